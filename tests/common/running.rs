//! One drive on a ring with the scripted master, running or about to, and what a test asks of it.

use bench::{DriveHandle, DriveSetup, Executor, Works, World, parameters_of, product, ring_of_drives_on};
use plant::ReferenceAxis;
use ring::chip::Alternatives;
use ring::fibre::{Effect, Fault, TelegramKind};
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, SlotChoice, Telegram};
use ring::service_client::{Reply, Request, ServiceError};
use ring::slots::MdtPlace;
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

pub(crate) const ADDRESS: u8 = 5;
/// 300 rpm in 0.0001 rpm.
pub(crate) const VELOCITY: i32 = 3_000_000;

/// A drive in velocity mode, running at 300 rpm for ever.
pub(crate) fn script() -> MasterScript {
    let drive =
        DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with_all(parameters_of(&ReferenceAxis::press()));
    let motion = Motion::new(1_000_000, |_| CommandValues::at_velocity(VELOCITY));
    MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) }
}

pub(crate) struct Bench {
    pub(crate) world: World<ScriptedMaster>,
    pub(crate) drive: DriveHandle,
}

impl Bench {
    /// A drive before its run-up.
    pub(crate) fn new(setup: DriveSetup, script: MasterScript) -> Self {
        Self::on(Executor::Host, setup, script)
    }

    /// The same, and where it runs.
    pub(crate) fn on(executor: Executor, setup: DriveSetup, script: MasterScript) -> Self {
        let configuration = RingConfiguration::new(1, BitRate::M2);
        let master = ScriptedMaster::new(script);
        let (world, mut handles) = ring_of_drives_on(configuration, master, &[setup], |_| executor.clone()).unwrap();
        Self { world, drive: handles.remove(0) }
    }

    /// A drive that turns.
    pub(crate) fn running() -> Self {
        Self::running_on(Alternatives::default(), MdtPlace::Late)
    }

