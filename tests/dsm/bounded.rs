//! Memory and time are bounded whatever the input says: files that repeat themselves by reference,
//! settings that ask for terabytes, devices and pipes, and a standard error that is closed.
//!
//! The commands run with a limit on their address space, so that a command that takes the memory
//! fails here and not on the machine.

#![cfg(unix)]

use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{sample, skysweep};
use jobs::dsm::DsmConfig;
use jobs::production::{PlanEstimate, PlanFile};
use rayon::prelude::*;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

/// Address space of a command, kilobytes.
const MEMORY_KB: u32 = 3_000_000;

/// Runs the command in a shell with limited memory. `redirections` are of the shell.
fn bounded(arguments: &[&str], redirections: &str) -> Output {
    let script = format!("ulimit -v {MEMORY_KB}; exec \"$0\" \"$@\" {redirections}");
    let mut command = Command::new("bash");
    command.args(["-c", &script]).arg(assert_cmd::cargo::cargo_bin("skysweep")).args(arguments);
    command.output().unwrap()
}

#[track_caller]
fn refused(arguments: &[&str], expected: &str) {
    let run = bounded(arguments, "");
    let text = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!(run.status.code(), Some(2), "{arguments:?}: {text}");
    assert!(text.contains(expected), "{arguments:?}: {text}");
}

fn path(name: &str) -> String {
    sample(name).to_str().unwrap().to_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A CityJSON file of 5,000 instances of a template.
fn instances(boundaries: &str, semantics: &str) -> String {
    let matrix = "[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]";
    let instance = format!(
        "{{\"type\":\"GeometryInstance\",\"template\":0,\"boundaries\":[0],\"transformationMatrix\":{matrix}}}"
    );
    let objects: Vec<String> =
        (0..5000).map(|i| format!("\"t{i}\":{{\"type\":\"Building\",\"geometry\":[{instance}]}}")).collect();
    format!(
        "{{\"type\":\"CityJSON\",\"version\":\"2.0\",\"transform\":{{\"scale\":[1,1,1],\"translate\":[0,0,0]}},\
         \"metadata\":{{\"referenceSystem\":\"https://www.opengis.net/def/crs/EPSG/0/7415\"}},\
         \"geometry-templates\":{{\"vertices-templates\":[[0,0,0],[1,0,0],[0,1,0]],\
         \"templates\":[{{\"type\":\"MultiSurface\",\"lod\":\"2\",\"boundaries\":[{boundaries}],\
         \"semantics\":{semantics}}}]}},\"CityObjects\":{{{}}},\"vertices\":[[0,0,0]]}}",
        objects.join(",")
    )
}

/// A CityGML file of a building with `surfaces`, and other buildings.
fn gml(surfaces: &str, others: &str) -> String {
    format!(
        "<CityModel xmlns=\"http://www.opengis.net/citygml/2.0\" xmlns:gml=\"http://www.opengis.net/gml\" \
         xmlns:bldg=\"http://www.opengis.net/citygml/building/2.0\" xmlns:xlink=\"http://www.w3.org/1999/xlink\">\
         <cityObjectMember><bldg:Building gml:id=\"b\">{surfaces}</bldg:Building></cityObjectMember>{others}</CityModel>"
    )
}

fn gml_set(corners: &str, links: &str) -> String {
    format!(
        "<bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember><gml:Polygon gml:id=\"p\"><gml:exterior>\
         <gml:LinearRing><gml:posList srsDimension=\"3\">{corners}0 0 0</gml:posList></gml:LinearRing></gml:exterior>\
         </gml:Polygon></gml:surfaceMember>{links}</gml:MultiSurface></bldg:lod2MultiSurface>"
    )
}

/// Writes a small city model that repeats itself beyond measure, and expects its refusal.
#[track_caller]
fn is_refused_as_bomb(content: &str) {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("bomb"), folder.path().join("out.city.json"));
    std::fs::write(&file, content).unwrap();
    refused(&["city", "convert", text(&file), "-o", text(&out)], "repeats by reference");
    assert!(!out.exists());
}

