//! The alignment by hand as its page asks for it: what it is told, pairs that are fitted, what is
//! saved, and what is refused in words. The model is planted: cameras and heights of the sample
//! town in a frame of their own, as a reconstruction leaves them.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use camera::Similarity;
use crs::VerticalDatum;
use formats::colmap::{ColmapEncoding, ColmapModel, ColmapPoint, ColmapView, read_with_points};
use formats::splat_ply::LocalOrigin;
use jobs::align::{AlignJobConfig, ManualAlignConfig};
use jobs::align_page::{AlignPage, AlignPageConfig};
use numeric::{CancelFlag, Cancellable, Silent};
use serde_json::{Value, json};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn map() -> PathBuf {
    root().join("data-samples/town/truth/dsm.tif")
}

fn town_cameras() -> ColmapModel {
    read_with_points(&root().join("data-samples/town/cameras/sparse/0")).unwrap().0
}

/// Writes a model, and returns the similarity from it to the world.
fn planted(folder: &Path) -> Similarity {
    let cameras = town_cameras();
    let dem = formats::raster::read_dem(map()).unwrap();
    let (x, y) = dem.geotransform.map_from_cell(320.0, 320.0);
    let turn = [[0.36, 0.48, 0.8], [-0.8, 0.6, 0.0], [-0.48, -0.64, 0.6]];
    let world = Similarity::new(4.0, turn, [x, y, 200.0]).unwrap();
    let back = world.inverse();
    let views = cameras.views.iter().map(|view| ColmapView { pose: back.move_pose(&view.pose), ..view.clone() });
    let model = ColmapModel { lenses: cameras.lenses.clone(), views: views.collect() };
    let point = |i: usize| {
        let (column, row) = (120 + i * 37 % 400, 110 + i * 53 % 410);
        let (x, y) = dem.geotransform.map_from_cell(column as f64, row as f64);
        let position = back.apply([x, y, f64::from(dem.heights[(column, row)])]);
        ColmapPoint { position, color: [i as u8, 20, 30], error_px: 0.5, track: Vec::new() }
    };
    write(folder, &model, &(0..300).map(point).collect::<Vec<_>>());
    world
}

fn write(folder: &Path, model: &ColmapModel, points: &[ColmapPoint]) {
    std::fs::create_dir_all(folder).unwrap();
    formats::colmap::write(folder, model, points, ColmapEncoding::Binary, false).unwrap();
}

struct Client {
    host: String,
    token: String,
}

impl Client {
    fn asked(&self, method: &str, name: &str, body: &str) -> (u16, Vec<u8>) {
        let Self { host, token } = self;
        let mut stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let head = format!("{method} /{token}/job/{name} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json");
        stream.write_all(format!("{head}\r\nContent-Length: {}\r\n\r\n{body}", body.len()).as_bytes()).unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let status = String::from_utf8_lossy(&all[..end]).split(' ').nth(1).unwrap().parse().unwrap();
        (status, all.split_off(end + 4))
    }

    fn get(&self, name: &str) -> Value {
        serde_json::from_slice(&self.asked("GET", name, "").1).unwrap()
    }

    fn post(&self, name: &str, body: &Value) -> Value {
        let (status, answer) = self.asked("POST", name, &body.to_string());
        assert_eq!(status, 200, "{}", String::from_utf8_lossy(&answer));
        serde_json::from_slice(&answer).unwrap()
    }

    /// Words of a refusal.
    fn refused(&self, name: &str, body: &str) -> String {
        let (status, answer) = self.asked("POST", name, body);
        assert_eq!(status, 400, "{name} {body}");
        String::from_utf8(answer).unwrap()
    }
}

/// Serves a page while `work` asks; returns whether something was saved.
fn served(page: &AlignPage, work: impl FnOnce(&Client)) -> bool {
    let url = page.url();
    let (host, token) = url.strip_prefix("http://").unwrap().trim_end_matches('/').split_once('/').unwrap();
    let (client, flag) = (Client { host: host.to_owned(), token: token.to_owned() }, CancelFlag::new());
    std::thread::scope(|scope| {
        let progress = Cancellable { inner: &Silent, flag: &flag };
        let server = scope.spawn(move || page.serve(&progress).unwrap());
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(&client)));
        flag.cancel();
        let report = server.join().unwrap();
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        report.saved.is_some()
    })
}

fn config(folder: &Path) -> AlignPageConfig {
    AlignPageConfig::new(ManualAlignConfig::new(folder.join("model"), folder.join("out")), vec![map()])
}

fn numbers(value: &Value) -> [f64; 3] {
    serde_json::from_value(value.clone()).unwrap()
}

fn moved(parts: &Value, p: [f64; 3]) -> [f64; 3] {
    let rotation: [[f64; 3]; 3] = serde_json::from_value(parts["rotation"].clone()).unwrap();
    Similarity::new(parts["scale"].as_f64().unwrap(), rotation, numbers(&parts["translation"])).unwrap().apply(p)
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] + b[i])
}

