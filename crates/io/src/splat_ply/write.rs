//! Splats out.

use std::io::Write;
use std::path::Path;

use gaussian::Splat;

use super::{LocalOrigin, SH_C0, SH_DEGREE_MAX, SplatLayout, SplatPlyError, invalid};
use crate::atomic::{refuse_existing, write_stream};

/// Writes splats, and their origin beside them.
///
/// # Errors
/// A degree above [`SH_DEGREE_MAX`], a splat that is none, a file that exists (without `overwrite`) or cannot be written.
pub fn write(
    path: &Path,
    splats: &[Splat],
    origin: &LocalOrigin,
    layout: SplatLayout,
    overwrite: bool,
) -> Result<(), SplatPlyError> {
    if layout.sh_degree > SH_DEGREE_MAX {
        let what =
            format!("harmonics of degree {} were asked for, at most {SH_DEGREE_MAX} are known", layout.sh_degree);
        return Err(invalid(path, what));
    }
    for (index, splat) in splats.iter().enumerate() {
        splat.validate().map_err(|source| SplatPlyError::Splat { path: path.to_owned(), index, source })?;
    }
    refuse_existing(path, overwrite)?;
    // The splats come last: where they are, their origin is.
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
