//! Whole runs of the command with mutated files and hostile settings.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::corpus::Seed;
use crate::mutate::{Dice, mutated};
use crate::{Campaign, MEMORY_KB, folder};

/// A run that takes longer is ended and counts as a failure, seconds. The good ones take a second.
const SECONDS: u32 = 120;

/// Good runs. A word with a dot or slash that names a file of the corpus is an input.
const RUNS: [&str; 27] = [
    "dsm view_1.tif view_3.tif -o out --gsd 1 --preset fast",
    "dsm view_1.tif view_2.tif view_3.tif -o out --gsd 2 --preset fast --dem dtm.tif --prior buildings.city.json",
    "dsm view_1.tif view_3.tif -o out --gsd 1 --preset fast --chunk 64 --height-range 150 260 --fill all",
    "dsm view_1.tif v.vrt -o out --gsd 1 --preset fast --pairs 1-2 --reference 1 --vertical egm96",
    "dsm view_1.tif view_3.tif -o out --gsd 1 --preset fast --crs EPSG:32631 --tile 64 --threads 2 --memory 500",
    "eval dsm.tif dtm.tif --align xyz --html e.html --error-map e.tif",
    "eval dsm.tif s.laz --ref-cell 1 --test-vertical ellipsoid --thresholds 1,2 --skip 3",
    "eval dsm.tif dtm.tif --classes classes.tif --mask classes.tif --buildings buildings.tif --dtm dtm.tif",
    "eval m.obj m.ply --samples-per-m2 1 --voxel 2",
    "eval panorama.npy panorama.npy --maps depth",
    "ortho view_1.tif view_2.tif --dsm dsm.tif -o o.tif --gsd 1 --tolerance 0.1",
    "ortho view_1.tif --dsm dsm.tif -o o.tif --corrections report.json",
    "heightmap dsm.tif --positions list.csv -o maps --size 64 --resolution 2",
    "heightmap buildings.city.json --center 5.4 43.53 -o h.tif --size 64 --heading 30 --dtm dtm.tif",
    "heightmap unproject map.tif -o h.las --merge 1",
    "groundview dsm.tif --center 5.4 43.53 --width 64 --crops 1 --crop-size 32 --fov 80 -o gv --points 20",
    "groundview compose relief.png panorama.png relief.png -o c.png",
    "priors buildings.city.json --cameras sparse -o pri --points 200 --epsilon 0.1 --previews 1",
    "priors buildings.city.json --cameras view_1.tif -o pri --maps-only",
    "splats dsm.tif view_1.tif view_2.tif -o s.ply --error 0.5 --sh-degree 1",
    "splats render s.ply view_1.tif -o r",
    "splats convert s.ply s.sog --sh-degree 1",
    "align sparse --positions control.csv -o a --threshold 5",
    "split sparse --contexts 2 --context-iou 0.2 --target-ious 0.1",
    "city convert m.gml -o m2.city.json --report r.json --all-objects",
    "rpc project a_RPC.TXT --lon 5.4 --lat 43.53 --height 100",
    "simulate town.toml -o scene --size 60 --gsd 1 --views 2 --seed 3",
];
/// Values that options are not made for.
const VALUES: [&str; 30] = [
    "0",
    "-1",
    "-0",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "-inf",
    "99999999999",
    "18446744073709551616",
    "1e9",
    "0.0001",
    "",
    " ",
    "1,2",
    "1-1",
    "9-9",
    "é",
    "/dev/zero",
    "/dev/null",
    "/",
    ".",
    "../..",
    "EPSG:4978",
    "EPSG:4326",
    "EPSG:999999",
    "egm2008",
    "5783",
    "/vsimem/x",
];
/// Options that are put into a run that may not have them, with a value or without.
const OPTIONS: [&str; 16] = [
    "--gsd=@",
    "--bounds @ @ @ @",
    "--threads=@",
    "--tile=@",
    "--chunk=@",
    "--memory=@",
    "--vertical=@",
    "--crs=@",
    "--overwrite",
    "--json",
    "--progress=json",
    "-v",
    "--height-range @ @",
    "--size=@",
    "--seed=@",
    "--force",
];

/// Tries the runs of a campaign. Returns how many were tried, and the failures.
pub(crate) fn try_all(corpus: &[Seed], campaign: Campaign) -> (u64, Vec<String>) {
    let begun = Instant::now();
    let inputs = inputs(corpus);
    let (mut tried, mut failures) = (0, Vec::new());
    for number in 0..campaign.count {
        if begun.elapsed() > campaign.time {
            break;
        }
        let mut dice = Dice::new(campaign.seed ^ 0x5275_6e73, number);
        let folder = tempfile::tempdir().unwrap();
        let arguments = prepare(number, &inputs, folder.path(), &mut dice);
        tried += 1;
        if let Some(how) = failure(folder.path(), &arguments) {
            let kept = keep(folder.path(), number);
            failures.push(format!("run {number}, seed {}: {arguments:?}: {how}; {kept}", campaign.seed));
        }
    }
    (tried, failures)
}

