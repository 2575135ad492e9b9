//! Writes splats.

use std::io::Write;
use std::path::Path;

use gaussian::{Splat, SplatHarmonics, SplatLabel};

use super::layout::{SH_C0, SH_DEGREE_MAX, SplatLayout};
use super::origin::LocalOrigin;
use super::read::SplatFile;
use crate::atomic::{refuse_existing, write_stream};
use crate::format_error::FormatError;
use crate::ply::write_header;

/// Writes splats, and their origin beside them. Harmonics beyond the constant one are 0.
///
/// # Errors
/// [`FormatError`] when the degree of the harmonics is above [`SH_DEGREE_MAX`], the origin is not
/// finite, or a splat fails [`Splat::validate`]; when a file exists and `overwrite` is false, or
/// cannot be written.
pub fn write(
    path: &Path,
    splats: &[Splat],
    origin: &LocalOrigin,
    layout: SplatLayout,
    overwrite: bool,
) -> Result<(), FormatError> {
    checked(path, splats, layout, overwrite)?;
    // The splats are written last, so that a file of splats always has its origin.
    origin.write_beside(path, overwrite)?;
    Ok(write_stream(path, overwrite, |out| body(out, splats, None, None, layout))?)
}

/// Writes splats as [`write()`] does, with their harmonics: padded with zeros or cut to the degree
/// of the layout. An origin is written beside them where there is one. Splats with labels get two
/// properties more, and the table beside them.
///
/// # Errors
/// Those of [`write()`]; [`FormatError`] also when the labels are not as many as the splats.
///
/// # Panics
/// If there are harmonics of fewer splats.
pub fn write_file(path: &Path, file: &SplatFile, overwrite: bool) -> Result<(), FormatError> {
    let SplatFile { splats, harmonics, labels, layout, origin } = file;
    checked(path, splats, *layout, overwrite)?;
    if let Some(labels) = labels {
        if labels.of.len() != splats.len() {
            let what =
                format!("there are {} labels, expected one for each of {} splats", labels.of.len(), splats.len());
            return Err(FormatError::new(path, what));
        }
        labels.table.write_beside(path, overwrite)?;
    }
    let labels = labels.as_ref().map(|labels| labels.of.as_slice());
    if let Some(origin) = origin {
        origin.write_beside(path, overwrite)?;
    }
    Ok(write_stream(path, overwrite, |out| body(out, splats, harmonics.as_ref(), labels, *layout))?)
}

/// Checks what is to be written, before anything is.
pub(crate) fn checked(path: &Path, splats: &[Splat], layout: SplatLayout, overwrite: bool) -> Result<(), FormatError> {
    if layout.sh_degree > SH_DEGREE_MAX {
        let what = format!("the degree of the harmonics is {}, expected 0 to {SH_DEGREE_MAX}", layout.sh_degree);
        return Err(FormatError::new(path, what));
    }
    for (index, splat) in splats.iter().enumerate() {
        splat.validate().map_err(|source| {
            FormatError::because(path, format!("splat {index} cannot be written ({source})"), source)
        })?;
    }
    Ok(refuse_existing(path, overwrite)?)
}

fn body(
    out: &mut dyn Write,
    splats: &[Splat],
    harmonics: Option<&SplatHarmonics>,
    labels: Option<&[SplatLabel]>,
    layout: SplatLayout,
) -> std::io::Result<()> {
    let mut properties: Vec<String> = layout.properties().into_iter().map(|name| format!("float {name}")).collect();
    if labels.is_some() {
        properties.extend(["uchar class", "uint object"].map(str::to_owned));
    }
    let properties: Vec<&str> = properties.iter().map(String::as_str).collect();
    write_header(out, &[], &[("vertex", splats.len(), &properties)])?;
    let mut row: Vec<u8> = Vec::new();
    for (number, splat) in splats.iter().enumerate() {
        row.clear();
        let mut put = |value: f64| row.extend_from_slice(&(value as f32).to_le_bytes());
        splat.position.iter().for_each(|&p| put(f64::from(p)));
        splat.normal().into_iter().for_each(&mut put);
        splat.colour.iter().for_each(|&c| put((f64::from(c) - 0.5) / SH_C0));
        for channel in 0..3 {
            let known = harmonics.map_or(&[][..], |harmonics| harmonics.of(number, channel));
            let coefficient = |i: usize| known.get(i).copied().map_or(0.0, f64::from);
            (0..layout.rest() / 3).for_each(|i| put(coefficient(i)));
        }
        let opacity = f64::from(splat.opacity);
        put((opacity / (1.0 - opacity)).ln());
        splat.scale_m[..layout.form.scales()].iter().for_each(|&s| put(f64::from(s).ln()));
        splat.rotation.iter().for_each(|&q| put(f64::from(q)));
        if let Some(SplatLabel { class, object }) = labels.map(|labels| labels[number]) {
            row.push(class);
            row.extend_from_slice(&object.to_le_bytes());
        }
        out.write_all(&row)?;
    }
    Ok(())
}
