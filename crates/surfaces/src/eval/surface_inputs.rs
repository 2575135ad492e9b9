//! Reads two surfaces and brings them to one coordinate reference system, one vertical datum and
//! one local origin, in f64.

use city::{MeshConfig, Scope};
use cityfiles::surfaces::SurfaceFile;
use crs::{HeightConverter, VerticalDatum};
use eval::LocalSurface;

use super::error::EvalJobError;
use super::surface_config::SurfaceEvalConfig;
use job::error::FileCrsError;

/// Two surfaces that can be compared.
pub(super) struct SurfaceInputs {
    pub(super) test: LocalSurface,
    pub(super) reference: LocalSurface,
    /// Formats and sizes of test and reference, in words.
    pub(super) formats: [String; 2],
    /// Position of the local origin in the coordinate reference system, whole metres.
    pub(super) origin: [f64; 3],
    pub(super) crs: Option<String>,
    pub(super) vertical: Option<VerticalDatum>,
    /// Choices and doubts that a reader must know.
    pub(super) notes: Vec<String>,
}

impl SurfaceInputs {
    /// Reads the surfaces of a configuration. A `given` surface takes the place of the test's file.
    pub(super) fn read(config: &SurfaceEvalConfig, given: Option<SurfaceFile>) -> Result<Self, EvalJobError> {
        let scope = if config.all_objects { Scope::Everything } else { Scope::Buildings };
        let lod = config.lod.map(city::LodChoice::Only).unwrap_or_default();
        let mesh = MeshConfig { lod, scope };
        let mut test = match given {
            Some(test) => test,
            None => cityfiles::surfaces::read(&config.test, &mesh)?,
        };
        let mut reference = cityfiles::surfaces::read(&config.reference, &mesh)?;
        let mut notes: Vec<String> = test.notes.drain(..).chain(reference.notes.drain(..)).collect();
        test.vertical = config.test_vertical.or(test.vertical);
        reference.vertical = config.reference_vertical.or(reference.vertical);
        bring(&mut test, &reference, &mut notes)?;
        let origin = middle(&reference.positions);
        let formats = [&test, &reference].map(|file| format!("{}, {}", file.format, size(file)));
        let (crs, vertical) = (reference.crs.clone().or(test.crs.clone()), reference.vertical.or(test.vertical));
        Ok(Self {
            test: local(test, origin),
            reference: local(reference, origin),
            formats,
            origin,
            crs,
            vertical,
            notes,
        })
    }
}

fn size(file: &SurfaceFile) -> String {
    match file.triangles.len() {
        0 => format!("{} points", file.positions.len()),
        triangles => format!("{triangles} triangles"),
    }
}

/// Returns the middle of the bounding box, rounded to whole metres.
fn middle(positions: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|i| {
        let bounds = |(low, high): (f64, f64), p: &[f64; 3]| (low.min(p[i]), high.max(p[i]));
        let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        if low <= high { (0.5 * (low + high)).round() } else { 0.0 }
    })
}

fn local(file: SurfaceFile, origin: [f64; 3]) -> LocalSurface {
    let mut positions = file.positions;
    positions.iter_mut().for_each(|p| (0..3).for_each(|i| p[i] -= origin[i]));
    if file.triangles.is_empty() {
        LocalSurface::Points(positions)
    } else {
        LocalSurface::Mesh { positions, triangles: file.triangles }
    }
}

/// Converts the test to the coordinate reference system and the vertical datum of the reference.
fn bring(test: &mut SurfaceFile, reference: &SurfaceFile, notes: &mut Vec<String>) -> Result<(), EvalJobError> {
    let heights = datums(test, reference, notes);
    let systems = match (&test.crs, &reference.crs) {
        (Some(from), Some(to)) => Some((from.clone(), to.clone())),
        (None, None) => {
            notes.push("neither file names a coordinate system: taken as the same, in metres".into());
            None
        }
        _ => {
            notes.push("only one file names a coordinate system: taken as that of both".into());
            None
        }
    };
    for file in [&*test, reference] {
        let Some(definition) = &file.crs else { continue };
        let metres = FileCrsError::projection(&file.path, definition)?.metres_per_unit();
        if metres != Some(1.0) {
            return Err(EvalJobError::NotInMetres { path: file.path.clone(), definition: definition.clone() });
        }
    }
    match (systems, heights) {
        (Some((from, to)), heights) if from != to || heights.is_some() => convert(test, &from, &to, heights, notes),
        (_, Some(DatumChange { from, to })) => Err(EvalJobError::NoCrsForHeights { path: test.path.clone(), from, to }),
        _ => Ok(()),
    }
}

/// A conversion between vertical datums.
#[derive(Clone, Copy)]
struct DatumChange {
    from: VerticalDatum,
    to: VerticalDatum,
}

/// Returns the conversion of the test's heights; `None` if the datums are the same or one of them
/// is not known.
fn datums(test: &SurfaceFile, reference: &SurfaceFile, notes: &mut Vec<String>) -> Option<DatumChange> {
    match (test.vertical, reference.vertical) {
        (Some(from), Some(to)) => (from != to).then_some(DatumChange { from, to }),
        (None, None) => {
            notes.push("neither file says what its heights are above: taken as the same".into());
            None
        }
        (Some(datum), None) | (None, Some(datum)) => {
            let unknown = if test.vertical.is_none() { "test" } else { "reference" };
            notes.push(format!("the {unknown} does not say what its heights are above: taken as {datum}"));
            None
        }
    }
}

fn convert(
    test: &mut SurfaceFile,
    from: &str,
    to: &str,
    heights: Option<DatumChange>,
    notes: &mut Vec<String>,
) -> Result<(), EvalJobError> {
    let [from_map, to_map] = [from, to].map(|definition| FileCrsError::projection(&test.path, definition));
    let (from_map, to_map) = (from_map?, to_map?);
    let axis = |i: usize| test.positions.iter().map(|p| p[i]).collect::<Vec<f64>>();
    let (mut x, mut y, mut z) = (axis(0), axis(1), axis(2));
    let mut lost = from_map.lonlat_from_map_slices(&mut x, &mut y)?;
    if let Some(DatumChange { from, to }) = heights {
        lost += HeightConverter::new(from)?.ellipsoid_from_datum_slices(&x, &y, &mut z)?;
        lost += HeightConverter::new(to)?.datum_from_ellipsoid_slices(&x, &y, &mut z)?;
        notes.push(format!("the test's heights were converted from {from} to {to}"));
    }
    lost += to_map.map_from_lonlat_slices(&mut x, &mut y)?;
    if lost > 0 {
        let (path, from, to) = (test.path.clone(), from.to_owned(), to.to_owned());
        return Err(EvalJobError::PointsLost { path, lost, from, to });
    }
    if from != to {
        notes.push(format!("the test was projected from {from} to {to}"));
    }
    for (i, position) in test.positions.iter_mut().enumerate() {
        *position = [x[i], y[i], z[i]];
    }
    Ok(())
}
