//! Hubs by theory: flap frequencies and damping of articulated blades, the
//! gimbal of two blades that is a teeter hinge, averages over the azimuth.

mod common;

use coaxdesign::numerics::scalar::{Dual, Scalar};
use coaxdesign::problem::{AzimuthModel, Governor, HubKind, Problem};
use coaxdesign::vehicle::Vehicle;
use common::{analytic, constant, lively, problem, rates, vehicle};
use std::f64::consts::TAU;

/// One rotor on an airframe so heavy that it stands still, without air.
fn on_a_rock(hub_kind: HubKind) -> Problem {
    let mut p = problem("coax2d");
    p.rotors.truncate(1);
    p.controls.mix.truncate(1);
    p.controls.collective_limits.truncate(1);
    p.controls.cyclic_limits.truncate(1);
    p.wings.clear();
    p.fuselages.clear();
    p.inflow.interactions = false;
    let mass = &mut p.mass;
    mass.mass *= 1e9;
    for moment in [&mut mass.i_xx, &mut mass.i_yy, &mut mass.i_zz] {
        *moment *= 1e9;
    }
    let rotor = &mut p.rotors[0];
    rotor.hub_kind = hub_kind;
    rotor.blades = 4;
    rotor.precone = 0.0;
    rotor.chord = constant(0.0);
    rotor.elements = 200;
    p
}

fn articulated(hinge_offset: f64, spring: f64, damping: f64) -> HubKind {
    HubKind::Articulated { hinge_offset, spring, damping, delta_3: 0.0 }
}

/// Slope of the rate of one state with another about rest.
fn slope(p: &Problem, of: &str, with: &str) -> f64 {
    let vehicle = vehicle(p);
    let name = |state: &str| format!("{}.{state}", p.rotors[0].name);
    let place = |state: &str| vehicle.layout.state(&name(state)).unwrap();
    let (of, with) = (place(of), place(with));
    let mut state = vec![Dual::<1>::default(); vehicle.state_count()];
    state[with] = Dual::variable(0.0, 0);
    let effectors = vec![Dual::<1>::default(); vehicle.effector_count()];
    let mut work = vehicle.workspace::<Dual<1>>();
    let mut out = vec![Dual::<1>::default(); state.len()];
    vehicle.rates(0.3, &state, &effectors, [0.0; 3], &mut work, &mut out);
    out[of].tangent(0)
}

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (value / expected - 1.0).abs();
    assert!(error < tolerance, "{what}: {value}, expected {expected}, off by {error:.1e}");
}

/// A blade without offset and spring flaps once a revolution; offset and spring
/// raise that to √(1 + e M/I + K/(I Ω²)), in coning and against its neighbours;
/// a hingeless blade has the frequency that it was asked for.
#[test]
fn val_flap_frequencies_in_vacuum() {
    for (offset, spring) in [(0.0, 0.0), (0.2, 0.0), (0.2, 5e3)] {
        let p = on_a_rock(articulated(offset, spring, 0.0));
        let rotor = &p.rotors[0];
        let (first, second, speed) =
            (rotor.blade_first_moment, rotor.blade_second_moment, rotor.speed);
        let square = 1.0 + offset * first / second + spring / (second * speed * speed);
        for mode in ["beta_0", "beta_d"] {
            let stiffness = -slope(&p, &format!("{mode}_rate"), mode) / (speed * speed);
            close(stiffness, square, 1e-7, mode);
        }
        // The disk as a whole, in the frame at rest: ν² − 1 and twice the speed.
        let disk = slope(&p, "beta_1c_rate", "beta_1c") / (speed * speed);
        assert!((disk - (1.0 - square)).abs() < 1e-7, "{disk}");
        close(slope(&p, "beta_1c_rate", "beta_1s_rate"), -2.0 * speed, 1e-7, "gyroscopic");
        close(rotor.flap_frequency().unwrap(), square.sqrt(), 1e-12, "as told");
    }
    let hingeless =
        HubKind::Hingeless { hinge_offset: 0.1, frequency: 1.12, damping: 0.0, delta_3: 0.0 };
    let p = on_a_rock(hingeless);
    let stiffness = -slope(&p, "beta_0_rate", "beta_0") / p.rotors[0].speed.powi(2);
    close(stiffness.sqrt(), 1.12, 1e-7, "hingeless");
}

