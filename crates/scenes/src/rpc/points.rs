//! Projecting ground points into an image, and localizing image positions at a given height.

use std::path::PathBuf;

use camera::{CameraError, ImagePoint, Rpc};
use geodesy::LonLatHeight;
use job::error::JobError;
use serde::{Deserialize, Serialize};

use super::error::RpcJobError;
use super::input;
use numeric::Progress;

/// Which way points go through the camera model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RpcDirection {
    /// From the ground into the image.
    Project,
    /// From the image to the ground at a given height.
    Localize,
}

/// A question to the camera model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum RpcQuery {
    /// Where in the image is this ground point?
    Project(LonLatHeight),
    /// Which ground point of this height is seen at this image position?
    Localize {
        /// Position in the image, pixels.
        image: ImagePoint,
        /// Height above the ellipsoid, metres.
        height_m: f64,
    },
}

/// Points to be answered by the RPC of one file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RpcPointsConfig {
    /// RPC file, or image with an RPC.
    pub file: PathBuf,
    /// The questions.
    pub queries: Vec<RpcQuery>,
}

/// A ground point and its place in the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RpcPoint {
    /// Position on the ground.
    pub ground: LonLatHeight,
    /// Position in the image.
    pub image: ImagePoint,
}

/// Answers in the order of the questions.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcPointsReport {
    /// One point per question.
    pub points: Vec<RpcPoint>,
}

impl RpcPointsConfig {
    /// Questions to the RPC of `file`.
    pub fn new(file: PathBuf, queries: Vec<RpcQuery>) -> Self {
        Self { file, queries }
    }
}

impl RpcQuery {
    /// The question that three numbers ask: longitude, latitude, height, or sample, line, height.
    pub(super) fn from_numbers(direction: RpcDirection, [first, second, height_m]: [f64; 3]) -> Self {
        match direction {
            RpcDirection::Project => Self::Project(LonLatHeight::new(first, second, height_m)),
            RpcDirection::Localize => Self::Localize { image: ImagePoint::new(first, second), height_m },
        }
    }

    fn numbers(self) -> [f64; 3] {
        match self {
            Self::Project(ground) => [ground.lon_deg, ground.lat_deg, ground.height_m],
            Self::Localize { image, height_m } => [image.sample, image.line, height_m],
        }
    }

    pub(super) fn answer(self, rpc: &Rpc) -> Result<RpcPoint, CameraError> {
        match self {
            Self::Project(ground) => Ok(RpcPoint { ground, image: rpc.project(ground)? }),
            Self::Localize { image, height_m } => Ok(RpcPoint { ground: rpc.localize(image, height_m)?, image }),
        }
    }
}

/// Projects and localizes points.
///
/// # Errors
/// [`JobError`] without a usable RPC, and at the first point without an answer.
///
/// ```
/// use camera::ImagePoint;
/// use scenes::rpc::{RpcPointsConfig, RpcQuery, points};
/// let image = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
/// let question = RpcQuery::Localize { image: ImagePoint::new(100.0, 50.0), height_m: 60.0 };
/// let answer = points(&RpcPointsConfig::new(image.into(), vec![question]), &numeric::Silent)?.points[0];
/// let back = RpcQuery::Project(answer.ground);
/// let back = points(&RpcPointsConfig::new(image.into(), vec![back]), &numeric::Silent)?.points[0];
/// assert!((back.image.sample - 100.0).abs() < 1e-4);
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn points(config: &RpcPointsConfig, progress: &dyn Progress) -> Result<RpcPointsReport, JobError> {
    let rpc = input::read(&config.file, progress)?.rpc;
    let answer = |query: &RpcQuery| {
        query.answer(&rpc).map_err(|source| RpcJobError::NoAnswer { point: query.numbers(), source })
    };
    Ok(RpcPointsReport { points: config.queries.iter().map(answer).collect::<Result<_, _>>()? })
}
