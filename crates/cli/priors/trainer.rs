//! What trainers can do with a lens.
//!
//! The COLMAP readers of 3DGS and 2DGS take PINHOLE and SIMPLE_PINHOLE, and 2DGS puts the principal point into the middle of the
//! image whatever the file says: an image with another one would be learned shifted. Cropping the image so that the point
//! is in its middle (within a quarter of a pixel) is the way out.

use anyhow::bail;
use camera::{Lens, LensModel};
use serde::Serialize;

use super::options::{Args, Trainer};

/// Principal points this close to the middle are left there, pixels.
const MIDDLE_PX: f64 = 0.5;

/// The part of an image that is kept, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Crop {
    /// First column.
    pub(super) x: usize,
    /// First row.
    pub(super) y: usize,
    /// Number of columns.
    pub(super) width: usize,
    /// Number of rows.
    pub(super) height: usize,
}

/// The lens that the dataset has for one that was read.
pub(super) fn usable(args: &Args, lens: &Lens) -> anyhow::Result<(Lens, Option<Crop>)> {
    if args.maps_only {
        return Ok((lens.clone(), None));
    }
    if !lens.model().is_pinhole() {
        bail!(
            "its lens is {}, and trainers take undistorted images only: undistort them (colmap image_undistorter) and give the \
             cameras that come with them, or ask for --maps-only",
            lens.model().name()
        );
    }
    let centre = [lens.principal_point().sample, lens.principal_point().line];
    let size = [lens.width(), lens.height()];
    let off = [0, 1].map(|i| centre[i] - (size[i] as f64 - 1.0) / 2.0);
    if args.trainer == Trainer::Gsplat || off.iter().all(|o| o.abs() <= MIDDLE_PX) {
        return Ok((pinhole(lens, size, centre)?, None));
    }
    if !args.recrop {
        bail!(
            "its principal point is {:+.2}, {:+.2} px from the middle of the image, and 2DGS takes the middle: --recrop crops the \
             camera (and says how to crop the images), --trainer gsplat keeps it",
            off[0],
            off[1]
        );
    }
    let cut = off.map(|o| (2.0 * o).round());
    let kept = [0, 1].map(|i| size[i] as f64 - cut[i].abs());
    if (0..2).any(|i| kept[i] < size[i] as f64 / 2.0) {
        bail!(
            "its principal point is {:+.0}, {:+.0} px from the middle: cropping would leave less than half of the image",
            off[0],
            off[1]
        );
    }
    let (first, kept) = (cut.map(|c| c.max(0.0) as usize), kept.map(|k| k as usize));
    let crop = Crop { x: first[0], y: first[1], width: kept[0], height: kept[1] };
    let centre = [0, 1].map(|i| centre[i] - first[i] as f64);
    Ok((pinhole(lens, kept, centre)?, Some(crop)))
}

fn pinhole(lens: &Lens, size: [usize; 2], centre: [f64; 2]) -> anyhow::Result<Lens> {
    let [fx, fy] = lens.focal_px();
    Ok(Lens::new(size[0], size[1], LensModel::Pinhole, &[fx, fy, centre[0], centre[1]])?)
}
