//! Identities that the equations of motion must obey, whatever the aircraft:
//! exact derivatives, the period, the mirror, and the conservation laws of a
//! free system of rigid bodies.

mod common;

use coaxdesign::numerics::integration::{COOPER_VERNER_8, Integrator};
use coaxdesign::numerics::scalar::{Dual, Scalar, Vec3};
use coaxdesign::problem::{
    AzimuthModel, Direction, FuselageAerodynamics, Governor, HubKind, MassFlow, Problem,
    TotalInflow, Wash, WingModel,
};
use coaxdesign::vehicle::frames::body_to_hub;
use coaxdesign::vehicle::output::Output;
use coaxdesign::vehicle::{AirMotion, Layout, Vehicle, VehicleError};
use common::{constant, lively, mirror_signs, mirrored, problem, rates, vehicle};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Changes a problem and gives it a name for messages.
fn variant(base: &str, label: &str, change: impl FnOnce(&mut Problem)) -> Problem {
    let mut changed = common::coarsened(problem(base));
    change(&mut changed);
    changed.name = format!("{base}, {label}");
    changed
}

/// The three built-in problems, and one variant for each choice that takes
/// another path through the equations.
fn variants() -> Vec<Problem> {
    let as_it_is = |base| variant(base, "as it is", |_| {});
    vec![
        as_it_is("coax2d"),
        as_it_is("coax2d-appendix"),
        as_it_is("coax2d-physics"),
        variant("coax2d", "rigid rotors of three blades", |p| {
            *p = common::rigid_three_blades(p.clone());
        }),
        variant("coax2d", "governed rotors", |p| {
            for (rotor, time_constant) in p.rotors.iter_mut().zip([0.4, 0.7]) {
                rotor.governor = Some(Governor { time_constant });
            }
        }),
        variant("coax2d", "total mass flow, algebraic", |p| {
            p.inflow.mass_flow = MassFlow::Total;
            p.inflow.total_inflow = TotalInflow::Algebraic;
        }),
        variant("coax2d", "small angles", |p| {
            for rotor in &mut p.rotors {
                rotor.airfoil = common::small_angles(6.0, 0.01);
            }
        }),
        variant("coax2d", "hinge offsets, couplings and odd geometry", |p| {
            for (k, rotor) in p.rotors.iter_mut().enumerate() {
                rotor.hub_kind =
                    HubKind::Teetering { undersling: 0.05, spring: 900.0, delta_3: -0.4 };
                rotor.swashplate_phase = 0.2;
                rotor.azimuth_offset = 0.3 + 0.5 * k as f64;
                rotor.cant = 0.03;
                rotor.hub.butt_line = 0.1;
                rotor.tip_loss = 0.97;
                rotor.root_cutout = 0.15;
            }
            p.mass.i_xy = 20.0;
            p.mass.i_yz = -15.0;
            p.mass.center_of_gravity.butt_line = 0.04;
            // The general table of interference is slow to build.
            p.inflow.interactions = false;
        }),
        variant("coax2d", "articulated rotors of four blades", |p| {
            *p = common::articulated(p.clone(), 4);
        }),
        variant("coax2d", "articulated rotors of two blades", |p| {
            *p = common::articulated(p.clone(), 2);
        }),
        variant("coax2d", "hingeless rotors of five blades, governed", |p| {
            *p = common::articulated(p.clone(), 5);
            for rotor in &mut p.rotors {
                rotor.hub_kind = HubKind::Hingeless {
                    hinge_offset: 0.1,
                    frequency: 1.15,
                    damping: 20.0,
                    delta_3: 0.1,
                };
                rotor.governor = Some(Governor { time_constant: 0.5 });
            }
            p.inflow.interactions = false;
        }),
        variant("coax2d", "gimballed rotors of three blades, governed", |p| {
            *p = common::gimballed(p.clone(), 3);
            for rotor in &mut p.rotors {
                rotor.governor = Some(Governor { time_constant: 0.5 });
            }
            p.inflow.interactions = false;
        }),
        variant("coax2d", "fuselage tables, finite wings, wash that turns", |p| {
            p.fuselages[0].aerodynamics =
                FuselageAerodynamics::Table(Arc::new(common::fuselage_table()));
            p.fuselages[0].wash = Wash::AngleOnly;
            p.fuselages[0].position.fuselage_station = 0.7;
            for wing in &mut p.wings {
                wing.model = WingModel::Finite {
                    lift_slope: 5.7,
                    zero_lift_angle: -0.02,
                    parasite_drag: 0.01,
                    oswald: 0.8,
                    stall_angle: 0.25,
                };
                wing.wash = Wash::AngleOnly;
            }
        }),
    ]
}

/// Rates and output in air that moves.
#[inline(never)]
fn in_air(
    vehicle: &Vehicle,
    state: &[f64],
    effectors: &[f64],
    air: AirMotion,
) -> (Vec<f64>, Output) {
    let mut work = vehicle.workspace::<f64>();
    let mut rates = vec![0.0; vehicle.state_count()];
    vehicle.rates(0.8, state, effectors, air, &mut work, &mut rates);
    let output = vehicle.output(state, effectors, air, &work);
    (rates, output)
}

