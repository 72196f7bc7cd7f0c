//! The property that matters: whatever has happened on the ring, ten clean cycles of CP0 and a proper run-up end in CP4,
//! S-0-0099 leaves no error behind, and the motor follows again (sercos2.md 2.1 to 2.4).
//!
//! A case that fails is printed with all its events, smaller than it was found, and its seed is kept in
//! `recovery.regressions` beside this file. That file belongs into the repository: its seeds are tried first in every run.
//! A seed goes when its events can no longer be made, not when it has passed. `PROPTEST_CASES` asks for more cases.

use bench::{Amplifier, DriveHandle, DriveSetup, World, parameters_of, ring_of_drives};
use drive::DICTIONARY;
use plant::ReferenceAxis;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use ring::fibre::{Effect, Fault, TelegramKind};
use ring::ident::{Element, Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, SlotChoice, Telegram};
use ring::service_client::{Reply, Request, Step};
use ring::slots::{MdtPlace, Slots};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};
use sercos::data_block::{DataBlock, Location, NeededFor};

/// Cases in a run without `PROPTEST_CASES`: some ten seconds.
const CASES: u32 = 150;
/// Enough to lose what does not belong to a failure, in a minute.
const SHRINKING_STEPS: u32 = 400;

/// In cycles; a master that waits longer calls the ring open.
const LONGEST_DARKNESS: u64 = 150;
/// Telegrams that are lost or damaged in a row: fewer than the MSTs that a master sends in CP0.
const LONGEST_BURST: u64 = 7;

/// From one t1 to the next, in us, where the slots are given: an AT of the longest telegram lasts 118 us.
const AT_DISTANCE: u16 = 300;

const ADDRESSES: [u8; 2] = [5, 9];
/// 300 rpm in 0.0001 rpm.
const VELOCITY: i32 = 3_000_000;
const INTERFACE: Idn = Idn(14);

/// One thing that goes wrong, and how many milliseconds pass until the next.
#[derive(Clone, Debug)]
struct Event {
    what: What,
    then: u16,
}

#[derive(Clone, Debug)]
enum What {
    /// Telegrams of one kind in so many cycles, on a hop.
    Telegrams { kind: TelegramKind, effect: Effect, cycles: u64, hop: usize },
    /// No light on a hop for so many cycles.
    Dark { cycles: u64, hop: usize },
    /// The master begins again, whatever it was doing, with a script that is proper but for some values.
    Restart { script: Script, garbage: Vec<(usize, u64)> },
    /// Requests and steps in the middle of whatever goes on with a drive.
    Service { drive: usize, requests: Vec<Request> },
    /// The status lines of a drive's amplifier.
    Amplifier { drive: usize, main_power: bool, fault: bool },
}

/// What the master does with a ring that it runs up.
#[derive(Clone, Debug)]
struct Script {
    cycle: u16,
    telegram: u16,
    /// t1 to t4 of every drive as they come, instead of what the drives ask for.
    slots: Option<[u16; 4]>,
    moves: bool,
}

/// The ring and its drives.
struct Bench {
    world: World<ScriptedMaster>,
    drives: Vec<DriveHandle>,
}

impl Bench {
    fn new(drives: usize) -> Self {
        let setups: Vec<_> = ADDRESSES[..drives].iter().map(|&address| DriveSetup::new(address)).collect();
        let configuration = RingConfiguration::new(drives, BitRate::M2);
        let master = ScriptedMaster::new(proper_script(drives));
        let (world, drives) = ring_of_drives(configuration, master, &setups).unwrap();
        Self { world, drives }
    }

    /// A broken law is a failed case and no panic: each step of the shrinking would write one, and bury what is left.
    fn run(&mut self, milliseconds: u64) -> Result<(), TestCaseError> {
        let until = self.world.now() + Nanoseconds::from_millis(milliseconds);
        self.world.run_until(until).map_err(|error| TestCaseError::fail(format!("{error:?}")))
    }

