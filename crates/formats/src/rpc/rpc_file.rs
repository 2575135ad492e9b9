//! An RPC together with the file that it came from.

use std::path::{Path, PathBuf};

use camera::Rpc;

use super::format::RpcFormat;

/// An RPC and the file that it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct RpcFile {
    /// The RPC. The centre of the upper-left pixel is (0, 0).
    pub rpc: Rpc,
    /// The container.
    pub format: RpcFormat,
    /// The file that holds the RPC: the one asked for, or one beside it. The image itself where
    /// GDAL reports the RPC, because GDAL does not name the file that its metadata is from.
    pub source: PathBuf,
    /// Conventions that had to be guessed, entries that were ignored, and sources that disagree.
    pub warnings: Vec<String>,
}

impl RpcFile {
    pub(super) fn new(path: &Path, format: RpcFormat, parsed: Parsed) -> Self {
        Self { rpc: parsed.rpc, format, source: path.to_owned(), warnings: parsed.warnings }
    }
}

/// Result of one format's reader.
#[derive(Debug)]
pub(super) struct Parsed {
    pub(super) rpc: Rpc,
    pub(super) warnings: Vec<String>,
}

impl Parsed {
    /// An RPC that needs no warning.
    pub(super) fn certain(rpc: Rpc) -> Self {
        Self { rpc, warnings: Vec::new() }
    }
}
