//! `coaxdesign tune-gains`.

use clap::{Args, ValueEnum};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::args::{Format, FormatArgs, ModelsArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::designs::{Chosen, lock, write_models};
use super::watch::Watch;
use super::{CliError, Outcome, output};
use coaxdesign::control::axis::{Axis, Channel};
use coaxdesign::control::design::Design;
use coaxdesign::control::explain::{Explanation, Target, TargetReport};
use coaxdesign::control::law::LawTable;
use coaxdesign::control::misses::misses;
use coaxdesign::control::models::LeftOut;
use coaxdesign::control::plant::{ModelClass, ModelSet};
use coaxdesign::control::spec::Specification;
use coaxdesign::control::tuning::{DRIFT_GROWTH, Price, TuningStats};
use coaxdesign::control::verify::{Authority, Fading, NotRequired, Verdict, Verification};
use coaxdesign::lti::LtiSet;
use coaxdesign::pipeline::directory::ModelInputs;
use coaxdesign::pipeline::{
    PRICE_SHOWN, Requirements, TuneOptions, Tuned, Verified, tune, tune_models,
    verification_document,
};
use coaxdesign::report::figures::{
    Curve, CurvePanel, ExclusionRegion, FrequencyResponse, MarginMap, Marks, SensitivityPanel,
    gain_schedule_figure, heatmap_figure, nyquist_figure, sensitivity_figure,
};
use coaxdesign::report::plot::Figure;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::units::{Kind, System};

/// Tune a gain schedule to a specification, verify it densely, and explain what is missed
///
/// Trims and linearises every model at every speed, tunes the gains of all speeds together by
/// conic programs, and verifies the result at the speeds and between them.
#[derive(Debug, Args)]
pub struct Tune {
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    models: ModelsArgs,
    #[command(flatten)]
    spec: SpecArgs,
    /// Directory of the design: schedule.json, verification.json, and all that made them. A design
    /// that is there keeps its aircraft and its specification unless others are named
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace files that are already there
    #[arg(long)]
    force: bool,
    /// Outer loops to tune; the inner axes are always tuned
    #[arg(long = "axis", value_enum, value_name = "AXIS")]
    axes: Vec<AxisName>,
    /// Write plots of the gains, margins and loops to the output directory, as SVG
    #[arg(long, alias = "plot", requires = "output")]
    plots: bool,
    /// Show the price of every target at every speed, and explain the hardest speed of every axis
    #[arg(long)]
    explain: bool,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// Axes by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AxisName {
    /// Bank angle
    Roll,
    /// Pitch angle
    Pitch,
    /// Yaw rate
    Yaw,
    /// Vertical velocity
    Heave,
    /// Forward velocity
    Vx,
    /// Velocity to the right
    Vy,
}

impl AxisName {
    fn channel(self) -> Channel {
        Channel::ALL[self as usize]
    }
}

/// `--spec` and `--nominal-only`.
#[derive(Debug, Clone, Args)]
pub struct SpecArgs {
    /// Specification file [default: that of the design in -o, else the built-in Level 1 targets]
    #[arg(long, value_name = "SPEC")]
    spec: Option<PathBuf>,
    /// Use only the first nominal model of the specification
    #[arg(long)]
    nominal_only: bool,
}

impl SpecArgs {
    /// A specification file, or the built-in one, with all its models.
    pub(super) fn of(spec: Option<PathBuf>) -> Self {
        Self { spec, nominal_only: false }
    }

    /// Whether a file is named.
    pub(super) fn is_given(&self) -> bool {
        self.spec.is_some()
    }

    /// Reads the specification.
    pub(super) fn load(&self) -> Result<Requirements, CliError> {
        Ok(self.reduced(match &self.spec {
            None => Requirements::builtin()?,
            Some(path) => {
                output::is_input(path);
                Requirements::load(path)?
            }
        }))
    }

    /// A specification with the models that are asked for.
    pub(super) fn reduced(&self, requirements: Requirements) -> Requirements {
        if self.nominal_only { requirements.nominal_only() } else { requirements }
    }
}

/// A mistake of the user, and what to do about it.
pub(super) fn usage(message: String, help: &str) -> CliError {
    CliError::Usage { message, help: help.into() }
}

impl Tune {
    /// The choices that shape the design, for its note.
    fn options(&self) -> BTreeMap<String, String> {
        let mut options = BTreeMap::new();
        if !self.axes.is_empty() {
            let axes: Vec<&str> = self.axes.iter().map(|a| a.channel().name()).collect();
            options.insert("axis".into(), axes.join(","));
        }
        if self.spec.nominal_only {
            options.insert("nominal-only".into(), "true".into());
        }
        options
    }

    /// The specification; and the set of models with the path that named it:
    /// that of the arguments, else that of the design in -o.
    fn models(&self, quiet: bool) -> Result<(Requirements, Option<(LtiSet, PathBuf)>), CliError> {
        let kept = match &self.output {
            Some(directory) if self.models.models.is_none() && self.problem.file.is_none() => {
                ModelInputs::read(directory)?
            }
            _ => None,
        };
        if let Some(kept) = kept {
            let origin = kept.note.aircraft.problem.origin.clone();
            let own = if self.spec.is_given() {
                self.spec.load()?
            } else {
                let name = kept.note.specification.origin.clone();
                self.spec.reduced(Requirements { name, ..kept.requirements })
            };
            return Ok((own, Some((kept.set, origin.into()))));
        }
        let own = self.spec.load()?;
        let mapping = &own.specification.models_from;
        let set = self.models.load(&self.problem, mapping, &own.name, quiet)?;
        let named = self.models.models.clone().or_else(|| mapping.path.clone()).unwrap_or_default();
        Ok((own, set.map(|set| (set, named))))
    }

    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let _lock = self.output.as_deref().map(lock).transpose()?;
        let quiet = self.run.quiet;
        let (own, set) = self.models(quiet)?;
        let chosen = match &set {
            Some(_) => None,
            None => Some(Chosen::new(&self.problem, &self.spec, self.output.as_deref(), quiet)?),
        };
        let requirements = chosen.as_ref().map_or(&own, |chosen| &chosen.requirements);
        let system = self.units.of(chosen.as_ref().map(|chosen| &chosen.loaded.problem));
        let paths =
            self.output.as_ref().map(|d| Paths::new(d, &requirements.specification, self.plots));
        if let Some(paths) = &paths {
            for path in paths.all() {
                if path.exists() && !self.force {
                    return Err(CliError::Exists { path });
                }
            }
        }
        let options = TuneOptions {
            channels: self.axes.iter().map(|a| a.channel()).collect(),
            explain_all: self.explain,
        };
        let watch = Watch::new(self.run.quiet);
        let tuned = match (&set, &chosen) {
            (Some((set, _)), _) => tune_models(set, requirements, &options, &watch)?,
            (None, Some(chosen)) => tune(&chosen.loaded, requirements, &options, &watch)?,
            (None, None) => {
                return Err(CliError::Internal("there is neither aircraft nor model".into()));
            }
        };
        let spec = &requirements.specification;
        let Tuned { design, nodes, verified, explanations, .. } = &tuned;
        if !self.run.quiet {
            output::note(&(effort(&design.tuning.stats) + "\n"));
        }
        let met = verified.met();
        let prices = &design.tuning.prices;
        let json_text = || verification_text(verified, explanations, prices);
        if let Some(paths) = &paths {
            let mut files = design_files(&tuned)?;
            if self.plots {
                for (name, figure) in
                    figures(&design.table, nodes, spec, &verified.verification, system)?
                {
                    files.push((format!("{name}.svg"), figure.to_svg().into_bytes()));
                }
            }
            match &chosen {
                Some(chosen) => {
                    let mut note = chosen.note();
                    note.options = self.options();
                    chosen.write(&paths.directory, &note, files, self.force)?;
                }
                None => {
                    if let Some((set, origin)) = &set {
                        let options = self.options();
                        let directory = &paths.directory;
                        write_models(directory, set, origin, &own, options, files, self.force)?;
                    }
                }
            }
        }
        match self.format.shown() {
            Format::Json => {
                output::print(&json_text()?)?;
            }
            Format::Csv => {
                output::print(&rows_table(&verified.verification, system, true).to_csv())?
            }
            Format::Table => {
                let coloring = Coloring::for_stdout();
                let mut text = format!(
                    "aircraft {}, specification {}\n\n",
                    tuned.schedule.name, requirements.name
                );
                text += &lag_text(design, system);
                text += &gains_table(&design.table, system).to_text(coloring);
                text.push('\n');
                text += &report_text(&verified.verification, system, coloring);
                text += &authority_text(&verified.authority, system);
                if self.explain {
                    text.push('\n');
                    text += &prices_table(prices, system).to_text(coloring);
                }
                text += &explanations_text(explanations, system);
                text += &misses_text(&verified.verification, system);
                text += &left_out_text(&verified.left_out, system);
                if let Some(paths) = &paths {
                    text += &format!("Wrote {}.\n", paths.directory.display());
                }
                if !met {
                    text += "The specification is not met: this is the least-violating design \
                             that was found.\n";
                }
                output::print(&text)?;
            }
        }
        Ok(if met { Outcome::Done } else { Outcome::GoalMissed })
    }
}

