//! Maps that a satellite image would measure of a model: height above the ellipsoid, distance,
//! normal, class and object per pixel.
//!
//! The line of sight of a pixel joins the ground points that the RPC returns above and below the
//! model ([`LinesOfSight`]). The pixel sees the first triangle on this line. No centre of
//! projection is assumed, because a pushbroom scanner has none. Normals are in east, north and up
//! at the middle of the model, which are the axes of the map turned by the meridian convergence
//! there. Within a scene of 10 km the convergence changes by less than 0.1°.

mod lines;

pub use lines::LinesOfSight;

use gaussian::SplatLabel;
use raster::Grid;
use rayon::prelude::*;

use crate::maps::{MISSING_CLASS, NO_OBJECT};
use crate::{PriorModel, PriorsError, surface_label};
use numeric::vector::{along, dot, norm};

/// Maps of a satellite image. All have its size.
#[derive(Debug, Clone, PartialEq)]
pub struct SatelliteMaps {
    /// Height above the ellipsoid of the model's heights, metres; NaN where no building is seen.
    pub height_m: Grid<f32>,
    /// Distance along the line of sight from the height [`LinesOfSight::from_height_m`], metres;
    /// NaN where no building is seen.
    pub distance_m: Grid<f32>,
    /// Unit normal facing the sensor (east, north, up); zero where no building is seen.
    pub normal: Grid<[f32; 3]>,
    /// Number of the class of the surface ([`city::SurfaceClass`]); [`MISSING_CLASS`] where no
    /// building is seen.
    pub class: Grid<u8>,
    /// Index of the object in the model plus one; [`NO_OBJECT`] where no building is seen.
    pub object: Grid<u32>,
}

impl SatelliteMaps {
    /// Casts rays along the lines of sight of an image.
    ///
    /// # Errors
    /// [`PriorsError::ImageSize`] when the image has more than [`crate::MAX_PIXELS`] pixels.
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

    /// Returns the pixels that see a building.
    pub fn mask(&self) -> Grid<bool> {
        self.object.map(|object| *object != NO_OBJECT)
    }

    /// Returns the number of pixels that see a building.
    pub fn hits(&self) -> usize {
        self.object.data().iter().filter(|object| **object != NO_OBJECT).count()
    }
}

/// The values of a pixel that sees a building.
struct Seen {
    height_m: f32,
    distance_m: f32,
    normal: [f32; 3],
    class: u8,
    object: u32,
}

impl Seen {
    /// Returns `None` when the pixel sees no building.
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
        let SplatLabel { class, object } = surface_label(surface.class, surface.object);
        Some(Self {
            height_m: height as f32,
            distance_m: (hit.t * norm(ray.direction)) as f32,
            // Adding zero turns −0 into 0, so that equal normals have equal bytes.
            normal: lines.east_north_up(world).map(|c| (turn * c) as f32 + 0.0),
            class,
            object,
        })
    }
}

#[cfg(test)]
mod tests;
