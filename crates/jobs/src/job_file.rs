//! Job files: the configuration of a job as TOML.
//!
//! Keys have the names of the fields of the configuration. Paths are relative to the file. A key
//! that no job has is an error that names the nearest known one. The `used_config.toml` of a run is
//! a job file. `${NAME}` in a path stands for the environment variable.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use numeric::nearest_name;
use serde::de::DeserializeOwned;

use crate::dsm::DsmConfig;
use crate::files::{FileError, read_text};
use crate::job_paths::resolved;
use crate::path_variables::expanded;

/// A commented job file for a surface model, with every key and its default.
pub const DSM_TEMPLATE: &str = include_str!("job_file/dsm.toml");

/// A job file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobFileError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A key that the job does not have.
    #[error(
        "unknown key `{key}` (line {line}); {}: {}",
        nearest.as_ref().map_or_else(|| format!("known are {}", known.join(", ")), |n| format!("did you mean `{n}`?")),
        path.display()
    )]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// Line of the key, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Known key that is most like it, if any is.
        nearest: Option<String>,
        /// Keys that are known in this place.
        known: Vec<String>,
    },
    /// Text that is not TOML, a value of the wrong type, or a missing key.
    #[error("{what} (line {line}): {}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line of the defect, from 1.
        line: usize,
        /// The text found and the text expected.
        what: String,
    },
    /// A path with an environment variable that is not set.
    #[error("{what}: {}", path.display())]
    Variable {
        /// The file.
        path: PathBuf,
        /// The variable and the path that names it.
        what: String,
    },
}

/// Reads the configuration of a surface model from a job file.
///
/// The output folder may be left out; the caller then gives it.
///
/// # Errors
/// [`JobFileError`].
pub fn read_dsm_job(path: &Path) -> Result<DsmConfig, JobFileError> {
    let mut config: DsmConfig = parse(&read_text(path)?, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let unset = RefCell::new(None);
    config.map_paths(|path| match expanded(path) {
        Ok(path) => resolved(&path, folder),
        Err(what) => {
            unset.borrow_mut().get_or_insert(what);
            path.to_owned()
        }
    });
    match unset.into_inner() {
        Some(what) => Err(JobFileError::Variable { path: path.to_owned(), what }),
        None => Ok(config),
    }
}

/// Whether a path has the ending of job files.
pub fn is_job_file(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Parses a configuration. `path` is the file for errors.
///
/// # Errors
/// [`JobFileError::UnknownKey`], [`JobFileError::Invalid`].
pub(crate) fn parse<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, JobFileError> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = 1 + text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count();
        defect(error.message(), line, path)
    })
}

