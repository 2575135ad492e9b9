//! What every command shares: the options that all of them take, and how a command can end.

use clap::ArgAction;

/// Options that every command takes.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct Global {
    /// Read rasters from the web addresses (https://…) that are given as inputs; what a file names
    /// is never fetched.
    #[arg(long, global = true)]
    pub(crate) allow_remote: bool,
    /// Fetch geoid grids that PROJ does not find from <https://cdn.proj.org>, once, into PROJ's
    /// folder of the user.
    #[arg(long, global = true)]
    pub(crate) fetch_grids: bool,
    /// Print errors only.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Print more: -v the stages with their times, -vv also every file that is opened or written.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
}

impl Global {
    /// Whether only errors are to be printed.
    pub(crate) fn is_quiet(self) -> bool {
        self.quiet
    }
}

/// How a command ended that was not stopped by an error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All that was asked for is done.
    Complete,
    /// Parts failed, or a requested threshold was missed. The text says which; it is printed as an
    /// error, so that no run ends with 1 and without a word.
    Partial(String),
}