/// What a tuning leaves behind: `schedule.json` and `verification.json`.
pub(super) fn design_files(tuned: &Tuned) -> Result<Vec<(String, Vec<u8>)>, CliError> {
    let schedule = tuned.schedule.to_json().map_err(|e| CliError::Internal(e.to_string()))?;
    let prices = &tuned.design.tuning.prices;
    let verification = verification_text(&tuned.verified, &tuned.explanations, prices)?;
    Ok(vec![
        ("schedule.json".into(), schedule.into_bytes()),
        ("verification.json".into(), verification.into_bytes()),
    ])
}

/// Files of a design.
struct Paths {
    directory: PathBuf,
    schedule: PathBuf,
    verification: PathBuf,
    plots: Vec<PathBuf>,
}

impl Paths {
    fn new(directory: &Path, spec: &Specification, plot: bool) -> Self {
        let mut plots = Vec::new();
        if plot {
            plots
                .extend(["gains.svg", "margins.svg", "sensitivity.svg"].map(|n| directory.join(n)));
            for c in &spec.channels {
                plots.push(directory.join(format!("nyquist-{}.svg", c.channel)));
            }
        }
        Self {
            schedule: directory.join("schedule.json"),
            verification: directory.join("verification.json"),
            directory: directory.into(),
            plots,
        }
    }

