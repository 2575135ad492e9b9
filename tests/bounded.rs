//! Memory and time are bounded whatever the input says: files that repeat themselves by reference,
//! settings that ask for terabytes, devices and pipes, and a standard error that is closed.
//!
//! The commands run with a limit on their address space, so that a command that takes the memory
//! fails here and not on the machine.

#![cfg(unix)]

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::sample;

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
