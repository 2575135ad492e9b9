//! Maps that a camera would measure of a model: depth, normal, mask, class and object per pixel.
//!
//! Rays pass through the centres of the pixels. The depth is the distance along the optical axis
//! (z-depth), which trainers render, or the distance along the ray. At the corner of a wide image
//! the two differ by a quarter. A pixel that sees no building has the depth +∞. The depth 0 would
//! be wrong, because resizing in a trainer would mix it with the depths of the neighbours. Normals
//! face the camera.

use bvh::{DepthImage, MISS};
use gaussian::SplatLabel;
use raster::Grid;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{PriorModel, Rays, View, surface_label};
use numeric::vector::dot;

/// Meaning of the depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum DepthKind {
    /// Distance along the optical axis of the camera.
    #[default]
    ZDepth,
    /// Distance along the ray.
    RayLength,
}

impl DepthKind {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] =
        [("z", Self::ZDepth, "Along the axis of the camera"), ("ray", Self::RayLength, "Along the ray")];
}

/// Axes of the normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum NormalFrame {
    /// Axes of the mesh.
    #[default]
    World,
    /// Axes of the camera: right, down, forward. Normals that face the camera have a negative last
    /// component near the middle of the image.
    Camera,
}

impl NormalFrame {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] =
        [("world", Self::World, "The axes of the cameras' frame"), ("camera", Self::Camera, "The axes of each camera")];
}

/// Options for the maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MapConfig {
    /// Meaning of the depth.
    pub depth: DepthKind,
    /// Axes of the normals.
    pub normals: NormalFrame,
}

/// Class of a pixel that sees no building.
pub const MISSING_CLASS: u8 = SplatLabel::NONE.class;
/// Object of a pixel that sees no building; objects are numbered from 1.
pub const NO_OBJECT: u32 = SplatLabel::NONE.object;

/// Maps of a view. All have the size of its image.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorMaps {
    /// Depth, metres; +∞ where no building is seen.
    pub depth_m: Grid<f32>,
    /// Unit normal facing the camera; zero where no building is seen.
    pub normal: Grid<[f32; 3]>,
    /// Number of the class of the surface ([`city::SurfaceClass`]); [`MISSING_CLASS`] where no
    /// building is seen.
    pub class: Grid<u8>,
    /// Index of the object in the model plus one; [`NO_OBJECT`] where no building is seen.
    pub object: Grid<u32>,
}

impl PriorMaps {
    /// Casts the rays of a view; `rays` must belong to its lens.
    pub fn render(model: &PriorModel, view: &View, rays: &Rays, config: MapConfig) -> Self {
        let (width, height) = (rays.width(), rays.height());
        let image = model.bvh().cast_image(&view.eye(), width, height, |column, row| rays.direction(column, row));
        let mut maps = Self {
            depth_m: Grid::filled(width, height, f32::INFINITY),
            normal: Grid::filled(width, height, [0.0; 3]),
            class: Grid::filled(width, height, MISSING_CLASS),
            object: Grid::filled(width, height, NO_OBJECT),
        };
        let depth = maps.depth_m.data_mut().par_chunks_mut(width).zip(maps.normal.data_mut().par_chunks_mut(width));
        let ids = maps.class.data_mut().par_chunks_mut(width).zip(maps.object.data_mut().par_chunks_mut(width));
        depth.zip(ids).enumerate().for_each(|(row, ((depth, normal), (class, object)))| {
            for column in 0..width {
                let Some(pixel) = Pixel::new(model, view, rays, config, &image, [column, row]) else { continue };
                depth[column] = pixel.depth_m;
                normal[column] = pixel.normal;
                class[column] = pixel.class;
                object[column] = pixel.object;
            }
        });
        maps
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
struct Pixel {
    depth_m: f32,
    normal: [f32; 3],
    class: u8,
    object: u32,
}

impl Pixel {
    /// Returns `None` when the pixel sees no building.
    fn new(
        model: &PriorModel,
        view: &View,
        rays: &Rays,
        config: MapConfig,
        image: &DepthImage,
        [column, row]: [usize; 2],
    ) -> Option<Self> {
        let at = row * image.width + column;
        let triangle = Some(image.triangle[at]).filter(|&t| t != MISS)? as usize;
        if !model.is_building(triangle) {
            return None;
        }
        let [x, y] = rays.direction(column, row)?;
        let surface = model.mesh().surface(triangle);
        let ray = [x, y, 1.0];
        let world = model.normal(triangle);
        let in_camera = view.pose.rotation.map(|axis| dot(axis, world));
        let turn = if dot(in_camera, ray) > 0.0 { -1.0 } else { 1.0 };
        let normal = match config.normals {
            NormalFrame::World => world,
            NormalFrame::Camera => in_camera,
        };
        let depth = f64::from(image.depth[at]);
        let depth = match config.depth {
            DepthKind::ZDepth => depth,
            DepthKind::RayLength => depth * dot(ray, ray).sqrt(),
        };
        let SplatLabel { class, object } = surface_label(surface.class, surface.object);
        Some(Self {
            depth_m: depth as f32,
            // Adding zero turns −0 into 0, so that equal normals have equal bytes.
            normal: normal.map(|c| (turn * c) as f32 + 0.0),
            class,
            object,
        })
    }
}

#[cfg(test)]
mod tests;
