//! Frequency responses of the closed loops and their affine structure.
//!
//! The law enters as its block diagram, differentiated about trimmed flight
//! with all gains at zero and a port at each of them ([`GainLaw`]): what each
//! gain multiplies, and what sticks make of what a channel asks for. So the
//! loops of the tuning hold all that the law as it is flown does to small
//! deviations, in both modes: inner loops under an attitude demand, outer
//! loops under a velocity demand.
//!
//! With the plant's response X(jω) from sticks to measured states (hardware
//! included), sticks are δ = K X δ with
//!
//! ```text
//! K = K₀ + Σ_channels c Σ_g k_g r_g
//! ```
//!
//! c being what sticks make of what the channel asks for and r_g what its gain
//! k_g multiplies. An outer loop asks for an attitude: its c holds what the
//! inner gains make of that, and the r_g of an inner channel what the outer
//! gains ask for. Every gain multiplies a matrix of rank one. So with all other
//! gains fixed det(I − K X) is *affine* in one channel's gains, by the matrix
//! determinant lemma. The same holds for the minor without one effector's row
//! and column. With D = det(I − K X) and D̄ that minor, the loop cut at the
//! effector with everything else closed is
//!
//! ```text
//! 1 + L = D / D̄,    S = N / D,
//! ```
//!
//! N being D with the gains that hold the disturbed quantity set to zero.

use super::axis::{Channel, ChannelGains, GainSet};
use super::closed_loop::{STATES, STICKS, noise_ports, still_air};
use super::law::{LawTable, Linearizer};
use super::plant::{Hardware, Plant, PlantError};
pub use crate::law::mdi::LawSettings;
use crate::law::{LinearLaw, mdi, tables};
use crate::numerics::conic::AffineRow;
use nalgebra::DMatrix;
use num_complex::Complex64 as C;
use std::sync::Arc;

const ZERO: C = C::new(0.0, 0.0);
const ONE: C = C::new(1.0, 0.0);

/// A four-vector of complex numbers.
pub type Row4 = [C; 4];
/// A 4 × 4 complex matrix, by rows.
pub type Matrix4c = [[C; 4]; 4];

/// A function affine in at most three gains: `f[0] + Σ f[1 + g] x[g]`.
pub type Affine = [C; 4];

/// Value of an affine function.
pub fn affine_value(f: &Affine, x: &[f64]) -> C {
    x.iter().zip(&f[1..]).fold(f[0], |sum, (&x, &c)| sum + c * x)
}

/// Where a loop is cut for its margins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cut {
    /// At the effector of the channel's axis, every other loop closed.
    Effector,
    /// At the channel's own feedback signal, every other loop closed.
    Channel,
}

/// A plant's frequency response, ready for evaluation at any frequency.
#[derive(Debug, Clone)]
pub struct FrequencyModel {
    /// Upper Hessenberg form of the balanced system matrix.
    hessenberg: DMatrix<f64>,
    /// Q'B of that form.
    input: DMatrix<f64>,
    /// Rows of Q that give the eight measured states.
    output: DMatrix<f64>,
    hardware: Hardware,
    extra_delay: f64,
}

impl FrequencyModel {
    /// Prepares a plant: one orthogonal reduction, then each frequency costs
    /// a Hessenberg solve.
    pub fn new(plant: &Plant, hardware: Hardware, extra_delay: f64) -> Result<Self, PlantError> {
        plant.check()?;
        let mut a = plant.a.clone();
        let scale = nalgebra::linalg::balancing::balance_parlett_reinsch(&mut a);
        let n = a.nrows();
        let mut b = plant.b.clone();
        for i in 0..n {
            b.row_mut(i).unscale_mut(scale[i]);
        }
        let (q, hessenberg) = nalgebra::linalg::Hessenberg::new(a).unpack();
        let input = q.transpose() * b;
        let output = DMatrix::from_fn(8, n, |i, j| {
            let k = plant.measured[i];
            scale[k] * q[(k, j)]
        });
        Ok(Self { hessenberg, input, output, hardware, extra_delay })
    }

