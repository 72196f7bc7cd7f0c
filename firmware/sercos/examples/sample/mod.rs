//! The data blocks of a slave that has what the protocol itself needs, and a little of everything else: what the tests of this crate work with,
//! and a table to begin one's own with.

use sercos::data_block::{Location, Selection as Dictionary};

sercos::dictionary! {
    /// The table.
    pub(crate) static DICTIONARY accessed by Location;
    BLOCKS,
}

sercos::data_blocks! {
    /// Its only section.
    const BLOCKS accessed by Location;

    /// Interval of new command values.
    S 1 "Control unit cycle time (tNcyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// Distance of two MSTs from CP3 on.
    S 2 "Communication cycle time (tScyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// End of the MST to the earliest AT of this drive.
    S 3 "Shortest AT transmission starting time (t1min)" ["us"] U16/0 written NEVER () = 12 => Parameter;
    /// End of the own AT to the earliest start of the MDT.
    S 4 "Transmit/receive transition time (tATMT)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// Feedback capture (t4) to the end of the MST before the AT that carries the value.
    S 5 "Minimum feedback processing time (t5)" ["us"] U16/0 written NEVER () = 30 => Parameter;
    /// End of the MST to the start of this drive's AT, from CP3 on.
    S 6 "AT transmission starting time (t1)" ["us"] U16/0 written IN_CP2 (12 to 65_000) = 12 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives capture their feedback.
    S 7 "Feedback acquisition capture point (t4)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives make their command values valid.
    S 8 "Command value valid time (t3)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// First byte of this drive's data record in the MDT, counted from 1 after the address.
    S 9 "Position of data record in MDT" [""] U16/0 written IN_CP2 (1 to 65_531) = 1 => Parameter, needed_for_cp3;
    /// Bytes of all data records of the MDT; even.
    S 10 "Length of MDT" [""] U16/0 written IN_CP2 (4 to 65_534) = 4 => Parameter, needed_for_cp3;
    /// Errors that shut the drive down, until S-0-0099 clears them.
    S 11 "Class 1 diagnostic (C1D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Warnings.
    S 12 "Class 2 diagnostic (C2D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Operation status.
    S 13 "Class 3 diagnostic (C3D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// 0 to 7.
    S 15 "Telegram type parameter" [""] BITS/0 written IN_CP2 () = 2 => Parameter, needed_for_cp3;
    /// IDNs in the AT if the telegram type is 7, in this order.
    S 16 "Configuration list of AT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// Every IDN of the drive.
    S 17 "IDN list of all operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(All);
    /// IDNs that S-0-0127 checks.
    S 18 "IDN list of operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Dictionary(NeededForCp3);
    /// IDNs that S-0-0128 checks.
    S 19 "IDN list of operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Dictionary(NeededForCp4);
    /// IDNs that can be written in CP4.
    S 20 "IDN list of operation data for CP4" [""] IDNS/0 written NEVER () = 0 => Dictionary(ChangeableInCp4);
    /// IDNs that S-0-0127 found invalid.
    S 21 "IDN list of invalid operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs that S-0-0128 found invalid.
    S 22 "IDN list of invalid operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs in this drive's MDT record if the telegram type is 7, in this order.
    S 24 "Configuration list of MDT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// All procedure commands.
    S 25 "IDN list of all procedure commands" [""] IDNS/0 written NEVER () = 0 => Dictionary(Commands);
    /// What the bits of S-0-0144 show, from bit 0 up.
    S 26 "Configuration list for signal status word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// What the bits of S-0-0145 set, from bit 0 up.
    S 27 "Configuration list for signal control word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Firmware and its version.
    S 30 "Manufacturer version" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Operation mode of control word bits 11, 9, 8 = 000.
    S 32 "Primary operation mode" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 001.
    S 33 "Secondary operation mode 1" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 010.
    S 34 "Secondary operation mode 2" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 011.
    S 35 "Secondary operation mode 3" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Velocity command of the control unit.
    S 36 "Velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Added to S-0-0036.
    S 37 "Additive velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Velocity of the motor encoder.
    S 40 "Velocity feedback value 1" [velocity] I32 written NEVER () = 0 => Live, in_at;
    /// Bit 0 inverts the velocity command, bit 1 the additive one, bit 2 the velocity feedback.
    S 43 "Velocity polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bits 2 to 0.
    S 44 "Velocity data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one velocity increment, with the exponent of S-0-0046.
    S 45 "Velocity data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0045.
    S 46 "Velocity data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -4 => Parameter, stored, needed_for_cp4;
    /// Position command of the control unit, compared with S-0-0051 modulo 2^32 or S-0-0103.
    S 47 "Position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Added to S-0-0047.
    S 48 "Additive position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Highest position, while bit 4 of S-0-0055 is set and the axis is homed.
    S 49 "Positive position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Lowest position, while bit 4 of S-0-0055 is set and the axis is homed.
    S 50 "Negative position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = -2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Position of the motor encoder, captured at t4.
    S 51 "Position feedback value 1 (motor feedback)" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Position of the second encoder.
    S 53 "Position feedback value 2 (external feedback)" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Bits 0 and 2, which must be equal, invert all positions that are written and read (docs/polarity.md), bit 1 the additive command.
    S 55 "Position polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bits 2 to 0.
    S 76 "Position data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Metres of one position increment, with the exponent of S-0-0078, if bit 3 of a linear S-0-0076 is set.
    S 77 "Linear position data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0077.
    S 78 "Linear position data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -7 => Parameter, stored, needed_for_cp4;
    /// Position increments of one revolution of the motor or the load, if bit 3 of a rotary S-0-0076 is set.
    S 79 "Rotational position resolution" [""] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Torque command of the control unit.
    S 80 "Torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => Live, in_mdt;
    /// Added to S-0-0080.
    S 81 "Additive torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => Live, in_mdt;
    /// Torque that the measured current makes.
    S 84 "Torque feedback value" [torque] I16 written NEVER () = 0 => Live, in_at;
    /// Bit 0 inverts the torque command, bit 1 the additive one, bit 2 the torque feedback.
    S 85 "Torque polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// 0.
    S 86 "Torque data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Recovery time between two ATs of the same slave; this slave sends one.
    S 87 "Transmit/transmit recovery time (tATAT)" ["us"] U16/0 written NEVER () = 0 => Parameter;
    /// End of the MDT to the start of the next MST.
    S 88 "Receive/receive recovery time (tMTSY)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// End of the MST to the start of the MDT, from CP3 on.
    S 89 "MDT transmission starting time (t2)" ["us"] U16/0 written IN_CP2 (0 to 65_535) = 0 => Parameter, needed_for_cp3;
    /// End of the MDT to the earliest t3.
    S 90 "Command value proceeding time (tMTSG)" ["us"] U16/0 written NEVER () = 2 => Parameter;
    /// Largest velocity that the drive commands in either direction.
    S 91 "Bipolar velocity limit value" [velocity] U32 written ALWAYS (1 to 2_147_483_647) = 30_000_000 => Parameter, stored, needed_for_cp4, in_mdt, restricted;
    /// Largest torque in either direction.
    S 92 "Bipolar torque limit value" [torque] U16 written ALWAYS (0 to 65_535) = 2_000 => Parameter, stored, needed_for_cp4, in_mdt;
    /// Weight of one torque increment in N or Nm, with the exponent of S-0-0094.
    S 93 "Torque data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0093.
    S 94 "Torque data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -1 => Parameter, stored, needed_for_cp4;
    /// State or error of the drive in plain words.
    S 95 "Diagnostic message" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Both bytes are the drive address.
    S 96 "Slave arrangement (SLKN)" [""] HEX/0 written NEVER () = 0 => Live;
    /// Bits of S-0-0012 that set the change bit 12 of the status word.
    S 97 "Mask class 2 diagnostic" [""] BITS/0 written ALWAYS () = 0xFFFF => Parameter, stored;
    /// Clears errors whose cause is gone.
    S 99 "Reset class 1 diagnostic" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// Position range if bit 7 of S-0-0076 is set.
    S 103 "Modulo value" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Velocity for one unit of following distance.
    S 104 "Position loop Kv-factor" ["1000/min"] U16/2 written ALWAYS (1 to 65_535) = 100 => Parameter, stored;
    /// The drive never commands a higher velocity.
    S 113 "Maximum motor speed" ["rpm"] U32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 60_000_000 => Parameter, stored, needed_for_cp4;
    /// Checks everything that CP3 needs.
    S 127 "CP3 transition check" [""] COMMAND/0 written IN_CP2 () = 0 => Command;
    /// Checks everything that CP4 needs.
    S 128 "CP4 transition check" [""] COMMAND/0 written IN_CP3 () = 0 => Command;
    /// Ramp of halt and of stopping after an error or Drive OFF.
    S 138 "Bipolar acceleration limit value" [acceleration] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored, in_mdt, restricted;
    /// Type of the motor, for the reader.
    S 141 "Motor type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// What the axis does, for the reader.
    S 142 "Application type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Finds the reference point in the way of S-0-0147, gives it the position S-0-0052, and sets S-0-0403 bit 0.
    S 148 "Drive controlled homing procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// Bits 2 to 0.
    S 160 "Acceleration data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one acceleration increment, with the exponent of S-0-0162.
    S 161 "Acceleration data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0161.
    S 162 "Acceleration data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -3 => Parameter, stored, needed_for_cp4;
    /// Bytes of configurable data that the AT can hold.
    S 185 "Length of the configurable data record in the AT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// Bytes of configurable data that this drive's MDT record can hold.
    S 186 "Length of the configurable data record in the MDT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// IDNs that S-0-0016 may name.
    S 187 "IDN list of configurable data in the AT" [""] IDNS/0 written NEVER () = 0 => Dictionary(ConfigurableInAt);
    /// IDNs that S-0-0024 may name.
    S 188 "IDN list of configurable data in the MDT" [""] IDNS/0 written NEVER () = 0 => Dictionary(ConfigurableInMdt);
    /// Position command minus position feedback.
    S 189 "Following distance" [position] I32 written NEVER () = 0 => Live, in_at;
    /// IDNs that a control saves and restores.
    S 192 "IDN list of backup operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Backup);
    /// Jerk of positioning.
    S 193 "Positioning jerk" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// Speed of positioning, within S-0-0091.
    S 259 "Positioning velocity" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored, needed_for_cp4, in_mdt, restricted;
    /// Locks S-0-0279.
    S 267 "Password" [""] TEXT/0 written ALWAYS () = 0 => Live, restricted;
    /// Longest way to the home switch.
    S 278 "Maximum travel range" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 100.
    S 284 "Secondary operation mode 4" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 101.
    S 285 "Secondary operation mode 5" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 110.
    S 286 "Secondary operation mode 6" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 111.
    S 287 "Secondary operation mode 7" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bit 0 is control word bit 6 of the last MDT.
    S 300 "Real-time control bit 1" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// IDN of S-0-0399 whose bit S-0-0413 follows control word bit 6.
    S 301 "Allocation of real-time control bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0399 whose bit S-0-0414 follows control word bit 7.
    S 303 "Allocation of real-time control bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0398 whose bit S-0-0415 status word bit 6 shows.
    S 305 "Allocation of real-time status bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0398 whose bit S-0-0416 status word bit 7 shows.
    S 307 "Allocation of real-time status bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Checksum of S-0-0327.
    S 326 "Parameter checksum" [""] HEX32/0 written NEVER () = 0 => Live;
    /// Bit number for each entry of S-0-0026, 0 to 15.
    S 328 "Bit number allocation list for signal status word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Bit number for each entry of S-0-0027, 0 to 15.
    S 329 "Bit number allocation list for signal control word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Velocity command minus velocity feedback.
    S 347 "Velocity error" [velocity] I32 written NEVER () = 0 => Live, in_at;
    /// Jerk of halt and of the ramps of velocity commands.
    S 349 "Bipolar jerk limit value" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// What S-0-0305, S-0-0307 and S-0-0026 may name.
    S 398 "IDN list of configurable data for status bits" [""] IDNS/0 written NEVER () = 0 => Dictionary(BitSources);
    /// What S-0-0301, S-0-0303 and S-0-0027 may name.
    S 399 "IDN list of configurable data for control bits" [""] IDNS/0 written NEVER () = 0 => Dictionary(BitTargets);
    /// When each error of S-0-0375 came, in seconds since the supply came on.
    P 4 "Times of the last errors" ["s"] LONGS/0 written NEVER () = 0 => Live;
    /// Up to eight numbers of the control's own choice.
    P 7 "Application data" [""] LONGS/0 written ALWAYS () = 0 => Parameter, stored;
    /// A text of the control's own choice, as the serial number of the machine.
    P 8 "Application identifier" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// A word of the control's own choice that comes back in the AT. Real-time and signal bits can set its bits.
    P 19 "Application word" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Live, in_at, bit_target, restricted;
}
