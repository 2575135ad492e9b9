//! Requests and responses of HTTP/1.1, one per connection, within fixed bounds. `hyper` reads and
//! writes them.
//!
//! A head has at most 16 KiB, 64 fields and five seconds. A body is read only where a job behind
//! the page takes some, and has at most 256 KiB. Connections wait for their clients without a
//! thread, so that slow ones keep nobody from being answered.

use std::convert::Infallible;
use std::future::poll_fn;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{ALLOW, CONTENT_LENGTH, CONTENT_TYPE, HOST, HeaderName, HeaderValue, ORIGIN};
use hyper::server::conn::http1::Builder;
use hyper::service::service_fn;
use hyper::{Method, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::timeout;

/// Longest head of a request, bytes.
const HEAD_MAX: usize = 16 << 10;
/// Most fields of a head.
const FIELDS_MAX: usize = 64;
/// Time within which the head of a request must arrive.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time for a whole connection: the head, the work, and a slow client that receives the response.
const CONNECTION_TIME: Duration = Duration::from_secs(60);
/// Connections that are open at once; further ones wait until one ends. A browser opens six, and
/// macOS allows 256 open files to a program.
const CONNECTIONS_MAX: usize = 128;
/// Time between two looks whether the viewer ends.
const PAUSE: Duration = Duration::from_millis(50);
/// Parts of 4 KiB of a refused request that are read after the response, and the time for them. A
/// socket that is closed with unread bytes would take the response back.
const REST_PARTS: usize = 512;
const REST_TIME: Duration = Duration::from_secs(1);
/// Longest body of a request, bytes.
const BODY_MAX: usize = 256 << 10;
/// Type of the bodies that are taken. No form of a foreign page can send it.
const BODY_KIND: &str = "application/json";

/// Fields of every response. The page loads nothing from elsewhere and is shown in no frame; its
/// address, which holds the token, is told to nobody.
const FIELDS: [(&str, &str); 8] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("x-frame-options", "DENY"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cache-control", "no-store"),
    ("connection", "close"),
];

/// Type of the numbers that pages read.
pub(super) const BINARY: &str = "application/octet-stream";

/// A request that may be answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    /// Path and query.
    pub(super) target: String,
    /// The field `Host`.
    pub(super) host: String,
    /// The body of a POST.
    pub(super) posted: Option<Bytes>,
}

/// A request, and where its answer is expected.
pub(super) struct Question {
    /// The request, or why it is refused.
    pub(super) request: Result<Request, Refusal>,
    reply: oneshot::Sender<Result<Answer, Refusal>>,
}

/// The content of a response.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Answer {
    /// Type of the content.
    pub(super) kind: &'static str,
    /// The content.
    pub(super) body: Bytes,
}

/// Why a request is not answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Refusal {
    /// The request asks for something out of range.
    Malformed(String),
    /// The request names another host.
    ForeignHost,
    /// There is nothing under this address, or the token is wrong.
    NotFound,
    /// The method is neither GET nor HEAD, nor a POST where there is a job that takes some.
    Method,
    /// The data cannot be read.
    Failed(String),
}

impl Question {
    /// Gives the answer. A client that went away is no error.
    pub(super) fn reply(self, answer: Result<Answer, Refusal>) {
        drop(self.reply.send(answer));
    }
}

