//! The camera of an image as a DSM run corrected its pointing.

use std::path::Path;

use camera::RpcCamera;

use job::corrections::image_of_run;
use job::error::JobError;

/// Returns the camera of an image with the pointing correction that a DSM run found for it.
///
/// `run` is the folder of the run. `image` is the path of the image, or its file name alone where
/// that is unique among the images of the run. The RPC is read from the image, which lies at the
/// path given here, or else where the run found it.
///
/// # Errors
/// [`JobError`] if the folder holds no report, the run did not use the image, or the image has no
/// usable RPC.
pub fn camera_of_run(run: &Path, image: &Path) -> Result<RpcCamera, JobError> {
    let (place, correction) = image_of_run(run, image)?;
    Ok(RpcCamera { rpc: formats::rpc::read_for_image(&place)?.rpc, correction })
}
