//! What a test does when an input or a tool is absent: it prints one line and passes. Also the
//! smooth noise of synthetic scenes.
//!
//! Large inputs are not part of the repository. They lie in `../shared/data` beside the checkout,
//! or in the folder that the environment variable `SKYSWEEP_DATA` names. Tests that need them call
//! [`shared_data`]; tests that need an installed program call [`skip`] when they do not find it.
//! The line goes to standard error directly, so the test harness shows it even for tests that pass.
//!
//! With `SKYSWEEP_REQUIRE_DATA=1`, which CI sets, absent shared data fail the test. Absent programs
//! are still skipped.
//!
//! This crate is a dev-dependency only; no product crate uses it.

mod noise;

use std::env;
use std::io::Write;
use std::path::{Path, PathBuf};

pub use noise::lattice_noise;

/// Returns the path of a file or folder below the shared data.
///
/// When it does not exist, prints that the test is skipped and returns `None`.
///
/// # Panics
///
/// Panics when it does not exist and `SKYSWEEP_REQUIRE_DATA` is set to `1`.
///
/// ```no_run
/// let Some(tile) = testing::shared_data("city/3dbag_5910.city.json") else { return };
/// assert!(tile.is_file());
/// ```
pub fn shared_data(path: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = env::var_os("SKYSWEEP_DATA").map_or_else(beside, PathBuf::from);
    let is_required = env::var("SKYSWEEP_REQUIRE_DATA").is_ok_and(|value| value == "1");
    below(&data, path, is_required)
}

fn below(data: &Path, path: &str, is_required: bool) -> Option<PathBuf> {
    let found = data.join(path);
    if found.exists() {
        return Some(found);
    }
    assert!(!is_required, "{} does not exist, and SKYSWEEP_REQUIRE_DATA=1 requires it", found.display());
    skip(&format!("{} does not exist", found.display()));
    None
}

/// Prints that a test, or a part of it, is skipped, and why.
///
/// ```
/// testing::skip("gdallocationinfo is not installed");
/// ```
pub fn skip(reason: &str) {
    // A line that cannot be printed is no reason to fail the test.
    let _ = writeln!(std::io::stderr(), "skipped: {reason}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_that_exists_is_returned() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert_eq!(below(here, "src/lib.rs", true), Some(here.join("src/lib.rs")));
    }

    #[test]
    fn an_absent_path_is_skipped() {
        assert_eq!(below(Path::new(env!("CARGO_MANIFEST_DIR")), "absent", false), None);
    }

    #[test]
    #[should_panic(expected = "SKYSWEEP_REQUIRE_DATA=1 requires it")]
    fn an_absent_path_fails_where_data_are_required() {
        below(Path::new(env!("CARGO_MANIFEST_DIR")), "absent", true);
    }
}
