//! Lists that the drive supplies.

sercos::data_blocks! {
    /// A list of two-byte numbers.
    pub enum Words in WORD_LISTS: Live [];

    /// IDNs that S-0-0127 found invalid; empty after a positive check.
    S 21 "IDN list of invalid operation data for CP2" [""] IDNS/0 written NEVER () = 0 => InvalidForCp3;
    /// IDNs that S-0-0128 found invalid; empty after a positive check.
    S 22 "IDN list of invalid operation data for CP3" [""] IDNS/0 written NEVER () = 0 => InvalidForCp4;
    /// The operation mode parameter that control word bits 11, 9, 8 asked for in CP4 and that was not initialised; empty again after S-0-0099.
    S 23 "IDN list of invalid operation data for CP4" [""] IDNS/0 written NEVER () = 0 => InvalidInCp4;
    /// Values that S-0-0265 may have.
    S 266 "List of available languages" [""] NUMBERS/0 written NEVER () = 0 => Languages;
    /// Operation modes that S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287 may name.
    S 292 "List of supported operation modes" [""] HEXES/0 written NEVER () = 0 => OperationModes;
    /// S-0-0390 of the last 32 errors, the newest first; their times are in P-0-0004. They outlive the supply.
    S 375 "List of diagnostic numbers" [""] HEXES/0 written NEVER () = 0 => DiagnosticNumbers;
    /// Why S-0-0127 blames each IDN of S-0-0021, in the same order; the codes are in the manual.
    P 1 "Reasons of S-0-0021" [""] HEXES/0 written NEVER () = 0 => ReasonsForCp3;
    /// Why S-0-0128 blames each IDN of S-0-0022, in the same order; the codes are in the manual.
    P 2 "Reasons of S-0-0022" [""] HEXES/0 written NEVER () = 0 => ReasonsForCp4;
    /// Data blocks that were saved and could not be taken over at the start or by S-0-0263: unknown to this firmware, of another length, or out of today's range, which are the default then, and S-0-0127 or S-0-0128 asks for those that it needs; and ratings of another amplifier than this one, for which S-0-0128 refuses CP4 until S-0-0264 says that this one is right.
    P 14 "Data that were not restored" [""] IDNS/0 written NEVER () = 0 => NotRestored;
}

sercos::data_blocks! {
    /// A list of four-byte numbers.
    pub enum Longs in LONG_LISTS: Live [];

    /// When each error of S-0-0375 came, in seconds of P-0-0015.
    P 4 "Times of the last errors" ["s"] LONGS/0 written NEVER () = 0 => ErrorTimes;
    /// P-0-0012 for the maker: cause (1 fault, 2 panic, 3 stack, 4 crystal, 5 unbound interrupt, 6 watchdog, 7 control stopped) in bits 6 to 0, exception from bit 16 up; crashes since the supply came on; pc, lr, sp, xPSR, r0 to r12; CFSR, HFSR, MMFAR, BFAR; line of a panic or tasks that did not begin; end of the file's name. Empty without a crash.
    P 13 "Record of the last crash" [""] HEX_LONGS/0 written NEVER () = 0 => CrashRecord;
    /// A hint only: S-0-0051 as it was kept last before this start while S-0-0403 was 1, in the weight that it had then, and the seconds of P-0-0015 since. It is kept with every error and every hour, without torque. An incremental encoder knows nothing of what the axis has done since, and nothing in the drive works with it. Empty: never kept.
    P 16 "Position kept last" [""] SIGNED_LONGS/0 written NEVER () = 0 => LastPosition;
    /// How often the phase error had a magnitude of up to 50, 100, 200, 500, 1000, 2000 ns and above, since the loops locked.
    P 152 "Histogram of the phase error" [""] LONGS/0 written NEVER () = 0 => PhaseErrorHistogram;
    /// Points of channel 1 from P-0-0214 on, in order of time, at most 32: the trigger is point P-0-0207. Empty unless P-0-0200 is 4.
    P 210 "Oscilloscope points 1" [""] SIGNED_LONGS/0 written NEVER () = 0 => ScopePoints1;
    /// As P-0-0210, for channel 2.
    P 211 "Oscilloscope points 2" [""] SIGNED_LONGS/0 written NEVER () = 0 => ScopePoints2;
    /// As P-0-0210, for channel 3.
    P 212 "Oscilloscope points 3" [""] SIGNED_LONGS/0 written NEVER () = 0 => ScopePoints3;
    /// As P-0-0210, for channel 4.
    P 213 "Oscilloscope points 4" [""] SIGNED_LONGS/0 written NEVER () = 0 => ScopePoints4;
}
