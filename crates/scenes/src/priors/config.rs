//! What priors are made of, and how.

use std::path::PathBuf;
use std::str::FromStr;

use ::priors::{Amount, ClassWeights, MapConfig, SampleConfig, Spacing, VisibilityConfig};
use city::{Lod, SurfaceClass};
use crs::VerticalDatum;
use job::error::JobError;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::error::PriorsJobError;

/// A city model and the cameras that its priors are made for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PriorsConfig {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    pub model: PathBuf,
    /// One COLMAP folder (or a folder with `sparse/0` in it), one `transforms.json`, or satellite
    /// images with RPCs (files, or a folder of them).
    pub cameras: Vec<PathBuf>,
    /// Folder for the dataset.
    pub output: PathBuf,
    /// Origin of the cameras' frame in the model's coordinates. Perspective cameras only.
    pub offset: Option<[f64; 3]>,
    /// File with the similarity from the model's coordinates to the cameras' frame; excludes
    /// `offset`. Perspective cameras only.
    pub transform: Option<PathBuf>,
    /// Columns and rows of the images, for a `transforms.json` that does not state them.
    pub image_size: Option<[usize; 2]>,
    /// EPSG code of the model's map, where its file does not state it. Satellite images only.
    pub map_epsg: Option<u32>,
    /// Vertical datum of the model, where its file does not state it. Satellite images only.
    pub vertical: Option<VerticalDatum>,
    /// Report of a DSM run with the pointing corrections of the images; RPCs as they are when
    /// `None`. Satellite images only.
    pub corrections: Option<PathBuf>,
    /// What is to be trained.
    pub mode: PriorsMode,
    /// The trainer that the dataset is for.
    pub trainer: PriorsTrainer,
    /// Whether cameras are cropped whose principal point is off the middle of the image.
    pub recrop: bool,
    /// Whether only maps are made, for lenses of any kind.
    pub maps_only: bool,
    /// Level of detail; the highest of each object up to 2.x when `None`.
    #[serde(with = "job::as_text", default)]
    pub lod: Option<Lod>,
    /// Whether everything in the model hides what is behind it, and not only buildings.
    pub all_objects: bool,
    /// Number or density of the points.
    pub amount: Amount,
    /// How points keep a distance from each other.
    pub spacing: Spacing,
    /// Weights of surface classes that differ from the mode's own.
    pub class_weights: Vec<PriorsClassWeight>,
    /// Seed of everything random.
    pub seed: u64,
    /// When a camera sees a point, and which points are kept.
    pub visibility: VisibilityConfig,
    /// Meaning of depths and normals in the maps.
    pub maps: MapConfig,
    /// Whether files are written that repeat others in another form: the COLMAP model as text, the
    /// points as PLY beside `sparse`, and initial splats of the points.
    #[serde(default)]
    pub extras: bool,
    /// Where the pictures of the dataset come from. Perspective cameras only.
    #[serde(default)]
    pub images: PriorsImages,
    /// Depth of pixels that see no building, in the `.npy` maps. Perspective cameras only.
    #[serde(default)]
    pub miss: PriorsMiss,
    /// Whether the maps are written as GeoTIFF too.
    pub geotiff: bool,
    /// Number of views with preview pictures.
    pub previews: usize,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether an earlier dataset may be replaced.
    pub overwrite: bool,
}

/// What is to be trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PriorsMode {
    /// Only buildings: images, depths and normals are masked to them.
    BuildingOnly,
    /// The whole scene, with priors on buildings.
    BuildingEnhanced,
}

impl PriorsMode {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] = [
        ("building-only", Self::BuildingOnly, "Everything masked to buildings"),
        ("building-enhanced", Self::BuildingEnhanced, "The whole scene, with priors on buildings"),
    ];
}

/// The program that reads the dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PriorsTrainer {
    /// 2DGS and the trainers derived from it, which ignore the principal point.
    #[serde(rename = "2dgs")]
    TwoDgs,
    /// gsplat and nerfstudio, which use the principal point.
    #[serde(rename = "gsplat")]
    Gsplat,
}

impl PriorsTrainer {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] =
        [("2dgs", Self::TwoDgs, "2DGS and the trainers made from it"), ("gsplat", Self::Gsplat, "gsplat, nerfstudio")];
}

/// Where the pictures of a dataset come from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum PriorsImages {
    /// The dataset has no pictures.
    #[default]
    None,
    /// From where pictures usually lie: `images` beside the COLMAP model or above it, or as the
    /// `transforms.json` names them.
    Beside,
    /// From this folder.
    Folder(PathBuf),
}

