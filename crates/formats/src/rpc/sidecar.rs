//! RPC files beside an image: `NAME_RPC.TXT`, `NAME.RPB`, DIMAP's `RPC_NAME.XML`, ALOS'
//! `RPC-NAME.txt`, `NAME.geom`, ….
//!
//! Letter case in names does not matter. Only files in the image's folder are considered.
//!
//! A `.geom` describes the scene that the image was cut from (OTB's convention). An image without
//! map projection whose geotransform is a shift by whole pixels is such a cut: the shift is its
//! origin in the scene, and the RPC is moved by it.

use std::path::{Path, PathBuf};

use gdal::Dataset;

use super::error::{Attempt, RpcReadError};
use super::format::RpcFormat;
use super::rpc_file::RpcFile;
use super::text_file;
use crate::stac::{is_item_name, read_item};

/// Endings after the image's name without its extension, best first.
const ENDINGS: [&str; 6] = ["_rpc.txt", ".rpb", ".xml", ".rpc", ".geom", ".json"];

/// Reads the RPC of the first file beside `image` that has one. Adds every other candidate to
/// `tried`.
pub(super) fn read(
    image: &Path,
    dataset: Option<&Dataset>,
    tried: &mut Vec<Attempt>,
) -> Result<Option<RpcFile>, RpcReadError> {
    for candidate in candidates(image, tried)? {
        match text_file::read(&candidate) {
            Ok(mut file) => {
                if file.format == RpcFormat::OssimGeom {
                    move_to_cut(&mut file, dataset);
                }
                return Ok(Some(file));
            }
            Err(RpcReadError::NotRpc { .. }) => tried.push(Attempt::new(file_name(&candidate), "it has no RPC")),
            Err(e) => return Err(e),
        }
    }
    Ok(None)
}

/// Reads the RPCs of all files beside an image that have one. That of a `.geom` is that of the
/// scene, which is the image's own only where the image is no cut of it.
pub(super) fn all(image: &Path) -> Vec<RpcFile> {
    let files = candidates(image, &mut Vec::new()).unwrap_or_default();
    let read = files.iter().filter_map(|file| text_file::read(file).ok());
    read.filter(|file| file.format != RpcFormat::OssimGeom).collect()
}

/// Returns the files beside an image that may hold its RPC, best first; none where the folder
/// cannot be read. Of a STAC item they are those of its image, the image itself, and the item's RPC
/// file.
pub fn side_files(image: &Path) -> Vec<PathBuf> {
    let item = is_item_name(image).then(|| read_item(image).ok()).flatten();
    let beside = item.as_ref().map_or(image, |item| &item.image);
    let mut files = candidates(beside, &mut Vec::new()).unwrap_or_default();
    files.extend(item.into_iter().flat_map(|item| [Some(item.image), item.rpc]).flatten());
    files
}

/// Returns the existing files whose names fit, best first.
fn candidates(image: &Path, tried: &mut Vec<Attempt>) -> Result<Vec<PathBuf>, RpcReadError> {
    let stem = image.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    let full = file_name(image).to_lowercase();
    let folder = image.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let io = |source| RpcReadError::Io { path: folder.to_owned(), source };
    let mut found: Vec<(usize, PathBuf)> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = file_name(&path).to_lowercase();
        if let Some(rank) = rank(&stem, &full, &name).filter(|_| path.is_file() && name != full) {
            found.push((rank, path));
        }
    }
    found.sort();
    if found.is_empty() {
        let what = format!("files beside the image ({}, RPC_*.xml, RPC-*.txt)", ENDINGS.join(", "));
        tried.push(Attempt::new(what, "there are none"));
    }
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

/// Ranks how well the file name `name` fits an image, smaller is better. All names are in lower
/// case.
fn rank(stem: &str, full: &str, name: &str) -> Option<usize> {
    let plain = name.strip_prefix(stem).and_then(|rest| ENDINGS.iter().position(|e| *e == rest));
    let aux = || (name.strip_prefix(full) == Some(".aux.xml")).then_some(ENDINGS.len());
    plain.or_else(aux).or_else(|| dimap(stem, name)).or_else(|| alos(stem, name))
}

/// Whether a file has the name of the first tile of a DIMAP product, `IMG_X_R1C1`.
pub(super) fn is_first_tile(image: &Path) -> bool {
    let stem = image.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    product_of_first_tile(&stem).is_some()
}

/// Returns X of `img_x_r1c1`.
fn product_of_first_tile(stem: &str) -> Option<&str> {
    stem.strip_prefix("img_")?.strip_suffix("_r1c1")
}

/// Ranks DIMAP names: `rpc_X.xml` fits `dim_X`, which stands for all tiles, and `img_X_r1c1`, also
/// with more at the end of X (`_p` of Pléiades Neo).
///
/// It does not fit other tiles, because the RPC file does not have their position in the scene.
fn dimap(stem: &str, name: &str) -> Option<usize> {
    let scene = stem.strip_prefix("dim_").or_else(|| product_of_first_tile(stem))?;
    let of_rpc = name.strip_prefix("rpc_")?.strip_suffix(".xml")?;
    let rest = scene.strip_prefix(of_rpc)?;
    (rest.is_empty() || rest.starts_with('_')).then_some(ENDINGS.len() + 1 + rest.len())
}

/// Ranks ALOS names: `rpc-X.txt` fits `img-X` and `img-01-X`.
fn alos(stem: &str, name: &str) -> Option<usize> {
    let scene = stem.strip_prefix("img-")?;
    let of_rpc = name.strip_prefix("rpc-")?.strip_suffix(".txt")?;
    let band = scene.strip_suffix(of_rpc)?.strip_suffix('-').unwrap_or("");
    let fits = scene == of_rpc || (band.len() == 2 && band.bytes().all(|b| b.is_ascii_digit()));
    fits.then_some(ENDINGS.len() + 1)
}

/// Moves the RPC so that image coordinates are counted from the first pixel of the cut.
fn move_to_cut(file: &mut RpcFile, dataset: Option<&Dataset>) {
    let Some(dataset) = dataset.filter(|d| d.projection().is_empty()) else { return };
    let Ok([x, dx, rx, y, ry, dy]) = dataset.geo_transform() else { return };
    let is_cut = dx == 1.0 && dy.abs() == 1.0 && rx == 0.0 && ry == 0.0 && x.fract() == 0.0 && y.fract() == 0.0;
    if !is_cut {
        let what = "the geotransform is not a shift by whole pixels, so the image is not a cut of the .geom's scene: \
                    the RPC is used as it is";
        file.warnings.push(what.to_owned());
    } else if (x, y) != (0.0, 0.0) {
        file.rpc.samp_off -= x;
        file.rpc.line_off -= y;
        file.warnings
            .push(format!("the image is a cut of the .geom's scene at sample {x}, line {y}: the RPC was moved"));
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
