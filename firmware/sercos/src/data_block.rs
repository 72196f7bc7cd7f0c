//! What describes one IDN.

use crate::attribute::{Attribute, Format};
use crate::idn::Idn;
use crate::unit::Unit;

/// A data block: everything about one IDN that does not change at run time.
#[derive(Clone, Copy, Debug)]
pub struct DataBlock {
    /// Element 1.
    pub idn: Idn,
    /// Element 2.
    pub name: &'static str,
    /// Element 4, or what it follows from; see [`DataBlock::scaled_unit`].
    pub unit: Unit,
    /// Element 3, with the decimal places of the default scaling; see [`DataBlock::scaled_attribute`].
    pub attribute: Attribute,
    /// Element 5, in units of the operation data; `None`: no minimum. Only for data of fixed length.
    pub minimum: Option<i64>,
    /// Element 6, like `minimum`.
    pub maximum: Option<i64>,
    /// Operation data of a parameter of fixed length after the start without stored values.
    pub default: i64,
    /// Where the operation data live.
    pub location: Location,
    /// The value is kept in non-volatile memory, and a control saves it (S-0-0192).
    pub stored: bool,
    /// The transition check that needs the data.
    pub needed_for: NeededFor,
    /// Cyclic telegrams in which the data can be configured.
    pub cyclic: Cyclic,
    /// What a real-time bit or a bit of a signal word can do with it.
    pub bits: Bits,
    /// Not every value within the limits is taken: the drive refuses some with 7008H (in operation also where the loops cannot work with it
    /// and the other parameters), 700CH, or 1001H for an allocation to an unknown IDN.
    pub restricted: bool,
    /// One line for the reader of the manual.
    pub documentation: &'static str,
    /// Where the block stands in its table, from 0.
    pub(crate) row: u16,
    /// Where its value is kept.
    pub(crate) place: Place,
}

/// Where the value of a parameter or the state of a command is kept; given when the table is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The data block is no parameter and no command.
    None,
    /// Two or four bytes.
    Value(u8),
    /// A list of IDNs.
    Idns(u8),
    /// A list of two-byte numbers.
    Words(u8),
    /// A list of four-byte numbers.
    Longs(u8),
    /// A text.
    Text(u8),
    /// A procedure command.
    Command(u8),
}

/// Where the operation data of a data block live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Location {
    /// A value, IDN list or text in [`crate::parameters::Parameters`]. Read-only ones are constants of the drive.
    Parameter,
    /// The drive itself, asked through [`crate::service::Live`].
    Live,
    /// An IDN list that is derived from the table itself.
    Dictionary(Selection),
    /// A procedure command; its operation data are the command's state.
    Command,
}

/// A selection of the table: the contents of the IDN lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Selection {
    /// S-0-0017.
    All,
    /// S-0-0018.
    NeededForCp3,
    /// S-0-0019.
    NeededForCp4,
    /// S-0-0020.
    ChangeableInCp4,
    /// S-0-0025.
    Commands,
    /// S-0-0187.
    ConfigurableInAt,
    /// S-0-0188.
    ConfigurableInMdt,
    /// S-0-0192, and what the password protects (S-0-0279) and the checksum covers (S-0-0327).
    Backup,
    /// S-0-0398.
    BitSources,
    /// S-0-0399.
    BitTargets,
}

/// The transition check that needs a data block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NeededFor {
    /// None.
    Neither,
    /// S-0-0127: in the list S-0-0018.
    Cp3,
    /// S-0-0128: in the list S-0-0019.
    Cp4,
}

/// Cyclic telegrams in which a data block can be configured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Cyclic {
    /// None.
    Never,
    /// The AT: in the list S-0-0187.
    At,
    /// The MDT: in the list S-0-0188.
    Mdt,
}

/// What a real-time bit (S-0-0300 to S-0-0307) or a bit of a signal word (S-0-0144, S-0-0145) can do with a data block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Bits {
    /// Nothing.
    Never,
    /// Be shown: in the list S-0-0398.
    Source,
    /// Be shown and be set: in the lists S-0-0398 and S-0-0399.
    Target,
}

impl Location {
    /// Itself: a table that has nothing to say but the location gives it as the accessor of its rows.
    pub const fn location(self) -> Self {
        self
    }

    /// In no telegram, unless the row says so.
    pub const fn cyclic(self) -> Cyclic {
        Cyclic::Never
    }

