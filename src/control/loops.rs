//! Frequency responses of the closed loops and their affine structure.
//!
//! With the plant's response X(jω) from sticks to measured states (hardware
//! included), the law's feedback is δ = −Λ δ with
//!
//! ```text
//! Λ = M (F_κ + Σ_axes e_i Σ_g K_ig c_ig(jω)) X
//! ```
//!
//! M being the allocation of feedback.
//! Every gain multiplies a matrix of rank one: a column (of M, or of the
//! command path for an outer loop) times a row. So with all other gains fixed
//! det(I + Λ) is *affine* in one channel's gains, by the matrix determinant
//! lemma. The same holds for the minor without one effector's row and column.
//! With D = det(I + Λ) and D̄ that minor, the loop cut at the effector with
//! everything else closed is
//!
//! ```text
//! 1 + L = D / D̄,    S = N / D,
//! ```
//!
//! N being D with the gains that hold the disturbed quantity set to zero.

use super::axis::{Axis, Channel, ChannelGains, Gain, GainSet};
use super::plant::{Hardware, Inversion, Plant, PlantError};
pub use crate::law::mdi::LawSettings;
use crate::law::mdi::Notch;
use crate::numerics::conic::AffineRow;
use crate::units::STANDARD_GRAVITY as GRAVITY;
use nalgebra::DMatrix;
use num_complex::Complex64 as C;
use std::sync::Arc;

const ZERO: C = C::new(0.0, 0.0);
const ONE: C = C::new(1.0, 0.0);

/// Command model of an attitude axis from command to reference, at s.
pub fn attitude_command(settings: &LawSettings, axis: Axis, s: C) -> C {
    let wn = if axis == Axis::Roll { settings.roll_frequency } else { settings.pitch_frequency };
    wn * wn / (s * s + 2.0 * settings.attitude_damping * wn * s + wn * wn)
}

/// A notch filter at s.
pub fn notch(notch: &Notch, s: C) -> C {
    let (w, wide) = (notch.frequency, 2.0 * notch.damping * notch.frequency);
    let even = s * s + w * w;
    (even + wide * notch.depth * s) / (even + wide * s)
}

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

/// Everything of the loops at one frequency that does not depend on gains.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// M N: the allocation of feedback behind the notch filters.
    allocation: Matrix4c,
    /// I + M N F_κ X.
    base: Matrix4c,
    /// Rows c_g X of each channel's gains K_D, K_P, K_I.
    rows: [[Row4; 3]; 6],
    /// Sticks per unit of roll (0) and pitch (1) command, without the error path.
    command_feed: [Row4; 2],
    /// Reference per unit of roll and pitch command, delayed as in the error path.
    command_reference: [C; 2],
}

/// The loops of one plant under one law on a frequency grid.
#[derive(Debug, Clone)]
pub struct LoopModel {
    omega: Arc<[f64]>,
    points: Vec<Point>,
    frequency: FrequencyModel,
    inversion: Inversion,
    settings: LawSettings,
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

impl LoopModel {
    /// Assembles the loops of `plant` under the law whose inversion is given
    /// (it may belong to another plant) on the grid `omega`, rad/s.
    pub fn new(
        plant: &Plant,
        inversion: &Inversion,
        settings: &LawSettings,
        hardware: Hardware,
        extra_delay: f64,
        omega: Arc<[f64]>,
    ) -> Result<Self, PlantError> {
        let frequency = FrequencyModel::new(plant, hardware, extra_delay)?;
        let mut model = Self {
            omega: omega.clone(),
            points: Vec::with_capacity(omega.len()),
            frequency,
            inversion: inversion.clone(),
            settings: *settings,
        };
        model.points = omega.iter().map(|&w| model.point(w)).collect();
        Ok(model)
    }

    /// The grid, rad/s.
    pub fn omega(&self) -> &Arc<[f64]> {
        &self.omega
    }

