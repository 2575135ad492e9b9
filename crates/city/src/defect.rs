//! The catalogue of the defects of city models, each with a stable number.
//!
//! Numbers below 1000 have the same meaning as in val3dity's catalogue (Ledoux 2018,
//! doi:10.1186/s40965-018-0043-x). Defects that val3dity has no number for start at 1001.

use std::fmt;

/// Kind of a defect, by its number in the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u16)]
#[non_exhaustive]
pub enum DefectCode {
    /// A ring has fewer than three different vertices.
    TooFewPoints = 101,
    /// A ring repeats a vertex directly.
    ConsecutivePointsSame = 102,
    /// The first and last vertex of a ring differ, in a format that requires them to be equal.
    RingNotClosed = 103,
    /// A ring touches or crosses itself.
    RingSelfIntersection = 104,
    /// Two rings of a polygon cross or share an edge.
    RingIntersection = 201,
    /// Two rings of a polygon are the same.
    DuplicateRings = 202,
    /// A vertex lies off the best-fit plane.
    NonPlanarDistance = 203,
    /// The normal of a triangle of the polygon deviates from the normal of the polygon.
    NonPlanarNormals = 204,
    /// Rings touch and cut the interior of the polygon into pieces.
    InteriorDisconnected = 205,
    /// A hole lies outside the outer ring.
    InnerRingOutside = 206,
    /// A hole lies in another hole.
    InnerRingsNested = 207,
    /// A hole turns the same way as the outer ring.
    OrientationRingsSame = 208,
    /// A shell has fewer than four polygons.
    TooFewPolygons = 301,
    /// A shell has edges that belong to only one polygon.
    ShellNotClosed = 302,
    /// An edge belongs to more than two polygons of a shell, or the polygons around a vertex form
    /// several fans.
    NonManifold = 303,
    /// A shell consists of several pieces.
    MultipleComponents = 305,
    /// Polygons of a shell touch or cross where they do not share an edge.
    ShellSelfIntersection = 306,
    /// Some polygons of a shell face the wrong side.
    WrongOrientation = 307,
    /// Two shells of a solid cross or share part of a face.
    ShellsIntersect = 401,
    /// Two shells of a solid are the same.
    DuplicateShells = 402,
    /// A cavity lies outside its solid, or in another cavity.
    InnerShellOutside = 403,
    /// Shells touch and cut the interior of the solid into pieces.
    SolidInteriorDisconnected = 404,
    /// All polygons of a shell face the wrong side.
    WrongOrientationShell = 405,
    /// Two solids of a composite solid overlap.
    SolidsIntersect = 501,
    /// Two solids of a composite solid are the same.
    DuplicateSolids = 502,
    /// The solids of a composite solid are not connected by shared faces.
    SolidsDisconnected = 503,
    /// Parts of a building overlap.
    PartsOverlap = 601,
    /// An object has no geometry.
    NoGeometry = 609,
    /// The file breaks the rules of its format.
    InvalidFile = 901,
    /// A geometry or a part of it has no surfaces.
    EmptyPrimitive = 902,
    /// The format, or an element of it, is not supported.
    NotSupported = 904,
    /// A ring names a vertex that does not exist.
    VertexOutOfRange = 1001,
    /// A coordinate is not finite, or too large.
    CoordinateOutOfRange = 1002,
    /// A polygon has no area.
    ZeroArea = 1003,
    /// An object has the same polygon twice.
    DuplicatePolygon = 1004,
    /// A geometry consists of points or lines.
    NotASurface = 1005,
    /// A reference leads to something that is not in the file.
    UnresolvedReference = 1006,
    /// Two elements have the same identifier.
    DuplicateId = 1007,
    /// The semantics do not fit the geometry.
    SemanticsMismatch = 1008,
    /// The level of detail is missing or not a number.
    LodUnknown = 1009,
    /// The file does not name the reference system of its coordinates.
    CrsMissing = 1010,
    /// The name of the reference system gives no EPSG code.
    CrsUnknown = 1011,
    /// A polygon cannot be cut into triangles.
    NotTriangulated = 1012,
    /// A geometry is too large to be checked.
    NotChecked = 1013,
}

/// Consequence of a defect for the element that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effect {
    /// None: the element is used as it is.
    Noted,
    /// The element was repaired without moving a vertex.
    Repaired,
    /// The element is left out.
    Dropped,
}

/// A defect of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Defect {
    /// Kind of the defect.
    pub code: DefectCode,
    /// Consequence of the defect.
    pub effect: Effect,
    /// Index in [`CityModel::objects`](crate::CityModel::objects), if the defect belongs to an
    /// object.
    pub object: Option<usize>,
    /// Place within the object (`geometry 0, surface 12`) or within the file.
    pub place: String,
    /// Details; may be empty.
    pub detail: String,
}

