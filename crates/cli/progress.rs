//! Progress on stderr: bars for people, JSON lines for programs.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};
use jobs::event_lines::EventLines;
use numeric::{Choice, Progress};

use crate::interrupt::{self, Interruptible};
use crate::{Global, print};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ProgressStyle {
    /// A bar per stage, where stderr is a terminal.
    Bar,
    /// One JSON object per line.
    Json,
    /// Nothing.
    None,
}

/// How a command shows what it does and what it found.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct ShowOptions {
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    pub(crate) progress: ProgressStyle,
    /// Print the report as JSON on stdout.
    #[arg(long)]
    pub(crate) json: bool,
}

impl ShowOptions {
    /// Runs a job that writes `output` while its progress is shown.
    pub(crate) fn watch<T, E: std::error::Error>(
        self,
        global: Global,
        output: &Path,
        job: impl FnOnce(&dyn Progress) -> Result<T, E>,
    ) -> Result<T, E> {
        interrupt::listen();
        if self.progress == ProgressStyle::Json {
            let lines = EventLines::new(say);
            let result = job(&Interruptible(&lines));
            lines.finish(output, result.as_ref().err().map(|error| error as _));
            return result;
        }
        let watcher = Watcher::new(self.progress, global);
        let result = job(&Interruptible(&watcher));
        watcher.bar.finish_and_clear();
        watcher.say_time();
        result
    }

    /// Prints a report as JSON if asked for, or else as text unless only errors are to be printed.
    pub(crate) fn print(
        self,
        global: Global,
        report: &impl serde::Serialize,
        text: impl FnOnce() -> String,
    ) -> anyhow::Result<()> {
        print::report(self.json, !global.is_quiet(), report, text)
    }
}

/// What becomes of earlier outputs, and what a command shows.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct WriteOptions {
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) show: ShowOptions,
}

/// How a job runs, what becomes of earlier outputs, and what it shows.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct RunOptions {
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) show: ShowOptions,
}

/// Shows a job's progress.
struct Watcher {
    quiet: bool,
    /// Whether stages and their times are printed as lines.
    verbose: bool,
    /// The bar, and above it a line for each part that is at work.
    table: MultiProgress,
    bar: ProgressBar,
    parts: Mutex<BTreeMap<String, ProgressBar>>,
    stage: Mutex<(String, Instant)>,
}

impl Watcher {
    fn new(style: ProgressStyle, global: Global) -> Self {
        let quiet = global.is_quiet();
        // At -vv the lines of files would tear the bar.
        let shown = style == ProgressStyle::Bar && !quiet && global.verbose < 2;
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let table = MultiProgress::with_draw_target(target);
        let bar = table.add(ProgressBar::new(0));
        if let Ok(look) = BarStyle::with_template("{msg:22} {bar:30} {percent:>3} % {eta:>4} left") {
            bar.set_style(look);
        }
        let stage = Mutex::new((String::new(), Instant::now()));
        Self { quiet, verbose: global.verbose > 0, table, bar, parts: Mutex::default(), stage }
    }

    /// Prints how long the stage took that ends.
    fn say_time(&self) {
        if let (true, Ok(stage)) = (self.verbose, self.stage.lock())
            && !stage.0.is_empty()
        {
            self.say(&format!("{:<30} {:.1} s", stage.0, stage.1.elapsed().as_secs_f64()));
        }
    }

    fn say(&self, text: &str) {
        self.table.suspend(|| say(text));
    }
}

/// Writes a line to standard error. Where that is closed or full, the work goes on in silence.
fn say(text: &str) {
    drop(writeln!(std::io::stderr(), "{text}"));
}

impl Progress for Watcher {
    fn begin(&self, stage: &str, steps: usize) {
        self.say_time();
        self.bar.set_length(steps as u64);
        self.bar.set_position(0);
        self.bar.set_message(stage.to_owned());
        if let Ok(mut current) = self.stage.lock() {
            *current = (stage.to_owned(), Instant::now());
        }
    }

    fn step(&self) {
        // A stage may find that it has more steps than it said.
        if Some(self.bar.position()) == self.bar.length() {
            self.bar.inc_length(1);
        }
        self.bar.inc(1);
    }

    fn part(&self, name: &str, state: Option<&str>) {
        let Ok(mut parts) = self.parts.lock() else { return };
        let look = BarStyle::with_template("{prefix:20} {msg}").unwrap_or_else(|_| BarStyle::default_spinner());
        let new = || {
            self.table.insert_before(&self.bar, ProgressBar::no_length().with_style(look).with_prefix(name.to_owned()))
        };
        match state {
            Some(state) => parts.entry(name.to_owned()).or_insert_with(new).set_message(state.to_owned()),
            None => parts.remove(name).iter().for_each(ProgressBar::finish_and_clear),
        }
    }

    fn choice(&self, choice: &Choice) {
        if !self.quiet {
            self.say(&format!("{:<13} {} ({})", choice.name, choice.value, choice.reason));
        }
    }

    fn warn(&self, text: &str) {
        if !self.quiet {
            self.say(&format!("warning: {text}"));
        }
    }
}

/// Passes the warnings of a job without visible stages to the log.
pub(crate) struct Log;

impl Progress for Log {
    fn begin(&self, stage: &str, _: usize) {
        tracing::info!("{stage}");
    }

    fn step(&self) {}

    fn choice(&self, choice: &Choice) {
        tracing::info!("{}: {} ({})", choice.name, choice.value, choice.reason);
    }

    fn warn(&self, text: &str) {
        tracing::warn!("{text}");
    }
}
