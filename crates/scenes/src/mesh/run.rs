//! Makes a mesh and writes it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use cityfiles::surfaces::SurfaceFile;
use formats::coloured_mesh::{ColouredMesh, write_mesh_glb, write_mesh_ply};
use numeric::Progress;
use serde::Serialize;
use tsdf::{DepthView, FusedMesh, TsdfConfig, fuse};

use super::config::MeshJobConfig;
use super::depths;
use super::error::MeshJobError;
use crate::train::DatasetPlace;
use job::dataset_folder::sparse_folder;
use job::error::JobError;
use job::files::{self, FileError};
use job::report_page;
use job::threads;
use surfaces::eval::{SurfaceEvalConfig, SurfaceEvalReport, evaluate_surface};

/// A finished mesh.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct MeshJobReport {
    /// The settings.
    pub settings: MeshJobConfig,
    /// Number of depth maps.
    pub maps: usize,
    /// Number of corners.
    pub corners: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of small parts that were left out.
    pub parts_left_out: usize,
    /// Seconds of the fusion.
    pub seconds: f64,
    /// The comparison with the reference.
    pub comparison: Option<SurfaceEvalReport>,
}

impl MeshJobReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut text = format!(
            "mesh      {} ({} triangles of {} depth maps, {:.0} s)\n",
            self.settings.output.display(),
            self.triangles,
            self.maps,
            self.seconds,
        );
        if let Some(comparison) = &self.comparison {
            let result = &comparison.result;
            text += &format!(
                "distance  {:.3} m to the reference, {:.3} m from it, Chamfer {:.3} m\n",
                result.accuracy.mean_m, result.completeness.mean_m, result.chamfer_m
            );
            for score in &result.scores {
                text += &format!(
                    "{:7.2} m right {:.1} %, complete {:.1} %\n",
                    score.threshold_m,
                    100.0 * score.precision,
                    100.0 * score.recall
                );
            }
        }
        text
    }
}

/// Fuses the depth maps of a dataset and writes the mesh.
///
/// # Errors
/// [`JobError`]: a dataset that cannot be read, maps of another size, a volume that is too
/// large, an output that exists.
pub fn run(config: &MeshJobConfig, progress: &dyn Progress) -> Result<MeshJobReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &MeshJobConfig, progress: &dyn Progress) -> Result<MeshJobReport, MeshJobError> {
    config.validate()?;
    files::check_destination(&config.output, config.overwrite)?;
    let report_path = report_path(&config.output);
    report_page::refuse_existing(&report_path, config.overwrite)?;
    let report = threads::install(config.threads, || make(config, progress))??;
    let lead = "The surface of fused depth maps.";
    report_page::write(&report_path, ("Mesh", lead), &report, Vec::new(), config.overwrite)?;
    Ok(report)
}

/// Returns the report beside a mesh.
fn report_path(mesh: &Path) -> PathBuf {
    mesh.with_extension("report.json")
}

fn make(config: &MeshJobConfig, progress: &dyn Progress) -> Result<MeshJobReport, MeshJobError> {
    let mut model = formats::colmap::read(&sparse_folder(&config.dataset))?;
    let place = DatasetPlace::read(&config.dataset, &mut model)?;
    let maps = depths::read(config, &model, &place, progress)?;
    progress.check_cancelled()?;
    progress.begin("fusion", 1);
    let begun = Instant::now();
    let views: Vec<DepthView<'_>> = maps
        .iter()
        .map(|map| DepthView {
            lens: &map.lens,
            pose: &map.view.pose,
            depth_m: &map.depth_m,
            colour: map.colour.as_ref(),
        })
        .collect();
    let mut settings = TsdfConfig::default();
    settings.voxel_m = config.voxel_m;
    settings.truncation_m = config.truncation_m.unwrap_or(4.0 * config.voxel_m);
    settings.least_views = config.least_views;
    settings.memory_bytes = (config.memory_gib * (1u64 << 30) as f64) as usize;
    let whole = fuse(&views, &settings)?;
    let (mesh, parts_left_out) = whole.without_small_parts(config.least_part_m2);
    if mesh.triangles.is_empty() {
        return Err(MeshJobError::Empty { triangles: whole.triangles.len() });
    }
    let seconds = begun.elapsed().as_secs_f64();
    progress.step();
    progress.check_cancelled()?;
    write(config, &mesh, &place)?;
    Ok(MeshJobReport {
        settings: config.clone(),
        maps: maps.len(),
        corners: mesh.positions.len(),
        triangles: mesh.triangles.len(),
        parts_left_out,
        seconds,
        comparison: compared(config, &mesh, &place, progress)?,
    })
}

fn write(config: &MeshJobConfig, mesh: &FusedMesh, place: &DatasetPlace) -> Result<(), FileError> {
    let coloured = coloured(mesh, place);
    let write = if config.is_glb() { write_mesh_glb } else { write_mesh_ply };
    write(&config.output, &coloured, config.overwrite).map_err(FileError::write)
}

/// Returns the mesh in the frame of the model, where the dataset says which it is.
fn coloured<'a>(mesh: &'a FusedMesh, place: &'a DatasetPlace) -> ColouredMesh<'a> {
    ColouredMesh {
        positions: &mesh.positions,
        colours: &mesh.colours,
        triangles: &mesh.triangles,
        origin: [0, 1, 2].map(|i| mesh.origin[i] + place.origin.origin[i]),
        crs: Some(place.origin.crs.as_str()).filter(|_| place.is_on_a_map()),
    }
}

/// Compares the mesh with the reference, where there is one.
fn compared(
    config: &MeshJobConfig,
    mesh: &FusedMesh,
    place: &DatasetPlace,
    progress: &dyn Progress,
) -> Result<Option<SurfaceEvalReport>, MeshJobError> {
    let Some(reference) = &config.reference else { return Ok(None) };
    let ColouredMesh { positions, triangles, origin, crs, .. } = coloured(mesh, place);
    let positions = positions.iter().map(|p| [0, 1, 2].map(|i| f64::from(p[i]) + origin[i])).collect();
    let test = SurfaceFile::of_mesh(&config.output, positions, triangles.to_vec(), crs);
    let eval = SurfaceEvalConfig::new(config.output.clone(), reference.clone());
    let report = evaluate_surface(test, &eval, progress).map_err(|error| MeshJobError::Comparison(Box::new(error)))?;
    Ok(Some(report))
}
