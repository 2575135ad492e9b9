//! `skysweep plan`, `run` and `merge`: the bytes of `skysweep dsm` whatever happens on the way, and
//! job files.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use crate::common::{sample, skysweep};
use jobs::dsm::{ChunkContent, ChunkResult, ChunkSurface, merge};
use jobs::production::PlanFile;
use numeric::{RandomByIndex, Silent};
use predicates::prelude::*;
use serde_json::Value;

/// Settings of a scene of four chunks that takes a second.
const SMALL: [&str; 7] = ["--gsd", "2", "--preset", "fast", "--chunk", "128", "-q"];
/// Files of a run that have the same bytes however it is computed.
const PRODUCTS: [&str; 13] = [
    "dsm/dsm.tif",
    "dsm/sigma.tif",
    "dsm/views.tif",
    "dsm/filled.tif",
    "dsm/source.tif",
    "dsm/confidence.tif",
    "dsm/hillshade.png",
    "dsm/relief.png",
    "dsm/relief.pgw",
    "dsm/thumbnail.png",
    "dsm/dsm.qml",
    "dsm/source.qml",
    "used_config.toml",
];

fn views() -> [PathBuf; 2] {
    ["view_1.tif", "view_3.tif"].map(sample)
}

/// Runs a command of skysweep; returns what it wrote to standard output and error.
#[track_caller]
fn run(command: &str, arguments: &[&str], folder: &Path, code: i32) -> (String, String) {
    let assert = skysweep().arg(command).args(arguments).current_dir(folder).assert().code(code);
    let output = assert.get_output();
    (String::from_utf8_lossy(&output.stdout).into_owned(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Plans the small scene into `name`.
fn plan(folder: &Path, name: &str, options: &[&str]) {
    let mut command = skysweep();
    command.current_dir(folder).arg("plan").args(views()).args(["-o", name]).args(SMALL).args(options);
    command.assert().code(0);
}

/// The bytes of the products of a run.
fn products(run: &Path) -> Vec<Vec<u8>> {
    PRODUCTS.map(|name| std::fs::read(run.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))).into()
}

/// The small scene by `skysweep dsm`.
static EXPECTED: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    skysweep().arg("dsm").args(views()).arg("-o").arg(folder.path().join("out")).args(SMALL).assert().code(0);
    products(&folder.path().join("out"))
});

/// Names of files and folders below a folder that are neither products nor results of chunks.
fn temporary(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || name.ends_with(".partial") {
            found.push(name);
        }
        if entry.path().is_dir() {
            found.extend(temporary(&entry.path()));
        }
    }
    found
}