    /// Measured states per stick at ω, hardware included: 8 rows of 4.
    pub fn states(&self, omega: f64) -> [Row4; 8] {
        let n = self.hessenberg.nrows();
        // (jω − H) Z = Q'B by elimination with partial pivoting; row k + 1 is
        // the only one with an entry below the diagonal in column k.
        let mut m: Vec<C> = (0..n * n)
            .map(|k| {
                let (i, j) = (k / n, k % n);
                let diagonal = if i == j { omega } else { 0.0 };
                C::new(-self.hessenberg[(i, j)], diagonal)
            })
            .collect();
        let mut z: Vec<Row4> =
            (0..n).map(|i| std::array::from_fn(|j| C::new(self.input[(i, j)], 0.0))).collect();
        for k in 0..n - 1 {
            if m[(k + 1) * n + k].norm_sqr() > m[k * n + k].norm_sqr() {
                for j in k..n {
                    m.swap(k * n + j, (k + 1) * n + j);
                }
                z.swap(k, k + 1);
            }
            let factor = m[(k + 1) * n + k] / m[k * n + k];
            if factor != ZERO {
                for j in k + 1..n {
                    let t = m[k * n + j];
                    m[(k + 1) * n + j] -= factor * t;
                }
                let row = z[k];
                for (target, value) in z[k + 1].iter_mut().zip(row) {
                    *target -= factor * value;
                }
            }
        }
        for k in (0..n).rev() {
            for j in k + 1..n {
                let t = m[k * n + j];
                let row = z[j];
                for (target, value) in z[k].iter_mut().zip(row) {
                    *target -= t * value;
                }
            }
            let d = m[k * n + k];
            for value in z[k].iter_mut() {
                *value /= d;
            }
        }
        let path = self.hardware.response(omega, self.extra_delay);
        std::array::from_fn(|i| {
            let mut row = [ZERO; 4];
            for (k, zk) in z.iter().enumerate() {
                let q = self.output[(i, k)];
                for (target, value) in row.iter_mut().zip(zk) {
                    *target += q * value;
                }
            }
            row.map(|v| v * path)
        })
    }
}

/// The law at one speed with its gains pulled out, under an attitude demand and
/// under a velocity demand.
#[derive(Debug, Clone)]
pub struct GainLaw {
    /// Both modes: the law with all gains at zero and a port at each.
    modes: [LinearLaw; 2],
    delay: f64,
    vy_share: f64,
}

/// A law's response at a frequency, its gains pulled out.
#[derive(Debug, Clone)]
struct GainResponse {
    /// K₀: sticks from states.
    direct: [[C; STATES]; 4],
    /// Sticks per unit of what each channel asks for, all gains at zero.
    columns: [Row4; 6],
    /// What each channel's K_D, K_P, K_I multiply, from states.
    sees: [[[C; STATES]; 3]; 6],
    /// The same per unit of what an outer loop asks for, vx and vy.
    around: [[[C; 2]; 3]; 6],
    /// The same per unit of the channel's noise.
    noise: [[C; 3]; 6],
}

/// The outer loops, in the order of [`GainResponse::around`].
const OUTER: [Channel; 2] = [Channel::Vx, Channel::Vy];

/// Every gain: channel and place among K_D, K_P, K_I.
fn gains_of_law() -> impl Iterator<Item = (Channel, usize)> {
    Channel::ALL.into_iter().flat_map(|c| c.gains().iter().map(move |g| (c, g.index())))
}

/// Place of a gain among the law's tables.
fn gain_place(channel: Channel, gain: usize) -> Option<usize> {
    tables::place("gains", channel.name(), ["k_d", "k_p", "k_i"][gain])
}

