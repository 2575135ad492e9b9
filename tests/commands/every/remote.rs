//! Addresses as inputs: refused unless the user allows them, and then only those that the user
//! named.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::common::{sample, skysweep};
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, write_cog};
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use raster::{GeoTransform, Grid};

/// Serves files by name, whole or in parts, and notes which were asked for.
fn server(files: Vec<(&'static str, Vec<u8>)>) -> (u16, Arc<Mutex<Vec<String>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let asked = Arc::new(Mutex::new(Vec::new()));
    let noted = Arc::clone(&asked);
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // A client that goes away is no fault of the server.
            let _ = answer(stream, &files, &noted);
        }
    });
    (port, asked)
}

fn answer(mut stream: TcpStream, files: &[(&str, Vec<u8>)], noted: &Mutex<Vec<String>>) -> std::io::Result<()> {
    let mut lines = BufReader::new(stream.try_clone()?).lines();
    let first = lines.next().unwrap_or(Ok(String::new()))?;
    let mut words = first.split(' ');
    let (method, name) = (words.next().unwrap_or_default(), words.next().unwrap_or_default().to_owned());
    let mut range = None;
    for line in lines {
        let line = line?.to_ascii_lowercase();
        if let Some((from, to)) = line.strip_prefix("range: bytes=").and_then(|range| range.split_once('-')) {
            range = from.parse::<usize>().ok().zip(to.parse::<usize>().ok());
        }
        if line.is_empty() {
            break;
        }
    }
    noted.lock().unwrap().push(name.clone());
    // What begins with `late` is moved when more than its first byte is asked for.
    let is_first = range == Some((0, 0));
    if let Some(to) = name.strip_prefix("/to?").or_else(|| name.strip_prefix("/late?").filter(|_| !is_first)) {
        return write!(
            stream,
            "HTTP/1.1 302 Found\r\nLocation: {to}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
        );
    }
    if name == "/stall" {
        // The client leaves first.
        stream.write_all(b"HTTP/1.1 206 Partial")?;
        return stream.read(&mut [0]).map(|_| ());
    }
    let name = if name.starts_with("/late?") { "/dsm.tif".to_owned() } else { name };
    let Some((_, content)) = files.iter().find(|(known, _)| *known == name) else {
        return stream.write_all(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    };
    let (from, to) = range.map_or((0, content.len()), |(from, to)| (from, (to + 1).min(content.len())));
    let status = if range.is_some() { "206 Partial Content" } else { "200 OK" };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Length: {}\r\nContent-Range: bytes {from}-{}/{}\r\nAccept-Ranges: bytes\r\nConnection: close\r\n\r\n",
        to - from,
        to.saturating_sub(1),
        content.len()
    );
    stream.write_all(head.as_bytes())?;
    if method == "HEAD" { Ok(()) } else { stream.write_all(&content[from..to]) }
}

#[test]
fn addresses_are_read_only_when_the_user_says_so() {
    let reference = sample("truth/dsm.tif");
    let content = std::fs::read(&reference).unwrap();
    let (port, asked) = server(vec![("/dsm.tif", content.clone()), ("/secret.tif", content)]);
    let url = format!("http://127.0.0.1:{port}/dsm.tif");
    let evaluate = |test: &str, options: &[&str]| {
        let mut command = skysweep();
        command.arg("eval").arg(test).arg(&reference).args(["--no-report"]).args(options).assert()
    };
    evaluate(&url, &[]).code(2).stderr(contains("--allow-remote"));
    assert!(asked.lock().unwrap().is_empty(), "nothing is asked for without leave");
    evaluate(&url, &["--allow-remote"]).code(0);
    assert!(asked.lock().unwrap().iter().all(|name| name == "/dsm.tif"), "{asked:?}");
    // Leave for what the user names is none for what a file names.
    let folder = tempfile::tempdir().unwrap();
    for (number, prefix) in ["/vsicurl/", "/vsicurl_streaming/", ""].iter().enumerate() {
        let vrt = folder.path().join(format!("{number}.vrt"));
        let text = format!(
            "<VRTDataset rasterXSize=\"8\" rasterYSize=\"8\"><GeoTransform>693675, 1, 0, 4822500, 0, -1</GeoTransform>\
             <VRTRasterBand dataType=\"Float32\" band=\"1\"><SimpleSource><SourceFilename>{prefix}\
             http://127.0.0.1:{port}/secret.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource>\
             </VRTRasterBand></VRTDataset>"
        );
        std::fs::write(&vrt, text).unwrap();
        evaluate(vrt.to_str().unwrap(), &["--allow-remote"]).code(2);
    }
    assert!(asked.lock().unwrap().iter().all(|name| name != "/secret.tif"), "{asked:?}");
}

