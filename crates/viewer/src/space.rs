//! Splats, meshes and cameras of the inputs, for a page of its own.
//!
//! All lie in the map of the first file that names one. Positions are counted from its origin.

use std::path::{Path, PathBuf};

use formats::splat_files::SplatFormat;
use formats::splat_ply::{LocalOrigin, SplatFile, SplatForm};
use hyper::body::Bytes;
use numeric::Progress;
use serde::Serialize;
use serde_json::Value;

use super::error::ViewError;
use super::http::{Answer, BINARY};
use super::packed;
use super::query::whole;
use super::rasters;
use job::dataset_folder::{UNKNOWN_FRAME, sparse_folder};
use job::error::JobError;
use job::error_text::with_causes;
use job::placed_model;

/// Most splats: 256 MB to send without harmonics. A browser sorts them in about a second.
const SPLATS_MAX: usize = 8_000_000;
/// Most bytes of splats and harmonics: those that a page may hold twice.
const SPLAT_BYTES_MAX: usize = 1 << 30;
/// Largest mesh, bytes.
const MESH_BYTES_MAX: u64 = 512 << 20;
/// Most files of splats and meshes.
const FILES_MAX: usize = 16;
/// Longest header of a PLY file, bytes.
const HEADER_MAX: usize = 16 << 10;
/// Largest report of a training, bytes.
const REPORT_MAX: u64 = 64 << 20;

/// What the page shows.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Space {
    /// Reference system of the map; `None` where no file names one.
    crs: Option<String>,
    /// Its name for people.
    crs_name: Option<String>,
    vertical: String,
    /// What positions are counted from.
    origin: [f64; 3],
    has_origin: bool,
    /// Whether there is a page of a map, too.
    pub(super) has_map: bool,
    splats: Vec<SpaceSplats>,
    meshes: Vec<SpaceMesh>,
    cameras: Vec<SpaceCamera>,
    /// Inputs that have nothing for a map.
    #[serde(skip)]
    taken: Vec<PathBuf>,
}

#[derive(Debug, Clone, Serialize)]
struct SpaceSplats {
    name: String,
    count: usize,
    /// Whether they are flat.
    discs: bool,
    /// Degree of the harmonics.
    degree: u8,
    /// Origin of the file, counted from that of the scene.
    shift: [f64; 3],
    /// Whether they have classes and objects of a city model.
    labelled: bool,
    #[serde(skip)]
    words: Bytes,
    #[serde(skip)]
    harmonics: Bytes,
    /// Objects and classes, as [`packed::labels`] packs them; nothing where there are none.
    #[serde(skip)]
    labels: Bytes,
    /// The table of the objects as JSON.
    #[serde(skip)]
    objects: Bytes,
}

#[derive(Debug, Clone, Serialize)]
struct SpaceMesh {
    name: String,
    shift: [f64; 3],
    #[serde(skip)]
    bytes: Bytes,
}

/// A camera to fly to, without the distortion of its lens.
#[derive(Debug, Clone, Serialize)]
struct SpaceCamera {
    name: String,
    held_out: bool,
    focal: [f64; 2],
    principal: [f64; 2],
    size: [usize; 2],
    /// Rows: right, down and forward in the scene.
    rotation: [[f64; 3]; 3],
    centre: [f64; 3],
}

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Splats,
    Mesh,
}

