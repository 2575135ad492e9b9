//! Every command that writes, on disks that are too small for it: a file system in memory (tmpfs)
//! is mounted with a size between nothing and a little more than the results take. Where none can
//! be mounted, a line says so; limits on the size of files are tried in any case.
//!
//! `SKYSWEEP_DISK_SIZES=13` tries 13 sizes for every command instead of one for a few, and prints
//! the counts. `eval` of a run writes a page beside it where it can, which is no result that was
//! asked for.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::Command;

use crate::commands::{COMMANDS, Writing, copy, prepare, run, snapshot};
use crate::{HOLD_TIMES, ends_as};

/// One command in this many is tried with every test run, on the size of half of its results.
const ONE_IN: usize = 6;
/// What tells that a disk is full. The report of a batch holds the reasons of its tasks.
const CAUSES: [&str; 4] = ["space", "disk is not full", "disk is full", "the report names the reasons"];
/// Bytes that a file system gives to a file at a time.
const PAGE: u64 = 4096;

/// A mounted file system of a size. Dropping it takes it away.
struct Disk<'a>(&'a Path);

impl<'a> Disk<'a> {
    fn mount(folder: &'a Path, bytes: u64) -> Option<Self> {
        let size = format!("size={}", bytes.max(PAGE));
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder).output();
        mount.is_ok_and(|mount| mount.status.success()).then_some(Self(folder))
    }
}

impl Drop for Disk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(self.0).status();
    }
}

/// Writes a line to standard error. A test that cannot print still fails where it must.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Bytes that files take on the disk.
fn taken(files: &BTreeMap<String, Vec<u8>>) -> u64 {
    files.values().map(|bytes| (bytes.len() as u64).div_ceil(PAGE) * PAGE).sum()
}

/// What became of a command on its disks.
#[derive(Default)]
struct Counts {
    complete: usize,
    refused: usize,
    /// What is not as it should be.
    faults: Vec<String>,
}

/// Whether a file of this name grows with a run, so that it may end anywhere.
fn is_journal(name: &str) -> bool {
    [".jsonl", ".log"].iter().any(|end| name.ends_with(end))
}

/// Whether a file of this name is kept to go on with a run, and goes at its end.
fn is_to_go_on(name: &str) -> bool {
    is_journal(name) || name.contains("/chunks/")
}

/// Whether a file of this name holds times, so that its bytes differ from run to run.
fn holds_times(name: &str) -> bool {
    let base = name.rsplit('/').next().unwrap_or(name);
    let of_run = ["status", "plan.json", "pointing.json", "batch.toml", "batch_report.json", "batch_report.html"];
    HOLD_TIMES.contains(&base)
        || of_run.contains(&base)
        || name.contains("tasks/")
        || [".json", ".html", ".laz", ".toml", ".gpkg"].iter().any(|end| base.ends_with(end))
}

/// Runs a command on disks that give its results these shares of what they take.
fn check(of: &Writing, shares: &[f64]) -> Option<Counts> {
    let root = tempfile::tempdir().unwrap();
    // All at the same depth: plans and configurations name their images from where they lie.
    let [begin, whole, disk] = ["begin", "whole", "disk"].map(|name| root.path().join(name));
    [&begin, &whole, &disk].iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    let (begin, whole) = (begin.join("work"), whole.join("work"));
    std::fs::create_dir(&begin).unwrap();
    prepare(&begin, of);
    copy(&begin, &whole);
    assert_eq!(run(&whole, of.command, "").code, 0, "{}", of.name);
    let (before, whole) = (snapshot(&begin), snapshot(&whole));
    let mut counts = Counts::default();
    for share in shares {
        let more = (taken(&whole) - taken(&before)) as f64 * share;
        let bytes = taken(&before) + more as u64 + if *share == 0.0 { 0 } else { PAGE };
        let Some(_mounted) = Disk::mount(&disk, bytes) else {
            say("skipped: no file system in memory can be mounted (as root: mount -t tmpfs)");
            return None;
        };
        let place = disk.join("work");
        copy(&begin, &place);
        let ended = run(&place, of.command, "");
        let case = format!("{} on {bytes} bytes", of.name);
        let left = snapshot(&place);
        match ended.code {
            0 => {
                let lost: Vec<_> = whole.keys().filter(|name| !left.contains_key(*name)).collect();
                if !lost.is_empty() && of.name != "eval of a run" {
                    counts.faults.push(format!("{case}: exit code 0 without {lost:?}"));
                }
                counts.complete += 1;
            }
            1 | 2 => {
                let told = &ended.told;
                if !CAUSES.iter().any(|cause| told.contains(cause)) {
                    counts.faults.push(format!("{case}: the cause is not told: {told}"));
                }
                counts.refused += 1;
            }
            code => panic!("{case}: exit code {code}: {}", ended.told),
        }
        for (name, bytes) in left.iter().filter(|(name, _)| !name.ends_with('/')) {
            let is_as_before = before.get(name) == Some(bytes);
            let is_whole = whole.get(name).is_some_and(|expected| {
                expected == bytes || (holds_times(name) && ends_as(Path::new(name), bytes, expected))
            });
            if !whole.contains_key(name) {
                if !is_to_go_on(name) {
                    counts.faults.push(format!("{case}: {name} is left ({})", ended.told));
                }
            } else if !is_as_before && !is_whole && !is_journal(name) {
                counts.faults.push(format!("{case}: {name} is broken ({})", ended.told));
            }
        }
    }
    Some(counts)
}

#[test]
fn disks_that_are_too_small_leave_nothing_broken() {
    let sizes: Option<usize> = std::env::var("SKYSWEEP_DISK_SIZES").ok().map(|sizes| sizes.parse().unwrap());
    // From nothing to a tenth more than the results take.
    let shares = sizes.map_or(vec![0.5], |sizes| (0..sizes).map(|i| 1.1 * i as f64 / sizes as f64).collect());
    let mut all = Counts::default();
    for of in COMMANDS.iter().step_by(if sizes.is_some() { 1 } else { ONE_IN }) {
        let Some(counts) = check(of, &shares) else { return };
        say(&format!("{:20} {:3} complete {:3} refused", of.name, counts.complete, counts.refused));
        all.complete += counts.complete;
        all.refused += counts.refused;
        all.faults.extend(counts.faults);
    }
    assert!(all.faults.is_empty(), "{} faults:\n{}", all.faults.len(), all.faults.join("\n"));
    say(&format!("{:20} {:3} complete {:3} refused", "all", all.complete, all.refused));
    assert!(all.refused > 0, "no disk was too small");
}