#[test]
fn plan_run_and_merge_give_the_bytes_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "run", &[]);
    let missing = run("merge", &["run"], folder.path(), 2).1;
    assert!(
        missing.contains("4 of 4 chunks have no result (0, 1, 2, 3)") && missing.contains("--partial"),
        "{missing}"
    );
    run("run", &["run", "--chunks", "2", "-q"], folder.path(), 0);
    let report = run("run", &["run", "--json"], folder.path(), 0).0;
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!((&report["computed"], &report["done_before"]), (&3.into(), &1.into()), "{report}");
    run("merge", &["run", "-q"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == *EXPECTED);
    assert!(temporary(folder.path()).is_empty(), "{:?}", temporary(folder.path()));
    // What is there is not replaced unasked.
    run("merge", &["run", "-q"], folder.path(), 2);
    run("merge", &["run", "-q", "--overwrite"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == *EXPECTED);
}

/// A plan holds the cameras as a reference has placed them.
#[test]
fn a_planned_run_with_a_reference_gives_the_bytes_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let reference = sample("truth/dsm.tif");
    let settings = [&SMALL[..], &["--reference-dem", reference.to_str().unwrap()]].concat();
    for (command, name) in [("dsm", "once"), ("plan", "run")] {
        let mut started = skysweep();
        started.current_dir(folder.path()).arg(command).args(views()).args(["-o", name]).args(&settings);
        started.assert().code(0);
    }
    run("run", &["run", "--chunks", "1/2", "-q"], folder.path(), 0);
    run("run", &["run", "--chunks", "2/2", "-q"], folder.path(), 0);
    run("merge", &["run", "-q"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == products(&folder.path().join("once")));
    let shift = |name: &str| {
        let text = std::fs::read(folder.path().join(name).join("report/report.json")).unwrap();
        serde_json::from_slice::<Value>(&text).unwrap()["pointing"]["reference"]["shift_m"].clone()
    };
    assert!(shift("run").is_array() && shift("run") == shift("once"), "{} {}", shift("run"), shift("once"));
}

#[test]
fn a_scene_in_one_chunk_has_the_same_bytes_too() {
    let folder = tempfile::tempdir().unwrap();
    let settings = ["--gsd", "2", "--preset", "fast", "-q"];
    skysweep().current_dir(folder.path()).arg("dsm").args(views()).args(["-o", "once"]).args(settings).assert().code(0);
    skysweep().current_dir(folder.path()).arg("plan").args(views()).args(["-o", "run"]).args(settings).assert().code(0);
    run("run", &["run", "-q"], folder.path(), 0);
    run("merge", &["run", "-q"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == products(&folder.path().join("once")));
    // The saved pointing serves as a report does.
    let view = sample("view_1.tif");
    let ortho = |name: &str, corrections: &str| {
        let mut command = skysweep();
        command.current_dir(folder.path()).arg("ortho").arg(&view).args(["--dsm", "run", "-q", "-o", name]);
        command.args(["--corrections", corrections]).assert().code(0);
        std::fs::read(folder.path().join(name)).unwrap()
    };
    assert!(ortho("a.tif", "run/pointing.json") == ortho("b.tif", "once/report/report.json"));
}

/// Starts a process that computes chunks.
fn worker(folder: &Path, options: &[&str]) -> Child {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("skysweep"));
    command.current_dir(folder).args(["run", "run", "-q", "--threads", "1"]).args(options);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

#[test]
fn two_processes_share_a_folder() {
    for options in [[&["--chunks", "1/2"][..], &["--chunks", "2/2"]], [&[], &[]]] {
        let folder = tempfile::tempdir().unwrap();
        plan(folder.path(), "run", &[]);
        let mut workers = options.map(|options| worker(folder.path(), options));
        assert!(workers.iter_mut().all(|worker| worker.wait().unwrap().success()));
        run("merge", &["run", "-q"], folder.path(), 0);
        assert!(products(&folder.path().join("run")) == *EXPECTED, "{options:?}");
        assert!(temporary(folder.path()).is_empty(), "{:?}", temporary(folder.path()));
    }
}

/// Starts a command whose signals do what they usually do, or which ignores Ctrl-C.
#[cfg(target_os = "linux")]
fn listening(folder: &Path, arguments: &[&str], ignores: bool) -> Child {
    // Whoever runs the tests in the background may have turned Ctrl-C off.
    let signals = if ignores { "--ignore-signal=INT" } else { "--default-signal=INT,TERM,HUP" };
    let mut command = Command::new("env");
    command.arg(signals).arg(assert_cmd::cargo::cargo_bin("skysweep")).args(arguments).current_dir(folder);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Waits until something is there, and sends a signal to a process. Returns how it ended.
#[cfg(target_os = "linux")]
fn signalled(mut process: Child, signal: &str, is_there: impl Fn() -> bool) -> std::process::ExitStatus {
    let since = std::time::Instant::now();
    while !is_there() {
        assert!(since.elapsed() < Duration::from_secs(60), "it did not begin");
        std::thread::sleep(Duration::from_millis(2));
    }
    let kill = format!("kill -{signal} {}", process.id());
    assert!(Command::new("bash").args(["-c", &kill]).status().unwrap().success());
    process.wait().unwrap()
}

/// Whether a file below a folder holds a text.
#[cfg(target_os = "linux")]
fn is_told(folder: &Path, text: &str) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => is_told(&entry.path(), text),
        _ => std::fs::read(entry.path()).is_ok_and(|bytes| String::from_utf8_lossy(&bytes).contains(text)),
    })
}

