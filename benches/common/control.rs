//! Control points of the town: five places, measured in all images that show them.

use std::fmt::Write as _;
use std::path::Path;

use super::town::{self, Frame, Look};

/// Places of the points, as shares of the sides of the area.
const PLACES: [[f64; 2]; 5] = [[0.15, 0.18], [0.84, 0.12], [0.47, 0.55], [0.2, 0.86], [0.8, 0.83]];

/// A table of control points.
pub(crate) struct Control {
    area_m: [f64; 2],
    table: String,
}

impl Control {
    /// Makes a table of points in an area of `area_m` metres to the east and to the south.
    pub(crate) fn new(area_m: [f64; 2]) -> Self {
        Self { area_m, table: "name,lon,lat,height,accuracy_m,role,image,sample,line\n".to_owned() }
    }

    /// Adds the points that an image shows.
    pub(crate) fn add(&mut self, image: &Path, look: &Look, frame: &Frame) {
        for (number, share) in PLACES.iter().enumerate() {
            let [x, y] = [share[0] * self.area_m[0], -share[1] * self.area_m[1]];
            let z = town::height(x, y);
            let [a, b] = look.slant;
            let sample = (x + a * z) / look.gsd_m - frame.first[0] as f64;
            let line = (b * z - y) / look.gsd_m - frame.first[1] as f64;
            let is_inside = |v: f64, size: usize| (8.0..size as f64 - 8.0).contains(&v);
            if !is_inside(sample, frame.size[0]) || !is_inside(line, frame.size[1]) {
                continue;
            }
            let (lon, lat) =
                (town::ORIGIN.0 + x / town::METRES_PER_DEGREE[0], town::ORIGIN.1 + y / town::METRES_PER_DEGREE[1]);
            let name = image.file_name().unwrap_or_default().to_string_lossy();
            let height = town::GROUND_M + z;
            let _ = writeln!(
                self.table,
                "point {number},{lon:.9},{lat:.9},{height:.3},0.1,control,{name},{sample:.3},{line:.3}"
            );
        }
    }

    /// Writes the table.
    pub(crate) fn write(&self, path: &Path) -> std::io::Result<()> {
        std::fs::write(path, &self.table)
    }
}
