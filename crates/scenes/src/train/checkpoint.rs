//! The checkpoint of a training job: what the trainer has learned, and the pixels that are left
//! out.

use std::path::Path;

use ::train::{CheckpointDefect, SurfelCamera, TrainingState, TrainingView};

use super::error::TrainError;
use job::files::FileError;

/// First bytes of a checkpoint: name and version.
const MAGIC: &[u8; 8] = b"skcours1";
/// Largest checkpoint, bytes.
const LIMIT: u64 = 1 << 33;

/// A checkpoint that was read.
pub(super) struct Checkpoint {
    pub(super) state: TrainingState,
    /// For each picture which of its pixels are left out; empty as long as this was not asked.
    pub(super) left_out: Vec<Vec<bool>>,
}

impl Checkpoint {
    /// Writes a checkpoint in the place of an earlier one.
    pub(super) fn write(path: &Path, state: &TrainingState, left_out: &[Vec<bool>]) -> Result<(), FileError> {
        let state = state.to_bytes();
        let mut bytes = MAGIC.to_vec();
        bytes.extend((state.len() as u64).to_le_bytes());
        bytes.extend(state);
        for mask in left_out {
            bytes.extend(mask.chunks(8).map(|pixels| (0..pixels.len()).map(|k| u8::from(pixels[k]) << k).sum::<u8>()));
        }
        Ok(formats::write_bytes(path, &bytes, true)?)
    }

    /// Whether a training wrote a file, by its beginning.
    pub(super) fn is_ours(path: &Path) -> bool {
        formats::read_regular(path, LIMIT).is_ok_and(|bytes| bytes.starts_with(MAGIC))
    }

    /// Returns the number of iterations that are done; `None` where there is no checkpoint.
    pub(super) fn iteration(path: &Path) -> Result<Option<u32>, TrainError> {
        if !path.is_file() {
            return Ok(None);
        }
        let bytes =
            formats::read_regular(path, LIMIT).map_err(|source| FileError::Read { path: path.to_owned(), source })?;
        let state = parts(&bytes).and_then(|(state, _)| TrainingState::from_bytes(state));
        Ok(Some(state.map_err(|source| TrainError::Checkpoint { path: path.to_owned(), source })?.iteration))
    }

    /// Reads the checkpoint of a training on `views`, of which the first have pictures.
    pub(super) fn read<C: SurfelCamera>(
        path: &Path,
        views: &[TrainingView<C>],
        pictures: usize,
    ) -> Result<Self, TrainError> {
        let bytes =
            formats::read_regular(path, LIMIT).map_err(|source| FileError::Read { path: path.to_owned(), source })?;
        let defect = |source| TrainError::Checkpoint { path: path.to_owned(), source };
        let (state, mut rest) = parts(&bytes).map_err(defect)?;
        let state = TrainingState::from_bytes(state).map_err(defect)?;
        let found = state.appearance.len();
        if found != views.len() {
            return Err(TrainError::OtherViews { path: path.to_owned(), found, expected: views.len() });
        }
        let mut left_out = Vec::new();
        if !rest.is_empty() {
            for view in &views[..pictures] {
                let pixels = view.camera.size().iter().product::<usize>();
                let packed = rest.split_off(..pixels.div_ceil(8)).ok_or_else(|| defect(CheckpointDefect::Length))?;
                left_out.push((0..pixels).map(|k| packed[k / 8] >> (k % 8) & 1 == 1).collect());
            }
        }
        if rest.is_empty() { Ok(Self { state, left_out }) } else { Err(defect(CheckpointDefect::Length)) }
    }
}

/// Returns the state and what follows it.
fn parts(bytes: &[u8]) -> Result<(&[u8], &[u8]), CheckpointDefect> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(CheckpointDefect::Kind)?;
    let (length, rest) = rest.split_first_chunk::<8>().ok_or(CheckpointDefect::Length)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| CheckpointDefect::Length)?;
    rest.split_at_checked(length).ok_or(CheckpointDefect::Length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::train::{PinholeView, Surfel};

    #[test]
    fn states_and_masks_come_back_and_damage_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.bin");
        let camera = PinholeView {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            centre: [0.0; 3],
            focal_px: [5.0; 2],
            principal_px: [2.0; 2],
            size: [5, 3],
        };
        let nothing = || vec![0.5f32; 15];
        let views = [0; 3].map(|_| TrainingView::new(camera, [nothing(), nothing(), nothing()]));
        let state = TrainingState::new(vec![Surfel::default(); 4], 3);
        let masks: Vec<Vec<bool>> = (0..2).map(|v| (0..15).map(|i| (i + v) % 3 == 0).collect()).collect();
        for left_out in [&[][..], &masks] {
            Checkpoint::write(&path, &state, left_out).unwrap();
            let found = Checkpoint::read(&path, &views, 2).unwrap();
            assert!(found.state == state && found.left_out == left_out);
        }
        let other = Checkpoint::read(&path, &views[..2], 2);
        assert!(matches!(other, Err(TrainError::OtherViews { found: 3, expected: 2, .. })));
        let whole = std::fs::read(&path).unwrap();
        for bytes in [&whole[..whole.len() - 1], &whole[..20], &[&whole[..], &[0]].concat(), b"other"] {
            std::fs::write(&path, bytes).unwrap();
            assert!(matches!(Checkpoint::read(&path, &views, 2), Err(TrainError::Checkpoint { .. })));
        }
    }
}
