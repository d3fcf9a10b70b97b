//! `coaxdesign check`.

use clap::{Args, ValueEnum};
use serde_json::{Map, Value as Json, json};

use super::args::{ProblemArgs, UnitsArgs};
use super::error::color;
use super::{CliError, Outcome, output};
use coaxdesign::problem::{
    AzimuthModel, Direction, Effectiveness, FuselageAerodynamics, HubKind, InterferenceRule,
    Loaded, MassFlow, Problem, Rotor, STICKS, Spanwise, Station, TeeterEquation, TotalInflow, Wash,
    WingModel,
};
use coaxdesign::units::{Kind, System};
use coaxdesign::vehicle::azimuth::Turning;
use coaxdesign::vehicle::{Vehicle, summary};

/// Digits that are shown; JSON has them all.
const DIGITS: usize = 5;

/// Forms of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Aligned columns for people
    Table,
    /// JSON
    Json,
}

/// Check a problem file and show what was understood
#[derive(Debug, Args)]
pub struct Check {
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    units: UnitsArgs,
    /// Form of the answer
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
}

impl Check {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let loaded = self.problem.load()?;
        let system = self.units.of(Some(&loaded.problem));
        // Building the model finds what only the model knows, such as rotors
        // too close to one another.
        let vehicle = Vehicle::new(&loaded.problem)?;
        let sections = sections(&loaded.problem, &vehicle);
        match self.format {
            Format::Table => {
                output::print(&table(&loaded, &sections, system))?;
                for warning in &loaded.warnings {
                    output::note(&format!("\n{}", warning.render(color())));
                }
            }
            Format::Json => {
                let text = serde_json::to_string_pretty(&json(&loaded, &sections, system))
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                output::print(&(text + "\n"))?;
            }
        }
        Ok(Outcome::Done)
    }
}

/// One thing that was understood about a body.
enum Cell {
    Number(f64),
    Numbers(Vec<f64>),
    Text(String),
}

/// A row: a key for programs, a label for people, a cell a body.
struct Row {
    key: &'static str,
    label: &'static str,
    kind: Kind,
    cells: Vec<Option<Cell>>,
}

/// Bodies of one sort, with their rows.
struct Section {
    key: &'static str,
    /// Names of the bodies; a single empty name for the aircraft as a whole.
    names: Vec<String>,
    rows: Vec<Row>,
}

impl Section {
    fn new(key: &'static str, names: impl IntoIterator<Item = String>) -> Self {
        Self { key, names: names.into_iter().collect(), rows: Vec::new() }
    }

    fn row<T>(
        &mut self,
        key: &'static str,
        label: &'static str,
        kind: Kind,
        bodies: &[T],
        cell: impl Fn(&T) -> Option<Cell>,
    ) {
        self.rows.push(Row { key, label, kind, cells: bodies.iter().map(cell).collect() });
    }
}

fn number(value: f64) -> Option<Cell> {
    Some(Cell::Number(value))
}

fn text(value: &str) -> Option<Cell> {
    Some(Cell::Text(value.into()))
}

fn station(station: &Station) -> Option<Cell> {
    Some(Cell::Numbers(vec![station.fuselage_station, station.butt_line, station.water_line]))
}

/// A constant as a number, anything else as its values from root to tip.
fn spanwise(spanwise: &Spanwise) -> Option<Cell> {
    Some(match spanwise.value.as_slice() {
        [constant] => Cell::Number(*constant),
        several => Cell::Numbers(several.to_vec()),
    })
}

fn wash(wash: Wash) -> Option<Cell> {
    text(match wash {
        Wash::None => "none",
        Wash::Full => "full",
        Wash::AngleOnly => "angle_only",
    })
}

fn sections(problem: &Problem, vehicle: &Vehicle) -> Vec<Section> {
    vec![
        aircraft(problem),
        fuselages(problem),
        rotors(problem),
        wings(problem),
        inflow(problem),
        formulation(problem),
        interference(problem, vehicle),
        sticks(problem),
        mixes(problem),
    ]
}

