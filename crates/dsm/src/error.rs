//! The errors of the DSM job.

use std::fmt;
use std::path::PathBuf;

use numeric::{Failure, Kind, failures};
use reconstruct::{CELLS_MAX, HeightRange, MapBounds, ReconstructError};
use report::plain_number;
use sweep::SweepError;

use crate::products::ProductsError;
use job::error::{JobError, from_steps};
use job::files::FileError;

/// A setting of [`DsmConfig`](crate::DsmConfig) that an error names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DsmSetting {
    /// `output`.
    Output,
    /// `gsd_m`.
    CellSize,
    /// `crs_epsg`.
    Crs,
    /// `bounds`.
    Bounds,
    /// `height_range_m`.
    HeightRange,
    /// `dem`.
    Dem,
    /// `reference_dem`.
    ReferenceDem,
    /// `masks`.
    Masks,
    /// `image_masks`.
    ImageMasks,
    /// `control`.
    Control,
    /// `pairs`.
    Pairs,
    /// `references`.
    References,
    /// `threads`.
    Threads,
    /// `chunk`.
    ChunkSide,
    /// `tile`.
    TileSide,
}

impl DsmSetting {
    /// Returns the setting in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Output => "the output folder",
            Self::CellSize => "the cell size",
            Self::Crs => "the coordinate reference system",
            Self::Bounds => "the bounds",
            Self::HeightRange => "the height range",
            Self::Dem => "the elevation model",
            Self::ReferenceDem => "the reference elevation model",
            Self::Masks => "the mask",
            Self::ImageMasks => "the mask of an image",
            Self::Control => "the file of ground points",
            Self::Pairs => "the list of image pairs",
            Self::References => "the list of reference images",
            Self::Threads => "the number of threads",
            Self::ChunkSide => "the side of the chunks",
            Self::TileSide => "the side of the tiles",
        }
    }
}

impl fmt::Display for DsmSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.in_words())
    }
}