/// 5,000 instances of a template of 20,000 triangles in about a megabyte.
#[test]
fn instances_of_a_large_template_are_refused() {
    is_refused_as_bomb(&instances(&vec!["[[0,1,2]]"; 20_000].join(","), "null"));
}

/// 20,000 links to one polygon of 10,000 corners.
#[test]
fn links_to_a_large_polygon_are_refused() {
    let corners: String = (0..10_000).map(|i| format!("{i} {} 0 ", i % 7)).collect();
    is_refused_as_bomb(&gml(&gml_set(&corners, &"<gml:surfaceMember xlink:href=\"#p\"/>".repeat(20_000)), ""));
}

/// 5,000 instances of, and links to, a surface with a megabyte of attributes.
#[test]
fn surfaces_with_large_attributes_are_refused_when_they_multiply() {
    let note = "x".repeat(1_000_000);
    let semantics = format!("{{\"surfaces\":[{{\"type\":\"RoofSurface\",\"note\":\"{note}\"}}],\"values\":[0]}}");
    is_refused_as_bomb(&instances("[[0,1,2]]", &semantics));
    let notes = format!("<bldg:note>{}</bldg:note>", "x".repeat(50_000)).repeat(20);
    let roof = format!(
        "<bldg:boundedBy><bldg:RoofSurface>{notes}{}</bldg:RoofSurface></bldg:boundedBy>",
        gml_set("0 0 0 4 0 0 0 4 0 ", "")
    );
    let other = "<cityObjectMember><bldg:Building><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember \
                 xlink:href=\"#p\"/></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></cityObjectMember>";
    is_refused_as_bomb(&gml(&roof, &other.repeat(5000)));
}

#[test]
fn settings_that_ask_for_terabytes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let (image, dsm, town) = (path("view_1.tif"), path("truth/dsm.tif"), path("truth/buildings.city.json"));
    refused(&["ortho", &image, "--dsm", &dsm, "--gsd", "1e-6", "-o", text(&out)], "cells");
    refused(&["ortho", &image, "--dsm", &dsm, "--gsd", "0.01", "-o", text(&out)], "choose a smaller area");
    refused(&["dsm", &image, &path("view_3.tif"), "--threads", "100000", "-o", text(&out)], "at most 1024");
    let cameras = path("cameras/sparse/0");
    let priors = ["priors", town.as_str(), "--cameras", &cameras, "-o", text(&out), "--geometric-error", "1e-9"];
    refused(&priors, "the limit is 100000000");
}

#[test]
fn pipes_and_devices_are_no_side_files() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success());
    let (dsm, out) = (path("truth/dsm.tif"), folder.path().join("out"));
    let names = ["/dev/zero", text(&pipe)];
    for name in &names[..if made { 2 } else { 1 }] {
        refused(&["heightmap", &dsm, "--positions", name, "-o", text(&out)], "");
        refused(&["eval", &dsm, name], "");
        refused(&["city", "info", name], "not a regular file");
        refused(&["rpc", "info", name], "");
    }
}

/// Standard error is for people: its loss is no reason to lose the result.
#[test]
fn a_lost_standard_error_does_not_stop_the_work() {
    let (first, second) = (path("view_1.tif"), path("view_3.tif"));
    for (redirections, progress) in [("2>&-", "bar"), ("2>/dev/full", "bar"), ("2>/dev/full", "json")] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let common = ["--gsd", "2", "--preset", "fast", "-v", "--progress", progress];
        let run = bounded(&[&["dsm", &first, &second, "-o", text(&out)], &common[..]].concat(), redirections);
        assert_eq!(run.status.code(), Some(0), "{redirections} {progress}");
        assert!(out.join("report/report.json").is_file());
    }
}

/// Forged plans that are computed and merged by the command, of those that are read, unless
/// `SKYSWEEP_FORGED=all`.
const COMPUTED: usize = 24;
/// Parts of a plan that are measured or asked for, and that nothing else in the plan tells.
const MEASURED: [&str; 6] =
    ["/plan/config", "/plan/radiometry", "/height_range", "/plan/step_m", "/plan/pixel_m", "/plan/report/pointing"];
