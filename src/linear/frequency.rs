//! Frequency responses, and comparisons of models over frequency.

use nalgebra::{Complex, DMatrix};

use super::LinearError;
use super::dense::{balance, ensure_finite, largest_singular_value};
use super::model::{Channel, StateSpace};

type C64 = Complex<f64>;

/// A frequency response G(jω) = C (jω − A)⁻¹ B + D on a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Inputs, in the order of the columns.
    pub inputs: Vec<Channel>,
    /// Outputs, in the order of the rows.
    pub outputs: Vec<Channel>,
    /// One outputs × inputs matrix a frequency, SI units.
    pub values: Vec<DMatrix<C64>>,
}

/// `points` frequencies from `from` to `to`, rad/s, equally spaced in log ω.
///
/// # Errors
/// Bounds that are not positive and increasing, or fewer than two points.
pub fn log_grid(from: f64, to: f64, points: usize) -> Result<Vec<f64>, LinearError> {
    if !(from > 0.0 && to > from && to.is_finite() && points >= 2) {
        return Err(LinearError::Domain(format!(
            "a frequency grid needs 0 < from < to and two points or more, not {from}:{to} rad/s \
             with {points} points"
        )));
    }
    let (low, high) = (from.ln(), to.ln());
    Ok((0..points)
        .map(|i| match i {
            0 => from,
            _ if i == points - 1 => to,
            _ => (low + (high - low) * i as f64 / (points - 1) as f64).exp(),
        })
        .collect())
}

/// The frequency response of a model.
///
/// A is balanced and brought to Hessenberg form once; each frequency then
/// costs O(n²) operations an input.
///
/// # Errors
/// A frequency that is not finite, or that is an eigenvalue of A.
pub fn frequency_response(
    model: &StateSpace,
    omega: &[f64],
) -> Result<FrequencyResponse, LinearError> {
    if let Some(bad) = omega.iter().find(|w| !w.is_finite()) {
        return Err(LinearError::Domain(format!("frequency {bad} rad/s is not finite")));
    }
    let (n, m, p) = (model.states().len(), model.inputs().len(), model.outputs().len());
    let (balanced, scale) = balance(model.a())?;
    let mut b = model.b().clone();
    let mut c = model.c().clone();
    for i in 0..n {
        b.row_mut(i).unscale_mut(scale[i]);
        c.column_mut(i).scale_mut(scale[i]);
    }
    let h = if n > 2 {
        let (q, h) = balanced.hessenberg().unpack();
        b = q.transpose() * b;
        c *= q;
        h
    } else {
        balanced
    };
    let size = h.amax();
    let mut work = Shifted::new(n, m);
    let mut values = Vec::with_capacity(omega.len());
    for &w in omega {
        work.load(&h, &b, w);
        if !work.solve(size.max(w.abs())) {
            return Err(LinearError::Singular {
                what: format!("jω − A at {w} rad/s: the model has an undamped mode there;"),
            });
        }
        let mut g = model.d().map(|x| Complex::new(x, 0.0));
        for j in 0..m {
            let x = &work.rhs[j * n..(j + 1) * n];
            for i in 0..p {
                let mut sum = C64::default();
                for (k, xk) in x.iter().enumerate() {
                    sum += xk * c[(i, k)];
                }
                g[(i, j)] += sum;
            }
        }
        values.push(g);
    }
    Ok(FrequencyResponse {
        omega: omega.to_vec(),
        inputs: model.inputs().to_vec(),
        outputs: model.outputs().to_vec(),
        values,
    })
}

/// A shifted Hessenberg system, solved by elimination with row exchanges.
struct Shifted {
    n: usize,
    m: usize,
    /// Rows of jω − H, row-major.
    rows: Vec<C64>,
    /// Right-hand sides, column by column; the solutions in the end.
    rhs: Vec<C64>,
}

impl Shifted {
    fn new(n: usize, m: usize) -> Self {
        Self { n, m, rows: vec![C64::default(); n * n], rhs: vec![C64::default(); n * m] }
    }

    fn load(&mut self, h: &DMatrix<f64>, b: &DMatrix<f64>, w: f64) {
        for i in 0..self.n {
            for j in i.saturating_sub(1)..self.n {
                self.rows[i * self.n + j] = Complex::new(-h[(i, j)], if i == j { w } else { 0.0 });
            }
        }
        for (x, v) in self.rhs.iter_mut().zip(b.as_slice()) {
            *x = Complex::new(*v, 0.0);
        }
    }