/// An image with its RPC inside is an image at an address, too. Files beside it are not fetched.
#[test]
fn images_at_addresses_bring_their_rpc() {
    let names = ["view_1.tif", "view_2.tif"];
    let mut files: Vec<(&'static str, Vec<u8>)> = vec![
        ("/view_1.tif", std::fs::read(sample(names[0])).unwrap()),
        ("/view_2.tif", std::fs::read(sample(names[1])).unwrap()),
    ];
    files.push(("/plain.tif", std::fs::read(sample("truth/ortho.tif")).unwrap()));
    let (port, asked) = server(files);
    let url = |name: &str| format!("http://127.0.0.1:{port}/{name}");
    let folder = tempfile::tempdir().unwrap();
    let dsm = |out: &str, images: [&str; 2], more: &[&str]| {
        let mut command = skysweep();
        command.arg("dsm").args(images.map(url)).arg("-o").arg(folder.path().join(out));
        command.args(["--preset", "fast", "--gsd", "2", "--progress", "none"]).args(more).assert()
    };
    dsm("closed", names, &[]).code(2).stderr(contains("--allow-remote"));
    assert!(asked.lock().unwrap().is_empty(), "nothing is asked for without leave");
    dsm("open", names, &["--allow-remote"]).code(0);
    let mut local = skysweep();
    local.arg("dsm").args(names.map(sample)).arg("-o").arg(folder.path().join("local"));
    local.args(["--preset", "fast", "--gsd", "2", "--progress", "none"]).assert().code(0);
    let surface = |out: &str| crate::common::band(&folder.path().join(out).join("dsm/dsm.tif"), 1);
    // GDAL prints the RPC with 15 digits, and the file at hand has the numbers themselves.
    let (open, local) = (surface("open"), surface("local"));
    let differs = |(a, b): (&f32, &f32)| a.is_nan() != b.is_nan() || (a - b).abs() > 0.01;
    let different = open.data().iter().zip(local.data()).filter(|cells| differs(*cells)).count();
    assert!(different * 1000 < local.data().len(), "{different} cells differ");
    let told = dsm("bare", ["view_1.tif", "plain.tif"], &["--allow-remote"]).code(2);
    told.stderr(contains("files beside an address are not fetched"));
    let known = ["/view_1.tif", "/view_2.tif", "/plain.tif"];
    assert!(asked.lock().unwrap().iter().all(|name| known.contains(&name.as_str())), "{:?}", asked.lock().unwrap());
}

/// A server that the user named cannot make the program ask another one, nor keep it waiting.
#[test]
fn servers_neither_lead_elsewhere_nor_stall() {
    let reference = sample("truth/dsm.tif");
    let content = std::fs::read(&reference).unwrap();
    let (port, _) = server(vec![("/dsm.tif", content.clone())]);
    let (other, asked) = server(vec![("/dsm.tif", content)]);
    let evaluate = |name: &str| {
        let mut command = skysweep();
        command.env("GDAL_HTTP_TIMEOUT", "1").arg("eval").arg(format!("http://127.0.0.1:{port}/{name}"));
        command.arg(&reference).args(["--no-report", "--allow-remote"]).assert()
    };
    for name in ["to?/dsm.tif", "to?dsm.tif", &format!("to?http://127.0.0.1:{port}/dsm.tif")] {
        evaluate(name).code(0);
    }
    let elsewhere = [
        format!("http://127.0.0.1:{other}/dsm.tif"),
        format!("http://localhost:{port}/dsm.tif"),
        format!("//127.0.0.1:{other}/dsm.tif"),
        format!("http://127.0.0.1:{port}@127.0.0.1:{other}/dsm.tif"),
    ];
    for to in elsewhere {
        evaluate(&format!("to?{to}")).code(2).stderr(contains("redirects to another server"));
        evaluate(&format!("late?{to}")).code(2).stderr(contains("redirects to another server"));
    }
    evaluate("to?file:///etc/passwd").code(2).stderr(contains("redirects to another server"));
    evaluate("to?to?to?to?to?to?to?to?/dsm.tif").code(2);
    assert!(asked.lock().unwrap().is_empty(), "another server was asked");
    let start = Instant::now();
    evaluate("stall").code(2).stderr(contains("did not answer in time"));
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}

/// A geoid grid that is not installed is fetched where the user says so, once, from the address
/// that PROJ's variable names.
#[test]
fn grids_are_fetched_only_when_the_user_says_so() {
    const UNDULATION_M: f32 = 5.25;
    let folder = tempfile::tempdir().unwrap();
    let grid = folder.path().join("undulation.tif");
    // One degree around the town, in steps of a tenth.
    let values = Grid::filled(10, 10, UNDULATION_M);
    let bands = [Band { description: "geoid_undulation", data: BandData::F32(&values) }];
    let place = GeoTransform([4.9, 0.1, 0.0, 44.0, 0.0, -0.1]);
    let raster = CogRaster { holds_heights: false, ..CogRaster::new(&bands, place, Crs::ellipsoidal(4326)) };
    write_cog(&grid, &raster, false).unwrap();
    let (port, asked) = server(vec![("/us_nga_egm08_25.tif", std::fs::read(&grid).unwrap())]);

    let reference = sample("truth/dsm.tif");
    let user = folder.path().join("proj");
    let evaluate = |endpoint: &str, options: &[&str]| {
        let mut command = skysweep();
        command.env("PROJ_USER_WRITABLE_DIRECTORY", &user).env("PROJ_NETWORK_ENDPOINT", endpoint);
        command.arg("eval").arg(&reference).arg(&reference).args(["--test-vertical", "egm2008", "--align", "none"]);
        command.args(["--no-report", "--json"]).args(options).assert()
    };
    let here = format!("http://127.0.0.1:{port}");
    evaluate(&here, &[]).code(2).stderr(contains("us_nga_egm08_25.tif").and(contains("--fetch-grids")));
    assert!(asked.lock().unwrap().is_empty() && !user.exists(), "nothing is asked for without leave");

    let elsewhere = format!("{here}/elsewhere");
    evaluate(&elsewhere, &["--fetch-grids"]).code(2).stderr(contains("404").and(contains("us_nga_egm08_25.tif")));
    assert_eq!(std::fs::read_dir(&user).unwrap().count(), 0, "nothing is left of what was not found");

    let told = evaluate(&here, &["--fetch-grids"]).code(0).stderr(contains("fetched").and(contains(&here)));
    let report: serde_json::Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
    let median_m = report["metrics"]["median"].as_f64().unwrap();
    assert!((median_m - f64::from(UNDULATION_M)).abs() < 0.01, "{median_m}");

    let requests = asked.lock().unwrap().len();
    evaluate(&here, &[]).code(0);
    assert_eq!(asked.lock().unwrap().len(), requests, "the grid is kept");
}
