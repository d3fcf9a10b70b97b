//! The sections of a report.

use num_complex::Complex64;

use super::super::bode::quotient;
use super::super::models::on_axis;
use super::super::modes::plane;
use super::super::trim::{failures, figure as trim_curves, on_off, published};
use super::super::tune::{
    authority_text, explanations_text, figures as design_figures, gains_table, left_out_text,
    not_required_texts, rows_table,
};
use super::super::version;
use super::Inputs;
use super::gather::{Checked, Linear, Revolution, Study};
use crate::cli::{CliError, output};
use coaxdesign::control::axis::Channel;
use coaxdesign::control::law::LawTable;
use coaxdesign::control::plant::ModelClass;
use coaxdesign::control::verify::{Row, Verdict};
use coaxdesign::linear::frequency::{compare, log_grid};
use coaxdesign::linear::model::{index_of, shown_per_si};
use coaxdesign::linear::modes::{Mode, modes as modes_of};
use coaxdesign::linear::{LinearError, StateSpace};
use coaxdesign::pipeline::problem_hash;
use coaxdesign::problem::{FuselageAerodynamics, Problem, Reference, Station, Wing};
use coaxdesign::report::figures::{
    BodeChannel, Curve, CurvePanel, EigenvalueSet, FrequencyResponse, Marks, bode_figure,
    interference_figure, orbit_figure,
};
use coaxdesign::report::html::Section;
use coaxdesign::report::law::{Flow, LawLabels, closed_loop, computed, inner_loop, outer_loop};
use coaxdesign::report::plot::diagram::Diagram;
use coaxdesign::report::plot::{Figure, Legend};
use coaxdesign::report::table::{Cell, Column, Digits, Highlight, Table, decimals, significant};
use coaxdesign::report::three_view::{
    BodyView, Point, RotorView, SurfaceView, VehicleView, three_view_figure,
};
use coaxdesign::schedule::hash;
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::trim::TrimPoint;
use coaxdesign::units::{Kind, STANDARD_GRAVITY, System};
use coaxdesign::vehicle::frames::{about_x, about_y, body_to_hub, product};
use coaxdesign::vehicle::summary;

/// Styles of interactions on and off and of published values, everywhere.
const ON: usize = 0;
const OFF: usize = 1;
const PUBLISHED: usize = 2;
/// Style of the first rotor; the others follow.
const FIRST_ROTOR: usize = 2;

/// A quantity with its unit, for people.
fn shown(kind: Kind, value: f64, digits: usize, system: System) -> String {
    let unit = kind.symbol(system).replace("^2", "²").replace("^3", "³");
    format!("{} {unit}", significant(kind.from_si(value, system), digits))
}

fn speed_of(value: f64, system: System) -> String {
    let number = decimals(Kind::Airspeed.from_si(value, system), 0);
    format!("{number} {}", Kind::Airspeed.symbol(system))
}

fn interactions(on: bool) -> String {
    format!("interactions {}", on_off(on))
}

fn style_of(on: bool) -> usize {
    if on { ON } else { OFF }
}

// ---------------------------------------------------------------------------
// Summary

/// The verdict, the least margins and the numbers that the aircraft is known by.
pub(super) fn summary(inputs: &Inputs, study: &Study, system: System) -> Section {
    let mut section = Section::new("Summary");
    section = match &inputs.checked {
        Some(checked) => {
            let (highlight, headline, text) = verdict(checked, system);
            section.verdict(highlight, headline, &text).table(axes_table(checked, system))
        }
        None => section.verdict(
            Highlight::Warning,
            "Not verified.",
            "There is no verification.json beside the schedule: whether it meets its \
             specification is not known.",
        ),
    };
    let stale = stale(inputs);
    if !stale.is_empty() {
        section = section.verdict(Highlight::Bad, "Of different origin.", &stale.join(" "));
    }
    section.facts(facts(inputs, study, system))
}

/// What the page draws from, where that is not what the schedule was tuned for.
fn stale(inputs: &Inputs) -> Vec<String> {
    let mut said = Vec::new();
    let provenance = &inputs.schedule.provenance;
    if problem_hash(&inputs.loaded) != provenance.problem_hash {
        said.push(format!(
            "The problem {} is not the one that the schedule was tuned for: trims and models here \
             are of the file as it is now.",
            inputs.problem_name
        ));
    }
    if inputs.requirements.hash() != provenance.specification_hash {
        said.push(format!(
            "The specification {} is not the one that the schedule was tuned for: limits drawn \
             here are of the file as it is now.",
            inputs.requirements.name
        ));
    }
    said
}

