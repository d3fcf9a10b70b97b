//! Models over flight speed, and interpolation between them.

use nalgebra::DMatrix;

use super::LinearError;
use super::dense::{balance, eigenvalues};
use super::frequency::{ErrorOptions, ResponseError, response_error};
use super::model::StateSpace;
use crate::units::Kind;

/// How entries of the matrices run between the speeds of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Straight lines.
    Linear,
    /// Cubic Hermite pieces whose slope at each speed is that of the parabola
    /// through it and its neighbours: continuous slope, exact for parabolas.
    #[default]
    Cubic,
}

/// Trim values of the states and inputs of a model, in their order; SI and
/// radians.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrimValues {
    /// x₀.
    pub states: Vec<f64>,
    /// u₀.
    pub inputs: Vec<f64>,
    /// Limits of the inputs; empty where they are not known.
    pub limits: Vec<[f64; 2]>,
}

/// Models with the same channels at increasing speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSet {
    interactions: Option<bool>,
    speeds: Vec<f64>,
    models: Vec<StateSpace>,
    trims: Option<Vec<TrimValues>>,
}

impl ModelSet {
    /// A set; `speeds` are true airspeeds in m/s.
    ///
    /// # Errors
    /// No model, unequal numbers of speeds and models, speeds that do not
    /// increase, or models whose channels differ.
    pub fn new(
        interactions: Option<bool>,
        speeds: Vec<f64>,
        models: Vec<StateSpace>,
    ) -> Result<Self, LinearError> {
        if speeds.is_empty() || speeds.len() != models.len() {
            return Err(LinearError::Domain(format!(
                "a model set needs one model a speed: {} speeds, {} models",
                speeds.len(),
                models.len()
            )));
        }
        if speeds.iter().any(|v| !v.is_finite()) || speeds.windows(2).any(|w| w[1] <= w[0]) {
            return Err(LinearError::Domain("the speeds of a model set must increase".into()));
        }
        for (speed, model) in speeds.iter().zip(&models) {
            let first = &models[0];
            if model.states() != first.states()
                || model.inputs() != first.inputs()
                || model.outputs() != first.outputs()
            {
                return Err(LinearError::Domain(format!(
                    "the model at {} has other states, inputs or outputs than the first",
                    Kind::Airspeed.in_both(*speed)
                )));
            }
        }
        Ok(Self { interactions, speeds, models, trims: None })
    }

    /// The same set with the trims of its models.
    ///
    /// # Errors
    /// A number of trims, or of values in one, that does not fit.
    pub fn with_trims(mut self, trims: Vec<TrimValues>) -> Result<Self, LinearError> {
        let fits = |(trim, model): (&TrimValues, &StateSpace)| {
            trim.states.len() == model.states().len() && trim.inputs.len() == model.inputs().len()
        };
        if trims.len() != self.models.len() || !trims.iter().zip(&self.models).all(fits) {
            return Err(LinearError::Domain(
                "a model set needs one trim a model, with a value for every state and input".into(),
            ));
        }
        self.trims = Some(trims);
        Ok(self)
    }

    /// Trims, one a model, if they are known.
    pub fn trims(&self) -> Option<&[TrimValues]> {
        self.trims.as_deref()
    }

    /// Whether rotor-on-rotor interactions were on; `None` if unknown.
    pub fn interactions(&self) -> Option<bool> {
        self.interactions
    }
    /// True airspeeds, m/s.
    pub fn speeds(&self) -> &[f64] {
        &self.speeds
    }
    /// Models, one a speed.
    pub fn models(&self) -> &[StateSpace] {
        &self.models
    }

    /// The model at a speed within the set's range, m/s.
    ///
    /// # Errors
    /// A speed outside the range: a linear model is not extrapolated.
    pub fn at(&self, speed: f64, how: Interpolation) -> Result<StateSpace, LinearError> {
        let (low, high) = (self.speeds[0], self.speeds[self.speeds.len() - 1]);
        if !(speed >= low && speed <= high) {
            return Err(LinearError::Domain(format!(
                "{} is outside the speeds of the model set, {} to {}",
                Kind::Airspeed.in_both(speed),
                Kind::Airspeed.in_both(low),
                Kind::Airspeed.in_both(high)
            )));
        }
        let weights = self.weights(speed, how);
        let mix = |pick: fn(&StateSpace) -> &DMatrix<f64>| {
            let mut sum =
                DMatrix::zeros(pick(&self.models[0]).nrows(), pick(&self.models[0]).ncols());
            for &(k, w) in &weights {
                sum += pick(&self.models[k]) * w;
            }
            sum
        };
        let first = &self.models[0];
        StateSpace::new(
            first.states().to_vec(),
            first.inputs().to_vec(),
            first.outputs().to_vec(),
            mix(StateSpace::a),
            mix(StateSpace::b),
            mix(StateSpace::c),
            mix(StateSpace::d),
        )
    }

