//! One continuous model of all speeds, stitched from linear models.
//!
//! After Tobias and Tischler (US Army RDMR-AF-16-01, 2016): trim states, trim
//! controls and derivatives become tables over the airspeed along the body's x
//! axis, gravity and kinematics stay nonlinear, and the derivatives with
//! respect to u are not kept as such: they follow from how the trims change
//! along the tables. With U that airspeed, K the linearised gravity and
//! kinematics, R = A − K what is left of a point model, and k(x) the nonlinear
//! gravity and kinematics,
//!
//! ```text
//! x' = k(x) − k(x₀(U)) + R(U) (x − x₀(U)) + B(U) (δ − δ₀(U))
//! ```
//!
//! the column of R for u being nil. Every x₀(U) is an equilibrium. The
//! derivative with respect to u is that of the point model where
//! A x₀' + B δ₀' = 0: the slopes of the trim tables at the models are the ones
//! nearest to the differences of the trims that satisfy this, so that each
//! point model comes back exactly. How far they had to be moved says how well
//! trims and derivatives of the set belong together ([`Stitched::consistency`]).
//! See docs/theory/stitching.md.

use super::mapping::Inertia;
use super::{LtiSet, PointModel, Trim};
use crate::linear::dense::eigenvalues;
use crate::linear::reduction::{RIGID_BODY, residualise};
use crate::linear::{Channel, LinearError, StateSpace};
use crate::trim::{FlightCondition, Lateral};
use crate::units::{KNOT, STANDARD_GRAVITY as GRAVITY};
use nalgebra::{DMatrix, DVector, Vector3};

/// Rigid-body states.
pub const RIGID: usize = RIGID_BODY.len();
/// Sticks.
pub const INPUTS: usize = 4;
const U: usize = 0;
const V: usize = 1;
const W: usize = 2;
const P: usize = 3;
const PHI: usize = 6;
const THETA: usize = 7;

/// Trims that turn faster than this are not straight, rad/s.
const STRAIGHT: f64 = 1e-4;
/// Least distance of two models along the x axis, m/s.
const LEAST_STEP: f64 = 0.05;

/// Why a set cannot be stitched.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StitchError {
    /// The airspeed along x does not grow from model to model.
    #[error(
        "{label}: u of the trim, {found:.3} m/s, is not above that of the model before, \
         {before:.3} m/s: tables over u need it to grow"
    )]
    Order {
        /// The model.
        label: String,
        /// Its u, m/s.
        found: f64,
        /// u of the one before, m/s.
        before: f64,
    },
    /// A trim in a turn.
    #[error(
        "{label}: the trim turns, with rates up to {rate:.4} rad/s: stitching needs straight flight"
    )]
    Turning {
        /// The model.
        label: String,
        /// Largest rate, rad/s.
        rate: f64,
    },
    /// The trim slopes are not determined.
    #[error(
        "{label}: the trim equations A x0' + B d0' = 0 have no solution: the sticks do not move the motion independently"
    )]
    Slopes {
        /// The model.
        label: String,
    },
    /// A change of the centre of gravity without mass properties.
    #[error(
        "a shift of the centre of gravity needs mass and inertia: give mass, i_xx, i_yy and i_zz \
         under [models_from.mass] of the specification"
    )]
    NoMass,
    /// A sideways condition.
    #[error(
        "a stitched model starts with the sideways velocity of its trims, not with a sideslip or a \
         bank that is asked for"
    )]
    Lateral,
    /// Something that only a problem has.
    #[error("a set of linear models has no {what} that could be varied")]
    NotVaried {
        /// What it has not.
        what: &'static str,
    },
    /// The flight condition has no trim.
    #[error(
        "the stitched model has no trim at {speed:.1} kt ({residual:.1e} after {iterations} steps)"
    )]
    Trim {
        /// True airspeed, kt.
        speed: f64,
        /// What is left, SI.
        residual: f64,
        /// Newton steps.
        iterations: usize,
    },
    /// Reduction failed.
    #[error("{label}: {source}")]
    Linear {
        /// The model.
        label: String,
        /// Cause.
        source: LinearError,
    },
}

/// How far the trim slopes of a model had to be moved so that its derivatives
/// with respect to u come out of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Consistency {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Slopes of φ and θ as moved, less those of the trims, rad per m/s.
    pub attitude: [f64; 2],
    /// Slopes of lat, lon, col, ped likewise, % per m/s.
    pub sticks: [f64; 4],
}

