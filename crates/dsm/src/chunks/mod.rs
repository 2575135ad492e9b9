//! The results of chunks, from their making to the merge.

pub(super) mod chunk;
pub(super) mod chunk_check;
pub(super) mod chunk_files;
pub(super) mod merge;
