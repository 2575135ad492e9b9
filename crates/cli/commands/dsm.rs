//! `skysweep dsm`: satellite images with RPCs in, a georeferenced DSM out.

use std::path::{Path, PathBuf};

use crs::{CrsRequest, VerticalDatum};
use formats::raster::BandChoice;
use jobs::dsm::job_file::read_dsm_job;
use jobs::dsm::{DsmConfig, DsmError, DsmReport, Fill, HeightRange, ImagePair, LayerArea, MapBounds, Preset};
use jobs::error::JobError;
use jobs::image_files::image_files;
use jobs::job_file::is_job_file;
use jobs::production::make_plan;
use jobs::products::ProductKind;

use crate::error::with_hint;
use crate::options::named;
use crate::progress::ShowOptions;
use crate::{Global, Outcome};

/// Make a surface model from two or more satellite images with RPCs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "With no option but the images and -o, everything is chosen from the scene, and each choice is \
                        printed with its reason. Example: skysweep dsm left.tif right.tif -o out"
)]
pub(crate) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Print the plan (images, grid, chunks, memory and time, choices) and write nothing.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    show: ShowOptions,
}

/// Inputs and settings of a surface model.
#[derive(Debug, clap::Args)]
pub(crate) struct SceneArgs {
    /// The images, two or more: anything GDAL reads, with its RPC inside or beside it, or STAC
    /// items that name it; a folder stands for the images with an RPC in it, and a pattern in
    /// quotes ('pass_*/*.tif') for the files that match. Or one job file (see skysweep template
    /// dsm), whose settings the options replace.
    #[arg(required = true, value_name = "IMAGE|JOB.toml")]
    images: Vec<PathBuf>,
    /// Folder for the results [default: the job file's].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Cell size of the DSM in metres [default: the coarsest image's].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    gsd: Option<f64>,
    /// CRS of the DSM: auto, or a projected EPSG code [default: the scene's UTM zone].
    #[arg(long, value_name = "CRS")]
    crs: Option<CrsRequest>,
    /// Use the CRS although the scene lies far outside its area of use.
    #[arg(long)]
    force: bool,
    /// Area of the DSM in its CRS [default: the ground that at least two images see].
    #[arg(long, num_args = 4, value_names = ["X_MIN", "Y_MIN", "X_MAX", "Y_MAX"], allow_negative_numbers = true)]
    bounds: Option<Vec<f64>>,
    /// CRS of --bounds, such as EPSG:4326 for degrees [default: that of the DSM].
    #[arg(long, value_name = "CRS", value_parser = parse_epsg)]
    bounds_crs: Option<u32>,
    /// Polygons in which the DSM lies (GeoPackage, GeoJSON, shapefile); cells outside are void.
    #[arg(long, value_name = "FILE", conflicts_with = "bounds")]
    area: Option<PathBuf>,
    /// Ground without heights, such as water: polygons, or a georeferenced raster that is not 0
    /// there.
    #[arg(long = "mask", value_name = "FILE")]
    masks: Vec<PathBuf>,
    /// Pixels that are not matched, such as clouds: polygons on the ground, or a raster in the
    /// frame of an image; its name begins with that of its image (left_clouds.tif for left.tif).
    #[arg(long = "image-mask", value_name = "FILE")]
    image_masks: Vec<PathBuf>,
    /// Band to match, by number or name [default: the luma of all bands].
    #[arg(long, value_name = "BAND")]
    band: Option<BandChoice>,
    /// Heights to search, metres above the ellipsoid [default: from tie points].
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], allow_negative_numbers = true, conflicts_with = "dem")]
    height_range: Option<Vec<f64>>,
    /// Coarse elevation model from which the heights to search are taken.
    #[arg(long, value_name = "FILE")]
    dem: Option<PathBuf>,
    /// Surface model that the scene is moved onto, in its pointing.
    #[arg(long, value_name = "FILE", conflicts_with = "no_pointing")]
    reference_dem: Option<PathBuf>,
    /// Tilt the heights onto the reference elevation model, too.
    #[arg(long)]
    reference_plane: bool,
    /// What the heights of --dem and --reference-dem are above [default: what the files name].
    #[arg(long, value_name = "DATUM")]
    dem_vertical: Option<VerticalDatum>,
    /// City model (CityJSON, CityGML) whose roofs are expected: they are searched and favoured, but
    /// the images decide.
    #[arg(long, value_name = "MODEL")]
    prior: Option<PathBuf>,
    /// Ground control points and check points with their places in the images (CSV, GeoJSON).
    #[arg(long, value_name = "FILE")]
    control: Option<PathBuf>,
    /// Pointing corrections of an earlier run to start from: its pointing.json or report.json.
    #[arg(long, value_name = "FILE")]
    corrections: Option<PathBuf>,
    /// What the heights of the DSM are measured from: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM")]
    vertical: Option<VerticalDatum>,
    /// Speed against accuracy [default: balanced].
    #[arg(long, value_parser = named(&Preset::CHOICES))]
    preset: Option<Preset>,
    /// Voids to close from the heights around them, marked in filled.tif: none, justified (narrow
    /// voids, voids behind buildings, voids between known heights where the images have texture) or
    /// all within reach of known heights [default: justified].
    #[arg(long, value_parser = named(&Fill::CHOICES))]
    fill: Option<Fill>,
    /// Pairs of images to match, by position: 1-2,1-3 [default: all that are useful].
    #[arg(long, value_name = "I-J,…", value_delimiter = ',')]
    pairs: Option<Vec<ImagePair>>,
    /// Images to compute heights for, by position: 1,3 [default: all].
    #[arg(long, value_name = "I,…", value_delimiter = ',', value_parser = parse_position)]
    reference: Option<Vec<usize>>,
    /// Use the RPCs as they are, without a correction of their pointing.
    #[arg(long)]
    no_pointing: bool,
    /// What to make beside the DSM, in products [default: nothing].
    #[arg(long, value_name = "PRODUCT,…", value_delimiter = ',', value_parser = named(&ProductKind::CHOICES))]
    products: Option<Vec<ProductKind>>,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Memory limit, megabytes; a scene that takes more is computed by chunks [default: 4000].
    #[arg(long, value_name = "MB")]
    memory: Option<u64>,
    /// Side of the chunks of a large scene, cells [default: as large as the memory allows].
    #[arg(long, value_name = "CELLS")]
    chunk: Option<usize>,
    /// Side of the tiles that are fused at a time, cells; it changes the memory needed, never the
    /// result [default: 1024].
    #[arg(long, value_name = "CELLS")]
    tile: Option<usize>,
    /// Replace existing results.
    #[arg(long)]
    overwrite: bool,
}