impl Space {
    /// Reads the splats, meshes and cameras of the inputs; those of folders may be left out.
    ///
    /// # Errors
    /// [`ViewError`] for a file that was named and cannot be read or is too large, and when the job
    /// was cancelled.
    pub(super) fn open(inputs: &[PathBuf], progress: &dyn Progress) -> Result<Self, ViewError> {
        let mut space = Self::default();
        let mut left_out = 0;
        for input in inputs {
            progress.check_cancelled().map_err(JobError::from)?;
            let is_named = !input.is_dir();
            let files = if is_named { vec![input.clone()] } else { files_in(input) };
            for (path, kind) in files.iter().filter_map(|path| Some((path, kind(path)?))) {
                if space.splats.len() + space.meshes.len() == FILES_MAX {
                    left_out += 1;
                    continue;
                }
                match space.add(path, kind, progress) {
                    Ok(()) => {}
                    Err(error) if is_named => return Err(error),
                    Err(error) => progress.warn(&format!("left out: {}", with_causes(&error))),
                }
                if is_named {
                    space.taken.push(input.clone());
                }
            }
        }
        if left_out > 0 {
            progress.warn(&format!("{left_out} further splats and meshes are left out: at most {FILES_MAX} are shown"));
        }
        let held_out: Vec<String> = inputs.iter().flat_map(|input| held_out(input)).collect();
        for input in inputs.iter().filter(|input| input.is_dir()) {
            if let Err(error) = space.add_cameras(input, &held_out) {
                progress.warn(&format!("its cameras are left out: {}", with_causes(&error)));
            }
        }
        let for_space = |input: &&PathBuf| input.is_dir() && rasters::find(&[(*input).clone()]).is_err();
        // A folder with neither is told of where its rasters are missed.
        if !space.is_empty() {
            space.taken.extend(inputs.iter().filter(for_space).cloned());
        }
        Ok(space)
    }

    /// Returns the inputs that may have something for a map.
    pub(super) fn others(&self, inputs: &[PathBuf]) -> Vec<PathBuf> {
        inputs.iter().filter(|input| !self.taken.contains(input)).cloned().collect()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.splats.is_empty() && self.meshes.is_empty()
    }

    /// Names of what is shown.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        let splats = self.splats.iter().map(|layer| layer.name.clone());
        splats.chain(self.meshes.iter().map(|layer| layer.name.clone()))
    }

    /// Answers the part of an address after the token.
    pub(super) fn bytes(&self, kind: &str, name: &str) -> Option<Answer> {
        let number = |ending: &str| name.strip_suffix(ending).and_then(whole);
        let body = match kind {
            "splats" => &self.splats.get(number(".bin")?)?.words,
            "harmonics" => &self.splats.get(number(".bin")?)?.harmonics,
            "labels" => &self.splats.get(number(".bin")?).filter(|layer| layer.labelled)?.labels,
            "objects" => {
                let layer = self.splats.get(number(".json")?).filter(|layer| layer.labelled)?;
                return Some(Answer { kind: "application/json", body: layer.objects.clone() });
            }
            _ => &self.meshes.get(number(".glb")?)?.bytes,
        };
        Some(Answer { kind: BINARY, body: body.clone() })
    }

    fn add(&mut self, path: &Path, kind: Kind, progress: &dyn Progress) -> Result<(), ViewError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let too_large = |what, found: u64, most: u64| ViewError::TooLarge { path: path.to_owned(), what, found, most };
        if kind == Kind::Mesh {
            let unreadable = |source| ViewError::Mesh { path: path.to_owned(), source };
            let length = std::fs::metadata(path).map_err(unreadable)?.len();
            if length > MESH_BYTES_MAX {
                return Err(too_large("bytes of a mesh", length, MESH_BYTES_MAX));
            }
            let bytes = std::fs::read(path).map_err(unreadable)?.into();
            let Some(shift) = self.place(LocalOrigin::read_beside(path)?.as_ref(), path, progress) else {
                return Ok(());
            };
            self.meshes.push(SpaceMesh { name, shift, bytes });
            return Ok(());
        }
        let file: SplatFile = formats::splat_files::read(path)?;
        let known: usize = self.splats.iter().map(|layer| layer.count).sum();
        let found = known + file.splats.len();
        if found > SPLATS_MAX {
            return Err(too_large("splats", found as u64, SPLATS_MAX as u64));
        }
        let Some(shift) = self.place(file.origin.as_ref(), path, progress) else { return Ok(()) };
        let (words, harmonics, labels) = (packed::splats(&file), packed::harmonics(&file), packed::labels(&file));
        let table = file.labels.as_ref().map(|labels| serde_json::to_vec(&labels.table).unwrap_or_default());
        let size = |layer: &SpaceSplats| layer.words.len() + layer.harmonics.len() + layer.labels.len();
        let bytes: usize = self.splats.iter().map(size).sum();
        let bytes = bytes + words.len() + harmonics.len() + labels.len();
        if bytes > SPLAT_BYTES_MAX {
            return Err(too_large("bytes of splats and harmonics", bytes as u64, SPLAT_BYTES_MAX as u64));
        }
        self.splats.push(SpaceSplats {
            name,
            count: file.splats.len(),
            discs: file.is_flat() || file.layout.form == SplatForm::Discs,
            degree: file.harmonics.as_ref().map_or(0, |harmonics| harmonics.degree()),
            shift,
            labelled: table.is_some(),
            words: words.into(),
            harmonics: harmonics.into(),
            labels: labels.into(),
            objects: table.unwrap_or_default().into(),
        });
        Ok(())
    }

    /// Returns where the origin of a file lies in the scene; the first one makes the scene. `None`
    /// with a warning for a file on another map. Files without an origin lie in the scene's frame.
    fn place(&mut self, origin: Option<&LocalOrigin>, path: &Path, progress: &dyn Progress) -> Option<[f64; 3]> {
        let Some(origin) = origin else { return Some([0.0; 3]) };
        let crs = Some(origin.crs.clone()).filter(|crs| crs != UNKNOWN_FRAME);
        if !self.has_origin {
            let named = |crs: &String| crs.split('"').nth(1).unwrap_or(crs).to_owned();
            self.crs_name = crs.as_ref().map(named);
            (self.crs, self.vertical) = (crs, origin.vertical.clone());
            (self.origin, self.has_origin) = (origin.origin, true);
            return Some([0.0; 3]);
        }
        if crs != self.crs {
            progress.warn(&format!("left out, because it lies on another map ({}): {}", origin.crs, path.display()));
            return None;
        }
        Some([0, 1, 2].map(|i| origin.origin[i] - self.origin[i]))
    }

    fn add_cameras(&mut self, folder: &Path, held_out: &[String]) -> Result<(), JobError> {
        let sparse = sparse_folder(folder);
        if self.is_empty() || !["bin", "txt"].iter().any(|kind| sparse.join(format!("cameras.{kind}")).is_file()) {
            return Ok(());
        }
        let model = if self.has_origin {
            let crs = self.crs.clone().unwrap_or_else(|| UNKNOWN_FRAME.to_owned());
            placed_model::read(folder, &LocalOrigin::new(crs, self.vertical.clone(), self.origin))?
        } else {
            formats::colmap::read(&sparse)?
        };
        for view in model.views {
            let Some(lens) = model.lenses.get(view.lens) else { continue };
            let principal = lens.principal_point();
            self.cameras.push(SpaceCamera {
                held_out: held_out.contains(&view.name),
                name: view.name,
                focal: lens.focal_px(),
                principal: [principal.sample, principal.line],
                size: [lens.width(), lens.height()],
                rotation: view.pose.rotation,
                centre: view.pose.centre,
            });
        }
        self.cameras.sort_by(|a, b| a.name.cmp(&b.name));
        self.taken.push(folder.to_owned());
        Ok(())
    }
}

