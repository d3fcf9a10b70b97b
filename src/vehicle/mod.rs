//! The time-periodic flight dynamics of a rotorcraft, `xdot = f(azimuth, x, u)`.
//!
//! One rigid airframe carries any number of rotors, wings and fuselage bodies.
//! [`Vehicle::rates`] is pure: it reads the azimuth, the state and the blade
//! controls, and writes the rates. It is written over
//! [`Scalar`], so that the same lines give values and
//! exact derivatives, and it allocates nothing beyond its [`Workspace`].
//!
//! The accelerations of airframe and blades are solved for together: the
//! blades' inertia on the moving hub enters a 6 × 6 mass matrix, from which
//! teeter accelerations are eliminated. Nothing is dropped for being small,
//! except what the modules say they do not model.

pub mod airfoil;
pub mod atmosphere;
pub mod azimuth;
pub mod blades;
pub mod census;
pub mod frames;
pub mod fuselage;
pub mod inflow;
pub mod interference;
pub mod layout;
pub mod output;
pub mod rotor;
pub mod summary;
pub mod wing;

use crate::numerics::scalar::{Local, Scalar, Vec3};
use crate::problem::{
    AzimuthModel, Controls, Formulation, InflowOptions, MassFlow, Problem, TotalInflow,
};
use crate::units::STANDARD_GRAVITY;
use atmosphere::Air;
use azimuth::Turning;
use blades::{Blade, BladeAtSpeed, BladeGoverned, MOST_EVALUATED};
use frames::{Matrix3, position_body};
use fuselage::Fuselage;
use inflow::{APPARENT_MASS_HARMONIC, APPARENT_MASS_UNIFORM, Wake, WakeOf};
use interference::{DiskGeometry, Interference, PointWash, SeenPoint, WashWidth};
pub use layout::{Layout, RotorStates};
use nalgebra::Matrix3 as HubAxes;
use rotor::{LoadsAtSpeed, LoadsGoverned, Rotor, RotorLoads, Shaft};
use wing::{DeflectedLoads, UnwashedLoads, Wing};

/// Change of uniform inflow at which the algebraic loop is closed.
const LOOP_TOLERANCE: f64 = 1e-14;
/// Rounds of the algebraic loop between mass flow and interference.
const LOOP_ROUNDS: usize = 60;

/// Why a checked problem makes no vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VehicleError {
    /// The speeds of rotors that are to be resolved have no common period.
    #[error(
        "the rotors `{rotors}` are to be resolved in azimuth but never come round together: no time \
         up to {passages} blade passages of the slowest is a whole number of passages of each; \
         choose speeds in the ratio of small whole numbers, or write azimuth = \"averaged\" for some"
    )]
    NoCommonPeriod {
        /// Names of the rotors.
        rotors: String,
        /// Longest period tried, in passages of the slowest rotor.
        passages: usize,
    },
    /// The blades of an averaged rotor meet so much that changes over a turn
    /// that no number of azimuths gives their mean.
    #[error(
        "rotor `{rotor}`: {azimuths} azimuths are too few for the mean of its loads, which change \
         abruptly over a turn; check its airfoil"
    )]
    Averaging {
        /// Rotor.
        rotor: String,
        /// Most azimuths tried.
        azimuths: usize,
    },
    /// An airfoil table cannot be interpolated.
    #[error("airfoil of `{of}`: {source}")]
    Airfoil {
        /// Rotor or wing.
        of: String,
        /// What is wrong with the table.
        source: crate::numerics::interpolation::GridError,
    },
    /// Two rotors lie so that their interference cannot be computed.
    #[error("interference of rotor `{source_rotor}` on `{receiver}`: {message}")]
    Interference {
        /// Source rotor.
        source_rotor: String,
        /// Receiving rotor or body.
        receiver: String,
        /// What is wrong.
        message: String,
    },
}

/// How the air moves about the centre of gravity: as a rigid body, whose
/// velocity is v + ω × r at a place r from there. Body frame.
///
/// The rotation is the linear part of a field of air that the lifting parts
/// see each at its own place: p = ∂w/∂y, q = −∂w/∂x, r = ∂v/∂x, the angular
/// gusts of MIL-F-8785C.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AirMotion {
    /// Velocity over the ground at the centre of gravity, m/s.
    pub velocity: [f64; 3],
    /// Angular velocity, rad/s.
    pub rate: [f64; 3],
}

impl From<[f64; 3]> for AirMotion {
    /// Air of the same velocity everywhere, m/s.
    fn from(velocity: [f64; 3]) -> Self {
        Self { velocity, rate: [0.0; 3] }
    }
}

/// Rates of the heading (rad/s) and velocity over the ground in heading axes,
/// forward, to starboard and down (m/s), from u v w p q r φ θ, which come first
/// in a state.
#[inline(always)]
pub fn navigation<S: Scalar>(state: &[S]) -> [S; 4] {
    let [u, v, w, _, q, r] = [state[0], state[1], state[2], state[3], state[4], state[5]];
    let (sin_phi, cos_phi) = state[6].sin_cos();
    let (sin_theta, cos_theta) = state[7].sin_cos();
    let heading_rate = (q * sin_phi + r * cos_phi) / cos_theta;
    let lifted = v * sin_phi + w * cos_phi;
    [
        heading_rate,
        u * cos_theta + lifted * sin_theta,
        v * cos_phi - w * sin_phi,
        lifted * cos_theta - u * sin_theta,
    ]
}

/// A rotorcraft, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct Vehicle {
    /// Name of the problem.
    pub name: String,
    /// Air it flies in.
    pub air: Air,
    /// Gross mass, kg.
    pub mass: f64,
    /// Inertia tensor about the centre of gravity, body frame, kg m².
    pub inertia: Matrix3,
    /// Rotors, in the order of the problem.
    pub rotors: Vec<Rotor>,
    /// Wings and tail surfaces.
    pub wings: Vec<Wing>,
    /// Fuselage bodies.
    pub fuselages: Vec<Fuselage>,
    /// From sticks to blades.
    pub controls: Controls,
    /// Inflow choices.
    pub inflow: InflowOptions,
    formulation: Formulation,
    /// Names and places of states and effectors.
    pub layout: Layout,
    /// Speed of the slowest resolved rotor, rad/s: the reference azimuth turns
    /// with it.
    pub reference_speed: f64,
    /// Period of the dynamics, s. Where no rotor is resolved the dynamics do not
    /// vary with time, and this is a time like any other.
    pub period: f64,
    /// Blade passages of the slowest resolved rotor in a period.
    pub passages: usize,
    /// Factor on the inflow that rotors induce in one another, 1: for studies
    /// of how much hangs on it.
    pub interference_gain: f64,
    /// `[receiver][source]`, none on the diagonal or without interactions.
    interference: Vec<Vec<Option<Interference>>>,
    /// `[fuselage][source]`.
    fuselage_wash: Vec<Vec<PointWash>>,
    /// `[wing][strip][source]`.
    wing_wash: Vec<Vec<Vec<PointWash>>>,
}

