//! A machine whose control writes eleven blocks of communication and nothing of the axis: the recorded one. The drive was told its axis once, by somebody else, and
//! has saved it; the supply is cut, and the recorded run-up brings it back with motor, brake, scaling and mode.
//!
//! No recording goes on after CP4. The commands of velocity that follow here are put behind it, in the form of its last MDT.

use std::f64::consts::TAU;

use bench::{DriveSetup, Executor, parameters_of, product, ring_of_drives_on};
use flash::FlashModel;
use plant::ReferenceAxis;
use ring::capture::{RecordedCycle, Recording};
use ring::ident::{Idn, Value};
use ring::master::{DriveScript, MasterScript, Telegram};
use ring::player::CapturePlayer;
use ring::ring::Sender;
use ring::service_client::control;
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

use crate::common::recordings;
use crate::elf::on_qemu;
use crate::kept::{command, flash_of, run_up};
use crate::running::Bench;

const SAVE: u16 = 264;
/// The one of the recorded four that remembers.
const ADDRESS: u8 = 1;
/// S-0-0009 of it in every recording.
const RECORD: usize = 1;
/// The first secondary mode: bit 8 of the control word.
const SECONDARY: u16 = 1 << 8;
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT | SECONDARY;
/// Turns of the motor for two of the load, which moves 10 mm with each: a turn of the motor is 66 667 of 0.1 um.
const GEAR: (u32, u32) = (3, 2);
const FEED: f64 = 100_000.0;
const OF_A_TURN: f64 = FEED * 2.0 / 3.0;
/// 0.001 mm/min, at the load: 1 000 mm/min are 150 rpm.
const VELOCITY: i32 = 1_000_000;
const RPM: f64 = 150.0;
/// Cycles of 2 ms without torque, and with it.
const OFF: usize = 20;
const ON: usize = 1_400;

/// A ball screw with a brake and a counterweight, so that it may look for its commutation angle with the brake open.
fn axis() -> ReferenceAxis {
    let mut axis = ReferenceAxis::vertical();
    axis.machine.mechanics.gravity_torque = 0.0;
    axis
}

/// What is told once. None of it is a default: motor, brake, linear data of a load behind a gear, velocity as a secondary mode.
fn told() -> Vec<(Idn, Value)> {
    const LINEAR_OF_LOAD: u16 = 0x41;
    let scaling = [76, 44].map(|idn| (Idn(idn), Value::Word(LINEAR_OF_LOAD)));
    let more = [
        (Idn(121), Value::Long(GEAR.0)),
        (Idn(122), Value::Long(GEAR.1)),
        (Idn(123), Value::Long(FEED as u32)),
        (Idn(32), Value::Word(0x13)),
        (Idn(33), Value::Word(2)),
        // Ten times the friction; half of the peak current moves this motor too far.
        (product(116), Value::Word(170)),
        (product(120), Value::Word(7)),
        (Idn(206), Value::Word(60)),
        (Idn(207), Value::Word(60)),
    ];
    scaling.into_iter().chain(parameters_of(&axis())).chain(more).collect()
}

/// What it has saved.
fn saved(executor: Executor) -> FlashModel {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with_all(told());
    let script = MasterScript { reset_diagnostics: false, ..MasterScript::new(vec![drive]) };
    let setup = DriveSetup { axis: axis(), flash: FlashModel::new(), ..DriveSetup::new(ADDRESS) };
    let mut bench = run_up(Bench::on(executor, setup, script));
    assert_eq!(command(&mut bench, SAVE), Ok(3));
    flash_of(&bench)
}