fn aircraft(problem: &Problem) -> Section {
    let mut section = Section::new("aircraft", [String::new()]);
    let whole = summary::aircraft(problem);
    let mass = &problem.mass;
    let mut row = |key, label, kind, cell: Option<Cell>| {
        section.rows.push(Row { key, label, kind, cells: vec![cell] });
    };
    row("mass", "gross mass", Kind::Mass, number(mass.mass));
    row("weight", "weight", Kind::Force, number(whole.weight));
    row(
        "center_of_gravity",
        "centre of gravity (station, butt, water line)",
        Kind::Length,
        station(&mass.center_of_gravity),
    );
    row("i_xx", "I_xx", Kind::Inertia, number(mass.i_xx));
    row("i_yy", "I_yy", Kind::Inertia, number(mass.i_yy));
    row("i_zz", "I_zz", Kind::Inertia, number(mass.i_zz));
    row("i_xz", "I_xz", Kind::Inertia, number(mass.i_xz));
    row("i_xy", "I_xy", Kind::Inertia, number(mass.i_xy));
    row("i_yz", "I_yz", Kind::Inertia, number(mass.i_yz));
    row(
        "principal_inertia",
        "principal moments of inertia",
        Kind::Inertia,
        Some(Cell::Numbers(whole.principal_inertia.to_vec())),
    );
    row("disk_area", "sum of disk areas", Kind::Area, number(whole.disk_area));
    row(
        "disk_loading",
        "weight over the sum of disk areas",
        Kind::Pressure,
        number(whole.disk_loading),
    );
    row("altitude", "pressure altitude", Kind::Length, number(problem.atmosphere.altitude));
    row("temperature", "air temperature", Kind::Temperature, number(whole.air.temperature));
    row("density", "air density", Kind::Density, number(whole.air.density));
    row("sound_speed", "speed of sound", Kind::Velocity, number(whole.air.sound_speed));
    section
}

fn fuselages(problem: &Problem) -> Section {
    let bodies = &problem.fuselages;
    let mut section = Section::new("fuselages", bodies.iter().map(|body| body.name.clone()));
    section.row("position", "position (station, butt, water line)", Kind::Length, bodies, |body| {
        station(&body.position)
    });
    section.row("model", "model", Kind::Dimensionless, bodies, |body| {
        text(match body.aerodynamics {
            FuselageAerodynamics::FlatPlate { .. } => "flat_plate",
            FuselageAerodynamics::Table(_) => "table",
        })
    });
    section.row(
        "drag_area",
        "drag area x, y, z, coefficient included",
        Kind::Area,
        bodies,
        |body| match &body.aerodynamics {
            FuselageAerodynamics::FlatPlate { area, drag_coefficient } => {
                Some(Cell::Numbers(area.iter().zip(drag_coefficient).map(|(s, c)| s * c).collect()))
            }
            FuselageAerodynamics::Table(_) => None,
        },
    );
    section.row("wash", "rotor wash", Kind::Dimensionless, bodies, |body| wash(body.wash));
    section
}

