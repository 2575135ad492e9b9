//! The city model jobs: an account of a model, and its triangles, footprints or objects in another
//! format.
//!
//! A model is incomplete when objects have no usable surface, or when the reader had to drop
//! surfaces. That is a result and not an error: the account names every object, used or not, with
//! the reason.

mod account;
mod config;
mod convert;
mod error;
mod input;
mod text;

pub use account::{CityAccount, CityCrsSummary, CityDefectCount, CityDefectEntry, CityObjectEntry, CitySummary};
pub use config::{CityConvertConfig, CityInfoConfig, CityInput, CityOutputFormat};
pub use convert::{CityConvertReport, convert};

use job::error::JobError;
use numeric::Progress;

/// Describes a city model and writes the account of every object where the configuration names a
/// file for it.
///
/// # Errors
/// [`JobError`]: a model that cannot be read, an account that exists or cannot be written.
///
/// ```
/// use scenes::city::{CityInfoConfig, info};
/// let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/buildings.city.json");
/// let summary = info(&CityInfoConfig::new(model.into()), &numeric::Silent)?;
/// assert!(summary.triangles > 100 && !summary.incomplete);
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn info(config: &CityInfoConfig, progress: &dyn Progress) -> Result<CitySummary, JobError> {
    let opened = input::open(&config.input, progress)?;
    let account = CityAccount::of(&opened);
    account.write(&config.input)?;
    Ok(account.summary)
}
