//! A rotor alone on its stand: momentum and blade-element theory, published
//! hover tests, and the same rotor as in a trimmed aircraft.

mod common;

use approx::assert_relative_eq;
use coaxdesign::problem::{Airfoil, HubKind, Polar, Problem, Spanwise};
use coaxdesign::trim::stand::{Flow, Load, Stand, StandPoint};
use coaxdesign::trim::{FlightCondition, Options, trim_at};
use coaxdesign::vehicle::Vehicle;
use coaxdesign::vehicle::inflow::FlowState;
use common::{analytic, problem};
use std::f64::consts::SQRT_2;

const STILL: Flow = Flow { edgewise: 0.0, axial: 0.0 };

/// A rigid rotor of constant chord without twist: radius and chord, m, blades,
/// tip speed, m/s, and its section.
fn plain(radius: f64, chord: f64, blades: usize, tip_speed: f64, airfoil: Airfoil) -> Problem {
    let mut p = problem("coax2d");
    p.rotors.truncate(1);
    let rotor = &mut p.rotors[0];
    let constant = |value: f64| Spanwise { station: vec![0.0], value: vec![value] };
    rotor.radius = radius;
    rotor.chord = constant(chord);
    rotor.twist = constant(0.0);
    rotor.blades = blades;
    rotor.speed = tip_speed / radius;
    rotor.airfoil = airfoil;
    rotor.hub_kind = HubKind::Rigid;
    rotor.precone = 0.0;
    rotor.root_cutout = 0.15;
    rotor.tip_loss = 1.0;
    rotor.elements = 40;
    rotor.governor = None;
    p
}

fn trimmed(stand: &Stand, load: Load, flow: Flow) -> StandPoint {
    let point = stand.trim(load, flow);
    assert!(point.failure.is_none(), "{load:?} {flow:?}: {:?}", point.failure);
    assert!(point.residual_norm < 1e-8);
    point
}

/// Loads that are asked for are met, and agree with one another.
#[test]
fn loads_are_met() {
    let stand = Stand::new(&problem("coax2d"), 0).unwrap();
    let by_c_t = trimmed(&stand, Load::ThrustCoefficient(0.004), STILL);
    assert_relative_eq!(by_c_t.thrust_coefficient, 0.004, max_relative = 1e-9);
    let by_thrust = trimmed(&stand, Load::Thrust(by_c_t.thrust), STILL);
    let by_torque = trimmed(&stand, Load::Torque(by_c_t.torque), STILL);
    for other in [by_thrust, by_torque] {
        assert_relative_eq!(other.pitch[0], by_c_t.pitch[0], max_relative = 1e-7);
        assert_relative_eq!(other.power, by_c_t.power, max_relative = 1e-7);
    }
    assert_relative_eq!(
        by_c_t.profile_power + by_c_t.induced_power,
        by_c_t.power,
        max_relative = 1e-6
    );
}

/// Hover of an ideal section: induced power is that of momentum theory with
/// uniform inflow, profile power σδ/8, and the collective that of blade-element
/// theory, 6C_T/(σa) + 3λ/2, all for a blade to the shaft and small angles.
#[test]
fn val_hover_of_momentum_and_blade_element_theory() {
    let (radius, chord, blades, tip_speed) = (5.0, 0.2, 3, 200.0);
    let mut p = plain(radius, chord, blades, tip_speed, analytic(5.7, 0.01));
    p.rotors[0].root_cutout = 0.01;
    let stand = Stand::new(&p, 0).unwrap();
    let sigma = blades as f64 * chord / (std::f64::consts::PI * radius);
    for c_t in [0.002, 0.004, 0.006] {
        let point = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL);
        let lambda = (0.5 * c_t).sqrt();
        assert_relative_eq!(point.inflow[0], lambda, max_relative = 2e-2);
        let induced = point.power_coefficient * point.induced_power / point.power;
        assert_relative_eq!(induced, c_t.powf(1.5) / SQRT_2, max_relative = 2e-2);
        let profile = point.power_coefficient * point.profile_power / point.power;
        assert_relative_eq!(profile, sigma * 0.01 / 8.0, max_relative = 4e-2);
        let collective = 6.0 * c_t / (sigma * 5.7) + 1.5 * lambda;
        assert_relative_eq!(point.pitch[0], collective, max_relative = 3e-2);
        assert!(point.pitch[1].abs() + point.pitch[2].abs() < 1e-9);
    }
}

