//! Errors of jobs as Python sees them: a text with all causes, and the class of the exception.

use std::error::Error;

use camera::{CameraError, FitError, RpcError};
use crs::CrsError;
use io::raster::RasterError;
use io::rpc::{RpcReadError, RpcWriteError};
use jobs::align::AlignJobError;
use jobs::batch::BatchError;
use jobs::buildings::BuildingMapError;
use jobs::city::CityJobError;
use jobs::classes::ClassesError;
use jobs::corrections::CorrectionsError;
use jobs::diff::DiffError;
use jobs::dsm::DsmError;
use jobs::dtm::DtmError;
use jobs::error::{FileCrsError, ImageInputError, JobError};
use jobs::eval::EvalJobError;
use jobs::files::FileError;
use jobs::groundview::GroundViewError;
use jobs::heightmap::HeightMapJobError;
use jobs::job_file::JobFileError;
use jobs::map_surface::MapSurfaceError;
use jobs::mesh::MeshJobError;
use jobs::ortho::OrthoError;
use jobs::priors::PriorsJobError;
use jobs::production::ProductionError;
use jobs::products::ProductsError;
use jobs::register::RegisterError;
use jobs::rpc::RpcJobError;
use jobs::simulate::SimulateJobError;
use jobs::splats::SplatsJobError;
use jobs::split::SplitJobError;
use jobs::tiles::TilesError;
use jobs::train::TrainError;

/// Class of an exception. The names are those of the classes in `skysweep` without `Error`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultKind {
    /// A setting or an array that cannot be used.
    Input,
    /// A file cannot be read or written.
    File,
    /// An output exists and may not be replaced.
    OutputExists,
    /// Another process has the output folder for itself, or works in it.
    InUse,
    /// A coordinate reference system or a vertical datum cannot be used.
    Crs,
    /// The job was asked to stop.
    Cancelled,
    /// Another reason why there is no result.
    Skysweep,
}

/// An error on its way to Python.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Class of the exception.
    pub(crate) kind: FaultKind,
    /// What happened, with all causes.
    pub(crate) text: String,
    /// Number of the system's error among the causes, if there is one.
    pub(crate) system_code: Option<i32>,
}

impl Fault {
    /// A setting that serde does not take.
    pub(crate) fn setting(text: String) -> Self {
        Self { kind: FaultKind::Input, text, system_code: None }
    }

    /// A defect of the program or of the system.
    pub(crate) fn internal(text: &str) -> Self {
        Self { kind: FaultKind::Skysweep, text: text.to_owned(), system_code: None }
    }

    /// A value that cannot be used.
    pub(crate) fn input(error: &dyn Error) -> Self {
        Self::setting(with_causes(error))
    }
}

fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        // Some errors have the text of their cause within their own.
        let own = error.to_string();
        if !text.contains(&own) {
            text = format!("{text}: {own}");
        }
        cause = error.source();
    }
    text
}

/// An error whose class is known.
trait Judged: Error + 'static {
    /// Returns the class by the error's own variant; `None` leaves it to the causes.
    fn kind(&self) -> Option<FaultKind>;
}

impl<E: Judged> From<E> for Fault {
    fn from(error: E) -> Self {
        let kind = error.kind().or_else(|| kind_of_causes(&error)).unwrap_or(FaultKind::Skysweep);
        let text = with_causes(&error);
        // The writers of single files say it in their text alone.
        let kind = if text.contains(io::atomic::OUTPUT_EXISTS) { FaultKind::OutputExists } else { kind };
        Self { kind, text, system_code: system_code(&error) }
    }
}

fn of_job(error: &JobError) -> Option<FaultKind> {
    match error {
        JobError::Setting(_) | JobError::Threads(_) => Some(FaultKind::Input),
        JobError::File(error) => of_file(error),
        JobError::Cancelled(_) => Some(FaultKind::Cancelled),
        _ => None,
    }
}

fn of_file(error: &FileError) -> Option<FaultKind> {
    match error {
        FileError::Exists { .. } => Some(FaultKind::OutputExists),
        FileError::NotUtf8 { .. } => Some(FaultKind::Input),
        FileError::InUse { .. } => Some(FaultKind::InUse),
        _ => Some(FaultKind::File),
    }
}

