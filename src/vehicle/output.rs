//! What a rotorcraft does at one instant, beyond its rates: rotor loads,
//! powers and the loads of each component.

use crate::numerics::scalar::Vec3;
use crate::vehicle::census::Census;
use crate::vehicle::rotor::RotorInput;
use crate::vehicle::{AirMotion, Vehicle, Workspace};

/// A rotor at one instant, in its own (for a clockwise rotor mirrored) hub
/// frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RotorOutput {
    /// Force on the hub along the shaft, up, N.
    pub thrust: f64,
    /// Torque that the shaft puts into the rotor, N m.
    pub torque: f64,
    /// Shaft power, W.
    pub power: f64,
    /// Total inflow λ_0, λ_1c, λ_1s.
    pub inflow: [f64; 3],
    /// Self-induced inflow λ_s0, λ_s1c, λ_s1s.
    pub self_inflow: [f64; 3],
    /// Velocity of the hub through the air over the tip speed: forward,
    /// sideways and down the shaft, own hub frame.
    pub advance: [f64; 3],
    /// β_1c, β_1s, rad.
    pub flapping: [f64; 2],
    /// θ_0, θ_1c, θ_1s, rad.
    pub pitch: [f64; 3],
    /// Force on the hub, hub frame, N.
    pub force_hub: [f64; 3],
    /// Moment on the hub, hub frame, N m.
    pub moment_hub: [f64; 3],
    /// Power of section drag, W.
    pub profile_power: f64,
    /// Power of induced flow, W.
    pub induced_power: f64,
    /// Shaft power that a switch which leaves exact mechanics takes and no blade
    /// delivers, W: see [`Rotor::inexact_power`](super::rotor::Rotor::inexact_power).
    pub inexact_power: f64,
    /// Flap angle of blade 1 against its precone, rad: on a teetering hub the
    /// teeter angle.
    pub teeter_angle: f64,
    /// What the sections of its blades meet.
    pub census: Census,
    /// Coning β_0, rad; zero where blades do not cone.
    pub coning: f64,
}

/// Loads of a body or wing on the airframe.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BodyLoads {
    /// Force, body frame, N.
    pub force_body: [f64; 3],
    /// Moment about the centre of gravity, body frame, N m.
    pub moment_body: [f64; 3],
}

/// Everything at one instant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Output {
    /// One a rotor.
    pub rotors: Vec<RotorOutput>,
    /// One a fuselage.
    pub fuselages: Vec<BodyLoads>,
    /// One a wing.
    pub wings: Vec<BodyLoads>,
    /// Power that air takes from fuselages and wings, W.
    pub parasite_power: f64,
    /// Power that goes into height, W.
    pub climb_power: f64,
    /// Specific force at the centre of gravity, body frame, m/s².
    pub specific_force: [f64; 3],
}

impl Vehicle {
    /// Output of the state and the air last passed to [`Vehicle::rates`] with
    /// this workspace.
    #[must_use]
    pub fn output(
        &self,
        state: &[f64],
        effectors: &[f64],
        air: impl Into<AirMotion>,
        work: &Workspace<f64>,
    ) -> Output {
        let motion = air.into();
        let rate = Vec3([state[3], state[4], state[5]]);
        let [specific_force, angular] = work.acceleration;
        let rotors = self
            .rotors
            .iter()
            .enumerate()
            .map(|(index, rotor)| {
                let places = &self.layout.rotors[index];
                let (hub, spin) = self.hub_acceleration(index, rate, specific_force, angular);
                let (force, moment) = self.accelerated_hub(index, work, hub, spin);
                let force_hub = (work.loads[index].force_hub + force).0;
                let moment_hub = (work.loads[index].moment_hub + moment).0;
                let flapping = places.flapping.map_or([0.0; 2], |at| [state[at], state[at + 1]]);
                let three = |list: &[f64], at: Option<usize>| {
                    at.map_or([0.0; 3], |at| [list[at], list[at + 1], list[at + 2]])
                };
                let pitch = three(effectors, places.pitch);
                let shaft = &work.shaft[index];
                let input = RotorInput {
                    velocity_hub: work.hub[index][0],
                    rate_hub: work.hub[index][1],
                    air_rate_hub: rotor.frame.rate_hub(motion.rate),
                    flapping,
                    inflow: work.inflow[index],
                    pitch,
                };
                let set = &work.sets[index];
                let mut blades = match rotor.set {
                    Some(_) => rotor.power_of(&input, shaft, |k| [set[k].angle, set[k].rate]),
                    None => rotor.blade_power(&input, shaft),
                };
                if rotor.coefficients.is_some() {
                    // What a rotor without blades takes from its shaft and its motion.
                    let hub = input.velocity_hub;
                    let along = Vec3([force_hub[0], force_hub[1], 0.0]);
                    blades.profile = moment_hub[2] * shaft.speed - along.dot(hub);
                }
                RotorOutput {
                    thrust: -force_hub[2],
                    torque: moment_hub[2],
                    power: moment_hub[2] * shaft.speed,
                    inflow: work.inflow[index],
                    self_inflow: three(state, places.self_inflow),
                    advance: work.hub[index][0].0.map(|v| v / rotor.tip_speed()),
                    flapping,
                    pitch,
                    force_hub,
                    moment_hub,
                    profile_power: blades.profile,
                    induced_power: blades.induced,
                    census: blades.census,
                    inexact_power: rotor.inexact_power(
                        &input,
                        shaft,
                        &work.blades[index],
                        (hub, spin),
                    ),
                    teeter_angle: set.first().map_or(work.teeter[index][0], |blade| blade.angle),
                    coning: places.coning.map_or(0.0, |at| state[at]),
                }
            })
            .collect();
        let velocity = Vec3([state[0], state[1], state[2]]);
        let [air, air_rate] = self.through_air(velocity, rate, &motion);
        let mut parasite_power = 0.0;
        let mut component = |loads: &[(Vec3<f64>, Vec3<f64>)]| -> Vec<BodyLoads> {
            loads
                .iter()
                .map(|(force, moment)| {
                    parasite_power -= force.dot(air) + moment.dot(air_rate);
                    BodyLoads { force_body: force.0, moment_body: moment.0 }
                })
                .collect()
        };
        let fuselages = component(&work.fuselage_loads);
        let wings = component(&work.wing_loads);
        let [_, _, _, down] = self.navigation(state);
        Output {
            rotors,
            fuselages,
            wings,
            parasite_power,
            climb_power: -self.mass * crate::units::STANDARD_GRAVITY * down,
            specific_force: specific_force.0,
        }
    }
}