    fn happen(&mut self, event: &Event) -> Result<(), TestCaseError> {
        let from = self.world.ring().cycle().unwrap_or(0) + 2;
        match &event.what {
            What::Telegrams { kind, effect, cycles, hop } => {
                let hop = hop % (self.drives.len() + 1);
                for cycle in from..from + cycles {
                    self.world.ring_mut().add_fault(Fault::once(cycle, hop, *kind, *effect));
                }
            }
            What::Dark { cycles, hop } => {
                let hop = hop % (self.drives.len() + 1);
                self.world.ring_mut().add_fault(Fault::ring_break(from..from + cycles, hop));
            }
            What::Restart { script, garbage } => {
                let script = script.of_master(self.drives.len(), garbage);
                self.world.ring_mut().master_mut().restart(script);
            }
            What::Service { drive, requests } => {
                let client = self.world.ring_mut().master_mut().service(drive % self.drives.len());
                requests.iter().cloned().for_each(|request| client.request(request));
            }
            What::Amplifier { drive, main_power, fault } => {
                let drive = &self.drives[drive % self.drives.len()];
                let inputs = Amplifier { main_power: *main_power, fault: *fault };
                drive.motor_side.borrow_mut().set_amplifier_inputs(inputs);
            }
        }
        self.run(u64::from(event.then))
    }

    /// The amplifiers are sound again. Faults of telegrams may go on for a while: they end before the tenth clean MST of CP0.
    fn mend(&mut self) {
        for drive in &self.drives {
            drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: false });
        }
    }

    /// Ten cycles of CP0, a proper run-up with S-0-0099, and the motors turn.
    fn recover(&mut self) -> Result<(), TestCaseError> {
        self.world.ring_mut().master_mut().restart(proper_script(self.drives.len()));
        for _ in 0..1_000 {
            self.run(10)?;
            let master = self.world.ring().master();
            if let Some(error) = &master.report().error {
                return Err(TestCaseError::fail(format!("{error}, in {}", master.state())));
            }
            if self.turn() {
                return self.look_for_errors();
            }
        }
        Err(TestCaseError::fail(format!("the motors do not turn: {}", self.world.ring().master().state())))
    }

    fn turn(&mut self) -> bool {
        let now = self.world.now().0;
        let rpm =
            |drive: &DriveHandle| drive.motor_side.borrow_mut().machine().velocity(now) * 60.0 / core::f64::consts::TAU;
        self.world.ring().master().phase() == 4 && self.drives.iter().all(|drive| (299.0..301.0).contains(&rpm(drive)))
    }

    fn look_for_errors(&mut self) -> Result<(), TestCaseError> {
        let read = [(INTERFACE, 4), (Idn::CLASS_1_DIAGNOSTIC, 0)];
        for drive in 0..self.drives.len() {
            for (idn, _) in read {
                self.world.ring_mut().master_mut().service(drive).request(Request::Read(idn));
            }
        }
        self.run(100)?;
        let report = self.world.ring().master().report();
        prop_assert_eq!(&report.error, &None);
        for record in &report.drives {
            for (idn, expected) in read {
                let service = record.services.iter().rev().find(|service| service.request == Request::Read(idn));
                let result = service.map(|service| &service.result);
                let Some(Ok(Reply::Data { value, .. })) = result else {
                    return Err(TestCaseError::fail(format!("drive {}: {idn}: {result:?}", record.address)));
                };
                prop_assert_eq!(value.as_number(), Some(expected), "drive {}: {}", record.address, idn);
            }
        }
        Ok(())
    }
}

/// Every parameter as the table has it, then the press drive of the tests, turning for ever.
fn proper_script(drives: usize) -> MasterScript {
    Script { cycle: 2_000, telegram: 2, slots: None, moves: true }.of_master(drives, &[])
}

