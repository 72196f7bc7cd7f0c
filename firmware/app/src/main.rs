//! The RTIC application of the servo drive: one interrupt, one call into `drive`.
//!
//! | task | vector | priority | when | done within |
//! |---|---|---|---|---|
//! | [`app::current_loop`] | ADC | 5 | the currents are converted, every 62.5 us | 28 us |
//! | [`app::chip_interrupt_0`] | EXTI3 | 4 | an edge on INT0 of the SERCON816 | 8 us |
//! | [`app::chip_interrupt_1`] | EXTI2 | 4 | an edge on INT1 of the SERCON816 | 8 us |
//! | [`app::command_valid`] | CAN1_TX | 4 | started by the two above at t3 | 16 us |
//! | [`app::capture_feedback`] | CAN1_RX0 | 4 | started by the two above at t4 | 30 us |
//! | [`app::control_loop`] | CAN2_TX | 4 | started by every second current loop, every 125 us | 60 us |
//! | [`app::velocity_loop`] | CAN2_RX1 | 4 | started by the current loops in between, every 125 us | 60 us |
//! | [`app::supervision`] | CAN2_RX0 | 4 | one half of it, started by every second control loop, every 250 us | 125 us |
//! | [`app::phase_change`] | CAN1_RX1 | 2 | the MST shows another phase, or supervision gives the ring up | one communication cycle |
//! | [`app::service_channel`] | CAN1_SCE | 2 | the service container waits for us; the drive has become another state or has an error | 100 us |
//! | [`app::idle`] | - | 0 | nothing else to do: feeds the watchdogs, logs, keeps what is to outlive the supply | - |
//!
//! Higher numbers interrupt lower ones. The current loop is alone at the top, owns what it works with and talks to the others through
//! [`drive::CurrentLink`], without a lock: nobody can hold it up. Everything that belongs to the cycle has one priority below, so these
//! tasks never interrupt each other and wait for at most one of the others; at equal priority the lower vector number goes first: the
//! chip's interrupts, then t3, t4, then the control loop, its supervision, and the velocity loop. Priorities 3 and 1 are free: 3 for what must not delay the cycle but may
//! delay the bus, 1 for an operator's port.
//!
//! Tasks without an interrupt of their own borrow the vectors of CAN1 and CAN2, which this drive has no use for; they are started by setting
//! the vector pending. All log lines come from priority 2 and below and mask nothing.
#![no_std]
#![no_main]

mod fault;
mod locks;

use defmt_rtt as _;

defmt::timestamp!("{=u32:us}", board::timestamp::microseconds());

#[rtic::app(device = board::pac, peripherals = true)]
mod app {
    use board::Board;
    use board::fsmc::SercosBus;
    use board::interrupt_pins::InterruptPin;
    use board::pac::Interrupt;
    use board::parameter_flash::{PERMIT, ParameterFlash};
    use board::watchdog::{CheckIn, Watchdog};
    use board::{Inverter, MotorSide, chip_control, switches};
    use core::cell::RefCell;
    use core::mem::MaybeUninit;
    use core::pin::pin;
    use core::task::{Context, Waker};
    use drive::crash::{CrashRecord, MOST_CRASHES_IN_A_ROW};
    use drive::production::Production;
    use drive::remembering::{self, Forgetting, Recollection};
    use drive::{Communication, CurrentControl, CurrentLink, Drive, DriveAddress};
    use drive::{Identity, Motion, RingInterrupts, Scope, Tasks};
    use embassy_futures::{block_on, yield_now};
    use memory::{Log, Memory};

    use crate::locks::{ByTurns, Referred};

    /// After 10 s (feedings are 8 ms apart) crashes until here are none in a row with one that comes.
    const FEEDINGS_UNTIL_WELL: u16 = 1_250;

    /// A permit is for now: [`Motion::may_stand_still`] reckons with 10 us beside the word.
    const GRANT_US: u32 = 8;

    /// Takes what is kept at once, with its key.
    const BUFFER_BYTES: usize = memory::MOST_BYTES + 32;

    /// What the tasks report to the watchdog.
    static CHECK_IN: CheckIn = CheckIn::new();
    /// Between the current loop and the tasks of the loop tick.
    static LINK: CurrentLink = CurrentLink::new();

