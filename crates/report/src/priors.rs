//! Report of a set of priors, as JSON and as one page: its inputs, its results, and their limits.

use serde::Serialize;
use serde_json::Value;

use crate::escape::escape;
use crate::page::page;
use crate::parts::{ViewPictures, cards_of, figures, last_part, notes, table, with_generator};
use crate::picture::PictureError;
use crate::words::{counted, typeset};

/// Report of the priors of a city model for a set of cameras.
#[derive(Debug, Clone, Serialize)]
pub struct PriorsReport {
    /// File of the city model.
    pub model: String,
    /// Source of the cameras.
    pub cameras: String,
    /// `building-only` or `building-enhanced`.
    pub mode: String,
    /// Notes: choices with their reasons, and what was left out.
    pub notes: Vec<String>,
    /// Number of triangles of the model in use.
    pub triangles: usize,
    /// Sampled area, m².
    pub sampled_area_m2: f64,
    /// Area that was not sampled, by class, m².
    pub skipped_area_m2: Vec<(String, f64)>,
    /// Number of points on the model.
    pub samples: usize,
    /// Number of points that enough views see.
    pub kept: usize,
    /// Lowest number of views that must see a point.
    pub min_views: u32,
    /// Number of pairs of a view and a point that it sees.
    pub pairs: u64,
    /// Number of points by the number of views that see them. The last entry counts that many views
    /// and more.
    pub views_histogram: Vec<usize>,
    /// Number of kept points, by class.
    pub kept_by_class: Vec<(String, usize)>,
    /// Number of points taken from the structure from motion.
    pub scene_points: usize,
    /// Number of points against geometric error.
    pub error_curve: Vec<ErrorRow>,
    /// Metres per step of the 16-bit depth maps. `None` if there are none.
    pub depth_png_step: Option<f64>,
    /// Command lines that train on the dataset.
    pub commands: Vec<String>,
    /// One row per view.
    pub views: Vec<ViewRow>,
    /// Settings, by name.
    pub settings: Value,
}

/// Number of points that keep within a geometric error.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ErrorRow {
    /// Geometric error, metres.
    pub error_m: f64,
    /// Number of points with varying spacing.
    pub points: f64,
    /// Number of points with one spacing.
    pub even_points: f64,
}

/// Report of one view.
#[derive(Debug, Clone, Serialize)]
pub struct ViewRow {
    /// Name of the image.
    pub name: String,
    /// Numbers of columns and rows of its maps.
    pub size: [usize; 2],
    /// Number of pixels that see a building.
    pub hit_pixels: usize,
    /// Smallest and largest depth. `None` if no building is seen.
    pub depth_range: Option<[f32; 2]>,
    /// Number of points in the image.
    pub candidates: usize,
    /// Number of these points that nothing hides.
    pub visible: usize,
}

impl PriorsReport {
    /// Returns every number by name.
    ///
    /// # Errors
    /// [`serde_json::Error`] if the report cannot be serialised. A report of finite numbers always
    /// can.
    pub fn json(&self) -> Result<Value, serde_json::Error> {
        with_generator(self)
    }

    /// Returns the page, with pictures of some views.
    ///
    /// # Errors
    /// [`PictureError`] if a picture has no pixels.
    pub fn html(&self, pictures: &[ViewPictures]) -> Result<String, PictureError> {
        let title = format!("Priors of {}", last_part(&self.model));
        let mut body = vec![
            format!("<h1>{}</h1>", escape(&title)),
            format!("<p class=\"lead\">{}</p>", escape(&self.lead())),
            self.cards(),
            notes(&self.notes),
        ];
        body.push(figures(pictures)?);
        body.extend([
            self.curve_table(),
            self.class_table(),
            self.view_table(),
            self.command_list(),
            self.setting_list(),
        ]);
        Ok(page(&title, &body.join("\n")))
    }

    fn lead(&self) -> String {
        format!(
            "Of {} on {}, {} are seen by {} or more of {} ({}).",
            counted(self.samples, "point"),
            counted(self.triangles, "triangle"),
            self.kept,
            self.min_views,
            counted(self.views.len(), "view"),
            self.mode
        )
    }

    fn cards(&self) -> String {
        let hits: usize = self.views.iter().map(|v| v.hit_pixels).sum();
        let pixels: usize = self.views.iter().map(|v| v.size[0] * v.size[1]).sum();
        let share = 100.0 * hits as f64 / pixels.max(1) as f64;
        let cards = [
            (self.kept.to_string(), "points kept"),
            (self.pairs.to_string(), "pairs of view and point"),
            (self.views.len().to_string(), "views"),
            (format!("{share:.1} <small>%</small>"), "of the pixels see a building"),
        ];
        cards_of(&cards)
    }