impl Script {
    /// The values of `garbage` are written last in CP2.
    fn of_master(&self, drives: usize, garbage: &[(usize, u64)]) -> MasterScript {
        let drives = ADDRESSES[..drives].iter().map(|&address| {
            let mut drive = DriveScript::new(address, Telegram::standard(self.telegram).unwrap());
            drive.parameters.extend(defaults());
            drive.parameters.extend(press_drive());
            if self.telegram >= 3 {
                drive.parameters.push((Idn::OPERATION_MODE, Value::Word(11)));
            }
            drive.parameters.extend(garbage.iter().map(|&(number, value)| garbage_value(number, value)));
            drive
        });
        let drives: Vec<_> = drives.collect();
        let slots = match self.slots {
            None => SlotChoice::Computed(MdtPlace::Late),
            Some([t1, t2, t3, t4]) => {
                let t1 = (0..).map(|drive| t1 + drive * AT_DISTANCE).take(drives.len()).collect();
                SlotChoice::Fixed(Slots { t1, t2, t3, t4 })
            }
        };
        let motion = self.moves.then(|| Motion::new(u64::MAX, |_| CommandValues::at_velocity(VELOCITY)));
        MasterScript { cycle: self.cycle, slots, motion, ..MasterScript::new(drives) }
    }
}

/// What a control restores of a drive before S-0-0127 (S-0-0192), and what S-0-0128 looks at besides.
fn defaults() -> impl Iterator<Item = (Idn, Value)> {
    let restored = |block: &&DataBlock| is_value(block) && (block.stored || block.needed_for == NeededFor::Cp4);
    DICTIONARY.blocks().iter().filter(restored).map(|block| (Idn(block.idn.0), value_of(block, block.default as u64)))
}

/// The motor of [`DriveSetup::new`], and loops that suit it.
fn press_drive() -> Vec<(Idn, Value)> {
    parameters_of(&ReferenceAxis::press())
}

/// A parameter of fixed length that a master can write in CP2.
fn is_value(block: &DataBlock) -> bool {
    block.location == Location::Parameter
        && block.fixed_bytes().is_some()
        && !block.attribute.is_protected_in(sercos::Phase::Cp2)
}

/// One of the parameters with a value that it may or may not take.
fn garbage_value(number: usize, value: u64) -> (Idn, Value) {
    let blocks: Vec<_> = DICTIONARY.blocks().iter().filter(|block| is_value(block)).collect();
    let block = blocks[number % blocks.len()];
    (Idn(block.idn.0), value_of(block, value))
}

fn value_of(block: &DataBlock, value: u64) -> Value {
    match block.fixed_bytes() {
        Some(2) => Value::Word(value as u16),
        Some(4) => Value::Long(value as u32),
        _ => Value::Quad(value),
    }
}

fn any_event() -> impl Strategy<Value = Event> {
    // Within a dialogue as often as after it; a run-up of these drives takes a second and a half.
    // Within ten milliseconds the next event meets the supervision while it makes up its mind.
    let then = prop_oneof![2 => 0u16..10, 1 => 0u16..400, 1 => 1_000u16..2_000];
    (any_what(), then).prop_map(|(what, then)| Event { what, then })
}

fn any_what() -> impl Strategy<Value = What> {
    prop_oneof![
        4 => any_telegrams(),
        1 => (1..LONGEST_DARKNESS, 0usize..3).prop_map(|(cycles, hop)| What::Dark { cycles, hop }),
        4 => any_restart(),
        3 => (0usize..2, prop::collection::vec(any_request(), 1..4))
            .prop_map(|(drive, requests)| What::Service { drive, requests }),
        2 => (0usize..2, any::<bool>(), any::<bool>())
            .prop_map(|(drive, main_power, fault)| What::Amplifier { drive, main_power, fault }),
    ]
}

fn any_telegrams() -> impl Strategy<Value = What> {
    let kind = prop_oneof![
        3 => Just(TelegramKind::Mst),
        3 => Just(TelegramKind::Mdt),
        1 => prop::sample::select(ADDRESSES.map(TelegramKind::At).to_vec()),
    ];
    let span = || (0u64..2_000).prop_map(Nanoseconds::from_microseconds);
    let effect = prop_oneof![
        3 => Just(Effect::Drop),
        1 => (0usize..200).prop_map(Effect::FlipBit),
        1 => span().prop_map(Effect::Delay),
        1 => span().prop_map(Effect::Duplicate),
        1 => prop_oneof![0u8..8, any::<u8>()].prop_map(Effect::Phase),
        1 => (0usize..20, any::<u8>()).prop_map(|(index, value)| Effect::Byte { index, value }),
    ];
    (kind, effect, prop_oneof![Just(2), 1..=LONGEST_BURST], 0usize..3)
        .prop_map(|(kind, effect, cycles, hop)| What::Telegrams { kind, effect, cycles, hop })
}

