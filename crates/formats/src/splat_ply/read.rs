//! Reads splats. Properties are found by name, so that files of other programs can be read. Unknown
//! ones are skipped.

use std::path::Path;

use gaussian::{Splat, SplatHarmonics, SplatLabel};

use super::labels::{LabelTable, SplatLabels};
use super::layout::{SH_C0, SH_DEGREE_MAX, SplatForm, SplatLayout};
use super::origin::LocalOrigin;
use crate::format_error::FormatError;
use crate::ply::{PlyElement, PlyEncoding, PlyHeader, PlyNumber, PlyProperty};
use crate::regular::read_regular;

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 16 << 30;
/// Thickness of a disc as a fraction of its smaller scale.
const DISC_THICKNESS: f32 = 1e-3;
/// Greatest thickness of a disc in a file with three scales, as a fraction of its smaller scale.
const FLAT: f32 = 2e-3;
/// Least scale that files of bytes hold, metres: e⁻¹⁰, and rounding.
const LEAST_SCALE_M: f32 = 4.6e-5;

/// Splats from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct SplatFile {
    /// The splats. Discs get a third scale of a thousandth of their smaller one.
    pub splats: Vec<Splat>,
    /// Harmonics beyond the constant one; `None` where the file has none that are not 0.
    pub harmonics: Option<SplatHarmonics>,
    /// Classes and objects of the splats, where the file has them: only PLY can hold them.
    pub labels: Option<SplatLabels>,
    /// Properties of the file.
    pub layout: SplatLayout,
    /// Origin of the positions, when a file with it lies beside.
    pub origin: Option<LocalOrigin>,
}

impl SplatFile {
    /// Returns whether all splats are discs. Files with three scales do not say so: in them, discs
    /// are those whose third scale is 0 as far as the file can tell.
    pub fn is_flat(&self) -> bool {
        let thin = |splat: &Splat| {
            let [u, v, thickness] = splat.scale_m;
            thickness <= LEAST_SCALE_M.max(FLAT * u.min(v))
        };
        self.layout.form == SplatForm::Discs || (!self.splats.is_empty() && self.splats.iter().all(thin))
    }

    /// Gives discs the thickness that [`read`] gives them.
    pub(crate) fn flattened(mut self) -> Self {
        if self.is_flat() {
            self.layout.form = SplatForm::Discs;
            for splat in &mut self.splats {
                splat.scale_m[2] = DISC_THICKNESS * splat.scale_m[0].min(splat.scale_m[1]);
            }
        }
        self
    }
}

/// Reads the splats of a file, and the origin beside it.
///
/// # Errors
/// [`FormatError`] when the system cannot read the file or its origin, and when the file is not a
/// little-endian binary PLY of Gaussians, is shorter than its header announces, holds a splat that
/// fails [`Splat::validate`], or the origin beside it is broken.
///
/// # Examples
/// ```
/// use gaussian::Splat;
/// use formats::splat_ply::{LocalOrigin, SplatLayout, read, write};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("roof.ply");
/// let splat = Splat {
///     position: [1.0, 2.0, 3.0],
///     scale_m: [0.5, 0.5, 0.01],
///     rotation: [1.0, 0.0, 0.0, 0.0],
///     colour: [0.8, 0.3, 0.2],
///     opacity: 0.75,
/// };
/// let origin = LocalOrigin::new("EPSG:32631", "ellipsoid", [690_000.0, 4_820_000.0, 180.0]);
/// write(&path, &[splat], &origin, SplatLayout::default(), false)?;
///
/// let file = read(&path)?;
/// assert_eq!(file.splats[0].position, [1.0, 2.0, 3.0]);
/// assert_eq!(file.origin, Some(origin));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path) -> Result<SplatFile, FormatError> {
    let bytes = read_regular(path, SIZE_LIMIT).map_err(|source| FormatError::unreadable(path, "the file", source))?;
    let refused = |what: String| FormatError::new(path, what);
    let header = PlyHeader::parse(&bytes).map_err(|fault| FormatError::new(path, fault))?;
    if header.encoding != PlyEncoding::LittleEndian {
        return Err(refused("the format of the PLY is not binary_little_endian, which splats have".to_owned()));
    }
    let vertices = header.elements.first().filter(|element| element.name == "vertex");
    let vertices =
        vertices.ok_or_else(|| refused("the file does not begin with its vertices, as splats do".to_owned()))?;
    let size = vertices
        .record_bytes()
        .ok_or_else(|| refused("a vertex has a list property, expected numbers only".to_owned()))?;
    let room = (bytes.len() - header.end) / size.max(1);
    if size == 0 || vertices.count > room as u64 {
        return Err(refused(format!("the header announces {} splats, the file has room for {room}", vertices.count)));
    }
    let count = vertices.count as usize;
    let columns = Columns::of(vertices).map_err(refused)?;
    let rows = bytes[header.end..].chunks_exact(size).take(count);
    let mut splats = Vec::with_capacity(count);
    let mut coefficients: Vec<f32> = Vec::new();
    let mut labels: Option<Vec<SplatLabel>> = columns.labels.map(|_| Vec::with_capacity(count));
    for (index, row) in rows.enumerate() {
        let splat = columns.splat(row);
        splat.validate().map_err(|defect| FormatError::new(path, format!("splat {index}: {defect}")))?;
        splats.push(splat);
        if let (Some(labels), Some(places)) = (&mut labels, columns.labels) {
            let [class, object] = places.map(|place| value(row, place));
            labels.push(SplatLabel { class: class as u8, object: object as u32 });
        }
        coefficients.extend(columns.rest.iter().map(|&column| value(row, column) as f32));
    }
    if let Some(place) = coefficients.iter().position(|c| !c.is_finite()) {
        let what = format!("splat {}: a harmonic is not finite", place / columns.rest.len().max(1));
        return Err(FormatError::new(path, what));
    }
    // Trainers without harmonics pad files with zeros for loaders.
    let are_zero = coefficients.iter().all(|c| *c == 0.0);
    let harmonics = SplatHarmonics::new(columns.layout.sh_degree, coefficients).filter(|_| !are_zero);
    let table = || LabelTable::read_beside(path).map(Option::unwrap_or_default);
    let labels = labels.map(|of| Ok::<_, FormatError>(SplatLabels { of, table: table()? })).transpose()?;
    Ok(SplatFile { splats, harmonics, labels, layout: columns.layout, origin: LocalOrigin::read_beside(path)? })
}