fn verdict(checked: &Checked, system: System) -> (Highlight, &'static str, String) {
    let v = &checked.verification;
    let of = |class: ModelClass| v.rows.iter().filter(move |r| r.class == class);
    let met = |class: ModelClass| of(class).filter(|r| r.passed).count();
    let judged = |verdict| v.stability.iter().filter(|s| s.passed && s.verdict == verdict).count();
    let (stable, drifts) = (judged(Verdict::Stable), judged(Verdict::Drifts));
    let within = checked.authority.iter().filter(|a| a.passed).count();
    let mut text = format!(
        "Nominal model: {} of {} checks met. Other models: {} of {}. Closed loops stable: {} of \
         {}. Step commands within blade limits: {} of {}.",
        met(ModelClass::Nominal),
        of(ModelClass::Nominal).count(),
        met(ModelClass::OffNominal),
        of(ModelClass::OffNominal).count(),
        stable,
        v.stability.len(),
        within,
        checked.authority.len(),
    );
    if drifts > 0 {
        text += &format!(" {drifts} more drift slowly until the outer loops hold them.");
    }
    for sentence in not_required_texts(&v.not_required, system) {
        text += &format!(" {sentence}.");
    }
    if let Some(worst) = least(v.rows.iter()) {
        text += &format!(
            " The least design margin is {} %: {}.",
            decimals(worst.design_margin_percent.unwrap_or(f64::NAN), 0).replace('-', "−"),
            place_of(worst, system)
        );
    }
    if !checked.left_out.is_empty() {
        text += &format!(
            " {} combinations of model and speed do not trim and are left out.",
            checked.left_out.len()
        );
    }
    if v.passed && checked.left_out.is_empty() && within < checked.authority.len() {
        let headline = "Every margin is met, but step commands ask for more than the blades have.";
        (Highlight::Warning, headline, text)
    } else if v.passed && checked.left_out.is_empty() {
        (Highlight::Good, "Every requirement is met.", text)
    } else if v.nominal_passed {
        (Highlight::Warning, "Met by the nominal model, not by every other.", text)
    } else {
        (Highlight::Bad, "Not every requirement is met: the least-violating design.", text)
    }
}

fn least<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    rows.filter(|r| r.design_margin_percent.is_some()).min_by(|a, b| {
        let margin = |r: &Row| r.design_margin_percent.unwrap_or(f64::INFINITY);
        margin(a).total_cmp(&margin(b))
    })
}

fn place_of(row: &Row, system: System) -> String {
    format!(
        "{} at {}, model {}, {}",
        row.axis,
        speed_of(row.speed_m_s, system),
        row.model,
        requirement(row)
    )
}

/// The requirement that binds, in words.
fn requirement(row: &Row) -> String {
    match row.binding.as_deref() {
        None => "no requirement".into(),
        Some("pm_deg") => "phase margin".into(),
        Some("gm_up_db") => "gain margin upward".into(),
        Some("gm_down_db") => "gain margin downward".into(),
        Some("drb_rad_s") => "rejection bandwidth".into(),
        Some("drp_db") => "rejection peak".into(),
        Some("crossover_min_rad_s") => "least crossover".into(),
        Some("crossover_max_rad_s") => "largest crossover".into(),
        Some(other) => other.replace('_', " "),
    }
}

fn axes_table(checked: &Checked, system: System) -> Table {
    let margin = |name: &str| Column::number(name, "%", Digits::Decimals(0));
    let mut table = Table::new(
        "Design margins: 0 % is just met, 100 % is comfortable",
        vec![
            Column::text("axis"),
            margin("nominal model"),
            Column::text("at"),
            Column::text("bound by"),
            margin("all models"),
            Column::text("at"),
            Column::text("model"),
            Column::text("bound by"),
            Column::text("checks met"),
        ],
    );
    for channel in Channel::ALL {
        let of = || checked.verification.rows.iter().filter(|r| r.axis == channel.name());
        let (Some(nominal), Some(all)) =
            (least(of().filter(|r| r.class == ModelClass::Nominal)), least(of()))
        else {
            continue;
        };
        let cell = |row: &Row| {
            let highlight = if row.passed { Highlight::Good } else { Highlight::Bad };
            Cell::from(row.design_margin_percent).highlight(highlight)
        };
        let met = of().filter(|r| r.passed).count();
        let count = of().count();
        let all_met = if met == count { Highlight::Good } else { Highlight::Bad };
        let bound = |row: &Row| Cell::from(requirement(row));
        table.row([
            Cell::from(channel.name()),
            cell(nominal),
            speed_of(nominal.speed_m_s, system).into(),
            bound(nominal),
            cell(all),
            speed_of(all.speed_m_s, system).into(),
            all.model.as_str().into(),
            bound(all),
            Cell::from(format!("{met} of {count}")).highlight(all_met),
        ]);
    }
    table
}

