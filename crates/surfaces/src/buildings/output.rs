//! Writes a building index in the pixels of its image or on a surface model.

use std::path::Path;

use formats::raster::{Band, BandData, CogRaster, write_cog, write_map, write_map_with_rpc};
use numeric::Progress;
use raster::{GeoTransform, Grid, NO_DATA};

use super::config::BuildingMapConfig;
use super::error::BuildingMapError;
use super::input::{Input, Place};
use crate::map_crs::MapCrs;
use crate::ortho::{self, OrthoSurface};
use job::corrections::Corrections;
use job::files::FileError;
use job::run_folder::surface_file;
use job::threads;

/// Name of the band.
const BAND: &str = "building_index";

/// An index on a grid.
pub(super) struct Placed {
    pub(super) index: Grid<f32>,
    /// Geotransform and CRS of the surface model that it lies on.
    map: Option<(GeoTransform, MapCrs)>,
}

impl Placed {
    /// An index in the pixels of its image.
    pub(super) fn in_image(index: Grid<f32>) -> Self {
        Self { index, map: None }
    }

    /// Lays an index on a surface model, as an ortho.
    pub(super) fn on_surface(
        index: &Grid<f32>,
        surface: &Path,
        config: &BuildingMapConfig,
        progress: &dyn Progress,
    ) -> Result<Self, BuildingMapError> {
        let camera = Corrections::for_surface(surface, &config.corrections)?.camera(&config.image, progress)?;
        let ground = OrthoSurface::read(&surface_file(surface), config.surface_vertical, progress)?;
        let image = ground.image(&config.image, index, camera)?;
        let mut laid = ortho::lay(&ground, image, progress)?.bands.swap_remove(0);
        // Interpolation overshoots at steps.
        laid.data_mut().iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        Ok(Self { index: laid, map: Some((ground.dsm.geotransform, ground.map)) })
    }

    /// Writes the index.
    pub(super) fn write(&self, config: &BuildingMapConfig, input: &Input) -> Result<(), BuildingMapError> {
        let bands = [Band { description: BAND, data: BandData::F32(&self.index) }];
        let (path, overwrite, no_data) = (&config.output, config.overwrite, Some(f64::from(NO_DATA)));
        let on_map = |geotransform: &GeoTransform, crs| {
            let plain = CogRaster::new(&bands, *geotransform, crs);
            let threads = threads::count(config.threads);
            let raster = CogRaster { threads, holds_heights: false, provenance: Some(&input.provenance), ..plain };
            write_cog(path, &raster, overwrite)
        };
        match (&self.map, &input.place) {
            (Some((geotransform, map)), _) => on_map(geotransform, map.ellipsoidal()),
            (None, Place::Map(geotransform, crs)) => on_map(geotransform, (*crs).into()),
            (None, Place::Rpc(rpc)) => write_map_with_rpc(path, &bands, rpc, no_data, &input.provenance, overwrite),
            (None, Place::Unknown) => {
                let items = input.provenance.items();
                let items: Vec<(&str, &str)> = items.iter().map(|(key, value)| (*key, value.as_str())).collect();
                write_map(path, &bands, no_data, &items, overwrite)
            }
        }
        .map_err(|error| FileError::from(error).into())
    }
}