    #[shared]
    struct Shared {
        interrupts: RingInterrupts<SercosBus>,
        motion: Motion<SercosBus, MotorSide>,
        /// By reference: it is half of what the start would otherwise move over its stack.
        communication: &'static mut Communication<SercosBus>,
    }

    #[local]
    struct Local {
        current: CurrentControl<Inverter>,
        int0: InterruptPin,
        int1: InterruptPin,
        watchdog: Watchdog,
        memory: Memory<ParameterFlash>,
        buffer: &'static mut [u8; BUFFER_BYTES],
    }

    /// Sets up board and chip with interrupts disabled; they arrive as soon as this returns.
    ///
    /// Takes about 2 ms until the chip repeats, in which the ring is open at this station. Then what was saved is looked for, while the chip repeats: some
    /// 10 ms, and every 40 saves the 1 to 2 s of an erase.
    #[init(local = [
        scope: Scope = Scope::new(),
        page: [u8; BUFFER_BYTES] = [0; BUFFER_BYTES],
        place: MaybeUninit<Communication<SercosBus>> = MaybeUninit::uninit(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        board::stack_guard::start(&context.core.MPU);
        let board = Board::new(context.device);
        let Board { bus, motor_side, inverter, int0, int1, mut watchdog, settings, parameter_flash, .. } = board;
        defmt::info!("started by {}", watchdog.reset_cause());
        let crash = board::crash::last(watchdog.reset_cause());
        if let Some(record) = &crash {
            told(record);
        }
        if crash.is_some_and(|record| !record.told && record.in_a_row >= MOST_CRASHES_IN_A_ROW) {
            defmt::error!("{=u8} crashes in a row: out of the ring until the next reset", MOST_CRASHES_IN_A_ROW);
            remain_a_repeater()
        }
        PERMIT.always();
        let buffer = context.local.page;
        let mut memory = Memory::new(parameter_flash);
        let Some(identity) = identity(&settings) else {
            defmt::error!("{=u8} on the address switches is no drive address", settings.address);
            match block_on(remembering::forget_lock(&mut memory, buffer)) {
                Forgetting::NoLock => defmt::info!("no password S-0-0267 was to be forgotten"),
                Forgetting::Forgotten => defmt::warn!("the password S-0-0267 is forgotten"),
                Forgetting::Failed => defmt::error!(
                    "the password S-0-0267 could not be forgotten: once more, and if it stays, have the board replaced"
                ),
            }
            remain_a_repeater()
        };
        let recollection = block_on(remembering::recall(&mut memory, buffer));
        if let Some(trouble) = told_of_memory(&recollection) {
            defmt::warn!("parameters: {=str}", trouble);
        }
        let communication = communication(context.local.place, bus.clone(), identity, recollection);
        let mut drive = match drive::new(bus, motor_side, inverter, &LINK, context.local.scope, communication) {
            Ok(drive) => drive,
            Err(error) => {
                defmt::error!("default parameters: {}", error);
                remain_a_repeater()
            }
        };
        let past = block_on(memory.load_log(buffer, Log::Events)).ok().flatten();
        let last_crash = past.and_then(|log| communication.recall_log(log));
        PERMIT.only_when_granted();
        if let Some(record) = crash.or(last_crash) {
            communication.note_crash(record, task(record.exception));
        }
        if let Err(error) = communication.start(&mut drive.interrupts, &mut drive.motion) {
            defmt::error!("ring controller: {}", error);
            remain_a_repeater()
        }
        defmt::info!("drive {=u8}, {}", settings.address, settings.bit_rate);
        if !watchdog.start() {
            defmt::warn!("debugger attached, watchdog off");
        }
        let Drive { current, interrupts, motion } = drive;
        let shared = Shared { interrupts, motion, communication };
        (shared, Local { current, int0, int1, watchdog, memory, buffer })
    }