/// Byte offset and type of a number within a row.
type Column = (usize, PlyNumber);

/// Returns a number of a row.
fn value(row: &[u8], (at, number): Column) -> f64 {
    number.value(&row[at..])
}

/// Places of the numbers of a splat within a row.
struct Columns {
    position: [Column; 3],
    colour: [Column; 3],
    opacity: Column,
    scale: [Column; 3],
    rotation: [Column; 4],
    /// The harmonics beyond the constant one.
    rest: Vec<Column>,
    /// Class and object, where there are both with the types of labels.
    labels: Option<[Column; 2]>,
    layout: SplatLayout,
}

impl Columns {
    fn of(vertices: &PlyElement) -> Result<Self, String> {
        let column = |name: &str| {
            let missing = || format!("the vertices have no float property {name:?}, so this is not a file of splats");
            vertices.column(name).filter(|(_, number)| number.is_float()).ok_or_else(missing)
        };
        let label = |name: &str, kind: PlyNumber| vertices.column(name).filter(|(_, number)| *number == kind);
        let numbered = |name: &str, i: usize| column(&format!("{name}_{i}"));
        let (first, second) = (numbered("scale", 0)?, numbered("scale", 1)?);
        let third = numbered("scale", 2).ok();
        let is_rest = |property: &&PlyProperty| property.name.starts_with("f_rest_") && property.value.is_float();
        let rest = vertices.properties.iter().filter(is_rest).count();
        let degree = (0..=SH_DEGREE_MAX)
            .find(|&sh_degree| SplatLayout { sh_degree, ..SplatLayout::default() }.rest() == rest)
            .ok_or_else(|| {
                format!("found {rest} f_rest properties, expected 0, 9, 24 or 45 (harmonics of degree 0 to 3)")
            })?;
        let rest = (0..rest).map(|i| numbered("f_rest", i)).collect::<Result<Vec<Column>, String>>()?;
        Ok(Self {
            rest,
            labels: label("class", PlyNumber::U8)
                .zip(label("object", PlyNumber::U32))
                .map(|(class, object)| [class, object]),
            position: [column("x")?, column("y")?, column("z")?],
            colour: [numbered("f_dc", 0)?, numbered("f_dc", 1)?, numbered("f_dc", 2)?],
            opacity: column("opacity")?,
            scale: [first, second, third.unwrap_or(first)],
            rotation: [numbered("rot", 0)?, numbered("rot", 1)?, numbered("rot", 2)?, numbered("rot", 3)?],
            layout: SplatLayout {
                form: if third.is_some() { SplatForm::Ellipsoids } else { SplatForm::Discs },
                sh_degree: degree,
            },
        })
    }

    fn splat(&self, row: &[u8]) -> Splat {
        let value = |column: Column| value(row, column);
        let rotation = self.rotation.map(value);
        // Trainers store quaternions of any length and normalise them when they use them.
        let length = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        let mut scale_m = self.scale.map(|s| value(s).exp() as f32);
        if self.layout.form == SplatForm::Discs {
            scale_m[2] = DISC_THICKNESS * scale_m[0].min(scale_m[1]);
        }
        let opacity = 1.0 / (1.0 + (-value(self.opacity)).exp());
        Splat {
            position: self.position.map(|p| value(p) as f32),
            scale_m,
            rotation: rotation.map(|q| (q / length) as f32),
            colour: self.colour.map(|c| (0.5 + SH_C0 * value(c)) as f32),
            // Logits beyond ±17 round to an opacity of 0 or 1 in f32, which has no finite logit.
            opacity: (opacity as f32).clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON),
        }
    }
}
