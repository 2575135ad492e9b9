//! Disjoint sets of numbers (union-find with path halving).

/// A partition of the numbers below a count into sets.
pub(crate) struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    /// Creates one set per number.
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    /// Returns the representative of the set that contains `at`.
    pub(crate) fn head(&mut self, mut at: usize) -> usize {
        while self.parent[at] != at {
            self.parent[at] = self.parent[self.parent[at]];
            at = self.parent[at];
        }
        at
    }

    /// Joins the sets of two numbers, and returns whether they were different sets.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.head(a), self.head(b));
        self.parent[a] = b;
        a != b
    }

    /// Returns the number of sets.
    pub(crate) fn count(&self) -> usize {
        self.parent.iter().enumerate().filter(|(at, parent)| at == *parent).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_numbers_have_one_head() {
        let mut sets = DisjointSets::new(5);
        assert!(sets.join(0, 3) && sets.join(3, 4) && !sets.join(4, 0));
        assert_eq!((sets.head(0) == sets.head(4), sets.head(0) == sets.head(1), sets.count()), (true, false, 3));
    }
}
