//! What a shell and `man` are told of the command line.

use std::io::{Write, stdout};

use anyhow::{Context as _, anyhow};
use clap::Command;
use clap_complete::{Shell, generate};
use clap_mangen::Man;

use super::Failure;

/// Print the completions of a shell
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  drape completions bash > ~/.local/share/bash-completion/completions/drape")]
pub struct CompletionsArgs {
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Print the manual page of the program or of a command
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape man > ~/.local/share/man/man1/drape.1
  drape man study judge | man -l -")]
pub struct ManArgs {
    #[arg(value_name = "COMMAND")]
    command: Vec<String>,
}

/// Runs `drape completions`.
pub fn complete(args: &CompletionsArgs, mut command: Command) -> Result<(), Failure> {
    let mut text = Vec::new();
    generate(args.shell, &mut command, "drape", &mut text);
    write(&text)
}

/// Runs `drape man`.
pub fn manual(args: &ManArgs, mut command: Command) -> Result<(), Failure> {
    command.build();
    for name in &args.command {
        let found = command.find_subcommand(name).cloned();
        command = found.ok_or_else(|| {
            let of = command.get_name();
            Failure::invalid(anyhow!("{of} has no command `{name}`, see {of} --help"))
        })?;
    }
    let mut text = Vec::new();
    Man::new(command).render(&mut text)?;
    write(&text)
}

fn write(text: &[u8]) -> Result<(), Failure> {
    let written = stdout().write_all(text);
    Ok(written.context("cannot write to standard output")?)
}
