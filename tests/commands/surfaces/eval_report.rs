//! The report of `skysweep eval`: where it goes, what it never replaces, and that a browser shows
//! it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use raster::{GeoTransform, Grid};
use serde_json::Value;
use tempfile::TempDir;

/// A slope with two blocks; the test is a little higher and lacks a corner.
fn surface(i: usize, test: bool) -> f32 {
    let (column, row) = (i % 120, i / 120);
    let block = (20..50).contains(&column) && (30..70).contains(&row) || (70..100).contains(&column) && row > 60;
    if test && column < 9 && row < 9 {
        return f32::NAN;
    }
    30.0 + 0.03 * column as f32 + if block { 9.0 } else { 0.0 } + if test { 0.2 * (i % 7) as f32 } else { 0.0 }
}

fn write(path: &Path, test: bool) {
    let heights = Grid::from_vec(120, 100, (0..12_000).map(|i| surface(i, test)).collect()).unwrap();
    let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
    let geotransform = GeoTransform::north_up(436_078.0, 3_357_752.0, 0.5);
    write_cog(path, &CogRaster::new(&bands, geotransform, Crs::ellipsoidal(32617)), false).unwrap();
}

/// The folder of a run as `skysweep dsm` leaves it, and a reference.
fn run_folder() -> (TempDir, PathBuf, PathBuf) {
    let folder = TempDir::new().unwrap();
    let run = folder.path().join("run");
    for part in ["dsm", "report"] {
        fs::create_dir_all(run.join(part)).unwrap();
    }
    fs::write(run.join("report/report.json"), "{}").unwrap();
    fs::write(run.join("used_config.toml"), "").unwrap();
    write(&run.join("dsm/dsm.tif"), true);
    let reference = folder.path().join("reference.tif");
    write(&reference, false);
    (folder, run, reference)
}

fn skysweep(arguments: &[&str], test: &Path, reference: &Path) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("skysweep").unwrap();
    command.arg("eval").args([test, reference]).args(["--align", "none"]).args(arguments).assert()
}

