//! A plan as text for people.

use std::fmt::Write;

use numeric::Choice;

use crate::ChunkWork;
use crate::production::plan_file::PlanFile;

/// Chunks that are listed one by one.
const LISTED: usize = 40;

impl PlanFile {
    /// Returns the plan as text: images, grid, chunks with their memory and processor time, choices
    /// with reasons.
    pub fn text(&self) -> String {
        let (plan, mut out) = (&self.plan, String::new());
        // Writing to a string cannot fail.
        for image in &plan.report.images {
            let gsd = image.gsd_m.map_or_else(String::new, |gsd| format!(", {gsd:.2} m a pixel"));
            let _ = writeln!(out, "image      {} ({} × {} px{gsd})", image.path.display(), image.size.0, image.size.1);
        }
        let bounds = plan.grid.bounds().to_array();
        let _ = writeln!(
            out,
            "grid       {} × {} cells of {} m, EPSG:{}, bounds {bounds:.2?}",
            plan.grid.size.0, plan.grid.size.1, plan.grid.gsd_m, plan.grid.epsg
        );
        let estimate = &self.estimate;
        let _ = writeln!(
            out,
            "chunks     {}; about {} MB and {:.0} s of processor time in all",
            plan.chunks.len(),
            estimate.peak_mb,
            estimate.cpu_seconds
        );
        for (index, (chunk, needs)) in plan.chunks.iter().zip(&estimate.chunks).enumerate().take(LISTED) {
            let core = chunk.core;
            let work = match &chunk.work {
                ChunkWork::Sweep(sweep) => format!(
                    "{} views, heights {:.0} to {:.0} m, {} MB, {:.0} s",
                    sweep.windows.iter().flatten().count(),
                    sweep.height_range.low_m,
                    sweep.height_range.high_m,
                    needs.needed_mb,
                    needs.cpu_seconds
                ),
                ChunkWork::Unseen => "no two images see it".to_owned(),
                ChunkWork::Failed { reason } => reason.clone(),
            };
            let _ = writeln!(out, "  {index:<8} {} × {} cells: {work}", core.width, core.height);
        }
        if plan.chunks.len() > LISTED {
            let _ = writeln!(out, "  and {} more", plan.chunks.len() - LISTED);
        }
        for Choice { name, value, reason } in &plan.choices {
            let _ = writeln!(out, "{name:<13} {value} ({reason})");
        }
        for warning in &plan.warnings {
            let _ = writeln!(out, "warning: {warning}");
        }
        out
    }
}