impl Refusal {
    fn status(&self) -> StatusCode {
        match self {
            Self::Malformed(_) => StatusCode::BAD_REQUEST,
            Self::ForeignHost => StatusCode::FORBIDDEN,
            Self::NotFound => StatusCode::NOT_FOUND,
            Self::Method => StatusCode::METHOD_NOT_ALLOWED,
            Self::Failed(_) => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

/// Accepts connections and passes their requests on, until `is_over`. Bodies are read if `posts`.
///
/// # Errors
/// The error of the system when the listener cannot be used.
pub(super) async fn serve(
    listener: std::net::TcpListener,
    questions: mpsc::UnboundedSender<Question>,
    posts: bool,
    is_over: impl Fn() -> bool,
) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = TcpListener::from_std(listener)?;
    let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let mut place = None;
    while !is_over() {
        if place.is_none() {
            place = timeout(PAUSE, Arc::clone(&places).acquire_owned()).await.ok().and_then(Result::ok);
            continue;
        }
        match timeout(PAUSE, listener.accept()).await {
            Ok(Ok((stream, _))) => {
                let (taken, questions) = (place.take(), questions.clone());
                tokio::spawn(async move {
                    // A client that is too slow has lost its connection.
                    let _ = timeout(CONNECTION_TIME, converse(stream, questions, posts)).await;
                    drop(taken);
                });
            }
            // Too many open files, for example.
            Ok(Err(_)) => tokio::time::sleep(PAUSE).await,
            Err(_) => {}
        }
    }
    Ok(())
}

/// Answers the request of one connection.
async fn converse(stream: TcpStream, questions: mpsc::UnboundedSender<Question>, posts: bool) {
    let service = service_fn(|request| Box::pin(answer(request, questions.clone(), posts)));
    let mut builder = Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME);
    builder
        .keep_alive(false)
        .title_case_headers(true)
        .max_buf_size(HEAD_MAX)
        .max_headers(FIELDS_MAX)
        .auto_date_header(false);
    let mut connection = builder.serve_connection(TokioIo::new(stream), service);
    // A malformed request has its answer already, and a client that went away needs none.
    let _ = poll_fn(|context| connection.poll_without_shutdown(context)).await;
    let mut stream = connection.into_parts().io.into_inner();
    let rest = async {
        stream.shutdown().await?;
        let mut part = [0u8; 4096];
        let mut parts = REST_PARTS;
        while parts > 0 && stream.read(&mut part).await? > 0 {
            parts -= 1;
        }
        std::io::Result::Ok(())
    };
    let _ = timeout(REST_TIME, rest).await;
}

/// Passes a request on and makes the response of its answer.
async fn answer(
    request: hyper::Request<Incoming>,
    questions: mpsc::UnboundedSender<Question>,
    posts: bool,
) -> Result<Response<Full<Bytes>>, Infallible> {
    let (reply, answer) = oneshot::channel();
    let is_head = request.method() == Method::HEAD;
    let ends = || Refusal::Failed("the viewer ends".to_owned());
    let answer = match questions.send(Question { request: checked(request, posts).await, reply }) {
        Ok(()) => answer.await.unwrap_or_else(|_| Err(ends())),
        Err(_) => Err(ends()),
    };
    Ok(response(answer, is_head, posts))
}

/// Returns what a request asks for.
async fn checked(request: hyper::Request<Incoming>, posts: bool) -> Result<Request, Refusal> {
    let is_post = posts && request.method() == Method::POST;
    if !is_post && ![Method::GET, Method::HEAD].contains(request.method()) {
        return Err(Refusal::Method);
    }
    let mut hosts = request.headers().get_all(HOST).iter();
    let (Some(host), None) = (hosts.next(), hosts.next()) else { return Err(Refusal::ForeignHost) };
    let host = host.to_str().map_err(|_| Refusal::ForeignHost)?.to_owned();
    // An address with a host is for proxies.
    if request.uri().authority().is_some() {
        return Err(Refusal::NotFound);
    }
    let target = request.uri().path_and_query().ok_or(Refusal::NotFound)?.as_str().to_owned();
    let posted = if is_post { Some(body(request, &host).await?) } else { None };
    Ok(Request { target, host, posted })
}

/// Reads the body of a POST that the own page sends. A browser says where a request comes from.
async fn body(request: hyper::Request<Incoming>, host: &str) -> Result<Bytes, Refusal> {
    let own = format!("http://{host}");
    if request.headers().get_all(ORIGIN).iter().any(|origin| origin.as_bytes() != own.as_bytes()) {
        return Err(Refusal::ForeignHost);
    }
    if request.headers().get(CONTENT_TYPE).is_none_or(|kind| kind.as_bytes() != BODY_KIND.as_bytes()) {
        return Err(Refusal::Malformed(format!("the type of the body is not {BODY_KIND}")));
    }
    let read = Limited::new(request.into_body(), BODY_MAX).collect().await;
    let too_long = |_| Refusal::Malformed(format!("the body cannot be read, or is longer than {BODY_MAX} bytes"));
    Ok(read.map_err(too_long)?.to_bytes())
}

fn response(answer: Result<Answer, Refusal>, is_head: bool, posts: bool) -> Response<Full<Bytes>> {
    let (status, kind, body) = match answer {
        Ok(answer) => (StatusCode::OK, answer.kind, answer.body),
        Err(refusal) => {
            let status = refusal.status();
            let text = match refusal {
                Refusal::Malformed(text) | Refusal::Failed(text) => text,
                _ => status.canonical_reason().unwrap_or_default().to_owned(),
            };
            (status, "text/plain; charset=utf-8", Bytes::from(text))
        }
    };
    let length = body.len();
    let mut response = Response::new(Full::new(if is_head { Bytes::new() } else { body }));
    *response.status_mut() = status;
    let fields = response.headers_mut();
    for (name, value) in FIELDS {
        fields.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    fields.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    fields.insert(CONTENT_LENGTH, HeaderValue::from(length));
    if status == StatusCode::METHOD_NOT_ALLOWED {
        fields.insert(ALLOW, HeaderValue::from_static(if posts { "GET, HEAD, POST" } else { "GET, HEAD" }));
    }
    response
}