impl GainLaw {
    /// The law of a table at a speed, m/s, whatever the table's gains are.
    pub fn new(table: &LawTable, speed: f64) -> Self {
        let table = table.with_gains(|_| GainSet::default());
        let entries: Vec<usize> = gains_of_law().filter_map(|(c, g)| gain_place(c, g)).collect();
        let linearizer = Linearizer::new(&table, &entries);
        // All gains of a channel act at the same place: the port of one serves.
        let mut inputs: Vec<&str> = tables::STATES.iter().map(|s| s.0).collect();
        let mut outputs: Vec<&str> = STICKS.to_vec();
        for (channel, gain) in gains_of_law() {
            let place = gain_place(channel, gain);
            if let Some(tap) = linearizer.taps().iter().find(|t| Some(t.entry) == place) {
                if gain == 1 {
                    inputs.push(&tap.input);
                }
                outputs.push(&tap.signal);
            }
        }
        inputs.extend(mdi::PORTS.iter().map(|port| port.0));
        let modes = [false, true].map(|velocity_mode| {
            still_air(&linearizer.at(speed, velocity_mode)).part(&inputs, &outputs)
        });
        let delay = table.settings.reference_delay;
        Self { modes, delay, vy_share: table.outer_share(Channel::Vy, speed) }
    }

    /// As [`LawTable::outer_share`] at this speed.
    pub fn share(&self, channel: Channel) -> f64 {
        if channel == Channel::Vy { self.vy_share } else { 1.0 }
    }

    fn response(&self, mode: usize, omega: f64) -> GainResponse {
        let s = C::new(0.0, omega);
        let law = &self.modes[mode];
        let late = C::from_polar(1.0, -omega * self.delay);
        let (rows, columns) = (law.outputs.len() - law.lines, law.inputs.len() - law.lines);
        // A pole of the law on the imaginary axis is where |K| has no bound;
        // frequencies are beside it.
        let whole =
            law.response(s, late).unwrap_or_else(|| DMatrix::from_element(rows, columns, ZERO));
        let (taps, ports) = (STATES, STATES + Channel::ALL.len());
        let mut out = GainResponse {
            direct: std::array::from_fn(|i| std::array::from_fn(|k| whole[(i, k)])),
            columns: std::array::from_fn(|c| std::array::from_fn(|i| whole[(i, taps + c)])),
            sees: [[[ZERO; STATES]; 3]; 6],
            around: [[[ZERO; 2]; 3]; 6],
            noise: [[ZERO; 3]; 6],
        };
        for (row, (channel, gain)) in gains_of_law().enumerate() {
            let (row, c) = (4 + row, channel.index());
            out.sees[c][gain] = std::array::from_fn(|k| whole[(row, k)]);
            if !channel.is_outer() {
                out.around[c][gain] = OUTER.map(|o| whole[(row, taps + o.index())]);
            }
            out.noise[c][gain] = noise_ports(channel, s)
                .iter()
                .fold(ZERO, |sum, (port, by)| sum + whole[(row, ports + *port as usize)] * by);
        }
        out
    }
}

/// A [`GainLaw`] on a grid of frequencies, for the plants of all models.
#[derive(Debug, Clone)]
pub struct GainGrid {
    law: Arc<GainLaw>,
    omega: Arc<[f64]>,
    responses: [Vec<GainResponse>; 2],
}

impl GainGrid {
    /// The law of a table at a speed, m/s, on the grid `omega`, rad/s.
    pub fn new(table: &LawTable, speed: f64, omega: Arc<[f64]>) -> Self {
        let law = GainLaw::new(table, speed);
        let responses = [0, 1].map(|mode| omega.iter().map(|&w| law.response(mode, w)).collect());
        Self { law: Arc::new(law), omega, responses }
    }

    /// The law.
    pub fn law(&self) -> &GainLaw {
        &self.law
    }
}

/// Everything of the loops at one frequency and in one mode that does not
/// depend on gains.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// I − K₀ X.
    base: Matrix4c,
    /// Columns of each channel, all gains at zero.
    columns: [Row4; 6],
    /// Rows −r_g X of each channel's gains K_D, K_P, K_I.
    rows: [[Row4; 3]; 6],
    /// See [`GainResponse::around`].
    around: [[[C; 2]; 3]; 6],
    /// See [`GainResponse::noise`].
    noise: [[C; 3]; 6],
}

