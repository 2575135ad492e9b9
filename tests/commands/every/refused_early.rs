//! What cannot work is refused before the computation, with the name of what is wrong: output
//! folders, coordinate reference systems, and surfaces with no-data values as heights.

use std::ffi::{OsStr, OsString};
use std::path::Path;

use crate::common::{band, sample, skysweep};
use assert_cmd::Command;
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
use predicates::prelude::*;

/// Runs a command that must fail with exit code 2, and returns its standard error.
fn refused(mut command: Command) -> String {
    let output = command.assert().code(2).get_output().clone();
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the commands that write a folder, with inputs that do not exist wherever possible: they
/// are not read before the folder is checked.
fn commands_of_folders(output: &Path) -> Vec<Command> {
    let cases: [(&[&str], &str); 8] = [
        (&["dsm", "no_1.tif", "no_2.tif"], "-o"),
        (&["simulate", "town", "--size", "100", "--overwrite"], "-o"),
        (&["priors", "no.city.json", "--cameras", "no.tif"], "-o"),
        (&["groundview", "no.tif", "--center", "5.4", "43.53"], "-o"),
        (&["heightmap", "no.tif", "--positions", "no.csv"], "-o"),
        (&["align", "no_model", "--positions", "no.csv"], "-o"),
        (&["splats", "render", "no.ply", "no_1.tif"], "-o"),
        (&["splats", "no.tif", "no_1.tif", "-o", "no.ply"], "--render"),
    ];
    let make = |(arguments, option): (&[&str], &str)| {
        let mut command = skysweep();
        command.args(arguments).arg(option).arg(output);
        command
    };
    cases.into_iter().map(make).collect()
}

/// A file in the place of the folder, a folder in which nobody can write, and a name that is not
/// UTF-8 are found before the inputs are.
#[cfg(target_os = "linux")]
#[test]
fn an_output_folder_that_cannot_take_results_is_refused_first() {
    use std::os::unix::ffi::OsStrExt;
    let root = tempfile::tempdir().unwrap();
    let file = root.path().join("taken");
    std::fs::write(&file, b"mine").unwrap();
    let strange = root.path().join(OsStr::from_bytes(b"caf\xe9"));
    let places: [(OsString, &str); 3] =
        [(file.clone().into(), "taken"), ("/proc/self".into(), "/proc/self"), (strange.into(), "not UTF-8")];
    for (output, named) in &places {
        for command in commands_of_folders(Path::new(output)) {
            let shown = format!("{command:?}");
            let error = refused(command);
            assert!(error.contains(named), "{shown}: {error}");
        }
    }
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
}

/// A missing folder, a folder in the place of the file, and a folder in which nobody can write are
/// found before the inputs are, which do not exist.
#[cfg(target_os = "linux")]
#[test]
fn an_output_file_that_cannot_be_written_is_refused_first() {
    let root = tempfile::tempdir().unwrap();
    let missing = root.path().join("missing");
    let commands: [(&[&str], &str); 7] = [
        (&["ortho", "no.tif", "--dsm", "no_dsm.tif"], "-o"),
        (&["heightmap", "no.tif", "--center", "5.4", "43.53"], "-o"),
        (&["splats", "no.tif", "no_1.tif"], "-o"),
        (&["city", "convert", "no.city.json", "--format", "obj"], "-o"),
        (&["eval", "no_1.tif", "no_2.tif", "--no-report"], "--error-map"),
        (&["eval", "no_1.tif", "no_2.tif", "--no-report"], "--html"),
        (&["split", "no_model"], "-o"),
    ];
    let taken = tempfile::Builder::new().suffix(".ply").tempdir().unwrap();
    for (arguments, option) in commands {
        // The ending of a file of splats says its format.
        let file = if arguments[0] == "splats" { "out.ply" } else { "out.tif" };
        let unwritable = format!("/proc/self/{file}");
        for (place, named) in [
            (missing.join(file), "folder does not exist"),
            (taken.path().to_owned(), "a folder has this name"),
            (unwritable.clone().into(), unwritable.as_str()),
        ] {
            let mut command = skysweep();
            // Without it the folder would be refused as an output that exists already.
            command.args(arguments).arg("--overwrite").arg(option).arg(&place);
            let error = refused(command);
            assert!(error.contains(named), "{arguments:?}: {error}");
        }
    }
    assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0);
    assert_eq!(std::fs::read_dir(taken.path()).unwrap().count(), 0);
}

/// A DSM is on a map, near the place of the CRS, and above a vertical datum.
#[test]
fn systems_of_another_kind_or_place_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let images = ["view_1.tif", "view_3.tif"].map(sample);
    for (option, code, expected) in [
        ("--crs", "EPSG:4978", "geocentric"),
        ("--crs", "EPSG:5773", "vertical"),
        ("--crs", "EPSG:32731", "--force"),
        ("--crs", "EPSG:32640", "--force"),
        ("--vertical", "EPSG:32631", "UTM zone 31N"),
        ("--vertical", "EPSG:4979", "vertical datum"),
    ] {
        let mut command = skysweep();
        command.arg("dsm").args(&images).args(["-q", option, code, "-o"]).arg(&out);
        let error = refused(command);
        assert!(error.contains(code) && error.contains(expected), "{code}: {error}");
        assert!(!out.exists(), "{code}");
    }
}

/// A surface whose voids hold −9999 without a declaration would give errors of kilometres.
#[test]
fn a_surface_with_an_undeclared_no_data_value_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("undeclared.tif");
    let truth = sample("truth/dsm.tif");
    let dem = read_dem(&truth).unwrap();
    let mut heights = band(&truth, 1);
    (0..50).for_each(|column| heights[(column, 20)] = -9999.0);
    let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
    let surface = CogRaster { no_data: None, ..CogRaster::new(&bands, dem.geotransform, Crs::ellipsoidal(32631)) };
    write_cog(&path, &surface, false).unwrap();
    let [out, splats] = ["out.tif", "out.ply"].map(|name| folder.path().join(name));
    let image = sample("view_1.tif");
    let cases: [(&str, Vec<&OsStr>); 5] = [
        ("eval", vec![path.as_os_str(), truth.as_os_str()]),
        ("eval", vec![truth.as_os_str(), path.as_os_str()]),
        ("ortho", vec!["--dsm".as_ref(), path.as_os_str(), image.as_os_str(), "-o".as_ref(), out.as_os_str()]),
        ("splats", vec![path.as_os_str(), image.as_os_str(), "-o".as_ref(), splats.as_os_str()]),
        (
            "heightmap",
            vec![
                path.as_os_str(),
                "--center".as_ref(),
                "5.4".as_ref(),
                "43.53".as_ref(),
                "-o".as_ref(),
                out.as_os_str(),
            ],
        ),
    ];
    for (name, arguments) in cases {
        let mut command = skysweep();
        let refused = command.arg(name).args(arguments).assert().code(2);
        refused.stderr(
            predicate::str::contains("50 cells have exactly the value -9999")
                .and(predicate::str::contains("undeclared.tif")),
        );
        assert!(!out.exists(), "{name}");
    }
}
