//! The scenes, their references, and what issue 2 asks of each.

use std::path::{Path, PathBuf};

/// What a scene's DSM is compared with.
pub(crate) enum Truth {
    /// A surface model; `test_vertical` names the datum of a reference that does not say its own.
    Raster { path: PathBuf, test_vertical: Option<&'static str> },
    /// The pyramid of Khufu; `peer` is S2P's surface model of it, measured in the same way.
    Pyramid { peer: PathBuf },
}

/// One run of the bench.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) images: Vec<PathBuf>,
    pub(crate) truth: Truth,
    /// The result, with its bounds: name, least, greatest.
    pub(crate) goals: &'static [(&'static str, f64, f64)],
    /// Processor seconds of S2P on the same scene (`../shared/data/README.md`), where it was run on it.
    pub(crate) s2p_cpu_s: Option<f64>,
}

const INF: f64 = f64::INFINITY;
/// `jax_068`, all seven views.
const SEVEN: [(&str, f64, f64); 3] = [("mae", 0.0, 1.5), ("completeness_1", 0.62, 1.0), ("valid_ratio", 0.90, 1.0)];
/// `jax_068`, two views.
const PAIR: [(&str, f64, f64); 2] = [("mae", 0.0, 1.2), ("completeness_1", 0.58, 1.0)];
/// Against S2P's own DSM.
const S2P: [(&str, f64, f64); 2] = [("median_abs", 0.0, 0.35), ("valid_ratio", 0.90, 1.0)];
/// Khufu: the faces' slope and the height of the apex over the base.
const KHUFU: [(&str, f64, f64); 4] =
    [("east_deg", 50.84, 52.84), ("south_deg", 50.84, 52.84), ("west_deg", 50.84, 52.84), ("height_m", 144.0, 148.0)];
/// Measured only.
const NONE: [(&str, f64, f64); 1] = [("mae", 0.0, INF)];

/// All scenes under `data` (`../shared/data/stereo`).
pub(crate) fn all(data: &Path) -> Vec<Scene> {
    let jax = |views: &[usize]| -> Vec<PathBuf> {
        views.iter().map(|v| data.join(format!("jax_068/images/JAX_068_{v:03}_RGB.tif"))).collect()
    };
    let lidar =
        || Truth::Raster { path: data.join("jax_068/truth/JAX_068_DSM_georef.tif"), test_vertical: Some("ellipsoid") };
    let s2p = |name: &str| Truth::Raster { path: data.join("peers").join(name), test_vertical: Some("ellipsoid") };
    let numbered = |folder: &str, n: usize| -> Vec<PathBuf> {
        (1..=n).map(|i| data.join(format!("{folder}/img_0{i}.tif"))).collect()
    };
    let scene = |name, images, truth, goals, s2p_cpu_s| Scene { name, images, truth, goals, s2p_cpu_s };
    vec![
        scene("jax_068 7 views", jax(&[1, 2, 3, 4, 5, 6, 7]), lidar(), &SEVEN, None),
        scene("jax_068 001-003", jax(&[1, 3]), lidar(), &PAIR, None),
        scene("jax_068 002-003", jax(&[2, 3]), lidar(), &PAIR, None),
        scene("jax_068 002-004", jax(&[2, 4]), lidar(), &NONE, None),
        scene("s2p_pair", numbered("s2p_pair", 2), s2p("s2p_pair_default_0.5m.tif"), &S2P, Some(30.0)),
        scene("s2p_triplet", numbered("s2p_triplet", 3), s2p("s2p_triplet_default_0.5m.tif"), &S2P, Some(48.0)),
        scene(
            "phr_gizeh",
            vec![data.join("phr_gizeh/img1_rpc.tif"), data.join("phr_gizeh/img2_rpc.tif")],
            Truth::Pyramid { peer: data.join("peers/s2p_gizeh_0.5m.tif") },
            &KHUFU,
            Some(19.0),
        ),
    ]
}