/// A scheduler that ends a job sends SIGTERM, a person presses Ctrl-C.
#[cfg(target_os = "linux")]
#[test]
fn signals_leave_no_temporary_files_and_no_claims() {
    use std::os::unix::process::ExitStatusExt;
    let folder = tempfile::tempdir().unwrap();
    let images = views().map(|view| view.to_str().unwrap().to_owned());
    let small = [&["dsm", images[0].as_str(), images[1].as_str(), "-o", "out"][..], &SMALL].concat();
    for (name, number) in [("TERM", 15), ("INT", 2), ("HUP", 1)] {
        let ended = signalled(listening(folder.path(), &small, false), name, || !temporary(folder.path()).is_empty());
        assert_eq!(ended.signal(), Some(number), "{ended:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{name} left files");
    }
    plan(folder.path(), "run", &[]);
    let chunks = folder.path().join("run/chunks");
    let computing = listening(folder.path(), &["run", "run", "-q"], false);
    let ended = signalled(computing, "TERM", || is_told(&chunks, "running"));
    assert_eq!(ended.signal(), Some(15), "{ended:?}");
    assert!(!is_told(&chunks, "running"), "the claim is not given back");
    assert!(temporary(folder.path()).is_empty(), "{:?}", temporary(folder.path()));
    // In the background of a script Ctrl-C does nothing.
    let computing = listening(folder.path(), &["run", "run", "-q"], true);
    let ended = signalled(computing, "INT", || is_told(&chunks, "running"));
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    run("merge", &["run", "-q"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == *EXPECTED);
    let text = format!(
        "output = 'night'\n[[scene]]\nname = 'a'\nimages = ['{}', '{}']\ntasks = ['dsm']\n\
         dsm.preset = 'fast'\ndsm.gsd_m = 2.0\ndsm.chunk = 128\n",
        images[0], images[1]
    );
    std::fs::write(folder.path().join("batch.toml"), text).unwrap();
    let chunks = folder.path().join("night/a/chunks");
    let night = listening(folder.path(), &["batch", "batch.toml", "-q"], false);
    let ended = signalled(night, "TERM", || is_told(&chunks, "running"));
    assert_eq!(ended.signal(), Some(15), "{ended:?}");
    assert!(!is_told(&chunks, "running") && temporary(folder.path()).is_empty());
    run("batch", &["batch.toml", "-q"], folder.path(), 0);
    assert!(folder.path().join("night/a/dsm/dsm.tif").is_file());
}

/// Files of a user among the chunks stay, and are named; so do files that only have our names.
#[cfg(unix)]
#[test]
fn what_others_put_among_the_chunks_stays() {
    let folder = tempfile::tempdir().unwrap();
    let (run_folder, outside) = (folder.path().join("run"), folder.path().join("outside"));
    std::fs::create_dir(&outside).unwrap();
    std::fs::write(outside.join("canary"), "kept").unwrap();
    let chunk = run_folder.join("chunks/0000");
    type Plant = fn(&Path, &Path);
    let plants: [(&str, &str, Plant); 7] = [
        ("chunks/mine", "mine", |path, _| std::fs::create_dir(path).unwrap()),
        ("chunks/notes.txt", "notes.txt", |path, _| std::fs::write(path, "kept").unwrap()),
        ("chunks/0000/notes.txt", "notes.txt", |path, _| std::fs::write(path, "kept").unwrap()),
        ("chunks/0000/status", "status", |path, _| std::fs::write(path, "kept").unwrap()),
        ("chunks/0000/status", "status", |path, outside| {
            std::os::unix::fs::symlink(outside.join("canary"), path).unwrap();
        }),
        ("chunks/0000/status", "status", |path, _| {
            assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
        }),
        ("chunks/0000/.claim-1", ".claim-1", |path, _| {
            std::fs::create_dir(path).unwrap();
            std::fs::write(path.join("notes"), "kept").unwrap();
        }),
    ];
    let views = views().map(|view| view.to_str().unwrap().to_owned());
    for (name, told, plant) in plants {
        let _ = std::fs::remove_dir_all(&run_folder);
        std::fs::create_dir_all(&chunk).unwrap();
        plant(&run_folder.join(name), &outside);
        let planning = [&[views[0].as_str(), views[1].as_str(), "-o", "run"][..], &SMALL].concat();
        let refused = run("plan", &planning, folder.path(), 2).1;
        assert!(refused.contains(told) && refused.contains("did not make"), "{name}: {refused}");
        assert!(run_folder.join(name).symlink_metadata().is_ok() && chunk.is_dir(), "{name} is gone");
        assert!(!run_folder.join("plan.json").exists());
    }
    assert_eq!(std::fs::read_to_string(outside.join("canary")).unwrap(), "kept");
    // The same in a folder that is planned.
    std::fs::remove_dir_all(&run_folder).unwrap();
    plan(folder.path(), "run", &[]);
    run("run", &["run", "--chunks", "0", "-q"], folder.path(), 0);
    std::fs::write(chunk.join("result/notes.txt"), "kept").unwrap();
    std::fs::create_dir_all(run_folder.join("chunks/0001")).unwrap();
    std::fs::write(run_folder.join("chunks/0001/notes.txt"), "kept").unwrap();
    for command in [&["run", "run", "-q"][..], &["merge", "run", "--partial", "-q"]] {
        let refused = run(command[0], &command[1..], folder.path(), 2).1;
        assert!(refused.contains("notes.txt"), "{refused}");
    }
    assert!(chunk.join("result/notes.txt").is_file() && run_folder.join("chunks/0001/notes.txt").is_file());
}

/// The moments are random, and the same in every run of the test.
#[test]
fn killed_at_any_moment_a_run_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let moments = RandomByIndex::new(18, 0);
    for kill in 6..9 {
        let mut planner = Command::new(assert_cmd::cargo::cargo_bin("skysweep"));
        planner.current_dir(folder.path()).arg("plan").args(views()).args(["-o", "run"]).args(SMALL);
        let mut planner = planner.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis((300.0 * moments.uniform(kill)) as u64));
        let _ = planner.kill();
        planner.wait().unwrap();
    }
    if !folder.path().join("run/plan.json").exists() {
        plan(folder.path(), "run", &[]);
    }
    for kill in 0..6 {
        let mut worker = worker(folder.path(), &["--resume"]);
        // The result does not depend on the moment.
        std::thread::sleep(Duration::from_millis(20 + (500.0 * moments.uniform(kill)) as u64));
        // It may have ended by itself.
        let _ = worker.kill();
        worker.wait().unwrap();
    }
    run("run", &["run", "--resume", "-q"], folder.path(), 0);
    // A merge, too.
    let mut merge = Command::new(assert_cmd::cargo::cargo_bin("skysweep"));
    let mut merge = merge.current_dir(folder.path()).args(["merge", "run", "-q"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(60));
    let _ = merge.kill();
    merge.wait().unwrap();
    run("merge", &["run", "-q", "--overwrite"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == *EXPECTED);
    assert!(temporary(folder.path()).is_empty(), "{:?}", temporary(folder.path()));
}

#[test]
fn changed_inputs_and_settings_are_refused_or_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    for (name, view) in ["left.tif", "right.tif"].iter().zip(views()) {
        std::fs::copy(view, folder.path().join(name)).unwrap();
    }
    run("plan", &[&["left.tif", "right.tif", "-o", "run"][..], &SMALL].concat(), folder.path(), 0);
    run("run", &["run", "--chunks", "0", "-q"], folder.path(), 0);
    // A file that belongs to an image and was not there before.
    let rpc = folder.path().join("left_RPC.TXT");
    std::fs::write(&rpc, "LINE_OFF: 1\n").unwrap();
    let refused = run("run", &["run", "-q"], folder.path(), 2).1;
    assert!(refused.contains("was not there when the plan was made") && refused.contains("left_RPC.TXT"), "{refused}");
    std::fs::remove_file(rpc).unwrap();
    // Another content under the same name.
    std::fs::copy(sample("view_2.tif"), folder.path().join("right.tif")).unwrap();
    let refused = run("run", &["run", "-q"], folder.path(), 2).1;
    assert!(
        refused.contains("another content") && refused.contains("right.tif") && refused.contains("--resume"),
        "{refused}"
    );
    // The old content under a new date is the old input.
    std::fs::copy(sample("view_3.tif"), folder.path().join("right.tif")).unwrap();
    run("run", &["run", "--chunks", "1", "-q"], folder.path(), 0);
    let config = folder.path().join("run/used_config.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    // Threads do not change the result, and are no change.
    std::fs::write(&config, format!("threads = 2\n{text}")).unwrap();
    run("run", &["run", "--chunks", "1", "-q"], folder.path(), 0);
    std::fs::write(&config, text.replace("gsd_m = 2.0", "gsd_m = 2.5")).unwrap();
    let refused = run("merge", &["run", "--partial", "-q"], folder.path(), 2).1;
    assert!(refused.contains("the configuration was changed"), "{refused}");
    let report: Value = serde_json::from_str(&run("run", &["run", "--resume", "--json"], folder.path(), 0).0).unwrap();
    assert_eq!(report["done_before"], 0, "chunks of the old plan are not mixed in: {report}");
    run("merge", &["run", "-q"], folder.path(), 0);
    let dsm = formats::raster::read_dem(folder.path().join("run/dsm/dsm.tif")).unwrap();
    assert_eq!(dsm.geotransform.0[1], 2.5);
    // An edited plan is no plan.
    let plan = folder.path().join("run/plan.json");
    let text = std::fs::read_to_string(&plan).unwrap();
    std::fs::write(&plan, text.replacen("\"step_m\": ", "\"step_m\": 1", 1)).unwrap();
    assert!(run("run", &["run", "-q"], folder.path(), 2).1.contains("it is not as it was written"));
}

/// One process of an array job plans again, and the others wait for it.
#[test]
fn an_array_job_is_resumed_after_a_change() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "run", &[]);
    run("run", &["run", "--chunks", "1", "-q"], folder.path(), 0);
    let config = folder.path().join("run/used_config.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text.replace("gsd_m = 2.0", "gsd_m = 2.5")).unwrap();
    let mut workers = ["1/3", "2/3", "3/3"].map(|share| worker(folder.path(), &["--resume", "--chunks", share]));
    let ended = workers.each_mut().map(|worker| worker.wait().unwrap().code());
    assert_eq!(ended, [Some(0); 3]);
    run("merge", &["run", "-q"], folder.path(), 0);
    let dsm = formats::raster::read_dem(folder.path().join("run/dsm/dsm.tif")).unwrap();
    assert_eq!(dsm.geotransform.0[1], 2.5);
    assert!(temporary(folder.path()).is_empty(), "{:?}", temporary(folder.path()));
}

