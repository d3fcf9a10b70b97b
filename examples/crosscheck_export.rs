//! Writes a small schedule that the exports are proven on: see
//! `tests/crosscheck/export.py`.

use coaxdesign::schedule::sample;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    print!("{}", sample::schedule().to_json()?);
    Ok(())
}
