//! Problems and their trims.

use std::path::PathBuf;
use std::sync::Arc;

use coaxdesign::pipeline;
use coaxdesign::problem::{self, Loaded, STICKS};
use coaxdesign::report::figures::{self, Channel, Marks, TrimSweep};
use coaxdesign::trim::{FlightCondition, Lateral, Status, TrimPoint};
use coaxdesign::units::{self, Kind, System};
use coaxdesign::vehicle::{Layout, Vehicle};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{Columns, shaped};
use crate::errors::{self, Finding};
use crate::run::run;

/// A checked problem, with the texts that it was read from.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Problem {
    pub loaded: Arc<Loaded>,
}

impl Problem {
    fn of(py: Python<'_>, loaded: Result<Loaded, problem::Report>) -> PyResult<Self> {
        loaded
            .map(|loaded| Self { loaded: Arc::new(loaded) })
            .map_err(|report| errors::report(py, "ProblemError", &report))
    }

    /// The problem with its interactions and altitude set, where they are.
    pub fn changed(&self, interactions: Option<bool>, altitude: Option<f64>) -> problem::Problem {
        let mut changed = self.loaded.problem.clone();
        if let Some(on) = interactions {
            changed.inflow.interactions = on;
        }
        if let Some(altitude) = altitude {
            changed.atmosphere.altitude = altitude;
        }
        changed
    }
}

#[pymethods]
impl Problem {
    /// A built-in problem.
    #[staticmethod]
    fn builtin(py: Python<'_>, name: &str) -> PyResult<Self> {
        Self::of(py, problem::builtin_named(name))
    }

    /// A problem file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Self::of(py, problem::load(path))
    }

    /// A text. Files that it names stand in `base`, or are the built-in ones.
    #[staticmethod]
    #[pyo3(signature = (text, base=None))]
    fn parse(py: Python<'_>, text: &str, base: Option<PathBuf>) -> PyResult<Self> {
        Self::of(
            py,
            match base {
                // The name tells where bases and tables are looked for, also
                // when the problem is read again elsewhere.
                Some(base) => {
                    problem::parse_str(&base.join("<text>").display().to_string(), text, &base)
                }
                None => problem::parse_beside_builtin("<text>", text),
            },
        )
    }

    /// Name of the aircraft.
    #[getter]
    fn name(&self) -> String {
        self.loaded.problem.name.clone()
    }

    /// Names of the rotors.
    #[getter]
    fn rotors(&self) -> Vec<String> {
        self.loaded.problem.rotors.iter().map(|rotor| rotor.name.clone()).collect()
    }

    /// Mass, kg.
    #[getter]
    fn mass(&self) -> f64 {
        self.loaded.problem.mass.mass
    }

    /// What is odd about the problem.
    #[getter]
    fn warnings(&self) -> Vec<Finding> {
        self.loaded.warnings.iter().map(errors::finding).collect()
    }

    /// The texts that it was read from, `(name, text)`, its own first.
    #[getter]
    fn files(&self) -> Vec<(String, String)> {
        let files = self.loaded.sources.files();
        files.iter().map(|file| (file.name.clone(), file.text.clone())).collect()
    }

    /// Hash of those texts, as results of it carry it.
    #[getter]
    fn hash(&self) -> String {
        pipeline::problem_hash(&self.loaded)
    }
}

/// A problem again from the texts of [`Problem::files`].
#[pyfunction]
pub fn reload(py: Python<'_>, files: Vec<(String, String)>) -> PyResult<Problem> {
    Problem::of(py, problem::reload(&files))
}

/// Names of the built-in problems.
#[pyfunction]
pub fn problem_names() -> Vec<&'static str> {
    problem::BUILTIN.to_vec()
}

/// A quantity with its unit, such as `"20 kt"`, in SI and radians; `kind` is
/// what it is to measure, by the name of the library's kind.
#[pyfunction]
pub fn quantity(py: Python<'_>, text: &str, kind: &str) -> PyResult<f64> {
    let known = Kind::ALL.into_iter().find(|known| format!("{known:?}") == kind);
    let kind = known.ok_or_else(|| {
        let names: Vec<String> = Kind::ALL.iter().map(|known| format!("{known:?}")).collect();
        let message = format!("{kind:?} is not a kind of quantity; one of {}", names.join(", "));
        errors::raise(py, "UnitError", &message)
    })?;
    units::parse_quantity(text, kind)
        .map_err(|error| errors::raise(py, "UnitError", &format!("{error}; {}", error.help())))
}

/// A flight condition but for its speed: rate of climb, rate of turn, sideslip,
/// bank, all SI and radians.
pub type Path = (f64, f64, Option<f64>, Option<f64>);

