//! A drive without a ring: service channel, parameters and motion side, on a bench where nothing moves.

use std::boxed::Box;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::vec::Vec;

use heapless::String;
use rtic_core::Exclusive;
use sercon816::{BitRate, Bus, MasterClock, RamAddress, Register, Slave, Transceiver};
use sercos::data_block::DataBlock;
use sercos::parameters::Parameters;
use sercos::service::Live;
use sercos::service::{ReadPosition, Reply, Server, Step};
use sercos::transition::{self, Invalid};
use sercos::{Idn, Phase, PhaseMachine};

use servo::current::{CurrentSensing, PwmFrequency};
use servo::monitor::{Divider, TemperatureSensor, Thermometers};
use servo::motor::{BoardKind, CurrentLink, Facts};

use super::access::Access;
use super::commissioning::Commissioning;
use super::context::{Checks, Context};
use super::rescaling::Rescaling;
use super::{checks, loops};
use crate::amplifier::Amplifier;
use crate::crash::LastCrash;
use crate::diagnosis::error_memory::ErrorMemory;
use crate::dictionary::{DICTIONARY, parameters_on};
use crate::hardware::{Hardware, Inputs, InterruptLine, ProbeInput, ResetCause};
use crate::identity::DriveAddress;
use crate::identity::Identity;
use crate::motion::Motion;
use crate::production::Production;
use crate::remembering::keeping::Keeping;
use crate::remembering::set;

/// Registers and RAM that keep what is written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory(Rc<RefCell<BTreeMap<(bool, u16), u16>>>);

impl Bus for Memory {
    fn read_register(&mut self, register: Register) -> u16 {
        self.0.borrow().get(&(true, register.word())).copied().unwrap_or(0)
    }

    fn write_register(&mut self, register: Register, value: u16) {
        self.0.borrow_mut().insert((true, register.word()), value);
    }

    fn read_ram(&mut self, address: RamAddress) -> u16 {
        self.0.borrow().get(&(false, address.word())).copied().unwrap_or(0)
    }

    fn write_ram(&mut self, address: RamAddress, value: u16) {
        self.0.borrow_mut().insert((false, address.word()), value);
    }
}

/// A motor side where nothing moves.
#[derive(Debug)]
pub(crate) struct Still;

/// Of both temperature inputs.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

impl BoardKind for Still {
    const FACTS: Facts = Facts {
        frequency: PwmFrequency::Khz16,
        dead_time: 1_000,
        current_sensing: CurrentSensing::InLine,
        loop_timer_counts: 10_500,
        sample_to_count: 2_200,
        encoder_rate: 18_600_000,
        thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
    };
}

/// Of the board on which nothing moves, for all tests of this crate.
pub(crate) const FACTS: Facts = Still::FACTS;

/// 20 A, 500 V.
pub(crate) const AMPLIFIER: Amplifier = Amplifier {
    peak_current: 14_142,
    continuous_current: 7_071,
    trip_current: 17_677,
    current_range: 25_000,
    dead_time_band: 200,
    bus_range: 500,
    undervoltage: 150,
    overvoltage: 440,
    withstand_voltage: 600,
    least_resistance: 220,
    warning_temperature: 800,
    shutdown_temperature: 900,
    thermal_time_constant: 5_000,
};

/// The defaults, with the ratings of this amplifier.
pub(crate) fn parameters() -> Parameters {
    parameters_on(&AMPLIFIER, &FACTS)
}

impl Hardware for Still {
    type Board = Self;

    const AMPLIFIER: Amplifier = AMPLIFIER;

    fn encoder_count(&mut self) -> u32 {
        0
    }

    fn encoder_latch(&mut self, _: InterruptLine) -> u32 {
        0
    }

    fn edge_phase(&mut self, _: InterruptLine) -> u16 {
        0
    }

    fn edge_waits(&mut self, _: InterruptLine) -> bool {
        false
    }

    fn phase_now(&mut self) -> u16 {
        0
    }

    fn inputs(&mut self) -> Inputs {
        Inputs { main_power: true, bridge_ready: true, safe_torque_1: true, safe_torque_2: true, ..Inputs::default() }
    }

    fn set_bridge(&mut self, _: bool) {}

    fn bridge_is_on(&mut self) -> bool {
        false
    }

    fn reset_bridge(&mut self) {}

    fn set_brake(&mut self, _: bool) {}

    fn arm_index(&mut self) {}

    fn index_latch(&mut self) -> Option<u32> {
        None
    }

    fn arm_probe(&mut self, _: ProbeInput) {}

    fn probe_latch(&mut self, _: ProbeInput, _: bool) -> Option<u32> {
        None
    }

    fn reset_cause(&self) -> ResetCause {
        ResetCause::PowerOn
    }
}

/// What a service step works with.
pub(super) type StepContext<'a> = Context<'a, Memory, Exclusive<'a, Motion<Memory, Still>>>;

/// The drive, and the master's side of its service channel.
pub(crate) struct Rig {
    pub(super) parameters: Parameters,
    pub(crate) motion: Motion<Memory, Still>,
    pub(super) checks: Checks,
    server: Server,
    slave: Slave<Memory>,
    phases: PhaseMachine,
    commissioning: Commissioning,
    rescaling: Rescaling,
    pub(super) identity: Identity,
    access: Access,
    errors: ErrorMemory,
    pub(super) keeping: Keeping,
    /// P-0-0012.
    pub(super) crash: Option<LastCrash>,
}

