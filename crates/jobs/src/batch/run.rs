//! Running a batch: several scenes at a time, and a report at the end.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use numeric::Progress;

use crate::batch::batch_file::{BatchConfig, BatchScene};
use crate::batch::batch_report::{BatchReport, SceneReport};
use crate::batch::error::BatchError;
use crate::batch::images::images_of;
use crate::batch::task::{TaskJob, TaskKind, TaskScene};
use crate::batch::tasks_of_scene::{SceneJobs, TaskLimits};
use crate::files::{FileError, write_json};
use crate::output_folder::OutputFolder;
use crate::threads;

/// Names of the reports in the folder of a batch.
const REPORT_JSON: &str = "batch_report.json";
const REPORT_PAGE: &str = "batch_report.html";
/// Memory of the surface models that are computed at a time where none is given, megabytes.
const MEMORY_MB: u64 = 4000;
/// Beginnings of the names of files that killed runs leave.
const LEFT_OVER: [&str; 2] = [".skysweep-", ".claim-"];
/// Name of a result of a chunk that a killed run leaves.
const PARTIAL_RESULT: &str = "result.partial";

/// Runs a batch. What an earlier run of it completed is left alone.
///
/// # Errors
/// [`BatchError::UnknownTask`], [`BatchError::Settings`] before anything is done;
/// [`BatchError::File`] for a folder in use and a report that cannot be written;
/// [`BatchError::Cancelled`]. A task that fails is in the report.
pub fn run(batch: &BatchConfig, progress: &dyn Progress) -> Result<BatchReport, BatchError> {
    let scenes = batch.scenes.iter().map(|scene| prepare(batch, scene)).collect::<Result<Vec<_>, _>>()?;
    let folder = OutputFolder::take(&batch.output)?;
    remove_left_over(folder.path())?;
    scenes.iter().try_for_each(|scene| remove_left_over_below(&scene.folder))?;
    progress.begin("tasks", scenes.iter().map(|scene| scene.tasks.len()).sum());
    let parallel = batch.limits.parallel.min(scenes.len());
    let limits = TaskLimits {
        threads: Some((threads::count(batch.limits.threads) / parallel).max(1)),
        retries: batch.limits.retries,
        progress,
    };
    let next = AtomicUsize::new(0);
    let reports = Mutex::new(vec![None; scenes.len()]);
    std::thread::scope(|scope| {
        for _ in 0..parallel {
            scope.spawn(|| {
                while let Some((at, scene)) = take_next(&next, &scenes).filter(|_| !progress.is_cancelled()) {
                    let report = scene.run(&limits);
                    if let Ok(mut reports) = reports.lock() {
                        reports[at] = Some(report);
                    }
                }
            });
        }
    });
    progress.check_cancelled()?;
    let reports: Vec<SceneReport> = reports.into_inner().unwrap_or_default().into_iter().flatten().collect();
    let report = BatchReport::new(reports);
    write_json(&batch.output.join(REPORT_JSON), &report, true)?;
    let page = report.page();
    io::write_bytes(batch.output.join(REPORT_PAGE), page.as_bytes(), true).map_err(FileError::from)?;
    Ok(report)
}

fn take_next<'a>(next: &AtomicUsize, scenes: &'a [SceneJobs]) -> Option<(usize, &'a SceneJobs)> {
    let at = next.fetch_add(1, Ordering::Relaxed);
    scenes.get(at).map(|scene| (at, scene))
}

/// Makes the jobs of a scene. Settings that are wrong stop the batch. Images and areas that are
/// missing do not.
fn prepare(batch: &BatchConfig, scene: &BatchScene) -> Result<SceneJobs, BatchError> {
    let tasks = batch.tasks(scene)?;
    let folder = batch.output.join(&scene.name);
    let images = images_of(&scene.images, &batch.folder);
    let place = TaskScene {
        base: &batch.folder,
        images: images.clone().unwrap_or_default(),
        folder: folder.clone(),
        has_surface: tasks.contains(&TaskKind::Dsm),
        bounds: scene.bounds,
        area: scene.area.clone().map(|area| area.or_named(&scene.name)),
    };
    let mut jobs = Vec::with_capacity(tasks.len());
    for &task in &tasks {
        let job = TaskJob::new(task, batch.settings(scene, task), &place).map_err(|what| BatchError::Settings {
            scene: scene.name.clone(),
            task: task.name().to_owned(),
            what,
        })?;
        jobs.push(job.limited(memory_mb(batch)));
    }
    Ok(SceneJobs { name: scene.name.clone(), folder, tasks, jobs: images.map(|_| jobs) })
}

/// Returns the memory that one surface model may take, megabytes.
fn memory_mb(batch: &BatchConfig) -> u64 {
    // Whatever the number of scenes: one more must not change the plans of the others.
    batch.limits.memory_mb.unwrap_or(MEMORY_MB) / batch.limits.parallel.max(1) as u64
}

/// Removes the files that killed runs left in a folder.
fn remove_left_over(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if name == PARTIAL_RESULT || LEFT_OVER.iter().any(|beginning| name.starts_with(beginning)) {
            let removed = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
            removed.map_err(|source| FileError::Remove { path, source })?;
        } else if is_folder {
            folders.push(path);
        }
    }
    Ok(folders)
}

/// Removes the files that killed runs left in the folder of a scene and in those below it. A folder
/// in which another run works is left alone.
fn remove_left_over_below(folder: &Path) -> Result<(), FileError> {
    if !folder.is_dir() {
        return Ok(());
    }
    let _taken = match OutputFolder::take(folder) {
        Err(FileError::InUse { .. }) => return Ok(()),
        other => other?,
    };
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        folders.extend(remove_left_over(&folder)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_killed_runs_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene");
        let names = ["chunks/0000/result.partial", "chunks/.claim-1", "result.partial.txt"];
        for name in names {
            std::fs::create_dir_all(scene.join(name)).unwrap();
        }
        let share = OutputFolder::share(&scene).unwrap();
        remove_left_over_below(&scene).unwrap();
        assert!(names.iter().all(|name| scene.join(name).exists()), "another run works here");
        drop(share);
        remove_left_over_below(&scene).unwrap();
        assert_eq!(names.map(|name| scene.join(name).exists()), [false, false, true]);
    }

    #[test]
    fn another_scene_does_not_change_the_memory_of_the_others() {
        let mut batch = BatchConfig::default();
        batch.limits.parallel = 3;
        batch.limits.memory_mb = Some(900);
        assert_eq!(memory_mb(&batch), 300);
        batch.scenes = vec![BatchScene::default()];
        assert_eq!(memory_mb(&batch), 300);
    }
}
