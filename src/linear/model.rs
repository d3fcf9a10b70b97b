//! Periodic and time-invariant state-space models with named channels.

use nalgebra::DMatrix;

use super::LinearError;
use super::dense::ensure_finite;
use crate::units::{Kind, System};

/// A state, input or output: its name and what it measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name, such as `u`, `theta` or `upper.beta_1c`.
    pub name: String,
    /// What it measures. Values inside the library are SI.
    pub kind: Kind,
}

impl Channel {
    /// A channel of this name and kind.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self { name: name.into(), kind }
    }
}

/// How many units of `kind` for people one SI unit makes, offsets aside.
pub fn shown_per_si(kind: Kind, system: System) -> f64 {
    kind.from_si(1.0, system) - kind.from_si(0.0, system)
}

/// Position of `name` among the channels, or an error naming the nearest one.
pub fn index_of(
    channels: &[Channel],
    role: &'static str,
    name: &str,
) -> Result<usize, LinearError> {
    if let Some(i) = channels.iter().position(|c| c.name == name) {
        return Ok(i);
    }
    // Ties go to the earlier channel, so that the message is reproducible.
    let nearest = channels
        .iter()
        .map(|c| (strsim::damerau_levenshtein(&c.name, name), &c.name))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, candidate)| *distance <= 3.max(candidate.len() / 2))
        .map(|(_, candidate)| candidate.clone());
    Err(LinearError::UnknownName { role, name: name.to_owned(), nearest })
}

/// Positions of several names, each of which may appear once.
pub fn indices_of<S: AsRef<str>>(
    channels: &[Channel],
    role: &'static str,
    names: &[S],
) -> Result<Vec<usize>, LinearError> {
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        let i = index_of(channels, role, name.as_ref())?;
        if found.contains(&i) {
            return Err(LinearError::DuplicateName { role, name: name.as_ref().to_owned() });
        }
        found.push(i);
    }
    Ok(found)
}

fn check_unique(channels: &[Channel], role: &'static str) -> Result<(), LinearError> {
    for (i, c) in channels.iter().enumerate() {
        if channels[..i].iter().any(|other| other.name == c.name) {
            return Err(LinearError::DuplicateName { role, name: c.name.clone() });
        }
    }
    Ok(())
}

fn check_matrix(
    what: &str,
    m: &DMatrix<f64>,
    rows: &[Channel],
    columns: &[Channel],
) -> Result<(), LinearError> {
    if m.shape() != (rows.len(), columns.len()) {
        return Err(LinearError::Shape {
            what: what.to_owned(),
            found_rows: m.nrows(),
            found_columns: m.ncols(),
            rows: rows.len(),
            columns: columns.len(),
        });
    }
    ensure_finite(what, m).map_err(|e| match e {
        LinearError::NotFinite { what, row, column } => {
            let named = |text: String, of: &[Channel]| {
                text.parse::<usize>()
                    .ok()
                    .and_then(|i| of.get(i - 1))
                    .map_or(text, |c| c.name.clone())
            };
            LinearError::NotFinite { what, row: named(row, rows), column: named(column, columns) }
        }
        other => other,
    })
}

