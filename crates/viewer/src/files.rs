//! The files of the page, which are part of the program.

use super::http::Answer;

/// Files of the page by their names in the address: name, type, content.
const FILES: [(&str, &str, &str); 9] = [
    ("", "text/html; charset=utf-8", include_str!("page/index.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("main.js", SCRIPT, include_str!("page/main.js")),
    ("map.js", SCRIPT, include_str!("page/map.js")),
    ("legend.js", SCRIPT, include_str!("page/legend.js")),
    ("numbers.js", SCRIPT, include_str!("page/numbers.js")),
    ("profile.js", SCRIPT, include_str!("page/profile.js")),
    ("surface.js", SCRIPT, include_str!("page/surface.js")),
    ("vectors.js", SCRIPT, include_str!("page/vectors.js")),
];
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Returns the file of a name.
pub(super) fn file(name: &str) -> Option<Answer> {
    let (_, kind, content) = FILES.iter().find(|(own, ..)| *own == name)?;
    Some(Answer { kind, body: content.as_bytes().to_vec() })
}
