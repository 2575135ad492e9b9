//! The page of a job: what came out, on maps that can be switched, in plots and in tables. One file
//! without script: the switches are radio buttons whose state selects what the style shows.

use raster::{Grid, VOID_COLOUR};
use serde_json::Value;

use crate::comparison::{self, Comparison};
use crate::escape::escape;
use crate::legend::Legend;
use crate::links::{PageLink, section};
use crate::page::page;
use crate::parts::{cards_of, notes, table};
use crate::picture::{PictureError, data_uri, grey_alpha_uri};
use crate::svg::Chart;
use crate::words::{field_words, sensible, typeset, unit_of};

/// Distance of the stripes of hatched cells, and their width, pixels.
const HATCH: (usize, usize) = (8, 2);
/// Grey value and opacity of the stripes.
const STRIPE: [u8; 2] = [20, 150];
/// Most rows of a table on the page; the JSON report has all.
const ROWS_MAX: usize = 200;

/// Page of a job.
#[derive(Debug, Clone, Default)]
pub struct JobPage {
    /// Heading.
    pub title: String,
    /// The result in a sentence or two.
    pub lead: String,
    /// Numbers that matter most, with what they are.
    pub cards: Vec<(String, &'static str)>,
    /// Warnings and notes.
    pub notes: Vec<String>,
    /// Maps on one grid, of which one is shown at a time.
    pub layers: Vec<MapLayer>,
    /// Cells of the maps that are hatched, because their values were not observed.
    pub hatched: Option<Grid<bool>>,
    /// Pictures against the truth.
    pub comparisons: Vec<Comparison>,
    /// Plots with their titles and captions.
    pub plots: Vec<(Chart, String, String)>,
    /// Tables.
    pub tables: Vec<JobTable>,
    /// Files beside the page.
    pub links: Vec<PageLink>,
    /// Single values by name.
    pub facts: Vec<(String, String)>,
    /// Further values by name, under headings.
    pub groups: Vec<(String, Vec<(String, String)>)>,
}

/// A map of a page.
#[derive(Debug, Clone)]
pub struct MapLayer {
    /// Name on its switch.
    pub name: String,
    /// The map, as large as the other maps of the page. Where it has a legend, pixels of
    /// [`VOID_COLOUR`] are cells without a value, and the legend says so.
    pub picture: Grid<[u8; 3]>,
    /// What it shows.
    pub caption: String,
    /// Meaning of its colours, where they have one.
    pub legend: Option<Legend>,
}

/// A table of a page.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JobTable {
    /// Heading.
    pub title: String,
    /// Names of the columns.
    pub heads: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

impl JobPage {
    /// Returns a page with all that a report in JSON holds: its values as facts, its objects as
    /// groups, its lists of objects as tables. Names are written as words with their units.
    pub fn of_report(title: &str, lead: &str, report: &Value) -> Self {
        let mut page = Self { title: title.to_owned(), lead: lead.to_owned(), ..Self::default() };
        page.facts = page.take("", report);
        page
    }

    /// Takes the fields of an object: its lists and objects go to the page under their `path`. The
    /// single values are returned.
    fn take(&mut self, path: &str, object: &Value) -> Vec<(String, String)> {
        let mut facts = Vec::new();
        for (name, value) in object.as_object().into_iter().flatten() {
            let heading = || heading(path, name);
            match value {
                Value::Null => {}
                Value::Object(_) => {
                    // The group stands before those inside of it.
                    let (at, title) = (self.groups.len(), heading());
                    self.groups.push((title.clone(), Vec::new()));
                    self.groups[at].1 = self.take(&title, value);
                }
                Value::Array(rows) if rows.iter().any(Value::is_object) => {
                    self.tables.push(JobTable::of(&heading(), rows));
                }
                Value::Array(items) if name == "warnings" || name == "notes" => {
                    self.notes.extend(items.iter().map(|item| in_words(name, item)));
                }
                _ => facts.push((field_words(name), in_words(name, value))),
            }
        }
        facts
    }

    /// Returns the page.
    ///
    /// # Errors
    /// [`PictureError`] for a map without pixels.
    pub fn html(&self) -> Result<String, PictureError> {
        let cards: Vec<(String, &str)> =
            self.cards.iter().map(|(value, text)| (typeset(&escape(value)), *text)).collect();
        let plot = |(chart, title, caption): &(Chart, String, String)| {
            let (title, caption) = (escape(title), escape(caption));
            format!("<figure>{}<figcaption><b>{title}.</b> {caption}</figcaption></figure>", chart.inline())
        };
        let plots: String = self.plots.iter().map(plot).collect();
        let body = [
            format!("<h1>{}</h1>", escape(&self.title)),
            format!("<p class=\"lead\">{}</p>", escape(&typeset(&self.lead))),
            if cards.is_empty() { String::new() } else { cards_of(&cards) },
            notes(&self.notes),
            self.maps()?,
            comparison::section(&self.comparisons)?,
            section(&self.links),
            if plots.is_empty() { plots } else { format!("<h2>Plots</h2><div class=\"plots\">{plots}</div>") },
            self.tables.iter().map(JobTable::html).collect(),
            self.fact_list(),
        ];
        Ok(page(&self.title, &body.join("\n")))
    }

