//! Finds the command and the shared data for a bench.
//!
//! The environment variable `SKYSWEEP_BIN` names another command than the one that Cargo built with
//! the bench, for example a reference binary. `SKYSWEEP_DATA` names the folder of the shared data;
//! without it that is `../shared/data` beside the checkout.

#![allow(dead_code, reason = "not every bench reads shared data")]

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Returns the command that is measured.
pub(crate) fn skysweep() -> OsString {
    env::var_os("SKYSWEEP_BIN").unwrap_or_else(|| env!("CARGO_BIN_EXE_skysweep").into())
}

/// Returns the folder of the shared data. It may not exist.
pub(crate) fn shared_data() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    env::var_os("SKYSWEEP_DATA").map_or_else(beside, PathBuf::from)
}