/// Climb and descent along the shaft follow momentum theory and, between hover
/// and the windmill, Castles and Gray; the flow's state is told.
#[test]
fn val_axial_flight_of_momentum_theory() {
    let stand = Stand::new(&plain(5.0, 0.2, 3, 200.0, analytic(5.7, 0.01)), 0).unwrap();
    let c_t = 0.004;
    let hover = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL).inflow[0];
    for (x, ratio, state) in [
        (1.0_f64, 0.5 * (5.0_f64.sqrt() - 1.0), FlowState::Normal),
        (-1.0, 1.816, FlowState::VortexRing),
        (-1.5, 2.083, FlowState::VortexRing),
        (-3.0, 1.5 - 1.25_f64.sqrt(), FlowState::Windmill),
    ] {
        let flow = Flow { axial: x * hover * 200.0, ..STILL };
        let point = trimmed(&stand, Load::ThrustCoefficient(c_t), flow);
        let found = point.inflow[0] / hover;
        println!("{x}: {found:.4} for {ratio:.4}");
        assert!((found / ratio - 1.0).abs() < 0.03, "{x}: {found} for {ratio}");
        assert_eq!(point.flow_state, state, "{x}");
    }
}

/// In a wind tunnel the disk is level, the retreating blade works at a larger
/// angle, and induced power falls as Glauert's.
#[test]
fn val_edgewise_flow_of_glauert() {
    let p = problem("coax2d-physics");
    let stand = Stand::new(&p, 0).unwrap();
    let c_t = 0.003;
    let hover = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL);
    let tip_speed = p.rotors[0].speed * p.rotors[0].radius;
    let mu = 0.2;
    let flow = Flow { edgewise: mu * tip_speed, axial: 0.0 };
    let fast = trimmed(&stand, Load::ThrustCoefficient(c_t), flow);
    assert_relative_eq!(fast.inflow[0], c_t / (2.0 * mu), max_relative = 0.05);
    assert!(fast.induced_power < 0.4 * hover.induced_power);
    assert!(fast.flapping.iter().all(|angle| angle.abs() < 1e-8), "{:?}", fast.flapping);
    assert!(fast.pitch[2] < 0.0, "{:?}", fast.pitch);
    assert!(fast.figure_of_merit.is_none() && hover.figure_of_merit.is_some());
}

/// The stand's rotor is the aircraft's: without interactions the upper rotor of
/// the CoAX 2D hovers with the power that it has on the stand at that thrust.
#[test]
fn the_stand_agrees_with_the_trimmed_aircraft() {
    let mut p = problem("coax2d");
    p.inflow.interactions = false;
    let vehicle = Vehicle::new(&p).unwrap();
    let hover = trim_at(&vehicle, FlightCondition::level(0.0), &Options::default());
    let upper = hover.rotors[0];
    let stand = Stand::new(&p, 0).unwrap();
    let point = trimmed(&stand, Load::Thrust(upper.thrust), STILL);
    // The aircraft's rotor flaps a little and sees the airframe shake.
    assert_relative_eq!(point.power, upper.power, max_relative = 0.02);
    assert_relative_eq!(point.inflow[0], upper.inflow[0], max_relative = 0.01);
    assert_relative_eq!(point.pitch[0], upper.pitch[0], max_relative = 0.02);
    // Every trim tells the figure of merit in hover, and none in flight.
    let merit = upper.figure_of_merit.unwrap();
    assert_relative_eq!(point.figure_of_merit.unwrap(), merit, max_relative = 0.02);
    let flight = trim_at(&vehicle, FlightCondition::level(25.0), &Options::default());
    assert!(flight.rotors.iter().all(|rotor| rotor.figure_of_merit.is_none()));
}

