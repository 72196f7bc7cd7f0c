//! The flashed ELF in QEMU, as a processor of the world: its external bus is the chip's, its motor side is simulated.

use std::cell::RefMut;

use drive::production::RECORD_BYTES;
use emulator::{DigitalInputs, EmulatorError, Environment, Guest, GuestConfiguration, IndexEdge, Reset, Stopped};
use flash::FlashModel;
use ring::Nanoseconds;
use ring::chip::SharedChip;
use ring::wire::BitRate;

use crate::elf::{Elf, LineEdge, Tape};
use crate::executor::{Elves, SharedMeasurements};
use crate::motor_side::SharedMotorSide;
use crate::observer::{BusObserver, INTERRUPT_STATUS};
use crate::processor::{Processor, ProcessorError};

/// Byte offset of the registers in the window of the external bus; the RAM begins at 0 (board: A12 selects).
const REGISTERS: u32 = 0x1000;

/// A drive that runs in QEMU.
pub struct QemuDrive {
    address: u8,
    elf: Elf,
    environment: QemuEnvironment,
}

impl QemuDrive {
    /// Boots the ELF; its reset is the beginning of the simulation.
    ///
    /// # Errors
    /// QEMU is missing, an ELF is not what it should be, or the bus does not come up.
    pub fn start(
        elves: &Elves,
        (chip, motor_side): (&SharedChip, &SharedMotorSide),
        (flash, production): (&FlashModel, [u8; RECORD_BYTES]),
        address: u8,
        bit_rate: BitRate,
        measurements: SharedMeasurements,
    ) -> Result<Self, ProcessorError> {
        let how = GuestConfiguration {
            one_cpu: elves.one_cpu,
            whole_blocks: elves.whole_blocks,
            foretells: elves.foretells,
            ..GuestConfiguration::new(&elves.product, &elves.bus)
        };
        let stuck = |error: EmulatorError| ProcessorError::Stuck { address, cause: error.to_string() };
        let mut guest = Guest::start(&how).map_err(stuck)?;
        guest.set_flash(flash.clone()).map_err(stuck)?;
        guest.set_production_record(production.to_vec()).map_err(stuck)?;
        motor_side.borrow_mut().leave_breaks();
        let elf = Elf::new(guest);
        let environment = QemuEnvironment {
            elf: elf.clone(),
            chip: chip.clone(),
            motor_side: motor_side.clone(),
            address,
            bit_rate,
            chip_runs: false,
            observer: BusObserver::new(measurements),
        };
        Ok(Self { address, elf, environment })
    }

    /// Resets the processor; `now` is the world's time.
    ///
    /// # Errors
    /// QEMU does not come up again.
    pub fn reset(&mut self, now: Nanoseconds, reset: Reset) -> Result<(), EmulatorError> {
        self.elf.guest.borrow_mut().reset(&mut self.environment, now, reset)
    }

    /// Stops its crystal; `now` is the world's time.
    ///
    /// # Errors
    /// What the models refuse.
    pub fn fail_crystal(&mut self, now: Nanoseconds) -> Result<(), EmulatorError> {
        self.elf.guest.borrow_mut().fail_crystal(&mut self.environment, now)
    }

    /// The running product, to trace it.
    pub fn guest_mut(&mut self) -> RefMut<'_, Guest> {
        self.elf.guest.borrow_mut()
    }

    /// For whoever tests it.
    #[must_use]
    pub fn elf(&self) -> Elf {
        self.elf.clone()
    }
}

impl Processor for QemuDrive {
    fn next_event(&self) -> Option<Nanoseconds> {
        let inputs = self.environment.motor_side.borrow().changed_inputs();
        let lines = self.elf.lines.borrow().next();
        self.elf.guest.borrow().next_event().into_iter().chain(inputs).chain(lines).min()
    }

