//! A drive in QEMU, brought into a state, and what happens to it there.

use std::cell::RefCell;
use std::rc::Rc;

use bench::{DriveHandle, DriveSetup, Elves, QemuDrive, World, crashing_drive, product};
use emulator::{Functions, Incident, Mistake, Reset, What};
use plant::ReferenceAxis;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::service_client::{Reply, Request, control};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

const ADDRESS: u8 = 5;
/// 300 rpm in 0.0001 rpm.
const VELOCITY: i32 = 3_000_000;
/// The velocity comes so many cycles after the drive follows.
const STANDSTILL_CYCLES: u64 = 100;
/// Torque of the hanging load in Nm: 4 % of the motor's peak.
const GRAVITY: f64 = 1.0;
/// Bit 15 taken back.
const OFF: u16 = control::ENABLE | control::NO_HALT;

/// Which machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axis {
    /// The press axis: no brake, its commutation angle is searched for.
    Horizontal,
    /// A load that falls without torque and brake.
    Vertical,
}

/// State of the drive in which something happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    /// Started, in CP0.
    Off,
    /// The bridge has just been switched on.
    SwitchingOn,
    /// In operation, at velocity zero.
    Standstill,
    /// In operation at 300 rpm.
    AtSpeed,
    /// Bit 15 was taken back at speed.
    Stopping,
}

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// The program makes a mistake at the beginning of a function.
    Mistake(Mistake, &'static str),
    /// The idle task makes a mistake, of one instruction, where it waits for an interrupt.
    InIdle(Mistake),
    /// The crystal stops.
    CrystalFails,
    /// A reset from outside.
    Reset(Reset),
}

/// When what happened, from outside.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// The event itself: the handler's first instruction, or what came from outside.
    pub(crate) event: Nanoseconds,
    /// Handlers and resets.
    pub(crate) incidents: Vec<Incident>,
    /// From the event to the bridge off; `None`: it was off.
    pub(crate) bridge_off: Option<Nanoseconds>,
    /// From the event to the coil without current; `None`: it had none.
    pub(crate) brake_off: Option<Nanoseconds>,
    /// From the event to the reset of the processor, if there was one.
    pub(crate) reset: Option<Nanoseconds>,
}

pub(crate) struct Rig {
    pub(crate) world: World<ScriptedMaster>,
    pub(crate) drive: DriveHandle,
    pub(crate) qemu: Rc<RefCell<QemuDrive>>,
    pub(crate) functions: Functions,
    axis: Axis,
}

fn elves() -> Elves {
    let path = |name: &str| {
        let missing = "is not set: run `cargo xtask test`, which builds the ELF and runs the tests in QEMU";
        std::env::var_os(name).unwrap_or_else(|| panic!("{name} {missing}"))
    };
    Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN"))
}

fn motion() -> Motion {
    let mut motion = Motion::new(1_000_000, |point| {
        CommandValues::at_velocity(if point.cycle < STANDSTILL_CYCLES { 0 } else { VELOCITY })
    });
    motion.patience = 8_000;
    motion
}

/// After a reset a drive has started and fed its watchdog for the first time, which writes a line.
pub(crate) const STARTED_MS: u64 = 30;

impl Rig {
    /// A drive before its first instruction.
    pub(crate) fn new(axis: Axis) -> Self {
        // The motor of the drive's default parameters: little is written in CP2, so that the run-up is short.
        let mut machine = ReferenceAxis::catalogue();
        let pole_pairs = f64::from(machine.machine.windings.pole_pairs);
        let angle = (machine.machine.encoder.electrical_zero * pole_pairs).fract() * 36_000.0;
        let mut drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
            .with(Idn::OPERATION_MODE, Value::Word(2))
            // Known, so that it need not be searched for.
            .with(product(118), Value::Long(angle as u32));
        if axis == Axis::Vertical {
            machine.machine.mechanics.gravity_torque = -GRAVITY;
            machine.machine.brake = ReferenceAxis::vertical().machine.brake;
            // A brake, and a load that falls without it.
            drive = drive
                .with(product(120), Value::Word(3))
                .with(Idn(206), Value::Word(60))
                .with(Idn(207), Value::Word(60));
        }
        let script = MasterScript {
            bit_rate: BitRate::M4,
            start_up_cycle: Nanoseconds::from_millis(1),
            // A drive that starts with its master is in the ring after 13 ms.
            good_msts: 20,
            cycle: 500,
            idle_in_cp3: 20,
            motion: Some(motion()),
            stops_at_refusals: false,
            ..MasterScript::new(vec![drive])
        };
        let elves = elves();
        let functions = Functions::read(&elves.product).unwrap();
        let setup = DriveSetup { axis: machine, ..DriveSetup::new(ADDRESS) };
        let configuration = RingConfiguration::new(1, BitRate::M4);
        let (world, drive, qemu) = crashing_drive(configuration, ScriptedMaster::new(script), &setup, &elves).unwrap();
        Self { world, drive, qemu, functions, axis }
    }

