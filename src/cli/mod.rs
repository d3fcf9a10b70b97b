//! The command line.
//!
//! One file a subcommand. A subcommand turns arguments into calls of the
//! library and results into text; it holds no formulas. It gives an
//! [`Outcome`], or a [`CliError`] that knows its exit code.

pub mod args;
mod bode;
mod check;
mod compare;
mod completions;
mod design;
mod designs;
mod error;
mod export;
mod fly;
mod identify;
mod import;
mod linearize;
mod man;
mod models;
mod modes;
mod montecarlo;
mod new;
pub mod output;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "png")]
mod png;
mod quantity;
mod report;
mod rotor;
mod schema;
mod simulate;
pub(crate) mod trim;
mod tune;
mod validate;
mod verify;
mod version;
mod watch;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use error::{CliError, Outcome};

/// Exit codes, for `--help` and the manual page.
const EXIT_CODES: &str = "\
First steps:
  coaxdesign trim                        trim the built-in CoAX 2D from 0 to 90 kt
  coaxdesign new mine.toml               a commented file to start from
  coaxdesign check mine.toml             what was understood of it
  coaxdesign design mine.toml -o DIR     the whole way to a verified, flown gain schedule
  coaxdesign report DIR                  look at it

Environment:
  NO_COLOR   no colours, if set
  RUST_LOG   what is being done, on standard error: error, warn, info, debug, trace

Exit codes:
   0  done
   1  the computation ran but did not reach its goal, for example a trim that did not converge
   2  bad usage or bad input; every error of a problem file is listed
   3  a file could not be read or written
  70  an internal error of the program";

/// From a description of a rotorcraft to a flyable gain schedule
#[derive(Debug, Parser)]
#[command(name = "coaxdesign", version = version::LONG, after_help = EXIT_CODES, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[allow(clippy::large_enum_variant)] // made once, by the parser
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Trim over a range of speeds, and compare with the published hover
    Trim(trim::Trim),
    /// Trim one rotor alone on a stand: hover polars, climb, wind tunnel
    Rotor(rotor::Rotor),
    /// Tune a gain schedule to a specification, and verify it
    TuneGains(tune::Tune),
    /// Verify a gain schedule against a specification
    Verify(verify::Verify),
    /// Write a gain schedule in the form of another program
    Export(export::Export),
    /// Read a gain schedule of another program, or written by hand
    Import(import::Import),
    /// Run the whole pipeline into a directory, changed stages only
    Design(design::Design),
    /// Write a design as one HTML page
    Report(report::Report),
    /// Problem files or designs side by side
    Compare(compare::Compare),
    /// Fly a manoeuvre with the full nonlinear vehicle
    Simulate(simulate::Simulate),
    /// Measure a schedule's margins in simulated flight, by frequency sweeps
    Identify(identify::Identify),
    /// Fly a manoeuvre many times with the aircraft and the air varied
    Montecarlo(montecarlo::MonteCarlo),
    /// Linear models of a trim: periodic, averaged, harmonic, reduced
    Linearize(linearize::Linearize),
    /// Eigenvalues or Floquet exponents of a trim, and what they are
    Modes(modes::Modes),
    /// Frequency responses of a trim
    Bode(bode::Bode),
    /// Compare with every number of the reference paper
    Validate(validate::Validate),
    /// Check a problem file and show what was understood
    Check(check::Check),
    /// Write the JSON Schema of problem files or of results, for editors and other programs
    Schema(schema::Schema),
    /// Write a commented problem file to start from
    New(new::New),
    /// Print completions for a shell
    Completions(completions::Completions),
    /// Print a manual page
    Man(man::Man),
}

impl Command {
    fn run(self) -> Result<Outcome, CliError> {
        match self {
            Command::Trim(command) => command.run(),
            Command::Rotor(command) => command.run(),
            Command::TuneGains(command) => command.run(),
            Command::Verify(command) => command.run(),
            Command::Export(command) => command.run(),
            Command::Import(command) => command.run(),
            Command::Design(command) => command.run(),
            Command::Report(command) => command.run(),
            Command::Compare(command) => command.run(),
            Command::Simulate(command) => command.run(),
            Command::Identify(command) => command.run(),
            Command::Montecarlo(command) => command.run(),
            Command::Linearize(command) => command.run(),
            Command::Modes(command) => command.run(),
            Command::Bode(command) => command.run(),
            Command::Validate(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Schema(command) => command.run(),
            Command::New(command) => command.run(),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(),
        }
    }
}

/// Runs the program with the arguments of the process.
///
/// A panic is a mistake of the program: it ends with exit code 70, so that
/// scripts can tell it from bad input.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    trace();
    let code = match std::panic::catch_unwind(|| cli.command.run()) {
        Ok(Ok(outcome)) => outcome.exit_code(),
        Ok(Err(error)) => {
            error.print();
            error.exit_code()
        }
        Err(_) => {
            output::note("error: this is a mistake of the program; please report it\n");
            error::INTERNAL
        }
    };
    ExitCode::from(code)
}

/// Shows on standard error what `RUST_LOG` asks for, such as `debug` or
/// `coaxdesign::trim=debug`; nothing without it.
fn trace() {
    use tracing_subscriber::filter::Targets;
    use tracing_subscriber::layer::SubscriberExt;
    use tracing_subscriber::util::SubscriberInitExt;
    let Some(asked) = std::env::var_os("RUST_LOG").filter(|value| !value.is_empty()) else {
        return;
    };
    let asked = asked.to_string_lossy();
    let targets = match asked.parse::<Targets>() {
        Ok(targets) => targets,
        Err(error) => {
            output::note(&format!(
                "warning: RUST_LOG={asked:?} is ignored: {error}; write a level such as `debug`, \
                 or `coaxdesign::trim=debug`\n"
            ));
            return;
        }
    };
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(!plain && std::io::IsTerminal::is_terminal(&std::io::stderr()));
    // A second subscriber in one process is refused, and the first stays.
    let _ = tracing_subscriber::registry().with(targets).with(lines).try_init();
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }
}
