//! STAC items in the place of images: the bytes are those of the images, dates and sun come from
//! the items, and items that lead nowhere are refused.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{band, sample, skysweep};
use serde_json::{Value, json};

/// Writes an item for a view of the sample town, and returns its path.
fn item(folder: &Path, view: usize, properties: &Value, assets: Value) -> PathBuf {
    let path = folder.join(format!("view_{view}.json"));
    let item = json!({ "type": "Feature", "stac_version": "1.0.0", "id": format!("view {view}"), "geometry": null,
                       "properties": properties, "links": [], "assets": assets });
    fs::write(&path, item.to_string()).unwrap();
    path
}

fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn stderr(done: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&done.get_output().stderr).into_owned()
}

fn image(href: &Path) -> Value {
    json!({ "data": { "href": href, "type": "image/tiff; application=geotiff", "roles": ["data"] } })
}

#[test]
fn items_stand_for_their_images() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    fs::create_dir(root.join("images")).unwrap();
    let views: Vec<PathBuf> = [1, 3].map(|view| sample(&format!("view_{view}.tif"))).to_vec();
    let items: Vec<PathBuf> = [(1, 150.0), (3, 150.2)]
        .into_iter()
        .zip(&views)
        .map(|((view, sun), path)| {
            let name = format!("images/view_{view}.tif");
            fs::copy(path, root.join(&name)).unwrap();
            let properties = json!({ "datetime": format!("2024-05-01T10:1{view}:00Z"), "view:sun_azimuth": sun,
                                     "view:sun_elevation": 48.0, "view:incidence_angle": 60.0 });
            item(root, view, &properties, image(Path::new(&format!("./{name}"))))
        })
        .collect();
    let settings = ["--gsd", "2", "--preset", "fast", "--height-range", "170", "280"];
    let run = |images: &[PathBuf], out: &str| {
        let out = root.join(out);
        let done = skysweep().arg("dsm").args(images).arg("-o").arg(&out).args(settings).assert().success();
        (band(&out.join("dsm/dsm.tif"), 1), read_json(&out.join("report/report.json")), stderr(&done))
    };
    let (plain, plain_report, _) = run(&views, "plain");
    let (of_items, report, warned) = run(&items, "items");
    // The files themselves name their inputs and dates.
    let bits = |heights: &raster::Grid<f32>| heights.data().iter().map(|h| h.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&plain), bits(&of_items));
    assert_eq!(report["images"][0]["acquired"], "2024-05-01T10:11:00Z");
    assert_eq!(report["images"][1]["sun"], json!({ "azimuth_deg": 150.2, "elevation_deg": 48.0 }));
    assert_eq!(report["images"][0]["rpc"], plain_report["images"][0]["rpc"]);
    assert!(plain_report["images"][0].get("sun").is_none());
    assert!(warned.contains("the item states an incidence angle of 60.0°"), "{warned}");
    let page = fs::read_to_string(root.join("items/report/report.html")).unwrap();
    assert!(page.contains("sun: azimuth") && page.contains("150, 48"), "the page shows the sun");
    let catalogue = read_json(&root.join("items/stac/item.json"));
    assert_eq!(catalogue["properties"]["start_datetime"], "2024-05-01T10:11:00Z");

    // Other commands take items as well.
    let ortho = root.join("ortho.tif");
    skysweep().arg("ortho").args(&items).arg("--dsm").arg(root.join("items")).arg("-o").arg(&ortho).assert().success();
    assert!(ortho.is_file());
    let info = skysweep().args(["rpc", "info"]).arg(&items[0]).assert().success();
    assert!(String::from_utf8_lossy(&info.get_output().stdout).contains("50844"), "the RPC is that of the image");
}

#[test]
fn the_rpc_of_an_item_is_taken_where_the_image_has_none() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    fs::create_dir(root.join("meta")).unwrap();
    let rpc = root.join("meta/camera_RPC.TXT");
    skysweep().args(["rpc", "convert"]).arg(sample("view_1.tif")).arg("-o").arg(&rpc).assert().success();
    let mut assets = json!({ "image": { "href": "plain.vrt", "roles": ["data"] },
                             "rpc": { "href": "meta/camera_RPC.TXT", "type": "text/plain" } });
    let vrt =
        "<VRTDataset rasterXSize=\"32\" rasterYSize=\"32\"><VRTRasterBand dataType=\"Byte\" band=\"1\"/></VRTDataset>";
    fs::write(root.join("plain.vrt"), vrt).unwrap();
    let with_rpc = item(root, 1, &json!({}), assets.clone());
    assert_eq!(formats::rpc::read_for_image(&with_rpc).unwrap().rpc, formats::rpc::read(&rpc).unwrap().rpc);
    assert!(formats::rpc::side_files(&with_rpc).contains(&root.join("meta/camera_RPC.TXT")));
    // An item is no RPC file, not even its own.
    assets["rpc"]["href"] = json!("view_1.json");
    item(root, 1, &json!({}), assets);
    assert!(formats::rpc::read_for_image(&with_rpc).is_err());
}

#[test]
fn items_that_lead_nowhere_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let other = sample("view_3.tif");
    let refused = |assets: Value, expected: &str| {
        let path = item(root, 1, &json!({}), assets);
        let done =
            skysweep().arg("dsm").args([&path, &other]).arg("-o").arg(root.join("out")).assert().failure().code(2);
        let text = stderr(&done);
        assert!(text.contains(expected) && text.contains("view_1.json"), "{text}");
    };
    refused(image(Path::new("https://example.com/view.tif")), "copy it beside the item");
    refused(image(Path::new("gone.tif")), "is not there, expected the file");
    refused(json!({}), "no asset is an image");
    fs::write(root.join("other.json"), "{\"type\": \"FeatureCollection\"}").unwrap();
    let images = [root.join("other.json"), other.clone()];
    let text = stderr(&skysweep().arg("dsm").args(images).arg("-o").arg(root.join("out")).assert().failure());
    assert!(text.contains("several features, expected a STAC item"), "{text}");
    assert!(!root.join("out").exists());
}
