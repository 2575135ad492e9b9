//! The report of an alignment as lines of text.

use std::path::Path;

use colmap::align::{Disturbance, NoiseLevel};

use super::AlignJobReport;

impl AlignJobReport {
    /// Returns the report as text, which ends in a line break. `output` is the folder that was
    /// written.
    pub fn text(&self, output: &Path) -> String {
        let mut text = format!(
            "positions  {} of {} agree within {:.3} m, RMSE {:.3} m\nscale      {:.6} m per unit of the model\n",
            self.inliers, self.pairs, self.threshold_m, self.rmse_m, self.world_from_model.scale,
        );
        text += &self.noise.iter().map(noise_line).collect::<String>();
        text + &format!("written    {}\n", output.display())
    }
}

fn noise_line(level: &NoiseLevel) -> String {
    let name = match level.disturbance {
        Disturbance::TranslationM(m) => format!("{m} m"),
        Disturbance::RotationDeg(deg) => format!("{deg}°"),
    };
    format!(
        "noise      {name:>6}: cameras off by {:.2} ± {:.2} m, turned by {:.2} ± {:.2}°, scale by {:.2} ± {:.2} %\n",
        level.position_m.mean,
        level.position_m.std,
        level.rotation_deg.mean,
        level.rotation_deg.std,
        level.scale_percent.mean,
        level.scale_percent.std
    )
}
