//! The rotor against closed forms of blade-element, momentum and flapping
//! theory, and wings and fuselages against theirs.

mod common;

use coaxdesign::numerics::scalar::Vec3;
use coaxdesign::problem::{
    self, AtmosphereConditions, DriveTrain, Formulation, Fuselage as FuselageProblem,
    FuselageAerodynamics, HubKind, Spanwise, Station, TeeterEquation, Wash, WingModel,
};
use coaxdesign::vehicle::atmosphere::Air;
use coaxdesign::vehicle::fuselage::Fuselage;
use coaxdesign::vehicle::rotor::{Rotor, RotorInput, RotorLoads, Shaft};
use coaxdesign::vehicle::wing::Wing;
use common::{analytic, constant, problem, rates, vehicle};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

const ORIGIN: Station = Station { fuselage_station: 0.0, butt_line: 0.0, water_line: 0.0 };
const SEA_LEVEL: AtmosphereConditions =
    AtmosphereConditions { altitude: 0.0, temperature_offset: 0.0 };
/// Lift slope of the analytic section, 1/rad.
const SLOPE: f64 = 5.7;

/// A plain rigid rotor: analytic section, no twist, no precone.
fn plain(drag: f64, elements: usize) -> problem::Rotor {
    let mut rotor = problem("coax2d").rotors[1].clone();
    rotor.hub = ORIGIN;
    (rotor.tilt, rotor.cant, rotor.precone) = (0.0, 0.0, 0.0);
    rotor.hub_kind = HubKind::Rigid;
    rotor.twist = constant(0.0);
    rotor.airfoil = analytic(SLOPE, drag);
    rotor.elements = elements;
    rotor
}

/// The same, free to teeter.
fn teetering(elements: usize, spring: f64, delta_3: f64) -> problem::Rotor {
    let hub_kind = HubKind::Teetering { undersling: 0.0, spring, delta_3 };
    problem::Rotor { hub_kind, ..plain(0.0, elements) }
}

fn built(rotor: &problem::Rotor) -> Rotor {
    Rotor::new(rotor, &Formulation::EXACT, &ORIGIN, &Air::at(&SEA_LEVEL)).unwrap()
}

/// A rotor that hovers and does nothing.
fn at_rest() -> RotorInput<f64> {
    RotorInput {
        velocity_hub: Vec3([0.0; 3]),
        rate_hub: Vec3([0.0; 3]),
        air_rate_hub: [0.0; 3],
        flapping: [0.0; 2],
        inflow: [0.0; 3],
        pitch: [0.0; 3],
    }
}

fn shaft(rotor: &Rotor, azimuth: f64) -> Shaft<f64> {
    let (sine, cosine) = azimuth.sin_cos();
    Shaft { speed: rotor.speed, acceleration: 0.0, sine, cosine }
}

fn loads(rotor: &Rotor, input: &RotorInput<f64>, azimuth: f64) -> RotorLoads<f64> {
    rotor.loads(input, &shaft(rotor, azimuth))
}

/// C_Q of a rigid rotor, whose hub moment has no inertia in it at rest.
fn torque_coefficient(rotor: &Rotor, loads: &RotorLoads<f64>) -> f64 {
    loads.moment_hub.0[2] / (rotor.force_scale() * rotor.radius)
}

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (value - expected).abs() / expected.abs();
    assert!(error < tolerance, "{what}: {value} against {expected}, off by {error:.1e}");
}

// --- Blade-element theory ----------------------------------------------------

/// C_T = σ/2 (a (θ_0/3 + θ_tw/4 − λ/2) − δ λ/2), C_Q = σ δ/8 + λ σ a/2 (θ_0/3 + θ_tw/4 − λ/2).
/// The theory drops squares of the angles, so these are small: 1e-3 rad. The
/// midpoint rule of 1000 elements is good to 1e-6.
#[test]
fn val_hover_thrust_and_torque_are_blade_element_theory() {
    let small = 1e-3;
    let (theta, twist, lambda) = (8.0 * small, -3.0 * small, 2.0 * small);
    for drag in [0.0, 0.01] {
        let mut description = plain(drag, 1000);
        description.twist = Spanwise { station: vec![0.0, 1.0], value: vec![0.0, twist] };
        let rotor = built(&description);
        let sigma = rotor.solidity();
        close(sigma, 2.0 * description.chord.value[0] / (PI * rotor.radius), 1e-12, "solidity");
        let input =
            RotorInput { pitch: [theta, 0.0, 0.0], inflow: [lambda, 0.0, 0.0], ..at_rest() };
        let out = loads(&rotor, &input, 0.3);
        let angle = theta / 3.0 + twist / 4.0 - lambda / 2.0;
        let thrust = 0.5 * sigma * (SLOPE * angle - drag * lambda / 2.0);
        close(out.thrust_coefficient, thrust, 3e-5, "C_T");
        let torque = sigma * drag / 8.0 + lambda * 0.5 * sigma * SLOPE * angle;
        close(torque_coefficient(&rotor, &out), torque, 1e-4, "C_Q");
        // Two blades in axial flow: nothing is left sideways.
        assert!(out.force_hub.0[0].abs() < 1e-9 && out.force_hub.0[1].abs() < 1e-9);
    }
}