fn rotors(problem: &Problem) -> Section {
    let bodies: Vec<_> =
        problem.rotors.iter().map(|rotor| (rotor, summary::rotor(problem, rotor))).collect();
    let mut section = Section::new("rotors", problem.rotors.iter().map(|r| r.name.clone()));
    let one = Kind::Dimensionless;
    section.row("position", "hub (station, butt, water line)", Kind::Length, &bodies, |(r, _)| {
        station(&r.hub)
    });
    section.row(
        "hub_from_center_of_gravity",
        "hub from the centre of gravity, body x, y, z",
        Kind::Length,
        &bodies,
        |(_, s)| Some(Cell::Numbers(s.hub_from_center_of_gravity.to_vec())),
    );
    section.row("cant", "shaft cant", Kind::Angle, &bodies, |(r, _)| number(r.cant));
    section.row("tilt", "shaft tilt, aft", Kind::Angle, &bodies, |(r, _)| number(r.tilt));
    section.row("direction", "direction", one, &bodies, |(r, _)| {
        text(match r.direction {
            Direction::CounterClockwise => "counter-clockwise",
            Direction::Clockwise => "clockwise",
        })
    });
    section.row("hub", "hub kind", one, &bodies, |(r, _)| text(r.hub_kind.word()));
    section.row("blades", "blades", one, &bodies, |(r, _)| number(r.blades as f64));
    section.row("radius", "radius", Kind::Length, &bodies, |(r, _)| number(r.radius));
    section.row("chord", "chord", Kind::Length, &bodies, |(r, _)| spanwise(&r.chord));
    section.row("twist", "twist along the span", Kind::Angle, &bodies, |(r, _)| spanwise(&r.twist));
    section.row("solidity", "solidity", one, &bodies, |(_, s)| number(s.solidity));
    section.row("disk_area", "disk area", Kind::Area, &bodies, |(_, s)| number(s.disk_area));
    section.row("speed", "speed", Kind::AngularRateRad, &bodies, |(r, _)| number(r.speed));
    let turning = Turning::of(problem).ok();
    let models = (0..bodies.len()).map(|k| turning.as_ref().map(|turning| turning.models[k]));
    section.row("azimuth", "azimuth", one, &models.collect::<Vec<_>>(), |model| {
        text(match model.as_ref()? {
            AzimuthModel::Resolved => "resolved",
            AzimuthModel::Averaged => "averaged",
        })
    });
    section.row("tip_speed", "tip speed", Kind::Velocity, &bodies, |(_, s)| number(s.tip_speed));
    section.row("tip_mach", "tip Mach number in hover", one, &bodies, |(_, s)| number(s.tip_mach));
    section.row(
        "lift_slope",
        "lift slope of the section at 0.75 R",
        Kind::PerAngle,
        &bodies,
        |(_, s)| number(s.lift_slope),
    );
    section
        .row("lock_number", "Lock number", one, &bodies, |(_, s)| s.lock_number.map(Cell::Number));
    section.row(
        "teeter_frequency_per_rev",
        "teeter frequency in vacuo, per rev",
        one,
        &bodies,
        |(_, s)| s.teeter_frequency.map(Cell::Number),
    );
    section.row("precone", "precone", Kind::Angle, &bodies, |(r, _)| number(r.precone));
    section.row("undersling", "undersling", Kind::Length, &bodies, |(r, _)| match r.hub_kind {
        HubKind::Teetering { undersling, .. } | HubKind::Gimballed { undersling, .. } => {
            number(undersling)
        }
        _ => None,
    });
    let flapping = |r: &Rotor| r.flap_frequency().is_some();
    section.row("hinge_offset", "flap hinge offset", Kind::Length, &bodies, |(r, _)| {
        flapping(r).then(|| Cell::Number(r.hub_kind.hinge_offset()))
    });
    section.row(
        "flap_spring",
        "flap spring of a blade",
        Kind::AngularStiffness,
        &bodies,
        |(r, _)| flapping(r).then(|| Cell::Number(r.flap_spring())),
    );
    section.row(
        "flap_frequency_per_rev",
        "flap frequency in vacuo, per rev",
        one,
        &bodies,
        |(r, _)| r.flap_frequency().map(Cell::Number),
    );
    section.row("blade_mass", "blade mass", Kind::Mass, &bodies, |(r, _)| number(r.blade_mass));
    section.row(
        "blade_first_moment",
        "blade first mass moment",
        Kind::FirstMoment,
        &bodies,
        |(r, _)| number(r.blade_first_moment),
    );
    section.row(
        "blade_second_moment",
        "blade second mass moment",
        Kind::Inertia,
        &bodies,
        |(r, _)| number(r.blade_second_moment),
    );
    section.row("blade_mass_center", "centre of mass of a blade, r/R", one, &bodies, |(_, s)| {
        s.blade_mass_center.map(Cell::Number)
    });
    section
}

fn wings(problem: &Problem) -> Section {
    let bodies = &problem.wings;
    let mut section = Section::new("wings", bodies.iter().map(|body| body.name.clone()));
    section.row(
        "aerodynamic_center",
        "aerodynamic centre (station, butt, water line)",
        Kind::Length,
        bodies,
        |body| station(&body.aerodynamic_center),
    );
    section.row("span", "span", Kind::Length, bodies, |body| number(body.span));
    section.row("chord", "chord", Kind::Length, bodies, |body| spanwise(&body.chord));
    section.row("area", "area", Kind::Area, bodies, |body| number(summary::wing_area(body)));
    section.row("aspect_ratio", "aspect ratio", Kind::Dimensionless, bodies, |body| {
        number(body.span * body.span / summary::wing_area(body))
    });
    section.row("incidence", "incidence", Kind::Angle, bodies, |body| number(body.incidence));
    section.row("cant", "cant", Kind::Angle, bodies, |body| number(body.cant));
    section.row("dihedral", "dihedral", Kind::Angle, bodies, |body| number(body.dihedral));
    section.row("model", "model", Kind::Dimensionless, bodies, |body| {
        text(match body.model {
            WingModel::Elements { .. } => "strips",
            WingModel::Finite { .. } => "finite",
        })
    });
    section.row("wash", "rotor wash", Kind::Dimensionless, bodies, |body| wash(body.wash));
    if bodies.iter().any(|body| body.surface.is_some()) {
        section.row(
            "effectiveness",
            "effectiveness of the control surface",
            Kind::Dimensionless,
            bodies,
            |body| {
                body.surface.as_ref().and_then(|surface| match &surface.effectiveness {
                    Effectiveness::Constant(tau) => number(*tau),
                    Effectiveness::Table { .. } => None,
                })
            },
        );
        section.row(
            "deflection",
            "deflection for lat, lon, col, ped",
            Kind::AnglePerPercent,
            bodies,
            |body| body.surface.as_ref().map(|surface| Cell::Numbers(surface.gearing.to_vec())),
        );
        section.row("deflection_limits", "limits of the deflection", Kind::Angle, bodies, |body| {
            body.surface.as_ref().map(|surface| Cell::Numbers(surface.limits.to_vec()))
        });
    }
    section
}

