//! The page of splats and meshes over the viewer's own socket: what is found in folders, the bytes
//! of splats, cameras that were held out, and what is too much.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};

use formats::colmap::{ColmapEncoding, ColmapModel, ColmapView};
use formats::splat_ply::{LabelTable, LabelledObject, LocalOrigin, SplatFile, SplatForm, SplatLabels, SplatLayout};
use gaussian::{Splat, SplatHarmonics, SplatLabel};
use numeric::{CancelFlag, Cancellable, Failure, Kind, Silent};
use serde_json::Value;
use viewer::{ViewConfig, ViewServer};

/// Gets paths behind the token while a viewer is served.
fn served<T>(inputs: &[PathBuf], work: impl FnOnce(&dyn Fn(&str) -> (u16, Vec<u8>)) -> T) -> T {
    let viewer = ViewServer::open(&ViewConfig::new(inputs.to_vec()), &Silent).unwrap();
    let url = viewer.url();
    let (host, token) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let token = token.trim_end_matches('/');
    let get = |path: &str| {
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET /{token}{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let status = String::from_utf8_lossy(&all[..end]).split(' ').nth(1).unwrap().parse().unwrap();
        (status, all.split_off(end + 4))
    };
    answering(&viewer, || work(&get))
}

/// Serves a viewer while `work` is done.
fn answering<T>(viewer: &ViewServer, work: impl FnOnce() -> T) -> T {
    let flag = CancelFlag::new();
    let progress = Cancellable { inner: &Silent, flag: &flag };
    std::thread::scope(|scope| {
        let server = scope.spawn(|| viewer.serve(&progress).unwrap());
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        flag.cancel();
        server.join().unwrap();
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn splats(origin: Option<LocalOrigin>) -> SplatFile {
    let splat = Splat {
        position: [1.0, -2.0, 30.5],
        scale_m: [0.5, 0.25, 2.5e-4],
        rotation: [0.5, -0.5, 0.5, 0.5],
        colour: [0.25, 0.5, 1.5],
        opacity: 0.75,
    };
    let splats = vec![splat; 3];
    let harmonics = SplatHarmonics::new(1, (0..27).map(|i| i as f32 / 8.0).collect());
    SplatFile { splats, harmonics, labels: None, layout: SplatLayout { form: SplatForm::Discs, sh_degree: 1 }, origin }
}

fn origin(x: f64) -> LocalOrigin {
    LocalOrigin::new("EPSG:32631", "ellipsoid", [x, 4_820_000.0, 100.0])
}

/// A training with one held-out view, its dataset, and a mesh.
fn folders(folder: &Path) -> [PathBuf; 2] {
    let [training, dataset] = ["training", "dataset"].map(|name| folder.join(name));
    fs::create_dir_all(&training).unwrap();
    formats::splat_files::write(&training.join("splats.ply"), &splats(Some(origin(690_000.0))), false).unwrap();
    fs::write(training.join("mesh.glb"), b"glTF and more").unwrap();
    fs::write(training.join("points.ply"), b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n").unwrap();
    fs::write(training.join("report.json"), r#"{"views": [{"name": "b.png", "held_out": true}]}"#).unwrap();
    let lens = camera::Lens::new(60, 40, camera::LensModel::Pinhole, &[50.0, 51.0, 29.5, 19.5]).unwrap();
    let pose =
        camera::Pose { rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]], centre: [5.0, 6.0, 7.0] };
    let view = |id, name: &str| ColmapView { id, name: name.to_owned(), lens: 0, pose };
    let model = ColmapModel { lenses: vec![lens], views: vec![view(1, "b.png"), view(2, "a.png")] };
    let sparse = dataset.join("sparse/0");
    fs::create_dir_all(&sparse).unwrap();
    formats::colmap::write(&sparse, &model, &[], ColmapEncoding::Text, false).unwrap();
    fs::write(sparse.join("origin.json"), serde_json::to_string(&origin(690_010.0)).unwrap()).unwrap();
    [training, dataset]
}

#[test]
fn a_training_is_shown_with_its_cameras() {
    let folder = tempfile::tempdir().unwrap();
    served(&folders(folder.path()), |get| {
        let page = String::from_utf8(get("/").1).unwrap();
        assert!(page.contains("space/main.js") && !page.contains("http://") && !page.contains("<script>"));
        for name in ["main", "camera", "splats", "sort", "mesh"] {
            assert_eq!(get(&format!("/space/{name}.js")).0, 200, "{name}");
        }
        let scene: Value = serde_json::from_slice(&get("/space.json").1).unwrap();
        assert_eq!(scene["crs"], "EPSG:32631");
        assert_eq!((&scene["has_map"], scene["splats"].as_array().unwrap().len()), (&Value::Bool(false), 1));
        let layer = &scene["splats"][0];
        assert_eq!(
            (layer["count"].as_u64(), layer["degree"].as_u64(), layer["discs"].as_bool()),
            (Some(3), Some(1), Some(true))
        );
        assert_eq!(scene["meshes"][0]["name"], "mesh.glb");
        let cameras = scene["cameras"].as_array().unwrap();
        assert_eq!(cameras.len(), 2);
        assert_eq!((&cameras[0]["name"], &cameras[0]["held_out"]), (&"a.png".into(), &false.into()));
        assert_eq!(cameras[1]["held_out"], true);
        // Counted from the origin of the splats.
        assert_eq!(cameras[1]["centre"][0], 15.0);

        let (status, words) = get("/splats/0.bin");
        assert_eq!((status, words.len()), (200, 3 * 32));
        let float = |at: usize| f32::from_le_bytes(words[at..at + 4].try_into().unwrap());
        assert_eq!([float(0), float(4), float(8)], [1.0, -2.0, 30.5]);
        let half = |at: usize| u16::from_le_bytes([words[at], words[at + 1]]);
        // 0.25, 0.5, 1.5, 0.75 as halves; the largest component of the rotation is the first.
        assert_eq!([half(12), half(14), half(16), half(18)], [0x3400, 0x3800, 0x3e00, 0x3a00]);
        // Nine halves in two texels: 0, 3 / 8, 6 / 8 are the first coefficients of the channels.
        let (status, harmonics) = get("/harmonics/0.bin");
        assert_eq!((status, harmonics.len()), (200, 3 * 32));
        assert_eq!(harmonics[..6], [0, 0, 0x00, 0x36, 0x00, 0x3a]);
        assert_eq!(get("/meshes/0.glb").1, b"glTF and more");
        for path in
            ["/splats/1.bin", "/splats/0", "/harmonics/9.bin", "/meshes/1.glb", "/meshes/..%2f.glb", "/splats/-1.bin"]
        {
            assert_eq!(get(path).0, 404, "{path}");
        }
    });
}

/// Objects and classes of splats come with the table of the objects; others have none.
#[test]
fn labels_come_with_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let [labelled, bare] = ["a.ply", "b.ply"].map(|name| folder.path().join(name));
    let [roof, wall] = [(2, 300), (3, 7)].map(|(class, object)| SplatLabel { class, object });
    let attributes = [("storeys".to_owned(), 3.into())].into_iter().collect();
    let [id, kind, building] = ["part", "BuildingPart", "house"].map(str::to_owned);
    let objects = vec![LabelledObject { number: 300, id, kind, building, attributes }];
    let table = LabelTable { classes: [(2, "RoofSurface".to_owned())].into(), objects, ..LabelTable::default() };
    let labels = Some(SplatLabels { of: vec![roof, wall, SplatLabel::NONE], table });
    formats::splat_files::write(&labelled, &SplatFile { labels, ..splats(None) }, false).unwrap();
    formats::splat_files::write(&bare, &splats(None), false).unwrap();
    served(&[labelled, bare], |get| {
        let scene: Value = serde_json::from_slice(&get("/space.json").1).unwrap();
        let is_labelled = |i: usize| scene["splats"][i]["labelled"].as_bool();
        assert_eq!((is_labelled(0), is_labelled(1)), (Some(true), Some(false)));
        let (status, numbers) = get("/labels/0.bin");
        assert_eq!((status, &numbers[..]), (200, &[44, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 2, 3, 255][..]));
        let table: Value = serde_json::from_slice(&get("/objects/0.json").1).unwrap();
        assert_eq!((&table["classes"]["2"], &table["missing_object"]), (&"RoofSurface".into(), &0.into()));
        let object = &table["objects"][0];
        assert_eq!((&object["id"], &object["attributes"]["storeys"]), (&"part".into(), &3.into()));
        assert_eq!(get("/space/objects.js").0, 200);
        for path in ["/labels/1.bin", "/objects/1.json", "/objects/0.bin", "/labels/2.bin"] {
            assert_eq!(get(path).0, 404, "{path}");
        }
    });
}

#[test]
fn splats_lie_beside_a_map_and_files_of_other_maps_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second, foreign] = ["a.spz", "b.ply", "c.ply"].map(|name| folder.path().join(name));
    formats::splat_files::write(&first, &splats(Some(origin(690_000.0))), false).unwrap();
    formats::splat_files::write(&second, &splats(Some(origin(690_100.0))), false).unwrap();
    let elsewhere = LocalOrigin::new("EPSG:32632", "ellipsoid", [0.0; 3]);
    formats::splat_files::write(&foreign, &splats(Some(elsewhere)), false).unwrap();
    let dsm = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/truth/dsm.tif");
    served(&[dsm, first, second, foreign], |get| {
        assert!(String::from_utf8(get("/").1).unwrap().contains("to-space"));
        let map: Value = serde_json::from_slice(&get("/scene.json").1).unwrap();
        assert_eq!((&map["has_space"], map["rasters"].as_array().unwrap().len()), (&true.into(), 1));
        let scene: Value = serde_json::from_slice(&get("/space.json").1).unwrap();
        assert_eq!((&scene["has_map"], scene["splats"].as_array().unwrap().len()), (&true.into(), 2));
        assert_eq!(scene["splats"][1]["shift"][0], 100.0);
        assert_eq!(get("/space.html").0, 200);
    });
}

#[test]
fn damaged_and_missing_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("splats.ply");
    fs::write(
        &damaged,
        b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float opacity\nend_header\n",
    )
    .unwrap();
    let open = |path: PathBuf| ViewServer::open(&ViewConfig::new(vec![path]), &Silent);
    assert_eq!(open(damaged).err().unwrap().kind(), Kind::File);
    // The damaged file of a folder is left out, and nothing else is there.
    let error = open(folder.path().to_owned()).err().unwrap().to_string();
    assert!(error.starts_with("found no GeoTIFF to show"), "{error}");
    assert!(open(folder.path().join("none.glb")).is_err());
    let large = folder.path().join("large.glb");
    fs::File::create(&large).unwrap().set_len((512 << 20) + 1).unwrap();
    let error = open(large).err().unwrap().to_string();
    assert!(error.contains("536870913 bytes of a mesh") && error.contains("536870912"), "{error}");
}

