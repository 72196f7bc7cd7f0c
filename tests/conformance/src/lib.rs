//! The slave conformance test: what a SERCOS II slave must do, case by case, against the whole drive on a simulated ring.
//!
//! The public record has no text of the slave test, only its headings (sercos2.md 9); the rules are those of the reference document, of the
//! master test IGS 1.04 seen from the other side, and of what the recorded master does.
//!
//! * [`slave`], [`configuration`]: a slave, and everything a case can do to it.
//! * [`case`]: cases and what comes of them.
//! * [`sections`]: the cases themselves, one file a heading.
//! * [`walk`]: every element of every data block, compared with the table.
#![forbid(unsafe_code)]

pub mod case;
pub mod configuration;
pub mod sections;
pub mod slave;
pub mod walk;

pub use case::{Case, CaseReport, Section, SlaveReport};
pub use configuration::Configuration;
pub use sections::cases;
pub use slave::{Answer, At, Outcome, Slave};