/// Intermediate results of one evaluation; allocated once, used again.
#[derive(Debug, Clone)]
pub struct Workspace<S> {
    /// Velocity of each hub through the air and its rate, own hub frame.
    pub(crate) hub: Vec<[Vec3<S>; 2]>,
    pub(crate) wake: Vec<Wake<S>>,
    /// Total inflow λ_0, λ_1c, λ_1s of each rotor.
    pub(crate) inflow: Vec<[S; 3]>,
    /// Where the total inflow tends.
    pub(crate) inflow_target: Vec<[S; 3]>,
    pub(crate) shaft: Vec<Shaft<S>>,
    pub(crate) teeter: Vec<[S; 2]>,
    pub(crate) loads: Vec<RotorLoads<S>>,
    /// Blades of rotors that are treated blade by blade, and without tangents;
    /// none of others.
    pub(crate) sets: Vec<Vec<Blade<S>>>,
    pub(crate) plain_sets: Vec<Vec<Blade<f64>>>,
    /// Rows of hub-to-blades rotations, without tangents.
    pub(crate) blades: Vec<[Vec3<f64>; 3]>,
    pub(crate) fuselage_loads: Vec<(Vec3<S>, Vec3<S>)>,
    pub(crate) wing_loads: Vec<(Vec3<S>, Vec3<S>)>,
    /// Specific force of the centre of gravity and angular acceleration.
    pub(crate) acceleration: [Vec3<S>; 2],
}

impl<S: Scalar> Workspace<S> {
    /// Specific force at the centre of gravity, body frame, m/s², of the last
    /// evaluation.
    #[must_use]
    pub fn specific_force(&self) -> Vec3<S> {
        self.acceleration[0]
    }
}

impl Vehicle {
    /// Builds the vehicle of a problem, interference tables included.
    ///
    /// # Errors
    /// Rotors without a common period, or geometry that the interference
    /// theory cannot treat.
    pub fn new(problem: &Problem) -> Result<Self, VehicleError> {
        let air = Air::at(&problem.atmosphere);
        let cg = &problem.mass.center_of_gravity;
        let Turning { models, reference_speed, period, passages } = Turning::of(problem)?;
        let rotors: Vec<Rotor> = problem
            .rotors
            .iter()
            .zip(models)
            .map(|(rotor, model)| match model {
                AzimuthModel::Resolved => Rotor::new(rotor, &problem.formulation, cg, &air),
                AzimuthModel::Averaged => Rotor::averaged(rotor, &problem.formulation, cg, &air),
            })
            .collect::<Result<_, _>>()?;
        let wings: Vec<Wing> =
            problem.wings.iter().map(|wing| Wing::new(wing, cg, &air)).collect::<Result<_, _>>()?;
        let fuselages: Vec<Fuselage> =
            problem.fuselages.iter().map(|body| Fuselage::new(body, cg, &air)).collect();
        let m = &problem.mass;
        let inertia =
            [[m.i_xx, -m.i_xy, -m.i_xz], [-m.i_xy, m.i_yy, -m.i_yz], [-m.i_xz, -m.i_yz, m.i_zz]];
        let layout = Layout::new(&rotors, &wings, &problem.inflow);
        let mut vehicle = Self {
            name: problem.name.clone(),
            air,
            mass: m.mass,
            inertia,
            rotors,
            wings,
            fuselages,
            controls: problem.controls.clone(),
            inflow: problem.inflow,
            formulation: problem.formulation,
            layout,
            reference_speed,
            period,
            passages,
            interference_gain: 1.0,
            interference: Vec::new(),
            fuselage_wash: Vec::new(),
            wing_wash: Vec::new(),
        };
        vehicle.build_interference()?;
        vehicle.build_wash()?;
        Ok(vehicle)
    }

    /// The same vehicle with rotor-on-rotor interactions switched.
    ///
    /// # Errors
    /// As for [`Vehicle::new`].
    pub fn with_interactions(&self, on: bool) -> Result<Self, VehicleError> {
        let mut vehicle = self.clone();
        if vehicle.inflow.interactions != on {
            vehicle.inflow.interactions = on;
            vehicle.build_interference()?;
        }
        Ok(vehicle)
    }

    /// Interference coefficients of one rotor on another, none on itself or
    /// without interactions.
    #[must_use]
    pub fn interference(&self, receiver: usize, source: usize) -> Option<&Interference> {
        self.interference[receiver][source].as_ref()
    }

    /// Interference tables in memory: one for every distinct way in which two
    /// rotors lie.
    #[must_use]
    pub fn interference_tables(&self) -> usize {
        let mut distinct: Vec<&Interference> = Vec::new();
        for pair in self.interference.iter().flatten().flatten() {
            if !distinct.iter().any(|other| other.shares_table(pair)) {
                distinct.push(pair);
            }
        }
        distinct.len()
    }

    /// Where a rotor is seen from another.
    ///
    /// Public so that the interference of one pair can be built alone.
    #[must_use]
    pub fn disk_geometry(&self, receiver: usize, source: usize) -> DiskGeometry {
        let (receiver, source) = (&self.rotors[receiver], &self.rotors[source]);
        DiskGeometry {
            source_radius: source.radius,
            receiver_radius: receiver.radius,
            offset: unmirrored(source, &receiver.position_body).into(),
            receiver_axes: axes_in(source, receiver),
            source_mirrored: source.frame.handedness < 0.0,
            receiver_mirrored: if self.formulation.mirrored_interference {
                receiver.frame.handedness < 0.0
            } else {
                source.frame.handedness < 0.0
            },
        }
    }

