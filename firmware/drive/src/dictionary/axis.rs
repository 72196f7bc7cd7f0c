//! Parameters of the axis and its motor that other drives have too.

use super::access::Access;

sercos::data_blocks! {
    /// In ascending order.
    pub(super) const AXIS_PARAMETERS accessed by Access;

    /// Operation mode of control word bits 11, 9, 8 = 000: 1 torque, 2 velocity, 3 position, 11 position without lag.
    S 32 "Primary operation mode" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 001; 0: none.
    S 33 "Secondary operation mode 1" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 010; 0: none.
    S 34 "Secondary operation mode 2" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 011; 0: none.
    S 35 "Secondary operation mode 3" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Speed of homing.
    S 41 "Homing velocity" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored;
    /// Acceleration of homing.
    S 42 "Homing acceleration" [acceleration] I32 written ALWAYS (1_000 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Bit 0 inverts the velocity command, bit 1 the additive one, bit 2 the velocity feedback.
    S 43 "Velocity polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0045 and S-0-0046 instead of 0.0001 rpm or 1 um/min; bit 5: per second;
    /// bit 6: of the load.
    S 44 "Velocity data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one velocity increment, with the exponent of S-0-0046.
    S 45 "Velocity data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0045.
    S 46 "Velocity data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -4 => Parameter, stored, needed_for_cp4;
    /// Highest position, while bit 4 of S-0-0055 is set and the axis is homed; not below S-0-0050. Beyond it the axis may be held and go back.
    S 49 "Positive position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Lowest position, while bit 4 of S-0-0055 is set and the axis is homed.
    S 50 "Negative position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = -2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Position that S-0-0148 and S-0-0447 give to the place where the motor stands. Not while S-0-0148 is set (700CH).
    S 52 "Reference distance 1" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// Bits 0 and 2, which must be equal, invert all positions that are written and read (docs/polarity.md), bit 1 the additive command; bit 4 switches S-0-0049 and S-0-0050 on, not with modulo data.
    S 55 "Position polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Window of C3D bit 6 (in position), for the following distance, and of C3D bit 8, for the way to S-0-0430.
    S 57 "Position window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 10_000 => Parameter, stored;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0077 and S-0-0078 instead of 0.1 um, or by S-0-0079 instead of 0.0001 deg;
    /// bit 6: of the load; bit 7: modulo.
    S 76 "Position data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Metres of one position increment, with the exponent of S-0-0078, if bit 3 of a linear S-0-0076 is set.
    S 77 "Linear position data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0077.
    S 78 "Linear position data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -7 => Parameter, stored, needed_for_cp4;
    /// Position increments of one revolution of the motor or the load, if bit 3 of a rotary S-0-0076 is set.
    S 79 "Rotational position resolution" [""] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Bit 0 inverts the torque command, bit 1 the additive one, bit 2 the torque feedback.
    S 85 "Torque polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// 0: per cent of S-0-0111, 0.1 % an increment. Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0093 and S-0-0094 instead of 1 N or
    /// 0.01 Nm; bit 6: of the load. Newton metres are made of P-0-0114.
    S 86 "Torque data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Weight of one torque increment in N or Nm, with the exponent of S-0-0094.
    S 93 "Torque data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0093.
    S 94 "Torque data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -1 => Parameter, stored, needed_for_cp4;
    /// Bits of S-0-0012 that set the change bit 12 of the status word.
    S 97 "Mask class 2 diagnostic" [""] BITS/0 written ALWAYS () = 0xFFFF => Parameter, stored;
    /// Bits of S-0-0013 that set the change bit 11 of the status word.
    S 98 "Mask class 3 diagnostic" [""] BITS/0 written ALWAYS () = 0xFFFF => Parameter, stored;
    /// Current for one unit of velocity difference at the motor; one increment is 1 mA s/rad.
    S 100 "Velocity loop proportional gain" ["As/rad"] U16/3 written ALWAYS (0 to 65_535) = 71 => Parameter, stored, restricted;
    /// Time in which the integral part reaches the proportional part; 0 switches the integral part off.
    S 101 "Velocity loop integral action time" ["ms"] U16/1 written ALWAYS (0 to 65_535) = 100 => Parameter, stored, restricted;
    /// Position range if bit 7 of S-0-0076 is set.
    S 103 "Modulo value" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Velocity for one unit of following distance.
    S 104 "Position loop Kv-factor" ["1000/min"] U16/2 written ALWAYS (1 to 65_535) = 100 => Parameter, stored;
    /// Voltage for one ampere of current difference in the d and q axis.
    S 106 "Current loop proportional gain 1" ["V/A"] U16/3 written ALWAYS (1 to 65_535) = 40_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Time in which the integral part of the current loop reaches the proportional part; 0 switches it off.
    S 107 "Current loop integral action time 1" ["ms"] U16/1 written ALWAYS (0 to 65_535) = 50 => Parameter, stored, needed_for_cp4, restricted;
    /// Share of S-0-0259 that positioning may use, within S-0-0091 whatever it is.
    S 108 "Feedrate override" ["%"] U16/2 written ALWAYS (0 to 32_767) = 10_000 => Parameter, stored;
    /// Largest current of the motor, RMS of a phase, as the name plate has it. All currents and gains per ampere are RMS where nothing else is said.
    S 109 "Motor peak current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 14_142 => Parameter, stored, needed_for_cp4;
    /// Current of the motor at its continuous stall torque, RMS of a phase: 100 % of torque data, see S-0-0086.
    S 111 "Motor continuous stall current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 3_536 => Parameter, stored, needed_for_cp4;
    /// The drive never commands a higher velocity, and S-0-0128 refuses one at whose overspeed, a quarter above it, the encoder (S-0-0116, S-0-0256) makes more than 18.6 million increments a second.
    S 113 "Maximum motor speed" ["rpm"] U32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 45_000_000 => Parameter, stored, needed_for_cp4;
    /// Load of the thermal models at which the drive shuts down (C1D bit 0); 100 % is the continuous current for ever.
    S 114 "Load limit of the motor" ["%"] U16/1 written IN_CP2_CP3 (901 to 2_000) = 1_100 => Parameter, stored, needed_for_cp4;
    /// Lines of the motor encoder; four increments each.
    S 116 "Resolution of feedback 1" ["cycles/rev"] U32/0 written IN_CP2_CP3 (1 to 1_048_576) = 2_500 => Parameter, stored, needed_for_cp4;
    /// Revolutions of the motor while the load turns S-0-0122, for data of the load.
    S 121 "Input revolutions of load gear" ["rev"] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 1 => Parameter, stored, needed_for_cp4;
    /// Revolutions of the load while the motor turns S-0-0121.
    S 122 "Output revolutions of load gear" ["rev"] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 1 => Parameter, stored, needed_for_cp4;
    /// What one revolution moves, for linear data: of the load behind the gear, or of the motor with linear data of the motor.
    S 123 "Feed constant" ["mm/rev"] I32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 100_000 => Parameter, stored, needed_for_cp4;
    /// Velocity below which C3D bit 1 (standstill) is set.
    S 124 "Standstill window" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Velocity below which C3D bit 2 is set.
    S 125 "Velocity threshold (nx)" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored;
    /// Torque from which C3D bit 3 is set.
    S 126 "Torque threshold (Tx)" [torque] U16 written ALWAYS (0 to 65_535) = 1_000 => Parameter, stored;
    /// Type of the motor, for the reader; up to 40 characters.
    S 141 "Motor type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// What the axis does, for the reader; up to 40 characters.
    S 142 "Application type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Bit 0: negative direction; bit 1: falling edge of the home switch; bit 2: switch at the drive (else S-0-0400 is written); bit 4: S-0-0407 is evaluated; bit 5: no switch; bit 6: no marker; bit 7: stop at the reference point. With bits 5 and 6 and without 7 the reference is where the motor stands. Not while S-0-0148 is set (700CH).
    S 147 "Homing parameter" [""] BITS/0 written ALWAYS () = 0x0060 => Parameter, stored, restricted;
    /// From the marker, or the edge of the switch, to the reference point.
    S 150 "Reference offset 1" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter, stored;
    /// Coulomb friction that the velocity loop is helped with.
    S 155 "Friction compensation" [torque] U16 written ALWAYS (0 to 1_000) = 0 => Parameter, stored, restricted;
    /// Velocity difference below which C3D bit 0 (n_feedback = n_command) is set.
    S 157 "Velocity window" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Following distance above which the drive shuts down with C1D bit 11; 0: not monitored.
    S 159 "Monitoring window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 300_000 => Parameter, stored;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0161 and S-0-0162 instead of 1 um/s^2 or 0.001 rad/s^2; bit 6: of the load.
    /// Jerks have the same increments a second.
    S 160 "Acceleration data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one acceleration increment, with the exponent of S-0-0162.
    S 161 "Acceleration data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0161.
    S 162 "Acceleration data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -3 => Parameter, stored, needed_for_cp4;
    /// Bit 0: positive edge of probe 1; bit 1: negative edge; bits 2 and 3: those of probe 2. While S-0-0170 runs they count from the write on.
    S 169 "Probe control" [""] BITS/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Motor temperature from which C2D bit 2 warns.
    S 201 "Motor warning temperature" ["C"] U16/1 written ALWAYS (1 to 2_500) = 1_150 => Parameter, stored, needed_for_cp4, restricted;
    /// Motor temperature at which the drive shuts down (C1D bit 2).
    S 204 "Motor shut-down temperature" ["C"] U16/1 written ALWAYS (2 to 2_500) = 1_300 => Parameter, stored, needed_for_cp4, restricted;
    /// From the brake's current to its opening: no movement before.
    S 206 "Drive on delay time" ["ms"] U16/0 written ALWAYS (0 to 10_000) = 100 => Parameter, stored;
    /// From the end of the brake's current to its holding: torque stays so long.
    S 207 "Drive off delay time" ["ms"] U16/0 written ALWAYS (0 to 10_000) = 100 => Parameter, stored;
    /// Bit 0: 0 degrees Celsius, which is all that this drive has.
    S 208 "Temperature data scaling type" [""] BITS/0 written ALWAYS (0 to 0) = 0 => Parameter;
    /// Increments of one line of the motor encoder.
    S 256 "Multiplication 1" [""] U32/0 written NEVER () = 4 => Parameter;
    /// Way to S-0-0430 within which C3D bit 11 (in coarse position) is set.
    S 261 "Coarse position window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Language of S-0-0095, P-0-0003, P-0-0010 and P-0-0011: 0 German (S-0-0095 only, the others stay English), 1 English.
    S 265 "Language selection" [""] U16/0 written ALWAYS (0 to 1) = 1 => Parameter, stored;
    /// 0: what is written of S-0-0192 is kept for the next start, a quarter of a second after the last write and not while torque is on; bit 3 of S-0-0182 is set until then. 1: it is kept by S-0-0264.
    S 269 "Storage mode" [""] BITS/0 written ALWAYS (0 to 1) = 1 => Parameter, stored;
    /// What S-0-0293 saves: up to 16 IDNs of S-0-0192. It is not kept itself.
    S 270 "IDN list of selected backup operation data" [""] IDNS/0 written ALWAYS () = 0 => Parameter, restricted;
    /// Time after which an axis that does not come to a standstill is braked all the same; 0: never.
    S 273 "Maximum drive off delay time" ["ms"] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored;
    /// Bit 3: the encoder counts the other way round. Rotary, incremental, at the motor: all other bits 0.
    S 277 "Position feedback 1 type" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Longest way to the home switch; 0: not limited.
    S 278 "Maximum travel range" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 100; 0: none.
    S 284 "Secondary operation mode 4" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 101; 0: none.
    S 285 "Secondary operation mode 5" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 110; 0: none.
    S 286 "Secondary operation mode 6" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 111; 0: none.
    S 287 "Secondary operation mode 7" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Part of the commanded velocity that goes past the position loop in modes without lag; 100 % leaves no lag, above it the axis leads.
    S 296 "Velocity feed-forward gain" ["%"] U16/1 written ALWAYS (0 to 1_200) = 1_000 => Parameter, stored;
    /// From the edge of the home switch to where the marker counts, at most a revolution of the motor.
    S 299 "Home switch offset 1" [position] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored;
    /// Current for one unit of commanded acceleration at the motor, in mode 11.
    S 348 "Acceleration feed-forward gain" ["mAs^2/rad"] U16/1 written ALWAYS (0 to 65_535) = 0 => Parameter, stored;
    /// Deceleration of positioning; 0: as S-0-0260.
    S 359 "Positioning deceleration" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// Ramp of halt; 0: as S-0-0138.
    S 372 "Drive halt acceleration bipolar" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// Velocity deviation above which C2D bit 11 warns; 0: not monitored.
    S 377 "Velocity feedback monitoring window" [velocity] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored;
    /// Time constant of the velocity that the velocity loop controls, the mean over a tick of 125 us; 0: none, what the encoder moves in 62.5 us. P-0-0220 sets 0 where its steps are not felt.
    S 392 "Velocity feedback filter" ["us"] U16/0 written ALWAYS (0 to 65_500) = 500 => Parameter, stored;
    /// Bits 1 and 0: a modulo axis goes to a position 0 the shortest way, 1 in positive, 2 in negative direction. Bit 2: a target that was not attained when its mode ended or the torque went is, when it comes back, 0 gone to, 1 dropped.
    S 393 "Command value mode" [""] U16/0 written ALWAYS (0 to 6) = 4 => Parameter, stored, restricted;
    /// A position that lies no further than this behind an axis at rest is gone to backwards, whatever S-0-0393 says.
    S 418 "Target position window in modulo mode" [position] I32 written ALWAYS (0 to 2_147_483_647) = 1_000 => Parameter, stored;
}
