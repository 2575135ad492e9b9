//! Writing RPC files: RPC00B text, RPB, and JSON with rpcm's names.
//!
//! Numbers are written with the fewest digits that read back to the same double. The file appears under its name
//! only when it is complete.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use camera::Rpc;
use serde_json::{Map, Value};

use super::draft::{POLYS, Poly, REQUIRED, RPC00B};
use super::error::RpcWriteError;
use super::{RpcFormat, json, rpb};

/// What to do with a file that is already there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Leave it and report an error.
    Keep,
    /// Put the new one in its place.
    Replace,
}

/// Writes `rpc` to `path` as [`RpcFormat::Text`], [`RpcFormat::Rpb`] or [`RpcFormat::Json`].
///
/// # Errors
/// Another format, a file that is there and is to be kept, or an error of the file system. Nothing is left behind.
pub fn write(path: &Path, rpc: &Rpc, format: RpcFormat, existing: Existing) -> Result<(), RpcWriteError> {
    let text = to_text(rpc, format)?;
    let io = |source| RpcWriteError::Io { path: path.to_owned(), source };
    let exists = || RpcWriteError::Exists { path: path.to_owned() };
    if existing == Existing::Keep && path.symlink_metadata().is_ok() {
        return Err(exists());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    set_usual_permissions(&mut builder);
    let mut file = builder.prefix(".skysweep-").tempfile_in(folder).map_err(io)?;
    file.write_all(text.as_bytes()).map_err(io)?;
    file.as_file().sync_all().map_err(io)?;
    match existing {
        Existing::Replace => file.persist(path).map(drop).map_err(|e| io(e.error)),
        Existing::Keep => file.persist_noclobber(path).map(drop).map_err(|e| match e.error.kind() {
            std::io::ErrorKind::AlreadyExists => exists(),
            _ => io(e.error),
        }),
    }
}

/// The text of an RPC file.
///
/// # Errors
/// A format other than text, RPB and JSON.
pub fn to_text(rpc: &Rpc, format: RpcFormat) -> Result<String, RpcWriteError> {
    match format {
        RpcFormat::Text => Ok(key_value(rpc)),
        RpcFormat::Rpb => Ok(rpb(rpc)),
        RpcFormat::Json => Ok(rpcm_json(rpc)),
        format => Err(RpcWriteError::Format { format }),
    }
}

/// Temporary files are private by default; a finished RPC file is as readable as any other.
#[cfg(unix)]
pub(crate) fn set_usual_permissions(builder: &mut tempfile::Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(std::fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
pub(crate) fn set_usual_permissions(_: &mut tempfile::Builder<'_, '_>) {}

/// The scalars in the order of [`RPC00B`], the two errors only where they are known.
fn scalars(rpc: &Rpc) -> [Option<f64>; 12] {
    [
        Some(rpc.line_off),
        Some(rpc.samp_off),
        Some(rpc.lat_off),
        Some(rpc.long_off),
        Some(rpc.height_off),
        Some(rpc.line_scale),
        Some(rpc.samp_scale),
        Some(rpc.lat_scale),
        Some(rpc.long_scale),
        Some(rpc.height_scale),
        rpc.err_bias_m,
        rpc.err_rand_m,
    ]
}

fn coefficients(rpc: &Rpc, poly: Poly) -> &[f64; 20] {
    match poly {
        Poly::LineNum => &rpc.line_num,
        Poly::LineDen => &rpc.line_den,
        Poly::SampNum => &rpc.samp_num,
        Poly::SampDen => &rpc.samp_den,
    }
}

fn key_value(rpc: &Rpc) -> String {
    let mut text = String::new();
    for (key, value) in RPC00B.scalars.iter().zip(scalars(rpc)) {
        if let Some(value) = value {
            let _ = writeln!(text, "{key}: {value} {}", unit(key));
        }
    }
    for poly in POLYS {
        for (i, c) in coefficients(rpc, poly).iter().enumerate() {
            let _ = writeln!(text, "{}: {c:e}", RPC00B.coefficient(poly, i));
        }
    }
    text
}

fn unit(key: &str) -> &'static str {
    match key.as_bytes() {
        [b'L', b'I', ..] | [b'S', ..] => "pixels",
        [b'L', ..] => "degrees",
        _ => "meters",
    }
}

fn rpb(rpc: &Rpc) -> String {
    let mut text = String::from("satId = \"????\";\nbandId = \"?\";\nSpecId = \"RPC00B\";\nBEGIN_GROUP = IMAGE\n");
    // The format requires both errors; 0 is what providers write for unknown ones.
    let _ = writeln!(text, "\terrBias = {};", rpc.err_bias_m.unwrap_or(0.0));
    let _ = writeln!(text, "\terrRand = {};", rpc.err_rand_m.unwrap_or(0.0));
    for (name, value) in rpb::NAMES.scalars.iter().zip(scalars(rpc).iter().flatten()).take(REQUIRED.len()) {
        let _ = writeln!(text, "\t{name} = {value};");
    }
    for (name, poly) in rpb::NAMES.polys.iter().zip(POLYS) {
        let values: Vec<String> = coefficients(rpc, poly).iter().map(|c| format!("\t\t\t{c:e}")).collect();
        let _ = writeln!(text, "\t{name} = (\n{});", values.join(",\n"));
    }
    text.push_str("END_GROUP = IMAGE\nEND;\n");
    text
}

fn rpcm_json(rpc: &Rpc) -> String {
    let mut map = Map::new();
    for (key, value) in json::RPCM.scalars.iter().zip(scalars(rpc)) {
        if let Some(value) = value {
            map.insert((*key).to_owned(), Value::from(value));
        }
    }
    for (key, poly) in json::RPCM.polys.iter().zip(POLYS) {
        map.insert((*key).to_owned(), Value::from(coefficients(rpc, poly).to_vec()));
    }
    format!("{:#}\n", Value::Object(map))
}
