//! The surface of a scene: terrain, buildings, trees and vehicles.

pub(super) mod building;
pub(super) mod crown;
pub(super) mod frame;
pub(super) mod index;
pub(super) mod lod2;
pub(super) mod natural_crown;
pub(super) mod noise;
pub(super) mod planting;
pub(super) mod prism;
pub(super) mod ray;
pub(super) mod scene;
pub(super) mod streets;
pub(super) mod terrain;
pub(super) mod texture;
pub(super) mod town;
pub(super) mod tree;
