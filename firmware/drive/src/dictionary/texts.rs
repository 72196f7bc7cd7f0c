//! Texts that the drive supplies.

sercos::data_blocks! {
    /// A text that lives in the drive.
    pub enum Text in TEXTS: Live [];

    /// Firmware and its version.
    S 30 "Manufacturer version" [""] TEXT/0 written NEVER () = 0 => Version;
    /// State or error of the drive in plain words; belongs to S-0-0390.
    S 95 "Diagnostic message" [""] TEXT/0 written NEVER () = 0 => DiagnosticMessage;
    /// Type of the drive.
    S 140 "Controller type" [""] TEXT/0 written NEVER () = 0 => ControllerType;
    /// Version of the SERCOS specification.
    S 143 "System interface version" [""] TEXT/0 written NEVER () = 0 => SystemInterface;
    /// Locks S-0-0279: 3 to 10 characters lock with them as password, the password unlocks. Reads *** while locked, also after the supply was off: it is kept within 2 s and not while torque is on, and bit 3 of S-0-0182 is set until then. Forgotten by a start with no drive address on the switches (0 or 255).
    S 267 "Password" [""] TEXT/0 written ALWAYS () = 0 => Password, restricted;
    /// What the last transition check or homing that failed has found, or why the last write was refused with 7008H, in plain words; empty after a success.
    P 3 "Finding of the last check or write" [""] TEXT/0 written NEVER () = 0 => CheckFinding;
    /// What led to the state or error in S-0-0095.
    P 10 "Cause of the diagnostic message" [""] TEXT/0 written NEVER () = 0 => DiagnosticCause;
    /// What to do about the error in S-0-0095; empty for a state that needs nothing.
    P 11 "Remedy for the diagnostic message" [""] TEXT/0 written NEVER () = 0 => DiagnosticRemedy;
    /// How the program ended last since the supply came on, and where, in plain words; empty when it did not. Numbers F120H to F125H of S-0-0375.
    P 12 "Last crash" [""] TEXT/0 written NEVER () = 0 => LastCrash;
    /// Serial number of the drive, from its production record; empty where there is none.
    P 20 "Serial number" [""] TEXT/0 written NEVER () = 0 => SerialNumber;
    /// Type and version of its hardware, from its production record; empty where there is none.
    P 21 "Hardware" [""] TEXT/0 written NEVER () = 0 => HardwareName;
    /// Why P-0-0220, P-0-0224, P-0-0225 or P-0-0226 has failed last, in plain words; empty after a success.
    P 228 "Finding of the identification" [""] TEXT/0 written NEVER () = 0 => IdentificationFinding;
}