fn facts(inputs: &Inputs, study: &Study, system: System) -> Vec<(String, String)> {
    let problem = &inputs.loaded.problem;
    let aircraft = summary::aircraft(problem);
    let mut facts = vec![
        ("weight".to_string(), shown(Kind::Force, aircraft.weight, 4, system)),
        ("disk loading".to_string(), shown(Kind::Pressure, aircraft.disk_loading, 3, system)),
    ];
    for points in &study.sweeps {
        if let Some(hover) = points.iter().find(|p| p.condition.airspeed == 0.0 && p.on_orbit()) {
            let power = shown(Kind::Power, hover.power.shaft, 4, system);
            facts.push((format!("hover power, {}", interactions(hover.interactions)), power));
        }
    }
    for points in &study.sweeps {
        let Some(first) = points.first() else { continue };
        let word = interactions(first.interactions);
        let flown = points.iter().filter(|p| p.on_orbit()).count();
        facts.push((format!("trimmed, {word}"), format!("{flown} of {} speeds", points.len())));
    }
    let speeds: Vec<f64> = inputs.schedule.points.iter().map(|p| p.speed).collect();
    if let (Some(low), Some(high)) = (speeds.first(), speeds.last()) {
        facts.push((
            "schedule".into(),
            format!(
                "{} breakpoints, {} to {}",
                speeds.len(),
                decimals(Kind::Airspeed.from_si(*low, system), 0),
                speed_of(*high, system)
            ),
        ));
    }
    let models = inputs.requirements.specification.models.len();
    facts.push(("models in the specification".into(), models.to_string()));
    facts
}

// ---------------------------------------------------------------------------
// Vehicle

/// The three-view and the data of the rotors.
pub(super) fn vehicle(inputs: &Inputs, system: System) -> Section {
    let problem = &inputs.loaded.problem;
    let mut table = Table::new(
        "Rotors",
        vec![
            Column::text("rotor"),
            Column::number("blades", "", Digits::Decimals(0)),
            Column::number("radius", Kind::Length.symbol(system), Digits::Significant(4)),
            Column::number("solidity", "", Digits::Decimals(4)),
            Column::number("speed", "rad/s", Digits::Significant(4)),
            Column::number("tip Mach", "", Digits::Decimals(3)),
            Column::number("Lock number", "", Digits::Significant(3)),
            Column::number("tilt", "deg", Digits::Decimals(1)),
            Column::number("cant", "deg", Digits::Decimals(1)),
            Column::text("turns"),
        ],
    );
    for rotor in &problem.rotors {
        let derived = summary::rotor(problem, rotor);
        table.row([
            Cell::from(rotor.name.as_str()),
            Cell::from(rotor.blades as f64),
            Kind::Length.from_si(rotor.radius, system).into(),
            derived.solidity.into(),
            rotor.speed.into(),
            derived.tip_mach.into(),
            derived.lock_number.map_or_else(Cell::empty, Cell::from),
            rotor.tilt.to_degrees().into(),
            rotor.cant.to_degrees().into(),
            match rotor.direction {
                coaxdesign::problem::Direction::CounterClockwise => "counter-clockwise",
                coaxdesign::problem::Direction::Clockwise => "clockwise",
            }
            .into(),
        ]);
    }
    Section::new("Vehicle")
        .figure(
            three_view_figure("Vehicle from three sides", &view(problem, system)),
            "The vehicle from its problem file: rotor disks with hub frames (x forward, y to \
             starboard, z down) and sense of rotation, wings, equivalent plate areas of bodies as \
             grey disks, centre of gravity (+).",
        )
        .table(table)
}

/// A point of the body frame, m from a station, in drawing coordinates.
fn drawn(from: &Station, body: [f64; 3], system: System) -> Point {
    [from.fuselage_station - body[0], from.butt_line + body[1], from.water_line - body[2]]
        .map(|v| Kind::Length.from_si(v, system))
}