/// Profile power alone is C_P = σ δ/8, and the work that the air takes says
/// the same.
#[test]
fn val_profile_power() {
    let rotor = built(&plain(0.011, 2000));
    let input = at_rest();
    let out = loads(&rotor, &input, 1.0);
    let expected = rotor.solidity() * 0.011 / 8.0;
    close(torque_coefficient(&rotor, &out), expected, 1e-6, "C_P");
    let power = rotor.blade_power(&input, &shaft(&rotor, 1.0));
    let scale = rotor.force_scale() * rotor.tip_speed();
    close(power.profile / scale, expected, 1e-6, "profile power");
    assert_eq!(power.induced, 0.0);
}

/// The error of the blade elements falls with the square of their number.
#[test]
fn elements_converge_with_their_square() {
    let thrust = |elements: usize| {
        let mut description = plain(0.01, elements);
        description.twist = Spanwise { station: vec![0.0, 1.0], value: vec![0.0, -0.13] };
        let rotor = built(&description);
        let input = RotorInput {
            pitch: [0.17, 0.02, -0.01],
            inflow: [0.03, 0.0, 0.0],
            velocity_hub: Vec3([12.0, 0.0, 0.0]),
            ..at_rest()
        };
        loads(&rotor, &input, 0.9).thrust_coefficient
    };
    let limit = thrust(4096);
    // Near the root the flow is steep and the lift no longer linear: the first
    // elements must be small enough to see that.
    let errors = [32, 64, 128, 256].map(|n| (thrust(n) - limit).abs());
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.1, "order {order} from errors {errors:?}");
    }
}

/// Tip loss cuts the lift beyond B, and only the lift; a root cutout leaves
/// no blade at all.
#[test]
fn val_tip_loss_and_root_cutout() {
    let (theta, lambda, drag) = (8e-3, 2e-3, 0.01);
    let input = RotorInput { pitch: [theta, 0.0, 0.0], inflow: [lambda, 0.0, 0.0], ..at_rest() };
    // 0.95 falls between elements, as it must for the midpoint rule to hold.
    let b = 0.95_f64;
    let rotor = built(&problem::Rotor { tip_loss: b, ..plain(drag, 1000) });
    let sigma = rotor.solidity();
    let out = loads(&rotor, &input, 0.0);
    let lift = SLOPE * (theta * b.powi(3) / 3.0 - lambda * b * b / 2.0);
    let thrust = 0.5 * sigma * (lift - drag * lambda / 2.0);
    close(out.thrust_coefficient, thrust, 3e-5, "C_T with tip loss");
    let idle = loads(&rotor, &at_rest(), 0.0);
    close(torque_coefficient(&rotor, &idle), sigma * drag / 8.0, 1e-6, "drag beyond B");

    let root = 0.2_f64;
    let rotor = built(&problem::Rotor { root_cutout: root, ..plain(drag, 1000) });
    let full = 2.0 * plain(drag, 1).chord.value[0] / (PI * rotor.radius);
    close(rotor.solidity(), full * (1.0 - root), 1e-12, "solidity beyond the cutout");
    let out = loads(&rotor, &input, 0.0);
    let lift = SLOPE * (theta * (1.0 - root.powi(3)) / 3.0 - lambda * (1.0 - root * root) / 2.0);
    let thrust = 0.5 * full * (lift - drag * lambda * (1.0 - root * root) / 2.0);
    close(out.thrust_coefficient, thrust, 3e-5, "C_T with cutout");
    let idle = loads(&rotor, &at_rest(), 0.0);
    let profile = full * drag * (1.0 - root.powi(4)) / 8.0;
    close(torque_coefficient(&rotor, &idle), profile, 1e-6, "C_Q with cutout");
}

/// Forward flight, no drag: the mean over the azimuth of
/// C_T = σ a/2 (θ_0 (∫x² + μ²/2 ∫1) − λ ∫x). The root cutout is larger than
/// μ, so that no section meets reversed flow.
#[test]
fn val_forward_flight_thrust() {
    let (root, mu, theta, lambda) = (0.3_f64, 0.2, 6e-3, 1.5e-3);
    let rotor = built(&problem::Rotor { root_cutout: root, ..plain(0.0, 1000) });
    let full = rotor.solidity() / (1.0 - root);
    let input = RotorInput {
        pitch: [theta, 0.0, 0.0],
        inflow: [lambda, 0.0, 0.0],
        velocity_hub: Vec3([mu * rotor.tip_speed(), 0.0, 0.0]),
        ..at_rest()
    };
    let count = 16;
    let mean = (0..count)
        .map(|k| loads(&rotor, &input, PI * f64::from(k) / f64::from(count)).thrust_coefficient)
        .sum::<f64>()
        / f64::from(count);
    let pitch = (1.0 - root.powi(3)) / 3.0 + 0.5 * mu * mu * (1.0 - root);
    let expected = 0.5 * full * SLOPE * (theta * pitch - lambda * (1.0 - root * root) / 2.0);
    close(mean, expected, 1e-4, "C_T at μ = 0.2");
    // The advancing blade is to starboard (azimuth 90°): more lift there rolls
    // a rigid rotor to port.
    let side = loads(&rotor, &input, FRAC_PI_2);
    assert!(side.roll_coefficient < 0.0, "{}", side.roll_coefficient);
}

