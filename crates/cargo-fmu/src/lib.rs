//! `cargo fmu`: exports the models of a workspace, and inspects FMUs from any tool.
//!
//! # As a library
//!
//! The commands of `cargo fmu`, which other commands may offer as well. Each is a type whose fields clap fills from the
//! command line. Those that run FMUs are in the crate `fmu-run`.

mod a2l;
mod compile;
mod compile_sources;
mod export;
mod generation;
mod info;
mod licenses;
mod merge;
mod metadata;
mod new;
mod parameter_binding;
mod parameters;
mod sources;
mod target;
mod validate;

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use clap_complete::Shell;
use fmu_io::exit::exit_with;
use fmu_io::terminal;
use fmu_io::terminal::{CARGO_FMU, program};

pub use a2l::A2l;
pub use compile_sources::Compile;
pub use export::{Export, Plan, say, trial};
pub use info::Info;
pub use merge::Merge;
pub use new::New;
pub use parameters::Parameters;
pub use validate::Validate;

/// Exit statuses, for the help.
const EXIT_STATUSES: &str = "\
Exit status:
  0    success; `validate`: no errors; `sweep`: no failed runs
  1    `validate`: errors found; `sweep`: runs failed
  2    failure or wrong command line; see standard error
  130  interrupted

Examples:
  cargo fmu new decay                 # a package with a model
  cargo fmu export                    # its FMU, in target/fmu
  cargo fmu export --target win64     # the same for Windows
  cargo fmu validate target/fmu/decay.fmu";

/// Creates, exports, inspects, validates and merges Functional Mock-up Units (FMI).
#[derive(Parser)]
#[command(name = "cargo-fmu", bin_name = "cargo fmu", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    #[command(after_help = "\
Examples:
  cargo fmu new decay
  cargo fmu new ball --template bouncing_ball
  cargo fmu new pi-controller --template sampled --vcs none")]
    New(New),
    /// Compile the models of this workspace and write their .fmu files
    #[command(after_help = "\
Examples:
  cargo fmu export                                      # all models, for this platform, into target/fmu
  cargo fmu export -p decay --target linux64 --target win64
  cargo fmu export --interfaces cs,me                   # for co-simulation and Model Exchange
  cargo fmu export --fmi 2,3                            # for FMI 2.0, and for FMI 3.0 in the folder fmi3
  cargo fmu export --target linux64 --binary darwin64=libdecay.dylib
  cargo fmu export --parameters slow.ssv                # with decay.ssp, which binds the set
  cargo fmu export --sources                            # with the models as C
  cargo fmu export --wasm                               # WebAssembly modules instead of FMUs")]
    Export {
        #[command(flatten)]
        export: Export,
        /// Parameter sets; each is bound to the FMU with its parameters, in a package MODEL.ssp
        #[arg(long, value_name = "FILE.ssv", conflicts_with = "wasm")]
        parameters: Vec<PathBuf>,
    },
    #[command(after_help = "\
Examples:
  cargo fmu compile decay.fmu                           # writes decay.linux64.fmu, on x86-64 Linux
  CC=clang cargo fmu compile decay.fmu --out own.fmu")]
    Compile(Compile),
    #[command(after_help = "\
Example:
  cargo fmu merge linux/decay.fmu windows/decay.fmu --out decay.fmu --ran win64='Windows 11, FMPy'")]
    Merge(Merge),
    #[command(after_help = "\
Example:
  cargo fmu info target/fmu/decay.fmu")]
    Info(Info),
    #[command(after_help = "\
Examples:
  cargo fmu validate target/fmu/decay.fmu
  cargo fmu validate target/fmu/decay.fmu --format json
  cargo fmu validate target/fmu/decay.fmu --importer CasADi --importer PyFMI
  cargo fmu validate --rules                            # the table of all rules")]
    Validate(Validate),
    #[command(after_help = "\
Example:
  cargo fmu parameters target/fmu/decay.fmu --out slow.ssv")]
    Parameters(Parameters),
    #[command(after_help = "\
Example:
  cargo fmu a2l target/thumbv7em-none-eabihf/release/ecu --out ecu.a2l")]
    A2l(A2l),
    #[cfg(feature = "simulate")]
    #[command(flatten)]
    Run(fmu_run::Command),
    /// Print shell completions
    #[command(after_help = "\
Example:
  cargo fmu completions bash > ~/.local/share/bash-completion/completions/cargo-fmu")]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Write the manual pages
    #[command(after_help = "\
Example:
  cargo fmu man ~/.local/share/man/man1")]
    Man {
        /// The folder to write to
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
}

/// The command line, in the words with which it is called.
fn command_line() -> clap::Command {
    fn renamed(command: clap::Command, program: &'static str) -> clap::Command {
        let examples = command.get_after_help().map(|help| help.to_string().replace(CARGO_FMU, program));
        let command = if let Some(examples) = examples { command.after_help(examples) } else { command };
        command.mut_subcommands(|command| renamed(command, program))
    }
    let command = Arguments::command();
    match program() {
        CARGO_FMU => command,
        program => renamed(command, program).name(program).bin_name(program),
    }
}

/// Runs `cargo fmu`, or `fmu`, with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    #[cfg(feature = "simulate")]
    fmu_run::fail_when_an_fmu_exits();
    exit_with(|| {
        // Cargo passes the word `fmu` as the first argument.
        let is_of_cargo =
            |index: usize, word: &OsString| index == 1 && word == "fmu" && program() == CARGO_FMU;
        let arguments = env::args_os().enumerate().filter(|(index, word)| !is_of_cargo(*index, word));
        let arguments: Vec<_> = arguments.map(|(_, word)| word).collect();
        #[cfg(feature = "simulate")]
        let (is_worker, arguments) = fmu_run::workers::told_to_work(arguments);
        let matches = command_line().get_matches_from(&arguments);
        let command = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()).command;
        match command {
            Command::New(new) => new.run(),
            Command::Export { export, parameters } => parameter_binding::export(&export.plan()?, &parameters),
            Command::Compile(compile) => compile.run(),
            Command::Merge(merge) => merge.run(),
            Command::Info(info) => info.run(),
            Command::Validate(validate) => return validate.run(),
            Command::Parameters(parameters) => parameters.run(),
            Command::A2l(a2l) => a2l.run(),
            #[cfg(feature = "simulate")]
            Command::Run(command) => return command.run(is_worker, &arguments, &trial),
            Command::Completions { shell } => {
                let mut command = command_line();
                // Shells complete the program that cargo runs.
                let name = command.get_name().to_owned();
                let mut script = vec![];
                clap_complete::generate(shell, &mut command, name, &mut script);
                String::from_utf8(script).map_err(Into::into).and_then(|script| Ok(terminal::print(&script)?))
            }
            Command::Man { folder } => clap_mangen::generate_to(command_line(), &folder)
                .with_context(|| format!("cannot write to the folder {}", folder.display())),
        }
        .map(|()| true)
    })
}
