//! Completion scripts and manual pages, made from the definition of the command line.

use anyhow::bail;
use clap::Command;
use clap_complete::Shell;
use numeric::nearest_name;

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
    /// Command to describe, such as `dsm`, `splats render` or `splats-render` [default: skysweep
    /// itself].
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

/// Returns the command of a name below another one: `render`, or as the pages are called in their
/// titles and references, `splats-render` and `skysweep-splats-render`.
fn below(command: &Command, name: &str) -> anyhow::Result<Command> {
    if let Some(found) = command.find_subcommand(name) {
        return Ok(found.clone());
    }
    let own = name.strip_prefix(command.get_name()).and_then(|rest| rest.strip_prefix('-'));
    if let Some(rest) = own {
        return below(command, rest);
    }
    let joined = command.get_subcommands().find_map(|found| {
        let rest = name.strip_prefix(found.get_name())?.strip_prefix('-')?;
        found.has_subcommands().then_some((found, rest))
    });
    if let Some((found, rest)) = joined {
        return below(found, rest);
    }
    let known = || command.get_subcommands().map(Command::get_name);
    let meant = nearest_name(name, known()).map(|meant| format!("did you mean '{meant}'? ")).unwrap_or_default();
    let known = known().collect::<Vec<_>>().join(", ");
    bail!("'{}' has no command '{name}': {meant}expected one of {known}", command.get_name())
}