    fn build_interference(&mut self) -> Result<(), VehicleError> {
        let count = self.rotors.len();
        let bladed = |rotor: usize| self.rotors[rotor].coefficients.is_none();
        let acts = |i: usize, j: usize| i != j && bladed(i) && bladed(j);
        let pairs: Vec<(usize, usize)> = if self.inflow.interactions {
            let all = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
            all.filter(|&(i, j)| acts(i, j)).collect()
        } else {
            Vec::new()
        };
        let (pairs, geometries): (Vec<_>, Vec<_>) = pairs
            .into_iter()
            .map(|(i, j)| ((i, j), self.disk_geometry(i, j)))
            .filter(|(_, seen)| {
                seen.offset.x.hypot(seen.offset.y) <= self.inflow.reach * seen.source_radius
            })
            .unzip();
        let built = Interference::of_all(&geometries, self.formulation.interference_rule).map_err(
            |(pair, error)| VehicleError::Interference {
                source_rotor: self.rotors[pairs[pair].1].name.clone(),
                receiver: self.rotors[pairs[pair].0].name.clone(),
                message: error.to_string(),
            },
        )?;
        self.interference = vec![vec![None; count]; count];
        for ((i, j), table) in pairs.into_iter().zip(built) {
            self.interference[i][j] = Some(table);
        }
        Ok(())
    }

    fn build_wash(&mut self) -> Result<(), VehicleError> {
        use crate::problem::Wash;
        let bodies = self.fuselages.iter().filter(|body| body.wash != Wash::None);
        let wings = self.wings.iter().filter(|wing| wing.wash != Wash::None);
        let places: Vec<([[f64; 3]; 2], &str)> = bodies
            .map(|body| ([body.position_body, [0.0; 3]], body.name.as_str()))
            .chain(wings.flat_map(|wing| wing.wash_points().map(|at| (at, wing.name.as_str()))))
            .collect();
        let seen: Vec<SeenPoint> = places
            .iter()
            .flat_map(|([point, half], _)| {
                self.rotors.iter().map(|source| SeenPoint {
                    source_radius: source.radius,
                    point: unmirrored(source, point).into(),
                    half_span: unmirrored_vector(source, half).into(),
                    source_mirrored: source.frame.handedness < 0.0,
                })
            })
            .collect();
        let count = self.rotors.len();
        let width = WashWidth { core: self.inflow.wash_core, edge: self.inflow.wash_edge };
        let tables = if seen.is_empty() {
            Vec::new()
        } else {
            PointWash::of_all(&seen, width).map_err(|(index, error)| {
                VehicleError::Interference {
                    source_rotor: self.rotors[index % count].name.clone(),
                    receiver: places[index / count].1.to_owned(),
                    message: error.to_string(),
                }
            })?
        };
        let mut tables = tables.into_iter();
        let mut next = || tables.by_ref().take(count).collect::<Vec<_>>();
        self.fuselage_wash = self
            .fuselages
            .iter()
            .map(|body| if body.wash == Wash::None { Vec::new() } else { next() })
            .collect();
        self.wing_wash = self
            .wings
            .iter()
            .map(|wing| match wing.wash {
                Wash::None => Vec::new(),
                _ => wing.wash_points().map(|_| next()).collect(),
            })
            .collect();
        Ok(())
    }