    /// False if a pivot vanishes against `size`.
    fn solve(&mut self, size: f64) -> bool {
        let n = self.n;
        for k in 0..n {
            if k + 1 < n {
                let (upper, lower) = self.rows.split_at_mut((k + 1) * n);
                let (upper, lower) = (&mut upper[k * n..], &mut lower[..n]);
                let exchange = upper[k].norm_sqr() < lower[k].norm_sqr();
                if exchange {
                    upper[k..].swap_with_slice(&mut lower[k..]);
                }
                if upper[k].norm() <= f64::EPSILON * size {
                    return false;
                }
                let factor = lower[k] / upper[k];
                if factor != C64::default() {
                    for (l, u) in lower[k + 1..].iter_mut().zip(&upper[k + 1..]) {
                        *l -= factor * u;
                    }
                }
                for j in 0..self.m {
                    let x = &mut self.rhs[j * n..(j + 1) * n];
                    if exchange {
                        x.swap(k, k + 1);
                    }
                    let change = factor * x[k];
                    x[k + 1] -= change;
                }
            } else if self.rows[k * n + k].norm() <= f64::EPSILON * size {
                return false;
            }
        }
        for j in 0..self.m {
            let x = &mut self.rhs[j * n..(j + 1) * n];
            for i in (0..n).rev() {
                let row = &self.rows[i * n..(i + 1) * n];
                let mut sum = x[i];
                for k in i + 1..n {
                    sum -= row[k] * x[k];
                }
                x[i] = sum / row[i];
            }
        }
        true
    }
}

/// One channel of a frequency response for plots: gain and phase over frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Bode {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// |G|, output SI unit per input SI unit.
    pub gain: Vec<f64>,
    /// Phase, rad, without jumps of a whole turn.
    pub phase: Vec<f64>,
}

impl FrequencyResponse {
    /// Values of one channel over frequency.
    pub fn channel(&self, output: &str, input: &str) -> Result<Vec<C64>, LinearError> {
        let i = super::model::index_of(&self.outputs, "output", output)?;
        let j = super::model::index_of(&self.inputs, "input", input)?;
        Ok(self.values.iter().map(|g| g[(i, j)]).collect())
    }

    /// Gain and unwrapped phase of one channel.
    pub fn bode(&self, output: &str, input: &str) -> Result<Bode, LinearError> {
        let values = self.channel(output, input)?;
        Ok(Bode {
            omega: self.omega.clone(),
            gain: values.iter().map(|z| z.norm()).collect(),
            phase: unwrapped_phase(&values),
        })
    }
}

/// Phase of successive values, rad, continued without jumps.
///
/// The first phase lies in −π…π; where the response is zero the phase before
/// it is held, since a zero has none.
pub fn unwrapped_phase(values: &[C64]) -> Vec<f64> {
    use std::f64::consts::{PI, TAU};
    let mut phases = Vec::with_capacity(values.len());
    let mut last: Option<f64> = None;
    for z in values {
        let phase = match last {
            _ if z.norm_sqr() == 0.0 => last.unwrap_or(0.0),
            None => z.arg(),
            Some(before) => {
                let step = z.arg() - before;
                before + step - TAU * ((step + PI) / TAU).floor()
            }
        };
        if z.norm_sqr() > 0.0 {
            last = Some(phase);
        }
        phases.push(phase);
    }
    phases
}

/// Which whole turn to put phases on when several models are drawn together.
///
/// Shifts `phases` by the multiple of 2π that brings them closest to
/// `reference` at the frequencies where both gains are largest, so that
/// curves that agree lie on each other.
pub fn align_phase(phases: &mut [f64], reference: &[f64], weights: &[f64]) {
    use std::f64::consts::TAU;
    let (mut sum, mut total) = (0.0, 0.0);
    for ((p, r), w) in phases.iter().zip(reference).zip(weights) {
        sum += w * (r - p);
        total += w;
    }
    if total > 0.0 && sum.is_finite() {
        let turns = (sum / total / TAU).round();
        phases.iter_mut().for_each(|p| *p += turns * TAU);
    }
}

/// Several models side by side in one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelComparison {
    /// Input name.
    pub input: String,
    /// Output name.
    pub output: String,
    /// Label and curve of each model; phases put on the same turn as the first.
    pub curves: Vec<(String, Bode)>,
}

/// The same channel of several models on one grid, for one plot.
///
/// # Errors
/// A model without the input or output, or with an undamped mode on the grid.
pub fn compare(
    models: &[(&str, &StateSpace)],
    input: &str,
    output: &str,
    omega: &[f64],
) -> Result<ChannelComparison, LinearError> {
    let mut curves: Vec<(String, Bode)> = Vec::with_capacity(models.len());
    for (label, model) in models {
        let single = model.select_inputs(&[input])?.select_outputs(&[output])?;
        let mut bode = frequency_response(&single, omega)?.bode(output, input)?;
        if let Some((_, first)) = curves.first() {
            align_phase(&mut bode.phase, &first.phase, &vec![1.0; omega.len()]);
        }
        curves.push(((*label).to_owned(), bode));
    }
    Ok(ChannelComparison { input: input.to_owned(), output: output.to_owned(), curves })
}

/// How the error of an approximate model is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorOptions {
    /// Relative error up to which the approximation is trusted, 1.
    pub tolerance: f64,
    /// A channel weaker than this fraction of the strongest channel of its
    /// output (at the same frequency, inputs scaled by `input_scale`) is judged
    /// against that fraction, 1. Without it, the relative error of a coupling
    /// that is nearly zero would be as large as one likes.
    pub coupling_floor: f64,
    /// Size of each input that counts as equally large, SI; empty for ones.
    pub input_scale: Vec<f64>,
}