/// Elements at both ends of an array that are forged.
const ENDS: usize = 1;

/// What one value of a plan may be replaced by, of which a third is tried for each value, unless
/// `SKYSWEEP_FORGED=all`.
fn forgeries_of(value: &Value) -> Vec<Value> {
    match value {
        Value::Number(number) => {
            let own = number.as_f64().unwrap();
            let others = [0.0, -1.0, 1e18, 1e-9, own + 0.5, -own, 2.0 * own, own + 1.0].into_iter();
            let numbers = others.map(|other| if number.is_f64() { json!(other) } else { json!(other as i128 as i64) });
            numbers.chain([Value::Null, json!(u64::MAX)]).filter(|other| other != value).collect()
        }
        Value::Array(all) => {
            let reversed: Vec<&Value> = all.iter().rev().collect();
            [json!([]), json!([&all[..], &all[..]].concat()), json!(reversed)]
                .into_iter()
                .filter(|v| v != value)
                .collect()
        }
        Value::String(text) => vec![json!(""), json!(format!("{text}/../x"))],
        Value::Bool(flag) => vec![json!(!flag)],
        Value::Null => vec![json!(0), json!([1e18, -1e18])],
        Value::Object(_) => vec![json!({})],
    }
}

/// Collects the place (a JSON pointer) and the new value of every forgery of a plan.
fn forge(value: &Value, place: &str, is_all: bool, found: &mut Vec<(String, Value)>) {
    let others = forgeries_of(value);
    let every = if is_all { 1 } else { 3 };
    let first = found.len() % every.min(others.len().max(1));
    found.extend(others.into_iter().skip(first).step_by(every).map(|other| (place.to_owned(), other)));
    match value {
        Value::Array(all) => {
            for (i, inner) in all.iter().enumerate().filter(|(i, _)| *i < ENDS || i + ENDS >= all.len()) {
                forge(inner, &format!("{place}/{i}"), is_all, found);
            }
        }
        Value::Object(all) => {
            all.iter().for_each(|(key, inner)| forge(inner, &format!("{place}/{key}"), is_all, found))
        }
        _ => {}
    }
}

/// Writes a forged plan with the identity, the estimate and the configuration that belong to it, as
/// one who knows the program would. One that is no plan any more is written as it is.
fn write_forged(folder: &Path, good: &Value, (place, other): &(String, Value)) {
    let mut forged = good.clone();
    *forged.pointer_mut(place).unwrap() = other.clone();
    if let Ok(mut file) = serde_json::from_value::<PlanFile>(forged.clone()) {
        if !place.starts_with("/estimate") {
            file.estimate = PlanEstimate::of(&file.plan);
        }
        // The identity does not hold what leaves the surface as it is.
        let mut plan = file.plan.clone();
        let plain = DsmConfig::new(Vec::new(), PathBuf::new());
        (plan.config.products, plan.config.threads) = (plain.products, plain.threads);
        (plan.config.tile, plan.config.overwrite) = (plain.tile, plain.overwrite);
        let inputs: Vec<_> = file.inputs.iter().map(|input| (&input.path, &input.sha256)).collect();
        let digest = Sha256::digest(serde_json::to_vec(&(inputs, &plan)).unwrap());
        if place != "/id" {
            file.id = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        }
        if let Ok(text) = toml::to_string_pretty(&file.plan.config) {
            std::fs::write(folder.join("used_config.toml"), text).unwrap();
        }
        forged = serde_json::to_value(&file).unwrap();
    }
    std::fs::write(folder.join("plan.json"), serde_json::to_vec_pretty(&forged).unwrap()).unwrap();
}