    /// Of no use to bits, unless the row says so.
    pub const fn bits(self) -> Bits {
        Bits::Never
    }
}

impl DataBlock {
    /// True if the data block belongs to the selection.
    pub const fn is_in(&self, selection: Selection) -> bool {
        match selection {
            Selection::All => true,
            Selection::NeededForCp3 => matches!(self.needed_for, NeededFor::Cp3),
            Selection::NeededForCp4 => matches!(self.needed_for, NeededFor::Cp4),
            Selection::ChangeableInCp4 => !self.attribute.protected_in_cp4(),
            Selection::Commands => self.attribute.command(),
            Selection::ConfigurableInAt => matches!(self.cyclic, Cyclic::At),
            Selection::ConfigurableInMdt => matches!(self.cyclic, Cyclic::Mdt),
            Selection::Backup => self.stored,
            Selection::BitSources => !matches!(self.bits, Bits::Never),
            Selection::BitTargets => matches!(self.bits, Bits::Target),
        }
    }

    /// Length of the operation data in bytes if it is fixed: 2, 4 or 8.
    pub const fn fixed_bytes(&self) -> Option<u16> {
        self.attribute.length().fixed_bytes()
    }

    /// The default as it is transmitted.
    pub(crate) const fn default_as_transmitted(&self) -> u64 {
        match self.fixed_bytes() {
            Some(2) => self.default as u16 as u64,
            _ => self.default as u32 as u64,
        }
    }

    /// True if the operation data are a text.
    pub const fn is_text(&self) -> bool {
        matches!(self.attribute.format(), Format::Text)
    }

    /// Where the block stands in its table, from 0: for those who have something to say of each row.
    pub const fn row(&self) -> usize {
        self.row as usize
    }

    // What follows is the vocabulary of `dictionary!`.

    /// A data block without limits, with default 0, in no telegram and no list but S-0-0017.
    pub const fn new(
        idn: Idn,
        name: &'static str,
        unit: Unit,
        attribute: Attribute,
        location: Location,
        documentation: &'static str,
    ) -> Self {
        Self {
            idn,
            name,
            unit,
            attribute,
            minimum: None,
            maximum: None,
            default: 0,
            location,
            stored: false,
            needed_for: NeededFor::Neither,
            cyclic: Cyclic::Never,
            bits: Bits::Never,
            restricted: false,
            documentation,
            row: 0,
            place: Place::None,
        }
    }

    /// Elements 5 and 6.
    #[must_use]
    pub const fn limited(mut self, minimum: Option<i64>, maximum: Option<i64>) -> Self {
        self.minimum = minimum;
        self.maximum = maximum;
        self
    }

    /// The value after the start.
    #[must_use]
    pub const fn with_default(mut self, default: i64) -> Self {
        self.default = default;
        self
    }

    /// What telegrams and bits can do with it.
    #[must_use]
    pub const fn shown(mut self, cyclic: Cyclic, bits: Bits) -> Self {
        self.cyclic = cyclic;
        self.bits = bits;
        self
    }

    /// S-0-0127 needs it.
    #[must_use]
    pub const fn needed_for_cp3(mut self) -> Self {
        self.needed_for = NeededFor::Cp3;
        self
    }

    /// S-0-0128 needs it.
    #[must_use]
    pub const fn needed_for_cp4(mut self) -> Self {
        self.needed_for = NeededFor::Cp4;
        self
    }

    /// It can be configured in the AT.
    #[must_use]
    pub const fn in_at(mut self) -> Self {
        self.cyclic = Cyclic::At;
        self
    }

    /// It can be configured in the MDT.
    #[must_use]
    pub const fn in_mdt(mut self) -> Self {
        self.cyclic = Cyclic::Mdt;
        self
    }

    /// A bit can show it.
    #[must_use]
    pub const fn bit_source(mut self) -> Self {
        self.bits = Bits::Source;
        self
    }

    /// A bit can show and set it.
    #[must_use]
    pub const fn bit_target(mut self) -> Self {
        self.bits = Bits::Target;
        self
    }

    /// The drive refuses some values within the limits.
    #[must_use]
    pub const fn restricted(mut self) -> Self {
        self.restricted = true;
        self
    }

    /// A control saves it.
    #[must_use]
    pub const fn stored(mut self) -> Self {
        self.stored = true;
        self
    }
}
