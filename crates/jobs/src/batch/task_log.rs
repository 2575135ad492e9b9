//! The log of a task: its progress as lines of JSON in a file of its own.

use std::fs::File;
use std::io::{Error, ErrorKind, Write};
use std::path::Path;
use std::sync::Mutex;

use numeric::{Choice, Progress};

use job::event_lines::EventLines;

/// Writes the progress of a task to its log, shows its stage to the watcher of the batch, and
/// passes on the wish to stop.
pub(super) struct TaskLog<'a, W> {
    lines: EventLines<W>,
    scene: &'a str,
    task: &'a str,
    /// The current stage with the number of its steps, done and in all.
    stage: Mutex<(String, usize, usize)>,
    /// Warnings since they were last taken.
    warnings: Mutex<Vec<String>>,
    batch: &'a dyn Progress,
}

/// Opens the log of a task of a scene in `folder`. Lines are added to its end; a link in its place
/// is replaced.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidInput`] where something else than a file has its name.
pub(super) fn open<'a>(
    folder: &Path,
    (scene, task): (&'a str, &'a str),
    batch: &'a dyn Progress,
) -> std::io::Result<TaskLog<'a, impl Fn(&str) + Sync + use<>>> {
    let path = folder.join(format!("{task}.jsonl"));
    match path.symlink_metadata() {
        Ok(found) if found.is_symlink() => std::fs::remove_file(&path)?,
        Ok(found) if !found.is_file() => {
            return Err(Error::new(ErrorKind::InvalidInput, format!("{} is no file", path.display())));
        }
        _ => {}
    }
    let file = File::options().create(true).append(true).open(path)?;
    // A log that cannot be written is no reason to lose the result.
    let lines = EventLines::new(move |line: &str| drop((&file).write_all(format!("{line}\n").as_bytes())));
    Ok(TaskLog { lines, scene, task, stage: Mutex::default(), warnings: Mutex::default(), batch })
}

impl<W: Fn(&str) + Sync> TaskLog<'_, W> {
    /// Writes how the task ended.
    pub(super) fn finish(&self, output: &Path, reason: Option<&str>) {
        let error = reason.map(|reason| std::io::Error::other(reason.to_owned()));
        self.lines.finish(output, error.as_ref().map(|error| error as _));
        self.batch.part(self.scene, None);
    }

    /// Takes the warnings that were given since the last call.
    pub(super) fn take_warnings(&self) -> Vec<String> {
        self.warnings.lock().map(|mut warnings| std::mem::take(&mut *warnings)).unwrap_or_default()
    }

    /// Changes the stage and shows it.
    fn show(&self, change: impl FnOnce(&mut (String, usize, usize))) {
        let Ok(mut stage) = self.stage.lock() else { return };
        change(&mut stage);
        let (name, done, steps) = &*stage;
        self.batch.part(self.scene, Some(&format!("{}: {name} {done}/{}", self.task, steps.max(done))));
    }
}

impl<W: Fn(&str) + Sync> Progress for TaskLog<'_, W> {
    fn begin(&self, stage: &str, steps: usize) {
        self.lines.begin(stage, steps);
        self.show(|shown| *shown = (stage.to_owned(), 0, steps));
    }

    fn step(&self) {
        self.lines.step();
        self.show(|(_, done, _)| *done += 1);
    }

    fn choice(&self, choice: &Choice) {
        self.lines.choice(choice);
    }

    fn warn(&self, text: &str) {
        self.lines.warn(text);
        if let Ok(mut warnings) = self.warnings.lock() {
            warnings.push(text.to_owned());
        }
    }

    fn is_cancelled(&self) -> bool {
        self.batch.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Keeps what the parts of a batch show.
    #[derive(Default)]
    struct Shown(Mutex<Vec<String>>);

    impl Progress for Shown {
        fn begin(&self, _: &str, _: usize) {}
        fn step(&self) {}
        fn choice(&self, _: &Choice) {}
        fn warn(&self, _: &str) {}
        fn part(&self, name: &str, state: Option<&str>) {
            self.0.lock().unwrap().push(format!("{name} {}", state.unwrap_or("ended")));
        }
    }

    #[test]
    fn the_batch_sees_the_stages_of_its_tasks() {
        let (folder, shown) = (tempfile::tempdir().unwrap(), Shown::default());
        let log = open(folder.path(), ("north", "dsm"), &shown).unwrap();
        log.begin("sweeping heights", 1);
        log.step();
        // More steps than were said.
        log.step();
        log.finish(folder.path(), None);
        let expected = ["0/1", "1/1", "2/2"].map(|steps| format!("north dsm: sweeping heights {steps}"));
        let found = shown.0.into_inner().unwrap();
        assert_eq!((&found[..3], found[3].as_str()), (&expected[..], "north ended"));
        assert!(std::fs::read_to_string(folder.path().join("dsm.jsonl")).unwrap().contains("sweeping heights"));
    }
}
