//! Positions in the reference system of a city model.

/// Position in the reference system of the model, usually metres east, north and up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ModelPoint {
    /// First coordinate, usually easting.
    pub x: f64,
    /// Second coordinate, usually northing.
    pub y: f64,
    /// Third coordinate, the height above the model's vertical datum.
    pub z: f64,
}

impl ModelPoint {
    /// Creates a position.
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// Returns whether all coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }

    /// Returns the vector from `origin` to this position.
    pub fn from_origin(self, origin: Self) -> [f64; 3] {
        [self.x - origin.x, self.y - origin.y, self.z - origin.z]
    }
}

impl From<[f64; 3]> for ModelPoint {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}
