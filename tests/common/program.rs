//! Running the program in a test.

// Each test file uses its own part of this.
#![allow(dead_code)]

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

/// Runs the program in a directory.
pub fn program(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap()
}

/// As [`program`], with arguments that hold no blanks in one line.
pub fn command(directory: &Path, line: &str) -> Output {
    program(directory, &line.split_whitespace().collect::<Vec<_>>())
}

/// Exit code.
pub fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

/// Standard output.
pub fn out(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

/// Standard error.
pub fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
