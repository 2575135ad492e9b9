//! `skysweep products` and `skysweep dsm --products` on the sample town: the products agree with
//! the rasters of the run, and what is refused.

use std::path::Path;

use crate::common::{band, sample, skysweep};
use formats::points::PointCloud;
use formats::raster::read_dem;
use predicates::prelude::*;
use serde_json::Value;

/// Makes a coarse surface model of the town, with products.
fn run_of_town(folder: &Path, products: &[&str]) {
    let mut command = skysweep();
    command.arg("dsm").args(["view_1.tif", "view_2.tif", "view_3.tif"].map(sample)).arg("-o").arg(folder);
    command.args(["--preset", "fast", "--gsd", "1", "--height-range", "170", "280", "--progress", "none", "-q"]);
    command.args(products).assert().code(0);
}

fn report(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("products/products.json")).unwrap()).unwrap()
}

#[test]
fn the_cloud_has_the_observed_cells_of_the_run() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    run_of_town(&folder, &["--products", "dtm,cloud,classes"]);
    let made = report(&folder);
    let (heights, source) = (read_dem(folder.join("dsm/dsm.tif")).unwrap(), band(&folder.join("dsm/source.tif"), 1));
    let ground = band(&folder.join("products/dtm/ground.tif"), 1);
    let classes = band(&folder.join("products/classes/classes.tif"), 1);
    let buildings = classes.data().iter().filter(|class| **class == 6.0).count();
    assert!(buildings > 0 && made["classes"]["cells_building"] == buildings);
    let page = std::fs::read_to_string(folder.join("products/products.html")).unwrap();
    assert!(page.contains("<h1>Products</h1>") && page.contains(&buildings.to_string()));
    assert!(folder.join("products/classes/classes.html").is_file());
    let observed = source.data().iter().filter(|code| **code == 1.0).count();
    assert_eq!(made["cloud"]["points"], observed);
    // Buildings and vegetation as in the class raster; of the rest, ground is what the terrain
    // model shows.
    let class_of = |cell: usize| match (classes.data()[cell] as u8, ground.data()[cell] == 1.0) {
        (code @ (3 | 5 | 6 | 9), _) => code,
        (_, true) => 2,
        _ => 1,
    };
    for code in [2, 6] {
        let cells = (0..source.data().len()).filter(|cell| source.data()[*cell] == 1.0 && class_of(*cell) == code);
        assert_eq!(made["cloud"]["class_points"][code.to_string()], cells.count());
    }
    assert_eq!(made["cloud"]["ground_points"], made["cloud"]["class_points"]["2"]);
    for name in ["cloud.laz", "cloud.copc.laz"] {
        let cloud = PointCloud::open(folder.join("products").join(name)).unwrap();
        assert_eq!((cloud.horizontal_epsg(), cloud.vertical()), (heights.horizontal_epsg, heights.vertical));
        let width = heights.heights.width();
        let mut seen = vec![false; source.data().len()];
        let counts = cloud.visit(|point| {
            let (column, row) = heights.geotransform.cell_from_map(point.x, point.y).unwrap();
            let cell = row.round() as usize * width + column.round() as usize;
            assert!((f64::from(heights.heights.data()[cell]) - point.height_m).abs() < 0.0006);
            assert_eq!(point.class, class_of(cell));
            assert!(!std::mem::replace(&mut seen[cell], true));
        });
        assert_eq!(counts.unwrap().read, observed as u64);
    }

    // A second call takes the ortho of the first, and adds the filled cells.
    let call = |arguments: &[&str]| {
        let mut command = skysweep();
        command.arg("products").arg(&folder).args(["--progress", "none"]).args(arguments).assert()
    };
    call(&["--only", "cloud"])
        .code(2)
        .stderr(predicate::str::contains("cloud.laz").and(predicate::str::contains("hint")));
    let other = root.path().join("other");
    let ortho = folder.join("products/ortho.tif");
    let with = ["--only", "cloud", "--filled", "-o", other.to_str().unwrap(), "--ortho", ortho.to_str().unwrap()];
    call(&with).code(0);
    let all = heights.heights.data().iter().filter(|h| h.is_finite()).count();
    let told: Value = serde_json::from_slice(&std::fs::read(other.join("products.json")).unwrap()).unwrap();
    assert_eq!((&told["cloud"]["points"], &told["cloud"]["synthetic"]), (&all.into(), &(all - observed).into()));

    // A new surface takes the products of the old one away.
    run_of_town(&folder, &["--overwrite"]);
    assert!(!folder.join("products").exists());
}

