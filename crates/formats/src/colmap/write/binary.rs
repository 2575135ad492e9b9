//! Writes COLMAP's binary files: little-endian numbers, each list after its count.

use std::io::{Result, Write};

use super::observations::{ImageObservations, Numbering};
use crate::colmap::convention::colmap_parameters;
use crate::colmap::model::{ColmapModel, ColmapPoint};

pub(super) fn cameras(out: &mut dyn Write, model: &ColmapModel) -> Result<()> {
    out.write_all(&(model.lenses.len() as u64).to_le_bytes())?;
    for (number, lens) in (1u32..).zip(&model.lenses) {
        out.write_all(&number.to_le_bytes())?;
        out.write_all(&lens.model().number().to_le_bytes())?;
        out.write_all(&(lens.width() as u64).to_le_bytes())?;
        out.write_all(&(lens.height() as u64).to_le_bytes())?;
        floats(out, &colmap_parameters(lens))?;
    }
    Ok(())
}

pub(super) fn images(out: &mut dyn Write, model: &ColmapModel, seen: &ImageObservations) -> Result<()> {
    out.write_all(&(model.views.len() as u64).to_le_bytes())?;
    for (index, view) in model.views.iter().enumerate() {
        out.write_all(&view.id.to_le_bytes())?;
        floats(out, &view.pose.quaternion())?;
        floats(out, &view.pose.translation())?;
        out.write_all(&(view.lens as u32 + 1).to_le_bytes())?;
        out.write_all(view.name.as_bytes())?;
        out.write_all(&[0])?;
        let seen = seen.by_view(index);
        out.write_all(&(seen.len() as u64).to_le_bytes())?;
        for (pixel, point) in seen {
            floats(out, &[pixel.sample, pixel.line])?;
            out.write_all(&point.to_le_bytes())?;
        }
    }
    Ok(())
}

pub(super) fn points(out: &mut dyn Write, model: &ColmapModel, points: &[ColmapPoint]) -> Result<()> {
    let mut numbering = Numbering::new(model.views.len());
    out.write_all(&(points.len() as u64).to_le_bytes())?;
    for (number, point) in (1u64..).zip(points) {
        out.write_all(&number.to_le_bytes())?;
        floats(out, &point.position)?;
        out.write_all(&point.color)?;
        floats(out, &[point.error_px])?;
        out.write_all(&(point.track.len() as u64).to_le_bytes())?;
        for seen in &point.track {
            out.write_all(&model.views[seen.view as usize].id.to_le_bytes())?;
            out.write_all(&numbering.next(seen.view).to_le_bytes())?;
        }
    }
    Ok(())
}

fn floats(out: &mut dyn Write, values: &[f64]) -> Result<()> {
    values.iter().try_for_each(|value| out.write_all(&value.to_le_bytes()))
}