    /// Feeds the watchdog, logs what became of the drive, keeps what is to outlive the supply, and sleeps until the next interrupt.
    ///
    /// Holds the cycle's tasks up for the 2 us of a snapshot, once in 8 ms, and the background for the 0.2 ms in which a set of parameters is put
    /// together. A word of flash stops the processor, only while nothing is due: [`Motion::may_stand_still`].
    #[idle(local = [watchdog, memory, buffer], shared = [motion, communication])]
    fn idle(context: idle::Context) -> ! {
        let idle::SharedResources { motion, communication, .. } = context.shared;
        let idle::LocalResources { watchdog, memory, buffer, .. } = context.local;
        let motion = RefCell::new(motion);
        let mut communication = Referred(communication);
        let mut keepers_motion = ByTurns(&motion);
        let mut keeper = pin!(async {
            loop {
                remembering::keep(memory, *buffer, &mut communication, &mut keepers_motion).await;
                yield_now().await;
            }
        });
        let mut motion = ByTurns(&motion);
        // A word has waited for a permit when idle was here last.
        let mut waited = false;
        let mut state = None;
        let mut class_1 = None;
        let mut feedings = 0_u16;
        loop {
            let fed = watchdog.feed(&CHECK_IN);
            if fed {
                feedings = feedings.saturating_add(1);
                if feedings == FEEDINGS_UNTIL_WELL {
                    board::crash::well();
                }
                let now = motion.lock(|motion| motion.snapshot());
                if state.replace(now.state) != Some(now.state) {
                    defmt::info!("{}", now.state);
                }
                if class_1.replace(now.class_1) != Some(now.class_1) {
                    defmt::info!("class 1 diagnostic {=u16:#06x}", now.class_1.bits());
                }
            }
            // The first answer may be one of long ago.
            let wanted = PERMIT.is_wanted();
            let granted = wanted && motion.lock(Motion::may_stand_still) && waited;
            waited = wanted;
            if granted {
                PERMIT.grant(board::timestamp::microseconds().wrapping_add(GRANT_US));
            }
            if granted || fed && !wanted {
                // It never ends.
                let _ = keeper.as_mut().poll(&mut Context::from_waker(Waker::noop()));
                PERMIT.withdraw();
            }
            cortex_m::asm::wfi();
        }
    }

    /// Samples in, compare values out; starts the control loop in the first cycle of a tick, and the velocity loop in the second.
    ///
    /// Contract: the compare values are written before the counter's bottom, where they come into force: 31.2 us behind the middle of the
    /// samples, of which the converters take 2. No lock, no wait, nothing above it; a cycle that comes too late is counted, a second in a
    /// row switches the bridge off.
    #[task(binds = ADC, priority = 5, local = [current])]
    fn current_loop(context: current_loop::Context) {
        let begins_tick = context.local.current.current_loop();
        rtic::pend(if begins_tick { Interrupt::CAN2_TX } else { Interrupt::CAN2_RX1 });
    }

    /// Serves INT0: latches t4's position, acknowledges the chip's events, starts the tasks that they belong to.
    ///
    /// Contract: 8 us, of which 3 to 8 bus accesses take 1.7 to 4.4; nothing is waited for. Runs once more for the trailing
    /// edge that the acknowledgement makes, and then finds nothing (one bus access).
    #[task(binds = EXTI3, priority = 4, local = [int0], shared = [interrupts, motion])]
    fn chip_interrupt_0(context: chip_interrupt_0::Context) {
        let chip_interrupt_0::SharedResources { interrupts, motion, .. } = context.shared;
        context.local.int0.acknowledge();
        let line = context.local.int0.line();
        start((interrupts, motion).lock(|interrupts, motion| interrupts.take(line, motion)));
    }

    /// Serves INT1, exactly as [`chip_interrupt_0`] serves INT0: which source drives which line is one of the chip's unknowns.
    #[task(binds = EXTI2, priority = 4, local = [int1], shared = [interrupts, motion])]
    fn chip_interrupt_1(context: chip_interrupt_1::Context) {
        let chip_interrupt_1::SharedResources { interrupts, motion, .. } = context.shared;
        context.local.int1.acknowledge();
        let line = context.local.int1.line();
        start((interrupts, motion).lock(|interrupts, motion| interrupts.take(line, motion)));
    }

