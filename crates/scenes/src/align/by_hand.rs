//! Alignment by hand: a person lays the points of a COLMAP model over a map, and picks pairs of
//! places that are known in both.
//!
//! The map's heights are above the datum of its surface. A page works in that frame. What is saved
//! is above the ellipsoid, as every alignment is: one shift, that of the middle of the map, is
//! added to all heights.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use camera::Similarity;
use colmap::align::{AlignConfig, AlignError, PointPair, camera_up, fit_level, plane_normal};
use crs::{CrsError, HeightConverter, MapProjection, VerticalDatum};
use formats::colmap::ColmapEncoding;
use formats::splat_ply::LocalOrigin;
use numeric::{Progress, order_statistic, upper_median};
use serde::{Deserialize, Serialize};

use super::error::AlignJobError;
use super::output::{ModelWithPoints, ModelWriter, SimilarityParts};
use super::photograph::Photographs;
use super::{AlignResidual, Aligned, REPORT, aligned, read_model};
use job::dataset_folder::{dataset_folder, pictures_folder, sparse_folder};
use job::error::JobError;
use job::files::{self, FileError};
use job::output_folder::OutputFolder;
use job::report_page;

/// Share of the shorter side of the map that the points fill at the start, from their middle to
/// where [`FAR`] of them end: all of it is on the screen, with the map around it.
const START_FILL: f64 = 0.35;
/// Share of the points within the distance that counts as their extent. Models have a few points
/// far off.
const FAR: f64 = 0.9;
/// Share of the points below what counts as the ground of the model.
const LOW: f64 = 0.05;
/// Most pairs: more than anybody clicks.
const PAIRS_MAX: usize = 1000;
/// Pairs of a model and its map, as `positions` takes them.
const PAIRS: &str = "pairs.csv";

/// A COLMAP model to be moved to the world by hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ManualAlignConfig {
    /// Folder of a COLMAP model (text or binary), or of a dataset with one.
    pub model: PathBuf,
    /// Folder of the photographs; looked for around the model when `None`.
    pub images: Option<PathBuf>,
    /// Folder to write: the moved model, `origin.json`, `similarity.json`, `pairs.csv`,
    /// `align.json`.
    pub output: PathBuf,
    /// Datum of the map's heights; the one that the map names, else the ellipsoid, when `None`.
    pub vertical: Option<VerticalDatum>,
    /// Whether the up direction of the cameras is up in the world where the pairs do not determine
    /// the tilt.
    pub use_gravity: bool,
    /// Encoding of the model that is written.
    pub encoding: ColmapEncoding,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

impl ManualAlignConfig {
    /// An alignment with the photographs around the model and the datum that the map names.
    pub fn new(model: PathBuf, output: PathBuf) -> Self {
        Self {
            model,
            images: None,
            output,
            vertical: None,
            use_gravity: true,
            encoding: ColmapEncoding::Binary,
            overwrite: false,
        }
    }
}

/// The map that a model is laid over.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignMap {
    /// Name for people.
    pub name: String,
    /// Coordinate system: `EPSG:n` or WKT.
    pub crs: String,
    /// Least easting and northing, greatest easting and northing.
    pub bounds: [f64; 4],
    /// Usual height of the map's surface; `None` where the map has no heights.
    pub ground_m: Option<f64>,
    /// Datum of the heights, as far as the map names it.
    pub vertical: Option<String>,
}

/// A model, a map and what has been made of them.
pub struct ManualAlign {
    config: ManualAlignConfig,
    model: ModelWithPoints,
    photographs: Photographs,
    map: AlignMap,
    vertical: VerticalDatum,
    /// Height of the map's datum above the ellipsoid at the middle of the map, metres.
    ellipsoid_shift_m: f64,
    /// What positions in the world are counted from: easting, northing, height above the map's
    /// datum.
    origin: [f64; 3],
    /// Middle of the points, in the frame of the model.
    pivot: [f64; 3],
    start: ManualStart,
    saved: Mutex<Option<ManualAlignReport>>,
}

