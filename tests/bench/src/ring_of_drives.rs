//! A ring of host-side drives, each with chip, motor and processor.

use std::cell::RefCell;
use std::rc::Rc;

use drive::production::Production;
use drive::{DriveAddress, Hardware, Identity};
use flash::FlashModel;
use laws::{Observer, SharedObserver};
use plant::ReferenceAxis;
use ring::chip::{Alternatives, Chip, SharedChip, Straps};
use ring::time::SharedClock;
use ring::wire::BitRate;
use ring::{Master, Nanoseconds, Ring, RingConfiguration};
use sercon816::layout::MST_ERRORS;
use sercon816::{Block, MasterClock, Transceiver};

use crate::elf::Elf;
use crate::executor::{Executor, SharedMeasurements};
use crate::host_drive::{HostDrive, Latency};
use crate::memory::{SharedFlash, ratings, remembered, saved_defaults};
use crate::motor_side::{MotorSide, MotorSideState, SharedMotorSide};
use crate::processor::{Processor, ProcessorError};
use crate::qemu_drive::QemuDrive;
use crate::report::MissedTelegrams;
use crate::works::Works;
use crate::world::{Inhabited, World};

/// One drive of a ring.
#[derive(Clone, Debug)]
pub struct DriveSetup {
    /// Its address, 1 to 254; an ELF may also be shown another one.
    pub address: u8,
    /// How its chip behaves where the public record stops.
    pub alternatives: Alternatives,
    /// Its motor and load.
    pub axis: ReferenceAxis,
    /// How long its processor takes.
    pub latency: Latency,
    /// How fast its crystal is, in ppm.
    pub clock_ppm: i64,
    /// What the works have told it of its amplifier.
    pub works: Works,
    /// What it remembers.
    pub flash: FlashModel,
}

impl DriveSetup {
    /// A press drive on a chip that behaves as proposed, in whose memory the defaults were saved.
    pub fn new(address: u8) -> Self {
        Self {
            address,
            alternatives: Alternatives::default(),
            axis: ReferenceAxis::press(),
            latency: Latency::default(),
            clock_ppm: 0,
            works: Works::OfItsAxis,
            flash: saved_defaults(),
        }
    }

    /// The motor that the defaults of the drive's parameters describe, on a board as it comes: it runs without any parameter written.
    pub fn catalogue(address: u8) -> Self {
        Self { axis: ReferenceAxis::catalogue(), works: Works::Blank, ..Self::new(address) }
    }
}

/// What an observer keeps of one drive.
#[derive(Clone)]
pub struct DriveHandle {
    /// Its address.
    pub address: u8,
    /// Its motor, load and amplifier.
    pub axis: ReferenceAxis,
    /// Its chip.
    pub chip: SharedChip,
    /// Its motor and board.
    pub motor_side: SharedMotorSide,
    /// What is measured on it.
    pub measurements: SharedMeasurements,
    /// What it remembers, where it runs on this computer; of an ELF it is `Guest::flash`.
    pub flash: SharedFlash,
    /// Its processor, where that runs in QEMU.
    pub elf: Option<Elf>,
    /// Who watches whether it keeps the laws of the axis.
    pub laws: SharedObserver,
}

impl DriveHandle {
    /// MSTs and MDTs that its chip has counted as missed or wrong.
    #[must_use]
    pub fn missed_by_chip(&self) -> MissedTelegrams {
        let chip = &mut *self.chip.borrow_mut();
        let now = Nanoseconds::ZERO;
        MissedTelegrams {
            mst: u64::from(chip.read_ram(now, MST_ERRORS.word())),
            mdt: u64::from(chip.read_ram(now, Block::CYCLIC.mdt_header.offset(ERROR_COUNTER).word())),
            at: 0,
            first_at: false,
        }
    }
}

/// Word of a receive header that counts errors (sercon816.md 6.2).
const ERROR_COUNTER: u16 = 4;