    fn run(&mut self, now: Nanoseconds, horizon: &dyn Fn() -> Nanoseconds) -> Result<(), ProcessorError> {
        // An event of somebody else's that moves no pin of this drive.
        if self.next_event().is_none_or(|time| time > now) && !self.environment.chip.borrow().has_pin_edges() {
            return Ok(());
        }
        self.environment.note_edges();
        self.environment.motor_side.borrow_mut().take_inputs();
        self.elf.lines.borrow_mut().advance(now);
        let lines = self.elf.lines.borrow().next();
        let guest = &mut *self.elf.guest.borrow_mut();
        let due = guest.next_event().is_some_and(|time| time <= now);
        // The horizon is worked out only when the guest is going to be let loose.
        let until = if due { horizon().min(lines.unwrap_or(Nanoseconds(u64::MAX))) } else { now };
        let address = self.address;
        guest
            .run(&mut self.environment, now, until)
            .map_err(|error| ProcessorError::Stuck { address, cause: error.to_string() })?;
        self.environment.observer.traced(guest.measurements().trace);
        for line in guest.take_log() {
            self.environment.observer.log(format!("{:>14}  {:<5} {}", line.time.to_string(), line.level, line.text));
        }
        Ok(())
    }
}

/// What stands around the processor.
struct QemuEnvironment {
    elf: Elf,
    chip: SharedChip,
    motor_side: SharedMotorSide,
    address: u8,
    bit_rate: BitRate,
    /// The chip has left its reset once.
    chip_runs: bool,
    observer: BusObserver,
}

impl QemuEnvironment {
    fn note_edges(&mut self) {
        let chip = &mut *self.chip.borrow_mut();
        if chip.has_pin_edges() {
            for edge in chip.pin_edges() {
                self.observer.edge(&edge, chip);
                self.elf.lines.borrow_mut().edge(edge.time, edge.pin);
                if let Some(edges) = &mut self.elf.tape.borrow_mut().edges {
                    let status = chip.read_register(edge.time, INTERRUPT_STATUS);
                    let count = self.motor_side.borrow_mut().machine().encoder_count(edge.time.0);
                    edges.push(LineEdge { time: edge.time, line: edge.pin, level: edge.level, status, count });
                }
            }
        }
    }
}

impl Environment for QemuEnvironment {
    fn stopped(&mut self, guest: &mut Guest, stopped: Stopped) -> Result<(), EmulatorError> {
        match &mut *self.elf.on_stop.borrow_mut() {
            Some(on_stop) => on_stop(guest, stopped),
            None => Ok(()),
        }
    }

    fn external_read(&mut self, now: Nanoseconds, byte_offset: u32) -> u16 {
        let word = word_of(byte_offset);
        let chip = &mut *self.chip.borrow_mut();
        if byte_offset < REGISTERS {
            self.observer.read(now, word);
            chip.read_ram(now, word)
        } else {
            chip.read_register(now, word)
        }
    }

    fn external_write(&mut self, now: Nanoseconds, byte_offset: u32, value: u16) {
        let word = word_of(byte_offset);
        let chip = &mut *self.chip.borrow_mut();
        if byte_offset < REGISTERS {
            chip.write_ram(now, word, value);
            self.observer.write(now, word, value, chip);
        } else {
            chip.write_register(now, word, value);
        }
    }

    /// The RAM and 05H: reading has no effect, and they change by an event of the chip or a write only. The record of the MDT is
    /// left out, because the observer wants to see when it is read.
    fn external_peek(&self, byte_offset: u32) -> Option<u16> {
        let word = word_of(byte_offset);
        let chip = &mut *self.chip.borrow_mut();
        if byte_offset >= REGISTERS {
            (word == INTERRUPT_STATUS).then(|| chip.read_register(Nanoseconds::ZERO, word))
        } else {
            (!BusObserver::watches_read_of(word)).then(|| chip.read_ram(Nanoseconds::ZERO, word))
        }
    }