/// Momentum theory: a rotor whose blade elements give C_T = 2 λ² holds its
/// inflow, and one of more pitch draws more.
#[test]
fn val_hover_inflow_is_momentum_theory() {
    let mut p = problem("coax2d");
    p.inflow.interactions = false;
    p.wings.clear();
    p.fuselages.clear();
    for rotor in &mut p.rotors {
        let hub = rotor.hub;
        *rotor = problem::Rotor { hub, name: rotor.name.clone(), ..plain(0.0, 400) };
    }
    let vehicle = vehicle(&p);
    let sigma = vehicle.rotors[0].solidity();
    let lambda = 3e-3;
    let theta = 3.0 * (2.0 * 2.0 * lambda * lambda / (sigma * SLOPE) + lambda / 2.0);
    let mut state = vec![0.0; vehicle.state_count()];
    let mut effectors = vec![0.0; vehicle.effector_count()];
    for places in &vehicle.layout.rotors {
        state[places.self_inflow.unwrap()] = lambda;
        state[places.total_inflow.unwrap()] = lambda;
        effectors[places.pitch.unwrap()] = theta;
    }
    let at = vehicle.layout.rotors[0];
    let rate = |effectors: &[f64], k: usize| rates(&vehicle, 0.4, &state, effectors, [0.0; 3])[k];
    // λ' = Ω (3π/8) (C_T − 2λ²): the closed form is good to 1e-4 of 2λ².
    let scale = vehicle.rotors[0].speed * 3.0 * PI / 8.0 * 2.0 * lambda * lambda;
    assert!(rate(&effectors, at.self_inflow.unwrap()).abs() < 2e-4 * scale);
    for k in [1, 2] {
        assert!(rate(&effectors, at.self_inflow.unwrap() + k).abs() < 1e-9, "no gradient");
    }
    // Total inflow has arrived.
    assert!(rate(&effectors, at.total_inflow.unwrap()).abs() < 1e-9);
    effectors[at.pitch.unwrap()] *= 1.1;
    assert!(rate(&effectors, at.self_inflow.unwrap()) > 0.01 * scale);
}

// --- Teetering -----------------------------------------------------------------

/// β'' of blade 1 when one input alone is not zero.
fn teeter_acceleration(rotor: &Rotor, azimuth: f64, change: impl Fn(&mut RotorInput<f64>)) -> f64 {
    let mut input = at_rest();
    change(&mut input);
    loads(rotor, &input, azimuth).teeter_acceleration
}

/// Slope of β'' at rest by a central difference; the cubic term of a step of
/// 1e-4 is 1e-8.
fn teeter_slope(rotor: &Rotor, azimuth: f64, change: impl Fn(&mut RotorInput<f64>, f64)) -> f64 {
    let h = 1e-4;
    let at = |value: f64| teeter_acceleration(rotor, azimuth, |input| change(input, value));
    (at(h) - at(-h)) / (2.0 * h)
}

/// Multi-blade flapping that holds blade 1 at an angle β, with no rate.
fn held(azimuth: f64, beta: f64) -> [f64; 2] {
    [beta * azimuth.cos(), beta * azimuth.sin()]
}

/// Eq. 54 in vacuum: β'' = −(Ω² + k/I)β + 2Ω(p cos ψ − q sin ψ) + p' sin ψ +
/// q' cos ψ, with I of Eq. 55, for the printed blade with its precone and
/// undersling. The printed equation takes the blades as a thin line through
/// the hinge; the exact factor of Ω² and of 2Ω is off 1 by the ratio of the
/// blades' second moments along the shaft and along the span, 2e-4 here.
#[test]
fn val_teeter_equation_of_the_paper_in_vacuum() {
    let mut description = problem("coax2d").rotors[1].clone();
    (description.cant, description.tilt) = (0.0, 0.0);
    description.chord = constant(0.0);
    let spring = 5000.0;
    let undersling = 0.2 * 0.3048;
    description.hub_kind = HubKind::Teetering { undersling, spring: 0.0, delta_3: 0.0 };
    let free = built(&description);
    description.hub_kind = HubKind::Teetering { undersling, spring, delta_3: 0.0 };
    let sprung = built(&description);
    let d = &description;
    let (m, first, second) = (d.blade_mass, d.blade_first_moment, d.blade_second_moment);
    // Eq. 55.
    let inertia = 2.0
        * second
        * (1.0 - 2.0 * undersling * first * d.precone.sin() / second
            + undersling * undersling * m / second);
    let along_shaft = inertia - 2.0 * second * d.precone.cos().powi(2);
    let along_span = inertia - along_shaft;
    let thin = (along_span - along_shaft) / inertia;
    assert!((thin - 1.0).abs() < 1e-3, "the printed equation is nearly exact: {thin}");
    let omega = free.speed;
    for azimuth in [0.0, 0.7, 2.5, 4.4] {
        let (s, c) = f64::sin_cos(azimuth);
        let by_beta =
            |rotor: &Rotor| teeter_slope(rotor, azimuth, |i, h| i.flapping = held(azimuth, h));
        close(by_beta(&free), -omega * omega * thin, 1e-6, "centrifugal stiffness");
        close(by_beta(&sprung) - by_beta(&free), -spring / inertia, 1e-5, "spring, Eq. 55");
        let by_p = teeter_slope(&free, azimuth, |i, h| i.rate_hub.0[0] = h);
        let by_q = teeter_slope(&free, azimuth, |i, h| i.rate_hub.0[1] = h);
        let gyroscopic = omega * (1.0 + thin);
        assert!((by_p - gyroscopic * c).abs() < 1e-6 * omega, "p: {by_p}");
        assert!((by_q + gyroscopic * s).abs() < 1e-6 * omega, "q: {by_q}");
        // Angular acceleration of the hub.
        let blades = free.hub_to_blades(0.0, &shaft(&free, azimuth));
        let still = Vec3([0.0; 3]);
        let by_acceleration = |axis: usize| {
            let mut unit = [0.0; 3];
            unit[axis] = 1.0;
            free.acceleration_loads(&blades, still, Vec3(unit)).2
        };
        assert!((by_acceleration(0) - s).abs() < 1e-12);
        assert!((by_acceleration(1) - c).abs() < 1e-12);
        assert!(by_acceleration(2).abs() < 1e-12);
    }
}

