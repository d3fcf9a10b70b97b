//! What the control stage needs to know of the aircraft and its hardware.

use super::axis::{Axis, Effector};
use nalgebra::{DMatrix, Matrix3, SMatrix, Vector4};
use serde::{Deserialize, Serialize};

/// States of the reduced model, in the order u v w p q r φ θ; m/s, rad/s, rad.
pub const RIGID_STATES: [&str; 8] = ["u", "v", "w", "p", "q", "r", "phi", "theta"];

/// Places of the rigid-body states in an eight-vector.
pub mod rigid {
    /// Forward body velocity.
    pub const U: usize = 0;
    /// Sideward body velocity.
    pub const V: usize = 1;
    /// Downward body velocity.
    pub const W: usize = 2;
    /// Roll rate.
    pub const P: usize = 3;
    /// Pitch rate.
    pub const Q: usize = 4;
    /// Yaw rate.
    pub const R: usize = 5;
    /// Bank angle.
    pub const PHI: usize = 6;
    /// Pitch angle.
    pub const THETA: usize = 7;
}

/// System matrix of the reduced model.
pub type Matrix8 = SMatrix<f64, 8, 8>;
/// Input matrix of the reduced model, per % of stick.
pub type Matrix8x4 = SMatrix<f64, 8, 4>;

/// Trimmed flight that a plant is linearised about.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrimPoint {
    /// Body velocity u, v, w, m/s.
    pub velocity_body: [f64; 3],
    /// Bank angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Sticks lat, lon, col, ped, %.
    pub sticks: [f64; 4],
}

/// A linear model at one speed, at full order and reduced to rigid-body states.
///
/// Inputs are the sticks lat, lon, col, ped in %; the full-order states may
/// have any order and number, [`Plant::measured`] points at the eight that the
/// control law measures.
#[derive(Debug, Clone)]
pub struct Plant {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Full-order system matrix, n × n.
    pub a: DMatrix<f64>,
    /// Full-order input matrix, n × 4, per %.
    pub b: DMatrix<f64>,
    /// Places of u v w p q r φ θ among the full-order states.
    pub measured: [usize; 8],
    /// Reduced system matrix.
    pub reduced_a: Matrix8,
    /// Reduced input matrix, per %.
    pub reduced_b: Matrix8x4,
    /// The trim.
    pub trim: TrimPoint,
}

/// Why a plant cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A matrix has a non-finite entry.
    #[error("the model at {speed:.1} m/s has a non-finite entry in {matrix}")]
    NotFinite {
        /// Speed, m/s.
        speed: f64,
        /// Which matrix.
        matrix: &'static str,
    },
    /// Sizes do not fit together.
    #[error("the model at {speed:.1} m/s has a {matrix} of {rows} x {columns}")]
    Size {
        /// Speed, m/s.
        speed: f64,
        /// Which matrix.
        matrix: &'static str,
        /// Rows.
        rows: usize,
        /// Columns.
        columns: usize,
    },
    /// The four sticks do not move the four outputs independently.
    #[error(
        "the model at {speed:.1} m/s cannot be inverted: the sticks do not move roll, pitch, \
         yaw and heave independently (condition number {condition:.1e} after scaling)"
    )]
    NotInvertible {
        /// Speed, m/s.
        speed: f64,
        /// Condition number of the scaled decoupling matrix.
        condition: f64,
    },
}

