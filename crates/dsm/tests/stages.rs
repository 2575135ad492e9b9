//! The stages of the DSM job are plain values: written, read back and continued in a fresh session
//! they give the same bytes. A cancelled run leaves nothing.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use dsm::{
    ChunkContent, ChunkResult, DsmConfig, DsmError, Opened, Plan, Pointed, Preset, Session, merge, open, plan, point,
    run, run_chunk,
};
use numeric::{Choice, Progress, Silent};
use serde::Serialize;
use serde::de::DeserializeOwned;

fn town(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town").join(name)
}

/// The town on coarse cells, which takes a second.
fn config(output: &Path) -> DsmConfig {
    let images = ["view_1.tif", "view_2.tif", "view_3.tif"].map(town);
    let mut config = DsmConfig::new(images.into(), output.to_owned());
    (config.preset, config.gsd_m) = (Preset::Fast, Some(2.0));
    config.prior = Some(town("truth/buildings.city.json"));
    config
}

/// The value after it was written as JSON and read back.
fn read_back<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &T) -> T {
    let json = serde_json::to_string(value).unwrap();
    let back = serde_json::from_str(&json).unwrap();
    assert_eq!(*value, back);
    back
}

/// Names and contents of the rasters and pictures.
fn bytes(output: &Path) -> BTreeMap<OsString, Vec<u8>> {
    let files = std::fs::read_dir(output.join("dsm")).unwrap().map(Result::unwrap);
    let read = |file: std::fs::DirEntry| (file.file_name(), std::fs::read(file.path()).unwrap());
    let all: BTreeMap<_, _> = files.map(read).collect();
    assert_eq!(all.len(), 18);
    all
}

/// Runs every stage in its own session, with each value written and read back between them.
fn run_apart(config: &DsmConfig, folder: &Path) {
    let opened: Opened = read_back(&open(config).unwrap());
    let pointed: Pointed = read_back(&point(config, &opened, &mut Session::new(&Silent)).unwrap());
    let plan: Plan = read_back(&plan(config, &pointed, &mut Session::new(&Silent)).unwrap());
    // The order of the chunks does not matter.
    for index in (0..plan.chunks.len()).rev() {
        let result = run_chunk(&plan, index, &mut Session::new(&Silent)).unwrap();
        assert!(matches!(result.content, ChunkContent::Surface(_)));
        result.write(&folder.join(index.to_string())).unwrap();
    }
    let results = (0..plan.chunks.len()).map(|index| ChunkResult::read(&folder.join(index.to_string())));
    let product = merge(&plan, results, &Silent).unwrap();
    assert!(product.files.iter().all(|file| file.is_file()));
}

#[test]
fn stages_apart_give_the_same_bytes_as_one_run() {
    for chunk in [None, Some(150)] {
        let folder = tempfile::tempdir().unwrap();
        let (once, apart) = (folder.path().join("once"), folder.path().join("apart"));
        let mut config = config(&once);
        config.chunk = chunk;
        let report = run(&config, &Silent).unwrap();
        assert_eq!(report.chunks.map(|c| (c.done, c.failed.len())), chunk.map(|_| (4, 0)));
        config.output.clone_from(&apart);
        run_apart(&config, folder.path());
        assert!(bytes(&once) == bytes(&apart), "other bytes with chunks of {chunk:?}");
    }
}

#[test]
fn bounds_are_planned_with_the_cameras_that_were_pointed() {
    let folder = tempfile::tempdir().unwrap();
    let (once, apart) = (folder.path().join("once"), folder.path().join("apart"));
    let mut config = config(&once);
    config.prior = None;
    config.bounds = Some([693_800.0, 4_822_550.0, 693_900.0, 4_822_640.0].into());
    run(&config, &Silent).unwrap();
    config.output.clone_from(&apart);
    run_apart(&config, folder.path());
    assert!(bytes(&once) == bytes(&apart));
}

#[test]
fn chunks_are_merged_once_each() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(&folder.path().join("out"));
    (config.prior, config.chunk) = (None, Some(150));
    let mut session = Session::new(&Silent);
    let pointed = point(&config, &open(&config).unwrap(), &mut session).unwrap();
    let plan = plan(&config, &pointed, &mut session).unwrap();
    let mut results = || run_chunk(&plan, 0, &mut session);
    let missing = merge(&plan, [results()], &Silent).unwrap_err();
    assert!(matches!(missing, DsmError::ChunksMissing { found: 1, count: 4 }), "{missing}");
    let twice = merge(&plan, [results(), results()], &Silent).unwrap_err();
    assert!(matches!(twice, DsmError::ChunksMissing { found: 1, count: 4 }), "{twice}");
    assert!(!config.output.exists());
    let beyond = run_chunk(&plan, 4, &mut Session::new(&Silent)).unwrap_err();
    assert!(matches!(beyond, DsmError::NoSuchChunk { index: 4, count: 4 }));
    assert!(matches!(ChunkResult::read(folder.path()), Err(DsmError::ChunkFile { .. })));
}

/// Asks the run to stop when a number of steps is done.
struct StopAfter(AtomicUsize);

impl Progress for StopAfter {
    fn begin(&self, _: &str, _: usize) {}
    fn choice(&self, _: &Choice) {}
    fn warn(&self, _: &str) {}

    fn step(&self) {
        let _ = self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
    }

    fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) == 0
    }
}

#[test]
fn a_cancelled_run_leaves_nothing() {
    // While images are read, while they are swept or planned, and when chunks are done.
    for (chunk, steps) in [(None, 0), (None, 2), (None, 8), (None, 13), (Some(150), 3), (Some(150), 9)] {
        let folder = tempfile::tempdir().unwrap();
        let mut config = config(&folder.path().join("out"));
        (config.prior, config.chunk) = (None, chunk);
        let ended = run(&config, &StopAfter(steps.into()));
        assert!(matches!(ended, Err(DsmError::Cancelled)), "{chunk:?} after {steps} steps: {ended:?}");
        assert!(!config.output.exists(), "{chunk:?} after {steps} steps");
    }
}

/// Appends a byte to a file when a stage begins.
struct ChangeAt<'a>(&'a str, &'a Path);

impl Progress for ChangeAt<'_> {
    fn begin(&self, stage: &str, _: usize) {
        if stage == self.0 {
            let mut bytes = std::fs::read(self.1).unwrap();
            bytes.push(0);
            std::fs::write(self.1, bytes).unwrap();
        }
    }

    fn step(&self) {}
    fn choice(&self, _: &Choice) {}
    fn warn(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}

#[test]
fn an_input_that_changes_during_the_run_is_named() {
    let (whole, chunked) = ((None, "sweeping heights"), (Some(150), "sweeping chunks"));
    for ((chunk, stage), changed) in [(whole, "image.tif"), (chunked, "image.tif"), (whole, "image_RPC.TXT")] {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("image.tif");
        std::fs::copy(town("view_2.tif"), &image).unwrap();
        let rpc = formats::rpc::read_for_image(&image).unwrap().rpc;
        formats::rpc::write(&folder.path().join("image_RPC.TXT"), &rpc, formats::rpc::RpcFormat::Text, false).unwrap();
        let mut config = config(&folder.path().join("out"));
        (config.prior, config.chunk) = (None, chunk);
        config.images[1].clone_from(&image);
        let changed = folder.path().join(changed);
        let ended = run(&config, &ChangeAt(stage, &changed));
        assert!(matches!(&ended, Err(DsmError::InputChanged { path }) if *path == changed), "{ended:?}");
        assert!(!config.output.exists());
    }
}
