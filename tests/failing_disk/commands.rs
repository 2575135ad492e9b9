//! Every command that writes, on inputs so small that it takes a fraction of a second.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::common::sample;
use crate::scene;

/// A command that writes. `$town` is a small simulated scene, `$made` a folder with a surface model
/// of it, splats and a dataset, `$samples` the sample town, `$tests` the folder of the tests.
pub(crate) struct Writing {
    pub(crate) name: &'static str,
    /// Commands whose results it works on, in its working folder.
    pub(crate) before: &'static [&'static str],
    pub(crate) command: &'static str,
    /// The option that allows to replace files; none where the command takes up its own results.
    pub(crate) overwrite: &'static str,
}

const fn writing(name: &'static str, command: &'static str) -> Writing {
    Writing { name, before: &[], command, overwrite: "--overwrite" }
}

const DSM: &str = "dsm $town/view_1.tif $town/view_3.tif -o out --preset fast --gsd 2";
const PLAN: &str = "plan $town/view_1.tif $town/view_3.tif -o out --preset fast --gsd 1 --chunk 128";

/// The commands.
pub(crate) const COMMANDS: &[Writing] = &[
    writing("dsm", DSM),
    writing("dsm by chunks", "dsm $town/view_1.tif $town/view_3.tif -o out --preset fast --gsd 1 --chunk 128"),
    writing("plan", PLAN),
    Writing { name: "run", before: &[PLAN], command: "run out", overwrite: "" },
    Writing { name: "merge", before: &[PLAN, "run out"], command: "merge out", overwrite: "--overwrite" },
    Writing { name: "batch", before: &["files batch"], command: "batch batch.toml", overwrite: "" },
    Writing { name: "products", before: &[DSM], command: "products out", overwrite: "--overwrite" },
    Writing {
        name: "eval of a run",
        before: &[DSM],
        command: "eval out/dsm/dsm.tif $town/truth/dsm.tif --align none",
        overwrite: "--overwrite",
    },
    writing(
        "eval",
        "eval $made/run/dsm/dsm.tif $town/truth/dsm.tif -o out --align none --error-map error.tif --html page.html",
    ),
    writing(
        "eval of surfaces",
        "eval $town/truth/buildings.city.json $town/truth/buildings.city.json --samples-per-m2 1 -o out",
    ),
    writing("simulate", "simulate $made/tiny.toml -o out --flight 2"),
    writing("ortho", "ortho $town/view_1.tif --dsm $town/truth/dsm.tif -o ortho.tif"),
    writing("dtm", "dtm $town/truth/dsm.tif -o out"),
    writing("classes", "classes $town/truth/dsm.tif -o out"),
    writing("diff", "diff $town/truth/dsm.tif $town/truth/dtm.tif -o out --align none --sigma-m 0.1"),
    writing("buildings", "buildings $town/view_1.tif -o buildings.tif"),
    writing("heightmap", "heightmap $samples/truth/dsm.tif --center 5.4 43.53 --size 60 -o map.tif"),
    writing("heightmaps", "heightmap $samples/truth/dsm.tif --positions $made/list.csv --size 60 -o out"),
    writing("unproject", "heightmap unproject $made/map.tif -o points.ply"),
    writing(
        "tiles",
        "tiles $samples/truth/dsm.tif --positions $made/list.csv --images $samples/view_1.tif --size 60 -o out",
    ),
    writing(
        "groundview",
        "groundview $samples/truth/dsm.tif --center 5.4 43.53 --width 64 --crops 2 --crop-size 32 -o out",
    ),
    writing(
        "priors",
        "priors $samples/truth/buildings.city.json --cameras $samples/cameras --points 500 --geotiff -o out",
    ),
    writing(
        "priors of images",
        "priors $town/truth/buildings.city.json --cameras $town/view_1.tif $town/view_3.tif -o out",
    ),
    writing("splats", "splats $town/truth/dsm.tif $town/view_1.tif -o splats.ply --render out"),
    writing("splats render", "splats render $made/splats.ply $town/view_1.tif -o out"),
    writing("train", "train $town/view_1.tif $town/view_3.tif --splats $made/splats.ply --iterations 4 -o out"),
    writing("mesh", "mesh $made/dataset --depths $made/dataset/raw_depth --voxel 4 -o mesh.ply"),
    writing("city convert", "city convert $town/truth/buildings.city.json -o town.obj"),
    writing("align", "align $tests/reference/align/model --gps $tests/reference/align/gps.csv -o out"),
    writing("split", "split $tests/reference/align/model -o split.json"),
    writing(
        "register",
        "register $town/view_3.tif --dsm $town/truth/dsm.tif --images $town/view_1.tif --reach 5 --order shift -o register.json",
    ),
    writing("rpc convert", "rpc convert $town/view_1.tif -o view.json"),
];

