//! Rotors blade by blade: articulated, hingeless and gimballed hubs of any
//! number of blades, and teetering ones averaged over their azimuth.
//!
//! A blade k flaps by β_k about a hinge a distance e from the shaft, in its own
//! plane of F, the frame that turns with the shaft (x along the blade, z down
//! the shaft). Its mass is a slender line from its attachment, which lies `u`
//! below the hinge along the z axis of T, the frame that flaps; the blade is
//! coned by β_p against T. In T the first moment about the hinge is
//! (S_x, 0, S_z) = (M_β cos β_p, 0, m u − M_β sin β_p), and likewise the second
//! moments xx, zz, xz. In F they turn with β; S_i, S_k, X, Z, XZ below.
//!
//! **Flap equation**, Euler's law about the hinge axis j, exact:
//!
//! J β'' = M_j − K β − C β' − G − J ω'_j − S_k a_i + S_i (a_k − e ω'_j),
//! J = X + Z,
//! G = α_j (J + e S_i) + (ω_i² − ω_k²) XZ + ω_i ω_k (Z − X − e S_i)
//!     − (ω_j² + ω_k²) e S_k,
//!
//! with M_j the moment of the air, ω the rate of F, α its acceleration from the
//! turning of the shaft, a and ω' the acceleration of the hub (less gravity) and
//! the angular acceleration of the airframe, all in F.
//!
//! **Reaction of the blade on the hub**: its aerodynamic force and moment less
//! what its mass takes to be moved, so that nothing of the hinge, its spring or
//! its stops is ever modelled as a hub stiffness. The blade's mass as a point at
//! the hub is the airframe's.
//!
//! **Constraints.** Blades whose angles are not free (a gimbal, an averaged
//! rotor) have the acceleration that is nearest to the free one in the sense of
//! virtual work: since all blades have the same J, the modes of the hub are
//! fitted to the free accelerations by least squares.
//!
//! **Averaging.** An averaged rotor has M blades at fixed azimuths, evenly over
//! the turn, with N_b/M of everything each.

use crate::numerics::scalar::{Local, Scalar, Vec3};
use crate::vehicle::rotor::{BladeFlap, HubFlow, Rotor, RotorInput, Shaft, unpack};
use std::f64::consts::TAU;

/// A way in which the blades of a hub flap together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// All alike: β_0.
    Coning,
    /// β_nc cos nψ + β_ns sin nψ, with their rates as states.
    Cyclic(usize),
    /// Neighbours against one another, (−1)^k β_d: no force or moment on the hub
    /// in small motions.
    Reactionless,
    /// Opposite blades against one another, as on a teeter hinge: β_1c, β_1s
    /// stand for angle and rate of blade 1, by variation of constants.
    Teeter,
}

impl Mode {
    /// Names of its angles.
    fn angles(self) -> Vec<String> {
        match self {
            Self::Coning => vec!["beta_0".into()],
            Self::Cyclic(n) => vec![format!("beta_{n}c"), format!("beta_{n}s")],
            Self::Reactionless => vec!["beta_d".into()],
            Self::Teeter => vec!["beta_1c".into(), "beta_1s".into()],
        }
    }

    /// Whether its rates are states beside its angles.
    fn has_rates(self) -> bool {
        self != Self::Teeter
    }
}

/// Hinge and mass of one blade.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct BladeBody {
    /// Distance e of the flap hinge from the shaft, m.
    pub offset: f64,
    /// Spring about the hinge, N m/rad.
    pub spring: f64,
    /// Damper about the hinge, N m s/rad.
    pub damping: f64,
    /// Mass, kg.
    pub mass: f64,
    /// First moments S_x, S_z about the hinge in T, kg m.
    pub first: [f64; 2],
    /// Second moments ∫x², ∫z², ∫xz about the hinge in T, kg m².
    pub second: [f64; 3],
}

impl BladeBody {
    fn scaled(self, share: f64) -> Self {
        Self {
            offset: self.offset,
            spring: self.spring * share,
            damping: self.damping * share,
            mass: self.mass * share,
            first: self.first.map(|value| value * share),
            second: self.second.map(|value| value * share),
        }
    }

    /// Moment of inertia J about the hinge axis, kg m².
    pub fn flap_inertia(&self) -> f64 {
        self.second[0] + self.second[1]
    }

