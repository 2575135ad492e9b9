//! The page: headline numbers, protocol, pictures, plots, tables.

use eval::AlignmentMethod;

use super::numbers::{grouped, percent};
use super::report::EvaluationReport;
use crate::escape::escape;
use crate::page::page;
use crate::picture::PictureError;
use crate::words::typeset;

/// Short names of the page and what they mean. An error is the evaluated height minus that of the
/// reference.
const ABBREVIATIONS: [(&str, &str); 13] = [
    ("reference_cells", "cells in which the reference has a height and which no class or mask leaves out"),
    ("n", "those of them in which the evaluated surface has a height, too"),
    ("valid_ratio", "n as a share of reference_cells"),
    ("mean, bias", "mean of the errors, with their signs"),
    ("MAE", "mean absolute error"),
    ("RMSE", "root mean square error: the root of the mean of the squared errors"),
    ("std", "standard deviation of the errors"),
    (
        "NMAD",
        "normalised median absolute deviation: 1.4826 times the median distance of the errors from their median; \
              for normally distributed errors it is their standard deviation, and outliers hardly change it",
    ),
    ("LE68, LE90, LE95", "linear error: 68, 90 or 95 % of the errors are at most this large, without their signs"),
    ("robust_…", "the same without outliers"),
    (
        "completeness_T",
        "share of reference_cells whose error is below T metres; cells without a height count as failures",
    ),
    ("pag_T", "percentage of accurate grid cells: share of n whose error is below T metres"),
    ("IoU", "intersection over union: what both surfaces have in common, as a share of what either has"),
];

