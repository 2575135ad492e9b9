//! What the viewer shows: rasters on one map, and the layers that are drawn of them.
//!
//! All rasters lie in the coordinate system of the first one; others are laid into it by the
//! nearest cell. Those without a system where the first has one, or the other way round, are left
//! out with a warning.
//! Positions on the map are in the units of that system, or columns and rows of the raster where it
//! has no georeference.

use std::path::PathBuf;

use crs::{CrsIdentity, MapProjection};
use formats::raster::{BandLabel, ImageInfo, ImageSource, RasterError};
use numeric::Progress;
use raster::{GeoTransform, Grid, Window};
use report::{MapLegend, MapStyle};
use serde::Serialize;

use super::config::ViewConfig;
use super::error::ViewError;
use super::rasters::{FoundRaster, RASTERS_MAX, find, find_vectors, is_vectors};
use super::styles::{LayerLook, RasterTraits, bands, looks};
use super::vectors::SceneVectors;
use job::error::JobError;
use job::error_text::with_causes;

/// Side of a tile, pixels.
pub(super) const TILE: usize = 256;
/// Longest side of a picture or a grid.
pub(super) const SIDE_MAX: usize = 1024;
/// Longest side of the reduced raster from which the range of the colours follows.
const SAMPLE_SIDE: usize = 512;
/// Cells to decode for one picture above which a raster is slow to show.
const SLOW_CELLS: u64 = 64 << 20;
/// Cells to decode for one picture above which a raster is refused: a few seconds, as GDAL decodes
/// about 10⁸ cells in a second. Beyond, moving the map asks for more than the computer answers.
const REFUSED_CELLS: u64 = 256 << 20;
/// Metres in a degree of latitude.
const DEGREE_M: f64 = 111_195.0;

/// Everything that is shown.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Scene {
    /// The coordinate system of the map.
    pub(super) map: MapSystem,
    /// The rasters; the first one sets the map.
    pub(super) rasters: Vec<SceneRaster>,
    /// The layers in the order of the list.
    pub(super) layers: Vec<SceneLayer>,
    /// The vectors, which are drawn over the layers.
    pub(super) vectors: Vec<SceneVectors>,
    /// Number of folders among the inputs: two are shown side by side.
    folders: usize,
    /// Whether there are splats or meshes, which have a page of their own.
    pub(super) has_space: bool,
    /// Side of a tile, pixels.
    tile: usize,
    /// Version of the program.
    version: &'static str,
}

/// The coordinate system of the map.
#[derive(Debug, Clone, Serialize)]
pub(super) struct MapSystem {
    /// Name for people, with its EPSG code.
    name: String,
    /// Vertical datum of heights, where it is known.
    pub(super) vertical: Option<String>,
    /// Unit of positions.
    unit: &'static str,
    /// Metres in a unit along x and y.
    pub(super) metres: (f64, f64),
    #[serde(skip)]
    pub(super) wkt: Option<String>,
    #[serde(skip)]
    pub(super) epsg: Option<u32>,
    /// Whether the rasters have a georeference.
    pub(super) is_placed: bool,
}

/// A raster on the map.
#[derive(Debug, Clone, Serialize)]
pub(super) struct SceneRaster {
    #[serde(skip)]
    pub(super) path: PathBuf,
    /// Whether it is laid into the system of the map.
    #[serde(skip)]
    pub(super) is_laid: bool,
    /// Name of the file.
    file: String,
    /// Columns.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
    /// Map from cells, as in [`GeoTransform`].
    pub(super) transform: GeoTransform,
    /// Number of the coarsest level of tiles; a tile of level 0 has the cells of the raster.
    pub(super) levels: u32,
    /// Bands that are drawn and read, counted from 1.
    pub(super) bands: Vec<usize>,
    /// Unit of the values, empty where unknown.
    unit: String,
    /// Width and height of a cell, metres.
    #[serde(skip)]
    pub(super) cell_m: (f64, f64),
}

