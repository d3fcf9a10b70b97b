//! `coaxdesign validate`: every published number beside ours.

use clap::Args;

use super::args::OutputArgs;
use super::trim::trim_all;
use super::tune::{tune, verify_error};
use super::{CliError, Outcome, output};
use crate::control::law::LawTable;
use crate::control::plant::ModelClass;
use crate::control::spec::Specification;
use crate::control::verify::{Row, Verdict, verify};
use crate::linear::linearize::{Options, averaged};
use crate::linear::modes::modes;
use crate::linear::reduction::residualise;
use crate::linear::reference::{Condition, appendix, compare_with_appendix};
use crate::linear::{LinearError, StateSpace};
use crate::problem::{self, Problem};
use crate::report::table::{Cell, Column, Digits, Table};
use crate::simulate::flight::Autopilot;
use crate::simulate::metrics::Meter;
use crate::simulate::{self, Flight, maneuver};
use crate::trim::reference::{HOVER_OFF, HOVER_ON};
use crate::trim::{self, FlightCondition, Guess, TrimPoint};
use crate::units::{HORSEPOWER, KNOT, POUND_FORCE};
use crate::validation;
use crate::vehicle::Vehicle;

/// States kept by the published models.
pub(super) const RIGID_BODY: [&str; 8] = ["u", "v", "w", "p", "q", "r", "phi", "theta"];
/// Printed entries of A and B above this, in the printed units, are judged by
/// their ratio, the rest by their difference.
const SMALLEST_ENTRY: f64 = 0.01;
/// A difference of a small entry that is not worth a word.
const SMALL_DIFFERENCE: f64 = 0.005;

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
        text += &identity_table(&problem)?;
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
        text += &closed_loop(&problem::builtin_named(name)?.problem, name == "coax2d")?;
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
(`docs/decisions/feedback-allocation.md`). At speed the yaw loop's gain may dip below 1 before its last crossing, which is
the one that counts. In flight the law also follows two powers that change away from the schedule's trims, of the pedals
with collective and of rotor lift with the tail's load (`docs/theory/control.md`). To 60 kt the paper's manoeuvre is then
flown within all bounds; to 80 kt in the same time pitch strays by 5°, since longitudinal cyclic loses its power
over pitch there under the printed rigging, in the climb still sooner.

";

/// A tuning with the built-in specification: ranges of the metrics by axis.
fn closed_loop(problem: &Problem, fly: bool) -> Result<String, CliError> {
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
    let judged = |verdict| {
        verification.stability.iter().filter(|s| s.passed && s.verdict == verdict).count()
    };
    let drifts = match judged(Verdict::Drifts) {
        0 => String::new(),
        count => format!(" {count} more drift slowly until the outer loops hold them."),
    };
    let flown = if fly { flight(problem, &tuned.design.table, &spec)? } else { String::new() };
    Ok(format!(
        "{}\n{a} of {b} nominal and {c} of {d} off-nominal rows meet their targets; {} of {} closed loops are \
         shown stable.{drifts}\n\n{flown}",
        table.to_markdown(),
        judged(Verdict::Stable),
        verification.stability.len()
    ))
}

/// The paper's manoeuvre under the law, in each of the models that the paper
/// flies: rotors that wash each other and rotors that do not.
fn flight(problem: &Problem, law: &LawTable, spec: &Specification) -> Result<String, CliError> {
    let fault = |error: String| CliError::Internal(error);
    let maneuver = maneuver::builtin("accel-climb-turn")
        .ok_or_else(|| fault("the paper's manoeuvre is not built in".into()))?
        .map_err(|report| fault(report.to_string()))?;
    let options = simulate::Options::new(spec.hardware, spec.pitch_rate_limit);
    let mut text = String::from(
        "### The paper's manoeuvre\n\nFig. 17: hover to 60 kt in 23 s, climbing and turning \
         (`problems/maneuvers/accel-climb-turn.toml`). Errors are against what the law steers \
         to. The paper says that velocities and attitudes are tracked accurately with minimal \
         off-axis response; the bounds are ours.\n\n",
    );
    for interactions in [true, false] {
        let mut problem = problem.clone();
        problem.inflow.interactions = interactions;
        let vehicle = Vehicle::new(&problem)?;
        let condition = maneuver.start.condition;
        let guess = Guess::estimate(&vehicle, &condition);
        let start = trim::trim(&vehicle, condition, &guess, &trim::Options::default())
            .into_converged()
            .map_err(|point| fault(format!("no trim to start from: {:?}", point.status)))?;
        let autopilot =
            Autopilot { table: law.clone(), stick_limits: problem.controls.stick_limits };
        let mut flight = Flight::new(&vehicle, &start, Some(&autopilot), &maneuver, &options)
            .map_err(|error| fault(error.to_string()))?;
        let mut meter = Meter::new(&flight);
        let status = flight.fly(|flight| meter.see(flight));
        let metrics = meter.finish(&flight, &status);
        let size = |channel: &str| metrics.tracked(channel).map(|t| t.size).unwrap_or_default();
        let degrees = f64::to_degrees;
        let mut list = Vec::new();
        for (name, channel) in [
            ("forward", "forward_velocity"),
            ("sideward", "right_velocity"),
            ("upward", "climb_rate"),
        ] {
            let size = size(channel);
            let text = |what: &str| format!("{name} velocity, {what}");
            list.push(Claim::at_most(text("root mean square"), size.rms / KNOT, "kt", 1.0));
            list.push(Claim::at_most(text("peak"), size.peak / KNOT, "kt", 3.0));
        }
        list.push(Claim::at_most("bank, peak", degrees(size("phi").peak), "deg", 2.0));
        list.push(Claim::at_most("pitch, peak", degrees(size("theta").peak), "deg", 2.0));
        list.extend(
            metrics.steady_turn_rate_error_rad_s.map(|error| {
                Claim::at_most("heading rate in the steady turn", error, "rad/s", 0.01)
            }),
        );
        list.extend(metrics.coordinated_bank_error_rad.map(|error| {
            let text = "bank less atan(ψ'V/g) above 50 kt, peak";
            Claim::at_most(text, degrees(error.peak), "deg", 1.5)
        }));
        list.push(Claim::at_most(
            "time with an actuator at a limit",
            metrics.saturated_s,
            "s",
            0.0,
        ));
        text += &format!(
            "Interactions {}, {}:\n\n{}\n",
            if interactions { "on, as designed for" } else { "off, though designed with them" },
            metrics.end.status,
            claims(&list)
        );
    }
    Ok(text)
}