    /// A drive in this state.
    pub(crate) fn in_state(axis: Axis, state: State) -> Self {
        let mut rig = Self::new(axis);
        rig.run_to(state);
        rig
    }

    /// Runs a drive up to this state.
    pub(crate) fn run_to(&mut self, state: State) {
        if state == State::Off {
            self.run_ms(STARTED_MS);
            return;
        }
        self.run_until("switched on", Self::has_torque);
        if self.axis == Axis::Vertical {
            self.run_until("opening its brake", |rig| rig.drive.motor_side.borrow().brake_is_open());
        }
        if state == State::SwitchingOn {
            return;
        }
        self.run_until("in operation", Self::is_in_operation);
        self.run_ms(20);
        if state == State::Standstill {
            return;
        }
        self.run_until("at speed", |rig| rig.rpm() > 295.0);
        if state == State::Stopping {
            self.world.ring_mut().master_mut().hold_switches(Some(OFF));
            self.run_until("stopping", |rig| rig.rpm() < 250.0);
        }
    }

    fn run_until(&mut self, what: &str, done: impl Fn(&mut Self) -> bool) {
        let limit = self.world.now() + Nanoseconds::from_millis(10_000);
        while !done(self) {
            assert!(self.world.now() < limit, "not {what}: {}", self.world.ring().master().state());
            self.run_ms(1);
        }
    }

    pub(crate) fn run_ms(&mut self, milliseconds: u64) {
        self.run(Nanoseconds::from_millis(milliseconds));
    }

    pub(crate) fn run(&mut self, span: Nanoseconds) {
        let until = self.world.now() + span;
        self.world.run_until(until).unwrap();
    }

    pub(crate) fn has_torque(&mut self) -> bool {
        self.drive.motor_side.borrow().bridge_is_on()
    }

    pub(crate) fn rpm(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().velocity(now) * 60.0 / core::f64::consts::TAU
    }

    fn is_in_operation(&mut self) -> bool {
        let samples = &self.world.ring().master().report().samples;
        samples.last().and_then(|sample| sample.status).is_some_and(|status| status & 0xC000 == 0xC000)
    }

    pub(crate) fn log(&self) -> Vec<String> {
        self.drive.measurements.borrow().log.clone()
    }

    /// It happens now; looks at what follows until the processor was reset, and a moment longer.
    /// `begun`: when it begins, where nothing but the same run with another mistake can tell.
    pub(crate) fn happen(&mut self, event: Event, begun: Option<Nanoseconds>) -> Seen {
        let now = self.world.now();
        let before = self.incidents().len();
        let had = (self.has_torque(), self.drive.motor_side.borrow().brake_is_open());
        {
            let qemu = &mut *self.qemu.borrow_mut();
            match event {
                Event::Mistake(mistake, function) => {
                    mistake.plant(&mut qemu.guest_mut(), &self.functions, function).unwrap();
                }
                Event::InIdle(mistake) => mistake.plant_in_idle(&mut qemu.guest_mut(), &self.functions).unwrap(),
                Event::CrystalFails => qemu.fail_crystal(now).unwrap(),
                Event::Reset(reset) => qemu.reset(now, reset).unwrap(),
            }
        }
        let is_reset = |incident: &Incident| matches!(incident.what, What::Reset(_));
        for _ in 0..250 {
            if self.incidents()[before..].iter().any(is_reset) {
                break;
            }
            self.run_ms(1);
        }
        let incidents = self.incidents()[before..].to_vec();
        let from_outside = matches!(event, Event::Reset(_) | Event::CrystalFails);
        let handler = incidents.iter().find(|incident| matches!(incident.what, What::Handler(_)));
        let at_handler = handler.filter(|_| !from_outside).map_or(now, |incident| incident.time);
        let event = begun.unwrap_or(at_handler);
        let since = |at: Nanoseconds| Nanoseconds(at.0.saturating_sub(event.0));
        let motor_side = self.drive.motor_side.borrow();
        let reset = incidents.iter().find(|incident| is_reset(incident)).map(|incident| since(incident.time));
        let bridge_off = had.0.then(|| since(motor_side.bridge_off_at().unwrap()));
        let brake_off = had.1.then(|| since(motor_side.brake_off_at().unwrap()));
        Seen { event, bridge_off, brake_off, reset, incidents }
    }

