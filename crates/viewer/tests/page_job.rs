//! A job behind the page, over the server's own socket: what a POST must have to reach it, and that
//! nothing reaches it where there is none.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use numeric::{CancelFlag, Cancellable, Silent};
use viewer::{MapFrame, PageData, PageJob, ViewConfig, ViewServer};

/// Keeps what reaches it.
#[derive(Default)]
struct Desk(Mutex<Vec<String>>);

impl PageJob for Desk {
    fn get(&self, name: &str) -> Option<Result<PageData, String>> {
        match name {
            "numbers.bin" => Some(Ok(PageData::Binary(vec![1, 2, 3]))),
            "broken.png" => Some(Err("the picture is torn".to_owned())),
            _ => None,
        }
    }

    fn post(&self, name: &str, body: &[u8]) -> Option<Result<String, String>> {
        let body = String::from_utf8_lossy(body).into_owned();
        self.0.lock().unwrap().push(body.clone());
        match name {
            "save" => Some(Ok(format!("[{}]", body.len()))),
            "refuse" => Some(Err("the folder is full".to_owned())),
            _ => None,
        }
    }
}

fn opened() -> ViewServer {
    let heights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/truth/dsm.tif");
    ViewServer::open(&ViewConfig::new(vec![heights]), &Silent).unwrap()
}

/// Serves while `work` asks, with a job or without. `work` gets the host and the token.
fn served(viewer: &ViewServer, job: Option<&Desk>, work: impl FnOnce(&str, &str)) {
    let url = viewer.url();
    let (host, token) = url.strip_prefix("http://").unwrap().trim_end_matches('/').split_once('/').unwrap();
    let flag = CancelFlag::new();
    std::thread::scope(|scope| {
        let progress = Cancellable { inner: &Silent, flag: &flag };
        let server = scope.spawn(move || match job {
            Some(job) => viewer.serve_job(job, &progress).unwrap(),
            None => viewer.serve(&progress).unwrap(),
        });
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(host, token)));
        flag.cancel();
        server.join().unwrap();
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
}

/// Sends a request and returns its status and everything of the answer.
fn asked(host: &str, head: &str, body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let text = format!("{head}\r\nHost: {host}\r\nContent-Length: {}\r\n\r\n{body}", body.len());
    // A server that refuses may close before everything is sent.
    let _ = stream.write_all(text.as_bytes());
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    (answer.split(' ').nth(1).unwrap().parse().unwrap(), answer)
}

const JSON: &str = "Content-Type: application/json";

#[test]
fn only_a_post_of_the_own_page_reaches_the_job() {
    let (viewer, desk) = (opened(), Desk::default());
    served(&viewer, Some(&desk), |host, token| {
        let post = |name: &str, fields: &str, body: &str| {
            asked(host, &format!("POST /{token}/{name} HTTP/1.1\r\n{fields}"), body)
        };
        let own = format!("{JSON}\r\nOrigin: http://{host}");
        let (status, answer) = post("job/save", &own, "{}");
        assert!(status == 200 && answer.ends_with("\r\n\r\n[2]"), "{answer}");
        assert_eq!(post("job/save", JSON, "{ }").0, 200, "a program names no origin");
        // What it refuses is told in its words.
        let (status, answer) = post("job/refuse", &own, "{}");
        assert!(status == 400 && answer.ends_with("the folder is full"), "{answer}");
        assert_eq!(post("job/unknown", &own, "{}").0, 404);
        let reached = desk.0.lock().unwrap().len();
        // Foreign pages, forms, long bodies, other paths and wrong tokens.
        for origin in ["https://example.org", "null", "http://localhost:1"] {
            assert_eq!(post("job/save", &format!("{JSON}\r\nOrigin: {origin}"), "{}").0, 403, "{origin}");
        }
        for kind in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
            assert_eq!(post("job/save", &format!("Content-Type: {kind}"), "{}").0, 400, "{kind}");
        }
        assert_eq!(asked(host, &format!("POST /{token}/job/save HTTP/1.1"), "{}").0, 400, "no type");
        assert_eq!(post("job/save", &own, &" ".repeat(300 << 10)).0, 400, "long");
        assert_eq!(post("scene.json", &own, "{}").0, 404);
        let foreign = "0".repeat(token.len());
        assert_eq!(asked(host, &format!("POST /{foreign}/job/save HTTP/1.1\r\n{own}"), "{}").0, 404);
        for method in ["PUT", "DELETE", "OPTIONS"] {
            let (status, answer) = asked(host, &format!("{method} /{token}/job/save HTTP/1.1\r\n{own}"), "{}");
            assert!(status == 405 && answer.contains("Allow: GET, HEAD, POST"), "{answer}");
        }
        assert_eq!(desk.0.lock().unwrap().len(), reached, "nothing of these reached the job");
    });
}

#[test]
fn the_page_and_the_data_of_a_job_are_there_with_it_only() {
    let (viewer, desk) = (opened(), Desk::default());
    let get = |host: &str, token: &str, name: &str| asked(host, &format!("GET /{token}/{name} HTTP/1.1"), "");
    served(&viewer, Some(&desk), |host, token| {
        assert!(get(host, token, "").1.contains("<title>skysweep align</title>"));
        assert_eq!(get(host, token, "align/main.js").0, 200);
        assert!(get(host, token, "job/numbers.bin").1.ends_with("\r\n\r\n\u{1}\u{2}\u{3}"));
        let (status, answer) = get(host, token, "job/broken.png");
        assert!(status == 500 && answer.ends_with("the picture is torn"), "{answer}");
        assert_eq!(get(host, token, "job/../secret").0, 404);
    });
    served(&viewer, None, |host, token| {
        assert!(get(host, token, "").1.contains("<title>skysweep view</title>"));
        assert_eq!((get(host, token, "align.html").0, get(host, token, "job/numbers.bin").0), (404, 404));
        assert_eq!(asked(host, &format!("POST /{token}/job/save HTTP/1.1\r\n{JSON}"), "{}").0, 405);
    });
    assert!(desk.0.lock().unwrap().is_empty());
}

#[test]
fn the_frame_of_the_map_is_that_of_its_raster() {
    let frame: MapFrame = opened().map_frame().unwrap().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/truth/dsm.tif");
    let dem = formats::raster::read_dem(&path).unwrap();
    let (x, y) = dem.geotransform.map_from_cell(-0.5, -0.5);
    assert_eq!((frame.bounds[0], frame.bounds[3], frame.epsg), (x, y, dem.horizontal_epsg));
    let mut heights: Vec<f64> = dem.heights.data().iter().map(|h| f64::from(*h)).filter(|h| h.is_finite()).collect();
    let median = numeric::upper_median(&mut heights).unwrap();
    assert!((frame.ground_m.unwrap() - median).abs() < 0.5, "{:?} {median}", frame.ground_m);
    let image = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/view_1.tif");
    let viewer = ViewServer::open(&ViewConfig::new(vec![image]), &Silent).unwrap();
    assert_eq!(viewer.map_frame().unwrap(), None, "an image that lies on no map");
}
