//! Reading a city model and making its triangles.

use city::{LodChoice, MeshConfig, MeshedModel, Scope, TriangleMesh};
use cityfiles::CityFile;

use super::config::CityInput;
use super::error::CityJobError;
use numeric::Progress;

/// A model with its triangles.
pub(super) struct OpenedCity {
    pub(super) file: CityFile,
    pub(super) meshed: MeshedModel,
}

/// Reads a model and makes its triangles. Solids are checked where an account is asked for.
pub(super) fn open(input: &CityInput, progress: &dyn Progress) -> Result<OpenedCity, CityJobError> {
    progress.begin("reading the model", 2 + usize::from(input.account.is_some()));
    let file = cityfiles::read(&input.file)?;
    progress.step();
    progress.check_cancelled()?;
    let config = MeshConfig {
        lod: input.lod.map_or_else(LodChoice::default, LodChoice::Only),
        scope: if input.all_objects { Scope::Everything } else { Scope::Buildings },
    };
    let mut meshed = TriangleMesh::from_model(&file.model, &config)?;
    progress.step();
    if input.account.is_some() {
        meshed.defects.extend(city::check_solids(&file.model, &config)?);
        progress.step();
    }
    Ok(OpenedCity { file, meshed })
}