/// A model of the set, ready for the tables.
#[derive(Debug, Clone, PartialEq)]
struct Node {
    speed: f64,
    /// x₀ and δ₀.
    state: DVector<f64>,
    sticks: DVector<f64>,
    /// x₀' and δ₀' per m/s of U.
    state_slope: DVector<f64>,
    sticks_slope: DVector<f64>,
    /// R with a column of zeros for u.
    rest: DMatrix<f64>,
    b: DMatrix<f64>,
}

/// Tables at one U: values, and slopes per m/s.
#[derive(Debug, Clone)]
pub struct Lookup {
    state: DVector<f64>,
    state_slope: DVector<f64>,
    sticks: DVector<f64>,
    sticks_slope: DVector<f64>,
    rest: DMatrix<f64>,
    rest_slope: DMatrix<f64>,
    b: DMatrix<f64>,
    b_slope: DMatrix<f64>,
    /// Room for a state, a difference of states, one of sticks, and forces.
    air: DVector<f64>,
    off: DVector<f64>,
    moved: DVector<f64>,
    force: DVector<f64>,
}

/// A continuous model of all speeds of a set.
#[derive(Debug, Clone, PartialEq)]
pub struct Stitched {
    /// Name of the aircraft.
    pub name: String,
    /// States: u v w p q r φ θ, then those of the models.
    pub states: Vec<Channel>,
    /// Places of the measured eight.
    pub measured: [usize; RIGID],
    /// Whether actuators, delays and sensors are in it.
    pub hardware_included: bool,
    /// Least and greatest position of lat, lon, col, ped, %.
    pub stick_limits: [[f64; 2]; 4],
    /// What was moved to make trims and derivatives fit, one a model.
    pub consistency: Vec<Consistency>,
    /// What was done that the owner of the set should know.
    pub notes: Vec<String>,
    nodes: Vec<Node>,
    inertia: Option<Inertia>,
    /// Mass over that of the set.
    mass_scale: f64,
    /// Inertia likewise.
    inertia_scale: f64,
    /// From the new centre of gravity to that of the set, body axes, m.
    old_center: Vector3<f64>,
}

/// Nonlinear gravity and kinematics k(x) of the eight states.
fn kinematics(x: &[f64], inertia: Option<&Inertia>, out: &mut [f64]) {
    let [u, v, w, p, q, r, phi, theta] = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| x[k]);
    let ((sp, cp), (st, ct)) = (phi.sin_cos(), theta.sin_cos());
    out[U] = r * v - q * w - GRAVITY * st;
    out[V] = p * w - r * u + GRAVITY * sp * ct;
    out[W] = q * u - p * v + GRAVITY * cp * ct;
    let gyroscopic = inertia.map_or(Vector3::zeros(), |i| gyroscopic(i, p, q, r));
    for k in 0..3 {
        out[P + k] = gyroscopic[k];
    }
    let tangent = st / ct;
    out[PHI] = p + (q * sp + r * cp) * tangent;
    out[THETA] = q * cp - r * sp;
}

/// −I⁻¹ ω × I ω.
fn gyroscopic(i: &Inertia, p: f64, q: f64, r: f64) -> Vector3<f64> {
    let rate = Vector3::new(p, q, r);
    -(i.inverse * rate.cross(&(i.tensor * rate)))
}

/// K: derivatives of [`kinematics`] at a state.
fn kinematic_matrix(x: &[f64], inertia: Option<&Inertia>) -> DMatrix<f64> {
    let [u, v, w, p, q, r, phi, theta] = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| x[k]);
    let ((sp, cp), (st, ct)) = (phi.sin_cos(), theta.sin_cos());
    let g = GRAVITY;
    let mut m = DMatrix::zeros(RIGID, RIGID);
    let mut set = |row: usize, entries: &[(usize, f64)]| {
        for (column, value) in entries {
            m[(row, *column)] = *value;
        }
    };
    set(U, &[(V, r), (W, -q), (P + 1, -w), (P + 2, v), (THETA, -g * ct)]);
    set(V, &[(U, -r), (W, p), (P, w), (P + 2, -u), (PHI, g * cp * ct), (THETA, -g * sp * st)]);
    set(W, &[(U, q), (V, -p), (P, -v), (P + 1, u), (PHI, -g * sp * ct), (THETA, -g * cp * st)]);
    let (tangent, secant) = (st / ct, 1.0 / (ct * ct));
    set(
        PHI,
        &[
            (P, 1.0),
            (P + 1, sp * tangent),
            (P + 2, cp * tangent),
            (PHI, (q * cp - r * sp) * tangent),
            (THETA, (q * sp + r * cp) * secant),
        ],
    );
    set(THETA, &[(P + 1, cp), (P + 2, -sp), (PHI, -q * sp - r * cp)]);
    if let Some(i) = inertia {
        // d/dω of −I⁻¹ (ω × I ω) = −I⁻¹ ([ω×] I − [(I ω)×]).
        let rate = Vector3::new(p, q, r);
        let part =
            -(i.inverse * (rate.cross_matrix() * i.tensor - (i.tensor * rate).cross_matrix()));
        m.view_mut((P, P), (3, 3)).copy_from(&part);
    }
    m
}

