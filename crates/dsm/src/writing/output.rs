//! The files of a run. All are made in a work folder inside the output folder, then each is moved
//! to its final name. An old report is removed before the first and the new one is moved last, so a
//! folder with a report holds the files of one run.
//!
//! A scene that was computed at once is written from memory. The chunks of a large scene go into
//! spools on the disk as they come, and its pictures are reduced to a size that can be looked at.

use std::path::{Path, PathBuf};

use crs::{Crs, HeightConverter, VerticalDatum};
use formats::raster::{Band, BandData, CogPlace, CogRaster, Provenance, RasterSpool, SpoolBand, write_cog};
use raster::{Grid, Window};
use reconstruct::{DsmGrid, SurfaceRasters};
use tempfile::TempDir;

use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::products::remove_products;
use crate::report::{DsmReport, ImageReport};
use crate::stac::{AssetKind, StacAsset, StacRasters, item_and_collection};
use crate::writing::layers::{HEIGHTS, LAYERS, Layer};
use crate::writing::page;
use crate::writing::pictures::{ReadLayer, RunMaps, write_pictures};
use job::files::{FileError, create_folder, write_json};
use job::job_paths::relative;
use job::output_folder::OutputFolder;
use job::run_links;
use surfaces::eval::remove_evaluation;

/// Files of a run beside its rasters and their styles. The report is the last to appear: a folder
/// with a report is complete.
const OTHERS: [&str; 11] = [
    "dsm/hillshade.png",
    "dsm/hillshade.pgw",
    "dsm/relief.png",
    "dsm/relief.pgw",
    "dsm/thumbnail.png",
    "dsm/thumbnail.pgw",
    "stac/item.json",
    "stac/collection.json",
    USED_CONFIG,
    PAGE,
    "report/report.json",
];
/// Files of a run, relative to its folder, in the order in which they appear.
pub const FILES: [&str; 2 * LAYERS.len() + OTHERS.len()] = {
    let mut files = [""; 2 * LAYERS.len() + OTHERS.len()];
    let mut at = 0;
    while at < LAYERS.len() {
        (files[at], files[LAYERS.len() + at]) = (LAYERS[at].raster, LAYERS[at].style);
        at += 1;
    }
    at = 0;
    while at < OTHERS.len() {
        files[2 * LAYERS.len() + at] = OTHERS[at];
        at += 1;
    }
    files
};
const PAGE: &str = "report/report.html";
/// Configuration of the run, as a job file.
pub const USED_CONFIG: &str = "used_config.toml";

/// Returns the contents of the rasters in the order of [`LAYERS`]; `heights` come from
/// [`absolute_heights`].
fn bands<'a>(rasters: &'a SurfaceRasters, heights: &'a Grid<f32>) -> [BandData<'a>; LAYERS.len()] {
    LAYERS.each_ref().map(|layer| (layer.cells)(rasters, heights))
}

/// The output folder of a run, with the work folder in which its files are made. Dropping it before
/// the files are published removes what was made.
pub(crate) struct DsmFolder {
    // Dropped first, so that an empty output folder can be removed after it.
    work: TempDir,
    folder: OutputFolder,
}

impl DsmFolder {
    /// Takes the output folder for this run, and refuses early what would fail at the end.
    ///
    /// # Errors
    /// [`DsmError::InUse`] when another run writes into the folder, [`DsmError::Exists`] for
    /// results that may not be replaced, [`DsmError::Output`] for a folder that cannot be written.
    pub(crate) fn take(config: &DsmConfig) -> Result<Self, DsmError> {
        let folder = OutputFolder::take(&config.output)?;
        if !config.overwrite {
            refuse_results(&config.output, &FILES)?;
        }
        Self::inside(folder)
    }

    /// Makes the work folder inside a folder that this run has taken.
    ///
    /// # Errors
    /// [`DsmError::Output`].
    pub(crate) fn inside(folder: OutputFolder) -> Result<Self, DsmError> {
        folder.check_places(FILES)?;
        let work = folder.work_folder()?;
        for name in ["dsm", "report", "spool", "stac"] {
            create_folder(&work.path().join(name))?;
        }
        Ok(Self { work, folder })
    }

    fn dsm(&self) -> PathBuf {
        self.work.path().join("dsm")
    }

    fn spool(&self, name: &str) -> PathBuf {
        self.work.path().join("spool").join(name)
    }

