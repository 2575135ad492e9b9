//! Many points at once: one slice per coordinate, vectorised, f64.
//!
//! A point that fails is NaN in every output and counted in the result; nothing panics. Projection evaluates the model
//! as [`Rpc::project`] does; localisation takes a fixed number of Newton steps from the affine inverse at the domain's
//! centre, keeps what provably converged (less than 1e-8 px left), and gives the rest to [`Rpc::localize`].
//! Each point's result is the same wherever it stands in the slices. Processors with fused multiply-add round less
//! often than those without: between the two, and against the scalar forms, the last bits differ (below 1e-8 px).

use crate::kernel::{self, BLOCK};
use crate::{CameraError, ImagePoint, Rpc, RpcCamera, RpcPlane};
use geodesy::LonLatHeight;

impl Rpc {
    /// Projects points given by longitude, latitude (degrees) and height (metres); returns how many failed.
    ///
    /// # Errors
    /// Slices of different lengths.
    pub fn project_batch(
        &self,
        lon_deg: &[f64],
        lat_deg: &[f64],
        height_m: &[f64],
        sample: &mut [f64],
        line: &mut [f64],
    ) -> Result<usize, CameraError> {
        same_length(lon_deg.len(), &[lat_deg.len(), height_m.len(), sample.len(), line.len()])?;
        kernel::project(self, lon_deg, lat_deg, height_m, sample, line);
        Ok(count_nan(sample))
    }

    /// Localises image points at heights (metres) to longitude and latitude (degrees); returns how many failed.
    ///
    /// # Errors
    /// Slices of different lengths.
    pub fn localize_batch(
        &self,
        sample: &[f64],
        line: &[f64],
        height_m: &[f64],
        lon_deg: &mut [f64],
        lat_deg: &mut [f64],
    ) -> Result<usize, CameraError> {
        same_length(sample.len(), &[line.len(), height_m.len(), lon_deg.len(), lat_deg.len()])?;
        kernel::localize(self, sample, line, height_m, lon_deg, lat_deg);
        let mut failed = 0;
        for (i, lon) in lon_deg.iter_mut().enumerate().filter(|(_, lon)| lon.is_nan()) {
            match self.localize(ImagePoint::new(sample[i], line[i]), height_m[i]) {
                Ok(LonLatHeight { lon_deg, lat_deg: found, .. }) => (*lon, lat_deg[i]) = (lon_deg, found),
                Err(_) => failed += 1,
            }
        }
        Ok(failed)
    }
}

impl RpcPlane {
    /// Projects points of the plane given by longitude and latitude, degrees; returns how many failed.
    ///
    /// # Errors
    /// Slices of different lengths.
    pub fn project_batch(
        &self,
        lon_deg: &[f64],
        lat_deg: &[f64],
        sample: &mut [f64],
        line: &mut [f64],
    ) -> Result<usize, CameraError> {
        same_length(lon_deg.len(), &[lat_deg.len(), sample.len(), line.len()])?;
        kernel::project_plane(self, lon_deg, lat_deg, sample, line);
        Ok(count_nan(sample))
    }
}

impl RpcCamera {
    /// As [`Rpc::project_batch`], corrected.
    ///
    /// # Errors
    /// Slices of different lengths.
    pub fn project_batch(
        &self,
        lon_deg: &[f64],
        lat_deg: &[f64],
        height_m: &[f64],
        sample: &mut [f64],
        line: &mut [f64],
    ) -> Result<usize, CameraError> {
        let failed = self.rpc.project_batch(lon_deg, lat_deg, height_m, sample, line)?;
        for (s, l) in sample.iter_mut().zip(line) {
            let p = self.correction.apply(ImagePoint::new(*s, *l));
            (*s, *l) = (p.sample, p.line);
        }
        Ok(failed)
    }

    /// As [`Rpc::localize_batch`], corrected. A correction that cannot be inverted fails for every point.
    ///
    /// # Errors
    /// Slices of different lengths.
    pub fn localize_batch(
        &self,
        sample: &[f64],
        line: &[f64],
        height_m: &[f64],
        lon_deg: &mut [f64],
        lat_deg: &mut [f64],
    ) -> Result<usize, CameraError> {
        same_length(sample.len(), &[line.len(), height_m.len(), lon_deg.len(), lat_deg.len()])?;
        let mut failed = 0;
        let (mut block_s, mut block_l) = ([0.0; BLOCK], [0.0; BLOCK]);
        for first in (0..sample.len()).step_by(BLOCK) {
            let part = first..(first + BLOCK).min(sample.len());
            let n = part.len();
            for (i, (&s, &l)) in sample[part.clone()].iter().zip(&line[part.clone()]).enumerate() {
                let p = self.correction.invert(ImagePoint::new(s, l));
                (block_s[i], block_l[i]) = p.map_or((f64::NAN, f64::NAN), |p| (p.sample, p.line));
            }
            failed += self.rpc.localize_batch(
                &block_s[..n],
                &block_l[..n],
                &height_m[part.clone()],
                &mut lon_deg[part.clone()],
                &mut lat_deg[part],
            )?;
        }
        Ok(failed)
    }
}

fn same_length(expected: usize, others: &[usize]) -> Result<(), CameraError> {
    match others.iter().find(|&&n| n != expected) {
        Some(&found) => Err(CameraError::Length { expected, found }),
        None => Ok(()),
    }
}

fn count_nan(values: &[f64]) -> usize {
    values.iter().filter(|v| v.is_nan()).count()
}
