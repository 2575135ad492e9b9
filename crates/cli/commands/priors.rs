//! `skysweep priors`: a city model and cameras in, a dataset for Gaussian splatting trainers out.
//!
//! Satellite images give maps only. Exit code 1 when objects of the model could not be used.

use std::path::PathBuf;

use ::priors::{Amount, DepthKind, NormalFrame, Spacing, VisibilityConfig};
use city::Lod;
use crs::{CrsRequest, VerticalDatum};
use jobs::error::JobError;
use jobs::priors::{PriorsClassWeight, PriorsConfig, PriorsImages, PriorsMiss, PriorsMode, PriorsTrainer};
use numeric::{Failure, Kind};

use crate::corrections::code_of;
use crate::error::with_hint;
use crate::options::named;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Make depth, normal and mask priors of a city model for the cameras of a Gaussian splatting
/// scene.
#[derive(Debug, clap::Args)]
#[command(
    mut_arg("overwrite", |arg| arg.help("Replace an earlier dataset")),
    after_help = "Examples: skysweep priors town.city.json --cameras scene/sparse/0 --offset 690000 5336000 0 -o scene_priors; \
                  skysweep priors town.city.json --cameras view_*.tif -o satellite_priors"
)]
pub(crate) struct Args {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Cameras: the folder of a COLMAP model (or one with sparse/0 in it), a transforms.json, or
    /// satellite images with RPCs.
    ///
    /// Of satellite images (files, or a folder of them) the maps are made, in the pixels of each
    /// image and with its RPC: heights above the ellipsoid, distances along the line of sight,
    /// normals in east, north and up, mask, class and object.
    #[arg(long, value_name = "DIR|FILE", required = true, num_args = 1..)]
    cameras: Vec<PathBuf>,
    /// Folder for the dataset.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Origin of the cameras' frame in the model's coordinates.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, conflicts_with = "transform")]
    offset: Option<Vec<f64>>,
    /// Similarity from the model's coordinates to the cameras' frame (JSON: scale, rotation,
    /// translation, or a matrix).
    #[arg(long, value_name = "FILE")]
    transform: Option<PathBuf>,
    /// Columns and rows of the images, for a transforms.json that does not state them.
    #[arg(long, num_args = 2, value_names = ["COLUMNS", "ROWS"])]
    image_size: Option<Vec<usize>>,

    /// The model's map, where its file does not state it (satellite images): EPSG:n or EPSG:n+m
    /// with the code of the heights.
    #[arg(long, value_name = "CRS", alias = "crs", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    model_crs: Option<CrsRequest>,
    /// Vertical datum of the model, where its file does not state it: ellipsoid, egm96, egm2008 or
    /// an EPSG code.
    #[arg(long, value_name = "DATUM", alias = "vertical", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    model_vertical: Option<VerticalDatum>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm [default: RPCs as
    /// they are].
    #[arg(long, value_name = "report.json", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    corrections: Option<PathBuf>,

    /// What is to be trained: only the buildings, or the whole scene with priors on them.
    #[arg(long, value_parser = named(&PriorsMode::CHOICES), default_value = "building-only")]
    mode: PriorsMode,
    /// The trainer that the dataset is for; 2DGS ignores the principal point, gsplat uses it.
    #[arg(long, value_parser = named(&PriorsTrainer::CHOICES), default_value = "2dgs")]
    trainer: PriorsTrainer,
    /// Crop cameras whose principal point is not in the middle; crops.json says how to crop the
    /// images.
    #[arg(long)]
    recrop: bool,
    /// Make the maps only, for lenses of any kind, in the pixels of the images as they are.
    #[arg(long, conflicts_with = "recrop")]
    maps_only: bool,

    /// Level of detail, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    lod: Option<Lod>,
    /// Let everything in the model hide what is behind it, not only buildings.
    #[arg(long)]
    all_objects: bool,

    /// Number of points on the model [default: 1000000].
    #[arg(long, value_name = "N", group = "amount")]
    points: Option<usize>,
    /// Points per square metre.
    #[arg(long, value_name = "PER_M2", group = "amount")]
    density: Option<f64>,
    /// As many points as this geometric error needs, metres: few on large planes, more at edges and
    /// on small parts.
    #[arg(long, value_name = "METRES", group = "amount")]
    geometric_error: Option<f64>,
    /// The largest spacing with --geometric-error, metres.
    #[arg(long, value_name = "METRES", default_value_t = 2.0)]
    max_spacing: f64,
    /// How points keep a distance from each other.
    #[arg(long, value_parser = named(&Spacing::CHOICES), default_value = "stratified")]
    spacing: Spacing,
    /// Weight of a class of surfaces, such as RoofSurface=2; 0 leaves it out.
    #[arg(long, value_name = "CLASS=WEIGHT")]
    class_weight: Vec<PriorsClassWeight>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Views that must see a point.
    #[arg(long, value_name = "K", default_value_t = VisibilityConfig::default().min_views)]
    min_views: u32,
    /// How far inside the image a point must lie, pixels.
    #[arg(long, value_name = "PX", default_value_t = VisibilityConfig::default().margin_px, allow_negative_numbers = true)]
    margin: f64,
    /// Length of the end of a ray that is not tested for occlusion, metres.
    #[arg(long, value_name = "METRES", default_value_t = VisibilityConfig::default().epsilon_m)]
    epsilon: f64,
    /// Least depth at which something is seen, metres.
    #[arg(long, value_name = "METRES", default_value_t = VisibilityConfig::default().near_m)]
    near: f64,
    /// The largest angle between ray and normal, degrees [default: none].
    #[arg(long, value_name = "DEGREES")]
    max_incidence: Option<f64>,
    /// Largest number of observations kept per point (the best).
    #[arg(long, value_name = "M", default_value_t = VisibilityConfig::default().max_observations)]
    max_observations: usize,