/// Slopes at points of a table: those of the parabola through the three
/// nearest points, or of the line through two.
fn parabola_slope(at: &[f64], node: usize) -> Vec<(usize, f64)> {
    let n = at.len();
    match n {
        0 | 1 => Vec::new(),
        2 => {
            let h = at[1] - at[0];
            vec![(0, -1.0 / h), (1, 1.0 / h)]
        }
        _ => {
            let first = node.saturating_sub(1).min(n - 3);
            let x = [at[first], at[first + 1], at[first + 2]];
            (0..3)
                .map(|i| {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    let w =
                        ((at[node] - x[j]) + (at[node] - x[k])) / ((x[i] - x[j]) * (x[i] - x[k]));
                    (first + i, w)
                })
                .collect()
        }
    }
}

impl Stitched {
    /// The stitched model of a set. Where the models do not have the same
    /// states, the eight rigid-body states of each are stitched.
    ///
    /// # Errors
    /// Trims that cannot be tables over u, or that do not determine slopes.
    pub fn new(set: &LtiSet, inertia: Option<Inertia>) -> Result<Self, StitchError> {
        let mut notes = set.notes.clone();
        let same = set.models.iter().all(|m| m.model.states() == set.models[0].model.states());
        let mut models: Vec<PointModel> = set.models.clone();
        if !same {
            notes.push(
                "the models have different states beside the eight: these are residualised before \
                 stitching"
                    .into(),
            );
            for model in &mut models {
                *model = eight_states(model)
                    .map_err(|source| StitchError::Linear { label: model.label.clone(), source })?;
            }
        }
        let speeds: Vec<f64> = models.iter().map(|m| m.trim.velocity_body[0]).collect();
        for (k, model) in models.iter().enumerate() {
            if k > 0 && speeds[k] < speeds[k - 1] + LEAST_STEP {
                return Err(StitchError::Order {
                    label: model.label.clone(),
                    found: speeds[k],
                    before: speeds[k - 1],
                });
            }
            let rate = model.trim.rates.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            if rate > STRAIGHT {
                return Err(StitchError::Turning { label: model.label.clone(), rate });
            }
        }
        let states = models[0].model.states().to_vec();
        let mut nodes: Vec<Node> =
            models.iter().map(|model| node(model, inertia.as_ref())).collect();
        let consistency = slopes(&mut nodes, &models, &speeds)?;
        Ok(Self {
            name: set.name.clone(),
            measured: models[0].measured,
            hardware_included: set.hardware_included,
            stick_limits: set.stick_limits,
            states,
            consistency,
            notes,
            nodes,
            inertia,
            mass_scale: 1.0,
            inertia_scale: 1.0,
            old_center: Vector3::zeros(),
        })
    }

    /// The same aircraft with another mass, inertia alike, and centre of
    /// gravity, m aft: the aerodynamic forces and moments stay those of the
    /// set, at the same airspeed and controls. Trims change, and with them the
    /// linear models.
    ///
    /// # Errors
    /// A shift without mass and inertia.
    pub fn varied(&self, mass_scale: f64, shift_aft: f64) -> Result<Self, StitchError> {
        if shift_aft != 0.0 && self.inertia.and_then(|i| i.mass).is_none() {
            return Err(StitchError::NoMass);
        }
        let mut out = self.clone();
        out.mass_scale *= mass_scale;
        out.inertia_scale *= mass_scale;
        out.old_center.x += shift_aft;
        Ok(out)
    }

    /// The same aircraft with moments and products of inertia that are a factor
    /// of what they are, and the same mass.
    #[must_use]
    pub fn with_inertia(&self, factor: f64) -> Self {
        let mut out = self.clone();
        out.inertia_scale *= factor;
        out
    }

    /// Whether mass, inertia and centre of gravity are those of the set.
    #[must_use]
    pub fn as_given(&self) -> bool {
        self.mass_scale == 1.0 && self.inertia_scale == 1.0 && self.old_center == Vector3::zeros()
    }

    /// Mass properties of the set, if they are known.
    #[must_use]
    pub fn inertia(&self) -> Option<&Inertia> {
        self.inertia.as_ref()
    }