/// A linear time-invariant model ẋ = A x + B u, y = C x + D u.
///
/// The variables are perturbations from a trim, in SI units and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    states: Vec<Channel>,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl StateSpace {
    /// A model of these matrices: A is states × states, B states × inputs,
    /// C outputs × states, D outputs × inputs.
    ///
    /// # Errors
    /// A matrix of another size, a value that is not finite, or a name used
    /// twice among the states, the inputs or the outputs.
    pub fn new(
        states: Vec<Channel>,
        inputs: Vec<Channel>,
        outputs: Vec<Channel>,
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
    ) -> Result<Self, LinearError> {
        check_unique(&states, "state")?;
        check_unique(&inputs, "input")?;
        check_unique(&outputs, "output")?;
        check_matrix("A", &a, &states, &states)?;
        check_matrix("B", &b, &states, &inputs)?;
        check_matrix("C", &c, &outputs, &states)?;
        check_matrix("D", &d, &outputs, &inputs)?;
        Ok(Self { states, inputs, outputs, a, b, c, d })
    }

    /// A model whose outputs are its states: C = I, D = 0.
    pub fn with_state_outputs(
        states: Vec<Channel>,
        inputs: Vec<Channel>,
        a: DMatrix<f64>,
        b: DMatrix<f64>,
    ) -> Result<Self, LinearError> {
        let (n, m) = (states.len(), inputs.len());
        Self::new(
            states.clone(),
            inputs,
            states,
            a,
            b,
            DMatrix::identity(n, n),
            DMatrix::zeros(n, m),
        )
    }

    /// States, in the order of the rows of A.
    pub fn states(&self) -> &[Channel] {
        &self.states
    }
    /// Inputs, in the order of the columns of B.
    pub fn inputs(&self) -> &[Channel] {
        &self.inputs
    }
    /// Outputs, in the order of the rows of C.
    pub fn outputs(&self) -> &[Channel] {
        &self.outputs
    }
    /// State matrix.
    pub fn a(&self) -> &DMatrix<f64> {
        &self.a
    }
    /// Input matrix.
    pub fn b(&self) -> &DMatrix<f64> {
        &self.b
    }
    /// Output matrix.
    pub fn c(&self) -> &DMatrix<f64> {
        &self.c
    }
    /// Feed-through matrix.
    pub fn d(&self) -> &DMatrix<f64> {
        &self.d
    }

    /// Names of the states.
    pub fn state_names(&self) -> Vec<&str> {
        self.states.iter().map(|c| c.name.as_str()).collect()
    }

    /// Index of a state by name.
    pub fn state(&self, name: &str) -> Result<usize, LinearError> {
        index_of(&self.states, "state", name)
    }
    /// Index of an input by name.
    pub fn input(&self, name: &str) -> Result<usize, LinearError> {
        index_of(&self.inputs, "input", name)
    }
    /// Index of an output by name.
    pub fn output(&self, name: &str) -> Result<usize, LinearError> {
        index_of(&self.outputs, "output", name)
    }

    /// The entry ∂(rate of `row`)/∂`column`, where the column is a state or,
    /// failing that, an input.
    pub fn derivative(&self, row: &str, column: &str) -> Result<f64, LinearError> {
        let i = self.state(row)?;
        match self.state(column) {
            Ok(j) => Ok(self.a[(i, j)]),
            Err(unknown) => match self.input(column) {
                Ok(j) => Ok(self.b[(i, j)]),
                Err(_) => Err(unknown),
            },
        }
    }

    /// The same model with these inputs only, in this order.
    pub fn select_inputs<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, LinearError> {
        let keep = indices_of(&self.inputs, "input", names)?;
        let mut out = self.clone();
        out.inputs = keep.iter().map(|&i| self.inputs[i].clone()).collect();
        out.b = self.b.select_columns(&keep);
        out.d = self.d.select_columns(&keep);
        Ok(out)
    }

    /// The same model with these outputs only, in this order.
    pub fn select_outputs<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, LinearError> {
        let keep = indices_of(&self.outputs, "output", names)?;
        let mut out = self.clone();
        out.outputs = keep.iter().map(|&i| self.outputs[i].clone()).collect();
        out.c = self.c.select_rows(&keep);
        out.d = self.d.select_rows(&keep);
        Ok(out)
    }

    /// The same model with its states in this order. Every state must be
    /// named: to leave states out is reduction, see [`super::reduction`].
    pub fn reorder_states<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, LinearError> {
        let order = indices_of(&self.states, "state", names)?;
        if order.len() != self.states.len() {
            let missing = (0..self.states.len())
                .filter(|i| !order.contains(i))
                .map(|i| self.states[i].name.as_str())
                .collect::<Vec<_>>();
            return Err(LinearError::Domain(format!(
                "the new order of the states leaves out {}",
                missing.join(", ")
            )));
        }
        let mut out = self.clone();
        out.states = order.iter().map(|&i| self.states[i].clone()).collect();
        out.a = self.a.select_rows(&order).select_columns(&order);
        out.b = self.b.select_rows(&order);
        out.c = self.c.select_columns(&order);
        Ok(out)
    }

    /// The same model with further outputs: rows `c` and `d` below its own.
    pub fn append_outputs(
        &self,
        outputs: Vec<Channel>,
        c: &DMatrix<f64>,
        d: &DMatrix<f64>,
    ) -> Result<Self, LinearError> {
        check_matrix("C of the new outputs", c, &outputs, &self.states)?;
        check_matrix("D of the new outputs", d, &outputs, &self.inputs)?;
        let mut all = self.outputs.clone();
        all.extend(outputs);
        Self::new(
            self.states.clone(),
            self.inputs.clone(),
            all,
            self.a.clone(),
            self.b.clone(),
            stack(&self.c, c),
            stack(&self.d, d),
        )
    }

    /// Removes states that nothing else depends on, such as a position or the
    /// heading: their columns of A (own row aside) and of C must be zero.
    ///
    /// # Errors
    /// [`LinearError::StillUsed`] if a remaining state or an output depends on
    /// one of them by more than 10⁻¹² of that row's largest entry.
    pub fn remove_unused<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, LinearError> {
        const NEGLIGIBLE: f64 = 1e-12;
        let gone = indices_of(&self.states, "state", names)?;
        let kept: Vec<usize> = (0..self.states.len()).filter(|i| !gone.contains(i)).collect();
        for &j in &gone {
            let used = |m: &DMatrix<f64>, i: usize| m[(i, j)].abs() > NEGLIGIBLE * m.row(i).amax();
            let dependent = kept
                .iter()
                .find(|&&i| used(&self.a, i))
                .map(|&i| format!("state \"{}\"", self.states[i].name))
                .or_else(|| {
                    (0..self.outputs.len())
                        .find(|&i| used(&self.c, i))
                        .map(|i| format!("output \"{}\"", self.outputs[i].name))
                });
            if let Some(dependent) = dependent {
                return Err(LinearError::StillUsed {
                    state: self.states[j].name.clone(),
                    dependent,
                });
            }
        }
        Ok(self.sub_block(&kept))
    }

    /// Rows and columns `keep` of the matrices, the rest cut away.
    pub(super) fn sub_block(&self, keep: &[usize]) -> Self {
        Self {
            states: keep.iter().map(|&i| self.states[i].clone()).collect(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            a: self.a.select_rows(keep).select_columns(keep),
            b: self.b.select_rows(keep),
            c: self.c.select_columns(keep),
            d: self.d.clone(),
        }
    }

    /// The model in new states z with x = T z; `t` must be invertible.
    pub fn transform(&self, t: &DMatrix<f64>, states: Vec<Channel>) -> Result<Self, LinearError> {
        check_matrix("T", t, &self.states, &states)?;
        if t.nrows() != t.ncols() {
            return Err(LinearError::Domain("a change of state needs a square matrix".into()));
        }
        let lu = t.clone().full_piv_lu();
        let singular = || LinearError::Singular { what: "the change of state".into() };
        let a = lu.solve(&(&self.a * t)).ok_or_else(singular)?;
        let b = lu.solve(&self.b).ok_or_else(singular)?;
        Self::new(
            states,
            self.inputs.clone(),
            self.outputs.clone(),
            a,
            b,
            &self.c * t,
            self.d.clone(),
        )
    }

    /// Steady output per constant input, D − C A⁻¹ B, if A has an inverse.
    pub fn dc_gain(&self) -> Result<DMatrix<f64>, LinearError> {
        if self.states.is_empty() {
            return Ok(self.d.clone());
        }
        let x = super::dense::solve_checked("A", &self.a, &self.b)?;
        Ok(&self.d - &self.c * x)
    }

    /// This model followed by `next`: the outputs of `self` drive the inputs
    /// of `next`, paired by position. State names are prefixed when both
    /// models use the same one.
    pub fn series(&self, next: &Self) -> Result<Self, LinearError> {
        if self.outputs.len() != next.inputs.len() {
            return Err(LinearError::Domain(format!(
                "series connection: {} outputs cannot drive {} inputs",
                self.outputs.len(),
                next.inputs.len()
            )));
        }
        let (n1, n2) = (self.states.len(), next.states.len());
        let mut a = DMatrix::zeros(n1 + n2, n1 + n2);
        a.view_mut((0, 0), (n1, n1)).copy_from(&self.a);
        a.view_mut((n1, n1), (n2, n2)).copy_from(&next.a);
        a.view_mut((n1, 0), (n2, n1)).copy_from(&(&next.b * &self.c));
        Self::new(
            joined_names(&self.states, &next.states),
            self.inputs.clone(),
            next.outputs.clone(),
            a,
            stack(&self.b, &(&next.b * &self.d)),
            stack(&(&next.d * &self.c).transpose(), &next.c.transpose()).transpose(),
            &next.d * &self.d,
        )
    }

    /// The sum of two models that share inputs and outputs by position.
    pub fn parallel(&self, other: &Self) -> Result<Self, LinearError> {
        if self.outputs.len() != other.outputs.len() || self.inputs.len() != other.inputs.len() {
            return Err(LinearError::Domain(
                "parallel connection: the models differ in their numbers of inputs or outputs"
                    .into(),
            ));
        }
        let (n1, n2) = (self.states.len(), other.states.len());
        let mut a = DMatrix::zeros(n1 + n2, n1 + n2);
        a.view_mut((0, 0), (n1, n1)).copy_from(&self.a);
        a.view_mut((n1, n1), (n2, n2)).copy_from(&other.a);
        Self::new(
            joined_names(&self.states, &other.states),
            self.inputs.clone(),
            self.outputs.clone(),
            a,
            stack(&self.b, &other.b),
            stack(&self.c.transpose(), &other.c.transpose()).transpose(),
            &self.d + &other.d,
        )
    }

    /// The difference `self − other`, for errors between models.
    pub fn minus(&self, other: &Self) -> Result<Self, LinearError> {
        let mut negated = other.clone();
        negated.c = -&negated.c;
        negated.d = -&negated.d;
        self.parallel(&negated)
    }
}

