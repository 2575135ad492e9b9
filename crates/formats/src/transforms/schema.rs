//! The members of a `transforms.json` that describe cameras. Other members are skipped.

use camera::Similarity;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
pub(super) struct File {
    pub(super) frames: Vec<Frame>,
    #[serde(default)]
    pub(super) applied_transform: Option<Matrix>,
    #[serde(default)]
    pub(super) applied_scale: Option<f64>,
    #[serde(flatten)]
    pub(super) intrinsics: Intrinsics,
}

#[derive(Debug, Deserialize)]
pub(super) struct Frame {
    pub(super) file_path: String,
    pub(super) transform_matrix: Matrix,
    #[serde(flatten)]
    pub(super) intrinsics: Intrinsics,
}

/// A matrix of three or four rows of four numbers.
#[derive(Debug, Deserialize)]
pub(super) struct Matrix(Vec<Vec<f64>>);

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(super) struct Intrinsics {
    pub(super) camera_model: Option<String>,
    pub(super) is_fisheye: Option<bool>,
    pub(super) w: Option<f64>,
    pub(super) h: Option<f64>,
    pub(super) fl_x: Option<f64>,
    pub(super) fl_y: Option<f64>,
    pub(super) camera_angle_x: Option<f64>,
    pub(super) camera_angle_y: Option<f64>,
    pub(super) cx: Option<f64>,
    pub(super) cy: Option<f64>,
    pub(super) k1: Option<f64>,
    pub(super) k2: Option<f64>,
    pub(super) k3: Option<f64>,
    pub(super) k4: Option<f64>,
    pub(super) p1: Option<f64>,
    pub(super) p2: Option<f64>,
}

impl Intrinsics {
    /// Returns these intrinsics, with those of the file for missing ones.
    pub(super) fn or(&self, file: &Self) -> Self {
        Self {
            camera_model: self.camera_model.clone().or_else(|| file.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(file.is_fisheye),
            w: self.w.or(file.w),
            h: self.h.or(file.h),
            fl_x: self.fl_x.or(file.fl_x),
            fl_y: self.fl_y.or(file.fl_y),
            camera_angle_x: self.camera_angle_x.or(file.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(file.camera_angle_y),
            cx: self.cx.or(file.cx),
            cy: self.cy.or(file.cy),
            k1: self.k1.or(file.k1),
            k2: self.k2.or(file.k2),
            k3: self.k3.or(file.k3),
            k4: self.k4.or(file.k4),
            p1: self.p1.or(file.p1),
            p2: self.p2.or(file.p2),
        }
    }
}

impl Matrix {
    /// Returns the matrix as similarity, if its rows have the right lengths and the last one is 0 0
    /// 0 1.
    pub(super) fn similarity(&self) -> Result<Similarity, String> {
        let row = |i: usize| <[f64; 4]>::try_from(self.0.get(i)?.as_slice()).ok();
        let last_fits = self.0.get(3).is_none_or(|last| last.as_slice() == [0.0, 0.0, 0.0, 1.0]);
        match (row(0), row(1), row(2)) {
            (Some(a), Some(b), Some(c)) if last_fits && self.0.len() <= 4 => {
                Similarity::from_matrix([a, b, c]).map_err(|error| error.to_string())
            }
            _ => Err("the matrix does not have three or four rows of four numbers, or its fourth row is not 0 0 0 1"
                .to_owned()),
        }
    }
}
