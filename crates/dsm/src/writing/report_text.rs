//! The report of a run as text.

use std::path::Path;

use crate::report::{ControlReport, DsmReport};

impl DsmReport {
    /// Returns the report of a run into the folder `output` as text.
    pub fn text(&self, output: &Path) -> String {
        let s = &self.surface;
        let share = |n: usize| 100.0 * n as f64 / s.cells.max(1) as f64;
        let masked = match s.counts.masked {
            0 => String::new(),
            cells => format!(", of them {:.1} % masked", share(cells)),
        };
        let expected = s.counts.expected_share().map_or(String::new(), |share| {
            format!("expected   {:.0} % of the heights right within {:.1} m\n", 100.0 * share, s.right_within_m)
        });
        let control = self.pointing.control.as_ref().map_or(String::new(), ControlReport::text);
        let seconds: f64 = self.stages.iter().map(|t| t.seconds).sum();
        format!(
            "DSM        {}\n\
             cells      {} ({:.1} % observed, {:.1} % filled, {:.1} % void{masked})\n\
             {expected}\
             picture    {}\n\
             report     {}\n\
             time       {seconds:.1} s\n{control}",
            output.join("dsm/dsm.tif").display(),
            s.cells,
            share(s.counts.observed),
            share(s.counts.filled),
            share(s.counts.void),
            output.join("dsm/relief.png").display(),
            output.join("report/report.html").display(),
        )
    }
}

impl ControlReport {
    /// Returns the table of the ground points as text: heads, then one line for each point.
    fn text(&self) -> String {
        let rows = self.rows();
        let name = rows.iter().map(|row| row[0].chars().count()).chain([5]).max().unwrap_or(5);
        let heads = Self::HEADS.map(str::to_owned);
        let lines = std::iter::once(&heads).chain(&rows).map(|[point, role, dx, dy, up, remark]| {
            let line = format!("{point:name$}  {role:7} {dx:>8} {dy:>8} {up:>9}  {remark}");
            line.trim_end().to_owned() + "\n"
        });
        lines.collect()
    }

    /// Heads of [`Self::rows`].
    pub(crate) const HEADS: [&'static str; 6] = ["point", "role", "dx, px", "dy, px", "height, m", "remark"];

    /// Returns a row for each ground point: its name, what it was used for, how far its place in an
    /// image is from where the camera sees its position, how far its height is off, and a remark.
    pub(crate) fn rows(&self) -> Vec<[String; 6]> {
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:+.2}"));
        let control = self.control.iter().map(|point| {
            let [dx, dy] = [0, 1].map(|axis| number(point.off_px.map(|off| off[axis])));
            let role = if point.used { "control" } else { "unused" };
            let remark = match &point.reason {
                Some(reason) => reason.clone(),
                None if point.image.is_empty() => String::new(),
                None => format!("in {}", point.image),
            };
            [point.name.clone(), role.to_owned(), dx, dy, number(point.off_height_m), remark]
        });
        let checks = self.checks.iter().map(|point| {
            let [east, north, up] = point.error_m;
            let remark = format!("off by {east:+.2} m east, {north:+.2} m north");
            let none = || "–".to_owned();
            [point.name.clone(), "check".to_owned(), none(), none(), number(Some(up)), remark]
        });
        control.chain(checks).collect()
    }
}
