//! The pictures of a dataset: copies, or masked to the buildings where only those are trained.
//!
//! A trainer of buildings alone reads the mask from the alpha band of its pictures, so that these
//! are PNG with red, green, blue and alpha. Pictures of cropped cameras are cropped likewise.

use std::fs;
use std::path::{Path, PathBuf};

use formats::raster::{ImageSource, write_png_rgba};
use raster::Grid;

use super::cameras::SceneCameras;
use super::config::{PriorsConfig, PriorsImages, PriorsMode};
use super::error::PriorsJobError;
use super::trainer::ImageCrop;
use job::files::{self, FileError};

/// Folder of the pictures.
pub(super) const FOLDER: &str = "images";
/// Endings that are tried for the names of a `transforms.json`, which often have none.
const ENDINGS: [&str; 4] = ["", ".png", ".jpg", ".JPG"];

/// The pictures of all views, as they were found.
#[derive(Debug)]
pub(super) struct Pictures {
    /// Files, and the names that they get in the dataset.
    files: Vec<(PathBuf, String)>,
    masked: bool,
}

impl Pictures {
    /// Finds the pictures; `None` where none are asked for.
    pub(super) fn find(config: &PriorsConfig, cameras: &SceneCameras) -> Result<Option<Self>, PriorsJobError> {
        let folders = match &config.images {
            PriorsImages::None => return Ok(None),
            PriorsImages::Folder(folder) => vec![folder.clone()],
            PriorsImages::Beside => usual_folders(&cameras.source),
        };
        let replaced = config.output.join(FOLDER).canonicalize().ok();
        let masked = config.mode == PriorsMode::BuildingOnly;
        let mut files = Vec::with_capacity(cameras.stems.len());
        for (view, stem) in cameras.model.views.iter().zip(&cameras.stems) {
            let path = find(&folders, &view.name)
                .ok_or_else(|| PriorsJobError::NoPicture { name: view.name.clone(), folder: folders[0].clone() })?;
            // Masked pictures in the place of the originals would lose these.
            if let (Some(replaced), Ok(real)) = (&replaced, path.canonicalize())
                && real.starts_with(replaced)
            {
                return Err(PriorsJobError::PictureInOutput { path });
            }
            let ending = path.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
            let cropped = cameras.crops[view.lens].is_some();
            let name = if masked || cropped { format!("{stem}.png") } else { format!("{stem}.{ending}") };
            files.push((path, name));
        }
        Ok(Some(Self { files, masked }))
    }

    /// Returns the name of the picture of a view.
    pub(super) fn name(&self, view: usize) -> &str {
        &self.files[view].1
    }

    /// Writes the picture of a view; `mask` is true where its map shows a building.
    pub(super) fn write(
        &self,
        folder: &Path,
        view: usize,
        mask: &Grid<bool>,
        crop: Option<ImageCrop>,
    ) -> Result<(), PriorsJobError> {
        let (path, name) = &self.files[view];
        let to = folder.join(FOLDER).join(name);
        if !self.masked && crop.is_none() {
            return Ok(copy(path, &to)?);
        }
        let source = ImageSource::open(path)?;
        let pixels = source.read_colour(source.window())?;
        let (x, y) = crop.map_or((0, 0), |crop| (crop.x, crop.y));
        let expected = [x + mask.width(), y + mask.height()];
        let found = [pixels.width(), pixels.height()];
        let fits = if crop.is_some() { found[0] >= expected[0] && found[1] >= expected[1] } else { found == expected };
        if !fits {
            return Err(PriorsJobError::PictureSize { path: path.clone(), found, expected });
        }
        let brightest = pixels.data().iter().flatten().copied().fold(0.0f32, f32::max);
        let scale = if brightest > 255.0 { 255.0 / 65_535.0 } else { 1.0 };
        let mut made = Grid::filled(mask.width(), mask.height(), [0u8; 4]);
        for row in 0..mask.height() {
            for column in 0..mask.width() {
                let shown = mask[(column, row)] || !self.masked;
                if shown {
                    let [r, g, b] = pixels[(column + x, row + y)].map(|v| (v * scale).round() as u8);
                    made[(column, row)] = [r, g, b, 255];
                }
            }
        }
        Ok(write_png_rgba(to, &made, false).map_err(FileError::from)?)
    }
}

/// Returns the folders in which pictures usually lie: `images` beside the model or one or two
/// folders above it, or the folder of a `transforms.json`.
fn usual_folders(source: &Path) -> Vec<PathBuf> {
    if source.is_file() {
        return vec![source.parent().unwrap_or(Path::new(".")).to_owned()];
    }
    let source = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    let mut folders: Vec<PathBuf> = source.ancestors().take(3).map(|folder| folder.join(FOLDER)).collect();
    folders.reverse();
    let known: Vec<PathBuf> = folders.iter().filter(|folder| folder.is_dir()).cloned().collect();
    if known.is_empty() { folders } else { known }
}

/// Finds the picture of a name, in the folder of its name or without that.
fn find(folders: &[PathBuf], name: &str) -> Option<PathBuf> {
    let base = name.rsplit('/').next().unwrap_or(name);
    let tried = folders.iter().flat_map(|folder| [folder.join(name), folder.join(base)]);
    let ended = tried.flat_map(|path| {
        ENDINGS.iter().map(move |ending| {
            let mut text = path.clone().into_os_string();
            text.push(ending);
            PathBuf::from(text)
        })
    });
    ended.into_iter().find(|path| path.is_file())
}

fn copy(from: &Path, to: &Path) -> Result<(), FileError> {
    if let Some(folder) = to.parent() {
        files::create_folder(folder)?;
    }
    fs::copy(from, to).map(drop).map_err(|source| FileError::Unwritable { path: to.to_owned(), source })
}
