//! Answering points line by line from a stream.
//!
//! A line holds three numbers separated by blanks or commas: longitude, latitude, height to
//! project, or sample, line, height to localize. Empty lines and lines that start with `#` are
//! skipped. Every other line gets one answer, in order; a point that the model has no answer for is
//! an answer with an error.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use camera::CameraError;
use job::error::JobError;
use serde::{Deserialize, Serialize};

use super::error::{LineFault, RpcJobError};
use super::input;
use super::points::{RpcDirection, RpcPoint, RpcQuery};
use numeric::Progress;

/// Longest line that is read, bytes. Three numbers are shorter.
const LINE_MAX: u64 = 4096;

/// A stream of points for the RPC of one file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RpcLinesConfig {
    /// RPC file, or image with an RPC.
    pub file: PathBuf,
    /// Which way the points go.
    pub direction: RpcDirection,
}

/// Answer to one line.
#[derive(Debug)]
pub struct RpcLineAnswer {
    /// Number of the line, from 1.
    pub line: usize,
    /// The point, or why the model has no answer.
    pub point: Result<RpcPoint, CameraError>,
}

/// Counts of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct RpcLinesReport {
    /// Points with an answer.
    pub answered: usize,
    /// Points without an answer.
    pub failed: usize,
}

impl RpcLinesConfig {
    /// A stream of points through the RPC of `file`.
    pub fn new(file: PathBuf, direction: RpcDirection) -> Self {
        Self { file, direction }
    }
}

/// Opens a file of points for [`answer_lines`].
///
/// # Errors
/// [`JobError`] when the file cannot be read.
pub fn open_lines(path: &Path) -> Result<Box<dyn BufRead>, JobError> {
    let file = File::open(path).map_err(|source| RpcJobError::Points { path: path.to_owned(), source })?;
    Ok(Box::new(BufReader::new(file)))
}

/// Answers every line of `input`, in order, through `receive`.
///
/// # Errors
/// [`JobError`] without a usable RPC, at the first line without three numbers, when `receive`
/// fails, and when the job is cancelled.
///
/// ```
/// use scenes::rpc::{RpcDirection, RpcLinesConfig, answer_lines};
/// let image = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
/// let config = RpcLinesConfig::new(image.into(), RpcDirection::Localize);
/// let mut lines = &b"# sample line height\n100 50 60\n120, 50, 60\n"[..];
/// let report = answer_lines(&config, &mut lines, &mut |_| Ok(()), &numeric::Silent)?;
/// assert_eq!((report.answered, report.failed), (2, 0));
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn answer_lines(
    config: &RpcLinesConfig,
    input: &mut dyn BufRead,
    receive: &mut dyn FnMut(RpcLineAnswer) -> std::io::Result<()>,
    progress: &dyn Progress,
) -> Result<RpcLinesReport, JobError> {
    let rpc = input::read(&config.file, progress)?.rpc;
    let mut report = RpcLinesReport::default();
    for line in 1.. {
        progress.check_cancelled()?;
        let at_line = |source| RpcJobError::Line { line, source };
        let Some(text) = next_line(input).map_err(at_line)? else { break };
        let Some(numbers) = parse(&text).map_err(at_line)? else { continue };
        let point = RpcQuery::from_numbers(config.direction, numbers).answer(&rpc);
        match &point {
            Ok(_) => report.answered += 1,
            Err(_) => report.failed += 1,
        }
        receive(RpcLineAnswer { line, point }).map_err(RpcJobError::Output)?;
    }
    Ok(report)
}

fn next_line(input: &mut dyn BufRead) -> Result<Option<String>, LineFault> {
    let mut line = String::new();
    let read = input.take(LINE_MAX).read_line(&mut line)?;
    if read as u64 == LINE_MAX {
        return Err(LineFault::TooLong { limit: LINE_MAX });
    }
    Ok((read > 0).then_some(line))
}

/// Returns the three numbers of a line, or `None` for empty lines and comments.
fn parse(line: &str) -> Result<Option<[f64; 3]>, LineFault> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let not_three = || LineFault::NotThree { found: line.to_owned() };
    let mut words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
    let mut point = [0.0; 3];
    for value in &mut point {
        let word = words.next().ok_or_else(not_three)?;
        *value = word.parse().map_err(|_| LineFault::NotANumber { found: word.to_owned() })?;
    }
    if words.next().is_some() {
        return Err(not_three());
    }
    Ok(Some(point))
}