/// The equation for small angles is the exact one without the airframe's yaw
/// rate r in the restoring moment: they part by 2 Ω r β, and by the thin line
/// of the test above.
#[test]
fn small_angle_teeter_equation_forgets_the_yaw_rate() {
    let mut description = problem("coax2d").rotors[1].clone();
    (description.cant, description.tilt) = (0.0, 0.0);
    let exact = built(&description);
    let formulation =
        Formulation { teeter_equation: TeeterEquation::SmallAngles, ..Formulation::EXACT };
    let air = Air::at(&SEA_LEVEL);
    let small = Rotor::new(&description, &formulation, &ORIGIN, &air).unwrap();
    let omega = exact.speed;
    let beta = 1e-3;
    for azimuth in [0.3, 1.9, 4.0] {
        let apart = |yaw: f64| {
            let change = |input: &mut RotorInput<f64>| {
                input.flapping = held(azimuth, beta);
                input.rate_hub.0[2] = yaw;
            };
            teeter_acceleration(&exact, azimuth, change)
                - teeter_acceleration(&small, azimuth, change)
        };
        let yaw = 0.5;
        let by_yaw = (apart(yaw) - apart(-yaw)) / (2.0 * yaw);
        close(by_yaw, 2.0 * omega * beta, 1e-3, "yaw rate");
        assert!(apart(0.0).abs() < 1e-3 * omega * omega * beta, "{}", apart(0.0));
    }
    // The air and the hub's moments do not know of it.
    let mut moving = at_rest();
    (moving.flapping, moving.pitch[0]) = ([-0.07, 0.02], 0.2);
    (moving.rate_hub.0, moving.velocity_hub.0) = ([0.1, -0.2, 0.3], [5.0, 2.0, -1.0]);
    let [one, other] = [&exact, &small].map(|rotor| loads(rotor, &moving, 0.7));
    assert_ne!(one.teeter_acceleration, other.teeter_acceleration);
    assert_eq!(one.moment_hub.0, other.moment_hub.0);
    assert_eq!(one.thrust_coefficient, other.thrust_coefficient);
}

/// A teetering rotor in vacuum on a fixed hub flaps once a turn exactly: its
/// disk stays where it is, to the cube of the angle. When the hub turns, the
/// disk does not: it lags at the rate of the hub.
#[test]
fn disk_in_vacuum_is_a_gyroscope() {
    let mut description = teetering(1, 0.0, 0.0);
    description.chord = constant(0.0);
    let rotor = built(&description);
    let flapping_rates = |input: &RotorInput<f64>, azimuth: f64| {
        let shaft = shaft(&rotor, azimuth);
        let teeter = rotor.teeter(&input.flapping, &shaft);
        rotor.flapping_rates(teeter, rotor.loads(input, &shaft).teeter_acceleration, &shaft)
    };
    let drift = |size: f64| {
        (0..24)
            .map(|k| {
                let input = RotorInput { flapping: [size, -0.6 * size], ..at_rest() };
                let [a, b] = flapping_rates(&input, TAU * f64::from(k) / 24.0);
                a.hypot(b) / rotor.speed
            })
            .fold(0.0, f64::max)
    };
    // β − sin β cos β = 2/3 β³, and |β| is at most 1.17 of the size.
    assert!(drift(0.1) < 0.7 * 0.117_f64.powi(3), "{}", drift(0.1));
    let ratio = drift(0.1) / drift(0.05);
    assert!((ratio - 8.0).abs() < 0.1, "not a cube: {ratio}");
    // Rates of roll and pitch: mean rates of β_1s and β_1c are p and q. At
    // β_1c > 0 the disk leans forward, as a hub that pitches up leaves it.
    let (p, q) = (0.3, -0.2);
    let mut mean = [0.0; 2];
    for k in 0..24 {
        let input = RotorInput { rate_hub: Vec3([p, q, 0.0]), ..at_rest() };
        let rates = flapping_rates(&input, TAU * f64::from(k) / 24.0);
        for (sum, rate) in mean.iter_mut().zip(rates) {
            *sum += rate / 24.0;
        }
    }
    assert!((mean[0] - q).abs() < 1e-12, "β_1c' = {}", mean[0]);
    assert!((mean[1] - p).abs() < 1e-12, "β_1s' = {}", mean[1]);
}