/// Caradonna and Tung, NASA TM 81232 (1981): two blades of NACA 0012, 1.143 m
/// by 0.1905 m, without twist, at a tip Mach number of 0.44: thrust
/// coefficients of 0.00213, 0.00459 and 0.00796 at 5°, 8° and 12° of
/// collective. Here at those thrusts, with the usual tip loss 1 − √(C_T)/N_b
/// and a lift slope of 2π/√(1 − M²) at three quarters of the radius less the
/// tenth that sections lack. Uniform inflow without a factor on induced power
/// needs 10 to 20 % less collective than was measured: a misfit, and its bound.
/// A factor of 1.15 on induced power takes more than half of it away.
#[test]
fn val_collective_of_caradonna_and_tung() {
    for (c_t, degrees) in [(0.00213, 5.0), (0.00459, 8.0), (0.00796, 12.0)] {
        let slope = 0.9 * std::f64::consts::TAU / (1.0 - 0.33_f64.powi(2)).sqrt();
        let mut p = plain(1.143, 0.1905, 2, 0.439 * 340.3, analytic(slope, 0.0095));
        p.rotors[0].tip_loss = 1.0 - f64::sqrt(c_t) / 2.0;
        let stand = Stand::new(&p, 0).unwrap();
        let point = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL);
        let found = point.pitch[0].to_degrees();
        p.rotors[0].induced_power_factor = 1.15;
        let stand = Stand::new(&p, 0).unwrap();
        let uneven = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL).pitch[0].to_degrees();
        println!("C_T {c_t}: {found:.2} deg, with a factor {uneven:.2}, for {degrees}");
        assert!((0.9..1.0).contains(&(uneven / degrees)), "C_T {c_t}: {uneven} for {degrees}");
        assert!(degrees - uneven < 0.55 * (degrees - found), "{uneven} {found}");
        assert!((0.78..1.0).contains(&(found / degrees)), "C_T {c_t}: {found} for {degrees}");
    }
}

/// A load beyond the rotor fails by name.
#[test]
fn what_cannot_be_carried_fails() {
    let stand = Stand::new(&problem("coax2d"), 0).unwrap();
    let point = stand.trim(Load::ThrustCoefficient(0.2), STILL);
    assert!(point.failure.is_some());
}

/// κ multiplies induced power and nothing else: in hover by momentum theory, at
/// μ = 0.2 by Glauert's. The disk's momentum does not change.
#[test]
fn the_induced_power_factor_multiplies_induced_power() {
    let mut p = plain(5.0, 0.2, 3, 200.0, analytic(5.7, 0.01));
    let flows = [STILL, Flow { edgewise: 40.0, axial: 0.0 }];
    let plain_points = {
        let stand = Stand::new(&p, 0).unwrap();
        flows.map(|flow| trimmed(&stand, Load::ThrustCoefficient(0.005), flow))
    };
    p.rotors[0].induced_power_factor = 1.15;
    let stand = Stand::new(&p, 0).unwrap();
    for (flow, before) in flows.into_iter().zip(plain_points) {
        let point = trimmed(&stand, Load::ThrustCoefficient(0.005), flow);
        assert_relative_eq!(point.induced_power, 1.15 * before.induced_power, max_relative = 5e-3);
        assert_relative_eq!(point.profile_power, before.profile_power, max_relative = 1e-2);
        assert!(point.pitch[0] > before.pitch[0]);
    }
}

