//! A surface model on a projected map in metres, with heights above the WGS 84 ellipsoid.

use std::path::{Path, PathBuf};

use crs::{CrsError, HeightConverter, MapProjection, VerticalDatum};
use formats::raster::{Dem, read_dem};
use numeric::{Progress, failures};

use crate::error::{JobError, from_failures};
use crate::run_folder::surface_file;

/// A surface model that has been read.
pub struct MapSurface {
    /// The raster; heights in metres above the WGS 84 ellipsoid.
    pub dem: Dem,
    /// The projection of its map.
    pub projection: MapProjection,
}

/// A surface model that cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MapSurfaceError {
    /// The raster names no coordinate reference system.
    #[error("the surface model has no coordinate reference system: {}", path.display())]
    NoCrs {
        /// The raster.
        path: PathBuf,
    },
    /// The coordinate reference system is not usable.
    #[error("cannot use the coordinate reference system of the surface model: {}", path.display())]
    Crs {
        /// The raster.
        path: PathBuf,
        /// What is wrong with it.
        source: CrsError,
    },
    /// The map's unit is not the metre.
    #[error(
        "the surface model is in {unit}, expected a projected reference system in metres: warp it first: {}",
        path.display()
    )]
    NotInMetres {
        /// The raster.
        path: PathBuf,
        /// The unit in words.
        unit: String,
    },
    /// The heights cannot be converted.
    #[error("cannot convert the heights of the surface model to the ellipsoid: {}", path.display())]
    Heights {
        /// The raster.
        path: PathBuf,
        /// What is wrong.
        source: CrsError,
    },
}

failures!(MapSurfaceError: Crs {
    Self::Crs { source, .. } | Self::Heights { source, .. } => source.kind(),
});

from_failures!(MapSurfaceError);

/// Reads a surface model, or that of the folder of a DSM run; `stated` overrides the vertical datum
/// that the file names.
///
/// # Errors
/// [`JobError`] if the raster cannot be read or does not lie on a projected map in metres.
pub fn read(path: &Path, stated: Option<VerticalDatum>, progress: &dyn Progress) -> Result<MapSurface, JobError> {
    let path = &surface_file(path);
    let mut dem = read_dem(path)?;
    let definition = dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone());
    let definition = definition.ok_or_else(|| MapSurfaceError::NoCrs { path: path.to_owned() })?;
    let projection = MapProjection::from_definition(&definition)
        .map_err(|source| MapSurfaceError::Crs { path: path.to_owned(), source })?;
    match projection.metres_per_unit() {
        Some(1.0) => {}
        unit => {
            let unit = unit.map_or("degrees".to_owned(), |metres| format!("units of {metres} m"));
            return Err(MapSurfaceError::NotInMetres { path: path.to_owned(), unit }.into());
        }
    }
    match stated.or(dem.vertical) {
        None => progress.warn(&format!(
            "the file does not name the vertical datum of its heights, so they are taken as above the ellipsoid: {}",
            path.display()
        )),
        Some(VerticalDatum::Ellipsoid) => {}
        Some(datum) => to_ellipsoid(&mut dem, &projection, datum)
            .map_err(|source| MapSurfaceError::Heights { path: path.to_owned(), source })?,
    }
    Ok(MapSurface { dem, projection })
}

/// Converts the heights row by row.
fn to_ellipsoid(dem: &mut Dem, projection: &MapProjection, datum: VerticalDatum) -> Result<(), CrsError> {
    let converter = HeightConverter::new(datum)?;
    let (width, transform) = (dem.heights.width(), dem.geotransform);
    for row in 0..dem.heights.height() {
        let columns: Vec<usize> = (0..width).filter(|&column| dem.heights[(column, row)].is_finite()).collect();
        let map = |&column: &usize| transform.map_from_cell(column as f64, row as f64);
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = columns.iter().map(map).unzip();
        let mut heights: Vec<f64> = columns.iter().map(|&column| f64::from(dem.heights[(column, row)])).collect();
        projection.lonlat_from_map_slices(&mut x, &mut y)?;
        converter.ellipsoid_from_datum_slices(&x, &y, &mut heights)?;
        columns.iter().zip(heights).for_each(|(&column, height)| dem.heights[(column, row)] = height as f32);
    }
    Ok(())
}
