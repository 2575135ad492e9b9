//! The arguments of `skysweep priors`.

use std::path::PathBuf;

use ::priors::{
    Amount, ClassWeights, DepthKind, MapConfig, NormalFrame, SampleConfig, Spacing as Placement, VisibilityConfig,
};
use city::{Lod, SurfaceClass};
use clap::ValueEnum;
use crs::{CrsRequest, VerticalDatum};

use crate::progress::ProgressStyle;

/// Make depth, normal and mask priors of a city model for the cameras of a Gaussian splatting scene.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples: skysweep priors town.city.json --cameras scene/sparse/0 --offset 690000 5336000 0 -o scene_priors; \
                  skysweep priors town.city.json --cameras view_*.tif -o satellite_priors"
)]
pub(crate) struct Args {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    #[arg(value_name = "MODEL")]
    pub(super) model: PathBuf,
    /// Cameras: the folder of a COLMAP model (or one with sparse/0 in it), a transforms.json, or satellite images with RPCs.
    ///
    /// Of satellite images (files, or a folder of them) the maps are made, in the pixels of each image and with its RPC: heights
    /// above the ellipsoid, distances along the line of sight, normals in east, north and up, mask, class and object.
    #[arg(long, value_name = "DIR|FILE", required = true, num_args = 1..)]
    pub(super) cameras: Vec<PathBuf>,
    /// Folder for the dataset.
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Where the origin of the cameras' frame lies in the model's coordinates.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, conflicts_with = "transform")]
    pub(super) offset: Option<Vec<f64>>,
    /// Similarity from the model's coordinates to the cameras' frame (JSON: scale, rotation, translation, or a matrix).
    #[arg(long, value_name = "FILE")]
    pub(super) transform: Option<PathBuf>,
    /// Columns and rows of the images, for a transforms.json that does not say.
    #[arg(long, num_args = 2, value_names = ["COLUMNS", "ROWS"])]
    pub(super) image_size: Option<Vec<usize>>,

    /// The model's map, where its file does not say (satellite images): EPSG:n or EPSG:n+m with the code of the heights.
    #[arg(long, value_name = "EPSG", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    pub(super) crs: Option<CrsRequest>,
    /// What the model's heights are above, where its file does not say: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    pub(super) vertical: Option<VerticalDatum>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm [default: RPCs as they are].
    #[arg(long, value_name = "report.json", help_heading = "Satellite images", conflicts_with_all = ["offset", "transform"])]
    pub(super) corrections: Option<PathBuf>,

    /// What is to be trained: only the buildings, or the whole scene with priors on them.
    #[arg(long, value_enum, default_value_t = Mode::BuildingOnly)]
    pub(super) mode: Mode,
    /// The trainer that the dataset is for; 2DGS ignores the principal point, gsplat does not.
    #[arg(long, value_enum, default_value_t = Trainer::TwoDgs)]
    pub(super) trainer: Trainer,
    /// Crop cameras whose principal point is not in the middle; crops.json says how to crop the images.
    #[arg(long)]
    pub(super) recrop: bool,
    /// Make the maps only, for lenses of any kind, in the pixels of the images as they are.
    #[arg(long, conflicts_with = "recrop")]
    pub(super) maps_only: bool,

    /// Level of detail, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    pub(super) lod: Option<Lod>,
    /// Let everything in the model hide what is behind it, not only buildings.
    #[arg(long)]
    pub(super) all_objects: bool,

    /// Number of points on the model [default: 1000000].
    #[arg(long, value_name = "N", group = "amount")]
    pub(super) points: Option<usize>,
    /// Points per square metre.
    #[arg(long, value_name = "PER_M2", group = "amount")]
    pub(super) density: Option<f64>,
    /// As many points as this geometric error needs, metres: few on large planes, more at edges and on small parts.
    #[arg(long, value_name = "METRES", group = "amount")]
    pub(super) geometric_error: Option<f64>,
    /// The largest spacing with --geometric-error, metres.
    #[arg(long, value_name = "METRES", default_value_t = 2.0)]
    pub(super) max_spacing: f64,
    /// How points keep away from one another.
    #[arg(long, value_enum, default_value_t = Spacing::Stratified)]
    pub(super) spacing: Spacing,
    /// What a class of surfaces counts, such as RoofSurface=2; 0 leaves it out.
    #[arg(long, value_name = "CLASS=WEIGHT", value_parser = parse_weight)]
    pub(super) class_weight: Vec<(SurfaceClass, f64)>,
    /// Everything random follows from this number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,

    /// Views that must see a point.
    #[arg(long, value_name = "K", default_value_t = VisibilityConfig::default().min_views)]
    pub(super) min_views: u32,
    /// How far inside the image a point must lie, pixels.
    #[arg(long, value_name = "PX", default_value_t = VisibilityConfig::default().margin_px, allow_negative_numbers = true)]
    pub(super) margin: f64,
    /// The last part of a ray that is not looked at, metres.
    #[arg(long, value_name = "METRES", default_value_t = VisibilityConfig::default().epsilon_m)]
    pub(super) epsilon: f64,
    /// Depth before which nothing is seen, metres.
    #[arg(long, value_name = "METRES", default_value_t = VisibilityConfig::default().near_m)]
    pub(super) near: f64,
    /// The largest angle between ray and normal, degrees [default: none].
    #[arg(long, value_name = "DEGREES")]
    pub(super) max_incidence: Option<f64>,
    /// Observations kept per point, the best.
    #[arg(long, value_name = "M", default_value_t = VisibilityConfig::default().max_observations)]
    pub(super) max_observations: usize,

    /// What depth means.
    #[arg(long, value_enum, default_value_t = Depth::Z)]
    pub(super) depth: Depth,
    /// The axes of normals.
    #[arg(long, value_enum, default_value_t = Normals::World)]
    pub(super) normals: Normals,
    /// Write the maps as GeoTIFF too.
    #[arg(long)]
    pub(super) geotiff: bool,
    /// Number of views with preview pictures.
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub(super) previews: usize,

    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
    /// Replace an earlier dataset.
    #[arg(long)]
    pub(super) overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    pub(super) progress: ProgressStyle,
    /// Print the report as JSON on stdout.
    #[arg(long)]
    pub(super) json: bool,
}