/// The four matrices of a state-space model in some system of units.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrices {
    /// State matrix.
    pub a: DMatrix<f64>,
    /// Input matrix.
    pub b: DMatrix<f64>,
    /// Output matrix.
    pub c: DMatrix<f64>,
    /// Feed-through matrix.
    pub d: DMatrix<f64>,
}

impl StateSpace {
    /// The matrices in the units that people read, [`Kind::symbol`].
    pub fn matrices_in(&self, system: System) -> Matrices {
        let (x, u, y) = self.unit_factors(system);
        let scaled = |m: &DMatrix<f64>, rows: &[f64], columns: &[f64]| {
            DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * (rows[i] / columns[j]))
        };
        Matrices {
            a: scaled(&self.a, &x, &x),
            b: scaled(&self.b, &x, &u),
            c: scaled(&self.c, &y, &x),
            d: scaled(&self.d, &y, &u),
        }
    }

    /// A model of matrices given in the units that people read.
    pub fn from_matrices_in(
        system: System,
        states: Vec<Channel>,
        inputs: Vec<Channel>,
        outputs: Vec<Channel>,
        given: Matrices,
    ) -> Result<Self, LinearError> {
        let mut model = Self::new(states, inputs, outputs, given.a, given.b, given.c, given.d)?;
        let (x, u, y) = model.unit_factors(system);
        let scale = |m: &mut DMatrix<f64>, rows: &[f64], columns: &[f64]| {
            for (i, row) in rows.iter().enumerate() {
                for (j, column) in columns.iter().enumerate() {
                    m[(i, j)] *= column / row;
                }
            }
        };
        scale(&mut model.a, &x, &x);
        scale(&mut model.b, &x, &u);
        scale(&mut model.c, &y, &x);
        scale(&mut model.d, &y, &u);
        Ok(model)
    }

    fn unit_factors(&self, system: System) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let factors = |channels: &[Channel]| -> Vec<f64> {
            channels.iter().map(|c| shown_per_si(c.kind, system)).collect()
        };
        (factors(&self.states), factors(&self.inputs), factors(&self.outputs))
    }
}

