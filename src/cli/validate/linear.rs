//! Linear models beside print: the Appendix entry by entry, eigenvalues, and
//! what Figs. 15 and 16 say in words.

use num_complex::Complex64;

use super::{claim_table, fault, verdict};
use crate::cli::CliError;
use coaxdesign::linear::StateSpace;
use coaxdesign::linear::modes::{ModeName, modes};
use coaxdesign::problem::Problem;
use coaxdesign::report::table::{Cell, Column, Digits, Table};
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::studies::coax2d::claims;
use coaxdesign::studies::coax2d::eigenvalues::pair_eigenvalues;
use coaxdesign::studies::coax2d::entries::{
    SMALL_DIFFERENCE, SMALLEST, agrees, is_near, judged_entries,
};
use coaxdesign::validation::LevelFlight;

/// Everything of a problem's linear models.
pub(super) fn linear_models(problem: &Problem) -> Result<String, CliError> {
    let mut text = String::new();
    for (condition, speed) in
        [(Condition::Hover, 0.0), (Condition::Forward, 70.0), (Condition::Forward, 80.0)]
    {
        let on = LevelFlight::of(problem, speed, true).map_err(fault)?;
        text += &entries(&on.reduced, condition, speed)?;
        if speed != 80.0 {
            let off = LevelFlight::of(problem, speed, false).map_err(fault)?;
            text += &eigenvalues(&on.reduced, &off.reduced, condition, speed)?;
            if speed == 0.0 {
                text += &responses(&on.averaged, &off.averaged)?;
            }
        }
    }
    Ok(text)
}

/// What is known of an entry that misses print: see the introduction.
fn known_misfit(condition: Condition, row: &str, column: &str) -> &'static str {
    match (condition, row, column) {
        (Condition::Hover, "u" | "v", "p" | "q") => "rate derivatives: partly explained",
        (Condition::Hover, "p" | "q", "p" | "q") => "follows the rate derivatives of u and v",
        (Condition::Hover, "r", "r" | "lat" | "ped") => "inertia of the blades in yaw",
        (Condition::Hover, "v" | "p", "r") => "teeter equation for small angles",
        (Condition::Hover, "w", "w" | "p" | "q" | "r") => "small difference of two rotors",
        (Condition::Forward, "u" | "q", "w" | "lon" | "col" | "ped") => {
            "thrust line, wash at the tail"
        }
        (Condition::Forward, "w", "u") => "thrust line, wash at the tail",
        (Condition::Forward, "r", "p" | "r" | "ped") => "inertia of the blades in yaw, in part",
        _ => "unexplained",
    }
}

fn entries(model: &StateSpace, condition: Condition, speed: f64) -> Result<String, CliError> {
    let judged = judged_entries(model, condition).map_err(fault)?;
    let mut table = Table::new(
        "",
        vec![
            Column::text("entry"),
            Column::number("paper", "", Digits::Decimals(4)),
            Column::number("ours", "", Digits::Decimals(4)),
            Column::number("ratio", "", Digits::Decimals(2)),
            Column::text("within 10 %"),
        ],
    );
    for entry in &judged.large {
        table.row([
            Cell::from(format!("({}, {})", entry.row, entry.column)),
            Cell::from(entry.printed),
            Cell::from(entry.computed),
            Cell::from(entry.ratio()),
            Cell::from(if agrees(entry) {
                "yes".to_owned()
            } else {
                format!("no: {}", known_misfit(condition, &entry.row, &entry.column))
            }),
        ]);
    }
    let mut rest = Table::new(
        "",
        vec![
            Column::text("entry"),
            Column::number("paper", "", Digits::Decimals(4)),
            Column::number("ours", "", Digits::Decimals(4)),
            Column::number("difference", "", Digits::Decimals(4)),
            Column::text(&format!("within {SMALL_DIFFERENCE}")),
        ],
    );
    for entry in &judged.small {
        rest.row([
            Cell::from(format!("({}, {})", entry.row, entry.column)),
            Cell::from(entry.printed),
            Cell::from(entry.computed),
            Cell::from(entry.computed - entry.printed),
            Cell::from(verdict(is_near(entry))),
        ]);
    }
    Ok(format!(
        "### Appendix \"{:.0} kt\" beside ours at {speed:.0} kt\n\nUnits ft, s, rad, percent \
         stick; entries above {SMALLEST} in print, {} of {} within 10 %.\n\n{}\nThe rest, where \
         print is not zero:\n\n{}\n",
        condition.printed_speed_kt(),
        judged.large.iter().filter(|entry| agrees(entry)).count(),
        judged.large.len(),
        table.to_markdown(),
        rest.to_markdown()
    ))
}