impl Point {
    fn new(law: &GainResponse, x: &[Row4; STATES]) -> Self {
        let mut base = [[ZERO; 4]; 4];
        for (i, row) in base.iter_mut().enumerate() {
            *row = row_times(&law.direct[i], x);
            row[i] += ONE;
        }
        let rows = std::array::from_fn(|c| std::array::from_fn(|g| row_times(&law.sees[c][g], x)));
        Self { base, columns: law.columns, rows, around: law.around, noise: law.noise }
    }

    /// What a channel's gains multiply, weighted by them.
    fn asked(&self, gains: &GainSet, channel: Channel) -> Row4 {
        let (k, rows) = (gains[channel.index()].array(), &self.rows[channel.index()]);
        std::array::from_fn(|j| (0..3).fold(ZERO, |sum, g| sum + k[g] * rows[g][j]))
    }

    /// Column through which a channel's rows act on the sticks.
    fn column(&self, gains: &GainSet, channel: Channel) -> Row4 {
        let mut out = self.columns[channel.index()];
        let Some(o) = OUTER.iter().position(|c| *c == channel) else { return out };
        for inner in Channel::ALL.into_iter().filter(|c| !c.is_outer()) {
            let i = inner.index();
            let k = gains[i].array();
            let by = (0..3).fold(ZERO, |sum, g| sum + k[g] * self.around[i][g][o]);
            for (out, column) in out.iter_mut().zip(self.columns[i]) {
                *out += by * column;
            }
        }
        out
    }

    /// I − K X.
    fn matrix(&self, gains: &GainSet) -> Matrix4c {
        let mut m = self.base;
        for channel in Channel::ALL {
            if gains[channel.index()].array() == [0.0; 3] {
                continue;
            }
            let row = self.asked(gains, channel);
            let column = self.column(gains, channel);
            for i in 0..4 {
                for j in 0..4 {
                    m[i][j] += column[i] * row[j];
                }
            }
        }
        m
    }
}

/// The loops of one plant under one law on a frequency grid.
#[derive(Debug, Clone)]
pub struct LoopModel {
    omega: Arc<[f64]>,
    /// In both modes.
    points: [Vec<Point>; 2],
    frequency: FrequencyModel,
    law: Arc<GainLaw>,
}

/// D and the D̄ of each cut asked for, affine in one channel's gains, at every
/// frequency of a grid.
#[derive(Debug, Clone)]
pub struct ChannelLoops {
    /// The channel.
    pub channel: Channel,
    /// Frequencies, rad/s.
    pub omega: Arc<[f64]>,
    /// D.
    pub full: Vec<Affine>,
    /// D̄ of each cut.
    pub opened: Vec<Vec<Affine>>,
    /// Stick command per unit of white rate (inner) or velocity (outer) noise
    /// with the loop open, linear in the gains: the constant is zero.
    pub noise: Vec<Affine>,
}

/// Place of the mode that a channel is looked at in: any outer loop that is
/// closed, or the channel itself, flies under a velocity demand.
fn mode(gains: &GainSet, channel: Option<Channel>) -> usize {
    let outer = channel.is_some_and(Channel::is_outer)
        || OUTER.iter().any(|c| gains[c.index()].array() != [0.0; 3]);
    usize::from(outer)
}

impl LoopModel {
    /// The loops of `plant` under a law on its grid.
    ///
    /// # Errors
    /// An unusable plant.
    pub fn new(
        plant: &Plant,
        grid: &GainGrid,
        hardware: Hardware,
        extra_delay: f64,
    ) -> Result<Self, PlantError> {
        let frequency = FrequencyModel::new(plant, hardware, extra_delay)?;
        let mut points = [0, 1].map(|_| Vec::with_capacity(grid.omega.len()));
        for (k, &w) in grid.omega.iter().enumerate() {
            let x = frequency.states(w);
            for (points, responses) in points.iter_mut().zip(&grid.responses) {
                points.push(Point::new(&responses[k], &x));
            }
        }
        Ok(Self { omega: grid.omega.clone(), points, frequency, law: grid.law.clone() })
    }

    /// The grid, rad/s.
    pub fn omega(&self) -> &Arc<[f64]> {
        &self.omega
    }

    /// The law.
    pub fn law(&self) -> &GainLaw {
        &self.law
    }

