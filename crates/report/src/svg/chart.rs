//! Frame of a plot and its marks.

use std::fmt::Write;

use super::axis::Axis;
use crate::escape::escape;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 320.0;
/// Margins for ticks and labels: left, right, top, bottom.
const MARGINS: [f64; 4] = [58.0, 16.0, 16.0, 48.0];
/// Height of the heading above a plot.
const HEADING: f64 = 26.0;

/// Style of the marks. Colours are variables that a page, or a plot in a file of its own, sets.
pub(crate) const STYLE: &str = "\
.chart text{font:12px system-ui,sans-serif;fill:var(--ink)}.chart .soft{fill:var(--soft)}\
.chart .grid{stroke:var(--line);stroke-width:1}.chart .bar{fill:var(--a)}.chart .bar2{fill:var(--b)}\
.chart .line{fill:none;stroke:var(--a);stroke-width:2}.chart .line2{fill:none;stroke:var(--b);stroke-width:2}\
.chart .rule{fill:none;stroke:var(--soft);stroke-width:1;stroke-dasharray:4 3}.chart .whisker{fill:none;\
stroke:var(--ink);stroke-width:1.2}\
.chart .dot{fill:var(--a);stroke:var(--paper);stroke-width:1}.chart .dot2{fill:var(--b);stroke:var(--paper);\
stroke-width:1}\
.chart .dot3{fill:var(--soft);stroke:var(--paper);stroke-width:1}";

/// Colours of a plot in a file of its own.
const COLOURS: &str = ":root{--paper:#fff;--ink:#1d2530;--soft:#66707c;--line:#e2e6ea;--a:#2667a8;--b:#c8551b;\
background:#fff}\
@media(prefers-color-scheme:dark){:root{--paper:#14181d;--ink:#e4e8ec;--soft:#98a2ad;--line:#2b323a;--a:#6fb1ee;\
--b:#f29a63;background:#14181d}}";

/// Plot under construction. Marks are drawn in the order in which they are added.
///
/// ```
/// use report::{Axis, Chart};
///
/// let (x, y) = (Axis::linear("cell", 0.0, 10.0), Axis::linear("m", 0.0, 1.0));
/// let mut chart = Chart::new("Errors", x, y);
/// chart.dot("dot", 3.0, 0.4);
/// assert!(chart.inline().starts_with("<svg"));
/// ```
#[derive(Debug, Clone)]
pub struct Chart {
    title: String,
    x: Axis,
    y: Axis,
    marks: String,
}

