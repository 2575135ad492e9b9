//! How far a tie is from its height trajectory: the pointing error of its pair, whatever the
//! height.

use camera::RpcCamera;

use super::pair::Tie;
use crate::geometry::source_from_reference;

/// Length of the piece of a trajectory that gives its direction, metres. Trajectories are nearly
/// straight.
pub(super) const PIECE_M: f64 = 20.0;

/// Where a tie lies beside its height trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffTrajectory {
    /// Height at which the trajectory is nearest to the tie, metres above the ellipsoid.
    pub height_m: f64,
    /// Distance from the trajectory there, positive to its left, pixels of the source.
    pub across_px: f64,
}

/// Returns the height of the nearest point on a tie's trajectory and the distance from it; `None`
/// where a camera fails. The search begins at the height `start_m`.
pub fn off_trajectory(reference: &RpcCamera, source: &RpcCamera, tie: &Tie, start_m: f64) -> Option<OffTrajectory> {
    /// The second round is exact, because trajectories are nearly straight.
    const ROUNDS: usize = 3;
    let place = |height_m: f64| source_from_reference(reference, source, 0, tie.reference, height_m).ok();
    let (mut height_m, mut across_px) = (start_m, 0.0);
    for _ in 0..ROUNDS {
        let (from, to) = (place(height_m)?, place(height_m + PIECE_M)?);
        let along = [to.sample - from.sample, to.line - from.line];
        let found = [tie.source.sample - from.sample, tie.source.line - from.line];
        let square = along[0] * along[0] + along[1] * along[1];
        across_px = (along[0] * found[1] - along[1] * found[0]) / square.sqrt();
        height_m += PIECE_M * (along[0] * found[0] + along[1] * found[1]) / square;
    }
    (across_px.is_finite() && height_m.is_finite()).then_some(OffTrajectory { height_m, across_px })
}
