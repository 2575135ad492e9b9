//! Two surface models and their classes, read and brought to one vertical datum.
//!
//! What a file leaves open is decided here, and every decision that could be wrong is noted for the output.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use eval::{CellMap, MetresFromCells, convert_heights, nearest};
use geodesy::{CrsIdentity, HeightConverter, MapProjection, VerticalDatum, meridian_radius_m, prime_vertical_radius_m};
use io::raster::{Dem, ImageSource, read_dem};
use raster::{GeoTransform, Grid};

use super::Args;

/// Cells beyond the search radius for which the map between the grids must hold.
const MARGIN_CELLS: f64 = 4.0;
/// Most cells of a class raster.
const CELLS_MAX: usize = 1 << 30;

/// What is compared.
pub(super) struct Inputs {
    pub(super) test: Dem,
    pub(super) reference: Dem,
    pub(super) test_from_reference: CellMap,
    pub(super) metres_from_cells: MetresFromCells,
    /// On the reference grid.
    pub(super) classes: Option<Grid<Option<i32>>>,
    /// The datum of both, in words.
    pub(super) vertical: String,
    /// Decisions and doubts.
    pub(super) notes: Vec<String>,
}

impl Inputs {
    pub(super) fn read(args: &Args) -> anyhow::Result<Self> {
        let (mut test, reference) = (read_dem(&args.test)?, read_dem(&args.reference)?);
        let mut notes = Vec::new();
        for dem in [&test, &reference] {
            if dem.crs_wkt.is_none() {
                notes.push(format!("no coordinate system, taken as that of the other file: {}", dem.path.display()));
            }
        }
        let metres_from_cells = MetresFromCells::new(&reference.geotransform, metres_per_unit(&reference)?);
        let (along_columns, along_rows) = metres_from_cells.cell_size_m();
        let margin = args.search_m / along_columns.min(along_rows) + MARGIN_CELLS;
        // A radius that is too wide, or no number, is refused by the search itself.
        let margin = if margin.is_finite() { margin.clamp(MARGIN_CELLS, 1e4) as usize } else { 0 };
        let test_from_reference = cell_map(&reference, &test.geotransform, definition(&test), margin)?;
        let stated =
            Stated { test: args.test_vertical.or(test.vertical), reference: args.ref_vertical.or(reference.vertical) };
        let vertical = stated.reconcile(&mut test, &mut notes)?;
        let classes = args.classes.as_deref().map(|path| classes(path, &reference, &mut notes)).transpose()?;
        Ok(Self { test, reference, test_from_reference, metres_from_cells, classes, vertical, notes })
    }
}

/// The name of a file's CRS for PROJ; `None` where it has none.
fn definition(dem: &Dem) -> Option<String> {
    dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone())
}

fn projection(definition: &str, path: &Path) -> anyhow::Result<MapProjection> {
    MapProjection::from_definition(definition).with_context(|| format!("its coordinate system: {}", path.display()))
}

/// Metres per map unit of the reference along x and y, at its middle.
fn metres_per_unit(dem: &Dem) -> anyhow::Result<(f64, f64)> {
    let Some(definition) = definition(dem) else { return Ok((1.0, 1.0)) };
    if let Some(metres) = projection(&definition, &dem.path)?.metres_per_unit() {
        return Ok((metres, metres));
    }
    let (column, row) = (dem.heights.width() as f64 / 2.0, dem.heights.height() as f64 / 2.0);
    let lat = dem.geotransform.map_from_cell(column, row).1;
    let per_degree = 1.0_f64.to_radians();
    let (east, north) = (prime_vertical_radius_m(lat) * lat.to_radians().cos(), meridian_radius_m(lat));
    Ok((east * per_degree, north * per_degree))
}

/// The map from the cells of the reference to those of a grid with a CRS of its own (or, without, that of the reference).
fn cell_map(
    reference: &Dem,
    other: &GeoTransform,
    other_crs: Option<String>,
    margin: usize,
) -> anyhow::Result<CellMap> {
    let (from, to) = match (definition(reference), other_crs) {
        (Some(from), Some(to)) if from != to => (from, to),
        _ => return Ok(CellMap::affine(&reference.geotransform, other)?),
    };
    let (from, to) = (projection(&from, &reference.path)?, MapProjection::from_definition(&to)?);
    let size = (reference.heights.width(), reference.heights.height());
    let project = |x, y| {
        let (lon, lat) = from.lonlat_from_map(x, y).ok()?;
        let point = to.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    };
    Ok(CellMap::projected(&reference.geotransform, other, size, margin, project)?)
}