/// What is to be trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Mode {
    /// Everything masked to buildings.
    BuildingOnly,
    /// The whole scene, with priors on buildings.
    BuildingEnhanced,
}

/// Who reads the dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Trainer {
    /// 2DGS and the trainers made from it.
    #[value(name = "2dgs")]
    TwoDgs,
    /// gsplat, nerfstudio.
    Gsplat,
}

/// How points keep away from one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Spacing {
    /// Independent points.
    Random,
    /// Even shares, low discrepancy.
    Stratified,
    /// A least distance.
    Poisson,
}

/// What depth means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Depth {
    /// Along the axis of the camera.
    Z,
    /// Along the ray.
    Ray,
}

/// The axes of normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Normals {
    /// Those of the cameras' frame.
    World,
    /// Those of each camera.
    Camera,
}

impl Mode {
    /// The name on the command line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::BuildingOnly => "building-only",
            Self::BuildingEnhanced => "building-enhanced",
        }
    }
}

impl Args {
    /// What to sample.
    pub(super) fn sampling(&self) -> anyhow::Result<SampleConfig> {
        // The bottom of a building is left out where only buildings are trained: almost none of it is ever seen.
        let weights = match self.mode {
            Mode::BuildingOnly => ClassWeights::visible(),
            Mode::BuildingEnhanced => ClassWeights::visible().with(SurfaceClass::Ground, 1.0)?,
        };
        let weights = self.class_weight.iter().try_fold(weights, |w, &(class, weight)| w.with(class, weight))?;
        let amount = match (self.points, self.density, self.geometric_error) {
            (_, Some(density), _) => Amount::PerSquareMetre(density),
            (_, _, Some(error_m)) => Amount::Adaptive { error_m, max_spacing_m: self.max_spacing },
            (points, None, None) => points.map_or(SampleConfig::default().amount, Amount::Count),
        };
        let spacing = match self.spacing {
            Spacing::Random => Placement::Random,
            Spacing::Stratified => Placement::Stratified,
            Spacing::Poisson => Placement::PoissonDisk,
        };
        Ok(SampleConfig { amount, spacing, weights, everything: false, seed: self.seed })
    }

    /// What it takes to be seen.
    pub(super) fn visibility(&self) -> VisibilityConfig {
        VisibilityConfig {
            margin_px: self.margin,
            near_m: self.near,
            epsilon_m: self.epsilon,
            max_incidence_deg: self.max_incidence,
            min_views: self.min_views,
            max_observations: self.max_observations,
        }
    }

    /// What the maps hold.
    pub(super) fn map_config(&self) -> MapConfig {
        MapConfig {
            depth: match self.depth {
                Depth::Z => DepthKind::ZDepth,
                Depth::Ray => DepthKind::RayLength,
            },
            normals: match self.normals {
                Normals::World => NormalFrame::World,
                Normals::Camera => NormalFrame::Camera,
            },
        }
    }
}

/// `RoofSurface=2`, also `roof=2`.
fn parse_weight(text: &str) -> Result<(SurfaceClass, f64), String> {
    let names = || SurfaceClass::all().map(SurfaceClass::name).collect::<Vec<_>>().join(", ");
    let (name, weight) = text.split_once('=').ok_or_else(|| format!("expected CLASS=WEIGHT, found {text:?}"))?;
    let wanted = name.trim().to_lowercase();
    let fits = |class: &SurfaceClass| {
        let known = class.name().to_lowercase();
        known == wanted || known.strip_suffix("surface") == Some(wanted.as_str())
    };
    let class =
        SurfaceClass::all().find(fits).ok_or_else(|| format!("no class {name:?}, expected one of {}", names()))?;
    let weight = weight.trim().parse().map_err(|_| format!("expected a number after the class, found {weight:?}"))?;
    Ok((class, weight))
}
