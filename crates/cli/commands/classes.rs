//! `skysweep classes`: ground, buildings and vegetation of a surface model.

use std::path::PathBuf;

use formats::raster::BandChoice;
use jobs::classes::ClassesConfig;

use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::ground::GroundArgs;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep classes`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep classes run --multispectral ms_1.tif ms_2.tif -o classes")]
pub(crate) struct Args {
    /// Surface model on a map with square cells, or the folder of a run of skysweep dsm.
    surface: PathBuf,
    /// Folder for classes.tif, roughness.tif, ndvi.tif and classes.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Vegetation index (NDVI, −1 to 1) on any grid, which overrules the roughness of the surface.
    #[arg(long, value_name = "FILE")]
    ndvi: Option<PathBuf>,
    /// Multispectral images with RPCs to make a vegetation index of, with the pointing corrections
    /// of the run, which those of its panchromatic images give.
    #[arg(long, value_name = "IMAGE", num_args = 1.., conflicts_with = "ndvi")]
    multispectral: Vec<PathBuf>,
    /// Red band of the multispectral images, by number or name [default: the one that the file
    /// names so].
    #[arg(long, value_name = "BAND", requires = "multispectral")]
    red_band: Option<BandChoice>,
    /// Near-infrared band of the multispectral images, by number or name [default: the one that the
    /// file names so].
    #[arg(long, value_name = "BAND", requires = "multispectral")]
    nir_band: Option<BandChoice>,
    /// Pointing corrections of the multispectral images: the report of a run of skysweep dsm, or
    /// none [default: from the run that made the surface model].
    #[arg(long, value_name = "report.json|none", requires = "multispectral")]
    corrections: Option<PathBuf>,
    /// Building index (0 to 1, from skysweep buildings) on any grid, which decides where the
    /// heights are weak.
    #[arg(long, value_name = "FILE")]
    index: Option<PathBuf>,
    #[command(flatten)]
    ground: GroundArgs,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep classes`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = ClassesConfig::new(args.surface.clone(), args.output.clone());
    config.vegetation_index.clone_from(&args.ndvi);
    config.multispectral.clone_from(&args.multispectral);
    config.red_band.clone_from(&args.red_band);
    config.nir_band.clone_from(&args.nir_band);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.building_index.clone_from(&args.index);
    config.terrain = args.ground.config();
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::classes::run(&config, watcher)).map_err(|error| {
        let unnamed = error.setting() == Some("the bands of the vegetation index");
        with_hint(error, unnamed.then_some("give --red-band and --nir-band"))
    })?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
