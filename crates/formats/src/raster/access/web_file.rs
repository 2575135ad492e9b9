//! Files at addresses of the web, read in parts over HTTP.
//!
//! GDAL's own reader follows every redirect, so that a server could make it ask any machine of the
//! user's network. This one follows a redirect only to the origin (scheme, host and port) that the
//! user named. Each request has a bounded size and a bounded time, and a file that changes while it
//! is read is an error.

use std::sync::LazyLock;
use std::time::Duration;

use gdal::config;
use ureq::http::{Response, StatusCode, Uri, header};
use ureq::tls::{RootCerts, TlsConfig};
use ureq::{Agent, Body};

/// Time for a connection with its encryption, seconds. A server on another continent takes less
/// than one; the rest is for lost packets, which the system sends again after 1, 3 and 7 s.
const CONNECT_S: f64 = 10.0;
/// Time for one request and its answer of at most [`PART`] bytes, seconds: a slower line than
/// 17 kB/s would need days for an image.
const REQUEST_S: f64 = 60.0;
/// Most bytes of one request.
const PART: u64 = 1 << 20;
/// Redirects that are followed. Browsers stop at 20; within one origin two are ample.
const REDIRECTS_MAX: usize = 5;

/// GDAL's options for the two times in seconds, which users of GDAL know.
const CONNECT_OPTION: &str = "GDAL_HTTP_CONNECTTIMEOUT";
const REQUEST_OPTION: &str = "GDAL_HTTP_TIMEOUT";

static AGENT: LazyLock<Agent> = LazyLock::new(|| {
    let time = |option, seconds| {
        let given = config::get_config_option(option, "").ok().and_then(|text| text.parse::<f64>().ok());
        let given = given.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        Some(given.filter(|time| !time.is_zero()).unwrap_or(Duration::from_secs_f64(seconds)))
    };
    Agent::config_builder()
        .timeout_connect(time(CONNECT_OPTION, CONNECT_S))
        .timeout_per_call(time(REQUEST_OPTION, REQUEST_S))
        .max_redirects(0)
        .max_redirects_will_error(false)
        .http_status_as_error(false)
        .tls_config(TlsConfig::builder().root_certs(RootCerts::PlatformVerifier).build())
        .user_agent(concat!("skysweep/", env!("CARGO_PKG_VERSION")))
        .build()
        .new_agent()
});

/// A file at an address, and a position in it.
pub(crate) struct WebFile {
    /// The address after redirects.
    address: String,
    size: u64,
    position: u64,
    /// Whether a read met the end of the file.
    pub(crate) is_at_end: bool,
}

/// Bytes of a file, and the size of the whole.
struct Part {
    bytes: Vec<u8>,
    size: u64,
}

impl WebFile {
    /// Finds a file and its size.
    ///
    /// # Errors
    /// What the server answered instead of a part of the file, or that it did not answer in time.
    pub(crate) fn open(address: &str) -> Result<Self, String> {
        let mut address = address.to_owned();
        let first = part(&mut address, 0, 1)?;
        Ok(Self { address, size: first.size, position: 0, is_at_end: false })
    }

    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    pub(crate) fn seek(&mut self, position: u64) {
        self.position = position;
        self.is_at_end = false;
    }

    /// Reads into a buffer from the position on, and returns the number of bytes, which is smaller
    /// than the buffer only at the end of the file.
    ///
    /// # Errors
    /// As [`WebFile::open`].
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> Result<usize, String> {
        let left = usize::try_from(self.size.saturating_sub(self.position)).unwrap_or(usize::MAX);
        let wanted = buffer.len().min(left);
        self.is_at_end = wanted < buffer.len();
        let mut done = 0;
        for piece in buffer[..wanted].chunks_mut(PART as usize) {
            let found = part(&mut self.address, self.position, piece.len() as u64)?;
            if found.size != self.size {
                return Err(format!("the file had {} bytes and now has {}: read it again", self.size, found.size));
            }
            if found.bytes.len() != piece.len() {
                return Err(format!("the server sent {} bytes, expected {}", found.bytes.len(), piece.len()));
            }
            piece.copy_from_slice(&found.bytes);
            self.position += piece.len() as u64;
            done += piece.len();
        }
        Ok(done)
    }
}

/// Gets some bytes of the file at an address, which becomes the one that a redirect leads to.
fn part(address: &mut String, start: u64, count: u64) -> Result<Part, String> {
    for _ in 0..=REDIRECTS_MAX {
        let range = format!("bytes={start}-{}", start + count - 1);
        let request =
            AGENT.get(address.as_str()).header(header::RANGE, range).header(header::ACCEPT_ENCODING, "identity");
        let request = match basic_authorization(address) {
            Some(value) => request.header(header::AUTHORIZATION, value),
            None => request,
        };
        let mut response = request.call().map_err(|error| in_words(&error))?;
        match response.status() {
            StatusCode::PARTIAL_CONTENT => {
                let size = whole_size(&response)?;
                let bytes = response.body_mut().with_config().limit(PART).read_to_vec().map_err(|e| in_words(&e))?;
                return Ok(Part { bytes, size });
            }
            StatusCode::OK => {
                return Err("the server does not send parts of files: download the file first".to_owned());
            }
            status if status.is_redirection() => *address = redirected(address, &response)?,
            status => return Err(format!("the server answers {status}")),
        }
    }
    Err(format!("the server redirects more than {REDIRECTS_MAX} times"))
}

