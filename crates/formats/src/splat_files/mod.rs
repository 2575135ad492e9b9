//! Files of Gaussian splats: PLY ([`crate::splat_ply`]), SPZ (Niantic), SOG (PlayCanvas) and binary
//! glTF with `KHR_gaussian_splatting` (Khronos).
//!
//! | ending | content | precision |
//! |---|---|---|
//! | `.ply` | floats of 3DGS or 2DGS | of 32 bits |
//! | `.spz` | version 3, read from 2 to 4 | bytes; positions of 24 bits |
//! | `.sog` | version 2, an archive of WebP images | bytes; logarithms of positions of 16 bits |
//! | `.glb` | points with attributes, turned so that up is y | of 32 bits |
//!
//! Positions and axes are those of the local origin in `NAME.origin.json` beside the file; SPZ is
//! half a turn about x from them, and a node of glTF turns them for its viewers. A file is
//! recognised by its content when it is read, and by its ending when it is written. Lengths are
//! checked against the size of the file before anything is allocated.

mod codebook;
mod glb;
mod numbers;
mod sog;
mod spz;

use std::path::Path;

use crate::atomic::write_stream;
use crate::format_error::FormatError;
use crate::regular::read_regular;
use crate::splat_ply::{self, LocalOrigin, SplatFile, checked};

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 16 << 30;

/// A format of splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SplatFormat {
    /// PLY of 3DGS or 2DGS.
    Ply,
    /// SPZ.
    Spz,
    /// SOG, in one archive.
    Sog,
    /// Binary glTF.
    Glb,
}

impl SplatFormat {
    /// The endings of the formats.
    pub const ENDINGS: [(&'static str, Self); 4] =
        [("ply", Self::Ply), ("spz", Self::Spz), ("sog", Self::Sog), ("glb", Self::Glb)];

    /// Returns the endings in words: `.ply, .spz, .sog, .glb`.
    pub fn endings() -> String {
        Self::ENDINGS.map(|(ending, _)| format!(".{ending}")).join(", ")
    }

    /// Returns the format that the ending of a path names.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, format)| *format)
    }

    /// Returns the colours that the format can hold, where it cannot hold all; others are brought
    /// to the nearest of them.
    pub fn colour_range(self) -> Option<[f32; 2]> {
        (self == Self::Spz).then(spz::colour_range)
    }

    /// Returns whether the format holds classes and objects of splats.
    pub fn holds_labels(self) -> bool {
        self == Self::Ply
    }

    /// Returns the format of a file by its first bytes.
    fn of_content(bytes: &[u8]) -> Option<Self> {
        let starts = [(&b"ply"[..], Self::Ply), (&spz::GZIP[..], Self::Spz), (&spz::MAGIC[..], Self::Spz)];
        let starts = starts.into_iter().chain([(&b"PK"[..], Self::Sog), (&b"glTF"[..], Self::Glb)]);
        starts.into_iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, format)| format)
    }
}

/// Reads the splats of a file of any format, and the origin beside it.
///
/// Discs come back as discs: SOG says what they are, SPZ and glTF show it by third scales of 0.
///
/// # Errors
/// [`FormatError`] when the system cannot read the file or its origin, for other content, a damaged
/// file, a version that is not known, and splats that are not valid.
///
/// # Examples
/// ```
/// use gaussian::Splat;
/// use formats::splat_files;
/// use formats::splat_ply::{SplatFile, SplatForm, SplatLayout};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("roof.spz");
/// let splat = Splat {
///     position: [1.0, 2.0, 3.0],
///     scale_m: [0.5, 0.25, 0.01],
///     rotation: [1.0, 0.0, 0.0, 0.0],
///     colour: [0.8, 0.3, 0.2],
///     opacity: 0.75,
/// };
/// let layout = SplatLayout { form: SplatForm::Ellipsoids, sh_degree: 0 };
/// let file = SplatFile { splats: vec![splat], harmonics: None, labels: None, layout, origin: None };
/// splat_files::write(&path, &file, false)?;
///
/// let back = splat_files::read(&path)?;
/// assert_eq!(back.splats[0].position, [1.0, 2.0, 3.0]);
/// assert!((back.splats[0].colour[0] - 0.8).abs() < 0.004);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path) -> Result<SplatFile, FormatError> {
    let unreadable = |source| FormatError::unreadable(path, "the file", source);
    let bytes = read_regular(path, SIZE_LIMIT).map_err(unreadable)?;
    let file = match SplatFormat::of_content(&bytes) {
        Some(SplatFormat::Spz) => spz::decode(&bytes),
        Some(SplatFormat::Sog) => sog::decode(&bytes),
        Some(SplatFormat::Glb) => glb::decode(&bytes),
        Some(SplatFormat::Ply) | None => return splat_ply::read(path),
    };
    let file = file.map_err(|what| FormatError::new(path, what))?;
    for (index, splat) in file.splats.iter().enumerate() {
        splat.validate().map_err(|defect| FormatError::new(path, format!("splat {index}: {defect}")))?;
    }
    Ok(SplatFile { origin: LocalOrigin::read_beside(path)?, ..file.flattened() })
}

/// Writes splats in the format that the ending of the path names, and their origin beside them.
/// Harmonics are padded with zeros or cut to the degree of the layout. Labels are left out where
/// the format does not hold them ([`SplatFormat::holds_labels`]).
///
/// # Errors
/// [`FormatError`]
/// - for another ending, a degree above 3, an origin that is not finite, and what the format cannot
///   hold: SPZ positions beyond 8,000 km, glTF more than 4 GiB;
/// - when a splat is not valid;
/// - when a file exists and `overwrite` is false, or cannot be written.
///
/// # Panics
/// If there are harmonics of fewer splats.
pub fn write(path: &Path, file: &SplatFile, overwrite: bool) -> Result<(), FormatError> {
    let format = SplatFormat::of_ending(path).ok_or_else(|| {
        FormatError::new(
            path,
            format!("the ending names no format of splats, expected one of {}", SplatFormat::endings()),
        )
    })?;
    let bytes = match format {
        SplatFormat::Ply => return splat_ply::write_file(path, file, overwrite),
        _ => {
            checked(path, &file.splats, file.layout, overwrite)?;
            let is_finite =
                |splat| (0..3).all(|c| file.harmonics.iter().all(|h| h.of(splat, c).iter().all(|v| v.is_finite())));
            if let Some(splat) = (0..file.splats.len()).find(|splat| !is_finite(*splat)) {
                return Err(FormatError::new(
                    path,
                    format!("splat {splat} cannot be written (a harmonic is not finite)"),
                ));
            }
            match format {
                SplatFormat::Spz => spz::encode(file),
                SplatFormat::Sog => sog::encode(file),
                _ => glb::encode(file),
            }
        }
    };
    let bytes = bytes.map_err(|what| FormatError::new(path, what))?;
    // The splats are written last, so that a file of splats always has its origin.
    if let Some(origin) = &file.origin {
        origin.write_beside(path, overwrite)?;
    }
    Ok(write_stream(path, overwrite, |out| out.write_all(&bytes))?)
}

#[cfg(test)]
mod tests;
