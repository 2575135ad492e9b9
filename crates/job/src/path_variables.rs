//! Environment variables in the paths of job files and batch files: `${NAME}` stands for the value
//! of the variable `NAME`.
//!
//! A variable that is not set is an error: an empty text in its place would name another folder.

use std::path::{Path, PathBuf};

/// Returns a path with the values of the variables that it names.
///
/// # Errors
/// A text that names the variable that is not set, or the brace that is not closed.
pub fn expanded(path: &Path) -> Result<PathBuf, String> {
    expanded_with(&path.to_string_lossy(), |name| std::env::var(name).ok()).map(PathBuf::from)
}

fn expanded_with(path: &str, value: impl Fn(&str) -> Option<String>) -> Result<String, String> {
    let (mut out, mut rest) = (String::new(), path);
    while let Some((before, behind)) = rest.split_once("${") {
        let (name, after) = behind
            .split_once('}')
            .ok_or_else(|| format!("the path {path:?} has `${{` without a closing `}}`; expected ${{NAME}}"))?;
        let value = value(name).ok_or_else(|| {
            format!("the environment variable `{name}` of the path {path:?} is not set; set it or write the path out")
        })?;
        out.push_str(before);
        out.push_str(&value);
        rest = after;
    }
    Ok(out + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_are_replaced_once_and_must_be_set() {
        let value = |name: &str| match name {
            "DATA" => Some("/data".to_owned()),
            "DAY" => Some("${DATA}".to_owned()),
            _ => None,
        };
        assert_eq!(expanded_with("${DATA}/a$b/*.tif", value).unwrap(), "/data/a$b/*.tif");
        assert_eq!(expanded_with("x/${DAY}/${DATA}", value).unwrap(), "x/${DATA}//data");
        let unset = expanded_with("${SCENES}/a.tif", value).unwrap_err();
        assert!(unset.contains("`SCENES` of the path \"${SCENES}/a.tif\" is not set"), "{unset}");
        assert!(expanded_with("${DATA/a.tif", value).unwrap_err().contains("closing"));
    }
}
