//! RPC files and the cameras that they describe.

mod command;
mod files;
mod peer_readers;
mod reference;
