//! The catalogue of defects: what can be wrong with a city model, each with a stable number.
//!
//! Numbers below 1000 are those of val3dity's catalogue (Ledoux 2018, doi:10.1186/s40965-018-0043-x) with the same
//! meaning; what it has no number for starts at 1001.

use std::fmt;

/// A kind of defect by its number in the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u16)]
#[non_exhaustive]
pub enum DefectCode {
    /// A ring has fewer than three different vertices.
    TooFewPoints = 101,
    /// A vertex is repeated in a row.
    ConsecutivePointsSame = 102,
    /// The first and the last vertex of a ring that must be closed differ.
    RingNotClosed = 103,
    /// A ring meets itself.
    RingSelfIntersection = 104,
    /// Two rings of a polygon cross or share an edge.
    RingIntersection = 201,
    /// Two rings of a polygon are the same.
    DuplicateRings = 202,
    /// A vertex lies off the best-fit plane.
    NonPlanarDistance = 203,
    /// A triangle of the polygon looks another way than the polygon.
    NonPlanarNormals = 204,
    /// Rings touch so that the inside of the polygon falls into several pieces.
    InteriorDisconnected = 205,
    /// A hole lies outside of the outer ring.
    InnerRingOutside = 206,
    /// A hole lies in another hole.
    InnerRingsNested = 207,
    /// A hole turns the same way as the outer ring.
    OrientationRingsSame = 208,
    /// A shell has fewer than four polygons.
    TooFewPolygons = 301,
    /// A shell has edges that only one polygon uses.
    ShellNotClosed = 302,
    /// An edge is used by more than two polygons of a shell, or the polygons around a vertex are no single fan.
    NonManifold = 303,
    /// A shell falls into several pieces.
    MultipleComponents = 305,
    /// Polygons of a shell meet elsewhere than along the edges they share.
    ShellSelfIntersection = 306,
    /// Some polygons of a shell look to the wrong side.
    WrongOrientation = 307,
    /// Two shells of a solid cross, or share a piece of a face.
    ShellsIntersect = 401,
    /// Two shells of a solid are the same.
    DuplicateShells = 402,
    /// A cavity lies outside of its solid, or in another cavity.
    InnerShellOutside = 403,
    /// Shells touch so that the inside of the solid falls into several pieces.
    SolidInteriorDisconnected = 404,
    /// All polygons of a shell look to the wrong side.
    WrongOrientationShell = 405,
    /// Two solids of a composite solid overlap.
    SolidsIntersect = 501,
    /// Two solids of a composite solid are the same.
    DuplicateSolids = 502,
    /// The solids of a composite solid do not hang together by faces.
    SolidsDisconnected = 503,
    /// Parts of a building overlap.
    PartsOverlap = 601,
    /// An object has no geometry.
    NoGeometry = 609,
    /// The file breaks the rules of its format.
    InvalidFile = 901,
    /// A geometry or a part of it has no surfaces.
    EmptyPrimitive = 902,
    /// The format, or a thing in it, is not supported.
    NotSupported = 904,
    /// A ring names a vertex that is not there.
    VertexOutOfRange = 1001,
    /// A coordinate is no finite number of reasonable size.
    CoordinateOutOfRange = 1002,
    /// A polygon has no area.
    ZeroArea = 1003,
    /// A polygon occurs a second time in its object.
    DuplicatePolygon = 1004,
    /// A geometry of points or lines.
    NotASurface = 1005,
    /// A reference to something that is not in the file.
    UnresolvedReference = 1006,
    /// An identifier occurs a second time.
    DuplicateId = 1007,
    /// Semantics that do not fit the geometry.
    SemanticsMismatch = 1008,
    /// A level of detail that is missing or no number.
    LodUnknown = 1009,
    /// The file does not say which reference system its coordinates are in.
    CrsMissing = 1010,
    /// The reference system is named in a way that gives no EPSG code.
    CrsUnknown = 1011,
    /// A polygon that could not be cut into triangles.
    NotTriangulated = 1012,
    /// Something that is too large to be checked.
    NotChecked = 1013,
}