    fn all(&self) -> Vec<PathBuf> {
        let mut all = vec![self.schedule.clone(), self.verification.clone()];
        all.extend(self.plots.iter().cloned());
        all
    }
}

/// What the tuning took, for people.
fn effort(s: &TuningStats) -> String {
    format!(
        "tuning: {} programs solved in {} steps of at most {} rows; {:.1} s in the conic solver, \
         {:.1} s in assembly and checks, summed over threads",
        s.programs, s.solves, s.largest_rows, s.solver_time, s.assembly_time
    )
}

fn prices_table(prices: &[Price], system: System) -> Table {
    let unit = Kind::Airspeed.symbol(system);
    let mut columns =
        vec![Column::text("axis"), Column::number("speed", unit, Digits::Decimals(0))];
    for t in Target::PRICED {
        let heading = format!("{}, {}", t.name(), t.unit_tightening().1);
        columns.push(Column::number(&heading, "%", Digits::Decimals(2)));
    }
    let mut table =
        Table::new("Prices of the targets in actuator activity, from the duals", columns);
    for of_speed in prices.chunk_by(|a, b| a.channel == b.channel && a.speed == b.speed) {
        let Some(first) = of_speed.first() else { continue };
        let mut cells: Vec<Cell> =
            vec![first.channel.name().into(), speed(first.speed, system).into()];
        for p in of_speed {
            let shown = p.percent >= PRICE_SHOWN;
            cells.push(if shown { p.percent.into() } else { Cell::empty() });
        }
        table.row(cells);
    }
    table
}

/// `verification.json` as text.
pub(super) fn verification_text(
    verified: &Verified,
    explanations: &[Explanation],
    prices: &[Price],
) -> Result<String, CliError> {
    let value = verification_document(verified, explanations, prices)
        .map_err(|e| CliError::Internal(e.to_string()))?;
    let text =
        serde_json::to_string_pretty(&value).map_err(|e| CliError::Internal(e.to_string()))?;
    Ok(text + "\n")
}