impl Chart {
    /// Returns a plot without marks. The title is read by screen readers.
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Self { title: title.to_owned(), x, y, marks: String::new() }
    }

    /// Draws a line through points. `class` is `line`, `line2` or `rule`.
    pub fn line(&mut self, class: &str, points: impl Iterator<Item = (f64, f64)>) {
        let places: Vec<String> = points
            .map(|(x, y)| {
                let (x, y) = self.place(x, y);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        self.add(format_args!("<polyline class=\"{class}\" points=\"{}\"/>", places.join(" ")));
    }

    /// Draws a bar from the foot of the plot. `class` is `bar` or `bar2`.
    pub fn bar(&mut self, class: &str, (from, to): (f64, f64), value: f64) {
        let ((left, top), (right, foot)) = (self.place(from, value), self.place(to, f64::NEG_INFINITY));
        let (width, height) = ((right - left).max(0.0), (foot - top).max(0.0));
        self.add(format_args!(
            "<rect class=\"{class}\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        ));
    }

    /// Draws a vertical line between two values with a cap at the second.
    pub fn whisker(&mut self, x: f64, from: f64, to: f64) {
        let ((x, foot), (_, top)) = (self.place(x, from), self.place(x, to));
        let (left, right) = (x - 5.0, x + 5.0);
        self.add(format_args!(
            "<path class=\"whisker\" d=\"M{x:.1} {foot:.1}V{top:.1}M{left:.1} {top:.1}H{right:.1}\"/>"
        ));
    }

    /// Draws a line from a small dot, as an arrow without a head.
    pub fn vector(&mut self, (from_x, from_y): (f64, f64), (to_x, to_y): (f64, f64)) {
        let ((x, y), (end_x, end_y)) = (self.place(from_x, from_y), self.place(to_x, to_y));
        self.add(format_args!(
            "<path class=\"line\" d=\"M{x:.1} {y:.1}L{end_x:.1} {end_y:.1}\"/><circle class=\"dot2\" cx=\"{x:.1}\" \
             cy=\"{y:.1}\" r=\"2.5\"/>"
        ));
    }

    /// Returns how many times as wide as high the area of the marks is.
    pub(super) fn shape() -> f64 {
        let [left, right, top, bottom] = MARGINS;
        (WIDTH - left - right) / (HEIGHT - top - bottom)
    }

    /// Draws a dot. `class` is `dot`, `dot2` or `dot3`.
    pub fn dot(&mut self, class: &str, x: f64, y: f64) {
        let (x, y) = self.place(x, y);
        self.add(format_args!("<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\"/>"));
    }

    /// Draws a square. `class` is `dot`, `dot2` or `dot3`.
    pub fn square(&mut self, class: &str, x: f64, y: f64) {
        let (x, y) = self.place(x, y);
        let (left, top) = (x - 4.0, y - 4.0);
        self.add(format_args!("<rect class=\"{class}\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"8\" height=\"8\"/>"));
    }

    /// Draws text beside a position: to its right, or to its left if it would not fit there.
    pub fn note(&mut self, x: f64, y: f64, text: &str) {
        let (x, y) = self.place(x, y);
        let fits = x + 8.0 + 6.2 * text.chars().count() as f64 <= WIDTH;
        let (x, anchor) = if fits { (x + 8.0, "start") } else { (x - 8.0, "end") };
        let y = y + 4.0;
        self.add(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>", escape(text)));
    }

    /// Returns the plot for a page whose style sets the colours.
    pub fn inline(&self) -> String {
        self.svg("")
    }

    /// Returns plots as a file of their own, in `columns` columns, each under its title. `key`
    /// explains the marks below them: classes of dots with texts.
    pub fn sheet(charts: &[Self], columns: usize, key: &[(&str, &str)]) -> String {
        let columns = columns.clamp(1, charts.len().max(1));
        let pitch = HEIGHT + HEADING;
        let (width, foot) = (WIDTH * columns as f64, pitch * charts.len().div_ceil(columns) as f64);
        let height = foot + HEADING;
        let mut body = String::new();
        for (i, chart) in charts.iter().enumerate() {
            let (x, y) = ((i % columns) as f64 * WIDTH, (i / columns) as f64 * pitch);
            let title = escape(&chart.title);
            let (text_x, text_y, top) = (x + MARGINS[0], y + 18.0, y + HEADING);
            let place = format!(" x=\"{x}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{HEIGHT}\"");
            // Writing to a string cannot fail.
            let _ = write!(
                body,
                "<text x=\"{text_x}\" y=\"{text_y}\" font-weight=\"600\">{title}</text>{}",
                chart.svg(&place)
            );
        }
        let mut x = MARGINS[0];
        for (class, text) in key {
            let (y, text_x, text_y) = (foot + 9.0, x + 10.0, foot + 13.0);
            let _ = write!(body, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y}\" r=\"4.5\"/>");
            let _ = write!(body, "<text x=\"{text_x:.1}\" y=\"{text_y}\">{}</text>", escape(text));
            x += 34.0 + 6.6 * text.chars().count() as f64;
        }
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\"><style>{COLOURS}{STYLE}</style>{body}</svg>\n"
        )
    }

    fn svg(&self, attributes: &str) -> String {
        let (title, frame, marks) = (escape(&self.title), self.frame(), &self.marks);
        format!(
            "<svg class=\"chart\"{attributes} viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\
             <title>{title}</title>{frame}{marks}</svg>"
        )
    }

    fn frame(&self) -> String {
        let [left, right, top, bottom] = MARGINS;
        let (foot, end) = (HEIGHT - bottom, WIDTH - right);
        let mut frame = String::new();
        // Writing to a string cannot fail.
        for (value, text) in self.y.ticks() {
            let y = self.place(0.0, value).1;
            let _ = write!(frame, "<path class=\"grid\" d=\"M{left} {y:.1}H{end}\"/>");
            let (x, y) = (left - 7.0, y + 4.0);
            let _ = write!(
                frame,
                "<text class=\"soft\" x=\"{x}\" y=\"{y:.1}\" text-anchor=\"end\">{}</text>",
                escape(&text)
            );
        }
        for (value, text) in self.x.ticks() {
            let (x, tick, y) = (self.place(value, 0.0).0, foot + 5.0, foot + 19.0);
            let _ = write!(frame, "<path class=\"grid\" d=\"M{x:.1} {foot}V{tick}\"/>");
            let _ = write!(
                frame,
                "<text class=\"soft\" x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\">{}</text>",
                escape(&text)
            );
        }
        let (middle_x, middle_y, low) = ((left + end) / 2.0, (top + foot) / 2.0, HEIGHT - 8.0);
        let (x, y) = (escape(self.x.label()), escape(self.y.label()));
        let _ = write!(frame, "<text x=\"{middle_x}\" y=\"{low}\" text-anchor=\"middle\">{x}</text>");
        let _ =
            write!(frame, "<text transform=\"translate(14 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{y}</text>");
        frame
    }

    /// Returns the position of a pair of values in the picture.
    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, right, top, bottom] = MARGINS;
        let (width, height) = (WIDTH - left - right, HEIGHT - top - bottom);
        (left + width * self.x.fraction(x), top + height * (1.0 - self.y.fraction(y)))
    }

    fn add(&mut self, mark: std::fmt::Arguments<'_>) {
        let _ = self.marks.write_fmt(mark);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_lie_inside_the_frame_and_texts_are_escaped() {
        let mut chart = Chart::new("a < b", Axis::linear("x & y", 0.0, 1.0), Axis::linear("", 0.0, 2.0));
        chart.line("line", [(0.0, 0.0), (1.0, 2.0), (5.0, -9.0)].into_iter());
        chart.bar("bar", (0.2, 0.4), 1.0);
        chart.whisker(0.5, 0.0, 1.0);
        chart.dot("dot", 0.5, 1.0);
        chart.note(0.99, 1.0, "<balanced>");
        let svg = chart.inline();
        assert!(svg.contains("58.0,272.0 544.0,16.0 544.0,272.0"), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains("x &amp; y") && svg.contains("&lt;balanced&gt;"));
        assert!(svg.contains("text-anchor=\"end\">&lt;balanced"));
        assert!(!svg.contains("NaN") && !svg.contains("xmlns"));
        let sheet = Chart::sheet(&[chart.clone(), chart.clone(), chart], 2, &[("dot", "balanced")]);
        assert!(sheet.contains("xmlns") && sheet.contains("prefers-color-scheme"));
        assert!(sheet.contains("width=\"1120\" height=\"718\"") && sheet.contains("x=\"560\" y=\"26\""), "{sheet}");
    }
}
