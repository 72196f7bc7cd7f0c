//! The drive's portable tasks on this computer, started as the microcontroller's interrupt controller would.
//!
//! What this file stands for is `firmware/app/src/main.rs` and the board: edges of the interrupt pins, the end of
//! conversion, the order of priorities. Everything else is the product.

use drive::remembering;
use drive::{
    Communication, CurrentControl, CurrentLink, Drive, Identity, InterruptLine, Motion, RingInterrupts, Scope, Tasks,
};
use embassy_futures::block_on;
use memory::{Log, Memory};
use ring::Nanoseconds;
use ring::chip::{ChipBus, InterruptPin, SharedChip};
use ring::time::SharedClock;
use rtic_core::Exclusive;

use crate::executor::SharedMeasurements;
use crate::memory::{BUFFER, HostFlash, SharedFlash};
use crate::motor_side::{MotorSide, SharedMotorSide, SimulatedStage};
use crate::processor::{Processor, ProcessorError};

/// How long the simulated processor takes to get to a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// From an edge of an interrupt pin to its handler, and from there to the tasks of the same priority.
    pub interrupt: Nanoseconds,
    /// From the handler to the tasks of low priority: phase change and service channel, with everything above them done first.
    pub background: Nanoseconds,
}

impl Default for Latency {
    /// What the release ELF was measured to need, rounded up (see the README's table).
    fn default() -> Self {
        Self { interrupt: Nanoseconds::from_microseconds(2), background: Nanoseconds::from_microseconds(25) }
    }
}

/// A drive that runs on this computer, beside a chip of the ring and a motor.
pub struct HostDrive {
    chip: SharedChip,
    motor_side: SharedMotorSide,
    interrupts: RingInterrupts<ChipBus>,
    current: CurrentControl<SimulatedStage>,
    communication: Communication<ChipBus>,
    motion: Motion<ChipBus, MotorSide>,
    latency: Latency,
    edges: [Option<Nanoseconds>; 2],
    background: Option<(Nanoseconds, Tasks)>,
    measurements: SharedMeasurements,
    memory: Memory<HostFlash>,
    buffer: Box<[u8; BUFFER]>,
    /// When the idle task looks for what is to be kept.
    next_look: Nanoseconds,
}

/// How often the idle task looks for what is to be kept: as often as it feeds the watchdog.
const LOOKS: Nanoseconds = Nanoseconds::from_millis(8);

impl HostDrive {
    /// Switches a drive on: chip initialisation and everything that `init` does.
    ///
    /// # Errors
    /// The drive refuses its chip.
    pub fn start(
        (chip, motor_side, flash): (&SharedChip, &SharedMotorSide, &SharedFlash),
        clock: &SharedClock,
        identity: Identity,
        latency: Latency,
        measurements: SharedMeasurements,
    ) -> Result<Self, ProcessorError> {
        let bus = ChipBus::new(chip.clone(), clock.clone());
        let address = identity.address.get();
        let refused = |cause: &dyn std::fmt::Debug| ProcessorError::Stuck { address, cause: format!("{cause:?}") };
        // As in the application: link and oscilloscope live as long as the drive, which is for ever.
        let link = Box::leak(Box::new(CurrentLink::new()));
        let scope = Box::leak(Box::new(Scope::new()));
        let mut memory = Memory::new(HostFlash(flash.clone()));
        let mut buffer = Box::new([0; BUFFER]);
        let recollection = block_on(remembering::recall(&mut memory, &mut *buffer));
        let mut communication = Communication::new::<MotorSide>(bus.clone(), identity, recollection);
        let Drive { current, mut interrupts, mut motion } = drive::new(
            bus,
            MotorSide::new(motor_side.clone()),
            SimulatedStage::new(motor_side.clone()),
            link,
            scope,
            &communication,
        )
        .map_err(|error| refused(&error))?;
        let past = block_on(memory.load_log(&mut *buffer, Log::Events)).ok().flatten();
        if let Some(crash) = past.and_then(|log| communication.recall_log(log)) {
            communication.note_crash(crash, "before the supply went");
        }
        communication.start(&mut interrupts, &mut motion).map_err(|error| refused(&error))?;
        Ok(Self {
            chip: chip.clone(),
            motor_side: motor_side.clone(),
            current,
            interrupts,
            communication,
            motion,
            latency,
            edges: [None; 2],
            background: None,
            measurements,
            memory,
            buffer,
            next_look: Nanoseconds::ZERO,
        })
    }

    fn take_edges(&mut self) {
        if !self.chip.borrow().has_pin_edges() {
            return;
        }
        let edges = self.chip.borrow_mut().pin_edges();
        for edge in edges {
            let line = match edge.pin {
                InterruptPin::Int0 => InterruptLine::Int0,
                InterruptPin::Int1 => InterruptLine::Int1,
            };
            self.motor_side.borrow_mut().latch(line, edge.time);
            let due = edge.time + self.latency.interrupt;
            let slot = &mut self.edges[usize::from(line == InterruptLine::Int1)];
            *slot = Some(slot.map_or(due, |earlier| earlier.min(due)));
        }
    }

