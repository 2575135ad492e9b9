//! Every RPC of the shared collection projects as rpcm does, is inverted over its whole validity cube, and can be
//! replaced by the checked interpolant on a tile.
//!
//! `reference/rpc_rpcm.txt` holds rpcm's projections, written by `reference/rpc_rpcm.py`. The collection is not part of
//! the repository: without it the tests print a line and end.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use camera::{DEFAULT_TOLERANCE_PX, ImagePoint, Rpc, RpcCamera, TileExtent, TileInterpolant};
use geodesy::LonLatHeight;

/// Agreement with rpcm, pixels.
const AGREEMENT_PX: f64 = 1e-9;
/// Agreement of an image position with itself after localisation and projection, pixels.
const ROUND_TRIP_PX: f64 = 1e-6;

#[allow(clippy::print_stderr, reason = "the line says why nothing was tested")]
fn shared() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    if !path.is_dir() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

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
    let Some(root) = shared() else { return };
    let reference = reference();
    assert!(reference.len() > 50);
    for (path, points) in reference {
        let rpc = io::rpc::read(&root.join(&path)).unwrap_or_else(|e| panic!("{path}: {e}")).rpc;
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
    let Some(root) = shared() else { return };
    let files = ["rpc", "stereo"].into_iter().flat_map(|folder| files_below(&root.join(folder)));
    let mut readable = 0;
    for (path, file) in files.filter_map(|path| io::rpc::read(&path).ok().map(|file| (path, file))) {
        readable += 1;
        let (rpc, path) = (file.rpc, path.display());
        let ground: Vec<_> = cube(&rpc).collect();
        let images: Vec<_> = ground.iter().map(|&g| rpc.project(g).unwrap_or_else(|e| panic!("{path}: {e}"))).collect();
        for (g, &image) in ground.iter().zip(&images) {
            let back = rpc.localize(image, g.height_m).unwrap_or_else(|e| panic!("{path} at {g:?}: {e}"));
            let off = distance(rpc.project(back).expect("a localised point projects"), image);
            assert!(off < ROUND_TRIP_PX, "{path} at {g:?}: {off:e} px");
        }
        let (s, l): (Vec<_>, Vec<_>) = images.iter().map(|p| (p.sample, p.line)).unzip();
        let heights: Vec<_> = ground.iter().map(|g| g.height_m).collect();
        let (mut lon, mut lat) = (vec![0.0; s.len()], vec![0.0; s.len()]);
        assert_eq!(rpc.localize_batch(&s, &l, &heights, &mut lon, &mut lat), Ok(0), "{path}");
        for (i, &image) in images.iter().enumerate() {
            let back = LonLatHeight::new(lon[i], lat[i], heights[i]);
            let off = distance(rpc.project(back).expect("a localised point projects"), image);
            assert!(off < ROUND_TRIP_PX, "{path} at {back:?}: {off:e} px in the batch");
        }
    }
    assert!(readable > 60, "{readable}");
}

/// Reference and source of each scene, with a range of heights that holds the scene.
const PAIRS: [(&str, &str, (f64, f64)); 5] = [
    ("s2p_pair/img_01.tif", "s2p_pair/img_02.tif", (2100.0, 2600.0)),
    ("s2p_triplet/img_01.tif", "s2p_triplet/img_03.tif", (50.0, 350.0)),
    ("phr_gizeh/img1_rpc.tif", "phr_gizeh/img2_rpc.tif", (0.0, 300.0)),
    ("jax_068/images/JAX_068_001_RGB.tif", "jax_068/images/JAX_068_002_RGB.tif", (-60.0, 120.0)),
    ("jax_068/images/JAX_068_004_RGB.tif", "jax_068/images/JAX_068_007_RGB.tif", (-60.0, 120.0)),
];

/// A cubic meets the chain of two real RPCs over a whole image far below the tolerance, also between the lattice on
/// which it was checked.
#[test]
fn the_interpolant_replaces_the_chain_of_real_cameras() {
    let Some(root) = shared() else { return };
    let camera = |path: &str| RpcCamera::new(io::rpc::read(&root.join("stereo").join(path)).expect(path).rpc);
    for (reference, source, height_m) in PAIRS {
        let extent = TileExtent { u: (0.0, 1023.0), v: (0.0, 1023.0), height_m };
        let (a, b) = (camera(reference), camera(source));
        let tile = TileInterpolant::source_from_reference(&a, &b, extent, DEFAULT_TOLERANCE_PX).expect(reference);
        // Measured at 4e-7 px and below: whole images need no division into tiles.
        assert!(tile.max_error() < 1e-5, "{reference}: {:e} px", tile.max_error());
        for m in 0..1000 {
            let at = |i: usize, (lo, hi): (f64, f64)| lo + (hi - lo) * (i as f64 + 0.3) / 10.0;
            let (u, v, h) = (at(m % 10, extent.u), at(m / 10 % 10, extent.v), at(m / 100, height_m));
            let ground = a.localize(ImagePoint::new(u, v), h).expect("a point of the scene");
            let exact = b.project(ground).expect("a point of the scene");
            let [x, y] = tile.eval(u, v, h);
            let off = distance(exact, ImagePoint::new(x, y));
            assert!(off < 1.1 * tile.max_error() + 1e-7, "{reference}: {off:e} px, {:e} at most", tile.max_error());
        }
    }
}