/// One word for tables.
fn verdict(holds: bool) -> &'static str {
    if holds { "yes" } else { "no" }
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

/// A claim in figures: what is looked at, ours, and the bound.
struct Claim {
    text: String,
    ours: f64,
    unit: &'static str,
    /// At most, or at least.
    most: bool,
    bound: f64,
}

impl Claim {
    fn at_most(text: impl Into<String>, ours: f64, unit: &'static str, bound: f64) -> Self {
        Self { text: text.into(), ours, unit, most: true, bound }
    }

    fn at_least(text: impl Into<String>, ours: f64, unit: &'static str, bound: f64) -> Self {
        Self { text: text.into(), ours, unit, most: false, bound }
    }

    fn holds(&self) -> bool {
        if self.most { self.ours <= self.bound } else { self.ours >= self.bound }
    }
}

fn claims(list: &[Claim]) -> String {
    let mut table = Table::new(
        "",
        vec![
            Column::text("claim"),
            Column::number("ours", "", Digits::Significant(3)),
            Column::text("unit"),
            Column::text("bound"),
            Column::number("at", "", Digits::Significant(3)),
            Column::text("holds"),
        ],
    );
    for claim in list {
        table.row([
            Cell::from(claim.text.as_str()),
            Cell::from(claim.ours),
            Cell::from(claim.unit),
            Cell::from(if claim.most { "at most" } else { "at least" }),
            Cell::from(claim.bound),
            Cell::from(verdict(claim.holds())),
        ]);
    }
    table.to_markdown()
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
            Column::number("tolerance", "%", Digits::Decimals(1)),
            Column::text("within"),
        ],
    );
    for point in sweeps.iter().flatten() {
        let reference = if point.interactions { HOVER_ON } else { HOVER_OFF };
        // What is asked of the closest reproduction, %: thrust, power, inflow.
        let (thrust, power) = if point.interactions { (2.0, 2.5) } else { (0.5, 3.0) };
        for ((rotor, mean), theirs) in problem.rotors.iter().zip(&point.rotors).zip(&reference) {
            let blown = point.interactions && rotor.name == "lower";
            for (quantity, printed, ours, rounding, tolerance) in [
                ("T, lbf", theirs.thrust / POUND_FORCE, mean.thrust / POUND_FORCE, 0.05, thrust),
                ("P, hp", theirs.power / HORSEPOWER, mean.power / HORSEPOWER, 0.005, power),
                ("λ0", theirs.inflow, mean.inflow[0], 5e-4, if blown { 4.0 } else { 2.0 }),
                ("λs0", theirs.self_inflow, mean.self_inflow[0], 5e-4, 2.0),
                ("C_T", theirs.thrust_coefficient, mean.thrust_coefficient, 5e-6, thrust),
                ("C_P", theirs.power_coefficient, mean.power_coefficient, 5e-6, power),
            ] {
                // Coefficients are printed with two or three digits.
                let coefficient = quantity.starts_with("C_");
                let rounded = if coefficient { 100.0 * rounding / printed } else { 0.0 };
                let tolerance = tolerance + rounded;
                table.row([
                    Cell::from(if point.interactions { "on" } else { "off" }),
                    Cell::from(rotor.name.as_str()),
                    Cell::from(quantity),
                    Cell::from(printed),
                    Cell::from(ours),
                    Cell::from(ours / printed),
                    Cell::from(tolerance),
                    Cell::from(verdict((100.0 * (ours / printed - 1.0)).abs() <= tolerance)),
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
    let knots = |point: &TrimPoint| point.condition.airspeed / KNOT;
    let most = |points: &[TrimPoint], value: &dyn Fn(&TrimPoint) -> f64, from: f64| {
        let beyond = points.iter().filter(|point| knots(point) > from - 1.0);
        beyond.map(|point| value(point).abs()).fold(0.0, f64::max)
    };
    let bank = |point: &TrimPoint| degrees(point, 6);
    let largest = most(&sweeps[0], &bank, 0.0);
    let at = sweeps[0].iter().find(|point| bank(point).abs() >= largest).map_or(f64::NAN, knots);
    let rise = |range: std::ops::Range<f64>| {
        let inside =
            sweeps[0].iter().zip(&sweeps[1]).filter(move |(on, _)| range.contains(&knots(on)));
        inside.map(|(on, off)| 100.0 * (on.sticks[2] / off.sticks[2] - 1.0))
    };
    let pedal = |point: &TrimPoint| point.sticks[3];
    let fast = sweeps[0].iter().zip(&sweeps[1]).filter(|(on, _)| knots(on) > 61.0);
    let travel = fast.map(|(on, off)| on.sticks[2] - off.sticks[2]).fold(0.0, f64::max);
    let trends = [
        Claim::at_most("bank with interactions, largest", largest, "deg", 1.0),
        Claim::at_most("speed of that", at, "kt", 30.0),
        Claim::at_most("bank without interactions", most(&sweeps[1], &bank, 0.0), "deg", 1e-3),
        Claim::at_least(
            "collective on over off, below 50 kt",
            rise(0.0..49.0).fold(f64::INFINITY, f64::min),
            "% more",
            3.0,
        ),
        Claim::at_most(
            "collective on over off, beyond 60 kt",
            rise(61.0..f64::INFINITY).fold(0.0, f64::max),
            "% more",
            3.0,
        ),
        Claim::at_most("the same in stick travel", travel, "%", 3.0),
        Claim::at_least("pedal in hover", pedal(&sweeps[0][0]).abs(), "%", 1.0),
        Claim::at_most("pedal from 50 kt", most(&sweeps[0], &pedal, 50.0), "%", 0.5),
    ];
    Ok(format!("### Trim over speed\n\n{}\n{}\n", table.to_markdown(), claims(&trends)))
}

/// Ratios of ours to print that count as agreement.
const AGREEMENT: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// What is known of an entry that misses print: see the introduction.
fn known_misfit(condition: Condition, row: &str, column: &str) -> &'static str {
    match (condition, row, column) {
        (Condition::Hover, "u" | "v", "p" | "q") => "rate derivatives: partly explained",
        (Condition::Hover, "p" | "q", "p" | "q") => "follows the rate derivatives of u and v",
        (Condition::Hover, "r", "r" | "lat" | "ped") => "inertia of the blades in yaw",
        (Condition::Hover, "w", "w" | "p" | "q") => "small difference of two rotors",
        (Condition::Forward, "u" | "q", "w" | "lon" | "col" | "ped") => {
            "thrust line, stalled roots"
        }
        (Condition::Forward, "w", "u") => "thrust line, stalled roots",
        (Condition::Forward, "r", "p" | "r" | "ped") => "inertia of the blades in yaw, in part",
        _ => "unexplained",
    }
}

fn entries(model: &StateSpace, condition: Condition, speed: f64) -> Result<String, CliError> {
    let (large, small): (Vec<_>, Vec<_>) = compare_with_appendix(model, condition, 0.0)
        .map_err(|error| CliError::Internal(error.to_string()))?
        .into_iter()
        // Kinematics and gravity are the same by construction.
        .filter(|entry| entry.row != "phi" && entry.row != "theta")
        .partition(|entry| entry.printed.abs() > SMALLEST_ENTRY);
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
    for entry in &large {
        table.row([
            Cell::from(format!("({}, {})", entry.row, entry.column)),
            Cell::from(entry.printed),
            Cell::from(entry.computed),
            Cell::from(entry.ratio()),
            Cell::from(if AGREEMENT.contains(&entry.ratio()) {
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
    for entry in &small {
        let difference = entry.computed - entry.printed;
        rest.row([
            Cell::from(format!("({}, {})", entry.row, entry.column)),
            Cell::from(entry.printed),
            Cell::from(entry.computed),
            Cell::from(difference),
            Cell::from(verdict(difference.abs() <= SMALL_DIFFERENCE)),
        ]);
    }
    Ok(format!(
        "### Appendix \"{:.0} kt\" beside ours at {speed:.0} kt\n\nUnits ft, s, rad, percent \
         stick; entries above {SMALLEST_ENTRY} in print.\n\n{}\nThe rest, where print is not \
         zero:\n\n{}\n",
        condition.printed_speed_kt(),
        table.to_markdown(),
        rest.to_markdown()
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
