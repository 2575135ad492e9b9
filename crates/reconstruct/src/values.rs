//! Small values that the stages share: height ranges, pairs of images, map rectangles.
//!
//! Each is written to JSON and TOML as an array of numbers, the form that configurations and
//! reports have.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Grids of more cells than this come from a cell size or bounds in wrong units.
pub const CELLS_MAX: f64 = 4e9;

/// A range of heights, metres above the ellipsoid. It is written as `[low, high]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct HeightRange {
    /// Least height, metres.
    pub low_m: f64,
    /// Greatest height, metres.
    pub high_m: f64,
}

impl HeightRange {
    /// Heights of the Earth's surface above the ellipsoid: the shore of the Dead Sea and Everest,
    /// rounded outward.
    pub const EARTH: Self = Self::new(-500.0, 9000.0);

    /// Makes a range from its ends.
    pub const fn new(low_m: f64, high_m: f64) -> Self {
        Self { low_m, high_m }
    }

    /// Returns the range that holds one height only.
    pub const fn at(height_m: f64) -> Self {
        Self::new(height_m, height_m)
    }

    /// Returns the difference of the ends, metres.
    pub fn span_m(self) -> f64 {
        self.high_m - self.low_m
    }

    /// Returns the middle of the range.
    pub fn middle_m(self) -> f64 {
        0.5 * (self.low_m + self.high_m)
    }

    /// Returns whether the range is one of the Earth's surface, the lower end first.
    pub fn is_on_earth(self) -> bool {
        Self::EARTH.low_m <= self.low_m && self.low_m < self.high_m && self.high_m <= Self::EARTH.high_m
    }

    /// Returns whether a height lies in the range, ends included.
    pub fn contains(self, height_m: f64) -> bool {
        (self.low_m..=self.high_m).contains(&height_m)
    }

    /// Returns the smallest range that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self::new(self.low_m.min(other.low_m), self.high_m.max(other.high_m))
    }

    /// Returns the range cut to `limits`. The ends are in the wrong order when the two ranges are
    /// apart.
    #[must_use]
    pub fn cut_to(self, limits: Self) -> Self {
        Self::new(self.low_m.max(limits.low_m), self.high_m.min(limits.high_m))
    }

    /// Returns the range with `below_m` more at its lower end and `above_m` more at its upper end.
    #[must_use]
    pub fn grown(self, below_m: f64, above_m: f64) -> Self {
        Self::new(self.low_m - below_m, self.high_m + above_m)
    }
}

impl From<[f64; 2]> for HeightRange {
    fn from([low_m, high_m]: [f64; 2]) -> Self {
        Self { low_m, high_m }
    }
}

impl From<HeightRange> for [f64; 2] {
    fn from(range: HeightRange) -> Self {
        [range.low_m, range.high_m]
    }
}

/// A pair of images by their positions in the list of images. It is written as `[first, second]`
/// with positions as people count them, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "[usize; 2]", into = "[usize; 2]")]
pub struct ImagePair {
    /// Position of the first image, counted from 0.
    pub first: usize,
    /// Position of the second image, counted from 0.
    pub second: usize,
}

impl ImagePair {
    /// Makes a pair of two positions.
    pub const fn new(first: usize, second: usize) -> Self {
        Self { first, second }
    }

    /// Returns the pair with the lower position first.
    #[must_use]
    pub fn ordered(self) -> Self {
        Self::new(self.first.min(self.second), self.first.max(self.second))
    }

    /// Returns whether an image is one of the pair.
    pub const fn has(self, image: usize) -> bool {
        self.first == image || self.second == image
    }
}

impl TryFrom<[usize; 2]> for ImagePair {
    type Error = String;

    /// Takes two different positions that are counted from 1.
    fn try_from([first, second]: [usize; 2]) -> Result<Self, String> {
        if first == second {
            return Err(format!("a pair needs two different images, found [{first}, {second}]"));
        }
        Ok(Self { first: index_of_position(first)?, second: index_of_position(second)? })
    }
}

impl From<ImagePair> for [usize; 2] {
    fn from(pair: ImagePair) -> Self {
        [pair.first + 1, pair.second + 1]
    }
}

/// Returns the position counted from 0 of one that people count from 1.
///
/// # Errors
/// A sentence for the position 0.
pub fn index_of_position(position: usize) -> Result<usize, String> {
    position.checked_sub(1).ok_or_else(|| "positions of images count from 1, found 0".to_owned())
}