    /// The models that count at a speed, and their weights, which sum to one.
    fn weights(&self, speed: f64, how: Interpolation) -> Vec<(usize, f64)> {
        let v = &self.speeds;
        let n = v.len();
        if n == 1 {
            return vec![(0, 1.0)];
        }
        let k = v.partition_point(|x| *x <= speed).clamp(1, n - 1) - 1;
        let h = v[k + 1] - v[k];
        let t = (speed - v[k]) / h;
        if t == 0.0 {
            return vec![(k, 1.0)];
        }
        if t == 1.0 {
            return vec![(k + 1, 1.0)];
        }
        if how == Interpolation::Linear {
            return vec![(k, 1.0 - t), (k + 1, t)];
        }
        let mut weights = vec![0.0; n];
        weights[k] += (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t);
        weights[k + 1] += t * t * (3.0 - 2.0 * t);
        let slope_weights = [(k, t * (1.0 - t) * (1.0 - t) * h), (k + 1, -t * t * (1.0 - t) * h)];
        for (node, w) in slope_weights {
            for (j, s) in self.slope(node) {
                weights[j] += w * s;
            }
        }
        weights.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect()
    }

    /// The slope at a speed as weights of the models: that of the parabola
    /// through the three nearest, or of the line if there are only two.
    fn slope(&self, node: usize) -> Vec<(usize, f64)> {
        let v = &self.speeds;
        let n = v.len();
        if n == 2 {
            let h = v[1] - v[0];
            return vec![(0, -1.0 / h), (1, 1.0 / h)];
        }
        let first = node.saturating_sub(1).min(n - 3);
        let x = [v[first], v[first + 1], v[first + 2]];
        let at = v[node];
        // Derivative of each Lagrange polynomial.
        (0..3)
            .map(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let w = ((at - x[j]) + (at - x[k])) / ((x[i] - x[j]) * (x[i] - x[k]));
                (first + i, w)
            })
            .collect()
    }
}

/// How far the interpolated model is from the one computed at the same speed.
#[derive(Debug, Clone)]
pub struct MidpointCheck {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Largest difference of an entry of A, B, C or D, relative to the largest
    /// value of that entry over the set (entries negligible beside the rest of
    /// their row are measured against a thousandth of it).
    pub entry_error: f64,
    /// Where: for example `A(q, u)`.
    pub entry: String,
    /// Largest distance of an eigenvalue from its partner, rad/s.
    pub eigenvalue_error: f64,
    /// Error of the frequency response.
    pub response: ResponseError,
}

/// Entries below this part of the rest of their row are measured against it.
const NEGLIGIBLE_ENTRY: f64 = 1e-3;

/// Checks the interpolation against a model computed at a speed in between.
///
/// # Errors
/// A speed outside the range, or a model with other channels.
pub fn check_interpolation(
    set: &ModelSet,
    how: Interpolation,
    speed: f64,
    actual: &StateSpace,
    omega: &[f64],
    options: &ErrorOptions,
) -> Result<MidpointCheck, LinearError> {
    let guess = set.at(speed, how)?;
    if actual.states() != guess.states()
        || actual.inputs() != guess.inputs()
        || actual.outputs() != guess.outputs()
    {
        return Err(LinearError::Domain(format!(
            "the model at {} has other states, inputs or outputs than the set",
            Kind::Airspeed.in_both(speed)
        )));
    }
    // States of unlike units are brought to like size by balancing.
    let (_, scale) = balance(actual.a())?;
    let ones_in = vec![1.0; guess.inputs().len()];
    let ones_out = vec![1.0; guess.outputs().len()];
    let states: Vec<f64> = scale.iter().copied().collect();
    let mut worst = (0.0, String::from("none"));
    type Pick = fn(&StateSpace) -> &DMatrix<f64>;
    let parts: [(&str, Pick, &[f64], &[f64]); 4] = [
        ("A", StateSpace::a, &states, &states),
        ("B", StateSpace::b, &states, &ones_in),
        ("C", StateSpace::c, &ones_out, &states),
        ("D", StateSpace::d, &ones_out, &ones_in),
    ];
    for (label, pick, row_scale, column_scale) in parts {
        let (g, a) = (pick(&guess), pick(actual));
        let largest = DMatrix::from_fn(g.nrows(), g.ncols(), |i, j| {
            set.models().iter().map(|m| pick(m)[(i, j)].abs()).fold(a[(i, j)].abs(), f64::max)
                * column_scale[j]
                / row_scale[i]
        });
        for i in 0..g.nrows() {
            let floor = NEGLIGIBLE_ENTRY * largest.row(i).amax();
            for j in 0..g.ncols() {
                let of = largest[(i, j)].max(floor);
                let difference = (g[(i, j)] - a[(i, j)]).abs() * column_scale[j] / row_scale[i];
                if of > 0.0 && difference / of > worst.0 {
                    let rows =
                        if label == "A" || label == "B" { guess.states() } else { guess.outputs() };
                    let columns =
                        if label == "A" || label == "C" { guess.states() } else { guess.inputs() };
                    worst = (
                        difference / of,
                        format!("{label}({}, {})", rows[i].name, columns[j].name),
                    );
                }
            }
        }
    }
    Ok(MidpointCheck {
        speed,
        entry_error: worst.0,
        entry: worst.1,
        eigenvalue_error: eigenvalue_distance(&eigenvalues(guess.a())?, &eigenvalues(actual.a())?),
        response: response_error(actual, &guess, omega, options)?,
    })
}