/// Air damps a flapping blade by γΩ/8 (Lock), an offset by the moment of r²(r − e)
/// in place of r⁴/4; a damper adds C/I.
#[test]
fn val_flap_damping_is_the_lock_number() {
    for (offset, damper) in [(0.0, 0.0), (0.2, 0.0), (0.2, 40.0)] {
        let mut p = on_a_rock(articulated(offset, 0.0, damper));
        let density = vehicle(&p).air.density;
        let rotor = &mut p.rotors[0];
        rotor.chord = constant(0.2);
        rotor.airfoil = analytic(5.7, 0.0);
        rotor.twist = constant(0.0);
        rotor.tip_loss = 1.0;
        rotor.root_cutout = 0.1;
        let (radius, speed) = (rotor.radius, rotor.speed);
        // ½ρ a c Ω ∫ r (r − e)² dr from the cutout to the tip, r from the shaft.
        let primitive = |r: f64| {
            r.powi(4) / 4.0 - 2.0 * offset * r.powi(3) / 3.0 + offset * offset * r * r / 2.0
        };
        let air = 0.5 * density * 5.7 * 0.2 * speed * (primitive(radius) - primitive(0.1 * radius));
        let expected = (air + damper) / rotor.blade_second_moment;
        let damping = -slope(&p, "beta_0_rate", "beta_0_rate");
        close(damping, expected, 2e-4, "damping");
    }
}

/// Two blades on a gimbal are two blades on a teeter hinge: the sum of the
/// reactions of single blades against one rigid body, values and tangents.
#[test]
fn a_gimbal_of_two_blades_is_a_teeter_hinge() {
    let with = |gimbal: bool, governed: bool| {
        let mut p = common::coarsened(problem("coax2d"));
        for rotor in &mut p.rotors {
            let (undersling, spring, delta_3) = (0.05, 900.0, -0.4);
            rotor.hub_kind = if gimbal {
                HubKind::Gimballed { undersling, spring, damping: 0.0, delta_3 }
            } else {
                HubKind::Teetering { undersling, spring, delta_3 }
            };
            rotor.governor = governed.then_some(Governor { time_constant: 0.3 });
            rotor.cant = 0.04;
        }
        vehicle(&p)
    };
    const WIDTH: usize = 40;
    for governed in [false, true] {
        let [gimbal, hinge] = [true, false].map(|gimbal| with(gimbal, governed));
        let (state, effectors) = lively(&hinge);
        assert_eq!(gimbal.state_count(), hinge.state_count());
        for azimuth in [0.0, 0.7, 2.9] {
            let both = [&gimbal, &hinge].map(|vehicle: &Vehicle| {
                let mut work = vehicle.workspace::<Dual<WIDTH>>();
                let x: Vec<Dual<WIDTH>> =
                    state.iter().enumerate().map(|(k, &v)| Dual::variable(v, k)).collect();
                let u: Vec<Dual<WIDTH>> = effectors.iter().map(|&v| Dual::constant(v)).collect();
                let mut out = vec![Dual::<WIDTH>::default(); x.len()];
                vehicle.rates(azimuth, &x, &u, [0.0; 3], &mut work, &mut out);
                out
            });
            for (k, (a, b)) in both[0].iter().zip(&both[1]).enumerate() {
                let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1.0);
                assert!(near(a.v, b.v), "rate {k}: {} {}", a.v, b.v);
                for (a, b) in a.d.iter().zip(b.d) {
                    assert!(near(*a, b), "slope of rate {k}: {a} {b}");
                }
            }
        }
    }
}

/// Many blades resolved do what their average does. On a gimbal both flap in the
/// same ways; free blades have higher modes too, whose accelerations reach the
/// hub only where the blades stand out of the plane of rotation.
#[test]
fn many_flapping_blades_resolved_are_the_average() {
    for gimbal in [true, false] {
        let built = |azimuth| {
            let p = common::coarsened(problem("coax2d"));
            let mut p = if gimbal { common::gimballed(p, 12) } else { common::articulated(p, 12) };
            p.inflow.interactions = false;
            for rotor in &mut p.rotors {
                rotor.azimuth = Some(azimuth);
                rotor.airfoil = analytic(5.7, 0.01);
                rotor.precone = 0.0;
                for chord in &mut rotor.chord.value {
                    *chord /= 6.0;
                }
                rotor.blade_second_moment /= 6.0;
                rotor.blade_first_moment /= 6.0;
            }
            vehicle(&p)
        };
        let [resolved, averaged] = [AzimuthModel::Resolved, AzimuthModel::Averaged].map(built);
        assert!(averaged.is_steady());
        let (mut state, effectors) = lively(&averaged);
        if !gimbal {
            for places in &averaged.layout.rotors {
                state[places.flap[0]..places.flap[0] + places.flap[1]].fill(0.0);
            }
        }
        let mut wide = vec![0.0; resolved.state_count()];
        let place = |name: &str| resolved.layout.state(name).unwrap();
        for (quantity, value) in averaged.layout.states.iter().zip(&state) {
            wide[place(&quantity.name)] = *value;
        }
        let mean = rates(&averaged, 0.0, &state, &effectors, [0.0; 3]);
        for azimuth in [0.0, 0.13, 0.3] {
            let all = rates(&resolved, azimuth, &wide, &effectors, [0.0; 3]);
            for (quantity, b) in averaged.layout.states.iter().zip(&mean) {
                let a = all[place(&quantity.name)];
                // The mean is right to 1e-5 of the thrust: of gravity for the
                // airframe, of the restoring Ω² β at 0.1 rad for the flap rates.
                let flap = quantity.name.ends_with("_rate");
                let speed = averaged.rotors[0].speed;
                let scale = if flap { 0.1 * speed * speed } else { 10.0 };
                let near = (a - b).abs() < 1e-5 * scale.max(b.abs());
                assert!(near, "gimbal {gimbal}, {}: {a} {b}", quantity.name);
            }
        }
    }
}

