//! Control surfaces as effectors: thin-airfoil theory, equal incidence, mirror
//! images, gearing through trim and linear models.

mod common;

use approx::assert_relative_eq;
use coaxdesign::linear::linearize::{self, Inputs, linearize};
use coaxdesign::numerics::scalar::{Dual, Scalar, Vec3};
use coaxdesign::problem::{
    Airfoil, AtmosphereConditions, ControlSurface, DynamicPressure, Effectiveness, FlowAngle,
    Polar, Problem, Spanwise, Station, Wash, Wing, WingModel,
};
use coaxdesign::trim::{FlightCondition, Options, Status, trim_at};
use coaxdesign::units::KNOT;
use coaxdesign::validation::{mirror_signs, mirror_sticks, mirrored};
use coaxdesign::vehicle::{Vehicle, atmosphere::Air, wing};
use common::problem;
use std::f64::consts::PI;

const SPEED: f64 = 50.0;
const SLOPE: f64 = 5.9;
const AREA: f64 = 12.0;

fn air() -> Air {
    Air::at(&AtmosphereConditions { altitude: 0.0, temperature_offset: 0.0 })
}

fn surface(effectiveness: f64) -> ControlSurface {
    ControlSurface {
        effectiveness: Effectiveness::Constant(effectiveness),
        gearing: [0.0; 4],
        rigging: 0.0,
        limits: [-0.4, 0.4],
    }
}

fn strip_wing(surface: Option<ControlSurface>, incidence: f64) -> wing::Wing {
    let constant = |value| Spanwise { station: vec![0.0], value: vec![value] };
    let origin = Station { fuselage_station: 0.0, butt_line: 0.0, water_line: 0.0 };
    let wing = Wing {
        name: "wing".to_owned(),
        aerodynamic_center: Station { fuselage_station: 3.0, ..origin },
        span: 8.0,
        chord: constant(AREA / 8.0),
        incidence,
        incidence_schedule: None,
        dynamic_pressure: None,
        surface,
        cant: 0.0,
        dihedral: 0.1,
        model: WingModel::Elements {
            elements: 6,
            airfoil: Airfoil::Analytic {
                lift_slope: SLOPE,
                zero_lift_angle: -0.02,
                drag: 0.01,
                polar: Polar::default(),
                small_angles: false,
            },
            induced_angle: false,
        },
        wash: Wash::None,
    };
    wing::Wing::new(&wing, &origin, &air()).unwrap()
}

fn loads(wing: &wing::Wing, alpha: f64, deflection: Option<f64>) -> [f64; 6] {
    let (s, c) = alpha.sin_cos();
    let velocity = Vec3([SPEED * c, 0.0, SPEED * s]);
    let (force, moment) = wing.loads(velocity, Vec3([0.2, -0.1, 0.3]), deflection, |_| None);
    let ([fx, fy, fz], [mx, my, mz]) = (force.0, moment.0);
    [fx, fy, fz, mx, my, mz]
}

/// Glauert's integral for the angle from zero lift of a bent camber line,
/// by quadrature: τ = (1/π) ∫ (1 − cos θ) dθ over the flap.
#[test]
fn val_thin_airfoil_effectiveness_of_a_plain_flap() {
    for chord_fraction in [0.1, 0.25, 0.4, 0.7, 1.0] {
        let hinge = (2.0 * chord_fraction - 1.0_f64).acos();
        let count = 20_000;
        let width = (PI - hinge) / f64::from(count);
        let middles = (0..count).map(|k| hinge + (f64::from(k) + 0.5) * width);
        let integral: f64 = middles.map(|theta| (1.0 - theta.cos()) * width).sum();
        let tau = ControlSurface::thin_airfoil(chord_fraction);
        assert_relative_eq!(tau, integral / PI, max_relative = 1e-8);
    }
    // A quarter-chord flap, as in textbooks.
    assert_relative_eq!(ControlSurface::thin_airfoil(0.25), 0.609, epsilon = 5e-4);
}

/// Lift per deflection is the section's slope times τ, and still air makes no load.
#[test]
fn lift_of_a_deflection_is_slope_times_effectiveness() {
    let tau = ControlSurface::thin_airfoil(0.25);
    let wing = strip_wing(Some(surface(tau)), 0.0);
    let step = 1e-4;
    let lift = |deflection: f64| {
        let velocity = Vec3([SPEED, 0.0, 0.0]);
        let (force, _) = wing.loads(velocity, Vec3::default(), Some(deflection), |_| None);
        -force.0[2]
    };
    let pressure = 0.5 * air().density * SPEED * SPEED;
    let slope = (lift(step) - lift(-step)) / (2.0 * step * pressure * AREA);
    // The halves are turned by the dihedral: normal force leans by it.
    assert_relative_eq!(slope, SLOPE * tau * 0.1_f64.cos(), max_relative = 1e-6);
    let (still, _) = wing.loads(Vec3::<f64>::default(), Vec3::default(), Some(0.3), |_| None);
    assert_eq!(still.0, [0.0; 3]);
}

