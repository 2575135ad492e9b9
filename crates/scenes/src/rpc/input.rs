//! Reading the RPC that a job works on.

use std::path::Path;

use formats::rpc::RpcFile;

use super::error::RpcJobError;
use numeric::Progress;

/// Reads the RPC of a file and passes the reader's warnings on.
pub(super) fn read(path: &Path, progress: &dyn Progress) -> Result<RpcFile, RpcJobError> {
    let file = formats::rpc::read(path)?;
    for warning in &file.warnings {
        progress.warn(&format!("{}: {warning}", file.source.display()));
    }
    Ok(file)
}