/// Returns the size of the whole file from `Content-Range: bytes 0-9/1000`.
fn whole_size(response: &Response<Body>) -> Result<u64, String> {
    let text = response.headers().get(header::CONTENT_RANGE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let size = text.rsplit_once('/').and_then(|(_, size)| size.trim().parse().ok());
    size.ok_or_else(|| "the server does not tell the size of the file: download the file first".to_owned())
}

/// Returns the address that a redirect leads to.
fn redirected(from: &str, response: &Response<Body>) -> Result<String, String> {
    let location = response.headers().get(header::LOCATION).and_then(|value| value.to_str().ok());
    let location = location.ok_or_else(|| format!("the server answers {} without an address", response.status()))?;
    let to = resolved(from, location);
    match (origin(from), origin(&to)) {
        (Some(old), Some(new)) if old == new => Ok(to),
        _ => Err(format!(
            "the server redirects to another server, which is not followed: {to}; give that address yourself if you \
             trust it"
        )),
    }
}

/// Returns the address that a reference in the answer of another address means.
fn resolved(from: &str, location: &str) -> String {
    let location = location.split('#').next().unwrap_or_default();
    let scheme_end = from.find("://").map_or(0, |at| at + 3);
    let path_start = from[scheme_end..].find(['/', '?', '#']).map_or(from.len(), |at| scheme_end + at);
    let path_end = from[path_start..].find(['?', '#']).map_or(from.len(), |at| path_start + at);
    let has_scheme =
        location.split_once(':').is_some_and(|(scheme, _)| scheme.bytes().all(|b| b.is_ascii_alphanumeric()));
    if has_scheme {
        location.to_owned()
    } else if location.starts_with("//") {
        format!("{}:{location}", from.split(':').next().unwrap_or_default())
    } else if location.starts_with('/') {
        format!("{}{location}", &from[..path_start])
    } else if location.starts_with('?') {
        format!("{}{location}", &from[..path_end])
    } else {
        let folder = from[path_start..path_end].rfind('/').map_or("/", |at| &from[path_start..=path_start + at]);
        format!("{}{folder}{location}", &from[..path_start])
    }
}

/// Returns scheme, host and port of an address of the web.
fn origin(address: &str) -> Option<(String, String, u16)> {
    let uri: Uri = address.parse().ok()?;
    let scheme = uri.scheme_str()?.to_ascii_lowercase();
    let usual = match scheme.as_str() {
        "http" => 80,
        "https" => 443,
        _ => return None,
    };
    Some((scheme, uri.host()?.to_ascii_lowercase(), uri.port_u16().unwrap_or(usual)))
}

/// Returns the field for `https://name:password@host/…`.
fn basic_authorization(address: &str) -> Option<String> {
    let uri: Uri = address.parse().ok()?;
    let (user, _) = uri.authority()?.as_str().rsplit_once('@')?;
    let plain = |text: &str| percent_encoding::percent_decode_str(text).collect::<Vec<u8>>();
    Some(format!("Basic {}", base64::Engine::encode(&base64::prelude::BASE64_STANDARD, plain(user))))
}

fn in_words(error: &ureq::Error) -> String {
    match error {
        ureq::Error::Timeout(_) => {
            format!(
                "the server did not answer in time; {REQUEST_OPTION} and {CONNECT_OPTION} set other times, in seconds"
            )
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_are_resolved_and_origins_compared() {
        let from = "http://Host:8080/a/b.tif?x=1";
        for (location, to) in [
            ("/c.tif", "http://Host:8080/c.tif"),
            ("c.tif#part", "http://Host:8080/a/c.tif"),
            ("?y=2", "http://Host:8080/a/b.tif?y=2"),
            ("//other/c", "http://other/c"),
            ("https://host:8080/c", "https://host:8080/c"),
            ("file:///etc/passwd", "file:///etc/passwd"),
        ] {
            assert_eq!(resolved(from, location), to, "{location}");
        }
        assert_eq!(resolved("http://host", "c.tif"), "http://host/c.tif");
        assert_eq!(origin("HTTP://Host/a"), origin("http://host:80/b"));
        for other in ["https://host/a", "http://host:81/a", "http://host.evil/a", "http://host@evil/a", "ftp://host/a"]
        {
            assert_ne!(origin("http://host/a"), origin(other), "{other}");
        }
        assert_eq!(basic_authorization("http://a%40b:c@host/").as_deref(), Some("Basic YUBiOmM="));
        assert_eq!(basic_authorization("http://host/a@b"), None);
    }
}