/// Where the model lies before anybody has moved it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ManualStart {
    /// Similarity from the model to the world, relative to the origin.
    pub world_from_model: SimilarityParts,
    /// Where the up direction comes from, in words.
    pub up_from: String,
}

/// The similarity of clicked pairs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ManualFit {
    /// Similarity from the model to the world, relative to the origin.
    pub world_from_model: SimilarityParts,
    /// Whether each pair is part of the fit.
    pub inliers: Vec<bool>,
    /// What determined the fit, in words.
    pub how: String,
}

/// An alignment by hand that was saved.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ManualAlignReport {
    /// Folder of the model.
    pub model: String,
    /// The map.
    pub map: String,
    /// Origin that the moved model is relative to.
    pub origin: LocalOrigin,
    /// Similarity from the model to the world, relative to `origin`.
    pub world_from_model: SimilarityParts,
    /// Datum of the map's heights.
    pub map_vertical: String,
    /// Metres that were added to the map's heights, so that they are above the ellipsoid.
    pub ellipsoid_shift_m: f64,
    /// Number of pairs that were picked.
    pub pairs: usize,
    /// Root mean square residual of the pairs, metres; `None` without pairs.
    pub rmse_m: Option<f64>,
    /// Residual of every pair.
    pub residuals: Vec<AlignResidual>,
}

impl ManualAlignReport {
    /// Returns the report as text, which ends in a line break. `output` is the folder that was
    /// written.
    pub fn text(&self, output: &Path) -> String {
        let rmse = self.rmse_m.map_or(String::new(), |rmse| format!(", RMSE {rmse:.3} m"));
        format!(
            "pairs      {}{rmse}\nscale      {:.6} m per unit of the model\nwritten    {}\n",
            self.pairs,
            self.world_from_model.scale,
            output.display()
        )
    }
}

impl ManualAlign {
    /// Reads a model and lays it over a map. Refuses what could not be saved later.
    ///
    /// # Errors
    /// [`JobError`]: a model without points, a map without a place in the world (`None`) or not in
    /// metres, an output that exists.
    pub fn open(config: &ManualAlignConfig, map: Option<AlignMap>, progress: &dyn Progress) -> Result<Self, JobError> {
        Ok(Self::opened(config, map, progress)?)
    }

    fn opened(
        config: &ManualAlignConfig,
        map: Option<AlignMap>,
        progress: &dyn Progress,
    ) -> Result<Self, AlignJobError> {
        let map = map.ok_or(AlignJobError::MapNotPlaced)?;
        report_page::refuse_existing(&config.output.join(REPORT), config.overwrite)?;
        OutputFolder::check(&config.output)?;
        let sparse = sparse_folder(&config.model);
        let model = read_model(&sparse, progress)?;
        if model.points.is_empty() {
            return Err(AlignJobError::NoPoints { path: sparse });
        }
        let projection = MapProjection::from_definition(&map.crs)?;
        if projection.metres_per_unit() != Some(1.0) {
            return Err(AlignJobError::MapNotInMetres { map: map.name });
        }
        let stated = || map.vertical.as_deref().and_then(|name| name.parse().ok());
        if config.vertical.is_none() && map.ground_m.is_some() && stated().is_none() {
            progress.warn("the map does not name the datum of its heights, so they are taken as above the ellipsoid");
        }
        let vertical = config.vertical.or_else(stated).unwrap_or_default();
        let middle = [(map.bounds[0] + map.bounds[2]) / 2.0, (map.bounds[1] + map.bounds[3]) / 2.0];
        let origin = [middle[0].round(), middle[1].round(), map.ground_m.unwrap_or(0.0).round()];
        let names: Vec<&str> = model.cameras.views.iter().map(|view| view.name.as_str()).collect();
        let pictures = config.images.clone();
        let pictures = pictures.unwrap_or_else(|| pictures_folder(&dataset_folder(&sparse), &sparse, &names));
        let pivot = middle_of(model.points.iter().map(|point| point.position));
        Ok(Self {
            ellipsoid_shift_m: ellipsoid_shift(&projection, vertical, origin)?,
            start: start(&model, &sparse, &map, pivot, origin),
            photographs: Photographs::new(pictures),
            config: config.clone(),
            model,
            map,
            vertical,
            origin,
            pivot,
            saved: Mutex::default(),
        })
    }

