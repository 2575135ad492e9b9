//! The sensitivity of an alignment to noise in positions and heading, and models made with such noise.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use camera::Similarity;
use colmap::align::{AlignConfig, Alignment, Disturbance, NoiseConfig, NoiseLevel, PointPair, disturbed, sensitivity};

/// Options of the harness.
#[derive(Debug, clap::Args)]
#[group(id = "noise options")]
pub(super) struct Args {
    /// Repeat the alignment with noise and report what changes: mean and standard deviation over seeds.
    #[arg(long)]
    noise: bool,
    /// Standard deviations of the positions, metres along each axis.
    #[arg(long, value_name = "METRES", value_delimiter = ',', default_value = "1,3,5")]
    noise_translation: Vec<f64>,
    /// Standard deviations of the heading, degrees.
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', default_value = "5,10,15")]
    noise_rotation: Vec<f64>,
    /// Seeds per level.
    #[arg(long, value_name = "N", default_value_t = NoiseConfig::default().seeds, value_parser = clap::value_parser!(u64).range(1..=1000))]
    noise_seeds: u64,
    /// Also write the model of every level and seed to this folder.
    #[arg(long, value_name = "DIR", requires = "noise")]
    noise_output: Option<PathBuf>,
}

impl Args {
    fn config(&self) -> NoiseConfig {
        NoiseConfig {
            translation_m: self.noise_translation.clone(),
            rotation_deg: self.noise_rotation.clone(),
            seeds: self.noise_seeds,
        }
    }
}

/// The levels, none when they were not asked for.
pub(super) fn measure(
    args: &Args,
    pairs: &[PointPair],
    alignment: &Alignment,
    config: &AlignConfig,
) -> anyhow::Result<Vec<NoiseLevel>> {
    let levels = args.noise_translation.iter().chain(&args.noise_rotation);
    for level in levels {
        ensure!(*level >= 0.0 && level.is_finite(), "a level of noise is {level}, expected a number from 0 on");
    }
    Ok(if args.noise { sensitivity(pairs, alignment, &args.config(), config) } else { Vec::new() })
}

/// Writes the models under noise: `translation_3m_seed_2`, `rotation_10deg_seed_1`.
pub(super) fn write(
    args: &Args,
    pairs: &[PointPair],
    alignment: &Alignment,
    config: &AlignConfig,
    write_model: &impl Fn(&Path, &Similarity) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some(folder) = &args.noise_output else { return Ok(()) };
    let translations =
        args.noise_translation.iter().map(|&m| (Disturbance::TranslationM(m), format!("translation_{m}m")));
    let rotations =
        args.noise_rotation.iter().map(|&deg| (Disturbance::RotationDeg(deg), format!("rotation_{deg}deg")));
    for (disturbance, name) in translations.chain(rotations) {
        for seed in 1..=args.noise_seeds {
            match disturbed(pairs, alignment, disturbance, seed, config) {
                Ok(similarity) => write_model(&folder.join(format!("{name}_seed_{seed}")), &similarity)?,
                Err(error) => tracing::warn!("{name}, seed {seed}: {error}"),
            }
        }
    }
    Ok(())
}

/// The levels as text.
pub(super) fn table(levels: &[NoiseLevel]) -> String {
    let line = |level: &NoiseLevel| {
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
    };
    levels.iter().map(line).collect()
}
