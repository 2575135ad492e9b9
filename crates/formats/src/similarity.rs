//! Reading the similarity from a model's frame to the frame of the cameras, as JSON.
//!
//! camera = s · R · (model + (0, 0, vertical offset)) + t. A file has either the parts
//!
//! ```json
//! {
//!   "scale": 1.0,
//!   "rotation": [1, 0, 0, 0],
//!   "translation": [-690000.0, -5336000.0, 0.0],
//!   "vertical_offset_m": 45.2
//! }
//! ```
//!
//! or a matrix of four rows under `base_to_canonical`, `camera_from_model` or `matrix`, or that
//! matrix alone. At least one part is required; the rotation is a quaternion with w first, or three
//! rows. A matrix under `canonical_to_base` or `model_from_camera` is the inverse. The vertical
//! offset, metres, is added to the model's heights: it is the geoid's height above the ellipsoid
//! when the model has heights above the geoid and the cameras have ellipsoidal heights. Unknown
//! keys are refused.

use std::path::Path;

use camera::{Pose, Similarity, SimilarityError};
use serde::Deserialize;

use crate::format_error::FormatError;
use crate::regular::read_regular;

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 1 << 20;

/// A defect of the text or of its numbers.
#[derive(Debug)]
enum Fault {
    Text(String),
    Numbers(SimilarityError),
}

