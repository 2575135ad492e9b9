//! Writes splats.

use std::io::Write;
use std::path::Path;

use gaussian::Splat;

use super::error::{SplatPlyError, invalid};
use super::layout::{SH_C0, SH_DEGREE_MAX, SplatLayout};
use super::origin::LocalOrigin;
use crate::atomic::{refuse_existing, write_stream};

/// Writes splats, and their origin beside them.
///
/// # Errors
/// - [`SplatPlyError::Invalid`] when the degree of the harmonics is above [`SH_DEGREE_MAX`] or the
///   origin is not finite.
/// - [`SplatPlyError::Splat`] when a splat fails [`Splat::validate`].
/// - [`SplatPlyError::NotWritten`] when a file exists and `overwrite` is false, or cannot be
///   written.
pub fn write(
    path: &Path,
    splats: &[Splat],
    origin: &LocalOrigin,
    layout: SplatLayout,
    overwrite: bool,
) -> Result<(), SplatPlyError> {
    if layout.sh_degree > SH_DEGREE_MAX {
        let what = format!("the degree of the harmonics is {}, expected 0 to {SH_DEGREE_MAX}", layout.sh_degree);
        return Err(invalid(path, what));
    }
    for (index, splat) in splats.iter().enumerate() {
        splat.validate().map_err(|source| SplatPlyError::Splat { path: path.to_owned(), index, source })?;
    }
    refuse_existing(path, overwrite)?;
    // The splats are written last, so that a file of splats always has its origin.
    origin.write_beside(path, overwrite)?;
    Ok(write_stream(path, overwrite, |out| body(out, splats, layout))?)
}

fn body(out: &mut dyn Write, splats: &[Splat], layout: SplatLayout) -> std::io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", splats.len())?;
    for name in layout.properties() {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "end_header")?;
    let mut row: Vec<u8> = Vec::new();
    for splat in splats {
        row.clear();
        let mut put = |value: f64| row.extend_from_slice(&(value as f32).to_le_bytes());
        splat.position.iter().for_each(|&p| put(f64::from(p)));
        splat.normal().into_iter().for_each(&mut put);
        splat.colour.iter().for_each(|&c| put((f64::from(c) - 0.5) / SH_C0));
        (0..layout.rest()).for_each(|_| put(0.0));
        let opacity = f64::from(splat.opacity);
        put((opacity / (1.0 - opacity)).ln());
        splat.scale_m[..layout.form.scales()].iter().for_each(|&s| put(f64::from(s).ln()));
        splat.rotation.iter().for_each(|&q| put(f64::from(q)));
        out.write_all(&row)?;
    }
    Ok(())
}