fn view(problem: &Problem, system: System) -> VehicleView {
    let length = |v: f64| Kind::Length.from_si(v, system);
    VehicleView {
        unit: Kind::Length.symbol(system).into(),
        center_of_gravity: drawn(&problem.mass.center_of_gravity, [0.0; 3], system),
        rotors: problem
            .rotors
            .iter()
            .enumerate()
            .map(|(k, rotor)| RotorView {
                name: rotor.name.clone(),
                style: FIRST_ROTOR + k,
                hub: drawn(&rotor.hub, [0.0; 3], system),
                radius: length(rotor.radius),
                axes: body_to_hub(rotor.cant, rotor.tilt).map(|[x, y, z]| [-x, y, -z]),
                counter_clockwise: rotor.direction
                    == coaxdesign::problem::Direction::CounterClockwise,
            })
            .collect(),
        surfaces: problem.wings.iter().map(|wing| surface(wing, system)).collect(),
        bodies: problem
            .fuselages
            .iter()
            .map(|body| BodyView {
                name: body.name.clone(),
                position: drawn(&body.position, [0.0; 3], system),
                areas: match &body.aerodynamics {
                    FuselageAerodynamics::FlatPlate { area, drag_coefficient } => {
                        Some(std::array::from_fn(|k| {
                            Kind::Area.from_si(area[k] * drag_coefficient[k], system)
                        }))
                    }
                    FuselageAerodynamics::Table(_) => None,
                },
            })
            .collect(),
    }
}

/// The outline of a wing: its aerodynamic centre is at a quarter of the chord.
fn surface(wing: &Wing, system: System) -> SurfaceView {
    let axes = product(&about_y(wing.incidence), &about_x(wing.cant));
    let corner = |along: f64, behind: f64| {
        let chord = wing.chord.at(along);
        let y = (along - 0.5) * wing.span;
        let local = [(0.25 - behind) * chord, y, -y.abs() * wing.dihedral.tan()];
        let body = std::array::from_fn(|i| (0..3).map(|k| axes[k][i] * local[k]).sum());
        drawn(&wing.aerodynamic_center, body, system)
    };
    SurfaceView {
        name: wing.name.replace('_', " "),
        corners: vec![
            corner(0.0, 0.0),
            corner(0.5, 0.0),
            corner(1.0, 0.0),
            corner(1.0, 1.0),
            corner(0.5, 1.0),
            corner(0.0, 1.0),
        ],
    }
}

// ---------------------------------------------------------------------------
// Trim

/// Where a publication shows the same, for an aircraft that says so.
pub(super) fn printed(problem: &Problem, figures: &str) -> String {
    if problem.reference == Some(Reference::Coax2dPaper) {
        format!(" Compare with {figures} of the reference paper.")
    } else {
        String::new()
    }
}

/// Trim curves, and the hover beside published values.
pub(super) fn trim(inputs: &Inputs, study: &Study, system: System) -> Section {
    let problem = &inputs.loaded.problem;
    let caption = if study.sweeps.len() > 1 {
        "Trimmed level flight over true airspeed, with and without rotor-on-rotor interactions: \
         attitudes, sticks, power, and how the rotors share the thrust."
    } else {
        "Trimmed level flight over true airspeed: attitudes, sticks and power."
    };
    let caption = &format!("{caption}{}", printed(problem, "Figs. 13 and 14"));
    let mut section =
        Section::new("Trim").figure(trim_curves(problem, &study.sweeps, system), caption);
    let failed = failures(&study.sweeps, Some(system));
    if !failed.is_empty() {
        section = section.preformatted("What did not trim, and why", failed.trim_end());
    }
    match hover_table(problem, &study.sweeps, system) {
        Some(table) => section.heading("Hover").table(table).paragraph(
            "λ is the inflow over the tip speed: λ0 in all, λs0 induced by the rotor itself. \
             Published values are those of Table 2.",
        ),
        None => section,
    }
}

/// Hover beside the published values, a row for each quantity.
fn hover_table(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System) -> Option<Table> {
    let pairs = published(problem, sweeps)?;
    let rotors: Vec<&str> = problem.rotors.iter().map(|r| r.name.as_str()).collect();
    let number = |name: &str| Column::number(name, "", Digits::Significant(4));
    let mut columns =
        vec![Column::text("quantity"), Column::text("unit"), Column::text("interactions")];
    for rotor in &rotors {
        columns.push(number(rotor));
        columns.push(number("published"));
        columns.push(Column::number("ratio", "", Digits::Decimals(3)));
    }
    let mut table = Table::new("Hover beside the published Table 2", columns);
    let mut done: Vec<(&str, bool)> = Vec::new();
    for pair in &pairs {
        let key = (pair.quantity, pair.interactions);
        if done.contains(&key) {
            continue;
        }
        done.push(key);
        let mut cells = vec![
            Cell::from(pair.quantity),
            pair.kind.symbol(system).into(),
            on_off(pair.interactions).into(),
        ];
        for rotor in &rotors {
            let found =
                pairs.iter().find(|p| (p.quantity, p.interactions) == key && p.rotor == *rotor);
            cells.push(found.map(|p| p.kind.from_si(p.ours, system)).into());
            cells.push(found.map(|p| p.kind.from_si(p.printed, system)).into());
            cells.push(found.map(|p| p.ours / p.printed).into());
        }
        table.row(cells);
    }
    Some(table)
}