/// The same aircraft where there is no air: inertia, gravity and springs are
/// left.
fn airless(p: &Problem) -> Problem {
    let mut p = p.clone();
    p.wings.clear();
    p.fuselages.clear();
    p.inflow.interactions = false;
    for rotor in &mut p.rotors {
        rotor.chord = constant(0.0);
    }
    p
}

/// An aircraft that moves and turns with the air meets what a still one meets
/// in still air: every aerodynamic load is the same, and the accelerations
/// differ by what inertia alone makes of the motion. The latter comes from
/// the same aircraft without air.
#[test]
fn turning_with_the_air_is_inertia_alone() {
    for p in variants() {
        let (vehicle, void) = (vehicle(&p), vehicle(&airless(&p)));
        let (moving, effectors) = lively(&vehicle);
        let body = Layout::BODY;
        let air = AirMotion {
            velocity: [1.1, -0.6, 0.4],
            rate: [moving[body.rate], moving[body.rate + 1], moving[body.rate + 2]],
        };
        let mut still = moving.clone();
        for k in 0..3 {
            still[body.velocity + k] -= air.velocity[k];
            still[body.rate + k] = 0.0;
        }
        let both = |vehicle: &Vehicle| {
            let (with, loads) = in_air(vehicle, &moving, &effectors, air);
            let (without, same) = in_air(vehicle, &still, &effectors, AirMotion::default());
            let apart: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
            (apart, loads, same)
        };
        let ((apart, loads, same), (inertial, ..)) = (both(&vehicle), both(&void));
        let close = |a: f64, b: f64, size: f64, what: &str| {
            assert!((a - b).abs() <= 1e-10 * size, "{}: {what}: {a} and {b}", p.name);
        };
        for (k, state) in vehicle.layout.states.iter().enumerate() {
            if state.name.contains("lambda") {
                // The loads that drive the inflow are the air's alone.
                close(apart[k], 0.0, 1.0, &state.name);
            } else {
                close(apart[k], inertial[k], inertial[k].abs().max(1.0), &state.name);
            }
        }
        // It is not empty: turning has its inertial loads.
        assert!(inertial[..6].iter().any(|x| x.abs() > 0.1), "{}", p.name);
        for (a, b) in
            loads.wings.iter().chain(&loads.fuselages).zip(same.wings.iter().chain(&same.fuselages))
        {
            for k in 0..3 {
                close(a.force_body[k], b.force_body[k], 100.0, "force of a body");
                close(a.moment_body[k], b.moment_body[k], 100.0, "moment of a body");
            }
        }
        for (a, b) in loads.rotors.iter().zip(&same.rotors) {
            close(a.profile_power, b.profile_power, b.profile_power.abs(), "profile power");
            close(a.induced_power, b.induced_power, b.induced_power.abs(), "induced power");
        }
        close(loads.parasite_power, same.parasite_power, same.parasite_power.abs(), "parasite");
    }
}

/// Air that turns about a still aircraft is an aircraft that turns the other
/// way in still air, as far as the air goes; and it is felt by every rotor.
#[test]
fn air_that_turns_is_an_aircraft_that_turns() {
    for p in variants() {
        let vehicle = vehicle(&p);
        let (mut state, effectors) = lively(&vehicle);
        let body = Layout::BODY;
        let turning = [0.21, -0.14, 0.3];
        state[body.rate..body.rate + 3].copy_from_slice(&turning);
        let (aircraft, _) = in_air(&vehicle, &state, &effectors, AirMotion::default());
        state[body.rate..body.rate + 3].fill(0.0);
        let back = AirMotion { velocity: [0.0; 3], rate: turning.map(|rate| -rate) };
        let (air, _) = in_air(&vehicle, &state, &effectors, back);
        let (neither, _) = in_air(&vehicle, &state, &effectors, AirMotion::default());
        for places in &vehicle.layout.rotors {
            let mut felt = false;
            for k in 0..3 {
                let at = places.self_inflow.unwrap() + k;
                let (a, b) = (air[at], aircraft[at]);
                assert!((a - b).abs() < 1e-11, "{}: inflow {k}: {a} and {b}", p.name);
                felt |= (a - neither[at]).abs() > 1e-3;
            }
            assert!(felt, "{}: a rotor does not feel the air turn", p.name);
        }
    }
}

/// Width of the duals of these tests.
const WIDTH: usize = 8;

/// All columns of ∂rates/∂(state, effectors) by duals.
#[inline(never)]
fn exact_jacobian(
    vehicle: &Vehicle,
    azimuth: f64,
    state: &[f64],
    effectors: &[f64],
    wind: [f64; 3],
) -> Vec<Vec<f64>> {
    let n = state.len();
    let count = n + effectors.len();
    let mut columns = vec![vec![0.0; n]; count];
    let mut work = vehicle.workspace::<Dual<WIDTH>>();
    for first in (0..count).step_by(WIDTH) {
        let seed = |value: f64, index: usize| {
            if (first..first + WIDTH).contains(&index) {
                Dual::variable(value, index - first)
            } else {
                Dual::constant(value)
            }
        };
        let x: Vec<_> = state.iter().enumerate().map(|(k, &v)| seed(v, k)).collect();
        let u: Vec<_> = effectors.iter().enumerate().map(|(k, &v)| seed(v, n + k)).collect();
        let mut out = vec![Dual::<WIDTH>::default(); n];
        vehicle.rates(azimuth, &x, &u, wind, &mut work, &mut out);
        for (column, entries) in columns.iter_mut().enumerate().skip(first).take(WIDTH) {
            for (entry, rate) in entries.iter_mut().zip(&out) {
                *entry = rate.tangent(column - first);
            }
        }
    }
    columns
}

