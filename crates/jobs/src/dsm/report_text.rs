//! The report of a run as text.

use std::path::Path;

use crate::dsm::report::DsmReport;

impl DsmReport {
    /// Returns the report of a run into the folder `output` as text.
    pub fn text(&self, output: &Path) -> String {
        let s = &self.surface;
        let share = |n: usize| 100.0 * n as f64 / s.cells.max(1) as f64;
        let masked = match s.masked {
            0 => String::new(),
            cells => format!(", of them {:.1} % masked", share(cells)),
        };
        let seconds: f64 = self.stages.iter().map(|t| t.seconds).sum();
        format!(
            "DSM        {}\n\
             cells      {} ({:.1} % observed, {:.1} % filled, {:.1} % void{masked})\n\
             picture    {}\n\
             report     {}\n\
             time       {seconds:.1} s\n",
            output.join("dsm/dsm.tif").display(),
            s.cells,
            share(s.observed),
            share(s.filled),
            share(s.void),
            output.join("dsm/relief.png").display(),
            output.join("report/report.html").display(),
        )
    }
}