/// Parses a position, which people count from 1, into one counted from 0.
fn parse_position(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(n) if n > 0 => Ok(n - 1),
        _ => Err(format!("expected the position of an image, counted from 1, found {text:?}")),
    }
}

/// Parses a CRS that is named by its code.
fn parse_epsg(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(CrsRequest::Epsg { horizontal, .. }) => Ok(horizontal),
        Ok(CrsRequest::Auto) => Err("expected an EPSG code such as EPSG:4326".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

impl SceneArgs {
    /// Returns the configuration: that of the job file, or the defaults, with the options given.
    pub(crate) fn config(&self) -> anyhow::Result<DsmConfig> {
        let mut config = match self.images.as_slice() {
            [file] if is_job_file(file) => read_dsm_job(file)?,
            images => DsmConfig::new(image_files(images)?, PathBuf::new()),
        };
        let range = |v: &Vec<f64>| Some(HeightRange::new(*v.first()?, *v.get(1)?));
        let bounds = |b: &Vec<f64>| <[f64; 4]>::try_from(b.as_slice()).ok().map(MapBounds::from);
        config.output = self.output.clone().unwrap_or(config.output);
        config.gsd_m = self.gsd.or(config.gsd_m);
        match self.crs {
            None => {}
            Some(CrsRequest::Auto) => config.crs_epsg = None,
            Some(CrsRequest::Epsg { horizontal, vertical }) => {
                config.crs_epsg = Some(horizontal);
                config.vertical = vertical.unwrap_or(config.vertical);
            }
        }
        config.vertical = self.vertical.unwrap_or(config.vertical);
        config.force_crs |= self.force;
        config.bounds = self.bounds.as_ref().and_then(bounds).or(config.bounds);
        config.bounds_epsg = self.bounds_crs.or(config.bounds_epsg.filter(|_| self.bounds.is_none()));
        config.area = self.area.clone().map(LayerArea::new).or(config.area);
        for (given, own) in [(&self.masks, &mut config.masks), (&self.image_masks, &mut config.image_masks)] {
            if !given.is_empty() {
                own.clone_from(given);
            }
        }
        config.band = self.band.clone().or(config.band);
        if self.height_range.is_some() || self.dem.is_some() {
            config.height_range_m = self.height_range.as_ref().and_then(range);
            config.dem.clone_from(&self.dem);
        }
        config.reference_dem = self.reference_dem.clone().or(config.reference_dem);
        config.reference_plane |= self.reference_plane;
        config.dem_vertical = self.dem_vertical.or(config.dem_vertical);
        config.prior = self.prior.clone().or(config.prior);
        config.control = self.control.clone().or(config.control);
        config.corrections = self.corrections.clone().or(config.corrections);
        config.preset = self.preset.unwrap_or(config.preset);
        config.fill = self.fill.unwrap_or(config.fill);
        config.pairs = self.pairs.clone().or(config.pairs);
        config.references = self.reference.clone().or(config.references);
        config.pointing &= !self.no_pointing;
        config.products = self.products.clone().unwrap_or(config.products);
        config.threads = self.threads.or(config.threads);
        config.memory_mb = self.memory.or(config.memory_mb);
        config.chunk = self.chunk.or(config.chunk);
        config.tile = self.tile.unwrap_or(config.tile);
        config.overwrite |= self.overwrite;
        Ok(config)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let config = args.scene.config()?;
    if args.dry_run {
        let plan = args.show.watch(global, &config.output, |watcher| make_plan(&config, watcher));
        let plan = plan.map_err(production_hinted)?;
        args.show.print(global, &plan, || plan.text())?;
        return Ok(Outcome::Complete);
    }
    let report = args.show.watch(global, &config.output, |watcher| jobs::dsm::run(&config, watcher)).map_err(hinted)?;
    print(args.show, global, &report, &config.output)
}

/// Prints the report of a surface model.
pub(crate) fn print(show: ShowOptions, global: Global, report: &DsmReport, output: &Path) -> anyhow::Result<Outcome> {
    show.print(global, report, || report.text(output))?;
    let failed = report.chunks.as_ref().map_or(0, |chunks| chunks.failed.len());
    let what = || format!("chunks that could not be computed, whose cells are void: {failed}; the report names them");
    Ok(if failed == 0 { Outcome::Complete } else { Outcome::Partial(what()) })
}

fn hinted(error: DsmError) -> anyhow::Error {
    let hint = error.setting().and_then(hint);
    with_hint(error, hint)
}

/// Adds the option that helps with an error of a planned run.
pub(crate) fn production_hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the plan") => Some("skysweep plan IMAGES… -o RUN makes one"),
        Some("what the plan rests on") => Some("skysweep run RUN --resume plans and computes again"),
        Some("the chunks") => Some("skysweep run RUN computes them, --partial leaves them void"),
        other => other.and_then(hint),
    };
    with_hint(error, hint)
}

/// Returns the options that help with a setting or an input.
fn hint(setting: &str) -> Option<&'static str> {
    Some(match setting {
        "the pointing" => "--no-pointing uses the RPCs as they are",
        "the heights to search" => "--height-range LO HI gives the heights to search, and --dem takes them from a file",
        "the heights" => "--height-range LO HI gives the heights to search",
        "the given height range" => "without --height-range the heights are found from tie points",
        "the limit of memory" => "--memory MB raises the limit, and --bounds makes the area smaller",
        "the given bounds" => "without --bounds the DSM covers all the ground that two images see",
        "the area" => "without --area the DSM covers all the ground that two images see",
        "the city model" => "`skysweep city info MODEL` checks a city model",
        "the output folder" => "-o DIR names it",
        "the cell size" => "the cell size is set by --gsd",
        "the coordinate reference system" => "the CRS is set by --crs; --force uses it outside its area of use",
        "the bounds" => "the grid is set by --bounds and --gsd",
        "the height range" => "the heights are set by --height-range",
        "the elevation model" => "the elevation model is set by --dem",
        "the reference elevation model" => "the reference is set by --reference-dem, its datum by --dem-vertical",
        "the mask" => "masks on the ground are set by --mask, masks of single images by --image-mask",
        "the mask of an image" => "masks of single images are set by --image-mask",
        "the list of image pairs" => "the pairs are set by --pairs",
        "the list of reference images" => "the images to compute heights for are set by --reference",
        "the number of threads" => "the number of threads is set by --threads",
        "the side of the chunks" => "the chunks are set by --chunk",
        "the side of the tiles" => "the tiles are set by --tile",
        _ => return None,
    })
}