// ---------------------------------------------------------------------------
// One revolution

type Pick<'a> = &'a dyn Fn(&coaxdesign::vehicle::output::Output, usize) -> f64;

/// What the rotors do over one revolution, and the vibration at the hubs over speed.
pub(super) fn revolution(study: &Study, system: System) -> Section {
    let mut section = Section::new("One revolution");
    let names = &study.rotors;
    for revolution in &study.revolutions {
        let speed = speed_of(revolution.airspeed, system);
        section = section.figure(
            orbit(revolution, names, &speed, system),
            &format!(
                "The periodic orbit at {speed}: flap angle of the first blade, thrust, force on \
                 the hub across the shaft (hub frame, forward, less its mean), and acceleration at \
                 the centre of gravity less its mean. Each rotor in its own hub frame."
            ),
        );
    }
    section.figure(
        vibration(study, names, system),
        "Vibration at the hubs over airspeed: half of the peak-to-peak force along each axis of \
         the hub frame, interactions as in the problem file.",
    )
}

fn orbit(revolution: &Revolution, names: &[String], speed: &str, system: System) -> Figure {
    let azimuth: Vec<f64> = revolution.azimuth.iter().map(|a| a.to_degrees()).collect();
    let curves = |pick: Pick, less_mean: bool| -> Vec<Curve> {
        names
            .iter()
            .enumerate()
            .map(|(k, name)| {
                let y = revolution.output.iter().map(|o| pick(o, k)).collect();
                curve(name, FIRST_ROTOR + k, &azimuth, y, less_mean)
            })
            .collect()
    };
    let panel = |quantity: &str, unit: &str, span: f64, curves: Vec<Curve>| CurvePanel {
        title: String::new(),
        quantity: quantity.into(),
        unit: unit.into(),
        minimum_span: span,
        curves,
    };
    let force = Kind::Force.symbol(system);
    let acceleration = ["forward", "starboard", "down"]
        .iter()
        .enumerate()
        .map(|(axis, name)| {
            let y = revolution
                .output
                .iter()
                .map(|o| o.specific_force[axis] / STANDARD_GRAVITY)
                .collect();
            // Colours of their own: these are no rotors.
            curve(name, 4 + axis, &azimuth, y, true)
        })
        .collect();
    let newton = |value: f64| Kind::Force.from_si(value, system);
    orbit_figure(
        &format!("One revolution at {speed}"),
        &[
            panel(
                "flap angle",
                "deg",
                0.1,
                curves(&|o, k| o.rotors[k].teeter_angle.to_degrees(), false),
            ),
            panel("thrust", force, 1.0, curves(&|o, k| newton(o.rotors[k].thrust), false)),
            panel(
                "hub force across the shaft, less mean",
                force,
                1.0,
                curves(&|o, k| newton(o.rotors[k].force_hub[0]), true),
            ),
            panel("acceleration, less mean", "g", 0.01, acceleration),
        ],
    )
    .legend(Legend::Above)
}

/// A curve; the mean leaves out the last point, which repeats the first.
fn curve(name: &str, style: usize, x: &[f64], mut y: Vec<f64>, less_mean: bool) -> Curve {
    if less_mean && y.len() > 1 {
        let count = y.len() - 1;
        let mean = y[..count].iter().sum::<f64>() / count as f64;
        for value in &mut y {
            *value -= mean;
        }
    }
    Curve { name: name.into(), style, x: x.to_vec(), y, marks: Marks::Without }
}

fn vibration(study: &Study, names: &[String], system: System) -> Figure {
    let points: Vec<&TrimPoint> =
        study.sweeps[study.own_sweep].iter().filter(|p| p.on_orbit()).collect();
    let x: Vec<f64> =
        points.iter().map(|p| Kind::Airspeed.from_si(p.condition.airspeed, system)).collect();
    let panels: Vec<CurvePanel> = ["forward", "sideward", "along the shaft"]
        .iter()
        .enumerate()
        .map(|(axis, name)| CurvePanel {
            title: (*name).into(),
            quantity: "hub force, ±".into(),
            unit: Kind::Force.symbol(system).into(),
            minimum_span: 1.0,
            curves: names
                .iter()
                .enumerate()
                .map(|(k, rotor)| Curve {
                    name: rotor.clone(),
                    style: FIRST_ROTOR + k,
                    x: x.clone(),
                    y: points
                        .iter()
                        .map(|p| Kind::Force.from_si(p.rotors[k].force_vibration[axis], system))
                        .collect(),
                    marks: Marks::With,
                })
                .collect(),
        })
        .collect();
    interference_figure("Hub vibration", "airspeed", Kind::Airspeed.symbol(system), &panels)
        .columns(3)
        .panel_size(215.0, 150.0)
}

