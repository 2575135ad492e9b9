//! Which chunks of a plan a process computes: all, some by number, or its share (`2/5`).

use std::fmt;
use std::str::FromStr;

/// Chunks of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum ChunkSelection {
    /// All chunks that nobody else computes.
    #[default]
    All,
    /// Chunks with these numbers, from 0.
    Numbers(Vec<usize>),
    /// Every `of`-th chunk, for the process with this number, from 1: an array job.
    Share {
        /// Number of the process, from 1.
        number: usize,
        /// Number of processes.
        of: usize,
    },
}

/// A text that selects no chunks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected numbers of chunks from 0, such as 3,7, or a share of them, such as 2/5 (the second of five), found {0:?}"
)]
pub struct ChunkSelectionError(String);

impl ChunkSelection {
    /// Returns the numbers of the selected chunks of `count`.
    ///
    /// # Errors
    /// The first number that is not below `count`.
    pub(super) fn of(&self, count: usize) -> Result<Vec<usize>, usize> {
        match self {
            Self::All => Ok((0..count).collect()),
            Self::Numbers(numbers) => match numbers.iter().find(|number| **number >= count) {
                Some(number) => Err(*number),
                None => Ok(numbers.clone()),
            },
            Self::Share { number, of } => Ok((0..count).filter(|index| index % of == number - 1).collect()),
        }
    }
}

impl FromStr for ChunkSelection {
    type Err = ChunkSelectionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let failed = || ChunkSelectionError(text.to_owned());
        let number = |part: &str| part.trim().parse::<usize>().map_err(|_| failed());
        match text.split_once('/') {
            Some((first, second)) => {
                let (number, of) = (number(first)?, number(second)?);
                if number == 0 || number > of { Err(failed()) } else { Ok(Self::Share { number, of }) }
            }
            None => Ok(Self::Numbers(text.split(',').map(number).collect::<Result<_, _>>()?)),
        }
    }
}

impl fmt::Display for ChunkSelection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::Numbers(all) => f.write_str(&all.iter().map(usize::to_string).collect::<Vec<_>>().join(",")),
            Self::Share { number, of } => write!(f, "{number}/{of}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_every_chunk_once() {
        let mut all: Vec<usize> = Vec::new();
        for number in 1..=3 {
            let share: ChunkSelection = format!("{number}/3").parse().unwrap();
            assert_eq!(share.to_string(), format!("{number}/3"));
            all.extend(share.of(8).unwrap());
        }
        all.sort_unstable();
        assert_eq!(all, (0..8).collect::<Vec<_>>());
        assert_eq!("3,7".parse::<ChunkSelection>().unwrap().of(8), Ok(vec![3, 7]));
        assert_eq!("3,8".parse::<ChunkSelection>().unwrap().of(8), Err(8));
        for bad in ["", "0/3", "4/3", "1/0", "a", "1-3", "1/2/3"] {
            assert!(bad.parse::<ChunkSelection>().is_err(), "{bad}");
        }
    }
}
