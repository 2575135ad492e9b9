//! The tasks of one scene, one after the other.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

use numeric::Progress;

use crate::batch::batch_report::{SceneReport, TaskReport, TaskState};
use crate::batch::record::{Standing, TaskCourse, TaskRecord};
use crate::batch::task::{TaskJob, TaskKind, TaskOutcome};
use crate::batch::task_log::{self, TaskLog};
use job::error_text::with_causes;
use job::files::create_folder;
use job::guarded;

/// Folder of the records and logs of a scene's tasks.
pub(super) const TASKS: &str = "tasks";

/// A scene with its jobs.
#[derive(Debug)]
pub(super) struct SceneJobs {
    pub(super) name: String,
    pub(super) folder: PathBuf,
    /// The tasks in the order in which they are done.
    pub(super) tasks: Vec<TaskKind>,
    /// Their jobs, or the reason why the scene has none.
    pub(super) jobs: Result<Vec<TaskJob>, String>,
}

/// What holds for all tasks of a batch.
pub(super) struct TaskLimits<'a> {
    /// Worker threads of a task.
    pub(super) threads: Option<usize>,
    /// Times that a failed task is tried again.
    pub(super) retries: usize,
    /// Watcher of the batch.
    pub(super) progress: &'a dyn Progress,
}

/// What a task left.
struct Ended {
    state: TaskState,
    reason: Option<String>,
    course: TaskCourse,
}

impl Ended {
    fn failed(reason: impl Into<String>) -> Self {
        Self { state: TaskState::Failed, reason: Some(reason.into()), course: TaskCourse::default() }
    }
}

impl SceneJobs {
    /// Does the tasks that are not done. Tasks that rest on one without a result are not begun.
    pub(super) fn run(&self, limits: &TaskLimits<'_>) -> SceneReport {
        let mut tasks = Vec::with_capacity(self.tasks.len());
        let jobs = match &self.jobs {
            Ok(jobs) => jobs.as_slice(),
            Err(reason) => {
                let failed = |(i, task): (usize, &TaskKind)| match i {
                    0 => TaskReport { state: TaskState::Failed, ..TaskReport::not_begun(*task, reason) },
                    _ => TaskReport::not_begun(*task, "the scene has no images or no area"),
                };
                tasks.extend(self.tasks.iter().enumerate().map(failed));
                limits.progress.warn(&format!("{}: {reason}", self.name));
                tasks.iter().for_each(|_| limits.progress.step());
                &[]
            }
        };
        for job in jobs {
            let has_no_surface = tasks.first().is_some_and(|first: &TaskReport| {
                first.task == TaskKind::Dsm && matches!(first.state, TaskState::Failed | TaskState::NotBegun)
            });
            if has_no_surface || limits.progress.is_cancelled() {
                tasks.push(TaskReport::not_begun(job.kind(), "there is no surface model"));
            } else {
                let Ended { state, reason, course } = self.work(job, limits);
                if let Some(reason) = &reason {
                    limits.progress.warn(&format!("{} {}: {reason}", self.name, job.kind().name()));
                }
                let TaskCourse { seconds, attempts, warnings } = course;
                tasks.push(TaskReport { task: job.kind(), state, reason, attempts, seconds, warnings });
            }
            limits.progress.step();
        }
        self.report(tasks, false)
    }

    /// Returns how the tasks stand, and what a run would do. Nothing is written. A task that rests
    /// on a surface model that is to be made is to be made, too.
    pub(super) fn look(&self, left_out: bool) -> SceneReport {
        let jobs = match &self.jobs {
            Ok(jobs) => jobs.as_slice(),
            Err(reason) => {
                let failed = |task: &TaskKind| TaskReport {
                    state: if left_out { TaskState::NotBegun } else { TaskState::Failed },
                    ..TaskReport::not_begun(*task, reason)
                };
                return self.report(self.tasks.iter().map(failed).collect(), left_out);
            }
        };
        let mut tasks: Vec<TaskReport> = Vec::with_capacity(jobs.len());
        for job in jobs {
            let record = TaskRecord::read(&self.folder.join(TASKS).join(format!("{}.json", job.kind().name())));
            let is_surface_open = tasks.iter().any(|task| task.task == TaskKind::Dsm && !task.state.is_complete());
            let mut looked = job.clone();
            looked.set_running(None, record.is_some());
            let (state, reason) = match (record.as_ref().map(|record| record.standing(job, &self.folder)), left_out) {
                (Some(Standing::Complete), _) if !is_surface_open => (TaskState::DoneBefore, None),
                (_, true) => (TaskState::NotBegun, Some("the scene is left out of this run".to_owned())),
                (Some(Standing::Damaged(what)), _) => (TaskState::ToDo, Some(format!("a result is damaged: {what}"))),
                _ => match looked.refused() {
                    Some(reason) => (TaskState::Failed, Some(reason)),
                    None => (TaskState::ToDo, None),
                },
            };
            let course = record.filter(|_| state.is_complete()).map(|record| record.course).unwrap_or_default();
            let TaskCourse { seconds, attempts, warnings } = course;
            tasks.push(TaskReport { task: job.kind(), state, reason, attempts, seconds, warnings });
        }
        self.report(tasks, left_out)
    }

