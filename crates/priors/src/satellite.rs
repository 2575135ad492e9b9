//! What a satellite image sees of a model: height above the ellipsoid, distance, normal, class and
//! object of every pixel.
//!
//! A pixel of an RPC image sees along the line between the ground points that the RPC gives it
//! above and below the model ([`LinesOfSight`]); the first triangle on it is what it sees. No
//! centre of projection is assumed: scanners have none. Normals are in the directions of east,
//! north and up at the middle of the model: the map's axes turned by the convergence of its
//! meridians there (over a scene of 10 km that changes by less than 0.1°).

mod lines;

pub use lines::LinesOfSight;

use raster::Grid;
use rayon::prelude::*;

use crate::maps::{MISSING_CLASS, NO_OBJECT};
use crate::{PriorModel, PriorsError};
use numeric::vector::{along, dot, norm};

/// The maps of one image, all of its size.
#[derive(Debug, Clone, PartialEq)]
pub struct SatelliteMaps {
    /// Metres above the ellipsoid that the model's heights are above; NaN where no building is
    /// seen.
    pub height_m: Grid<f32>,
    /// Metres along the line of sight from the height [`LinesOfSight::from_height_m`]; NaN where no
    /// building is seen.
    pub distance_m: Grid<f32>,
    /// East, north, up; unit normals turned to the sensor, zero where no building is seen.
    pub normal: Grid<[f32; 3]>,
    /// Number of the surface's class ([`city::SurfaceClass`]); [`MISSING_CLASS`] where no building
    /// is seen.
    pub class: Grid<u8>,
    /// Index of the object in the model plus one; [`NO_OBJECT`] where no building is seen.
    pub object: Grid<u32>,
}

impl SatelliteMaps {
    /// Looks along the lines of sight of an image.
    ///
    /// # Errors
    /// An image of more than [`crate::MAX_PIXELS`] pixels.
    pub fn render(model: &PriorModel, lines: &LinesOfSight) -> Result<Self, PriorsError> {
        let (width, height) = lines.size();
        if width.saturating_mul(height) > crate::MAX_PIXELS {
            return Err(PriorsError::ImageSize { width, height, limit: crate::MAX_PIXELS });
        }
        let mut maps = Self {
            height_m: Grid::filled(width, height, f32::NAN),
            distance_m: Grid::filled(width, height, f32::NAN),
            normal: Grid::filled(width, height, [0.0; 3]),
            class: Grid::filled(width, height, MISSING_CLASS),
            object: Grid::filled(width, height, NO_OBJECT),
        };
        if width == 0 || height == 0 {
            return Ok(maps);
        }
        let metres =
            maps.height_m.data_mut().par_chunks_mut(width).zip(maps.distance_m.data_mut().par_chunks_mut(width));
        let ids = maps.class.data_mut().par_chunks_mut(width).zip(maps.object.data_mut().par_chunks_mut(width));
        let rows = metres.zip(ids).zip(maps.normal.data_mut().par_chunks_mut(width)).enumerate();
        rows.for_each(|(row, (((height_m, distance_m), (class, object)), normal))| {
            for column in 0..width {
                let Some(seen) = Seen::new(model, lines, column, row) else { continue };
                height_m[column] = seen.height_m;
                distance_m[column] = seen.distance_m;
                normal[column] = seen.normal;
                class[column] = seen.class;
                object[column] = seen.object;
            }
        });
        Ok(maps)
    }

    /// Where a building is seen.
    pub fn mask(&self) -> Grid<bool> {
        self.object.map(|object| *object != NO_OBJECT)
    }

    /// How many pixels see a building.
    pub fn hits(&self) -> usize {
        self.object.data().iter().filter(|object| **object != NO_OBJECT).count()
    }
}

/// What one pixel sees.
struct Seen {
    height_m: f32,
    distance_m: f32,
    normal: [f32; 3],
    class: u8,
    object: u32,
}

impl Seen {
    /// `None` where no building is seen.
    fn new(model: &PriorModel, lines: &LinesOfSight, column: usize, row: usize) -> Option<Self> {
        let ray = lines.ray(column, row)?;
        let hit = model.bvh().closest_hit(&ray)?;
        let triangle = hit.triangle as usize;
        if !model.is_building(triangle) {
            return None;
        }
        let surface = model.mesh().surface(triangle);
        let world = model.normal(triangle);
        let turn = if dot(world, ray.direction) > 0.0 { -1.0 } else { 1.0 };
        let height = along(ray.origin, hit.t, ray.direction)[2] + model.mesh().origin.z;
        Some(Self {
            height_m: height as f32,
            distance_m: (hit.t * norm(ray.direction)) as f32,
            // Zero has no sign in a file that others compare.
            normal: lines.east_north_up(world).map(|c| (turn * c) as f32 + 0.0),
            class: surface.class as u8,
            object: surface.object.saturating_add(1),
        })
    }
}

#[cfg(test)]
mod tests;