fn inflow(problem: &Problem) -> Section {
    let mut section = Section::new("inflow", [String::new()]);
    let options = &problem.inflow;
    let one = Kind::Dimensionless;
    let mut row = |key, label, kind, cell: Option<Cell>| {
        section.rows.push(Row { key, label, kind, cells: vec![cell] });
    };
    let on = if options.interactions { "on" } else { "off" };
    row("interactions", "rotor-on-rotor interactions", one, text(on));
    let mass_flow = match options.mass_flow {
        MassFlow::SelfInduced => "self",
        MassFlow::Total => "total",
    };
    row("mass_flow", "mass flow", one, text(mass_flow));
    let (total, bandwidth) = match options.total_inflow {
        TotalInflow::Algebraic => ("algebraic", None),
        TotalInflow::LowPass { bandwidth } => ("lowpass", number(bandwidth)),
    };
    row("total_inflow", "total inflow", one, text(total));
    row("lowpass_bandwidth", "bandwidth of the low-pass", Kind::Frequency, bandwidth);
    section
}

/// Published formulas in place of exact ones.
fn formulation(problem: &Problem) -> Section {
    let mut section = Section::new("formulation", [String::new()]);
    let formulation = &problem.formulation;
    let one = Kind::Dimensionless;
    let mut row = |key, label, cell: Option<Cell>| {
        section.rows.push(Row { key, label, kind: one, cells: vec![cell] });
    };
    let yes_no = |yes: bool| text(if yes { "yes" } else { "no" });
    row("teeter_torque_tilt", "in-plane moments tilt", yes_no(formulation.teeter_torque_tilt));
    let equation = match formulation.teeter_equation {
        TeeterEquation::Exact => "exact",
        TeeterEquation::SmallAngles => "small_angles",
    };
    row("teeter_equation", "teeter equation", text(equation));
    let (rule, radii, skews) = match formulation.interference_rule {
        InterferenceRule::Converged => ("converged", None, None),
        InterferenceRule::Trapezoid { radii, skews } => ("trapezoid", Some(radii), Some(skews)),
    };
    let count = |count: Option<usize>| count.and_then(|count| number(count as f64));
    row("interference_rule", "interference rule", text(rule));
    row("interference_radii", "radii of the rule", count(radii));
    row("interference_skews", "skew angles of the rule", count(skews));
    row(
        "mirrored_interference",
        "lateral interference changes sign",
        yes_no(formulation.mirrored_interference),
    );
    section
}

/// What each rotor's wake does to each other rotor in hover.
fn interference(problem: &Problem, vehicle: &Vehicle) -> Section {
    let rotors = &problem.rotors;
    let mut pairs = Vec::new();
    for (source, from) in rotors.iter().enumerate() {
        for (receiver, to) in rotors.iter().enumerate() {
            if let Some(map) = vehicle.interference(receiver, source) {
                pairs.push((format!("{}_on_{}", from.name, to.name), map));
            }
        }
    }
    let mut section = Section::new("interference", pairs.iter().map(|(name, _)| name.clone()));
    section.row(
        "hover_uniform",
        "uniform inflow in hover, over the source's own",
        Kind::Dimensionless,
        &pairs,
        |(_, map)| number(summary::hover_interference(map)),
    );
    section
}

fn sticks(problem: &Problem) -> Section {
    let limits = problem.controls.stick_limits;
    let mut section = Section::new("sticks", STICKS.map(String::from));
    section.row("limits", "travel", Kind::Percent, &limits, |limits| {
        Some(Cell::Numbers(limits.to_vec()))
    });
    section
}

