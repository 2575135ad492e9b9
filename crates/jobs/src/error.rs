//! Why a run ends without a result.

use std::path::PathBuf;

/// An input or a request that cannot be served; nothing was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// Fewer images than a surface needs.
    #[error("found {found} image(s), expected at least 2: heights come from the parallax between views")]
    TooFewImages {
        /// How many were given.
        found: usize,
    },
    /// The same image twice.
    #[error("the same image is given twice; remove one: {}", path.display())]
    SameImage {
        /// Its path.
        path: PathBuf,
    },
    /// A city model cannot be the prior.
    #[error("cannot use the city model as prior: {}", path.display())]
    Prior {
        /// The model.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An image could not be read.
    #[error("cannot read the image")]
    Image(#[from] io::raster::RasterError),
    /// An image has no usable RPC.
    #[error("no usable RPC for an image")]
    Rpc(#[source] Box<io::rpc::RpcReadError>),
    /// An RPC has no ground under its image.
    #[error("the RPC has no ground under the image; is it the RPC of this image? {}: {source}", path.display())]
    Camera {
        /// The image.
        path: PathBuf,
        /// What the camera model said.
        source: camera::CameraError,
    },
    /// No two images share ground.
    #[error(
        "the images share no ground (largest overlap {share_percent:.1} % of an image); check that the RPCs belong to the images"
    )]
    NoOverlap {
        /// The largest overlap found, percent of the smaller footprint.
        share_percent: f64,
    },
    /// No two overlapping images look from different directions.
    #[error(
        "no parallax: the overlapping images look along the same line (largest angle {angle_deg:.2}°, needed {needed_deg}°); \
         add an image from another direction"
    )]
    NoParallax {
        /// The largest intersection angle, degrees.
        angle_deg: f64,
        /// The least one that gives heights.
        needed_deg: f64,
    },
    /// An image of one value.
    #[error("an image has no contrast: all its pixels have one value or none; give another one: {}", path.display())]
    Blank {
        /// The image.
        path: PathBuf,
    },
    /// The same pixels under two RPCs.
    #[error(
        "no parallax: two images have the same pixels; remove one, or give the image that its RPC belongs to: {} and {}",
        first.display(), second.display()
    )]
    SamePixels {
        /// The first of the two.
        first: PathBuf,
        /// The second.
        second: PathBuf,
    },
    /// The matcher found nothing that tells the heights.
    #[error(
        "found {ties} tie points, expected at least {needed}: the height range cannot be found automatically; \
         give --height-range LO HI or --dem, and check that the images show the same ground"
    )]
    NoTies {
        /// How many were found.
        ties: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The given height range misses the scene.
    #[error(
        "the height range {0} to {1} m misses the scene, whose tie points lie between {2:.0} and {3:.0} m above the ellipsoid; \
         leave --height-range out, or give heights above the ellipsoid", range.0, range.1, seen.0, seen.1
    )]
    RangeMissesScene {
        /// What was asked for.
        range: (f64, f64),
        /// What the tie points show.
        seen: (f64, f64),
    },
    /// A value that makes no sense.
    #[error("{name} is {found}, expected {expected}")]
    Value {
        /// The option.
        name: &'static str,
        /// What was given.
        found: String,
        /// What would do.
        expected: String,
    },
    /// The area asked for is not covered.
    #[error("the bounds {bounds:?} share no ground with the images, which cover {covered:?} in EPSG:{epsg}")]
    BoundsMissScene {
        /// What was asked for.
        bounds: [f64; 4],
        /// What there is.
        covered: [f64; 4],
        /// The CRS of both.
        epsg: u32,
    },
    /// No height survived.
    #[error(
        "no two views agree on any height between {0:.0} and {1:.0} m: the images may not show the same ground, \
         or its heights lie outside", range.0, range.1
    )]
    NoSurface {
        /// The heights searched.
        range: (f64, f64),
    },
    /// Not enough memory for the smallest piece of work.
    #[error(
        "the run needs about {needed_mb} MB and the limit is {limit_mb} MB; raise --memory or give smaller --bounds"
    )]
    Memory {
        /// The estimate.
        needed_mb: u64,
        /// The limit.
        limit_mb: u64,
    },
    /// Results exist.
    #[error("results exist and would be replaced; choose another folder or add --overwrite: {}", path.display())]
    Exists {
        /// The first file found.
        path: PathBuf,
    },
    /// The output cannot be written.
    #[error("cannot write the output; check the folder's permissions and space: {}: {source}", path.display())]
    Output {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// CRS or datum trouble.
    #[error("cannot use the coordinate reference system")]
    Geodesy(#[from] crs::CrsError),
    /// The sweep failed.
    #[error("the height sweep failed")]
    Sweep(#[from] sweep::SweepError),
    /// The thread pool could not be made.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many.
        threads: usize,
        /// What the pool said.
        reason: String,
    },
}

impl From<io::rpc::RpcReadError> for PipelineError {
    fn from(e: io::rpc::RpcReadError) -> Self {
        // Boxed: it is several times larger than the other variants.
        Self::Rpc(Box::new(e))
    }
}