fn speed(value: f64, system: System) -> f64 {
    Kind::Airspeed.from_si(value, system)
}

fn speed_text(value: f64, system: System) -> String {
    format!("{:.0} {}", speed(value, system), Kind::Airspeed.symbol(system))
}

fn lag_text(design: &Design, system: System) -> String {
    let mut text = String::from(
        "Lag law: what the hardware and the rotor allow at a phase margin of 45 deg and gain \
         margins of 6 dB\n",
    );
    for (axis, v, lag) in &design.lag {
        text += &format!(
            "  {axis:5} {:>7}: equivalent delay {:.3} s, DRB up to about {:.2} rad/s, crossover \
             {:.1} rad/s\n",
            speed_text(*v, system),
            lag.equivalent_delay_s,
            lag.largest_drb_rad_s,
            lag.crossover_rad_s
        );
    }
    text.push('\n');
    text
}

pub(super) fn gains_table(table: &LawTable, system: System) -> Table {
    let unit = Kind::Airspeed.symbol(system);
    let mut columns = vec![Column::number("speed", unit, Digits::Decimals(0))];
    let digits = Digits::Significant(4);
    for c in Channel::ALL {
        for g in c.gains() {
            let letter = ["K_D", "K_P", "K_I"][g.index()];
            columns.push(Column::number(&format!("{c} {letter}"), "", digits));
        }
    }
    let mut out = Table::new("Gains", columns);
    for p in table.points() {
        let mut cells: Vec<Cell> = vec![speed(p.speed, system).into()];
        for c in Channel::ALL {
            for v in p.gains[c.index()].values(c) {
                cells.push(if p.gains[c.index()] == Default::default() {
                    Cell::empty()
                } else {
                    v.into()
                });
            }
        }
        out.row(cells);
    }
    out
}

/// Rows of a verification; only the first model's unless `all`.
pub(super) fn rows_table(v: &Verification, system: System, all: bool) -> Table {
    let unit = Kind::Airspeed.symbol(system);
    let two = Digits::Decimals(2);
    let one = Digits::Decimals(1);
    let columns = vec![
        Column::text("axis"),
        Column::number("speed", unit, Digits::Decimals(0)),
        Column::text("model"),
        Column::number("DRB", "rad/s", Digits::Decimals(3)),
        Column::number("DRP", "dB", two),
        Column::number("crossover", "rad/s", two),
        Column::number("GM up", "dB", one),
        Column::number("GM down", "dB", one),
        Column::number("PM", "deg", one),
        Column::number("disk", "", two),
        Column::number("activity", "%", Digits::Significant(4)),
        Column::number("design margin", "%", Digits::Decimals(0)),
        Column::text("binding"),
        Column::text(""),
    ];
    let first = v.rows.first().map(|r| r.model.clone()).unwrap_or_default();
    let title = if all { "Verification" } else { "Verification, nominal model" };
    let mut table = Table::new(title, columns);
    let mut rows: Vec<_> = v.rows.iter().filter(|r| all || r.model == first || !r.passed).collect();
    let place = |name: &str| Channel::ALL.iter().position(|c| c.name() == name);
    rows.sort_by(|a, b| {
        place(&a.axis).cmp(&place(&b.axis)).then(a.speed_m_s.total_cmp(&b.speed_m_s))
    });
    for r in rows {
        let word = if r.passed { "met" } else { "MISSED" };
        let highlight = if r.passed { Highlight::Good } else { Highlight::Bad };
        table.row([
            Cell::from(r.axis.as_str()),
            speed(r.speed_m_s, system).into(),
            r.model.as_str().into(),
            r.drb_rad_s.into(),
            r.drp_db.into(),
            r.crossover_rad_s.into(),
            r.gm_up_db.into(),
            r.gm_down_db.into(),
            r.pm_deg.into(),
            r.disk_margin.into(),
            r.activity.into(),
            r.design_margin_percent.into(),
            r.binding.as_deref().unwrap_or("").into(),
            Cell::from(word).highlight(highlight),
        ]);
    }
    table
}

