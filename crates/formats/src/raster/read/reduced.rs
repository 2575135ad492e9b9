//! Reading for display: a window at a reduced size, and what the file says of a band.
//!
//! GDAL reads from the overview that fits the size, so that a large raster with overviews is shown
//! without being read whole. A cell of the result has the value of one cell of that overview.

use gdal::Metadata;
use gdal::raster::{GdalType, RasterBand};
use raster::{Grid, Window};

use super::source::ImageSource;
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;

/// What a file says of one of its bands.
#[derive(Debug, Clone, PartialEq)]
pub struct BandLabel {
    /// Description; empty when the file has none.
    pub description: String,
    /// Unit of the values; empty when the file has none.
    pub unit: String,
    /// Number of overviews.
    pub overviews: usize,
}

impl ImageSource {
    /// Returns what the file says of a band, counted from 1.
    ///
    /// # Errors
    /// [`RasterError::Damaged`] for a band that the file does not have.
    pub fn band_label(&self, band: usize) -> Result<BandLabel, RasterError> {
        with_gdal(|| {
            let band = self.dataset().rasterband(band)?;
            let overviews = band.overview_count().map_or(0, |count| usize::try_from(count).unwrap_or(0));
            Ok(BandLabel { description: band.description().unwrap_or_default(), unit: band.unit(), overviews })
        })
        .map_err(|reason| RasterError::damaged(self.path(), reason))
    }

    /// Returns the most cells that are decoded for any picture of at most `side` × `side` cells of
    /// a band, counted from 1. Blocks are decoded whole, and those between the cells of a picture
    /// are passed over.
    ///
    /// # Errors
    /// [`RasterError::Damaged`] for a band that the file does not have.
    pub fn cells_of_picture(&self, band: usize, side: usize) -> Result<u64, RasterError> {
        let levels = with_gdal(|| {
            let band = self.dataset().rasterband(band)?;
            let mut levels = vec![(band.size(), band.block_size())];
            for index in 0..band.overview_count()? {
                let overview = band.overview(index as usize)?;
                levels.push((overview.size(), overview.block_size()));
            }
            Ok(levels)
        });
        let mut levels = levels.map_err(|reason| RasterError::damaged(self.path(), reason))?;
        levels.sort_by_key(|((width, height), _)| std::cmp::Reverse(width.saturating_mul(*height)));
        let one = |length: usize, block: usize, next: Option<usize>| {
            // A picture is read from the level that is just finer than itself.
            let step = next.map_or(length, |next| length.div_ceil(next.max(1)));
            let covered = length.min(side.saturating_mul(step));
            let blocks = (covered.div_ceil(block.max(1)) + 1).min(length.div_ceil(block.max(1))).min(side);
            blocks as u64 * block as u64
        };
        let cells = levels.iter().enumerate().map(|(i, ((width, height), block))| {
            let next = levels.get(i + 1).map(|(size, _)| *size);
            one(*width, block.0, next.map(|size| size.0)).saturating_mul(one(*height, block.1, next.map(|size| size.1)))
        });
        Ok(cells.max().unwrap_or(0))
    }

    /// Reads the part of a window that lies inside the image, in `size` columns and rows, with the
    /// scale and the offset of the band applied. NaN marks no-data. Bands are counted from 1.
    ///
    /// # Errors
    /// [`RasterError::Unsupported`] for a window outside of the image or a size of 0;
    /// [`RasterError::Damaged`] when GDAL cannot decode the cells, and for a band that the file
    /// does not have.
    pub fn read_reduced(&self, band: usize, window: Window, size: (usize, usize)) -> Result<Grid<f32>, RasterError> {
        let inside = self.window().intersection(&window).filter(|_| size.0 > 0 && size.1 > 0).ok_or_else(|| {
            let found = format!("{size:?} cells of the window {window:?}");
            RasterError::Unsupported { path: self.path().to_owned(), found, expected: "cells inside the image" }
        })?;
        let damaged = |reason: String| RasterError::damaged(self.path(), reason);
        let (values, mask, scale, offset) = with_gdal(|| {
            let band = self.dataset().rasterband(band)?;
            let values: Vec<f32> = read(&band, inside, size)?;
            let mask: Option<Vec<u8>> = match band.mask_flags()?.is_all_valid() {
                true => None,
                false => Some(read(&band.open_mask_band()?, inside, size)?),
            };
            Ok((values, mask, band.scale().unwrap_or(1.0), band.offset().unwrap_or(0.0)))
        })
        .map_err(damaged)?;
        let value = |(i, value): (usize, f32)| {
            let is_void = mask.as_ref().is_some_and(|mask| mask.get(i) == Some(&0));
            match is_void || !value.is_finite() {
                true => f32::NAN,
                false if scale == 1.0 && offset == 0.0 => value,
                false => (f64::from(value) * scale + offset) as f32,
            }
        };
        Grid::from_vec(size.0, size.1, values.into_iter().enumerate().map(value).collect())
            .ok_or_else(|| damaged("GDAL returned another number of pixels than requested".to_owned()))
    }
}

fn read<T: Copy + GdalType>(
    band: &RasterBand<'_>,
    inside: Window,
    size: (usize, usize),
) -> Result<Vec<T>, gdal::errors::GdalError> {
    let at = (inside.x as isize, inside.y as isize);
    Ok(band.read_as::<T>(at, (inside.width, inside.height), size, None)?.into_shape_and_vec().1)
}

#[cfg(test)]
mod tests {
    use crs::Crs;
    use raster::GeoTransform;

    use super::*;
    use crate::raster::{Band, BandData, CogRaster, write_cog};

    #[test]
    fn a_window_is_read_whole_or_reduced_with_its_voids() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let side = 1100;
        let value = |i: usize| if i % side < 200 { f32::NAN } else { (i / side) as f32 };
        let heights = Grid::from_vec(side, side, (0..side * side).map(value).collect()).unwrap();
        let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
        let place = GeoTransform::north_up(436_000.0, 3_358_000.0, 0.5);
        write_cog(&path, &CogRaster::new(&bands, place, Crs::ellipsoidal(32617)), false).unwrap();
        let source = ImageSource::open(&path).unwrap();
        let label = source.band_label(1).unwrap();
        assert_eq!((label.description.as_str(), label.overviews > 0), ("height_m", true));
        assert!(source.band_label(2).is_err() && source.band_label(0).is_err());
        // Pictures of 16 cells are at most so large on the overview, or lie in two tiles each way.
        let cells = source.cells_of_picture(1, 16).unwrap();
        assert!((16 * 16..=4 * 512 * 512).contains(&cells), "{cells}");
        assert!(
            source.cells_of_picture(1, 2000).unwrap() >= (side * side) as u64 && source.cells_of_picture(2, 9).is_err()
        );

        let window = Window { x: 150, y: 40, width: 100, height: 60 };
        let same = |a: &Grid<f32>, b: &Grid<f32>| {
            a.data().iter().zip(b.data()).all(|(a, b)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()))
        };
        assert!(same(&source.read_reduced(1, window, (100, 60)).unwrap(), &heights.window(window, f32::NAN)));
        let small = source.read_reduced(1, Window::whole(side, side), (11, 11)).unwrap();
        assert!(small.row(5)[..2].iter().all(|v| v.is_nan()) && (small[(6, 5)] - 550.0).abs() < 60.0);
        let outside = Window { x: 5000, y: 0, width: 9, height: 9 };
        assert!(source.read_reduced(1, outside, (9, 9)).is_err() && source.read_reduced(1, window, (0, 4)).is_err());
    }
}
