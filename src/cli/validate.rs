//! `coaxdesign validate`: every published number beside ours.

use clap::Args;

use super::args::OutputArgs;
use super::trim::trim_all;
use super::tune::{tune, verify_error};
use super::{CliError, Outcome, output};
use crate::control::plant::ModelClass;
use crate::control::verify::{Row, verify};
use crate::linear::linearize::{Options, averaged};
use crate::linear::modes::modes;
use crate::linear::reduction::residualise;
use crate::linear::reference::{Condition, appendix, compare_with_appendix};
use crate::linear::{LinearError, StateSpace};
use crate::problem::{self, Problem};
use crate::report::table::{Cell, Column, Digits, Table};
use crate::trim::reference::{HOVER_OFF, HOVER_ON};
use crate::trim::{FlightCondition, TrimPoint};
use crate::units::{HORSEPOWER, KNOT, POUND_FORCE};
use crate::vehicle::Vehicle;

/// States kept by the published models.
pub(super) const RIGID_BODY: [&str; 8] = ["u", "v", "w", "p", "q", "r", "phi", "theta"];
/// Printed entries of A and B below this, in the printed units, are rounding.
const SMALLEST_ENTRY: f64 = 0.01;

/// What the numbers mean, and what was tried on those that do not fit.
const INTRODUCTION: &str = include_str!("validate.md");

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
    let mut text = String::from(INTRODUCTION);
    for name in ["coax2d-appendix", "coax2d", "coax2d-physics"] {
        let problem = problem::builtin_named(name)?.problem;
        text += &format!("## `{name}`\n\n");
        text += &hover(&problem)?;
        text += &trends(&problem)?;
        for (condition, speed) in
            [(Condition::Hover, 0.0), (Condition::Forward, 70.0), (Condition::Forward, 80.0)]
        {
            let model = reduced(&problem, speed, true)?;
            text += &entries(&model, condition, speed)?;
            if speed != 80.0 {
                text += &eigenvalues(&problem, &model, condition, speed)?;
            }
        }
    }
    text += CONTROL;
    for name in ["coax2d", "coax2d-physics"] {
        text += &format!("## Closed loop of `{name}`\n\n");
        text += &closed_loop(&problem::builtin_named(name)?.problem)?;
    }
    Ok(text)
}

/// What the paper says of its control law, and what is compared.
const CONTROL: &str = "\
## Control law

The paper prints neither gains nor margins. It says that a dynamic inversion of the residualised models from hover to
90 kt tracks attitudes, rates and velocities with little coupling, that feedback gains may have to be scheduled where
disturbance rejection bandwidth and crossover are to be the same at all speeds, and it flies one manoeuvre. What follows
is such a schedule: `coaxdesign tune-gains` with the built-in targets, the built-in hardware and its five models
(`problems/hq.toml`), verified on the full-order averaged models at 0 to 90 kt by 5 kt. Ranges are over speed, of the
nominal model; the last column is the least design margin of all models (0 %: on the bound). Two things differ from the
paper's law on purpose: velocity terms are inverted in part, and feedback has an allocation of its own
(`docs/decisions/feedback-allocation.md`).

";

/// A tuning with the built-in specification: ranges of the metrics by axis.
fn closed_loop(problem: &Problem) -> Result<String, CliError> {
    let spec = crate::control::spec::builtin()?;
    let tuned = tune(problem, &spec, &[], true)?;
    let verification = verify(&tuned.design.table, &tuned.built.set, &spec.hardware, &spec)
        .map_err(|error| verify_error(&error))?;
    let column = |name: &str, unit: &str, digits| {
        [format!("{name} from"), "to".into()].map(|n| Column::number(&n, unit, digits))
    };
    let (two, one) = (Digits::Decimals(2), Digits::Decimals(1));
    let mut columns = vec![Column::text("axis")];
    columns.extend(column("DRB", "rad/s", two));
    columns.extend(column("DRP", "dB", two));
    columns.extend(column("crossover", "rad/s", two));
    columns.extend(column("GM", "dB", one));
    columns.extend(column("PM", "deg", one));
    columns.push(Column::number("least design margin", "%", Digits::Decimals(0)));
    let mut table = Table::new("", columns);
    let nominal = &tuned.built.set.models[0].name;
    for requirement in &spec.channels {
        let name = requirement.channel.name();
        let of_axis: Vec<&Row> = verification.rows.iter().filter(|r| r.axis == name).collect();
        let range = |value: &dyn Fn(&Row) -> Option<f64>| -> [Option<f64>; 2] {
            let list: Vec<f64> =
                of_axis.iter().filter(|r| r.model == *nominal).filter_map(|r| value(r)).collect();
            [list.iter().copied().reduce(f64::min), list.iter().copied().reduce(f64::max)]
        };
        let gain_margin =
            |r: &Row| [r.gm_up_db, r.gm_down_db].into_iter().flatten().reduce(f64::min);
        let mut cells = vec![Cell::from(name)];
        for ends in [
            range(&|r| r.drb_rad_s),
            range(&|r| Some(r.drp_db)),
            range(&|r| r.crossover_rad_s),
            range(&gain_margin),
            range(&|r| r.pm_deg),
        ] {
            cells.extend(ends.map(Cell::from));
        }
        let least = of_axis.iter().filter_map(|r| r.design_margin_percent).reduce(f64::min);
        cells.push(least.into());
        table.row(cells);
    }
    let met = |class: ModelClass| {
        let rows = verification.rows.iter().filter(|r| r.class == class);
        (rows.clone().filter(|r| r.passed).count(), rows.count())
    };
    let ((a, b), (c, d)) = (met(ModelClass::Nominal), met(ModelClass::OffNominal));
    let stable = verification.stability.iter().filter(|s| s.passed).count();
    Ok(format!(
        "{}\n{a} of {b} nominal and {c} of {d} off-nominal rows meet their targets; {stable} of {} closed loops are \
         shown stable.\n\n",
        table.to_markdown(),
        verification.stability.len()
    ))
}

