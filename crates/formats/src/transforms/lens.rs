//! The lens of a frame.

use camera::{Lens, LensModel};

use super::schema::Intrinsics;

/// Returns the lens of a frame; `size` is the size of the image, if the file does not have it.
pub(super) fn of(found: &Intrinsics, size: Option<[usize; 2]>) -> Result<Lens, String> {
    let [width, height] = image_size(found, size)?;
    let (w, h) = (width as f64, height as f64);
    let [fx, fy] = focal(found, w, h)?;
    // The file counts from the corner of the upper-left pixel, this toolkit from its centre.
    let centre = [found.cx.unwrap_or(0.5 * w) - 0.5, found.cy.unwrap_or(0.5 * h) - 0.5];
    let (model, distortion) = distortion(found)?;
    let parameters: Vec<f64> = [fx, fy].into_iter().chain(centre).chain(distortion).collect();
    Lens::new(width, height, model, &parameters).map_err(|error| error.to_string())
}

fn image_size(found: &Intrinsics, size: Option<[usize; 2]>) -> Result<[usize; 2], String> {
    match (found.w, found.h, size) {
        (Some(w), Some(h), _) => Ok([whole(w)?, whole(h)?]),
        (None, None, Some(size)) => Ok(size),
        _ => Err("the size of the image (w and h) is missing, give the size of the images".to_owned()),
    }
}

fn whole(length: f64) -> Result<usize, String> {
    let fits = length.fract() == 0.0 && (1.0..=f64::from(1 << 24)).contains(&length);
    fits.then_some(length as usize)
        .ok_or_else(|| format!("a side of the image has {length} pixels, expected a whole number from 1 to 16777216"))
}

fn focal(found: &Intrinsics, w: f64, h: f64) -> Result<[f64; 2], String> {
    let of_angle = |side: f64, angle: Option<f64>| match angle {
        Some(angle) if angle > 0.0 && angle < std::f64::consts::PI => Ok(Some(0.5 * side / (0.5 * angle).tan())),
        Some(angle) => Err(format!("the camera angle is {angle} rad, expected more than 0 and less than π")),
        None => Ok(None),
    };
    let x = found.fl_x.map_or_else(|| of_angle(w, found.camera_angle_x), |f| Ok(Some(f)))?;
    let y = found.fl_y.map_or_else(|| of_angle(h, found.camera_angle_y), |f| Ok(Some(f)))?;
    match (x, y) {
        (None, None) => Err("the focal length is missing, expected fl_x or camera_angle_x".to_owned()),
        // A single focal length means square pixels.
        (Some(f), None) | (None, Some(f)) => Ok([f, f]),
        (Some(x), Some(y)) => Ok([x, y]),
    }
}

fn distortion(found: &Intrinsics) -> Result<(LensModel, Vec<f64>), String> {
    let [k1, k2, k3, k4, p1, p2] =
        [found.k1, found.k2, found.k3, found.k4, found.p1, found.p2].map(|term| term.unwrap_or(0.0));
    let fisheye = match (found.camera_model.as_deref(), found.is_fisheye) {
        (Some("OPENCV_FISHEYE"), _) | (None, Some(true)) => true,
        (None | Some("OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "PERSPECTIVE"), _) => false,
        (Some(other), _) => {
            let shown: String = other.chars().take(30).collect();
            return Err(format!(
                "the camera model is {shown:?}, expected OPENCV, OPENCV_FISHEYE, PINHOLE or SIMPLE_PINHOLE"
            ));
        }
    };
    if fisheye {
        let tangential = p1 != 0.0 || p2 != 0.0;
        return if tangential {
            Err("the lens is a fisheye and has p1 or p2, which the fisheye model does not have".to_owned())
        } else {
            Ok((LensModel::OpenCvFisheye, vec![k1, k2, k3, k4]))
        };
    }
    if k4 != 0.0 {
        return Err(format!("k4 is {k4}, only the fisheye model has a fourth radial term"));
    }
    Ok(match [k1, k2, k3, p1, p2] {
        [0.0, 0.0, 0.0, 0.0, 0.0] => (LensModel::Pinhole, Vec::new()),
        [_, _, 0.0, _, _] => (LensModel::OpenCv, vec![k1, k2, p1, p2]),
        _ => (LensModel::FullOpenCv, vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]),
    })
}