/// Every tangent of the rates, with every state and every blade control,
/// against central differences. A row is scaled by its largest entry in
/// scaled units; the step is 1e-5 of each scale, where rounding (1e-11) and
/// truncation (1e-10) are both far below the tolerance, and a breakpoint of
/// the airfoil table inside the step changes little.
#[test]
fn tangents_are_central_differences() {
    for p in variants() {
        let vehicle = vehicle(&p);
        let (state, effectors) = lively(&vehicle);
        let n = state.len();
        let scales: Vec<f64> = vehicle
            .layout
            .states
            .iter()
            .chain(&vehicle.layout.effectors)
            .map(|quantity| quantity.scale)
            .collect();
        let wind = [1.1, -0.6, 0.4];
        for azimuth in [0.7, 2.9] {
            let exact = exact_jacobian(&vehicle, azimuth, &state, &effectors, wind);
            let mut row_size = vec![0.0_f64; n];
            for (column, scale) in exact.iter().zip(&scales) {
                for (size, entry) in row_size.iter_mut().zip(column) {
                    *size = size.max((entry * scale).abs());
                }
            }
            let mut worst = (0.0, 0, 0);
            for (column, scale) in scales.iter().enumerate() {
                let h = 1e-5 * scale;
                let shifted = |sign: f64| {
                    let mut all: Vec<f64> = state.iter().chain(&effectors).copied().collect();
                    all[column] += sign * h;
                    rates(&vehicle, azimuth, &all[..n], &all[n..], wind)
                };
                let (up, down) = (shifted(1.0), shifted(-1.0));
                for row in 0..n {
                    let difference = (up[row] - down[row]) / (2.0 * h);
                    let error = (difference - exact[column][row]).abs() * scale / row_size[row];
                    assert!(error.is_finite(), "{}: row {row}, column {column}", p.name);
                    if error > worst.0 {
                        worst = (error, row, column);
                    }
                }
            }
            let (error, row, column) = worst;
            println!("{} at {azimuth}: worst {error:.1e} ({row}, {column})", p.name);
            assert!(
                error < 1e-6,
                "{} at {azimuth}: {error:.1e} in rate {} by number {column}",
                p.name,
                vehicle.layout.states[row].name,
            );
        }
    }
}

/// Duals and plain numbers give the same rates.
#[test]
fn duals_carry_the_plain_values() {
    for p in variants() {
        let vehicle = vehicle(&p);
        let (state, effectors) = lively(&vehicle);
        let plain = rates(&vehicle, 1.1, &state, &effectors, [0.0; 3]);
        let mut work = vehicle.workspace::<Dual<WIDTH>>();
        let x: Vec<Dual<WIDTH>> = state.iter().map(|&v| Dual::constant(v)).collect();
        let u: Vec<Dual<WIDTH>> = effectors.iter().map(|&v| Dual::constant(v)).collect();
        let mut out = vec![Dual::<WIDTH>::default(); state.len()];
        vehicle.rates(1.1, &x, &u, [0.0; 3], &mut work, &mut out);
        for (k, (a, b)) in plain.iter().zip(&out).enumerate() {
            // The loop of the algebraic inflow closes to 1e-14.
            let close = 1e-11 * a.abs().max(1.0);
            assert!((a - b.v).abs() <= close, "{}: state {k}: {a} and {}", p.name, b.v);
            assert_eq!(b.d, [0.0; WIDTH], "{}: a constant has no tangents", p.name);
        }
    }
}

/// One period on, the rates are the same. The argument of the sines grows by
/// the period, so their rounding (1e-16 · 9) comes through loads of some
/// 100 m/s² and rates of some 50 rad/s.
#[test]
fn rates_are_periodic() {
    for p in variants() {
        let vehicle = vehicle(&p);
        let (state, effectors) = lively(&vehicle);
        let turn = vehicle.period * vehicle.reference_speed;
        // Two- and three-bladed rotors at one speed: half and a third of a turn.
        let blades = p.rotors[0].blades as f64;
        // Neighbours of four articulated blades differ by their reactionless mode.
        let alternate = vehicle.layout.states.iter().any(|state| state.name.ends_with("beta_d"));
        let blades = if alternate { 0.5 * blades } else { blades };
        assert!((turn - TAU / blades).abs() < 1e-12, "{}: period {turn}", p.name);
        for azimuth in [0.0, 0.9, 2.4] {
            let here = rates(&vehicle, azimuth, &state, &effectors, [0.0; 3]);
            let there = rates(&vehicle, azimuth + turn, &state, &effectors, [0.0; 3]);
            let half = rates(&vehicle, azimuth + 0.5 * turn, &state, &effectors, [0.0; 3]);
            // A two-bladed teetering rotor has changed hands: multi-blade
            // flapping is the same, so the whole vehicle is.
            for (k, (a, b)) in here.iter().zip(&there).enumerate() {
                let close = 1e-11 * a.abs().max(1.0);
                assert!((a - b).abs() < close, "{}: rate {k}: {a} and {b}", p.name);
            }
            // And the period is not longer than it must be.
            let moved = here.iter().zip(&half).any(|(a, b)| (a - b).abs() > 1e-3);
            assert!(moved, "{}: the rates do not vary within the period", p.name);
        }
    }
}