fn any_restart() -> impl Strategy<Value = What> {
    let slots = prop_oneof![
        2 => Just(None),
        1 => [0u16..1_000, 0u16..2_100, 0u16..2_100, 0u16..2_100].prop_map(Some),
        // Those of a cycle of 2 ms with t3 so late that the supervision is still at work when the next MST comes.
        2 => [20u16..200, 1_700u16..1_800, 1_960u16..2_000, 100u16..1_700].prop_map(Some),
    ];
    let script = (prop::sample::select(vec![2_000u16, 1_000, 4_000]), prop::sample::select(vec![2u16, 3, 4, 5]))
        .prop_flat_map(move |(cycle, telegram)| {
            (slots.clone(), any::<bool>()).prop_map(move |(slots, moves)| Script { cycle, telegram, slots, moves })
        });
    let value = prop_oneof![0u64..8, 0u64..70_000, any::<u64>()];
    (script, prop::collection::vec((0usize..256, value), 0..4))
        .prop_map(|(script, garbage)| What::Restart { script, garbage })
}

fn any_request() -> impl Strategy<Value = Request> {
    let value = prop_oneof![0u64..8, 0u64..70_000, any::<u64>()];
    prop_oneof![
        3 => prop::collection::vec(any_step(), 1..12).prop_map(Request::Steps),
        2 => prop::sample::select(vec![99u16, 127, 128]).prop_map(|idn| Request::Steps(started_and_left(Idn(idn)))),
        2 => (0usize..256, value).prop_map(|(number, value)| {
            let (idn, value) = garbage_value(number, value);
            Request::Write(idn, value)
        }),
        1 => any_idn().prop_map(Request::Read),
        1 => (prop::sample::select(vec![99u16, 127, 128]), 0u32..5)
            .prop_map(|(idn, polls)| Request::Command { idn: Idn(idn), polls }),
    ]
}

/// A command whose end nobody waits for.
fn started_and_left(idn: Idn) -> Vec<Step> {
    let start = Step { element: Element::Data, write: true, end: true, info: 3 };
    vec![Step::open(idn), start, Step::close(3)]
}

fn any_step() -> impl Strategy<Value = Step> {
    let element = prop_oneof![0u16..8, Just(7), Just(1)].prop_map(|number| Element::of_control(number << 3));
    let info = prop_oneof![any_idn().prop_map(|idn| idn.0), 0u16..8, any::<u16>()];
    (element, any::<bool>(), any::<bool>(), info).prop_map(|(element, write, end, info)| Step {
        element,
        write,
        end,
        info,
    })
}

/// Any data block but the password: a drive that is locked with garbage needs somebody who knows it, or its supply taken away.
fn any_idn() -> impl Strategy<Value = Idn> {
    let idns: Vec<_> =
        DICTIONARY.blocks().iter().map(|block| Idn(block.idn.0)).filter(|idn| *idn != Idn(267)).collect();
    prop::sample::select(idns)
}

fn configuration() -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
    ProptestConfig {
        cases: cases.unwrap_or(CASES),
        max_shrink_iters: SHRINKING_STEPS,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(configuration())]

    #[test]
    fn after_anything_ten_clean_cycles_and_a_run_up_end_in_cp4_without_an_error(
        drives in 1usize..=2,
        // From the first MST on as well as from a motor that turns.
        lead in prop_oneof![Just(0u64), 0u64..1_500, Just(3_000)],
        events in prop::collection::vec(any_event(), 1..8),
    ) {
        let mut bench = Bench::new(drives);
        bench.run(lead)?;
        for event in &events {
            bench.happen(event)?;
        }
        bench.mend();
        bench.recover()?;
    }
}