impl Default for ErrorOptions {
    fn default() -> Self {
        Self { tolerance: 0.1, coupling_floor: 0.1, input_scale: Vec::new() }
    }
}

/// Error of an approximate model against a full one over frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseError {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Input names.
    pub inputs: Vec<String>,
    /// Output names.
    pub outputs: Vec<String>,
    /// Relative error of each channel: one outputs × inputs matrix a frequency.
    pub channels: Vec<DMatrix<f64>>,
    /// σ̄(W ΔG S)/σ̄(W G S) at each frequency, where S holds the input scales
    /// and W makes the root-mean-square row norm over the grid one.
    pub sigma_max: Vec<f64>,
    /// The tolerance that `trusted_up_to` refers to.
    pub tolerance: f64,
    /// Largest frequency up to which, from the bottom of the grid, `sigma_max`
    /// stays within the tolerance; `None` if not even the first point does.
    pub trusted_up_to: Option<f64>,
    /// The same for each channel.
    pub channel_trusted_up_to: Vec<Vec<Option<f64>>>,
}

impl ResponseError {
    /// Largest channel error over the grid.
    pub fn worst(&self) -> f64 {
        self.channels.iter().map(|m| m.amax()).fold(0.0, f64::max)
    }
}

/// Compares an approximation with the full model, channels paired by position.
///
/// # Errors
/// Different numbers of inputs or outputs, or an undamped mode on the grid.
pub fn response_error(
    full: &StateSpace,
    approximate: &StateSpace,
    omega: &[f64],
    options: &ErrorOptions,
) -> Result<ResponseError, LinearError> {
    if full.inputs().len() != approximate.inputs().len()
        || full.outputs().len() != approximate.outputs().len()
    {
        return Err(LinearError::Domain(
            "models with different numbers of inputs or outputs cannot be compared".into(),
        ));
    }
    let g = frequency_response(full, omega)?;
    let h = frequency_response(approximate, omega)?;
    compare_responses(&g, &h, options)
}

/// The comparison of [`response_error`] for responses already at hand.
pub fn compare_responses(
    full: &FrequencyResponse,
    approximate: &FrequencyResponse,
    options: &ErrorOptions,
) -> Result<ResponseError, LinearError> {
    let (p, m) = (full.outputs.len(), full.inputs.len());
    let scale =
        if options.input_scale.is_empty() { vec![1.0; m] } else { options.input_scale.clone() };
    if scale.len() != m || scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(LinearError::Domain(format!("{m} positive input scales are needed")));
    }
    let omega = &full.omega;
    let scaled = |g: &DMatrix<C64>| DMatrix::from_fn(p, m, |i, j| g[(i, j)] * scale[j]);
    let mut row_mean = vec![0.0; p];
    for g in &full.values {
        let g = scaled(g);
        for (i, sum) in row_mean.iter_mut().enumerate() {
            *sum += g.row(i).norm_squared() / omega.len() as f64;
        }
    }
    let weight: Vec<f64> =
        row_mean.iter().map(|&mean| if mean > 0.0 { 1.0 / mean.sqrt() } else { 0.0 }).collect();

    let mut channels = Vec::with_capacity(omega.len());
    let mut sigma_max = Vec::with_capacity(omega.len());
    for (g, h) in full.values.iter().zip(&approximate.values) {
        let (g, h) = (scaled(g), scaled(h));
        let difference = &h - &g;
        channels.push(DMatrix::from_fn(p, m, |i, j| {
            let strongest = g.row(i).iter().map(|z| z.norm()).fold(0.0, f64::max);
            relative(
                difference[(i, j)].norm(),
                g[(i, j)].norm().max(options.coupling_floor * strongest),
            )
        }));
        let weighted = |x: &DMatrix<C64>| DMatrix::from_fn(p, m, |i, j| x[(i, j)] * weight[i]);
        sigma_max.push(relative(
            largest_singular_value(&weighted(&difference)),
            largest_singular_value(&weighted(&g)),
        ));
    }
    let trusted = |error: &dyn Fn(usize) -> f64| {
        (0..omega.len()).take_while(|&k| error(k) <= options.tolerance).last().map(|k| omega[k])
    };
    let channel_trusted_up_to =
        (0..p).map(|i| (0..m).map(|j| trusted(&|k| channels[k][(i, j)])).collect()).collect();
    let trusted_up_to = trusted(&|k| sigma_max[k]);
    for error in &channels {
        ensure_finite("the error over frequency", error)?;
    }
    Ok(ResponseError {
        omega: omega.clone(),
        inputs: full.inputs.iter().map(|c| c.name.clone()).collect(),
        outputs: full.outputs.iter().map(|c| c.name.clone()).collect(),
        tolerance: options.tolerance,
        trusted_up_to,
        channel_trusted_up_to,
        channels,
        sigma_max,
    })
}

/// `error`/`of`; an error against nothing counts as 1 unless it is nothing too.
fn relative(error: f64, of: f64) -> f64 {
    if of > 0.0 {
        error / of
    } else if error == 0.0 {
        0.0
    } else {
        1.0
    }
}
