//! Completion scripts and manual pages of the command line.

use assert_cmd::Command;

fn output_of(arguments: &[&str]) -> String {
    let assert = Command::cargo_bin("skysweep").expect("the command is built").args(arguments).assert().success();
    String::from_utf8_lossy(&assert.get_output().stdout).into_owned()
}

#[test]
fn every_shell_gets_a_script_that_knows_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = output_of(&["completions", shell]);
        assert!(script.contains("heightmap") && script.contains("preset"), "{shell}");
    }
}

#[test]
fn manual_pages_describe_a_command_and_its_subcommands() {
    assert!(output_of(&["man"]).contains(".TH skysweep"));
    assert!(output_of(&["man", "dsm"]).contains("height\\-range"));
    assert!(output_of(&["man", "splats", "render"]).contains("render"));
    let refused =
        Command::cargo_bin("skysweep").expect("the command is built").args(["man", "nothing"]).assert().code(2);
    let told = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(told.contains("'nothing'") && told.contains("dsm"), "{told}");
    // The names that the pages have in their titles and in the references of other pages.
    let page = output_of(&["man", "splats", "render"]);
    for name in ["splats-render", "skysweep-splats-render"] {
        assert_eq!(output_of(&["man", name]), page, "{name}");
    }
    assert_eq!(output_of(&["man", "skysweep-dsm"]), output_of(&["man", "dsm"]));
}

/// What is mistyped is answered with the nearest name: commands, options, values, pages, presets of
/// scenes and values of job files.
#[test]
fn slips_are_answered_with_the_nearest_name() {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.toml");
    std::fs::write(&job, "images = []\noutput = 'out'\npreset = 'acurate'\n").unwrap();
    let job = job.to_string_lossy().into_owned();
    let slips: [(&[&str], &str); 8] = [
        (&["dsmm"], "dsm"),
        (&["rpc", "infoo"], "info"),
        (&["dsm", "a.tif", "b.tif", "-o", "out", "--presett", "fast"], "--preset"),
        (&["dsm", "a.tif", "b.tif", "-o", "out", "--preset", "acurate"], "accurate"),
        (&["products", "run", "--only", "cloud,contour"], "contours"),
        (&["man", "ortoh"], "did you mean 'ortho'?"),
        (&["simulate", "twon", "-o", "out"], "did you mean town?"),
        (&["dsm", &job], "did you mean `accurate`?"),
    ];
    for (words, meant) in slips {
        let refused = Command::cargo_bin("skysweep").unwrap().args(words).current_dir(folder.path()).assert().code(2);
        let told = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        let is_suggested = told.contains(&format!("'{meant}'")) || told.contains(meant) && meant.contains(' ');
        assert!(is_suggested && !folder.path().join("out").exists(), "{words:?}: {told}");
    }
}

#[test]
fn quiet_commands_print_errors_only() {
    let town = concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town");
    let (view, truth) = (format!("{town}/view_1.tif"), format!("{town}/truth/dsm.tif"));
    let other = format!("{town}/view_2.tif");
    let city = format!("{town}/truth/buildings.city.json");
    let commands: [&[&str]; 4] = [
        &["rpc", "info", &view],
        &["eval", &truth, &truth, "--no-report"],
        &["city", "info", &city],
        &["dsm", &view, &other, "--gsd", "2", "--preset", "fast", "--dry-run", "-o", "never"],
    ];
    for words in commands {
        let printed = output_of(&[words, &["-q"]].concat());
        assert_eq!(printed, "", "{words:?}");
        if words[0] != "rpc" {
            assert!(output_of(&[words, &["-q", "--json"]].concat()).starts_with('{'), "{words:?}");
        }
    }
}

/// Commands with options, as words of the command line.
const COMMANDS: [&[&str]; 36] = [
    &["align"],
    &["batch"],
    &["buildings"],
    &["city", "info"],
    &["city", "convert"],
    &["classes"],
    &["diff"],
    &["dsm"],
    &["eval"],
    &["groundview"],
    &["groundview", "compose"],
    &["heightmap"],
    &["heightmap", "unproject"],
    &["merge"],
    &["mesh"],
    &["ortho"],
    &["plan"],
    &["priors"],
    &["products"],
    &["register"],
    &["rpc", "info"],
    &["rpc", "project"],
    &["rpc", "localize"],
    &["rpc", "convert"],
    &["rpc", "export"],
    &["run"],
    &["selftest"],
    &["simulate"],
    &["splats"],
    &["splats", "render"],
    &["train"],
    &["split"],
    &["template"],
    &["tiles"],
    &["view"],
    &["completions"],
];

