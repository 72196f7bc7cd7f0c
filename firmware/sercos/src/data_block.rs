//! What describes one IDN.

use crate::attribute::{Attribute, Format};
use crate::idn::Idn;
use crate::parameters::Parameters;
use crate::weighting::{Unit, Weight};
use arbitrary_int::u4;

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

    /// Element 4 under the scaling of these parameters; empty: there is none.
    pub fn scaled_unit(&self, parameters: &Parameters) -> &'static str {
        match self.unit {
            Unit::Fixed(unit) => unit,
            Unit::Scaled(dimension) => Weight::of(dimension, parameters).unit,
        }
    }

    /// Element 3 under the scaling of these parameters.
    pub fn scaled_attribute(&self, parameters: &Parameters) -> Attribute {
        match self.unit {
            Unit::Fixed(_) => self.attribute,
            Unit::Scaled(dimension) => {
                let weight = Weight::of(dimension, parameters);
                let decimals = u4::new(weight.decimals & 0xF);
                self.attribute.with_decimal_places(decimals).with_conversion_factor(weight.factor)
            }
        }
    }

    /// Length of the operation data in bytes if it is fixed: 2, 4 or 8.
    pub const fn fixed_bytes(&self) -> Option<u16> {
        self.attribute.length().fixed_bytes()
    }

    /// True if the operation data are a text.
    pub const fn is_text(&self) -> bool {
        matches!(self.attribute.format(), Format::Text)
    }

    // The methods below are the vocabulary of the table in `dictionary`.

    pub(crate) const fn needed_for_cp3(mut self) -> Self {
        self.needed_for = NeededFor::Cp3;
        self
    }

    pub(crate) const fn needed_for_cp4(mut self) -> Self {
        self.needed_for = NeededFor::Cp4;
        self
    }

    pub(crate) const fn in_at(mut self) -> Self {
        self.cyclic = Cyclic::At;
        self
    }

    pub(crate) const fn in_mdt(mut self) -> Self {
        self.cyclic = Cyclic::Mdt;
        self
    }

    pub(crate) const fn bit_source(mut self) -> Self {
        self.bits = Bits::Source;
        self
    }

    pub(crate) const fn bit_target(mut self) -> Self {
        self.bits = Bits::Target;
        self
    }

    pub(crate) const fn restricted(mut self) -> Self {
        self.restricted = true;
        self
    }

    pub(crate) const fn stored(mut self) -> Self {
        self.stored = true;
        self
    }
}