/// Hover flapping with a lifting, dragless blade: damping γΩ/8, stiffness
/// Ω² + k/I − (γ/8)Ω² tan δ3 (pitch rises by β tan δ3), and cyclic drives it
/// by (γ/8)Ω².
#[test]
fn val_flapping_frequency_and_damping() {
    let (spring, delta_3) = (2500.0, -0.35_f64);
    let air = Air::at(&SEA_LEVEL);
    let description = teetering(1000, spring, delta_3);
    let (inertia, chord) = (description.blade_second_moment, description.chord.value[0]);
    let lock = air.density * SLOPE * chord * description.radius.powi(4) / inertia;
    let coupled = built(&description);
    let uncoupled = built(&teetering(1000, spring, 0.0));
    let omega = coupled.speed;
    let eighth = lock / 8.0 * omega * omega;
    for azimuth in [0.0, 1.3, 3.9] {
        let by_beta =
            |rotor: &Rotor| teeter_slope(rotor, azimuth, |i, h| i.flapping = held(azimuth, h));
        let stiffness = -(omega * omega + spring / (2.0 * inertia));
        close(by_beta(&uncoupled), stiffness, 2e-6, "stiffness with a spring");
        let with_coupling = stiffness + eighth * delta_3.tan();
        close(by_beta(&coupled), with_coupling, 2e-6, "stiffness with δ3");
        // Blade 1 level, with rate h: flapping a quarter turn on.
        let (s, c) = f64::sin_cos(azimuth);
        let damping = teeter_slope(&uncoupled, azimuth, |i, h| {
            i.flapping = [-h * s / omega, h * c / omega];
        });
        close(damping, -eighth / omega, 2e-6, "damping");
        let by_cosine = teeter_slope(&uncoupled, azimuth, |i, h| i.pitch[1] = h);
        let by_sine = teeter_slope(&uncoupled, azimuth, |i, h| i.pitch[2] = h);
        assert!((by_cosine - eighth * c).abs() < 2e-6 * eighth, "θ_1c: {by_cosine}");
        assert!((by_sine - eighth * s).abs() < 2e-6 * eighth, "θ_1s: {by_sine}");
        let by_collective = teeter_slope(&uncoupled, azimuth, |i, h| i.pitch[0] = h);
        assert!(by_collective.abs() < 1e-9 * eighth, "collective moves both blades alike");
    }
}

/// Flapping and feathering are one: in hover the disk settles at β_1s = θ_1c,
/// β_1c = −θ_1s, where it feels nothing, at any azimuth.
#[test]
fn disk_follows_the_swashplate() {
    let rotor = built(&teetering(200, 0.0, 0.0));
    for size in [1e-3, 2e-3] {
        for azimuth in [0.2, 1.5, 3.3] {
            let input = RotorInput {
                pitch: [0.0, 0.7 * size, -0.4 * size],
                flapping: [0.4 * size, 0.7 * size],
                ..at_rest()
            };
            let shaft = shaft(&rotor, azimuth);
            let teeter = rotor.teeter(&input.flapping, &shaft);
            let acceleration = rotor.loads(&input, &shaft).teeter_acceleration;
            let rates = rotor.flapping_rates(teeter, acceleration, &shaft);
            // Dropped: terms of third order, with a factor of Ω and γ/8.
            let third = rotor.speed * size.powi(3);
            assert!(rates[0].hypot(rates[1]) < 2.0 * third, "{rates:?} of {third:.1e}");
        }
    }
}

/// A swashplate set ahead by Δ does what cyclic turned back by Δ does.
#[test]
fn swashplate_phase_turns_the_cyclic() {
    let phase = 0.37_f64;
    let table = problem("coax2d").rotors[1].clone();
    let straight = built(&table);
    let turned = built(&problem::Rotor { swashplate_phase: phase, ..table });
    let (s, c) = phase.sin_cos();
    let (cosine, sine) = (0.021, -0.034);
    for azimuth in [0.1, 2.2, 5.0] {
        let input = |pitch| RotorInput {
            velocity_hub: Vec3([25.0, 3.0, -1.0]),
            rate_hub: Vec3([0.1, 0.2, -0.1]),
            air_rate_hub: [0.03, -0.02, 0.05],
            flapping: [0.02, 0.01],
            inflow: [0.03, 0.01, 0.0],
            pitch,
        };
        let a = loads(&turned, &input([0.15, cosine, sine]), azimuth);
        let pitch = [0.15, cosine * c - sine * s, cosine * s + sine * c];
        let b = loads(&straight, &input(pitch), azimuth);
        for k in 0..3 {
            assert!((a.force_hub.0[k] - b.force_hub.0[k]).abs() < 1e-8);
            assert!((a.moment_hub.0[k] - b.moment_hub.0[k]).abs() < 1e-8);
        }
        assert!((a.teeter_acceleration - b.teeter_acceleration).abs() < 1e-9);
    }
}

/// What leaves the shaft arrives in the air: on a rotor that is rigid and at
/// rest, shaft power is profile power plus induced power plus the power of
/// the force that it carries the aircraft with, instant by instant.
#[test]
fn shaft_power_of_a_rigid_rotor_is_what_the_air_takes() {
    let mut description = problem("coax2d").rotors[0].clone();
    description.hub_kind = HubKind::Rigid;
    let rotor = built(&description);
    for azimuth in [0.0, 0.8, 2.3] {
        let velocity = [22.0, -3.0, 1.5];
        let input = RotorInput {
            velocity_hub: Vec3(velocity),
            rate_hub: Vec3([0.0; 3]),
            air_rate_hub: [0.0; 3],
            flapping: [0.0; 2],
            inflow: [0.03, 0.012, -0.007],
            pitch: [0.16, 0.01, -0.03],
        };
        let shaft = shaft(&rotor, azimuth);
        let out = rotor.loads(&input, &shaft);
        let power = rotor.blade_power(&input, &shaft);
        // Loads of the same blades without air: inertia alone.
        let idle = built(&problem::Rotor { chord: constant(0.0), ..description.clone() })
            .loads(&input, &shaft);
        let carried: f64 =
            (0..3).map(|k| (out.force_hub.0[k] - idle.force_hub.0[k]) * velocity[k]).sum();
        let torque = (out.moment_hub.0[2] - idle.moment_hub.0[2]) * rotor.speed;
        close(torque, power.profile + power.induced + carried, 1e-11, "power");
    }
}