/// Flight conditions at these speeds.
pub fn conditions(
    py: Python<'_>,
    speeds: &[f64],
    (climb_rate, turn_rate, sideslip, bank): Path,
) -> PyResult<Vec<FlightCondition>> {
    let bad = |message: String| Err(errors::raise(py, "UnitError", &message));
    if let Some(speed) = speeds.iter().find(|speed| !(0.0..=340.0).contains(*speed)) {
        return bad(format!(
            "a speed of {speed} m/s is not between 0 and the speed of sound; kt(...) converts knots"
        ));
    }
    if sideslip.is_some() && bank.is_some() {
        return bad("sideslip and bank cannot both be held".into());
    }
    let angle = sideslip.or(bank).unwrap_or(0.0);
    if !(climb_rate.is_finite() && turn_rate.is_finite() && angle.abs() <= 1.3) {
        return bad(format!(
            "climb_rate {climb_rate} m/s, turn_rate {turn_rate} rad/s and an angle of {angle} rad \
             are no flight condition; deg(...) converts degrees"
        ));
    }
    let lateral = bank.map_or(Lateral::Sideslip(angle), Lateral::Bank);
    Ok(speeds
        .iter()
        .map(|speed| FlightCondition {
            // A vertical climb is flown along the flight path.
            airspeed: speed.max(climb_rate.abs()),
            climb_rate,
            turn_rate,
            lateral,
        })
        .collect())
}

/// Why a point is not plainly converged; empty where it is.
pub fn reason(status: &Status) -> String {
    match status {
        Status::Converged => String::new(),
        Status::BeyondLimits { controls } => {
            format!("beyond the limits of {}", controls.join(", "))
        }
        Status::Failed { equations, binding, reason } => {
            let mut text = reason.clone();
            if !equations.is_empty() {
                text += &format!("; equations not met: {}", equations.join(", "));
            }
            if !binding.is_empty() {
                text += &format!("; limits that bind: {}", binding.join(", "));
            }
            text
        }
    }
}

/// Columns, orbits, names and units of the states.
pub type Trims<'py> = (Bound<'py, PyDict>, Bound<'py, PyList>, Vec<(String, &'static str)>);

/// Trims at these speeds, m/s: columns, orbits (one array a point, steps by
/// states) and the states' names and units.
#[pyfunction]
#[pyo3(signature = (problem, speeds, path, interactions=None, altitude=None, progress=None))]
pub fn trim<'py>(
    py: Python<'py>,
    problem: &Problem,
    speeds: Vec<f64>,
    path: Path,
    interactions: Option<bool>,
    altitude: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Trims<'py>> {
    let conditions = conditions(py, &speeds, path)?;
    let changed = problem.changed(interactions, altitude);
    let vehicle = Vehicle::new(&changed).map_err(|error| errors::vehicle(py, &error))?;
    let on = [changed.inflow.interactions];
    let points =
        run(py, progress.as_ref(), |ticker| pipeline::trim(&changed, &conditions, &on, ticker))?
            .map_err(|error| errors::pipeline(py, &error, "ProblemError"))?
            .remove(0);
    let columns = columns(py, &vehicle, &points)?;
    let orbits = points.iter().map(|point| {
        let values = point.orbit.iter().flatten().copied().collect();
        shaped(py, values, &[point.orbit.len(), vehicle.state_count()])
    });
    let orbits = PyList::new(py, orbits.collect::<PyResult<Vec<_>>>()?)?;
    Ok((columns, orbits, states(&vehicle)))
}

fn states(vehicle: &Vehicle) -> Vec<(String, &'static str)> {
    vehicle.layout.states.iter().map(|s| (s.name.clone(), s.kind.coherent())).collect()
}

