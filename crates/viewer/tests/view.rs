//! The viewer's server over its own socket: what it refuses, and that tiles, grids, positions and
//! profiles have the values of the raster.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use formats::raster::{ImageSource, read_dem};
use numeric::{CancelFlag, Cancellable, Failure, Kind, Silent};
use raster::{Grid, Window};
use serde_json::Value;
use viewer::{ViewConfig, ViewServer};

fn truth() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/truth")
}

/// A served viewer, as a browser sees it.
struct Client {
    host: String,
    token: String,
}

struct Response {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Client {
    fn of(viewer: &ViewServer) -> Self {
        let url = viewer.url();
        let (host, token) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
        Self { host: host.to_owned(), token: token.trim_end_matches('/').to_owned() }
    }

    /// Sends bytes as they are and reads the response.
    fn raw(&self, bytes: &[u8]) -> Response {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        // A server that refuses may close before everything is sent.
        let _ = stream.write_all(bytes);
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8(all[..end].to_vec()).unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Response { status, head, body: all.split_off(end + 4) }
    }

    fn request(&self, method: &str, target: &str, host: &str) -> Response {
        self.raw(format!("{method} {target} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes())
    }

    /// Gets a path behind the token.
    fn get(&self, path: &str) -> Response {
        self.request("GET", &format!("/{}/{path}", self.token), &self.host)
    }

    fn json(&self, path: &str) -> Value {
        let found = self.get(path);
        assert_eq!(found.status, 200, "{path}: {}", String::from_utf8_lossy(&found.body));
        serde_json::from_slice(&found.body).unwrap()
    }
}

/// Serves some inputs while `work` asks.
fn served<T>(inputs: &[PathBuf], work: impl FnOnce(&Client) -> T) -> T {
    let viewer = ViewServer::open(&ViewConfig::new(inputs.to_vec()), &Silent).unwrap();
    let (client, flag) = (Client::of(&viewer), CancelFlag::new());
    std::thread::scope(|scope| {
        let progress = Cancellable { inner: &Silent, flag: &flag };
        let server = scope.spawn(move || viewer.serve(&progress).unwrap());
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(&client)));
        flag.cancel();
        server.join().unwrap();
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn layer(scene: &Value, title: &str) -> (usize, usize) {
    let layers = scene["layers"].as_array().unwrap();
    let index = layers.iter().position(|layer| layer["title"] == title).unwrap_or_else(|| panic!("no {title}"));
    (index, layers[index]["raster"].as_u64().unwrap() as usize)
}

#[test]
fn only_the_page_of_this_computer_is_answered() {
    served(&[truth().join("dsm.tif")], |client| {
        let page = client.get("");
        assert_eq!(page.status, 200);
        assert!(page.head.contains("default-src 'none'") && page.head.contains("no-store"), "{}", page.head);
        let text = String::from_utf8(page.body).unwrap();
        assert!(!text.contains("http://") && !text.contains("https://") && !text.contains("<script>"));
        let head = client.request("HEAD", &format!("/{}/", client.token), &client.host);
        assert!(head.status == 200 && head.body.is_empty() && head.head.contains(&text.len().to_string()));
        let port = client.host.rsplit(':').next().unwrap();
        let local = client.request("GET", &format!("/{}/scene.json", client.token), &format!("localhost:{port}"));
        assert_eq!(local.status, 200);

        // The token.
        assert_eq!(client.token.len(), 32);
        let wrong = "0".repeat(32);
        let upper = client.token.to_uppercase();
        let shorter = &client.token[1..];
        for target in
            ["/", "/scene.json", "", &format!("/{wrong}/"), &format!("/{shorter}/"), &format!("//{}/", client.token)]
        {
            let target = if target.is_empty() { "*" } else { target };
            assert_eq!(client.request("GET", target, &client.host).status, 404, "{target}");
        }
        if upper != client.token {
            assert_eq!(client.request("GET", &format!("/{upper}/"), &client.host).status, 404);
        }
        // The host.
        let page = format!("/{}/", client.token);
        for host in ["evil.example", &format!("evil.example:{port}"), "127.0.0.1", "127.0.0.1:1", "", "[::1]"] {
            let found = client.request("GET", &page, host);
            assert_eq!(found.status, 403, "{host}");
            assert!(!String::from_utf8_lossy(&found.body).contains(&client.token));
        }
        assert_eq!(client.raw(format!("GET {page} HTTP/1.0\r\n\r\n").as_bytes()).status, 403);
        let twice = format!("GET {page} HTTP/1.1\r\nHost: {0}\r\nHost: {0}\r\n\r\n", client.host);
        assert_eq!(client.raw(twice.as_bytes()).status, 403);
        // The method.
        for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PATCH"] {
            let found = client.request(method, &page, &client.host);
            assert!(found.status == 405 && found.head.contains("Allow: GET, HEAD"), "{method}: {}", found.head);
        }
    });
}

#[test]
fn hostile_requests_are_refused_within_bounds() {
    served(&[truth().join("dsm.tif")], |client| {
        let not_found = [
            "../Cargo.toml",
            "..%2f..%2fetc%2fpasswd",
            "/etc/passwd",
            "page/main.js",
            "./main.js",
            "tile/99/0/0/0.png",
            "tile/0/99/0/0.png",
            "tile/0/0/2147483647/0.png",
            "tile/0/0/99999999999999999999/0.png",
            "tile/0/-1/0/0.png",
            "tile/0/0/0/0",
            "tile/0/0/0/0.png/",
            "tile/a/b/c/d.png",
            "tile/0/63/9223372036854775807/9223372036854775807.png",
            "grid/18446744073709551615?c=0&r=0&w=1&h=1&side=1",
            "picture/..%00.png?c=0&r=0&w=1&h=1&side=1",
        ];
        for path in not_found {
            assert_eq!(client.get(path).status, 404, "{path}");
        }
        let malformed = [
            "grid/0",
            "grid/0?c=0&r=0&w=0&h=0&side=10",
            "grid/0?c=0&r=0&w=9&h=9&side=0",
            "grid/0?c=0&r=0&w=9&h=9&side=1025",
            "grid/0?c=2147483647&r=2147483647&w=2147483647&h=2147483647&side=9",
            "grid/0?c=-1&r=0&w=9&h=9&side=9",
            "grid/0?c=1e3&r=0&w=9&h=9&side=9",
            "at?x=NaN&y=0",
            "at?x=1e999&y=0",
            "at?y=0",
            "profile?rasters=&x1=0&y1=0&x2=1&y2=1",
            "profile?rasters=0,0,0,0,0,0,0,0,0&x1=0&y1=0&x2=1&y2=1",
            "profile?rasters=0&x1=0&y1=0&x2=inf&y2=1",
        ];
        for path in malformed {
            assert_eq!(client.get(path).status, 400, "{path}");
        }
        // Far away there is nothing, in bounded time and size.
        let far = client.json("at?x=1e300&y=-1e300");
        assert_eq!(far["values"], serde_json::json!([[null]]));
        for ends in ["x1=-1e308&y1=-1e308&x2=1e308&y2=1e308", "x1=0&y1=0&x2=1e15&y2=1e15", "x1=1&y1=1&x2=1&y2=1"] {
            let found = client.json(&format!("profile?rasters=0&{ends}"));
            assert!(found["values"][0].as_array().unwrap().len() <= 4000, "{ends}");
        }
        // Heads that are too long, do not end, or are no HTTP.
        let path = format!("GET /{}/{} HTTP/1.1\r\nHost: {}\r\n\r\n", client.token, "a".repeat(1 << 20), client.host);
        assert_eq!(client.raw(path.as_bytes()).status, 431);
        let fields = format!("GET / HTTP/1.1\r\n{}\r\n", "x: y\r\n".repeat(3000));
        assert_eq!(client.raw(fields.as_bytes()).status, 431);
        assert_eq!(client.raw(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 tls").status, 400);
        // Clients that send one byte, or nothing, do not keep others from being answered.
        let slow: Vec<TcpStream> = (0..60)
            .map(|i| {
                let mut stream = TcpStream::connect(&client.host).unwrap();
                if i < 40 {
                    stream.write_all(b"G").unwrap();
                }
                stream
            })
            .collect();
        let start = Instant::now();
        assert_eq!(client.get("scene.json").status, 200);
        assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
        // They lose their connections.
        let mut first = &slow[0];
        first.set_read_timeout(Some(Duration::from_secs(15))).unwrap();
        assert!(first.read_to_end(&mut Vec::new()).is_ok() && start.elapsed() < Duration::from_secs(10));
    });
}

#[test]
fn tiles_and_grids_have_the_values_of_the_raster() {
    served(&[truth()], |client| {
        let scene = client.json("scene.json");
        let classes = ImageSource::open(truth().join("classes.tif")).unwrap();
        let (index, raster) = layer(&scene, "Classes");
        assert_eq!(scene["rasters"][raster]["file"], "classes.tif");
        let legend: Vec<(i64, [u8; 3])> = scene["layers"][index]["legend"]["classes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|class| (class["code"].as_i64().unwrap(), serde_json::from_value(class["colour"].clone()).unwrap()))
            .collect();
        let (width, height) = (classes.info().width, classes.info().height);
        let tile = client.get(&format!("tile/{index}/0/1/1.png"));
        let picture = image::load_from_memory(&tile.body).unwrap().to_rgba8();
        let (columns, rows) = ((width - 256).min(256), (height - 256).min(256));
        assert_eq!((picture.width() as usize, picture.height() as usize), (columns, rows));
        let values = classes.read_samples(1, Window { x: 256, y: 256, width: columns, height: rows }).unwrap();
        for (column, row, pixel) in picture.enumerate_pixels() {
            let value = values[(column as usize, row as usize)];
            let colour = legend.iter().find(|(code, _)| *code as f32 == value).map(|(_, colour)| *colour);
            let found = (pixel.0[3] == 255).then_some([pixel.0[0], pixel.0[1], pixel.0[2]]);
            assert_eq!(found, colour, "at {column}, {row}");
        }

        let dsm = read_dem(truth().join("dsm.tif")).unwrap().heights;
        let (_, raster) = layer(&scene, "Heights");
        let grid = client.get(&format!("grid/{raster}?c=30&r=40&w=200&h=100&side=200")).body;
        let numbers: Vec<f32> = grid[8..].chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        let grid = Grid::from_vec(200, 100, numbers).unwrap();
        assert_eq!(grid, dsm.window(Window { x: 30, y: 40, width: 200, height: 100 }, f32::NAN));
        let small = client.get(&format!("grid/{raster}?c=0&r=0&w=100000&h=100000&side=50")).body;
        let sides: Vec<u32> = small[..8].chunks(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect();
        assert!(sides.iter().max() == Some(&50) && small.len() == 8 + 4 * (sides[0] * sides[1]) as usize);
        let found = client.get(&format!("picture/{}.png?c=0&r=0&w=400&h=400&side=100", layer(&scene, "Hillshade").0));
        assert_eq!(image::load_from_memory(&found.body).unwrap().width(), 100);
    });
}

#[test]
fn neighbouring_tiles_of_a_hillshade_fit_together() {
    served(&[truth().join("dsm.tif")], |client| {
        let scene = client.json("scene.json");
        let (shade, _) = layer(&scene, "Hillshade");
        let picture = |path: &str| image::load_from_memory(&client.get(path).body).unwrap().to_rgba8();
        let whole = picture(&format!("picture/{shade}.png?c=0&r=0&w=512&h=300&side=512"));
        let (left, right) = (picture(&format!("tile/{shade}/0/0/0.png")), picture(&format!("tile/{shade}/0/1/0.png")));
        for row in 0..256 {
            for (tile, column) in [(&left, 255), (&right, 0), (&left, 7)] {
                let start = if std::ptr::eq(tile, &right) { 256 } else { 0 };
                assert_eq!(tile.get_pixel(column, row), whole.get_pixel(start + column, row), "{column}, {row}");
            }
        }
    });
}

#[test]
fn positions_and_profiles_are_cells_of_the_raster() {
    served(&[truth()], |client| {
        let scene = client.json("scene.json");
        let dem = read_dem(truth().join("dsm.tif")).unwrap();
        let dtm = read_dem(truth().join("dtm.tif")).unwrap();
        let ((_, top), (_, ground)) = (layer(&scene, "Heights"), layer(&scene, "Terrain"));
        let place = |column: f64, row: f64| dem.geotransform.map_from_cell(column, row);
        let (x, y) = place(123.3, 45.6);
        let found = client.json(&format!("at?x={x}&y={y}"));
        assert_eq!(found["values"][top][0].as_f64().unwrap() as f32, dem.heights[(123, 46)]);
        let ((x1, y1), (x2, y2)) = (place(-20.0, 80.2), place(333.3, 222.2));
        let found = client.json(&format!("profile?rasters={top},{ground}&x1={x1}&y1={y1}&x2={x2}&y2={y2}"));
        let numbers = |name: &str| -> Vec<f64> { serde_json::from_value(found[name].clone()).unwrap() };
        let (xs, ys, along) = (numbers("x"), numbers("y"), numbers("distance"));
        let length = (x2 - x1).hypot(y2 - y1);
        assert!((along.last().unwrap() - length).abs() < 1e-6 && along.len() > 380 && xs.len() == along.len());
        let mut outside = 0;
        for (i, (x, y)) in xs.iter().zip(&ys).enumerate() {
            let (column, row) = dem.geotransform.cell_from_map(*x, *y).unwrap();
            let (column, row) = ((column + 0.5).floor(), (row + 0.5).floor());
            for (series, heights) in [&dem.heights, &dtm.heights].into_iter().enumerate() {
                let value = found["values"][series][i].as_f64().map(|value| value as f32);
                let inside = (column >= 0.0).then(|| heights[(column as usize, row as usize)]);
                assert_eq!(value, inside.filter(|value| value.is_finite()), "sample {i}");
            }
            outside += usize::from(column < 0.0);
        }
        assert!(outside > 10, "the line begins outside");
    });
}

#[test]
fn one_map_has_one_coordinate_system() {
    let image = truth().join("../view_1.tif");
    served(&[truth().join("dsm.tif"), image.clone()], |client| {
        let scene = client.json("scene.json");
        assert_eq!(scene["rasters"].as_array().unwrap().len(), 1, "an image without a georeference is left out");
        assert_eq!((scene["map"]["unit"].as_str(), scene["map"]["metres"][0].as_f64()), (Some("m"), Some(1.0)));
        assert!(scene["map"]["name"].as_str().unwrap().contains("EPSG:"), "{}", scene["map"]);
    });
    served(std::slice::from_ref(&image), |client| {
        let scene = client.json("scene.json");
        assert_eq!(
            (scene["map"]["unit"].as_str(), scene["layers"][0]["is_height"].as_bool()),
            (Some("px"), Some(false))
        );
        let source = ImageSource::open(&image).unwrap();
        let value = source.read_samples(1, Window { x: 17, y: 29, width: 1, height: 1 }).unwrap()[(0, 0)];
        let found = client.json("at?x=17.9&y=29.1");
        assert_eq!(found["values"][0][0].as_f64().unwrap() as f32, value);
        assert_eq!(client.get("tile/0/0/0/0.png").status, 200);
    });
}

/// A raster in another zone is laid into the map, and vectors too; classes have their names.
#[test]
fn other_systems_and_vectors_are_laid_into_the_map() {
    let folder = tempfile::tempdir().unwrap();
    let surface = read_dem(truth().join("dsm.tif")).unwrap();
    let map = crs::MapProjection::from_epsg(surface.horizontal_epsg.unwrap()).unwrap();
    let (x, y) = surface.geotransform.map_from_cell(100.0, 120.0);
    let (lon, lat) = map.lonlat_from_map(x, y).unwrap();
    // The same heights in degrees, a cell of which is about a metre.
    let step = 1e-5;
    let cells = Grid::from_vec(64, 64, (0..4096).map(|i| (i % 64) as f32).collect()).unwrap();
    let transform = raster::GeoTransform([lon - 32.0 * step, step, 0.0, lat + 32.0 * step, 0.0, -step]);
    let other = folder.path().join("degrees.tif");
    let bands = [formats::raster::Band { description: "height_m", data: formats::raster::BandData::F32(&cells) }];
    let placed = formats::raster::CogRaster::new(&bands, transform, crs::Crs::ellipsoidal(4326));
    formats::raster::write_cog(&other, &placed, false).unwrap();
    let classes = folder.path().join("classes.tif");
    let codes = cells.map(|value| if *value < 32.0 { 2u8 } else { 6 });
    let description = "class_2_ground_3_low_vegetation_5_vegetation_6_building_9_water";
    let bands = [formats::raster::Band { description, data: formats::raster::BandData::U8(&codes) }];
    let placed = formats::raster::CogRaster::new(&bands, transform, crs::Crs::ellipsoidal(4326));
    formats::raster::write_cog(&classes, &placed, false).unwrap();
    let lines = folder.path().join("changes.geojson");
    let feature = format!(
        r#"{{"type":"Feature","properties":{{"mean_m":-2.5,"area_m2":81}},"geometry":{{"type":"Polygon",
        "coordinates":[[[{lon},{lat}],[{0},{lat}],[{lon},{1}],[{lon},{lat}]]]}}}}"#,
        lon + 1e-4,
        lat + 1e-4
    );
    std::fs::write(&lines, format!(r#"{{"type":"FeatureCollection","features":[{feature}]}}"#)).unwrap();
    served(&[truth().join("dsm.tif"), other, classes, lines.clone()], |client| {
        let scene = client.json("scene.json");
        assert_eq!(scene["rasters"].as_array().unwrap().len(), 3, "{scene}");
        let found = client.json(&format!("at?x={x}&y={y}"));
        // The position is a cell corner in the middle: either neighbour is right.
        let value = found["values"][1][0].as_f64().unwrap();
        assert!((31.0..=33.0).contains(&value), "{found}");
        let layers = scene["layers"].as_array().unwrap();
        let legend = &layers.iter().find(|layer| layer["raster"] == 2).unwrap()["legend"]["classes"];
        assert!(legend.as_array().unwrap().iter().any(|class| class["code"] == 6 && class["label"] == "building"));
        assert_eq!((&scene["vectors"][0]["look"], &scene["vectors"][0]["count"]), (&"change".into(), &1.into()));
        let features = client.json("vectors/0.json");
        let corner: Vec<f64> = (0..2).map(|i| features["features"][0]["parts"][0][i].as_f64().unwrap()).collect();
        assert!((corner[0] - x).hypot(corner[1] - y) < 0.01, "{features}");
        assert_eq!(features["features"][0]["properties"]["mean_m"], -2.5);
        assert!(client.get("tile/0/0/0/0.png").status == 200 && client.get("vectors/1.json").status == 404);
        assert_eq!(client.get("vectors/..%2f0.json").status, 404);
    });
    // Vectors that are named and have no place are an error.
    std::fs::write(&lines, "{}").unwrap();
    let config = ViewConfig::new(vec![truth().join("dsm.tif"), lines]);
    let refused = ViewServer::open(&config, &Silent).err().unwrap();
    assert!(refused.to_string().starts_with("cannot read the area"), "{refused}");
}

#[test]
fn a_viewer_ends_after_its_time_and_bad_inputs_are_refused() {
    let mut config = ViewConfig::new(vec![truth().join("dsm.tif")]);
    config.seconds = Some(0.05);
    let viewer = ViewServer::open(&config, &Silent).unwrap();
    let taken: u16 = Client::of(&viewer).host.rsplit(':').next().unwrap().parse().unwrap();
    let mut other = config.clone();
    other.port = Some(taken);
    let refused = ViewServer::open(&other, &Silent).err().unwrap();
    assert!(refused.setting() == Some("the port") && refused.to_string().contains(&taken.to_string()), "{refused}");
    let report = viewer.serve(&Silent).unwrap();
    assert!(report.seconds < 5.0 && report.answered == 0 && report.layers[0] == "Heights", "{report:?}");

    for seconds in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        config.seconds = Some(seconds);
        let refused = ViewServer::open(&config, &Silent).err().unwrap();
        assert!(refused.kind() == Kind::Input && refused.setting().is_some(), "{seconds}: {refused}");
    }
    let empty = tempfile::tempdir().unwrap();
    let open = |inputs: Vec<PathBuf>| ViewServer::open(&ViewConfig::new(inputs), &Silent).map(|_| ());
    let refused = |inputs: Vec<PathBuf>, text: &str| {
        let error = open(inputs).unwrap_err();
        assert!(error.to_string().starts_with(text), "{error}");
        error.kind()
    };
    refused(vec![empty.path().to_owned()], "found no GeoTIFF to show");
    assert_eq!(refused(vec![empty.path().join("nothing.tif")], "cannot read the file"), Kind::File);
    assert_eq!(refused(Vec::new(), ""), Kind::Input);
    // One picture of a large raster must not take minutes.
    let large = empty.path().join("large.tif");
    std::fs::write(&large, bare_tiff(60_000, 256)).unwrap();
    refused(vec![large.clone()], "the raster of 60000 × 60000 cells has no overviews that fit");
    std::fs::write(&large, bare_tiff(9_000, 256)).unwrap();
    open(vec![large.clone()]).unwrap();
    std::fs::remove_file(large).unwrap();
    // A raster of a folder that cannot be read is left out.
    let run = tempfile::tempdir().unwrap();
    std::fs::write(run.path().join("a.tif"), b"no raster").unwrap();
    refused(vec![run.path().to_owned()], "found no GeoTIFF to show");
    std::fs::copy(truth().join("dsm.tif"), run.path().join("b.tif")).unwrap();
    open(vec![run.path().to_owned()]).unwrap();
}

/// A tiled TIFF of one band of bytes, all 0: no tile is stored, and there are no overviews.
fn bare_tiff(side: u32, tile: u32) -> Vec<u8> {
    let tiles = side.div_ceil(tile).pow(2);
    let after = 8 + 2 + 10 * 12 + 4;
    let tags: [(u16, u16, u32, u32); 10] = [
        (256, 4, 1, side),
        (257, 4, 1, side),
        (258, 3, 1, 8),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (277, 3, 1, 1),
        (322, 4, 1, tile),
        (323, 4, 1, tile),
        (324, 4, tiles, after),
        (325, 4, tiles, after + 4 * tiles),
    ];
    let mut bytes = b"II*\0\x08\0\0\0\x0a\0".to_vec();
    for (tag, kind, count, value) in tags {
        bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        bytes.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    bytes.resize(after as usize + 8 * tiles as usize, 0);
    bytes
}