impl Plant {
    /// Checks sizes and finiteness.
    pub fn check(&self) -> Result<(), PlantError> {
        let speed = self.speed;
        let size = |matrix, m: &DMatrix<f64>, ok: bool| {
            if ok {
                Ok(())
            } else {
                Err(PlantError::Size { speed, matrix, rows: m.nrows(), columns: m.ncols() })
            }
        };
        let n = self.a.nrows();
        size("system matrix A", &self.a, n >= 8 && self.a.ncols() == n)?;
        size("input matrix B", &self.b, self.b.nrows() == n && self.b.ncols() == 4)?;
        if let Some(&k) = self.measured.iter().find(|&&k| k >= n) {
            return Err(PlantError::Size {
                speed,
                matrix: "measured state list",
                rows: k,
                columns: n,
            });
        }
        let parts: [(&'static str, &[f64]); 4] = [
            ("system matrix A", self.a.as_slice()),
            ("input matrix B", self.b.as_slice()),
            ("reduced system matrix", self.reduced_a.as_slice()),
            ("reduced input matrix", self.reduced_b.as_slice()),
        ];
        for (matrix, values) in parts {
            if values.iter().any(|v| !v.is_finite()) {
                return Err(PlantError::NotFinite { speed, matrix });
            }
        }
        Ok(())
    }
}

/// Whether a model is the design point or a variation of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelClass {
    /// Must meet the nominal margins.
    Nominal,
    /// Must meet the off-nominal margins.
    OffNominal,
}

/// One member of the model set.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelInfo {
    /// Name in the specification.
    pub name: String,
    /// Which margins it must meet.
    pub class: ModelClass,
    /// Delay on top of the hardware's, s.
    pub extra_delay: f64,
}

/// Plants of every model at every speed. Model 0 is the one that the control
/// law inverts.
#[derive(Debug, Clone)]
pub struct ModelSet {
    /// The models.
    pub models: Vec<ModelInfo>,
    /// `plants[speed][model]`, speeds strictly increasing.
    pub plants: Vec<Vec<Plant>>,
}

impl ModelSet {
    /// Speeds, m/s.
    pub fn speeds(&self) -> Vec<f64> {
        self.plants.iter().map(|p| p[0].speed).collect()
    }
}

/// The path from measurement to blade: actuators, delay and sensor filters,
/// the same in every channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hardware {
    /// Natural frequency of the second-order actuators, rad/s.
    pub actuator_bandwidth: f64,
    /// Damping ratio of the actuators.
    pub actuator_damping: f64,
    /// Transport delay, s.
    pub delay: f64,
    /// Bandwidth of the first-order sensor filters, rad/s.
    pub sensor_bandwidth: f64,
}

impl Hardware {
    /// For models that have actuators, delays and sensors inside: what is left
    /// is too fast to matter at any frequency of a loop.
    pub const INCLUDED: Self =
        Self { actuator_bandwidth: 1e5, actuator_damping: 1.0, delay: 0.0, sensor_bandwidth: 1e5 };

    /// Response at jω, with `extra_delay` s on top.
    pub fn response(&self, omega: f64, extra_delay: f64) -> num_complex::Complex64 {
        use num_complex::Complex64 as C;
        let s = C::new(0.0, omega);
        let wa = self.actuator_bandwidth;
        let actuator = wa * wa / (s * s + 2.0 * self.actuator_damping * wa * s + wa * wa);
        let delay = C::from_polar(1.0, -omega * (self.delay + extra_delay));
        actuator * delay / (1.0 + s / self.sensor_bandwidth)
    }

    /// Low-frequency equivalent delay, s.
    pub fn equivalent_delay(&self) -> f64 {
        2.0 * self.actuator_damping / self.actuator_bandwidth
            + self.delay
            + 1.0 / self.sensor_bandwidth
    }
}

/// What the control law knows of the aircraft at one speed: the outputs it
/// controls, and the inversion of the reduced model.
///
/// The outputs are y = (φ, θ, r, V_z) with V_z the earth-vertical velocity,
/// positive down. φ and θ are differentiated twice, r and V_z once:
/// ν = F x + B_d δ.
///
/// Commands go through the exact inverse B_d⁻¹. Feedback goes through
/// [`Inversion::allocation`], M, which differs from it in two ways. First,
/// what an attitude error asks for moves no collective: at speed cyclic lifts
/// almost as much as collective does, and to null that lift the exact inverse
/// flies pitch with the collective and heave with the cyclic. Second, M takes
/// the sticks' power over attitudes at the frequency where the loops cross,
/// with what u, v, w do until then, not at the first instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Inversion {
    /// Output rows C, 4 × 8.
    pub outputs: SMatrix<f64, 4, 8>,
    /// C A, 4 × 8; its first two rows are the attitude rates.
    pub rates: SMatrix<f64, 4, 8>,
    /// F: rows C A² (φ, θ) and C A (r, V_z).
    pub feedback: SMatrix<f64, 4, 8>,
    /// B_d⁻¹: sticks, %, per unit of ν (rad/s², rad/s², rad/s², m/s²).
    pub decoupling: SMatrix<f64, 4, 4>,
    /// M: sticks, %, per unit of the ν that feedback asks for.
    pub allocation: SMatrix<f64, 4, 4>,
    /// Rows of the ground velocity in heading axes, forward and to the right,
    /// 2 × 8.
    pub ground_velocity: SMatrix<f64, 2, 8>,
    /// What the aircraft does under a command, for the hybrid feed-forward.
    pub reference: ReferenceModel,
    /// The trim.
    pub trim: TrimPoint,
}

