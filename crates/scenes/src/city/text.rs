//! The summary of a city model as lines of text.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use city::CrsReference;

use super::CitySummary;

impl CitySummary {
    /// Returns the summary as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut text = format!("{}: {}\n", self.source, self.format);
        let mut row = |name: &str, value: String| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {name:<18}{value}");
        };
        let (name, epsg, vertical_epsg) = (self.crs.name.clone(), self.crs.epsg, self.crs.vertical_epsg);
        let shown_name = name.as_ref().filter(|_| epsg.is_some()).map(|name| format!(" ({name})")).unwrap_or_default();
        row("reference system", format!("{}{shown_name}", CrsReference { name, epsg, vertical_epsg }));
        match self.bounds {
            Some([low, high]) => {
                row("from", format!("{:.3} {:.3} {:.3}", low[0], low[1], low[2]));
                row("to", format!("{:.3} {:.3} {:.3}", high[0], high[1], high[2]));
            }
            None => row("extent", "no surfaces".to_owned()),
        }
        row("objects", format!("{} ({})", self.objects, listed(&self.statuses)));
        row("levels of detail", format!("{}; used: {}", listed(&self.lods), listed(&self.lods_used)));
        row("triangles", format!("{} ({})", self.triangles, listed(&self.triangles_by_class)));
        if !self.left_out.is_empty() {
            row("left out", listed(&self.left_out));
        }
        row("defects", if self.defects.is_empty() { "none".to_owned() } else { String::new() });
        for defect in &self.defects {
            row("", format!("{} × {} ({}), {}", defect.count, defect.code, defect.meaning, defect.effect));
        }
        text
    }
}

/// Names with their counts, or `none`.
fn listed(counts: &BTreeMap<String, usize>) -> String {
    if counts.is_empty() {
        return "none".to_owned();
    }
    counts.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}