/// A result of a chunk that was truncated, changed or deleted is never merged.
#[test]
fn damaged_chunks_are_named_and_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "run", &[]);
    run("run", &["run", "-q"], folder.path(), 0);
    let chunk = |index: usize| folder.path().join(format!("run/chunks/{index:04}/result"));
    let height = chunk(1).join("height.npy");
    let bytes = std::fs::read(&height).unwrap();
    std::fs::write(&height, &bytes[..bytes.len() - 4]).unwrap();
    let told = run("merge", &["run", "-q"], folder.path(), 2).1;
    assert!(told.contains("chunk 1") && told.contains("height.npy") && told.contains("bytes, expected"), "{told}");
    let (out, _) = run("merge", &["run", "--partial", "--json"], folder.path(), 1);
    let report: Value = serde_json::from_str(&out).unwrap();
    let reason = report["chunks"]["failed"][0]["reason"].as_str().unwrap();
    assert!(reason.contains("damaged") && reason.contains("height.npy"), "{report}");
    let mut turned = std::fs::read(chunk(2).join("height.npy")).unwrap();
    *turned.last_mut().unwrap() ^= 64;
    std::fs::write(chunk(2).join("height.npy"), turned).unwrap();
    std::fs::remove_dir_all(chunk(3)).unwrap();
    let (out, told) = run("run", &["run", "--json"], folder.path(), 0);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&report["computed"], &report["done_before"]), (&3.into(), &1.into()), "{report}");
    assert!(["chunk 1", "chunk 2", "chunk 3"].iter().all(|name| told.contains(name)), "{told}");
    run("merge", &["run", "-q", "--overwrite"], folder.path(), 0);
    assert!(products(&folder.path().join("run")) == *EXPECTED);
}