#[test]
fn clicked_pairs_bring_the_model_back_and_are_saved() {
    let folder = tempfile::tempdir().unwrap();
    let world = planted(&folder.path().join("model"));
    let (_, points) = read_with_points(&folder.path().join("model")).unwrap();
    let page = AlignPage::open(&config(folder.path()), &Silent).unwrap();
    let was_saved = served(&page, |client| {
        let opening = client.get("opening.json");
        let (origin, pivot) = (numbers(&opening["origin"]), numbers(&opening["pivot"]));
        assert_eq!((opening["points"].as_u64(), opening["stride"].as_u64()), (Some(300), Some(1)));
        let (_, cloud) = client.asked("GET", "cloud.bin", "");
        assert_eq!((cloud.len(), &cloud[16 * 7 + 12..16 * 8]), (16 * 300, &[7u8, 20, 30, 0][..]));
        let first = [0, 4, 8].map(|at| f64::from(f32::from_le_bytes(cloud[at..at + 4].try_into().unwrap())));
        assert!(apart(plus(first, pivot), points[0].position) < 1e-4);
        // At the start, the middle of the points is over that of the map.
        let start = &opening["start"]["world_from_model"];
        let at = moved(start, pivot);
        assert!(at[0].hypot(at[1]) < 1.0 && opening["crs"] == "EPSG:32631", "{at:?}");
        let pair = |i: usize, off: [f64; 3]| {
            let place = plus(world.apply(points[i].position), off);
            let place = plus(place, origin.map(|c| -c));
            json!({ "model": points[i].position, "world": place })
        };
        let off = |parts: &Value, i: usize| {
            apart(plus(moved(parts, points[i].position), origin), world.apply(points[i].position))
        };
        // One pair moves, two level; the third and further ones determine everything.
        let wish = |pairs: Vec<Value>| json!({ "world_from_model": start, "pairs": pairs });
        let one = client.post("fit", &wish(vec![pair(3, [0.0; 3])]));
        assert!(off(&one["world_from_model"], 3) < 1e-6 && one["world_from_model"]["scale"] == start["scale"]);
        let two = client.post("fit", &wish(vec![pair(3, [0.0; 3]), pair(80, [0.0; 3])]));
        assert!(two["how"].as_str().unwrap().contains("two pairs"));
        let (before, after) = (numbers(&start["rotation"][2]), numbers(&two["world_from_model"]["rotation"][2]));
        assert!(apart(before, after) < 1e-9, "what was up stays up");
        let mut pairs: Vec<Value> = [3, 80, 150, 222, 290].iter().map(|&i| pair(i, [0.0; 3])).collect();
        pairs.push(pair(40, [30.0, -20.0, 5.0]));
        let all = client.post("fit", &wish(pairs.clone()));
        assert_eq!(all["inliers"], json!([true, true, true, true, true, false]), "a wrong click is left out");
        assert!((0..300).all(|i| off(&all["world_from_model"], i) < 1e-6));
        pairs.pop();
        let body = json!({ "world_from_model": all["world_from_model"], "pairs": pairs });
        assert!(client.post("save", &body)["rmse_m"].as_f64().unwrap() < 1e-6);
        let told = client.refused("save", &body.to_string());
        assert!(told.contains("exist") && told.contains("Nothing was written"), "{told}");
    });
    assert!(was_saved);
    // The outputs are those of the alignment by positions.
    let out = folder.path().join("out");
    let origin: LocalOrigin = serde_json::from_slice(&std::fs::read(out.join("origin.json")).unwrap()).unwrap();
    assert_eq!((origin.crs.as_str(), origin.vertical.as_str()), ("EPSG:32631", "ellipsoid"));
    let similarity = formats::similarity::read(out.join("similarity.json")).unwrap();
    let (_, after) = read_with_points(&out).unwrap();
    for (before, after) in points.iter().zip(&after) {
        assert!(apart(plus(after.position, origin.origin), world.apply(before.position)) < 1e-5);
        assert!(apart(after.position, similarity.apply(before.position)) < 1e-6);
    }
    // The table of the pairs gives the same alignment again, to its millimetres.
    let again = folder.path().join("again");
    let mut by_table = AlignJobConfig::new(folder.path().join("model"), out.join("pairs.csv"), again);
    by_table.crs_epsg = Some(32631);
    let report = jobs::align::run(&by_table, &Silent).unwrap();
    assert!((report.world_from_model.scale / similarity.scale() - 1.0).abs() < 1e-4 && report.rmse_m < 0.01);
}