    /// Returns the maps with a switch for each, and one for the hatching.
    fn maps(&self) -> Result<String, PictureError> {
        if self.layers.is_empty() {
            return Ok(String::new());
        }
        let (mut switches, mut figures, mut rules) = (String::new(), String::new(), String::new());
        let stripes = if self.hatched.is_some() { "<i class=\"hatching\"></i>" } else { "" };
        for (number, layer) in self.layers.iter().enumerate() {
            let (uri, name, caption) = (data_uri(&layer.picture)?, escape(&layer.name), escape(&layer.caption));
            let checked = if number == 0 { " checked" } else { "" };
            switches += &format!(
                "<input type=\"radio\" name=\"layer\" id=\"layer{number}\"{checked}><label \
                 for=\"layer{number}\">{name}</label>"
            );
            let has_voids = layer.picture.data().contains(&VOID_COLOUR);
            let legend = layer.legend.as_ref().map_or_else(String::new, |legend| legend.html(has_voids));
            figures += &format!(
                "<figure class=\"layer{number}\"><div class=\"map\"><img src=\"{uri}\" alt=\"{name}\">{stripes}</div>\
                 {legend}<figcaption><b>{name}.</b> {caption}</figcaption></figure>"
            );
            rules += &format!(
                "#layer{number}:checked~.stack .layer{number}{{display:block}}\
                 #layer{number}:focus-visible+label{{outline:2px solid var(--b)}}"
            );
        }
        if let Some(hatched) = &self.hatched {
            switches += "<input type=\"checkbox\" id=\"hatched\" checked><label for=\"hatched\">filled cells \
                         hatched</label>";
            // One picture of the stripes lies over all maps, also where they are printed together.
            let uri = grey_alpha_uri(&self::stripes(hatched))?;
            rules += &format!(".hatching{{background-image:url({uri})}}");
        }
        Ok(format!(
            "<h2>Maps</h2><style>{rules}</style><div class=\"layers\">{switches}<div \
             class=\"stack\">{figures}</div></div>"
        ))
    }

    fn fact_list(&self) -> String {
        let fact =
            |(name, value): &(String, String)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), typeset(&escape(value)));
        let group = |(title, facts): (&str, &Vec<(String, String)>)| {
            let facts: String = facts.iter().map(fact).collect();
            if facts.is_empty() { facts } else { format!("<h2>{}</h2><dl>{facts}</dl>", escape(title)) }
        };
        let groups = self.groups.iter().map(|(title, facts)| (title.as_str(), facts));
        [("Values", &self.facts)].into_iter().chain(groups).map(group).collect()
    }
}

impl JobTable {
    /// Returns the objects of a list as a table, with a column for each field that is no list.
    fn of(title: &str, rows: &[Value]) -> Self {
        let mut heads: Vec<&String> = Vec::new();
        for row in rows.iter().filter_map(Value::as_object) {
            heads.extend(row.iter().filter(|(_, v)| is_simple(v)).map(|(name, _)| name));
        }
        let mut seen = std::collections::HashSet::new();
        heads.retain(|head| seen.insert(*head));
        let cell = |row: &Value, head: &str| row.get(head).map_or_else(String::new, |value| in_words(head, value));
        let cells = |row: &Value| heads.iter().map(|head| cell(row, head)).collect();
        Self {
            title: title.to_owned(),
            heads: heads.iter().map(|head| field_words(head)).collect(),
            rows: rows.iter().map(cells).collect(),
        }
    }

    fn html(&self) -> String {
        let heads: Vec<&str> = self.heads.iter().map(String::as_str).collect();
        let shown = self.rows.len().min(ROWS_MAX);
        let rest = match self.rows.len() - shown {
            0 => String::new(),
            more => format!("<p>{more} more rows are in the report in JSON.</p>"),
        };
        table(&self.title, &heads, self.rows[..shown].iter().cloned()) + &rest
    }
}

/// Returns whether a value fits a cell of a table.
fn is_simple(value: &Value) -> bool {
    match value {
        Value::Object(_) => false,
        Value::Array(items) => items.len() <= 4 && items.iter().all(|item| !item.is_object() && !item.is_array()),
        _ => true,
    }
}

