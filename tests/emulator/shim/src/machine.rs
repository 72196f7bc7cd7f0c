//! The few real registers of QEMU's machine that the shim uses, and raw memory.

/// Count of QEMU's TIM5: virtual nanoseconds, never set, wraps at 2^32.
pub(crate) const TIMER_COUNT: u32 = 0x4000_0C24;
/// Reload register of QEMU's TIM5. As long as the count has never been written, QEMU 7.2 interrupts so many nanoseconds after each
/// write and repeats; [`timer_keeps_time`] checks that it does.
pub(crate) const TIMER_RELOAD: u32 = 0x4000_0C2C;
const TIMER_STATUS: u32 = 0x4000_0C10;
const TIMER_CONTROL: u32 = 0x4000_0C00;
const TIMER_INTERRUPT_ENABLE: u32 = 0x4000_0C0C;
/// TIM5 on the STM32F405.
pub(crate) const TIMER_INTERRUPT: u32 = 50;

const INTERRUPT_SET_ENABLE: u32 = 0xE000_E100;
const INTERRUPT_SET_PENDING: u32 = 0xE000_E200;
const INTERRUPT_CLEAR_PENDING: u32 = 0xE000_E280;
const INTERRUPT_ACTIVE: u32 = 0xE000_E300;
const VECTOR_TABLE_OFFSET: u32 = 0xE000_ED08;
const MPU_CONTROL: u32 = 0xE000_ED94;
const MPU_NUMBER: u32 = 0xE000_ED98;
const MPU_BASE: u32 = 0xE000_ED9C;
const MPU_ATTRIBUTES: u32 = 0xE000_EDA0;

/// Reads a word of memory or of a register.
pub(crate) fn read(address: u32) -> u32 {
    // SAFETY: the shim runs in a simulator with every address to its own; the worst a wrong address does is a fault, which
    // ends the run loudly. Callers pass aligned addresses.
    unsafe { core::ptr::read_volatile(address as *const u32) }
}

/// Reads a half-word of memory.
pub(crate) fn read_half(address: u32) -> u16 {
    // SAFETY: as in `read`.
    unsafe { core::ptr::read_volatile(address as *const u16) }
}

/// Writes a word of memory or of a register.
pub(crate) fn write(address: u32, value: u32) {
    // SAFETY: as in `read`; the addresses written are QEMU's registers, the shim's own RAM, or what the host names.
    unsafe { core::ptr::write_volatile(address as *mut u32, value) }
}

/// Starts the tick counter and lets its interrupt through. Returns whether the timer interrupts when it is expected to.
pub(crate) fn start_timer() -> bool {
    write(TIMER_CONTROL, 1);
    write(TIMER_INTERRUPT_ENABLE, 1);
    let in_time = timer_keeps_time();
    write(TIMER_RELOAD, u32::MAX);
    drop_timer_interrupt();
    write(INTERRUPT_SET_ENABLE + (TIMER_INTERRUPT / 32) * 4, 1 << (TIMER_INTERRUPT % 32));
    in_time
}

/// Other versions of QEMU may count from elsewhere: then every simulated time would be wrong.
fn timer_keeps_time() -> bool {
    const ALARM: u32 = 10_000;
    const TOLERANCE: u32 = 50;
    let start = read(TIMER_COUNT);
    write(TIMER_RELOAD, ALARM);
    loop {
        let waited = read(TIMER_COUNT).wrapping_sub(start);
        if read(TIMER_STATUS) & 1 != 0 {
            return waited.abs_diff(ALARM) < TOLERANCE;
        }
        if waited > 2 * ALARM {
            return false;
        }
    }
}

/// Forgets a timer interrupt that fired while the shim was at work.
pub(crate) fn drop_timer_interrupt() {
    write(INTERRUPT_CLEAR_PENDING + (TIMER_INTERRUPT / 32) * 4, 1 << (TIMER_INTERRUPT % 32));
}

/// Pends the interrupts of `word` (32 each): edges always, levels unless their handler is active.
pub(crate) fn pend(word: u32, edges: u32, levels: u32) {
    let mut pending = edges;
    if levels != 0 {
        pending |= levels & !read(INTERRUPT_ACTIVE + word * 4);
    }
    if pending != 0 {
        write(INTERRUPT_SET_PENDING + word * 4, pending);
    }
}

/// Moves the vector table.
pub(crate) fn set_vector_table(address: u32) {
    write(VECTOR_TABLE_OFFSET, address);
}

/// Closes 0x4000_0000 to 0x7FFF_FFFF and 0xA000_0000 to 0xBFFF_FFFF: no access, execute never; the rest as by default.
pub(crate) fn close_peripherals() {
    const NO_ACCESS: u32 = 1 << 28;
    const ENABLE: u32 = 1;
    for (number, base, size) in [(0, 0x4000_0000, 29), (1, 0xA000_0000, 28)] {
        write(MPU_NUMBER, number);
        write(MPU_BASE, base);
        write(MPU_ATTRIBUTES, NO_ACCESS | size << 1 | ENABLE);
    }
    const PRIVILEGED_DEFAULT: u32 = 1 << 2;
    write(MPU_CONTROL, PRIVILEGED_DEFAULT | ENABLE);
}
