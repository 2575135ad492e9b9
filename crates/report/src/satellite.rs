//! Report of priors for satellite images, as JSON and as one page: what each image sees of a city
//! model.

use serde::Serialize;
use serde_json::Value;

use crate::escape::escape;
use crate::page::page;
use crate::parts::{ViewPictures, cards_of, figures, last_part, notes, table, with_generator};
use crate::picture::PictureError;
use crate::words::counted;

/// Report of the priors of a city model for satellite images.
#[derive(Debug, Clone, Serialize)]
pub struct SatellitePriorsReport {
    /// File of the city model.
    pub model: String,
    /// Reference system that the model states.
    pub model_crs: String,
    /// Map projection in which its coordinates were read.
    pub map: String,
    /// Vertical datum of its heights, in words.
    pub model_heights_above: String,
    /// Number of triangles of the model in use.
    pub triangles: usize,
    /// Notes for the reader.
    pub notes: Vec<String>,
    /// One row per image.
    pub images: Vec<SatelliteRow>,
    /// Description of the maps, by name.
    pub maps: Value,
}

/// Report of one image.
#[derive(Debug, Clone, Serialize)]
pub struct SatelliteRow {
    /// File of the image.
    pub image: String,
    /// Name of its maps.
    pub name: String,
    /// Numbers of columns and rows.
    pub size: [usize; 2],
    /// Number of pixels that see a building.
    pub hit_pixels: usize,
    /// Lowest and highest place seen, metres above the ellipsoid. `None` if no building is seen.
    pub height_range_m: Option<[f32; 2]>,
    /// Height from which distances are measured, metres above the ellipsoid.
    pub distance_from_height_m: f64,
    /// Largest distance between the approximated lines of sight and those of the RPC, metres.
    pub line_of_sight_error_m: f64,
    /// Whether a correction was applied to the RPC.
    pub corrected: bool,
}

impl SatellitePriorsReport {
    /// Returns every number by name.
    ///
    /// # Errors
    /// [`serde_json::Error`] if the report cannot be serialised. A report of finite numbers always
    /// can.
    pub fn json(&self) -> Result<Value, serde_json::Error> {
        with_generator(self)
    }

    /// Returns the page, with pictures of some images.
    ///
    /// # Errors
    /// [`PictureError`] if a picture has no pixels.
    pub fn html(&self, pictures: &[ViewPictures]) -> Result<String, PictureError> {
        let title = format!("Priors of {} in satellite images", last_part(&self.model));
        let lead = format!(
            "{} in {}, heights above {}, seen from {}.",
            counted(self.triangles, "triangle"),
            self.map,
            self.model_heights_above,
            counted(self.images.len(), "image")
        );
        let body = [
            format!("<h1>{}</h1>", escape(&title)),
            format!("<p class=\"lead\">{}</p>", escape(&lead)),
            self.cards(),
            notes(&self.notes),
            figures(pictures)?,
            self.image_table(),
            self.map_table(),
        ];
        Ok(page(&title, &body.join("\n")))
    }

    fn cards(&self) -> String {
        let hits: usize = self.images.iter().map(|row| row.hit_pixels).sum();
        let pixels: usize = self.images.iter().map(|row| row.size[0] * row.size[1]).sum();
        let seeing = self.images.iter().filter(|row| row.hit_pixels > 0).count();
        let error_m = self.images.iter().map(|row| row.line_of_sight_error_m).fold(0.0, f64::max);
        let share = 100.0 * hits as f64 / pixels.max(1) as f64;
        cards_of(&[
            (format!("{seeing} <small>of {}</small>", self.images.len()), "images see a building"),
            (format!("{share:.1} <small>%</small>"), "of the pixels see a building"),
            (format!("{:.1} <small>mm</small>", 1e3 * error_m), "off the RPC's lines of sight at most"),
        ])
    }

    fn image_table(&self) -> String {
        let row = |row: &SatelliteRow| {
            let range = row.height_range_m.map_or("–".to_owned(), |[low, high]| format!("{low:.1} to {high:.1} m"));
            let share = 100.0 * row.hit_pixels as f64 / (row.size[0] * row.size[1]).max(1) as f64;
            vec![
                row.name.clone(),
                format!("{} × {}", row.size[0], row.size[1]),
                format!("{share:.1} %"),
                range,
                format!("{:.1} m", row.distance_from_height_m),
                format!("{:.2} mm", 1e3 * row.line_of_sight_error_m),
                if row.corrected { "corrected" } else { "as delivered" }.to_owned(),
            ]
        };
        let heads = ["image", "size", "building", "heights", "distances from", "lines of sight off by", "RPC"];
        table("All images", &heads, self.images.iter().map(row))
    }

    fn map_table(&self) -> String {
        let Value::Object(maps) = &self.maps else { return String::new() };
        let row = |(name, value): (&String, &Value)| vec![name.clone(), value.as_str().unwrap_or_default().to_owned()];
        table("Maps", &["folder", "what it holds"], maps.iter().map(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::Grid;
    use serde_json::json;

    fn report() -> SatellitePriorsReport {
        let row = |name: &str, hit_pixels| SatelliteRow {
            image: format!("images/{name}.tif"),
            name: name.to_owned(),
            size: [10, 4],
            hit_pixels,
            height_range_m: (hit_pixels > 0).then_some([181.5, 203.25]),
            distance_from_height_m: 210.0,
            line_of_sight_error_m: 0.000_4,
            corrected: hit_pixels > 0,
        };
        SatellitePriorsReport {
            model: "data/town.city.json".to_owned(),
            model_crs: "EPSG:32631".to_owned(),
            map: "EPSG:32631".to_owned(),
            model_heights_above: "the ellipsoid".to_owned(),
            triangles: 12,
            notes: vec!["one image sees <nothing>".to_owned()],
            images: vec![row("view_1", 10), row("view_2", 0)],
            maps: json!({ "mask": "1 where a building is seen" }),
        }
    }

    #[test]
    fn the_page_holds_the_numbers() {
        let maps = vec![("heights", Grid::filled(4, 3, [9; 3]))];
        let page = report().html(&[ViewPictures { name: "view_1".to_owned(), maps }]).unwrap();
        for words in [
            "1 <small>of 2</small>",
            "12.5 <small>%</small>",
            "181.5 to 203.2 m",
            "0.40 mm",
            "as delivered",
            "&lt;nothing&gt;",
            "data:image/png",
            "1 where a building is seen",
        ] {
            assert!(page.contains(words), "{words} is not in\n{page}");
        }
        assert!(!page.contains("<nothing>"));
        let plain = report().html(&[]).unwrap();
        assert!(!plain.contains("<figure"));
    }

    #[test]
    fn the_json_has_every_image() {
        let value = report().json().unwrap();
        assert_eq!(
            (&value["images"][0]["hit_pixels"], &value["images"][1]["height_range_m"]),
            (&json!(10), &Value::Null)
        );
    }
}