/// Rotors whose speeds have a common period of several passages, and rotors
/// that have none.
#[test]
fn period_of_rotors_of_different_speeds() {
    let with_ratio = |ratio: f64| {
        let mut p = common::coarsened(problem("coax2d"));
        p.inflow.interactions = false;
        p.rotors[1].speed = p.rotors[0].speed * ratio;
        Vehicle::new(&p)
    };
    // Passages in the ratio 2 : 3, the slower one two to a turn.
    let vehicle = with_ratio(1.5).unwrap();
    assert!((vehicle.period * vehicle.reference_speed - TAU).abs() < 1e-12);
    let (state, effectors) = lively(&vehicle);
    let here = rates(&vehicle, 0.4, &state, &effectors, [0.0; 3]);
    let there = rates(&vehicle, 0.4 + TAU, &state, &effectors, [0.0; 3]);
    for (a, b) in here.iter().zip(&there) {
        assert!((a - b).abs() < 1e-11 * a.abs().max(1.0));
    }
    // Without a common period the faster one is averaged, and both cannot be
    // resolved.
    let vehicle = with_ratio(std::f64::consts::SQRT_2).unwrap();
    assert!(!vehicle.rotors[0].is_averaged() && vehicle.rotors[1].is_averaged());
    let mut p = common::coarsened(problem("coax2d"));
    p.rotors[1].speed *= std::f64::consts::SQRT_2;
    for rotor in &mut p.rotors {
        rotor.azimuth = Some(AzimuthModel::Resolved);
    }
    assert!(matches!(Vehicle::new(&p), Err(VehicleError::NoCommonPeriod { .. })));
}

/// Mirrored vehicle, mirrored flight: mirrored rates, to rounding.
#[test]
fn mirrored_vehicle_has_mirrored_rates() {
    let eight = variant("octo-x8", "eight rotors, all on all", |p| p.inflow.reach = 1000.0);
    for p in variants().into_iter().chain([eight]) {
        let (original, mirror) = (vehicle(&p), vehicle(&mirrored(&p)));
        let (state, effectors) = lively(&original);
        let signs = mirror_signs(&original);
        let flipped: Vec<f64> = state.iter().zip(&signs).map(|(x, s)| x * s).collect();
        // Blade controls live in each rotor's own mirrored frame: unchanged.
        for azimuth in [0.3, 1.9] {
            let a = rates(&original, azimuth, &state, &effectors, [1.0, -2.0, 0.5]);
            let b = rates(&mirror, azimuth, &flipped, &effectors, [1.0, 2.0, 0.5]);
            for (k, ((a, b), sign)) in a.iter().zip(&b).zip(&signs).enumerate() {
                let close = 1e-10 * a.abs().max(1.0);
                assert!((a - sign * b).abs() < close, "{}: rate {k}: {a} and {b}", p.name);
            }
        }
        // The mirrored mix gives the same blade controls for mirrored sticks.
        let (mut here, mut there) = (effectors.clone(), effectors);
        original.mix(&[3.0, -2.0, 40.0, 5.0], &mut here);
        mirror.mix(&[-3.0, -2.0, 40.0, -5.0], &mut there);
        assert_eq!(here, there, "{}", p.name);
    }
}

/// One rotor turned the other way, in a wind from the other side, makes the
/// mirrored loads.
#[test]
fn a_rotor_turned_the_other_way_makes_mirrored_loads() {
    let alone = |direction| {
        let mut p = common::coarsened(problem("coax2d"));
        p.rotors.truncate(1);
        p.controls.mix.truncate(1);
        p.controls.collective_limits.truncate(1);
        p.controls.cyclic_limits.truncate(1);
        p.wings.clear();
        p.fuselages.clear();
        p.rotors[0].direction = direction;
        vehicle(&p)
    };
    let (one, other) = (alone(Direction::CounterClockwise), alone(Direction::Clockwise));
    let (mut state, effectors) = lively(&one);
    state[..6].fill(0.0);
    let output = |vehicle: &Vehicle, wind: [f64; 3]| {
        let mut work = vehicle.workspace::<f64>();
        let mut rates = vec![0.0; vehicle.state_count()];
        vehicle.rates(0.8, &state, &effectors, wind, &mut work, &mut rates);
        (vehicle.output(&state, &effectors, wind, &work).rotors[0], rates)
    };
    // Wind from ahead, from port and from below.
    let (a, rates_a) = output(&one, [-20.0, 4.0, -1.0]);
    let (b, rates_b) = output(&other, [-20.0, -4.0, -1.0]);
    for (x, y) in
        a.force_hub.iter().chain(&a.moment_hub).zip(b.force_hub.iter().chain(&b.moment_hub))
    {
        assert!((x - y).abs() < 1e-9 * x.abs().max(1.0), "{x} and {y}");
    }
    assert!((a.power - b.power).abs() < 1e-9 * a.power.abs());
    // In the body frame yaw acceleration is opposite, heave the same.
    assert!((rates_a[5] + rates_b[5]).abs() < 1e-11);
    assert!((rates_a[2] - rates_b[2]).abs() < 1e-11);
    // The reaction of a rotor that turns counter-clockwise from above pushes
    // the nose to starboard.
    assert!(rates_a[5] > 0.1, "{}", rates_a[5]);
}

