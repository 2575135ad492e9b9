//! What a camera would measure of a model: depth, normal, mask, class and object of every pixel.
//!
//! Rays go through the centres of the pixels. The depth is the distance along the camera's axis
//! (z-depth), which trainers render, or along the ray: at the corner of a wide image they differ by
//! a quarter. A pixel that sees no building has depth +∞, never 0, which a trainer's resizing would
//! mix into depths of its neighbours. Normals are turned to the camera.

use bvh::{DepthImage, MISS};
use raster::Grid;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{PriorModel, Rays, View};
use numeric::vector::dot;

/// What depth means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum DepthKind {
    /// Along the axis of the camera.
    #[default]
    ZDepth,
    /// Along the ray.
    RayLength,
}

/// The axes that normals are given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum NormalFrame {
    /// Those of the mesh.
    #[default]
    World,
    /// Those of the camera: right, down, forward. Normals turned to it have a negative last
    /// component near the middle.
    Camera,
}

/// What the maps hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MapConfig {
    /// What depth means.
    pub depth: DepthKind,
    /// The axes of normals.
    pub normals: NormalFrame,
}

/// The class of a pixel that sees no building.
pub const MISSING_CLASS: u8 = 255;
/// The object of a pixel that sees no building; objects are counted from 1.
pub const NO_OBJECT: u32 = 0;

/// The maps of one view, all of the size of its image.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorMaps {
    /// Metres; +∞ where no building is seen.
    pub depth_m: Grid<f32>,
    /// Unit normals, turned to the camera; zero where no building is seen.
    pub normal: Grid<[f32; 3]>,
    /// Number of the surface's class ([`city::SurfaceClass`]); [`MISSING_CLASS`] where no building
    /// is seen.
    pub class: Grid<u8>,
    /// Index of the object in the model plus one; [`NO_OBJECT`] where no building is seen.
    pub object: Grid<u32>,
}

impl PriorMaps {
    /// Casts the rays of a view; `rays` are those of its lens.
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
struct Pixel {
    depth_m: f32,
    normal: [f32; 3],
    class: u8,
    object: u32,
}

impl Pixel {
    /// `None` where no building is seen.
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
        Some(Self {
            depth_m: depth as f32,
            // Zero has no sign in a file that others compare.
            normal: normal.map(|c| (turn * c) as f32 + 0.0),
            class: surface.class as u8,
            object: surface.object.saturating_add(1),
        })
    }
}

#[cfg(test)]
mod tests;