    /// What depth means.
    #[arg(long, value_parser = named(&DepthKind::CHOICES), default_value = "z")]
    depth: DepthKind,
    /// The axes of normals.
    #[arg(long, value_parser = named(&NormalFrame::CHOICES), default_value = "world")]
    normals: NormalFrame,
    /// Write more forms of the points: the COLMAP model as text, points3D.ply beside sparse, and
    /// initial splats for 2DGS and 3DGS.
    #[arg(long, conflicts_with = "maps_only")]
    extras: bool,
    /// Write the pictures, too: those of this folder, or without a folder those beside the cameras.
    /// Masked to the buildings in the mode building-only, cropped where cameras are. "--images=DIR"
    /// names the folder.
    #[arg(long, value_name = "DIR", num_args = 0..=1, require_equals = true, conflicts_with = "maps_only")]
    images: Option<Option<PathBuf>>,
    /// Depth of pixels that see no building, in the maps as .npy.
    #[arg(long, value_parser = named(&PriorsMiss::CHOICES), default_value = "inf")]
    miss: PriorsMiss,
    /// Write the maps as GeoTIFF too.
    #[arg(long)]
    geotiff: bool,
    /// Number of views with preview pictures.
    #[arg(long, value_name = "N", default_value_t = 12)]
    previews: usize,

    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep priors`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let config = args.config()?;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::priors::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report.product, || report.text())?;
    let what = "no point of the model is seen by enough cameras, or objects of it have no usable surface";
    Ok(if report.is_whole() { Outcome::Complete } else { Outcome::Partial(what.to_owned()) })
}

/// Names the options that mend an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        _ if error.kind() == Kind::OutputExists => Some("choose another folder or pass --overwrite"),
        Some("the frame of the cameras") => Some("state it with --offset or --transform"),
        Some("the pictures") => Some("--images=DIR names the folder of the pictures"),
        Some("the values for satellite images") => Some("leave out --model-crs, --model-vertical and --corrections"),
        Some("the values for perspective cameras") => Some("leave out --offset, --transform and --images"),
        Some("the map of the model") => Some("give --model-crs EPSG:n"),
        Some("the objects of the model") => Some("skysweep city info names the reasons"),
        Some("the offset of the frame") => Some("it is given by --offset"),
        Some("the lens") => Some("--maps-only makes the maps for any lens"),
        Some("the principal point") => Some(
            "--recrop crops the camera (and writes how to crop the images), --trainer gsplat keeps the principal point",
        ),
        _ => None,
    };
    with_hint(error, hint)
}

impl Args {
    fn config(&self) -> anyhow::Result<PriorsConfig> {
        let mut config = PriorsConfig::new(self.model.clone(), self.cameras.clone(), self.output.clone());
        config.offset = self.offset.as_deref().and_then(|offset| offset.try_into().ok());
        config.transform.clone_from(&self.transform);
        config.image_size = self.image_size.as_deref().and_then(|size| size.try_into().ok());
        let (map_epsg, datum) = code_of(self.model_crs, "--model-crs")?;
        config.map_epsg = map_epsg;
        config.vertical = self.model_vertical.or(datum);
        config.corrections.clone_from(&self.corrections);
        config.mode = self.mode;
        config.trainer = self.trainer;
        config.recrop = self.recrop;
        config.maps_only = self.maps_only;
        config.lod = self.lod;
        config.all_objects = self.all_objects;
        self.set_sampling(&mut config);
        config.visibility = VisibilityConfig {
            margin_px: self.margin,
            near_m: self.near,
            epsilon_m: self.epsilon,
            max_incidence_deg: self.max_incidence,
            min_views: self.min_views,
            max_observations: self.max_observations,
        };
        config.maps.depth = self.depth;
        config.maps.normals = self.normals;
        config.extras = self.extras;
        config.images = match &self.images {
            None => PriorsImages::None,
            Some(None) => PriorsImages::Beside,
            Some(Some(folder)) => PriorsImages::Folder(folder.clone()),
        };
        config.miss = self.miss;
        config.geotiff = self.geotiff;
        config.previews = self.previews;
        config.threads = self.run.threads.map(|threads| threads.max(1));
        config.overwrite = self.run.overwrite;
        Ok(config)
    }

    fn set_sampling(&self, config: &mut PriorsConfig) {
        config.amount = match (self.points, self.density, self.geometric_error) {
            (_, Some(density), _) => Amount::PerSquareMetre(density),
            (_, _, Some(error_m)) => Amount::Adaptive { error_m, max_spacing_m: self.max_spacing },
            (points, None, None) => points.map_or(config.amount, Amount::Count),
        };
        config.spacing = self.spacing;
        config.class_weights.clone_from(&self.class_weight);
        config.seed = self.seed;
    }
}
