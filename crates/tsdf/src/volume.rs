//! A sparse volume: blocks of 8 × 8 × 8 voxels, and the surface where the distance is zero.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::cubes::{CORNERS, CubeEdge, triangles};
use crate::mesh::FusedMesh;

/// Voxels along an edge of a block.
pub(crate) const SIDE: usize = 8;
/// Voxels of a block.
const VOXELS: usize = SIDE * SIDE * SIDE;
/// Bytes of a block.
pub(crate) const BLOCK_BYTES: usize = std::mem::size_of::<Voxel>() * VOXELS;

/// Number of a block along the three axes.
pub(crate) type BlockKey = [i32; 3];

/// What is known at a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Voxel {
    /// Sum of the distances to the surface in units of the truncation, positive on the side of the
    /// cameras.
    pub(crate) distance: f32,
    /// Number of views.
    pub(crate) weight: f32,
    /// Sum of the colours.
    pub(crate) colour: [f32; 3],
    /// Number of colours.
    pub(crate) coloured: f32,
}

/// A block of voxels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    pub(crate) key: BlockKey,
    pub(crate) voxels: Vec<Voxel>,
}

impl Block {
    pub(crate) fn new(key: BlockKey) -> Self {
        Self { key, voxels: vec![Voxel::default(); VOXELS] }
    }

    /// Returns the number of a voxel along the three axes of the volume.
    pub(crate) fn place(&self, voxel: usize) -> [i32; 3] {
        let within = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)];
        [0, 1, 2].map(|i| self.key[i] * SIDE as i32 + within[i] as i32)
    }
}

/// A corner of a mesh: the voxel from which its edge goes, and the axis.
type EdgeKey = ([i32; 3], u8);

/// A corner of a mesh with its position in voxels and its colour.
type Corner = (EdgeKey, [f64; 3], [f32; 3]);

/// Returns the surface of blocks in the order of their keys. Cubes with a voxel that fewer than
/// `least_weight` views saw have none.
pub(crate) fn surface(blocks: &[Block], origin: [f64; 3], voxel_m: f64, least_weight: f32) -> FusedMesh {
    let numbers: HashMap<BlockKey, usize> = blocks.iter().enumerate().map(|(i, block)| (block.key, i)).collect();
    let cases: Vec<Vec<[CubeEdge; 3]>> = (0..=255).map(triangles).collect();
    let of_block = |block: &Block| {
        let neighbours = CORNERS.map(|offset| {
            numbers.get(&[0, 1, 2].map(|i| block.key[i] + offset[i] as i32)).map(|&number| &blocks[number])
        });
        let mut found: Vec<[Corner; 3]> = Vec::new();
        for voxel in 0..VOXELS {
            cube(block.place(voxel), &neighbours, block.key, least_weight, &cases, &mut found);
        }
        found
    };
    let found: Vec<Vec<[Corner; 3]>> = blocks.par_iter().map(of_block).collect();
    let mut mesh = FusedMesh { origin, ..FusedMesh::default() };
    let mut corners: HashMap<EdgeKey, u32> = HashMap::new();
    for triangle in found.into_iter().flatten() {
        let triangle = triangle.map(|(key, position, colour)| {
            *corners.entry(key).or_insert_with(|| {
                mesh.positions.push(position.map(|c| (c * voxel_m) as f32));
                mesh.colours.push(colour);
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.triangles.push(triangle);
    }
    mesh
}

/// Adds the triangles of the cube whose least corner is a voxel.
fn cube(
    place: [i32; 3],
    neighbours: &[Option<&Block>; 8],
    key: BlockKey,
    least_weight: f32,
    cases: &[Vec<[CubeEdge; 3]>],
    found: &mut Vec<[Corner; 3]>,
) {
    let mut at = [Voxel::default(); 8];
    let mut inside = 0u8;
    for (corner, offset) in CORNERS.iter().enumerate() {
        let within = [0, 1, 2].map(|i| (place[i] - key[i] * SIDE as i32) as usize + offset[i]);
        let next = within.map(|w| w / SIDE);
        let Some(block) = neighbours[next[0] + 2 * next[1] + 4 * next[2]] else { return };
        let [x, y, z] = within.map(|w| w % SIDE);
        let voxel = block.voxels[x + SIDE * (y + SIDE * z)];
        if voxel.weight < least_weight {
            return;
        }
        at[corner] = voxel;
        inside |= u8::from(voxel.distance < 0.0) << corner;
    }
    for triangle in &cases[usize::from(inside)] {
        found.push(triangle.map(|(corner, axis)| {
            let (a, b) = (usize::from(corner), usize::from(corner | 1 << axis));
            let [from, to] = [a, b].map(|corner| f64::from(at[corner].distance / at[corner].weight));
            let share = from / (from - to);
            let start = [0, 1, 2].map(|i| place[i] + CORNERS[a][i] as i32);
            let mut position = start.map(f64::from);
            position[usize::from(axis)] += share;
            ((start, axis), position, colour(&at[a], &at[b]))
        }));
    }
}

/// Returns the mean colour of two voxels, grey without any.
fn colour(a: &Voxel, b: &Voxel) -> [f32; 3] {
    let count = a.coloured + b.coloured;
    if count > 0.0 { [0, 1, 2].map(|i| (a.colour[i] + b.colour[i]) / count) } else { [0.5; 3] }
}