// --- Wings and fuselages ---------------------------------------------------------

const SPEED: f64 = 40.0;

fn wing(cant: f64, dihedral: f64, model: WingModel) -> problem::Wing {
    problem::Wing {
        name: "wing".to_owned(),
        aerodynamic_center: ORIGIN,
        span: 6.0,
        chord: constant(1.2),
        incidence: 0.0,
        incidence_schedule: None,
        dynamic_pressure: None,
        surface: None,
        cant,
        dihedral,
        model,
        wash: Wash::None,
    }
}

fn strips(induced_angle: bool) -> WingModel {
    WingModel::Elements { elements: 10, airfoil: analytic(SLOPE, 0.01), induced_angle }
}

fn wing_loads(wing: &problem::Wing, velocity: [f64; 3], rate: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let wing = Wing::new(wing, &ORIGIN, &Air::at(&SEA_LEVEL)).unwrap();
    let (force, moment) = wing.loads(Vec3(velocity), Vec3(rate), None, |_| None);
    (force.0, moment.0)
}

/// C_L and C_D of a level wing at an angle of attack.
fn coefficients(wing: &problem::Wing, alpha: f64) -> [f64; 2] {
    let (s, c) = alpha.sin_cos();
    let ([x, _, z], _) = wing_loads(wing, [SPEED * c, 0.0, SPEED * s], [0.0; 3]);
    let area = wing.span * wing.chord.value[0];
    let pressure = 0.5 * Air::at(&SEA_LEVEL).density * SPEED * SPEED * area;
    [(x * s - z * c) / pressure, -(x * c + z * s) / pressure]
}

/// Elliptic loading: lift slope a/(1 + a/(π AR)), induced drag C_L²/(π AR).
#[test]
fn val_finite_wing_lift_slope_and_induced_drag() {
    let aspect = 6.0 / 1.2;
    let finite = |oswald| WingModel::Finite {
        lift_slope: SLOPE,
        zero_lift_angle: -0.03,
        parasite_drag: 0.01,
        oswald,
        stall_angle: 0.3,
    };
    for (model, oswald, zero_lift) in
        [(strips(true), 1.0, 0.0), (finite(1.0), 1.0, -0.03), (finite(0.75), 0.75, -0.03)]
    {
        let wing = wing(0.0, 0.0, model);
        let slope = SLOPE / (1.0 + SLOPE / (PI * aspect * oswald));
        for alpha in [-0.1, 0.05, 0.15] {
            let [lift, drag] = coefficients(&wing, alpha);
            close(lift, slope * (alpha - zero_lift), 1e-12, "C_L");
            close(drag, 0.01 + lift * lift / (PI * aspect * oswald), 1e-12, "C_D");
        }
    }
    // Without the correction, the section's own.
    let [lift, drag] = coefficients(&wing(0.0, 0.0, strips(false)), 0.1);
    close(lift, SLOPE * 0.1, 1e-12, "C_L of the section");
    close(drag, 0.01, 1e-12, "C_D of the section");
    // Incidence adds to the angle of attack.
    let mut raised = wing(0.0, 0.0, strips(true));
    raised.incidence = 0.04;
    let [lift, _] = coefficients(&raised, 0.05);
    let [expected, _] = coefficients(&wing(0.0, 0.0, strips(true)), 0.09);
    close(lift, expected, 1e-12, "incidence");
}

/// A stalled finite wing is a flat plate: no lift broadside, drag both ways.
#[test]
fn stalled_wing_is_a_flat_plate() {
    let model = WingModel::Finite {
        lift_slope: SLOPE,
        zero_lift_angle: 0.0,
        parasite_drag: 0.01,
        oswald: 0.8,
        stall_angle: 0.25,
    };
    let wing = wing(0.0, 0.0, model);
    let [below, _] = coefficients(&wing, 0.19);
    let [beyond, _] = coefficients(&wing, 0.5);
    assert!(beyond < below, "lift falls in the stall");
    for side in [-1.0, 1.0] {
        let [lift, drag] = coefficients(&wing, side * FRAC_PI_2);
        assert!(lift.abs() < 1e-12 && drag > 1.0, "{lift} {drag}");
        let [_, backward] = coefficients(&wing, side * 3.0);
        assert!(backward > 0.0);
    }
    let (force, moment) = wing_loads(&wing, [0.0; 3], [0.0; 3]);
    assert_eq!((force, moment), ([0.0; 3], [0.0; 3]), "still air");
}