/// Results that another program made, or a defect of ours, are no surface.
#[test]
fn heights_that_are_not_finite_or_were_never_searched_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "run", &[]);
    run("run", &["run", "-q"], folder.path(), 0);
    let mut plan = PlanFile::read(&folder.path().join("run")).unwrap().plan.clone();
    plan.config.output = folder.path().join("merged");
    let place = |index: usize| folder.path().join(format!("run/chunks/{index:04}/result"));
    let merged = |change: &dyn Fn(&mut ChunkSurface)| {
        let results = (0..plan.chunks.len()).map(|index| {
            let mut result = ChunkResult::read(&place(index))?;
            if let (2, ChunkContent::Surface(surface)) = (index, &mut result.content) {
                change(surface);
            }
            Ok(result)
        });
        merge(&plan, results, &Silent).map(|_| ()).map_err(|error| error.to_string())
    };
    let set = |height_m: f32| {
        move |surface: &mut ChunkSurface| {
            let observed = surface.rasters.filled.data().iter().position(|mark| *mark == 0).unwrap();
            surface.rasters.height_m.data_mut()[observed] = height_m;
        }
    };
    for (height_m, found) in [(f32::INFINITY, "inf m"), (f32::NAN, "NaN m"), (5000.0, "m, expected heights from")] {
        let told = merged(&set(height_m)).unwrap_err();
        assert!(told.contains("chunk 2") && told.contains(found) && told.contains("compute it again"), "{told}");
    }
    let told = merged(&|surface| surface.summary.counts.cells.void += 1).unwrap_err();
    assert!(told.contains("void") && told.contains("chunk 2"), "{told}");
    let told = merged(&|surface| surface.summary.height_range.high_m += 1.0).unwrap_err();
    assert!(told.contains("expected heights from"), "{told}");
    assert!(!folder.path().join("merged/dsm").exists());
    merged(&|_| {}).unwrap();
}