impl EvaluationReport<'_> {
    /// Returns the whole page.
    ///
    /// # Errors
    /// [`PictureError`] if a grid has no cells.
    pub fn html(&self) -> Result<String, PictureError> {
        let title = format!("{} against {}", short(&self.protocol.test), short(&self.protocol.reference));
        let body = [
            format!("<h1>{}</h1>", escape(&title)),
            format!("<p class=\"lead\">{}</p>", self.lead()),
            format!("<p class=\"lead\">{}</p>", escape(&self.brief_protocol())),
            self.cards(),
            self.notes(),
            "<h2>Pictures</h2>".to_owned(),
            self.pictures()?,
            "<h2>How the errors are distributed</h2>".to_owned(),
            self.plots(),
            "<h2>Buildings and trees</h2>".to_owned(),
            self.standing_table(),
            format!("<p>{}</p>", self.overreach()),
            "<h2>All numbers</h2>".to_owned(),
            self.metric_table(),
            "<h2>By slope</h2>".to_owned(),
            self.slope_table(),
            self.coverage_table(),
            self.judged(),
            "<h2>Protocol</h2>".to_owned(),
            self.protocol_list(),
            abbreviations(),
        ];
        Ok(page(&title, &body.join("\n")))
    }

    /// Returns the section about the origin of the heights, their stated uncertainty and single
    /// objects. It is empty without an input for any of them.
    fn judged(&self) -> String {
        match self.judged_html() {
            tables if tables.is_empty() => tables,
            tables => format!("<h2>Origin, uncertainty, objects</h2>\n{tables}"),
        }
    }

    /// Returns the result in a sentence.
    fn lead(&self) -> String {
        let overall = &self.found.overall;
        let cell = self.protocol.cell_m.0;
        let cells = format!("{} cells of {cell:.2} m", grouped(overall.reference_cells));
        let Some(errors) = overall.errors else { return format!("Of {cells}, none has a height to compare.") };
        let coverage = percent(overall.valid_ratio());
        format!(
            "Of {cells}, {coverage} % have a height. Two thirds of these are within {:.2} m (LE68), nine in ten \
              within {:.2} m (LE90).",
            errors.le68, errors.le90
        )
    }

    /// Returns the most important conventions in a sentence.
    fn brief_protocol(&self) -> String {
        let shift = self.found.shift;
        let moved = match self.protocol.config.alignment {
            AlignmentMethod::None => "Compared as they are, without alignment".to_owned(),
            AlignmentMethod::Z => format!("Aligned by the median: {:+.2} m up", shift.dz_m),
            _ => format!("Aligned: {:+.2} m east, {:+.2} m north, {:+.2} m up", shift.dx_m, shift.dy_m, shift.dz_m),
        };
        let left_out = match self.found.skipped_cells {
            0 => String::new(),
            cells => format!(" {} cells are left out by class or mask.", grouped(cells)),
        };
        let moved = typeset(&moved);
        format!("{moved}. Vertical datum: {}. Grid: {}.{left_out}", self.protocol.vertical, self.protocol.crs)
    }

    fn cards(&self) -> String {
        let overall = &self.found.overall;
        let metres = |value: Option<f64>| (value.map_or("–".into(), |v| typeset(&format!("{v:.3}"))), "m");
        let errors = overall.errors;
        let share = |value: Option<f64>| (percent(value), "%");
        let one = [1.0].into_iter().chain(overall.below.iter().map(|(t, _)| *t));
        let threshold = one.into_iter().find(|&t| overall.completeness(t).is_some());
        let within = threshold.map_or("completeness".to_owned(), |t| format!("of all cells within {t} m"));
        let cards = [
            (metres(errors.map(|e| e.mae)), "mean absolute error".to_owned()),
            (metres(errors.map(|e| e.rmse)), "root mean square error".to_owned()),
            (metres(errors.map(|e| e.nmad)), "NMAD, the robust spread".to_owned()),
            (metres(errors.map(|e| e.mean)), "bias".to_owned()),
            (share(threshold.and_then(|t| overall.completeness(t))), within),
            (share(self.found.standing.volume.iou()), "volume IoU above the terrain".to_owned()),
        ];
        let cards = cards.map(|((value, unit), text)| {
            format!("<div class=\"card\"><b>{value} <small>{unit}</small></b><span>{}</span></div>", escape(&text))
        });
        format!("<div class=\"cards\">{}</div>", cards.concat())
    }

    fn notes(&self) -> String {
        let all: String = self
            .protocol
            .missed
            .iter()
            .map(|missed| format!("<li><b>missed:</b> {}</li>", escape(&typeset(missed))))
            .chain(self.protocol.notes.iter().map(|note| format!("<li>{}</li>", escape(&typeset(note)))))
            .collect();
        if all.is_empty() { String::new() } else { format!("<div class=\"notes\"><ul>{all}</ul></div>") }
    }

    fn overreach(&self) -> String {
        let sharpness = &self.found.sharpness;
        let places = format!("{} of {} places", grouped(sharpness.measured), grouped(sharpness.edges));
        match sharpness.overreach_m {
            Some(e) => typeset(&format!(
                "Roof edges reach out by {:+.2} m (median; NMAD {:.2} m, LE90 {:.2} m), measured at {places} \
                  where the reference \
                 is level on both sides of a jump. Positive is too large.",
                e.median, e.nmad, e.le90
            )),
            None => format!("The overreach of roof edges could not be measured ({places})."),
        }
    }

    fn protocol_list(&self) -> String {
        let lines = self.protocol.lines(self.found);
        let items: String =
            lines.iter().map(|(name, text)| format!("<dt>{name}</dt><dd>{}</dd>", escape(&typeset(text)))).collect();
        format!("<dl>{items}</dl>")
    }
}

/// Returns what the short names of the page mean.
fn abbreviations() -> String {
    let items: String = ABBREVIATIONS.iter().map(|(name, text)| format!("<dt>{name}</dt><dd>{text}</dd>")).collect();
    format!("<h2>Abbreviations</h2><dl>{items}</dl>")
}

/// Returns the last three parts of a path, which are enough to recognise it.
fn short(path: &str) -> String {
    let parts: Vec<&str> = path.split(['/', '\\']).filter(|part| !part.is_empty() && *part != ".").collect();
    parts[parts.len().saturating_sub(3)..].join("/")
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn a_path_is_known_by_its_end() {
        assert_eq!(short("/tmp/a/d/dsm/dsm.tif"), "d/dsm/dsm.tif");
        assert_eq!(short("./dsm.tif"), "dsm.tif");
        assert_eq!(short(""), "");
    }
}
