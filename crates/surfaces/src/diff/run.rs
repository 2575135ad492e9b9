//! Runs the diff job.

use std::path::Path;

use change::{Change, ChangeConfig, ChangeInput, detect, volume_of};
use crs::{Crs, MapProjection};
use formats::areas::{AreaFeature, NamedAreas};
use formats::raster::{Band, BandData, CogRaster, write_cog};
use numeric::Progress;
use report::{Legend, MapLayer};

use super::aligned::Aligned;
use super::config::DiffConfig;
use super::error::DiffError;
use super::layers::{of_areas, of_regions};
use super::page;
use super::report::{DiffBlocks, DiffRegion, DiffReport};
use job::error::JobError;
use job::files::{self, FileError};
use job::output_folder::OutputFolder;
use job::report_page;
use job::threads;

/// Names of the files in the output folder.
const CHANGE: &str = "change.tif";
const SIGNIFICANCE: &str = "significance.tif";
const REGIONS: &str = "regions.tif";
const POLYGONS: &str = "changes.geojson";
const AREAS: &str = "areas.geojson";
const REPORT: &str = "diff.json";
const PAGE: &str = "diff.html";
/// Styles of QGIS, in the order of the maps of the page.
const STYLES: [&str; 2] = ["change.qml", "significance.qml"];
const FILES: [&str; 9] = [CHANGE, SIGNIFICANCE, REGIONS, POLYGONS, AREAS, STYLES[0], STYLES[1], PAGE, REPORT];
/// Range of the page's map of significance, standard deviations.
const SHOWN_SIGMAS: f64 = 5.0;

/// Growth of the distance by which the walls of surfaces of this toolkit reach too far outwards,
/// per metre of their height. It was fitted to the volumes of buildings of 3 to 20 m that came or
/// went: 99 in towns of `benches/evidence/change.py` (seeds 8051 to 8054 and 8061 to 8070), and 25
/// in those of `benches/products/diff.py` (seeds 11 to 15).
const OVERREACH_GROWTH: f64 = 0.01;
/// Standard deviation of that distance from building to building, cells, in the same towns.
const OVERREACH_SIGMA_CELLS: f64 = 0.45;

/// Finds what changed between two surface models, and writes rasters, polygons and a report.
///
/// # Errors
/// [`JobError`]: surfaces that cannot be read or brought together, polygons that cannot be read,
/// outputs that exist.
///
/// ```
/// use surfaces::diff::{DiffConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/dsm.tif");
/// let folder = tempfile::tempdir()?;
/// let mut config = DiffConfig::new(town.into(), town.into(), folder.path().join("diff"));
/// config.sigma_m = Some(0.3);
/// let report = run(&config, &Silent)?;
/// assert!(report.regions.is_empty() && report.total.net_m3.abs() < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &DiffConfig, progress: &dyn Progress) -> Result<DiffReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &DiffConfig, progress: &dyn Progress) -> Result<DiffReport, DiffError> {
    config.validate()?;
    for name in FILES {
        files::refuse_existing(&config.output.join(name), config.overwrite)?;
    }
    let layer = config
        .areas
        .as_ref()
        .map(|path| formats::areas::read_features(path, config.areas_layer.as_deref(), config.areas_field.as_deref()));
    let layer = layer.transpose()?;
    threads::install(config.threads, || {
        let folder = OutputFolder::take(&config.output)?;
        progress.begin("surfaces", 1);
        let aligned = Aligned::new(config, progress)?;
        progress.step();
        progress.begin("change", 1);
        let input = ChangeInput {
            before: &aligned.inputs.reference.heights,
            after: &aligned.after,
            sigma: aligned.sigma.as_ref(),
            observed: Some(&aligned.observed),
            probability: aligned.probability.as_ref(),
            cell_m: aligned.cell_m,
        };
        let change = detect(&input, &parameters(config, &aligned))?;
        progress.step();
        progress.check_cancelled()?;
        finish(config, &folder, aligned, &change, layer.as_ref())
    })?
}

/// Returns the parameters of the search with the overreach of walls.
fn parameters(config: &DiffConfig, aligned: &Aligned) -> ChangeConfig {
    let mut parameters = config.change;
    if aligned.is_own {
        parameters.overreach_sigma_m = OVERREACH_SIGMA_CELLS * aligned.cell_m;
        parameters.overreach_growth = OVERREACH_GROWTH;
    }
    if let Some(stated) = config.overreach_m {
        (parameters.overreach_m, parameters.overreach_growth) = (stated, 0.0);
    }
    parameters
}

