//! The `skysweep` command: arguments in, exit code out; all work is in the crates.
fn main() {}
