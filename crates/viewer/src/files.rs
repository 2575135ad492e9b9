//! The files of the page, which are part of the program.

use hyper::body::Bytes;

use super::http::Answer;

/// Files of the page by their names in the address: name, type, content.
const FILES: [(&str, &str, &str); 24] = [
    ("", HTML, include_str!("page/index.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("main.js", SCRIPT, include_str!("page/main.js")),
    ("map.js", SCRIPT, include_str!("page/map.js")),
    ("legend.js", SCRIPT, include_str!("page/legend.js")),
    ("numbers.js", SCRIPT, include_str!("page/numbers.js")),
    ("profile.js", SCRIPT, include_str!("page/profile.js")),
    ("surface.js", SCRIPT, include_str!("page/surface.js")),
    ("vectors.js", SCRIPT, include_str!("page/vectors.js")),
    (SPACE, HTML, include_str!("page/space/index.html")),
    ("space/space.css", "text/css; charset=utf-8", include_str!("page/space/space.css")),
    ("space/main.js", SCRIPT, include_str!("page/space/main.js")),
    ("space/camera.js", SCRIPT, include_str!("page/space/camera.js")),
    ("space/splats.js", SCRIPT, include_str!("page/space/splats.js")),
    ("space/objects.js", SCRIPT, include_str!("page/space/objects.js")),
    ("space/sort.js", SCRIPT, include_str!("page/space/sort.js")),
    ("space/mesh.js", SCRIPT, include_str!("page/space/mesh.js")),
    (ALIGN, HTML, include_str!("page/align/index.html")),
    ("align/align.css", "text/css; charset=utf-8", include_str!("page/align/align.css")),
    ("align/main.js", SCRIPT, include_str!("page/align/main.js")),
    ("align/clouds.js", SCRIPT, include_str!("page/align/clouds.js")),
    ("align/similarity.js", SCRIPT, include_str!("page/align/similarity.js")),
    ("align/dots.js", SCRIPT, include_str!("page/align/dots.js")),
    ("align/views.js", SCRIPT, include_str!("page/align/views.js")),
];
const SCRIPT: &str = "text/javascript; charset=utf-8";
const HTML: &str = "text/html; charset=utf-8";
/// Name of the page of splats and meshes.
pub(super) const SPACE: &str = "space.html";

/// Name of the page of the alignment by hand.
pub(super) const ALIGN: &str = "align.html";

/// Returns the file of a name.
pub(super) fn file(name: &str) -> Option<Answer> {
    let (_, kind, content) = FILES.iter().find(|(own, ..)| *own == name)?;
    Some(Answer { kind, body: Bytes::from_static(content.as_bytes()) })
}
