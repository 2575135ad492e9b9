//! The comparison of two surfaces as text.

use eval::SurfaceComparison;

use super::surfaces::SurfaceEvalReport;

impl SurfaceEvalReport {
    /// Returns the protocol and all results as a table, which ends in a line break.
    pub fn table(&self) -> String {
        let (protocol, found) = (&self.protocol, &self.result);
        let mut text = String::new();
        let mut line = |label: &str, value: String| text += &format!("{label:<10} {value}\n");
        line("test", format!("{} ({})", protocol.test, protocol.test_format));
        line("reference", format!("{} ({})", protocol.reference, protocol.reference_format));
        line("crs", protocol.crs.clone().unwrap_or_else(|| "no coordinate system".into()));
        let datum = protocol.vertical.as_deref().unwrap_or("not stated");
        line("heights", format!("above {datum}; nothing is aligned"));
        text += &distances(found);
        text += &scores(found);
        text += &other_results(found);
        protocol.notes.iter().for_each(|note| text += &format!("note: {note}\n"));
        text
    }

    /// Returns the requirements that are not met, in words.
    pub fn missed(&self) -> &[String] {
        &self.protocol.missed
    }
}

fn distances(found: &SurfaceComparison) -> String {
    let mut text = row("distance m", &["n", "mean", "median", "rmse", "le90", "le95", "max"].map(str::to_owned));
    for (name, side) in [("accuracy", found.accuracy), ("completeness", found.completeness)] {
        let metres = [side.mean_m, side.median_m, side.rmse_m, side.le90_m, side.le95_m, side.max_m];
        let cells: Vec<String> = std::iter::once(side.n.to_string()).chain(metres.map(|m| format!("{m:.4}"))).collect();
        text += &row(name, &cells);
    }
    format!("\n{text}")
}

fn scores(found: &SurfaceComparison) -> String {
    let mut text = row("threshold m", &["precision %", "recall %", "F-score %"].map(str::to_owned));
    for score in &found.scores {
        let shares = [score.precision, score.recall, score.f_score].map(|share| format!("{:.2}", 100.0 * share));
        text += &row(&score.threshold_m.to_string(), &shares);
    }
    format!("\n{text}\n")
}

fn other_results(found: &SurfaceComparison) -> String {
    let mut text = format!(
        "chamfer          {:.4} m (mean of the two mean distances)\nhausdorff        {:.4} m\n",
        found.chamfer_m, found.hausdorff_m
    );
    if let Some(angle) = found.normal_angle {
        text += &format!(
            "normal angle     mean {:.2}°, median {:.2}°, 90 % below {:.2}° (n {})\n",
            angle.mean_deg, angle.median_deg, angle.p90_deg, angle.n
        );
    }
    if let Some(m3c2) = found.m3c2 {
        let lod = m3c2.median_lod_m.map_or("none".to_owned(), |lod| format!("{lod:.4} m"));
        let real = m3c2.significant.map_or("-".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        text += &format!(
            "M3C2             mean {:+.4} m, mean |d| {:.4} m, median {:+.4} m, std {:.4} m; level of detection {lod}, above it {real} ({} of {} core points)\n",
            m3c2.mean_m, m3c2.mean_abs_m, m3c2.median_m, m3c2.std_m, m3c2.n, m3c2.core_points
        );
    }
    let voc = found.voc;
    text += &format!(
        "VOC              {:.4} in voxels of {} m (completeness {:.4}, correctness {:.4})\n",
        voc.voc, voc.voxel_m, voc.completeness, voc.correctness
    );
    text
}

fn row(label: &str, cells: &[String]) -> String {
    let cells: String = cells.iter().map(|cell| format!(" {cell:>11}")).collect();
    format!("{label:<14}{cells}\n")
}
