//! The page of the products: all of them as maps and as links, also those that earlier calls made.

use std::path::Path;

use raster::{Grid, gaussian};
use report::{JobPage, Legend, LightEnd, MapLayer, PageLink, grouped, sensible};

use super::contours::SMOOTHING_PX;
use super::error::ProductsError;
use super::report::ProductsReport;
use super::scene::SurfaceOfRun;
use job::files::FileError;
use job::report_page;
use surfaces::classes;

/// Files that the page links to, and what they are.
const FILES: [(&str, &str); 15] = [
    ("dtm/dtm.html", "report of the bare ground"),
    ("dtm/dtm.tif", "heights of the bare ground"),
    ("dtm/height_above_ground.tif", "heights above the ground"),
    ("dtm/ground.tif", "where the ground was observed"),
    ("classes/classes.html", "report of the classes"),
    ("classes/classes.tif", "ground, buildings, vegetation"),
    ("classes/ndvi.tif", "vegetation index"),
    ("contours.gpkg", "contour lines of the ground"),
    ("cloud.laz", "coloured points (LAZ)"),
    ("cloud.copc.laz", "coloured points (COPC)"),
    ("mesh.glb", "textured mesh (GLB)"),
    ("tileset.json", "textured mesh (3D Tiles)"),
    ("ortho.tif", "images laid on the surface"),
    ("ortho_report.html", "report of the ortho"),
    ("products.json", "all numbers of this report"),
];
/// Colour of contour lines.
const LINE: [u8; 3] = [92, 52, 24];

/// Returns the page. `colours` are those of the cloud and the mesh.
pub(super) fn of(
    report: &ProductsReport,
    surface: &SurfaceOfRun,
    colours: Option<Grid<[u8; 3]>>,
) -> Result<JobPage, ProductsError> {
    let value = serde_json::to_value(report).map_err(FileError::from)?;
    let names = FILES.iter().filter(|(name, _)| report.folder.join(name).is_file() || *name == "products.json");
    let mut links: Vec<PageLink> = names.map(|(name, title)| PageLink::new(*name, *title)).collect();
    let run_page = Path::new("../report/report.html");
    if report.folder.join(run_page).is_file() {
        links.push(PageLink::new(run_page.to_string_lossy(), "report of the surface model"));
    }
    let filled = surface.layer("filled.tif").ok();
    Ok(JobPage {
        cards: cards(report),
        layers: layers(report, surface, colours),
        hatched: filled.map(|filled| report_page::thinned(&filled).0.map(|code| *code == 1.0)),
        links,
        ..JobPage::of_report("Products", &format!("Made of {}.", report.surface.display()), &value)
    })
}

fn cards(report: &ProductsReport) -> Vec<(String, &'static str)> {
    let mut cards = Vec::new();
    if let Some(classes) = &report.classes {
        let cells = (classes.size.0 * classes.size.1).max(1) as f64;
        cards.push((format!("{:.1} %", 100.0 * classes.cells_building as f64 / cells), "covered by buildings"));
    }
    if let Some(dtm) = &report.dtm {
        let cells = (dtm.size.0 * dtm.size.1).max(1) as f64;
        cards.push((format!("{:.1} %", 100.0 * dtm.cells_ground as f64 / cells), "of the cells show the ground"));
    }
    if let Some(contours) = &report.contours {
        cards.push((
            format!("{} {}", sensible(contours.interval, contours.unit), contours.unit),
            "between contour lines",
        ));
    }
    if let Some(cloud) = &report.cloud {
        let points = usize::try_from(cloud.extent.points).unwrap_or(usize::MAX);
        cards.push((grouped(points), "points"));
    }
    if let Some(mesh) = &report.mesh {
        cards.push((grouped(mesh.glb_triangles), "triangles of the mesh"));
    }
    cards
}

/// Returns the maps. What cannot be read is left out: the products themselves are whole.
fn layers(report: &ProductsReport, surface: &SurfaceOfRun, colours: Option<Grid<[u8; 3]>>) -> Vec<MapLayer> {
    let cell_m = surface.cell_m();
    let read = |name: &str| surface.raster(&report.folder.join(name)).ok();
    let mut layers =
        vec![report_page::relief_layer("Surface", "Heights of the surface, shaded.", &surface.dem.heights, cell_m)];
    layers.extend(colours.map(|picture| MapLayer {
        name: "Colours".to_owned(),
        picture,
        caption: "Colours of the cells in the point cloud and the mesh.".to_owned(),
        legend: None,
    }));
    let ground = read("dtm/dtm.tif");
    if let Some(ground) = &ground {
        let caption = "Heights of the bare ground, shaded.";
        layers.push(report_page::relief_layer("Ground", caption, ground, cell_m));
    }
    if let Some(above) = read("dtm/height_above_ground.tif") {
        let (_, highest) = report_page::shown_range(&above);
        let ramp = Legend::sequential(0.0, f64::from(highest), LightEnd::Low, "m");
        layers.push(report_page::legend_layer("Above ground", "Heights above the bare ground.", &above, ramp));
    }
    if let Some(codes) = read("classes/classes.tif") {
        // No-data is the code of cells without a class.
        let codes = codes.map(|code| if code.is_nan() { 0.0 } else { *code });
        let caption = "What stands is a building where it consists of planes, and vegetation where it is rough.";
        layers.push(report_page::legend_layer("Classes", caption, &codes, classes::legend()));
    }
    if let (Some(ground), Some(contours)) = (&ground, &report.contours) {
        layers.push(contour_layer(ground, (contours.interval, contours.unit), cell_m));
    }
    layers
}

/// Returns the ground with its contour lines, which pass between cells on two sides of a height.
/// The interval and the heights of the ground have the same unit.
fn contour_layer(ground: &Grid<f32>, (interval, unit): (f64, &str), cell_m: f64) -> MapLayer {
    let caption = format!("Contour lines every {} {unit} over the bare ground.", sensible(interval, unit));
    let mut layer = report_page::relief_layer("Contours", &caption, ground, cell_m);
    let heights = report_page::thinned(&gaussian(ground, SMOOTHING_PX)).0;
    let step = |x: usize, y: usize| (f64::from(heights[(x, y)]) / interval).floor();
    for y in 1..heights.height() {
        for x in 1..heights.width() {
            let here = step(x, y);
            let is_line = [step(x - 1, y), step(x, y - 1)].iter().any(|other| other.is_finite() && *other != here);
            if is_line && here.is_finite() {
                layer.picture[(x, y)] = LINE;
            }
        }
    }
    layer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contour_lines_lie_where_heights_pass_them() {
        let slope = Grid::from_vec(40, 40, (0..1600).map(|i| (i % 40) as f32 + 0.5).collect()).unwrap();
        let layer = contour_layer(&slope, (10.0, "m"), 1.0);
        let lines: Vec<usize> = (0..40).filter(|&x| layer.picture[(x, 20)] == LINE).collect();
        assert_eq!(lines, [10, 20, 30]);
        assert!(layer.caption.contains("every 10 m"));
    }
}
