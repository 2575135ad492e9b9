//! The configuration of a DSM run and its validation.

use std::path::{Path, PathBuf};

use crs::VerticalDatum;
use formats::areas::AreaName;
use formats::raster::BandChoice;
use reconstruct::{Fill, HeightRange, ImagePair, MapBounds, Preset, SurfaceOptions};
use serde::{Deserialize, Serialize};

use crate::adapters::positions_from_one;
use crate::error::{DsmError, DsmSetting};
use crate::products::ProductKind;

/// Smaller output tiles and chunks cost more to manage than to fill, cells.
const SIDE_MIN: usize = 64;
/// Most images of a folder that an error names.
const NAMED_IMAGES: usize = 8;

/// Polygons of a layer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct LayerArea {
    /// GeoPackage or GeoJSON.
    pub file: PathBuf,
    /// Layer; the only one when `None`.
    pub layer: Option<String>,
    /// Field that holds the names of the polygons.
    #[serde(default = "name_field")]
    pub field: String,
    /// Name of the polygon; all polygons when `None`, and in a batch that of the scene.
    pub name: Option<String>,
}

fn name_field() -> String {
    "name".to_owned()
}

impl LayerArea {
    /// Makes the area of all polygons of a file with one layer.
    pub fn new(file: PathBuf) -> Self {
        Self { file, layer: None, field: name_field(), name: None }
    }

    /// Returns the area with a name, unless it has one.
    pub fn or_named(self, name: &str) -> Self {
        Self { name: self.name.or_else(|| Some(name.to_owned())), ..self }
    }

    /// Returns its place in the file.
    pub(crate) fn wanted(&self) -> AreaName<'_> {
        AreaName { layer: self.layer.as_deref(), field: &self.field, name: self.name.as_deref() }
    }
}

/// Configuration of a DSM run. A field that is `None` is chosen from the scene. Positions of images
/// count from 0 here, and from 1 where the configuration is written as text.
///
/// ```
/// use dsm::{DsmConfig, DsmError, DsmSetting};
///
/// let mut config = DsmConfig::new(vec!["left.tif".into(), "right.tif".into()], "out".into());
/// assert!(config.validate().is_ok());
/// config.gsd_m = Some(-0.5);
/// let refused = config.validate().unwrap_err();
/// assert!(matches!(refused, DsmError::Value { setting: DsmSetting::CellSize, .. }));
/// let text = "the cell size is -0.5, expected a positive cell size in metres";
/// assert_eq!(refused.to_string(), text);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DsmConfig {
    /// Image files, two or more, each with its RPC inside or beside it.
    pub images: Vec<PathBuf>,
    /// Folder for the results.
    #[serde(default)]
    pub output: PathBuf,
    /// Cell size of the DSM, metres.
    pub gsd_m: Option<f64>,
    /// EPSG code of the horizontal CRS.
    pub crs_epsg: Option<u32>,
    /// Area of the DSM, in its CRS.
    pub bounds: Option<MapBounds>,
    /// EPSG code of the CRS of `bounds` where that is another one, such as 4326 for degrees. The
    /// grid is the rectangle around them.
    pub bounds_epsg: Option<u32>,
    /// Polygons in which the DSM lies. Cells outside are void, and without `bounds` the grid is the
    /// rectangle around them.
    pub area: Option<LayerArea>,
    /// Ground without heights, such as water: polygons (GeoJSON, GeoPackage, shapefile), and
    /// georeferenced rasters where they are neither 0 nor without data.
    #[serde(default)]
    pub masks: Vec<PathBuf>,
    /// Pixels that are not matched, such as clouds: polygons on the ground, and rasters in the
    /// frame of an image. The name of each begins with that of its image.
    #[serde(default)]
    pub image_masks: Vec<PathBuf>,
    /// Band to match; the luma of all bands when `None`.
    pub band: Option<BandChoice>,
    /// Heights to search, metres above the ellipsoid.
    pub height_range_m: Option<HeightRange>,
    /// Coarse elevation model from which the height range is taken.
    pub dem: Option<PathBuf>,
    /// Surface model to which the pointing is co-registered.
    pub reference_dem: Option<PathBuf>,
    /// Whether the heights are also tilted onto the reference by a plane.
    #[serde(default)]
    pub reference_plane: bool,
    /// What the heights of `dem` and `reference_dem` are above; the datum that a file names when
    /// `None`.
    pub dem_vertical: Option<VerticalDatum>,
    /// City model whose roofs are expected.
    pub prior: Option<PathBuf>,
    /// Ground control points and check points with their places in the images (CSV, GeoJSON).
    pub control: Option<PathBuf>,
    /// Pointing corrections of an earlier run to start from: its `pointing.json` or its report.
    pub corrections: Option<PathBuf>,
    /// Whether a CRS may be used far outside its area of use, where its coordinates mean little.
    #[serde(default)]
    pub force_crs: bool,
    /// Datum of the heights of the DSM.
    #[serde(default)]
    pub vertical: VerticalDatum,
    /// Trade-off of speed and accuracy.
    #[serde(default)]
    pub preset: Preset,
    /// Choice of the voids that are closed.
    #[serde(default)]
    pub fill: Fill,
    /// Pairs of images to match, by positions that are written from 1; all useful ones when `None`.
    pub pairs: Option<Vec<ImagePair>>,
    /// Images to compute heights for, by positions that are written from 1; all when `None`.
    #[serde(default, with = "positions_from_one")]
    pub references: Option<Vec<usize>>,
    /// Whether the pointing of the RPCs is corrected.
    #[serde(default = "yes")]
    pub pointing: bool,
    /// What is made of the DSM beside it, as [`crate::products`] does.
    #[serde(default)]
    pub products: Vec<ProductKind>,
    /// Number of worker threads; all cores when `None`.
    pub threads: Option<usize>,
    /// Memory limit, megabytes; 4000 when `None`. A scene that takes more is computed by chunks.
    pub memory_mb: Option<u64>,
    /// Side of the chunks of a large scene, cells; as large as the memory allows when `None`.
    pub chunk: Option<usize>,
    /// Side of the output tiles that are fused at a time, cells. It changes the memory needed,
    /// never the result.
    #[serde(default = "default_tile")]
    pub tile: usize,
    /// Whether existing results may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