/// Rotors far apart feel nothing of each other: interference is nil, and inflow
/// is that of two rotors alone. The flow of the uniform circulation falls with
/// the cube of the distance, that of the harmonics only with the distance
/// itself (the theory keeps the rings of a wake and drops the vortices along
/// it), so "far" is a hundred thousand radii.
#[test]
fn distant_rotors_are_two_rotors_alone() {
    let apart = |sideways: f64, up: f64| {
        let mut p = common::coarsened(problem("coax2d"));
        p.rotors[0].hub.butt_line += sideways;
        p.rotors[0].hub.water_line += up;
        p.inflow.reach = f64::INFINITY;
        for rotor in &mut p.rotors {
            rotor.tilt = 0.0;
        }
        vehicle(&p)
    };
    let lone = |index: usize| {
        let mut p = common::coarsened(problem("coax2d"));
        p.rotors = vec![p.rotors[index].clone()];
        p.rotors[0].tilt = 0.0;
        p.controls.mix = vec![p.controls.mix[index]];
        p.controls.collective_limits.truncate(1);
        p.controls.cyclic_limits.truncate(1);
        vehicle(&p)
    };
    let lones = [lone(0), lone(1)];
    let vehicle = apart(325_000.0, 0.0);
    for (receiver, source) in [(0, 1), (1, 0)] {
        let table = vehicle.interference(receiver, source).unwrap();
        for skew in [[0.0, 0.0], [0.4, 0.1], [-0.3, 0.5], [0.0, -0.6]] {
            let g = table.evaluate(skew);
            assert!(g.amax() < 1e-5, "{receiver} {source} at {skew:?}: {g}");
        }
        assert!(table.evaluate([0.0, 0.0])[(0, 0)].abs() < 1e-12);
    }
    let (mut state, effectors) = lively(&vehicle);
    // Without turning, hubs at any place fly at the same speed.
    state[3..6].fill(0.0);
    for places in &vehicle.layout.rotors {
        // Total inflow as it settles.
        let start = places.total_inflow.unwrap();
        for k in 0..3 {
            state[start + k] = state[places.self_inflow.unwrap() + k];
        }
    }
    let together = rates(&vehicle, 0.6, &state, &effectors, [0.0; 3]);
    for (index, alone) in lones.iter().enumerate() {
        let places = vehicle.layout.rotors[index];
        let own = alone.layout.rotors[0];
        let mut x = state[..Layout::BODY.count].to_vec();
        let first = places.flapping.unwrap();
        x.extend(&state[first..first + 8]);
        let pitch = places.pitch.unwrap();
        let u = &effectors[pitch..pitch + 3];
        let single = rates(alone, 0.6, &x, u, [0.0; 3]);
        for k in 0..6 {
            let (a, b) =
                (together[places.self_inflow.unwrap() + k], single[own.self_inflow.unwrap() + k]);
            // Interference of 1e-5 on a circulation of 0.1, times 200 rad/s.
            assert!((a - b).abs() < 2e-4, "rotor {index}, inflow {k}: {a} and {b}");
        }
        for k in 0..3 {
            let (a, b) =
                (together[places.self_inflow.unwrap() + k], single[own.self_inflow.unwrap() + k]);
            assert!((a - b).abs() < 1e-9, "rotor {index}, own inflow {k}: {a} and {b}");
        }
    }
    // A rotor a thousand radii right above another feels nothing, and blows its
    // fully developed wake, twice its own inflow, on the one below.
    let stacked = apart(0.0, 3250.0);
    let on_upper = stacked.interference(0, 1).unwrap().evaluate([0.0, 0.0]);
    let on_lower = stacked.interference(1, 0).unwrap().evaluate([0.0, 0.0]);
    assert!(on_upper.amax() < 1e-5, "{on_upper}");
    // Γ_0 = 2 λ in hover: G_11 = 1 is twice the inflow.
    assert!((on_lower[(0, 0)] - 1.0).abs() < 1e-4, "{on_lower}");
}

// --- Conservation laws -----------------------------------------------------

/// A free aircraft in vacuum: no aerodynamic load at all.
fn in_vacuum(base: &str, change: impl FnOnce(&mut Problem)) -> Problem {
    let mut p = problem(base);
    p.wings.clear();
    p.fuselages.clear();
    p.inflow.interactions = false;
    for rotor in &mut p.rotors {
        rotor.chord = constant(0.0);
        rotor.elements = 1;
    }
    change(&mut p);
    p
}

