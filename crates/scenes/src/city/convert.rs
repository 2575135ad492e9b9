//! Writing a city model in another format.

use std::collections::BTreeMap;

use cityfiles::{CityJsonOptions, MeshFormat, move_images, write_cityjson, write_footprints, write_mesh};
use serde::Serialize;

use super::account::{CityAccount, CitySummary};
use super::config::{CityConvertConfig, CityOutputFormat};
use super::error::CityJobError;
use super::input::{self, OpenedCity};
use job::error::JobError;
use job::files;
use numeric::Progress;

/// What a conversion wrote.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CityConvertReport {
    /// Numbers about the model.
    pub summary: CitySummary,
    /// Format that was written.
    pub format: CityOutputFormat,
    /// Used objects that have no surface that looks down, and therefore no footprint; 0 for other
    /// formats.
    pub without_footprint: usize,
}

/// Writes the triangles (OBJ, PLY, glTF), the footprints with heights (GeoJSON) or the objects
/// (CityJSON 2.0) of a model.
///
/// # Errors
/// [`JobError`]: an unknown ending of the output, a model that cannot be read, no object with a
/// surface to write (CityJSON takes all objects and levels), an output that exists or cannot be
/// written.
///
/// ```
/// use scenes::city::{CityConvertConfig, convert};
/// let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/buildings.city.json");
/// let folder = tempfile::tempdir()?;
/// let output = folder.path().join("town.obj");
/// convert(&CityConvertConfig::new(model.into(), output.clone()), &numeric::Silent)?;
/// assert!(std::fs::read_to_string(output)?.contains("\nv "));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn convert(config: &CityConvertConfig, progress: &dyn Progress) -> Result<CityConvertReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &CityConvertConfig, progress: &dyn Progress) -> Result<CityConvertReport, CityJobError> {
    config.validate()?;
    let format = config.output_format()?;
    for path in [Some(&config.output), config.input.account.as_ref()].into_iter().flatten() {
        files::check_destination(path, config.input.overwrite)?;
    }
    let mut opened = input::open(&config.input, progress)?;
    let mut account = CityAccount::of(&opened);
    let appearance = &opened.file.model.appearance;
    if format == CityOutputFormat::Cityjson {
        move_images(&mut opened.file.model, &config.input.file, &config.output);
    } else if !appearance.is_empty() {
        let count = appearance.materials.len() + appearance.textures.len();
        account.summary.left_out.insert("materials and textures".to_owned(), count);
    }
    if format != CityOutputFormat::Cityjson && account.summary.triangles == 0 {
        account.write(&config.input)?;
        return Err(nothing_selected(config, &account.summary));
    }
    let without_footprint = write(config, format, &opened)?;
    if without_footprint > 0 {
        progress.warn(&format!("{without_footprint} objects have no surface that looks down, and no footprint"));
    }
    for (what, count) in &account.summary.left_out {
        progress.warn(&format!("{count} {what} of the file are not written"));
    }
    account.write(&config.input)?;
    Ok(CityConvertReport { summary: account.summary, format, without_footprint })
}

/// The error of a model without a triangle to write.
fn nothing_selected(config: &CityConvertConfig, summary: &CitySummary) -> CityJobError {
    let listed = |counts: &BTreeMap<String, usize>| {
        counts.iter().map(|(name, count)| format!("{name}: {count}")).collect::<Vec<_>>().join(", ")
    };
    let levels: Vec<&str> = summary.lods.keys().map(String::as_str).collect();
    CityJobError::NothingSelected {
        path: config.input.file.clone(),
        objects: summary.objects,
        reasons: listed(&summary.statuses),
        levels: if levels.is_empty() { "none".to_owned() } else { levels.join(", ") },
    }
}

/// Writes the output and returns the number of objects without a footprint.
fn write(config: &CityConvertConfig, format: CityOutputFormat, opened: &OpenedCity) -> Result<usize, CityJobError> {
    let (path, overwrite) = (&config.output, config.input.overwrite);
    let OpenedCity { file, meshed } = opened;
    let triangles = |format| write_mesh(path, &file.model, &meshed.mesh, format, overwrite);
    match format {
        CityOutputFormat::Obj => triangles(MeshFormat::Obj)?,
        CityOutputFormat::Ply => triangles(MeshFormat::Ply)?,
        CityOutputFormat::Glb => triangles(MeshFormat::Glb)?,
        CityOutputFormat::Cityjson => {
            write_cityjson(path, &file.model, &CityJsonOptions { overwrite, ..CityJsonOptions::default() })?;
        }
        CityOutputFormat::Geojson => {
            return Ok(write_footprints(path, &file.model, &meshed.objects, overwrite)?.without);
        }
    }
    Ok(0)
}
