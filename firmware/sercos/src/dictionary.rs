//! The table of all data blocks of a drive. Everything that knows IDNs (service channel, IDN lists, parameter memory, manual, host tool) is
//! derived from it.
//!
//! Which data blocks there are is the product's matter: it writes the rows with [`data_blocks!`](crate::data_blocks!), and puts them together with
//! [`dictionary!`](crate::dictionary!). What this crate reads
//! itself must be in it ([`REQUIRED`]); a table without does not compile.

use crate::attribute::{Format, Length};
use crate::capacity;
use crate::data_block::{DataBlock, Location, Place, Selection};
use crate::idn::Idn;

/// A table of data blocks, in ascending order of their IDN.
#[derive(Clone, Copy, Debug)]
pub struct Dictionary {
    blocks: &'static [DataBlock],
    lists: [&'static [Idn]; SELECTIONS.len()],
}

impl Dictionary {
    /// What [`dictionary!`](crate::dictionary!) has put together.
    #[doc(hidden)]
    pub const fn new(blocks: &'static [DataBlock], lists: [&'static [Idn]; SELECTIONS.len()]) -> Self {
        Self { blocks, lists }
    }

    /// All data blocks.
    pub const fn blocks(&self) -> &'static [DataBlock] {
        self.blocks
    }

    /// The data block of an IDN.
    // A search that is inlined takes 50 KB of flash: each parameter of the loops is looked for by its IDN.
    #[inline(never)]
    pub fn find(&self, idn: Idn) -> Option<&'static DataBlock> {
        let row = self.blocks.binary_search_by_key(&idn, |block| block.idn).ok()?;
        self.blocks.get(row)
    }

    /// The data blocks of a selection.
    pub fn select(&self, selection: Selection) -> impl Iterator<Item = &'static DataBlock> + use<> {
        self.blocks.iter().filter(move |block| block.is_in(selection))
    }

    /// The IDNs of a selection: the contents of an IDN list, put together by the compiler.
    pub fn list(&self, selection: Selection) -> &'static [Idn] {
        self.lists.get(selection as usize).copied().unwrap_or(&[])
    }
}

/// Two tables are the same if they lie at the same place: nobody compares row by row.
impl PartialEq for Dictionary {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self.blocks, other.blocks)
    }
}

impl Eq for Dictionary {}

/// All selections, in the order of their numbers.
#[doc(hidden)]
pub const SELECTIONS: [Selection; 10] = [
    Selection::All,
    Selection::NeededForCp3,
    Selection::NeededForCp4,
    Selection::ChangeableInCp4,
    Selection::Commands,
    Selection::ConfigurableInAt,
    Selection::ConfigurableInMdt,
    Selection::Backup,
    Selection::BitSources,
    Selection::BitTargets,
];

/// Numbers of the standard parameters that the transition checks, the telegram types and the scaling read (S-0-).
pub const REQUIRED: [u16; 44] = [
    1, 2, 4, 5, 6, 7, 8, 9, 10, 15, 16, 24, 32, 33, 34, 35, 43, 44, 45, 46, 49, 50, 55, 76, 77, 78, 79, 85, 86, 88, 89,
    90, 93, 94, 103, 160, 161, 162, 185, 186, 284, 285, 286, 287,
];

/// Formats of operation data: the attribute without decimal places and write protection.
pub mod formats {
    /// 16 single bits.
    pub const BITS: u32 = 0x0001_0001;
    /// Two bytes without sign.
    pub const U16: u32 = 0x0011_0001;
    /// Two bytes with sign.
    pub const I16: u32 = 0x0021_0001;
    /// Two bytes, hexadecimal.
    pub const HEX: u32 = 0x0031_0001;
    /// Four bytes without sign.
    pub const U32: u32 = 0x0012_0001;
    /// Four bytes, hexadecimal.
    pub const HEX32: u32 = 0x0032_0001;
    /// Four bytes with sign.
    pub const I32: u32 = 0x0022_0001;
    /// A text.
    pub const TEXT: u32 = 0x0044_0001;
    /// A list of IDNs.
    pub const IDNS: u32 = 0x0055_0001;
    /// A list of two-byte numbers, hexadecimal.
    pub const HEXES: u32 = 0x0035_0001;
    /// A list of two-byte numbers.
    pub const NUMBERS: u32 = 0x0015_0001;
    /// A list of four-byte numbers.
    pub const LONGS: u32 = 0x0016_0001;
    /// A list of four-byte numbers, hexadecimal.
    pub const HEX_LONGS: u32 = 0x0036_0001;
    /// A list of four-byte numbers with sign.
    pub const SIGNED_LONGS: u32 = 0x0026_0001;
    /// A procedure command.
    pub const COMMAND: u32 = 0x0009_0001;
}