/// Chip and motor of a drive, ready for a processor.
pub(crate) fn station(setup: &DriveSetup, bit_rate: BitRate, clock: &SharedClock) -> (SharedChip, SharedMotorSide) {
    let straps = Straps { bit_rate, mclk_megahertz: 32 };
    let seed = u64::from(setup.address) * 0x9E37_79B9;
    let chip = Rc::new(RefCell::new(Chip::with_straps(straps, setup.alternatives, seed)));
    let motor = MotorSideState::new(clock.clone(), &setup.axis, setup.clock_ppm);
    (chip, Rc::new(RefCell::new(motor)))
}

/// Watches the drive of a setup.
pub(crate) fn observer(setup: &DriveSetup) -> SharedObserver {
    let mut observer = Observer::new(setup.address, setup.axis.machine);
    observer.remember(ratings(production(setup).amplifier(&MotorSide::AMPLIFIER)));
    observer.remember(remembered(&setup.flash));
    Rc::new(RefCell::new(observer))
}

/// What the works have written into the drive of a setup.
fn production(setup: &DriveSetup) -> Production {
    Production::read(&setup.works.sector(&setup.axis))
}

/// The identity that switches and works give a drive.
fn identity(setup: &DriveSetup, bit_rate: BitRate) -> Result<Identity, ProcessorError> {
    let address = setup.address;
    Ok(Identity {
        address: DriveAddress::new(address)
            .ok_or_else(|| ProcessorError::Stuck { address, cause: "an address is 1 to 254".to_owned() })?,
        bit_rate: match bit_rate {
            BitRate::M2 => sercon816::BitRate::Mbit2,
            BitRate::M4 => sercon816::BitRate::Mbit4,
            BitRate::M8 => sercon816::BitRate::Mbit8,
            BitRate::M16 => sercon816::BitRate::Mbit16,
        },
        master_clock: MasterClock::Mhz32,
        transceiver: Transceiver::STANDARD,
        production: production(setup),
    })
}

/// A world of host-side drives behind a master.
///
/// # Errors
/// A drive that refuses its chip or its address.
pub fn ring_of_drives<M: Master>(
    configuration: RingConfiguration,
    master: M,
    setups: &[DriveSetup],
) -> Result<(World<M>, Vec<DriveHandle>), ProcessorError> {
    ring_of_drives_on(configuration, master, setups, |_| Executor::Host)
}

/// A world of drives behind a master; `executor` says where the drive of an address runs.
///
/// # Errors
/// A drive that refuses its chip or its address, or that can not be started.
pub fn ring_of_drives_on<M: Master>(
    configuration: RingConfiguration,
    master: M,
    setups: &[DriveSetup],
    executor: impl Fn(u8) -> Executor,
) -> Result<(World<M>, Vec<DriveHandle>), ProcessorError> {
    let bit_rate = configuration.bit_rate;
    let clock = configuration.clock.clone();
    let mut chips = Vec::new();
    let mut handles = Vec::new();
    let mut stations = Vec::new();
    for setup in setups {
        let (chip, motor_side) = station(setup, bit_rate, &clock);
        let measurements = SharedMeasurements::default();
        let flash = Rc::new(RefCell::new(setup.flash.clone()));
        let mut elf = None;
        let processor: Box<dyn Processor> = match executor(setup.address) {
            Executor::Host => {
                let parts = (&chip, &motor_side, &flash);
                let identity = identity(setup, bit_rate)?;
                Box::new(HostDrive::start(parts, &clock, identity, setup.latency, measurements.clone())?)
            }
            Executor::Qemu(elves) => {
                let parts = (&chip, &motor_side);
                let measured = measurements.clone();
                let sectors = (&setup.flash, setup.works.sector(&setup.axis));
                let drive = QemuDrive::start(&elves, parts, sectors, setup.address, bit_rate, measured)?;
                elf = Some(drive.elf());
                Box::new(drive)
            }
        };
        let laws = observer(setup);
        stations.push(Inhabited { processor, motor_side: motor_side.clone(), laws: laws.clone() });
        handles.push(DriveHandle {
            address: setup.address,
            axis: setup.axis,
            chip: chip.clone(),
            motor_side,
            measurements,
            flash,
            elf,
            laws,
        });
        chips.push(chip);
    }
    let ring = Ring::new(configuration, master, chips);
    Ok((World::new(ring, stations), handles))
}