#[test]
fn missing_and_failed_chunks_are_void_counted_and_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, view) in ["left.tif", "right.tif"].iter().zip(views()) {
        std::fs::copy(view, folder.path().join(name)).unwrap();
    }
    run("plan", &[&["left.tif", "right.tif", "-o", "run"][..], &SMALL].concat(), folder.path(), 0);
    run("run", &["run", "--chunks", "1,2,3", "-q"], folder.path(), 0);
    let (out, told) = run("merge", &["run", "--partial", "--json"], folder.path(), 1);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(report["chunks"]["failed"][0]["reason"], "not computed", "{report}");
    assert!(told.contains("chunks that could not be computed"), "{told}");
    let quiet = run("merge", &["run", "--partial", "--overwrite", "-q"], folder.path(), 1).1;
    assert!(quiet.starts_with("error: ") && quiet.contains("chunk"), "{quiet}");
    assert!(run("run", &["run", "--chunks", "4"], folder.path(), 2).1.contains("none with number 4"));
    assert!(run("run", &["run", "--chunks", "3/2"], folder.path(), 2).1.contains("such as 2/5"));
    assert!(run("run", &["."], folder.path(), 2).1.contains("the folder has no plan"));
    assert!(run("merge", &["."], folder.path(), 2).1.contains("skysweep plan"));
}

