//! The server: one thread that holds the connections, and others that check requests and answer
//! them.

use std::fmt::Write;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use job::error::JobError;
use numeric::Progress;
use tokio::sync::mpsc;

use super::answers::Answers;
use super::config::ViewConfig;
use super::error::ViewError;
use super::frame::MapFrame;
use super::http::{Answer, Question, Refusal, Request, serve};
use super::page_job::PageJob;
use super::report::ViewerReport;
use super::scene::Scene;
use super::space::Space;

/// Requests that are answered at once. A browser asks six at a time.
const WORKERS: usize = 6;
/// Bytes of the token.
const TOKEN_BYTES: usize = 16;

/// A viewer that listens and is not served yet.
pub struct ViewServer {
    scene: Scene,
    space: Space,
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    seconds: Option<f64>,
}

/// Requests by what became of them.
#[derive(Default)]
struct Counts {
    answered: AtomicU64,
    refused: AtomicU64,
    failed: AtomicU64,
}

impl ViewServer {
    /// Finds the layers, and listens on 127.0.0.1. Warnings say what is left out.
    ///
    /// # Errors
    /// [`JobError`]: a setting out of range, rasters that cannot be read, a port that is taken.
    pub fn open(config: &ViewConfig, progress: &dyn Progress) -> Result<Self, JobError> {
        Ok(Self::opened(config, progress)?)
    }

    fn opened(config: &ViewConfig, progress: &dyn Progress) -> Result<Self, ViewError> {
        config.validate()?;
        let mut space = Space::open(&config.inputs, progress)?;
        let rasters = ViewConfig { inputs: space.others(&config.inputs), ..config.clone() };
        let mut scene = if rasters.inputs.is_empty() { Scene::empty() } else { Scene::open(&rasters, progress)? };
        (space.has_map, scene.has_space) = (!scene.rasters.is_empty(), !space.is_empty());
        let mut bytes = [0u8; TOKEN_BYTES];
        getrandom::fill(&mut bytes).map_err(|error| ViewError::Token { reason: error.to_string() })?;
        let token = bytes.iter().fold(String::new(), |mut token, byte| {
            // Writing into a text cannot fail.
            let _ = write!(token, "{byte:02x}");
            token
        });
        let port = config.port.unwrap_or(0);
        let taken = |source| ViewError::Port { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(taken)?;
        let address = listener.local_addr().map_err(taken)?;
        Ok(Self { scene, space, listener, address, token, seconds: config.seconds })
    }

    /// Returns the address of the page, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Opens the page in the browser that the system prefers. The address, and with it the token,
    /// is an argument of that program, which other users of this computer may be able to see.
    ///
    /// # Errors
    /// [`JobError`] when there is no such program.
    pub fn open_browser(&self) -> Result<(), JobError> {
        let program = match std::env::consts::OS {
            "macos" => "open",
            "windows" => "explorer",
            _ => "xdg-open",
        };
        let mut command = Command::new(program);
        command.arg(self.url()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Ok(command.spawn().map(drop).map_err(ViewError::Browser)?)
    }

    /// Returns the frame of the map, and its ground as far as its rasters have heights.
    ///
    /// # Errors
    /// [`JobError`] when the heights cannot be read.
    pub fn map_frame(&self) -> Result<Option<MapFrame>, JobError> {
        Ok(MapFrame::of(&self.scene)?)
    }

    /// Answers requests until the job is cancelled or the time of the configuration is over.
    ///
    /// # Errors
    /// [`JobError`] when the system starts no threads.
    pub fn serve(&self, progress: &dyn Progress) -> Result<ViewerReport, JobError> {
        Ok(self.answer_all(None, progress)?)
    }

    /// Answers as [`Self::serve`] does, with a page for a job behind it in the place of the map's
    /// own.
    ///
    /// # Errors
    /// As [`Self::serve`].
    pub fn serve_job(&self, job: &dyn PageJob, progress: &dyn Progress) -> Result<ViewerReport, JobError> {
        Ok(self.answer_all(Some(job), progress)?)
    }

    fn answer_all(&self, job: Option<&dyn PageJob>, progress: &dyn Progress) -> Result<ViewerReport, ViewError> {
        let start = Instant::now();
        let counts = Counts::default();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ViewError::Thread)?;
        let listener = self.listener.try_clone().map_err(ViewError::Thread)?;
        let is_over = || self.seconds.is_some_and(|seconds| start.elapsed().as_secs_f64() >= seconds);
        let (questions, received) = mpsc::unbounded_channel();
        let received = Mutex::new(received);
        let served = std::thread::scope(|scope| {
            let work = || self.work(job, &received, &counts);
            let spawn = |_| std::thread::Builder::new().name("view".to_owned()).spawn_scoped(scope, work);
            (0..WORKERS).try_for_each(|i| spawn(i).map(drop))?;
            let served =
                runtime.block_on(serve(listener, questions, job.is_some(), || progress.is_cancelled() || is_over()));
            // The connections end with the runtime, and the threads when no connection may ask.
            drop(runtime);
            served
        });
        served.map_err(ViewError::Thread)?;
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Ok(ViewerReport {
            layers: self.scene.layers.iter().map(|layer| layer.title.clone()).chain(self.space.names()).collect(),
            answered: count(&counts.answered),
            refused: count(&counts.refused),
            failed: count(&counts.failed),
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Answers one request after the other until no more can come.
    fn work(&self, job: Option<&dyn PageJob>, questions: &Mutex<mpsc::UnboundedReceiver<Question>>, counts: &Counts) {
        let mut answers = Answers::new(&self.scene, &self.space, job);
        let next = || questions.lock().unwrap_or_else(PoisonError::into_inner).blocking_recv();
        while let Some(question) = next() {
            let request = question.request.clone();
            let answer = request.and_then(|request| self.answer(&request, &mut answers));
            let counter = match &answer {
                Ok(_) => &counts.answered,
                Err(Refusal::Failed(_)) => &counts.failed,
                Err(_) => &counts.refused,
            };
            counter.fetch_add(1, Ordering::Relaxed);
            question.reply(answer);
        }
    }

    /// Checks the host and the token of a request, and answers it.
    fn answer(&self, request: &Request, answers: &mut Answers<'_>) -> Result<Answer, Refusal> {
        let port = self.address.port();
        if ![format!("127.0.0.1:{port}"), format!("localhost:{port}")].contains(&request.host) {
            return Err(Refusal::ForeignHost);
        }
        let (path, query) = request.target.split_once('?').unwrap_or((&request.target, ""));
        let (token, path) = path.strip_prefix('/').and_then(|path| path.split_once('/')).ok_or(Refusal::NotFound)?;
        if !is_same(token, &self.token) {
            return Err(Refusal::NotFound);
        }
        match &request.posted {
            Some(body) => answers.post(path, body),
            None => answers.answer(path, query),
        }
    }
}

/// Compares two texts in a time that does not tell where they differ.
fn is_same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}