const fn yes() -> bool {
    true
}

const fn default_tile() -> usize {
    SurfaceOptions::USUAL_TILE
}

impl DsmConfig {
    /// Makes the configuration of a run that chooses everything but the images and the output
    /// folder by itself.
    pub fn new(images: Vec<PathBuf>, output: PathBuf) -> Self {
        Self {
            images,
            output,
            gsd_m: None,
            crs_epsg: None,
            bounds: None,
            bounds_epsg: None,
            area: None,
            masks: Vec::new(),
            image_masks: Vec::new(),
            band: None,
            height_range_m: None,
            dem: None,
            reference_dem: None,
            reference_plane: false,
            dem_vertical: None,
            prior: None,
            control: None,
            corrections: None,
            force_crs: false,
            vertical: VerticalDatum::Ellipsoid,
            preset: Preset::default(),
            fill: Fill::default(),
            pairs: None,
            references: None,
            pointing: true,
            products: Vec::new(),
            threads: None,
            memory_mb: None,
            chunk: None,
            tile: SurfaceOptions::USUAL_TILE,
            overwrite: false,
        }
    }

    /// Returns the inputs beside the images.
    pub(crate) fn side_inputs(&self) -> impl Iterator<Item = &PathBuf> {
        let single = [&self.dem, &self.reference_dem, &self.prior, &self.control, &self.corrections];
        let area = self.area.iter().map(|area| &area.file);
        single.into_iter().flatten().chain(area).chain(&self.masks).chain(&self.image_masks)
    }

    /// Returns the configuration with the defaults for what does not change the DSM: products,
    /// threads, tiles, and whether files may be replaced.
    pub fn deciding(&self) -> Self {
        let plain = Self::new(Vec::new(), PathBuf::new());
        let Self { products, threads, tile, overwrite, .. } = plain;
        Self { products, threads, tile, overwrite, ..self.clone() }
    }

    /// Replaces every path by what `change` makes of it.
    pub(crate) fn map_paths(&mut self, change: impl Fn(&Path) -> PathBuf) {
        let single =
            [&mut self.dem, &mut self.reference_dem, &mut self.prior, &mut self.control, &mut self.corrections];
        let area = self.area.iter_mut().map(|area| &mut area.file);
        let sides = single.into_iter().flatten().chain(area).chain(&mut self.masks).chain(&mut self.image_masks);
        for path in self.images.iter_mut().chain([&mut self.output]).chain(sides) {
            *path = change(path);
        }
    }

