//! VOC, the volumetric overlap: the voxels that both surfaces occupy.

use serde::Serialize;

/// Overlap of occupied voxels. Corners of voxels are at whole multiples of the edge length from the
/// local origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VoxelOverlap {
    /// Edge length of a voxel, metres.
    pub voxel_m: f64,
    /// Number of voxels with samples of the test.
    pub test: usize,
    /// Number of voxels with samples of the reference.
    pub reference: usize,
    /// Number of voxels with samples of both.
    pub shared: usize,
    /// Number of shared voxels divided by the number occupied by either: the volumetric overlap.
    pub voc: f64,
    /// Number of shared voxels divided by the number of the reference.
    pub completeness: f64,
    /// Number of shared voxels divided by the number of the test.
    pub correctness: f64,
}

pub(super) fn overlap(test: &[[f64; 3]], reference: &[[f64; 3]], voxel_m: f64) -> VoxelOverlap {
    let (a, b) = (occupied(test, voxel_m), occupied(reference, voxel_m));
    let shared = a.iter().filter(|voxel| b.binary_search(voxel).is_ok()).count();
    let share = |of: usize| shared as f64 / of.max(1) as f64;
    VoxelOverlap {
        voxel_m,
        test: a.len(),
        reference: b.len(),
        shared,
        voc: share(a.len() + b.len() - shared),
        completeness: share(b.len()),
        correctness: share(a.len()),
    }
}

/// Returns the voxels of points, in order.
fn occupied(points: &[[f64; 3]], voxel_m: f64) -> Vec<[i64; 3]> {
    let mut voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|c| (c / voxel_m).floor() as i64)).collect();
    voxels.sort_unstable();
    voxels.dedup();
    voxels
}