/// Computes and merges a plan with limited memory; returns the last exit code and what was told.
fn computed(folder: &Path) -> (i32, String) {
    for arguments in [&["run"][..], &["merge", "--overwrite"]] {
        let run = bounded(&[arguments, &[text(folder), "-q"]].concat(), "");
        let told = String::from_utf8_lossy(&run.stderr).into_owned();
        let code = run.status.code().unwrap_or(-1);
        if code != 0 {
            return (code, told);
        }
    }
    (0, String::new())
}

/// A plan is trusted by all that follows it. Every value of a small one is replaced in turn, and
/// the plan is signed anew.
#[test]
fn forged_plans_are_refused_or_computed_and_nothing_breaks() {
    let is_all = std::env::var("SKYSWEEP_FORGED").is_ok_and(|value| value == "all");
    let root = tempfile::tempdir().unwrap();
    let folder = |name: &str| root.path().join(name);
    let mut command = skysweep();
    command.arg("plan").args(["view_1.tif", "view_3.tif"].map(sample)).arg("-o").arg(folder("good"));
    command.args(["--bounds", "693812", "4822332", "694012", "4822632", "--gsd", "2", "--preset", "fast"]);
    command.args(["--chunk", "128", "-q"]).assert().code(0);
    assert_eq!(computed(&folder("good")), (0, String::new()));
    let surface = |folder: PathBuf| std::fs::read(folder.join("dsm/dsm.tif")).unwrap();
    let expected = surface(folder("good"));
    let good: Value = serde_json::from_slice(&std::fs::read(folder("good").join("plan.json")).unwrap()).unwrap();
    let mut forged = Vec::new();
    forge(&good, "", is_all, &mut forged);
    assert!(forged.len() >= 150, "{}", forged.len());
    let place = |i: usize| folder(&format!("forged_{i}"));
    // Whether the plan is read; an error for one that breaks the reader.
    let is_read = |i: usize| {
        std::fs::create_dir(place(i)).unwrap();
        write_forged(&place(i), &good, &forged[i]);
        let read = catch_unwind(AssertUnwindSafe(|| PlanFile::read(&place(i)).map(|file| file.text())));
        read.map_or_else(|_| Err(format!("{:?} breaks the reader", forged[i])), |read| Ok(read.is_ok()))
    };
    let read: Vec<Result<bool, String>> = (0..forged.len()).into_par_iter().map(is_read).collect();
    let mut broken: Vec<String> = read.iter().filter_map(|read| read.clone().err()).collect();
    let read: Vec<usize> = (0..forged.len()).filter(|i| read[*i] == Ok(true)).collect();
    let every = if is_all { 1 } else { read.len().div_ceil(COMPUTED).max(1) };
    let chosen: Vec<usize> = read.iter().copied().step_by(every).collect();
    let ended: Vec<(usize, i32, String)> = chosen
        .par_iter()
        .map(|&i| {
            let (code, told) = computed(&place(i));
            (i, code, told)
        })
        .collect();
    let is_whole = |code: i32, told: &str| {
        (0..=2).contains(&code) && !told.contains("panicked") && (code == 0 || told.contains("error: "))
    };
    broken.extend(
        ended.iter().filter(|(_, code, told)| !is_whole(*code, told)).map(|e| format!("{:?} {e:?}", forged[e.0])),
    );
    let is_other = |(i, code, _): &&(usize, i32, String)| *code == 0 && surface(place(*i)) != expected;
    let other: Vec<_> = ended.iter().filter(is_other).map(|(i, ..)| &forged[*i]).collect();
    let _ = writeln!(
        std::io::stderr(),
        "forged {}: refused when read {}; computed {}: refused {}, another surface {}: {other:?}",
        forged.len(),
        forged.len() - read.len() - broken.len(),
        ended.len(),
        ended.iter().filter(|(_, code, _)| *code != 0).count(),
        other.len(),
    );
    assert!(broken.is_empty(), "{broken:#?}");
    // Whoever changes what nothing else in the plan tells asks for another surface.
    let is_measured = |place: &str| MEASURED.iter().any(|part| place.contains(part));
    assert!(other.iter().all(|(place, _)| is_measured(place)), "{other:?}");
}