/// A fin aft of the centre of gravity: a slip to starboard pushes it to port,
/// and turns the nose into the wind; yawing is damped.
#[test]
fn fin_is_a_weathercock() {
    for model in [
        strips(true),
        WingModel::Finite {
            lift_slope: SLOPE,
            zero_lift_angle: 0.0,
            parasite_drag: 0.01,
            oswald: 1.0,
            stall_angle: 0.3,
        },
    ] {
        let mut fin = wing(FRAC_PI_2, 0.0, model);
        fin.aerodynamic_center.fuselage_station = 5.0;
        let slip = 0.05_f64;
        let velocity = [SPEED * slip.cos(), SPEED * slip.sin(), 0.0];
        let ([_, side, up], [_, _, yaw]) = wing_loads(&fin, velocity, [0.0; 3]);
        assert!(side < 0.0 && yaw > 0.0, "side {side}, yaw {yaw}");
        close(yaw, -5.0 * side, 1e-12, "arm");
        assert!(up.abs() < 1e-9 * side.abs());
        // As large as the lift of the same wing laid flat.
        let flat = wing(0.0, 0.0, fin.model.clone());
        let pressure =
            0.5 * Air::at(&SEA_LEVEL).density * SPEED * SPEED * fin.span * fin.chord.value[0];
        let [lift, drag] = coefficients(&flat, slip);
        let expected = -(lift * slip.cos() + drag * slip.sin()) * pressure;
        close(side, expected, 1e-9, "side force");
        let (_, [_, _, damping]) = wing_loads(&fin, [SPEED, 0.0, 0.0], [0.0, 0.0, 0.1]);
        assert!(damping < 0.0, "{damping}");
    }
}

/// In the wake of a fuselage a surface keeps the share of its loads that the
/// dynamic pressure keeps: by the angle of attack or the sideslip of the aircraft,
/// and all of them in hover, with tangents that are derivatives.
#[test]
fn a_surface_in_the_wake_of_a_fuselage_keeps_a_share_of_its_loads() {
    use coaxdesign::numerics::scalar::Dual;
    use coaxdesign::problem::{DynamicPressure, FlowAngle};
    let free = wing(0.0, 0.0, strips(true));
    let behind = |over| problem::Wing {
        dynamic_pressure: Some(DynamicPressure {
            over,
            angle: vec![-0.4, 0.0, 0.4],
            ratio: vec![1.0, 0.6, 0.8],
        }),
        ..free.clone()
    };
    let (attack, slip) = (behind(FlowAngle::Attack), behind(FlowAngle::Sideslip));
    let lift = |wing: &problem::Wing, velocity| wing_loads(wing, velocity, [0.0; 3]).0[2];
    let there = |v: f64| v * v / (v * v + 25.0);
    for (velocity, by_attack, by_slip) in [
        ([SPEED, 0.0, 1e-9], 0.6, 0.6),
        ([SPEED * 0.4_f64.cos(), 0.0, SPEED * 0.4_f64.sin()], 0.8, 0.6),
        ([SPEED * 0.6_f64.cos(), -SPEED * 0.6_f64.sin(), 0.1], 0.6, 1.0),
        ([-SPEED, 0.0, 4.0], 0.8, 0.6),
    ] {
        let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        for (wing, ratio) in [(&attack, by_attack), (&slip, by_slip)] {
            let share = 1.0 + (ratio - 1.0) * there(speed);
            let (kept, all) = (lift(wing, velocity), lift(&free, velocity));
            assert!((kept - share * all).abs() < 2e-3 * all.abs().max(1e-3), "{velocity:?}");
        }
    }
    let center = ORIGIN;
    let air = coaxdesign::vehicle::atmosphere::Air::at(&common::problem("coax2d").atmosphere);
    let built = Wing::new(&attack, &center, &air).unwrap();
    let at = [12.0, 1.0, 2.5];
    let velocity = [0, 1, 2].map(|k| Dual::<3>::variable(at[k], k));
    let exact = built.loads(Vec3(velocity), Vec3::default(), None, |_| None).0.0[2];
    for k in 0..3 {
        let side = |by: f64| {
            let mut moved = at;
            moved[k] += by;
            built.loads(Vec3(moved), Vec3::default(), None, |_| None).0.0[2]
        };
        let difference = (side(1e-5) - side(-1e-5)) / 2e-5;
        assert!((exact.d[k] - difference).abs() < 1e-4 * difference.abs().max(1.0), "{k}");
    }
    let rest = built.loads(Vec3([Dual::<3>::default(); 3]), Vec3::default(), None, |_| None).0.0;
    assert!(rest.iter().all(|f| f.v == 0.0 && f.d.iter().all(|d| d.is_finite())));
}

/// Dihedral rolls away from a slip; a wing damps roll, by strip theory
/// L_p = −ρ V a c b³/24 without the induced angle.
#[test]
fn val_dihedral_and_roll_damping() {
    let slip = [SPEED, 2.0, 0.0];
    let (_, [flat, ..]) = wing_loads(&wing(0.0, 0.0, strips(true)), slip, [0.0; 3]);
    let (_, [raised, ..]) = wing_loads(&wing(0.0, 0.1, strips(true)), slip, [0.0; 3]);
    let (_, [drooped, ..]) = wing_loads(&wing(0.0, -0.1, strips(true)), slip, [0.0; 3]);
    assert!(flat.abs() < 1e-9, "{flat}");
    assert!(raised < -1.0, "{raised}");
    assert!((raised + drooped).abs() < 1e-9 * raised.abs());

    let mut fine = wing(0.0, 0.0, strips(false));
    fine.model =
        WingModel::Elements { elements: 4, airfoil: analytic(SLOPE, 0.0), induced_angle: false };
    let h = 1e-4;
    let (_, [damping, ..]) = wing_loads(&fine, [SPEED, 0.0, 0.0], [h, 0.0, 0.0]);
    let density = Air::at(&SEA_LEVEL).density;
    let expected = -0.5 * density * SPEED * SLOPE * fine.chord.value[0] * fine.span.powi(3) / 12.0;
    close(damping / h, expected, 1e-5, "L_p");
}