/// Options of a help page: their group, their first line, and their text.
fn options_of(command: &[&str]) -> Vec<(String, String, String)> {
    let (mut group, mut found) = (String::new(), Vec::new());
    for line in output_of(&[command, &["--help"]].concat()).lines() {
        let text = line.trim().to_owned();
        if !line.starts_with(' ') && line.ends_with(':') {
            group = text;
        } else if line.starts_with("  ")
            && text.starts_with('-')
            && text.contains("--")
            && !line.starts_with("        ")
        {
            found.push((group.clone(), text, String::new()));
        } else if let Some((_, _, about)) = found.last_mut() {
            *about += &text;
            *about += " ";
        }
    }
    found
}

/// Who reads only the usage line knows the unit.
#[test]
fn lengths_name_metres_in_their_values() {
    let mut seen = 0;
    for command in COMMANDS {
        for (_, option, about) in options_of(command) {
            let is_length = about.to_lowercase().contains("metres") && option.contains('<');
            let other = ["X_MIN", "LO", "DATUM", "CRS", "FILE", "OUT", "auto|S|none"];
            if is_length && !other.iter().any(|name| option.contains(name)) && !option.contains("<PX/M>") {
                assert!(option.contains("<METRES>"), "{command:?}: {option}: {about}");
                seen += 1;
            }
        }
    }
    assert!(seen > 20, "{seen}");
}

/// `--crs` and `--vertical` say what is written. What is known of an input names the input.
#[test]
fn one_option_has_one_meaning() {
    let with = |name: &str| -> Vec<String> {
        let has = |command: &&&[&str]| {
            options_of(command).iter().any(|(_, option, _)| option.split_whitespace().any(|word| word == name))
        };
        COMMANDS.iter().filter(has).map(|command| command.join(" ")).collect()
    };
    assert_eq!(with("--vertical"), ["dsm", "plan"]);
    assert_eq!(with("--crs"), ["align", "dsm", "heightmap", "plan", "tiles"]);
    assert_eq!(with("--dsm-vertical"), ["buildings", "ortho", "register", "splats"]);
    for (command, old) in [("splats", "--vertical"), ("groundview", "--vertical"), ("align", "--vertical")] {
        let told = Command::cargo_bin("skysweep").unwrap().args([command, old, "none"]).assert().code(2);
        let told = String::from_utf8_lossy(&told.get_output().stderr).into_owned();
        assert!(told.contains("invalid value"), "the old name still works: {told}");
    }
}

#[test]
fn options_are_in_groups() {
    let group = |command: &[&str], name: &str| {
        let found = options_of(command).into_iter().find(|(_, option, _)| option.contains(name));
        found.unwrap_or_else(|| panic!("{command:?} has no {name}")).0
    };
    for command in COMMANDS {
        assert_eq!([group(command, "--quiet"), group(command, "--verbose")], ["Messages:", "Messages:"]);
    }
    for command in [&["dsm"][..], &["ortho"], &["splats", "render"]] {
        assert_eq!(group(command, "--overwrite"), "Output:");
    }
    assert_eq!(group(&["dsm"], "--memory"), "Run:");
    assert_eq!(group(&["eval"], "--max-mae"), "Requirements (exit code 1 when missed):");
    assert_eq!(group(&["eval"], "--voxel"), "Surfaces (meshes, city models, clouds):");
}

/// The cells of our grids are square.
#[test]
fn sizes_of_gdal_must_be_equal() {
    let refused = |arguments: &[&str]| {
        let told = Command::cargo_bin("skysweep").unwrap().args(arguments).assert().code(2);
        String::from_utf8_lossy(&told.get_output().stderr).into_owned()
    };
    let inputs = ["ortho", "none.tif", "--dsm", "none.tif", "-o", "never.tif"];
    let told = refused(&[&inputs[..], &["-tr", "0.5", "0.25"]].concat());
    assert!(told.contains("square") && told.contains("-tr"), "{told}");
    assert!(refused(&[&inputs[..], &["-tr", "0.5", "0.5"]].concat()).contains("none.tif"));
    // A command without the option does not know GDAL's name for it either.
    assert!(refused(&["split", "model", "-t_srs", "EPSG:32631"]).contains("unexpected argument '-t'"));
}