pub(super) fn report_text(v: &Verification, system: System, coloring: Coloring) -> String {
    let mut text = rows_table(v, system, false).to_text(coloring);
    let count =
        |f: &dyn Fn(&&coaxdesign::control::verify::Row) -> bool| v.rows.iter().filter(f).count();
    let nominal = |r: &&coaxdesign::control::verify::Row| r.class == ModelClass::Nominal;
    let verdict = |verdict: Verdict| v.stability.iter().filter(move |s| s.verdict == verdict);
    text += &format!(
        "\n{} of {} nominal rows met, {} of {} off-nominal rows met, {} of {} closed loops \
         stable.\n",
        count(&|r| nominal(r) && r.passed),
        count(&nominal),
        count(&|r| !nominal(r) && r.passed),
        count(&|r| !nominal(r)),
        verdict(Verdict::Stable).count(),
        v.stability.len()
    );
    for line in not_required_texts(&v.not_required, system) {
        text += &format!("  {line}\n");
    }
    for s in v.stability.iter().filter(|s| s.verdict == Verdict::Unsure) {
        text += &format!(
            "  not shown stable: model {} at {}, outer loops {}: largest real part {:.2e} 1/s, \
             change on refining the delay {:.1e} 1/s\n",
            s.model,
            speed_text(s.speed_m_s, system),
            if s.outer_loops { "closed" } else { "open" },
            s.growth_per_s,
            s.pade_change_per_s
        );
    }
    if v.stability.iter().any(|s| !s.growing_modes.is_empty()) {
        text.push('\n');
        text += &growing_table(v, system).to_text(coloring);
        let drifts = verdict(Verdict::Drifts).count();
        if drifts > 0 {
            text += &format!(
                "  {drifts} closed loops pass as drifts: slower than {DRIFT_GROWTH} 1/s, with the \
                 outer loops open, and held where these are closed.\n"
            );
        }
    }
    text
}

/// Where outer loops are held to no requirement, and why; speeds at which one is
/// open stand in one line.
pub(super) fn not_required_texts(list: &[NotRequired], system: System) -> Vec<String> {
    let alike = |a: &NotRequired, b: &NotRequired| {
        a.axis == b.axis && a.reason == Fading::Open && b.reason == Fading::Open
    };
    let text = |group: &[NotRequired]| {
        let first = group.first()?;
        let speeds: Vec<String> =
            group.iter().map(|n| format!("{:.0}", speed(n.speed_m_s, system))).collect();
        let place = match first.reason {
            Fading::NoSpeed => String::new(),
            _ => format!(" at {} {}", speeds.join(", "), Kind::Airspeed.symbol(system)),
        };
        let left = match first.reason {
            Fading::TurnCoordination => {
                format!(" and leaves it {:.0} % of it", 100.0 * first.share)
            }
            _ => String::new(),
        };
        let why = first.reason.words();
        Some(format!("{}{place} is held to no requirement: {why}{left}", first.axis))
    };
    list.chunk_by(alike).filter_map(text).collect()
}

/// Modes that grow, every one of every loop.
fn growing_table(v: &Verification, system: System) -> Table {
    let mut table = Table::new(
        "Growing modes of the closed loops",
        vec![
            Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(0)),
            Column::text("model"),
            Column::text("outer loops"),
            Column::text("state"),
            Column::number("growth", "1/s", Digits::Decimals(5)),
            Column::number("frequency", "rad/s", Digits::Decimals(3)),
            Column::number("doubles in", "s", Digits::Decimals(0)),
            Column::text("verdict"),
        ],
    );
    for s in &v.stability {
        let (word, highlight) = match s.verdict {
            Verdict::Stable => ("stable", Highlight::Good),
            Verdict::Drifts => ("drift, held by the outer loops", Highlight::Good),
            Verdict::Unstable => ("UNSTABLE", Highlight::Bad),
            Verdict::Unsure => ("UNSURE", Highlight::Bad),
        };
        for m in &s.growing_modes {
            table.row([
                Cell::from(speed(s.speed_m_s, system)),
                s.model.as_str().into(),
                if s.outer_loops { "closed" } else { "open" }.into(),
                m.state.as_str().into(),
                m.growth_per_s.into(),
                m.frequency_rad_s.into(),
                m.time_to_double_s.into(),
                Cell::from(word).highlight(highlight),
            ]);
        }
    }
    table
}

