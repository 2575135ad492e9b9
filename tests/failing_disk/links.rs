//! Links and files of the user in the folders of every command that writes: nothing outside the
//! output folder changes, the user's files stay as they are, and the command either makes all of
//! its results or refuses and names what it found.

use std::collections::BTreeMap;
use std::os::unix::fs::symlink;
use std::path::Path;

use tempfile::TempDir;

use crate::commands::{COMMANDS, Ended, Writing, copy, prepare, run, snapshot};

/// Name of a file that no command writes, and its content.
const FOREIGN: (&str, &[u8]) = ("my_notes.txt", b"a user's notes");

/// A command in a folder of its own, with a folder outside that must not change.
struct Trial {
    root: TempDir,
    before: BTreeMap<String, Vec<u8>>,
}

impl Trial {
    /// Begins from a copy of a folder.
    fn from(state: &Path) -> Self {
        let root = tempfile::tempdir().unwrap();
        copy(state, &root.path().join("work"));
        std::fs::create_dir(root.path().join("outside")).unwrap();
        std::fs::write(root.path().join("outside/canary"), b"outside").unwrap();
        Self { root, before: BTreeMap::new() }
    }

    /// Puts a link to the folder outside into the place of a folder, whose content moves there.
    fn link(&mut self, name: &str) {
        let (path, outside) = (self.root.path().join("work").join(name), self.root.path().join("outside"));
        if path.is_dir() {
            std::fs::remove_file(outside.join("canary")).unwrap();
            std::fs::remove_dir(&outside).unwrap();
            std::fs::rename(&path, &outside).unwrap();
            std::fs::write(outside.join("canary"), b"outside").unwrap();
        }
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        symlink(&outside, path).unwrap();
    }

    fn note(&self, folder: &str) {
        let folder = self.root.path().join("work").join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(FOREIGN.0), FOREIGN.1).unwrap();
    }

    /// Runs the command, and checks that nothing outside changed.
    fn run(&mut self, of: &Writing, overwrite: &str) -> Ended {
        let outside = self.root.path().join("outside");
        self.before = snapshot(&outside);
        let ended = run(&self.root.path().join("work"), of.command, overwrite);
        let name = of.name;
        assert!(snapshot(&outside) == self.before, "{name} {overwrite} changed files outside: {}", ended.told);
        ended
    }

    /// Checks that what the command makes is there, or that the refusal names one of `planted`.
    fn check(&self, of: &Writing, ended: &Ended, made: &BTreeMap<String, Vec<u8>>, planted: &[&str], case: &str) {
        // A command that takes only new folders says so before it looks further.
        let taken = ["exists already", "is not empty", "holds views already"];
        // The reasons of a batch are in its report.
        let report = self.root.path().join("work/out/batch_report.json");
        let told = format!("{} {}", ended.told, std::fs::read_to_string(report).unwrap_or_default());
        let is_named = planted.iter().chain(&taken).any(|name| told.contains(name));
        match ended.code {
            0 => {
                let found = snapshot(&self.root.path().join("work"));
                let lost: Vec<_> = made.keys().filter(|name| !found.contains_key(*name)).collect();
                assert!(lost.is_empty(), "{}, {case}: exit code 0 without {lost:?}", of.name);
            }
            // Parts of a batch or of a list are refused one by one.
            1 | 2 => assert!(is_named, "{}, {case}: nothing is named: {told}", of.name),
            code => panic!("{}, {case}: exit code {code}: {}", of.name, ended.told),
        }
    }
}

/// Whether each link is tried in every state of the output: `SKYSWEEP_LINKS=all`, which takes four
/// minutes. Otherwise the states take turns.
fn is_whole() -> bool {
    std::env::var("SKYSWEEP_LINKS").is_ok_and(|value| value == "all")
}