    /// Whether no rotor is resolved in azimuth, so that a trim is a steady point.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.rotors.iter().all(Rotor::is_averaged)
    }

    /// Number of states.
    #[must_use]
    pub fn state_count(&self) -> usize {
        self.layout.states.len()
    }

    /// Number of blade controls (effectors).
    #[must_use]
    pub fn effector_count(&self) -> usize {
        self.layout.effectors.len()
    }

    /// A workspace for [`Vehicle::rates`].
    #[must_use]
    pub fn workspace<S: Scalar>(&self) -> Workspace<S> {
        let n = self.rotors.len();
        let zero = Vec3::<S>::default();
        let shaft = Shaft {
            speed: S::default(),
            acceleration: S::default(),
            sine: S::default(),
            cosine: S::default(),
        };
        Workspace {
            hub: vec![[zero; 2]; n],
            wake: vec![Wake::default(); n],
            inflow: vec![[S::default(); 3]; n],
            inflow_target: vec![[S::default(); 3]; n],
            shaft: vec![shaft; n],
            teeter: vec![[S::default(); 2]; n],
            loads: vec![RotorLoads::default(); n],
            sets: self.sets(),
            plain_sets: self.sets(),
            blades: vec![[Vec3::default(); 3]; n],
            fuselage_loads: vec![(zero, zero); self.fuselages.len()],
            wing_loads: vec![(zero, zero); self.wings.len()],
            acceleration: [zero; 2],
        }
    }

    /// Blades of the rotors that are treated blade by blade.
    fn sets<S: Scalar>(&self) -> Vec<Vec<Blade<S>>> {
        let count = |rotor: &Rotor| rotor.set.as_ref().map_or(0, |set| set.len());
        self.rotors.iter().map(|rotor| vec![Blade::default(); count(rotor)]).collect()
    }

    /// Effectors from stick positions in percent: rigging plus mix, of blade
    /// pitches, commanded speeds and deflections of control surfaces. A
    /// governor's speed stays nominal.
    pub fn mix<S: Scalar>(&self, sticks: &[S; 4], effectors: &mut [S]) {
        let geared = |rigging: f64, row: &[f64; 4]| {
            let value =
                rigging + (0..4).map(|stick| row[stick] * sticks[stick].value()).sum::<f64>();
            S::chain(value, row, sticks)
        };
        for (index, rotor) in self.rotors.iter().enumerate() {
            let mix = &self.controls.mix[index];
            let places = &self.layout.rotors[index];
            if let Some(start) = places.pitch {
                for (k, row) in [mix.theta_0, mix.theta_1c, mix.theta_1s].iter().enumerate() {
                    effectors[start + k] = geared(mix.rigging[k], row);
                }
            }
            if let Some(place) = places.command {
                effectors[place] = if rotor.commanded {
                    geared(mix.speed_rigging, &mix.speed)
                } else {
                    S::constant(rotor.speed)
                };
            }
        }
        for (wing, place) in self.wings.iter().zip(&self.layout.deflections) {
            if let (Some(surface), &Some(place)) = (&wing.surface, place) {
                effectors[place] = geared(surface.rigging, &surface.gearing);
            }
        }
    }

    /// Rates of all states, per second, at a reference azimuth (rad).
    ///
    /// `effectors` are the blade controls of [`Layout::effectors`]; `air` is
    /// how the air moves over the ground: an [`AirMotion`], or a velocity, body
    /// frame, m/s. Slices have the lengths of the layout.
    #[inline(always)]
    pub fn rates<S: Scalar>(
        &self,
        azimuth: f64,
        state: &[S],
        effectors: &[S],
        air: impl Into<AirMotion>,
        work: &mut Workspace<S>,
        rates: &mut [S],
    ) {
        self.rates_in(azimuth, state, effectors, &air.into(), work, rates);
    }

    #[inline(never)] // one large copy a scalar type is enough
    fn rates_in<S: Scalar>(
        &self,
        azimuth: f64,
        state: &[S],
        effectors: &[S],
        motion: &AirMotion,
        work: &mut Workspace<S>,
        rates: &mut [S],
    ) {
        let body = Layout::BODY;
        debug_assert_eq!(state.len(), self.layout.states.len());
        debug_assert_eq!(effectors.len(), self.layout.effectors.len());
        let velocity = Vec3([state[0], state[1], state[2]]);
        let rate = Vec3([state[3], state[4], state[5]]);
        let (sin_phi, cos_phi) = state[6].sin_cos();
        let (sin_theta, cos_theta) = state[7].sin_cos();
        // Through the air: what makes aerodynamic loads. Inertia knows only of
        // `velocity` and `rate`.
        let [air, air_rate] = self.through_air(velocity, rate, motion);

        for (index, rotor) in self.rotors.iter().enumerate() {
            let hub = air + air_rate.cross_constant(rotor.position_body);
            let spin = rate.rotated(&rotor.frame.polar);
            let turn = rotor.frame.handedness;
            work.hub[index] =
                [hub.rotated(&rotor.frame.polar), Vec3(spin.0.map(|component| component * turn))];
            work.shaft[index] = self.shaft(index, azimuth, state, effectors);
        }
        self.wakes(state, work);
        let zero = S::default();
        for (index, rotor) in self.rotors.iter().enumerate() {
            let places = &self.layout.rotors[index];
            let flapping =
                places.flapping.map_or([zero; 2], |start| [state[start], state[start + 1]]);
            let shaft = &work.shaft[index];
            let ([vx, vy, vz], [p, q, r]) = (work.hub[index][0].0, work.hub[index][1].0);
            let [l0, l1c, l1s] = work.inflow[index];
            let [t0, t1c, t1s] = places
                .pitch
                .map_or([zero; 3], |at| [effectors[at], effectors[at + 1], effectors[at + 2]]);
            let [b1c, b1s] = flapping;
            let air_rate_hub = rotor.frame.rate_hub(motion.rate);
            let input = [vx, vy, vz, p, q, r, b1c, b1s, l0, l1c, l1s, t0, t1c, t1s];
            if rotor.set.is_some() {
                self.blade_loads(index, &input, state, air_rate_hub, work);
            } else {
                let loads = if rotor.governor_time_constant.is_none() {
                    let azimuth = (shaft.sine.value(), shaft.cosine.value());
                    S::compose(&LoadsAtSpeed { rotor, azimuth, air_rate_hub }, &input)
                } else {
                    S::compose(&LoadsGoverned { rotor, air_rate_hub }, &with_shaft(&input, shaft))
                };
                let [fx, fy, fz, mx, my, mz, teeter_acceleration, c_t, c_l, c_m] = loads;
                work.loads[index] = RotorLoads {
                    force_hub: Vec3([fx, fy, fz]),
                    moment_hub: Vec3([mx, my, mz]),
                    teeter_acceleration,
                    thrust_coefficient: c_t,
                    roll_coefficient: c_l,
                    pitch_coefficient: c_m,
                };
                work.teeter[index] = rotor.teeter(&flapping, shaft);
                let [teeter_angle, _] = work.teeter[index].map(S::value);
                work.blades[index] = rotor.hub_to_blades(teeter_angle, &shaft.value());
            }
            let RotorLoads { thrust_coefficient: c_t, roll_coefficient: c_l, .. } =
                work.loads[index];
            let c_m = work.loads[index].pitch_coefficient;

            // Momentum theory is that of a disk of radius B R.
            let tip = rotor.tip_loss;
            let within = 1.0 / tip.powi(4);
            let drive = [c_t * within, c_m * (-within / tip), c_l * (-within / tip)];
            let Some(own) = places.self_inflow else { continue };
            for (k, &load) in drive.iter().enumerate() {
                let mass = if k == 0 { APPARENT_MASS_UNIFORM } else { APPARENT_MASS_HARMONIC };
                let own_scale = if k == 0 { tip } else { 1.0 };
                rates[own + k] =
                    (load - work.wake[index].balance[k]) * (rotor.speed / mass * own_scale);
            }
            if let (Some(start), TotalInflow::LowPass { bandwidth }) =
                (places.total_inflow, self.inflow.total_inflow)
            {
                for k in 0..3 {
                    rates[start + k] =
                        (work.inflow_target[index][k] - work.inflow[index][k]) * bandwidth;
                }
            }
        }

        let (force, moment) = self.external_loads(air, air_rate, effectors, work);
        self.accelerate(rate, force, moment, work);
        let [specific_force, angular] = work.acceleration;
        let gravity = [
            sin_theta * -STANDARD_GRAVITY,
            sin_phi * cos_theta * STANDARD_GRAVITY,
            cos_phi * cos_theta * STANDARD_GRAVITY,
        ];
        let turning = rate.cross(velocity);
        for k in 0..3 {
            rates[body.velocity + k] = specific_force.0[k] + gravity[k] - turning.0[k];
            rates[body.rate + k] = angular.0[k];
        }
        let [p, q, r] = rate.0;
        let across = q * sin_phi + r * cos_phi;
        rates[body.roll] = p + across * sin_theta / cos_theta;
        rates[body.pitch] = q * cos_phi - r * sin_phi;

        for (index, rotor) in self.rotors.iter().enumerate() {
            let places = &self.layout.rotors[index];
            let shaft = work.shaft[index];
            if let Some(set) = &rotor.set {
                let mut flap = [S::default(); MOST_EVALUATED];
                let flap = &mut flap[..set.len()];
                let blades = &work.sets[index];
                let (hub, spin) = self.hub_acceleration(index, rate, specific_force, angular);
                set.accelerated(blades, hub, spin, flap);
                for (flap, blade) in flap.iter_mut().zip(blades) {
                    *flap += blade.free;
                }
                let [start, angles, rates_after] = places.flap;
                let range = start..start + angles + rates_after;
                let states = &state[range.clone()];
                set.rates(states, &shaft, blades, flap, &mut rates[range]);
            } else if let Some(start) = places.flapping {
                let ([p, q, r], [ax, ay, az]) = (rate.0, specific_force.0);
                let [wx, wy, wz] = angular.0;
                let Shaft { sine, cosine, .. } = shaft;
                let teeter_angle = work.teeter[index][0];
                let [extra] = S::compose(
                    &TeeterOfHub { vehicle: self, index },
                    &[p, q, r, ax, ay, az, wx, wy, wz, teeter_angle, sine, cosine],
                );
                let total = work.loads[index].teeter_acceleration + extra;
                let [b1c, b1s] = rotor.flapping_rates(work.teeter[index], total, &shaft);
                rates[start] = b1c;
                rates[start + 1] = b1s;
            }
            if let Some(start) = places.speed {
                rates[start] = shaft.acceleration;
                if let Some(place) = places.azimuth {
                    rates[place] = shaft.speed - rotor.speed;
                }
            }
        }
    }

    /// Loads of a rotor that is treated blade by blade, on a hub that does not
    /// accelerate, from its inputs (flapping left out of these).
    #[inline(always)]
    fn blade_loads<S: Scalar>(
        &self,
        index: usize,
        input: &[S; 14],
        state: &[S],
        air_rate_hub: [f64; 3],
        work: &mut Workspace<S>,
    ) {
        let rotor = &self.rotors[index];
        let Some(set) = &rotor.set else { return };
        let shaft = work.shaft[index];
        let [start, angles, rates] = self.layout.rotors[index].flap;
        let blades = &mut work.sets[index];
        set.place(&state[start..start + angles + rates], &shaft, blades);
        let mut sum = [S::default(); 10];
        let mut flap = [S::default(); MOST_EVALUATED];
        let flap = &mut flap[..blades.len()];
        for (blade, flap) in blades.iter_mut().zip(flap.iter_mut()) {
            let mut own = *input;
            (own[6], own[7]) = (blade.angle, blade.rate);
            let loads = if rotor.governor_time_constant.is_none() {
                let azimuth = (blade.sine.value(), blade.cosine.value());
                S::compose(&BladeAtSpeed { rotor, body: set.body(), azimuth, air_rate_hub }, &own)
            } else {
                let shaft = Shaft { sine: blade.sine, cosine: blade.cosine, ..shaft };
                let governed = BladeGoverned { rotor, body: set.body(), air_rate_hub };
                S::compose(&governed, &with_shaft(&own, &shaft))
            };
            *flap = loads[6];
            for (sum, load) in sum.iter_mut().zip(loads) {
                *sum += load;
            }
        }
        set.constrained(blades, flap);
        let (force, moment) = set.flapping_loads(blades, flap);
        for (blade, flap) in blades.iter_mut().zip(flap.iter()) {
            blade.free = *flap;
        }
        for (plain, blade) in work.plain_sets[index].iter_mut().zip(blades.iter()) {
            *plain = blade.value();
        }
        let [fx, fy, fz, mx, my, mz, _, air_z, air_mx, air_my] = sum;
        let scale = 1.0 / rotor.force_scale();
        work.loads[index] = RotorLoads {
            force_hub: Vec3([fx, fy, fz]) + force,
            moment_hub: Vec3([mx, my, mz]) + moment,
            teeter_acceleration: S::default(),
            thrust_coefficient: air_z * -scale,
            roll_coefficient: air_mx * (scale / rotor.radius),
            pitch_coefficient: air_my * (scale / rotor.radius),
        };
    }

    /// Force and moment on the hub, hub frame, that blades return for an
    /// acceleration of their hub and an angular acceleration of the airframe.
    #[inline(always)]
    pub(crate) fn accelerated_hub<S: Scalar>(
        &self,
        index: usize,
        work: &Workspace<S>,
        hub: Vec3<f64>,
        angular: Vec3<f64>,
    ) -> (Vec3<f64>, Vec3<f64>) {
        let rotor = &self.rotors[index];
        match &rotor.set {
            Some(set) => {
                let mut flap = [0.0; MOST_EVALUATED];
                let flap = &mut flap[..set.len()];
                set.accelerated(&work.plain_sets[index], hub, angular, flap)
            }
            None => {
                let (force, moment, _) =
                    rotor.acceleration_loads(&work.blades[index], hub, angular);
                (force, moment)
            }
        }
    }

    /// A force on the hub and a moment about it, hub frame, as force and moment
    /// about the centre of gravity, body frame.
    #[inline(always)]
    fn about_center<S: Scalar>(
        &self,
        index: usize,
        force: Vec3<S>,
        moment: Vec3<S>,
    ) -> (Vec3<S>, Vec3<S>) {
        let rotor = &self.rotors[index];
        let force = force.rotated_back(&rotor.frame.polar);
        let turn = rotor.frame.handedness;
        let moment = Vec3(moment.rotated_back(&rotor.frame.polar).0.map(|c| c * turn));
        (force, moment - force.cross_constant(rotor.position_body))
    }

    /// Velocity of the centre of gravity through the air and angular velocity
    /// against it, body frame.
    #[inline(always)]
    pub(crate) fn through_air<S: Scalar>(
        &self,
        velocity: Vec3<S>,
        rate: Vec3<S>,
        air: &AirMotion,
    ) -> [Vec3<S>; 2] {
        let [mut velocity, mut rate] = [velocity, rate];
        for k in 0..3 {
            velocity.0[k] = velocity.0[k] - air.velocity[k];
            rate.0[k] = rate.0[k] - air.rate[k];
        }
        [velocity, rate]
    }

    /// [`navigation`] of a state.
    #[inline(always)]
    pub fn navigation<S: Scalar>(&self, state: &[S]) -> [S; 4] {
        navigation(state)
    }

    #[inline(always)]
    fn shaft<S: Scalar>(
        &self,
        index: usize,
        azimuth: f64,
        state: &[S],
        effectors: &[S],
    ) -> Shaft<S> {
        let rotor = &self.rotors[index];
        let turned = if rotor.is_averaged() { 0.0 } else { azimuth };
        let angle = rotor.azimuth_offset + turned * (rotor.speed / self.reference_speed);
        let places = &self.layout.rotors[index];
        match (places.speed, rotor.governor_time_constant) {
            (Some(start), Some(time_constant)) => {
                let (sine, cosine) = match places.azimuth {
                    Some(place) => (state[place] + angle).sin_cos(),
                    None => S::constant(angle).sin_cos(),
                };
                let speed = state[start];
                let command = places.command.map_or(speed, |place| effectors[place]);
                let acceleration = (command - speed) * (1.0 / time_constant);
                Shaft { speed, acceleration, sine, cosine }
            }
            _ => {
                let (sine, cosine) = angle.sin_cos();
                Shaft {
                    speed: S::constant(rotor.speed),
                    acceleration: S::default(),
                    sine: S::constant(sine),
                    cosine: S::constant(cosine),
                }
            }
        }
    }

    /// Wakes of all rotors, and the inflow that they make together.
    #[inline(always)]
    fn wakes<S: Scalar>(&self, state: &[S], work: &mut Workspace<S>) {
        for (index, places) in self.layout.rotors.iter().enumerate() {
            let Some(own) = places.self_inflow else { continue };
            let start = places.total_inflow.unwrap_or(own);
            work.inflow[index] = [state[start], state[start + 1], state[start + 2]];
        }
        let looped = self.inflow.mass_flow == MassFlow::Total
            && self.inflow.total_inflow == TotalInflow::Algebraic
            && self.inflow.interactions;
        let rounds = if looped { LOOP_ROUNDS } else { 1 };
        let mut settled = false;
        for _ in 0..rounds {
            for (index, rotor) in self.rotors.iter().enumerate() {
                let Some(own) = self.layout.rotors[index].self_inflow else { continue };
                // Ratios to the speed at B R, where the lift ends.
                let inverse = 1.0 / rotor.tip_loss;
                let scale = inverse / rotor.tip_speed();
                let [vx, vy, vz] = work.hub[index][0].0;
                // What κ adds for the blades carries no momentum.
                let excess = rotor.induced_power_factor - 1.0;
                let total = work.inflow[index][0] - state[own] * excess;
                let [b0, b1c, b1s, g0, g1c, g1s, xc, xs] = S::compose(
                    &WakeOf { mass_flow: self.inflow.mass_flow },
                    &[
                        vx * scale,
                        vy * -scale,
                        vz * scale,
                        state[own] * inverse,
                        state[own + 1],
                        state[own + 2],
                        total * inverse,
                    ],
                );
                let circulation = [g0, g1c, g1s].map(|g| g * rotor.tip_loss);
                work.wake[index] = Wake { balance: [b0, b1c, b1s], circulation, skew: [xc, xs] };
            }
            let mut change = 0.0_f64;
            for (index, places) in self.layout.rotors.iter().enumerate() {
                let Some(own) = places.self_inflow else { continue };
                let factor = self.rotors[index].induced_power_factor;
                let mut total = [own, own + 1, own + 2].map(|place| state[place] * factor);
                for (source, table) in self.interference[index].iter().enumerate() {
                    if let Some(table) = table {
                        let ratio =
                            self.rotors[source].tip_speed() / self.rotors[index].tip_speed();
                        let added =
                            induced(table, &work.wake[source], ratio * self.interference_gain);
                        for k in 0..3 {
                            total[k] += added[k];
                        }
                    }
                }
                work.inflow_target[index] = total;
                if places.total_inflow.is_none() {
                    change = change.max((total[0].value() - work.inflow[index][0].value()).abs());
                    work.inflow[index] = total;
                }
            }
            // One round more than the values need settles the tangents too.
            if settled {
                break;
            }
            settled = change < LOOP_TOLERANCE;
        }
        if looped && !settled {
            // No inflow satisfies the loop: rates that are not finite say so.
            for inflow in &mut work.inflow {
                *inflow = [S::constant(f64::NAN); 3];
            }
        }
    }

    /// Velocity of the air that all rotors move at a point, body frame.
    #[inline(always)]
    fn wash<S: Scalar>(&self, tables: &[PointWash], work: &Workspace<S>) -> Vec3<S> {
        let mut velocity = Vec3::<S>::default();
        for (source, table) in tables.iter().enumerate() {
            let rotor = &self.rotors[source];
            let wake = &work.wake[source];
            let [xc, xs] = wake.skew;
            let [value, by_x, by_y] = table.evaluate_with_partials([-xc.value(), xs.value()]);
            let strength = wake.circulation.map(S::value);
            let dot = |w: &[f64; 3]| w[0] * strength[0] + w[1] * strength[1] + w[2] * strength[2];
            let down = S::chain(
                dot(&value),
                &[-dot(&by_x), dot(&by_y), value[0], value[1], value[2]],
                &[xc, xs, wake.circulation[0], wake.circulation[1], wake.circulation[2]],
            ) * rotor.tip_speed();
            let axis = rotor.frame.polar[2];
            velocity += Vec3([down * axis[0], down * axis[1], down * axis[2]]);
        }
        velocity
    }

    /// Force and moment about the centre of gravity of everything but
    /// gravity and the inertia of blades on an accelerating hub, body frame,
    /// from velocity and angular velocity through the air.
    #[inline(always)]
    fn external_loads<S: Scalar>(
        &self,
        air: Vec3<S>,
        rate: Vec3<S>,
        effectors: &[S],
        work: &mut Workspace<S>,
    ) -> (Vec3<S>, Vec3<S>) {
        let mut force = Vec3::<S>::default();
        let mut moment = Vec3::<S>::default();
        for (index, body) in self.fuselages.iter().enumerate() {
            let tables = &self.fuselage_wash[index];
            let wash = (!tables.is_empty()).then(|| self.wash(tables, work));
            let loads = body.loads(air, rate, wash);
            work.fuselage_loads[index] = loads;
            force += loads.0;
            moment += loads.1;
        }
        for (index, wing) in self.wings.iter().enumerate() {
            let tables = &self.wing_wash[index];
            let deflection = self.layout.deflections[index].map(|place| effectors[place]);
            let loads = if tables.is_empty() {
                let ([u, v, w], [p, q, r]) = (air.0, rate.0);
                let [fx, fy, fz, mx, my, mz] = match deflection {
                    None => S::compose(&UnwashedLoads { wing }, &[u, v, w, p, q, r]),
                    Some(d) => S::compose(&DeflectedLoads { wing }, &[u, v, w, p, q, r, d]),
                };
                (Vec3([fx, fy, fz]), Vec3([mx, my, mz]))
            } else {
                wing.loads(air, rate, deflection, |strip| Some(self.wash(&tables[strip], work)))
            };
            work.wing_loads[index] = loads;
            force += loads.0;
            moment += loads.1;
        }
        for (index, rotor) in self.rotors.iter().enumerate() {
            let loads = &work.loads[index];
            let hub_force = loads.force_hub.rotated_back(&rotor.frame.polar);
            let turn = rotor.frame.handedness;
            let hub_moment = loads.moment_hub.rotated_back(&rotor.frame.polar);
            force += hub_force;
            moment += Vec3(hub_moment.0.map(|component| component * turn));
            moment += -hub_force.cross_constant(rotor.position_body);
        }
        (force, moment)
    }

    /// Acceleration of a hub less gravity, and angular acceleration, in the
    /// rotor's own hub frame.
    #[inline(always)]
    fn hub_acceleration<S: Scalar>(
        &self,
        index: usize,
        rate: Vec3<S>,
        specific_force: Vec3<S>,
        angular: Vec3<S>,
    ) -> (Vec3<S>, Vec3<S>) {
        let rotor = &self.rotors[index];
        let place = rotor.position_body;
        let hub =
            specific_force + angular.cross_constant(place) + rate.cross(rate.cross_constant(place));
        let turn = rotor.frame.handedness;
        (
            hub.rotated(&rotor.frame.polar),
            Vec3(angular.rotated(&rotor.frame.polar).0.map(|component| component * turn)),
        )
    }

    /// Force and moment about the centre of gravity, body frame, that blades
    /// return for an acceleration of their hub (less gravity) and an angular
    /// acceleration of the airframe, both in the hub frame.
    #[inline(always)]
    fn returned<S: Scalar>(
        &self,
        index: usize,
        blades: &[Vec3<S>; 3],
        hub: Vec3<S>,
        angular_hub: Vec3<S>,
    ) -> (Vec3<S>, Vec3<S>) {
        let (force, moment, _) = self.rotors[index].acceleration_loads(blades, hub, angular_hub);
        self.about_center(index, force, moment)
    }

    /// Solves Newton's and Euler's equations of airframe and blades for the
    /// specific force and the angular acceleration.
    #[inline(always)]
    fn accelerate<S: Scalar>(
        &self,
        rate: Vec3<S>,
        force: Vec3<S>,
        moment: Vec3<S>,
        work: &mut Workspace<S>,
    ) {
        let mut matrix = [[0.0; 6]; 6];
        for k in 0..3 {
            matrix[k][k] = self.mass;
            for j in 0..3 {
                matrix[3 + k][3 + j] = self.inertia[k][j];
            }
        }
        let zero = Vec3::<f64>::default();
        let rate_value = Vec3(rate.value());
        let gyroscopic = rate_value.cross(rate_value.rotated(&self.inertia));
        let mut right = [0.0; 6];
        for k in 0..3 {
            right[k] = force.0[k].value();
            right[3 + k] = moment.0[k].value() - gyroscopic.0[k];
        }
        for (index, rotor) in self.rotors.iter().enumerate() {
            let returned = |hub: Vec3<f64>, angular: Vec3<f64>| {
                let (force, moment) = self.accelerated_hub(index, work, hub, angular);
                self.about_center(index, force, moment)
            };
            let (hub, _) = self.hub_acceleration(index, rate_value, zero, zero);
            let (f, m) = returned(hub, zero);
            for k in 0..3 {
                right[k] += f.0[k];
                right[3 + k] += m.0[k];
            }
            // Columns of the mass matrix: what unit accelerations return.
            let polar = &rotor.frame.polar;
            let turn = rotor.frame.handedness;
            for column in 0..6 {
                let (hub, angular) = if column < 3 {
                    ([polar[0][column], polar[1][column], polar[2][column]], [0.0; 3])
                } else {
                    let axis = column - 3;
                    let mut unit = [0.0; 3];
                    unit[axis] = 1.0;
                    let arm = Vec3(unit).cross_constant(rotor.position_body).rotated(polar);
                    (arm.0, [polar[0][axis] * turn, polar[1][axis] * turn, polar[2][axis] * turn])
                };
                let (f, m) = returned(Vec3(hub), Vec3(angular));
                for k in 0..3 {
                    matrix[k][column] -= f.0[k];
                    matrix[3 + k][column] -= m.0[k];
                }
            }
        }
        let inverse = inverted(&matrix);
        let mut solution = [0.0; 6];
        for (row, out) in inverse.iter().zip(&mut solution) {
            *out = row.iter().zip(&right).map(|(a, b)| a * b).sum();
        }
        let mut answer = solution.map(S::constant);
        if S::TANGENTS > 0 {
            // Differentiate the equations at the solution: the tangents of
            // right − matrix · solution, through the inverse.
            let [p, q, r] = rate.0;
            let gyroscopic = S::compose(&Gyroscopic { inertia: &self.inertia }, &[p, q, r]);
            let mut residual = [S::default(); 6];
            for k in 0..3 {
                residual[k] = force.0[k];
                residual[3 + k] = moment.0[k] - gyroscopic[k];
            }
            for (index, rotor) in self.rotors.iter().enumerate() {
                if let Some(set) = &rotor.set {
                    let [ax, ay, az, wx, wy, wz] = solution;
                    let (hub, angular) = self.hub_acceleration(
                        index,
                        rate,
                        Vec3::constant([ax, ay, az]),
                        Vec3::constant([wx, wy, wz]),
                    );
                    let mut flap = [S::default(); MOST_EVALUATED];
                    let flap = &mut flap[..set.len()];
                    let (force, moment) = set.accelerated(&work.sets[index], hub, angular, flap);
                    let (force, moment) = self.about_center(index, force, moment);
                    for k in 0..3 {
                        residual[k] += force.0[k];
                        residual[3 + k] += moment.0[k];
                    }
                    continue;
                }
                let Shaft { sine, cosine, .. } = work.shaft[index];
                let part = S::compose(
                    &ReturnedAt { vehicle: self, index, solution },
                    &[p, q, r, work.teeter[index][0], sine, cosine],
                );
                for (sum, value) in residual.iter_mut().zip(part) {
                    *sum += value;
                }
            }
            for k in 0..6 {
                answer[k] = S::chain(solution[k], &inverse[k], &residual);
            }
        }
        work.acceleration =
            [Vec3([answer[0], answer[1], answer[2]]), Vec3([answer[3], answer[4], answer[5]])];
    }
}

