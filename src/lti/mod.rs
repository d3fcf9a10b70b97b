//! Linear models that others have made: read, checked, and brought to our
//! names and units.
//!
//! A set holds one linear model a speed, each with A, B, C, D, the names and
//! units of its channels, and its trim. It comes as JSON
//! (`coaxdesign.lti-set/1`), as a MAT file of level 5 or as a directory of CSV
//! tables; what each form looks like is told in `docs/models.md`.
//!
//! * [`mapping`]: which of their names is which of ours, from the
//!   specification's `[models_from]`.
//! * [`read`]: the forms.
//! * [`resolve`]: names, units, missing attitudes, delays: [`LtiSet`].
//! * [`schema`]: of the JSON form.
//! * [`stitch`]: one continuous model of all speeds.
//!
//! Whatever is not clear is refused, and the message shows the line to add to
//! the specification.

pub mod mapping;
pub mod read;
pub mod resolve;
pub mod schema;
pub mod stitch;

use crate::linear::StateSpace;
use crate::problem::{Diagnostic, Report};
use mapping::Mapping;
use std::path::Path;

/// Trimmed flight that a model is linearised about.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Trim {
    /// Body velocity u, v, w, m/s.
    pub velocity_body: [f64; 3],
    /// Body rates p, q, r, rad/s.
    pub rates: [f64; 3],
    /// Bank angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Sticks lat, lon, col, ped, %.
    pub sticks: [f64; 4],
}

/// A model of one speed in our names and units.
#[derive(Debug, Clone, PartialEq)]
pub struct PointModel {
    /// File and place in it, for messages.
    pub label: String,
    /// True airspeed, m/s.
    pub speed: f64,
    /// States u v w p q r phi theta first, then the model's own; inputs lat,
    /// lon, col, ped in %; the outputs that the model gives. SI and radians.
    pub model: StateSpace,
    /// Places among the states of what the control law measures of u v w p q r
    /// φ θ: behind the delays of the outputs, where the model has such.
    pub measured: [usize; 8],
    /// The trim.
    pub trim: Trim,
    /// Trim values of the states behind the first eight, where the model gives
    /// them.
    pub inner_trim: Vec<Option<f64>>,
}

/// Models at increasing speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct LtiSet {
    /// Name of the aircraft, or of the file.
    pub name: String,
    /// Models, speeds strictly increasing.
    pub models: Vec<PointModel>,
    /// Whether actuators, delays and sensors are in the models already.
    pub hardware_included: bool,
    /// What was done to the models that their owner should know.
    pub notes: Vec<String>,
    /// Least and greatest position of lat, lon, col, ped, %: 0 to 100 where the
    /// set does not say it.
    pub stick_limits: [[f64; 2]; 4],
    /// Texts of the files, for a hash; of a MAT file a character a byte.
    pub texts: Vec<String>,
    /// Names of the files, without their directory.
    pub files: Vec<String>,
    /// Whether the set is a directory of files.
    pub is_directory: bool,
}

impl LtiSet {
    /// True airspeeds, m/s.
    #[must_use]
    pub fn speeds(&self) -> Vec<f64> {
        self.models.iter().map(|m| m.speed).collect()
    }

    /// Names and bytes of the files, as they were read.
    #[must_use]
    pub fn contents(&self) -> Vec<(String, Vec<u8>)> {
        let bytes = |(name, text): (&String, &String)| {
            let binary = name.to_lowercase().ends_with(".mat");
            let bytes = if binary {
                text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect()
            } else {
                text.clone().into_bytes()
            };
            (name.clone(), bytes)
        };
        self.files.iter().zip(&self.texts).map(bytes).collect()
    }

    /// The model at a speed of the set, m/s.
    #[must_use]
    pub fn at(&self, speed: f64) -> Option<&PointModel> {
        self.models.iter().find(|m| (m.speed - speed).abs() < SAME_SPEED)
    }
}

/// Speeds closer than this are the same, m/s.
pub const SAME_SPEED: f64 = 1e-3;

/// Reads a set: a directory of CSV tables, or a JSON, MAT or CSV file.
///
/// # Errors
/// Everything that is wrong with it, each with file, model and row, and with
/// the line that helps.
pub fn load(path: &Path, mapping: &Mapping) -> Result<LtiSet, Report> {
    let raw = read::read(path, mapping)?;
    resolve::resolve(raw, mapping)
}

/// A finding about a model.
fn finding(file: &str, place: &str, message: String, help: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::whole_file(file, message, help);
    diagnostic.key = place.into();
    diagnostic
}
