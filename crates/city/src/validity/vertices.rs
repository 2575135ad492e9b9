//! Finds vertices at which a closed shell touches itself: the polygons around a vertex must form
//! one fan.

use crate::SurfacePolygon;
use crate::sets::DisjointSets;

/// Counts the vertices with several fans around them. Every edge of the shell must belong to two
/// polygons.
pub(super) fn pinched(surfaces: &[&SurfacePolygon]) -> usize {
    // A spoke is an edge seen from one of its ends. The two corners that share a spoke are
    // neighbours in a fan.
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