/// Two runs without a plan into one folder would mix their files, and so would a merge beside a
/// process that computes chunks.
#[test]
fn a_folder_in_which_chunks_are_computed_is_not_merged() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "run", &[]);
    let share = std::fs::File::open(folder.path().join("run")).unwrap();
    share.lock_shared().unwrap();
    for command in [&["merge", "run", "--partial"][..], &["run", "run", "--resume", "-q"]] {
        let code = if command[0] == "run" { 0 } else { 2 };
        let told = run(command[0], &command[1..], folder.path(), code).1;
        assert_eq!(told.contains("another run"), code == 2, "{told}");
    }
    let mut again = skysweep();
    again.current_dir(folder.path()).arg("plan").args(views()).args(["-o", "run"]).args(SMALL).arg("--overwrite");
    again.assert().code(2).stderr(predicate::str::contains("another run"));
}

#[test]
fn a_dry_run_prints_the_plan_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = skysweep();
    command.current_dir(folder.path()).arg("dsm").args(views()).args(["-o", "out"]).args(&SMALL[..6]).arg("--dry-run");
    let output = command.assert().code(0).get_output().stdout.clone();
    let text = String::from_utf8(output).unwrap();
    for words in
        ["view_1.tif", "EPSG:32631", "chunks     4; about ", " MB and ", "of processor time", "height range", "(given)"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_used_configuration_fed_back_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), "first", &["--bounds", "693812", "4822332", "694012", "4822532"]);
    run("run", &["first", "-q"], folder.path(), 0);
    run("merge", &["first", "-q"], folder.path(), 0);
    // From another folder: the paths are relative to the file.
    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    // Products name their images relative to their own folder, so both runs lie equally deep.
    run("dsm", &["../first/used_config.toml", "-o", "../second", "-q"], &elsewhere, 0);
    assert!(products(&folder.path().join("second")) == products(&folder.path().join("first")));
    // Options replace settings of the file.
    run("dsm", &["../first/used_config.toml", "-o", "third", "--gsd", "4", "-q"], &elsewhere, 0);
    let dsm = formats::raster::read_dem(elsewhere.join("third/dsm/dsm.tif")).unwrap();
    assert_eq!((dsm.geotransform.0[1], dsm.heights.width()), (4.0, 50));
}

#[test]
fn job_files_are_checked_and_have_a_template() {
    let folder = tempfile::tempdir().unwrap();
    let template = run("template", &["dsm"], folder.path(), 0).0;
    assert!(template.contains("# gsd_m = "), "{template}");
    let job = folder.path().join("job.toml");
    std::fs::write(&job, template.replace("# gsd_m", "gsd")).unwrap();
    let told = run("dsm", &["job.toml"], folder.path(), 2).1;
    assert!(told.contains("unknown key `gsd` (line ") && told.contains("did you mean `gsd_m`?"), "{told}");
    std::fs::write(&job, "images = ['left.tif', 'right.tif']").unwrap();
    let told = run("dsm", &["job.toml"], folder.path(), 2).1;
    assert!(told.contains("the output folder is missing") && told.contains("-o DIR"), "{told}");
    let told = run("plan", &["job.toml", "-o", "out"], folder.path(), 2).1;
    assert!(told.contains("left.tif"), "{told}");
}
