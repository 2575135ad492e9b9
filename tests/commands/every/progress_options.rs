//! The commands that compare, move, choose and convert show their progress as the others do.

use std::path::Path;

use crate::common::{sample, skysweep};

/// Runs a command with its progress as JSON and returns the events.
fn events(arguments: &[&str], files: &[&Path], options: &[&str]) -> Vec<serde_json::Value> {
    let mut command = skysweep();
    let ended = command.args(arguments).args(files).args(options).args(["--progress", "json"]).output().unwrap();
    let text = String::from_utf8(ended.stderr).unwrap();
    let event = |line: &str| serde_json::from_str(line).ok();
    let events: Vec<serde_json::Value> = text.lines().filter_map(event).collect();
    assert!(!events.is_empty(), "{arguments:?}: {text}");
    events
}

fn names(events: &[serde_json::Value]) -> Vec<&str> {
    events.iter().filter_map(|event| event["event"].as_str()).collect()
}

#[test]
fn stages_and_the_end_are_events() {
    let folder = tempfile::tempdir().unwrap();
    let (dsm, model) = (sample("truth/dsm.tif"), sample("truth/buildings.city.json"));
    let obj = folder.path().join("town.obj");
    let obj = obj.to_str().unwrap();
    let done = [
        events(&["eval"], &[&dsm, &dsm], &["--align", "none", "--no-report"]),
        events(&["city", "info"], &[&model], &[]),
        events(&["city", "convert"], &[&model], &["-o", obj]),
    ];
    for events in done {
        let names = names(&events);
        assert!(names.first() == Some(&"stage") && names.contains(&"step"), "{names:?}");
        assert_eq!(names.last(), Some(&"done"));
    }
}

#[test]
fn the_error_that_ends_a_command_is_an_event() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("no_model");
    let output = folder.path().join("out");
    let output = output.to_str().unwrap();
    let failed = [
        events(&["split"], &[&missing], &["-o", output]),
        events(&["align"], &[&missing], &["--positions", "no.csv", "-o", output]),
    ];
    for events in failed {
        assert_eq!(names(&events).last(), Some(&"error"), "{events:?}");
    }
}