    /// The drive has started after a reset, and is without torque.
    #[track_caller]
    pub(crate) fn assert_started_again_without_torque(&mut self) {
        let motor_side = self.drive.motor_side.borrow();
        assert!(!motor_side.bridge_is_on() && !motor_side.brake_is_open());
        let lines = &self.drive.measurements.borrow().log;
        if self.qemu.borrow_mut().guest_mut().has_crystal() {
            let last =
                lines.iter().rev().find(|line| line.contains("started by") || line.contains("class 1 diagnostic"));
            assert!(last.is_some_and(|line| line.contains("class 1 diagnostic 0x0000")), "{lines:#?}");
        }
    }

    #[track_caller]
    pub(crate) fn assert_nothing_was_ever_on(&self) {
        let motor_side = self.drive.motor_side.borrow();
        assert!(!motor_side.bridge_is_on() && motor_side.bridge_off_at().is_none());
        assert!(!motor_side.brake_is_open() && motor_side.brake_off_at().is_none());
    }

    /// The master begins anew, in CP0, and runs its ring up without a motion.
    pub(crate) fn begin_again(&mut self) {
        let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with(Idn::OPERATION_MODE, Value::Word(2));
        let script = MasterScript {
            bit_rate: BitRate::M4,
            start_up_cycle: Nanoseconds::from_millis(1),
            cycle: 500,
            idle_in_cp3: 20,
            reset_diagnostics: false,
            ..MasterScript::new(vec![drive])
        };
        self.world.ring_mut().master_mut().restart(script);
    }

    /// The same, as far as CP4.
    pub(crate) fn run_up_again(&mut self) {
        self.begin_again();
        self.run_until("in CP4 again", |rig| {
            let master = rig.world.ring().master();
            assert_eq!(master.report().error, None);
            master.is_done()
        });
    }

    /// Asks for a data block, without waiting.
    pub(crate) fn request(&mut self, idn: u16) {
        self.world.ring_mut().master_mut().service(0).request(Request::Read(Idn(idn)));
    }

    fn read(&mut self, idn: u16) -> Value {
        let done = self.world.ring().master().report().drives[0].services.len();
        self.request(idn);
        let services = |rig: &Self| rig.world.ring().master().report().drives[0].services.get(done).cloned();
        self.run_until("answering", |rig| services(rig).is_some());
        match services(self).map(|service| service.result) {
            Some(Ok(Reply::Data { value, .. })) => value,
            other => panic!("{}: {other:?}", Idn(idn)),
        }
    }

    /// A text.
    pub(crate) fn text(&mut self, idn: u16) -> String {
        self.read(idn).as_text().unwrap()
    }

    fn bytes(&mut self, idn: u16) -> Vec<u8> {
        match self.read(idn) {
            Value::Bytes(bytes) => bytes,
            other => panic!("{}: {other}", Idn(idn)),
        }
    }

    /// A list of words.
    pub(crate) fn list(&mut self, idn: u16) -> Vec<u16> {
        self.bytes(idn).chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect()
    }

    /// A list of long words.
    pub(crate) fn longs(&mut self, idn: u16) -> Vec<u32> {
        let bytes = self.bytes(idn);
        bytes.chunks(4).map(|four| u32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect()
    }

    fn incidents(&self) -> Vec<Incident> {
        self.qemu.borrow_mut().guest_mut().incidents().to_vec()
    }
}
