//! Surface model, images with their cameras, and the grid of the ortho.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use camera::{ImageCorrection, RpcCamera};
use crs::{HeightConverter, MapProjection, VerticalDatum};
use io::raster::{Dem, ImageSource, read_dem};
use occlusion::{Eyeline, GridGround};
use raster::GeoTransform;

use super::Args;
use crate::progress::Log;
use jobs::corrections::Corrections;

/// Most cells of an ortho, and of all its bands.
const CELLS_MAX: usize = 1 << 28;
/// Most images: their numbers are bytes.
const IMAGES_MAX: usize = 255;

/// What an ortho is made from.
pub(super) struct Inputs {
    /// Heights above the ellipsoid.
    pub(super) dsm: Dem,
    /// Side of the surface model's cells, metres.
    pub(super) cell_m: f64,
    pub(super) epsg: u32,
    pub(super) images: Vec<Image>,
    pub(super) grid: OrthoGrid,
}

/// An image with its camera.
pub(super) struct Image {
    pub(super) source: ImageSource,
    pub(super) camera: RpcCamera,
    /// Whether a correction of the pointing was found.
    pub(super) corrected: bool,
    /// Over the cells of the surface model.
    pub(super) eyeline: Eyeline,
}

/// The cells of the ortho.
pub(super) struct OrthoGrid {
    pub(super) geotransform: GeoTransform,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) ground: GridGround,
    /// Whether the cells are those of the surface model.
    pub(super) is_dsm: bool,
}

impl Inputs {
    pub(super) fn open(args: &Args) -> anyhow::Result<Self> {
        ensure!(args.images.len() <= IMAGES_MAX, "{} images, at most {IMAGES_MAX} at a time", args.images.len());
        ensure!(args.tolerance >= 0.0, "--tolerance is {}, expected metres", args.tolerance);
        let path = if args.dsm.is_dir() { args.dsm.join("dsm/dsm.tif") } else { args.dsm.clone() };
        let mut dsm = read_dem(&path)?;
        let epsg = dsm
            .horizontal_epsg
            .with_context(|| format!("the surface model's coordinate system has no EPSG code: {}", path.display()))?;
        let projection = MapProjection::from_epsg(epsg)?;
        let metres = projection.metres_per_unit().with_context(|| {
            format!("the surface model is in degrees, expected a projected map: {}", path.display())
        })?;
        let (along_columns, along_rows) = dsm.geotransform.cell_size();
        let cell_m = metres * (along_columns * along_rows).sqrt();
        to_ellipsoid(&mut dsm, args.dsm_vertical, &projection, cell_m)?;
        let known: Vec<f64> = dsm.heights.data().iter().filter(|h| h.is_finite()).map(|&h| f64::from(h)).collect();
        ensure!(!known.is_empty(), "the surface model has no heights: {}", path.display());
        let middle_m = known.iter().sum::<f64>() / known.len() as f64;
        let grid = OrthoGrid::new(args, &dsm, &projection)?;
        let corrections = Corrections::for_surface(&args.dsm, &crate::corrections_of(args.corrections.as_deref()))?;
        let open = |path: &PathBuf| Image::open(path, &dsm, &projection, middle_m, &corrections);
        let images = args.images.iter().map(open).collect::<anyhow::Result<Vec<_>>>()?;
        let bands = images.first().map_or(0, |image| image.source.info().bands);
        if let Some(other) = images.iter().find(|image| image.source.info().bands != bands) {
            let found = other.source.info().bands;
            bail!("{found} bands, expected the {bands} of the first image: {}", other.source.path().display());
        }
        let cells = grid.width.saturating_mul(grid.height);
        ensure!(
            cells.saturating_mul(bands) <= CELLS_MAX,
            "{} x {} cells of {bands} bands, at most 2^28 in all: give --bounds or a larger --gsd",
            grid.width,
            grid.height
        );
        Ok(Self { dsm, cell_m, epsg, images, grid })
    }
}