/// What the blades of a rotor return at a given specific force and angular
/// acceleration of the airframe, force then moment, as a local function of the
/// body rates, the teeter angle, and the sine and cosine of the azimuth.
struct ReturnedAt<'a> {
    vehicle: &'a Vehicle,
    index: usize,
    solution: [f64; 6],
}

impl Local<6, 6> for ReturnedAt<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, &[p, q, r, teeter, sine, cosine]: &[T; 6]) -> [T; 6] {
        let Self { vehicle, index, solution: [ax, ay, az, wx, wy, wz] } = *self;
        let zero = T::default();
        let shaft = Shaft { speed: zero, acceleration: zero, sine, cosine };
        let blades = vehicle.rotors[index].hub_to_blades(teeter, &shaft);
        let (hub, angular) = vehicle.hub_acceleration(
            index,
            Vec3([p, q, r]),
            Vec3::constant([ax, ay, az]),
            Vec3::constant([wx, wy, wz]),
        );
        let (force, moment) = vehicle.returned(index, &blades, hub, angular);
        let ([fx, fy, fz], [mx, my, mz]) = (force.0, moment.0);
        [fx, fy, fz, mx, my, mz]
    }
}

/// Teeter acceleration that the motion of the hub adds, as a local function of
/// body rates, specific force, angular acceleration, teeter angle, and sine and
/// cosine of the azimuth.
struct TeeterOfHub<'a> {
    vehicle: &'a Vehicle,
    index: usize,
}

