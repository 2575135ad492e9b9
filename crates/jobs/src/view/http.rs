//! Requests and responses of HTTP/1.1, one per connection, within fixed bounds.
//!
//! A head has at most 16 KiB, 64 fields and five seconds, and begins within one second. A body is
//! not read.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Longest head of a request, bytes.
pub(super) const HEAD_MAX: usize = 16 << 10;
/// Most fields of a head.
const FIELDS_MAX: usize = 64;
/// Time within which the head of a request must arrive.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time within which it must begin. Browsers open connections in advance that they leave idle.
const IDLE_TIME: Duration = Duration::from_millis(1000);
/// Time after which a connection looks whether the viewer ends.
const SLICE: Duration = Duration::from_millis(100);
/// Time that a client may take to receive a part of a response.
const WRITE_TIME: Duration = Duration::from_secs(10);
/// Parts of 4 KiB of a refused request that are read after the response.
const REST_PARTS: usize = 64;

/// Fields of every response. The page loads nothing from elsewhere and is shown in no frame; its
/// address, which holds the token, is told to nobody.
const FIELDS: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
    X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nX-Frame-Options: DENY\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
    Cache-Control: no-store\r\nConnection: close\r\n";

/// A request that may be answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    /// Whether only the head of the response is wanted.
    pub(super) is_head: bool,
    /// Path and query.
    pub(super) target: String,
    /// The field `Host`.
    pub(super) host: String,
}

/// The content of a response.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Answer {
    /// Type of the content.
    pub(super) kind: &'static str,
    /// The content.
    pub(super) body: Vec<u8>,
}

/// Why a request is not answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Refusal {
    /// The request is malformed, or asks for something out of range.
    Malformed(String),
    /// The request names another host.
    ForeignHost,
    /// There is nothing under this address, or the token is wrong.
    NotFound,
    /// The method is neither GET nor HEAD.
    Method,
    /// The request did not arrive in time.
    TooSlow,
    /// The head is too long.
    TooLong,
    /// The data cannot be read.
    Failed(String),
    /// The connection was closed before a request, or the viewer ends: nothing is sent.
    Gone,
}

impl Refusal {
    /// Returns the status line's code and words; `None` when nothing is sent.
    fn status(&self) -> Option<(u16, &'static str)> {
        Some(match self {
            Self::Malformed(_) => (400, "Bad Request"),
            Self::ForeignHost => (403, "Forbidden"),
            Self::NotFound => (404, "Not Found"),
            Self::Method => (405, "Method Not Allowed"),
            Self::TooSlow => (408, "Request Timeout"),
            Self::TooLong => (431, "Request Header Fields Too Large"),
            Self::Failed(_) => (500, "Internal Server Error"),
            Self::Gone => return None,
        })
    }
}

/// Reads the head of a request. `is_over` is asked while it waits.
///
/// # Errors
/// [`Refusal`], never [`Refusal::NotFound`], [`Refusal::ForeignHost`] or [`Refusal::Failed`].
pub(super) fn receive(stream: &mut TcpStream, is_over: &dyn Fn() -> bool) -> Result<Request, Refusal> {
    let start = Instant::now();
    let mut head = Vec::new();
    let mut part = [0u8; 4096];
    stream.set_read_timeout(Some(SLICE)).map_err(|_| Refusal::Gone)?;
    loop {
        match stream.read(&mut part) {
            Ok(0) => return Err(Refusal::Gone),
            Ok(count) => head.extend_from_slice(part.get(..count).unwrap_or_default()),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(_) => return Err(Refusal::Gone),
        }
        if let Some(request) = parse(&head)? {
            return Ok(request);
        }
        if is_over() {
            return Err(Refusal::Gone);
        }
        match head.is_empty() {
            true if start.elapsed() > IDLE_TIME => return Err(Refusal::Gone),
            false if start.elapsed() > HEAD_TIME => return Err(Refusal::TooSlow),
            _ => {}
        }
    }
}