type V3 = [f64; 3];

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn scale(a: V3, s: f64) -> V3 {
    a.map(|x| x * s)
}
fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Position (from the hub, body frame) of a point of a blade at radius `r`,
/// written down anew from the drawing of a teetering rotor: the blade is
/// attached `undersling` below the hinge, coned by `precone`, and tilts with
/// the teeter angle about the hinge.
fn blade_point<S: Scalar>(
    rotor: &coaxdesign::problem::Rotor,
    azimuth: S,
    flap: S,
    blade: usize,
    r: f64,
) -> Vec3<S> {
    let undersling = match rotor.hub_kind {
        HubKind::Teetering { undersling, .. } | HubKind::Gimballed { undersling, .. } => undersling,
        _ => 0.0,
    };
    let psi = azimuth + TAU * blade as f64 / rotor.blades as f64;
    let (sp, cp) = psi.sin_cos();
    let (sf, cf) = flap.sin_cos();
    let (sc, cc) = (flap + rotor.precone).sin_cos();
    // Outward along the disk, and up along the shaft.
    let out = cc * r + sf * undersling + rotor.hub_kind.hinge_offset();
    let up = sc * r - cf * undersling;
    // Blade 1 points aft at azimuth zero and moves to starboard if the rotor
    // turns counter-clockwise seen from above.
    let side = if rotor.direction == Direction::CounterClockwise { 1.0 } else { -1.0 };
    let in_hub = Vec3([-(out * cp), out * sp * side, -up]);
    let hub = body_to_hub(rotor.cant, rotor.tilt);
    in_hub.rotated_back(&hub)
}

/// Flap angle of a blade and its rate from the multi-blade states, written down
/// anew from their names.
fn flap(
    vehicle: &Vehicle,
    rotor: usize,
    x: &[f64],
    azimuth: f64,
    speed: f64,
    blade: usize,
) -> Dual<1> {
    let rotor = &vehicle.rotors[rotor];
    let psi = azimuth + TAU * blade as f64 / rotor.blades as f64;
    let state =
        |name: &str| vehicle.layout.state(&format!("{}.{name}", rotor.name)).map(|place| x[place]);
    let mut flap = Dual::<1> { v: 0.0, d: [0.0] };
    let alternating = if blade.is_multiple_of(2) { 1.0 } else { -1.0 };
    for (name, sign) in [("beta_0", 1.0), ("beta_d", alternating)] {
        if let (Some(angle), Some(rate)) = (state(name), state(&format!("{name}_rate"))) {
            flap.v += sign * angle;
            flap.d[0] += sign * rate;
        }
    }
    for n in 1..=5 {
        let (Some(c), Some(s)) = (state(&format!("beta_{n}c")), state(&format!("beta_{n}s")))
        else {
            continue;
        };
        let rates = [format!("beta_{n}c_rate"), format!("beta_{n}s_rate")];
        // Variation of constants leaves their own rates out.
        let [rate_c, rate_s] = rates.map(|name| state(&name).unwrap_or(0.0));
        let (sin, cos) = (n as f64 * psi).sin_cos();
        flap.v += c * cos + s * sin;
        let turn = n as f64 * speed;
        flap.d[0] += (rate_c + turn * s) * cos + (rate_s - turn * c) * sin;
    }
    flap
}

/// Momentum, angular momentum about a fixed point, energy: of airframe and
/// blades, seen from a freely falling observer.
struct Mechanics {
    momentum: V3,
    angular_momentum: V3,
    energy: f64,
}

/// Position, heading, and work of the shafts after the vehicle's own states.
const EXTRA: usize = 5;