    fn report(&self, tasks: Vec<TaskReport>, left_out: bool) -> SceneReport {
        SceneReport { name: self.name.clone(), folder: self.folder.clone(), tasks, left_out }
    }

    fn work(&self, job: &TaskJob, limits: &TaskLimits<'_>) -> Ended {
        let since = Instant::now();
        let made = create_folder(&self.folder).and_then(|()| guarded::make_folder(&self.folder, TASKS));
        let folder = match made {
            Ok(folder) => folder,
            Err(error) => return Ended::failed(with_causes(&error)),
        };
        let name = job.kind().name();
        let place = folder.join(format!("{name}.json"));
        let record = TaskRecord::read(&place);
        match record.as_ref().map(|record| record.standing(job, &self.folder)) {
            Some(Standing::Complete) => {
                let course = record.map(|record| record.course).unwrap_or_default();
                return Ended { state: TaskState::DoneBefore, reason: None, course };
            }
            Some(Standing::Damaged(what)) => {
                let task = format!("{} {name}", self.name);
                limits.progress.warn(&format!("{task}: a result is damaged and made again: {what}"));
            }
            Some(Standing::Open) | None => {}
        }
        let log = match task_log::open(&folder, (&self.name, name), limits.progress) {
            Ok(log) => log,
            Err(error) => return Ended::failed(format!("cannot write the log: {error}")),
        };
        // What an earlier run of the batch made may be replaced, and nothing else.
        let mut job = job.clone();
        job.set_running(limits.threads, record.is_some());
        let mut ended = Ended::failed("it was not tried");
        for attempt in 1..=limits.retries + 1 {
            ended = self.try_once(&job, &place, &log, (since, attempt));
            log.finish(&job.product(), ended.reason.as_deref());
            if ended.state != TaskState::Failed || limits.progress.is_cancelled() {
                break;
            }
            job.set_running(limits.threads, place.exists());
        }
        ended
    }

    /// Tries a task and keeps its record. `since` is when it was first tried.
    fn try_once<W: Fn(&str) + Sync>(
        &self,
        job: &TaskJob,
        place: &Path,
        log: &TaskLog<'_, W>,
        (since, attempts): (Instant, usize),
    ) -> Ended {
        let begun = TaskRecord::begin(job).and_then(|record| match job.refused() {
            Some(reason) => Err(reason),
            None => record.write(place).map(|()| record),
        });
        let mut record = match begun {
            Ok(record) => record,
            Err(reason) => {
                return Ended { course: TaskCourse { attempts, ..TaskCourse::default() }, ..Ended::failed(reason) };
            }
        };
        // A defect of ours in one task is no reason to lose the night.
        let result = catch_unwind(AssertUnwindSafe(|| job.run(log)));
        let result =
            result.unwrap_or_else(|_| Err("the program has a defect; the log ends where it was met".to_owned()));
        let mut warnings = log.take_warnings();
        // A run that goes on with an earlier plan does not say again what the plan warned of.
        let kept = result.iter().flat_map(|outcome| &outcome.warnings);
        let forgotten: Vec<String> = kept.filter(|warning| !warnings.contains(warning)).cloned().collect();
        warnings.splice(0..0, forgotten);
        let course = TaskCourse { seconds: since.elapsed().as_secs_f64(), attempts, warnings };
        let ended = match result {
            Err(reason) => Ended::failed(reason),
            Ok(TaskOutcome { missing: Some(reason), .. }) => {
                Ended { state: TaskState::Partial, reason: Some(reason), course: TaskCourse::default() }
            }
            Ok(TaskOutcome { missing: None, .. }) => {
                match record.finish(job, &self.folder, course.clone()).and_then(|()| record.write(place)) {
                    Ok(()) => Ended { state: TaskState::Done, reason: None, course: TaskCourse::default() },
                    Err(reason) => Ended::failed(reason),
                }
            }
        };
        Ended { course, ..ended }
    }
}
