//! Options of the search for the ground, which several commands share.

use terrain::GroundConfig;

/// Options of the search for the ground.
#[derive(Debug, clap::Args)]
pub(crate) struct GroundArgs {
    /// Width of the widest object, metres: large halls and closed blocks of houses.
    #[arg(long, value_name = "METRES", default_value_t = GroundConfig::default().widest_object_m)]
    widest_object: f64,
    /// Slope of open ground, rise per run: 0.15 is 15 %. Part of the place's own slope is added.
    #[arg(long, value_name = "RISE_PER_RUN", default_value_t = GroundConfig::default().slope)]
    slope: f64,
}

impl GroundArgs {
    /// Returns the parameters of the search.
    pub(crate) fn config(&self) -> GroundConfig {
        let mut config = GroundConfig::default();
        config.widest_object_m = self.widest_object;
        config.slope = self.slope;
        config
    }
}