    /// Number of states.
    #[must_use]
    pub fn order(&self) -> usize {
        self.states.len()
    }

    /// Least and largest true airspeed of the set, m/s.
    #[must_use]
    pub fn speed_range(&self) -> [f64; 2] {
        let last = self.nodes.len() - 1;
        [self.nodes[0].speed, self.nodes[last].speed]
    }

    /// Least and largest airspeed along the body's x axis in the trims of the
    /// set, m/s: where the tables begin and end.
    #[must_use]
    pub fn axial_range(&self) -> [f64; 2] {
        let last = self.nodes.len() - 1;
        [self.nodes[0].state[U], self.nodes[last].state[U]]
    }

    /// Magnitude of the fastest eigenvalue of the models, rad/s, or a bound of
    /// it: what the step of an integration must be short against.
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let of = |node: &Node| {
            let sticks = std::array::from_fn(|k| node.sticks[k]);
            let (a, _) = self.linear(node.state.as_slice(), &sticks);
            // A norm bounds the eigenvalues where they are not found.
            let bound = a.row_iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
            eigenvalues(&a).map_or_else(
                |_| bound.fold(0.0, f64::max),
                |values| values.iter().map(|z| z.norm()).fold(0.0, f64::max),
            )
        };
        self.nodes.iter().map(of).fold(0.0, f64::max)
    }

    /// Steady flight at a condition: level and straight, and with the mass of the
    /// set, that of the tables; else what [`Stitched::trim`] finds.
    ///
    /// # Errors
    /// No trim, or a sideslip or bank that is asked for: the sideways velocity
    /// is that of the tables.
    pub fn steady(&self, condition: &FlightCondition) -> Result<StitchedTrim, StitchError> {
        let FlightCondition { airspeed: speed, climb_rate: climb, turn_rate: turn, lateral } =
            *condition;
        if lateral != Lateral::Sideslip(0.0) {
            return Err(StitchError::Lateral);
        }
        if !self.as_given() || climb != 0.0 || turn != 0.0 {
            return self.trim(speed, climb, turn);
        }
        let (state, sticks) = self.table_point(self.table_speed(speed));
        Ok(StitchedTrim { speed, climb, turn, state: state.as_slice().to_vec(), sticks })
    }

    /// True airspeeds of the models, m/s.
    #[must_use]
    pub fn speeds(&self) -> Vec<f64> {
        self.nodes.iter().map(|n| n.speed).collect()
    }

    /// Room for lookups.
    #[must_use]
    pub fn lookup(&self) -> Lookup {
        let n = self.order();
        let matrix = |columns: usize| DMatrix::zeros(n, columns);
        let vector = || DVector::zeros(n);
        Lookup {
            state: vector(),
            state_slope: vector(),
            sticks: DVector::zeros(INPUTS),
            sticks_slope: DVector::zeros(INPUTS),
            rest: matrix(n),
            rest_slope: matrix(n),
            b: matrix(INPUTS),
            b_slope: matrix(INPUTS),
            air: vector(),
            off: vector(),
            moved: DVector::zeros(INPUTS),
            force: vector(),
        }
    }

    /// Tables at an airspeed along x, m/s. Beyond the ends derivatives stay
    /// and trims go on straight.
    fn look(&self, u: f64, at: &mut Lookup) {
        let last = self.nodes.len() - 1;
        let place = self.nodes.partition_point(|n| n.state[U] <= u);
        let end = if place == 0 {
            Some(&self.nodes[0])
        } else if place > last {
            Some(&self.nodes[last])
        } else {
            None
        };
        if let Some(node) = end {
            let step = u - node.state[U];
            at.state.copy_from(&node.state);
            at.state.axpy(step, &node.state_slope, 1.0);
            at.state_slope.copy_from(&node.state_slope);
            at.sticks.copy_from(&node.sticks);
            at.sticks.axpy(step, &node.sticks_slope, 1.0);
            at.sticks_slope.copy_from(&node.sticks_slope);
            at.rest.copy_from(&node.rest);
            at.rest_slope.fill(0.0);
            at.b.copy_from(&node.b);
            at.b_slope.fill(0.0);
            return;
        }
        let (low, high) = (&self.nodes[place - 1], &self.nodes[place]);
        let h = high.state[U] - low.state[U];
        let t = (u - low.state[U]) / h;
        let value = hermite(t, h);
        let slope = hermite_slope(t, h);
        let blend = |to: &mut DVector<f64>, w: &[f64; 4], parts: [&DVector<f64>; 4]| {
            to.fill(0.0);
            for (w, part) in w.iter().zip(parts) {
                to.axpy(*w, part, 1.0);
            }
        };
        let states = [&low.state, &low.state_slope, &high.state, &high.state_slope];
        blend(&mut at.state, &value, states);
        blend(&mut at.state_slope, &slope, states);
        let sticks = [&low.sticks, &low.sticks_slope, &high.sticks, &high.sticks_slope];
        blend(&mut at.sticks, &value, sticks);
        blend(&mut at.sticks_slope, &slope, sticks);
        // The argument itself, without rounding.
        at.state[U] = u;
        at.state_slope[U] = 1.0;
        // Derivatives run straight between the models.
        for (to, slope, low, high) in [
            (&mut at.rest, &mut at.rest_slope, &low.rest, &high.rest),
            (&mut at.b, &mut at.b_slope, &low.b, &high.b),
        ] {
            let pairs = low.as_slice().iter().zip(high.as_slice());
            let to = to.as_mut_slice().iter_mut().zip(slope.as_mut_slice());
            for ((to, slope), (low, high)) in to.zip(pairs) {
                *to = low + t * (high - low);
                *slope = (high - low) / h;
            }
        }
    }

    /// x' at a state and sticks, %, in air that moves with `wind` and turns
    /// with `wind_rate`, body axes, m/s and rad/s. Allocates nothing.
    pub fn rates(
        &self,
        x: &[f64],
        sticks: &[f64; INPUTS],
        wind: [f64; 3],
        wind_rate: [f64; 3],
        work: &mut Lookup,
        rates: &mut [f64],
    ) {
        let n = self.order();
        work.air.copy_from_slice(&x[..n]);
        let arm = self.old_center;
        for (k, rate) in wind_rate.into_iter().enumerate() {
            work.air[P + k] -= rate;
        }
        let turn = Vector3::new(work.air[P], work.air[P + 1], work.air[P + 2]).cross(&arm);
        for k in 0..3 {
            work.air[U + k] += turn[k] - wind[k];
        }
        self.look(work.air[U], work);
        work.off.copy_from(&work.air);
        work.off -= &work.state;
        for (k, stick) in sticks.iter().enumerate() {
            work.moved[k] = stick - work.sticks[k];
        }
        let mut trimmed = [0.0; RIGID];
        kinematics(work.state.as_slice(), None, &mut trimmed);
        work.force.gemv(1.0, &work.rest, &work.off, 0.0);
        work.force.gemv(1.0, &work.b, &work.moved, 1.0);
        for (force, trimmed) in work.force.iter_mut().zip(trimmed) {
            *force -= trimmed;
        }
        self.to_new_mass(work.force.as_mut_slice());
        kinematics(x, self.inertia.as_ref(), rates);
        rates[RIGID..n].fill(0.0);
        for (rate, force) in rates.iter_mut().zip(&work.force) {
            *rate += force;
        }
    }

    /// Specific forces and moments of the set to those of the new mass and
    /// centre of gravity.
    fn to_new_mass(&self, force: &mut [f64]) {
        if self.as_given() {
            return;
        }
        for f in &mut force[..P] {
            *f /= self.mass_scale;
        }
        for f in &mut force[P..P + 3] {
            *f /= self.inertia_scale;
        }
        let Some(Inertia { mass: Some(mass), inverse, .. }) = &self.inertia else { return };
        // I⁻¹ m of the new mass properties.
        let mass = mass * (self.mass_scale / self.inertia_scale);
        let moment = self.old_center.cross(&Vector3::new(force[U], force[V], force[W])) * mass;
        let added = inverse * moment;
        for k in 0..3 {
            force[P + k] += added[k];
        }
    }

    /// Whether trims of the tables and of the model agree: those of the set as
    /// it was given do.
    fn table_point(&self, u: f64) -> (DVector<f64>, [f64; INPUTS]) {
        let mut at = self.lookup();
        self.look(u, &mut at);
        (at.state.clone(), std::array::from_fn(|k| at.sticks[k]))
    }

    /// The linear model at a state and sticks, still air: A and B.
    #[must_use]
    pub fn linear(&self, x: &[f64], sticks: &[f64; INPUTS]) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.order();
        let mut at = self.lookup();
        let arm = self.old_center;
        // To the state at the old centre of gravity, and its derivative.
        let mut lever = DMatrix::identity(n, n);
        let cross = -arm.cross_matrix();
        lever.view_mut((U, P), (3, 3)).copy_from(&cross);
        let air = &lever * DVector::from_column_slice(&x[..n]);
        self.look(air[U], &mut at);
        let off = &air - &at.state;
        let moved = DVector::from_fn(INPUTS, |k, _| sticks[k] - at.sticks[k]);
        let mut force = at.rest.clone();
        let trimmed = kinematic_matrix(at.state.as_slice(), None);
        let mut by_u = &at.rest_slope * &off - &at.rest * &at.state_slope + &at.b_slope * &moved
            - &at.b * &at.sticks_slope;
        let along = trimmed * at.state_slope.rows(0, RIGID);
        for k in 0..RIGID {
            by_u[k] -= along[k];
        }
        force.set_column(U, &by_u);
        let mut force = force * lever;
        let mut b = at.b.clone();
        for column in 0..n {
            self.to_new_mass(force.column_mut(column).as_mut_slice());
        }
        for column in 0..INPUTS {
            self.to_new_mass(b.column_mut(column).as_mut_slice());
        }
        let own = kinematic_matrix(x, self.inertia.as_ref());
        let mut a = force;
        for i in 0..RIGID {
            for j in 0..RIGID {
                a[(i, j)] += own[(i, j)];
            }
        }
        (a, b)
    }

    /// Level straight flight at a true airspeed, m/s, and the linear model
    /// there. At the speeds of the set, with its mass, that is the model of the
    /// set; between them the trim is that of the tables.
    ///
    /// # Errors
    /// No trim with the changed mass.
    pub fn at(&self, speed: f64) -> Result<PointModel, StitchError> {
        let (state, sticks) = if self.as_given() {
            self.table_point(self.table_speed(speed))
        } else {
            let trimmed = self.trim(speed, 0.0, 0.0)?;
            (DVector::from_vec(trimmed.state), trimmed.sticks)
        };
        let label = format!("{} at {:.1} kt", self.name, speed / KNOT);
        let (a, b) = self.linear(state.as_slice(), &sticks);
        let inputs = crate::problem::STICKS
            .map(|name| Channel::new(name, crate::units::Kind::Percent))
            .to_vec();
        let model = StateSpace::with_state_outputs(self.states.clone(), inputs, a, b)
            .map_err(|source| StitchError::Linear { label: label.clone(), source })?;
        Ok(PointModel {
            label,
            speed,
            model,
            measured: self.measured,
            trim: Trim {
                velocity_body: [state[U], state[V], state[W]],
                rates: [state[P], state[P + 1], state[P + 2]],
                roll: state[PHI],
                pitch: state[THETA],
                sticks,
            },
            inner_trim: state.iter().skip(RIGID).map(|x| Some(*x)).collect(),
        })
    }

    /// u of the table at which the trim has a true airspeed, m/s.
    fn table_speed(&self, speed: f64) -> f64 {
        if let Some(node) = self.nodes.iter().find(|n| (n.speed - speed).abs() < super::SAME_SPEED)
        {
            return node.state[U];
        }
        let own = |node: &Node| node.state.rows(0, 3).norm();
        let place = self.nodes.partition_point(|n| own(n) <= speed);
        let last = self.nodes.len() - 1;
        if place == 0 {
            return self.nodes[0].state[U] - (own(&self.nodes[0]) - speed);
        }
        if place > last {
            return self.nodes[last].state[U] + (speed - own(&self.nodes[last]));
        }
        let (mut low, mut high) = (self.nodes[place - 1].state[U], self.nodes[place].state[U]);
        let mut at = self.lookup();
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            self.look(middle, &mut at);
            if at.state.rows(0, 3).norm() > speed { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }

    /// The trim of a true airspeed, m/s, with a rate of climb, m/s, and a turn
    /// rate, rad/s. The velocity to starboard is that of the tables.
    ///
    /// # Errors
    /// Newton's iteration does not end.
    pub fn trim(&self, speed: f64, climb: f64, turn: f64) -> Result<StitchedTrim, StitchError> {
        const ITERATIONS: usize = 40;
        const TOLERANCE: f64 = 1e-11;
        let n = self.order();
        let (state, sticks) = self.table_point(self.table_speed(speed));
        // Unknown: all states but the rates, and the sticks.
        let free: Vec<usize> = (0..n).filter(|k| !(P..P + 3).contains(k)).collect();
        let size = free.len() + INPUTS;
        let mut z = DVector::zeros(size);
        for (k, place) in free.iter().enumerate() {
            z[k] = state[*place];
        }
        for k in 0..INPUTS {
            z[free.len() + k] = sticks[k];
        }
        let mut work = self.lookup();
        let full = |z: &DVector<f64>| -> (Vec<f64>, [f64; INPUTS]) {
            let mut x = vec![0.0; n];
            for (k, place) in free.iter().enumerate() {
                x[*place] = z[k];
            }
            let ((sp, cp), (st, ct)) = (x[PHI].sin_cos(), x[THETA].sin_cos());
            x[P] = -turn * st;
            x[P + 1] = turn * ct * sp;
            x[P + 2] = turn * ct * cp;
            (x, std::array::from_fn(|k| z[free.len() + k]))
        };
        let mut residual = |z: &DVector<f64>| -> DVector<f64> {
            let (x, sticks) = full(z);
            let mut rates = vec![0.0; n];
            self.rates(&x, &sticks, [0.0; 3], [0.0; 3], &mut work, &mut rates);
            let ((sp, cp), (st, ct)) = (x[PHI].sin_cos(), x[THETA].sin_cos());
            let mut out = DVector::zeros(size);
            // φ' and θ' are nil by the choice of the rates.
            let dynamic = (0..n).filter(|k| *k != PHI && *k != THETA);
            for (row, k) in dynamic.enumerate() {
                out[row] = rates[k];
            }
            let row = n - 2;
            out[row] = (x[U] * x[U] + x[V] * x[V] + x[W] * x[W]).sqrt() - speed;
            out[row + 1] = x[U] * st - (x[V] * sp + x[W] * cp) * ct - climb;
            out[row + 2] = x[V] - work.state[V];
            out
        };
        // At rest |V| has no derivative: u takes its place.
        let hover = speed < 0.1;
        let mut r = residual(&z);
        let mut norm = f64::INFINITY;
        for _ in 0..ITERATIONS {
            if hover {
                r[n - 2] = z[U] - self.table_speed(speed);
            }
            norm = r.amax();
            if norm < TOLERANCE {
                let (state, sticks) = full(&z);
                return Ok(StitchedTrim { speed, climb, turn, state, sticks });
            }
            let mut jacobian = DMatrix::zeros(size, size);
            for k in 0..size {
                let h = 1e-6 * z[k].abs().max(1e-2);
                let (mut up, mut down) = (z.clone(), z.clone());
                up[k] += h;
                down[k] -= h;
                let (mut up, mut down) = (residual(&up), residual(&down));
                if hover {
                    up[n - 2] = if k == U { h } else { 0.0 };
                    down[n - 2] = -up[n - 2];
                }
                jacobian.set_column(k, &((up - down) / (2.0 * h)));
            }
            let Some(step) = jacobian.full_piv_lu().solve(&r) else { break };
            z -= step;
            r = residual(&z);
            if r.iter().any(|x| !x.is_finite()) {
                break;
            }
        }
        Err(StitchError::Trim { speed: speed / KNOT, residual: norm, iterations: ITERATIONS })
    }
}

