//! The scenes, their references and the goals.

use std::path::{Path, PathBuf};

use crate::run;

/// The surface that a scene's DSM is compared with.
#[derive(Clone)]
pub(crate) enum Truth {
    /// The exact surface of a simulated scene, with its terrain and classes.
    Simulated,
    /// The exact surface of a scene of another simulator, with a number for each building.
    Independent,
    /// A measured surface; `vertical` names the datum of a reference that does not say its own.
    Measured { path: PathBuf, vertical: &'static str },
    /// Another program's surface. It is no truth; differences show only how far two programs agree.
    Peer { path: PathBuf, vertical: &'static str },
    /// The pyramid of Khufu. `peers` are other programs' surface models of it (prefix of the
    /// metric, file), measured in the same way.
    Pyramid { peers: [(&'static str, PathBuf); 2] },
}

/// A goal for the default preset: name of the metric, least and greatest value.
pub(crate) type Goal = (&'static str, f64, f64);

/// One scene of the bench.
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) images: Vec<PathBuf>,
    pub(crate) truth: Truth,
    pub(crate) goals: &'static [Goal],
    /// Arguments of `skysweep simulate` for a simulated scene.
    simulation: &'static [&'static str],
    /// Folder of a simulated scene, or of a scene of another simulator.
    pub(crate) folder: PathBuf,
}

/// Simulated scenes: name and arguments.
const SIMULATED: [(&str, &[&str]); 13] = [
    ("town", &["town"]),
    ("dense-city", &["dense-city"]),
    ("high-rise", &["high-rise"]),
    ("hills", &["hills"]),
    ("quarry", &["quarry"]),
    ("harbour", &["harbour"]),
    ("repetitive-roofs", &["repetitive-roofs"]),
    ("low-texture", &["low-texture"]),
    ("five-dates", &["town", "--views", "5", "--dates", "5"]),
    ("five-seasons", &["town", "--views", "5", "--dates", "5", "--seasons"]),
    ("suburb", &["suburb"]),
    ("dense-towers", &["dense-towers"]),
    ("industrial", &["industrial"]),
];

/// `jax_068`, all seven views.
const SEVEN: [Goal; 3] = [("mae", 0.0, 1.5), ("completeness_1", 0.62, 1.0), ("valid_ratio", 0.90, 1.0)];
/// `jax_068`, two views.
const PAIR: [Goal; 2] = [("mae", 0.0, 1.2), ("completeness_1", 0.58, 1.0)];
/// Against S2P's own DSM.
const S2P: [Goal; 2] = [("median_abs", 0.0, 0.35), ("valid_ratio", 0.90, 1.0)];
/// Khufu: the faces' slope and the height of the apex over the base.
const KHUFU: [Goal; 4] =
    [("east_deg", 50.84, 52.84), ("south_deg", 50.84, 52.84), ("west_deg", 50.84, 52.84), ("height_m", 144.0, 148.0)];

/// Returns the simulated scenes. Their images do not exist before [`Scene::make`].
pub(crate) fn simulated() -> Vec<Scene> {
    let scene = |(name, simulation)| Scene {
        name,
        images: Vec::new(),
        truth: Truth::Simulated,
        goals: &[],
        simulation,
        folder: PathBuf::new(),
    };
    SIMULATED.into_iter().map(scene).collect()
}

/// Returns the scenes of another simulator under `sim` (`../shared/data/sim`), present or not.
pub(crate) fn independent(sim: &Path) -> Vec<Scene> {
    let scene = |(name, folder): (&'static str, &str)| {
        let folder = sim.join(folder);
        let images = (1..=3).map(|view| folder.join(format!("view_{view}.tif"))).collect();
        Scene { name, images, truth: Truth::Independent, goals: &[], simulation: &[], folder }
    };
    [("sim/town", "town"), ("sim/suburb", "suburb"), ("sim/highrise", "highrise")].map(scene).to_vec()
}

/// Returns the paths of the images of Jacksonville with these numbers.
pub(crate) fn jax_images(data: &Path, views: &[usize]) -> Vec<PathBuf> {
    views.iter().map(|v| data.join(format!("jax_068/images/JAX_068_{v:03}_RGB.tif"))).collect()
}

/// The real scenes under `data` (`../shared/data/stereo`).
pub(crate) fn real(data: &Path) -> Vec<Scene> {
    let jax = |views: &[usize]| jax_images(data, views);
    let lidar = || Truth::Measured { path: data.join("jax_068/truth/JAX_068_DSM_georef.tif"), vertical: "ellipsoid" };
    let s2p = |name: &str| Truth::Peer { path: data.join("peers").join(name), vertical: "ellipsoid" };
    let numbered = |folder: &str, n: usize| -> Vec<PathBuf> {
        (1..=n).map(|i| data.join(format!("{folder}/img_0{i}.tif"))).collect()
    };
    let scene =
        |name, images, truth, goals| Scene { name, images, truth, goals, simulation: &[], folder: PathBuf::new() };
    vec![
        scene("jax_068 7 views", jax(&[1, 2, 3, 4, 5, 6, 7]), lidar(), &SEVEN),
        scene("jax_068 001-003-004", jax(&[1, 3, 4]), lidar(), &[]),
        scene("jax_068 002-005-006", jax(&[2, 5, 6]), lidar(), &[]),
        scene("jax_068 001-003", jax(&[1, 3]), lidar(), &PAIR),
        scene("jax_068 002-003", jax(&[2, 3]), lidar(), &PAIR),
        scene("jax_068 002-004", jax(&[2, 4]), lidar(), &[]),
        scene("s2p_pair", numbered("s2p_pair", 2), s2p("s2p_pair_default_0.5m.tif"), &S2P),
        scene("s2p_triplet", numbered("s2p_triplet", 3), s2p("s2p_triplet_default_0.5m.tif"), &S2P),
        scene(
            "phr_gizeh",
            vec![data.join("phr_gizeh/img1_rpc.tif"), data.join("phr_gizeh/img2_rpc.tif")],
            Truth::Pyramid {
                peers: [("s2p", "s2p_gizeh_0.5m.tif"), ("cars", "cars_gizeh_0.5m.tif")]
                    .map(|(prefix, file)| (prefix, data.join("peers").join(file))),
            },
            &KHUFU,
        ),
    ]
}

impl Scene {
    /// Makes the images of a simulated scene below `folder`; does nothing for a real one.
    pub(crate) fn make(&mut self, folder: &Path) -> anyhow::Result<()> {
        if self.simulation.is_empty() {
            return Ok(());
        }
        self.folder = folder.join("scenes").join(self.name);
        run::simulate(self.simulation, &self.folder)?;
        let mut images: Vec<PathBuf> = std::fs::read_dir(&self.folder)?.flatten().map(|entry| entry.path()).collect();
        images.retain(|path| path.extension().is_some_and(|extension| extension == "tif"));
        images.sort();
        self.images = images;
        Ok(())
    }

    /// Megapixels of all images together.
    pub(crate) fn megapixels(&self) -> anyhow::Result<f64> {
        megapixels(&self.images)
    }
}

/// Megapixels of images together.
pub(crate) fn megapixels(images: &[PathBuf]) -> anyhow::Result<f64> {
    let mut pixels = 0;
    for image in images {
        let source = formats::raster::ImageSource::open(image)?;
        pixels += source.info().width * source.info().height;
    }
    Ok(pixels as f64 / 1e6)
}