/// The end of a command.
pub(crate) struct Ended {
    pub(crate) code: i32,
    pub(crate) told: String,
}

/// Runs a command of the table in a folder.
pub(crate) fn run(folder: &Path, command: &str, overwrite: &str) -> Ended {
    let words = format!("{command} {overwrite} -q");
    let made = made();
    let full = |word: &str| {
        let places = [
            ("$town", made.town),
            ("$made", made.folder.as_path()),
            ("$samples", made.samples.as_path()),
            ("$tests", made.tests.as_path()),
        ];
        let place =
            places.into_iter().find_map(|(name, path)| Some(path.to_str()?.to_owned() + word.strip_prefix(name)?));
        place.unwrap_or_else(|| word.to_owned())
    };
    let mut process = Command::new(assert_cmd::cargo::cargo_bin("skysweep"));
    let output = process.args(words.split_whitespace().map(full)).current_dir(folder).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!told.contains("panicked"), "{command}: {told}");
    Ended { code: output.status.code().unwrap_or_else(|| panic!("{command} was killed: {told}")), told }
}

/// Makes what a command works on, in a folder.
pub(crate) fn prepare(folder: &Path, of: &Writing) {
    for before in of.before {
        match *before {
            "files batch" => {
                let town = made().town.display();
                let text = format!(
                    "output = 'out'\n[[scene]]\nname = 'a'\nimages = ['{town}/view_1.tif', '{town}/view_3.tif']\n\
                     tasks = ['dsm', 'ortho', 'eval']\ndsm.preset = 'fast'\ndsm.gsd_m = 1.0\ndsm.chunk = 128\n\
                     eval.reference = '{town}/truth/dsm.tif'\n"
                );
                std::fs::write(folder.join("batch.toml"), text).unwrap();
            }
            command => {
                let ended = run(folder, command, "");
                assert_eq!(ended.code, 0, "{command}: {}", ended.told);
            }
        }
    }
}

/// Copies a folder; a link is copied as a link.
pub(crate) fn copy(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("-a").arg(from).arg(to).status().unwrap();
    assert!(copied.success(), "{} to {}", from.display(), to.display());
}

/// What the commands work on, made once.
struct Made {
    town: &'static Path,
    folder: PathBuf,
    samples: PathBuf,
    tests: PathBuf,
}

fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let town = scene();
        let folder = town.parent().unwrap().join("made");
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let samples = sample("");
        let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("list.csv", "id,lon,lat,heading,height_m\na,5.4000,43.5300,37,\nb,5.4003,43.5301,100,195\n");
        let scene = std::fs::read_to_string(sample("scene.toml")).unwrap();
        write("tiny.toml", &scene.replace("size_m = 320.0", "size_m = 60.0").replace("subpixels = 3", "subpixels = 1"));
        let skysweep = |words: &[&str]| {
            let mut command = crate::common::skysweep();
            command.current_dir(&folder).args(words).args(["-q", "--progress", "none"]).assert().code(0);
        };
        let of_town = |name: &str| town.join(name).to_str().unwrap().to_owned();
        let of_samples = |name: &str| samples.join(name).to_str().unwrap().to_owned();
        let images = [of_town("view_1.tif"), of_town("view_3.tif")];
        let fast = ["--preset", "fast", "--gsd", "2", "-o", "run"];
        skysweep(&[&["dsm", images[0].as_str(), images[1].as_str()][..], &fast].concat());
        skysweep(&["splats", &of_town("truth/dsm.tif"), &images[0], "-o", "splats.ply"]);
        let place = ["--center", "5.4", "43.53", "--size", "60", "-o", "map.tif"];
        skysweep(&[&["heightmap", of_samples("truth/dsm.tif").as_str()][..], &place].concat());
        let (model, cameras) = (of_samples("truth/buildings.city.json"), of_samples("cameras"));
        skysweep(&["priors", &model, "--cameras", &cameras, "--points", "500", "-o", "dataset"]);
        Made { town, folder, samples, tests }
    })
}

/// Returns every file and link below a folder with its content, by its name; links are not
/// followed.
pub(crate) fn snapshot(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).unwrap().map(Result::unwrap) {
            let path = entry.path();
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            let kind = entry.file_type().unwrap();
            if kind.is_dir() {
                found.insert(format!("{name}/"), Vec::new());
                open.push(path);
            } else if kind.is_symlink() {
                found.insert(name, std::fs::read_link(&path).unwrap().to_str().unwrap().as_bytes().to_vec());
            } else {
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}
