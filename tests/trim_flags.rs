//! What a trim says of its blades: reversed flow, stall, drag divergence, blade
//! loading and the worst section, over whole orbits.

use std::f64::consts::PI;

use coaxdesign::problem;
use coaxdesign::trim::{self, FlightCondition, Guess, TrimPoint};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;

fn trimmed(text: &str, knots: f64) -> (Vehicle, TrimPoint) {
    let loaded = problem::parse_beside_builtin("t.toml", text).unwrap_or_else(|r| panic!("{r}"));
    let mut problem = loaded.problem;
    problem.inflow.interactions = false;
    let vehicle = Vehicle::new(&problem).unwrap();
    let condition = FlightCondition::level(knots * KNOT);
    let guess = Guess::estimate(&vehicle, &condition);
    let point = trim::trim(&vehicle, condition, &guess, &trim::Options::default());
    assert!(point.on_orbit(), "{:?}", point.status);
    (vehicle, point)
}

const COAX: &str = include_str!("../problems/coax2d.toml");

/// In forward flight the reversed circle has μ²/4 of the disk, here less what
/// the root cut-out leaves out and the elements resolve; in hover it is gone.
#[test]
fn reversed_flow_grows_with_the_square_of_the_advance_ratio() {
    for knots in [60.0, 80.0] {
        let (vehicle, point) = trimmed(COAX, knots);
        for (rotor, mean) in vehicle.rotors.iter().zip(&point.rotors) {
            let mu = knots * KNOT / rotor.tip_speed();
            let expected = 0.25 * mu * mu;
            let found = mean.census.reversed();
            assert!(found <= 1.1 * expected + 1e-3, "{knots} kt: {found} {expected}");
            assert!(found >= 0.3 * expected - 1e-3, "{knots} kt: {found} {expected}");
        }
    }
    let (_, hover) = trimmed(COAX, 0.0);
    for mean in &hover.rotors {
        assert_eq!(mean.census.reversed(), 0.0);
        assert_eq!(mean.census.stalled(), 0.0);
        assert_eq!(mean.census.diverging(), 0.0);
        assert!((0.1..1.0).contains(&mean.census.severity), "{:?}", mean.census);
    }
}

/// C_T/σ times the density, the blade area and the tip speed squared is the thrust.
#[test]
fn blade_loading_is_thrust_over_blade_area() {
    let (vehicle, point) = trimmed(COAX, 0.0);
    for (rotor, mean) in vehicle.rotors.iter().zip(&point.rotors) {
        let disk = PI * rotor.radius * rotor.radius;
        let density = rotor.force_scale() / (disk * rotor.tip_speed() * rotor.tip_speed());
        let area = rotor.solidity() * disk;
        let thrust = mean.blade_loading * density * area * rotor.tip_speed().powi(2);
        assert!((thrust - mean.thrust).abs() < 1e-9 * mean.thrust, "{thrust} {}", mean.thrust);
    }
}

/// Blades with a third of the chord carry three times the loading and stall, on
/// the retreating side in forward flight.
#[test]
fn narrow_blades_stall_on_the_retreating_side() {
    let (_, wide) = trimmed(COAX, 60.0);
    let narrow = COAX.replace("chord = \"0.72 ft\"", "chord = \"0.24 ft\"");
    assert_ne!(narrow, COAX, "the chord stands in the file");
    let (_, narrow) = trimmed(&narrow, 60.0);
    for (wide, narrow) in wide.rotors.iter().zip(&narrow.rotors) {
        assert!(narrow.blade_loading > 1.5 * wide.blade_loading);
        assert!(narrow.census.severity > wide.census.severity);
        assert!(narrow.census.stalled() >= wide.census.stalled());
    }
    let worst = narrow
        .rotors
        .iter()
        .max_by(|a, b| a.census.stalled().total_cmp(&b.census.stalled()))
        .unwrap();
    assert!(worst.census.stalled() > 0.01, "{:?}", worst.census);
    // Retreating: between 180 and 360 deg.
    assert!(worst.census.worst.azimuth.rem_euclid(2.0 * PI) > PI, "{:?}", worst.census);
    assert!(worst.census.worst.angle_of_attack > 0.15);
}
