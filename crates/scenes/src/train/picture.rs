//! A photograph as a training takes it: its colours, NaN where they do not count, as a pinhole sees
//! them.
//!
//! Masks lie in one folder, one for each photograph: `NAME.jpg.png` as COLMAP names them, or
//! `NAME.png`, in the folder of the name or without it. Their pixels are 0 where the photograph
//! does not count, such as on the sky, vehicles or the camera's mount.
//!
//! A lens with distortion is laid over a pinhole of the same size, focal length and principal
//! point, which keeps the scale at the centre. The colour at a pixel is interpolated linearly
//! between the four around its place in the photograph; it is NaN where one of these does not count
//! or is outside.

use std::path::{Path, PathBuf};

use camera::{ImagePoint, Lens, LensModel};
use formats::colmap::ColmapView;
use formats::raster::ImageSource;
use raster::Grid;
use rayon::prelude::*;

use super::error::TrainError;

/// Distance between a pixel and where the lens projects its ray that shows a place beyond the fold
/// of a distortion, in focal lengths: far more than rounding, far less than a pixel.
const FOLD: f64 = 1e-6;

/// Where the pixels of a pinhole are in the photograph of a lens with distortion.
#[derive(Debug, Clone)]
pub(super) struct Undistortion {
    /// The pinhole.
    pub(super) lens: Lens,
    /// Column and row in the photograph; NaN where there is none.
    places: Grid<[f32; 2]>,
}

impl Undistortion {
    /// Returns nothing for a pinhole, which needs none.
    pub(super) fn new(lens: &Lens) -> Option<Self> {
        if lens.model().is_pinhole() {
            return None;
        }
        let ([fx, fy], centre) = (lens.focal_px(), lens.principal_point());
        let (width, height) = (lens.width(), lens.height());
        let pinhole = Lens::new(width, height, LensModel::Pinhole, &[fx, fy, centre.sample, centre.line]).ok()?;
        let place = |pixel: usize| {
            let at = ImagePoint { sample: (pixel % width) as f64, line: (pixel / width) as f64 };
            let [x, y] = pinhole.direction(at)?;
            let found = lens.project(x, y)?;
            let [bx, by] = lens.direction(found)?;
            let returns = (bx - x).hypot(by - y) < FOLD * (1.0 + x.hypot(y));
            returns.then_some([found.sample as f32, found.line as f32])
        };
        let places = (0..width * height).into_par_iter().map(|pixel| place(pixel).unwrap_or([f32::NAN; 2])).collect();
        Some(Self { lens: pinhole, places: Grid::from_vec(width, height, places)? })
    }

    /// Returns the nearest pixel of the photograph at a pixel of the pinhole.
    pub(super) fn nearest(&self, pixel: usize) -> Option<usize> {
        let [x, y] = self.places.data()[pixel].map(f32::round);
        let (width, height) = (self.places.width(), self.places.height());
        let inside = x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
        inside.then_some(y as usize * width + x as usize)
    }

    /// Returns the photograph as the pinhole sees it.
    fn apply(&self, picture: &Grid<[f32; 3]>) -> Grid<[f32; 3]> {
        let last = [picture.width() as f32 - 1.0, picture.height() as f32 - 1.0];
        self.places.map(|&[x, y]| {
            if !(x >= 0.0 && y >= 0.0 && x <= last[0] && y <= last[1]) {
                return [f32::NAN; 3];
            }
            let (column, row) = (x.floor(), y.floor());
            let (right, below) = (x - column, y - row);
            let (column, row) = (column as usize, row as usize);
            let next = [(column + 1).min(picture.width() - 1), (row + 1).min(picture.height() - 1)];
            let corners = [
                picture[(column, row)],
                picture[(next[0], row)],
                picture[(column, next[1])],
                picture[(next[0], next[1])],
            ];
            [0, 1, 2].map(|c| {
                let [a, b, d, e] = corners.map(|corner| corner[c]);
                (a * (1.0 - right) + b * right) * (1.0 - below) + (d * (1.0 - right) + e * right) * below
            })
        })
    }
}

/// What a mask leaves of a photograph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Left {
    /// Pixels of the photograph.
    pub(super) pixels: usize,
    /// Pixels that count.
    pub(super) kept: usize,
}

