//! The nodes of the tree. A node holds eight boxes side by side, in f32 and rounded outwards.

/// Number of children of a node.
pub(crate) const WIDTH: usize = 8;
/// Largest number of triangles in a leaf.
pub(crate) const LEAF_SIZE: usize = 4;
/// Largest number of triangles: a leaf names its first one in 27 bits of a [`Child`].
pub(crate) const MAX_TRIANGLES: usize = 1 << 27;

/// Eight children with their boxes.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Lower corners, `[axis][child]`; +∞ where there is no child.
    pub(crate) low: [[f32; WIDTH]; 3],
    /// Upper corners, `[axis][child]`; −∞ where there is no child.
    pub(crate) high: [[f32; WIDTH]; 3],
    /// Index or triangles of each child.
    pub(crate) children: [Child; WIDTH],
}

/// The index of a node, or a leaf with its range of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Child(u32);

const LEAF: u32 = 1 << 31;

impl Child {
    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    pub(crate) fn leaf(start: usize, count: usize) -> Self {
        Self(LEAF | (start as u32) << 3 | (count as u32 - 1))
    }

    /// Returns the triangles of a leaf, `None` for a node.
    #[inline(always)]
    pub(crate) fn triangles(self) -> Option<std::ops::Range<usize>> {
        let start = ((self.0 & !LEAF) >> 3) as usize;
        (self.0 & LEAF != 0).then(|| start..start + (self.0 & 7) as usize + 1)
    }

    /// Returns the index of a node.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

impl Node {
    pub(crate) fn empty() -> Self {
        Self { low: [[f32::INFINITY; WIDTH]; 3], high: [[f32::NEG_INFINITY; WIDTH]; 3], children: [Child(0); WIDTH] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_are_told_apart() {
        assert_eq!(Child::leaf(1234, 4).triangles(), Some(1234..1238));
        assert_eq!(Child::leaf(MAX_TRIANGLES - 1, 1).triangles(), Some(MAX_TRIANGLES - 1..MAX_TRIANGLES));
        assert_eq!((Child::node(77).triangles(), Child::node(77).index()), (None, 77));
    }
}
