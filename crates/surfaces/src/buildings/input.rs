//! Reads the image and finds out how large its pixels are and where they lie.

use std::path::Path;

use camera::{ImagePoint, Rpc, RpcCamera};
use crs::{Crs, MapProjection};
use formats::raster::{ImageSource, Provenance, iso_time, read_dem_window};
use formats::rpc::RpcReadError;
use raster::{GeoTransform, Grid, Window};

use super::config::BuildingMapConfig;
use super::error::BuildingMapError;

/// Most pixels of an image: about 60 bytes of each are held in memory.
const PIXELS_MAX: usize = 1 << 28;

/// Where the pixels of an image lie.
pub(super) enum Place {
    /// Where an RPC says.
    Rpc(Box<Rpc>),
    /// On a map in metres or feet.
    Map(GeoTransform, Crs),
    /// Nothing says it.
    Unknown,
}

/// An image to look for buildings in.
pub(super) struct Input {
    /// Grey values; NaN where the image has none.
    pub(super) values: Grid<f32>,
    pub(super) place: Place,
    /// Side of a pixel on the ground, metres.
    pub(super) gsd_m: f64,
    pub(super) provenance: Provenance,
}

impl Input {
    /// Reads the image of a configuration.
    pub(super) fn read(config: &BuildingMapConfig) -> Result<Self, BuildingMapError> {
        let path = config.image.as_path();
        let source = ImageSource::open(path)?;
        let (width, height) = (source.info().width, source.info().height);
        if width.saturating_mul(height) > PIXELS_MAX {
            return Err(BuildingMapError::TooLarge { path: path.to_owned(), width, height });
        }
        let (place, found_m) = place(path, &source)?;
        let gsd_m = config.gsd_m.or(found_m).ok_or_else(|| BuildingMapError::NoScale { path: path.to_owned() })?;
        let values = source.read_luma(source.window())?.luma;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let acquired = source.acquired_s().and_then(iso_time).into_iter().collect();
        Ok(Self { values, place, gsd_m, provenance: Provenance { sources: vec![name], acquired } })
    }
}

/// Returns where an image lies, and the side of its pixels in metres where that is known. A map is
/// preferred, because an image that was laid on one may still carry its RPC.
fn place(path: &Path, source: &ImageSource) -> Result<(Place, Option<f64>), BuildingMapError> {
    let info = source.info();
    if info.geotransform.is_some() && info.crs_wkt.is_some() {
        let corner = read_dem_window(path, Window::whole(1, 1))?;
        if let Some(horizontal) = corner.horizontal_epsg {
            let metres = MapProjection::from_epsg(horizontal)?.metres_per_unit();
            let (along, across) = corner.geotransform.cell_size();
            let place = Place::Map(corner.geotransform, Crs::ellipsoidal(horizontal));
            return Ok((place, metres.map(|metres| metres * (along * across).sqrt())));
        }
    }
    let rpc = match formats::rpc::read_for_image(path) {
        Ok(read) => read.rpc,
        Err(RpcReadError::NotRpc { .. }) => return Ok((Place::Unknown, None)),
        Err(other) => return Err(other.into()),
    };
    let middle = ImagePoint { sample: info.width as f64 / 2.0, line: info.height as f64 / 2.0 };
    let camera = RpcCamera::new(rpc);
    let gsd = camera
        .gsd_at(middle, camera.rpc.height_off)
        .map_err(|source| BuildingMapError::Scale { path: path.to_owned(), source })?;
    Ok((Place::Rpc(Box::new(camera.rpc)), Some(gsd.mean_m())))
}