/// Returns the names of the views that a training held out.
fn held_out(folder: &Path) -> Vec<String> {
    let text = formats::read_regular_text(&folder.join("report.json"), REPORT_MAX);
    let report: Value = text.ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    let views = report["views"].as_array().into_iter().flatten();
    let held = views.filter(|view| view["held_out"] == true);
    held.filter_map(|view| view["name"].as_str().map(str::to_owned)).collect()
}

/// Returns the files of a folder that may be splats or meshes, by name.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten().take(2000);
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

/// Returns what a file is by its name and its first bytes.
fn kind(path: &Path) -> Option<Kind> {
    match SplatFormat::of_ending(path)? {
        SplatFormat::Spz | SplatFormat::Sog => Some(Kind::Splats),
        // Clouds and meshes have no opacities.
        SplatFormat::Ply => starts_with(path, HEADER_MAX, "opacity").then_some(Kind::Splats),
        SplatFormat::Glb if starts_with(path, 1 << 20, "KHR_gaussian_splatting") => Some(Kind::Splats),
        SplatFormat::Glb => Some(Kind::Mesh),
    }
}

/// Whether the first bytes of a file hold a word.
fn starts_with(path: &Path, length: usize, word: &str) -> bool {
    use std::io::Read;
    let mut head = Vec::new();
    let read = formats::open_regular(path).and_then(|file| file.take(length as u64).read_to_end(&mut head));
    read.is_ok() && head.windows(word.len()).any(|part| part == word.as_bytes())
}