/// As many blades as the average has azimuths stand where it looks: resolved and
/// averaged are one sum, with a gimbal and rigid, to 1e-9 of gravity.
#[test]
fn blades_at_the_azimuths_of_the_average_are_the_average() {
    for gimbal in [true, false] {
        let built = |azimuth, blades: usize| {
            let mut p = common::coarsened(problem("coax2d"));
            if gimbal {
                p = common::gimballed(p, blades);
            }
            p.inflow.interactions = false;
            for rotor in &mut p.rotors {
                if !gimbal {
                    rotor.hub_kind = HubKind::Rigid;
                    rotor.blades = blades;
                }
                rotor.azimuth = Some(azimuth);
                rotor.airfoil = analytic(5.7, 0.01);
                let share = 2.0 / blades as f64;
                for chord in &mut rotor.chord.value {
                    *chord *= share;
                }
                rotor.blade_second_moment *= share;
                rotor.blade_first_moment *= share;
                rotor.blade_mass *= share;
            }
            vehicle(&p)
        };
        let average = built(AzimuthModel::Averaged, 2);
        let azimuths = average.rotors.iter().filter_map(|r| r.averaging_azimuths()).max().unwrap();
        let [averaged, resolved] =
            [AzimuthModel::Averaged, AzimuthModel::Resolved].map(|model| built(model, azimuths));
        let counts: Vec<_> = averaged.rotors.iter().map(|r| r.averaging_azimuths()).collect();
        assert!(counts.iter().all(|count| *count == Some(azimuths)), "{counts:?}");
        let (state, effectors) = lively(&averaged);
        let mean = rates(&averaged, 0.0, &state, &effectors, [0.0; 3]);
        let all = rates(&resolved, 0.0, &state, &effectors, [0.0; 3]);
        assert_eq!(averaged.state_count(), resolved.state_count());
        for (k, (a, b)) in all.iter().zip(&mean).enumerate() {
            let near = (a - b).abs() < 1e-6 * b.abs().max(1e-2);
            assert!(near, "gimbal {gimbal}, {}: {a} {b}", averaged.layout.states[k].name);
        }
    }
}

/// An averaged teetering rotor is the mean of a resolved one over a turn, where
/// the airframe is too heavy to shake.
#[test]
fn an_averaged_teetering_rotor_is_the_mean_of_a_resolved_one() {
    let built = |azimuth| {
        let mut p = common::coarsened(problem("coax2d-physics"));
        p.inflow.interactions = false;
        p.mass.mass *= 1e6;
        for moment in [&mut p.mass.i_xx, &mut p.mass.i_yy, &mut p.mass.i_zz] {
            *moment *= 1e6;
        }
        for rotor in &mut p.rotors {
            rotor.azimuth = Some(azimuth);
            rotor.airfoil = analytic(5.7, 0.01);
        }
        vehicle(&p)
    };
    let [resolved, averaged] = [AzimuthModel::Resolved, AzimuthModel::Averaged].map(built);
    let (state, effectors) = lively(&resolved);
    let mean = rates(&averaged, 0.0, &state, &effectors, [0.0; 3]);
    let count = 64;
    let mut sum = vec![0.0; state.len()];
    for k in 0..count {
        let azimuth = TAU * f64::from(k) / f64::from(count);
        let now = rates(&resolved, azimuth, &state, &effectors, [0.0; 3]);
        for (sum, rate) in sum.iter_mut().zip(now) {
            *sum += rate / f64::from(count);
        }
    }
    for (k, (a, b)) in sum.iter().zip(&mean).enumerate() {
        assert!((a - b).abs() < 2e-5 * b.abs().max(1.0), "rate {k}: {a} {b}");
    }
}
