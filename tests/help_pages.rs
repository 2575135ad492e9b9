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
}
