//! The problem files of the repository, the reference page, and every way a
//! file can be wrong.

use std::path::{Path, PathBuf};

use coaxdesign::problem;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Whether expected outputs are written rather than compared.
fn blessing() -> bool {
    std::env::var_os("COAXDESIGN_BLESS").is_some()
}

/// Compares a text with a file of the repository, or writes the file.
fn assert_file(path: &Path, text: &str) {
    if blessing() {
        std::fs::write(path, text).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        expected == text,
        "{} does not hold what the program writes; if the change is meant, run with \
         COAXDESIGN_BLESS=1\n--- file\n{expected}\n--- program\n{text}",
        path.display()
    );
}

#[test]
fn reference_page_is_that_of_the_format() {
    assert_file(
        &root().join("docs/problem-format.md"),
        &problem::page::markdown(),
    );
}
#[test]
fn tmp_builtin() {
    for n in problem::BUILTIN {
        match problem::builtin_named(n) {
            Err(r) => println!("{r}"),
            Ok(l) => {
                for w in &l.warnings {
                    println!("{}", w.render(false));
                }
                println!("{:?}", l.problem.controls)
            }
        }
    }
}
