//! One cycle of CP4, from a drive that runs on a ring: what is on the fibre, and which task runs when.

use super::is_on_the_page;
use bench::{DriveSetup, parameters_of, ring_of_drives};
use plant::ReferenceAxis;
use ring::ident::Idn;
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::service_client::Request;
use ring::wire::{BitRate, LineError};
use ring::{Nanoseconds, RingConfiguration, Tap};
use std::cell::RefCell;
use std::fmt::Write as _;
use std::rc::Rc;

const ADDRESS: u8 = 5;
const CYCLE_MICROSECONDS: u16 = 1_000;
const STEP: Nanoseconds = Nanoseconds::from_millis(1);

/// Something that happens in the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    MstEnds,
    MdtBegins,
    MdtEnds,
    AtBegins,
    Task(&'static str),
}

/// An ear at the drive.
#[derive(Default)]
struct Ear(Vec<(Nanoseconds, Event)>);

impl Tap for Ear {
    fn arrived(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        match frame {
            Ok([0xFF, _]) => self.0.push((end, Event::MstEnds)),
            Ok([0xFF, ..]) => self.0.extend([(start, Event::MdtBegins), (end, Event::MdtEnds)]),
            _ => {}
        }
    }

    fn sent(&mut self, now: Nanoseconds, _bytes: &[u8]) {
        self.0.push((now, Event::AtBegins));
    }
}

/// The events of one cycle with a step of the service channel in it, ns after the end of its MST.
fn cycle() -> Vec<(u64, Event)> {
    let telegram = Telegram::application(&[Idn(51), Idn(40)], &[Idn::POSITION_COMMAND]);
    let drive = DriveScript::new(ADDRESS, telegram)
        .with(Idn::OPERATION_MODE, ring::ident::Value::Word(11))
        .with_all(parameters_of(&ReferenceAxis::press()));
    let mut motion = Motion::new(u64::from(u32::MAX), |point| {
        CommandValues::at_position(point.start.wrapping_add(point.cycle.min(1_000_000) as i32 * 1_000))
    });
    motion.patience = 4_000;
    let script = MasterScript {
        bit_rate: BitRate::M4,
        cycle: CYCLE_MICROSECONDS,
        motion: Some(motion),
        stops_at_refusals: false,
        ..MasterScript::new(vec![drive])
    };
    let configuration = RingConfiguration::new(1, BitRate::M4);
    let setup = DriveSetup::new(ADDRESS);
    let (mut world, drives) = ring_of_drives(configuration, ScriptedMaster::new(script), &[setup]).unwrap();
    let in_operation = |master: &ScriptedMaster| {
        master.report().samples.last().and_then(|sample| sample.status).is_some_and(|status| status >> 14 == 3)
    };
    while !in_operation(world.ring().master()) {
        let now = world.now();
        assert!(now < Nanoseconds::from_millis(20_000), "{}", world.ring().master().state());
        world.run_until(now + STEP).unwrap();
    }
    let ear = Rc::new(RefCell::new(Ear::default()));
    world.ring_mut().tap(0, ear.clone());
    drives[0].measurements.borrow_mut().tasks = Some(Vec::new());
    world.ring_mut().master_mut().service(0).request(Request::Read(Idn(30)));
    let now = world.now();
    world.run_until(now + Nanoseconds::from_millis(40)).unwrap();
    let mut events = std::mem::take(&mut ear.borrow_mut().0);
    let tasks = drives[0].measurements.borrow_mut().tasks.take().unwrap();
    events.extend(tasks.into_iter().map(|(time, name)| (time, Event::Task(name))));
    events.sort_by_key(|(time, _)| *time);
    let begins: Vec<_> = events.iter().enumerate().filter(|(_, (_, event))| *event == Event::MstEnds).collect();
    let cycle = begins
        .windows(2)
        .map(|pair| &events[pair[0].0..pair[1].0])
        .find(|cycle| cycle.iter().any(|(_, event)| *event == Event::Task("service_channel")));
    let cycle = cycle.expect("a text takes more than one step");
    cycle.iter().map(|(time, event)| (time.0 - cycle[0].0.0, *event)).collect()
}

fn generated(cycle: &[(u64, Event)]) -> String {
    let mut picture = String::from(
        "```mermaid\nsequenceDiagram\n    participant M as Master\n    participant C as SERCON816\n    participant I as chip interrupts\n    participant T as tasks of the cycle\n    participant L as loops\n    participant S as service_channel\n",
    );
    let microseconds = |time: u64| format!("{}.{} us", time / 1_000, time % 1_000 / 100);
    for (index, (time, event)) in cycle.iter().enumerate() {
        let at = microseconds(*time);
        let line = match event {
            Event::MstEnds => format!("M->>C: {at} MST ends, the zero of the cycle"),
            Event::AtBegins => format!("C->>M: {at} t1, AT"),
            Event::MdtBegins => format!("M->>C: {at} t2, MDT begins"),
            Event::MdtEnds => format!("M->>C: {at} MDT ends"),
            Event::Task(task @ ("chip_interrupt_0" | "chip_interrupt_1")) => {
                // What it has found is what it starts, up to the next of its kind.
                let found =
                    cycle[index + 1..].iter().take_while(|(then, _)| then == time).map_while(
                        |(_, event)| match event {
                            Event::Task("INT_SC") => Some(", INT_SC"),
                            Event::Task("command_valid") => Some(", timer of t3"),
                            Event::Task("capture_feedback") => Some(", timer of t4"),
                            _ => None,
                        },
                    );
                format!("C->>I: {at} {task}{}", found.collect::<String>())
            }
            Event::Task("command_valid") => format!("I->>T: {at} t3, command_valid: the MDT record comes into force"),
            Event::Task("capture_feedback") => {
                format!("I->>T: {at} t4, capture_feedback: the latched position goes into the AT")
            }
            Event::Task("supervision") => format!("L->>T: {at} supervision"),
            Event::Task("service_channel") => format!("I->>S: {at} service_channel, and releases the container"),
            Event::Task("control_loop") => format!("L->>L: {at} control_loop"),
            // Two of them, and one, in every loop tick: they would hide the rest.
            Event::Task("current_loop" | "velocity_loop" | "INT_SC") => continue,
            Event::Task(other) => panic!("{other} in a cycle of CP4"),
        };
        writeln!(picture, "    {line}").unwrap();
    }
    let count = |name| cycle.iter().filter(|(_, event)| *event == Event::Task(name)).count();
    writeln!(
        picture,
        "```\n\nIn this cycle of {CYCLE_MICROSECONDS} us the current loop ran {} times, the control loop {} times, the velocity loop in between {} times, the supervision {} times.",
        count("current_loop"),
        count("control_loop"),
        count("velocity_loop"),
        count("supervision")
    )
    .unwrap();
    picture
}

#[test]
fn one_cycle_is_drawn_as_the_drive_went_through_it() {
    let cycle = cycle();
    println!("{cycle:?}");
    let count = |wanted| cycle.iter().filter(|(_, event)| *event == wanted).count();
    for event in [
        Event::MdtBegins,
        Event::MdtEnds,
        Event::AtBegins,
        Event::Task("command_valid"),
        Event::Task("capture_feedback"),
    ] {
        assert_eq!(count(event), 1, "{event:?}");
    }
    assert_eq!(count(Event::Task("control_loop")), 8);
    assert_eq!(count(Event::Task("velocity_loop")), 8);
    is_on_the_page("one cycle", &generated(&cycle));
}