fn mechanics(p: &Problem, vehicle: &Vehicle, time: f64, x: &[f64]) -> Mechanics {
    const GRAVITY: f64 = 9.806_65;
    let n = vehicle.state_count();
    let (position, heading) = ([x[n], x[n + 1], x[n + 2]], x[n + 3]);
    // Body to ground: yaw, pitch, roll.
    let (sf, cf) = x[6].sin_cos();
    let (st, ct) = x[7].sin_cos();
    let (sh, ch) = heading.sin_cos();
    let to_ground = |b: V3| {
        let (y, z) = (b[1] * cf - b[2] * sf, b[1] * sf + b[2] * cf);
        let (forward, down) = (b[0] * ct + z * st, z * ct - b[0] * st);
        [forward * ch - y * sh, forward * sh + y * ch, down]
    };
    let falling = |velocity: V3| add(velocity, [0.0, 0.0, -GRAVITY * time]);
    let center = add(position, [0.0, 0.0, -0.5 * GRAVITY * time * time]);
    let (velocity, rate) = ([x[0], x[1], x[2]], [x[3], x[4], x[5]]);
    let m = &p.mass;
    let spin = [
        m.i_xx * rate[0] - m.i_xy * rate[1] - m.i_xz * rate[2],
        m.i_yy * rate[1] - m.i_xy * rate[0] - m.i_yz * rate[2],
        m.i_zz * rate[2] - m.i_xz * rate[0] - m.i_yz * rate[1],
    ];
    let mut total = Mechanics {
        momentum: [0.0; 3],
        angular_momentum: to_ground(spin),
        energy: 0.5 * dot(spin, rate),
    };
    let mut point = |mass: f64, place: V3, velocity: V3| {
        let (place, velocity) = (add(center, to_ground(place)), falling(to_ground(velocity)));
        total.momentum = add(total.momentum, scale(velocity, mass));
        let turning = cross(place, scale(velocity, mass));
        total.angular_momentum = add(total.angular_momentum, turning);
        total.energy += 0.5 * mass * dot(velocity, velocity);
    };
    point(m.mass, [0.0; 3], velocity);
    let mut springs = 0.0;
    for (index, rotor) in p.rotors.iter().enumerate() {
        let places = &vehicle.layout.rotors[index];
        let (mut azimuth, mut speed) = (rotor.speed * time + rotor.azimuth_offset, rotor.speed);
        if let (Some(start), Some(lead)) = (places.speed, places.azimuth) {
            speed = x[start];
            azimuth += x[lead];
        }
        let flaps: Vec<Dual<1>> =
            (0..rotor.blades).map(|k| flap(vehicle, index, x, azimuth, speed, k)).collect();
        let azimuth = Dual::<1> { v: azimuth, d: [speed] };
        let shares = rotor.blades as f64 * if rotor.blades == 2 { 1.0 } else { 0.5 };
        let spring = match rotor.hub_kind {
            HubKind::Teetering { spring, .. } => spring / 2.0,
            HubKind::Gimballed { spring, .. } => spring / shares,
            _ => rotor.flap_spring(),
        };
        springs += flaps.iter().map(|flap| 0.5 * spring * flap.v * flap.v).sum::<f64>();
        let hub = vehicle.rotors[index].position_body;
        let hub_velocity = add(velocity, cross(rate, hub));
        // The airframe counts the blades as points at the hub: take them out.
        point(-rotor.blade_mass * rotor.blades as f64, hub, hub_velocity);
        // Three weights on the blade with its mass and first two moments. They
        // may be negative: the printed blade has I m < M².
        let radius = rotor.radius;
        let (first, second) =
            (rotor.blade_first_moment / radius, rotor.blade_second_moment / (radius * radius));
        let tip = 2.0 * second - first;
        let middle = 2.0 * (first - tip);
        let root = rotor.blade_mass - middle - tip;
        for (blade, &flap) in flaps.iter().enumerate().take(rotor.blades) {
            for (mass, r) in [(root, 0.0), (middle, 0.5 * radius), (tip, radius)] {
                let place = blade_point(rotor, azimuth, flap, blade, r).0;
                let from_center = add(hub, place.map(|c| c.v));
                let relative = place.map(|c| c.d[0]);
                let moving = add(velocity, add(cross(rate, from_center), relative));
                point(mass, from_center, moving);
            }
        }
    }
    total.energy += springs;
    total
}

/// Flies a free aircraft in vacuum and compares what must be conserved.
fn assert_conserved(p: &Problem) {
    let vehicle = vehicle(p);
    let n = vehicle.state_count();
    let (lively, mut effectors) = lively(&vehicle);
    let mut x = vec![0.0; n + EXTRA];
    x[..8].copy_from_slice(&[5.0, -3.0, 2.0, 0.4, -0.3, 0.5, 0.2, -0.1]);
    for (rotor, places) in vehicle.rotors.iter().zip(&vehicle.layout.rotors) {
        let [start, angles, rates] = places.flap;
        x[start..start + angles].copy_from_slice(&[0.06, -0.04, 0.03, -0.02, 0.01][..angles]);
        let moving = start + angles;
        x[moving..moving + rates].copy_from_slice(&[0.5, 0.9, -0.4, 0.3, -0.6][..rates]);
        if let Some(start) = places.speed {
            x[start] = lively[start];
            x[start + 1] = lively[start + 1];
            effectors[places.command.unwrap()] = rotor.speed + 2.0;
        }
    }
    let mut integrator = Integrator::<f64>::new(COOPER_VERNER_8, n + EXTRA);
    let mut work = vehicle.workspace::<f64>();
    let start = mechanics(p, &vehicle, 0.0, &x);
    let (turns, per_turn) = (3, 60);
    let step = TAU / vehicle.reference_speed / f64::from(per_turn);
    for k in 0..turns * per_turn {
        integrator.step(f64::from(k) * step, step, &mut x, |time, x, out| {
            let azimuth = time * vehicle.reference_speed;
            let (state, rates) = (&x[..n], &mut out[..n]);
            vehicle.rates(azimuth, state, &effectors, [0.0; 3], &mut work, rates);
            let output = vehicle.output(state, &effectors, [0.0; 3], &work);
            let [turn, forward, right, down] = vehicle.navigation(state);
            let (sh, ch) = x[n + 3].sin_cos();
            out[n] = forward * ch - right * sh;
            out[n + 1] = forward * sh + right * ch;
            out[n + 2] = down;
            out[n + 3] = turn;
            out[n + 4] = output.rotors.iter().map(|rotor| rotor.power).sum();
        });
    }
    let time = f64::from(turns * per_turn) * step;
    let end = mechanics(p, &vehicle, time, &x);
    let work_done = x[n + 4];
    let largest = |v: V3| v.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let difference = |a: V3, b: V3| largest(add(a, scale(b, -1.0)));
    let momentum = difference(start.momentum, end.momentum) / largest(start.momentum);
    let angular =
        difference(start.angular_momentum, end.angular_momentum) / largest(start.angular_momentum);
    let energy = (end.energy - start.energy - work_done).abs() / start.energy;
    println!(
        "{}: momentum {momentum:.1e}, angular momentum {angular:.1e}, energy {energy:.1e} (shaft \
         work {:.1e})",
        p.name,
        work_done / start.energy
    );
    // It did move: teetering and shaft work are not trivial.
    assert!(work_done.abs() > 1e-6 * start.energy, "{}: shaft work {work_done}", p.name);
    assert!(momentum < 1e-10, "{}: momentum drifts by {momentum:.1e}", p.name);
    assert!(angular < 1e-10, "{}: angular momentum drifts by {angular:.1e}", p.name);
    assert!(energy < 1e-10, "{}: energy drifts by {energy:.1e}", p.name);
}