/// Looks for a known error among the causes, the error itself included.
fn kind_of_causes(error: &(dyn Error + 'static)) -> Option<FaultKind> {
    let mut cause = Some(error);
    let mut last = None;
    while let Some(error) = cause {
        if error.is::<CrsError>() || error.is::<FileCrsError>() {
            return Some(FaultKind::Crs);
        }
        if error.is::<std::io::Error>() || error.is::<RasterError>() || error.is::<RpcReadError>() {
            last = Some(FaultKind::File);
        }
        cause = error.source();
    }
    last
}

/// Looks for the number of an error of the system among the causes.
fn system_code(error: &(dyn Error + 'static)) -> Option<i32> {
    let own = error.downcast_ref::<std::io::Error>().and_then(std::io::Error::raw_os_error);
    own.or_else(|| system_code(error.source()?))
}

/// Judges errors that hold those of every job as `Job(JobError)`, and some variants of their own.
macro_rules! judged {
    ($($error:ident { $($variant:pat => $kind:expr),* $(,)? })+) => {$(
        impl Judged for $error {
            fn kind(&self) -> Option<FaultKind> {
                match self {
                    Self::Job(error) => of_job(error),
                    $($variant => $kind,)*
                    #[allow(unreachable_patterns, reason = "not every error has other variants")]
                    _ => None,
                }
            }
        }
    )+};
}

judged! {
    AlignJobError {}
    BuildingMapError {
        Self::Image(error) => error.kind(),
        Self::Surface(error) => error.kind(),
    }
    CityJobError { Self::Read(_) => Some(FaultKind::File) }
    ClassesError {
        Self::Index(error) => error.kind(),
        Self::Surface(error) => error.kind(),
        Self::Image(error) => error.kind(),
    }
    DiffError { Self::Surfaces(error) => error.kind() }
    DtmError { Self::Surface(error) => error.kind() }
    EvalJobError {
        Self::Raster(_) | Self::Points(_) | Self::SurfaceFile(_) | Self::MapFile(_) => Some(FaultKind::File),
        Self::FileCrs(_) | Self::Crs(_) => Some(FaultKind::Crs),
        Self::ForeignFile { .. } => Some(FaultKind::OutputExists),
    }
    GroundViewError {
        Self::Surface(error) => error.kind(),
        Self::Raster(error) => error.kind(),
    }
    HeightMapJobError { Self::Raster(error) => error.kind() }
    MeshJobError {
        Self::Model(_) | Self::Ply(_) | Self::Map(_) => Some(FaultKind::File),
        Self::Image(error) => error.kind(),
    }
    OrthoError { Self::Image(error) => error.kind() }
    PriorsJobError { Self::Image(error) => error.kind() }
    ProductsError { Self::Raster(error) => error.kind() }
    SimulateJobError {
        Self::Scene(_) | Self::Parameters { .. } => Some(FaultKind::Input),
        Self::NotEmpty { .. } => Some(FaultKind::OutputExists),
    }
    RegisterError {
        Self::Splats(_) => Some(FaultKind::File),
        Self::Surface(error) => error.kind(),
        Self::Image(error) => error.kind(),
    }
    SplatsJobError {
        Self::Surface(error) => error.kind(),
        Self::Image(error) => error.kind(),
    }
    SplitJobError {}
    TilesError {
        Self::Map(error) => error.kind(),
        Self::Ortho(error) => error.kind(),
        Self::Image(error) => error.kind(),
    }
    TrainError {
        Self::Surface(error) => error.kind(),
        Self::Image(error) => error.kind(),
    }
}

impl Judged for DsmError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::TooFewImages { .. }
            | Self::Folder { .. }
            | Self::SameImage { .. }
            | Self::Value { .. }
            | Self::BoundsMissScene { .. }
            | Self::RangeMissesScene { .. }
            | Self::NoSuchChunk { .. }
            | Self::Memory { .. }
            | Self::Threads(_) => Some(FaultKind::Input),
            Self::Exists { .. } => Some(FaultKind::OutputExists),
            Self::InUse { .. } => Some(FaultKind::InUse),
            Self::Image(_) | Self::Rpc(_) | Self::Output { .. } | Self::ChunkFile { .. } => Some(FaultKind::File),
            Self::File(error) => of_file(error),
            Self::Crs(_) => Some(FaultKind::Crs),
            Self::Cancelled => Some(FaultKind::Cancelled),
            _ => None,
        }
    }
}

impl Judged for ProductionError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::Dsm(error) => error.kind(),
            Self::File(error) => of_file(error),
            Self::Job(error) => error.kind(),
            Self::Threads(_) | Self::OtherPlan { .. } => Some(FaultKind::Input),
            Self::NoPlan { .. } | Self::Plan { .. } => Some(FaultKind::File),
            _ => None,
        }
    }
}

impl Judged for JobFileError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::File(error) => of_file(error),
            _ => Some(FaultKind::Input),
        }
    }
}

impl Judged for BatchError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::Job(error) => error.kind(),
            Self::Cancelled(_) => Some(FaultKind::Cancelled),
            _ => Some(FaultKind::Input),
        }
    }
}

impl Judged for RpcJobError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::Read(_) => Some(FaultKind::File),
            Self::Cancelled(_) => Some(FaultKind::Cancelled),
            _ => None,
        }
    }
}

impl Judged for ImageInputError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::Corrections(CorrectionsError::NotInRun { .. }) => Some(FaultKind::Input),
            _ => Some(FaultKind::File),
        }
    }
}

impl Judged for MapSurfaceError {
    fn kind(&self) -> Option<FaultKind> {
        match self {
            Self::Raster(error) => error.kind(),
            _ => Some(FaultKind::Crs),
        }
    }
}

impl Judged for RasterError {
    fn kind(&self) -> Option<FaultKind> {
        Some(if matches!(self, Self::Crs { .. }) { FaultKind::Crs } else { FaultKind::File })
    }
}

/// Judges errors that are of one class, whatever their variant.
macro_rules! judged_alike {
    ($($error:ty => $kind:ident),+ $(,)?) => {$(
        impl Judged for $error {
            fn kind(&self) -> Option<FaultKind> {
                Some(FaultKind::$kind)
            }
        }
    )+};
}

judged_alike! {
    RpcReadError => File,
    RpcWriteError => File,
    CrsError => Crs,
    CameraError => Input,
    RpcError => Input,
    FitError => Input,
    city::ModelError => Input,
    cityfiles::CityError => File,
    bvh::BvhError => Input,
    eval::EvalError => Input,
}
