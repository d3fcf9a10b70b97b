//! The README's tour, as a newcomer meets it: every command in a `console`
//! block is run, and what it prints is compared with the page.
//!
//! Commands follow `$`; what they print, on standard output and then on
//! standard error, follows them. A line `...` at the end stands for the rest.
//! With the environment variable `UPDATE_README` set, the outputs in the page
//! are replaced instead; a `...` keeps as many lines before it as there were,
//! or the first dozen.

use std::fmt::Write as _;
use std::path::Path;

use assert_cmd::Command;

/// Lines kept before a `...` that stands alone.
const SHOWN: usize = 12;

/// A command with the lines that the page shows of it.
struct Shown {
    command: String,
    lines: Vec<String>,
    /// Whether the page leaves out the end.
    cut: bool,
}

/// Words of a command line; double quotes hold words together.
fn words(command: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    let mut quoted = false;
    for c in command.chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => found.push(String::new()),
            c => found.last_mut().unwrap().push(c),
        }
    }
    found.retain(|word| !word.is_empty());
    found
}

/// What a command prints, without blanks at the ends of lines.
fn printed(command: &str, directory: &Path) -> Vec<String> {
    let words = words(command);
    assert_eq!(words[0], "coaxdesign", "{command}");
    let output = Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
        .current_dir(directory)
        .env_remove("RUST_LOG")
        .args(&words[1..])
        .output()
        .unwrap();
    let code = output.status.code().unwrap();
    let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8_lossy(&output.stderr);
    // Bad input is shown on purpose; a file already there or a panic is not.
    assert!(code <= 2, "{command}: exit code {code}\n{text}");
    text.lines().map(|line| line.trim_end().to_owned()).collect()
}

/// Whether two texts say the same: word by word, where numbers below what
/// rounding leaves count as equal.
fn alike(a: &[String], b: &[String]) -> bool {
    const ROUNDING: f64 = 1e-9;
    let residue = |word: &str| word.parse::<f64>().is_ok_and(|v| v != 0.0 && v.abs() < ROUNDING);
    let same = |(x, y): (&str, &str)| x == y || (residue(x) && residue(y));
    a.len() == b.len()
        && a.iter().zip(b).all(|(x, y)| {
            let (x, y) = (x.split_whitespace(), y.split_whitespace());
            x.clone().count() == y.clone().count() && x.zip(y).all(same)
        })
}

/// A newcomer's clone, but for what a run must not touch.
fn clone_of_the_repository() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["designs", "examples", "problems", "tests"] {
        copy(&root.join(name), &directory.path().join(name));
    }
    directory
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
        }
    }
}

/// The commands of a block and their outputs.
fn commands(block: &[&str]) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    for line in block {
        if let Some(command) = line.strip_prefix("$ ") {
            found.push(Shown { command: command.into(), lines: Vec::new(), cut: false });
            continue;
        }
        let last = found.last_mut().expect("a console block begins with a command");
        assert!(!last.cut, "nothing follows `...` in {}", last.command);
        if *line == "..." {
            last.cut = true;
        } else {
            last.lines.push((*line).to_string());
        }
    }
    found
}

