//! Numbers that only the service channel shows.

sercos::data_blocks! {
    /// A number of two or four bytes that lives in the drive, and that no telegram carries.
    pub enum Number in NUMBERS: Live [];

    /// Invalid MSTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 28 "MST error counter" [""] U16/0 written NEVER () = 0 => MstErrors;
    /// Invalid MDTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 29 "MDT error counter" [""] U16/0 written NEVER () = 0 => MdtErrors;
    /// Both bytes are the drive address: one drive in this slave.
    S 96 "Slave arrangement (SLKN)" [""] HEX/0 written NEVER () = 0 => SlaveArrangement;
    /// Bit 0 is status word bit 6.
    S 304 "Real-time status bit 1" [""] BITS/0 written NEVER () = 0 => RealTimeStatusBit1;
    /// Bit 0 is status word bit 7.
    S 306 "Real-time status bit 2" [""] BITS/0 written NEVER () = 0 => RealTimeStatusBit2;
    /// Checksum of S-0-0327: equal settings, equal checksum.
    S 326 "Parameter checksum" [""] HEX32/0 written NEVER () = 0 => Checksum;
    /// Time since the processor was started.
    P 6 "Operating time" ["s"] U32/0 written NEVER () = 0 => OperatingTime;
    /// Why the processor was started: 1 supply, 2 reset pin, 3 watchdog, 4 software, 5 low power, 0 unknown.
    P 9 "Reset cause" [""] U16/0 written NEVER () = 0 => ResetCause;
    /// Time for which the processor has run, all starts together; kept every hour, and with every error.
    P 15 "Total operating time" ["s"] U32/0 written NEVER () = 0 => TotalOperatingTime;
    /// Electrical angle at this moment; -1: not known. Written without torque it is taken over: for an axis whose angle was kept elsewhere while its brake held it; -1 lets the drive search again.
    P 118 "Commutation angle" ["deg"] I32/2 written ALWAYS (-1 to 35_999) = -1 => CommutationAngle, restricted;
    /// 0: the commutation angle is not known; 1: from the alignment or from P-0-0118; 2: checked by the index.
    P 119 "Commutation state" [""] U16/0 written NEVER () = 0 => CommutationState;
    /// Load of the motor's thermal model; the current is folded back from 90 % on.
    P 132 "Motor load" ["%"] U16/1 written NEVER () = 0 => MotorLoad;
    /// Load of the amplifier's thermal model.
    P 133 "Amplifier load" ["%"] U16/1 written NEVER () = 0 => AmplifierLoad;
    /// Phase error of the loop tick to the ring at the last t3; positive: the tick comes early.
    P 150 "Phase error of the loops" ["ns"] I32/0 written NEVER () = 0 => PhaseError;
    /// Largest magnitude of the phase error since the loops locked; 0 again in CP2.
    P 151 "Largest phase error of the loops" ["ns"] I32/0 written NEVER () = 0 => LargestPhaseError;
    /// Cycles of the current loop that came too late, since the start.
    P 153 "Late current loops" [""] U32/0 written NEVER () = 0 => LateCurrentLoops;
    /// Oscilloscope: 0 idle, 1 fills the points before the trigger, 2 waits for the trigger, 3 fills those behind it, 4 done.
    P 200 "Oscilloscope state" [""] U16/0 written NEVER () = 0 => ScopeState;
    /// First point that P-0-0210 to P-0-0213 show; 0 after arming.
    P 214 "Oscilloscope window" [""] U16/0 written ALWAYS (0 to 2_047) = 0 => ScopeWindow;
    /// Time between two points of the recording.
    P 215 "Oscilloscope interval" ["us"] U32/1 written NEVER () = 0 => ScopeInterval;
    /// How far P-0-0224, P-0-0225 or P-0-0226 has come; 100 when it is done.
    P 227 "Progress of the identification" ["%"] U16/0 written NEVER () = 0 => IdentificationProgress;
    /// Load of the chopper's resistor; it warns from 90 % on, is switched off at 100 % and works again below 80 %.
    P 238 "Load of the chopper resistor" ["%"] U16/1 written NEVER () = 0 => ChopperLoad;
}