/// The tileset names the tiles that are there, coarse ones have larger errors, and the lines lie at
/// whole intervals over the relief.
#[test]
fn the_mesh_and_the_contour_lines_fit_the_surface() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    run_of_town(&folder, &["--products", "contours,mesh"]);
    let (made, products) = (report(&folder), folder.join("products"));
    let tileset: Value = serde_json::from_slice(&std::fs::read(products.join("tileset.json")).unwrap()).unwrap();
    let mut tiles = Vec::new();
    let mut todo = vec![(&tileset["root"], tileset["geometricError"].as_f64().unwrap())];
    while let Some((tile, above)) = todo.pop() {
        let error = tile["geometricError"].as_f64().unwrap();
        assert!(error < above || (error == 0.0 && tile["children"].is_null()));
        tiles.push(tile["content"]["uri"].as_str().unwrap().to_owned());
        todo.extend(tile["children"].as_array().into_iter().flatten().map(|child| (child, error)));
    }
    assert_eq!(made["mesh"]["tiles"], tiles.len());
    assert!(tiles.len() > 4 && tiles.iter().all(|name| products.join(name).is_file()));
    // The transform leads to the middle of the town on the ellipsoid.
    let place: Vec<f64> = (12..15).map(|i| tileset["root"]["transform"][i].as_f64().unwrap()).collect();
    let ground = geodesy::ground_from_ecef(geodesy::EcefPoint { x: place[0], y: place[1], z: place[2] });
    let heights = read_dem(folder.join("dsm/dsm.tif")).unwrap();
    let map = crs::MapProjection::from_epsg(heights.horizontal_epsg.unwrap()).unwrap();
    let at = map.map_from_lonlat(ground.lon_deg, ground.lat_deg).unwrap();
    let (column, row) = heights.geotransform.cell_from_map(at.x, at.y).unwrap();
    let (width, height) = (heights.heights.width() as f64, heights.heights.height() as f64);
    assert!((column - 0.5 * width).abs() < 0.01 && (row - 0.5 * height).abs() < 0.01);

    // The single file holds the triangles of the report.
    let glb = std::fs::read(products.join("mesh.glb")).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let corners = 3 * made["mesh"]["glb_triangles"].as_u64().unwrap();
    assert_eq!(document["accessors"][2]["count"], corners);
    assert_eq!(document["asset"]["extras"]["origin"], made["mesh"]["glb_origin"]);
    assert!(corners < 3 * 2 * heights.heights.data().len() as u64 / 2, "{corners} corners");
    assert!(made["contours"]["lines"].as_u64().unwrap() > 5 && made["contours"]["unit"] == "m");
    assert!(made["dtm"]["cells_ground"].as_u64().unwrap() > 0, "contour lines need the ground");
    // The page of the products and that of the run link to all that is there, and to nothing else.
    for (page, own) in [("products/products.html", "./mesh.glb"), ("report/report.html", "../products/mesh.glb")] {
        let text = std::fs::read_to_string(folder.join(page)).unwrap();
        let targets: Vec<&str> = text.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        let targets: Vec<&str> = targets.into_iter().filter(|target| *target != "data:,").collect();
        assert!(targets.contains(&own) && !text.contains("cloud.laz"), "{page}: {targets:?}");
        for target in targets {
            let path = folder.join(page).parent().unwrap().join(target);
            assert!(path.is_file(), "{page} leads to {}", path.display());
        }
    }
    let text = std::fs::read_to_string(folder.join("products/products.html")).unwrap();
    for map in ["<b>Surface.</b>", "<b>Ground.</b>", "<b>Above ground.</b>", "<b>Contours.</b>", "<b>Colours.</b>"] {
        assert!(text.contains(map), "{map}");
    }
    // What the images do not say is said to be unknown, and each image has its quality.
    let text = std::fs::read_to_string(folder.join("report/report.html")).unwrap();
    for words in ["The dates of the images are unknown", "Quality of the images", "<td class=\"words\">unknown</td>"] {
        assert!(text.contains(words) || text.contains(&words.replace(" class=\"words\"", "")), "{words}");
    }
    assert!(text.contains("no value"), "the maps have voids, whose colour is explained");

    let refused = |arguments: &[&str], reason: &str| {
        let mut command = skysweep();
        command.arg("products").arg(&folder).args(["--progress", "none"]).args(arguments);
        command.assert().code(2).stderr(predicate::str::contains(reason));
    };
    refused(&["--only", "contours", "--contour-interval", "0"], "the contour interval is 0");
    refused(&["--only", "mesh", "--mesh-tolerance", "nan"], "the tolerance of the mesh is NaN");
    refused(&["--only", "mesh"], "mesh.glb");
}

#[test]
fn folders_that_are_no_run_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |products: &str, reason: &str| {
        let mut command = skysweep();
        command.arg("products").arg(folder.path()).args(["--only", products, "--progress", "none"]);
        command.assert().code(2).stderr(predicate::str::contains(reason));
        assert!(!folder.path().join("products").exists());
    };
    refused("cloud", "dsm.tif");
    refused("statues", "possible values: cloud");
    std::fs::create_dir(folder.path().join("dsm")).unwrap();
    std::fs::copy(sample("truth/dsm.tif"), folder.path().join("dsm/dsm.tif")).unwrap();
    refused("cloud", "used_config.toml");
}
