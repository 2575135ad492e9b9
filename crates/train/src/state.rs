//! What a training has learned so far, and its checkpoint.

use gaussian::SplatHarmonics;

use crate::adam::Moments;
use crate::harmonics::LearnedHarmonics;
use crate::loss::ViewAppearance;
use crate::surfel::Surfel;
use crate::view::SurfelCamera;

/// First bytes of a checkpoint: name and version.
const MAGIC: &[u8; 8] = b"sktrain2";

/// The state of a training after an iteration. The same state gives the same training.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingState {
    /// Number of iterations that are done.
    pub iteration: u32,
    /// The surfels.
    pub surfels: Vec<Surfel>,
    /// Harmonics of the surfels beyond the constant one.
    pub harmonics: LearnedHarmonics,
    /// Gain and offset of each view.
    pub appearance: Vec<ViewAppearance>,
    /// Factor of the prior depths.
    pub depth_scale: f32,
    pub(crate) moments: Vec<Moments<{ Surfel::PARAMETERS }>>,
    pub(crate) appearance_moments: Vec<Moments<6>>,
    pub(crate) scale_moments: Moments<1>,
    /// Sum of the gradients by the position in the image, and number of drawings, since surfels
    /// were last added.
    pub(crate) pulls: Vec<[f32; 2]>,
}

/// Why a checkpoint cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointDefect {
    /// The first bytes are others.
    #[error("the file is not a checkpoint of a training, or of another version")]
    Kind,
    /// The length does not fit the counts.
    #[error("the checkpoint is cut off or has bytes too many")]
    Length,
}

impl TrainingState {
    /// Returns the state before the first iteration.
    pub fn new(surfels: Vec<Surfel>, views: usize) -> Self {
        let count = surfels.len();
        Self {
            iteration: 0,
            surfels,
            harmonics: LearnedHarmonics::default(),
            appearance: vec![ViewAppearance::PLAIN; views],
            depth_scale: 1.0,
            moments: vec![Moments::default(); count],
            appearance_moments: vec![Moments::default(); views],
            scale_moments: Moments::default(),
            pulls: vec![[0.0; 2]; count],
        }
    }

    /// Returns the surfels with the colours that a camera sees. `memory` may be reused.
    pub fn seen<'a, C: SurfelCamera>(&'a self, camera: &C, memory: &'a mut Vec<Surfel>) -> &'a [Surfel] {
        self.harmonics.seen(&self.surfels, camera, self.harmonics.degree(), memory)
    }

    /// Returns the state as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        let degree = u32::from(self.harmonics.degree());
        for count in [self.iteration, self.surfels.len() as u32, self.appearance.len() as u32, degree] {
            out.extend(count.to_le_bytes());
        }
        let mut put = |values: &[f32]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        put(&[self.depth_scale]);
        put_moments(&self.scale_moments, &mut put);
        for ((surfel, moments), pull) in self.surfels.iter().zip(&self.moments).zip(&self.pulls) {
            put(&surfel.to_array());
            put_moments(moments, &mut put);
            put(pull);
        }
        for (appearance, moments) in self.appearance.iter().zip(&self.appearance_moments) {
            put(&appearance.gain);
            put(&appearance.offset);
            put_moments(moments, &mut put);
        }
        self.harmonics.parts().into_iter().for_each(&mut put);
        out
    }

    /// Returns the state of [`Self::to_bytes`].
    ///
    /// # Errors
    /// [`CheckpointDefect`] for bytes that are no checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointDefect> {
        const PER_SURFEL: usize = 4 * (3 * Surfel::PARAMETERS + 1 + 2);
        const PER_VIEW: usize = 4 * (6 + 13);
        let rest = bytes.strip_prefix(MAGIC).ok_or(CheckpointDefect::Kind)?;
        let mut words = rest.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
        let mut count = || words.next().ok_or(CheckpointDefect::Length);
        let (iteration, surfels, views) = (count()?, count()? as usize, count()? as usize);
        let degree = u8::try_from(count()?).ok().filter(|degree| *degree <= SplatHarmonics::DEGREE_MAX);
        let degree = degree.ok_or(CheckpointDefect::Length)?;
        // Counts are checked before anything is allocated.
        let harmonics = 3 * SplatHarmonics::count(degree);
        let expected = surfels.checked_mul(PER_SURFEL + 4 * 3 * harmonics).zip(views.checked_mul(PER_VIEW));
        let expected = expected.and_then(|(a, b)| a.checked_add(b)?.checked_add(16 + 4 + 12));
        if expected != Some(rest.len()) {
            return Err(CheckpointDefect::Length);
        }
        let mut words = Words(words);
        let depth_scale = f32::from_bits(words.next());
        let scale_moments = words.moments();
        let mut state = Self { iteration, depth_scale, scale_moments, ..Self::new(Vec::new(), 0) };
        for _ in 0..surfels {
            state.surfels.push(Surfel::from_array(words.numbers()));
            state.moments.push(words.moments());
            state.pulls.push(words.numbers());
        }
        for _ in 0..views {
            state.appearance.push(ViewAppearance { gain: words.numbers(), offset: words.numbers() });
            state.appearance_moments.push(words.moments());
        }
        let parts = [(); 3].map(|()| (0..surfels * harmonics).map(|_| f32::from_bits(words.next())).collect());
        state.harmonics = LearnedHarmonics::from_parts(degree, parts);
        Ok(state)
    }
}

fn put_moments<const N: usize>(moments: &Moments<N>, put: &mut impl FnMut(&[f32])) {
    put(&moments.mean);
    put(&moments.square);
    put(&[f32::from_bits(moments.steps)]);
}

/// The words of a checkpoint, whose number was checked.
struct Words<I>(I);

impl<I: Iterator<Item = u32>> Words<I> {
    fn next(&mut self) -> u32 {
        self.0.next().unwrap_or_default()
    }

    fn numbers<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| f32::from_bits(self.next()))
    }

    fn moments<const N: usize>(&mut self) -> Moments<N> {
        Moments { mean: self.numbers(), square: self.numbers(), steps: self.next() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_come_back() {
        let mut state = TrainingState::new(vec![Surfel { opacity_logit: 2.0, ..Surfel::default() }; 3], 2);
        state.iteration = 17;
        state.moments[1].steps = 70_000;
        state.moments[2].square[12] = 0.25;
        state.appearance[1].offset[2] = -0.5;
        state.pulls[0] = [3.0, 4.0];
        let numbers = (0..27).map(|k| k as f32).collect();
        state.harmonics = LearnedHarmonics::of(&SplatHarmonics::new(1, numbers).unwrap(), 3);
        let bytes = state.to_bytes();
        assert_eq!(TrainingState::from_bytes(&bytes), Ok(state));
        assert_eq!(TrainingState::from_bytes(&bytes[..bytes.len() - 4]), Err(CheckpointDefect::Length));
        assert_eq!(TrainingState::from_bytes(b"ply"), Err(CheckpointDefect::Kind));
        let mut huge = bytes;
        huge[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(TrainingState::from_bytes(&huge), Err(CheckpointDefect::Length));
    }
}