    /// Moves every file to its final name. Results about the DSM that is replaced go with it.
    fn publish(&self) -> Result<(), DsmError> {
        if let Some(report) = FILES.last() {
            self.folder.remove(report)?;
        }
        remove_evaluation(&self.folder)?;
        remove_products(&self.folder)?;
        Ok(FILES.iter().try_for_each(|name| self.folder.publish(self.work.path(), name))?)
    }
}

/// Refuses results of these names in a folder.
///
/// # Errors
/// [`DsmError::Exists`] with the first that is there.
pub(crate) fn refuse_results(folder: &Path, names: &[&str]) -> Result<(), DsmError> {
    let existing = names.iter().map(|name| folder.join(name)).find(|path| path.symlink_metadata().is_ok());
    existing.map_or(Ok(()), |path| Err(DsmError::Exists { path }))
}

/// Writes a configuration as a job file, whose paths are relative to `folder`.
///
/// # Errors
/// [`DsmError::Output`], [`DsmError::File`].
pub(crate) fn write_config(path: &Path, config: &DsmConfig, folder: &Path) -> Result<(), DsmError> {
    let mut named = config.clone();
    named.map_paths(|path| relative(path, folder));
    let text = toml::to_string_pretty(&named)
        .map_err(|e| DsmError::Output { path: path.to_owned(), source: std::io::Error::other(e) })?;
    Ok(formats::write_bytes(path, text.as_bytes(), false).map_err(FileError::from)?)
}

/// Writes the results of a scene that was computed at once.
///
/// # Errors
/// [`DsmError::Output`], [`DsmError::Image`], [`DsmError::Crs`]. Nothing stays behind.
pub(crate) fn write_whole(
    folder: &DsmFolder,
    config: &DsmConfig,
    grid: &DsmGrid,
    rasters: &SurfaceRasters,
    report: &DsmReport,
) -> Result<(), DsmError> {
    let heights = absolute_heights(grid, config.vertical, rasters)?;
    let parts = bands(rasters, &heights);
    // What a raster gives for its no-data value must not depend on where it is read.
    let read = |layer: usize, window: Window| Ok(cells_of(&parts[layer], LAYERS[layer].band().no_data as f32, window));
    let (looks, written) = rayon::join(
        || write_looks(folder, config, grid, report, &read),
        || write_rasters(folder.work.path(), config.vertical, grid, &parts, &provenance(report)),
    );
    looks.and(written)?;
    write_texts(folder, config, report)?;
    folder.publish()
}

/// Returns a window of a raster in memory as floats; NaN is no-data.
fn cells_of(data: &BandData<'_>, no_data: f32, window: Window) -> Grid<f32> {
    match data {
        BandData::F32(cells) => cells.window(window, f32::NAN),
        BandData::U8(cells) => {
            let value = |v: &u8| if f32::from(*v) == no_data { f32::NAN } else { f32::from(*v) };
            cells.window(window, no_data as u8).map(value)
        }
        _ => Grid::filled(window.width, window.height, f32::NAN),
    }
}

/// Writes what people look at: pictures, styles, the page and the STAC item.
fn write_looks(
    folder: &DsmFolder,
    config: &DsmConfig,
    grid: &DsmGrid,
    report: &DsmReport,
    read: ReadLayer<'_>,
) -> Result<(), DsmError> {
    let (dsm, root) = (folder.dsm(), folder.work.path());
    write_pictures(&dsm, grid, read)?;
    let maps = RunMaps::read(grid, read)?;
    maps.write_styles(root)?;
    let crs = Crs { horizontal: grid.epsg, vertical: config.vertical };
    let links = run_links::links("../", PAGE, |name| FILES.contains(&name));
    let page = page::html(config, report, (&crs, grid.gsd_m), &maps, links)
        .map_err(|e| DsmError::Output { path: root.join("report/report.html"), source: std::io::Error::other(e) })?;
    formats::write_bytes(root.join("report/report.html"), page.as_bytes(), false).map_err(FileError::from)?;
    let (item, collection) = item_and_collection(&stac_rasters(config, grid, report, &crs))?;
    write_json(&root.join("stac/item.json"), &item, false)?;
    Ok(write_json(&root.join("stac/collection.json"), &collection, false)?)
}