// ---------------------------------------------------------------------------
// Linear models

/// Eigenvalues of the reduced hover models, with the published ones.
pub(super) fn modes(inputs: &Inputs, study: &Study) -> Result<Section, CliError> {
    let mut sets = Vec::new();
    let mut table = modes_table();
    let mut add = |name: &str, style: usize, model: &StateSpace| -> Result<(), LinearError> {
        let found = modes_of(model)?;
        sets.push(EigenvalueSet {
            name: name.into(),
            style,
            values: with_conjugates(&found),
            labels: Vec::new(),
        });
        for mode in &found {
            table.row(mode_cells(name, mode));
        }
        Ok(())
    };
    for Linear { interactions: on, reduced, .. } in &study.hover {
        add(&interactions(*on), style_of(*on), reduced)?;
    }
    if inputs.loaded.problem.reference == Some(Reference::Coax2dPaper) {
        add("paper's appendix, interactions on", PUBLISHED, &appendix(Condition::Hover)?)?;
    }
    let section = Section::new("Modes in hover");
    if sets.is_empty() {
        return Ok(section.paragraph("The vehicle does not trim in hover."));
    }
    Ok(section
        .figure(
            plane("Eigenvalues of the residualised hover models", &sets),
            &format!(
                "Eigenvalues of the averaged model, residualised to the rigid body, with and \
                 without rotor-on-rotor interactions. Right of the imaginary axis, motion grows.{}",
                printed(&inputs.loaded.problem, "Fig. 15")
            ),
        )
        .folded("Modes with damping, frequency and states", table))
}

fn with_conjugates(modes: &[Mode]) -> Vec<Complex64> {
    modes
        .iter()
        .flat_map(|mode| {
            let value = mode.eigenvalue;
            std::iter::once(value).chain(mode.oscillates().then(|| value.conj()))
        })
        .collect()
}

fn modes_table() -> Table {
    Table::new(
        "Modes",
        vec![
            Column::text("model"),
            Column::number("real part", "rad/s", Digits::Decimals(4)),
            Column::number("imaginary part", "rad/s", Digits::Decimals(4)),
            Column::number("damping ratio", "", Digits::Decimals(3)),
            Column::number("to half", "s", Digits::Decimals(2)),
            Column::number("to double", "s", Digits::Decimals(2)),
            Column::text("mode"),
            Column::text("states"),
        ],
    )
}

fn mode_cells(model: &str, mode: &Mode) -> Vec<Cell> {
    let states: Vec<String> = mode
        .dominant
        .iter()
        .take(3)
        .map(|(name, share)| format!("{name} {:.0} %", 100.0 * share))
        .collect();
    let growth = Cell::from(mode.time_to_double());
    vec![
        Cell::from(model),
        mode.eigenvalue.re.into(),
        mode.eigenvalue.im.into(),
        mode.damping_ratio().into(),
        mode.time_to_half().into(),
        if mode.unstable() { growth.highlight(Highlight::Bad) } else { growth },
        mode.name.map_or("", |name| name.label()).into(),
        states.join(", ").into(),
    ]
}

/// On-axis frequency responses of the full-order hover models.
pub(super) fn responses(
    inputs: &Inputs,
    study: &Study,
    system: System,
) -> Result<Section, CliError> {
    let section = Section::new("Frequency responses in hover");
    let Some(first) = study.hover.first() else {
        return Ok(section.paragraph("The vehicle does not trim in hover."));
    };
    let omega = log_grid(0.1, 30.0, 200)?;
    let names: Vec<String> = study.hover.iter().map(|l| interactions(l.interactions)).collect();
    let labelled: Vec<(&str, &StateSpace)> =
        names.iter().map(String::as_str).zip(study.hover.iter().map(|l| &l.full)).collect();
    let channels = on_axis(&first.full)?
        .iter()
        .map(|(input, output)| {
            let found = compare(&labelled, input, output, &omega)?;
            let model = &first.full;
            let kind_in = model.inputs()[index_of(model.inputs(), "input", input)?].kind;
            let kind_out = model.outputs()[index_of(model.outputs(), "output", output)?].kind;
            let factor = shown_per_si(kind_out, system) / shown_per_si(kind_in, system);
            Ok(BodeChannel {
                title: format!("{input} to {output}"),
                magnitude_unit: format!("dB re {}", quotient(kind_out, kind_in, system)),
                valid: None,
                responses: found
                    .curves
                    .iter()
                    .zip(&study.hover)
                    .map(|((label, bode), linear)| FrequencyResponse {
                        name: label.clone(),
                        style: style_of(linear.interactions),
                        frequency: bode.omega.clone(),
                        response: bode
                            .gain
                            .iter()
                            .zip(&bode.phase)
                            .map(|(gain, phase)| Complex64::from_polar(gain * factor, *phase))
                            .collect(),
                    })
                    .collect(),
            })
        })
        .collect::<Result<Vec<_>, LinearError>>()?;
    // Two axes a figure, to keep the letters large.
    Ok(channels.chunks(2).fold(section, |section, pair| {
        let names: Vec<&str> = pair.iter().map(|c| c.title.as_str()).collect();
        section.figure(
            bode_figure(&names.join(", "), pair),
            &format!(
                "On-axis responses of the full-order, averaged models.{}",
                printed(&inputs.loaded.problem, "Fig. 16")
            ),
        )
    }))
}