/// What the steps ask for, by axis.
pub(super) fn authority_text(checks: &[Authority], system: System) -> String {
    if checks.is_empty() {
        return String::from(
            "\nAuthority is not checked: linear models say nothing of the blades' limits.\n",
        );
    }
    let mut text = String::from("\nAuthority: what the step commands ask of the blades\n");
    for axis in Axis::ALL {
        let of: Vec<&Authority> = checks.iter().filter(|c| c.axis == axis.name()).collect();
        let Some(worst) = of
            .iter()
            .min_by(|a, b| (a.largest_step / a.step).total_cmp(&(b.largest_step / b.step)))
        else {
            continue;
        };
        let list = |beyond: &dyn Fn(&&&Authority) -> bool| -> String {
            let speeds: Vec<String> = of
                .iter()
                .filter(beyond)
                .map(|c| format!("{:.0}", speed(c.speed_m_s, system)))
                .collect();
            if speeds.is_empty() {
                return "within".into();
            }
            format!("BEYOND at {} {}", speeds.join(", "), Kind::Airspeed.symbol(system))
        };
        let kind = match axis {
            Axis::Roll | Axis::Pitch => Kind::Angle,
            Axis::Yaw => Kind::AngularRate,
            Axis::Heave => Kind::ClimbRate,
        };
        let size = |v: f64| {
            let digits = if axis == Axis::Heave { 0 } else { 1 };
            format!("{:.digits$} {}", kind.from_si(v, system), kind.symbol(system))
        };
        let most = of.iter().map(|c| c.used_percent).fold(0.0, f64::max);
        let fastest = of.iter().map(|c| c.rate_deg_s).fold(0.0, f64::max);
        // Rotors of fixed pitch have no pitch rate.
        let rate = if fastest > 0.0 {
            let beyond = list(&|c| c.rate_deg_s > c.rate_limit_deg_s);
            format!("; blade pitch rate: {beyond}, at most {fastest:.0} deg/s")
        } else {
            String::new()
        };
        text += &format!(
            "  {:5} room: {}, at most {most:.0} % used{rate}\n        hardest at {}: of {} it \
             can do {} ({})\n",
            axis.name(),
            list(&|c| c.used_percent > 100.0),
            speed_text(worst.speed_m_s, system),
            size(worst.step),
            size(worst.largest_step),
            worst.control,
        );
    }
    text
}

pub(super) fn explanations_text(list: &[Explanation], system: System) -> String {
    list.iter().map(|e| explanation_text(e, system)).collect()
}

fn explanation_text(e: &Explanation, system: System) -> String {
    let place = if e.breakpoint { "at" } else { "between breakpoints, at" };
    let mut text = format!("\n{} {place} {}: ", e.axis, speed_text(e.speed_m_s, system));
    if e.met {
        text += "all targets are met. ";
        let priced: Vec<String> = e
            .targets
            .iter()
            .filter_map(|t| {
                let price = t.price_percent.filter(|p| *p >= PRICE_SHOWN)?;
                Some(format!("  {}: {} costs {price:.2} %\n", t.target.name(), t.price_of))
            })
            .collect();
        text += match priced.is_empty() {
            true => "None of them costs actuator activity.\n",
            false => "Prices in actuator activity:\n",
        };
        return text + &priced.concat();
    }
    if let Some([key, value]) = &e.remedy {
        text += &format!(
            "gains for this speed alone meet all targets; those of the design are tied to the \
             speeds beside it. The key is {key}, try {value}.\n"
        );
        for t in e.targets.iter().filter(|t| t.missed) {
            text += &format!("  {}\n", asked_and_reached(t));
        }
        return text;
    }
    text += "the targets cannot all be met here.\n";
    for t in e.targets.iter().filter(|t| t.missed) {
        text += &format!("  {}", asked_and_reached(t));
        text += &match (t.attainable, &t.set_to) {
            (Some(best), Some(value)) => {
                let more = t.reached.is_none_or(|v| (t.asked - best).abs() < (t.asked - v).abs());
                let most = if more {
                    format!("{best:.3} can be had")
                } else {
                    "no more can be had".into()
                };
                format!(
                    "; {most} with the others held{}. The key is {}, try {value}.\n",
                    bound_text(t),
                    t.key
                )
            }
            _ => format!(
                "; nothing near it can be had with the others held. The key is {}.\n",
                t.key
            ),
        };
    }
    let against: Vec<&TargetReport> =
        e.targets.iter().filter(|t| !t.missed && t.attainable.is_some()).collect();
    if against.is_empty() {
        text += "  No met target moved alone lets all be met.\n";
    }
    for t in against {
        if let (Some(best), Some(value)) = (t.attainable, &t.set_to) {
            text += &format!(
                "  or instead the {} of {} models: with {best:.3} {} in place of {:.3} all is met. \
                 The key is {}, try {value}.\n",
                t.target.name(),
                class_text(t.class),
                t.target.unit(),
                t.asked,
                t.key
            );
        }
    }
    text
}

