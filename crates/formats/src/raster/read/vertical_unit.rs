//! Heights in the unit of their vertical CRS: metres inside of this program, feet in files whose
//! CRS is in feet.

use crs::VerticalDatum;
use gdal::raster::Buffer;
use gdal::{Dataset, Metadata};

use crate::raster::access::gdal_setup::with_gdal;

/// Ending of the names of bands in metres, and its replacements.
const METRES: &str = "_m";
const FEET: &str = "_ft";
const US_SURVEY_FEET: &str = "_ft_us";
/// Length of an international foot, metres. A US survey foot is 2 millionths longer.
const FOOT_M: f64 = 0.3048;
/// Rows that are converted at a time.
const ROWS: usize = 256;

/// Turns the bands in metres of a dataset of heights into the unit of the vertical CRS, and renames
/// them.
///
/// # Errors
/// The message of GDAL or PROJ.
pub(in crate::raster) fn to_vertical_unit(dataset: &Dataset, datum: VerticalDatum) -> Result<(), String> {
    let metres = datum.metres_per_unit().map_err(|error| error.to_string())?;
    if metres == 1.0 {
        return Ok(());
    }
    let ending = if metres == FOOT_M { FEET } else { US_SURVEY_FEET };
    with_gdal(|| {
        let (width, height) = dataset.raster_size();
        for index in 1..=dataset.raster_count() {
            let mut band = dataset.rasterband(index)?;
            let description = band.description()?;
            let Some(stem) = description.strip_suffix(METRES) else { continue };
            band.set_description(&format!("{stem}{ending}"))?;
            let void = band.no_data_value().map(|value| value as f32);
            for top in (0..height).step_by(ROWS) {
                let size = (width, ROWS.min(height - top));
                let (_, mut cells) = band.read_as::<f32>((0, top as isize), size, size, None)?.into_shape_and_vec();
                for cell in cells.iter_mut().filter(|cell| Some(**cell) != void) {
                    *cell = (f64::from(*cell) / metres) as f32;
                }
                band.write((0, top as isize), size, &mut Buffer::new(size, cells))?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use crs::Crs;
    use raster::{GeoTransform, Grid};

    use super::*;
    use crate::raster::{Band, BandData, CogRaster, read_dem, write_cog};

    /// NAVD 88 in US survey feet and in international feet, on a map in US survey feet.
    #[test]
    fn heights_are_in_feet_in_the_file_and_in_metres_when_read() {
        let folder = tempfile::tempdir().unwrap();
        let heights = Grid::from_vec(3, 1, vec![12.5f32, f32::NAN, -3.25]).unwrap();
        let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
        let place = GeoTransform::north_up(450_000.0, 2_180_000.0, 1.5);
        for (code, metres, unit) in [(6360, 1200.0 / 3937.0, "US survey foot"), (8228, 0.3048, "ft")] {
            let path = folder.path().join(format!("{code}.tif"));
            let crs = Crs { horizontal: 2236, vertical: VerticalDatum::Epsg(code) };
            write_cog(&path, &CogRaster::new(&bands, place, crs), false).unwrap();
            let written = Dataset::open(&path).unwrap();
            let band = written.rasterband(1).unwrap();
            let cells = band.read_as::<f32>((0, 0), (3, 1), (3, 1), None).unwrap();
            assert!((f64::from(cells.data()[0]) - 12.5 / metres).abs() < 1e-4, "{code}");
            assert_eq!((cells.data()[1], band.unit().as_str()), (-32768.0, unit));
            let dem = read_dem(&path).unwrap();
            assert_eq!(dem.vertical, Some(VerticalDatum::Epsg(code)));
            let error = dem.heights.data().iter().zip(heights.data()).map(|(a, b)| (a - b).abs());
            assert!(error.filter(|e| e.is_finite()).all(|e| e < 1e-3) && dem.heights[(1, 0)].is_nan());
        }
    }
}