/// A trim of a stitched model.
#[derive(Debug, Clone, PartialEq)]
pub struct StitchedTrim {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Rate of climb, m/s.
    pub climb: f64,
    /// Turn rate, rad/s.
    pub turn: f64,
    /// All states.
    pub state: Vec<f64>,
    /// Sticks lat, lon, col, ped, %.
    pub sticks: [f64; INPUTS],
}

/// Weights of value and slope at both ends of an interval.
fn hermite(t: f64, h: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [(1.0 + 2.0 * t) * s * s, h * t * s * s, t * t * (3.0 - 2.0 * t), -h * t * t * s]
}

/// Their derivatives.
fn hermite_slope(t: f64, h: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-6.0 * t * s / h, s * (1.0 - 3.0 * t), 6.0 * t * s / h, t * (3.0 * t - 2.0)]
}

/// A point model with its inner states residualised.
fn eight_states(point: &PointModel) -> Result<PointModel, LinearError> {
    let model = residualise(&point.model, &RIGID_BODY)?.model.reorder_states(&RIGID_BODY)?;
    Ok(PointModel {
        model,
        measured: std::array::from_fn(|k| k),
        inner_trim: Vec::new(),
        ..point.clone()
    })
}

fn node(point: &PointModel, inertia: Option<&Inertia>) -> Node {
    let n = point.model.states().len();
    let trim = &point.trim;
    let mut state = DVector::zeros(n);
    for k in 0..3 {
        state[U + k] = trim.velocity_body[k];
    }
    state[PHI] = trim.roll;
    state[THETA] = trim.pitch;
    let mut rest = point.model.a().clone();
    let own = kinematic_matrix(state.as_slice(), inertia);
    for i in 0..RIGID {
        for j in 0..RIGID {
            rest[(i, j)] -= own[(i, j)];
        }
    }
    Node {
        speed: point.speed,
        sticks: DVector::from_column_slice(&trim.sticks),
        state_slope: DVector::zeros(n),
        sticks_slope: DVector::zeros(INPUTS),
        rest,
        b: point.model.b().clone(),
        state,
    }
}