/// A deflection is an incidence of τ δ, at any angle of attack, stalled or not;
/// without deflection the wing is that without a surface.
#[test]
fn deflection_is_an_incidence() {
    let (tau, deflection) = (0.6, 0.25);
    let hinged = strip_wing(Some(surface(tau)), 0.03);
    let turned = strip_wing(None, 0.03 + tau * deflection);
    let plain = strip_wing(None, 0.03);
    for alpha in [-3.0, -1.0, -0.2, 0.0, 0.15, 0.5, 2.0] {
        let pairs = [
            (loads(&hinged, alpha, Some(deflection)), loads(&turned, alpha, None)),
            (loads(&hinged, alpha, Some(0.0)), loads(&plain, alpha, None)),
        ];
        for (ours, expected) in pairs {
            let size = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            for (a, b) in ours.iter().zip(expected) {
                assert!((a - b).abs() <= 1e-12 * size, "{alpha}: {ours:?}, not {expected:?}");
            }
        }
    }
}

/// A table of the effectiveness goes through its points with the slope of a
/// constant where it is straight, and holds its ends.
#[test]
fn table_of_effectiveness_goes_through_its_points() {
    let deflection = vec![-0.4, -0.2, 0.0, 0.2, 0.4];
    let shift = vec![-0.16, -0.1, 0.0, 0.1, 0.16];
    let by =
        |effectiveness| strip_wing(Some(ControlSurface { effectiveness, ..surface(0.5) }), 0.03);
    let table = by(Effectiveness::Table { deflection: deflection.clone(), shift: shift.clone() });
    let same = |ours: [f64; 6], expected: [f64; 6]| {
        for (a, b) in ours.iter().zip(expected) {
            assert_relative_eq!(*a, b, epsilon = 1e-9, max_relative = 1e-12);
        }
    };
    for (delta, shift) in deflection.iter().zip(&shift) {
        let turned = strip_wing(None, 0.03 + shift);
        same(loads(&table, 0.1, Some(*delta)), loads(&turned, 0.1, None));
    }
    same(loads(&table, 0.1, Some(0.7)), loads(&table, 0.1, Some(0.4)));
    let line = by(Effectiveness::Table { deflection: vec![-0.4, 0.4], shift: vec![-0.2, 0.2] });
    same(loads(&line, 0.1, Some(0.13)), loads(&by(Effectiveness::Constant(0.5)), 0.1, Some(0.13)));
    // Tangents are those of the curve.
    let step = 1e-6;
    let velocity = [SPEED, 0.0, 2.0].map(Dual::<1>::constant);
    let (force, _) = table.loads(
        Vec3(velocity),
        Vec3([0.0; 3].map(Dual::<1>::constant)),
        Some(Dual { v: 0.25, d: [1.0] }),
        |_| None,
    );
    let at =
        |delta| table.loads(Vec3([SPEED, 0.0, 2.0]), Vec3::default(), Some(delta), |_| None).0.0[2];
    let slope = (at(0.25 + step) - at(0.25 - step)) / (2.0 * step);
    assert_relative_eq!(force.0[2].d[0], slope, max_relative = 1e-6);
}

/// The UH-60A with an elevator geared to the longitudinal stick, and a rudder.
fn with_surfaces() -> Problem {
    let mut p = problem("uh60a");
    p.rotors[0].azimuth = Some(coaxdesign::problem::AzimuthModel::Averaged);
    let degrees_per_percent = 0.1_f64.to_radians();
    let geared = |stick: usize, rigging: f64| {
        let mut gearing = [0.0; 4];
        gearing[stick] = degrees_per_percent;
        ControlSurface { gearing, rigging, ..surface(0.5) }
    };
    p.wings[0].surface = Some(geared(1, -0.1));
    p.wings[1].surface = Some(geared(3, 0.02));
    // One side of the fin stands in more wake than the other.
    p.wings[1].dynamic_pressure = Some(DynamicPressure {
        over: FlowAngle::Sideslip,
        angle: vec![-0.3, 0.0, 0.2],
        ratio: vec![0.5, 0.7, 0.95],
    });
    p
}