    /// S_i, S_k, X, Z, XZ: the moments in F at a flap angle.
    #[inline(always)]
    fn flapped<S: Scalar>(&self, angle: S) -> [S; 5] {
        let (s, c) = angle.sin_cos();
        let [sx, sz] = self.first;
        let [xx, zz, xz] = self.second;
        let (ss, sc) = (s * s, s * c);
        let spread = xx - zz;
        // x_F = x c + z s, z_F = z c − x s.
        [
            c * sx + s * sz,
            c * sz - s * sx,
            ss * -spread + sc * (2.0 * xz) + xx,
            ss * spread - sc * (2.0 * xz) + zz,
            sc * -spread + ss * (-2.0 * xz) + xz,
        ]
    }
}

/// A blade at an instant.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Blade<S> {
    /// Sine and cosine of its azimuth.
    pub sine: S,
    pub cosine: S,
    /// Flap angle and rate, precone left out, rad and rad/s.
    pub angle: S,
    pub rate: S,
    /// Flap acceleration, rad/s²: what it would be if the blade were alone on a
    /// hub that does not accelerate.
    pub free: S,
}

impl<S: Scalar> Blade<S> {
    #[inline(always)]
    pub fn value(&self) -> Blade<f64> {
        Blade {
            sine: self.sine.value(),
            cosine: self.cosine.value(),
            angle: self.angle.value(),
            rate: self.rate.value(),
            free: self.free.value(),
        }
    }
}

/// The blades of a rotor that is treated blade by blade.
#[derive(Debug, Clone)]
pub struct BladeSet {
    /// Ways in which they flap.
    modes: Vec<Mode>,
    /// Whether the modes are as many as the blades, which are then free.
    free: bool,
    /// Sine and cosine of the azimuth of each behind blade 1.
    places: Vec<[f64; 2]>,
    body: BladeBody,
}

impl BladeSet {
    /// Blades that stand evenly around, as many as evaluated, with a share of
    /// the body each.
    pub(crate) fn new(modes: Vec<Mode>, evaluated: usize, share: f64, body: BladeBody) -> Self {
        let freedoms: usize =
            modes.iter().map(|mode| if matches!(mode, Mode::Cyclic(_)) { 2 } else { 1 }).sum();
        Self {
            free: freedoms == evaluated,
            modes,
            places: (0..evaluated)
                .map(|k| (k as f64 * TAU / evaluated as f64).sin_cos().into())
                .collect(),
            body: body.scaled(share),
        }
    }

    /// How many blades are evaluated.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Never: a rotor has blades.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Hinge and mass of one evaluated blade.
    pub(crate) fn body(&self) -> &BladeBody {
        &self.body
    }

    /// Names of the flap states: angles, then rates.
    #[must_use]
    pub fn states(&self) -> (Vec<String>, Vec<String>) {
        let angles = self.modes.iter().flat_map(|mode| mode.angles()).collect();
        let with_rates = self.modes.iter().filter(|mode| mode.has_rates());
        let rates = with_rates
            .flat_map(|mode| mode.angles())
            .map(|angle| format!("{angle}_rate"))
            .collect();
        (angles, rates)
    }

    /// Number of angles among the flap states.
    fn angle_count(&self) -> usize {
        self.modes.iter().map(|mode| mode.angles_count()).sum()
    }

    /// Azimuths, angles and rates of the blades from the flap states.
    #[inline(always)]
    pub(crate) fn place<S: Scalar>(&self, state: &[S], shaft: &Shaft<S>, blades: &mut [Blade<S>]) {
        let omega = shaft.speed;
        for (index, (blade, [sk, ck])) in blades.iter_mut().zip(&self.places).enumerate() {
            let (s, c) =
                (shaft.sine * *ck + shaft.cosine * *sk, shaft.cosine * *ck - shaft.sine * *sk);
            let (mut angle, mut rate) = (S::default(), S::default());
            let (mut at, mut at_rate) = (0, self.angle_count());
            for mode in &self.modes {
                match *mode {
                    Mode::Coning => {
                        angle += state[at];
                        rate += state[at_rate];
                    }
                    Mode::Reactionless => {
                        let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
                        angle += state[at] * sign;
                        rate += state[at_rate] * sign;
                    }
                    Mode::Cyclic(n) => {
                        let (sn, cn) = multiple(s, c, n);
                        let turning = omega * n as f64;
                        let (bc, bs) = (state[at], state[at + 1]);
                        angle += bc * cn + bs * sn;
                        rate += (state[at_rate] + turning * bs) * cn
                            + (state[at_rate + 1] - turning * bc) * sn;
                    }
                    Mode::Teeter => {
                        let (bc, bs) = (state[at], state[at + 1]);
                        angle += bc * c + bs * s;
                        rate += (bs * c - bc * s) * omega;
                    }
                }
                at += mode.angles_count();
                if mode.has_rates() {
                    at_rate += mode.angles_count();
                }
            }
            *blade = Blade { sine: s, cosine: c, angle, rate, free: S::default() };
        }
    }