/// The reason why a DSM run ended without a result. No result file was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DsmError {
    /// There are fewer than two images.
    #[error("found {found} image(s), expected at least 2: heights come from the parallax between views")]
    TooFewImages {
        /// Number of images given.
        found: usize,
    },
    /// A folder is given in the place of an image.
    #[error(
        "a folder is given as an image ({}); give the images in it: {}",
        if images.is_empty() { "it holds no TIFF".to_owned() } else { format!("it holds {}", images.join(", ")) },
        path.display()
    )]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Names of the TIFFs in it, a few at most.
        images: Vec<String>,
    },
    /// One image is given twice.
    #[error("the same image is given twice; remove one: {}", path.display())]
    SameImage {
        /// File of the image.
        path: PathBuf,
    },
    /// An input changed while it was read.
    #[error("an input was changed or replaced during the run, which may have read both; run again: {}", path.display())]
    InputChanged {
        /// The input.
        path: PathBuf,
    },
    /// The city model cannot serve as prior.
    #[error("cannot use the city model as prior: {}", path.display())]
    Prior {
        /// File of the model.
        path: PathBuf,
        /// Kind of the cause.
        kind: Kind,
        /// Cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The scene cannot be co-registered to its reference.
    #[error(
        "the scene cannot be co-registered to its reference elevation model: {reason}; \
         give another reference, or leave it out: {}",
        path.display()
    )]
    Reference {
        /// The reference.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The polygons of an area or of a mask cannot be used.
    #[error(transparent)]
    Area(#[from] formats::areas::AreaError),
    /// The ground points cannot be used.
    #[error(transparent)]
    Control(formats::FormatError),
    /// The pointing corrections to start from cannot be read.
    #[error(transparent)]
    Corrections(JobError),
    /// An image cannot be read, or a raster cannot be written.
    #[error("cannot read the image")]
    Image(#[from] formats::raster::RasterError),
    /// An image has no usable RPC.
    #[error("no usable RPC for an image")]
    Rpc(#[source] Box<formats::rpc::RpcReadError>),
    /// An RPC has no ground under its image.
    #[error("the RPC has no ground under the image; is it the RPC of this image? {}: {source}", path.display())]
    Camera {
        /// File of the image.
        path: PathBuf,
        /// Failure of the camera model.
        source: camera::CameraError,
    },
    /// All pixels of an image have one value.
    #[error("an image has no contrast: all its pixels have one value or none; give another one: {}", path.display())]
    Blank {
        /// File of the image.
        path: PathBuf,
    },
    /// Two images are one picture with different RPCs.
    #[error(
        "no parallax: two images are one picture, whose copies differ by compression, brightness, noise or a cut \
         border at most; remove one, or give the image that its RPC belongs to: {} and {}",
        first.display(), second.display()
    )]
    SamePixels {
        /// File of the first image.
        first: PathBuf,
        /// File of the second image.
        second: PathBuf,
    },
    /// There are too few tie points to correct the pointing.
    #[error(
        "found {ties} tie points, expected at least {needed}: the pointing of the RPCs cannot be corrected; \
         check that the images show the same ground and that each RPC belongs to its image, or use the RPCs as \
         they are: {}",
        images.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
    )]
    NoPointing {
        /// Number of tie points found.
        ties: usize,
        /// Least number that is enough.
        needed: usize,
        /// Files of the images.
        images: Vec<PathBuf>,
    },
    /// There are too few tie points to find the height range.
    #[error(
        "found {ties} tie points, expected at least {needed}: the height range cannot be found automatically; \
         give a height range or an elevation model, and check that the images show the same ground"
    )]
    NoTies {
        /// Number of tie points found.
        ties: usize,
        /// Least number that is enough.
        needed: usize,
    },
    /// The given height range misses the scene.
    #[error(
        "the height range {} to {} m misses the scene, \
         whose tie points lie between {:.0} and {:.0} m above the ellipsoid; \
         leave the height range out, or give heights above the ellipsoid",
        asked.low_m, asked.high_m, seen.low_m, seen.high_m
    )]
    RangeMissesScene {
        /// Height range that was asked for.
        asked: HeightRange,
        /// Heights of the tie points.
        seen: HeightRange,
    },
    /// The elevation model has other heights than the scene.
    #[error(
        "the elevation model has heights from {:.0} to {:.0} m under the scene, whose tie points lie between {:.0} and \
         {:.0} m above the ellipsoid; check the model, its unit and its vertical datum, or leave it out",
        dem.low_m, dem.high_m, seen.low_m, seen.high_m
    )]
    DemMissesScene {
        /// Heights of the model over the scene, metres above the ellipsoid.
        dem: HeightRange,
        /// Heights of the tie points.
        seen: HeightRange,
    },
    /// A setting has a value that cannot be used.
    #[error("{setting} is {found}, expected {expected}")]
    Value {
        /// Setting with the wrong value.
        setting: DsmSetting,
        /// Value that was given.
        found: String,
        /// Description of the values that can be used.
        expected: String,
    },
    /// The requested bounds are not covered by the images.
    #[error(
        "the bounds [{}] share no ground with the images, which cover [{}] in EPSG:{epsg}{}",
        bounds.to_array().map(plain_number).join(", "), covered.to_array().map(plain_number).join(", "),
        axes_hint(*bounds, *covered)
    )]
    BoundsMissScene {
        /// Requested area.
        bounds: MapBounds,
        /// Area that the images cover.
        covered: MapBounds,
        /// EPSG code of the CRS of both areas.
        epsg: u32,
    },
    /// The polygons of the requested area are not covered by the images.
    #[error(
        "the polygons lie at {}, and the images see {}{}: {}",
        degrees(*area), degrees(*covered), axes_hint(*area, *covered), path.display()
    )]
    AreaMissesScene {
        /// File of the polygons.
        path: PathBuf,
        /// Longitudes and latitudes of the polygons.
        area: MapBounds,
        /// Longitudes and latitudes that the images cover.
        covered: MapBounds,
    },
    /// No height survived.
    #[error(
        "no two views agree on any height between {:.0} and {:.0} m: the images may not show the same ground, \
         or its heights lie outside", range.low_m, range.high_m
    )]
    NoSurface {
        /// Heights that were searched.
        range: HeightRange,
    },
    /// The smallest piece of work needs more memory than the limit.
    #[error(
        "the run needs about {needed_mb} MB and the limit is {limit_mb} MB; \
         raise the memory limit or give smaller bounds"
    )]
    Memory {
        /// Estimated need, megabytes.
        needed_mb: u64,
        /// Limit, megabytes.
        limit_mb: u64,
    },
    /// Results exist and may not be replaced.
    #[error("results exist and would be replaced; choose another folder or allow replacing them: {}", path.display())]
    Exists {
        /// First file found.
        path: PathBuf,
    },
    /// The output cannot be written.
    #[error("cannot write the output; check the folder's permissions and space: {}: {source}", path.display())]
    Output {
        /// File or folder that failed.
        path: PathBuf,
        /// Answer of the system.
        source: std::io::Error,
    },
    /// Another run writes into the output folder.
    #[error("another run is writing into the folder; wait for its end or choose another folder: {}", path.display())]
    InUse {
        /// Output folder.
        path: PathBuf,
    },
    /// A file of the output cannot be written.
    #[error(transparent)]
    File(FileError),
    /// The DSM is complete, but a product of it could not be made.
    #[error("the surface model is complete, but a product of it could not be made")]
    Products(#[source] Box<JobError>),
    /// A stored result of a chunk cannot be read.
    #[error("cannot read the result of a chunk ({reason}): {}", path.display())]
    ChunkFile {
        /// File or folder that failed.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The result of a chunk cannot be one of the plan.
    #[error(
        "the result of chunk {index} cannot be one of the plan: found {found}, expected {expected}; remove the folder \
         of the chunk and compute it again"
    )]
    ChunkContent {
        /// Number of the chunk, counted from 0.
        index: usize,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The plan has no chunk of a number.
    #[error("the plan has {count} chunks and none with number {index}")]
    NoSuchChunk {
        /// Number that was asked for, counted from 0.
        index: usize,
        /// Number of chunks.
        count: usize,
    },
    /// Results of chunks are missing, or there is more than one for a chunk.
    #[error("{found} of the {count} chunks of the plan have a result; compute each chunk once before merging")]
    ChunksMissing {
        /// Number of results given.
        found: usize,
        /// Number of chunks in the plan.
        count: usize,
    },
    /// The coordinate reference system or the vertical datum cannot be used.
    #[error("cannot use the coordinate reference system")]
    Crs(#[from] crs::CrsError),
    /// The views cannot be matched, or the height sweep failed.
    #[error(transparent)]
    Reconstruct(ReconstructError),
    /// The worker threads cannot be started.
    #[error(transparent)]
    Threads(JobError),
    /// The caller asked the run to stop.
    #[error("the run was cancelled")]
    Cancelled,
}

failures!(DsmError: Other {
    Self::TooFewImages { .. }
    | Self::Folder { .. }
    | Self::SameImage { .. }
    | Self::Value { .. }
    | Self::BoundsMissScene { .. }
    | Self::RangeMissesScene { .. }
    | Self::NoSuchChunk { .. }
    | Self::Memory { .. } => Kind::Input,
    Self::Exists { .. } => Kind::OutputExists,
    Self::InUse { .. } => Kind::InUse,
    Self::Output { .. } | Self::ChunkFile { .. } => Kind::File,
    Self::Prior { kind, .. } => *kind,
    Self::Area(error) => error.kind(),
    Self::Control(error) => error.kind(),
    Self::Corrections(error) => error.kind(),
    Self::Image(error) => error.kind(),
    Self::Rpc(error) => error.kind(),
    Self::File(error) => error.kind(),
    Self::Products(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Reconstruct(error) => error.kind(),
    Self::Threads(error) => error.kind(),
    Self::Cancelled => Kind::Cancelled,
});

/// Writes a rectangle of longitudes and latitudes.
pub(crate) fn degrees(place: MapBounds) -> String {
    let MapBounds { x_min, y_min, x_max, y_max } = place;
    format!("longitudes {x_min:.4}° to {x_max:.4}° and latitudes {y_min:.4}° to {y_max:.4}°")
}

/// Says that a rectangle would meet the scene with x and y exchanged, if it would.
pub(crate) fn axes_hint(found: MapBounds, scene: MapBounds) -> &'static str {
    let is_swapped = !found.meets(scene) && found.swapped().meets(scene);
    if is_swapped { "; with x and y exchanged they would meet: give x (longitude, easting) first" } else { "" }
}

impl DsmError {
    /// Returns the setting or the input that the error is about, in words.
    pub fn setting(&self) -> Option<&'static str> {
        Some(match self {
            Self::NoPointing { .. } => "the pointing",
            Self::NoTies { .. } => "the heights to search",
            Self::Reconstruct(ReconstructError::Sweep(
                SweepError::TooManyHypotheses { .. } | SweepError::HeightsTooFar { .. },
            )) => "the heights",
            Self::RangeMissesScene { .. } => "the given height range",
            Self::Memory { .. } => "the limit of memory",
            Self::BoundsMissScene { .. } => "the given bounds",
            Self::AreaMissesScene { .. } => "the area",
            Self::Prior { .. } => "the city model",
            Self::Value { setting, .. } => setting.in_words(),
            _ => return None,
        })
    }

    /// Makes the error of a setting with a wrong value.
    pub(crate) fn value(setting: DsmSetting, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Value { setting, found: found.into(), expected: expected.into() }
    }
}