    /// The cameras of the model.
    pub fn cameras(&self) -> &formats::colmap::ColmapModel {
        &self.model.cameras
    }

    /// The points of the model.
    pub fn points(&self) -> &[formats::colmap::ColmapPoint] {
        &self.model.points
    }

    /// What positions in the world are counted from: easting, northing, height of the map.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The middle of the points, in the frame of the model.
    pub fn pivot(&self) -> [f64; 3] {
        self.pivot
    }

    /// Where the model lies before anybody has moved it.
    pub fn start(&self) -> &ManualStart {
        &self.start
    }

    /// The map and the datum of its heights.
    pub fn map(&self) -> (&AlignMap, VerticalDatum) {
        (&self.map, self.vertical)
    }

    /// The folder that is written.
    pub fn output(&self) -> &Path {
        &self.config.output
    }

    /// The report of what was saved last.
    pub fn saved(&self) -> Option<ManualAlignReport> {
        self.saved.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether there is a photograph of a view.
    pub fn has_photograph(&self, view: usize) -> bool {
        self.model.cameras.views.get(view).is_some_and(|view| self.photographs.path(&view.name).is_file())
    }

    /// Returns the photograph of a view as a pinhole sees it, as PNG of at most 1024 pixels along
    /// its longer side; `None` for a view that is not there.
    pub fn photograph(&self, view: usize) -> Option<Result<Vec<u8>, JobError>> {
        let view = self.model.cameras.views.get(view)?;
        let lens = self.model.cameras.lenses.get(view.lens)?;
        Some(self.photographs.png(&view.name, lens).map_err(JobError::from))
    }

    /// Fits a similarity to pairs of positions in the model and in the world, relative to the
    /// origin. One pair only moves the model; with two pairs, and with pairs on a line, what is up
    /// in the model at `present` stays up.
    ///
    /// # Errors
    /// [`AlignError`] as [`super::run`] meets it, and for positions on a vertical line.
    pub fn fit(&self, pairs: &[PointPair], present: &Similarity) -> Result<ManualFit, AlignError> {
        let (similarity, inliers, how) = match pairs {
            [only] => {
                let at = present.apply(only.source);
                let translation = [0, 1, 2].map(|i| present.translation()[i] + only.target[i] - at[i]);
                let moved = Similarity::new(present.scale(), present.rotation(), translation);
                (moved.map_err(|_| AlignError::NotFinite { index: 0 })?, vec![true], "one pair: moved only")
            }
            [_, _] => level(pairs, present, "two pairs: what was up stays up")?,
            _ => match aligned(self.config.use_gravity, pairs, &self.model, &AlignConfig::default()) {
                Ok(Aligned { alignment: found, upright, .. }) => {
                    let how = if upright { "pairs, and the up direction of the cameras" } else { "pairs alone" };
                    (found.world_from_model, found.inliers, how)
                }
                Err(AlignError::Degenerate { .. }) => level(pairs, present, "pairs on a line: what was up stays up")?,
                Err(error) => return Err(error),
            },
        };
        Ok(ManualFit { world_from_model: SimilarityParts::from(&similarity), inliers, how: how.to_owned() })
    }

    /// Writes the moved model with the similarity, its origin, the pairs and a report.
    ///
    /// # Errors
    /// [`JobError`]: an output that exists or cannot be written, too many pairs.
    pub fn save(&self, similarity: &Similarity, pairs: &[PointPair]) -> Result<ManualAlignReport, JobError> {
        Ok(self.saved_as(similarity, pairs)?)
    }

    fn saved_as(&self, similarity: &Similarity, pairs: &[PointPair]) -> Result<ManualAlignReport, AlignJobError> {
        if pairs.len() > PAIRS_MAX {
            return Err(AlignJobError::TooManyPairs { found: pairs.len(), most: PAIRS_MAX });
        }
        // One save at a time.
        let mut saved = self.saved.lock().unwrap_or_else(PoisonError::into_inner);
        let Self { config, origin, .. } = self;
        let report_path = config.output.join(REPORT);
        let overwrite = config.overwrite;
        report_page::refuse_existing(&report_path, overwrite)?;
        let folder = OutputFolder::take(&config.output)?;
        let shifted = [origin[0], origin[1], origin[2] + self.ellipsoid_shift_m];
        let world = LocalOrigin::new(self.map.crs.clone(), "ellipsoid", shifted);
        let report = self.report(similarity, pairs, world.clone());
        folder.remove(REPORT)?;
        let writer = ModelWriter { model: &self.model, origin: &world, encoding: config.encoding, overwrite };
        writer.write(&config.output, "", similarity)?;
        if !pairs.is_empty() {
            let table = self.table(pairs);
            formats::write_bytes(config.output.join(PAIRS), table.as_bytes(), overwrite).map_err(FileError::write)?;
        } else if overwrite {
            // An earlier table would be taken for that of this alignment.
            files::remove(&config.output.join(PAIRS))?;
        }
        let lead = "A camera model moved to the world by hand.";
        report_page::write(&report_path, ("Alignment", lead), &report, Vec::new(), overwrite)?;
        *saved = Some(report.clone());
        Ok(report)
    }

    fn report(&self, similarity: &Similarity, pairs: &[PointPair], origin: LocalOrigin) -> ManualAlignReport {
        let residual = |(index, pair): (usize, &PointPair)| {
            let at = similarity.apply(pair.source);
            let residual_m = (0..3).map(|i| (at[i] - pair.target[i]).powi(2)).sum::<f64>().sqrt();
            AlignResidual { name: format!("pair {}", index + 1), residual_m, inlier: true }
        };
        let residuals: Vec<AlignResidual> = pairs.iter().enumerate().map(residual).collect();
        let squares: f64 = residuals.iter().map(|pair| pair.residual_m.powi(2)).sum();
        ManualAlignReport {
            model: self.config.model.display().to_string(),
            map: self.map.name.clone(),
            origin,
            world_from_model: SimilarityParts::from(similarity),
            map_vertical: self.vertical.to_string(),
            ellipsoid_shift_m: self.ellipsoid_shift_m,
            pairs: pairs.len(),
            rmse_m: (!pairs.is_empty()).then(|| (squares / pairs.len() as f64).sqrt()),
            residuals,
        }
    }

    /// The pairs as a table of known positions, with heights above the ellipsoid.
    fn table(&self, pairs: &[PointPair]) -> String {
        let line = |PointPair { source: [x, y, z], target }: &PointPair| {
            let [easting, northing, height] = [0, 1, 2].map(|i| self.origin[i] + target[i]);
            format!("{x},{y},{z},{easting:.3},{northing:.3},{:.3}\n", height + self.ellipsoid_shift_m)
        };
        "x,y,z,easting,northing,height\n".to_owned() + &pairs.iter().map(line).collect::<String>()
    }
}

/// Fits pairs so that what is up in the model at present stays up.
fn level(
    pairs: &[PointPair],
    present: &Similarity,
    how: &'static str,
) -> Result<(Similarity, Vec<bool>, &'static str), AlignError> {
    Ok((fit_level(pairs, present.rotation())?, vec![true; pairs.len()], how))
}

/// Returns the height of a datum above the ellipsoid at a place of the map, metres.
fn ellipsoid_shift(
    projection: &MapProjection,
    vertical: VerticalDatum,
    [x, y, height]: [f64; 3],
) -> Result<f64, CrsError> {
    if vertical == VerticalDatum::Ellipsoid {
        return Ok(0.0);
    }
    let (lon, lat) = projection.lonlat_from_map(x, y)?;
    Ok(HeightConverter::new(vertical)?.ellipsoid_from_datum(lon, lat, height)? - height)
}

/// Lays a model over the middle of a map with its up direction up; where it lies on the map
/// already, because it was aligned before, it stays.
fn start(model: &ModelWithPoints, folder: &Path, map: &AlignMap, pivot: [f64; 3], origin: [f64; 3]) -> ManualStart {
    let on_map = |p: [f64; 3]| {
        let [west, south, east, north] = map.bounds;
        (west..=east).contains(&p[0]) && (south..=north).contains(&p[1])
    };
    let own = formats::read_regular_text(&folder.join("origin.json"), files::TEXT_LIMIT).ok();
    let own = own.and_then(|text| serde_json::from_str::<LocalOrigin>(&text).ok());
    let own = own.filter(|own| own.crs == map.crs).map_or([0.0; 3], |own| own.origin);
    if on_map([0, 1, 2].map(|i| pivot[i] + own[i])) {
        let parts = SimilarityParts {
            translation: [0, 1, 2].map(|i| own[i] - origin[i]),
            ..SimilarityParts::from(&Similarity::IDENTITY)
        };
        return ManualStart { world_from_model: parts, up_from: "the model lies on the map already".to_owned() };
    }
    let rotations: Vec<[[f64; 3]; 3]> = model.cameras.views.iter().map(|view| view.pose.rotation).collect();
    let (up, up_from) = match camera_up(&rotations) {
        Some(up) => (up.direction, "up as the cameras are held"),
        None => {
            let centres = middle_of(model.cameras.views.iter().map(|view| view.pose.centre));
            let above = [0, 1, 2].map(|i| centres[i] - pivot[i]);
            (plane_normal(model.points.iter().map(|p| p.position), pivot, above), "up from the plane of the points")
        }
    };
    let rotation = upright(up);
    let turned = |p: [f64; 3]| rotation.map(|row| (0..3).map(|i| row[i] * (p[i] - pivot[i])).sum::<f64>());
    let placed: Vec<[f64; 3]> = model.points.iter().map(|point| turned(point.position)).collect();
    let at = |share: f64, mut values: Vec<f64>| {
        let rank = (share * (values.len() - 1) as f64).round() as usize;
        order_statistic(&mut values, rank).unwrap_or(0.0)
    };
    let far = at(FAR, placed.iter().map(|p| p[0].hypot(p[1])).collect());
    let low = at(LOW, placed.iter().map(|p| p[2]).collect());
    let side = (map.bounds[2] - map.bounds[0]).min(map.bounds[3] - map.bounds[1]);
    let scale = if far > 0.0 { (START_FILL * side / far).clamp(1e-6, 1e6) } else { 1.0 };
    let ground = map.ground_m.unwrap_or(0.0);
    let middle = [(map.bounds[0] + map.bounds[2]) / 2.0, (map.bounds[1] + map.bounds[3]) / 2.0, ground - scale * low];
    // The pivot comes to the middle.
    let moved = rotation.map(|row| (0..3).map(|i| row[i] * pivot[i]).sum::<f64>());
    let translation = [0, 1, 2].map(|i| middle[i] - origin[i] - scale * moved[i]);
    ManualStart { world_from_model: SimilarityParts { scale, rotation, translation }, up_from: up_from.to_owned() }
}

/// Returns the rotation by the least angle that turns a unit vector up.
fn upright([x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
    if z < -1.0 + 1e-9 {
        return [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    }
    let k = 1.0 / (1.0 + z);
    [[1.0 - k * x * x, -k * x * y, -x], [-k * x * y, 1.0 - k * y * y, -y], [x, y, z]]
}

/// Returns the median of each axis, which a few wild points do not carry away.
fn middle_of(points: impl Iterator<Item = [f64; 3]> + Clone) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = points.clone().map(|point| point[axis]).collect();
        upper_median(&mut values).unwrap_or(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_up_direction_comes_up_by_a_rotation() {
        for up in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.0, 0.0, -1.0]] {
            let rotation = upright(up);
            let turned = rotation.map(|row| (0..3).map(|i| row[i] * up[i]).sum::<f64>());
            assert!(turned[0].abs() < 1e-9 && turned[1].abs() < 1e-9 && (turned[2] - 1.0).abs() < 1e-9, "{turned:?}");
            assert!(Similarity::new(1.0, rotation, [0.0; 3]).is_ok());
        }
    }
}