/// Parses a head; `None` when more of it is needed.
///
/// # Errors
/// As [`receive`].
fn parse(head: &[u8]) -> Result<Option<Request>, Refusal> {
    let mut fields = [httparse::EMPTY_HEADER; FIELDS_MAX];
    let mut parsed = httparse::Request::new(&mut fields);
    let malformed = |e: httparse::Error| match e {
        httparse::Error::TooManyHeaders => Refusal::TooLong,
        other => Refusal::Malformed(other.to_string()),
    };
    if parsed.parse(head).map_err(malformed)?.is_partial() {
        return if head.len() > HEAD_MAX { Err(Refusal::TooLong) } else { Ok(None) };
    }
    let is_head = match parsed.method {
        Some("GET") => false,
        Some("HEAD") => true,
        _ => return Err(Refusal::Method),
    };
    let mut hosts = parsed.headers.iter().filter(|field| field.name.eq_ignore_ascii_case("host"));
    let (Some(host), None) = (hosts.next(), hosts.next()) else { return Err(Refusal::ForeignHost) };
    let host = String::from_utf8_lossy(host.value).into_owned();
    Ok(Some(Request { is_head, target: parsed.path.unwrap_or_default().to_owned(), host }))
}

/// Sends a response. A client that went away is no error.
pub(super) fn send(stream: &mut TcpStream, is_head: bool, answer: &Result<Answer, Refusal>) {
    let (status, kind, body) = match answer {
        Ok(answer) => ((200, "OK"), answer.kind, answer.body.as_slice()),
        Err(refusal) => {
            let Some(status) = refusal.status() else { return };
            let text = match refusal {
                Refusal::Malformed(text) | Refusal::Failed(text) => text.as_bytes(),
                _ => status.1.as_bytes(),
            };
            (status, "text/plain; charset=utf-8", text)
        }
    };
    let allow = if status.0 == 405 { "Allow: GET, HEAD\r\n" } else { "" };
    let (code, words, length) = (status.0, status.1, body.len());
    let head =
        format!("HTTP/1.1 {code} {words}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{allow}{FIELDS}\r\n");
    let body = if is_head { &[] } else { body };
    let sent = stream
        .set_write_timeout(Some(WRITE_TIME))
        .and_then(|()| stream.write_all(head.as_bytes()))
        .and_then(|()| stream.write_all(body));
    // After a refusal, the rest of the request is taken and thrown away for a while: a connection
    // that is closed with unread bytes would take the response with it.
    let is_refused = answer.is_err() && sent.is_ok() && stream.shutdown(Shutdown::Write).is_ok();
    let mut part = [0u8; 4096];
    let mut parts = if is_refused { REST_PARTS } else { 0 };
    while parts > 0 && stream.read(&mut part).is_ok_and(|count| count > 0) {
        parts -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_parsed_within_bounds() {
        let get = parse(b"GET /a?b HTTP/1.1\r\nhost: 127.0.0.1:80\r\n\r\n").unwrap().unwrap();
        assert_eq!((get.target.as_str(), get.host.as_str(), get.is_head), ("/a?b", "127.0.0.1:80", false));
        assert!(parse(b"HEAD / HTTP/1.1\r\nHost: a\r\n\r\n").unwrap().unwrap().is_head);
        assert_eq!(parse(b"GET / HTTP/1.1\r\nHos"), Ok(None));
        assert_eq!(parse(b"POST / HTTP/1.1\r\nHost: a\r\n\r\n"), Err(Refusal::Method));
        for text in ["GET / HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\nHost: a\r\n\r\n"] {
            assert_eq!(parse(text.as_bytes()), Err(Refusal::ForeignHost));
        }
        let long = format!("GET /{} HTTP/1.1", "a".repeat(HEAD_MAX));
        assert_eq!(parse(long.as_bytes()), Err(Refusal::TooLong));
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(FIELDS_MAX + 1));
        assert_eq!(parse(many.as_bytes()), Err(Refusal::TooLong));
        assert!(matches!(parse(b"\0\0\0\0"), Err(Refusal::Malformed(_))));
    }
}
