//! What is wrong with the drive, and how it is told.
//!
//! The loops know [`words`] and [`faults`] only; [`table`] has the texts.

pub(crate) mod error_memory;
pub(crate) mod faults;
pub(crate) mod news;
pub(crate) mod table;
pub(crate) mod words;
