//! Job files of surface models: every key and its default, and how they are read.

use std::path::Path;

use job::error::JobError;
use job::job_file::read_job;

use crate::DsmConfig;

/// A commented job file for a surface model, with every key and its default.
pub const DSM_TEMPLATE: &str = include_str!("job_file/dsm.toml");

/// Reads the configuration of a surface model from a job file.
///
/// The output folder may be left out; the caller then gives it.
///
/// # Errors
/// [`JobError`]: a file that cannot be read, or is no job file of a surface model.
pub fn read_dsm_job(path: &Path) -> Result<DsmConfig, JobError> {
    read_job(path, |config: &mut DsmConfig, new_path| config.map_paths(new_path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(text: &str) -> Result<DsmConfig, JobError> {
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
        assert_eq!(config.pairs.as_deref(), Some(&[crate::ImagePair::new(0, 2)][..]));
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
        let text = job("no_such_key = 1").unwrap_err().to_string();
        let (_, known) = text.split_once("known are ").expect("the known keys are listed");
        let (known, _) = known.split_once(": ").expect("the path follows");
        let known: Vec<&str> = known.split(", ").collect();
        let is_key = |line: &&str| {
            line.trim_start_matches('#').trim().split_once(" = ").is_some_and(|(key, _)| known.contains(&key))
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
