//! Words of bits, and data blocks of one bit.

use super::access::Access;
use crate::signal::control_bits::Enable;
use crate::signal::word::{Word, Word as Bit};

sercos::data_blocks! {
    /// In ascending order.
    pub(super) const BITS accessed by Access;

    /// Errors that shut the drive down, until S-0-0099 clears them.
    S 11 "Class 1 diagnostic (C1D)" [""] BITS/0 written NEVER () = 0 => Word(Class1);
    /// Warnings: bit 0 load of motor or amplifier, 1 amplifier temperature (S-0-0200), 2 motor temperature (S-0-0201), 9 switched on without main power, 11 velocity deviation (S-0-0377), 15 see S-0-0181. Reading it over the service channel clears bit 12 of the status word.
    S 12 "Class 2 diagnostic (C2D)" [""] BITS/0 written NEVER () = 0 => Word(Class2);
    /// Operation status. Reading it over the service channel clears bit 11 of the status word.
    S 13 "Class 3 diagnostic (C3D)" [""] BITS/0 written NEVER () = 0 => Word(Class3);
    /// Phase in bits 2 to 0; communication errors in bits 3 to 9 (10, duplicate address, cannot be seen by a slave), until S-0-0099 clears them.
    S 14 "Interface status" [""] BITS/0 written NEVER () = 0 => Word(InterfaceStatus);
    /// The errors behind C1D bit 15: bit 0 amplifier fault, 1 current sensor, 2 current loop too late, 3 brake, 4 safe torque off, 5 its channels contradict each other, 6 overspeed, 7 loops lost the ring, 8 wire of a temperature sensor broken, 9 to 11 search for the commutation angle, 12 command jumped, 13 motor phase open, 14 no saved parameters, 15 temperature sensor short-circuited.
    S 129 "Manufacturer class 1 diagnostic" [""] BITS/0 written NEVER () = 0 => Word(Manufacturer1);
    /// The control word of the last MDT.
    S 134 "Master control word" [""] BITS/0 written NEVER () = 0 => Word(Control);
    /// The status word of the last AT.
    S 135 "Drive status word" [""] BITS/0 written NEVER () = 0 => Word(Status);
    /// Bits 0 to 3: positive and negative edge of probe 1 and of probe 2 taken since they were armed.
    S 179 "Probe status" [""] BITS/0 written NEVER () = 0 => Word(ProbeStatus);
    /// The warnings behind C2D bit 15: bit 0 loops not locked to the ring in CP4, 1 telegram lost within the last second, 2 amplifier fault without torque, 3 zero of the current sensors not known, 4 limit of the MDT out of range, 5 DC link full and braking limited, 6 chopper resistor at 90 %, 7 chopper off because its resistor is too hot, 8 amplifier unknown and no CP4.
    S 181 "Manufacturer class 2 diagnostic" [""] BITS/0 written NEVER () = 0 => Word(Manufacturer2);
    /// The states behind C3D bit 15: bit 0 loops locked to the ring, 1 axis parked, 2 parameters locked by the password.
    S 182 "Manufacturer class 3 diagnostic" [""] BITS/0 written NEVER () = 0 => Word(Manufacturer3);
    /// Bit 0 is control word bit 6 of the last MDT.
    S 300 "Real-time control bit 1" [""] BITS/0 written NEVER () = 0 => Bit(Control, 6);
    /// Bit 0 is control word bit 7 of the last MDT.
    S 302 "Real-time control bit 2" [""] BITS/0 written NEVER () = 0 => Bit(Control, 7);
    /// Bit 0 is C2D bit 0: load of motor or amplifier.
    S 310 "Overload warning" [""] BITS/0 written NEVER () = 0 => Bit(Class2, 0);
    /// Bit 0 is C2D bit 1: heat sink warmer than S-0-0200.
    S 311 "Amplifier overtemperature warning" [""] BITS/0 written NEVER () = 0 => Bit(Class2, 1);
    /// Bit 0 is C2D bit 2: motor warmer than S-0-0201.
    S 312 "Motor overtemperature warning" [""] BITS/0 written NEVER () = 0 => Bit(Class2, 2);
    /// Bit 0 is C2D bit 9: switched on without main power.
    S 319 "Undervoltage warning" [""] BITS/0 written NEVER () = 0 => Bit(Class2, 9);
    /// Bit 0 is C2D bit 11: velocity deviation beyond S-0-0377.
    S 321 "Excessive velocity deviation" [""] BITS/0 written NEVER () = 0 => Bit(Class2, 11);
    /// Bit 0 is C3D bit 0.
    S 330 "Status n_feedback = n_command" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 0);
    /// Bit 0 is C3D bit 1.
    S 331 "Status n_feedback = 0" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 1);
    /// Bit 0 is C3D bit 2.
    S 332 "Status n_feedback < nx" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 2);
    /// Bit 0 is C3D bit 3.
    S 333 "Status T >= Tx" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 3);
    /// Bit 0 is C3D bit 4.
    S 334 "Status T >= Tlimit" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 4);
    /// Bit 0 is C3D bit 5.
    S 335 "Status n_command > n_limit" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 5);
    /// Bit 0 is C3D bit 6: the following distance is within S-0-0057, and a drive that moves by itself has arrived.
    S 336 "Status in position" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 6);
    /// Bit 0 is C3D bit 8: the drive goes to a target, and the position is within S-0-0057 of it.
    S 338 "Status position feedback = active target position" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 8);
    /// Bit 0 is C3D bit 11: the drive goes to a target, and the position is within S-0-0261 of it.
    S 341 "Status in coarse position" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 11);
    /// Bit 0 is C3D bit 12: the drive goes to a target, and its internal position command has arrived there.
    S 342 "Status target position attained" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 12);
    /// Bit 0 is C3D bit 13: the internal position command of a drive that goes to a target stands, at the target or (HALT, S-0-0108, S-0-0346) before it.
    S 343 "Status interpolator halted" [""] BITS/0 written NEVER () = 0 => Bit(Class3, 13);
    /// Bit 0: the home switch, that at the drive or, where S-0-0147 bit 2 is 0, what the control has written. Whatever has another owner, the input or a bit of the MDT (S-0-0301, 303, 27), takes no other value over the service channel (700CH); S-0-0405 to 0407 and P-0-0019 likewise.
    S 400 "Home switch" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Enable(HomeSwitch), restricted;
    /// Bit 0: level of probe 1.
    S 401 "Probe 1" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 1);
    /// Bit 0: level of probe 2.
    S 402 "Probe 2" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 2);
    /// Bit 0: the position refers to the reference point.
    S 403 "Position feedback value status" [""] BITS/0 written NEVER () = 0 => Word(PositionStatus);
    /// Bit 0 from 0 to 1 arms probe 1.
    S 405 "Probe 1 enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Enable(Probe1), restricted;
    /// Bit 0 from 0 to 1 arms probe 2.
    S 406 "Probe 2 enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Enable(Probe2), restricted;
    /// Bit 0: switch and marker may be taken, if S-0-0147 bit 4 asks for it.
    S 407 "Homing enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Enable(Homing), restricted;
    /// Bit 0: the marker has been found.
    S 408 "Reference marker pulse registered" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 3);
    /// Bit 0: positive edge of probe 1 taken.
    S 409 "Probe 1 positive latched" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 4);
    /// Bit 0: negative edge of probe 1 taken.
    S 410 "Probe 1 negative latched" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 5);
    /// Bit 0: positive edge of probe 2 taken.
    S 411 "Probe 2 positive latched" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 6);
    /// Bit 0: negative edge of probe 2 taken.
    S 412 "Probe 2 negative latched" [""] BITS/0 written NEVER () = 0 => Bit(Signals, 7);
    /// Bit 0 is bit 0 of the S-0-0346 that has taken S-0-0282 over last.
    S 419 "Positioning acknowledge" [""] BITS/0 written NEVER () = 0 => Bit(Positioning, 0);
    /// Bit 0 S-0-0419, 1 S-0-0342, 2 S-0-0343, 3 S-0-0338, 4 S-0-0341, 5 S-0-0336; 6 turns by bits 2 and 1 of S-0-0346; 7 a change of bit 0 of it waits; 8 one of the modes 0013H, 001BH, 0213H, 021BH is active.
    S 437 "Positioning status" [""] BITS/0 written NEVER () = 0 => Word(Positioning);
    /// A word of the control's own choice that comes back in the AT. Real-time and signal bits can set its bits.
    P 19 "Application word" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Word(Application), restricted;
}
