//! Harmonic decomposition: a periodic model as a larger time-invariant one.
//!
//! The state is written x(t) = x₀ + Σ xₙc cos nψ + xₙs sin nψ with slowly
//! varying coefficients, and the inputs and outputs likewise. Matching
//! harmonics gives a time-invariant model of the coefficients (Lopez and
//! Prasad, J. AHS 62(3), 2017; first-order form as used by Saetti and Horn).
//! With no harmonics it is the averaged model.

use nalgebra::DMatrix;

use super::LinearError;
use super::model::{Channel, FourierMatrix, PeriodicModel, StateSpace};

/// Harmonics to retain, besides the zeroth, which always is.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Harmonics {
    /// Harmonics of the state, each at least 1, increasing.
    pub states: Vec<usize>,
    /// Harmonics of the inputs.
    pub inputs: Vec<usize>,
    /// Harmonics of the outputs.
    pub outputs: Vec<usize>,
}

impl Harmonics {
    /// The first `n` harmonics of states, inputs and outputs.
    pub fn up_to(n: usize) -> Self {
        let all: Vec<usize> = (1..=n).collect();
        Self { states: all.clone(), inputs: all.clone(), outputs: all }
    }

    /// The first `n` harmonics of the states; inputs and outputs are averages.
    ///
    /// This is the model to compare with the averaged one: same inputs, same
    /// outputs, but with the state's response at the harmonics fed back.
    pub fn states_up_to(n: usize) -> Self {
        Self { states: (1..=n).collect(), ..Self::default() }
    }

    fn check(&self) -> Result<(), LinearError> {
        for list in [&self.states, &self.inputs, &self.outputs] {
            let increasing = list.windows(2).all(|w| w[0] < w[1]);
            if !increasing || list.first() == Some(&0) {
                return Err(LinearError::Domain(
                    "harmonics must be listed in increasing order from 1 up".into(),
                ));
            }
        }
        Ok(())
    }
}

/// Name of a coefficient: `x.0`, `x.2c` or `x.2s`.
pub fn coefficient_name(name: &str, harmonic: usize, sine: bool) -> String {
    match (harmonic, sine) {
        (0, _) => format!("{name}.0"),
        (n, false) => format!("{name}.{n}c"),
        (n, true) => format!("{name}.{n}s"),
    }
}

/// The harmonic decomposition model of a periodic model.
///
/// States are ordered by coefficient, then by state: all of `.0`, then all of
/// `.1c`, all of `.1s`, and so on; inputs and outputs likewise. The model is
/// exact in the limit of many harmonics.
///
/// # Errors
/// Harmonics out of order.
pub fn decompose(model: &PeriodicModel, keep: &Harmonics) -> Result<StateSpace, LinearError> {
    keep.check()?;
    let series = |pick: fn(&super::model::PeriodicSample) -> &DMatrix<f64>| {
        FourierMatrix::from_samples(model.samples().iter().map(pick))
    };
    let n = model.states().len();
    let mut a = product_operator(&series(|s| &s.a), &keep.states, &keep.states);
    // d/dt (xc cos nψ + xs sin nψ) = (ẋc + nΩ xs) cos nψ + (ẋs − nΩ xc) sin nψ.
    for (block, &harmonic) in keep.states.iter().enumerate() {
        let (c, s) = (n * (2 * block + 1), n * (2 * block + 2));
        let speed = harmonic as f64 * model.frequency();
        for i in 0..n {
            a[(c + i, s + i)] -= speed;
            a[(s + i, c + i)] += speed;
        }
    }
    StateSpace::new(
        expand(model.states(), &keep.states),
        expand(model.inputs(), &keep.inputs),
        expand(model.outputs(), &keep.outputs),
        a,
        product_operator(&series(|s| &s.b), &keep.states, &keep.inputs),
        product_operator(&series(|s| &s.c), &keep.outputs, &keep.states),
        product_operator(&series(|s| &s.d), &keep.outputs, &keep.inputs),
    )
}

fn expand(channels: &[Channel], harmonics: &[usize]) -> Vec<Channel> {
    let block = |harmonic, sine| {
        channels
            .iter()
            .map(move |c| Channel { name: coefficient_name(&c.name, harmonic, sine), kind: c.kind })
    };
    let mut all: Vec<Channel> = block(0, false).collect();
    for &h in harmonics {
        all.extend(block(h, false));
        all.extend(block(h, true));
    }
    all
}

/// The matrix that takes the Fourier coefficients of x to those of M x.
fn product_operator(m: &FourierMatrix, to: &[usize], from: &[usize]) -> DMatrix<f64> {
    let (rows, columns) = m.cosine[0].shape();
    let zero = DMatrix::zeros(rows, columns);
    let mut out = DMatrix::zeros(rows * (2 * to.len() + 1), columns * (2 * from.len() + 1));
    // Cosine coefficient with the zeroth counted twice, so that one formula
    // serves equal harmonics too; the sine coefficient is odd in k.
    let c = |k: isize| -> DMatrix<f64> {
        let k = k.unsigned_abs();
        match m.cosine.get(k) {
            Some(x) if k == 0 => x * 2.0,
            Some(x) => x.clone(),
            None => zero.clone(),
        }
    };
    let s = |k: isize| -> DMatrix<f64> {
        match m.sine.get(k.unsigned_abs()) {
            Some(x) if k >= 0 => x.clone(),
            Some(x) => -x,
            None => zero.clone(),
        }
    };
    let mut put = |i: usize, j: usize, block: DMatrix<f64>| {
        out.view_mut((i * rows, j * columns), (rows, columns)).copy_from(&block);
    };
    put(0, 0, m.cosine[0].clone());
    for (j, &l) in from.iter().enumerate() {
        let l = l as isize;
        put(0, 2 * j + 1, c(l) * 0.5);
        put(0, 2 * j + 2, s(l) * 0.5);
    }
    for (i, &k) in to.iter().enumerate() {
        let k = k as isize;
        put(2 * i + 1, 0, c(k));
        put(2 * i + 2, 0, s(k));
        for (j, &l) in from.iter().enumerate() {
            let l = l as isize;
            put(2 * i + 1, 2 * j + 1, (c(k - l) + c(k + l)) * 0.5);
            put(2 * i + 1, 2 * j + 2, (s(k + l) + s(l - k)) * 0.5);
            put(2 * i + 2, 2 * j + 1, (s(k + l) + s(k - l)) * 0.5);
            put(2 * i + 2, 2 * j + 2, (c(k - l) - c(k + l)) * 0.5);
        }
    }
    out
}

