//! Completion scripts and manual pages, made from the definition of the command line.

use anyhow::Context;
use clap::Command;
use clap_complete::Shell;

use crate::global::Outcome;
use crate::print;

/// Arguments of `skysweep completions`.
#[derive(Debug, clap::Args)]
pub(crate) struct CompletionArgs {
    /// Shell that will read the script.
    shell: Shell,
}

/// Arguments of `skysweep man`.
#[derive(Debug, clap::Args)]
pub(crate) struct ManArgs {
    /// Command to describe, such as `dsm` or `splats render` [default: skysweep itself].
    command: Vec<String>,
}

/// Prints a completion script.
pub(crate) fn completions(args: &CompletionArgs, command: &mut Command) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, command, "skysweep", &mut script);
    print::bytes(&script)?;
    Ok(Outcome::Complete)
}

/// Prints a manual page in roff.
pub(crate) fn man(args: &ManArgs, mut root: Command) -> anyhow::Result<Outcome> {
    root.build();
    let page = args.command.iter().try_fold(root, |command, name| below(&command, name))?;
    let mut roff = Vec::new();
    clap_mangen::Man::new(page).render(&mut roff)?;
    print::bytes(&roff)?;
    Ok(Outcome::Complete)
}

fn below(command: &Command, name: &str) -> anyhow::Result<Command> {
    let known = || command.get_subcommands().map(Command::get_name).collect::<Vec<_>>().join(", ");
    let found = command.find_subcommand(name).cloned();
    found.with_context(|| format!("'{}' has no command '{name}': expected one of {}", command.get_name(), known()))
}
