//! Sets of numbers that are joined one pair at a time (union-find with halved paths).

/// The numbers up to a count, in sets that share nothing.
pub(crate) struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    /// Sets of one number each.
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    /// The number that stands for the set of another.
    pub(crate) fn head(&mut self, mut at: usize) -> usize {
        while self.parent[at] != at {
            self.parent[at] = self.parent[self.parent[at]];
            at = self.parent[at];
        }
        at
    }

    /// Joins the sets of two numbers; whether they were two.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.head(a), self.head(b));
        self.parent[a] = b;
        a != b
    }

    /// How many sets there are.
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
