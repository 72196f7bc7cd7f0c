//! Integer arithmetic in the shapes that the processor is quick at, and the divisions that only settings make.

pub(crate) mod arctangent;
pub(crate) mod division;
pub(crate) mod gain;
pub(crate) mod limited_gain;
pub(crate) mod share;
pub(crate) mod trigonometry;
pub(crate) mod wide;

pub use gain::Gain;
pub use trigonometry::Rotation;
