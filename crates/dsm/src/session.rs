//! What a process keeps beside the plain values of the stages: the watcher, pixels that were read,
//! and times.
//!
//! Nothing in a session changes a result. A stage that finds its session empty, because an earlier
//! stage ran in another process, reads again what it needs.

use std::path::Path;
use std::time::Instant;

use numeric::Progress;
use sweep::SweepView;

use crate::error::DsmError;
use crate::prior::city_prior::CityPrior;
use crate::report::StageTime;

/// The watcher of a run, a cache of what was read, and the times of the stages.
pub struct Session<'a> {
    pub(crate) progress: &'a dyn Progress,
    /// Views of all images with the cameras of the latest stage, when the scene fits the memory.
    pub(crate) views: Option<Vec<SweepView>>,
    prior: Option<CityPrior>,
    times: Vec<StageTime>,
    since: Instant,
}

impl<'a> Session<'a> {
    /// Begins the session of one run, which reports to `progress`.
    pub fn new(progress: &'a dyn Progress) -> Self {
        Self { progress, views: None, prior: None, times: Vec::new(), since: Instant::now() }
    }

    /// Returns the wall times of the stages that ran in this session.
    pub fn times(&self) -> &[StageTime] {
        &self.times
    }

    /// Ends a stage: its time is that since the end of the one before it.
    pub(crate) fn lap(&mut self, stage: &str) {
        self.times.push(StageTime { stage: stage.to_owned(), seconds: self.since.elapsed().as_secs_f64() });
        self.since = Instant::now();
    }

    /// Returns the city model, which is read at the first call.
    ///
    /// # Errors
    /// [`DsmError::Prior`].
    pub(crate) fn prior(&mut self, path: &Path) -> Result<&CityPrior, DsmError> {
        let prior = match self.prior.take() {
            Some(prior) => prior,
            None => CityPrior::read(path)?,
        };
        Ok(self.prior.insert(prior))
    }
}
