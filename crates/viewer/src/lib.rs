//! The view job: an interactive viewer of a run, of rasters, or of splats and meshes, for the
//! browser of this computer.
//!
//! [`ViewServer::open`] finds the layers and takes a port, [`ViewServer::serve`] answers until it
//! is cancelled or its time is over. The server is read-only and meant for one person:
//!
//! - It listens on 127.0.0.1 only. Its address holds a random token of 128 bits, without which
//!   nothing is answered. The header `Host` must name this computer, so that the page of a foreign
//!   site cannot reach it under a name of its own (DNS rebinding).
//! - GET and HEAD are answered, nothing else. Nothing of a request becomes the name of a file:
//!   layers have numbers. Only where a job stands behind the page ([`PageJob`]), a POST from the
//!   page itself is passed to it.
//! - A request, its time and the work that it asks for are bounded, and so is the number of
//!   connections and of requests that are answered at once. A raster of which one picture would
//!   take long, because it has no overviews, is refused.
//! - The page consists of the files in `page/`, which are part of the program. It may talk to this
//!   server only (Content-Security-Policy).
//!
//! HTTP is spoken by `hyper`. Servers with a thread for each connection were looked at, too: they
//! bound neither the time for a head nor the number of threads that slow clients hold.

mod answers;
mod config;
mod error;
mod files;
mod frame;
mod http;
mod packed;
mod page_job;
mod query;
mod rasters;
mod report;
mod scene;
mod server;
mod space;
mod styles;
mod vectors;

pub use config::ViewConfig;
pub use frame::MapFrame;
pub use page_job::{PageData, PageJob};
pub use report::ViewerReport;
pub use server::ViewServer;