fn class_text(class: ModelClass) -> &'static str {
    match class {
        ModelClass::Nominal => "nominal",
        ModelClass::OffNominal => "off-nominal",
    }
}

fn asked_and_reached(t: &TargetReport) -> String {
    let reached = t.reached.map_or_else(|| "no limit".into(), |v| format!("{v:.3}"));
    format!(
        "{} of {} models: asked {:.3} {}, reached {reached}",
        t.target.name(),
        class_text(t.class),
        t.asked,
        t.target.unit()
    )
}

/// What holds a target at its attainable value.
fn bound_text(t: &TargetReport) -> String {
    if t.bound_by.is_empty() {
        return String::new();
    }
    let names: Vec<String> = t
        .bound_by
        .iter()
        .map(|b| format!("{} of {} models", b.target.name(), class_text(b.class)))
        .collect();
    format!(", bound by {}", names.join(", "))
}

/// Every requirement that is missed: how far, where worst, and the key that
/// asks for it.
pub(super) fn misses_text(verification: &Verification, system: System) -> String {
    let found = misses(verification);
    if found.is_empty() {
        return String::new();
    }
    let mut text = String::from("\nMissed, worst first, with what these gains reach:\n");
    for m in &found {
        let class = class_text(m.class);
        let place = if m.breakpoint { "at" } else { "between breakpoints, at" };
        text += &format!(
            "  {} {}: asked {:.3}, reached {:.3} {place} {} with model {}; {} of {} {class} rows. \
             The key is {}",
            m.axis,
            m.requirement,
            m.asked,
            m.reached,
            speed_text(m.speed, system),
            m.model,
            m.rows[0],
            m.rows[1],
            m.key
        );
        text += &match m.factor {
            Some(factor) => format!(", times {factor:.3} to be met.\n"),
            None => ".\n".into(),
        };
    }
    text
}

pub(super) fn left_out_text(list: &[LeftOut], system: System) -> String {
    let mut text = String::new();
    for l in list {
        text += &format!(
            "Left out: model {} does not trim at {} ({}).\n",
            l.model,
            speed_text(l.speed, system),
            l.reason
        );
    }
    text
}

/// Decibels of a factor without the last digits' noise, for labels.
fn tidy_decibels(factor: f64) -> f64 {
    (coaxdesign::control::metrics::decibels(factor) * 1e9).round() / 1e9
}

/// Most speeds in one plot of loops.
const MOST_CURVES: usize = 4;

/// At most `most` of `count` places, evenly spread, the first and the last
/// among them.
fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most || most < 2 {
        return (0..count).collect();
    }
    (0..most).map(|i| i * (count - 1) / (most - 1)).collect()
}

