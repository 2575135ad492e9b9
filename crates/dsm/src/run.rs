//! The whole run: the chain of its stages in one process.

use numeric::Progress;

use crate::chunks::chunk::run_chunk;
use crate::chunks::merge::{Merger, Product};
use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::georeferencing::register::register;
use crate::images::input_stamps::InputStamps;
use crate::images::open::open;
use crate::planning::plan::{Plan, plan};
use crate::pointing::point::point;
use crate::products;
use crate::report::DsmReport;
use crate::session::Session;
use crate::writing::output::DsmFolder;
use job::threads;

/// Makes a DSM and writes its files into the output folder.
///
/// A scene that does not fit the memory is computed by chunks. A chunk that fails then stays void
/// and is named in the report, and the others go on. The products that the configuration names are
/// made last, of the files of the DSM.
///
/// # Errors
/// See [`DsmError`]; nothing is left half-written.
///
/// ```
/// use dsm::{DsmConfig, HeightRange, Preset, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let images = ["view_1.tif", "view_3.tif"].map(|name| format!("{town}/{name}").into());
/// let mut config = DsmConfig::new(images.into(), folder.path().join("out"));
/// config.preset = Preset::Fast;
/// config.gsd_m = Some(2.0);
/// config.height_range_m = Some(HeightRange::new(170.0, 280.0));
/// let report = run(&config, &Silent)?;
/// assert!(report.surface.counts.observed > report.surface.cells / 2);
/// assert!(folder.path().join("out/dsm/dsm.tif").is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &DsmConfig, progress: &dyn Progress) -> Result<DsmReport, DsmError> {
    config.validate()?;
    let folder = DsmFolder::take(config)?;
    let inputs = InputStamps::of(config);
    threads::install(config.threads, || {
        let mut session = Session::new(progress);
        let opened = open(config)?;
        opened.warn(progress);
        let pointed = register(config, point(config, &opened, &mut session)?, &mut session)?;
        let plan = plan(config, &pointed, &mut session)?;
        drop((opened, pointed));
        let report = sweep_and_merge(&plan, folder, &inputs, &mut session)?.report;
        products::beside(&config.output, &config.products, config.overwrite, progress)?;
        Ok(report)
    })
    .map_err(DsmError::Threads)?
}

/// Computes all chunks of a plan and merges them.
fn sweep_and_merge(
    plan: &Plan,
    folder: DsmFolder,
    inputs: &InputStamps,
    session: &mut Session<'_>,
) -> Result<Product, DsmError> {
    let progress = session.progress;
    let is_chunked = plan.chunk_side.is_some();
    let mut merger = Merger::begin(plan, folder, progress)?;
    if is_chunked {
        progress.begin("sweeping chunks", plan.chunks.len());
    }
    for (index, chunk) in plan.chunks.iter().enumerate() {
        let result = run_chunk(plan, index, session);
        inputs.check()?;
        match result {
            Ok(result) => merger.add(result)?,
            Err(DsmError::Cancelled) => return Err(DsmError::Cancelled),
            Err(error) if is_chunked => merger.add_error(chunk.core, error),
            Err(error) => return Err(error),
        }
        if is_chunked {
            progress.step();
        }
    }
    if is_chunked {
        session.lap("chunks");
    }
    merger.finish(session.times())
}