    /// t3: the command values of this cycle come into force; in CP1 and CP2 the AT that was asked for is armed.
    ///
    /// Contract: 16 us from the chip's interrupt to the command in force with the slowest bus timing; 5 to 8 bus accesses.
    #[task(binds = CAN1_TX, priority = 4, shared = [motion])]
    fn command_valid(mut context: command_valid::Context) {
        CHECK_IN.begun(Tasks::COMMAND_VALID.bits());
        start(context.shared.motion.lock(Motion::command_valid));
    }

    /// t4: the position that the hardware latched, and the status word, go into the AT of the next cycle.
    ///
    /// Contract: 30 us from the chip's interrupt (t5, S-0-0005), t3 in between; 2 to 18 bus accesses. The sample itself has no jitter, whenever this runs.
    #[task(binds = CAN1_RX0, priority = 4, shared = [motion])]
    fn capture_feedback(mut context: capture_feedback::Context) {
        CHECK_IN.begun(Tasks::CAPTURE_FEEDBACK.bits());
        context.shared.motion.lock(Motion::capture_feedback);
    }

    /// Position and velocity loop, order to the current loop, and the flywheel that stands in for a missing t3.
    ///
    /// Contract: the order is there before the next current loop, 62.5 us after the one that started this, so that it counts from the second
    /// cycle of the tick on, also where t3, t4 and a half of the supervision come before; a cycle later where a parameter is just written.
    /// `cargo xtask budget` works both out. The chip is looked at only while its timers are being learned, in CP0.
    #[task(binds = CAN2_TX, priority = 4, local = [polls: bool = true], shared = [interrupts, motion])]
    fn control_loop(context: control_loop::Context) {
        let control_loop::SharedResources { mut interrupts, mut motion, .. } = context.shared;
        CHECK_IN.tick();
        let mut work = motion.lock(Motion::control_loop);
        if *context.local.polls {
            work |= (&mut interrupts, &mut motion).lock(|interrupts, motion| interrupts.poll(motion));
            *context.local.polls = interrupts.lock(|interrupts| interrupts.need_polling());
        }
        start(work);
    }

    /// The velocity loop once more, half a tick after the control loop: its current is put into the order that is in force.
    ///
    /// Contract: done before the next current loop, 62.5 us after the one that started this, also where t3 and t4 come before. No bus access.
    #[task(binds = CAN2_RX1, priority = 4, shared = [motion])]
    fn velocity_loop(mut context: velocity_loop::Context) {
        CHECK_IN.regulated();
        context.shared.motion.lock(Motion::velocity_loop);
    }

    /// Bus, loads, temperatures, encoder, brake, state machine and diagnostic words: all whose times are milliseconds, by halves.
    ///
    /// Contract: done before the next loop tick. What it decides acts in that tick; what must be faster is in the current loop, the control
    /// loop or the hardware.
    #[task(binds = CAN2_RX0, priority = 4, shared = [motion])]
    fn supervision(mut context: supervision::Context) {
        CHECK_IN.begun(Tasks::SUPERVISION.bits());
        CHECK_IN.supervised();
        start(context.shared.motion.lock(Motion::supervise));
    }

    /// Follows the MST into another phase, or falls back to CP0, and sets the chip up for it.
    ///
    /// Contract: done before the second MST of the new phase; the cycle's tasks go on meanwhile and are held up only while settings are
    /// handed over.
    #[task(binds = CAN1_RX1, priority = 2, shared = [interrupts, motion, communication])]
    fn phase_change(context: phase_change::Context) {
        CHECK_IN.begun(Tasks::PHASE_CHANGE.bits());
        let phase_change::SharedResources { mut interrupts, mut motion, mut communication, .. } = context.shared;
        let report = communication.lock(|communication| communication.phase_change(&mut interrupts, &mut motion));
        if let Some(report) = report {
            defmt::info!("{}", report);
        }
    }

