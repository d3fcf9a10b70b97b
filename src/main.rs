//! The `coaxdesign` program. Everything is in the library, see
//! [`coaxdesign::cli`].

fn main() -> std::process::ExitCode {
    coaxdesign::cli::main()
}