/// Figures of a design by name: gains, margins, a Nyquist plot a channel,
/// sensitivity. `nodes` are the plants at the breakpoints, the nominal first.
pub(super) fn figures(
    table: &LawTable,
    nodes: &ModelSet,
    spec: &Specification,
    verification: &Verification,
    system: System,
) -> Result<Vec<(String, Figure)>, CliError> {
    use coaxdesign::control::closed_loop::{Closed, LawLoop, PlantLoop};
    use coaxdesign::control::loops::{Cut, FrequencyModel};
    let unit = Kind::Airspeed.symbol(system);
    let x: Vec<f64> = table.points().iter().map(|p| speed(p.speed, system)).collect();
    let mut panels = Vec::new();
    for c in &spec.channels {
        let channel = c.channel;
        let curves = channel
            .gains()
            .iter()
            .map(|g| Curve {
                name: ["K_{D}", "K_{P}", "K_{I}"][g.index()].into(),
                style: g.index(),
                x: x.clone(),
                y: table.points().iter().map(|p| p.gains[channel.index()].get(*g)).collect(),
                marks: Marks::With,
            })
            .collect();
        panels.push(CurvePanel {
            title: channel.name().into(),
            quantity: "gain".into(),
            unit: "1/s and powers".into(),
            minimum_span: 1e-3,
            curves,
        });
    }
    let mut out = Vec::new();
    out.push((
        "gains".to_string(),
        gain_schedule_figure("Gains over true airspeed", unit, &panels),
    ));
    // Least design margin over models, axis by speed.
    let mut speeds: Vec<f64> = verification.rows.iter().map(|r| r.speed_m_s).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    let names: Vec<String> = spec.channels.iter().map(|c| c.channel.name().to_string()).collect();
    let least = |axis: &str, v: f64| {
        verification
            .rows
            .iter()
            .filter(|r| r.axis == axis && (r.speed_m_s - v).abs() < 1e-6)
            .filter_map(|r| r.design_margin_percent)
            .fold(f64::NAN, f64::min)
    };
    let map = MarginMap {
        values: names.iter().map(|n| speeds.iter().map(|&v| least(n, v)).collect()).collect(),
        requirements: names,
        speeds: speeds.iter().map(|v| format!("{:.0}", speed(*v, system))).collect(),
        speed_unit: unit.into(),
        label: if spec.models.len() == 1 {
            format!("design margin of model {}, %", spec.models[0].info.name)
        } else {
            "least design margin of all models, %".into()
        },
        required: 0.0,
        decimals: 0,
    };
    out.push(("margins".to_string(), heatmap_figure("Design margin", &map)));
    let grid: std::sync::Arc<[f64]> =
        coaxdesign::control::tuning::default_grid(0.02, 60.0, 500).into();
    let mut sensitivities = Vec::new();
    for c in &spec.channels {
        let (mut loops, mut rejections) = (Vec::new(), Vec::new());
        // The same speeds in every plot, so that a style is a speed.
        for (style, &k) in spread(table.points().len(), MOST_CURVES).iter().enumerate() {
            if table.points()[k].gains[c.channel.index()] == Default::default() {
                continue;
            }
            let p = &table.points()[k];
            let frequency = FrequencyModel::new(&nodes.plants[k][0], spec.hardware, 0.0)
                .map_err(|e| CliError::Internal(e.to_string()))?;
            let outer = c.channel.is_outer();
            let cut = if outer { Cut::Channel } else { Cut::Effector };
            let law = LawLoop::new(table, p.speed, outer);
            let model = PlantLoop::new(&frequency, &law);
            let closed: Vec<Closed> = grid.iter().map(|&w| model.at(w)).collect();
            let response = |response| FrequencyResponse {
                name: speed_text(p.speed, system),
                style,
                frequency: grid.to_vec(),
                response,
            };
            loops.push(response(closed.iter().map(|at| at.cut(c.channel, cut)).collect()));
            rejections.push(response(closed.iter().map(|at| at.sensitivity(c.channel)).collect()));
        }
        let t = &c.spec.nominal;
        let region = ExclusionRegion {
            gain_margin_db: tidy_decibels(t.gain_up),
            phase_margin_deg: t.phase.to_degrees(),
        };
        let title = format!("{} loop, nominal model", c.channel);
        out.push((format!("nyquist-{}", c.channel), nyquist_figure(&title, &loops, Some(&region))));
        sensitivities.push(SensitivityPanel {
            title: c.channel.name().into(),
            bandwidth_spec: t.drb,
            peak_spec_db: t.drp.map(tidy_decibels),
            responses: rejections,
        });
    }
    out.push((
        "sensitivity".to_string(),
        sensitivity_figure("Disturbance rejection, nominal model", &sensitivities),
    ));
    Ok(out)
}