/// Mirrored aircraft, sticks and motion give mirrored rates.
#[test]
fn mirrored_surfaces_mirror() {
    let p = with_surfaces();
    let (vehicle, image) = (Vehicle::new(&p).unwrap(), Vehicle::new(&mirrored(&p)).unwrap());
    let signs = mirror_signs(&vehicle);
    let mut state: Vec<f64> = vehicle.layout.states.iter().map(|s| 0.3 * s.scale).collect();
    state[0] = 45.0;
    state[1] = 4.0;
    let sticks = [45.0, 60.0, 40.0, 70.0];
    let rates = |vehicle: &Vehicle, state: &[f64], sticks: [f64; 4]| {
        let mut effectors = vec![0.0; vehicle.effector_count()];
        vehicle.mix(&sticks, &mut effectors);
        let mut rates = vec![0.0; state.len()];
        let mut work = vehicle.workspace::<f64>();
        vehicle.rates(0.0, state, &effectors, [0.0; 3], &mut work, &mut rates);
        rates
    };
    let ours = rates(&vehicle, &state, sticks);
    let seen: Vec<f64> = state.iter().zip(&signs).map(|(x, sign)| x * sign).collect();
    let theirs = rates(&image, &seen, mirror_sticks(sticks));
    for ((a, b), sign) in ours.iter().zip(&theirs).zip(&signs) {
        assert!((a - sign * b).abs() < 1e-8 * (1.0 + a.abs()), "{a} {b}");
    }
}

/// Surfaces are trimmed with, linearised exactly, and have margins.
#[test]
fn surfaces_reach_trim_and_linear_models() {
    let p = with_surfaces();
    let vehicle = Vehicle::new(&p).unwrap();
    let condition = FlightCondition::level(80.0 * KNOT);
    let point = trim_at(&vehicle, condition, &Options::default());
    assert_eq!(point.status, Status::Converged, "{:?}", point.status);
    let margin = |name: &str| point.margins.iter().find(|m| m.control == name).unwrap().clone();
    let elevator = margin("stabilator.deflection");
    let geared = -0.1 + 0.1_f64.to_radians() * point.sticks[1];
    assert_relative_eq!(elevator.value, geared, max_relative = 1e-12);
    assert_eq!(elevator.limits, [-0.4, 0.4]);

    // What the stick does through the elevator beside the swashplate: the columns
    // of the effectors, joined by the gearing, are the columns of the sticks.
    let trim = point.into_converged().unwrap();
    let of = |inputs| {
        let options = linearize::Options { inputs, ..Default::default() };
        linearize(&vehicle, &trim, &options).unwrap().model.averaged()
    };
    let (sticks, effectors) = (of(Inputs::Sticks), of(Inputs::Rotors));
    let names: Vec<&str> = effectors.inputs().iter().map(|c| c.name.as_str()).collect();
    assert!(names.ends_with(&["stabilator.deflection", "fin.deflection"]), "{names:?}");
    let count = names.len();
    let mut by_stick = vec![0.0; count];
    let mut rest = vec![0.0; count];
    vehicle.mix(&[50.0, 51.0, 50.0, 50.0], &mut by_stick);
    vehicle.mix(&[50.0; 4], &mut rest);
    for row in 0..sticks.a().nrows() {
        let joined: f64 =
            (0..count).map(|k| effectors.b()[(row, k)] * (by_stick[k] - rest[k])).sum();
        let direct = sticks.b()[(row, 1)];
        assert!((joined - direct).abs() < 1e-9 * (1.0 + direct.abs()), "{row}: {joined} {direct}");
    }
    let column = names.iter().position(|name| *name == "stabilator.deflection").unwrap();
    let q = effectors.states().iter().position(|c| c.name == "q").unwrap();
    assert!(effectors.b()[(q, column)] < 0.0, "trailing edge down pitches the nose down");

    // Narrow limits bind, and the trim says which.
    let mut narrow = p.clone();
    narrow.wings[0].surface.as_mut().unwrap().limits = [-0.01, 0.01];
    let point = trim_at(&Vehicle::new(&narrow).unwrap(), condition, &Options::default());
    let controls = vec!["stabilator.deflection".to_owned()];
    assert_eq!(point.status, Status::BeyondLimits { controls });
}

/// A whole surface that turns is the stabilator of an incidence schedule: at one
/// airspeed both make the same loads.
#[test]
fn turning_surface_is_the_stabilator() {
    let mut scheduled = problem("uh60a");
    scheduled.rotors[0].azimuth = Some(coaxdesign::problem::AzimuthModel::Averaged);
    let mut turned = scheduled.clone();
    let vehicle = Vehicle::new(&scheduled).unwrap();
    let speed = 60.0 * KNOT;
    turned.wings[0].incidence_schedule = None;
    turned.wings[0].surface = Some(ControlSurface {
        rigging: vehicle.wings[0].scheduled_incidence(speed),
        limits: [-1.0, 1.0],
        ..surface(1.0)
    });
    let at = |p: &Problem| {
        let vehicle = Vehicle::new(p).unwrap();
        trim_at(&vehicle, FlightCondition::level(speed), &Options::default())
    };
    let (a, b) = (at(&scheduled), at(&turned));
    for (a, b) in a.sticks.iter().zip(b.sticks) {
        assert_relative_eq!(*a, b, epsilon = 1e-6);
    }
}