type Rows = Vec<Vec<f64>>;

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Parts {
    scale: Option<f64>,
    rotation: Option<Rotation>,
    translation: Option<[f64; 3]>,
    vertical_offset_m: Option<f64>,
    #[serde(alias = "camera_from_model", alias = "matrix")]
    base_to_canonical: Option<Rows>,
    #[serde(alias = "model_from_camera")]
    canonical_to_base: Option<Rows>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Rotation {
    Quaternion([f64; 4]),
    Rows([[f64; 3]; 3]),
}

/// Reads the similarity from the model's frame to the frame of the cameras, including the vertical
/// offset.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("camera_from_model.json");
/// std::fs::write(&path, r#"{ "translation": [-1000.0, -2000.0, 0.0], "vertical_offset_m": 45.5 }"#)?;
///
/// let camera_from_model = formats::similarity::read(&path)?;
/// assert_eq!(camera_from_model.apply([1010.0, 2020.0, 1.0]), [10.0, 20.0, 46.5]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FormatError`] when the system refuses, for a file larger than 1 MiB or not of the documented
/// form, for a scale that is not positive, a matrix that mirrors or shears, and numbers that are
/// not finite.
pub fn read(path: impl AsRef<Path>) -> Result<Similarity, FormatError> {
    let path = path.as_ref();
    let unreadable = |source| FormatError::unreadable(path, "the file", source);
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    let invalid = |what: String| FormatError::new(path, format_args!("not a similarity ({what})"));
    if size > SIZE_LIMIT {
        return Err(invalid(format!("it has {size} bytes, expected at most {SIZE_LIMIT}")));
    }
    parse(&read_regular(path, SIZE_LIMIT).map_err(unreadable)?).map_err(|fault| match fault {
        Fault::Text(what) => invalid(what),
        Fault::Numbers(source) => FormatError::because(path, source.to_string(), source),
    })
}

fn parse(bytes: &[u8]) -> Result<Similarity, Fault> {
    let json = |error: serde_json::Error| Fault::Text(error.to_string());
    if bytes.trim_ascii_start().starts_with(b"[") {
        return matrix(&serde_json::from_slice(bytes).map_err(json)?);
    }
    let parts: Parts = serde_json::from_slice(bytes).map_err(json)?;
    let has_parts = parts.scale.is_some() || parts.rotation.is_some() || parts.translation.is_some();
    let camera_from_model = match (&parts.base_to_canonical, &parts.canonical_to_base, has_parts) {
        (Some(rows), None, false) => matrix(rows)?,
        (None, Some(rows), false) => matrix(rows)?.inverse(),
        (None, None, true) => of_parts(&parts)?,
        (None, None, false) if parts.vertical_offset_m.is_some() => Similarity::IDENTITY,
        (None, None, false) => {
            return Err(Fault::Text(
                "it has no key of a similarity, expected scale, rotation, translation or a matrix".to_owned(),
            ));
        }
        _ => return Err(Fault::Text("it has a matrix and other parts, expected one or the other".to_owned())),
    };
    let raised = [0.0, 0.0, parts.vertical_offset_m.unwrap_or(0.0)];
    let raise = Similarity::new(1.0, Similarity::IDENTITY.rotation(), raised).map_err(Fault::Numbers)?;
    Ok(camera_from_model.after(&raise))
}

fn of_parts(parts: &Parts) -> Result<Similarity, Fault> {
    let rotation = match parts.rotation {
        None => Similarity::IDENTITY.rotation(),
        Some(Rotation::Rows(rows)) => rows,
        Some(Rotation::Quaternion(quaternion)) => {
            let pose = Pose::from_quaternion(quaternion, [0.0; 3]);
            pose.ok_or_else(|| Fault::Text("the quaternion is zero or not finite".to_owned()))?.rotation
        }
    };
    Similarity::new(parts.scale.unwrap_or(1.0), rotation, parts.translation.unwrap_or_default()).map_err(Fault::Numbers)
}

/// Makes a similarity of three or four rows of four numbers.
fn matrix(rows: &Rows) -> Result<Similarity, Fault> {
    let row = |i: usize| <[f64; 4]>::try_from(rows.get(i)?.as_slice()).ok();
    let last_fits = rows.get(3).is_none_or(|last| last.as_slice() == [0.0, 0.0, 0.0, 1.0]);
    match (row(0), row(1), row(2)) {
        (Some(a), Some(b), Some(c)) if last_fits && rows.len() <= 4 => {
            Similarity::from_matrix([a, b, c]).map_err(Fault::Numbers)
        }
        _ => Err(Fault::Text(
            "the matrix is of another form, expected four rows of four numbers, the last 0 0 0 1".to_owned(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Similarity, Fault> {
        parse(text.as_bytes())
    }

    #[track_caller]
    fn check(text: &str, from: [f64; 3], to: [f64; 3]) {
        let found = read_text(text).unwrap().apply(from);
        assert!((0..3).all(|i| (found[i] - to[i]).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn all_forms_are_read() {
        let p = [690_010.0, 5_336_020.0, 500.0];
        check(r#"{"translation": [-690000, -5336000, -500]}"#, p, [10.0, 20.0, 0.0]);
        check(r#"{"vertical_offset_m": 45.5}"#, p, [p[0], p[1], 545.5]);
        // A quarter turn about z and a scale of 2; the offset is added before both.
        let quarter =
            r#"{"scale": 2, "rotation": [0.7071067811865476, 0, 0, 0.7071067811865476], "vertical_offset_m": 1}"#;
        check(quarter, [1.0, 0.0, 0.0], [0.0, 2.0, 2.0]);
        check(r#"{"rotation": [[0,-1,0],[1,0,0],[0,0,1]]}"#, [1.0, 2.0, 3.0], [-2.0, 1.0, 3.0]);
        let rows = "[[0,-2,0,5],[2,0,0,6],[0,0,2,7],[0,0,0,1]]";
        check(rows, [1.0, 2.0, 3.0], [1.0, 8.0, 13.0]);
        check(&format!(r#"{{"base_to_canonical": {rows}}}"#), [1.0, 2.0, 3.0], [1.0, 8.0, 13.0]);
        check(&format!(r#"{{"matrix": {rows}, "vertical_offset_m": 1}}"#), [1.0, 2.0, 2.0], [1.0, 8.0, 13.0]);
        check(&format!(r#"{{"canonical_to_base": {rows}}}"#), [1.0, 8.0, 13.0], [1.0, 2.0, 3.0]);
    }

    #[test]
    fn what_is_none_is_refused() {
        #[track_caller]
        fn refused(text: &str, words: &str) {
            let fault = match read_text(text).unwrap_err() {
                Fault::Text(what) => what,
                Fault::Numbers(source) => source.to_string(),
            };
            assert!(fault.contains(words), "{fault}");
        }
        refused("", "EOF");
        refused("{}", "no key");
        refused(r#"{"scales": 1}"#, "unknown field");
        refused(r#"{"scale": NaN}"#, "line 1");
        refused(r#"{"scale": 1e999}"#, "out of range");
        refused(r#"{"scale": 0}"#, "scale is 0");
        refused(r#"{"scale": 1e300}"#, "scale is");
        refused(r#"{"rotation": [0, 0, 0, 0]}"#, "quaternion");
        refused(r#"{"rotation": [1, 0, 0]}"#, "variant");
        refused(r#"{"rotation": [[1,0,0],[0,1,0],[0,0,-1]]}"#, "mirrors");
        refused(r#"{"scale": 1, "matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}"#, "one or the other");
        refused("[[1,0,0,0],[0,1,0,0],[0,0,0,0],[0,0,0,1]]", "scale is 0");
        refused("[[1,0,0,0],[0,1,0,0],[0,0,3,0],[0,0,0,1]]", "no rotation");
        refused("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]", "0 0 0 1");
        refused("[[1,0,0],[0,1,0],[0,0,1]]", "four rows");
        refused(&format!(r#"{{"rotation": {}"#, "[".repeat(100_000)), "recursion");
    }
}