// ---------------------------------------------------------------------------
// Law, gains, margins

/// Diagrams of the law with its settings.
pub(super) fn law(inputs: &Inputs, system: System) -> Section {
    let (settings, hardware) = (&inputs.schedule.law, &inputs.schedule.hardware);
    let number = |v: f64| output::significant(v, 3);
    let attitude = if settings.roll_frequency == settings.pitch_frequency {
        format!("ω {} rad/s", number(settings.roll_frequency))
    } else {
        format!("ω {}, {} rad/s", number(settings.roll_frequency), number(settings.pitch_frequency))
    };
    let labels = LawLabels {
        inverted_share: number(settings.kappa),
        reference_delay: format!("{} s", number(settings.reference_delay)),
        attitude_model: format!("{attitude}, ζ {}", number(settings.attitude_damping)),
        rate_models: format!(
            "{} s, {} s",
            number(settings.yaw_time_constant),
            number(settings.heave_time_constant)
        ),
        actuators: format!(
            "{} rad/s, {} ms",
            number(hardware.actuator_bandwidth),
            number(1e3 * hardware.delay)
        ),
        sensors: format!("{} rad/s", number(hardware.sensor_bandwidth)),
        turn_speed: speed_of(inputs.schedule.turn_coordination_speed, system),
    };
    let section = Section::new("Control law");
    // The diagram that the law is stepped, linearised and written from.
    let section = match inputs.law() {
        Ok(table) => section.diagram(
            law_as_computed(&table),
            "The law as it is computed: the groups of its blocks, and what flows between them. \
             Exported code has these groups as its sections and these names.",
        ),
        Err(_) => section,
    };
    section
        .diagram(
            closed_loop(&labels),
            "The closed loop: sticks are in percent, V is true airspeed. After Fig. 10 of the \
             paper on the CoAX 2D.",
        )
        .diagram(
            outer_loop(&labels),
            "The outer loop: translational rate command, passing over to coordinated turns. After \
             Fig. 11 of the paper on the CoAX 2D.",
        )
        .diagram(
            inner_loop(&labels),
            "The inner loop: attitude command in roll and pitch, rate command in yaw and heave. \
             Commands go through the exact inverse, feedback through an allocation of its own, \
             with a share κ of the velocity feedback. After Fig. 12 of that paper.",
        )
}

/// The groups of the law's blocks and what flows between them.
fn law_as_computed(table: &LawTable) -> Diagram {
    let mut law = table.diagram(0.01, [[0.0, 100.0]; 4], false, false);
    law.monitors.clear();
    let law = law.pruned();
    // Groups of inputs alone, or of what only engaging needs, have no box.
    let shown: Vec<usize> = (0..law.groups.len())
        .filter(|g| law.flow().iter().any(|(from, to, _)| from == g || to == g))
        .collect();
    let titles: Vec<&str> = shown.iter().map(|g| law.groups[*g].title.as_str()).collect();
    let place = |group: usize| shown.iter().position(|g| *g == group).unwrap_or_default();
    let flows: Vec<Flow> = law
        .flow()
        .into_iter()
        .map(|(from, to, names)| Flow {
            from: place(from),
            to: place(to),
            signals: names.into_iter().map(String::from).collect(),
        })
        .collect();
    computed(&titles, &flows)
}

