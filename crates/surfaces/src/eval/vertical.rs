//! One vertical datum for all surfaces of an evaluation.
//!
//! If both files name a datum, the heights of the test are converted to the datum of the reference.
//! If only one file names its datum, and this is a geoid, the comparison is refused until the other
//! datum is named. If it is the ellipsoid, both are taken as above the ellipsoid when the alignment
//! removes a vertical offset, and the comparison is refused when it does not: a geoid taken for the
//! ellipsoid would be an error of tens of metres.

use crs::{HeightConverter, VerticalDatum};
use eval::{AlignmentMethod, MetresFromCells, convert_heights};
use formats::raster::Dem;

use super::error::EvalJobError;
use super::on_reference::{definition, metres_per_unit};
use job::error::FileCrsError;

/// Vertical datums of the two surfaces, where the files or the configuration name them.
pub(super) struct StatedDatums {
    pub(super) test: Option<VerticalDatum>,
    pub(super) reference: Option<VerticalDatum>,
}

impl StatedDatums {
    /// Converts the test heights to the datum of the reference, and returns that datum.
    pub(super) fn reconcile(
        &self,
        test: &mut Dem,
        alignment: AlignmentMethod,
        notes: &mut Vec<String>,
    ) -> Result<Option<VerticalDatum>, EvalJobError> {
        let unstated = |unknown: &'static str, known: &'static str, datum: VerticalDatum| {
            if datum != VerticalDatum::Ellipsoid || alignment == AlignmentMethod::None {
                return Err(EvalJobError::DatumUnknown { known, unknown, datum });
            }
            Ok(format!(
                "the {unknown} does not say what its heights are above: taken as the ellipsoid, as the {known}'s"
            ))
        };
        let (test_datum, reference_datum) = match (self.test, self.reference) {
            (None, None) => {
                notes.push("neither file says what its heights are above: taken as the same".into());
                return Ok(None);
            }
            (Some(test), Some(reference)) => (test, reference),
            (Some(datum), None) => {
                notes.push(unstated("reference", "test", datum)?);
                (datum, datum)
            }
            (None, Some(datum)) => {
                notes.push(unstated("test", "reference", datum)?);
                (datum, datum)
            }
        };
        if test_datum != reference_datum {
            convert(test, test_datum, reference_datum)?;
            notes.push(format!("the test's heights were converted from {test_datum} to {reference_datum}"));
        }
        Ok(Some(reference_datum))
    }
}

/// Converts a terrain model to the datum of the reference. A model that names no datum is taken to
/// be in it already.
pub(super) fn bring_terrain(
    terrain: &mut Dem,
    datum: Option<VerticalDatum>,
    notes: &mut Vec<String>,
) -> Result<(), EvalJobError> {
    match (terrain.vertical, datum) {
        (Some(from), Some(to)) if from != to => {
            convert(terrain, from, to)?;
            notes.push(format!("the terrain's heights were converted from {from} to {to}"));
        }
        (Some(_), Some(_)) => {}
        _ => notes.push("the terrain model is taken as above the same datum as the reference".into()),
    }
    Ok(())
}

fn convert(dem: &mut Dem, from: VerticalDatum, to: VerticalDatum) -> Result<(), EvalJobError> {
    let definition =
        definition(dem).ok_or_else(|| EvalJobError::NoCrsForHeights { path: dem.path.clone(), from, to })?;
    let (along_columns, along_rows) = MetresFromCells::new(&dem.geotransform, metres_per_unit(dem)?).cell_size_m();
    let projection = FileCrsError::projection(&dem.path, &definition)?;
    let (from, to) = (HeightConverter::new(from)?, HeightConverter::new(to)?);
    let cell_m = along_columns.max(along_rows);
    Ok(convert_heights(&mut dem.heights, &dem.geotransform, cell_m, &projection, &from, &to)?)
}