fn stack(top: &DMatrix<f64>, bottom: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(top.nrows() + bottom.nrows(), top.ncols());
    out.rows_mut(0, top.nrows()).copy_from(top);
    out.rows_mut(top.nrows(), bottom.nrows()).copy_from(bottom);
    out
}

fn joined_names(first: &[Channel], second: &[Channel]) -> Vec<Channel> {
    let clash = first.iter().any(|f| second.iter().any(|s| s.name == f.name));
    let prefixed = |prefix: &str, c: &Channel| Channel {
        name: if clash { format!("{prefix}.{}", c.name) } else { c.name.clone() },
        kind: c.kind,
    };
    first
        .iter()
        .map(|c| prefixed("first", c))
        .chain(second.iter().map(|c| prefixed("second", c)))
        .collect()
}

/// Matrices of a periodic model at one azimuth.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicSample {
    /// State matrix, states × states.
    pub a: DMatrix<f64>,
    /// Input matrix, states × inputs.
    pub b: DMatrix<f64>,
    /// Output matrix, outputs × states.
    pub c: DMatrix<f64>,
    /// Feed-through matrix, outputs × inputs.
    pub d: DMatrix<f64>,
}

/// A linear time-periodic model: ẋ = A(ψ) x + B(ψ) u, y = C(ψ) x + D(ψ) u with
/// ψ = Ω t and matrices of period 2π in ψ.
///
/// The matrices are known at equally spaced azimuths and are the trigonometric
/// polynomial through the samples in between.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicModel {
    states: Vec<Channel>,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    frequency: f64,
    samples: Vec<PeriodicSample>,
}