/// What the heights of the two are above, as far as files and options say.
struct Stated {
    test: Option<VerticalDatum>,
    reference: Option<VerticalDatum>,
}

impl Stated {
    /// Brings the test heights to the reference's datum; says in words which that is.
    fn reconcile(&self, test: &mut Dem, notes: &mut Vec<String>) -> anyhow::Result<String> {
        let (test_datum, reference_datum) = match (self.test, self.reference) {
            (None, None) => {
                notes.push("neither file says what its heights are above: taken as the same".into());
                return Ok("not stated".into());
            }
            (Some(test), Some(reference)) => (test, reference),
            (Some(VerticalDatum::Ellipsoid), None) => {
                notes.push(
                    "the reference does not say what its heights are above: taken as the ellipsoid, as the test's"
                        .into(),
                );
                (VerticalDatum::Ellipsoid, VerticalDatum::Ellipsoid)
            }
            (None, Some(VerticalDatum::Ellipsoid)) => {
                notes.push(
                    "the test does not say what its heights are above: taken as the ellipsoid, as the reference's"
                        .into(),
                );
                (VerticalDatum::Ellipsoid, VerticalDatum::Ellipsoid)
            }
            (Some(datum), None) => bail!(
                "the test's heights are above {datum}, the reference does not say what its own are above: give --ref-vertical"
            ),
            (None, Some(datum)) => bail!(
                "the reference's heights are above {datum}, the test does not say what its own are above: give --test-vertical"
            ),
        };
        if test_datum != reference_datum {
            convert(test, test_datum, reference_datum)?;
            notes.push(format!("the test's heights were converted from {test_datum} to {reference_datum}"));
        }
        Ok(reference_datum.to_string())
    }
}

fn convert(test: &mut Dem, from: VerticalDatum, to: VerticalDatum) -> anyhow::Result<()> {
    let definition = definition(test).with_context(|| {
        format!(
            "heights can be converted from {from} to {to} only in a known coordinate system, there is none: {}",
            test.path.display()
        )
    })?;
    let (along_columns, along_rows) = MetresFromCells::new(&test.geotransform, metres_per_unit(test)?).cell_size_m();
    let projection = projection(&definition, &test.path)?;
    let (from, to) = (HeightConverter::new(from)?, HeightConverter::new(to)?);
    let cell_m = along_columns.max(along_rows);
    Ok(convert_heights(&mut test.heights, &test.geotransform, cell_m, &projection, &from, &to)?)
}

/// The class of each reference cell.
fn classes(path: &Path, reference: &Dem, notes: &mut Vec<String>) -> anyhow::Result<Grid<Option<i32>>> {
    let source = ImageSource::open(path)?;
    let info = source.info();
    ensure!(info.bands == 1, "{} bands, expected the one of a class raster: {}", info.bands, path.display());
    let cells = info.width.saturating_mul(info.height);
    ensure!(cells <= CELLS_MAX, "{cells} cells, at most 2^30 are read as classes: {}", path.display());
    let own = whole_numbers(&source.read_luma(source.window())?.luma, path)?;
    let (width, height) = (reference.heights.width(), reference.heights.height());
    let Some(geotransform) = info.geotransform else {
        ensure!(
            (own.width(), own.height()) == (width, height),
            "the class raster has no georeference and {} x {} cells, the reference {width} x {height}: give one that names \
             its position: {}",
            own.width(),
            own.height(),
            path.display()
        );
        notes.push(
            "the class raster has no georeference: taken as on the grid of the reference, which has its size".into(),
        );
        return Ok(own);
    };
    let crs = info.crs_wkt.as_deref().map(|wkt| {
        Ok::<_, anyhow::Error>(match CrsIdentity::of(wkt)?.horizontal {
            Some(code) => format!("EPSG:{code}"),
            None => wkt.to_owned(),
        })
    });
    let map = cell_map(reference, &geotransform, crs.transpose()?, 0)?;
    let mut on_reference = Grid::filled(width, height, None);
    for row in 0..height {
        for (column, class) in on_reference.row_mut(row).iter_mut().enumerate() {
            let (x, y) = map.position(column as f64, row as f64);
            *class = nearest(&own, x, y).flatten();
        }
    }
    Ok(on_reference)
}

fn whole_numbers(values: &Grid<f32>, path: &Path) -> anyhow::Result<Grid<Option<i32>>> {
    let class = |&value: &f32| (value.is_finite() && value.fract() == 0.0).then_some(value as i32);
    if let Some(odd) = values.data().iter().find(|v| v.is_finite() && class(v).is_none()) {
        bail!("the class raster holds {odd}, expected whole numbers: {}", path.display());
    }
    Ok(values.map(class))
}