impl Local<12, 1> for TeeterOfHub<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 12]) -> [T; 1] {
        let &[p, q, r, ax, ay, az, wx, wy, wz, teeter, sine, cosine] = x;
        let (vehicle, index, zero) = (self.vehicle, self.index, T::default());
        let shaft = Shaft { speed: zero, acceleration: zero, sine, cosine };
        let rotor = &vehicle.rotors[index];
        let blades = rotor.hub_to_blades(teeter, &shaft);
        let (hub, spin) = vehicle.hub_acceleration(
            index,
            Vec3([p, q, r]),
            Vec3([ax, ay, az]),
            Vec3([wx, wy, wz]),
        );
        [rotor.acceleration_loads(&blades, hub, spin).2]
    }
}

/// ω × I ω as a local function of ω.
struct Gyroscopic<'a> {
    inertia: &'a Matrix3,
}

impl Local<3, 3> for Gyroscopic<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, &[p, q, r]: &[T; 3]) -> [T; 3] {
        let rate = Vec3([p, q, r]);
        rate.cross(rate.rotated(self.inertia)).0
    }
}

/// Inputs of a rotor at its own speed, and its shaft.
#[inline(always)]
fn with_shaft<S: Scalar>(input: &[S; 14], shaft: &Shaft<S>) -> [S; 18] {
    let mut all = [S::default(); 18];
    all[..14].copy_from_slice(input);
    all[14..].copy_from_slice(&[shaft.speed, shaft.acceleration, shaft.sine, shaft.cosine]);
    all
}

