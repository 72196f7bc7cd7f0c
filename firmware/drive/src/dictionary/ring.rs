//! Parameters of the ring: cycle, slots, telegrams, what bits show and set.

use super::access::Access;

sercos::data_blocks! {
    /// In ascending order.
    pub(super) const RING_PARAMETERS accessed by Access;

    /// Interval of new command values; a multiple of S-0-0002, which it follows unless the master writes it. Like that a multiple of 250 us (7008H).
    S 1 "Control unit cycle time (tNcyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// Distance of two MSTs from CP3 on; a multiple of 250 us (7008H).
    S 2 "Communication cycle time (tScyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// End of the MST to the earliest AT of this drive.
    S 3 "Shortest AT transmission starting time (t1min)" ["us"] U16/0 written NEVER () = 12 => Parameter;
    /// End of the own AT to the earliest start of the MDT.
    S 4 "Transmit/receive transition time (tATMT)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// Feedback capture (t4) to the end of the MST before the AT that carries the value.
    S 5 "Minimum feedback processing time (t5)" ["us"] U16/0 written NEVER () = 30 => Parameter;
    /// End of the MST to the start of this drive's AT, from CP3 on; S-0-0003 at least.
    S 6 "AT transmission starting time (t1)" ["us"] U16/0 written IN_CP2 (12 to 65_000) = 12 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives capture their feedback.
    S 7 "Feedback acquisition capture point (t4)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives make their command values valid.
    S 8 "Command value valid time (t3)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// First byte of this drive's data record in the MDT, counted from 1 after the address; odd.
    S 9 "Position of data record in MDT" [""] U16/0 written IN_CP2 (1 to 65_531) = 1 => Parameter, needed_for_cp3;
    /// Bytes of all data records of the MDT; even.
    S 10 "Length of MDT" [""] U16/0 written IN_CP2 (4 to 65_534) = 4 => Parameter, needed_for_cp3;
    /// 0 to 7: contents of the cyclic telegrams; 7 takes them from S-0-0016 and S-0-0024. 11 to 13: as 3 to 5 with S-0-0053.
    S 15 "Telegram type parameter" [""] BITS/0 written IN_CP2 () = 2 => Parameter, needed_for_cp3;
    /// IDNs in the AT if the telegram type is 7, in this order.
    S 16 "Configuration list of AT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// IDNs in this drive's MDT record if the telegram type is 7, in this order.
    S 24 "Configuration list of MDT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// What the bits of S-0-0144 show, from bit 0 up; which bit of it says S-0-0328.
    S 26 "Configuration list for signal status word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// What the bits of S-0-0145 set, from bit 0 up; which bit of it says S-0-0329.
    S 27 "Configuration list for signal control word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Recovery time between two ATs of the same slave; this slave sends one.
    S 87 "Transmit/transmit recovery time (tATAT)" ["us"] U16/0 written NEVER () = 0 => Parameter;
    /// End of the MDT to the start of the next MST.
    S 88 "Receive/receive recovery time (tMTSY)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// End of the MST to the start of the MDT, from CP3 on.
    S 89 "MDT transmission starting time (t2)" ["us"] U16/0 written IN_CP2 (0 to 65_535) = 0 => Parameter, needed_for_cp3;
    /// End of the MDT to the earliest t3.
    S 90 "Command value proceeding time (tMTSG)" ["us"] U16/0 written NEVER () = 2 => Parameter;
    /// Bytes of configurable data that the AT can hold.
    S 185 "Length of the configurable data record in the AT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// Bytes of configurable data that this drive's MDT record can hold.
    S 186 "Length of the configurable data record in the MDT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// IDN of S-0-0399 whose bit S-0-0413 follows control word bit 6; 0: none.
    S 301 "Allocation of real-time control bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0399 whose bit S-0-0414 follows control word bit 7; 0: none.
    S 303 "Allocation of real-time control bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0398 whose bit S-0-0415 status word bit 6 shows; 0: none.
    S 305 "Allocation of real-time status bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// IDN of S-0-0398 whose bit S-0-0416 status word bit 7 shows; 0: none.
    S 307 "Allocation of real-time status bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Bit number for each entry of S-0-0026, 0 to 15; 0 where the list is shorter.
    S 328 "Bit number allocation list for signal status word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Bit number for each entry of S-0-0027, 0 to 15; 0 where the list is shorter.
    S 329 "Bit number allocation list for signal control word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Bit of the data block in S-0-0301.
    S 413 "Bit number allocation of real-time control bit 1" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0303.
    S 414 "Bit number allocation of real-time control bit 2" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0305.
    S 415 "Bit number allocation of real-time status bit 1" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0307.
    S 416 "Bit number allocation of real-time status bit 2" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
}