/// Averaged, residualised model of the rigid-body states at a speed.
fn reduced(problem: &Problem, speed_kt: f64, on: bool) -> Result<StateSpace, CliError> {
    let mut problem = problem.clone();
    problem.inflow.interactions = on;
    let vehicle = Vehicle::new(&problem)?;
    let conditions = if speed_kt > 0.0 {
        vec![FlightCondition::level(0.5 * speed_kt * KNOT), FlightCondition::level(speed_kt * KNOT)]
    } else {
        vec![FlightCondition::level(0.0)]
    };
    let sweep = crate::trim::sweep(&vehicle, &conditions, &crate::trim::Options::default(), |_| {});
    let last = sweep.points.into_iter().next_back();
    let trim = last
        .and_then(|point| point.into_converged().ok())
        .ok_or_else(|| CliError::Internal(format!("no trim at {speed_kt} kt")))?;
    let fault = |error: LinearError| CliError::Internal(error.to_string());
    let full = averaged(&vehicle, &trim, &Options::default()).map_err(fault)?;
    Ok(residualise(&full, &RIGID_BODY).map_err(fault)?.model)
}

fn hover(problem: &Problem) -> Result<String, CliError> {
    let sweeps = trim_all(problem, &[FlightCondition::level(0.0)], &[true, false], true)?;
    let mut table = Table::new(
        "",
        vec![
            Column::text("interactions"),
            Column::text("rotor"),
            Column::text("quantity"),
            Column::number("paper", "", Digits::Significant(4)),
            Column::number("ours", "", Digits::Significant(4)),
            Column::number("ratio", "", Digits::Decimals(3)),
        ],
    );
    for point in sweeps.iter().flatten() {
        let reference = if point.interactions { HOVER_ON } else { HOVER_OFF };
        for ((rotor, mean), theirs) in problem.rotors.iter().zip(&point.rotors).zip(&reference) {
            for (quantity, printed, ours) in [
                ("T, lbf", theirs.thrust / POUND_FORCE, mean.thrust / POUND_FORCE),
                ("P, hp", theirs.power / HORSEPOWER, mean.power / HORSEPOWER),
                ("λ0", theirs.inflow, mean.inflow[0]),
                ("λs0", theirs.self_inflow, mean.self_inflow[0]),
                ("C_T", theirs.thrust_coefficient, mean.thrust_coefficient),
                ("C_P", theirs.power_coefficient, mean.power_coefficient),
            ] {
                table.row([
                    Cell::from(if point.interactions { "on" } else { "off" }),
                    Cell::from(rotor.name.as_str()),
                    Cell::from(quantity),
                    Cell::from(printed),
                    Cell::from(ours),
                    Cell::from(ours / printed),
                ]);
            }
        }
    }
    Ok(format!("### Hover, Table 2\n\n{}\n", table.to_markdown()))
}

