//! A job behind a page: it has data for the page under names of its own, and does what the page
//! asks for. The viewer passes both on and knows nothing of the work.

use super::http::{Answer, BINARY};

/// What a page reads and asks for beside the map. Requests come from several threads.
pub trait PageJob: Sync {
    /// Returns what the job has under a name; `None` for a name that it does not know, words for a
    /// person where it cannot be had.
    fn get(&self, name: &str) -> Option<Result<PageData, String>>;

    /// Does what the page asks for under a name, with the JSON that it sends, and returns JSON;
    /// `None` for a name that it does not know, words for a person where it is refused.
    fn post(&self, name: &str, body: &[u8]) -> Option<Result<String, String>>;
}

/// Data for a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PageData {
    /// JSON as text.
    Json(String),
    /// Numbers.
    Binary(Vec<u8>),
    /// A picture as PNG.
    Png(Vec<u8>),
}

impl From<PageData> for Answer {
    fn from(data: PageData) -> Self {
        match data {
            PageData::Json(text) => Self { kind: "application/json", body: text.into() },
            PageData::Binary(bytes) => Self { kind: BINARY, body: bytes.into() },
            PageData::Png(bytes) => Self { kind: "image/png", body: bytes.into() },
        }
    }
}
