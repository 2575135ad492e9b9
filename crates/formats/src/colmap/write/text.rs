//! Writes COLMAP's text files. Numbers have the fewest digits that read back to the same f64.

use std::io::{Result, Write};

use super::observations::{ImageObservations, Numbering};
use crate::colmap::convention::colmap_parameters;
use crate::colmap::model::{ColmapModel, ColmapPoint};

pub(super) fn cameras(out: &mut dyn Write, model: &ColmapModel) -> Result<()> {
    writeln!(out, "# Cameras, one a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n# {}", model.lenses.len())?;
    for (number, lens) in (1u32..).zip(&model.lenses) {
        write!(out, "{number} {} {} {}", lens.model().name(), lens.width(), lens.height())?;
        floats(out, &colmap_parameters(lens))?;
        writeln!(out)?;
    }
    Ok(())
}

pub(super) fn images(out: &mut dyn Write, model: &ColmapModel, seen: &ImageObservations) -> Result<()> {
    writeln!(out, "# Images, two lines each: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; then X Y POINT3D_ID …")?;
    writeln!(out, "# {}", model.views.len())?;
    for (index, view) in model.views.iter().enumerate() {
        write!(out, "{}", view.id)?;
        floats(out, &view.pose.quaternion())?;
        floats(out, &view.pose.translation())?;
        writeln!(out, " {} {}", view.lens + 1, view.name)?;
        for (place, (pixel, point)) in seen.by_view(index).iter().enumerate() {
            let gap = if place == 0 { "" } else { " " };
            write!(out, "{gap}{:?} {:?} {point}", pixel.sample, pixel.line)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

pub(super) fn points(out: &mut dyn Write, model: &ColmapModel, points: &[ColmapPoint]) -> Result<()> {
    let mut numbering = Numbering::new(model.views.len());
    writeln!(
        out,
        "# Points, one a line: POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX …\n# {}",
        points.len()
    )?;
    for (number, point) in (1u64..).zip(points) {
        write!(out, "{number}")?;
        floats(out, &point.position)?;
        let [r, g, b] = point.color;
        write!(out, " {r} {g} {b}")?;
        floats(out, &[point.error_px])?;
        for seen in &point.track {
            write!(out, " {} {}", model.views[seen.view as usize].id, numbering.next(seen.view))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes each value after a space.
fn floats(out: &mut dyn Write, values: &[f64]) -> Result<()> {
    values.iter().try_for_each(|value| write!(out, " {value:?}"))
}
