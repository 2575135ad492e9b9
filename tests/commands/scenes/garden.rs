//! A real scene as flat splats with harmonics of all degrees, drawn through the renderer of
//! trainings, `splats render` and `mesh`, against a slow computation from the papers' formulas.

use std::path::Path;

use crate::common::skysweep;
use formats::npy::{self, NpyArray, NpyData};
use formats::raster::ImageSource;
use formats::splat_ply::{SplatFile, SplatForm, SplatLayout};
use gaussian::{Splat, SplatHarmonics};
use train::{Drawing, LearnedHarmonics, PinholeView, Registers, Surfel};

/// Written by `generate.py` beside it, which has the shape of the splats, too.
const REFERENCE: &str = include_str!("../../reference/garden/reference.txt");
/// Columns and rows of a block of the reference.
const BLOCK: [usize; 2] = [54, 42];
const SIZE: [usize; 2] = [648, 420];

/// A block of a view.
struct Block {
    view: usize,
    first: [usize; 2],
    /// Means of red, green, blue, coverage and weighted depth.
    means: [f64; 5],
    /// A pixel in it, and its colour.
    pixel: [usize; 2],
    colour: [f64; 3],
}

fn reference() -> Vec<Block> {
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let whole = |i: usize| numbers[i] as usize;
        Block {
            view: whole(0),
            first: [whole(1), whole(2)],
            means: numbers[3..8].try_into().unwrap(),
            pixel: [whole(8), whole(9)],
            colour: numbers[10..13].try_into().unwrap(),
        }
    };
    REFERENCE.lines().map(line).collect()
}

/// Reads an array of the archive, whose entries are stored without compression.
fn array(archive: &[u8], name: &str, folder: &Path) -> NpyArray {
    let name = format!("{name}.npy");
    let short = |at: usize| usize::from(u16::from_le_bytes(archive[at..at + 2].try_into().unwrap()));
    let long = |at: usize| u32::from_le_bytes(archive[at..at + 4].try_into().unwrap()) as usize;
    // The directory at the end knows the sizes.
    let entries = (0..archive.len() - 46).filter(|&at| archive[at..].starts_with(b"PK\x01\x02"));
    let mut entries = entries.filter(|&at| &archive[at + 46..at + 46 + short(at + 28)] == name.as_bytes());
    let entry = entries.next().unwrap_or_else(|| panic!("the archive has no {name}"));
    assert_eq!(short(entry + 10), 0, "{name} is compressed");
    let (size, local) = (long(entry + 20), long(entry + 42));
    let begin = local + 30 + short(local + 26) + short(local + 28);
    let path = folder.join(name);
    std::fs::write(&path, &archive[begin..begin + size]).unwrap();
    npy::read(&path).unwrap()
}

fn cameras(views: &[f64], intrinsics: &[f64]) -> Vec<PinholeView> {
    let one = |(m, k): (&[f64], &[f64])| {
        let rotation = [0, 1, 2].map(|i| [m[4 * i], m[4 * i + 1], m[4 * i + 2]]);
        let moved = [m[3], m[7], m[11]];
        PinholeView {
            rotation,
            centre: [0, 1, 2].map(|i| -(0..3).map(|row| rotation[row][i] * moved[row]).sum::<f64>()),
            focal_px: [k[0], k[4]],
            // The centre of the upper left pixel is (0, 0) here.
            principal_px: [k[2] - 0.5, k[5] - 0.5],
            size: SIZE,
        }
    };
    views.chunks_exact(16).zip(intrinsics.chunks_exact(9)).map(one).collect()
}

fn surfels(points: &[f64], colours: &[u8]) -> Vec<Surfel> {
    let one = |(number, (point, colour)): (usize, (&[f64], &[u8]))| {
        let i = number as f64;
        let side = |by: usize| ((0.008 * (1 + number % by) as f64).ln()) as f32;
        Surfel {
            position: [0, 1, 2].map(|axis| point[axis] as f32),
            rotation: [1.0, (0.7 * i).sin() as f32, (1.1 * i).sin() as f32, (1.7 * i).sin() as f32],
            log_scale: [side(3), side(2)],
            opacity_logit: (number % 5) as f32 - 2.0,
            colour: [0, 1, 2].map(|c| f32::from(colour[c]) / 255.0),
        }
    };
    points.chunks_exact(3).zip(colours.chunks_exact(3)).enumerate().map(one).collect()
}

