//! Parameters of this product: amplifier, motor, brake, filters, oscilloscope, identification.

use super::access::Access;

sercos::data_blocks! {
    /// In ascending order.
    pub(super) const PRODUCT_PARAMETERS accessed by Access;

    /// Up to eight numbers of the control's own choice.
    P 7 "Application data" [""] LONGS/0 written ALWAYS () = 0 => Parameter, stored;
    /// A text of the control's own choice, as the serial number of the machine; up to 40 characters.
    P 8 "Application identifier" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Largest current that weakens the field above the speed that the bus voltage reaches, in per cent of the smaller of S-0-0109 and S-0-0110; 0: none, and a speed above it ends in an overcurrent.
    P 107 "Field weakening current" ["%"] U16/1 written ALWAYS (0 to 900) = 500 => Parameter, stored, restricted;
    /// Pole pairs of the motor; another number makes the commutation angle unknown.
    P 110 "Pole pairs" [""] U16/0 written IN_CP2_CP3 (1 to 64) = 4 => Parameter, stored, needed_for_cp4;
    /// Resistance of a phase.
    P 111 "Winding resistance" ["Ohm"] U32/3 written ALWAYS (1 to 1_000_000) = 1_200 => Parameter, stored;
    /// Inductance of a phase in the d axis; for the decoupling.
    P 112 "Direct inductance" ["mH"] U32/3 written ALWAYS (0 to 1_000_000) = 6_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Inductance of a phase in the q axis; for the decoupling.
    P 113 "Quadrature inductance" ["mH"] U32/3 written ALWAYS (0 to 1_000_000) = 6_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Torque per ampere RMS, as the name plate has it: 0.01654 times the voltage constant in V RMS between two phases at 1000 rpm. Flux of the magnets follows from it and P-0-0110.
    P 114 "Torque constant" ["Nm/A"] U32/6 written ALWAYS (0 to 500_000_000) = 1_131_371 => Parameter, stored, needed_for_cp4, restricted;
    /// Electrical angle at the encoder's index; -1: not known, the angle is then only that of the alignment.
    P 115 "Commutation angle at the index" ["deg"] I32/2 written ALWAYS (-1 to 35_999) = -1 => Parameter, stored;
    /// Largest current of the search for the commutation angle, in per cent of the smaller of S-0-0109 and S-0-0110; ten times the friction.
    P 116 "Alignment current" ["%"] U16/1 written ALWAYS (1 to 1_000) = 500 => Parameter, stored, needed_for_cp4;
    /// 1: the encoder's index is connected, and lost or added increments are found by it.
    P 117 "Encoder index" [""] BITS/0 written IN_CP2_CP3 (0 to 1) = 1 => Parameter, stored, needed_for_cp4;
    /// Bit 0: there is a holding brake; bit 1: it has a contact; bit 2: the axis stays where it is with its brake open and without torque, and may be aligned so.
    P 120 "Holding brake" [""] BITS/0 written IN_CP2_CP3 (0 to 7) = 0 => Parameter, stored, needed_for_cp4;
    /// Current of the d axis with which the torque is proven before the brake opens, in per cent of the smaller of S-0-0109 and S-0-0110.
    P 121 "Test current of the torque proof" ["%"] U16/1 written ALWAYS (10 to 1_000) = 100 => Parameter, stored, needed_for_cp4, restricted;
    /// Movement beyond which a brake does not hold.
    P 122 "Window of the brake test" ["deg"] U16/2 written ALWAYS (1 to 36_000) = 100 => Parameter, stored, needed_for_cp4;
    /// Time in which the torque goes after the brake has closed, and for which the axis is watched then.
    P 123 "Time of the brake test" ["ms"] U16/0 written ALWAYS (1 to 10_000) = 20 => Parameter, stored, needed_for_cp4;
    /// Of the motor's winding.
    P 130 "Thermal time constant of the motor" ["s"] U32/3 written IN_CP2_CP3 (1_000 to 3_600_000) = 60_000 => Parameter, stored, needed_for_cp4;
    /// 0 none, 1 KTY84-130, 2 Pt1000, 3 resistor with negative coefficient of 10 kOhm (B25/85 3 435 K), 4 PTC thermistors, one to three in series, 5 switch that opens when it is hot. With 0, 4 and 5 S-0-0383 shows -200.0, and S-0-0201 and S-0-0204 have no effect: 4 shuts down above 3.3 kOhm, 5 when it opens, with F102H.
    P 134 "Temperature sensor of the motor" [""] U16/0 written IN_CP2_CP3 (0 to 5) = 1 => Parameter, stored, needed_for_cp4;
    /// What an error does to a motor that runs: 0 velocity command zero at the torque limit, 1 torque-free, 2 ramp S-0-0138.
    P 140 "Reaction to errors" [""] U16/0 written ALWAYS (0 to 2) = 2 => Parameter, stored;
    /// Path between position commands: 0 straight lines, 1 cubic, 2 cubic if S-0-0001 is 4 ms or more and else straight lines.
    P 141 "Interpolation" [""] U16/0 written ALWAYS (0 to 2) = 2 => Parameter, stored;
    /// Friction that grows with the velocity.
    P 142 "Viscous friction compensation" ["mA/rpm"] U16/3 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Filter 1 of the current command: 0 off, 1 low-pass, 2 notch.
    P 170 "Current filter 1" [""] U16/0 written ALWAYS (0 to 2) = 0 => Parameter, stored;
    /// Of filter 1.
    P 171 "Frequency of current filter 1" ["Hz"] U16/1 written ALWAYS (100 to 35_000) = 8_000 => Parameter, stored;
    /// Damping of the low-pass in 0.001 (200 to 2000), or width of the notch in 0.1 Hz (100 to 20 000).
    P 172 "Width of current filter 1" [""] U16/0 written ALWAYS (100 to 20_000) = 707 => Parameter, stored;
    /// What the notch leaves of its centre frequency.
    P 173 "Depth of current filter 1" ["%"] U16/2 written ALWAYS (0 to 10_000) = 0 => Parameter, stored;
    /// Filter 2 of the current command: 0 off, 1 low-pass, 2 notch.
    P 174 "Current filter 2" [""] U16/0 written ALWAYS (0 to 2) = 0 => Parameter, stored;
    /// Of filter 2.
    P 175 "Frequency of current filter 2" ["Hz"] U16/1 written ALWAYS (100 to 35_000) = 8_000 => Parameter, stored;
    /// As P-0-0172.
    P 176 "Width of current filter 2" [""] U16/0 written ALWAYS (100 to 20_000) = 707 => Parameter, stored;
    /// What the notch leaves of its centre frequency.
    P 177 "Depth of current filter 2" ["%"] U16/2 written ALWAYS (0 to 10_000) = 0 => Parameter, stored;
    /// What channel 1 records: the IDN of a parameter of two or four bytes, of a command or feedback value or of a word of bits, or a signal inside the loops (F000H up); 0: nothing. All settings count from the next arming on.
    P 201 "Oscilloscope signal 1" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF004 => Parameter, restricted;
    /// As P-0-0201, for channel 2.
    P 202 "Oscilloscope signal 2" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF003 => Parameter, restricted;
    /// As P-0-0201, for channel 3.
    P 203 "Oscilloscope signal 3" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF006 => Parameter, restricted;
    /// As P-0-0201, for channel 4.
    P 204 "Oscilloscope signal 4" [""] HEX/0 written ALWAYS (0 to 65_535) = 0 => Parameter, restricted;
    /// Bits 7 to 0: the channel that triggers, 0 to 3 for channel 1 to 4. Bits 15 to 8: 0 at once, 1 it rises to P-0-0206, 2 it falls to P-0-0206.
    P 205 "Oscilloscope trigger" [""] HEX/0 written ALWAYS (0 to 65_535) = 0 => Parameter, restricted;
    /// In the weight of the signal that triggers.
    P 206 "Oscilloscope trigger level" [""] I32/0 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter;
    /// How many of the 2048 points lie before the trigger.
    P 207 "Oscilloscope pre-trigger" [""] U16/0 written ALWAYS (0 to 2_047) = 128 => Parameter;
    /// 0: a point every current loop (62.5 us); n: a point every n loop ticks of 125 us.
    P 208 "Oscilloscope sampling" [""] U16/0 written ALWAYS (0 to 65_535) = 1 => Parameter;
    /// Writing 1 arms with P-0-0201 to P-0-0208, or is refused if they do not go together; 0 stops. Reads what was written last.
    P 209 "Oscilloscope control" [""] U16/0 written ALWAYS (0 to 1) = 0 => Parameter, restricted;
    /// Highest velocity of P-0-0225 and P-0-0226, and by its sign their direction; half of it is used too.
    P 218 "Velocity of the identification" ["rpm"] I32/4 written ALWAYS (-2_147_483_647 to 2_147_483_647) = 3_000_000 => Parameter, stored;
    /// Ramps of P-0-0225 and P-0-0226; where S-0-0136 and S-0-0137 are set, not above them. For P-0-0226 it should take some times the current of the friction.
    P 219 "Acceleration of the identification" ["rad/s^2"] U32/3 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Motor and load at the motor's shaft.
    P 221 "Moment of inertia" ["kg cm^2"] U32/3 written ALWAYS (1 to 1_000_000_000) = 10_000 => Parameter, stored;
    /// At -3 dB, for P-0-0220; at most 0.17 of the frequency of the bridge.
    P 222 "Bandwidth of the current loop" ["Hz"] U16/0 written ALWAYS (10 to 2_716) = 2_000 => Parameter, stored;
    /// Where its open loop crosses, for P-0-0220.
    P 223 "Bandwidth of the velocity loop" ["Hz"] U16/0 written ALWAYS (1 to 666) = 40 => Parameter, stored;
    /// How far P-0-0225 and P-0-0226 may turn the motor from where it stands; they fail and HALT stops the motor when it is further.
    P 229 "Movement of the identification" ["rev"] U32/2 written ALWAYS (1 to 104_857_600) = 1_500 => Parameter, stored;
    /// By how much the shaft is where S-0-0047 said later than one cycle S-0-0001 after the t3 at which it became valid; negative: earlier. For drives of another make on the same line shaft.
    P 230 "Shift of the set-point in time" ["us"] I16/0 written IN_CP2_CP3 (-800 to 800) = 0 => Parameter, stored;
    /// Time constant with which S-0-0348 follows the accelerations of position commands; P-0-0220 sets it.
    P 231 "Smoothing time of the acceleration feed-forward" ["us"] U16/0 written ALWAYS (0 to 20_000) = 0 => Parameter, stored;
    /// Resistor that the drive switches across the DC link, on above 95 % and off below 92 % of P-0-0105, with and without torque; 0: none.
    P 235 "Resistance of the brake chopper" ["Ohm"] U16/1 written IN_CP2_CP3 (0 to 65_535) = 0 => Parameter, stored, needed_for_cp4;
    /// Power that the resistor carries for ever: 100 % of P-0-0238.
    P 236 "Continuous power of the chopper resistor" ["W"] U32/0 written IN_CP2_CP3 (1 to 1_000_000) = 100 => Parameter, stored, needed_for_cp4;
    /// Of the resistor. P-0-0236 times it is the energy of a short pulse that heats a cold resistor to 100 %.
    P 237 "Thermal time constant of the chopper resistor" ["s"] U32/3 written IN_CP2_CP3 (100 to 3_600_000) = 10_000 => Parameter, stored, needed_for_cp4;
    /// 0: there is no second encoder, telegram types 11 to 13 and S-0-0053 are refused; 1: the motor encoder stands in for it.
    P 2705 "Source of position feedback 2" [""] U16/0 written IN_CP2_CP3 (0 to 1) = 0 => Parameter, stored;
}