from_steps!(DsmError: Rpc(formats::rpc::RpcReadError));

impl From<FileError> for DsmError {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Exists { path } => Self::Exists { path },
            FileError::InUse { path } => Self::InUse { path },
            FileError::Folder { path, source } | FileError::Unwritable { path, source } => {
                Self::Output { path, source }
            }
            other => Self::File(other),
        }
    }
}

impl From<ReconstructError> for DsmError {
    fn from(error: ReconstructError) -> Self {
        match error {
            ReconstructError::Crs(error) => Self::Crs(error),
            ReconstructError::Cancelled => Self::Cancelled,
            ReconstructError::Cells { columns, rows, cell: (width, height) } => Self::value(
                DsmSetting::Bounds,
                format!("a grid of {columns:.0} × {rows:.0} cells of {width} × {height} map units"),
                format!("1 to {CELLS_MAX:.0} cells; bounds are x_min y_min x_max y_max in the DSM's CRS"),
            ),
            other => Self::Reconstruct(other),
        }
    }
}

impl From<SweepError> for DsmError {
    fn from(error: SweepError) -> Self {
        Self::Reconstruct(error.into())
    }
}

impl From<numeric::Cancelled> for DsmError {
    fn from(_: numeric::Cancelled) -> Self {
        Self::Cancelled
    }
}

impl From<ProductsError> for DsmError {
    fn from(error: ProductsError) -> Self {
        match error {
            error if error.kind() == Kind::Cancelled => Self::Cancelled,
            other => Self::Products(Box::new(other.into())),
        }
    }
}
