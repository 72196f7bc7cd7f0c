//! Results as text, and as one HTML page.

pub(crate) use bench::report as data;

pub(crate) mod checks;
#[cfg(test)]
pub(crate) mod examples;
pub(crate) mod numbers;
pub(crate) mod page;
mod plot;
pub(crate) mod scope;
pub(crate) mod text;
