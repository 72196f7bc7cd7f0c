//! A drive in QEMU whose processor a test takes away and lets come back.

use std::cell::RefCell;
use std::rc::Rc;

use ring::{Master, Nanoseconds, Ring, RingConfiguration};

use crate::executor::{Elves, SharedMeasurements};
use crate::processor::{Processor, ProcessorError};
use crate::qemu_drive::QemuDrive;
use crate::ring_of_drives::{DriveHandle, DriveSetup, observer, station};
use crate::world::{Inhabited, World};
use laws::Observer;

/// A drive of which a second hand takes hold.
pub(crate) struct Held(pub(crate) Rc<RefCell<QemuDrive>>);

impl Processor for Held {
    fn next_event(&self) -> Option<Nanoseconds> {
        self.0.borrow().next_event()
    }

    fn run(&mut self, now: Nanoseconds, horizon: &dyn Fn() -> Nanoseconds) -> Result<(), ProcessorError> {
        self.0.borrow_mut().run(now, horizon)
    }
}

/// The parts of a world with one drive in QEMU.
pub type Crashing<M> = (World<M>, DriveHandle, Rc<RefCell<QemuDrive>>);

/// A ring of one drive in QEMU that survives faults and resets. No law is judged: none of them is about a processor that is gone.
///
/// # Errors
/// QEMU does not start.
pub fn crashing_drive<M: Master>(
    configuration: RingConfiguration,
    master: M,
    setup: &DriveSetup,
    elves: &Elves,
) -> Result<Crashing<M>, ProcessorError> {
    let laws = Rc::new(RefCell::new(Observer::without_laws(setup.address, setup.axis.machine)));
    let (world, handle, drive) = held(configuration, master, setup, elves, laws)?;
    let stuck =
        |error: emulator::EmulatorError| ProcessorError::Stuck { address: setup.address, cause: error.to_string() };
    drive.borrow_mut().guest_mut().survive().map_err(stuck)?;
    Ok((world, handle, drive))
}

/// A ring of one drive in QEMU, watched.
pub(crate) fn watched<M: Master>(
    configuration: RingConfiguration,
    master: M,
    setup: &DriveSetup,
    elves: &Elves,
) -> Result<Crashing<M>, ProcessorError> {
    held(configuration, master, setup, elves, observer(setup))
}

fn held<M: Master>(
    configuration: RingConfiguration,
    master: M,
    setup: &DriveSetup,
    elves: &Elves,
    laws: laws::SharedObserver,
) -> Result<Crashing<M>, ProcessorError> {
    let bit_rate = configuration.bit_rate;
    let (chip, motor_side) = station(setup, bit_rate, &configuration.clock);
    let measurements = SharedMeasurements::default();
    let parts = (&chip, &motor_side);
    let drive = QemuDrive::start(
        elves,
        parts,
        (&setup.flash, setup.works.sector(&setup.axis)),
        setup.address,
        bit_rate,
        measurements.clone(),
    )?;
    let elf = Some(drive.elf());
    let drive = Rc::new(RefCell::new(drive));
    let inhabited =
        Inhabited { processor: Box::new(Held(drive.clone())), motor_side: motor_side.clone(), laws: laws.clone() };
    let ring = Ring::new(configuration, master, vec![chip.clone()]);
    let handle = DriveHandle {
        address: setup.address,
        axis: setup.axis,
        chip,
        motor_side,
        measurements,
        flash: Rc::default(),
        elf,
        laws,
    };
    Ok((World::new(ring, vec![inhabited]), handle, drive))
}