/// Returns the files of a run as an item of STAC.
fn stac_rasters<'a>(config: &DsmConfig, grid: &DsmGrid, report: &DsmReport, crs: &Crs) -> StacRasters<'a> {
    let mut assets: Vec<StacAsset<'a>> = Vec::new();
    for (place, layer) in LAYERS.iter().enumerate() {
        let SpoolBand { description, is_float, no_data } = layer.band();
        let data_type = if is_float { "float32" } else { "uint8" };
        assets.push(StacAsset {
            name: layer.stem,
            path: format!("../{}", layer.raster),
            title: layer.title.to_owned(),
            role: if place == HEIGHTS { "data" } else { "metadata" },
            kind: AssetKind::Cog { band: description, data_type, no_data, unit: layer.unit },
        });
    }
    let other = |name, path: &str, title: &str, role, kind| StacAsset {
        name,
        path: path.to_owned(),
        title: title.to_owned(),
        role,
        kind: AssetKind::Other(kind),
    };
    assets.push(other("thumbnail", "../dsm/thumbnail.png", "Relief, small", "thumbnail", "image/png"));
    assets.push(other("report", "../report/report.html", "Report of the run", "metadata", "text/html"));
    StacRasters {
        id: config.output.file_name().map_or_else(|| "dsm".to_owned(), |name| name.to_string_lossy().into_owned()),
        description: format!("Digital surface model from {} images, {crs}.", report.images.len()),
        epsg: grid.epsg,
        geotransform: grid.geotransform,
        size: grid.size,
        gsd_m: grid.gsd_m,
        acquired: provenance(report).acquired,
        assets,
    }
}

/// The rasters of a large scene, which grow on the disk chunk by chunk. Dropping it before
/// [`ChunkedOutput::finish`] removes what was made.
pub(crate) struct ChunkedOutput<'a> {
    config: &'a DsmConfig,
    grid: &'a DsmGrid,
    spools: Vec<RasterSpool>,
    folder: DsmFolder,
}

impl<'a> ChunkedOutput<'a> {
    /// Makes empty spools in the work folder.
    ///
    /// # Errors
    /// [`DsmError::Output`] also for a disk with too little space; [`DsmError::Image`].
    pub(crate) fn begin(folder: DsmFolder, config: &'a DsmConfig, grid: &'a DsmGrid) -> Result<Self, DsmError> {
        let cell_bytes: u64 = LAYERS.iter().map(|layer| if layer.band().is_float { 4 } else { 1 }).sum();
        let needed_bytes = grid.size.0 as u64 * grid.size.1 as u64 * cell_bytes;
        formats::atomic::require_space(&config.output, needed_bytes).map_err(FileError::from)?;
        let spool = |layer: &Layer| RasterSpool::create(folder.spool(layer.stem), grid.size, layer.band());
        let spools = LAYERS.iter().map(spool).collect::<Result<_, _>>()?;
        Ok(Self { config, grid, spools, folder })
    }

    /// Puts the cells of a chunk into their place.
    ///
    /// # Errors
    /// [`DsmError::Image`], [`DsmError::Crs`].
    pub(crate) fn put(&mut self, core: Window, rasters: &SurfaceRasters) -> Result<(), DsmError> {
        let heights = absolute_heights(&self.grid.part(core), self.config.vertical, rasters)?;
        for (spool, cells) in self.spools.iter_mut().zip(bands(rasters, &heights)) {
            spool.put((core.x as usize, core.y as usize), cells)?;
        }
        Ok(())
    }

    /// Makes the final files and moves them to their names.
    ///
    /// # Errors
    /// [`DsmError::Output`], [`DsmError::Image`].
    pub(crate) fn finish(self, report: &DsmReport) -> Result<(), DsmError> {
        let Self { config, grid, spools, folder } = self;
        let read = |layer: usize, window: Window| Ok(spools[layer].read(window)?);
        write_looks(&folder, config, grid, report, &read)?;
        let crs = Crs { horizontal: grid.epsg, vertical: config.vertical };
        let geotransform = grid.geotransform;
        let provenance = provenance(report);
        for (place, spool) in spools.into_iter().enumerate() {
            let holds_heights = place == HEIGHTS;
            let threads = rayon::current_num_threads();
            let to = CogPlace {
                geotransform,
                crs: crs.into(),
                holds_heights,
                provenance: Some(&provenance),
                metadata: &[],
                threads,
            };
            spool.into_cog(folder.work.path().join(LAYERS[place].raster), to, false)?;
        }
        write_texts(&folder, config, report)?;
        folder.publish()
    }
}

