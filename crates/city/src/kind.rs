//! What a city object is, by its CityJSON name.

use std::borrow::Cow;
use std::fmt;

/// The kind of a city object by its CityJSON name (`BuildingPart`); CityGML's names are the same but for older spellings.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ObjectKind(Cow<'static, str>);

/// What an object is to a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// A building.
    Building,
    /// A part of a building that stands for a piece of it (`BuildingPart`, `BuildingUnit`).
    Part,
    /// Something attached outside (chimney, dormer, balcony, outer stairs).
    Installation,
    /// Something inside (room, furniture, storey).
    Interior,
    /// No building: bridges, roads, relief, vegetation, …
    Other,
}

impl ObjectKind {
    /// A building.
    pub const BUILDING: Self = Self(Cow::Borrowed("Building"));
    /// A part of a building.
    pub const BUILDING_PART: Self = Self(Cow::Borrowed("BuildingPart"));
    /// An installation on a building.
    pub const BUILDING_INSTALLATION: Self = Self(Cow::Borrowed("BuildingInstallation"));

    /// The kind of a name as it stands in a file.
    pub fn new(name: impl Into<Cow<'static, str>>) -> Self {
        Self(name.into())
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// What the object is to a building.
    pub fn role(&self) -> Role {
        match self.name() {
            "Building" => Role::Building,
            "BuildingPart" | "BuildingUnit" => Role::Part,
            "BuildingInstallation" | "BuildingConstructiveElement" => Role::Installation,
            "BuildingRoom" | "Room" | "BuildingStorey" | "BuildingFurniture" | "IntBuildingInstallation" => {
                Role::Interior
            }
            _ => Role::Other,
        }
    }
}

impl fmt::Display for ObjectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
