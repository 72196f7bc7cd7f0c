//! IDN lists that follow from the table.

use sercos::data_block::Selection as List;

use super::access::Access;

sercos::data_blocks! {
    /// In ascending order.
    pub(super) const IDN_LISTS accessed by Access;

    /// Every IDN of the drive.
    S 17 "IDN list of all operation data" [""] IDNS/0 written NEVER () = 0 => List(All);
    /// IDNs that S-0-0127 checks.
    S 18 "IDN list of operation data for CP2" [""] IDNS/0 written NEVER () = 0 => List(NeededForCp3);
    /// IDNs that S-0-0128 checks.
    S 19 "IDN list of operation data for CP3" [""] IDNS/0 written NEVER () = 0 => List(NeededForCp4);
    /// IDNs that can be written in CP4.
    S 20 "IDN list of operation data for CP4" [""] IDNS/0 written NEVER () = 0 => List(ChangeableInCp4);
    /// All procedure commands.
    S 25 "IDN list of all procedure commands" [""] IDNS/0 written NEVER () = 0 => List(Commands);
    /// IDNs that S-0-0016 may name.
    S 187 "IDN list of configurable data in the AT" [""] IDNS/0 written NEVER () = 0 => List(ConfigurableInAt);
    /// IDNs that S-0-0024 may name.
    S 188 "IDN list of configurable data in the MDT" [""] IDNS/0 written NEVER () = 0 => List(ConfigurableInMdt);
    /// IDNs that a control saves and restores.
    S 192 "IDN list of backup operation data" [""] IDNS/0 written NEVER () = 0 => List(Backup);
    /// What S-0-0267 locks.
    S 279 "IDN list of password-protected operation data" [""] IDNS/0 written NEVER () = 0 => List(Backup);
    /// What S-0-0326 covers.
    S 327 "IDN list of checksum parameter" [""] IDNS/0 written NEVER () = 0 => List(Backup);
    /// What S-0-0305, S-0-0307 and S-0-0026 may name.
    S 398 "IDN list of configurable data for status bits" [""] IDNS/0 written NEVER () = 0 => List(BitSources);
    /// What S-0-0301, S-0-0303 and S-0-0027 may name.
    S 399 "IDN list of configurable data for control bits" [""] IDNS/0 written NEVER () = 0 => List(BitTargets);
}