    /// The same with a chip that behaves like this, and the MDT and t3 early or late in the cycle.
    pub(crate) fn running_on(alternatives: Alternatives, place: MdtPlace) -> Self {
        let script = MasterScript { slots: SlotChoice::Computed(place), ..script() };
        let mut bench = Self::new(DriveSetup { alternatives, ..DriveSetup::new(ADDRESS) }, script);
        for _ in 0..2_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.rpm() > 299.0 {
                bench.run(Nanoseconds::from_millis(300));
                return bench;
            }
        }
        panic!("{}", bench.world.ring().master().state());
    }

    /// A vertical axis with its brake and its commutation angle before its run-up; it is to be held at zero velocity.
    pub(crate) fn vertical(works: Works) -> Self {
        Self::vertical_on(Executor::Host, works)
    }

    /// The same, and where it runs.
    pub(crate) fn vertical_on(executor: Executor, works: Works) -> Self {
        let axis = ReferenceAxis::vertical();
        let encoder = axis.machine.encoder;
        let angle = (encoder.electrical_zero * f64::from(axis.machine.windings.pole_pairs)).fract() * 36_000.0;
        let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
            .with(Idn::OPERATION_MODE, Value::Word(2))
            .with_all(parameters_of(&axis))
            .with(product(120), Value::Word(3))
            .with(product(118), Value::Long(angle as u32))
            .with(Idn(206), Value::Word(60))
            .with(Idn(207), Value::Word(60));
        let motion = Motion::new(1_000_000, |_| CommandValues::default());
        let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        Self::on(executor, DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) }, script)
    }

    pub(crate) fn run(&mut self, span: Nanoseconds) {
        let until = self.world.now() + span;
        self.world.run_until(until).unwrap();
    }

    /// Runs until the drive says that it is in operation.
    pub(crate) fn run_to_operation(&mut self) {
        for _ in 0..1_000 {
            self.run(Nanoseconds::from_millis(10));
            if self.is_in_operation() {
                return;
            }
        }
        panic!("{}", self.world.ring().master().state());
    }

    pub(crate) fn rpm(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().velocity(now) * 60.0 / core::f64::consts::TAU
    }

    pub(crate) fn has_torque(&self) -> bool {
        self.drive.motor_side.borrow().bridge_is_on()
    }

    /// The drive says that it is in operation: bits 15 and 14 of its status word.
    pub(crate) fn is_in_operation(&self) -> bool {
        self.world
            .ring()
            .master()
            .report()
            .samples
            .last()
            .and_then(|sample| sample.status)
            .is_some_and(|status| status & 0xC000 == 0xC000)
    }

    /// So many telegrams of this kind are lost, from the next cycle but one on.
    pub(crate) fn lose(&mut self, kind: TelegramKind, cycles: u64) {
        let from = self.world.ring().cycle().unwrap() + 2;
        for cycle in from..from + cycles {
            self.world.ring_mut().add_fault(Fault::once(cycle, 0, kind, Effect::Drop));
        }
    }

    /// Runs the ring up again without a motion and reads two-byte data blocks.
    pub(crate) fn run_up_and_read(&mut self, idns: &[u16]) -> Vec<u16> {
        let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with(Idn::OPERATION_MODE, Value::Word(2));
        let script = MasterScript { reset_diagnostics: false, ..MasterScript::new(vec![drive]) };
        self.world.ring_mut().master_mut().restart(script);
        for _ in 0..2_000 {
            self.run(Nanoseconds::from_millis(10));
            if self.world.ring().master().is_done() {
                break;
            }
        }
        let report = self.world.ring().master().report();
        assert_eq!((&report.error, self.world.ring().master().phase()), (&None, 4));
        let client = self.world.ring_mut().master_mut().service(0);
        for &idn in idns {
            client.request(Request::Read(Idn(idn)));
        }
        self.run(Nanoseconds::from_millis(500));
        idns.iter().map(|&idn| self.last_read(idn)).collect()
    }

    /// The last value that the master has read of a two-byte data block.
    pub(crate) fn last_read(&self, idn: u16) -> u16 {
        let services = &self.world.ring().master().report().drives[0].services;
        let finished = services.iter().rev().find(|service| service.request == Request::Read(Idn(idn)));
        match &finished.unwrap_or_else(|| panic!("S-0-{idn:04} was not read")).result {
            Ok(Reply::Data { value, .. }) => value.as_number().unwrap() as u16,
            other => panic!("S-0-{idn:04}: {other:?}"),
        }
    }

    /// One request over the service channel, and what came of it.
    pub(crate) fn ask(&mut self, request: Request) -> Result<Reply, ServiceError> {
        let done = self.world.ring().master().report().drives[0].services.len();
        self.world.ring_mut().master_mut().service(0).request(request);
        for _ in 0..200 {
            self.run(Nanoseconds::from_millis(10));
            if let Some(finished) = self.world.ring().master().report().drives[0].services.get(done) {
                return finished.result.clone();
            }
        }
        panic!("the request is not answered: {}", self.world.ring().master().state());
    }

    /// Writes a data block; the error code, if it is refused.
    pub(crate) fn write(&mut self, idn: u16, value: Value) -> Result<(), u16> {
        let list = matches!(value, Value::Bytes(_));
        let idn = Idn(idn);
        let request = if list { Request::WriteList(idn, value) } else { Request::Write(idn, value) };
        match self.ask(request) {
            Ok(_) => Ok(()),
            Err(ServiceError::Refused { code, .. }) => Err(code),
            Err(error) => panic!("{error}"),
        }
    }

    /// Reads the operation data of a data block.
    pub(crate) fn read(&mut self, idn: u16) -> Value {
        match self.ask(Request::Read(Idn(idn))) {
            Ok(Reply::Data { value, .. }) => value,
            other => panic!("{}: {other:?}", Idn(idn)),
        }
    }

    /// Reads a list as words, without its two length words.
    pub(crate) fn entries(&mut self, idn: u16) -> Vec<u16> {
        match self.read(idn) {
            Value::Bytes(bytes) => bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect(),
            other => panic!("{}: {other}", Idn(idn)),
        }
    }

    /// Reads a number, as it is transmitted.
    pub(crate) fn number(&mut self, idn: u16) -> u64 {
        self.read(idn).as_number().unwrap()
    }

    /// Reads a text.
    pub(crate) fn text(&mut self, idn: u16) -> String {
        self.read(idn).as_text().unwrap()
    }

    /// The status word of the last AT.
    pub(crate) fn status(&self) -> u16 {
        self.world.ring().master().report().samples.last().and_then(|sample| sample.status).unwrap()
    }

    pub(crate) fn clear_errors(&mut self) {
        self.world.ring_mut().master_mut().service(0).request(Request::Command { idn: Idn(99), polls: 10 });
        self.run(Nanoseconds::from_millis(200));
    }

    /// The motor has stopped on a ramp and is without torque; it did not merely coast.
    pub(crate) fn assert_stopped(&mut self) {
        // 31.4 rad/s at 400 rad/s^2: 79 ms.
        self.run(Nanoseconds::from_millis(60));
        assert!(self.has_torque(), "torque before standstill");
        let on_the_way = self.rpm();
        assert!((20.0..250.0).contains(&on_the_way), "{on_the_way} rpm after 60 ms");
        self.run(Nanoseconds::from_millis(200));
        assert!(!self.has_torque());
        assert!(self.rpm().abs() < 1.0);
    }
}