fn to_ellipsoid(
    dsm: &mut Dem,
    asked: Option<VerticalDatum>,
    projection: &MapProjection,
    cell_m: f64,
) -> anyhow::Result<()> {
    let datum = asked.or(dsm.vertical).unwrap_or_else(|| {
        let path = dsm.path.display();
        tracing::warn!(
            "the file does not say what its heights are above, taken as the ellipsoid (--dsm-vertical): {path}"
        );
        VerticalDatum::Ellipsoid
    });
    if datum != VerticalDatum::Ellipsoid {
        let (from, to) = (HeightConverter::new(datum)?, HeightConverter::new(VerticalDatum::Ellipsoid)?);
        eval::convert_heights(&mut dsm.heights, &dsm.geotransform, cell_m, projection, &from, &to)?;
    }
    Ok(())
}

impl Image {
    fn open(
        path: &Path,
        dsm: &Dem,
        projection: &MapProjection,
        middle_m: f64,
        corrections: &Corrections,
    ) -> anyhow::Result<Self> {
        let source = ImageSource::open(path)?;
        let rpc = io::rpc::read_for_image(path)?.rpc;
        let correction = corrections.for_image(path, &Log);
        let corrected = correction != ImageCorrection::IDENTITY;
        let camera = RpcCamera { rpc, correction };
        let size = (dsm.heights.width(), dsm.heights.height());
        let eyeline = Eyeline::new(&camera, projection, &dsm.geotransform, size, middle_m)
            .with_context(|| format!("the image does not see the surface model: {}", path.display()))?;
        Ok(Self { source, camera, corrected, eyeline })
    }
}

impl OrthoGrid {
    fn new(args: &Args, dsm: &Dem, projection: &MapProjection) -> anyhow::Result<Self> {
        let (width, height) = (dsm.heights.width(), dsm.heights.height());
        if args.gsd.is_none() && args.bounds.is_none() {
            let ground = GridGround::new(projection, &dsm.geotransform, (width, height))?;
            return Ok(Self { geotransform: dsm.geotransform, width, height, ground, is_dsm: true });
        }
        let cell = args.gsd.unwrap_or_else(|| dsm.geotransform.cell_size().0);
        ensure!(cell > 0.0 && cell.is_finite(), "--gsd is {cell}, expected metres");
        let [x_min, y_min, x_max, y_max] = match args.bounds.as_deref() {
            Some(&[x_min, y_min, x_max, y_max]) => [x_min, y_min, x_max, y_max],
            _ => extent(&dsm.geotransform, width, height),
        };
        let count = |low: f64, high: f64| {
            let cells = ((high - low) / cell - 1e-6).ceil();
            ensure!(
                cells >= 1.0 && cells <= CELLS_MAX as f64,
                "from {low} to {high} there are {cells} cells of {cell} m, expected 1 to 2^28"
            );
            Ok(cells as usize)
        };
        let (columns, rows) = (count(x_min, x_max)?, count(y_min, y_max)?);
        let geotransform = GeoTransform::north_up(x_min, y_max, cell);
        let ground = GridGround::new(projection, &geotransform, (columns, rows))?;
        Ok(Self { geotransform, width: columns, height: rows, ground, is_dsm: false })
    }
}

/// Least and greatest x and y of a grid's corners.
fn extent(geotransform: &GeoTransform, width: usize, height: usize) -> [f64; 4] {
    let (w, h) = (width as f64 - 0.5, height as f64 - 0.5);
    let corners = [(-0.5, -0.5), (w, -0.5), (-0.5, h), (w, h)].map(|(c, r)| geotransform.map_from_cell(c, r));
    let fold = |pick: fn(&(f64, f64)) -> f64, best: fn(f64, f64) -> f64| {
        corners.iter().map(pick).reduce(best).unwrap_or_default()
    };
    [fold(|c| c.0, f64::min), fold(|c| c.1, f64::min), fold(|c| c.0, f64::max), fold(|c| c.1, f64::max)]
}