/// Trim over speed: what the figures of the paper say in words.
fn trends(problem: &Problem) -> Result<String, CliError> {
    let conditions: Vec<FlightCondition> =
        (0..19).map(|k| FlightCondition::level(5.0 * f64::from(k) * KNOT)).collect();
    let sweeps = trim_all(problem, &conditions, &[true, false], true)?;
    let mut table = Table::new(
        "",
        vec![
            Column::number("speed", "kt", Digits::Decimals(0)),
            Column::number("roll on", "deg", Digits::Decimals(3)),
            Column::number("roll off", "deg", Digits::Decimals(3)),
            Column::number("pitch on", "deg", Digits::Decimals(2)),
            Column::number("pitch off", "deg", Digits::Decimals(2)),
            Column::number("collective on/off", "", Digits::Decimals(3)),
            Column::number("pedal on", "%", Digits::Decimals(2)),
            Column::number("pedal off", "%", Digits::Decimals(2)),
            Column::number("power on/off", "", Digits::Decimals(3)),
            Column::number("energy imbalance on", "", Digits::Significant(2)),
            Column::text("status"),
        ],
    );
    let degrees = |point: &TrimPoint, k: usize| point.mean_state[k].to_degrees();
    for (on, off) in sweeps[0].iter().zip(&sweeps[1]) {
        table.row([
            Cell::from(on.condition.airspeed / KNOT),
            Cell::from(degrees(on, 6)),
            Cell::from(degrees(off, 6)),
            Cell::from(degrees(on, 7)),
            Cell::from(degrees(off, 7)),
            Cell::from(on.sticks[2] / off.sticks[2]),
            Cell::from(on.sticks[3]),
            Cell::from(off.sticks[3]),
            Cell::from(on.power.shaft / off.power.shaft),
            Cell::from(on.power.imbalance()),
            Cell::from(format!("{}, {}", on.status.word(), off.status.word())),
        ]);
    }
    Ok(format!("### Trim over speed\n\n{}\n", table.to_markdown()))
}

fn entries(model: &StateSpace, condition: Condition, speed: f64) -> Result<String, CliError> {
    let entries = compare_with_appendix(model, condition, SMALLEST_ENTRY)
        .map_err(|error| CliError::Internal(error.to_string()))?;
    let mut table = Table::new(
        "",
        vec![
            Column::text("entry"),
            Column::number("paper", "", Digits::Decimals(4)),
            Column::number("ours", "", Digits::Decimals(4)),
            Column::number("ratio", "", Digits::Decimals(2)),
        ],
    );
    for entry in &entries {
        // Kinematics and gravity are the same by construction.
        if entry.row == "phi" || entry.row == "theta" {
            continue;
        }
        table.row([
            Cell::from(format!("({}, {})", entry.row, entry.column)),
            Cell::from(entry.printed),
            Cell::from(entry.computed),
            Cell::from(entry.ratio()),
        ]);
    }
    Ok(format!(
        "### Appendix \"{:.0} kt\" beside ours at {speed:.0} kt\n\nUnits ft, s, rad, percent \
         stick; entries above {SMALLEST_ENTRY} in print.\n\n{}\n",
        condition.printed_speed_kt(),
        table.to_markdown()
    ))
}

fn eigenvalues(
    problem: &Problem,
    on: &StateSpace,
    condition: Condition,
    speed: f64,
) -> Result<String, CliError> {
    let fault = |error: LinearError| CliError::Internal(error.to_string());
    let off = reduced(problem, speed, false)?;
    let paper = appendix(condition).map_err(fault)?;
    let column = |model: &StateSpace| -> Result<Vec<String>, CliError> {
        let mut list: Vec<_> = modes(model)
            .map_err(fault)?
            .into_iter()
            .map(|mode| {
                (mode.eigenvalue, mode.name.map_or(String::new(), |n| format!(" {}", n.label())))
            })
            .filter(|(value, _)| value.im >= 0.0)
            .collect();
        list.sort_by(|a, b| a.0.re.total_cmp(&b.0.re).then(a.0.im.total_cmp(&b.0.im)));
        Ok(list
            .into_iter()
            .map(|(value, name)| {
                if value.im > 0.0 {
                    format!("{:.3} ± {:.3}i{name}", value.re, value.im)
                } else {
                    format!("{:.3}{name}", value.re)
                }
            })
            .collect())
    };
    let columns = [column(&paper)?, column(on)?, column(&off)?];
    let mut table = Table::new(
        "",
        vec![
            Column::text("paper, interactions on"),
            Column::text("ours, on"),
            Column::text("ours, off"),
        ],
    );
    for k in 0..columns.iter().map(Vec::len).max().unwrap_or(0) {
        table.row(columns.each_ref().map(|list| list.get(k).map_or("", String::as_str)));
    }
    Ok(format!("### Eigenvalues at {speed:.0} kt, rad/s\n\n{}\n", table.to_markdown()))
}