    /// Part of the blades' values in a mode: of its cosine (or its only one) and
    /// of its sine.
    #[inline(always)]
    fn part<S: Scalar>(&self, mode: Mode, blades: &[Blade<S>], values: &[S]) -> [S; 2] {
        let scale = 1.0 / blades.len() as f64;
        let (mut first, mut second) = (S::default(), S::default());
        for (index, (blade, value)) in blades.iter().zip(values).enumerate() {
            match mode {
                Mode::Coning => first += *value * scale,
                Mode::Reactionless => {
                    first += *value * if index % 2 == 0 { scale } else { -scale };
                }
                Mode::Cyclic(n) => {
                    let (sn, cn) = multiple(blade.sine, blade.cosine, n);
                    first += *value * cn * (2.0 * scale);
                    second += *value * sn * (2.0 * scale);
                }
                // Not a part at fixed azimuths: see `constrained`.
                Mode::Teeter => {}
            }
        }
        [first, second]
    }

    /// Accelerations that the hub allows, nearest to free ones, in their place.
    #[inline(always)]
    pub(crate) fn constrained<S: Scalar>(&self, blades: &[Blade<S>], values: &mut [S]) {
        if self.free {
            return;
        }
        let mut allowed = [S::default(); MOST_EVALUATED];
        for mode in &self.modes {
            let [first, second] = self.part(*mode, blades, values);
            for (index, blade) in blades.iter().enumerate() {
                allowed[index] += match *mode {
                    Mode::Coning => first,
                    Mode::Reactionless => first * if index % 2 == 0 { 1.0 } else { -1.0 },
                    Mode::Cyclic(n) => {
                        let (sn, cn) = multiple(blade.sine, blade.cosine, n);
                        first * cn + second * sn
                    }
                    Mode::Teeter => {
                        let opposite = (index + blades.len() / 2) % blades.len();
                        (values[index] - values[opposite]) * 0.5
                    }
                };
            }
        }
        values.copy_from_slice(&allowed[..values.len()]);
    }

    /// Rates of the flap states from the flap accelerations of the blades.
    #[inline(always)]
    pub(crate) fn rates<S: Scalar>(
        &self,
        state: &[S],
        shaft: &Shaft<S>,
        blades: &[Blade<S>],
        acceleration: &[S],
        rates: &mut [S],
    ) {
        let omega = shaft.speed;
        let (mut at, mut at_rate) = (0, self.angle_count());
        for mode in &self.modes {
            let [first, second] = self.part(*mode, blades, acceleration);
            match *mode {
                Mode::Coning | Mode::Reactionless => {
                    rates[at] = state[at_rate];
                    rates[at_rate] = first;
                }
                Mode::Cyclic(n) => {
                    let turning = omega * n as f64;
                    let speeding = shaft.acceleration * n as f64;
                    let (bc, bs) = (state[at], state[at + 1]);
                    let (rc, rs) = (state[at_rate], state[at_rate + 1]);
                    rates[at] = rc;
                    rates[at + 1] = rs;
                    let square = turning * turning;
                    rates[at_rate] = first - turning * rs * 2.0 - speeding * bs + square * bc;
                    rates[at_rate + 1] = second + turning * rc * 2.0 + speeding * bc + square * bs;
                }
                Mode::Teeter => {
                    let scale = 1.0 / blades.len() as f64;
                    let slip = shaft.acceleration / omega;
                    let inverse = S::constant(1.0) / omega;
                    rates[at] = S::default();
                    rates[at + 1] = S::default();
                    for (index, blade) in blades.iter().enumerate() {
                        let opposite = (index + blades.len() / 2) % blades.len();
                        let half = (acceleration[index] - acceleration[opposite]) * 0.5;
                        let (angle, rate) = teeter_of(blade, &state[at..at + 2], omega);
                        let drive = angle * omega + (half - rate * slip) * inverse;
                        rates[at] += blade.sine * drive * -scale;
                        rates[at + 1] += blade.cosine * drive * scale;
                    }
                }
            }
            at += mode.angles_count();
            if mode.has_rates() {
                at_rate += mode.angles_count();
            }
        }
    }

