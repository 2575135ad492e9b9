//! The report of a training.

use std::path::PathBuf;

use serde::Serialize;

use super::config::TrainConfig;
use super::recipe::{TrainPreset, TrainWeights};

/// A finished training.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TrainReport {
    /// The settings.
    pub settings: TrainConfig,
    /// What the training was for.
    pub preset: TrainPreset,
    /// The weights of the loss that it had.
    pub weights: TrainWeights,
    /// The splats.
    pub splats: PathBuf,
    /// Highest degree of the harmonics of their colours.
    pub harmonics_degree: u8,
    /// Number of splats at the beginning.
    pub splats_before: usize,
    /// Number of splats at the end.
    pub splats_after: usize,
    /// Whether only what the masks show is modelled.
    pub masked: bool,
    /// Factor of the prior depths, as learned.
    pub depth_scale: f32,
    /// Seconds of the iterations of this run.
    pub seconds: f64,
    /// Share of the pixels of each trained image that were left out as transient.
    pub transient_share: Vec<f64>,
    /// Quality of the views before and after.
    pub views: Vec<TrainedViewRow>,
    /// Mean loss of the iterations before each point.
    pub losses: Vec<LossPoint>,
}

/// Quality of a view.
#[derive(Debug, Clone, Serialize)]
pub struct TrainedViewRow {
    /// File name of the image.
    pub name: String,
    /// Whether the view was kept from the training.
    pub held_out: bool,
    /// Signal-to-noise ratio before the training, dB.
    pub psnr_before_db: Option<f64>,
    /// Signal-to-noise ratio, dB.
    pub psnr_db: Option<f64>,
    /// Structural similarity before the training.
    pub ssim_before: Option<f64>,
    /// Structural similarity.
    pub ssim: Option<f64>,
    /// Structural similarity over five scales; none of images with a side below 176 pixels.
    pub ms_ssim: Option<f64>,
    /// Signal-to-noise ratio over the right half of a photograph that was held out, dB.
    pub psnr_right_db: Option<f64>,
    /// The same after the gains and the offsets that bring its left half to the truth, dB: a
    /// photograph has an exposure of its own, which no training on others can know.
    pub psnr_right_exposed_db: Option<f64>,
}

/// Signal-to-noise ratio (dB) and structural similarity of a view.
pub(super) type Quality = (Option<f64>, Option<f64>);

/// Signal-to-noise ratio (dB) over the right half of a view, as it is and after its exposure.
pub(super) type Exposed = (Option<f64>, Option<f64>);

impl TrainedViewRow {
    pub(super) fn new(name: &str, held_out: bool, before: Quality, after: Quality) -> Self {
        Self {
            name: name.to_owned(),
            held_out,
            psnr_before_db: before.0,
            psnr_db: after.0,
            ssim_before: before.1,
            ssim: after.1,
            ms_ssim: None,
            psnr_right_db: None,
            psnr_right_exposed_db: None,
        }
    }

    pub(super) fn with_ms_ssim(self, ms_ssim: Option<f64>) -> Self {
        Self { ms_ssim, ..self }
    }

    pub(super) fn with_right(self, (plain, exposed): Exposed) -> Self {
        Self { psnr_right_db: plain, psnr_right_exposed_db: exposed, ..self }
    }
}

/// Mean terms of the loss over some iterations, without their weights.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LossPoint {
    /// Last iteration, counted from 1.
    pub iteration: u32,
    /// Number of splats.
    pub splats: usize,
    /// Sum with the weights.
    pub total: f64,
    /// Colour.
    pub colour: f64,
    /// Depths against the prior.
    pub prior_depth: f64,
    /// Normals against the prior.
    pub prior_normal: f64,
    /// One less the correlation with heights of unknown scale.
    pub correlation: f64,
}

impl TrainReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mean = |held_out: bool, of: fn(&TrainedViewRow) -> Option<f64>| {
            let values: Vec<f64> = self.views.iter().filter(|v| v.held_out == held_out).filter_map(of).collect();
            if values.is_empty() {
                "none".to_owned()
            } else {
                format!("{:.2}", values.iter().sum::<f64>() / values.len() as f64)
            }
        };
        let line = |held_out: bool| {
            format!(
                "{} dB (before {} dB), SSIM {}",
                mean(held_out, |v| v.psnr_db),
                mean(held_out, |v| v.psnr_before_db),
                mean(held_out, |v| v.ssim)
            )
        };
        let exposed = format!(
            "{} dB over the right halves, {} dB with the exposure of the left ones",
            mean(true, |v| v.psnr_right_db),
            mean(true, |v| v.psnr_right_exposed_db)
        );
        format!(
            "splats    {} ({}, before {})\ntrained   {}\nheld out  {}\n          {exposed}\ntime      {:.0} s\n",
            self.splats.display(),
            self.splats_after,
            self.splats_before,
            line(false),
            line(true),
            self.seconds,
        )
    }
}