    fn point(&self, mode: usize, omega: f64) -> Point {
        Point::new(&self.law.response(mode, omega), &self.frequency.states(omega))
    }

    fn affine_at(
        p: &Point,
        gains: &GainSet,
        channel: Channel,
        cuts: &[Cut],
    ) -> (Affine, Vec<Affine>, Affine) {
        let mut others = *gains;
        others[channel.index()] = ChannelGains::default();
        let m = p.matrix(&others);
        let column = p.column(gains, channel);
        let mut rows = p.rows[channel.index()];
        if !channel.is_outer() {
            // What the outer loops command enters this channel's errors.
            for (o, outer) in OUTER.into_iter().enumerate() {
                let asked = p.asked(gains, outer);
                for (row, around) in rows.iter_mut().zip(&p.around[channel.index()]) {
                    for (value, asked) in row.iter_mut().zip(asked) {
                        *value += around[o] * asked;
                    }
                }
            }
        }
        let e = channel.axis().effector().index();
        let lemma = |determinant: C, adjugate: &Row4, skip: Option<usize>| {
            let mut f = [determinant, ZERO, ZERO, ZERO];
            for (g, &gain) in channel.gains().iter().enumerate() {
                f[1 + g] = (0..4)
                    .filter(|&j| Some(j) != skip)
                    .fold(ZERO, |sum, j| sum + rows[gain.index()][j] * adjugate[j]);
            }
            f
        };
        let (d, adjugate) = determinant_and_adjugate(&m, &column);
        let full = lemma(d, &adjugate, None);
        let opened = cuts
            .iter()
            .map(|cut| match cut {
                Cut::Channel => [full[0], ZERO, ZERO, ZERO],
                Cut::Effector => {
                    // The minor without row and column e, kept 4 × 4 with a unit there.
                    let mut minor = m;
                    let mut reduced = column;
                    minor[e] = [ZERO; 4];
                    for row in &mut minor {
                        row[e] = ZERO;
                    }
                    minor[e][e] = ONE;
                    reduced[e] = ZERO;
                    let (d, adjugate) = determinant_and_adjugate(&minor, &reduced);
                    lemma(d, &adjugate, Some(e))
                }
            })
            .collect();
        let mut noise = [ZERO; 4];
        for (noise, &gain) in noise[1..].iter_mut().zip(channel.gains()) {
            *noise = column[e] * p.noise[channel.index()][gain.index()];
        }
        (full, opened, noise)
    }

    /// D, D̄ and noise of a channel over the grid, all other gains fixed.
    pub fn channel(&self, gains: &GainSet, channel: Channel, cuts: &[Cut]) -> ChannelLoops {
        let n = self.omega.len();
        let mut out = ChannelLoops {
            channel,
            omega: self.omega.clone(),
            full: Vec::with_capacity(n),
            opened: vec![Vec::with_capacity(n); cuts.len()],
            noise: Vec::with_capacity(n),
        };
        for p in &self.points[mode(gains, Some(channel))] {
            let (full, opened, noise) = Self::affine_at(p, gains, channel, cuts);
            out.full.push(full);
            out.noise.push(noise);
            for (list, f) in out.opened.iter_mut().zip(opened) {
                list.push(f);
            }
        }
        out
    }

    /// The loop L cut as asked, at any frequency.
    pub fn loop_at(&self, gains: &GainSet, channel: Channel, cut: Cut, omega: f64) -> C {
        let p = self.point(mode(gains, Some(channel)), omega);
        let (full, opened, _) = Self::affine_at(&p, gains, channel, &[cut]);
        let x = gains[channel.index()].values(channel);
        affine_value(&full, &x) / affine_value(&opened[0], &x) - 1.0
    }

    /// The sensitivity S of the channel's held quantity, at any frequency.
    pub fn sensitivity_at(&self, gains: &GainSet, channel: Channel, omega: f64) -> C {
        let p = self.point(mode(gains, Some(channel)), omega);
        let (full, _, _) = Self::affine_at(&p, gains, channel, &[]);
        let x = gains[channel.index()].values(channel);
        let free = without_hold(channel, &x);
        affine_value(&full, &free) / affine_value(&full, &x)
    }