/// Gains over speed.
pub(super) fn gains(inputs: &Inputs, study: &Study, system: System) -> Result<Section, CliError> {
    let table = inputs.law()?;
    let section = Section::new("Gain schedule");
    let figures = margin_figures(inputs, study, system)?;
    let section = figures.into_iter().filter(|(name, _)| name == "gains").fold(
        section,
        |section, (_, figure)| {
            section.figure(
                figure,
                "The tuned gains; between breakpoints they are interpolated linearly in true \
                 airspeed, beyond the ends they are held.",
            )
        },
    );
    Ok(section.folded("Gains as a table", gains_table(&table, system)))
}

fn margin_figures(
    inputs: &Inputs,
    study: &Study,
    system: System,
) -> Result<Vec<(String, Figure)>, CliError> {
    let empty = coaxdesign::control::verify::Verification {
        schema: String::new(),
        passed: false,
        nominal_passed: false,
        columns: Vec::new(),
        rows: Vec::new(),
        stability: Vec::new(),
        not_required: Vec::new(),
    };
    let verification = inputs.checked.as_ref().map_or(&empty, |c| &c.verification);
    design_figures(
        &inputs.law()?,
        &study.nodes,
        &inputs.requirements.specification,
        verification,
        system,
    )
}

/// Margins, sensitivities, Nyquist plots, authority; none without a verification.
pub(super) fn verification(
    inputs: &Inputs,
    study: &Study,
    system: System,
) -> Result<Option<Section>, CliError> {
    let Some(checked) = &inputs.checked else { return Ok(None) };
    let mut section = Section::new("Margins and verification");
    let mut loops = Figure::new("Open loops cut at the actuator, nominal model")
        .columns(3)
        .panel_size(235.0, 235.0)
        .legend(Legend::Above);
    for (name, figure) in margin_figures(inputs, study, system)? {
        let caption = match name.as_str() {
            "gains" => continue,
            _ if name.starts_with("nyquist") => {
                loops = loops.append(figure);
                continue;
            }
            "margins" => {
                "Least design margin of all models: 0 % is just met, 100 % is comfortable; \
                 underlined where missed."
            }
            "sensitivity" => {
                "Disturbance rejection of the nominal model at breakpoints over the speed range; where a curve must \
                 not go is shaded."
            }
            _ => "",
        };
        section = section.figure(figure, caption);
    }
    section = section
        .figure(
            loops,
            "Open loops with the region around −1 that the margins forbid; outer loops closed for \
             vx and vy, open for the others. Dots on the first curve name frequencies in rad/s.",
        )
        .folded(
            "Every check of the nominal model, and those missed by others",
            rows_table(&checked.verification, system, false),
        )
        .preformatted(
            "What the step commands ask of the blades",
            authority_text(&checked.authority, system).trim(),
        );
    let explained = explanations_text(&checked.explanations, system);
    if !explained.trim().is_empty() {
        section = section.preformatted("What limits the design", explained.trim());
    }
    let left_out = left_out_text(&checked.left_out, system);
    if !left_out.trim().is_empty() {
        section = section.preformatted("Left out", left_out.trim());
    }
    Ok(Some(section))
}

// ---------------------------------------------------------------------------
// Provenance

/// Where the design and the page came from.
pub(super) fn provenance(inputs: &Inputs) -> Section {
    let provenance = &inputs.schedule.provenance;
    let mut table = Table::new(
        "Files",
        vec![Column::text("file"), Column::text("hash (FNV-1a)"), Column::text("in the schedule")],
    );
    let same = |here: &str, there: &str| {
        if here == there {
            Cell::from("the same").highlight(Highlight::Good)
        } else {
            Cell::from(format!("another: {there}")).highlight(Highlight::Bad)
        }
    };
    let problem = problem_hash(&inputs.loaded);
    table.row([
        Cell::from(format!("problem {}, all files", inputs.problem_name)),
        problem.as_str().into(),
        same(&problem, &provenance.problem_hash),
    ]);
    for file in inputs.loaded.sources.files() {
        table.row([
            Cell::from(format!("  {}", file.name)),
            hash([file.text.as_str()]).into(),
            Cell::empty(),
        ]);
    }
    let spec = inputs.requirements.hash();
    table.row([
        Cell::from(format!("specification {}", inputs.requirements.name)),
        spec.as_str().into(),
        same(&spec, &provenance.specification_hash),
    ]);
    Section::new("Provenance")
        .facts(vec![
            ("schedule made by".into(), provenance.generator.clone()),
            ("page made by".into(), format!("coaxdesign {}", version::LONG)),
            ("schema of the schedule".into(), inputs.schedule.schema.clone()),
            ("interpolation".into(), inputs.schedule.interpolation.clone()),
        ])
        .table(table)
        .paragraph(
            "Everything on this page is computed from these files; the same files and program give \
             the same page, byte for byte.",
        )
}