/// The reduced model under exact inversion, driven by the references.
///
/// With ρ = (φ, θ, φ', θ', r, V_z) the references follow their commands
/// exactly, so that only the horizontal velocities z = (u, v) have dynamics of
/// their own: x_ref = `state` z + `input` ρ and z' = `dynamics` x_ref +
/// `drive` ν.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceModel {
    /// 8 × 2.
    pub state: SMatrix<f64, 8, 2>,
    /// 8 × 6.
    pub input: SMatrix<f64, 8, 6>,
    /// First two rows of A − B B_d⁻¹ F, 2 × 8, with u and v pulled back where
    /// they would settle slower than [`SLOWEST_REFERENCE`], or drift apart.
    pub dynamics: SMatrix<f64, 2, 8>,
    /// First two rows of B B_d⁻¹, 2 × 4.
    pub drive: SMatrix<f64, 2, 4>,
}

/// Frequency at which the allocation of feedback takes the power of the sticks
/// over attitudes, rad/s: somewhat below the crossovers that are asked for.
pub const CONTROL_POWER_FREQUENCY: f64 = 1.0;

/// Least rate at which the velocities of the reference model settle, 1/s.
pub const SLOWEST_REFERENCE: f64 = 0.01;

/// Largest condition number of the scaled decoupling matrix that may be
/// inverted, 1.
pub const MAX_DECOUPLING_CONDITION: f64 = 1e6;