/// Makes the polygons and the report, and writes all.
fn finish(
    config: &DiffConfig,
    folder: &OutputFolder,
    aligned: Aligned,
    change: &Change,
    layer: Option<&NamedAreas>,
) -> Result<DiffReport, DiffError> {
    let before = &aligned.inputs.reference;
    let epsg = before.horizontal_epsg.ok_or_else(|| DiffError::NoEpsg { path: before.path.clone() })?;
    let (map, transform) = (MapProjection::from_epsg(epsg)?, before.geotransform);
    let (areas, of_areas) = match layer {
        Some(layer) => of_areas(layer, change, &transform, &map)?,
        None => Default::default(),
    };
    let (width, height) = (change.difference.width(), change.difference.height());
    let regions: Vec<DiffRegion> = (1..)
        .zip(&change.regions)
        .map(|(number, found)| {
            let count = found.cells.len().max(1) as f64;
            let (x, y) = found.cells.iter().fold((0, 0), |(x, y), at| (x + at % width, y + at / width));
            let (x, y) = transform.map_from_cell(x as f64 / count, y as f64 / count);
            DiffRegion { number, centre: [x, y], found: found.clone() }
        })
        .collect();
    let of_regions = of_regions(&regions, width, &transform, &map)?;
    let with_heights = change.difference.data().iter().filter(|d| d.is_finite()).count();
    let report = DiffReport {
        before: before.path.clone(),
        after: aligned.inputs.test.path.clone(),
        output: config.output.clone(),
        crs: format!("EPSG:{epsg}"),
        vertical: aligned.inputs.vertical.clone(),
        size: (width, height),
        cell_m: aligned.cell_m,
        shift: aligned.shift,
        blocks: config.block_m.zip(aligned.local.as_ref()).map(|(side_m, local)| DiffBlocks::new(side_m, local)),
        sigma_factor: change.sigma_factor,
        detection_m: change.detection_m,
        offset_sigma_m: change.offset_sigma_m,
        correlation: change.correlation.clone(),
        observed_cells: change.observed_cells,
        deciding_cells: change.deciding_cells,
        before_acquired: before.provenance.acquired.clone(),
        after_acquired: aligned.inputs.test.provenance.acquired.clone(),
        filled_cells: with_heights - change.observed_cells,
        tested: change.tested,
        regions,
        total: volume_of(change, 0..width * height),
        areas,
        parameters: parameters(config, &aligned),
        notes: aligned.inputs.notes.clone(),
    };
    let written = Written { aligned: &aligned, change, regions: &of_regions, areas: layer.map(|_| &of_areas[..]) };
    written.write(config, folder, Crs::ellipsoidal(epsg), &report)?;
    Ok(report)
}

/// What is written.
struct Written<'a> {
    aligned: &'a Aligned,
    change: &'a Change,
    regions: &'a [AreaFeature],
    areas: Option<&'a [AreaFeature]>,
}

impl Written<'_> {
    /// Makes all files in a work folder and moves them to their names.
    fn write(
        &self,
        config: &DiffConfig,
        folder: &OutputFolder,
        crs: Crs,
        report: &DiffReport,
    ) -> Result<(), DiffError> {
        let work = folder.work_folder()?;
        let threads = threads::count(config.threads);
        let transform = self.aligned.inputs.reference.geotransform;
        let provenance = self.aligned.inputs.reference.provenance.with(&self.aligned.inputs.test.provenance);
        let put = |name: &str, bands: &[Band<'_>]| {
            let plain = CogRaster::new(bands, transform, crs);
            let raster = CogRaster { threads, holds_heights: false, provenance: Some(&provenance), ..plain };
            write_cog(work.path().join(name), &raster, false).map_err(FileError::from)
        };
        let band = |description, data| Band { description, data };
        let (difference, sigma) = (&self.change.difference, &self.change.sigma);
        put(CHANGE, &[band("change_m", BandData::F32(difference)), band("sigma_m", BandData::F32(sigma))])?;
        put(SIGNIFICANCE, &[band("change_in_sigmas", BandData::F32(&self.change.significance))])?;
        put(REGIONS, &[band("region_number", BandData::U32(&self.change.numbers))])?;
        let polygons = |path: &Path, features: &[AreaFeature]| {
            formats::areas::write(path, features, false).map_err(FileError::from)
        };
        polygons(&work.path().join(POLYGONS), self.regions)?;
        if let Some(areas) = self.areas {
            polygons(&work.path().join(AREAS), areas)?;
        }
        let page = page::of(report, self.layers(), self.areas.is_some());
        report_page::write_styles(work.path(), STYLES.into_iter().zip(&page.layers[1..]))?;
        report_page::write_page(&work.path().join(REPORT), &page, report, false)?;
        for name in FILES {
            folder.remove(name)?;
            if name != AREAS || self.areas.is_some() {
                folder.publish(work.path(), name)?;
            }
        }
        Ok(())
    }

    /// Returns the maps of the page.
    fn layers(&self) -> Vec<MapLayer> {
        let Change { difference, significance, .. } = self.change;
        // Blue and red end at the largest change of a region; without one, at the shown deviations.
        let of_regions = self.change.regions.iter().map(|region| region.mean_m.abs()).fold(0.0, f64::max);
        let range = if of_regions > 0.0 { of_regions } else { SHOWN_SIGMAS * self.change.detection_m };
        let metres = || Legend::signed(range, "m");
        let before = &self.aligned.inputs.reference.heights;
        let on_surface = page::regions_on_surface(self.change, before, self.aligned.cell_m, metres());
        vec![
            on_surface,
            report_page::legend_layer("Change", "Second surface minus first.", difference, metres()),
            report_page::legend_layer(
                "Significance",
                "The change in standard deviations, where the cell decides.",
                significance,
                Legend::signed(SHOWN_SIGMAS, "σ"),
            ),
            report_page::relief_layer(
                "First surface",
                "Heights of the first surface, shaded.",
                before,
                self.aligned.cell_m,
            ),
        ]
    }
}