/// What a slope of one unit weighs: 1 m/s, a degree, 1 % of stick. Inner
/// states whose trims are not known are free.
const ANGLE_WEIGHT: f64 = std::f64::consts::PI / 180.0;
const FREE_WEIGHT: f64 = 1e3;

/// Slopes of the trim tables: nearest to the differences of the trims, subject
/// to A x₀' + B δ₀' = 0. Fills the nodes, and the trims of inner states that
/// the set does not give.
fn slopes(
    nodes: &mut [Node],
    models: &[PointModel],
    speeds: &[f64],
) -> Result<Vec<Consistency>, StitchError> {
    let n = nodes[0].state.len();
    let known: Vec<bool> = (0..n)
        .map(|k| k < RIGID || models.iter().all(|m| m.inner_trim[k - RIGID].is_some()))
        .collect();
    for (node, model) in nodes.iter_mut().zip(models) {
        for (k, trim) in model.inner_trim.iter().enumerate() {
            node.state[RIGID + k] = trim.filter(|_| known[RIGID + k]).unwrap_or(0.0);
        }
    }
    let mut out = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let mut from = DVector::zeros(n + INPUTS);
        for (other, weight) in parabola_slope(speeds, index) {
            from.rows_mut(0, n).axpy(weight, &nodes[other].state, 1.0);
            from.rows_mut(n, INPUTS).axpy(weight, &nodes[other].sticks, 1.0);
        }
        // Columns that are free: v, w, attitudes, inner states, sticks.
        let free: Vec<usize> =
            (0..n + INPUTS).filter(|k| *k != U && !(P..P + 3).contains(k)).collect();
        let weight = |k: usize| match k {
            PHI | THETA => ANGLE_WEIGHT,
            _ if k >= n => 1.0,
            _ if !known[k] => FREE_WEIGHT,
            _ => 1.0,
        };
        let (a, b) = (model.model.a(), model.model.b());
        let column = |k: usize| if k < n { a.column(k) } else { b.column(k - n) };
        // Attitude rows hold by themselves in straight flight.
        let rows: Vec<usize> = (0..n).filter(|k| *k != PHI && *k != THETA).collect();
        let g = DMatrix::from_fn(rows.len(), free.len(), |i, j| {
            column(free[j])[rows[i]] * weight(free[j])
        });
        let start = DVector::from_fn(free.len(), |j, _| from[free[j]] / weight(free[j]));
        let target = DVector::from_fn(rows.len(), |i, _| -a[(rows[i], U)]) - &g * &start;
        let failed = || StitchError::Slopes { label: model.label.clone() };
        // Rows to like size, then the least change that satisfies them.
        let scale: Vec<f64> =
            g.row_iter().map(|r| r.norm()).map(|x| if x > 0.0 { 1.0 / x } else { 1.0 }).collect();
        let scaled = DMatrix::from_fn(g.nrows(), g.ncols(), |i, j| g[(i, j)] * scale[i]);
        let wanted = DVector::from_fn(target.len(), |i, _| target[i] * scale[i]);
        let svd = scaled.clone().svd(true, true);
        if svd.singular_values.min() < 1e-10 * svd.singular_values.max() {
            return Err(failed());
        }
        let mut change = svd.solve(&wanted, 0.0).map_err(|_| failed())?;
        // One step of refinement: the point model is to come back to the last
        // digits.
        let left = &wanted - &scaled * &change;
        change += svd.solve(&left, 0.0).map_err(|_| failed())?;
        let node = &mut nodes[index];
        node.state_slope.fill(0.0);
        node.state_slope[U] = 1.0;
        for (j, k) in free.iter().enumerate() {
            let slope = (start[j] + change[j]) * weight(*k);
            if *k < n {
                node.state_slope[*k] = slope;
            } else {
                node.sticks_slope[*k - n] = slope;
            }
        }
        out.push(Consistency {
            speed: model.speed,
            attitude: [PHI, THETA].map(|k| node.state_slope[k] - from[k]),
            sticks: std::array::from_fn(|k| node.sticks_slope[k] - from[n + k]),
        });
        node.rest.column_mut(U).fill(0.0);
    }
    // Trims of inner states that are not known are the integrals of their
    // slopes; where they begin does not matter.
    for index in 1..nodes.len() {
        let h = speeds[index] - speeds[index - 1];
        for k in (RIGID..n).filter(|k| !known[*k]) {
            let mean = 0.5 * (nodes[index].state_slope[k] + nodes[index - 1].state_slope[k]);
            nodes[index].state[k] = nodes[index - 1].state[k] + h * mean;
        }
    }
    Ok(out)
}
