//! Writing RPC files: RPC00B text, RPB, and JSON with rpcm's names.
//!
//! Numbers are written with the fewest digits that read back to the same double.

use std::fmt::Write as _;
use std::path::Path;

use camera::Rpc;
use serde_json::{Map, Value};

use super::error::ReadOnlyFormat;
use super::format::RpcFormat;
use super::names::{POLYS, Poly, REQUIRED, RPC00B};
use super::{json, rpb};
use crate::atomic::write_bytes;
use crate::format_error::FormatError;

/// Writes `rpc` to `path` as [`RpcFormat::Text`], [`RpcFormat::Rpb`] or [`RpcFormat::Json`].
///
/// The content is on the disk before the file gets its name.
///
/// # Errors
/// [`FormatError`] for another format, for a file that exists without `overwrite`, and when the
/// system refuses.
pub fn write(path: &Path, rpc: &Rpc, format: RpcFormat, overwrite: bool) -> Result<(), FormatError> {
    let text = to_text(rpc, format).map_err(|error| FormatError::of(path, error))?;
    Ok(write_bytes(path, text.as_bytes(), overwrite)?)
}

/// Returns the text of an RPC file.
///
/// # Errors
/// [`ReadOnlyFormat`] for a format other than text, RPB and JSON.
pub fn to_text(rpc: &Rpc, format: RpcFormat) -> Result<String, ReadOnlyFormat> {
    match format {
        RpcFormat::Text => Ok(key_value(rpc)),
        RpcFormat::Rpb => Ok(rpb(rpc)),
        RpcFormat::Json => Ok(rpcm_json(rpc)),
        format => Err(ReadOnlyFormat { format }),
    }
}

/// The scalars in the order of [`RPC00B`]. The two errors are `None` where they are unknown.
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
    // The format requires both errors; providers write 0 for unknown ones.
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
