//! What a life is made of: an axis, and what happens to it. A life is a file of a few lines that can be kept and read.

use fault_matrix::Fault;
use plant::ReferenceAxis;
use serde::{Deserialize, Serialize};

/// One axis and its fate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Life {
    /// What it was made from; a shrunk life keeps the seed of the life it was found in.
    pub seed: u64,
    /// The axis.
    pub axis: Axis,
    /// What happens in CP4, in the order of time.
    pub events: Vec<Event>,
    /// How long CP4 is watched after the last event, in us.
    pub rest: u32,
}

/// Machine, ring, and what the master writes before CP4.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Axis {
    /// The machine.
    pub plant: Plant,
    /// Increments of its encoder, where they are not those of the reference axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub increments: Option<u32>,
    /// A fault that the machine is built for (friction that comes, a slow brake).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub built_for: Option<Fault>,
    /// Bit rate in Mbit/s.
    pub megabits: u8,
    /// S-0-0002 in us.
    pub cycle: u16,
    /// S-0-0001 as a multiple of S-0-0002.
    pub control_cycles: u16,
    /// The MDT follows the AT at once.
    #[serde(default)]
    pub early_mdt: bool,
    /// S-0-0015.
    pub telegram: u16,
    /// S-0-0016, or what a standard telegram has.
    pub at: Vec<u16>,
    /// S-0-0024, or what a standard telegram has.
    pub mdt: Vec<u16>,
    /// P-0-0118 is written, so that there is no search for the commutation angle.
    pub aligned: bool,
    /// The position command of the master stays within S-0-0103, if the axis has a modulo.
    #[serde(default)]
    pub wraps: bool,
    /// Written in CP2 in this order, beside what the machine needs.
    pub settings: Vec<(u16, i64)>,
    /// What the service channel tries in CP2 after that, refused or not; reads and writes alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<Action>,
}

/// The machines that there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Plant {
    /// [`ReferenceAxis::press`].
    Press,
    /// [`ReferenceAxis::small_cnc`].
    SmallCnc,
    /// [`ReferenceAxis::precise`].
    Precise,
    /// [`ReferenceAxis::vertical`].
    Vertical,
    /// [`ReferenceAxis::catalogue`].
    Catalogue,
}

impl Plant {
    /// Its reference axis.
    #[must_use]
    pub fn axis(self) -> ReferenceAxis {
        match self {
            Self::Press => ReferenceAxis::press(),
            Self::SmallCnc => ReferenceAxis::small_cnc(),
            Self::Precise => ReferenceAxis::precise(),
            Self::Vertical => ReferenceAxis::vertical(),
            Self::Catalogue => ReferenceAxis::catalogue(),
        }
    }
}

/// One thing that happens.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Since CP4 began for the first time, in us; a run-up within a life takes no time of it.
    pub at: u32,
    /// What.
    pub action: Action,
}

/// What can happen to an axis.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Action {
    /// Control word bits 15, 14, 13 as a number from 0 to 7.
    Switches(u8),
    /// The same for so many cycles, then as before.
    Blip(u8, u8),
    /// Control word bits 11, 9, 8 as a number from 0 to 7.
    Mode(u8),
    /// A command value of the MDT is this from now on, and stays.
    Set(u16, i64),
    /// A command value of the MDT jumps by this.
    Jump(u16, i64),
    /// A command value of the MDT changes by this much a second.
    Ramp(u16, i64),
    /// S-0-0047 becomes S-0-0051 whenever the drive does not follow, or is left alone.
    Align(bool),
    /// The service channel writes a data block.
    Write(u16, i64),
    /// The service channel writes a list of numbers or IDNs.
    WriteList(u16, Vec<u32>),
    /// The service channel writes a text.
    WriteText(u16, String),
    /// The service channel writes these words, which are fewer or more than the data block has.
    WriteWords(u16, Vec<u16>),
    /// The service channel reads a data block.
    Read(u16),
    /// A procedure command is started.
    Start(u16),
    /// A procedure command is cancelled.
    Cancel(u16),
    /// So many MSTs are lost.
    LoseMst(u8),
    /// So many MDTs are lost.
    LoseMdt(u8),
    /// One bit of the next MST is inverted.
    DamageMst(u8),
    /// One bit of the next MDT is inverted.
    DamageMdt(u16),
    /// One MST shows another phase byte.
    WrongPhase(u8),
    /// The fibre is dark for so many cycles.
    Dark(u16),
    /// The master goes to CP0 and runs up again; its switches are taken away first, or stay.
    RunUp {
        /// The switches stay as they are.
        stubborn: bool,
        /// What the service channel tries in CP2, as [`Axis::also`].
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        also: Vec<Action>,
    },
    /// A run-up to the phase before this one, 3 or 4, and this one without its transition check; then a proper run-up.
    SkipCheck(u8),
    /// The master goes back to this phase for some cycles, then runs up from CP0.
    FallBack(u8),
    /// Something breaks.
    Break(Fault),
    /// Everything that broke is repaired.
    Repair,
    /// A load drives the shaft, in per cent of the torque at standstill current.
    Load(i16),
    /// The mains has so many per cent of its voltage.
    Mains(u8),
    /// The contactor opens or closes; with it, control word bit 15 goes.
    Contactor {
        /// It closes.
        closed: bool,
        /// Bit 15 is taken back with it.
        with_bit_15: bool,
    },
    /// Both channels of safe torque off open or close.
    SafeTorqueOff(bool),
    /// The home switch.
    HomeSwitch(bool),
    /// Probe 1.
    Probe(bool),
}
