//! `skysweep view` as a command: the printed address answers, the viewer ends after its time, and
//! bad inputs are refused.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::common::skysweep;
use predicates::prelude::*;

fn surface() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town/truth/dsm.tif")
}

#[test]
fn the_printed_address_answers_until_the_time_is_over() {
    let mut viewer = Command::new(assert_cmd::cargo::cargo_bin("skysweep"))
        .args(["view", "--for", "2", "--progress", "none"])
        .arg(surface())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut out = BufReader::new(viewer.stdout.take().unwrap());
    let mut url = String::new();
    out.read_line(&mut url).unwrap();
    let (host, path) = url.trim_end().strip_prefix("http://").unwrap().split_once('/').unwrap();
    assert!(host.starts_with("127.0.0.1:") && path.len() == 33, "{url}");
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let mut page = String::new();
    stream.read_to_string(&mut page).unwrap();
    assert!(page.starts_with("HTTP/1.1 200 ") && page.contains("skysweep view"), "{page}");
    assert_eq!(viewer.wait().unwrap().code(), Some(0));
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert!(rest.contains("1 answered, 0 refused, 0 failed"), "{rest}");
}

#[test]
fn the_report_is_json_alone() {
    let run = skysweep().args(["view", "--for", "0.1", "--json"]).arg(surface()).assert().code(0);
    let output = run.stderr(predicate::str::contains("http://127.0.0.1:")).get_output().stdout.clone();
    let report: serde_json::Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(report["layers"], serde_json::json!(["Heights", "Hillshade"]));
}

#[test]
fn bad_inputs_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], input: &Path, reason: &str| {
        let mut command = skysweep();
        command.arg("view").args(arguments).arg(input);
        command.assert().code(2).stderr(predicate::str::contains(reason));
    };
    refused(&[], folder.path(), "found no GeoTIFF to show");
    refused(&[], &folder.path().join("nothing.tif"), "nothing.tif");
    refused(&["--for", "0"], &surface(), "time of the viewer is 0");
    refused(&["--port", "0"], &surface(), "--port");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    refused(&["--port", &port], &surface(), "leave --port out");
}