impl Inversion {
    /// Inversion of a plant's reduced model.
    pub fn new(plant: &Plant) -> Result<Self, PlantError> {
        plant.check()?;
        let (a, b, trim) = (plant.reduced_a, plant.reduced_b, plant.trim);
        let [u, v, w] = trim.velocity_body;
        let ((sp, cp), (st, ct)) = (trim.roll.sin_cos(), trim.pitch.sin_cos());
        let mut outputs = SMatrix::<f64, 4, 8>::zeros();
        outputs[(0, rigid::PHI)] = 1.0;
        outputs[(1, rigid::THETA)] = 1.0;
        outputs[(2, rigid::R)] = 1.0;
        // V_z = -u sinθ + (v sinφ + w cosφ) cosθ, differentiated at the trim.
        outputs[(3, rigid::U)] = -st;
        outputs[(3, rigid::V)] = sp * ct;
        outputs[(3, rigid::W)] = cp * ct;
        outputs[(3, rigid::PHI)] = (v * cp - w * sp) * ct;
        outputs[(3, rigid::THETA)] = -u * ct - (v * sp + w * cp) * st;
        let mut ground_velocity = SMatrix::<f64, 2, 8>::zeros();
        // V_x = u cosθ + (v sinφ + w cosφ) sinθ.
        ground_velocity[(0, rigid::U)] = ct;
        ground_velocity[(0, rigid::V)] = sp * st;
        ground_velocity[(0, rigid::W)] = cp * st;
        ground_velocity[(0, rigid::PHI)] = (v * cp - w * sp) * st;
        ground_velocity[(0, rigid::THETA)] = -u * st + (v * sp + w * cp) * ct;
        // V_y = v cosφ - w sinφ.
        ground_velocity[(1, rigid::V)] = cp;
        ground_velocity[(1, rigid::W)] = -sp;
        ground_velocity[(1, rigid::PHI)] = -v * sp - w * cp;

        let rates = outputs * a;
        let mut feedback = rates;
        let mut decoupling = outputs * b;
        for i in 0..2 {
            feedback.set_row(i, &(rates.row(i) * a));
            decoupling.set_row(i, &(rates.row(i) * b));
        }
        let inverse = invert_scaled(&decoupling)
            .map_err(|condition| PlantError::NotInvertible { speed: plant.speed, condition })?;
        let allocation = allocation(&a, &b, &feedback, &decoupling)
            .map_err(|condition| PlantError::NotInvertible { speed: plant.speed, condition })?;
        let not_invertible =
            PlantError::NotInvertible { speed: plant.speed, condition: f64::INFINITY };
        // Body rates from attitude rates and r.
        let mut to_rates = Matrix3::zeros();
        for (i, row) in [0, 1].into_iter().enumerate() {
            for j in 0..3 {
                to_rates[(i, j)] = rates[(row, rigid::P + j)];
            }
        }
        to_rates[(2, 2)] = 1.0;
        let from_rates = to_rates.try_inverse().ok_or(not_invertible)?;
        let mut state = SMatrix::<f64, 8, 2>::zeros();
        let mut input = SMatrix::<f64, 8, 6>::zeros();
        input[(rigid::PHI, 0)] = 1.0;
        input[(rigid::THETA, 1)] = 1.0;
        for i in 0..3 {
            for j in 0..3 {
                input[(rigid::P + i, 2 + j)] = from_rates[(i, j)];
            }
        }
        // w follows from V_z; a vehicle on its side has no such w.
        let c_w = outputs[(3, rigid::W)];
        state[(rigid::U, 0)] = 1.0;
        state[(rigid::V, 1)] = 1.0;
        state[(rigid::W, 0)] = -outputs[(3, rigid::U)] / c_w;
        state[(rigid::W, 1)] = -outputs[(3, rigid::V)] / c_w;
        input[(rigid::W, 0)] = -outputs[(3, rigid::PHI)] / c_w;
        input[(rigid::W, 1)] = -outputs[(3, rigid::THETA)] / c_w;
        input[(rigid::W, 5)] = 1.0 / c_w;
        let driven = b * inverse;
        let mut dynamics = (a - driven * feedback).fixed_rows::<2>(0).into_owned();
        // Velocities that drift apart by themselves would take the model with
        // them, out of reach of every loop: it is pulled back just enough.
        let free = dynamics * state;
        let half = 0.5 * free.trace();
        let root = half * half - free.determinant();
        let slowest = half + root.max(0.0).sqrt();
        let pull = (slowest + SLOWEST_REFERENCE).max(0.0);
        dynamics[(0, rigid::U)] -= pull;
        dynamics[(1, rigid::V)] -= pull;
        let reference = ReferenceModel {
            state,
            input,
            dynamics,
            drive: driven.fixed_rows::<2>(0).into_owned(),
        };
        Ok(Self {
            outputs,
            rates,
            feedback,
            decoupling: inverse,
            allocation,
            ground_velocity,
            reference,
            trim,
        })
    }

    /// F split into the part on u, v, w and the part on attitudes and rates.
    pub fn split_feedback(&self) -> (SMatrix<f64, 4, 8>, SMatrix<f64, 4, 8>) {
        let (mut velocity, mut attitude) = (self.feedback, self.feedback);
        velocity.columns_mut(rigid::P, 5).fill(0.0);
        attitude.columns_mut(rigid::U, 3).fill(0.0);
        (velocity, attitude)
    }