/// Newton's third law through every hinge: in vacuum and free fall, momentum
/// and angular momentum of airframe and blades together are constant, and the
/// energy grows by the work of the shafts. The quantities are computed from
/// the positions of mass points alone, so this tests the mass matrix, the
/// teeter equation, the hub loads and every mirrored frame at once.
#[test]
fn free_flight_in_vacuum_conserves() {
    let named = |label: &str, mut p: Problem| {
        p.name = label.to_owned();
        p
    };
    let springs = |p: &mut Problem| {
        for rotor in &mut p.rotors {
            rotor.hub_kind = HubKind::Teetering { undersling: 0.1, spring: 3000.0, delta_3: 0.3 };
            rotor.cant = 0.05;
            rotor.azimuth_offset = 0.4;
            rotor.hub.butt_line += 0.3;
        }
        p.mass.i_xy = 30.0;
        p.mass.i_yz = -25.0;
    };
    let govern = |p: &mut Problem| {
        for rotor in &mut p.rotors {
            rotor.governor = Some(Governor { time_constant: 0.2 });
        }
    };
    let lossless = |p: &mut Problem| {
        for rotor in &mut p.rotors {
            match &mut rotor.hub_kind {
                HubKind::Articulated { damping, .. } | HubKind::Gimballed { damping, .. } => {
                    *damping = 0.0;
                }
                _ => {}
            }
        }
    };
    for p in [
        named("teetering", in_vacuum("coax2d", |_| {})),
        named("springs, cant and offsets", in_vacuum("coax2d", springs)),
        named("governed", in_vacuum("coax2d", govern)),
        named(
            "rigid, three blades",
            in_vacuum("coax2d", |p| {
                *p = common::rigid_three_blades(p.clone());
                // Equal rotors turned opposite ways do no work together.
                p.rotors[1].blade_second_moment *= 1.5;
            }),
        ),
        named(
            "articulated, four blades",
            in_vacuum("coax2d", |p| {
                *p = common::articulated(p.clone(), 4);
                lossless(p);
                p.rotors[1].blade_second_moment *= 1.5;
            }),
        ),
        named(
            "articulated, two blades, governed, and hingeless, five",
            in_vacuum("coax2d", |p| {
                *p = common::articulated(p.clone(), 2);
                lossless(p);
                govern(p);
                p.rotors[1].blades = 5;
                p.rotors[1].blade_mass *= 0.4;
                p.rotors[1].hub_kind = HubKind::Hingeless {
                    hinge_offset: 0.12,
                    frequency: 1.2,
                    damping: 0.0,
                    delta_3: 0.0,
                };
            }),
        ),
        named(
            "gimballed, three blades, governed, and two",
            in_vacuum("coax2d", |p| {
                *p = common::gimballed(p.clone(), 3);
                lossless(p);
                govern(p);
                p.rotors[1].blades = 2;
                p.rotors[1].azimuth_offset = 0.4;
            }),
        ),
        named(
            "rigid, two blades, governed",
            in_vacuum("coax2d", |p| {
                govern(p);
                p.rotors[0].hub_kind = HubKind::Rigid;
            }),
        ),
    ] {
        assert_conserved(&p);
    }
}

/// Attitude kinematics: the velocity over the ground has the length of the
/// velocity, and a level turn turns the heading at r / cos φ.
#[test]
fn navigation_is_a_rotation() {
    let vehicle = vehicle(&in_vacuum("coax2d", |_| {}));
    let mut state = vec![0.0; vehicle.state_count()];
    state[..8].copy_from_slice(&[30.0, 2.0, -4.0, 0.2, 0.1, 0.3, 0.4, -0.2]);
    let [_, forward, right, down] = vehicle.navigation(&state);
    let speed = (30.0_f64 * 30.0 + 4.0 + 16.0).sqrt();
    assert!(((forward * forward + right * right + down * down).sqrt() - speed).abs() < 1e-12);
    // A steady turn at 0.3 rad/s, banked, nose level.
    let (turn, bank) = (0.3, PI / 6.0);
    state[3..8].copy_from_slice(&[0.0, turn * bank.sin(), turn * bank.cos(), bank, 0.0]);
    assert!((vehicle.navigation(&state)[0] - turn).abs() < 1e-15);
}