    /// det(I − K X) with all gains, over the grid.
    pub fn determinant(&self, gains: &GainSet) -> Vec<C> {
        self.points[mode(gains, None)].iter().map(|p| determinant(&p.matrix(gains))).collect()
    }
}

/// A channel's gains with those of the held quantity set to zero.
pub fn without_hold(channel: Channel, x: &[f64]) -> Vec<f64> {
    channel.gains().iter().zip(x).map(|(&g, &v)| if channel.holds(g) { 0.0 } else { v }).collect()
}

impl ChannelLoops {
    /// L of a cut at grid point `k`.
    pub fn loop_value(&self, k: usize, cut: usize, x: &[f64]) -> C {
        affine_value(&self.full[k], x) / affine_value(&self.opened[cut][k], x) - 1.0
    }

    /// L of a cut over the grid.
    pub fn loop_curve(&self, cut: usize, x: &[f64]) -> Vec<C> {
        (0..self.omega.len()).map(|k| self.loop_value(k, cut, x)).collect()
    }

    /// S over the grid.
    pub fn sensitivity_curve(&self, x: &[f64]) -> Vec<C> {
        let free = without_hold(self.channel, x);
        self.full.iter().map(|f| affine_value(f, &free) / affine_value(f, x)).collect()
    }

    /// Stick command per unit of noise over the grid, cut 0's loop closed.
    pub fn activity_curve(&self, x: &[f64]) -> Vec<C> {
        (0..self.omega.len())
            .map(|k| {
                affine_value(&self.noise[k], x) * affine_value(&self.opened[0][k], x)
                    / affine_value(&self.full[k], x)
            })
            .collect()
    }
}

/// How a gain depends on a variable of a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dependence {
    /// The variable.
    pub variable: usize,
    /// Place of the gain among the channel's.
    pub gain: usize,
    /// Change of the gain per unit of the variable.
    pub slope: f64,
}

/// Real part of `rotation* · f`, as a row over the variables that the gains
/// depend on.
pub fn real_row(rotation: C, f: &Affine, dependence: &[Dependence]) -> AffineRow {
    let r = rotation.conj();
    AffineRow::new(
        (r * f[0]).re,
        dependence.iter().map(|d| (d.variable, (r * f[1 + d.gain]).re * d.slope)).collect(),
    )
}

/// Minus a row times eight rows.
fn row_times(row: &[C; STATES], x: &[Row4; STATES]) -> Row4 {
    let mut out = [ZERO; 4];
    for (c, xk) in row.iter().zip(x) {
        if *c != ZERO {
            for (target, value) in out.iter_mut().zip(xk) {
                *target -= c * value;
            }
        }
    }
    out
}

/// det M, and adj(M) b by Cramer's rule: both stay finite where M is singular.
fn determinant_and_adjugate(m: &Matrix4c, b: &Row4) -> (C, Row4) {
    let adjugate = std::array::from_fn(|k| {
        if b.iter().all(|v| *v == ZERO) {
            return ZERO;
        }
        let mut replaced = *m;
        for i in 0..4 {
            replaced[i][k] = b[i];
        }
        determinant(&replaced)
    });
    (determinant(m), adjugate)
}

/// Determinant by the 2 × 2 minors of the upper and lower row pairs.
pub(super) fn determinant(m: &Matrix4c) -> C {
    let upper = |i: usize, j: usize| m[0][i] * m[1][j] - m[0][j] * m[1][i];
    let lower = |i: usize, j: usize| m[2][i] * m[3][j] - m[2][j] * m[3][i];
    upper(0, 1) * lower(2, 3) - upper(0, 2) * lower(1, 3)
        + upper(0, 3) * lower(1, 2)
        + upper(1, 2) * lower(0, 3)
        - upper(1, 3) * lower(0, 2)
        + upper(2, 3) * lower(0, 1)
}

/// Gains of a channel replaced in a set.
pub fn with_channel(gains: &GainSet, channel: Channel, x: &[f64]) -> GainSet {
    let mut out = *gains;
    out[channel.index()] = ChannelGains::from_values(channel, x);
    out
}