/// Inflow that a wake induces over a disk.
#[inline(always)]
fn induced<S: Scalar>(table: &Interference, wake: &Wake<S>, ratio: f64) -> [S; 3] {
    let [xc, xs] = wake.skew;
    let strength = wake.circulation.map(S::value);
    let place = [-xc.value(), xs.value()];
    let inputs = [xc, xs, wake.circulation[0], wake.circulation[1], wake.circulation[2]];
    let dot = |gain: &HubAxes<f64>, k: usize| {
        ratio
            * (gain[(k, 0)] * strength[0] + gain[(k, 1)] * strength[1] + gain[(k, 2)] * strength[2])
    };
    if S::TANGENTS == 0 {
        let gain = table.evaluate(place);
        return [0, 1, 2].map(|k| S::constant(dot(&gain, k)));
    }
    let (gain, by_x, by_y) = table.evaluate_with_partials(place);
    [0, 1, 2].map(|k| {
        let partials = [
            -dot(&by_x, k),
            dot(&by_y, k),
            ratio * gain[(k, 0)],
            ratio * gain[(k, 1)],
            ratio * gain[(k, 2)],
        ];
        S::chain(dot(&gain, k), &partials, &inputs)
    })
}

/// A point, from the centre of gravity, seen from a rotor's hub in its
/// unmirrored hub frame.
fn unmirrored(rotor: &Rotor, point_body: &[f64; 3]) -> [f64; 3] {
    unmirrored_vector(rotor, &[0, 1, 2].map(|k| point_body[k] - rotor.position_body[k]))
}