    /// What flap accelerations do to the hub: force and moment, hub frame.
    #[inline(always)]
    pub(crate) fn flapping_loads<S: Scalar>(
        &self,
        blades: &[Blade<S>],
        acceleration: &[S],
    ) -> (Vec3<S>, Vec3<S>) {
        let mut force = Vec3::<S>::default();
        let mut moment = Vec3::<S>::default();
        let inertia = self.body.flap_inertia();
        for (blade, accelerated) in blades.iter().zip(acceleration) {
            let [si, sk, ..] = self.body.flapped(blade.angle);
            let (fi, fk) = (-(*accelerated * sk), *accelerated * si);
            let mj = -(*accelerated * inertia + fk * self.body.offset);
            let (s, c) = (blade.sine, blade.cosine);
            force += Vec3([-(c * fi), s * fi, fk]);
            moment += Vec3([-(s * mj), -(c * mj), S::default()]);
        }
        (force, moment)
    }

    /// What an acceleration of the hub (less gravity) and an angular
    /// acceleration of the airframe, both in the hub frame, add: force and
    /// moment on the hub, and the constrained flap accelerations.
    #[inline(always)]
    pub(crate) fn accelerated<S: Scalar>(
        &self,
        blades: &[Blade<S>],
        hub: Vec3<S>,
        angular: Vec3<S>,
        flap: &mut [S],
    ) -> (Vec3<S>, Vec3<S>) {
        let BladeBody { offset, mass, .. } = self.body;
        let inverse = 1.0 / self.body.flap_inertia();
        let mut force = Vec3::<S>::default();
        let mut moment = Vec3::<S>::default();
        let ([ax, ay, ak], [wx, wy, wk]) = (hub.0, angular.0);
        for (blade, free) in blades.iter().zip(flap.iter_mut()) {
            let (s, c) = (blade.sine, blade.cosine);
            let (ai, aj) = (s * ay - c * ax, -(s * ax + c * ay));
            let (wi, wj) = (s * wy - c * wx, -(s * wx + c * wy));
            let [si, sk, x, z, xz] = self.body.flapped(blade.angle);
            *free = -wj - (sk * ai - si * (ak - wj * offset)) * inverse;
            // About the hub: first moment Q, second moments.
            let qi = si + offset * mass;
            let x = x + si * (2.0 * offset) + offset * offset * mass;
            let xz = xz + sk * offset;
            let (fi, fj, fk) = (-(wj * sk), wi * sk - wk * qi, wj * qi);
            let mi = xz * wk - z * wi + sk * aj;
            let mj = qi * ak - sk * ai - (x + z) * wj;
            let mk = xz * wi - x * wk - qi * aj;
            force += Vec3([-(c * fi + s * fj), s * fi - c * fj, fk]);
            moment += Vec3([-(c * mi + s * mj), s * mi - c * mj, mk]);
        }
        self.constrained(blades, flap);
        let (by_flap, moment_by_flap) = self.flapping_loads(blades, flap);
        (force + by_flap, moment + moment_by_flap)
    }
}

/// Most blades that are evaluated.
pub(crate) const MOST_EVALUATED: usize = 64;

impl Mode {
    /// How many angles it has.
    fn angles_count(self) -> usize {
        match self {
            Self::Coning | Self::Reactionless => 1,
            Self::Cyclic(_) | Self::Teeter => 2,
        }
    }
}

/// Teeter angle and rate of a blade.
#[inline(always)]
fn teeter_of<S: Scalar>(blade: &Blade<S>, state: &[S], omega: S) -> (S, S) {
    let (bc, bs) = (state[0], state[1]);
    (bc * blade.cosine + bs * blade.sine, (bs * blade.cosine - bc * blade.sine) * omega)
}

/// Sine and cosine of n times an angle.
#[inline(always)]
fn multiple<S: Scalar>(s: S, c: S, n: usize) -> (S, S) {
    let (mut sn, mut cn) = (s, c);
    for _ in 1..n {
        (sn, cn) = (sn * c + cn * s, cn * c - sn * s);
    }
    (sn, cn)
}

