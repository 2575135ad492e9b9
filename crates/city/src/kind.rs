//! Kinds of city objects.

use std::borrow::Cow;
use std::fmt;

/// Kind of a city object: its CityJSON name, such as `BuildingPart`.
///
/// CityGML uses the same names, apart from older spellings.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ObjectKind(Cow<'static, str>);

/// Role of an object in a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BuildingRole {
    /// A building.
    Building,
    /// A piece of a building (`BuildingPart`, `BuildingUnit`).
    Part,
    /// Something attached to the outside of a building: chimney, dormer, balcony, outer stairs.
    Installation,
    /// Something inside a building: room, furniture, storey.
    Interior,
    /// Not related to a building: bridge, road, relief, vegetation, …
    Other,
}

impl ObjectKind {
    /// Kind of a building.
    pub const BUILDING: Self = Self(Cow::Borrowed("Building"));
    /// Kind of a part of a building.
    pub const BUILDING_PART: Self = Self(Cow::Borrowed("BuildingPart"));
    /// Kind of an installation on a building.
    pub const BUILDING_INSTALLATION: Self = Self(Cow::Borrowed("BuildingInstallation"));

    /// Creates a kind from its name in a file.
    pub fn new(name: impl Into<Cow<'static, str>>) -> Self {
        Self(name.into())
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// Returns the role of objects of this kind in a building.
    pub fn role(&self) -> BuildingRole {
        match self.name() {
            "Building" => BuildingRole::Building,
            "BuildingPart" | "BuildingUnit" => BuildingRole::Part,
            "BuildingInstallation" | "BuildingConstructiveElement" => BuildingRole::Installation,
            "BuildingRoom" | "Room" | "BuildingStorey" | "BuildingFurniture" | "IntBuildingInstallation" => {
                BuildingRole::Interior
            }
            _ => BuildingRole::Other,
        }
    }
}

impl fmt::Display for ObjectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
