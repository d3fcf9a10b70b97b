//! Exact time responses of linear models.

use nalgebra::{DMatrix, DVector};

use super::LinearError;
use super::dense::exponential;
use super::model::{Channel, StateSpace, index_of};

/// A piecewise constant signal on one input.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Input name.
    pub input: String,
    /// (time s, value from then on), times increasing; zero before the first.
    pub steps: Vec<(f64, f64)>,
}

impl Signal {
    /// A step of `size` (SI) at `start` s.
    pub fn step(input: impl Into<String>, start: f64, size: f64) -> Self {
        Self { input: input.into(), steps: vec![(start, size)] }
    }

    /// A doublet: +`size` for `half` s, then −`size` for `half` s, then zero.
    pub fn doublet(input: impl Into<String>, start: f64, half: f64, size: f64) -> Self {
        Self {
            input: input.into(),
            steps: vec![(start, size), (start + half, -size), (start + 2.0 * half, 0.0)],
        }
    }

    /// Value at a time, taken from the right.
    pub fn at(&self, time: f64) -> f64 {
        self.steps
            .iter()
            .take_while(|(start, _)| *start <= time)
            .last()
            .map_or(0.0, |(_, value)| *value)
    }
}

/// A response over time.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeResponse {
    /// Times, s.
    pub time: Vec<f64>,
    /// States.
    pub state_channels: Vec<Channel>,
    /// Outputs.
    pub output_channels: Vec<Channel>,
    /// State at each time, SI.
    pub states: Vec<DVector<f64>>,
    /// Output at each time, SI; at a jump of the input the value after it.
    pub outputs: Vec<DVector<f64>>,
}

impl TimeResponse {
    /// One output over time.
    pub fn output(&self, name: &str) -> Result<Vec<f64>, LinearError> {
        let i = index_of(&self.output_channels, "output", name)?;
        Ok(self.outputs.iter().map(|y| y[i]).collect())
    }
}

/// The response from `initial` to piecewise constant signals at the times
/// k·`interval`, k = 0…`count` − 1.
///
/// Exact up to rounding: the matrix exponential of [A B; 0 0] moves the state
/// from one instant to the next, and jumps between output times are met.
///
/// # Errors
/// An unknown input, times that do not increase, or sizes that do not fit.
pub fn time_response(
    model: &StateSpace,
    initial: &DVector<f64>,
    signals: &[Signal],
    interval: f64,
    count: usize,
) -> Result<TimeResponse, LinearError> {
    let (n, m) = (model.states().len(), model.inputs().len());
    if initial.len() != n {
        return Err(LinearError::Domain(format!(
            "the initial state has {} entries, the model {n} states",
            initial.len()
        )));
    }
    if !(interval.is_finite() && interval > 0.0) {
        return Err(LinearError::Domain(format!(
            "the output interval must be positive, not {interval} s"
        )));
    }
    let mut placed: Vec<(usize, &Signal)> = Vec::with_capacity(signals.len());
    let mut jumps: Vec<f64> = Vec::new();
    for signal in signals {
        let finite = signal.steps.iter().all(|(t, v)| t.is_finite() && v.is_finite());
        if !finite || signal.steps.windows(2).any(|w| w[1].0 <= w[0].0) {
            return Err(LinearError::Domain(format!(
                "the times of the signal on \"{}\" must increase and its values be finite",
                signal.input
            )));
        }
        placed.push((model.input(&signal.input)?, signal));
        jumps.extend(signal.steps.iter().map(|(t, _)| *t));
    }
    jumps.sort_by(f64::total_cmp);
    let input_at = |time: f64| {
        let mut u = DVector::zeros(m);
        for (j, signal) in &placed {
            u[*j] += signal.at(time);
        }
        u
    };
    let propagator = |duration: f64| -> Result<(DMatrix<f64>, DMatrix<f64>), LinearError> {
        let mut big = DMatrix::zeros(n + m, n + m);
        big.view_mut((0, 0), (n, n)).copy_from(&(model.a() * duration));
        big.view_mut((0, n), (n, m)).copy_from(&(model.b() * duration));
        let e = exponential(&big)?;
        Ok((e.view((0, 0), (n, n)).into_owned(), e.view((0, n), (n, m)).into_owned()))
    };
    let regular = propagator(interval)?;
    let mut x = initial.clone();
    let mut out = TimeResponse {
        time: Vec::with_capacity(count),
        state_channels: model.states().to_vec(),
        output_channels: model.outputs().to_vec(),
        states: Vec::with_capacity(count),
        outputs: Vec::with_capacity(count),
    };
    // Jumps closer to an output time than this are taken to be at it.
    let near = 1e-9 * interval;
    for k in 0..count {
        let time = k as f64 * interval;
        out.time.push(time);
        out.outputs.push(model.c() * &x + model.d() * input_at(time + near));
        out.states.push(x.clone());
        let end = (k + 1) as f64 * interval;
        let inside: Vec<f64> =
            jumps.iter().copied().filter(|t| *t > time + near && *t < end - near).collect();
        if inside.is_empty() {
            x = &regular.0 * x + &regular.1 * input_at(time + near);
        } else {
            let mut from = time;
            for to in inside.into_iter().chain([end]) {
                if to > from {
                    let (f, g) = propagator(to - from)?;
                    x = f * x + g * input_at(from + near);
                    from = to;
                }
            }
        }
        if x.iter().any(|v| !v.is_finite()) {
            return Err(LinearError::Domain(format!("the response overflows after {end:.3} s")));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Kind;

    fn oscillator() -> StateSpace {
        let c = |n: &str| Channel::new(n, Kind::Dimensionless);
        StateSpace::new(
            vec![c("x"), c("v")],
            vec![c("f")],
            vec![c("x")],
            DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -4.0, 0.0]),
            DMatrix::from_row_slice(2, 1, &[0.0, 4.0]),
            DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
            DMatrix::zeros(1, 1),
        )
        .unwrap()
    }

    #[test]
    fn step_of_an_oscillator_is_one_minus_cosine() {
        let r = time_response(
            &oscillator(),
            &DVector::zeros(2),
            &[Signal::step("f", 0.0, 1.0)],
            0.05,
            100,
        )
        .unwrap();
        for (t, y) in r.time.iter().zip(r.output("x").unwrap()) {
            assert!((y - (1.0 - (2.0 * t).cos())).abs() < 1e-12);
        }
    }

    #[test]
    fn jumps_between_output_times_are_met() {
        // A doublet is a sum of three steps, whatever the output interval.
        let signal = Signal::doublet("f", 0.123, 0.4567, 2.0);
        let r = time_response(&oscillator(), &DVector::zeros(2), &[signal], 0.1, 40).unwrap();
        let step = |t: f64| if t > 0.0 { 1.0 - (2.0 * t).cos() } else { 0.0 };
        for (&t, y) in r.time.iter().zip(r.output("x").unwrap()) {
            let exact = 2.0 * step(t - 0.123) - 4.0 * step(t - 0.5797) + 2.0 * step(t - 1.0364);
            assert!((y - exact).abs() < 1e-12, "{t} {y} {exact}");
        }
    }

    #[test]
    fn unknown_inputs_are_named_with_the_nearest() {
        let error = time_response(
            &oscillator(),
            &DVector::zeros(2),
            &[Signal::step("ff", 0.0, 1.0)],
            0.1,
            2,
        )
        .unwrap_err();
        assert!(error.to_string().contains("did you mean \"f\""), "{error}");
    }
}
