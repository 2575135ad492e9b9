//! The report of a viewer.

use serde::Serialize;

/// A viewer that has ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ViewerReport {
    /// Names of the layers, and of splats and meshes.
    pub layers: Vec<String>,
    /// Requests that were answered.
    pub answered: u64,
    /// Requests that were refused: without the token, from another host, malformed, or for
    /// something that is not there.
    pub refused: u64,
    /// Requests that failed, such as tiles of a damaged raster.
    pub failed: u64,
    /// Time from the start to the end, seconds.
    pub seconds: f64,
}

impl ViewerReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let Self { answered, refused, failed, seconds, .. } = self;
        format!("requests   {answered} answered, {refused} refused, {failed} failed\ntime       {seconds:.1} s\n")
    }
}