impl PeriodicModel {
    /// A model of these samples; sample k of n is at ψ = 2πk/n.
    ///
    /// # Errors
    /// No sample, a `frequency` Ω (rad/s) that is not positive, a matrix of the
    /// wrong size, a value that is not finite, or a name used twice.
    pub fn new(
        states: Vec<Channel>,
        inputs: Vec<Channel>,
        outputs: Vec<Channel>,
        frequency: f64,
        samples: Vec<PeriodicSample>,
    ) -> Result<Self, LinearError> {
        check_unique(&states, "state")?;
        check_unique(&inputs, "input")?;
        check_unique(&outputs, "output")?;
        if !(frequency.is_finite() && frequency > 0.0) {
            return Err(LinearError::Domain(format!(
                "the fundamental frequency must be positive, not {frequency} rad/s"
            )));
        }
        if samples.is_empty() {
            return Err(LinearError::Domain("a periodic model needs at least one sample".into()));
        }
        for (k, s) in samples.iter().enumerate() {
            check_matrix(&format!("A of sample {k}"), &s.a, &states, &states)?;
            check_matrix(&format!("B of sample {k}"), &s.b, &states, &inputs)?;
            check_matrix(&format!("C of sample {k}"), &s.c, &outputs, &states)?;
            check_matrix(&format!("D of sample {k}"), &s.d, &outputs, &inputs)?;
        }
        Ok(Self { states, inputs, outputs, frequency, samples })
    }

    /// States, in the order of the rows of A.
    pub fn states(&self) -> &[Channel] {
        &self.states
    }
    /// Inputs, in the order of the columns of B.
    pub fn inputs(&self) -> &[Channel] {
        &self.inputs
    }
    /// Outputs, in the order of the rows of C.
    pub fn outputs(&self) -> &[Channel] {
        &self.outputs
    }
    /// Fundamental frequency Ω, rad/s; the period is 2π/Ω.
    pub fn frequency(&self) -> f64 {
        self.frequency
    }
    /// Period, s.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.frequency
    }
    /// Samples over one period, the first at ψ = 0.
    pub fn samples(&self) -> &[PeriodicSample] {
        &self.samples
    }

    /// The zeroth harmonic: every matrix averaged over the period.
    pub fn averaged(&self) -> StateSpace {
        let n = self.samples.len() as f64;
        let mean = |pick: fn(&PeriodicSample) -> &DMatrix<f64>| {
            let mut sum = pick(&self.samples[0]).clone();
            for s in &self.samples[1..] {
                sum += pick(s);
            }
            sum / n
        };
        StateSpace {
            states: self.states.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            a: mean(|s| &s.a),
            b: mean(|s| &s.b),
            c: mean(|s| &s.c),
            d: mean(|s| &s.d),
        }
    }

    /// Removes states that nothing else depends on at any azimuth; see
    /// [`StateSpace::remove_unused`].
    pub fn remove_unused<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, LinearError> {
        let gone = indices_of(&self.states, "state", names)?;
        let kept: Vec<usize> = (0..self.states.len()).filter(|i| !gone.contains(i)).collect();
        let mut samples = Vec::with_capacity(self.samples.len());
        let mut states = Vec::new();
        for s in &self.samples {
            let here = StateSpace {
                states: self.states.clone(),
                inputs: self.inputs.clone(),
                outputs: self.outputs.clone(),
                a: s.a.clone(),
                b: s.b.clone(),
                c: s.c.clone(),
                d: s.d.clone(),
            };
            here.remove_unused(names)?;
            let cut = here.sub_block(&kept);
            states = cut.states;
            samples.push(PeriodicSample { a: cut.a, b: cut.b, c: cut.c, d: cut.d });
        }
        Ok(Self {
            states,
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            frequency: self.frequency,
            samples,
        })
    }
}

