//! What surface of a city model a splat stands for, and which label a pixel takes of its splats.

/// Class and object of a splat, in the numbers of the class and object maps of priors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SplatLabel {
    /// Number of the class of the surface; 255 for none.
    pub class: u8,
    /// Number of the object in the city model, counted from 1; 0 for none.
    pub object: u32,
}

impl SplatLabel {
    /// The label of what belongs to no city model.
    pub const NONE: Self = Self { class: 255, object: 0 };

    /// Returns whether there is no object.
    pub fn is_none(self) -> bool {
        self.object == Self::NONE.object
    }
}

/// Weight that the splats of a pixel must pass together for it to have a label, as for its depth:
/// otherwise most of its light comes from behind them.
const LEAST_COVERAGE: f32 = 0.5;

/// The labels of the splats of a pixel, with the sums of their weights.
#[derive(Debug, Clone, Default)]
pub struct LabelVotes {
    sums: Vec<(SplatLabel, f32)>,
    coverage: f32,
}

impl LabelVotes {
    /// Adds a splat with its weight in the pixel, w = α Π (1 − α) over the splats before it.
    pub fn add(&mut self, label: SplatLabel, weight: f32) {
        self.coverage += weight;
        match self.sums.iter_mut().find(|(known, _)| *known == label) {
            Some((_, sum)) => *sum += weight,
            None => self.sums.push((label, weight)),
        }
    }

    /// Returns the label with the greatest weight and forgets the pixel. Splats without a label
    /// count as one. There is none where the splats pass one half together or less; of equal
    /// weights, the first that was added wins.
    ///
    /// # Examples
    /// ```
    /// use gaussian::{LabelVotes, SplatLabel};
    ///
    /// let [roof, wall] = [2, 3].map(|class| SplatLabel { class, object: 7 });
    /// let mut votes = LabelVotes::default();
    /// [(wall, 0.3), (SplatLabel::NONE, 0.2), (roof, 0.25), (roof, 0.15)].map(|(label, weight)| votes.add(label, weight));
    /// assert_eq!(votes.take(), roof);
    /// votes.add(wall, 0.45);
    /// assert_eq!(votes.take(), SplatLabel::NONE);
    /// ```
    pub fn take(&mut self) -> SplatLabel {
        let mut best = (SplatLabel::NONE, 0.0);
        for &(label, sum) in &self.sums {
            if sum > best.1 {
                best = (label, sum);
            }
        }
        let is_covered = self.coverage > LEAST_COVERAGE;
        self.sums.clear();
        self.coverage = 0.0;
        if is_covered { best.0 } else { SplatLabel::NONE }
    }
}