/// An eigenvalue, the lower half of a conjugate pair with it.
fn eigenvalue(value: Complex64) -> String {
    if value.im == 0.0 {
        format!("{:.3}", value.re)
    } else {
        format!("{:.3} ± {:.3}i", value.re, value.im.abs())
    }
}

fn label(name: Option<ModeName>) -> &'static str {
    name.map_or("", ModeName::label)
}

/// Damping ratio.
fn damping(value: Complex64) -> f64 {
    -value.re / value.norm()
}

fn eigenvalues(
    on: &StateSpace,
    off: &StateSpace,
    condition: Condition,
    speed: f64,
) -> Result<String, CliError> {
    let paper = appendix(condition).map_err(fault)?;
    let (two, three) = (Digits::Decimals(2), Digits::Decimals(3));
    let mut table = Table::new(
        "",
        vec![
            Column::text("mode in print"),
            Column::text("mode of ours"),
            Column::text("paper"),
            Column::text("ours"),
            Column::number("ω paper", "rad/s", three),
            Column::number("ω ours", "rad/s", three),
            Column::number("ζ paper", "", two),
            Column::number("ζ ours", "", two),
            Column::number("distance", "%", Digits::Decimals(0)),
            Column::number("tolerance", "%", Digits::Decimals(0)),
            Column::text("within"),
        ],
    );
    let pairs = pair_eigenvalues(&paper, on).map_err(fault)?;
    for pair in &pairs {
        let same = pair.printed_name == pair.our_name;
        table.row([
            Cell::from(label(pair.printed_name)),
            Cell::from(if same { "the same" } else { label(pair.our_name) }),
            Cell::from(eigenvalue(pair.printed)),
            Cell::from(eigenvalue(pair.ours)),
            Cell::from(pair.printed.norm()),
            Cell::from(pair.ours.norm()),
            Cell::from(damping(pair.printed)),
            Cell::from(damping(pair.ours)),
            Cell::from(100.0 * pair.distance),
            Cell::from(100.0 * pair.tolerance()),
            Cell::from(verdict(pair.agrees())),
        ]);
    }
    let mut alone = Table::new(
        "",
        vec![
            Column::text("mode of ours"),
            Column::text("without interactions"),
            Column::number("ω", "rad/s", three),
            Column::number("ζ", "", two),
        ],
    );
    let mut list = modes(off).map_err(fault)?;
    list.sort_by(|a, b| a.eigenvalue.re.total_cmp(&b.eigenvalue.re));
    for mode in &list {
        alone.row([
            Cell::from(label(mode.name)),
            Cell::from(eigenvalue(mode.eigenvalue)),
            Cell::from(mode.natural_frequency()),
            Cell::from(damping(mode.eigenvalue)),
        ]);
    }
    let words = if condition == Condition::Hover {
        let claims = claims::eigenvalue_claims(on, off).map_err(fault)?;
        format!("\nWhat the paper says of them in words:\n\n{}", claim_table(&claims))
    } else {
        String::new()
    };
    Ok(format!(
        "### Eigenvalues at {speed:.0} kt\n\nOf the printed matrix and of ours with interactions, \
         rad/s, paired one to one so that the distances |ours − paper|/|paper| sum to the least. \
         The tolerance is 10 % and what half a unit of the last printed decimal in every entry \
         may move the eigenvalue by.\n\n{}\nPrint has no matrices without interactions. \
         Ours:\n\n{}{words}\n",
        table.to_markdown(),
        alone.to_markdown(),
    ))
}

fn responses(on: &StateSpace, off: &StateSpace) -> Result<String, CliError> {
    let changes = claims::response_changes(on, off).map_err(fault)?;
    let one = Digits::Decimals(1);
    let mut table = Table::new(
        "",
        vec![
            Column::text("axis"),
            Column::text("response"),
            Column::number("gain on over off, least", "dB", one),
            Column::number("mean", "dB", one),
            Column::number("largest", "dB", one),
            Column::number("phase on less off, mean", "deg", one),
        ],
    );
    for change in &changes {
        let [least, mean, most] = change.gain_db;
        table.row([
            Cell::from(change.axis),
            Cell::from(format!("{} to {}", change.channel[0], change.channel[1])),
            Cell::from(least),
            Cell::from(mean),
            Cell::from(most),
            Cell::from(change.phase_deg),
        ]);
    }
    Ok(format!(
        "### On-axis responses in hover, 0.5 to 10 rad/s\n\nOf the averaged models of full \
         order, means over log frequency.\n\n{}\nWhat the paper says of Fig. 16 in \
         words:\n\n{}\n",
        table.to_markdown(),
        claim_table(&claims::response_claims(&changes))
    ))
}
