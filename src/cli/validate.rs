//! `coaxdesign validate`: every published number beside ours.

mod control;
mod flight;
mod linear;

use clap::Args;

use super::args::OutputArgs;
use super::{CliError, Outcome, output};
use coaxdesign::problem::{self, Problem};
use coaxdesign::report::table::{Cell, Column, Digits, Table};
use coaxdesign::studies::coax2d::PAGE;
use coaxdesign::studies::coax2d::hypotheses::{Figure, STUDIES, Study};
use coaxdesign::validation::{self, Bound, Claim};

/// Compare with every number that the reference paper prints, as Markdown
#[derive(Debug, Args)]
pub struct Validate {
    #[command(flatten)]
    output: OutputArgs,
}

impl Validate {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.output.check()?;
        let text = markdown()?;
        match &self.output.output {
            Some(path) => output::write_whole(path, text.as_bytes(), self.output.force)?,
            None => output::print(&text)?,
        }
        Ok(Outcome::Done)
    }
}

/// The comparison as Markdown.
fn markdown() -> Result<String, CliError> {
    let mut text = String::from(PAGE);
    for study in &STUDIES {
        let place = format!("<!-- study: {} -->", study.name);
        if !text.contains(&place) {
            return Err(fault(format!("the page has no place for the study {:?}", study.name)));
        }
        text = text.replace(&place, study_table(study)?.trim_end());
    }
    text.push('\n');
    for name in ["coax2d-appendix", "coax2d", "coax2d-physics"] {
        let problem = problem::builtin_named(name)?.problem;
        text += &format!("## `{name}`\n\n");
        text += &identity_table(&problem)?;
        text += &flight::hover(&problem)?;
        text += &flight::trends(&problem)?;
        text += &linear::linear_models(&problem)?;
    }
    text += control::CONTROL;
    for name in ["coax2d", "coax2d-physics"] {
        text += &format!("## Closed loop of `{name}`\n\n");
        text += &control::closed_loop(&problem::builtin_named(name)?, name == "coax2d")?;
    }
    Ok(text)
}

/// An error that no user's input explains.
fn fault(error: impl std::fmt::Display) -> CliError {
    CliError::Internal(error.to_string())
}

/// One word for tables.
fn verdict(holds: bool) -> &'static str {
    if holds { "yes" } else { "no" }
}

/// What was tried on numbers that do not fit, print first.
fn study_table(study: &Study) -> Result<String, CliError> {
    let findings = study.run().map_err(fault)?;
    let mut columns = vec![Column::text("problem"), Column::text("what is changed")];
    let digits = |figure: &Figure| match figure {
        Figure::Entry(..) | Figure::HalfSum(_) | Figure::HalfDifference(_) | Figure::Inflow(_) => {
            Digits::Decimals(4)
        }
        Figure::Thrust(_) | Figure::Power(_) => Digits::Decimals(1),
        Figure::PitchAttitude => Digits::Decimals(2),
    };
    columns.extend(study.figures.iter().map(|f| Column::number(&f.label(), "", digits(f))));
    columns.push(Column::text("entries within 10 %"));
    let mut table = Table::new("", columns);
    let row = |name: &str, change: &str, values: &[f64], agreeing: String| {
        let numbers = values.iter().map(|value| Cell::from(*value));
        let mut cells = vec![Cell::from(name), Cell::from(change)];
        cells.extend(numbers);
        cells.push(Cell::from(agreeing));
        cells
    };
    table.row(row("print", "", &findings.printed, String::new()));
    for trial in &findings.trials {
        let (met, all) = trial.agreeing;
        let name = format!("`{}`", trial.name);
        table.row(row(&name, &trial.change, &trial.values, format!("{met} of {all}")));
    }
    Ok(table.to_markdown())
}

/// What must hold whatever the paper prints.
fn identity_table(problem: &Problem) -> Result<String, CliError> {
    let list =
        validation::identities(problem).map_err(|error| CliError::Internal(error.to_string()))?;
    let mut table = Table::new(
        "",
        vec![
            Column::text("stage"),
            Column::text("identity"),
            Column::text("where"),
            Column::text("measure"),
            Column::number("error", "", Digits::Significant(2)),
            Column::number("tolerance", "", Digits::Significant(2)),
            Column::text("holds"),
        ],
    );
    for identity in &list {
        table.row([
            Cell::from(identity.stage),
            Cell::from(identity.statement),
            Cell::from(identity.case.as_str()),
            Cell::from(identity.measure),
            Cell::from(identity.error),
            Cell::from(identity.tolerance),
            Cell::from(verdict(identity.holds())),
        ]);
    }
    Ok(format!("### Identities\n\n{}\n", table.to_markdown()))
}

/// Claims with our figures.
fn claim_table(list: &[Claim]) -> String {
    let mut table = Table::new(
        "",
        vec![
            Column::text("from"),
            Column::text("claim"),
            Column::number("ours", "", Digits::Significant(3)),
            Column::text("unit"),
            Column::text("bound"),
            Column::number("at", "", Digits::Significant(3)),
            Column::text("holds"),
        ],
    );
    for claim in list {
        let (words, bound) = match claim.bound {
            Bound::AtMost(bound) => ("at most", bound),
            Bound::AtLeast(bound) => ("at least", bound),
            Bound::Exactly(bound) => ("just", bound),
        };
        table.row([
            Cell::from(claim.source),
            Cell::from(claim.text.as_str()),
            if claim.ours.is_nan() { Cell::from("none") } else { Cell::from(claim.ours) },
            Cell::from(claim.unit),
            Cell::from(words),
            Cell::from(bound),
            Cell::from(verdict(claim.holds())),
        ]);
    }
    table.to_markdown()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_has_a_place_for_every_study_and_for_nothing_else() {
        for study in &STUDIES {
            let place = format!("<!-- study: {} -->", study.name);
            assert_eq!(PAGE.matches(&place).count(), 1, "{}", study.name);
        }
        assert_eq!(PAGE.matches("<!--").count(), STUDIES.len());
    }
}