/// Reads the colours of a photograph, 0 to 1, as its pinhole sees them, and what its mask leaves.
pub(super) fn read(
    path: &Path,
    view: &ColmapView,
    lens: &Lens,
    undistortion: Option<&Undistortion>,
    masks: Option<&Path>,
) -> Result<(Grid<[f32; 3]>, Left), TrainError> {
    let source = ImageSource::open(path)?;
    let mut pixels = source.read_colour(source.window())?;
    let (found, expected) = ([pixels.width(), pixels.height()], [lens.width(), lens.height()]);
    if found != expected {
        return Err(TrainError::Size { what: "the image", path: path.to_owned(), found, expected });
    }
    let brightest = pixels.data().iter().flatten().copied().fold(0.0f32, f32::max);
    let white = if brightest > 255.0 { 65_535.0 } else { 255.0 };
    pixels.data_mut().iter_mut().flatten().for_each(|value| *value /= white);
    let mut left = Left { pixels: pixels.data().len(), kept: pixels.data().len() };
    if let Some(folder) = masks {
        let path = mask_of(folder, &view.name)?;
        let source = ImageSource::open(&path)?;
        let mask = source.read_samples(1, source.window())?;
        let found = [mask.width(), mask.height()];
        if found != expected {
            return Err(TrainError::Size { what: "the mask", path, found, expected });
        }
        for (colour, value) in pixels.data_mut().iter_mut().zip(mask.data()) {
            let counts = *value > 0.0;
            if !counts {
                *colour = [f32::NAN; 3];
                left.kept -= 1;
            }
        }
    }
    let pixels = match undistortion {
        Some(to) => to.apply(&pixels),
        None => pixels,
    };
    Ok((pixels, left))
}

/// Finds the mask of a photograph.
fn mask_of(folder: &Path, name: &str) -> Result<PathBuf, TrainError> {
    let base = name.rsplit('/').next().unwrap_or(name);
    let named = |name: &str| {
        let stem = Path::new(name).with_extension("png");
        [folder.join(format!("{name}.png")), folder.join(stem)]
    };
    let tried = named(name).into_iter().chain(named(base));
    tried.into_iter().find(|path| path.is_file()).ok_or_else(|| TrainError::NoMask {
        name: name.to_owned(),
        expected: format!("{base}.png or {}", Path::new(base).with_extension("png").display()),
        folder: folder.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_found_by_both_names() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        };
        for name in ["a.jpg.png", "b.png", "left/c.png", "d.JPG.png"] {
            put(name);
        }
        for (name, mask) in
            [("a.jpg", "a.jpg.png"), ("b.jpg", "b.png"), ("left/c.jpg", "left/c.png"), ("right/d.JPG", "d.JPG.png")]
        {
            assert_eq!(mask_of(folder.path(), name).unwrap(), folder.path().join(mask));
        }
        let error = mask_of(folder.path(), "left/e.jpg").unwrap_err().to_string();
        assert!(error.contains("left/e.jpg") && error.contains("e.jpg.png or e.png"), "{error}");
    }

    #[test]
    fn undistorted_pictures_are_those_of_opencv() {
        // Made by undistortion.py beside it.
        let text = include_str!("../../../../tests/reference/undistortion.txt");
        let (size, red) =
            ([40, 30], |x: f64, y: f64| 0.5 + 0.3 * (0.31 * x + 0.17 * y).sin() + 0.15 * (0.23 * x - 0.4 * y).cos());
        let pixel = |i: usize| [red((i % size[0]) as f64, (i / size[0]) as f64) as f32, 0.5, 1.0];
        let picture = Grid::from_vec(size[0], size[1], (0..1200).map(pixel).collect()).unwrap();
        let mut made = Vec::new();
        let (mut compared, mut outside) = (0, 0);
        for line in text.lines() {
            let words: Vec<&str> = line.split(' ').collect();
            let numbers = |from: usize| words[from..].iter().map(|w| w.parse::<f64>().unwrap()).collect::<Vec<f64>>();
            if words[0] == "lens" {
                let lens = Lens::new(size[0], size[1], LensModel::from_name(words[1]).unwrap(), &numbers(2)).unwrap();
                let undistortion = Undistortion::new(&lens).unwrap();
                made.push((undistortion.apply(&picture), undistortion));
                continue;
            }
            let [lens, column, row] = [0, 1, 2].map(|i| words[i].parse::<usize>().unwrap());
            let expected = numbers(3);
            let (colours, undistortion) = &made[lens];
            let (place, colour) = (undistortion.places[(column, row)], colours[(column, row)]);
            assert!((0..2).all(|i| (f64::from(place[i]) - expected[i]).abs() < 1e-4), "{line}: {place:?}");
            if expected[2].is_nan() {
                assert!(colour.iter().all(|c| c.is_nan()), "{line}: {colour:?}");
                outside += 1;
            } else {
                assert!((f64::from(colour[0]) - expected[2]).abs() < 1e-5 && colour[1] == 0.5, "{line}: {colour:?}");
                let nearest = undistortion.nearest(row * size[0] + column).unwrap();
                assert!((nearest % size[0]) as f64 == expected[0].round(), "{line}: {nearest}");
                compared += 1;
            }
        }
        assert!(compared > 400 && outside > 50, "{compared} {outside}");
        let pinhole = Lens::new(9, 7, LensModel::Pinhole, &[8.0, 8.0, 4.0, 3.0]).unwrap();
        assert!(Undistortion::new(&pinhole).is_none());
    }
}