#[test]
fn every_output_in_the_readme_is_real() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let update = std::env::var_os("UPDATE_README").is_some();
    let directory = clone_of_the_repository();
    let (mut renewed, mut block): (String, Option<Vec<&str>>) = (String::new(), None);
    let (mut count, mut wrong) = (0, String::new());
    for line in page.lines() {
        match (&mut block, line) {
            (None, "```console") => block = Some(Vec::new()),
            (Some(lines), "```") => {
                renewed.push_str("```console\n");
                for shown in commands(lines) {
                    count += 1;
                    let real = printed(&shown.command, directory.path());
                    let keep = if !shown.cut {
                        real.len()
                    } else if shown.lines.is_empty() {
                        SHOWN.min(real.len())
                    } else {
                        shown.lines.len().min(real.len())
                    };
                    let _ = writeln!(renewed, "$ {}", shown.command);
                    for line in &real[..keep] {
                        let _ = writeln!(renewed, "{line}");
                    }
                    if shown.cut && keep < real.len() {
                        renewed.push_str("...\n");
                    }
                    if !alike(&shown.lines, &real[..keep]) {
                        let _ = writeln!(
                            wrong,
                            "$ {}\n--- README\n{}\n+++ now\n{}",
                            shown.command,
                            shown.lines.join("\n"),
                            real[..keep].join("\n")
                        );
                    }
                }
                renewed.push_str("```\n");
                block = None;
            }
            (Some(lines), line) => lines.push(line),
            (None, line) => {
                let _ = writeln!(renewed, "{line}");
            }
        }
    }
    assert!(block.is_none(), "a console block is not closed");
    assert!(count >= 8, "only {count} commands");
    if update {
        std::fs::write(&path, renewed).unwrap();
    } else {
        assert!(wrong.is_empty(), "run with UPDATE_README=1 to renew the page\n{wrong}");
    }
}

/// A specification that is tuned in seconds, for the tour below: the README's
/// commands take it from the design.
const SMALL: &str = r#"
[schedule]
speeds = ["0 kt", "20 kt"]
[margins.nominal]
gain_margin_db = 4.0
phase_margin = "30 deg"
[axis.roll]
drb = "0.2 rad/s"
[axis.pitch]
drb = "0.2 rad/s"
[axis.yaw]
drb = "0.2 rad/s"
[axis.heave]
drb = "0.2 rad/s"
"#;

/// Commands of the page that a test does not run: they build or test the
/// program itself, or tune all built-in problems to the built-in specification,
/// which the continuous integration does.
const ELSEWHERE: [&str; 3] = ["cargo ", ".ci/run", "coaxdesign validate"];

/// The commands of the `sh` blocks, in the order of the page, for a user's own
/// aircraft in a fresh directory. Nothing of the built-in aircraft may come in.
#[test]
fn the_tour_works_for_an_aircraft_of_ones_own() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md"));
    let page = page.unwrap();
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    printed("coaxdesign new mine.toml", here);
    std::fs::write(here.join("small.toml"), SMALL).unwrap();
    let mut inside = false;
    let mut ran = Vec::new();
    for line in page.lines() {
        match line {
            "```sh" => inside = true,
            "```" => inside = false,
            line if inside => {
                let command = line.split(" #").next().unwrap().trim();
                if command.is_empty() || ELSEWHERE.iter().any(|start| command.starts_with(start)) {
                    continue;
                }
                // The one change: the first design is tuned to fewer speeds.
                let command = if command.starts_with("coaxdesign design ") {
                    format!("{command} --spec small.toml --speeds 0,20kt")
                } else {
                    command.to_string()
                };
                let told = printed(&command, here).join("\n");
                assert!(!told.contains("error:"), "{command}\n{told}");
                if command.contains("designs/mine") && !command.contains(" export ") {
                    assert!(told.contains("starter"), "{command}\n{told}");
                }
                ran.push((command, told));
            }
            _ => {}
        }
    }
    let told = |start: &str| &ran.iter().find(|(command, _)| command.starts_with(start)).unwrap().1;
    for start in ["linearize", "bode", "design", "tune-gains", "verify", "simulate", "export"] {
        told(&format!("coaxdesign {start}"));
    }
    // What the tuning said of its rows is what the verification says.
    let count = |text: &str| {
        text.lines().find(|line| line.contains("nominal rows met")).map(str::to_owned).unwrap()
    };
    assert_eq!(count(told("coaxdesign tune-gains")), count(told("coaxdesign verify")));
    for file in ["models.mat", "bode.svg", "flight.csv", "flight.svg", "law", "designs/mine"] {
        assert!(here.join(file).exists(), "{file}");
    }
}