    /// Checks everything that can be wrong before a file is opened.
    ///
    /// # Errors
    /// [`DsmError::TooFewImages`], [`DsmError::SameImage`], and [`DsmError::Value`] with the
    /// setting that is wrong.
    pub fn validate(&self) -> Result<(), DsmError> {
        if self.images.len() < 2 {
            return Err(self.folder().unwrap_or(DsmError::TooFewImages { found: self.images.len() }));
        }
        for (i, path) in self.images.iter().enumerate() {
            // The same file may be given under two names.
            let same = |other: &PathBuf| {
                other == path || other.canonicalize().ok().zip(path.canonicalize().ok()).is_some_and(|(a, b)| a == b)
            };
            if self.images[..i].iter().any(same) {
                return Err(DsmError::SameImage { path: path.clone() });
            }
        }
        if self.output.as_os_str().is_empty() {
            return Err(DsmError::value(DsmSetting::Output, "missing", "a folder for the results"));
        }
        if self.reference_dem.is_some() && !self.pointing {
            let found = "given, although the pointing is not to be corrected";
            return Err(DsmError::value(
                DsmSetting::ReferenceDem,
                found,
                "a correction of the pointing, or no reference",
            ));
        }
        if self.reference_plane && self.reference_dem.is_none() {
            let found = "missing, although the heights are to be tilted onto it";
            return Err(DsmError::value(DsmSetting::ReferenceDem, found, "a surface model, or no tilt"));
        }
        self.validate_ground()?;
        self.validate_division()?;
        self.validate_positions()
    }

    /// Returns the error of a folder in the place of an image, if there is one.
    fn folder(&self) -> Option<DsmError> {
        let path = self.images.iter().find(|path| path.is_dir())?;
        let is_image = |path: &PathBuf| {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("tif") || e.eq_ignore_ascii_case("tiff"))
        };
        let entries = path.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
        let mut images: Vec<String> = entries
            .filter(is_image)
            .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
            .collect();
        images.sort();
        images.truncate(NAMED_IMAGES);
        Some(DsmError::Folder { path: path.clone(), images })
    }

    fn validate_ground(&self) -> Result<(), DsmError> {
        if let Some(gsd) = self.gsd_m.filter(|gsd| !(gsd.is_finite() && *gsd > 0.0)) {
            return Err(DsmError::value(DsmSetting::CellSize, gsd.to_string(), "a positive cell size in metres"));
        }
        if let Some(range) = self.height_range_m.filter(|range| !range.is_on_earth()) {
            return Err(DsmError::value(
                DsmSetting::HeightRange,
                format!("{} {}", range.low_m, range.high_m),
                "two heights of the Earth's surface in metres above the ellipsoid, the lower first",
            ));
        }
        let is_area =
            |b: &MapBounds| b.to_array().iter().all(|v| v.is_finite()) && b.x_min < b.x_max && b.y_min < b.y_max;
        if let Some(bounds) = self.bounds.filter(|bounds| !is_area(bounds)) {
            return Err(DsmError::value(
                DsmSetting::Bounds,
                format!("{:?}", bounds.to_array()),
                self.bounds_epsg.map_or_else(
                    || "x_min y_min x_max y_max in the DSM's CRS".to_owned(),
                    |code| format!("x_min y_min x_max y_max in EPSG:{code}"),
                ),
            ));
        }
        if let Some(code) = self.bounds_epsg.filter(|_| self.bounds.is_none()) {
            return Err(DsmError::value(
                DsmSetting::Bounds,
                format!("not given, but a CRS for them, EPSG:{code}"),
                "both or neither",
            ));
        }
        Ok(())
    }

    fn validate_division(&self) -> Result<(), DsmError> {
        let at_least = format!("{SIDE_MIN} or more cells");
        if self.tile < SIDE_MIN {
            return Err(DsmError::value(DsmSetting::TileSide, self.tile.to_string(), at_least));
        }
        if let Some(side) = self.chunk.filter(|side| *side < SIDE_MIN) {
            return Err(DsmError::value(DsmSetting::ChunkSide, side.to_string(), at_least));
        }
        if self.threads == Some(0) {
            return Err(DsmError::value(DsmSetting::Threads, "0", "1 or more"));
        }
        Ok(())
    }

    fn validate_positions(&self) -> Result<(), DsmError> {
        let n = self.images.len();
        let paired = self.pairs.iter().flatten().flat_map(|pair| [pair.first, pair.second]);
        let paired = paired.map(|position| (DsmSetting::Pairs, position));
        let references = self.references.iter().flatten().map(|&position| (DsmSetting::References, position));
        match paired.chain(references).find(|(_, position)| *position >= n) {
            None => Ok(()),
            Some((setting, bad)) => Err(DsmError::value(
                setting,
                bad.saturating_add(1).to_string(),
                format!("positions of images, 1 to {n}"),
            )),
        }
    }
}