/// A layer of the map.
#[derive(Debug, Clone, Serialize)]
pub(super) struct SceneLayer {
    /// Name for people.
    pub(super) title: String,
    /// Number of its raster.
    pub(super) raster: usize,
    /// Whether the values are heights above a datum.
    is_height: bool,
    /// Whether it lies above other layers instead of in their place.
    is_overlay: bool,
    legend: MapLegend,
    #[serde(skip)]
    pub(super) style: MapStyle,
}

impl Scene {
    /// A scene without rasters.
    pub(super) fn empty() -> Self {
        Self::of(MapSystem {
            name: "no coordinate system".to_owned(),
            vertical: None,
            unit: "px",
            metres: (1.0, 1.0),
            wkt: None,
            epsg: None,
            is_placed: false,
        })
    }

    /// A scene of a map without anything on it.
    fn of(map: MapSystem) -> Self {
        Self {
            map,
            rasters: Vec::new(),
            layers: Vec::new(),
            vectors: Vec::new(),
            folders: 0,
            has_space: false,
            tile: TILE,
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    /// Opens the rasters of the inputs and chooses how they are drawn.
    ///
    /// # Errors
    /// [`ViewError`] for a raster that was named and cannot be read, when nothing can be shown, and
    /// when the job was cancelled.
    pub(super) fn open(config: &ViewConfig, progress: &dyn Progress) -> Result<Self, ViewError> {
        let (found, more) = find(&config.inputs)?;
        let is_one_of_several = several(config);
        if more > 0 {
            progress.warn(&format!("{more} further rasters are left out: at most {RASTERS_MAX} are shown"));
        }
        let mut scene: Option<Self> = None;
        for file in &found {
            progress.check_cancelled().map_err(JobError::from)?;
            match add(&mut scene, file, is_one_of_several, progress) {
                Ok(()) => {}
                Err(error) if file.is_named => return Err(error),
                Err(error) => progress.warn(&format!("left out: {}", with_causes(&error))),
            }
        }
        let path = || config.inputs.first().cloned().unwrap_or_default();
        let mut scene = scene.ok_or_else(|| ViewError::NoRasters { path: path() })?;
        scene.folders = config.inputs.iter().filter(|input| input.is_dir()).count();
        scene.add_vectors(config, progress)?;
        Ok(scene)
    }

    /// The first raster with heights.
    pub(super) fn heights(&self) -> Option<&SceneRaster> {
        self.layers.iter().find(|layer| layer.is_height).and_then(|layer| self.rasters.get(layer.raster))
    }

    /// Adds the vectors of the inputs. Those that are only found in a folder may be left out.
    fn add_vectors(&mut self, config: &ViewConfig, progress: &dyn Progress) -> Result<(), ViewError> {
        let (found, more) = find_vectors(&config.inputs);
        if more > 0 {
            progress.warn(&format!("{more} further files of vectors are left out"));
        }
        for file in found {
            let suffix = if several(config) && !file.is_named { file.input.as_str() } else { "" };
            match SceneVectors::read(&file.path, suffix, self.map.wkt.as_deref()) {
                Ok(vectors) => self.vectors.extend(vectors),
                Err(error) if file.is_named => return Err(error),
                Err(error) => progress.warn(&format!("left out: {}", with_causes(&error))),
            }
        }
        Ok(())
    }
}

/// Whether rasters come from several inputs, so that their names must tell which.
fn several(config: &ViewConfig) -> bool {
    config.inputs.iter().filter(|input| !is_vectors(input)).count() > 1
}

/// Adds a raster and its layers. The first one makes the scene.
fn add(
    scene: &mut Option<Scene>,
    file: &FoundRaster,
    is_one_of_several: bool,
    progress: &dyn Progress,
) -> Result<(), ViewError> {
    let source = ImageSource::open(&file.path)?;
    let info = source.info();
    let map = match scene {
        Some(scene) => scene.map.clone(),
        None => MapSystem::of(&source)?,
    };
    let laid = match map.way_to(info) {
        Way::Same => None,
        Way::Laid(wkt) => Some(ImageSource::open_on_map(&file.path, wkt)?),
        Way::None => {
            progress.warn(&format!("left out, because its place on the map is not known: {}", file.path.display()));
            return Ok(());
        }
    };
    let label = source.band_label(1)?;
    let bands = bands(info);
    let mut cells = 0_u64;
    for band in &bands {
        cells = cells.saturating_add(source.cells_of_picture(*band, SIDE_MAX)?);
    }
    if cells > REFUSED_CELLS {
        let (columns, rows, cells) = (info.width, info.height, cells / 1_000_000);
        return Err(ViewError::NoOverviews { path: file.path.clone(), columns, rows, megacells: cells });
    }
    if cells > SLOW_CELLS {
        progress.warn(&format!("has no fitting overviews, so that its pictures take long: {}", file.path.display()));
    }
    if laid.is_some() {
        progress.warn(&format!(
            "its coordinate system is another, it is laid into that of the map by the nearest cell: {}",
            file.path.display()
        ));
    }
    let size = reduced((info.width, info.height), SAMPLE_SIDE);
    let sample: Vec<Grid<f32>> =
        bands.iter().map(|&band| source.read_reduced(band, source.window(), size)).collect::<Result<_, _>>()?;
    let looks = looks(&RasterTraits { stem: &file.stem, info, label: &label, sample: &sample });
    let scene = scene.get_or_insert_with(|| Scene::of(map));
    let index = scene.rasters.len();
    let is_height = looks.iter().any(|look| look.is_height);
    let placed = laid.as_ref().map_or(info, ImageSource::info);
    let raster = SceneRaster::new(file, placed, &scene.map, unit(&label, is_height), bands);
    scene.rasters.push(SceneRaster { is_laid: laid.is_some(), ..raster });
    for look in looks {
        let mut title =
            if is_one_of_several { format!("{} · {}", look.title, file.input) } else { look.title.clone() };
        if scene.layers.iter().any(|layer| layer.title == title) {
            let folder = file.path.parent().and_then(|folder| folder.file_name()).unwrap_or_default();
            title = format!("{title} ({})", folder.to_string_lossy());
        }
        scene.layers.push(SceneLayer::new(title, index, look));
    }
    Ok(())
}

/// Returns the unit of the values: that of the file, else the ending of the description.
fn unit(label: &BandLabel, is_height: bool) -> String {
    match label.unit.as_str() {
        "" | "metre" | "meter" if is_height || label.description.ends_with("_m") => "m".to_owned(),
        unit => unit.to_owned(),
    }
}

/// Returns the size of a raster of `size` cells that is reduced so far that no side is longer than
/// `side`.
pub(super) fn reduced(size: (usize, usize), side: usize) -> (usize, usize) {
    let factor = (size.0.max(size.1) as f64 / side.max(1) as f64).max(1.0);
    let one = |cells: usize| ((cells as f64 / factor).round() as usize).clamp(1, side.max(1));
    (one(size.0), one(size.1))
}

impl SceneRaster {
    fn new(file: &FoundRaster, info: &ImageInfo, map: &MapSystem, unit: String, bands: Vec<usize>) -> Self {
        let transform = info.geotransform.unwrap_or(GeoTransform([0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
        let (c, (x, y)) = (transform.0, map.metres);
        let cell_m = ((c[1] * x).hypot(c[4] * y), (c[2] * x).hypot(c[5] * y));
        let longest = info.width.max(info.height).div_ceil(TILE).max(1);
        Self {
            path: file.path.clone(),
            is_laid: false,
            file: file.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            width: info.width,
            height: info.height,
            transform,
            levels: longest.next_power_of_two().trailing_zeros(),
            bands,
            unit,
            cell_m,
        }
    }

    /// The window of the whole raster.
    pub(super) fn window(&self) -> Window {
        Window::whole(self.width, self.height)
    }

    /// Returns the cell of a position on the map; `None` outside of the raster.
    pub(super) fn cell(&self, x: f64, y: f64) -> Option<(usize, usize)> {
        let (column, row) = self.transform.cell_from_map(x, y)?;
        let inside = |at: f64, count: usize| {
            let cell = (at + 0.5).floor();
            (cell >= 0.0 && cell < count as f64).then_some(cell as usize)
        };
        Some((inside(column, self.width)?, inside(row, self.height)?))
    }
}

impl SceneLayer {
    fn new(title: String, raster: usize, look: LayerLook) -> Self {
        let is_overlay = matches!(look.style, MapStyle::Marked { .. });
        Self { title, raster, is_height: look.is_height, is_overlay, legend: look.style.legend(), style: look.style }
    }
}

impl MapSystem {
    /// Returns the system of a raster. One that PROJ cannot read is kept by its name.
    pub(super) fn of(source: &ImageSource) -> Result<Self, RasterError> {
        let info = source.info();
        let wkt = info.crs_wkt.clone();
        let is_placed = info.geotransform.is_some();
        let identity = wkt.as_deref().and_then(|wkt| CrsIdentity::of(wkt).ok());
        let epsg = identity.as_ref().and_then(|identity| identity.horizontal);
        let stated = || source.metadata("").into_iter().find(|(key, _)| key == "VERTICAL_DATUM").map(|(_, name)| name);
        let vertical = identity.and_then(|identity| identity.vertical).map(|datum| datum.to_string()).or_else(stated);
        let own_name = wkt.as_deref().and_then(|wkt| wkt.split('"').nth(1)).map(str::to_owned);
        let name = match (own_name, epsg) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name,
            (None, _) if is_placed => "no coordinate system".to_owned(),
            (None, _) => "columns and rows".to_owned(),
        };
        let (unit, metres) = units(info, wkt.as_deref());
        Ok(Self { name, vertical, unit, metres, wkt, epsg, is_placed })
    }

    /// Returns how a raster comes to lie in this system.
    fn way_to(&self, info: &ImageInfo) -> Way<'_> {
        let epsg = || info.crs_wkt.as_deref().and_then(|wkt| CrsIdentity::of(wkt).ok()?.horizontal);
        let is_same = info.crs_wkt == self.wkt || (self.epsg.is_some() && epsg() == self.epsg);
        match (&self.wkt, &info.crs_wkt) {
            _ if info.geotransform.is_some() != self.is_placed => Way::None,
            _ if is_same => Way::Same,
            (Some(wkt), Some(_)) => Way::Laid(wkt),
            _ => Way::None,
        }
    }
}

/// How a raster comes to lie in the system of the map.
enum Way<'a> {
    /// It lies in it.
    Same,
    /// It is laid into the system of this WKT.
    Laid(&'a str),
    /// Its place is not known.
    None,
}

/// Returns the unit of positions, and its metres along x and y.
fn units(info: &ImageInfo, wkt: Option<&str>) -> (&'static str, (f64, f64)) {
    let Some(transform) = info.geotransform else { return ("px", (1.0, 1.0)) };
    let projection = wkt.and_then(|wkt| MapProjection::from_definition(wkt).ok());
    match (projection.map(|projection| projection.metres_per_unit()), wkt) {
        (Some(Some(1.0)), _) => ("m", (1.0, 1.0)),
        (Some(Some(metres)), _) => ("map units", (metres, metres)),
        (Some(None), _) => {
            let (_, latitude) = transform.map_from_cell(info.width as f64 / 2.0, info.height as f64 / 2.0);
            ("°", (DEGREE_M * latitude.to_radians().cos().max(1e-6), DEGREE_M))
        }
        (None, _) => ("map units", (1.0, 1.0)),
    }
}