/// Returns the value of a field as it is shown: quantities with the digits that mean something in
/// their unit, other numbers with at most four decimals.
fn in_words(name: &str, value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            let value = number.as_f64().unwrap_or(f64::NAN);
            if let Some(unit) = unit_of(name) {
                return sensible(value, unit);
            }
            let rounded = (value * 1e4).round() / 1e4;
            // A value that rounding would lose keeps its digits.
            if rounded == 0.0 && value != 0.0 { format!("{value:.2e}") } else { rounded.to_string() }
        }
        Value::Array(items) => items.iter().map(|item| in_words(name, item)).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// Returns the heading of a list or an object of a report that lies under another heading.
fn heading(path: &str, name: &str) -> String {
    let name = field_words(name);
    if !path.is_empty() {
        return format!("{path}: {name}");
    }
    let mut characters = name.chars();
    characters.next().map_or_else(String::new, |first| first.to_uppercase().chain(characters).collect())
}

/// Returns diagonal stripes over the marked cells: grey value and opacity.
fn stripes(marked: &Grid<bool>) -> Grid<[u8; 2]> {
    let mut out = Grid::filled(marked.width(), marked.height(), [0u8; 2]);
    for y in 0..marked.height() {
        for (x, (pixel, marked)) in out.row_mut(y).iter_mut().zip(marked.row(y)).enumerate() {
            if *marked && (x + y) % HATCH.0 < HATCH.1 {
                *pixel = STRIPE;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn layer(name: &str) -> MapLayer {
        MapLayer {
            name: name.to_owned(),
            picture: Grid::filled(16, 8, [9; 3]),
            caption: "what <it> shows".to_owned(),
            legend: Some(Legend::heights(0.0, 10.0, "m")),
        }
    }

    #[test]
    fn layers_are_switched_without_a_script() {
        let mut page = JobPage { title: "a <title>".to_owned(), ..JobPage::default() };
        page.layers = vec![layer("Heights"), layer("σ")];
        page.hatched = Some(Grid::filled(16, 8, true));
        let html = page.html().unwrap();
        assert!(!html.contains("<script") && html.contains("#layer1:checked~.stack .layer1{display:block}"));
        assert_eq!(html.matches("type=\"radio\"").count(), 2);
        assert!(html.contains("what &lt;it&gt; shows") && html.contains("id=\"hatched\""));
        // The stripes lie on every map and are one picture.
        assert_eq!((html.matches("<i class=\"hatching\">").count(), html.matches("url(data:").count()), (2, 1));
        assert!(!html.contains("no value"), "no cell of the maps is void");
        page.layers[1].picture[(3, 3)] = VOID_COLOUR;
        assert_eq!(page.html().unwrap().matches("no value").count(), 1);
    }

    #[test]
    fn a_report_becomes_facts_tables_and_notes() {
        let report = json!({
            "cells": 12, "cell_m": 0.333_333_33, "tiny": 1e-9, "warnings": ["a - b"], "missing": null,
            "images": [{"path": "a.tif", "shift": [1.0, 2.5], "deep": {"x": 1}}, {"path": "b.tif", "more": true}],
            "inner": {"depth": 3, "rest": {"done": true}},
        });
        let page = JobPage::of_report("Job", "Done.", &report);
        let facts: Vec<(&str, &str)> = page.facts.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        assert_eq!(facts, [("cells", "12"), ("cell, m", "0.333"), ("tiny", "1.00e-9")]);
        let group =
            |title: &str, name: &str, value: &str| (title.to_owned(), vec![(name.to_owned(), value.to_owned())]);
        assert_eq!(page.groups, [group("Inner", "depth", "3"), group("Inner: rest", "done", "yes")]);
        let html = page.html().unwrap();
        assert!(html.contains("<h2>Inner: rest</h2><dl><dt>done</dt><dd>yes</dd></dl>") && html.contains("<h2>Images"));
        assert_eq!(page.notes, ["a - b"]);
        assert_eq!(page.tables[0].heads, ["path", "shift", "more"]);
        assert_eq!(page.tables[0].rows, [["a.tif", "1, 2.5", ""], ["b.tif", "", "yes"]]);
    }

    #[test]
    fn stripes_lie_on_marked_cells_only() {
        let marked = Grid::from_vec(16, 1, (0..16).map(|x| x < 10).collect()).unwrap();
        let striped: Vec<usize> = (0..16).filter(|&x| stripes(&marked)[(x, 0)] == STRIPE).collect();
        assert_eq!(striped, [0, 1, 8, 9]);
    }
}
