//! The flashed ELF boots in QEMU and sets the board up as it must.

use crate::quiet::{Chip, Quiet};
use emulator::{EmulatorError, Guest, GuestConfiguration, Probe, Trigger, audit, audit_power_stage};
use ring::Nanoseconds;

fn configuration() -> GuestConfiguration {
    let elf = |name: &str| {
        std::env::var_os(name)
            .unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`, which builds the ELF"))
    };
    GuestConfiguration::new(elf("PRODUCT_ELF"), elf("BUS_PLUGIN"))
}

fn run(guest: &mut Guest, world: &mut Quiet, until: Nanoseconds) -> Result<(), EmulatorError> {
    while let Some(now) = guest.next_event().filter(|now| *now < until) {
        guest.run(world, now, until)?;
    }
    Ok(())
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_release_elf_sets_the_board_up() {
    let mut world = Quiet::new();
    let mut guest = Guest::start(&configuration()).unwrap();
    let outcome = run(&mut guest, &mut world, Nanoseconds::from_millis(50));
    for line in guest.take_log() {
        println!("{} {} {}", line.time, line.level, line.text);
    }
    outcome.unwrap();
    println!("{:?}", guest.measurements());
    let mut findings = audit(&mut guest).unwrap();
    findings.extend(audit_power_stage(&guest));
    let report: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert!(report.is_empty(), "{}", report.join("\n"));
    assert!(!world.bridge, "the bridge must stay off without a master");
    assert!(!world.brake, "the brake must hold without a master");
    let periods: Vec<u64> = world.samples.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    assert!(periods.len() > 500, "only {} periods", periods.len());
    assert!(periods.iter().all(|period| period.abs_diff(62_500) <= 2), "{periods:?}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_chip_starts_with_the_straps_of_the_switches_after_a_reset_and_is_waited_for() {
    for (bit_rate, straps) in [(0, (true, true)), (1, (false, true)), (2, (true, false)), (3, (false, false))] {
        let mut world = Quiet { bit_rate, ..Quiet::new() };
        let mut guest = Guest::start(&configuration()).unwrap();
        run(&mut guest, &mut world, Nanoseconds::from_millis(35)).unwrap();
        let events = &world.chip;
        println!("{bit_rate}: {events:?}");
        let at = |wanted: Chip| events.iter().find(|(_, seen)| *seen == wanted).map(|(time, _)| time.0);
        let last = |of: fn(&Chip) -> bool| events.iter().rev().find(|(_, seen)| of(seen)).unwrap();
        assert_eq!(last(|seen| matches!(seen, Chip::Straps(..))).1, Chip::Straps(straps.0, straps.1), "{bit_rate}");
        assert_eq!(last(|seen| matches!(seen, Chip::Reset(_))).1, Chip::Reset(false), "{bit_rate}");
        // The reset is held from the supply on, by its pull-down; the straps move when the pins are set up, and the switches begin to be pulled.
        let held = events.iter().find(|(_, seen)| matches!(seen, Chip::Straps(..))).unwrap().0.0;
        assert!(at(Chip::Reset(true)).unwrap() <= held, "{bit_rate}: not in reset");
        let [released, accessed] = [Chip::Reset(false), Chip::Accessed].map(|event| at(event).unwrap());
        // The pull-ups of the switches take 100 us, the reset 10 us, the start of the chip 1 ms: so much at least. A turn of the delay's loop
        // counts three times as long here as its least on the part; and 1.4 ms pass for the rest of the set-up. Looking for
        // what was saved takes 2 ms in between, while the chip repeats.
        assert!((110_000..400_000).contains(&(released - held)), "{bit_rate}: {} ns in reset", released - held);
        assert!((4_500_000..5_500_000).contains(&(accessed - released)), "{bit_rate}: {} ns", accessed - released);
        if straps != (true, true) {
            let strapped = last(|seen| matches!(seen, Chip::Straps(..))).0.0;
            assert!((100_000..350_000).contains(&(strapped - held)), "{bit_rate}: switches read too early");
            assert!((10_000..35_000).contains(&(released - strapped)), "{bit_rate}: {} ns", released - strapped);
        }
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_station_whose_switches_show_no_drive_address_leaves_the_chip_alone() {
    for address in [0, 255, 1, 254] {
        let mut world = Quiet { address, ..Quiet::new() };
        let mut guest = Guest::start(&configuration()).unwrap();
        run(&mut guest, &mut world, Nanoseconds::from_millis(35)).unwrap();
        let accessed = world.chip.iter().any(|(_, seen)| *seen == Chip::Accessed);
        assert_eq!(accessed, (1..=254).contains(&address), "{address}");
        let released = world.chip.iter().any(|(_, seen)| *seen == Chip::Reset(false));
        assert!(released, "it repeats what it receives");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn two_runs_are_the_same_to_the_nanosecond() {
    let trace = || {
        let mut world = Quiet::new();
        let mut guest = Guest::start(&configuration()).unwrap();
        let mut times = Vec::new();
        while let Some(now) = guest.next_event().filter(|now| *now < Nanoseconds::from_millis(40)) {
            times.push(now);
            guest.run(&mut world, now, Nanoseconds::from_millis(40)).unwrap();
        }
        (times, guest.measurements().clone())
    };
    let (first, second) = (trace(), trace());
    assert_eq!(first.1, second.1);
    assert!(first.0 == second.0, "the times of the exchanges differ");
    assert!(first.0.len() > 100, "only {} exchanges", first.0.len());
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn an_edge_of_either_interrupt_pin_is_answered_within_microseconds() {
    const STATUS_REGISTER_4: u32 = 0x6000_1000 + 2 * 4;
    let mut world = Quiet::new();
    let mut guest = Guest::start(&configuration()).unwrap();
    guest.add_probe(Probe::new("INT0", Trigger::Int0Edge, Trigger::Read(STATUS_REGISTER_4)));
    guest.add_probe(Probe::new("INT1", Trigger::Int1Edge, Trigger::Read(STATUS_REGISTER_4)));
    run(&mut guest, &mut world, Nanoseconds::from_millis(40)).unwrap();
    // Off the beat of the loop timer, so that some edges meet the control loop at work.
    for edge in 0..40_u64 {
        let now = Nanoseconds::from_millis(41) + Nanoseconds(edge * 531_700);
        run(&mut guest, &mut world, now).unwrap();
        if edge % 4 < 2 {
            world.pins.0 = !world.pins.0;
        } else {
            world.pins.1 = !world.pins.1;
        }
        guest.run(&mut world, now, now).unwrap();
    }
    run(&mut guest, &mut world, Nanoseconds::from_millis(63)).unwrap();
    for probe in &guest.measurements().probes {
        println!("{}: {:?}", probe.name, probe.latency);
        assert_eq!(probe.latency.count, 20, "{}: an edge was lost", probe.name);
        let longest = probe.latency.longest;
        assert!(longest < Nanoseconds::from_microseconds(20), "{} took {longest}", probe.name);
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_missing_qemu_is_one_clear_line() {
    let mut configuration = configuration();
    configuration.qemu = "qemu-system-that-is-not-there".into();
    let error = Guest::start(&configuration).unwrap_err();
    assert!(matches!(error, EmulatorError::QemuMissing), "{error}");
    let text = error.to_string();
    assert!(text.contains("install") && !text.contains('\n'));
}

#[test]
fn a_file_that_is_no_firmware_is_refused_before_qemu_starts() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("firmware");
    std::fs::write(&file, "no ELF").unwrap();
    let error = Guest::start(&GuestConfiguration::new(&file, &file)).unwrap_err();
    assert!(matches!(error, EmulatorError::Elf { .. }), "{error}");
}
