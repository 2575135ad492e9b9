//! Makes cameras in a ring around a city model that look down on it at 45°, as a COLMAP text model.
//!
//! Usage: `cargo run -p skysweep-cityfiles --example ring_of_cameras -- MODEL OUT [COUNT]`. The
//! origin of the cameras' frame is on whole metres in the middle of the model. The offset from the
//! model's frame to it is printed for `skysweep priors --offset`.

#![allow(clippy::print_stdout)]

use std::path::Path;

use camera::{Lens, LensModel, Pose};
use formats::colmap::{self, ColmapEncoding, ColmapModel, ColmapView};

const WIDTH: usize = 480;
const HEIGHT: usize = 360;
const FOCAL_PX: f64 = 420.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, out, rest @ ..] = arguments.as_slice() else { panic!("usage: ring_of_cameras MODEL OUT [COUNT]") };
    let count: u32 = rest.first().map_or(8, |text| text.parse().expect("a number of cameras"));
    let (low, high) = cityfiles::read(Path::new(model)).expect("a city model").model.bounds().expect("surfaces");
    let radius = 0.5 * (high.x - low.x).max(high.y - low.y);
    let middle = [0.5 * (low.x + high.x), 0.5 * (low.y + high.y), low.z].map(f64::floor);
    let lens = Lens::new(
        WIDTH,
        HEIGHT,
        LensModel::Pinhole,
        &[FOCAL_PX, FOCAL_PX, (WIDTH as f64 - 1.0) / 2.0, (HEIGHT as f64 - 1.0) / 2.0],
    );
    let view = |number: u32| {
        let angle = std::f64::consts::TAU * f64::from(number) / f64::from(count);
        let centre = [radius * angle.cos(), radius * angle.sin(), radius];
        ColmapView { id: number + 1, name: format!("view_{}.png", number + 1), lens: 0, pose: looking_at_zero(centre) }
    };
    let cameras = ColmapModel { lenses: vec![lens.expect("a lens")], views: (0..count).map(view).collect() };
    let folder = Path::new(out);
    std::fs::create_dir_all(folder).expect("a folder");
    colmap::write(folder, &cameras, &[], ColmapEncoding::Text, true).expect("cameras");
    println!("--offset {} {} {}", middle[0], middle[1], middle[2]);
}

/// Returns the pose of a camera at `centre` that looks at the origin with a level horizon. The
/// centre must not be above the origin.
fn looking_at_zero(centre: [f64; 3]) -> Pose {
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        v.map(|c| c / length)
    };
    let forward = unit(centre.map(|c| -c));
    let right = unit([forward[1], -forward[0], 0.0]);
    let down = [
        forward[1] * right[2] - forward[2] * right[1],
        forward[2] * right[0] - forward[0] * right[2],
        forward[0] * right[1] - forward[1] * right[0],
    ];
    Pose { rotation: [right, down, forward], centre }
}