/// Tries links and files of the user in all places of a command's outputs.
fn check(of: &Writing) {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [begin, end] = folders.each_ref().map(|folder| folder.path().join("work"));
    std::fs::create_dir(&begin).unwrap();
    prepare(&begin, of);
    copy(&begin, &end);
    let (before, ended) = (snapshot(&begin), run(&end, of.command, ""));
    assert_eq!(ended.code, 0, "{}: {}", of.name, ended.told);
    let whole = snapshot(&end);
    let is_written = |(name, bytes): &(&String, &Vec<u8>)| before.get(*name) != Some(bytes);
    let files: Vec<&str> =
        whole.iter().filter(is_written).map(|(name, _)| name.as_str()).filter(|name| !name.ends_with('/')).collect();
    assert!(!files.is_empty(), "{} writes nothing", of.name);
    // What a link hides and the command did not make is not the command's to make again.
    let made: BTreeMap<String, Vec<u8>> = whole
        .iter()
        .filter(|(name, _)| !before.contains_key(*name))
        .map(|(name, b)| (name.clone(), b.clone()))
        .collect();
    // The user names the first folder, and the command those below.
    let written = |folder: &str| files.iter().any(|file| file.starts_with(folder));
    let folders: Vec<&str> = whole.keys().filter_map(|name| name.strip_suffix('/')).collect();
    let folders: Vec<&str> =
        folders.into_iter().filter(|folder| folder.contains('/') && written(&format!("{folder}/"))).collect();

    let states = [(&begin, ""), (&begin, of.overwrite), (&end, of.overwrite)];
    for (number, folder) in folders.iter().enumerate() {
        let tried = if is_whole() { &states[..] } else { &states[number % states.len()..][..1] };
        for &(state, options) in tried {
            let mut trial = Trial::from(state);
            trial.link(folder);
            let ended = trial.run(of, options);
            let link = trial.root.path().join("work").join(folder);
            assert!(link.is_symlink() || ended.code == 0, "{} replaced the link {folder}", of.name);
            let name = folder.rsplit('/').next().unwrap();
            trial.check(of, &ended, &made, &[name], &format!("{options}, a link in the place of {folder}"));
        }
    }
    for &(state, options) in if is_whole() { &states[..] } else { &states[1..] } {
        let mut trial = Trial::from(state);
        folders.iter().for_each(|folder| trial.note(folder));
        let ended = trial.run(of, options);
        for folder in &folders {
            let note = trial.root.path().join("work").join(folder).join(FOREIGN.0);
            let found = std::fs::read(&note).unwrap_or_default();
            assert!(found == FOREIGN.1, "{} {options}: {folder}/{} is lost", of.name, FOREIGN.0);
        }
        let planted: Vec<&str> = folders.iter().map(|folder| folder.rsplit('/').next().unwrap()).collect();
        trial.check(of, &ended, &made, &[&planted[..], &[FOREIGN.0]].concat(), &format!("{options}, notes"));
    }
    for options in ["", of.overwrite].into_iter().skip(usize::from(!is_whole())) {
        let mut trial = Trial::from(&begin);
        for file in files.iter().filter(|file| !before.contains_key(**file)) {
            let path = trial.root.path().join("work").join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            symlink(trial.root.path().join("outside/canary"), path).unwrap();
        }
        let ended = trial.run(of, options);
        let names: Vec<&str> = files.iter().map(|file| file.rsplit('/').next().unwrap()).collect();
        trial.check(of, &ended, &made, &names, &format!("{options}, links in the place of files"));
    }
    // Without any of this, results are replaced by the same ones.
    let again = Trial::from(&end).run(of, of.overwrite);
    assert_eq!(again.code, 0, "{} over its own results: {}", of.name, again.told);
}

/// Checks every second command, so that two tests share the work.
fn check_half(odd: bool) {
    let commands = COMMANDS.iter().enumerate().filter(|(number, _)| (number % 2 == 1) == odd);
    // All commands are told that fail, and not the first alone.
    let failed = commands.filter(|(_, of)| std::panic::catch_unwind(|| check(of)).is_err()).map(|(_, of)| of.name);
    let failed: Vec<&str> = failed.collect();
    assert!(failed.is_empty(), "failed: {failed:?}");
}

#[test]
fn links_and_foreign_files_stay_as_they_are() {
    check_half(false);
}

#[test]
fn links_and_foreign_files_stay_as_they_are_in_the_other_half() {
    check_half(true);
}
