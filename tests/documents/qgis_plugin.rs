//! The QGIS plugin in `qgis/`: its catalogue names options and choices that the command has, and
//! the part of it that runs the command works where Python is installed.

use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use serde_json::Value;

fn plugin() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("qgis")
}

fn algorithms() -> Vec<Value> {
    let text = std::fs::read_to_string(plugin().join("skysweep/algorithms.json")).unwrap();
    let catalogue: Value = serde_json::from_str(&text).unwrap();
    catalogue["algorithms"].as_array().unwrap().clone()
}

/// Returns the help of an option: from its name to the next option.
fn help_of<'a>(help: &'a str, option: &str) -> Option<&'a str> {
    let is_named = |line: &str| line.split([' ', ',', '=', '[']).any(|word| word == option);
    let starts = |line: &str| line.trim_start().starts_with('-') && line.starts_with("  ");
    let mut at = 0;
    let mut begin = None;
    for line in help.split_inclusive('\n') {
        if starts(line) && line.len() - line.trim_start().len() < 10 {
            match begin {
                Some(begin) => return Some(&help[begin..at]),
                None if is_named(line.trim_end()) => begin = Some(at),
                None => {}
            }
        }
        at += line.len();
    }
    begin.map(|begin| &help[begin..])
}

#[test]
fn every_option_and_choice_of_the_plugin_exists() {
    let algorithms = algorithms();
    assert!(algorithms.len() >= 6);
    for algorithm in &algorithms {
        let id = algorithm["id"].as_str().unwrap();
        let command = algorithm["command"].as_array().unwrap().iter().map(|word| word.as_str().unwrap());
        let printed = Command::new(cargo_bin("skysweep")).args(command).arg("--help").output().unwrap();
        let help = String::from_utf8(printed.stdout).unwrap();
        let parameters = algorithm["parameters"].as_array().unwrap().iter().chain([&algorithm["output"]]);
        for parameter in parameters {
            let name = parameter["name"].as_str().unwrap();
            let Some(option) = parameter["option"].as_str() else {
                assert_eq!(parameter["argument"], true, "{id}: {name} is neither an option nor an argument");
                continue;
            };
            let text = help_of(&help, option).unwrap_or_else(|| panic!("{id}: {option} is no option of the command"));
            for choice in parameter["choices"].as_array().into_iter().flatten() {
                let choice = format!("- {}:", choice.as_str().unwrap());
                assert!(text.contains(&choice), "{id}: {option} has no choice {choice}\n{text}");
            }
        }
    }
}

/// What plugins.qgis.org refuses a plugin without, and every command with a result of its own.
#[test]
fn the_plugin_is_described_and_runs_every_job() {
    let metadata = std::fs::read_to_string(plugin().join("skysweep/metadata.txt")).unwrap();
    let wanted = ["name", "description", "about", "version", "qgisMinimumVersion", "author", "email", "repository"];
    for key in wanted.into_iter().chain(["tracker", "homepage", "icon", "tags", "category"]) {
        let value = metadata.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        assert!(value.is_some_and(|value| !value.trim().is_empty()), "{key} is missing in metadata.txt");
    }
    let commands: Vec<String> = algorithms()
        .iter()
        .map(|algorithm| {
            let words = algorithm["command"].as_array().unwrap().iter();
            words.map(|word| word.as_str().unwrap()).collect::<Vec<_>>().join(" ")
        })
        .collect();
    for job in [
        "align",
        "buildings",
        "classes",
        "diff",
        "dsm",
        "dtm",
        "eval",
        "groundview",
        "heightmap",
        "mesh",
        "ortho",
        "priors",
        "products",
        "register",
        "rpc export",
        "simulate",
        "splats",
        "tiles",
        "train",
    ] {
        assert!(commands.iter().any(|command| command == job), "no algorithm runs skysweep {job}");
    }
}

#[test]
fn the_plugin_runs_the_command() {
    let Ok(version) = Command::new("python3").arg("--version").output() else {
        testing::skip("python3 is not installed");
        return;
    };
    assert!(version.status.success());
    let mut tests = Command::new("python3");
    tests.args(["-B", "-m", "unittest", "discover"]).arg(plugin().join("tests"));
    let ended = tests.env("SKYSWEEP_COMMAND", cargo_bin("skysweep")).output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
}