/// What a defect did to the thing it was found in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effect {
    /// Nothing: it is used as it is.
    Noted,
    /// It was mended without moving a vertex.
    Repaired,
    /// It is left out.
    Dropped,
}

/// A defect that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Defect {
    /// What kind.
    pub code: DefectCode,
    /// What was done.
    pub effect: Effect,
    /// Index in [`CityModel::objects`](crate::CityModel::objects), where an object is concerned.
    pub object: Option<usize>,
    /// Where: `geometry 0, surface 12` or a place in the file.
    pub place: String,
    /// Details, empty where the code says it all.
    pub detail: String,
}

impl DefectCode {
    /// Every code, ascending.
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

    /// The number in the catalogue.
    pub fn number(self) -> u16 {
        self as u16
    }

    /// A short sentence.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::TooFewPoints => "a ring has fewer than three different vertices",
            Self::ConsecutivePointsSame => "a vertex is repeated in a row",
            Self::RingNotClosed => "a ring is not closed",
            Self::RingSelfIntersection => "a ring meets itself",
            Self::RingIntersection => "two rings of a polygon cross or share an edge",
            Self::DuplicateRings => "two rings of a polygon are the same",
            Self::NonPlanarDistance => "a vertex lies off the polygon's plane",
            Self::NonPlanarNormals => "a part of the polygon looks another way than the polygon",
            Self::InteriorDisconnected => "touching rings cut the polygon's inside into pieces",
            Self::InnerRingOutside => "a hole lies outside of the outer ring",
            Self::InnerRingsNested => "a hole lies in another hole",
            Self::OrientationRingsSame => "a hole turns the same way as the outer ring",
            Self::TooFewPolygons => "a shell has fewer than four polygons",
            Self::ShellNotClosed => "a shell is not closed",
            Self::NonManifold => "an edge or a vertex joins more polygons of a shell than go around it once",
            Self::MultipleComponents => "a shell falls into several pieces",
            Self::ShellSelfIntersection => "polygons of a shell meet elsewhere than along their edges",
            Self::WrongOrientation => "polygons of a shell look to the wrong side",
            Self::ShellsIntersect => "two shells of a solid cross or share a piece of a face",
            Self::DuplicateShells => "two shells of a solid are the same",
            Self::InnerShellOutside => "a cavity lies outside of its solid, or in another cavity",
            Self::SolidInteriorDisconnected => "touching shells cut the solid's inside into pieces",
            Self::WrongOrientationShell => "all polygons of a shell look to the wrong side",
            Self::SolidsIntersect => "two solids of a composite solid overlap",
            Self::DuplicateSolids => "two solids of a composite solid are the same",
            Self::SolidsDisconnected => "the solids of a composite solid do not hang together",
            Self::PartsOverlap => "parts of a building overlap",
            Self::NoGeometry => "an object has no geometry",
            Self::InvalidFile => "the file breaks the rules of its format",
            Self::EmptyPrimitive => "a geometry or a part of it has no surfaces",
            Self::NotSupported => "not supported",
            Self::VertexOutOfRange => "a ring names a vertex that is not there",
            Self::CoordinateOutOfRange => "a coordinate is no finite number of reasonable size",
            Self::ZeroArea => "a polygon has no area",
            Self::DuplicatePolygon => "a polygon occurs a second time in its object",
            Self::NotASurface => "a geometry of points or lines",
            Self::UnresolvedReference => "a reference to something that is not in the file",
            Self::DuplicateId => "an identifier occurs a second time",
            Self::SemanticsMismatch => "the semantics do not fit the geometry",
            Self::LodUnknown => "the level of detail is missing or no number",
            Self::CrsMissing => "the file does not name its reference system",
            Self::CrsUnknown => "the reference system's name gives no EPSG code",
            Self::NotTriangulated => "a polygon could not be cut into triangles",
            Self::NotChecked => "too large to be checked",
        }
    }
}

impl fmt::Display for DefectCode {
    /// `203 (a vertex lies off the polygon's plane)`.
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