    fn chip_interrupts(&mut self, now: Nanoseconds) {
        for (index, line) in [InterruptLine::Int0, InterruptLine::Int1].into_iter().enumerate() {
            if self.edges[index].is_some_and(|due| due <= now) {
                self.edges[index] = None;
                self.motor_side.borrow_mut().acknowledge(line);
                self.measurements.borrow_mut().note(now, ["chip_interrupt_0", "chip_interrupt_1"][index]);
                let work = self.interrupts.take(line, &mut self.motion);
                if work.contains(Tasks::SERVICE_CHANNEL) {
                    self.measurements.borrow_mut().note(now, "INT_SC");
                }
                self.start_tasks(now, work);
            }
        }
    }

    fn start_tasks(&mut self, now: Nanoseconds, mut work: Tasks) {
        if work.contains(Tasks::SERVICE_CHANNEL) {
            self.measurements.borrow_mut().service.start(now);
        }
        for (task, name) in [
            (Tasks::COMMAND_VALID, "command_valid"),
            (Tasks::CAPTURE_FEEDBACK, "capture_feedback"),
            (Tasks::SUPERVISION, "supervision"),
        ] {
            if work.contains(task) {
                self.measurements.borrow_mut().note(now, name);
            }
        }
        if work.contains(Tasks::COMMAND_VALID) {
            work |= self.motion.command_valid();
        }
        if work.contains(Tasks::CAPTURE_FEEDBACK) {
            self.motion.capture_feedback();
        }
        if work.contains(Tasks::SUPERVISION) {
            work |= self.motion.supervise();
        }
        let low = work & (Tasks::PHASE_CHANGE | Tasks::SERVICE_CHANNEL);
        if !low.is_empty() {
            let (due, pending) = self.background.unwrap_or((now + self.latency.background, Tasks::empty()));
            self.background = Some((due, pending | low));
        }
    }

    fn background_tasks(&mut self, now: Nanoseconds) {
        let Some((_, work)) = self.background.take_if(|(due, _)| *due <= now) else { return };
        if work.contains(Tasks::PHASE_CHANGE) {
            self.measurements.borrow_mut().note(now, "phase_change");
            self.communication.phase_change(&mut Exclusive(&mut self.interrupts), &mut Exclusive(&mut self.motion));
        }
        if work.contains(Tasks::SERVICE_CHANNEL) {
            self.measurements.borrow_mut().note(now, "service_channel");
            self.communication.service_channel(&mut Exclusive(&mut self.motion));
            self.measurements.borrow_mut().service.stop(now);
        }
    }
}

impl HostDrive {
    /// What the idle task does beside feeding the watchdog.
    fn idle(&mut self, now: Nanoseconds) {
        if now < self.next_look || !self.motion.may_stand_still() {
            return;
        }
        self.next_look = now + LOOKS;
        let mut communication = Exclusive(&mut self.communication);
        let mut motion = Exclusive(&mut self.motion);
        // A word takes no time here; what it takes, and where it waits, the ELF shows.
        block_on(remembering::keep(&mut self.memory, &mut *self.buffer, &mut communication, &mut motion));
    }
}

impl Processor for HostDrive {
    fn next_event(&self) -> Option<Nanoseconds> {
        let background = self.background.map(|(due, _)| due);
        let cycle = self.motor_side.borrow().next_cycle();
        self.edges.into_iter().flatten().chain(background).chain([cycle]).min()
    }

    fn run(&mut self, now: Nanoseconds, _horizon: &dyn Fn() -> Nanoseconds) -> Result<(), ProcessorError> {
        self.take_edges();
        let due = self.motor_side.borrow_mut().take_cycle(now);
        if due {
            self.measurements.borrow_mut().note(now, "current_loop");
        }
        let tick = due && self.current.current_loop();
        let half_tick = due && !tick;
        self.chip_interrupts(now);
        if half_tick {
            self.measurements.borrow_mut().note(now, "velocity_loop");
            self.motion.velocity_loop();
        }
        if tick {
            self.measurements.borrow_mut().note(now, "control_loop");
            let mut work = self.motion.control_loop();
            if self.interrupts.need_polling() {
                work |= self.interrupts.poll(&mut self.motion);
            }
            self.start_tasks(now, work);
        }
        self.background_tasks(now);
        if tick {
            self.idle(now);
        }
        // What the tasks wrote may have moved the pins: a flag cleared, or one that came while the handler ran.
        self.take_edges();
        Ok(())
    }
}