impl Rotor {
    /// Loads of one blade, its flap acceleration left out, on a hub that does
    /// not accelerate: force and moment about the hub, flap acceleration were
    /// it free, and of the air alone the force along the shaft and both moments,
    /// hub frame. `flapping` of the input are the blade's own angle and rate,
    /// `shaft` has its own azimuth.
    #[inline(always)]
    pub(crate) fn blade_reaction<S: Scalar>(
        &self,
        body: &BladeBody,
        input: &RotorInput<S>,
        shaft: &Shaft<S>,
    ) -> [S; 10] {
        let (s, c, omega) = (shaft.sine, shaft.cosine, shaft.speed);
        let [angle, rate] = input.flapping;
        let (sin, cos) = angle.sin_cos();
        let [p, q, r] = input.rate_hub.0;
        let [air_p, air_q, air_r] = input.air_rate_hub;
        let flow = HubFlow {
            velocity: input.velocity_hub.0,
            slip: [p - air_p, q - air_q, r - air_r - omega],
            inflow: input.inflow,
            pitch: input.pitch,
        };
        let flap = BladeFlap { sin, cos, angle, rate };
        let ([fi, fj, fk], [mi, mj, mk]) = self.blade_forces(&flow, &flap, s, c);
        // The air about the hub.
        let offset = body.offset;
        let (air_j, air_k) = (mj - fk * offset, mk + fj * offset);

        // Inertia.
        let (wi, wj, wk) = (q * s - p * c, -(p * s + q * c), r - omega);
        let (ai, aj, ak) = (-(omega * wj), omega * wi, -shaft.acceleration);
        let [si, sk, x, z, xz] = body.flapped(angle);
        let inertia = body.flap_inertia();
        let (wii, wjj, wkk) = (wi * wi, wj * wj, wk * wk);
        let gyroscopic =
            aj * (si * offset + inertia) + (wii - wkk) * xz + wi * wk * (z - x - si * offset)
                - (wjj + wkk) * sk * offset;
        let held = angle * body.spring + rate * body.damping;
        let free = (mj - held - gyroscopic) * (1.0 / inertia);

        let qi = si + offset * body.mass;
        let x_hub = x + si * (2.0 * offset) + offset * offset * body.mass;
        let xz_hub = xz + sk * offset;
        let along = wi * qi + wk * sk;
        let square = wii + wjj + wkk;
        let rate2 = rate * rate;
        let twice = rate * 2.0;
        // α × Q + ω × (ω × Q) + 2 β' ω × (j × S) − β'² S; j × S = (S_k, 0, −S_i).
        let gi = aj * sk + wi * along - square * qi - twice * wj * si - rate2 * si;
        let gj = ak * qi - ai * sk + wj * along + twice * (wk * sk + wi * si);
        let gk = -(aj * qi) + wk * along - square * sk - twice * wj * sk - rate2 * sk;
        // I α + ω × I ω + Coriolis + β'² e S_k j.
        let (hi, hj, hk) = (z * wi - xz_hub * wk, (x_hub + z) * wj, x_hub * wk - xz_hub * wi);
        let lever = sk * offset;
        let ni = z * ai - xz_hub * ak
            + (wj * hk - wk * hj)
            + twice * (wi * lever - xz_hub * wi - z * wk);
        let nj = (x_hub + z) * aj + (wk * hi - wi * hk) + twice * wj * lever + rate2 * lever;
        let nk = x_hub * ak - xz_hub * ai
            + (wi * hj - wj * hi)
            + twice * (wk * lever + (x + si * offset) * wi + xz * wk);
        let (fi_all, fj_all, fk_all) = (fi - gi, fj - gj, fk - gk);
        let (mi_all, mj_all, mk_all) = (mi - ni, air_j - nj, air_k - nk);
        [
            -(c * fi_all + s * fj_all),
            s * fi_all - c * fj_all,
            fk_all,
            -(c * mi_all + s * mj_all),
            s * mi_all - c * mj_all,
            mk_all,
            free,
            fk,
            -(c * mi + s * air_j),
            s * mi - c * air_j,
        ]
    }
}

/// [`Rotor::blade_reaction`] as a local function: constant speed, 14 inputs.
pub(super) struct BladeAtSpeed<'a> {
    pub rotor: &'a Rotor,
    pub body: &'a BladeBody,
    /// Sine and cosine of the blade's azimuth.
    pub azimuth: (f64, f64),
    /// Angular velocity of the air, hub frame, rad/s.
    pub air_rate_hub: [f64; 3],
}

impl Local<14, 10> for BladeAtSpeed<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 14]) -> [T; 10] {
        let shaft = Shaft {
            speed: T::constant(self.rotor.speed),
            acceleration: T::default(),
            sine: T::constant(self.azimuth.0),
            cosine: T::constant(self.azimuth.1),
        };
        let input = unpack(x, self.air_rate_hub);
        self.rotor.blade_reaction(self.body, &input, &shaft)
    }
}

/// The same of a rotor whose speed is a state, 18 inputs.
pub(super) struct BladeGoverned<'a> {
    pub rotor: &'a Rotor,
    pub body: &'a BladeBody,
    /// Angular velocity of the air, hub frame, rad/s.
    pub air_rate_hub: [f64; 3],
}

impl Local<18, 10> for BladeGoverned<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 18]) -> [T; 10] {
        let shaft = Shaft { speed: x[14], acceleration: x[15], sine: x[16], cosine: x[17] };
        let input = unpack(&x[..14], self.air_rate_hub);
        self.rotor.blade_reaction(self.body, &input, &shaft)
    }
}