/// A vector of the body frame in those axes.
fn unmirrored_vector(rotor: &Rotor, body: &[f64; 3]) -> [f64; 3] {
    let mut seen = Vec3(*body).rotated(&rotor.frame.polar).0;
    seen[1] *= rotor.frame.handedness;
    seen
}

/// Hub axes of a receiver in the source's unmirrored hub frame, as columns.
fn axes_in(source: &Rotor, receiver: &Rotor) -> HubAxes<f64> {
    let mut axes = HubAxes::zeros();
    for (column, axis) in receiver.frame.polar.iter().enumerate() {
        let mut seen = Vec3(*axis).rotated(&source.frame.polar).0;
        seen[1] *= source.frame.handedness;
        let sign = if column == 1 { receiver.frame.handedness } else { 1.0 };
        for (row, value) in seen.iter().enumerate() {
            axes[(row, column)] = sign * value;
        }
    }
    axes
}

/// Inverse of the mass matrix by Gauss–Jordan elimination with partial
/// pivoting; an all-NaN matrix where it is singular, which every caller
/// detects as a rate that is not finite.
fn inverted(matrix: &[[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let mut a = *matrix;
    let mut inverse = [[0.0; 6]; 6];
    for (k, row) in inverse.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    for column in 0..6 {
        let mut pivot = column;
        for row in column + 1..6 {
            if a[row][column].abs() > a[pivot][column].abs() {
                pivot = row;
            }
        }
        a.swap(column, pivot);
        inverse.swap(column, pivot);
        let scale = 1.0 / a[column][column];
        if !scale.is_finite() {
            return [[f64::NAN; 6]; 6];
        }
        for k in 0..6 {
            a[column][k] *= scale;
            inverse[column][k] *= scale;
        }
        for row in 0..6 {
            if row != column {
                let factor = a[row][column];
                for k in 0..6 {
                    a[row][k] -= factor * a[column][k];
                    inverse[row][k] -= factor * inverse[column][k];
                }
            }
        }
    }
    inverse
}

/// Position of a station in the vehicle's body frame, for callers that draw.
#[must_use]
pub fn station_body(problem: &Problem, station: &crate::problem::Station) -> [f64; 3] {
    position_body(station, &problem.mass.center_of_gravity)
}