    fn curve_table(&self) -> String {
        if self.error_curve.is_empty() {
            return String::new();
        }
        let row = |row: &ErrorRow| {
            vec![format!("{} m", row.error_m), format!("{:.0}", row.points), format!("{:.0}", row.even_points)]
        };
        let rows = self.error_curve.iter().map(row);
        table("Points against geometric error", &["error", "points", "of one spacing"], rows)
    }

    fn class_table(&self) -> String {
        let kept =
            self.kept_by_class.iter().map(|(class, count)| vec![class.clone(), count.to_string(), String::new()]);
        let skipped = self.skipped_area_m2.iter();
        let skipped =
            skipped.map(|(class, area)| vec![class.clone(), "not sampled".to_owned(), format!("{area:.0} m²")]);
        table("Classes", &["class", "points kept", "left out"], kept.chain(skipped))
    }

    fn view_table(&self) -> String {
        let row = |view: &ViewRow| {
            let range = view.depth_range.map_or("–".to_owned(), |[near, far]| format!("{near:.1} to {far:.1}"));
            let share = 100.0 * view.hit_pixels as f64 / (view.size[0] * view.size[1]).max(1) as f64;
            let size = format!("{} × {}", view.size[0], view.size[1]);
            vec![
                view.name.clone(),
                size,
                format!("{share:.1} %"),
                range,
                view.candidates.to_string(),
                view.visible.to_string(),
            ]
        };
        let heads = ["image", "size", "building", "depth", "points in it", "visible"];
        table("All views", &heads, self.views.iter().map(row))
    }

    fn command_list(&self) -> String {
        if self.commands.is_empty() {
            return String::new();
        }
        let items: String = self.commands.iter().map(|c| format!("<li><code>{}</code></li>", escape(c))).collect();
        format!("<h2>How to train</h2><ul>{items}</ul>")
    }

    fn setting_list(&self) -> String {
        let Value::Object(settings) = &self.settings else { return String::new() };
        let item = |(name, value): (&String, &Value)| {
            let text = match value {
                Value::Null => "none".to_owned(),
                value => value.as_str().map_or_else(|| value.to_string(), str::to_owned),
            };
            format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(&typeset(&text)))
        };
        format!("<h2>Settings</h2><dl>{}</dl>", settings.iter().map(item).collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::Grid;
    use serde_json::json;

    fn report() -> PriorsReport {
        PriorsReport {
            model: "data/<town>.city.json".to_owned(),
            cameras: "sparse/0".to_owned(),
            mode: "building-only".to_owned(),
            notes: vec!["grounds & closures are left out".to_owned()],
            triangles: 12,
            sampled_area_m2: 132.0,
            skipped_area_m2: vec![("GroundSurface".to_owned(), 48.0)],
            samples: 1_000,
            kept: 321,
            min_views: 2,
            pairs: 900,
            views_histogram: vec![600, 79, 321],
            kept_by_class: vec![("RoofSurface".to_owned(), 321)],
            scene_points: 0,
            error_curve: vec![ErrorRow { error_m: 0.1, points: 5e3, even_points: 5e4 }],
            depth_png_step: Some(0.001),
            commands: vec!["train <it>".to_owned()],
            views: vec![ViewRow {
                name: "<a>.png".to_owned(),
                size: [8, 6],
                hit_pixels: 12,
                depth_range: Some([3.0, 9.5]),
                candidates: 500,
                visible: 400,
            }],
            settings: json!({ "seed": 7 }),
        }
    }

    #[test]
    fn the_page_holds_the_numbers_and_nothing_leaves_its_place() {
        let picture = Grid::filled(4, 3, [9; 3]);
        let page = report()
            .html(&[ViewPictures {
                name: "<a>.png".to_owned(),
                maps: vec![("depth", picture.clone()), ("normals", picture)],
            }])
            .unwrap();
        for words in
            ["321 are seen by 2 or more of 1 view (", "25.0 %", "3.0 to 9.5", "not sampled", "data:image/png", "50000"]
        {
            assert!(page.contains(words), "{words}");
        }
        assert!(!page.contains("<a>") && page.contains("&lt;a&gt;.png") && page.contains("&lt;town&gt;"));
    }

    #[test]
    fn the_json_says_who_made_it() {
        let value = report().json().unwrap();
        assert!(value["generator"].as_str().unwrap().starts_with("skysweep priors "));
        assert_eq!(
            (&value["kept"], &value["views"][0]["visible"], &value["settings"]["seed"]),
            (&json!(321), &json!(400), &json!(7))
        );
    }
}