    /// One step of the service channel: reads or writes an element of a data block, or answers with an error.
    ///
    /// Contract: 100 us from the end of the MDT to the release of the container, for every element; the master sees "busy" meanwhile, the
    /// cycle is not touched. Then, and when the motion side has news, diagnosis and error memory are brought up to date.
    #[task(binds = CAN1_SCE, priority = 2, shared = [motion, communication])]
    fn service_channel(context: service_channel::Context) {
        CHECK_IN.begun(Tasks::SERVICE_CHANNEL.bits());
        let service_channel::SharedResources { mut motion, mut communication, .. } = context.shared;
        communication.lock(|communication| communication.service_channel(&mut motion));
    }

    /// Sets the vectors of the tasks pending.
    fn start(work: Tasks) {
        if work.is_empty() {
            return;
        }
        CHECK_IN.started(work.bits());
        for (task, vector) in [
            (Tasks::COMMAND_VALID, Interrupt::CAN1_TX),
            (Tasks::CAPTURE_FEEDBACK, Interrupt::CAN1_RX0),
            (Tasks::SUPERVISION, Interrupt::CAN2_RX0),
            (Tasks::PHASE_CHANGE, Interrupt::CAN1_RX1),
            (Tasks::SERVICE_CHANNEL, Interrupt::CAN1_SCE),
        ] {
            if work.contains(task) {
                rtic::pend(vector);
            }
        }
    }

    /// `None`: the switches show no drive address. A record that cannot be read keeps the drive out of CP4.
    fn identity(settings: &switches::Settings) -> Option<Identity> {
        let production = Production::read(board::production_record::bytes());
        if let Production::Unreadable(error) = &production {
            defmt::error!("production record: {}", error);
        }
        Some(Identity {
            address: DriveAddress::new(settings.address)?,
            bit_rate: settings.bit_rate,
            master_clock: chip_control::MASTER_CLOCK,
            transceiver: chip_control::TRANSCEIVER,
            production,
        })
    }

    /// In a frame of its own: the start would keep on its stack what is on its way to its place.
    #[inline(never)]
    fn communication(
        place: &'static mut MaybeUninit<Communication<SercosBus>>,
        bus: SercosBus,
        identity: Identity,
        recollection: Recollection<'_>,
    ) -> &'static mut Communication<SercosBus> {
        place.write(Communication::new::<MotorSide>(bus, identity, recollection))
    }

    /// What is to be logged of what was found in the memory; `None`: nothing.
    const fn told_of_memory(recollection: &Recollection<'_>) -> Option<&'static str> {
        match recollection {
            Recollection::Set(_) => None,
            Recollection::Unfinished(_) => Some("the last save was cut, the set before it is in force"),
            Recollection::Empty => Some("nothing was ever saved"),
            Recollection::Damaged => Some("what was saved cannot be read any more"),
        }
    }

    /// Logs the last crash; one that has been told of was news at an earlier start.
    fn told(record: &CrashRecord) {
        let crash = record.told_of(task(record.exception));
        if record.told {
            defmt::info!("before: {}, {=u32} crashes", defmt::Display2Format(&crash), record.count);
        } else {
            defmt::error!("{}, {=u32} crashes", defmt::Display2Format(&crash), record.count);
        }
    }

    /// The task that is bound to an exception.
    fn task(exception: u16) -> &'static str {
        const FIRST_INTERRUPT: u16 = 16;
        let Some(number) = exception.checked_sub(FIRST_INTERRUPT) else { return "idle or init" };
        let tasks = [
            (Interrupt::ADC, "current_loop"),
            (Interrupt::EXTI3, "chip_interrupt_0"),
            (Interrupt::EXTI2, "chip_interrupt_1"),
            (Interrupt::CAN1_TX, "command_valid"),
            (Interrupt::CAN1_RX0, "capture_feedback"),
            (Interrupt::CAN2_TX, "control_loop"),
            (Interrupt::CAN2_RX0, "supervision"),
            (Interrupt::CAN2_RX1, "velocity_loop"),
            (Interrupt::CAN1_RX1, "phase_change"),
            (Interrupt::CAN1_SCE, "service_channel"),
        ];
        tasks.iter().find(|(vector, _)| *vector as u16 == number).map_or("an unbound interrupt", |(_, name)| *name)
    }

    /// For want of a drive: the bridge is off and stays off, the brake holds, and the chip repeats what it receives, as after its reset, so
    /// that the ring goes on without us.
    fn remain_a_repeater() -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }
}