impl DefectCode {
    /// All codes, ascending.
    pub const ALL: [Self; 44] = [
        Self::TooFewPoints,
        Self::ConsecutivePointsSame,
        Self::RingNotClosed,
        Self::RingSelfIntersection,
        Self::RingIntersection,
        Self::DuplicateRings,
        Self::NonPlanarDistance,
        Self::NonPlanarNormals,
        Self::InteriorDisconnected,
        Self::InnerRingOutside,
        Self::InnerRingsNested,
        Self::OrientationRingsSame,
        Self::TooFewPolygons,
        Self::ShellNotClosed,
        Self::NonManifold,
        Self::MultipleComponents,
        Self::ShellSelfIntersection,
        Self::WrongOrientation,
        Self::ShellsIntersect,
        Self::DuplicateShells,
        Self::InnerShellOutside,
        Self::SolidInteriorDisconnected,
        Self::WrongOrientationShell,
        Self::SolidsIntersect,
        Self::DuplicateSolids,
        Self::SolidsDisconnected,
        Self::PartsOverlap,
        Self::NoGeometry,
        Self::InvalidFile,
        Self::EmptyPrimitive,
        Self::NotSupported,
        Self::VertexOutOfRange,
        Self::CoordinateOutOfRange,
        Self::ZeroArea,
        Self::DuplicatePolygon,
        Self::NotASurface,
        Self::UnresolvedReference,
        Self::DuplicateId,
        Self::SemanticsMismatch,
        Self::LodUnknown,
        Self::CrsMissing,
        Self::CrsUnknown,
        Self::NotTriangulated,
        Self::NotChecked,
    ];

    /// Returns the number in the catalogue.
    pub fn number(self) -> u16 {
        self as u16
    }

    /// Returns the meaning as a short sentence.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::TooFewPoints => "a ring has fewer than three different vertices",
            Self::ConsecutivePointsSame => "a ring repeats a vertex directly",
            Self::RingNotClosed => "a ring is not closed",
            Self::RingSelfIntersection => "a ring touches or crosses itself",
            Self::RingIntersection => "two rings of a polygon cross or share an edge",
            Self::DuplicateRings => "two rings of a polygon are the same",
            Self::NonPlanarDistance => "a vertex lies off the polygon's plane",
            Self::NonPlanarNormals => "the normal of a part of the polygon deviates from the polygon's normal",
            Self::InteriorDisconnected => "touching rings cut the polygon's interior into pieces",
            Self::InnerRingOutside => "a hole lies outside the outer ring",
            Self::InnerRingsNested => "a hole lies in another hole",
            Self::OrientationRingsSame => "a hole turns the same way as the outer ring",
            Self::TooFewPolygons => "a shell has fewer than four polygons",
            Self::ShellNotClosed => "a shell is not closed",
            Self::NonManifold => {
                "an edge has more than two polygons of a shell, or the polygons around a vertex form several fans"
            }
            Self::MultipleComponents => "a shell consists of several pieces",
            Self::ShellSelfIntersection => "polygons of a shell touch or cross where they do not share an edge",
            Self::WrongOrientation => "polygons of a shell face the wrong side",
            Self::ShellsIntersect => "two shells of a solid cross or share part of a face",
            Self::DuplicateShells => "two shells of a solid are the same",
            Self::InnerShellOutside => "a cavity lies outside its solid, or in another cavity",
            Self::SolidInteriorDisconnected => "touching shells cut the solid's interior into pieces",
            Self::WrongOrientationShell => "all polygons of a shell face the wrong side",
            Self::SolidsIntersect => "two solids of a composite solid overlap",
            Self::DuplicateSolids => "two solids of a composite solid are the same",
            Self::SolidsDisconnected => "the solids of a composite solid are not connected by shared faces",
            Self::PartsOverlap => "parts of a building overlap",
            Self::NoGeometry => "an object has no geometry",
            Self::InvalidFile => "the file breaks the rules of its format",
            Self::EmptyPrimitive => "a geometry or a part of it has no surfaces",
            Self::NotSupported => "not supported",
            Self::VertexOutOfRange => "a ring names a vertex that does not exist",
            Self::CoordinateOutOfRange => "a coordinate is not finite, or too large",
            Self::ZeroArea => "a polygon has no area",
            Self::DuplicatePolygon => "an object has the same polygon twice",
            Self::NotASurface => "a geometry consists of points or lines",
            Self::UnresolvedReference => "a reference leads to something that is not in the file",
            Self::DuplicateId => "two elements have the same identifier",
            Self::SemanticsMismatch => "the semantics do not fit the geometry",
            Self::LodUnknown => "the level of detail is missing or not a number",
            Self::CrsMissing => "the file does not name its reference system",
            Self::CrsUnknown => "the reference system's name gives no EPSG code",
            Self::NotTriangulated => "a polygon cannot be cut into triangles",
            Self::NotChecked => "the geometry is too large to be checked",
        }
    }
}

impl fmt::Display for DefectCode {
    /// Writes the number and the meaning: `203 (a vertex lies off the polygon's plane)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.number(), self.meaning())
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Noted => "noted",
            Self::Repaired => "repaired",
            Self::Dropped => "dropped",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_is_complete_and_ascending() {
        assert!(DefectCode::ALL.is_sorted_by(|a, b| a.number() < b.number()));
        assert_eq!(DefectCode::ShellNotClosed.to_string(), "302 (a shell is not closed)");
    }
}
