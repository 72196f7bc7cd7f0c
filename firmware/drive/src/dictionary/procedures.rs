//! Procedure commands.

use sercos::Idn;

sercos::data_blocks! {
    /// A procedure command.
    pub enum Procedure in PROCEDURES: Command [];

    /// Clears errors whose cause is gone and of which an AT has told; fails while the drive still reacts to one.
    S 99 "Reset class 1 diagnostic" [""] COMMAND/0 written ALWAYS () = 0 => ResetClass1;
    /// Checks everything that CP3 needs; findings in S-0-0021.
    S 127 "CP3 transition check" [""] COMMAND/0 written IN_CP2 () = 0 => CheckForCp3;
    /// Checks everything that CP4 needs; findings in S-0-0022.
    S 128 "CP4 transition check" [""] COMMAND/0 written IN_CP3 () = 0 => CheckForCp4;
    /// Takes the axis out: no torque until it is cancelled or the next run-up passes CP2.
    S 139 "Park axis" [""] COMMAND/0 written IN_CP2 () = 0 => ParkAxis;
    /// Finds the reference point in the way of S-0-0147, gives it the position S-0-0052, and sets S-0-0403 bit 0. What it fails of says P-0-0003.
    S 148 "Drive controlled homing procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Homing;
    /// Takes the axis to a mechanical stop by the commands of the control: no following distance (S-0-0159) is monitored while it is set, and no brake is suspected. Executed when the axis has stood at its torque limit for 50 ms (S-0-0092, S-0-0124); failed when the torque goes before. The axis holds its torque until the command is cancelled; then the monitoring is there again.
    S 149 "Positive stop drive procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => PositiveStop;
    /// Positions at the edges of S-0-0169, each armed by S-0-0405 or S-0-0406; until it is cancelled.
    S 170 "Probing cycle procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Probing;
    /// Takes S-0-0403 bit 0 away.
    S 191 "Cancel reference point procedure command" [""] COMMAND/0 written ALWAYS () = 0 => CancelReference;
    /// Gives everything in S-0-0192 its default. Not in CP4, which protects some of it, and not while torque is on (7012H).
    S 262 "Load defaults procedure command" [""] COMMAND/0 written ALWAYS () = 0 => LoadDefaults;
    /// Gives everything in S-0-0192 the value that S-0-0264 has saved, and the default where it has saved none. Conditions as for S-0-0262.
    S 263 "Load working memory procedure command" [""] COMMAND/0 written ALWAYS () = 0 => LoadParameters;
    /// Saves everything in S-0-0192 for the next start, old or new and never a mix. Not while torque is on (700CH). In CP3 and CP4 it takes a word in each pause that t3 and t4 leave, and waits while torque is on: the set is that of its beginning. A step of the service channel that comes meanwhile is held (BUSY) for 1 ms at most.
    S 264 "Backup working memory procedure command" [""] COMMAND/0 written ALWAYS () = 0 => SaveParameters;
    /// Saves what S-0-0270 names when it is started, with the values of its beginning, for the next start; everything else stays as it was saved last, whatever it is now. Old or new and never a mix, and with the conditions of S-0-0264. Refused where S-0-0270 is empty (7013H), ends with an error where nothing was saved yet, or what was saved has another form or no room; P-0-0003 says which.
    S 293 "Selectively backup working memory procedure command" [""] COMMAND/0 written ALWAYS () = 0 => SaveSelected;
    /// Makes the place where the motor stands the position S-0-0052. Not while torque is on.
    S 447 "Set absolute position procedure command" [""] COMMAND/0 written ALWAYS () = 0 => SetAbsolutePosition;
    /// Works out S-0-0100, 0101, 0104, 0106, 0107, 0348, P-0-0231 and, against the steps of the encoder (S-0-0116), S-0-0392 and the low-pass P-0-0174 to P-0-0176 (a notch there stays, and one of your own belongs in P-0-0170) from S-0-0001, P-0-0110 to P-0-0114 and P-0-0221 to P-0-0223. All of them or, with the reason in P-0-0228, none.
    P 220 "Compute gains" [""] COMMAND/0 written ALWAYS () = 0 => ComputeGains;
    /// Measures P-0-0111 to P-0-0113 with direct current up to S-0-0111, within S-0-0082, 0083 and 0092. Needs torque, drive HALT and standstill (7012H); the motor turns by up to 30 electrical degrees. An axis that takes more than an eighth of the smallest of S-0-0109, S-0-0110 and S-0-0111 to be held is refused (P-0-0228): its load would go. Ends with an error when HALT ends.
    P 224 "Identify resistance and inductances" [""] COMMAND/0 written IN_CP4 () = 0 => IdentifyWinding;
    /// Measures P-0-0114 at P-0-0218 and half of it; the motor turns. Conditions as for P-0-0224.
    P 225 "Identify torque constant" [""] COMMAND/0 written IN_CP4 () = 0 => IdentifyFlux;
    /// Measures P-0-0221 with ramps P-0-0219 between P-0-0218 and half of it, and turns back to measure the friction, S-0-0155 and P-0-0142. Conditions as for P-0-0224.
    P 226 "Identify moment of inertia" [""] COMMAND/0 written IN_CP4 () = 0 => IdentifyInertia;
}

impl Procedure {
    /// Its data block.
    #[must_use]
    pub(crate) fn idn(self) -> Idn {
        // A row for each variant, in their order.
        PROCEDURES.get(self as usize).map_or(Idn(0), |(block, _)| block.idn)
    }
}
