//! The vertices of a model, each position held once.
//!
//! Formats without shared vertices (CityGML) repeat a corner in every polygon; putting equal coordinates on one index
//! makes shared edges visible to the topology checks. Equal means bit for bit (and −0 as 0): no tolerance moves a vertex.

use std::collections::HashMap;

use crate::ModelPoint;

/// Collects vertices and gives equal positions the same index.
#[derive(Debug, Clone, Default)]
pub struct VertexPool {
    vertices: Vec<ModelPoint>,
    index_of: HashMap<[u64; 3], u32>,
}

impl VertexPool {
    /// An empty pool.
    pub fn new() -> Self {
        Self::default()
    }

    /// The index of a position, new or known.
    ///
    /// `None` when the indices of 32 bits are used up.
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

    /// The positions in the order of their indices.
    pub fn vertices(&self) -> &[ModelPoint] {
        &self.vertices
    }

    /// The positions in the order of their indices.
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
