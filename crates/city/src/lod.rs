//! Levels of detail, with the decimals of the refined scheme of Biljecki et al. (2016), such as 1.2
//! and 2.2.

use std::fmt;
use std::str::FromStr;

use crate::ModelError;

/// Level of detail: `2`, or refined as `2.2`.
///
/// The order is that of the numbers, and a plain `2` is coarser than any `2.x`.
///
/// # Examples
/// ```
/// use city::Lod;
///
/// let refined: Lod = "2.2".parse()?;
/// assert!(refined.matches(Lod::new(2, None)));
/// assert!(Lod::new(2, None) < refined);
/// # Ok::<(), city::ModelError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Lod {
    major: u8,
    minor: Option<u8>,
}

impl Lod {
    /// Creates a level of detail; `minor` is the refinement.
    pub const fn new(major: u8, minor: Option<u8>) -> Self {
        Self { major, minor }
    }

    /// Returns the level, which is 0 to 4 in practice.
    pub const fn major(self) -> u8 {
        self.major
    }

    /// Returns the refinement, if there is one.
    pub const fn minor(self) -> Option<u8> {
        self.minor
    }

    /// Returns whether `chosen` covers this level. A plain `2` covers each of its refinements,
    /// `2.2` only itself.
    pub fn matches(self, chosen: Self) -> bool {
        self.major == chosen.major && (chosen.minor.is_none() || chosen.minor == self.minor)
    }
}

impl FromStr for Lod {
    type Err = ModelError;

    /// Parses `2` and `2.2`. `2.0` is a refinement of `2`, and is not equal to it.
    ///
    /// # Errors
    /// [`ModelError::Lod`] for any other text.
    fn from_str(text: &str) -> Result<Self, ModelError> {
        let digit = |part: &str| match part.as_bytes() {
            [b @ b'0'..=b'9'] => Some(b - b'0'),
            _ => None,
        };
        let (major, minor) = match text.trim().split_once('.') {
            Some((major, minor)) => (digit(major), digit(minor).map(Some)),
            None => (digit(text.trim()), Some(None)),
        };
        match (major, minor) {
            (Some(major), Some(minor)) => Ok(Self { major, minor }),
            _ => Err(ModelError::Lod { text: text.chars().take(20).collect() }),
        }
    }
}

impl fmt::Display for Lod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.minor {
            Some(minor) => write!(f, "{}.{minor}", self.major),
            None => write!(f, "{}", self.major),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_order() {
        let lod = |text: &str| text.parse::<Lod>().unwrap();
        assert!(lod("1.3") < lod("2") && lod("2") < lod("2.0") && lod("2.0") < lod("2.2") && lod("2.2") < lod("3"));
        for text in ["0", "1.2", "2.2", "3"] {
            assert_eq!(lod(text).to_string(), text);
        }
        for bad in ["", "two", "2.", ".2", "22", "2.25", "-1", "2.2.2"] {
            assert!(bad.parse::<Lod>().is_err(), "{bad}");
        }
        assert!(lod("2.2").matches(lod("2")) && lod("2.2").matches(lod("2.2")));
        assert!(!lod("2.2").matches(lod("2.1")) && !lod("1.2").matches(lod("2")));
    }
}