/// Depth of a pixel that sees no building.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum PriorsMiss {
    /// Positive infinity. Maps that are resized keep false depths out.
    #[default]
    #[serde(rename = "inf")]
    Infinite,
    /// NaN.
    #[serde(rename = "nan")]
    Nan,
    /// Zero, as readers of depth sensors expect. A map that is resized gets false near depths at
    /// its edges.
    #[serde(rename = "0")]
    Zero,
}

impl PriorsMiss {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("inf", Self::Infinite, "Infinity, which survives resizing"),
        ("nan", Self::Nan, "NaN"),
        ("0", Self::Zero, "Zero, as readers of depth sensors expect"),
    ];

    /// Returns the depth.
    pub(super) fn depth(self) -> f32 {
        match self {
            Self::Infinite => f32::INFINITY,
            Self::Nan => f32::NAN,
            Self::Zero => 0.0,
        }
    }
}

/// Weight of a surface class in the sampling; 0 leaves the class out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorsClassWeight {
    /// The class.
    #[serde(serialize_with = "class_name", deserialize_with = "class_of_name")]
    pub class: SurfaceClass,
    /// Points per area relative to a class of weight 1.
    pub weight: f64,
}

impl FromStr for PriorsClassWeight {
    type Err = String;

    /// Reads `CLASS=WEIGHT` in any letter case, such as `RoofSurface=2` or `roof=2`.
    fn from_str(text: &str) -> Result<Self, String> {
        let names = || SurfaceClass::all().map(SurfaceClass::name).collect::<Vec<_>>().join(", ");
        let (name, weight) = text.split_once('=').ok_or_else(|| format!("expected CLASS=WEIGHT, found {text:?}"))?;
        let wanted = name.trim().to_lowercase();
        let fits = |class: &SurfaceClass| {
            let known = class.name().to_lowercase();
            known == wanted || known.strip_suffix("surface") == Some(wanted.as_str())
        };
        let class =
            SurfaceClass::all().find(fits).ok_or_else(|| format!("no class {name:?}, expected one of {}", names()))?;
        let weight =
            weight.trim().parse().map_err(|_| format!("expected a number after the class, found {weight:?}"))?;
        Ok(Self { class, weight })
    }
}

impl PriorsConfig {
    /// Priors of the buildings of `model` for 2DGS, with the default sampling and visibility.
    pub fn new(model: PathBuf, cameras: Vec<PathBuf>, output: PathBuf) -> Self {
        let sampling = SampleConfig::default();
        Self {
            model,
            cameras,
            output,
            offset: None,
            transform: None,
            image_size: None,
            map_epsg: None,
            vertical: None,
            corrections: None,
            mode: PriorsMode::BuildingOnly,
            trainer: PriorsTrainer::TwoDgs,
            recrop: false,
            maps_only: false,
            lod: None,
            all_objects: false,
            amount: sampling.amount,
            spacing: Spacing::Stratified,
            class_weights: Vec::new(),
            seed: 0,
            visibility: VisibilityConfig::default(),
            maps: MapConfig::default(),
            extras: false,
            images: PriorsImages::None,
            miss: PriorsMiss::Infinite,
            geotiff: false,
            previews: 12,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks that the values go together.
    ///
    /// # Errors
    /// [`JobError`] for an offset beside a transform, and for a bad weight.
    pub fn validate(&self) -> Result<(), JobError> {
        if self.offset.is_some() && self.transform.is_some() {
            return Err(PriorsJobError::TwoFrames.into());
        }
        Ok(self.sampling().map(drop)?)
    }

    /// How points are sampled.
    pub(super) fn sampling(&self) -> Result<SampleConfig, PriorsJobError> {
        // The bottom of a building is left out where only buildings are trained: almost none of it
        // is ever seen.
        let weights = match self.mode {
            PriorsMode::BuildingOnly => ClassWeights::visible(),
            PriorsMode::BuildingEnhanced => ClassWeights::visible().with(SurfaceClass::Ground, 1.0)?,
        };
        let weights = self.class_weights.iter().try_fold(weights, |all, one| all.with(one.class, one.weight))?;
        Ok(SampleConfig { amount: self.amount, spacing: self.spacing, weights, everything: false, seed: self.seed })
    }
}

impl PriorsMode {
    /// The name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::BuildingOnly => "building-only",
            Self::BuildingEnhanced => "building-enhanced",
        }
    }
}

fn class_name<S: Serializer>(class: &SurfaceClass, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(class.name())
}

fn class_of_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SurfaceClass, D::Error> {
    let name = String::deserialize(deserializer)?;
    SurfaceClass::all()
        .find(|class| class.name() == name)
        .ok_or_else(|| serde::de::Error::custom(format!("no surface class is called {name:?}")))
}