/// Columns of trim points, SI and radians.
pub fn columns<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    points: &[TrimPoint],
) -> PyResult<Bound<'py, PyDict>> {
    let columns = Columns::new(py);
    let put = |name: &str, unit: &str, pick: &dyn Fn(&TrimPoint) -> f64| {
        columns.numbers(name, unit, points.iter().map(pick).collect())
    };
    let body = Layout::BODY;
    put("airspeed", "m/s", &|p| p.condition.airspeed)?;
    put("climb_rate", "m/s", &|p| p.condition.climb_rate)?;
    put("turn_rate", "rad/s", &|p| p.condition.turn_rate)?;
    columns.words("status", points.iter().map(|p| p.status.word().into()).collect())?;
    columns.words("reason", points.iter().map(|p| reason(&p.status)).collect())?;
    columns.flags("interactions", points.iter().map(|p| p.interactions).collect())?;
    put("phi", "rad", &|p| p.mean_state[body.roll])?;
    put("theta", "rad", &|p| p.mean_state[body.pitch])?;
    put("sideslip", "rad", &|p| p.sideslip)?;
    for (k, stick) in STICKS.iter().enumerate() {
        put(&format!("{stick}_stick"), "%", &|p| p.sticks[k])?;
    }
    for (k, rotor) in vehicle.rotors.iter().enumerate() {
        let put = |name: &str, unit: &str, pick: &dyn Fn(&TrimPoint) -> f64| {
            put(&format!("{}.{name}", rotor.name), unit, pick)
        };
        put("thrust", "N", &|p| p.rotors[k].thrust)?;
        put("torque", "N m", &|p| p.rotors[k].torque)?;
        put("power", "W", &|p| p.rotors[k].power)?;
        put("c_t", "1", &|p| p.rotors[k].thrust_coefficient)?;
        put("c_p", "1", &|p| p.rotors[k].power_coefficient)?;
        for (i, name) in ["lambda_0", "lambda_1c", "lambda_1s"].iter().enumerate() {
            put(name, "1", &|p| p.rotors[k].inflow[i])?;
        }
        for (i, name) in ["lambda_s0", "lambda_s1c", "lambda_s1s"].iter().enumerate() {
            put(name, "1", &|p| p.rotors[k].self_inflow[i])?;
        }
        for (i, name) in ["beta_1c", "beta_1s"].iter().enumerate() {
            put(name, "rad", &|p| p.rotors[k].flapping[i])?;
        }
        for (i, name) in ["theta_0", "theta_1c", "theta_1s"].iter().enumerate() {
            put(name, "rad", &|p| p.rotors[k].pitch[i])?;
        }
    }
    put("power", "W", &|p| p.power.shaft)?;
    put("power.profile", "W", &|p| p.power.profile)?;
    put("power.induced", "W", &|p| p.power.induced)?;
    put("power.parasite", "W", &|p| p.power.parasite)?;
    put("power.climb", "W", &|p| p.power.climb)?;
    let least = |p: &TrimPoint| {
        let margins = p.margins.iter().map(|m| (m.fraction(), m.control.clone()));
        margins.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, String::new()))
    };
    put("margin", "1", &|p| least(p).0)?;
    columns.words("margin_of", points.iter().map(|p| least(p).1).collect())?;
    put("residual_norm", "1", &|p| p.residual_norm)?;
    put("step_error", "1", &|p| p.step_error)?;
    columns.counts("iterations", points.iter().map(|p| p.iterations as i64).collect())?;
    columns.counts("steps", points.iter().map(|p| p.steps as i64).collect())?;
    Ok(columns.finish())
}

/// The trim figure of columns in SI and radians: speeds, pitch, roll, sticks,
/// power, and the thrust of each rotor.
#[pyfunction]
pub fn trim_svg(
    title: &str,
    us: bool,
    speed: Vec<f64>,
    attitude: [Vec<f64>; 2],
    sticks: [Vec<f64>; 4],
    power: Vec<f64>,
    thrust: Vec<(String, Vec<f64>)>,
) -> String {
    let system = if us { System::Us } else { System::Si };
    let shown = |kind: Kind, values: &[f64]| -> Vec<f64> {
        values.iter().map(|value| kind.from_si(*value, system)).collect()
    };
    let total: Vec<f64> =
        (0..speed.len()).map(|k| thrust.iter().map(|(_, values)| values[k]).sum()).collect();
    let [pitch, roll] = attitude;
    let data = TrimSweep {
        name: "trim".into(),
        style: 0,
        marks: Marks::With,
        pitch_attitude_deg: shown(Kind::Angle, &pitch),
        roll_attitude_deg: shown(Kind::Angle, &roll),
        controls: STICKS
            .iter()
            .zip(sticks)
            .map(|(name, values)| Channel { name: (*name).into(), unit: "%".into(), values })
            .collect(),
        power: Channel {
            name: "power".into(),
            unit: Kind::Power.symbol(system).into(),
            values: shown(Kind::Power, &power),
        },
        thrust_share: thrust
            .into_iter()
            .map(|(name, values)| Channel {
                name,
                unit: "%".into(),
                values: values.iter().zip(&total).map(|(t, sum)| 100.0 * t / sum).collect(),
            })
            .collect(),
        speed: shown(Kind::Airspeed, &speed),
    };
    figures::trim_figure(title, Kind::Airspeed.symbol(system), &[data]).to_svg()
}