/// Largest distance between two spectra, nearest pairs matched first.
pub fn eigenvalue_distance(x: &[nalgebra::Complex<f64>], y: &[nalgebra::Complex<f64>]) -> f64 {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in x.iter().enumerate() {
        for (j, b) in y.iter().enumerate() {
            pairs.push(((a - b).norm(), i, j));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut used_x, mut used_y) = (vec![false; x.len()], vec![false; y.len()]);
    let mut worst: f64 = 0.0;
    for (distance, i, j) in pairs {
        if !used_x[i] && !used_y[j] {
            used_x[i] = true;
            used_y[j] = true;
            worst = worst.max(distance);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::model::Channel;
    use crate::units::Kind;

    fn model(speed: f64) -> StateSpace {
        StateSpace::with_state_outputs(
            vec![Channel::new("w", Kind::Velocity), Channel::new("q", Kind::AngularRateRad)],
            vec![Channel::new("lon", Kind::Percent)],
            DMatrix::from_row_slice(
                2,
                2,
                &[-0.5 - 0.02 * speed, speed, -0.001 * speed * speed, -1.0],
            ),
            DMatrix::from_row_slice(2, 1, &[0.1 * speed, 1.0 + 0.01 * speed * speed]),
        )
        .unwrap()
    }

    fn set(speeds: &[f64]) -> ModelSet {
        ModelSet::new(None, speeds.to_vec(), speeds.iter().map(|&v| model(v)).collect()).unwrap()
    }

    #[test]
    fn cubic_is_exact_for_parabolas_and_linear_for_lines() {
        let s = set(&[0.0, 5.0, 12.0, 20.0]);
        for v in [0.0, 1.7, 5.0, 8.0, 13.3, 20.0] {
            let cubic = s.at(v, Interpolation::Cubic).unwrap();
            assert!((cubic.a() - model(v).a()).amax() < 1e-13);
            assert!((cubic.b() - model(v).b()).amax() < 1e-13);
            let linear = s.at(v, Interpolation::Linear).unwrap();
            assert!((linear.a()[(0, 1)] - v).abs() < 1e-13);
        }
    }

    #[test]
    fn cubic_has_a_continuous_slope() {
        let speeds: [f64; 5] = [0.0, 4.0, 9.0, 15.0, 20.0];
        let wavy: Vec<StateSpace> = speeds.iter().map(|&v| model(10.0 * (v * 0.4).sin())).collect();
        let s = ModelSet::new(None, speeds.to_vec(), wavy).unwrap();
        let h = 1e-5;
        for v in [4.0, 9.0, 15.0] {
            let f = |x: f64| s.at(x, Interpolation::Cubic).unwrap().a()[(0, 1)];
            let (left, right) = ((f(v) - f(v - h)) / h, (f(v + h) - f(v)) / h);
            assert!((left - right).abs() < 1e-3, "{v}: {left} {right}");
        }
    }

    #[test]
    fn midpoint_check_finds_what_linear_interpolation_misses() {
        let s = set(&[0.0, 10.0, 20.0]);
        let omega = [0.1, 1.0, 10.0];
        let check = |how| {
            check_interpolation(&s, how, 5.0, &model(5.0), &omega, &ErrorOptions::default())
                .unwrap()
        };
        let linear = check(Interpolation::Linear);
        // −0.001 V² at 5 m/s: the chord misses by 0.025 of at most 0.4.
        assert_eq!(linear.entry, "A(q, w)");
        assert!((linear.entry_error - 0.025 / 0.4).abs() < 1e-12, "{}", linear.entry_error);
        assert!(linear.eigenvalue_error > 1e-3);
        assert!(check(Interpolation::Cubic).entry_error < 1e-13);
    }

    #[test]
    fn nothing_is_extrapolated() {
        let error = set(&[0.0, 10.0]).at(10.1, Interpolation::Linear).unwrap_err();
        assert!(error.to_string().contains("outside the speeds"), "{error}");
    }
}
