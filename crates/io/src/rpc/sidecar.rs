//! RPC files beside an image: `NAME_RPC.TXT`, `NAME.RPB`, DIMAP's `RPC_NAME.XML`, ALOS' `RPC-NAME.txt`, `NAME.geom`, ….
//!
//! Names are compared without regard to case. Only files in the image's own folder are looked at.
//!
//! A `.geom` describes the scene that the image was cut from, as OTB has it: where the image has no map projection and its
//! geotransform is a whole number of pixels, that is the origin of the cut, and the RPC is moved by it.

use std::path::{Path, PathBuf};

use gdal::Dataset;

use super::error::Attempt;
use super::{RpcFile, RpcFormat, RpcReadError, read_text_file};

/// Endings that follow the image's name without its extension, in the order of preference.
const ENDINGS: [&str; 6] = ["_rpc.txt", ".rpb", ".xml", ".rpc", ".geom", ".json"];

/// The RPC of the first file beside `image` that has one; `tried` receives the names that were looked for.
pub(super) fn read(
    image: &Path,
    dataset: Option<&Dataset>,
    tried: &mut Vec<Attempt>,
) -> Result<Option<RpcFile>, RpcReadError> {
    for candidate in candidates(image, tried)? {
        match read_text_file(&candidate) {
            Ok(mut file) => {
                if file.format == RpcFormat::OssimGeom {
                    move_to_cut(&mut file, dataset);
                }
                return Ok(Some(file));
            }
            Err(RpcReadError::NotRpc { .. }) => tried.push(Attempt::new(file_name(&candidate), "no RPC in it")),
            Err(e) => return Err(e),
        }
    }
    Ok(None)
}

/// Existing files whose names fit, best first.
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
        tried.push(Attempt::new(what, "none there"));
    }
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

/// How well a file name fits an image; all names in lower case, smaller is better.
fn rank(stem: &str, full: &str, name: &str) -> Option<usize> {
    let plain = name.strip_prefix(stem).and_then(|rest| ENDINGS.iter().position(|e| *e == rest));
    let aux = || (name.strip_prefix(full) == Some(".aux.xml")).then_some(ENDINGS.len());
    plain.or_else(aux).or_else(|| dimap(stem, name)).or_else(|| alos(stem, name))
}

/// `img_X_r1c1` belongs to `rpc_X.xml`, also where the image's name has more at its end (`_p` of Pléiades Neo).
/// Other tiles do not: where they lie in the scene is not in the RPC file.
fn dimap(stem: &str, name: &str) -> Option<usize> {
    let scene = stem.strip_prefix("img_")?.strip_suffix("_r1c1")?;
    let of_rpc = name.strip_prefix("rpc_")?.strip_suffix(".xml")?;
    let rest = scene.strip_prefix(of_rpc)?;
    (rest.is_empty() || rest.starts_with('_')).then_some(ENDINGS.len() + 1 + rest.len())
}

/// `img-X` and `img-01-X` belong to `rpc-X.txt`.
fn alos(stem: &str, name: &str) -> Option<usize> {
    let scene = stem.strip_prefix("img-")?;
    let of_rpc = name.strip_prefix("rpc-")?.strip_suffix(".txt")?;
    let band = scene.strip_suffix(of_rpc)?.strip_suffix('-').unwrap_or("");
    let fits = scene == of_rpc || (band.len() == 2 && band.bytes().all(|b| b.is_ascii_digit()));
    fits.then_some(ENDINGS.len() + 1)
}

/// Counts image coordinates from the cut's own first pixel.
fn move_to_cut(file: &mut RpcFile, dataset: Option<&Dataset>) {
    let Some(dataset) = dataset.filter(|d| d.projection().is_empty()) else { return };
    let Ok([x, dx, rx, y, ry, dy]) = dataset.geo_transform() else { return };
    let is_cut = dx == 1.0 && dy.abs() == 1.0 && rx == 0.0 && ry == 0.0 && x.fract() == 0.0 && y.fract() == 0.0;
    if !is_cut {
        let what = "the image has a geotransform that is no cut of the .geom's scene: the RPC is used as it is";
        file.warnings.push(what.to_owned());
    } else if (x, y) != (0.0, 0.0) {
        file.rpc.samp_off -= x;
        file.rpc.line_off -= y;
        file.warnings
            .push(format!("the image is a cut at sample {x}, line {y} of the .geom's scene: the RPC was moved"));
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
