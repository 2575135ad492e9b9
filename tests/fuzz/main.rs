//! A seeded campaign against hostile input: mutated files for every reader, and whole runs of the
//! command with mutated files and hostile settings.
//!
//! Nothing may panic, abort, hang, or take more memory than the limit. A reader is called in a
//! process of its own with a limited address space, many inputs after each other; when the process
//! dies or stands still, the input is known and the next process goes on behind it.
//!
//! | variable | meaning | default |
//! |---|---|---|
//! | `SKYSWEEP_FUZZ_INPUTS` | mutated inputs | 1500 |
//! | `SKYSWEEP_FUZZ_RUNS` | whole runs | 30 |
//! | `SKYSWEEP_FUZZ_SECONDS` | time for each of both; what is left then is not tried | 55 |
//! | `SKYSWEEP_FUZZ_SEED` | seed of the mutations | 1 |
//!
//! `make fuzz` runs the hour-long campaign. A failure prints the seed and number of the input, and
//! keeps the file in `target/tmp/fuzz/failures`.

#![cfg(unix)]

#[path = "../common/mod.rs"]
mod common;
mod corpus;
mod mutate;
mod readers;
mod runs;
mod worker;

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Address space of a process under test, kilobytes.
pub(crate) const MEMORY_KB: u32 = 3_000_000;

/// Extent of a campaign.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Campaign {
    /// Number of mutated inputs or runs.
    pub(crate) count: u64,
    /// Time after which no further input is tried.
    pub(crate) time: Duration,
    /// Seed of the mutations.
    pub(crate) seed: u64,
}

impl Campaign {
    /// Reads the extent from the environment. `count` names the variable of the number and its
    /// default.
    fn from_env(count: (&str, u64)) -> Self {
        let number = |(name, default): (&str, u64)| match std::env::var(name) {
            Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name} is {text:?}, expected a whole number")),
            Err(_) => default,
        };
        Self {
            count: number(count),
            time: Duration::from_secs(number(("SKYSWEEP_FUZZ_SECONDS", 55))),
            seed: number(("SKYSWEEP_FUZZ_SEED", 1)),
        }
    }
}

/// Returns a folder of this test that holds files between runs.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Fails with the failures of a campaign, if there are any.
#[track_caller]
fn expect_none(failures: &[String], tried: u64, what: &str, campaign: Campaign) {
    let Campaign { count, seed, .. } = campaign;
    // A test that cannot print still counts its failures.
    let _ =
        writeln!(std::io::stderr(), "fuzz: {tried} of {count} {what} with seed {seed}, {} failures", failures.len());
    assert!(failures.is_empty(), "{} of {tried} {what}:\n{}", failures.len(), failures.join("\n"));
    assert!(tried > 0, "no time for a single one");
}

#[test]
fn mutated_inputs_are_read_or_refused() {
    let campaign = Campaign::from_env(("SKYSWEEP_FUZZ_INPUTS", 1500));
    let corpus = corpus::write(&folder("corpus"));
    let (tried, failures) = worker::try_all(&corpus, campaign);
    expect_none(&failures, tried, "mutated inputs", campaign);
}

#[test]
fn hostile_runs_end_with_an_exit_code() {
    let campaign = Campaign::from_env(("SKYSWEEP_FUZZ_RUNS", 30));
    let corpus = corpus::write(&folder("corpus_of_runs"));
    let (tried, failures) = runs::try_all(&corpus, campaign);
    expect_none(&failures, tried, "whole runs", campaign);
}

/// Every seed of the corpus is a good file of its reader, or the campaign would only try how files
/// are refused.
#[test]
fn the_inputs_before_mutation_are_good() {
    let corpus = corpus::write(&folder("good_corpus"));
    let refused: Vec<_> =
        corpus.iter().filter_map(|seed| Some((&seed.path, readers::call(seed.reader, &seed.path).err()?))).collect();
    assert!(refused.is_empty(), "{refused:#?}");
}
