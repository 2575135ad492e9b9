//! Classes of surfaces: the semantics of CityGML's boundary surfaces.

use std::fmt;

/// Class of a surface. Its number is stable and is used in class maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
#[repr(u8)]
#[non_exhaustive]
pub enum SurfaceClass {
    /// The file names no class.
    #[default]
    Unclassified = 0,
    /// The bottom of a building.
    Ground = 1,
    /// Roof.
    Roof = 2,
    /// Outer wall.
    Wall = 3,
    /// A virtual surface that closes a solid and does not exist in reality.
    Closure = 4,
    /// A ceiling that is visible from outside, such as the underside of an oriel.
    OuterCeiling = 5,
    /// A floor outside, such as the floor of a loggia.
    OuterFloor = 6,
    /// Window.
    Window = 7,
    /// Door.
    Door = 8,
    /// A wall, floor or ceiling inside the building.
    Interior = 9,
    /// A class that no surface of a building has, such as a traffic area.
    Other = 10,
}

/// Classes in the order of their numbers, with their names in CityGML and CityJSON.
const NAMES: [(SurfaceClass, &str); 11] = [
    (SurfaceClass::Unclassified, "Unclassified"),
    (SurfaceClass::Ground, "GroundSurface"),
    (SurfaceClass::Roof, "RoofSurface"),
    (SurfaceClass::Wall, "WallSurface"),
    (SurfaceClass::Closure, "ClosureSurface"),
    (SurfaceClass::OuterCeiling, "OuterCeilingSurface"),
    (SurfaceClass::OuterFloor, "OuterFloorSurface"),
    (SurfaceClass::Window, "Window"),
    (SurfaceClass::Door, "Door"),
    (SurfaceClass::Interior, "InteriorWallSurface"),
    (SurfaceClass::Other, "Other"),
];

impl SurfaceClass {
    /// Iterates over all classes in the order of their numbers.
    pub fn all() -> impl Iterator<Item = Self> {
        NAMES.iter().map(|&(class, _)| class)
    }

    /// Returns the class with a CityGML or CityJSON name, or [`SurfaceClass::Other`] for an unknown
    /// name.
    pub fn from_name(name: &str) -> Self {
        match name {
            "CeilingSurface" | "FloorSurface" => Self::Interior,
            "WindowSurface" => Self::Window,
            "DoorSurface" => Self::Door,
            _ => NAMES.iter().find(|&&(_, known)| known == name).map_or(Self::Other, |&(class, _)| class),
        }
    }

    /// Returns the name in CityGML and CityJSON, such as `RoofSurface`.
    pub fn name(self) -> &'static str {
        NAMES[self as usize].1
    }

    /// Returns the class with a number, if there is one.
    pub fn from_number(number: u8) -> Option<Self> {
        NAMES.get(usize::from(number)).map(|&(class, _)| class)
    }
}

impl fmt::Display for SurfaceClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_lead_back() {
        for (number, class) in SurfaceClass::all().enumerate() {
            assert_eq!(class as usize, number);
            assert_eq!(SurfaceClass::from_number(number as u8), Some(class));
            assert_eq!(SurfaceClass::from_name(class.name()), class);
        }
        assert_eq!(SurfaceClass::from_number(11), None);
        assert_eq!(SurfaceClass::from_name("TrafficArea"), SurfaceClass::Other);
    }
}
