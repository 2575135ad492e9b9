//! Every RPC of the shared collection projects as rpcm does, and is inverted over its whole
//! validity cube.
//!
//! `reference/rpc_rpcm.txt` holds the projections of rpcm, written by `reference/rpc_rpcm.py`. The
//! collection is part of the shared data.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use camera::{ImagePoint, Rpc};
use geodesy::LonLatHeight;

/// Agreement with rpcm, pixels.
const AGREEMENT_PX: f64 = 1e-9;
/// Agreement of an image position with itself after localisation and projection, pixels.
const ROUND_TRIP_PX: f64 = 1e-6;

fn distance(a: ImagePoint, b: ImagePoint) -> f64 {
    (a.sample - b.sample).hypot(a.line - b.line)
}

/// rpcm's projections by file.
fn reference() -> BTreeMap<String, Vec<(LonLatHeight, ImagePoint)>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/rpc_rpcm.txt");
    let text = fs::read_to_string(path).expect("the reference is in the repository");
    let mut by_file: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for line in text.lines().filter(|l| !l.starts_with('#')) {
        let fields: Vec<&str> = line.split(" | ").collect();
        let numbers = |i: usize| fields[i].split(' ').map(|v| v.parse().expect("a number")).collect::<Vec<f64>>();
        let (g, p) = (numbers(2), numbers(3));
        let point = (LonLatHeight::new(g[0], g[1], g[2]), ImagePoint::new(p[0], p[1]));
        by_file.entry(fields[0].to_owned()).or_default().push(point);
    }
    by_file
}

#[test]
fn projection_agrees_with_rpcm_on_every_file() {
    let Some(root) = testing::shared_data("") else { return };
    let reference = reference();
    assert!(reference.len() > 50);
    for (path, points) in reference {
        let rpc = formats::rpc::read(&root.join(&path)).unwrap_or_else(|e| panic!("{path}: {e}")).rpc;
        for (ground, expected) in points {
            let found = rpc.project(ground).unwrap_or_else(|e| panic!("{path}: {e}"));
            let off = distance(found, expected);
            assert!(off < AGREEMENT_PX, "{path} at {ground:?}: {found:?}, rpcm has {expected:?}, {off:e} px away");
        }
    }
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the collection");
    let paths = entries.map(|e| e.expect("an entry of the collection").path());
    paths.flat_map(|p| if p.is_dir() { files_below(&p) } else { vec![p] }).collect()
}

/// An even lattice over the validity cube, its faces and corners included.
fn cube(rpc: &Rpc) -> impl Iterator<Item = LonLatHeight> {
    let domain = rpc.domain();
    let at = |i: usize| i as f64 / 5.0 - 1.0;
    (0..11 * 11 * 11).map(move |m| domain.at([at(m % 11), at(m / 11 % 11), at(m / 121)]))
}

#[test]
fn localisation_inverts_projection_over_every_validity_cube() {
    let Some(root) = testing::shared_data("") else { return };
    let files = ["rpc", "stereo"].into_iter().flat_map(|folder| files_below(&root.join(folder)));
    let mut readable = 0;
    for (path, file) in files.filter_map(|path| formats::rpc::read(&path).ok().map(|file| (path, file))) {
        readable += 1;
        let (rpc, path) = (file.rpc, path.display());
        let ground: Vec<_> = cube(&rpc).collect();
        let images: Vec<_> = ground.iter().map(|&g| rpc.project(g).unwrap_or_else(|e| panic!("{path}: {e}"))).collect();
        for (g, &image) in ground.iter().zip(&images) {
            let back = rpc.localize(image, g.height_m).unwrap_or_else(|e| panic!("{path} at {g:?}: {e}"));
            let off = distance(rpc.project(back).expect("a localised point projects"), image);
            assert!(off < ROUND_TRIP_PX, "{path} at {g:?}: {off:e} px");
        }
    }
    assert!(readable > 60, "{readable}");
}
