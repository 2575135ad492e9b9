//! One vertical datum for all surfaces of an evaluation.
//!
//! Two stated datums are converted into each other. Where one side does not state its own, heights above a geoid are refused until it
//! is named; heights above the ellipsoid are taken as shared when the alignment removes a vertical offset, and refused when it
//! does not: a geoid taken for the ellipsoid would be an error of tens of metres.

use anyhow::{Context, bail};
use crs::{HeightConverter, VerticalDatum};
use eval::{Alignment, MetresFromCells, convert_heights};
use io::raster::Dem;

use super::grids::{definition, metres_per_unit, projection};

/// What the heights of the two are above, as far as files and options say.
pub(super) struct Stated {
    pub(super) test: Option<VerticalDatum>,
    pub(super) reference: Option<VerticalDatum>,
}

impl Stated {
    /// Brings the test heights to the reference's datum, which is returned.
    pub(super) fn reconcile(
        &self,
        test: &mut Dem,
        alignment: Alignment,
        notes: &mut Vec<String>,
    ) -> anyhow::Result<Option<VerticalDatum>> {
        let unstated = |what: &str, other: &str, option: &str, datum: VerticalDatum| {
            if datum != VerticalDatum::Ellipsoid || alignment == Alignment::None {
                bail!(
                    "the {other}'s heights are above {datum}, the {what} does not say what its own are above: give {option}"
                );
            }
            Ok(format!("the {what} does not say what its heights are above: taken as the ellipsoid, as the {other}'s"))
        };
        let (test_datum, reference_datum) = match (self.test, self.reference) {
            (None, None) => {
                notes.push("neither file says what its heights are above: taken as the same".into());
                return Ok(None);
            }
            (Some(test), Some(reference)) => (test, reference),
            (Some(datum), None) => {
                notes.push(unstated("reference", "test", "--ref-vertical", datum)?);
                (datum, datum)
            }
            (None, Some(datum)) => {
                notes.push(unstated("test", "reference", "--test-vertical", datum)?);
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

/// Brings a terrain model to the datum of the reference; one that states none is taken as being there already.
pub(super) fn bring_terrain(
    terrain: &mut Dem,
    datum: Option<VerticalDatum>,
    notes: &mut Vec<String>,
) -> anyhow::Result<()> {
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

fn convert(dem: &mut Dem, from: VerticalDatum, to: VerticalDatum) -> anyhow::Result<()> {
    let definition = definition(dem).with_context(|| {
        format!(
            "heights can be converted from {from} to {to} only in a known coordinate system, there is none: {}",
            dem.path.display()
        )
    })?;
    let (along_columns, along_rows) = MetresFromCells::new(&dem.geotransform, metres_per_unit(dem)?).cell_size_m();
    let projection = projection(&definition, &dem.path)?;
    let (from, to) = (HeightConverter::new(from)?, HeightConverter::new(to)?);
    let cell_m = along_columns.max(along_rows);
    Ok(convert_heights(&mut dem.heights, &dem.geotransform, cell_m, &projection, &from, &to)?)
}