    /// Element-wise linear blend, `(1 − t)·self + t·other`: the rule by which
    /// the schedule is read between its breakpoints.
    pub fn blend(&self, other: &Self, t: f64) -> Self {
        let s = 1.0 - t;
        let trim = TrimPoint {
            velocity_body: std::array::from_fn(|i| {
                s * self.trim.velocity_body[i] + t * other.trim.velocity_body[i]
            }),
            roll: s * self.trim.roll + t * other.trim.roll,
            pitch: s * self.trim.pitch + t * other.trim.pitch,
            sticks: std::array::from_fn(|i| s * self.trim.sticks[i] + t * other.trim.sticks[i]),
        };
        Self {
            outputs: self.outputs * s + other.outputs * t,
            rates: self.rates * s + other.rates * t,
            feedback: self.feedback * s + other.feedback * t,
            decoupling: self.decoupling * s + other.decoupling * t,
            allocation: self.allocation * s + other.allocation * t,
            ground_velocity: self.ground_velocity * s + other.ground_velocity * t,
            reference: ReferenceModel {
                state: self.reference.state * s + other.reference.state * t,
                input: self.reference.input * s + other.reference.input * t,
                dynamics: self.reference.dynamics * s + other.reference.dynamics * t,
                drive: self.reference.drive * s + other.reference.drive * t,
            },
            trim,
        }
    }
}

/// M: the inverse of the control power at [`CONTROL_POWER_FREQUENCY`] with the
/// lift of lat, lon and ped left out, so that only V_z errors move the
/// collective, and their effect on attitudes is nulled by the others. `power`
/// is B_d, that power at the first instant; `Err` carries a condition number.
fn allocation(
    a: &Matrix8,
    b: &Matrix8x4,
    feedback: &SMatrix<f64, 4, 8>,
    power: &SMatrix<f64, 4, 4>,
) -> Result<SMatrix<f64, 4, 4>, f64> {
    // B_d + F_uvw (jω − A_uvw)⁻¹ B_uvw, real part: velocities follow, attitudes
    // are held. (jω − A)⁻¹ has the real part −A (ω² + A²)⁻¹.
    let velocity: Matrix3<f64> = a.fixed_view::<3, 3>(rigid::U, rigid::U).into_owned();
    let squared = Matrix3::identity() * CONTROL_POWER_FREQUENCY * CONTROL_POWER_FREQUENCY
        + velocity * velocity;
    let follow = -velocity * squared.try_inverse().ok_or(f64::INFINITY)?;
    let mut late = power
        + feedback.fixed_columns::<3>(rigid::U) * follow * b.fixed_rows::<3>(rigid::U).into_owned();
    let heave = Axis::Heave.index();
    for effector in [Effector::Lateral, Effector::Longitudinal, Effector::Pedal] {
        late[(heave, effector.index())] = 0.0;
    }
    // The vertical acceleration is the collective's at once.
    let collective = Effector::Collective.index();
    late[(heave, collective)] = power[(heave, collective)];
    invert_scaled(&late)
}

/// Inverse after scaling rows and columns to unit size; `Err` carries the
/// condition number of the scaled matrix.
fn invert_scaled(m: &SMatrix<f64, 4, 4>) -> Result<SMatrix<f64, 4, 4>, f64> {
    let (mut rows, mut columns) = (Vector4::repeat(1.0), Vector4::repeat(1.0));
    let mut scaled = *m;
    for _ in 0..5 {
        for i in 0..4 {
            let r = scaled.row(i).amax();
            let f = if r > 0.0 { r.sqrt().recip() } else { 1.0 };
            rows[i] *= f;
            scaled.row_mut(i).scale_mut(f);
            let c = scaled.column(i).amax();
            let f = if c > 0.0 { c.sqrt().recip() } else { 1.0 };
            columns[i] *= f;
            scaled.column_mut(i).scale_mut(f);
        }
    }
    let sv = scaled.singular_values();
    let condition = if sv.min() > 0.0 { sv.max() / sv.min() } else { f64::INFINITY };
    if condition.is_nan() || condition > MAX_DECOUPLING_CONDITION {
        return Err(condition);
    }
    let mut inverse = scaled.try_inverse().ok_or(f64::INFINITY)?;
    for i in 0..4 {
        for j in 0..4 {
            inverse[(i, j)] *= columns[i] * rows[j];
        }
    }
    Ok(inverse)
}
