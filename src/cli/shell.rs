//! What a shell and `man` are told of the command line.

use std::io::{Write, stdout};

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

/// Print the manual page, for `man -l -`
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  drape man > ~/.local/share/man/man1/drape.1")]
pub struct ManArgs {}

/// Runs `drape completions`.
pub fn complete(args: &CompletionsArgs, mut command: Command) -> Result<(), Failure> {
    let mut text = Vec::new();
    generate(args.shell, &mut command, "drape", &mut text);
    Ok(stdout().write_all(&text)?)
}

/// Runs `drape man`: the page of the program with the options of all commands.
pub fn manual(mut command: Command) -> Result<(), Failure> {
    command.build();
    let mut text = Vec::new();
    Man::new(command.clone()).render(&mut text)?;
    for one in command.get_subcommands() {
        writeln!(text, ".SH DRAPE {}", one.get_name().to_uppercase())?;
        let one = Man::new(one.clone());
        one.render_description_section(&mut text)?;
        one.render_options_section(&mut text)?;
    }
    Ok(stdout().write_all(&text)?)
}