/// Flat plates: −½ρSC|u|u on each axis, at the place where it acts.
#[test]
fn fuselage_plates() {
    let (area, coefficient) = ([1.3, 5.0, 4.7], [0.45, 1.0, 0.9]);
    let description = FuselageProblem {
        name: "airframe".to_owned(),
        position: Station { fuselage_station: 0.5, butt_line: 0.1, water_line: -0.2 },
        aerodynamics: FuselageAerodynamics::FlatPlate { area, drag_coefficient: coefficient },
        wash: Wash::None,
    };
    let air = Air::at(&SEA_LEVEL);
    let body = Fuselage::new(&description, &ORIGIN, &air);
    // Aft, starboard, below: where the place is in the body frame.
    let place = [-0.5, 0.1, 0.2];
    assert_eq!(body.position_body, place);
    let (velocity, rate) = ([30.0, -4.0, 2.0], [0.2, -0.1, 0.3]);
    let (force, moment) = body.loads(Vec3(velocity), Vec3(rate), None);
    let local = [
        velocity[0] + rate[1] * place[2] - rate[2] * place[1],
        velocity[1] + rate[2] * place[0] - rate[0] * place[2],
        velocity[2] + rate[0] * place[1] - rate[1] * place[0],
    ];
    let expected: Vec<f64> = (0..3)
        .map(|k| -0.5 * air.density * area[k] * coefficient[k] * local[k].abs() * local[k])
        .collect();
    for k in 0..3 {
        close(force.0[k], expected[k], 1e-13, "plate");
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        close(moment.0[k], place[i] * expected[j] - place[j] * expected[i], 1e-12, "moment");
    }
}

/// A fuselage table gives its own values at its nodes, holds them beyond its
/// edges, and is smooth between.
#[test]
fn fuselage_table_reproduces_its_nodes() {
    let table = common::fuselage_table();
    let description = FuselageProblem {
        name: "airframe".to_owned(),
        position: ORIGIN,
        aerodynamics: FuselageAerodynamics::Table(Arc::new(table.clone())),
        wash: Wash::None,
    };
    let air = Air::at(&SEA_LEVEL);
    let body = Fuselage::new(&description, &ORIGIN, &air);
    let at = |alpha: f64, slip: f64| {
        let (sa, ca) = alpha.sin_cos();
        let (ss, cs) = slip.sin_cos();
        let velocity = [SPEED * ca * cs, SPEED * ss, SPEED * sa * cs];
        let (force, moment) = body.loads(Vec3(velocity), Vec3([0.0; 3]), None);
        let pressure = 0.5 * air.density * SPEED * SPEED;
        let [x, y, z] = force.0.map(|f| f / pressure);
        let [l, m, n] = moment.0.map(|m| m / pressure);
        [x, y, z, l, m, n]
    };
    let columns = table.sideslip.len();
    for (i, &alpha) in table.angle_of_attack.iter().enumerate() {
        for (j, &slip) in table.sideslip.iter().enumerate() {
            for (k, value) in at(alpha, slip).iter().enumerate() {
                let node = table.loads[k][i * columns + j];
                assert!((value - node).abs() < 1e-12, "load {k} at {alpha}, {slip}");
            }
        }
    }
    let (edge, beyond) = (at(1.0, 0.9), at(1.3, 1.1));
    for (a, b) in edge.iter().zip(beyond) {
        assert!((a - b).abs() < 1e-12, "constant beyond the edges");
    }
    let (force, _) = body.loads(Vec3([0.0; 3]), Vec3([0.0; 3]), None);
    assert_eq!(force.0, [0.0; 3], "still air");
}

/// A rotor of the size of a UH-1's: two blades with 2,420 slug ft² about the
/// teeter hinge at 324 rpm, at 4.7° of flapping, without air. At constant speed
/// the mast carries I Ω² β² = 18,700 lb ft at twice a revolution and the hub a
/// mean moment of I Ω² β³/4; behind a soft drive train neither.
#[test]
fn val_a_soft_drive_train_carries_no_coriolis_torque() {
    let flap = 4.7_f64.to_radians();
    let mut description = teetering(4, 0.0, 0.0);
    description.airfoil = analytic(1e-9, 0.0);
    description.speed = 324.0 * TAU / 60.0;
    description.blade_second_moment = 0.5 * 2420.0 * 1.355_818;
    let amplitude = |drive_train: DriveTrain| {
        let rotor = built(&problem::Rotor { drive_train, ..description.clone() });
        let input = RotorInput { flapping: [flap, 0.0], ..at_rest() };
        let count = 72;
        let mut torque = 0.0_f64;
        let mut mean = [0.0; 3];
        for k in 0..count {
            let moment = loads(&rotor, &input, TAU * f64::from(k) / f64::from(count)).moment_hub.0;
            torque = torque.max(moment[2].abs());
            for (mean, now) in mean.iter_mut().zip(moment) {
                *mean += now / f64::from(count);
            }
        }
        (torque / 1.355_818, mean.map(|moment| moment / 1.355_818))
    };
    let (held, mean) = amplitude(DriveTrain::Held);
    println!("held: {held:.0} lb ft, mean {mean:.1?}");
    close(held, 18_700.0, 0.01, "torque at twice a revolution");
    close(mean[0].hypot(mean[1]), 0.25 * held * flap, 0.02, "mean moment");
    let (soft, mean) = amplitude(DriveTrain::Soft);
    println!("soft: {soft:.3} lb ft, mean {mean:.3?}");
    assert!(soft < 1.0 && mean.iter().all(|moment| moment.abs() < 1.0), "{soft} {mean:?}");
}
