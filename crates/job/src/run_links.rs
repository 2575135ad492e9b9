//! Links of the pages of a run to the files that lie in its folder.
//!
//! The page of a run is written before what is made of it. So what makes products lays new links
//! into the page ([`refresh`]); everything else of the page stays.

use std::path::Path;

use report::{PageLink, with_links};

use crate::files::{FileError, read_text};

/// Page of a run.
const PAGE: &str = "report/report.html";
/// Record of a batch for the surface model of a scene. It knows the hash of the page.
const BATCH_RECORD: &str = "tasks/dsm.json";

/// What may lie in the folder of a run, and what it is.
const KNOWN: [(&str, &str); 33] = [
    ("report/report.html", "report of the surface model"),
    ("dsm/dsm.tif", "heights of the upper surface"),
    ("dsm/sigma.tif", "standard deviation of the heights"),
    ("dsm/confidence.tif", "probability that the height is right"),
    ("dsm/source.tif", "where each height comes from"),
    ("dsm/filled.tif", "filled cells"),
    ("dsm/views.tif", "number of views behind each height"),
    ("dsm/relief.png", "picture in the colours of a map"),
    ("dsm/hillshade.png", "picture in the light of the north-west"),
    ("stac/item.json", "description for catalogues (STAC)"),
    ("report/report.json", "all numbers of the report"),
    ("used_config.toml", "settings of the run"),
    ("eval/report.html", "errors against a reference"),
    ("ortho/ortho.tif", "images laid on the surface"),
    ("ortho.tif", "images laid on the surface"),
    ("dtm/dtm.html", "the bare ground: report"),
    ("dtm/dtm.tif", "the bare ground"),
    ("classes/classes.html", "ground, buildings, vegetation: report"),
    ("diff/diff.html", "change against another date"),
    ("heightmap.tif", "height map"),
    ("priors/report.html", "priors of a city model"),
    ("products/products.html", "products: report"),
    ("products/ortho.tif", "images laid on the surface"),
    ("products/dtm/dtm.html", "the bare ground: report"),
    ("products/dtm/dtm.tif", "the bare ground"),
    ("products/dtm/height_above_ground.tif", "heights above the ground"),
    ("products/classes/classes.html", "ground, buildings, vegetation: report"),
    ("products/classes/classes.tif", "ground, buildings, vegetation"),
    ("products/contours.gpkg", "contour lines of the ground"),
    ("products/cloud.laz", "coloured points (LAZ)"),
    ("products/cloud.copc.laz", "coloured points (COPC)"),
    ("products/mesh.glb", "textured mesh (GLB)"),
    ("products/tileset.json", "textured mesh (3D Tiles)"),
];

/// Returns the links to the files for which `is_there`. `up` leads from the page to the folder of
/// the run, and the page itself is left out.
pub fn links(up: &str, page: &str, is_there: impl Fn(&str) -> bool) -> Vec<PageLink> {
    let known = KNOWN.iter().filter(|(path, _)| *path != page && is_there(path));
    known.map(|(path, title)| PageLink::new(format!("{up}{path}"), *title)).collect()
}

/// Lays links to all that lies in the folder of a run into its page. A run without a page, or with
/// one of an older version, stays as it is. So does a scene of a batch, which would take the
/// changed page for a damaged one; the page of the batch has its links.
pub fn refresh(run: &Path) -> Result<(), FileError> {
    let path = run.join(PAGE);
    let is_plain = |path: &Path| path.symlink_metadata().is_ok_and(|found| found.is_file());
    if run.join(BATCH_RECORD).exists() || !is_plain(&path) {
        return Ok(());
    }
    let Ok(old) = read_text(&path) else { return Ok(()) };
    let links = links("../", PAGE, |name| run.join(name).is_file());
    match with_links(&old, &links) {
        Some(new) if new != old => Ok(formats::write_bytes(&path, new.as_bytes(), true)?),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_links_to_what_is_there() {
        let run = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let path = run.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        refresh(run.path()).unwrap();
        put(PAGE, &report::JobPage::default().html().unwrap());
        put("products/mesh.glb", "");
        refresh(run.path()).unwrap();
        let page = || std::fs::read_to_string(run.path().join(PAGE)).unwrap();
        assert!(page().contains("href=\"../products/mesh.glb\"") && !page().contains("cloud.laz"));
        // The batch knows the hash of the page of its scene.
        put(BATCH_RECORD, "{}");
        put("products/cloud.laz", "");
        refresh(run.path()).unwrap();
        assert!(!page().contains("cloud.laz"));
        std::fs::remove_file(run.path().join(BATCH_RECORD)).unwrap();
        refresh(run.path()).unwrap();
        assert!(page().contains("cloud.laz"));
        put(PAGE, "a page without the marks");
        refresh(run.path()).unwrap();
        assert_eq!(page(), "a page without the marks");
    }
}
