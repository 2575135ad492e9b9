//! Line numbers of a text that is read from front to back.

/// Finds the line of growing byte positions in one pass over the text.
#[derive(Debug)]
pub struct Lines<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    /// Starts at the beginning of a text.
    pub fn new(text: &'a str) -> Self {
        Self { text, position: 0, line: 1 }
    }

    /// Returns the line, from 1, of the byte at `position`. A position before an earlier one gets
    /// the line of the earlier one.
    pub fn at(&mut self, position: u64) -> usize {
        let position = usize::try_from(position).unwrap_or(usize::MAX).min(self.text.len());
        let passed = self.text.as_bytes().get(self.position..position).unwrap_or_default();
        self.line += passed.iter().filter(|byte| **byte == b'\n').count();
        self.position = position.max(self.position);
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_grow_with_positions() {
        let mut lines = Lines::new("ab\n\ncd");
        assert_eq!([1, 3, 4, 2, 99].map(|position| lines.at(position)), [1, 2, 3, 3, 3]);
    }
}