/// Returns the images of a run and their times.
fn provenance(report: &DsmReport) -> Provenance {
    let name = |image: &ImageReport| image.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Provenance {
        sources: report.images.iter().map(name).collect(),
        acquired: report.images.iter().filter_map(|image| image.acquired.clone()).collect(),
    }
}

fn write_texts(folder: &DsmFolder, config: &DsmConfig, report: &DsmReport) -> Result<(), DsmError> {
    let root = folder.work.path();
    write_json(&root.join("report/report.json"), report, false)?;
    write_config(&root.join(USED_CONFIG), config, folder.folder.path())
}

fn write_rasters(
    folder: &Path,
    vertical: VerticalDatum,
    grid: &DsmGrid,
    parts: &[BandData<'_>],
    provenance: &Provenance,
) -> Result<(), DsmError> {
    let crs = Crs { horizontal: grid.epsg, vertical };
    for (place, (layer, data)) in LAYERS.iter().zip(parts).enumerate() {
        let SpoolBand { description, no_data, .. } = layer.band();
        let bands = [Band { description, data: *data }];
        let plain = CogRaster::new(&bands, grid.geotransform, crs);
        let raster = CogRaster {
            no_data: Some(no_data),
            holds_heights: place == HEIGHTS,
            provenance: Some(provenance),
            ..plain
        };
        write_cog(folder.join(layer.raster), &raster, false)?;
    }
    Ok(())
}

/// Returns heights above the vertical datum, as they are written; NaN in voids.
fn absolute_heights(grid: &DsmGrid, vertical: VerticalDatum, rasters: &SurfaceRasters) -> Result<Grid<f32>, DsmError> {
    let mut out = rasters.height_m.map(|h| written(f64::from(*h) + rasters.origin_m));
    if vertical == VerticalDatum::Ellipsoid {
        return Ok(out);
    }
    let (projection, converter) = (grid.projection()?, HeightConverter::new(vertical)?);
    let columns = out.width();
    let (mut x, mut y, mut h) = (vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]);
    for row in 0..out.height() {
        for (c, (x, y)) in x.iter_mut().zip(&mut y).enumerate() {
            (*x, *y) = grid.geotransform.map_from_cell(c as f64, row as f64);
            h[c] = f64::from(rasters.height_m[(c, row)]) + rasters.origin_m;
        }
        projection.lonlat_from_map_slices(&mut x, &mut y)?;
        converter.datum_from_ellipsoid_slices(&x, &y, &mut h)?;
        out.row_mut(row).iter_mut().zip(&h).for_each(|(o, h)| *o = written(*h));
    }
    Ok(out)
}

/// Rounds a height to whole 1024ths of a metre, a hundredth of the precision of any image. The bits
/// behind them are noise that takes a third of the file and of the time to compress it.
fn written(height_m: f64) -> f32 {
    const UNIT_M: f64 = 1.0 / 1024.0;
    ((height_m / UNIT_M).round() * UNIT_M) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that is killed while it publishes leaves no report of an older run beside its files.
    #[test]
    fn the_report_goes_first_and_comes_last() {
        let root = tempfile::tempdir().unwrap();
        let mut config = DsmConfig::new(Vec::new(), root.path().join("out"));
        config.overwrite = true;
        for name in FILES {
            let path = config.output.join(name);
            create_folder(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"old").unwrap();
        }
        let folder = DsmFolder::take(&config).unwrap();
        std::fs::write(folder.dsm().join("dsm.tif"), b"new").unwrap();
        // The second file is missing, so publishing stops after the first.
        assert!(folder.publish().is_err());
        let content = |name: &str| std::fs::read(config.output.join(name)).ok();
        assert_eq!(content("dsm/dsm.tif").as_deref(), Some(&b"new"[..]));
        assert_eq!(content("dsm/sigma.tif").as_deref(), Some(&b"old"[..]));
        assert_eq!(content("report/report.json"), None);
    }

    #[test]
    fn written_heights_are_near() {
        for i in 0..1000 {
            let v = 0.001 + 0.37 * f64::from(i);
            assert!((f64::from(written(v)) - v).abs() <= 0.5 / 1024.0 + 1e-5);
        }
        assert!(written(f64::NAN).is_nan());
    }
}
