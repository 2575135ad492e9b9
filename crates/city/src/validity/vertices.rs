//! Vertices at which a closed shell touches itself: the polygons around one must form one fan.

use crate::Surface;
use crate::sets::DisjointSets;

/// How many vertices have several fans around them, in a shell whose every edge is used by two polygons.
pub(super) fn pinched(surfaces: &[&Surface]) -> usize {
    // A spoke is an edge seen from one of its ends; the two corners that have it are neighbours in a fan.
    let mut spokes: Vec<([u32; 2], usize)> = Vec::new();
    let mut vertex_of: Vec<u32> = Vec::new();
    for ring in surfaces.iter().flat_map(|surface| &surface.rings) {
        for (i, &vertex) in ring.iter().enumerate() {
            let (before, after) = (ring[(i + ring.len() - 1) % ring.len()], ring[(i + 1) % ring.len()]);
            spokes.extend([before, after].map(|end| ([vertex, end], vertex_of.len())));
            vertex_of.push(vertex);
        }
    }
    spokes.sort_unstable();
    let mut fans = DisjointSets::new(vertex_of.len());
    for pair in spokes.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        fans.join(pair[0].1, pair[1].1);
    }
    let mut heads: Vec<u32> =
        (0..vertex_of.len()).filter(|&corner| fans.head(corner) == corner).map(|corner| vertex_of[corner]).collect();
    heads.sort_unstable();
    heads.chunk_by(|a, b| a == b).filter(|of_vertex| of_vertex.len() > 1).count()
}