/// A blade that lifts up to B R has the momentum of a disk of that radius: in
/// hover induced power grows by 1/B (J. G. Leishman, Principles of Helicopter
/// Aerodynamics), in edgewise flow by 1/B².
#[test]
fn val_tip_loss_costs_induced_power() {
    let mut p = plain(5.0, 0.2, 3, 200.0, analytic(5.7, 0.01));
    p.rotors[0].elements = 100;
    let tip = 0.95;
    for (edgewise, factor) in [(0.0, 1.0 / tip), (60.0, 1.0 / (tip * tip))] {
        let flow = Flow { edgewise, axial: 0.0 };
        let at = |b: f64| {
            let mut p = p.clone();
            p.rotors[0].tip_loss = b;
            trimmed(&Stand::new(&p, 0).unwrap(), Load::ThrustCoefficient(0.005), flow)
        };
        let (whole, lossy) = (at(1.0), at(tip));
        let ratio = lossy.induced_power / whole.induced_power;
        println!("edgewise {edgewise}: {ratio:.4} for {factor:.4}");
        assert_relative_eq!(ratio, factor, max_relative = 0.01);
        assert!(lossy.pitch[0] > whole.pitch[0]);
    }
}

/// Profile power of Bailey's polar, δ = 0.0087 − 0.0216 α + 0.400 α² (F. J.
/// Bailey, NACA Report 716, 1941): by an integral over the angles of attack of
/// blade-element theory, α = θ − λ/r.
#[test]
fn val_profile_power_of_baileys_polar() {
    let polar = Polar { linear: -0.0216, quadratic: 0.4, stall: None };
    let section = |polar: Polar| Airfoil::Analytic {
        lift_slope: 5.73,
        zero_lift_angle: 0.0,
        drag: 0.0087,
        polar,
        small_angles: false,
    };
    let stand = Stand::new(&plain(5.0, 0.2, 3, 200.0, section(polar)), 0).unwrap();
    let constant = Stand::new(&plain(5.0, 0.2, 3, 200.0, section(Polar::default())), 0).unwrap();
    let sigma = 3.0 * 0.2 / (std::f64::consts::PI * 5.0);
    let mut before = 0.0;
    for c_t in [0.001, 0.003, 0.006] {
        let point = trimmed(&stand, Load::ThrustCoefficient(c_t), STILL);
        let profile = point.power_coefficient * point.profile_power / point.power;
        let count = 400;
        let integral: f64 = (0..count)
            .map(|k| {
                let dr = 0.85 / f64::from(count);
                let r = 0.15 + (f64::from(k) + 0.5) * dr;
                let lambda = point.inflow[0];
                let angle = point.pitch[0] - (lambda / r).atan();
                let drag = 0.0087 - 0.0216 * angle + 0.4 * angle * angle;
                0.5 * sigma * drag * (r * r + lambda * lambda).powf(1.5) * dr
            })
            .sum();
        assert_relative_eq!(profile, integral, max_relative = 5e-3);
        assert!(profile > before);
        before = profile;
    }
    // At large thrust the polar costs far more than its constant.
    let heavy = trimmed(&constant, Load::ThrustCoefficient(0.006), STILL);
    assert!(before > 1.2 * heavy.power_coefficient * heavy.profile_power / heavy.power);
}

/// A section that stalls bounds the load of a blade, and its profile power rises
/// steeply before.
#[test]
fn stall_bounds_the_load() {
    let section = |stall: Option<f64>| Airfoil::Analytic {
        lift_slope: 5.73,
        zero_lift_angle: 0.0,
        drag: 0.0087,
        polar: Polar { linear: 0.0, quadratic: 0.4, stall },
        small_angles: false,
    };
    let stand = Stand::new(&plain(5.0, 0.2, 3, 200.0, section(Some(0.21))), 0).unwrap();
    let without = Stand::new(&plain(5.0, 0.2, 3, 200.0, section(None)), 0).unwrap();
    let sigma = 3.0 * 0.2 / (std::f64::consts::PI * 5.0);
    let light = Load::ThrustCoefficient(0.06 * sigma);
    let (a, b) = (trimmed(&stand, light, STILL), trimmed(&without, light, STILL));
    assert_relative_eq!(a.power, b.power, max_relative = 1e-6);
    let heavy = Load::ThrustCoefficient(0.25 * sigma);
    assert!(without.trim(heavy, STILL).failure.is_none());
    assert!(stand.trim(heavy, STILL).failure.is_some());
}