/// The files of the corpus and the sample town by name, in one folder.
fn inputs(corpus: &[Seed]) -> PathBuf {
    let all = folder("inputs_of_runs");
    fs::remove_dir_all(&all).unwrap();
    fs::create_dir_all(all.join("sparse")).unwrap();
    for seed in corpus {
        let is_model = seed.reader == crate::readers::Reader::Colmap;
        for file in fs::read_dir(seed.path.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path()) {
            let place = if is_model { all.join("sparse") } else { all.clone() };
            fs::copy(&file, place.join(file.file_name().unwrap())).unwrap();
        }
    }
    fs::copy(all.join("scene.toml"), all.join("town.toml")).unwrap();
    let town = crate::folder("town_of_runs");
    let scene = town.join("town");
    let made = crate::common::skysweep()
        .args(["simulate", "-q", "--overwrite", "-o"])
        .arg(&scene)
        .arg(all.join("town.toml"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
    for name in [
        "view_1.tif",
        "view_2.tif",
        "view_3.tif",
        "truth/dsm.tif",
        "truth/dtm.tif",
        "truth/classes.tif",
        "truth/buildings.tif",
    ] {
        let file = scene.join(name);
        fs::copy(&file, all.join(file.file_name().unwrap())).unwrap();
    }
    let relief = crate::common::sample("relief.png");
    fs::copy(relief, all.join("relief.png")).unwrap();
    all
}

/// Copies the inputs of a run into its folder, with mutations, and returns its arguments.
fn prepare(number: u64, inputs: &Path, folder: &Path, dice: &mut Dice) -> Vec<String> {
    let line = RUNS[number as usize % RUNS.len()];
    let mut arguments: Vec<String> = line.split(' ').map(str::to_owned).collect();
    let used: Vec<String> = arguments.iter().filter(|word| inputs.join(word).exists()).cloned().collect();
    for name in &used {
        let copied = Command::new("cp").arg("-r").arg(inputs.join(name)).arg(folder).status();
        assert!(copied.is_ok_and(|status| status.success()));
    }
    if dice.below(2) == 0 && !used.is_empty() {
        let mut victim = folder.join(dice.one_of(&used));
        while victim.is_dir() {
            let mut files: Vec<_> = fs::read_dir(&victim).unwrap().map(|entry| entry.unwrap().path()).collect();
            files.sort();
            victim = dice.one_of(&files).clone();
        }
        let bytes = fs::read(&victim).unwrap();
        let other = fs::read(inputs.join("m.gml")).unwrap();
        fs::write(&victim, mutated(&bytes, &other, dice)).unwrap();
    }
    for _ in 0..dice.below(3) {
        spoil(&mut arguments, dice);
    }
    arguments
}

/// Changes the arguments of a run.
fn spoil(arguments: &mut Vec<String>, dice: &mut Dice) {
    let at = 1 + dice.below(arguments.len() - 1);
    match dice.below(6) {
        0 => drop(arguments.remove(at)),
        1 => {
            let copied = arguments[at].clone();
            arguments.insert(at, copied);
        }
        2 => arguments[at] = (*dice.one_of(&VALUES)).to_owned(),
        3 => {
            let numbers: Vec<usize> = (1..arguments.len()).filter(|i| arguments[*i].parse::<f64>().is_ok()).collect();
            let Some(at) = numbers.get(dice.below(numbers.len())) else { return };
            arguments[*at] = (*dice.one_of(&VALUES)).to_owned();
        }
        _ => {
            let option = *dice.one_of(&OPTIONS);
            for word in option.split(' ') {
                let value = VALUES[dice.below(VALUES.len())];
                arguments.push(word.replace('@', value));
            }
        }
    }
    // An output outside the folder of the run would be written.
    for i in 1..arguments.len() {
        let is_outside = |word: &str| matches!(word, "/" | "." | "../..");
        if arguments[i - 1] == "-o" && is_outside(&arguments[i]) {
            arguments[i] = "elsewhere".to_owned();
        }
    }
}

/// Runs the command and returns how it failed to keep its promises, if it did.
fn failure(folder: &Path, arguments: &[String]) -> Option<String> {
    let script = format!("ulimit -v {MEMORY_KB}; exec timeout -s KILL {SECONDS} \"$0\" \"$@\"");
    let run = Command::new("bash")
        .args(["-c", &script])
        .arg(assert_cmd::cargo::cargo_bin("skysweep"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&run.stderr);
    let last = text.lines().last().unwrap_or_default();
    match run.status.code() {
        Some(0) => None,
        Some(1 | 2) if text.contains("panicked at") => Some(format!("it panics: {text}")),
        Some(1 | 2) if text.trim().is_empty() => Some("it fails without a word".to_owned()),
        Some(1 | 2) => None,
        Some(137) => Some(format!("it takes more than {SECONDS} seconds or is killed: {last}")),
        code => Some(format!("it ends with {code:?}: {last}")),
    }
}

fn keep(folder: &Path, number: u64) -> String {
    let kept = crate::folder("failures").join(format!("run_{number}"));
    let _ = fs::remove_dir_all(&kept);
    let copied = Command::new("cp").arg("-r").arg(folder).arg(&kept).status();
    format!("kept ({}) in {}", copied.is_ok_and(|s| s.success()), kept.display())
}
