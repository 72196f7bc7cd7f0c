//! Digital inputs of the drive, all of them read by one load of port C and one of port B.
//!
//! A broken wire, an unplugged connector or an unpowered device must read as the safe state, so every line is active high with a
//! pull-down:
//!
//! | line | pin | level 1 | wire broken |
//! |---|---|---|---|
//! | main power | PC9 | DC link charged | no power |
//! | safe torque off, channel 1 | PC10 | torque permitted | torque forbidden |
//! | safe torque off, channel 2 | PC11 | torque permitted | torque forbidden |
//! | home switch | PC12 | switch actuated | not actuated: homing finds no reference and says so |
//! | brake feedback | PC13 | brake reports "released" | brake not released |
//! | probe 1 | PB8, TIM4 CH3 too | touched | not touched |
//! | probe 2 | PC8, TIM8 CH3 too | touched | not touched |
//! | power stage | PB12, TIM1 BKIN too | no fault | fault, and the bridge is off |
//!
//! Probe 1 and the power stage sit on port B because their timers have no pin on port C: they are read some 20 ns later, which nothing
//! depends on, for what has to be exact about them happens in the timers.
//!
//! The two channels of safe torque off act on the gate drivers without us; these inputs only watch them.

use drive::Inputs;
use stm32f4xx_hal::pac;

use crate::pins;

/// Reads all inputs.
#[inline(always)]
pub(crate) fn read() -> Inputs {
    // SAFETY: reading IDR has no side effect.
    let (port_b, port_c) = unsafe { ((*pac::GPIOB::ptr()).idr().read(), (*pac::GPIOC::ptr()).idr().read()) };
    decode(port_b.bits(), port_c.bits())
}

/// What the levels of ports B and C mean.
#[inline(always)]
#[must_use]
pub const fn decode(port_b: u32, port_c: u32) -> Inputs {
    Inputs {
        main_power: port_c & pins::MAIN_POWER.mask() != 0,
        bridge_ready: port_b & pins::BREAK_INPUT.mask() != 0,
        safe_torque_1: port_c & pins::SAFE_TORQUE_OFF[0].mask() != 0,
        safe_torque_2: port_c & pins::SAFE_TORQUE_OFF[1].mask() != 0,
        home_switch: port_c & pins::HOME_SWITCH.mask() != 0,
        brake_open: port_c & pins::BRAKE_FEEDBACK.mask() != 0,
        probe_1: port_b & pins::PROBE_1.mask() != 0,
        probe_2: port_c & pins::PROBE_2.mask() != 0,
    }
}

// Every wire broken, each line alone, all lines at once; pins that are not inputs do not matter.
const _: () = {
    const NONE: Inputs = Inputs {
        main_power: false,
        bridge_ready: false,
        safe_torque_1: false,
        safe_torque_2: false,
        home_switch: false,
        brake_open: false,
        probe_1: false,
        probe_2: false,
    };
    assert!(same(decode(0, 0), NONE));
    assert!(same(decode(0, 1 << 9), Inputs { main_power: true, ..NONE }));
    assert!(same(decode(0, 1 << 10), Inputs { safe_torque_1: true, ..NONE }));
    assert!(same(decode(0, 1 << 11), Inputs { safe_torque_2: true, ..NONE }));
    assert!(same(decode(0, 1 << 12), Inputs { home_switch: true, ..NONE }));
    assert!(same(decode(0, 1 << 13), Inputs { brake_open: true, ..NONE }));
    assert!(same(decode(1 << 8, 0), Inputs { probe_1: true, ..NONE }));
    assert!(same(decode(0, 1 << 8), Inputs { probe_2: true, ..NONE }));
    assert!(same(decode(1 << 12, 0), Inputs { bridge_ready: true, ..NONE }));
    assert!(same(decode(!(1 << 8 | 1 << 12), !0x3F00), NONE));
    assert!(same(
        decode(0xFFFF, 0xFFFF),
        Inputs {
            main_power: true,
            bridge_ready: true,
            safe_torque_1: true,
            safe_torque_2: true,
            home_switch: true,
            brake_open: true,
            probe_1: true,
            probe_2: true,
        }
    ));
};

/// Equality for the compiler: `==` of a derived type cannot be evaluated in a constant.
const fn same(one: Inputs, other: Inputs) -> bool {
    one.main_power == other.main_power
        && one.bridge_ready == other.bridge_ready
        && one.safe_torque_1 == other.safe_torque_1
        && one.safe_torque_2 == other.safe_torque_2
        && one.home_switch == other.home_switch
        && one.brake_open == other.brake_open
        && one.probe_1 == other.probe_1
        && one.probe_2 == other.probe_2
}
