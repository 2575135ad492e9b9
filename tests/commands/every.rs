//! What every command does, batches, and the viewer.

mod batch;
mod progress_options;
mod refused_early;
mod remote;
mod selftest;
mod view;