    fn interrupt_pins(&self) -> (bool, bool) {
        let pins = self.chip.borrow().interrupt_pins();
        self.elf.lines.borrow().levels((pins.int0, pins.int1))
    }

    fn encoder_count(&mut self, now: Nanoseconds) -> u32 {
        self.motor_side.borrow_mut().machine().encoder_count(now.0)
    }

    /// What is written meanwhile does not move the shaft by an increment within microseconds.
    fn encoder_foretold(&self, at: Nanoseconds) -> Option<u32> {
        Some(self.motor_side.borrow_mut().machine().encoder_ahead(at.0))
    }

    fn index_count(&mut self, now: Nanoseconds) -> IndexEdge {
        let state = &mut *self.motor_side.borrow_mut();
        let number = state.machine().index_pulses(now.0);
        IndexEdge { number: number.into(), count: state.machine().index_count(now.0).unwrap_or(0) }
    }

    /// The board's wiring: ADC1 phase current A and bus, ADC2 phase current B and heat sink, ADC3 phase current C and motor.
    fn analog_sample(&mut self, at: Nanoseconds, adc: usize, channel: u8) -> u16 {
        let machine = &mut *self.motor_side.borrow_mut();
        let machine = machine.machine();
        match (adc, channel) {
            (1, 10) => machine.current_samples(at.0)[0],
            (2, 11) => machine.current_samples(at.0)[1],
            (3, 12) => machine.current_samples(at.0)[2],
            (1, 13) => machine.bus_sample(at.0),
            (2, 14) => machine.temperature_samples(at.0)[0],
            (3, 4) => machine.temperature_samples(at.0)[1],
            // Nothing is connected to the others.
            _ => 0,
        }
    }

    fn set_chip_reset(&mut self, now: Nanoseconds, held: bool) {
        if std::mem::replace(&mut self.chip_runs, !held) && held {
            self.chip.borrow_mut().pulse_reset(now);
        }
    }

    fn set_bridge(&mut self, at: Nanoseconds, on: bool, _dead_time_ns: u32) {
        Tape::note(&mut self.elf.tape.borrow_mut().bridge, at, on);
        self.motor_side.borrow_mut().switch_bridge(on, at);
    }

    fn set_duties(&mut self, at: Nanoseconds, duties: [f64; 3]) {
        self.motor_side.borrow_mut().modulate(duties, at);
    }

    fn set_brake(&mut self, at: Nanoseconds, energised: bool) {
        Tape::note(&mut self.elf.tape.borrow_mut().coil, at, energised);
        self.motor_side.borrow_mut().switch_brake(energised, at);
    }

    fn set_chopper(&mut self, at: Nanoseconds, on: bool) {
        Tape::note(&mut self.elf.tape.borrow_mut().chopper, at, on);
        self.motor_side.borrow_mut().switch_chopper(on, at);
    }

    fn break_input(&self) -> bool {
        self.motor_side.borrow().inputs().bridge_ready
    }

    fn digital_inputs(&self) -> DigitalInputs {
        let inputs = self.motor_side.borrow_mut().levels();
        DigitalInputs {
            main_power: inputs.main_power,
            sto_1: inputs.safe_torque_1,
            sto_2: inputs.safe_torque_2,
            home_switch: inputs.home_switch,
            brake_feedback: inputs.brake_open,
            probe_1: inputs.probe_1,
            probe_2: inputs.probe_2,
        }
    }

    fn address_switches(&self) -> u8 {
        self.address
    }

    fn bit_rate_switches(&self) -> u8 {
        match self.bit_rate {
            BitRate::M2 => 0,
            BitRate::M4 => 1,
            BitRate::M8 => 2,
            BitRate::M16 => 3,
        }
    }
}

/// Word address in RAM or registers of a byte offset into the window.
fn word_of(byte_offset: u32) -> u16 {
    let within = byte_offset % REGISTERS;
    u16::try_from(within / 2).unwrap_or(u16::MAX)
}
