//! What the commissioning commands have under way.

use super::commissioning::Finding;
use super::tuning::Tuning;
use crate::dictionary::procedures::Procedure;

/// Which identification runs, and what the last command has found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Commissioning {
    /// P-0-0224, P-0-0225, P-0-0226, P-0-0240 or P-0-0250.
    pub(crate) identifying: Option<Procedure>,
    /// P-0-0228.
    pub(crate) finding: Option<Finding>,
    /// P-0-0240.
    pub(crate) tuning: Tuning,
}