/// Makes the error of a defect, which serde describes as `message`.
pub(crate) fn defect(message: &str, line: usize, path: &Path) -> JobFileError {
    let path = path.to_owned();
    let mut quoted = message.split('`').skip(1).step_by(2).map(str::to_owned);
    if message.starts_with("unknown field")
        && let Some(key) = quoted.next()
    {
        let known: Vec<String> = quoted.collect();
        let nearest = nearest_name(&key, known.iter().map(String::as_str)).map(str::to_owned);
        return JobFileError::UnknownKey { path, line, key, nearest, known };
    }
    let mut what = message.trim().replace('\n', " ");
    if what.starts_with("unknown variant")
        && let Some(value) = quoted.next()
    {
        let known: Vec<String> = quoted.collect();
        if let Some(nearest) = nearest_name(&value, known.iter().map(String::as_str)) {
            what += &format!("; did you mean `{nearest}`?");
        }
    }
    JobFileError::Invalid { path, line, what }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(text: &str) -> Result<DsmConfig, JobFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("job.toml");
        std::fs::write(&path, text).unwrap();
        read_dsm_job(&path).map(|mut config| {
            let root = folder.path().canonicalize().unwrap();
            config.map_paths(|path| path.strip_prefix(&root).unwrap_or(path).to_owned());
            config
        })
    }

    #[test]
    fn paths_are_relative_to_the_file() {
        let config = job("images = ['a.tif', '/far/b.tif']\noutput = 'out'\ngsd_m = 0.5\n").unwrap();
        assert_eq!(config.images, [Path::new("a.tif"), Path::new("/far/b.tif")]);
        assert_eq!((config.output.as_path(), config.gsd_m), (Path::new("out"), Some(0.5)));
    }

    #[test]
    fn a_variable_that_is_not_set_is_an_error() {
        let text = job("images = ['${SKYSWEEP_NO_SUCH}/a.tif']").unwrap_err().to_string();
        assert!(text.contains("`SKYSWEEP_NO_SUCH`") && text.contains("not set"), "{text}");
    }

    #[test]
    fn unknown_keys_are_errors_with_the_nearest_known_one() {
        for (key, meant) in
            [("gsd", "gsd_m"), ("chunks", "chunk"), ("memory", "memory_mb"), ("heigth_range_m", "height_range_m")]
        {
            let error = job(&format!("images = []\n\n{key} = 1\n")).unwrap_err();
            let text = error.to_string();
            assert!(text.contains(&format!("unknown key `{key}` (line 3); did you mean `{meant}`?")), "{text}");
        }
        let text = job("colour = 1").unwrap_err().to_string();
        assert!(text.contains("known are images, output, "), "{text}");
    }

    #[test]
    fn defects_have_their_line() {
        for (text, words) in [
            ("images = 3", "invalid type: integer `3`, expected a sequence (line 1)"),
            ("output = 'a'", "missing field `images`"),
            ("images = []\npreset = 'slow'", "(line 2)"),
            ("images = []\npreset = 'acurate'", "did you mean `accurate`? (line 2)"),
            ("images = [", "(line 1)"),
        ] {
            let error = job(text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    /// Positions of images count from 1, as on the command line, and a configuration that was used
    /// is one that can be used again.
    #[test]
    fn positions_count_from_one() {
        let text = "images = ['a.tif', 'b.tif', 'c.tif']\npairs = [[1, 3]]\nreferences = [1, 2]\n";
        let config = job(text).unwrap();
        assert_eq!(config.pairs.as_deref(), Some(&[crate::dsm::ImagePair::new(0, 2)][..]));
        assert_eq!(config.references.as_deref(), Some(&[0, 1][..]));
        let written = toml::to_string(&config).unwrap();
        assert!(written.contains("pairs = [[1, 3]]") && written.contains("references = [1, 2]"), "{written}");
        let again = job(&written).unwrap();
        assert_eq!((&again, toml::to_string(&again).unwrap()), (&config, written));
        for wrong in ["pairs = [[0, 1]]", "references = [0]"] {
            let error = job(&format!("images = ['a.tif', 'b.tif']\n{wrong}\n")).unwrap_err().to_string();
            assert!(error.contains("positions of images count from 1, found 0 (line 2)"), "{error}");
        }
    }

    /// The template has every key of the configuration, and the values that hold without it.
    #[test]
    fn the_template_has_every_key() {
        let JobFileError::UnknownKey { known, .. } = job("no_such_key = 1").unwrap_err() else { panic!("no list") };
        let is_key = |line: &&str| {
            line.trim_start_matches('#').trim().split_once(" = ").is_some_and(|(key, _)| known.iter().any(|k| k == key))
        };
        let keys: Vec<&str> = DSM_TEMPLATE.lines().filter(is_key).collect();
        assert_eq!(keys.len(), known.len(), "{keys:?} {known:?}");
        let uncommented: String =
            keys.iter().map(|line| format!("{}\n", line.trim_start_matches('#').trim())).collect();
        job(&uncommented).unwrap();
        let config = job(DSM_TEMPLATE).unwrap();
        let mut default = DsmConfig::new(config.images.clone(), config.output.clone());
        assert_eq!(config, default);
        // Keys with a default that does not depend on the scene show it.
        let shown = job(&keys
            .iter()
            .filter(|line| !line.contains("# scene"))
            .map(|l| format!("{}\n", l.trim_start_matches('#').trim()))
            .collect::<String>())
        .unwrap();
        default.threads = shown.threads;
        default.memory_mb = Some(4000);
        assert_eq!(shown, default);
    }
}