/// Phases in which the master may write: the write protection of the attribute.
pub mod phases {
    /// From CP2 on.
    pub const ALWAYS: u32 = 0;
    /// CP2 only.
    pub const IN_CP2: u32 = 0x6000_0000;
    /// CP3 only.
    pub const IN_CP3: u32 = 0x5000_0000;
    /// CP2 and CP3.
    pub const IN_CP2_CP3: u32 = 0x4000_0000;
    /// CP4 only.
    pub const IN_CP4: u32 = 0x3000_0000;
    /// Read only.
    pub const NEVER: u32 = 0x7000_0000;
}

/// Writes a section of a table: rows of data blocks.
///
/// One row: documentation; set and number, name, unit or what the data measure in the increments of their scaling; format, with decimal places
/// for a unit; phases in which the master may write; limits; default; accessor and further properties
/// ([`DataBlock`](crate::data_block::DataBlock) has a method for each).
///
/// The accessor says where the operation data live. There are two sorts of sections:
///
/// * `const NAME accessed by Accessor;` has a type of the product's as accessor: an enum whose variants hold nothing or a variant of an enum of
///   the variant's own name, and perhaps more, with three constant functions `location`, `cyclic` and `bits`.
///   [`Location`](crate::data_block::Location) is one, for a table that has nothing else to say.
/// * `enum Name in NAME: Location [properties];` makes an enum with a variant for each row. All its rows have the same location and properties.
///
/// [`dictionary!`](crate::dictionary!) puts the sections together; `examples/sample` has a table to begin with.
#[macro_export]
macro_rules! data_blocks {
    (
        $(#[$attribute:meta])*
        $visibility:vis const $NAME:ident accessed by $Accessor:ident;
        $(
            $(#[doc = $documentation:literal])+
            $set:ident $number:literal $name:literal [$unit:tt]
            $format:ident $(/ $decimals:literal)? written $phases:ident
            ($($minimum:literal to $maximum:literal)?) = $default:literal
            => $kind:ident $(($value:ident $(, $more:expr)*))? $(, $property:ident)*;
        )+
    ) => {
        $(#[$attribute])*
        $visibility const $NAME: &[($crate::data_block::DataBlock, $Accessor)] = &[$({
            const ACCESSOR: $Accessor = $Accessor::$kind $(($kind::$value $(, $more)*))?;
            let block = $crate::data_blocks!(
                @row ACCESSOR.location(), $($documentation)+, $set $number $name [$unit]
                $format $(/ $decimals)? written $phases ($($minimum to $maximum)?) = $default
            );
            (block.shown(ACCESSOR.cyclic(), ACCESSOR.bits())$(.$property())*, ACCESSOR)
        }),+];
    };
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $Name:ident in $NAME:ident: $location:ident $common:tt;
        $(
            $(#[doc = $documentation:literal])+
            $set:ident $number:literal $name:literal [$unit:tt]
            $format:ident $(/ $decimals:literal)? written $phases:ident
            ($($minimum:literal to $maximum:literal)?) = $default:literal
            => $variant:ident $(, $property:ident)*;
        )+
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visibility enum $Name {
            $($(#[doc = $documentation])+ $variant,)+
        }

        /// The data blocks, in the order of the variants.
        $visibility const $NAME: &[($crate::data_block::DataBlock, $Name)] = &[$({
            let block = $crate::data_blocks!(
                @row $crate::data_block::Location::$location, $($documentation)+, $set $number $name [$unit]
                $format $(/ $decimals)? written $phases ($($minimum to $maximum)?) = $default
            );
            ($crate::data_blocks!(@with block $common)$(.$property())*, $Name::$variant)
        }),+];
    };
    (
        @row $location:expr, $($documentation:literal)+, $set:ident $number:literal $name:literal [$unit:tt]
        $format:ident $(/ $decimals:literal)? written $phases:ident
        ($($minimum:literal to $maximum:literal)?) = $default:literal
    ) => {
        $crate::data_block::DataBlock::new(
            $crate::data_blocks!(@idn $set $number),
            $name,
            $crate::data_blocks!(@unit $unit),
            $crate::attribute::Attribute::new_with_raw_value(
                $crate::dictionary::formats::$format
                    | $crate::dictionary::phases::$phases
                    | (($crate::data_blocks!(@unit $unit).preferred_decimals(0 $(+ $decimals)?) as u32) << 24)
            ),
            $location,
            concat!($($documentation),+).trim_ascii(),
        )
        .limited($crate::data_blocks!(@limit $($minimum)?), $crate::data_blocks!(@limit $($maximum)?))
        .with_default($default)
    };
    (@with $block:ident [$($property:ident),*]) => { $block$(.$property())* };
    (@idn S $number:literal) => { $crate::idn::Idn::standard($number) };
    (@idn P $number:literal) => { $crate::idn::Idn::product($number) };
    (@unit position) => { $crate::unit::Unit::Scaled($crate::unit::Dimension::Position) };
    (@unit velocity) => { $crate::unit::Unit::Scaled($crate::unit::Dimension::Velocity) };
    (@unit acceleration) => { $crate::unit::Unit::Scaled($crate::unit::Dimension::Acceleration) };
    (@unit jerk) => { $crate::unit::Unit::Scaled($crate::unit::Dimension::Jerk) };
    (@unit torque) => { $crate::unit::Unit::Scaled($crate::unit::Dimension::Torque) };
    (@unit $unit:literal) => { $crate::unit::Unit::Fixed($unit) };
    (@limit) => { None };
    (@limit $limit:literal) => { Some($limit) };
}

/// Puts the sections of a table together, in ascending order of the IDNs. `SECTION as Variant` is a section with an enum of its own, which
/// that variant of the accessor holds.
#[macro_export]
macro_rules! dictionary {
    (
        $(#[$attribute:meta])*
        $visibility:vis static $NAME:ident accessed by $Accessor:ident
            $(in $accessors_visibility:vis static $ACCESSORS:ident)?;
        $($SECTION:ident $(as $Variant:ident)?,)+
    ) => {
        const ROWS: &[($crate::data_block::DataBlock, $Accessor)] = &{
            const COUNT: usize = 0 $(+ $SECTION.len())+;
            let mut rows = [None; COUNT];
            let mut row = 0;
            $(
                let mut next = 0;
                while next < $SECTION.len() {
                    let (block, accessor) = $SECTION[next];
                    rows[row] = Some((block, $crate::dictionary!(@accessor accessor $($Accessor::$Variant)?)));
                    row += 1;
                    next += 1;
                }
            )+
            $crate::dictionary::sorted::<_, COUNT>(rows)
        };

        /// The rows, one object with a name of its own.
        static DATA_BLOCKS: [$crate::data_block::DataBlock; ROWS.len()] = $crate::dictionary::lay_out(ROWS);

        $(
            /// The accessor of each row.
            $accessors_visibility static $ACCESSORS: [$Accessor; ROWS.len()] = $crate::dictionary::accessors(ROWS);
        )?

        $(#[$attribute])*
        $visibility static $NAME: $crate::dictionary::Dictionary = $crate::dictionary::Dictionary::new(
            &DATA_BLOCKS,
            $crate::dictionary!(@lists 0 1 2 3 4 5 6 7 8 9),
        );
    };
    (@accessor $accessor:ident) => { $accessor };
    (@accessor $accessor:ident $Accessor:ident::$Variant:ident) => { $Accessor::$Variant($accessor) };
    (@lists $($number:literal)+) => {
        [$({
            const SELECTION: $crate::data_block::Selection = $crate::dictionary::SELECTIONS[$number];
            static IDNS: [$crate::idn::Idn; $crate::dictionary::count(&DATA_BLOCKS, SELECTION)] =
                $crate::dictionary::collect(&DATA_BLOCKS, SELECTION);
            &IDNS
        }),+]
    };
}

/// All rows, in ascending order of their IDN.
///
/// # Panics
/// While it is compiled, if a row is missing.
#[doc(hidden)]
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
#[allow(clippy::panic, reason = "evaluated by the compiler only")]
pub const fn sorted<A: Copy, const N: usize>(rows: [Option<(DataBlock, A)>; N]) -> [(DataBlock, A); N] {
    let Some(first) = rows[0] else { panic!("no rows") };
    let mut sorted = [first; N];
    let mut row = 1;
    while row < N {
        let Some(inserted) = rows[row] else { panic!("a row is missing") };
        let mut place = row;
        while place > 0 && sorted[place - 1].0.idn.0 > inserted.0.idn.0 {
            sorted[place] = sorted[place - 1];
            place -= 1;
        }
        sorted[place] = inserted;
        row += 1;
    }
    sorted
}

/// The accessors of the rows.
#[doc(hidden)]
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
pub const fn accessors<A: Copy, const N: usize>(rows: &[(DataBlock, A)]) -> [A; N] {
    let mut accessors = [rows[0].1; N];
    let mut row = 1;
    while row < N {
        accessors[row] = rows[row].1;
        row += 1;
    }
    accessors
}

/// Rows of a selection.
#[doc(hidden)]
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
pub const fn count(rows: &[DataBlock], selection: Selection) -> usize {
    let mut count = 0;
    let mut row = 0;
    while row < rows.len() {
        if rows[row].is_in(selection) {
            count += 1;
        }
        row += 1;
    }
    count
}

/// The IDNs of a selection.
#[doc(hidden)]
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
pub const fn collect<const N: usize>(rows: &[DataBlock], selection: Selection) -> [Idn; N] {
    let mut idns = [Idn(0); N];
    let mut found = 0;
    let mut row = 0;
    while row < rows.len() {
        if rows[row].is_in(selection) {
            idns[found] = rows[row].idn;
            found += 1;
        }
        row += 1;
    }
    idns
}

/// Gives every row its number and every value its place.
///
/// # Panics
/// While it is compiled, if the table is not what the crate needs.
#[doc(hidden)]
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
pub const fn lay_out<A: Copy, const N: usize>(rows: &[(DataBlock, A)]) -> [DataBlock; N] {
    assert!(N == rows.len() && N <= capacity::DATA_BLOCKS, "more data blocks than `capacity` has room for");
    let mut laid_out = [rows[0].0; N];
    let mut taken = Taken { values: 0, idns: 0, words: 0, longs: 0, texts: 0, commands: 0 };
    let mut row = 0;
    while row < N {
        let block = rows[row].0;
        assert!(row == 0 || rows[row - 1].0.idn.0 < block.idn.0, "two rows have the same IDN");
        laid_out[row] = DataBlock { row: row as u16, place: taken.place(&block), ..block };
        row += 1;
    }
    taken.check();
    let mut required = 0;
    while required < REQUIRED.len() {
        assert!(is_parameter(&laid_out, REQUIRED[required]), "one of the `REQUIRED` parameters is missing");
        required += 1;
    }
    laid_out
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn is_parameter(rows: &[DataBlock], number: u16) -> bool {
    let mut row = 0;
    while row < rows.len() {
        if rows[row].idn.0 == number {
            return matches!(rows[row].location, Location::Parameter);
        }
        row += 1;
    }
    false
}

/// How many places of each kind are taken.
struct Taken {
    values: usize,
    idns: usize,
    words: usize,
    longs: usize,
    texts: usize,
    commands: usize,
}

impl Taken {
    #[allow(clippy::panic, reason = "evaluated by the compiler only")]
    const fn place(&mut self, block: &DataBlock) -> Place {
        match block.location {
            Location::Parameter => {}
            Location::Command => return Place::Command(next(&mut self.commands)),
            Location::Live | Location::Dictionary(_) => return Place::None,
        }
        match (block.attribute.length(), block.attribute.format()) {
            (Length::Two | Length::Four, _) => {
                assert!(
                    block.attribute.value_of(block.default_as_transmitted()) == block.default,
                    "a default does not fit its format"
                );
                Place::Value(next(&mut self.values))
            }
            (Length::ListOfBytes, _) => Place::Text(next(&mut self.texts)),
            (Length::ListOfTwo, Format::Idn) => Place::Idns(next(&mut self.idns)),
            (Length::ListOfTwo, _) => Place::Words(next(&mut self.words)),
            (Length::ListOfFour, _) => Place::Longs(next(&mut self.longs)),
            (Length::Eight | Length::ListOfEight | Length::Reserved, _) => {
                panic!("a parameter of a length that has no place")
            }
        }
    }

    const fn check(&self) {
        assert!(
            self.values <= capacity::VALUES
                && self.idns <= capacity::IDN_LISTS
                && self.words <= capacity::WORD_LISTS
                && self.longs <= capacity::LONG_LISTS
                && self.texts <= capacity::TEXTS
                && self.commands <= capacity::COMMANDS,
            "more parameters or commands than `capacity` has room for"
        );
    }
}

#[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn next(taken: &mut usize) -> u8 {
    let place = *taken;
    *taken += 1;
    place as u8
}
