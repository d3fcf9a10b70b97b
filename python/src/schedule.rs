//! Gain schedules.

use coaxdesign::control::axis::Channel;
use coaxdesign::control::law::{LawPoint, LawTable};
use coaxdesign::export::{self, Format, Options, Precision};
use coaxdesign::problem::STICKS;
use coaxdesign::schedule;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::Columns;
use crate::errors;

/// Files by name, and warnings.
type Exported<'py> = (Vec<(String, Bound<'py, PyBytes>)>, Vec<String>);

/// A gain schedule and its law.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Schedule {
    pub schedule: schedule::Schedule,
    pub law: LawTable,
}

impl Schedule {
    pub fn of(py: Python<'_>, schedule: schedule::Schedule) -> PyResult<Self> {
        let law = schedule.law().map_err(|error| errors::schedule(py, &error))?;
        Ok(Self { schedule, law })
    }
}

#[pymethods]
impl Schedule {
    /// A schedule of the text of a `schedule.json`.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        let schedule =
            schedule::Schedule::from_json(text).map_err(|error| errors::schedule(py, &error))?;
        Self::of(py, schedule)
    }

    /// The text of its `schedule.json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.schedule.to_json().map_err(|error| errors::schedule(py, &error))
    }

    /// Name of the aircraft.
    #[getter]
    fn name(&self) -> String {
        self.schedule.name.clone()
    }

    /// Whether every requirement was met when it was tuned.
    #[getter]
    fn requirements_met(&self) -> bool {
        self.schedule.requirements_met
    }

    /// Breakpoints, true airspeed in m/s.
    #[getter]
    fn speeds(&self) -> Vec<f64> {
        self.law.points().iter().map(|point| point.speed).collect()
    }

    /// Program, problem's hash and specification's hash that it came from.
    #[getter]
    fn provenance(&self) -> (String, String, String) {
        let of = self.schedule.provenance.clone();
        (of.generator, of.problem_hash, of.specification_hash)
    }

    /// The law at these speeds, m/s: `{name: (unit, array)}`, the speed's index
    /// first.
    fn at<'py>(&self, py: Python<'py>, speeds: Vec<f64>) -> PyResult<Bound<'py, PyDict>> {
        if let Some(bad) = speeds.iter().find(|speed| !speed.is_finite()) {
            return Err(errors::raise(py, "ScheduleError", &format!("{bad} is not a speed")));
        }
        let points: Vec<LawPoint> = speeds.iter().map(|speed| self.law.at(*speed)).collect();
        let count = points.len();
        let columns = Columns::new(py);
        columns.numbers("airspeed", "m/s", speeds)?;
        for channel in Channel::ALL {
            // Roll and pitch give an angular acceleration, hence one power of
            // time more than the others.
            let attitude = matches!(channel, Channel::Roll | Channel::Pitch);
            let units = if attitude { ["1/s", "1/s^2", "1/s^3"] } else { ["1", "1/s", "1/s^2"] };
            for (k, (gain, unit)) in ["k_d", "k_p", "k_i"].iter().zip(units).enumerate() {
                let values = points.iter().map(|p| p.gains[channel.index()].array()[k]).collect();
                columns.numbers(&format!("{}.{gain}", channel.name()), unit, values)?;
            }
        }
        for (k, name) in ["u", "v", "w"].iter().enumerate() {
            let values = points.iter().map(|p| p.inversion.trim.velocity_body[k]).collect();
            columns.numbers(&format!("trim.{name}"), "m/s", values)?;
        }
        columns.numbers("trim.phi", "rad", of(&points, |p| p.inversion.trim.roll))?;
        columns.numbers("trim.theta", "rad", of(&points, |p| p.inversion.trim.pitch))?;
        for (k, stick) in STICKS.iter().enumerate() {
            let values = points.iter().map(|p| p.inversion.trim.sticks[k]).collect();
            columns.numbers(&format!("trim.{stick}_stick"), "%", values)?;
        }
        macro_rules! matrix {
            ($name:literal, $($field:ident).+) => {{
                let (rows, cols) = self.law.points()[0].inversion.$($field).+.shape();
                let values = points
                    .iter()
                    .flat_map(|p| {
                        let m = &p.inversion.$($field).+;
                        (0..rows).flat_map(move |i| (0..cols).map(move |j| m[(i, j)]))
                    })
                    .collect();
                columns.shaped($name, "mixed", values, &[count, rows, cols])?;
            }};
        }
        matrix!("outputs", outputs);
        matrix!("output_rates", rates);
        matrix!("feedback", feedback);
        matrix!("decoupling", decoupling);
        matrix!("allocation", allocation);
        matrix!("ground_velocity", ground_velocity);
        matrix!("reference_state", reference.state);
        matrix!("reference_input", reference.input);
        matrix!("reference_dynamics", reference.dynamics);
        matrix!("reference_drive", reference.drive);
        Ok(columns.finish())
    }

    /// Files of an export, `(name, bytes)`, and what whoever flies it must
    /// know. A schedule with such warnings is refused unless `unverified`.
    #[pyo3(signature = (format, name=None, step=0.01, single=false, speed=0.0, unverified=false))]
    #[allow(clippy::too_many_arguments)] // keywords of one Python function
    fn export<'py>(
        &self,
        py: Python<'py>,
        format: &str,
        name: Option<String>,
        step: f64,
        single: bool,
        speed: f64,
        unverified: bool,
    ) -> PyResult<Exported<'py>> {
        let refused = |message: String| errors::raise(py, "ExportError", &message);
        let about = Format::ALL.iter().find(|about| about.name == format).ok_or_else(|| {
            let names: Vec<&str> = Format::ALL.iter().map(|about| about.name).collect();
            refused(format!("there is no format {format:?}; one of {}", names.join(", ")))
        })?;
        let warnings = export::warnings(&self.schedule, None);
        if !warnings.is_empty() && !unverified {
            let told = warnings.join("; ");
            return Err(refused(format!("{told}; unverified=True exports it all the same")));
        }
        let name = name.or_else(|| export::identifier(&self.schedule.name)).ok_or_else(|| {
            let of = &self.schedule.name;
            refused(format!("no identifier can be made of {of:?}; name=... gives one"))
        })?;
        let precision = if single { Precision::Float } else { Precision::Double };
        let options = Options { name, step, precision, speed, binaries: Vec::new() };
        let files = export::export(&self.schedule, warnings.clone(), about.format, &options)
            .map_err(|error| refused(error.to_string()))?;
        let files = files.into_iter().map(|f| (f.name, PyBytes::new(py, &f.bytes))).collect();
        Ok((files, warnings))
    }
}

fn of(points: &[LawPoint], pick: impl Fn(&LawPoint) -> f64) -> Vec<f64> {
    points.iter().map(pick).collect()
}

/// Forms of export: name, content, files.
#[pyfunction]
pub fn export_formats() -> Vec<(&'static str, &'static str, &'static str)> {
    Format::ALL.iter().map(|about| (about.name, about.content, about.files)).collect()
}
