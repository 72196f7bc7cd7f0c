//! Results as text, and as one HTML page.

pub(crate) mod checks;
// Until the bench exports it, its file is read in place.
#[allow(unreachable_pub, dead_code, reason = "the bench's public types, read in place")]
#[path = "../../bench/src/report.rs"]
pub(crate) mod data;
#[cfg(test)]
pub(crate) mod examples;
pub(crate) mod numbers;
pub(crate) mod page;
mod plot;
pub(crate) mod text;
