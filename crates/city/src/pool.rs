//! A list of vertices that holds each position once.
//!
//! Formats without shared vertices (CityGML) repeat a corner in every polygon. Equal coordinates
//! get the same index here, which makes shared edges visible to the topology checks. Equality is
//! bit for bit, and −0 equals 0. No tolerance is applied, so no vertex moves.

use std::collections::HashMap;

use crate::ModelPoint;

/// A list of vertices in which equal positions share an index.
#[derive(Debug, Clone, Default)]
pub struct VertexPool {
    vertices: Vec<ModelPoint>,
    index_of: HashMap<[u64; 3], u32>,
}

impl VertexPool {
    /// Creates an empty pool.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the index of a position, and adds the position if it is new.
    ///
    /// Returns `None` when all 32-bit indices are used.
    pub fn index(&mut self, point: ModelPoint) -> Option<u32> {
        let key = [point.x, point.y, point.z].map(|c| (c + 0.0).to_bits());
        if let Some(&index) = self.index_of.get(&key) {
            return Some(index);
        }
        let index = u32::try_from(self.vertices.len()).ok().filter(|&i| i < u32::MAX)?;
        self.vertices.push(point);
        self.index_of.insert(key, index);
        Some(index)
    }

    /// Returns the positions in the order of their indices.
    pub fn vertices(&self) -> &[ModelPoint] {
        &self.vertices
    }

    /// Returns the positions in the order of their indices, and consumes the pool.
    pub fn into_vertices(self) -> Vec<ModelPoint> {
        self.vertices
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_share_an_index() {
        let mut pool = VertexPool::new();
        let a = pool.index(ModelPoint::new(0.0, 1.0, 2.0));
        let b = pool.index(ModelPoint::new(-0.0, 1.0, 2.0));
        let c = pool.index(ModelPoint::new(0.0, 1.0, 2.0 + 1e-9));
        assert_eq!((a, b, c), (Some(0), Some(0), Some(1)));
        assert_eq!(pool.into_vertices().len(), 2);
    }
}