/// The part of a harmonic model that a pilot sees: average inputs to average
/// outputs. They and the means of the states are named as in the periodic
/// model.
pub fn mean_channels(harmonic: &StateSpace) -> Result<StateSpace, LinearError> {
    let mean = |channels: &[Channel]| -> Vec<String> {
        channels.iter().filter(|c| c.name.ends_with(".0")).map(|c| c.name.clone()).collect()
    };
    let cut = harmonic
        .select_inputs(&mean(harmonic.inputs()))?
        .select_outputs(&mean(harmonic.outputs()))?;
    let plain = |channels: &[Channel]| -> Vec<Channel> {
        channels
            .iter()
            .map(|c| Channel { name: c.name.trim_end_matches(".0").to_owned(), kind: c.kind })
            .collect()
    };
    StateSpace::new(
        plain(cut.states()),
        plain(cut.inputs()),
        plain(cut.outputs()),
        cut.a().clone(),
        cut.b().clone(),
        cut.c().clone(),
        cut.d().clone(),
    )
}

/// The model of the mean and `n` harmonics of the states, from the mean of the
/// inputs to that of the outputs.
///
/// # Errors
/// As [`decompose`].
pub fn mean_and_harmonics(model: &PeriodicModel, n: usize) -> Result<StateSpace, LinearError> {
    mean_channels(&decompose(model, &Harmonics::states_up_to(n))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::dense::tests::Numbers;
    use crate::linear::model::PeriodicSample;
    use crate::units::Kind;

    fn channels(prefix: &str, n: usize) -> Vec<Channel> {
        (0..n).map(|i| Channel::new(format!("{prefix}{i}"), Kind::Dimensionless)).collect()
    }

    fn random_model(samples: usize) -> PeriodicModel {
        let mut numbers = Numbers(21);
        PeriodicModel::new(
            channels("x", 3),
            channels("u", 2),
            channels("y", 2),
            2.0,
            (0..samples)
                .map(|_| PeriodicSample {
                    a: numbers.matrix(3, 3),
                    b: numbers.matrix(3, 2),
                    c: numbers.matrix(2, 3),
                    d: numbers.matrix(2, 2),
                })
                .collect(),
        )
        .unwrap()
    }

    #[test]
    fn no_harmonics_is_the_averaged_model() {
        let model = random_model(7);
        let (mean, none) = (model.averaged(), decompose(&model, &Harmonics::up_to(0)).unwrap());
        for (x, y) in
            [(mean.a(), none.a()), (mean.b(), none.b()), (mean.c(), none.c()), (mean.d(), none.d())]
        {
            assert!((x - y).amax() < 1e-14);
        }
        assert_eq!(none.states()[1].name, "x1.0");
    }

    #[test]
    fn operator_multiplies_trigonometric_polynomials() {
        // M(ψ) of degree 3 times x(ψ) of degree 2 is of degree 5: kept whole
        // with five output harmonics, the product must agree at any azimuth.
        let model = random_model(7);
        let m = FourierMatrix::from_samples(model.samples().iter().map(|s| &s.a));
        assert_eq!(m.highest(), 3);
        let from = [1, 2];
        let to = [1, 2, 3, 4, 5];
        let x = Numbers(4).matrix(3 * 5, 1);
        let y = product_operator(&m, &to, &from) * &x;
        let value = |coefficients: &DMatrix<f64>, harmonics: &[usize], psi: f64| {
            let mut v = coefficients.rows(0, 3).into_owned();
            for (i, &h) in harmonics.iter().enumerate() {
                let (s, c) = (h as f64 * psi).sin_cos();
                v += coefficients.rows(3 * (2 * i + 1), 3) * c;
                v += coefficients.rows(3 * (2 * i + 2), 3) * s;
            }
            v
        };
        for psi in [0.0, 0.7, 2.0, 5.5] {
            let exact = m.at(psi) * value(&x, &from, psi);
            assert!((value(&y, &to, psi) - exact).amax() < 1e-13);
        }
    }

    #[test]
    fn fourier_series_passes_through_the_samples() {
        for n in [1, 2, 6, 7] {
            let model = random_model(n);
            let m = FourierMatrix::from_samples(model.samples().iter().map(|s| &s.a));
            for (k, s) in model.samples().iter().enumerate() {
                let psi = std::f64::consts::TAU * k as f64 / n as f64;
                assert!((m.at(psi) - &s.a).amax() < 1e-13);
            }
        }
    }
}