impl Rig {
    /// A fresh drive in CP2.
    pub(super) fn new() -> Self {
        let bus = Memory::default();
        let identity = Identity {
            address: DriveAddress::new(5).unwrap(),
            bit_rate: BitRate::Mbit2,
            master_clock: MasterClock::Mhz32,
            transceiver: Transceiver::STANDARD,
            production: Production::Blank,
        };
        let parameters = set::told(&parameters());
        let settings = loops::settings::<Still>(&parameters).unwrap();
        let link = Box::leak(Box::new(CurrentLink::new()));
        let scope = Box::leak(Box::new(servo::scope::Scope::new()));
        let mut rig = Self {
            motion: Motion::new(bus.clone(), 5, Still, link, scope, &settings),
            checks: Checks::default(),
            server: Server::new(&DICTIONARY),
            slave: Slave::new(bus),
            phases: PhaseMachine::new(),
            commissioning: Commissioning::default(),
            rescaling: Rescaling::new(&parameters),
            identity,
            access: Access::default(),
            errors: ErrorMemory::new(),
            keeping: Keeping::with_memory(),
            crash: None,
            parameters,
        };
        for phase in [0, 1, 2] {
            rig.enter(phase);
        }
        rig
    }

    /// A drive with these parameters beside its defaults, in CP3 behind S-0-0127.
    pub(super) fn in_cp3(others: &[(Idn, &[u16])]) -> Self {
        let mut rig = Self::new();
        for (number, value) in [(2, 2_000), (6, 200), (89, 1_000), (8, 1_500), (7, 1_800), (9, 1), (10, 8)] {
            rig.write(Idn::standard(number), &[value]).unwrap();
        }
        for &(idn, words) in others {
            rig.write(idn, words).unwrap();
        }
        rig.write(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
        assert_eq!(rig.checks.finding, None);
        rig.enter(3);
        rig
    }

    /// Like [`Rig::in_cp3`], in CP4.
    pub(crate) fn in_cp4(others: &[(Idn, &[u16])]) -> Self {
        let mut rig = Self::in_cp3(others);
        rig.pass_check_for_cp4();
        rig.enter(4);
        rig
    }

    /// What S-0-0128 does once the loops have locked to the ring, which is not there.
    pub(super) fn pass_check_for_cp4(&mut self) {
        let capabilities = checks::capabilities(self.identity.bit_rate, &self.parameters);
        let cyclic = self.checks.cyclic.as_ref().unwrap();
        let ready = transition::check_cp4(&self.parameters, &capabilities, cyclic, true).unwrap();
        self.phases.permit_cp4(ready);
        self.motion.apply_settings(&loops::settings::<Still>(&self.parameters).unwrap());
    }

    pub(super) fn is_in_cp4(&self) -> bool {
        self.phases.current() == Phase::Cp4
    }

    /// What S-0-0128 finds in the parameters.
    pub(super) fn check_for_cp4(&self) -> Result<(), Vec<Invalid>> {
        let capabilities = checks::capabilities(self.identity.bit_rate, &self.parameters);
        let checked =
            transition::check_cp4(&self.parameters, &capabilities, self.checks.cyclic.as_ref().unwrap(), true);
        checked.map(|_| ()).map_err(|invalid| invalid.findings().to_vec())
    }

    fn enter(&mut self, phase: u8) {
        self.phases.received(phase).unwrap();
        self.server.phase_changed(self.phases.current());
        self.motion.enter_phase(self.phases.current());
    }

    /// The drive as a step finds it, and what is done after the step.
    pub(super) fn step<R>(&mut self, act: impl FnOnce(&mut Server, &mut Parameters, &mut StepContext<'_>) -> R) -> R {
        let mut motion = Exclusive(&mut self.motion);
        let mut context = Context {
            motion: &mut motion,
            slave: &mut self.slave,
            phases: &mut self.phases,
            checks: &mut self.checks,
            commissioning: &mut self.commissioning,
            rescaling: &mut self.rescaling,
            identity: &self.identity,
            access: &mut self.access,
            errors: &self.errors,
            keeping: &mut self.keeping,
            total_seconds: 0,
            last_position: None,
            crash: self.crash.as_ref(),
            settings_changed: false,
        };
        let result = act(&mut self.server, &mut self.parameters, &mut context);
        if let Some((idn, state)) = context.carry_out(&mut self.parameters) {
            self.server.command_progress(idn, state);
        }
        context.settle(&mut self.parameters);
        result
    }

    /// Opens a data block and writes its operation data.
    pub(super) fn write(&mut self, idn: Idn, words: &[u16]) -> Result<(), u16> {
        let open = [(1, idn.0)].into_iter();
        let data = words.iter().map(|&word| (7, word));
        for (index, (element, info)) in open.chain(data).enumerate() {
            let end = index == 0 || index == words.len();
            let step = Step { element, write: true, end, info, new_transfer: false, position: ReadPosition::Within };
            let reply = self.step(|server, parameters, context| server.step(step, parameters, context));
            if let Reply::Error(error) = reply {
                return Err(error.code());
            }
        }
        Ok(())
    }

    /// P-0-0003.
    pub(super) fn finding(&mut self) -> std::string::String {
        self.text(Idn::product(3))
    }

    /// A text of the drive's own.
    pub(super) fn text(&mut self, idn: Idn) -> std::string::String {
        self.step(|_, parameters, context| {
            let mut text = String::new();
            match context.read_text(DICTIONARY.find(idn).unwrap(), parameters, &mut text) {
                Some(text) => text.into(),
                None => text.as_str().into(),
            }
        })
    }
}

/// A value as it is written.
pub(super) fn words_of(block: &DataBlock, value: u64) -> Vec<u16> {
    let words = block.fixed_bytes().unwrap_or(2) / 2;
    (0..words).map(|word| (value >> (16 * word)) as u16).collect()
}
