//! Every command that writes, on disks that are too small for it: a file system in memory (tmpfs)
//! is mounted with a size between nothing and a little more than the results take. Where none can
//! be mounted, a line says so; limits on the size of files are tried in any case.
//!
//! `SKYSWEEP_DISK_SIZES=13` tries 13 sizes instead of two, and prints the counts.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use crate::commands::{COMMANDS, Writing, copy, prepare, run, snapshot};
use crate::{HOLD_TIMES, ends_as};

/// Sizes that are tried with every test run.
const SIZES: usize = 2;
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

/// Bytes that files take on the disk.
fn taken(files: &BTreeMap<String, Vec<u8>>) -> u64 {
    files.values().map(|bytes| (bytes.len() as u64).div_ceil(PAGE) * PAGE).sum()
}

/// What became of a command on its disks.
#[derive(Default)]
struct Counts {
    complete: usize,
    refused: usize,
}

/// Whether a file of this name holds times, so that its bytes differ from run to run.
fn holds_times(name: &str) -> bool {
    let base = name.rsplit('/').next().unwrap_or(name);
    let of_run = ["status", "plan.json", "pointing.json", "batch.toml", "batch_report.json", "batch_report.html"];
    HOLD_TIMES.contains(&base)
        || of_run.contains(&base)
        || name.contains("tasks/")
        || [".json", ".html", ".laz", ".toml"].iter().any(|end| base.ends_with(end))
}

fn check(of: &Writing, sizes: usize) -> Option<Counts> {
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
    for number in 0..sizes {
        // From nothing to a tenth more than the results take.
        let share = 1.1 * number as f64 / sizes.max(2) as f64;
        let more = (taken(&whole) - taken(&before)) as f64 * share;
        let bytes = taken(&before) + more as u64 + if number == 0 { 0 } else { PAGE };
        let Some(_mounted) = Disk::mount(&disk, bytes) else {
            println!("skipped: no file system in memory can be mounted (as root: mount -t tmpfs)");
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
                assert!(lost.is_empty(), "{case}: exit code 0 without {lost:?}");
                counts.complete += 1;
            }
            1 | 2 => {
                let (told, name) = (&ended.told, of.command.split(" -o ").nth(1).unwrap_or("out"));
                let name = name.split_whitespace().next().unwrap_or(name);
                let is_told = told.contains("space") || told.contains("disk is not full");
                assert!(is_told && told.contains(name), "{case}: the cause is not told: {told}");
                counts.refused += 1;
            }
            code => panic!("{case}: exit code {code}: {}", ended.told),
        }
        for (name, bytes) in left.iter().filter(|(name, _)| !name.ends_with('/')) {
            let expected = whole.get(name).unwrap_or_else(|| panic!("{case}: {name} is left ({})", ended.told));
            let is_whole = bytes == expected || (holds_times(name) && ends_as(Path::new(name), bytes));
            assert!(is_whole || before.get(name) == Some(bytes), "{case}: {name} is broken ({})", ended.told);
        }
    }
    Some(counts)
}

#[test]
fn disks_that_are_too_small_leave_nothing_broken() {
    let sizes = std::env::var("SKYSWEEP_DISK_SIZES").ok().and_then(|sizes| sizes.parse().ok()).unwrap_or(SIZES);
    let mut all = Counts::default();
    for of in COMMANDS {
        let Some(counts) = check(of, sizes) else { return };
        println!("{:20} {:3} complete {:3} refused", of.name, counts.complete, counts.refused);
        all.complete += counts.complete;
        all.refused += counts.refused;
    }
    println!("{:20} {:3} complete {:3} refused", "all", all.complete, all.refused);
    assert!(all.refused > 0, "no disk was too small");
}