    fn point(&self, omega: f64) -> Point {
        let s = C::new(0.0, omega);
        let x = self.frequency.states(omega);
        let inv = &self.inversion;
        let kappa = self.settings.kappa;
        let (velocity, attitude) = inv.split_feedback();
        let f_kappa = attitude + velocity * kappa;
        let notches = self.settings.notch.axes().map(|n| n.map_or(ONE, |n| notch(&n, s)));
        let allocation: Matrix4c =
            std::array::from_fn(|i| std::array::from_fn(|j| inv.allocation[(i, j)] * notches[j]));
        let inner: [[C; 8]; 4] = std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                (0..4).fold(ZERO, |sum, j| sum + allocation[i][j] * f_kappa[(j, k)])
            })
        });
        let mut base = [[ZERO; 4]; 4];
        for (i, row) in base.iter_mut().enumerate() {
            for (k, xk) in x.iter().enumerate() {
                for (target, value) in row.iter_mut().zip(xk) {
                    *target += inner[i][k] * value;
                }
            }
            row[i] += ONE;
        }
        let mut rows = [[[ZERO; 4]; 3]; 6];
        for axis in Axis::ALL {
            let i = axis.index();
            let output = row_times(|k| inv.outputs[(i, k)], &x);
            let target = &mut rows[Channel::from(axis).index()];
            if matches!(axis, Axis::Roll | Axis::Pitch) {
                target[0] = row_times(|k| inv.rates[(i, k)], &x);
            }
            target[1] = output;
            target[2] = output.map(|v| v / s);
        }
        // φ_c = (K_P + K_I/s)(V_y,c − V_y)/g and θ_c = −(K_P + K_I/s)(V_x,c − V_x)/g:
        // the sign of the feedback rows makes I + Λ as for the inner axes.
        for (channel, row, sign) in [(Channel::Vx, 0, -1.0), (Channel::Vy, 1, 1.0)] {
            let v = row_times(|k| inv.ground_velocity[(row, k)] * sign / GRAVITY, &x);
            rows[channel.index()][1] = v;
            rows[channel.index()][2] = v.map(|v| v / s);
        }
        let delay = C::from_polar(1.0, -omega * self.settings.reference_delay);
        let mut command_feed = [[ZERO; 4]; 2];
        let mut command_reference = [ZERO; 2];
        for (i, axis) in [Axis::Roll, Axis::Pitch].into_iter().enumerate() {
            let model = attitude_command(&self.settings, axis, s);
            command_reference[i] = model * delay;
            let acceleration = s * s * model;
            // B_d⁻¹ (ν − F x_ref) + M N F_κ x_ref.
            let less = inv.decoupling * inv.feedback;
            let reference = self.settings.hybrid_feedforward.then(|| self.ideal_states(omega, i));
            for (j, feed) in command_feed[i].iter_mut().enumerate() {
                *feed = C::new(inv.decoupling[(j, i)], 0.0);
                if let Some(x) = &reference {
                    *feed += (0..8).fold(ZERO, |sum, k| sum + (inner[j][k] - less[(j, k)]) * x[k]);
                }
                *feed *= acceleration;
            }
        }
        Point { allocation, base, rows, command_feed, command_reference }
    }

    /// States of the reference model per unit of ν in output `i` (φ or θ), at ω.
    fn ideal_states(&self, omega: f64, i: usize) -> [C; 8] {
        let r = &self.inversion.reference;
        let s = C::new(0.0, omega);
        // The references φ or θ and their rate.
        let rho = |k: usize| r.input[(k, i)] / (s * s) + r.input[(k, 2 + i)] / s;
        let a = r.dynamics * r.state;
        let rhs: [C; 2] = std::array::from_fn(|j| {
            (0..8).fold(C::new(r.drive[(j, i)], 0.0), |sum, k| sum + r.dynamics[(j, k)] * rho(k))
        });
        let (m00, m11) = (s - a[(0, 0)], s - a[(1, 1)]);
        let det = m00 * m11 - a[(0, 1)] * a[(1, 0)];
        let z =
            [(m11 * rhs[0] + a[(0, 1)] * rhs[1]) / det, (m00 * rhs[1] + a[(1, 0)] * rhs[0]) / det];
        std::array::from_fn(|k| rho(k) + r.state[(k, 0)] * z[0] + r.state[(k, 1)] * z[1])
    }

    /// Column through which a channel's rows act on the sticks, at a point.
    fn column(&self, p: &Point, omega: f64, gains: &GainSet, channel: Channel) -> Row4 {
        let i = channel.axis().index();
        if !channel.is_outer() {
            return std::array::from_fn(|k| p.allocation[k][i]);
        }
        let s = C::new(0.0, omega);
        let k = gains[Channel::from(channel.axis()).index()];
        let error = (k.k_d * s + k.k_p + k.k_i / s) * p.command_reference[i];
        std::array::from_fn(|r| p.command_feed[i][r] + p.allocation[r][i] * error)
    }

    /// I + Λ at a point.
    fn matrix(&self, p: &Point, omega: f64, gains: &GainSet) -> Matrix4c {
        let mut m = p.base;
        for channel in Channel::ALL {
            let k = gains[channel.index()].array();
            if k == [0.0; 3] {
                continue;
            }
            let rows = &p.rows[channel.index()];
            let row: Row4 =
                std::array::from_fn(|j| (0..3).fold(ZERO, |sum, g| sum + k[g] * rows[g][j]));
            let column = self.column(p, omega, gains, channel);
            for i in 0..4 {
                for j in 0..4 {
                    m[i][j] += column[i] * row[j];
                }
            }
        }
        m
    }

    fn affine_at(
        &self,
        p: &Point,
        omega: f64,
        gains: &GainSet,
        channel: Channel,
        cuts: &[Cut],
    ) -> (Affine, Vec<Affine>, Affine) {
        let mut others = *gains;
        others[channel.index()] = ChannelGains::default();
        let m = self.matrix(p, omega, &others);
        let column = self.column(p, omega, gains, channel);
        let mut rows = p.rows[channel.index()];
        if let Some(outer) = channel.outer() {
            // What an outer loop commands enters this channel's errors by the
            // same column as the output does.
            let k = gains[outer.index()].array();
            let around = &p.rows[outer.index()];
            let s = C::new(0.0, omega);
            for (row, order) in rows.iter_mut().zip([s, ONE, s.inv()]) {
                let by = order * p.command_reference[channel.axis().index()];
                for (j, value) in row.iter_mut().enumerate() {
                    *value += by * (0..3).fold(ZERO, |sum, h| sum + k[h] * around[h][j]);
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
        // Noise is white on the rate of an attitude, on the yaw rate, on a
        // velocity; the lower derivatives see its integrals.
        let s = C::new(0.0, omega);
        let first = channel.gains()[0].index();
        let mut noise = [ZERO; 4];
        for (g, &gain) in channel.gains().iter().enumerate() {
            let unit = if channel.is_outer() { GRAVITY.recip() } else { 1.0 };
            noise[1 + g] = column[e] * unit / s.powu((gain.index() - first) as u32);
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
        for (p, &w) in self.points.iter().zip(self.omega.iter()) {
            let (full, opened, noise) = self.affine_at(p, w, gains, channel, cuts);
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
        let p = self.point(omega);
        let (full, opened, _) = self.affine_at(&p, omega, gains, channel, &[cut]);
        let x = gains[channel.index()].values(channel);
        affine_value(&full, &x) / affine_value(&opened[0], &x) - 1.0
    }

    /// The sensitivity S of the channel's held quantity, at any frequency.
    pub fn sensitivity_at(&self, gains: &GainSet, channel: Channel, omega: f64) -> C {
        let p = self.point(omega);
        let (full, _, _) = self.affine_at(&p, omega, gains, channel, &[]);
        let x = gains[channel.index()].values(channel);
        let free = without_hold(channel, &x);
        affine_value(&full, &free) / affine_value(&full, &x)
    }

    /// Response of the output φ or θ to its command, outer loops as in `gains`.
    pub fn attitude_response_at(&self, gains: &GainSet, axis: Axis, omega: f64) -> C {
        let i = axis.index();
        let p = self.point(omega);
        let m = self.matrix(&p, omega, gains);
        let channel = if axis == Axis::Roll { Channel::Vy } else { Channel::Vx };
        let column = self.column(&p, omega, gains, channel);
        let (d, adjugate) = determinant_and_adjugate(&m, &column);
        let row = p.rows[Channel::from(axis).index()][Gain::Proportional.index()];
        debug_assert!(i < 2);
        (0..4).fold(ZERO, |sum, j| sum + row[j] * adjugate[j]) / d
    }

    /// det(I + Λ) with all gains, over the grid.
    pub fn determinant(&self, gains: &GainSet) -> Vec<C> {
        self.points
            .iter()
            .zip(self.omega.iter())
            .map(|(p, &w)| determinant_and_adjugate(&self.matrix(p, w, gains), &[ZERO; 4]).0)
            .collect()
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

/// A real row times eight complex rows.
fn row_times(row: impl Fn(usize) -> f64, x: &[Row4; 8]) -> Row4 {
    let mut out = [ZERO; 4];
    for (k, xk) in x.iter().enumerate() {
        let c = row(k);
        if c != 0.0 {
            for (target, value) in out.iter_mut().zip(xk) {
                *target += c * value;
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