#[test]
fn a_garden_with_unit_harmonics_is_drawn_as_the_formulas_say() {
    let Some(path) = testing::shared_data("photos/garden3/test_garden.npz") else { return };
    let folder = tempfile::tempdir().unwrap();
    let archive = std::fs::read(path).unwrap();
    let read = |name: &str| array(&archive, name, folder.path());
    let colours = match read("colors").data {
        NpyData::U8(values) => values,
        other => panic!("the colours are no bytes: {other:?}"),
    };
    let cameras = cameras(&read("viewmats").data.to_f64(), &read("Ks").data.to_f64());
    let surfels = surfels(&read("means3d").data.to_f64(), &colours);
    assert_eq!((surfels.len(), cameras.len()), (138_766, 3));
    let unit = SplatHarmonics::new(3, vec![1.0; surfels.len() * 45]).unwrap();
    let harmonics = LearnedHarmonics::of(&unit, surfels.len());

    let mut seen = Vec::new();
    let mut drawing = Drawing::new(&[], &cameras[0], Registers::Longest);
    let (mut far, mut pixels) = (0.0f64, 0.0f64);
    let blocks = reference();
    for (number, camera) in cameras.iter().enumerate() {
        drawing.redraw(harmonics.seen(&surfels, camera, 3, &mut seen), camera);
        let images = drawing.images();
        let planes = [&images.colour[0], &images.colour[1], &images.colour[2], &images.coverage, &images.depth_m];
        for block in blocks.iter().filter(|block| block.view == number) {
            for (plane, expected) in planes.iter().zip(block.means) {
                let row = |y: usize| &plane[(block.first[1] + y) * SIZE[0] + block.first[0]..][..BLOCK[0]];
                let sum: f64 = (0..BLOCK[1]).flat_map(row).map(|v| f64::from(*v)).sum();
                far = far.max((sum / (BLOCK[0] * BLOCK[1]) as f64 - expected).abs());
            }
            let at = block.pixel[1] * SIZE[0] + block.pixel[0];
            (0..3).for_each(|c| pixels = pixels.max((f64::from(planes[c][at]) - block.colour[c]).abs()));
        }
    }
    assert!(far < 2e-5, "the mean of a block is off by {far}");
    assert!(pixels < 1e-4, "a pixel is off by {pixels}");

    // The command draws the same from a file.
    let splats: Vec<Splat> = surfels.iter().map(|surfel| surfel.to_splat(1e-3)).collect();
    let layout = SplatLayout { form: SplatForm::Discs, sh_degree: 3 };
    let ply = folder.path().join("garden.ply");
    let file = SplatFile { splats, harmonics: Some(unit), labels: None, layout, origin: None };
    formats::splat_ply::write_file(&ply, &file, false).unwrap();
    write_model(&folder.path().join("model"), &cameras);
    let mut command = skysweep();
    command.args(["splats", "render", "--progress", "none"]).arg(&ply).arg("--cameras");
    command.arg(folder.path().join("model")).arg("-o").arg(folder.path().join("seen")).assert().code(0);
    let mut bytes = 0.0f64;
    for number in 0..cameras.len() {
        let source = ImageSource::open(folder.path().join(format!("seen/colour/{number}.png"))).unwrap();
        let picture = source.read_colour(source.window()).unwrap();
        for block in blocks.iter().filter(|block| block.view == number) {
            let found = picture[(block.pixel[0], block.pixel[1])];
            (0..3).for_each(|c| bytes = bytes.max((f64::from(found[c]) - 255.0 * block.colour[c].min(1.0)).abs()));
        }
    }
    assert!(bytes < 0.6, "a pixel of the command is off by {bytes} of 255");
}

/// Writes the cameras as a COLMAP model in text.
fn write_model(folder: &Path, cameras: &[PinholeView]) {
    std::fs::create_dir_all(folder).unwrap();
    let (mut lenses, mut images) = (String::new(), String::new());
    for (number, camera) in cameras.iter().enumerate() {
        let [fx, fy] = camera.focal_px;
        let [cx, cy] = camera.principal_px.map(|c| c + 0.5);
        lenses += &format!("{} PINHOLE {} {} {fx} {fy} {cx} {cy}\n", number + 1, SIZE[0], SIZE[1]);
        let r = camera.rotation;
        let [qw, qx, qy, qz] = gaussian::quaternion_of_axes([0, 1, 2].map(|i| [r[0][i], r[1][i], r[2][i]]));
        let moved = r.map(|row| -(0..3).map(|i| row[i] * camera.centre[i]).sum::<f64>());
        let [x, y, z] = moved;
        images += &format!("{} {qw} {qx} {qy} {qz} {x} {y} {z} {} {number}.png\n\n", number + 1, number + 1);
    }
    std::fs::write(folder.join("cameras.txt"), lenses).unwrap();
    std::fs::write(folder.join("images.txt"), images).unwrap();
    std::fs::write(folder.join("points3D.txt"), "").unwrap();
}
