//! Two surfaces from files, brought to one coordinate system, one vertical datum and one local origin, all in f64.

use anyhow::{Context, bail, ensure};
use city::{MeshConfig, Scope};
use crs::{HeightConverter, MapProjection, VerticalDatum};
use eval::Surface;
use io::surfaces::SurfaceFile;

use super::Args;

/// What is compared.
pub(super) struct SurfaceInputs {
    pub(super) test: Surface,
    pub(super) reference: Surface,
    /// The formats, in words.
    pub(super) formats: [String; 2],
    /// Position of the local origin, whole metres.
    pub(super) origin: [f64; 3],
    pub(super) crs: Option<String>,
    pub(super) vertical: Option<VerticalDatum>,
    /// Decisions and doubts.
    pub(super) notes: Vec<String>,
}

impl SurfaceInputs {
    pub(super) fn read(args: &Args) -> anyhow::Result<Self> {
        let scope = if args.surface.all_objects { Scope::Everything } else { Scope::Buildings };
        let lod = args.surface.lod.map(city::LodChoice::Only).unwrap_or_default();
        let config = MeshConfig { lod, scope };
        let mut test = io::surfaces::read(&args.test, &config)?;
        let mut reference = io::surfaces::read(&args.reference, &config)?;
        let mut notes: Vec<String> = test.notes.drain(..).chain(reference.notes.drain(..)).collect();
        test.vertical = args.test_vertical.or(test.vertical);
        reference.vertical = args.ref_vertical.or(reference.vertical);
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

/// The middle of the extent, on whole metres.
fn middle(positions: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|i| {
        let bounds = |(low, high): (f64, f64), p: &[f64; 3]| (low.min(p[i]), high.max(p[i]));
        let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        if low <= high { (0.5 * (low + high)).round() } else { 0.0 }
    })
}

fn local(file: SurfaceFile, origin: [f64; 3]) -> Surface {
    let mut positions = file.positions;
    positions.iter_mut().for_each(|p| (0..3).for_each(|i| p[i] -= origin[i]));
    if file.triangles.is_empty() {
        Surface::Points(positions)
    } else {
        Surface::Mesh { positions, triangles: file.triangles }
    }
}

/// Brings the test to the coordinate system and the vertical datum of the reference.
fn bring(test: &mut SurfaceFile, reference: &SurfaceFile, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let heights = datums(test, reference, notes)?;
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
        let metres = projection(definition, file)?.metres_per_unit();
        ensure!(
            metres == Some(1.0),
            "the coordinates are not in metres ({definition}), and surfaces are compared in metres: project it first: {}",
            file.path.display()
        );
    }
    match (systems, heights) {
        (Some((from, to)), heights) if from != to || heights.is_some() => convert(test, &from, &to, heights, notes),
        (_, Some((from, to))) => bail!(
            "heights can be converted from {from} to {to} only in a known coordinate system, there is none: {}",
            test.path.display()
        ),
        _ => Ok(()),
    }
}

/// The datums to convert from and to; `None` where they are the same or one of them is not known.
fn datums(
    test: &SurfaceFile,
    reference: &SurfaceFile,
    notes: &mut Vec<String>,
) -> anyhow::Result<Option<(VerticalDatum, VerticalDatum)>> {
    match (test.vertical, reference.vertical) {
        (Some(from), Some(to)) => Ok((from != to).then_some((from, to))),
        (None, None) => {
            notes.push("neither file says what its heights are above: taken as the same".into());
            Ok(None)
        }
        (Some(datum), None) | (None, Some(datum)) => {
            let (silent, option) =
                if test.vertical.is_none() { ("test", "--test-vertical") } else { ("reference", "--ref-vertical") };
            notes.push(format!("the {silent} does not say what its heights are above: taken as {datum}, see {option}"));
            Ok(None)
        }
    }
}

fn projection(definition: &str, file: &SurfaceFile) -> anyhow::Result<MapProjection> {
    MapProjection::from_definition(definition)
        .with_context(|| format!("its coordinate system: {}", file.path.display()))
}

fn convert(
    test: &mut SurfaceFile,
    from: &str,
    to: &str,
    heights: Option<(VerticalDatum, VerticalDatum)>,
    notes: &mut Vec<String>,
) -> anyhow::Result<()> {
    let (from_map, to_map) = (projection(from, test)?, projection(to, test)?);
    let axis = |i: usize| test.positions.iter().map(|p| p[i]).collect::<Vec<f64>>();
    let (mut x, mut y, mut z) = (axis(0), axis(1), axis(2));
    let mut lost = from_map.lonlat_from_map_slices(&mut x, &mut y)?;
    if let Some((from, to)) = heights {
        lost += HeightConverter::new(from)?.ellipsoid_from_datum_slices(&x, &y, &mut z)?;
        lost += HeightConverter::new(to)?.datum_from_ellipsoid_slices(&x, &y, &mut z)?;
        notes.push(format!("the test's heights were converted from {from} to {to}"));
    }
    lost += to_map.map_from_lonlat_slices(&mut x, &mut y)?;
    ensure!(lost == 0, "{lost} points cannot be converted from {from} to {to}: {}", test.path.display());
    if from != to {
        notes.push(format!("the test was projected from {from} to {to}"));
    }
    for (i, position) in test.positions.iter_mut().enumerate() {
        *position = [x[i], y[i], z[i]];
    }
    Ok(())
}
