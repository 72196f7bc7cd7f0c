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

use stm32f4xx_hal::pac;

use crate::pins;

/// The levels of all inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Levels {
    /// Main power is applied and the DC link is charged.
    pub main_power: bool,
    /// Safe torque off, channels 1 and 2: torque is permitted. They differ only while they switch.
    pub torque_permitted: [bool; 2],
    /// The home switch is actuated (S-0-0400).
    pub home_switch: bool,
    /// The brake reports that it is released.
    pub brake_released: bool,
    /// Probes 1 and 2 are touched (S-0-0401, S-0-0402).
    pub probes: [bool; 2],
    /// The power stage has no fault; without it the bridge cannot be switched on.
    pub power_stage_ready: bool,
}

/// The input side of ports B and C.
#[derive(Debug)]
pub struct Inputs(());

impl Inputs {
    /// The pin table has already set the pins up.
    pub(crate) const fn new() -> Self {
        Self(())
    }

    /// Reads all inputs.
    #[inline(always)]
    pub fn read(&self) -> Levels {
        // SAFETY: reading IDR has no side effect.
        let (port_b, port_c) = unsafe { ((*pac::GPIOB::ptr()).idr().read(), (*pac::GPIOC::ptr()).idr().read()) };
        decode(port_b.bits(), port_c.bits())
    }
}

/// What the levels of ports B and C mean.
#[must_use]
pub const fn decode(port_b: u32, port_c: u32) -> Levels {
    Levels {
        main_power: port_c & pins::MAIN_POWER.mask() != 0,
        torque_permitted: [
            port_c & pins::SAFE_TORQUE_OFF[0].mask() != 0,
            port_c & pins::SAFE_TORQUE_OFF[1].mask() != 0,
        ],
        home_switch: port_c & pins::HOME_SWITCH.mask() != 0,
        brake_released: port_c & pins::BRAKE_FEEDBACK.mask() != 0,
        probes: [port_b & pins::PROBE_1.mask() != 0, port_c & pins::PROBE_2.mask() != 0],
        power_stage_ready: port_b & pins::BREAK_INPUT.mask() != 0,
    }
}

// Every wire broken, each line alone, all lines at once; pins that are not inputs do not matter.
const _: () = {
    const NONE: Levels = Levels {
        main_power: false,
        torque_permitted: [false; 2],
        home_switch: false,
        brake_released: false,
        probes: [false; 2],
        power_stage_ready: false,
    };
    assert!(same(decode(0, 0), NONE));
    assert!(same(decode(0, 1 << 9), Levels { main_power: true, ..NONE }));
    assert!(same(decode(0, 1 << 10), Levels { torque_permitted: [true, false], ..NONE }));
    assert!(same(decode(0, 1 << 11), Levels { torque_permitted: [false, true], ..NONE }));
    assert!(same(decode(0, 1 << 12), Levels { home_switch: true, ..NONE }));
    assert!(same(decode(0, 1 << 13), Levels { brake_released: true, ..NONE }));
    assert!(same(decode(1 << 8, 0), Levels { probes: [true, false], ..NONE }));
    assert!(same(decode(0, 1 << 8), Levels { probes: [false, true], ..NONE }));
    assert!(same(decode(1 << 12, 0), Levels { power_stage_ready: true, ..NONE }));
    assert!(same(decode(!(1 << 8 | 1 << 12), !0x3F00), NONE));
    assert!(same(
        decode(0xFFFF, 0xFFFF),
        Levels {
            main_power: true,
            torque_permitted: [true; 2],
            home_switch: true,
            brake_released: true,
            probes: [true; 2],
            power_stage_ready: true,
        }
    ));
};

/// Equality for the compiler: `==` of a derived type cannot be evaluated in a constant.
const fn same(one: Levels, other: Levels) -> bool {
    one.main_power == other.main_power
        && one.torque_permitted[0] == other.torque_permitted[0]
        && one.torque_permitted[1] == other.torque_permitted[1]
        && one.home_switch == other.home_switch
        && one.brake_released == other.brake_released
        && one.probes[0] == other.probes[0]
        && one.probes[1] == other.probes[1]
        && one.power_stage_ready == other.power_stage_ready
}
