//! The city model that priors are made of.

use city::{LodChoice, MeshConfig, MeshedModel, ObjectStatus, Scope, TriangleMesh};
use cityfiles::CityFile;

use super::config::PriorsConfig;
use super::error::PriorsJobError;

/// A model with its triangles.
pub(super) struct UsableModel {
    pub(super) file: CityFile,
    pub(super) meshed: MeshedModel,
}

impl UsableModel {
    /// Reads a model and makes its triangles, of which there must be some.
    pub(super) fn read(config: &PriorsConfig) -> Result<Self, PriorsJobError> {
        let file = cityfiles::read(&config.model)?;
        let mesh_config = MeshConfig {
            lod: config.lod.map_or_else(LodChoice::default, LodChoice::Only),
            scope: if config.all_objects { Scope::Everything } else { Scope::Buildings },
        };
        let meshed = TriangleMesh::from_model(&file.model, &mesh_config)?;
        if meshed.mesh.triangles.is_empty() {
            return Err(PriorsJobError::NoObject { path: config.model.clone(), objects: file.model.objects.len() });
        }
        Ok(Self { file, meshed })
    }

    /// Number of objects that could not be used.
    pub(super) fn unusable(&self) -> usize {
        self.meshed.objects.iter().filter(|object| object.status == ObjectStatus::Unusable).count()
    }
}
