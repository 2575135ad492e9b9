//! RPC files: every container in which providers and tools keep the RPC of an image.
//!
//! [`read`] takes any file and finds its format by the content. [`read_for_image`] also looks at
//! the files beside an image. Whatever a format's convention, the [`Rpc`](camera::Rpc) that comes
//! out has the centre of the upper-left pixel at (0, 0), degrees, and metres above the ellipsoid.
//!
//! A file without an RPC is an error that lists the formats tried ([`RpcReadError::NotRpc`]). A
//! file of a known format with an entry that is missing, repeated, not finite or of the wrong
//! length is an error that names the entry, and its line in text formats
//! ([`RpcReadError::Invalid`]). Text is read up to [`TEXT_LIMIT`], XML with a DTD is refused, and
//! no file named inside another is opened.

mod alos;
mod detect;
mod digital_globe;
mod dimap;
mod draft;
mod envi;
mod error;
mod file;
mod format;
mod gdal_xml;
mod geom;
mod image;
mod json;
mod key_value;
mod names;
mod read;
mod rpb;
mod rpc_file;
mod sidecar;
mod text_file;
mod tiff_tag;
mod write;
mod xml;

pub use error::{Attempt, Fault, ReadOnlyFormat, RpcReadError};
pub use file::TEXT_LIMIT;
pub use format::RpcFormat;
pub use read::{all_of_image, read, read_for_image};
pub use rpc_file::RpcFile;
pub use sidecar::side_files;
pub use write::{to_text, write};
