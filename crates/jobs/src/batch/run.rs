//! Running a batch: several scenes at a time, and a report at the end.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use numeric::Progress;

use crate::batch::batch_file::{BatchConfig, BatchScene};
use crate::batch::batch_report::{BatchReport, SceneReport};
use crate::batch::error::BatchError;
use crate::batch::task::{TaskJob, TaskKind, TaskScene};
use crate::batch::tasks_of_scene::{SceneJobs, TASKS, TaskLimits};
use dsm::production::{CHUNKS, is_chunk, is_left_over};
use job::error::JobError;
use job::files::{FileError, write_json};
use job::guarded::{self, TEMPORARY};
use job::image_files::images_of;
use job::output_folder::OutputFolder;
use job::threads;

/// Names of the reports in the folder of a batch.
const REPORT_JSON: &str = "batch_report.json";
const REPORT_PAGE: &str = "batch_report.html";
/// Memory of the surface models that are computed at a time where none is given, megabytes.
const MEMORY_MB: u64 = 4000;
/// Folders of the tasks of a scene, and those that their jobs write below the folder of the scene.
const SCENE_FOLDERS: [&str; 13] = [
    TASKS,
    CHUNKS,
    "dsm",
    "report",
    "stac",
    "eval",
    "ortho",
    "heightmaps",
    "priors",
    "dtm",
    "classes",
    "products",
    "diff",
];

/// Runs a batch. What an earlier run of it completed is left alone.
///
/// # Errors
/// [`JobError`]: tasks and settings that are not known, before anything is done; a folder in use, a
/// report that cannot be written, and when cancelled. A task that fails is in the report.
pub fn run(batch: &BatchConfig, progress: &dyn Progress) -> Result<BatchReport, JobError> {
    Ok(steps(batch, progress)?)
}

fn steps(batch: &BatchConfig, progress: &dyn Progress) -> Result<BatchReport, BatchError> {
    let all = prepare_all(batch)?;
    let folder = OutputFolder::take(&batch.output)?;
    guarded::remove_inside(folder.path(), &|name| name.starts_with(TEMPORARY))?;
    let (scenes, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|(is_selected, _)| *is_selected);
    let scenes: Vec<SceneJobs> = scenes.into_iter().map(|(_, scene)| scene).collect();
    for scene in &scenes {
        guarded::check_folders(folder.path(), [scene.name.as_str()])?;
        guarded::check_folders(&scene.folder, SCENE_FOLDERS)?;
        remove_left_over(&scene.folder)?;
    }
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
    let mut reports: Vec<SceneReport> = reports.into_inner().unwrap_or_default().into_iter().flatten().collect();
    reports.extend(others.iter().map(|(_, scene)| scene.look(true)));
    let place = |name: &str| batch.scenes.iter().position(|scene| scene.name == name);
    reports.sort_by_key(|scene| place(&scene.name));
    let report = BatchReport::new(reports);
    write_json(&batch.output.join(REPORT_JSON), &report, true)?;
    let page = report.page();
    formats::write_bytes(batch.output.join(REPORT_PAGE), page.as_bytes(), true).map_err(FileError::from)?;
    Ok(report)
}

/// Returns what [`run`] would do, without doing anything: the settings and images of all scenes are
/// looked at, and what is done already.
///
/// # Errors
/// [`JobError`] for tasks and settings that are not known.
pub fn look(batch: &BatchConfig) -> Result<BatchReport, JobError> {
    let scenes = prepare_all(batch)?;
    Ok(BatchReport::new(scenes.iter().map(|(is_selected, scene)| scene.look(!is_selected)).collect()))
}

/// Makes the jobs of all scenes, each with whether it is worked on.
fn prepare_all(batch: &BatchConfig) -> Result<Vec<(bool, SceneJobs)>, BatchError> {
    batch.scenes.iter().map(|scene| Ok((batch.is_selected(scene), prepare(batch, scene)?))).collect()
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
    let makes_products = |job: &TaskJob| matches!(job, TaskJob::Dsm(config) if !config.products.is_empty());
    if tasks.contains(&TaskKind::Products) && jobs.iter().any(makes_products) {
        return Err(BatchError::Settings {
            scene: scene.name.clone(),
            task: TaskKind::Dsm.name().to_owned(),
            what: "`products` is given and the task `products` as well, which write the same folder; leave one out"
                .to_owned(),
        });
    }
    Ok(SceneJobs { name: scene.name.clone(), folder, tasks, jobs: images.map(|_| jobs) })
}

/// Returns the memory that one surface model may take, megabytes.
fn memory_mb(batch: &BatchConfig) -> u64 {
    // Whatever the number of scenes: one more must not change the plans of the others.
    batch.limits.memory_mb.unwrap_or(MEMORY_MB) / batch.limits.parallel.max(1) as u64
}

/// Removes the temporary files that killed runs left in the folder of a scene, in those of its
/// tasks, and in those of its chunks. A folder in which another run works is left alone. Links are
/// not followed.
fn remove_left_over(folder: &Path) -> Result<(), FileError> {
    guarded::check_folder(folder)?;
    if !folder.is_dir() {
        return Ok(());
    }
    let _taken = match OutputFolder::take(folder) {
        Err(FileError::InUse { .. }) => return Ok(()),
        other => other?,
    };
    let is_temporary = |name: &str| name.starts_with(TEMPORARY);
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        guarded::remove_inside(&folder, &is_temporary)?;
        folders.extend(guarded::folders_in(&folder));
    }
    let chunks = folder.join(CHUNKS);
    let of_chunks = guarded::folders_in(&chunks)
        .into_iter()
        .filter(|path| path.file_name().is_some_and(|name| is_chunk(&name.to_string_lossy())));
    of_chunks.into_iter().try_for_each(|chunk| guarded::remove_inside(&chunk, &is_left_over))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_killed_runs_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene");
        let left = ["chunks/0000/.skysweep-result-1/result/height.npy", "chunks/0000/.claim-1", "tasks/.skysweep-2"];
        let others = ["chunks/.claim-1", "chunks/mine/.claim-1", "chunks/0000/.claim-2/a", "mine/.claim-3", "notes"];
        for name in left.iter().chain(&others) {
            let path = scene.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let share = OutputFolder::share(&scene).unwrap();
        remove_left_over(&scene).unwrap();
        assert!(left.iter().all(|name| scene.join(name).exists()), "another run works here");
        drop(share);
        remove_left_over(&scene).unwrap();
        assert_eq!(left.map(|name| scene.join(name).exists()), [false; 3]);
        assert_eq!(others.map(|name| scene.join(name).exists()), [true; 5]);
        assert!(!scene.join("chunks/0000/.skysweep-result-1").exists());
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