/// Fourier coefficients of a periodic matrix known at equally spaced points.
///
/// M(ψ) = cosine\[0\] + Σₖ cosine\[k\] cos kψ + sine\[k\] sin kψ; sine\[0\] is zero.
#[derive(Debug, Clone)]
pub struct FourierMatrix {
    /// Cosine coefficients, harmonic 0 first.
    pub cosine: Vec<DMatrix<f64>>,
    /// Sine coefficients, harmonic 0 (zero) first.
    pub sine: Vec<DMatrix<f64>>,
}

impl FourierMatrix {
    /// Coefficients of the trigonometric polynomial through the samples. With
    /// an even number n of samples the harmonic n/2 is a pure cosine, which
    /// passes through the samples and is the least wavy choice.
    pub fn from_samples<'a>(samples: impl ExactSizeIterator<Item = &'a DMatrix<f64>>) -> Self {
        let all: Vec<&DMatrix<f64>> = samples.collect();
        let n = all.len();
        let (rows, columns) = all.first().map_or((0, 0), |m| m.shape());
        let highest = n / 2;
        let mut cosine = vec![DMatrix::zeros(rows, columns); highest + 1];
        let mut sine = cosine.clone();
        for k in 0..=highest {
            let alone = k == 0 || 2 * k == n;
            let weight = if alone { 1.0 } else { 2.0 } / n as f64;
            for (j, m) in all.iter().enumerate() {
                // The product is reduced modulo n so that large k j lose no digits.
                let (s, c) = (std::f64::consts::TAU * ((k * j) % n) as f64 / n as f64).sin_cos();
                let to = cosine[k].as_mut_slice();
                for (t, v) in to.iter_mut().zip(m.as_slice()) {
                    *t += weight * c * v;
                }
                if !alone {
                    for (t, v) in sine[k].as_mut_slice().iter_mut().zip(m.as_slice()) {
                        *t += weight * s * v;
                    }
                }
            }
        }
        Self { cosine, sine }
    }

    /// Highest harmonic held.
    pub fn highest(&self) -> usize {
        self.cosine.len() - 1
    }

    /// Drops the harmonics whose entries are all below `relative` times the
    /// largest entry of any harmonic.
    pub fn without_noise(mut self, relative: f64) -> Self {
        let size = |f: &Self, k: usize| f.cosine[k].amax().max(f.sine[k].amax());
        let largest = (0..self.cosine.len()).map(|k| size(&self, k)).fold(0.0, f64::max);
        while self.cosine.len() > 1 && size(&self, self.highest()) <= relative * largest {
            self.cosine.pop();
            self.sine.pop();
        }
        self
    }

    /// The matrix at azimuth `psi`, rad.
    pub fn at(&self, psi: f64) -> DMatrix<f64> {
        let mut out = self.cosine[0].clone();
        for k in 1..self.cosine.len() {
            let (s, c) = (k as f64 * psi).sin_cos();
            let pairs = self.cosine[k].as_slice().iter().zip(self.sine[k].as_slice());
            for (o, (ck, sk)) in out.as_mut_slice().iter_mut().zip(pairs) {
                *o += c * ck + s * sk;
            }
        }
        out
    }
}