/// A Chromium on this machine: the one that the variable CHROMIUM names, else a usual name on the
/// path.
fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let usual = std::env::split_paths(&folders).flat_map(|folder| names.map(|name| folder.join(name)));
    named.into_iter().chain(usual).find(|path| path.is_file())
}

#[test]
fn a_browser_opens_splats_without_complaint() {
    let Some(browser) = chromium() else {
        testing::skip("Chromium is not installed (the variable CHROMIUM may name one)");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("splats.spz");
    formats::splat_files::write(&path, &splats(Some(origin(690_000.0))), false).unwrap();
    let viewer = ViewServer::open(&ViewConfig::new(vec![path]), &Silent).unwrap();
    let shown = answering(&viewer, || {
        let mut command = std::process::Command::new(browser);
        command.args(["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader"]);
        command.args([
            "--enable-logging=stderr",
            "--v=0",
            "--timeout=60000",
            "--virtual-time-budget=8000",
            "--dump-dom",
        ]);
        command.arg(format!("--user-data-dir={}", folder.path().join("profile").display())).arg(viewer.url());
        command.output().unwrap()
    });
    let (page, log) = (String::from_utf8_lossy(&shown.stdout), String::from_utf8_lossy(&shown.stderr));
    // Drivers of WebGL tell of their speed in the same log.
    let complaints: Vec<&str> =
        log.lines().filter(|line| line.contains("CONSOLE") && !line.contains("GL Driver Message")).collect();
    assert_eq!(complaints, [""; 0]);
    // The time that the browser feigns does not wait for the worker that sorts.
    assert!(page.contains("data-ready=\"true\"") && page.contains("data-drawn="), "{page}");
    assert!(page.contains("3 splats") && page.contains("EPSG:32631"), "{page}");
}