impl fmt::Display for ImagePair {
    /// Writes the positions as people count them, from 1: `1-2`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.first.saturating_add(1), self.second.saturating_add(1))
    }
}

impl FromStr for ImagePair {
    type Err = String;

    /// Reads two different positions as people count them, from 1: `1-2`.
    fn from_str(text: &str) -> Result<Self, String> {
        let position = |part: &str| part.trim().parse::<usize>().ok()?.checked_sub(1);
        let pair =
            text.split_once('-').and_then(|(first, second)| Some(Self::new(position(first)?, position(second)?)));
        match pair {
            None => Err(format!("expected two positions of images, counted from 1, such as 1-2, found {text:?}")),
            Some(pair) if pair.first == pair.second => {
                Err(format!("a pair needs two different images, found {text:?}"))
            }
            Some(pair) => Ok(pair),
        }
    }
}

/// A rectangle on the map, in the units of its CRS. It is written as `[x_min, y_min, x_max,
/// y_max]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct MapBounds {
    /// Western edge.
    pub x_min: f64,
    /// Southern edge.
    pub y_min: f64,
    /// Eastern edge.
    pub x_max: f64,
    /// Northern edge.
    pub y_max: f64,
}

impl MapBounds {
    /// The rectangle that holds nothing, to be grown by [`MapBounds::including`].
    pub const EMPTY: Self =
        Self { x_min: f64::INFINITY, y_min: f64::INFINITY, x_max: f64::NEG_INFINITY, y_max: f64::NEG_INFINITY };

    /// Returns the smallest rectangle that holds this one and a point.
    #[must_use]
    pub fn including(self, x: f64, y: f64) -> Self {
        Self { x_min: self.x_min.min(x), y_min: self.y_min.min(y), x_max: self.x_max.max(x), y_max: self.y_max.max(y) }
    }

    /// Returns whether the interiors of two rectangles meet.
    pub fn meets(self, other: Self) -> bool {
        self.x_min < other.x_max && self.x_max > other.x_min && self.y_min < other.y_max && self.y_max > other.y_min
    }

    /// Returns the rectangle with x and y exchanged.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { x_min: self.y_min, y_min: self.x_min, x_max: self.y_max, y_max: self.x_max }
    }

    /// Returns the middle of the rectangle.
    pub fn middle(self) -> (f64, f64) {
        (0.5 * (self.x_min + self.x_max), 0.5 * (self.y_min + self.y_max))
    }

    /// Returns `[x_min, y_min, x_max, y_max]`.
    pub fn to_array(self) -> [f64; 4] {
        [self.x_min, self.y_min, self.x_max, self.y_max]
    }
}

impl From<[f64; 4]> for MapBounds {
    fn from([x_min, y_min, x_max, y_max]: [f64; 4]) -> Self {
        Self { x_min, y_min, x_max, y_max }
    }
}

impl From<MapBounds> for [f64; 4] {
    fn from(bounds: MapBounds) -> Self {
        bounds.to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_arrays() {
        assert_eq!(serde_json::to_string(&HeightRange::new(-1.5, 20.0)).unwrap(), "[-1.5,20.0]");
        assert_eq!(serde_json::to_string(&ImagePair::new(0, 2)).unwrap(), "[1,3]");
        assert_eq!(serde_json::from_str::<ImagePair>("[1,3]").unwrap(), ImagePair::new(0, 2));
        let zero = serde_json::from_str::<ImagePair>("[0,2]").unwrap_err().to_string();
        assert!(zero.contains("positions of images count from 1, found 0"), "{zero}");
        assert!(serde_json::from_str::<ImagePair>("[2,2]").is_err());
        assert_eq!(serde_json::to_string(&MapBounds::from([1.0, 2.0, 3.0, 4.0])).unwrap(), "[1.0,2.0,3.0,4.0]");
        assert_eq!(serde_json::from_str::<HeightRange>("[3,4]").unwrap(), HeightRange::new(3.0, 4.0));
        assert_eq!(ImagePair::new(2, 0).ordered().to_string(), "1-3");
        assert_eq!("1-3".parse(), Ok(ImagePair::new(0, 2)));
        assert!(["", "1", "0-1", "2-2", "1-2-3"].iter().all(|text| text.parse::<ImagePair>().is_err()));
    }
}