fn mixes(problem: &Problem) -> Section {
    let controls = &problem.controls;
    let mut section = Section::new("mix", problem.rotors.iter().map(|r| r.name.clone()));
    let gearing = Kind::AnglePerPercent;
    section.row("theta_0", "theta_0 for lat, lon, col, ped", gearing, &controls.mix, |mix| {
        Some(Cell::Numbers(mix.theta_0.to_vec()))
    });
    section.row("theta_1c", "theta_1c", gearing, &controls.mix, |mix| {
        Some(Cell::Numbers(mix.theta_1c.to_vec()))
    });
    section.row("theta_1s", "theta_1s", gearing, &controls.mix, |mix| {
        Some(Cell::Numbers(mix.theta_1s.to_vec()))
    });
    section.row(
        "rigging",
        "rigging theta_0, theta_1c, theta_1s",
        Kind::Angle,
        &controls.mix,
        |mix| Some(Cell::Numbers(mix.rigging.to_vec())),
    );
    section.row(
        "collective_limits",
        "limits of theta_0",
        Kind::Angle,
        &controls.collective_limits,
        |limits| Some(Cell::Numbers(limits.to_vec())),
    );
    section.row(
        "cyclic_limits",
        "limits of theta_1c and theta_1s",
        Kind::Angle,
        &controls.cyclic_limits,
        |limits| Some(Cell::Numbers(limits.to_vec())),
    );
    section
}

fn table(loaded: &Loaded, sections: &[Section], system: System) -> String {
    let problem = &loaded.problem;
    let mut all = format!("{}: {}\n", problem.name, problem.description);
    for section in sections.iter().filter(|section| !section.names.is_empty()) {
        let mut lines = Vec::new();
        let mut head = vec![section.key.to_string()];
        head.extend(section.names.iter().cloned());
        lines.push(head);
        for row in &section.rows {
            if row.cells.iter().all(Option::is_none) {
                continue;
            }
            let mut line = vec![format!("  {}", row.label)];
            line.extend(row.cells.iter().map(|cell| shown(cell.as_ref(), row.kind, system)));
            let unit = row.kind.symbol(system);
            // The unit is set left, behind a right-aligned last column.
            line.push(if unit == "-" { String::new() } else { unit.into() });
            lines.push(line);
        }
        // Units line up on their left edge.
        let unit_column = section.names.len() + 1;
        let widest =
            lines.iter().filter_map(|line| line.get(unit_column)).map(|u| u.chars().count());
        let widest = widest.max().unwrap_or(0);
        for line in &mut lines {
            if let Some(unit) = line.get_mut(unit_column) {
                *unit = format!("{unit:<widest$}");
            }
        }
        all += "\n";
        all += &output::aligned(&lines);
    }
    all
}

fn shown(cell: Option<&Cell>, kind: Kind, system: System) -> String {
    let one = |value: &f64| output::significant(kind.from_si(*value, system), DIGITS);
    match cell {
        None => "-".into(),
        Some(Cell::Text(text)) => text.clone(),
        Some(Cell::Number(value)) => one(value),
        Some(Cell::Numbers(values)) => values.iter().map(one).collect::<Vec<_>>().join(", "),
    }
}

fn json(loaded: &Loaded, sections: &[Section], system: System) -> Json {
    let mut root = Map::new();
    root.insert("schema".into(), json!("coaxdesign.check/1"));
    root.insert("name".into(), json!(loaded.problem.name));
    root.insert("description".into(), json!(loaded.problem.description));
    for section in sections {
        let body = |index: usize| {
            let mut values = Map::new();
            for row in &section.rows {
                let unit = row.kind.identifier(system);
                let one = |value: &f64| row.kind.from_si(*value, system);
                let (key, value) = match &row.cells[index] {
                    None => continue,
                    Some(Cell::Text(text)) => (row.key.to_string(), json!(text)),
                    Some(cell) => {
                        let value = match cell {
                            Cell::Numbers(values) => {
                                json!(values.iter().map(one).collect::<Vec<_>>())
                            }
                            Cell::Number(value) => json!(one(value)),
                            Cell::Text(text) => json!(text),
                        };
                        let key = match row.kind {
                            Kind::Dimensionless => row.key.into(),
                            _ => format!("{}_{unit}", row.key),
                        };
                        (key, value)
                    }
                };
                values.insert(key, value);
            }
            Json::Object(values)
        };
        let value = match section.names.as_slice() {
            [whole] if whole.is_empty() => body(0),
            names => Json::Object(
                names.iter().enumerate().map(|(index, name)| (name.clone(), body(index))).collect(),
            ),
        };
        root.insert(section.key.into(), value);
    }
    let warnings: Vec<Json> = loaded
        .warnings
        .iter()
        .map(|warning| {
            json!({
                "file": warning.file,
                "line": warning.line,
                "column": warning.column,
                "key": warning.key,
                "message": warning.message,
                "help": warning.help,
            })
        })
        .collect();
    root.insert("warnings".into(), json!(warnings));
    let files: Vec<&str> = loaded.sources.files().iter().map(|file| file.name.as_str()).collect();
    root.insert("files".into(), json!(files));
    Json::Object(root)
}