#[test]
fn requests_that_mean_nothing_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    planted(&folder.path().join("model"));
    let page = AlignPage::open(&config(folder.path()), &Silent).unwrap();
    let was_saved = served(&page, |client| {
        let similarity =
            json!({ "scale": 1.0, "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, 0] });
        let wish = |change: &dyn Fn(&mut Value)| {
            let mut body = json!({ "world_from_model": similarity, "pairs": [] });
            change(&mut body);
            body.to_string()
        };
        for name in ["fit", "save"] {
            assert!(client.refused(name, "{").contains("not readable"));
            assert!(client.refused(name, &wish(&|body| body["more"] = json!(1))).contains("not readable"));
            assert!(
                client.refused(name, &wish(&|body| body["world_from_model"]["scale"] = json!(0))).contains("scale")
            );
            let mirror = |body: &mut Value| body["world_from_model"]["rotation"][0][0] = json!(-1);
            assert!(client.refused(name, &wish(&mirror)).contains("mirrors"));
        }
        assert!(client.refused("fit", &wish(&|_| {})).contains("0 positions"));
        let above = json!([{ "model": [0, 0, 0], "world": [1, 2, 3] }, { "model": [0, 0, 5], "world": [1, 2, 8] }]);
        assert!(client.refused("fit", &wish(&|body| body["pairs"] = above.clone())).contains("line"));
        let many = vec![json!({ "model": [0, 0, 0], "world": [0, 0, 0] }); 1001];
        assert!(client.refused("save", &wish(&|body| body["pairs"] = json!(many))).contains("at most 1000"));
        for name in
            ["photo/999.png", "photo/-1.png", "photo/+1.png", "photo/..%2f1.png", "photo/12345678.png", "other.json"]
        {
            assert_eq!(client.asked("GET", name, "").0, 404, "{name}");
        }
        // There are no photographs here.
        let (status, words) = client.asked("GET", "photo/0.png", "");
        assert!(status == 500 && !words.is_empty());
        assert_eq!(client.get("opening.json")["cameras"][0]["has_photograph"], json!(false));
    });
    assert!(!was_saved && !folder.path().join("out").exists(), "nothing was written");
}

#[test]
fn many_points_are_thinned_and_an_aligned_model_stays() {
    let folder = tempfile::tempdir().unwrap();
    let dem = formats::raster::read_dem(map()).unwrap();
    let (x, y) = dem.geotransform.map_from_cell(50.0, 50.0);
    let point = |i: u32| {
        let position = [x + f64::from(i % 7), y + f64::from(i % 5), 190.0];
        ColmapPoint { position, color: [1, 2, 3], error_px: 0.5, track: Vec::new() }
    };
    write(&folder.path().join("model"), &town_cameras(), &(0..250_001).map(point).collect::<Vec<_>>());
    let page = AlignPage::open(&config(folder.path()), &Silent).unwrap();
    served(&page, |client| {
        let opening = client.get("opening.json");
        assert_eq!((opening["points"].as_u64(), opening["stride"].as_u64()), (Some(250_001), Some(3)));
        assert_eq!(client.asked("GET", "cloud.bin", "").1.len(), 16 * 250_001_usize.div_ceil(3));
        // It lies on the map already.
        let at = plus(moved(&opening["start"]["world_from_model"], [x, y, 190.0]), numbers(&opening["origin"]));
        assert!(apart(at, [x, y, 190.0]) < 1e-6);
    });
}

#[test]
fn heights_above_a_geoid_are_saved_above_the_ellipsoid() {
    let folder = tempfile::tempdir().unwrap();
    planted(&folder.path().join("model"));
    let mut config = config(folder.path());
    config.align.vertical = Some(VerticalDatum::Egm96);
    let page = AlignPage::open(&config, &Silent).unwrap();
    served(&page, |client| {
        let opening = client.get("opening.json");
        let start = json!({ "world_from_model": opening["start"]["world_from_model"], "pairs": [] });
        let saved = client.post("save", &start);
        let (shift, own) = (saved["ellipsoid_shift_m"].as_f64().unwrap(), numbers(&saved["origin"]["origin"]));
        assert!(shift.abs() > 1.0 && (own[2] - numbers(&opening["origin"])[2] - shift).abs() < 1e-9, "{shift}");
        assert_eq!((&saved["map_vertical"], &saved["origin"]["vertical"]), (&json!("egm96"), &json!("ellipsoid")));
        assert_eq!(saved["rmse_m"], Value::Null);
    });
    assert!(!folder.path().join("out/pairs.csv").exists());
}

#[test]
fn what_cannot_be_aligned_or_saved_has_no_page() {
    let folder = tempfile::tempdir().unwrap();
    planted(&folder.path().join("model"));
    let refused = |config: &AlignPageConfig| AlignPage::open(config, &Silent).err().unwrap();
    let mut image = config(folder.path());
    image.view.inputs = vec![root().join("data-samples/town/view_1.tif")];
    assert!(refused(&image).to_string().starts_with("the map has no coordinate system"));
    let mut bare = config(folder.path());
    bare.align.model = folder.path().join("bare");
    write(&bare.align.model, &town_cameras(), &[]);
    assert!(refused(&bare).to_string().starts_with("the model has no points3D"));
    // An earlier result is in the way at once, and not after an hour of work.
    std::fs::create_dir_all(folder.path().join("out")).unwrap();
    std::fs::write(folder.path().join("out/align.json"), "{}").unwrap();
    assert!(refused(&config(folder.path())).to_string().contains("exist"));
    let mut again = config(folder.path());
    again.align.overwrite = true;
    assert!(AlignPage::open(&again, &Silent).is_ok());
}
