//! Photographs of a model for a page: small, and as a pinhole sees them.
//!
//! The colour of a pixel is that of the nearest pixel of the reduced photograph where the lens sees
//! the pinhole's ray; it is transparent where there is none.

use std::path::PathBuf;

use camera::{ImagePoint, Lens, LensModel};
use formats::raster::ImageSource;
use raster::Grid;
use report::png_with_alpha;

use super::error::AlignJobError;

/// Longest side of a photograph, pixels.
const SIDE_MAX: usize = 1024;

/// The folder of the photographs.
pub(super) struct Photographs(PathBuf);

impl Photographs {
    pub(super) fn new(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// The file of a view. Names that lead out of the folder are refused where models are read.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Returns a photograph as PNG.
    pub(super) fn png(&self, name: &str, lens: &Lens) -> Result<Vec<u8>, AlignJobError> {
        let path = self.path(name);
        let source = ImageSource::open(&path)?;
        let factor = (lens.width().max(lens.height()) as f64 / SIDE_MAX as f64).max(1.0);
        let side = |full: usize| ((full as f64 / factor).round() as usize).max(1);
        let size = (side(lens.width()), side(lens.height()));
        let count = source.info().bands;
        let read = |band: usize| source.read_reduced(if count >= 3 { band } else { 1 }, source.window(), size);
        let bands = [read(1)?, read(2)?, read(3)?];
        let values = bands.iter().flat_map(|band| band.data()).copied().filter(|value| value.is_finite());
        let white = if values.fold(0.0f32, f32::max) > 255.0 { 65_535.0 } else { 255.0 };
        let colour = |column: usize, row: usize| {
            let of = |band: &Grid<f32>| (255.0 * band[(column, row)] / white).clamp(0.0, 255.0).round() as u8;
            [of(&bands[0]), of(&bands[1]), of(&bands[2]), 255]
        };
        let place = |column: usize, row: usize| -> Option<(usize, usize)> {
            let full = |at: usize, small: usize, large: usize| (at as f64 + 0.5) * large as f64 / small as f64 - 0.5;
            let pixel =
                ImagePoint { sample: full(column, size.0, lens.width()), line: full(row, size.1, lens.height()) };
            let found = seen(lens, pixel)?;
            let back = |at: f64, small: usize, large: usize| ((at + 0.5) * small as f64 / large as f64).floor();
            let (x, y) = (back(found.sample, size.0, lens.width()), back(found.line, size.1, lens.height()));
            let inside = x >= 0.0 && y >= 0.0 && x < size.0 as f64 && y < size.1 as f64;
            inside.then_some((x as usize, y as usize))
        };
        let is_pinhole = lens.model().is_pinhole();
        let mut picture = Grid::filled(size.0, size.1, [0u8; 4]);
        for row in 0..size.1 {
            for column in 0..size.0 {
                let at = if is_pinhole { Some((column, row)) } else { place(column, row) };
                if let Some((x, y)) = at {
                    picture[(column, row)] = colour(x, y);
                }
            }
        }
        png_with_alpha(&picture).map_err(|error| AlignJobError::Photograph { path, reason: error.to_string() })
    }
}

/// Returns where the photograph of a lens shows what a pinhole of the same focal length and
/// principal point sees at a pixel.
fn seen(lens: &Lens, pixel: ImagePoint) -> Option<ImagePoint> {
    let ([fx, fy], centre) = (lens.focal_px(), lens.principal_point());
    let parameters = [fx, fy, centre.sample, centre.line];
    let pinhole = Lens::new(lens.width(), lens.height(), LensModel::Pinhole, &parameters).ok()?;
    let [x, y] = pinhole.direction(pixel)?;
    lens.project(x, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose red is the column and whose green is the row.
    fn shown(lens: &Lens, [width, height]: [u32; 2]) -> image::RgbaImage {
        let folder = tempfile::tempdir().unwrap();
        let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 255]));
        picture.save(folder.path().join("a.png")).unwrap();
        let png = Photographs::new(folder.path().to_owned()).png("a.png", lens).unwrap();
        image::load_from_memory(&png).unwrap().to_rgba8()
    }

    #[test]
    fn a_pinhole_shows_its_photograph_and_a_lens_what_a_pinhole_sees() {
        let pinhole = Lens::new(200, 150, LensModel::Pinhole, &[180.0, 180.0, 99.5, 74.5]).unwrap();
        let plain = shown(&pinhole, [200, 150]);
        assert!(plain.enumerate_pixels().all(|(x, y, p)| p.0 == [x as u8, y as u8, 255, 255]));
        let lens = Lens::new(200, 150, LensModel::SimpleRadial, &[180.0, 99.5, 74.5, 0.3]).unwrap();
        let straight = shown(&lens, [200, 150]);
        let (mut inside, mut outside) = (0, 0);
        for (x, y, pixel) in straight.enumerate_pixels() {
            let [u, v] = pinhole.direction(ImagePoint { sample: f64::from(x), line: f64::from(y) }).unwrap();
            let at = lens.project(u, v).unwrap();
            if pixel.0[3] == 0 {
                outside += 1;
                assert!(at.sample < 0.0 || at.line < 0.0 || at.sample > 199.0 || at.line > 149.0, "{x} {y}");
            } else {
                inside += 1;
                let off = (f64::from(pixel.0[0]) - at.sample).abs().max((f64::from(pixel.0[1]) - at.line).abs());
                assert!(off <= 0.51, "{x} {y}: {off}");
            }
        }
        assert!(inside > 20_000 && outside > 100, "{inside} {outside}");
    }

    #[test]
    fn a_large_photograph_is_shown_small() {
        let lens = Lens::new(4000, 3000, LensModel::Pinhole, &[3000.0, 3000.0, 2000.0, 1500.0]).unwrap();
        let small = shown(&lens, [400, 300]);
        assert_eq!((small.width(), small.height()), (1024, 768), "stretched to the shape of its camera");
    }
}