#[test]
fn a_surface_in_the_folder_of_a_run_has_its_report_there() {
    let (_folder, run, reference) = run_folder();
    let dsm = run.join("dsm/dsm.tif");
    skysweep(&[], &dsm, &reference).success().stdout(contains("eval/report.html"));
    let page = fs::read_to_string(run.join("eval/report.html")).unwrap();
    assert!(page.contains("run/dsm/dsm.tif") && !page.contains("<script") && !page.contains("://"));
    assert!(read_dem(run.join("eval/error_map.tif")).unwrap().heights[(50, 50)].is_finite());
    assert!(["error_map.pgw", "error_map.qml"].iter().all(|name| run.join("eval").join(name).is_file()));
    let shown = skysweep(&["--json"], &dsm, &reference).success().get_output().stdout.clone();
    let kept = fs::read(run.join("eval/report.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&shown).unwrap(), serde_json::from_slice::<Value>(&kept).unwrap());
    fs::remove_dir_all(run.join("eval")).unwrap();
    skysweep(&["--no-report"], &dsm, &reference).success();
    assert!(!run.join("eval").exists());
}

/// What the README says in three commands: the folder that `dsm` leaves is one that `eval` knows.
#[test]
fn images_to_surface_to_report_in_three_commands() {
    let folder = TempDir::new().unwrap();
    let (scene, run) = (folder.path().join("s"), folder.path().join("d"));
    let skysweep = |arguments: &[&str]| Command::cargo_bin("skysweep").unwrap().args(arguments).assert().success();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    skysweep(&["simulate", "town", "--size", "90", "--views", "2", "-q", "-o", &text(&scene)]);
    let views = ["view_1.tif", "view_2.tif"].map(|name| text(&scene.join(name)));
    skysweep(&["dsm", &views[0], &views[1], "-q", "--progress", "none", "-o", &text(&run)]);
    let shown = skysweep(&["eval", &text(&run.join("dsm/dsm.tif")), &text(&scene.join("truth/dsm.tif"))]);
    shown.stdout(contains("d/eval/report.html"));
    let page = fs::read_to_string(run.join("eval/report.html")).unwrap();
    assert!(page.contains("mean absolute error") && page.matches("data:image/png").count() == 3);
}

#[test]
fn any_other_surface_is_only_printed_until_a_folder_is_named() {
    let (folder, _run, reference) = run_folder();
    let test = folder.path().join("test.tif");
    write(&test, true);
    let before = fs::read_dir(folder.path()).unwrap().count();
    skysweep(&[], &test, &reference).success().stdout(contains("-o DIR"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before);
    let out = folder.path().join("deep/out");
    skysweep(&["-o", out.to_str().unwrap()], &test, &reference).success();
    for name in ["report.html", "report.json", "error_map.tif", "error_map.png"] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let page = folder.path().join("page.html");
    skysweep(&["--html", page.to_str().unwrap()], &test, &reference).success().stdout(contains("page.html"));
    assert_eq!(fs::read(&page).unwrap(), fs::read(out.join("report.html")).unwrap());
    skysweep(&["--html", page.to_str().unwrap()], &test, &reference).code(2).stderr(contains("--overwrite"));
}

#[test]
fn what_no_evaluation_wrote_is_never_replaced_unasked() {
    let (folder, run, reference) = run_folder();
    let dsm = run.join("dsm/dsm.tif");
    fs::create_dir(run.join("eval")).unwrap();
    let mine = run.join("eval/report.html");
    fs::write(&mine, "mine").unwrap();
    // Nobody asked for the report, so the numbers are shown and the reason is told.
    skysweep(&[], &dsm, &reference).success().stderr(contains("no report").and(contains("report.html")));
    assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
    let out = run.join("eval");
    skysweep(&["-o", out.to_str().unwrap()], &dsm, &reference).code(2).stderr(contains("--overwrite"));
    skysweep(&["-o", out.to_str().unwrap(), "--overwrite"], &dsm, &reference).success();
    skysweep(&["-o", out.to_str().unwrap()], &dsm, &reference).success();
    assert_ne!(fs::read_to_string(&mine).unwrap(), "mine");
    let blocked = folder.path().join("reference.tif/inside");
    skysweep(&["-o", blocked.to_str().unwrap()], &dsm, &reference).code(2);
}

/// A Chromium on this machine: the one that the variable CHROMIUM names, else a usual name on the
/// path.
fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let usual = std::env::split_paths(&folders).flat_map(|folder| names.map(|name| folder.join(name)));
    named.into_iter().chain(usual).find(|path| path.is_file())
}

fn shown(browser: &Path, profile: &Path, page: &Path) -> Output {
    let url = format!("file://{}", page.display());
    std::process::Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--enable-logging=stderr",
            "--v=0",
        ])
        .args(["--timeout=60000", "--virtual-time-budget=3000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(url)
        .output()
        .unwrap()
}

#[test]
fn a_browser_shows_the_page_with_its_pictures_and_without_complaint() {
    let Some(browser) = chromium() else {
        testing::skip("Chromium is not installed (the variable CHROMIUM may name one)");
        return;
    };
    let (folder, run, reference) = run_folder();
    skysweep(&[], &run.join("dsm/dsm.tif"), &reference).success();
    let page = run.join("eval/report.html");
    let (first, second) = (folder.path().join("profile_1"), folder.path().join("profile_2"));
    let plain = shown(&browser, &first, &page);
    let log = String::from_utf8_lossy(&plain.stderr).into_owned();
    assert!(plain.status.success() && !log.contains("CONSOLE"), "{log}");
    assert!(String::from_utf8_lossy(&plain.stdout).contains("mean absolute error"));
    // The page allows no script: a copy that does counts what the browser made of it.
    let text = fs::read_to_string(&page).unwrap();
    let policy = text.lines().find(|line| line.contains("Content-Security-Policy")).unwrap();
    let probe = "<script>document.title = 'widths ' + [...document.images].map(i => i.naturalWidth).join(' ') + ' \
    charts ' + \
                 [...document.querySelectorAll('svg.chart')].filter(s => s.getBoundingClientRect().height > \
                 50).length + ' over ' + \
                 (document.documentElement.scrollWidth - document.documentElement.clientWidth);</script></body>";
    let probed = folder.path().join("probed.html");
    fs::write(&probed, text.replace(policy, "").replace("</body>", probe)).unwrap();
    let found = String::from_utf8_lossy(&shown(&browser, &second, &probed).stdout).into_owned();
    let title = found.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next()).unwrap_or_default();
    assert_eq!(title, "widths 120 120 120 charts 4 over 0");
}