/// The recording, and commands of velocity behind it: off, on, and at this velocity once there was time to look for the angle and to open the brake.
fn with_velocity(mut recording: Recording) -> Recording {
    let in_cp4 = recording.cycles.iter().rev().filter(|cycle| cycle.phase == 4);
    let pattern = in_cp4.filter_map(|cycle| cycle.mdt.clone()).next().expect("CP4 has MDTs");
    let cycle = |bits: u16, velocity: i32| {
        let mut mdt = pattern.clone();
        let service = u16::from_le_bytes([mdt[RECORD], mdt[RECORD + 1]]) & control::SERVICE;
        mdt[RECORD..RECORD + 2].copy_from_slice(&(service | bits).to_le_bytes());
        mdt[RECORD + 4..RECORD + 8].copy_from_slice(&velocity.to_le_bytes());
        RecordedCycle { phase: 4, mdt: Some(mdt) }
    };
    recording.cycles.extend((0..OFF).map(|_| cycle(SECONDARY, 0)));
    recording.cycles.extend((0..ON).map(|step| cycle(FOLLOW, if step < ON / 2 { 0 } else { VELOCITY })));
    recording
}

fn follows_the_recorded_master(executor: &Executor) {
    let flash = saved(executor.clone());
    // One of them is enough: the real one, where there is one.
    let (known, recording) = recordings().pop().unwrap();
    let addresses = CapturePlayer::addresses(&recording);
    let recording = with_velocity(recording);
    let cycles = recording.cycles.len() as u64;
    let setups: Vec<DriveSetup> = addresses
        .iter()
        .map(|&address| match address {
            ADDRESS => DriveSetup { axis: axis(), flash: flash.clone(), ..DriveSetup::new(address) },
            _ => DriveSetup::new(address),
        })
        .collect();
    let place = addresses.iter().position(|address| *address == ADDRESS).unwrap();
    let player = CapturePlayer::new(recording, BitRate::M2).unwrap();
    let configuration = RingConfiguration { trace: true, ..RingConfiguration::new(setups.len(), BitRate::M2) };
    let (mut world, handles) = ring_of_drives_on(configuration, player, &setups, |address| {
        if address == ADDRESS { executor.clone() } else { Executor::Host }
    })
    .unwrap();
    let motor = handles[place].motor_side.clone();
    let mut opened = None;
    while world.ring().master().progress().0 < cycles {
        world.run_until(world.now() + Nanoseconds::from_millis(1)).unwrap();
        let now = world.ring().master().progress().0;
        if opened.is_none() && motor.borrow().brake_is_open() {
            opened = Some(now);
        }
    }
    // Its whole run-up as recorded, and nothing of the axis in it.
    let now = world.now().0;
    let (rpm, turns) = {
        let mut motor = motor.borrow_mut();
        (motor.machine().velocity(now) * 60.0 / TAU, motor.machine().angle(now))
    };
    let opened = opened.expect("the brake has opened");
    println!("brake opened {} ms after the switching on, {rpm:.2} rpm", (opened + ON as u64 - cycles) * 2);
    assert!(opened > cycles - ON as u64, "not before it was switched on");
    assert!((rpm - RPM).abs() < RPM * 0.01, "{rpm} rpm");
    // S-0-0011, S-0-0051, P-0-0019 behind status and info.
    let at = world.ring().trace().iter().rev().find(|entry| entry.sender == Sender::Station(place)).unwrap();
    let position = i32::from_le_bytes(at.bytes[7..11].try_into().unwrap());
    let expected = turns * OF_A_TURN;
    println!("S-0-0051 = {position}, the shaft has turned {turns:.3} times: {expected:.0}");
    assert!((f64::from(position) - expected).abs() < OF_A_TURN * 0.03 && expected > OF_A_TURN, "{position}");

    while !world.ring().master().is_done() {
        world.run_until(world.now() + Nanoseconds::from_millis(1)).unwrap();
    }
    let report = world.ring().master().report();
    let drive = report.drives.iter().find(|drive| drive.address == ADDRESS).unwrap();
    assert!(drive.passed(), "{drive:#?}");
    assert_eq!(drive.written.len() as u64, known.written, "its own writes, the check commands with them");
    assert!(told().iter().all(|(idn, _)| !drive.written.contains_key(idn)), "nothing of the axis");
}

#[test]
fn behind_the_recorded_run_up_a_drive_that_remembers_opens_its_brake_and_follows_in_its_own_scaling() {
    follows_the_recorded_master(&Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn behind_the_recorded_run_up_the_elf_that_remembers_opens_its_brake_and_follows_in_its_own_scaling() {
    follows_the_recorded_master(&on_qemu());
}
