//! Describing an RPC: offsets, validity box, ground sampling distance and viewing direction, and
//! the image that it belongs to.
//!
//! The ground sampling distance and the viewing direction hold at the centre of the RPC's domain,
//! at the height offset. The incidence is the angle at the ground between the vertical and the
//! sensor. The azimuth is the direction to the sensor, clockwise from north.

use std::path::PathBuf;

use camera::{CameraError, ImagePoint, Rpc, RpcCamera};
use formats::rpc::RpcFormat;
use geodesy::LonLatHeight;
use job::error::JobError;
use serde::{Deserialize, Serialize};

use super::error::RpcJobError;
use super::input;
use super::pixels::{self, RpcPixels};
use numeric::Progress;

/// The file whose RPC is described.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RpcInfoConfig {
    /// RPC file, or image with an RPC.
    pub file: PathBuf,
}

/// An RPC and what follows from it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcInfoReport {
    /// The file that was asked for.
    pub file: String,
    /// The file that holds the RPC: `file`, or one beside it.
    pub source: String,
    /// Container of the RPC.
    pub format: RpcFormat,
    /// Warnings of the reader, such as conventions that it had to guess.
    pub warnings: Vec<String>,
    /// The image, where the file holds one.
    pub image: Option<RpcPixels>,
    /// The model.
    pub rpc: Rpc,
    /// Box on which the model was fitted.
    pub validity: RpcValidity,
    /// Geometry at the centre of the domain; absent where the model cannot be inverted there.
    pub centre: Option<RpcCentre>,
}

/// Box on which an RPC was fitted, each pair least and greatest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RpcValidity {
    /// Longitudes, degrees.
    pub lon_deg: [f64; 2],
    /// Latitudes, degrees.
    pub lat_deg: [f64; 2],
    /// Heights above the ellipsoid, metres.
    pub height_m: [f64; 2],
}

/// Geometry at the centre of an RPC's domain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RpcCentre {
    /// The centre on the ground.
    pub ground: LonLatHeight,
    /// The centre in the image.
    pub image: ImagePoint,
    /// Ground distance of one step along the sample axis, metres.
    pub gsd_sample_m: f64,
    /// Ground distance of one step along the line axis, metres.
    pub gsd_line_m: f64,
    /// Angle between the vertical and the direction to the sensor, degrees.
    pub incidence_deg: f64,
    /// Direction to the sensor, degrees clockwise from north.
    pub azimuth_deg: f64,
}

impl RpcInfoConfig {
    /// A description of the RPC of `file`.
    pub fn new(file: PathBuf) -> Self {
        Self { file }
    }
}

/// Describes the RPC of a file.
///
/// # Errors
/// [`JobError`] when the file holds no usable RPC.
///
/// ```
/// use scenes::rpc::{RpcInfoConfig, info};
/// let image = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
/// let report = info(&RpcInfoConfig::new(image.into()), &numeric::Silent)?;
/// assert!(report.centre.is_some_and(|centre| centre.gsd_line_m > 0.1));
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn info(config: &RpcInfoConfig, progress: &dyn Progress) -> Result<RpcInfoReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &RpcInfoConfig, progress: &dyn Progress) -> Result<RpcInfoReport, RpcJobError> {
    let file = input::read(&config.file, progress)?;
    let centre = centre(&file.rpc);
    if let Err(e) = &centre {
        progress.warn(&format!("no ground sampling distance and viewing angles: {e}"));
    }
    Ok(RpcInfoReport {
        file: config.file.display().to_string(),
        source: file.source.display().to_string(),
        format: file.format,
        warnings: file.warnings,
        image: pixels::of_file(&config.file, &file.rpc),
        validity: validity(&file.rpc),
        centre: centre.ok(),
        rpc: file.rpc,
    })
}

fn validity(rpc: &Rpc) -> RpcValidity {
    let domain = rpc.domain();
    let (low, high) = (domain.at([-1.0; 3]), domain.at([1.0; 3]));
    RpcValidity {
        lon_deg: [low.lon_deg, high.lon_deg],
        lat_deg: [low.lat_deg, high.lat_deg],
        height_m: [low.height_m, high.height_m],
    }
}

fn centre(rpc: &Rpc) -> Result<RpcCentre, CameraError> {
    let ground = rpc.domain().centre;
    let camera = RpcCamera::new(rpc.clone());
    let (gsd, view) = (camera.gsd(ground)?, camera.view_direction(ground)?);
    Ok(RpcCentre {
        ground,
        image: camera.project(ground)?,
        gsd_sample_m: gsd.sample_m,
        gsd_line_m: gsd.line_m,
        incidence_deg: view.incidence_deg(),
        azimuth_deg: view.azimuth_deg(),
    })
}
