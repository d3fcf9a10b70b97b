//! Multicopters with commanded rotor speeds: hover, control rows and drag of the
//! Hummingbird and the Firefly (RotorS), against what their coefficients say.

mod common;

use coaxdesign::linear::StateSpace;
use coaxdesign::linear::linearize::linearize;
use coaxdesign::trim::{FlightCondition, Options};
use coaxdesign::vehicle::{Layout, Vehicle};
use common::{problem, trimmed, vehicle};

/// Hover speed of every rotor, and the averaged model.
fn hover(vehicle: &Vehicle) -> (Vec<f64>, StateSpace) {
    let point = trimmed(vehicle, FlightCondition::level(0.0), &Options::default());
    let speeds = vehicle
        .layout
        .rotors
        .iter()
        .map(|places| point.mean_state[places.speed.unwrap()])
        .collect();
    let trim = point.into_converged().unwrap();
    let model = linearize(vehicle, &trim, &Default::default()).unwrap().model.averaged();
    (speeds, model)
}

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (value - expected).abs();
    assert!(error < tolerance, "{what}: {value}, expected {expected}");
}

/// (rotor, ṗ, q̇, ṙ per rad/s): `aircraft.md` derives them from mass, arms and
/// coefficients.
type Rows = [(&'static str, f64, f64, f64)];

fn assert_rows(name: &str, speed: f64, heave: f64, drag: f64, rows: &Rows) {
    let vehicle = vehicle(&problem(name));
    assert!(vehicle.is_steady());
    let (speeds, model) = hover(&vehicle);
    for found in speeds {
        assert!((found / speed - 1.0).abs() < 1e-3, "{name}: {found} rad/s");
    }
    let state = |name: &str| vehicle.layout.state(name).unwrap();
    let a = model.a();
    let mut all = 0.0;
    for (rotor, roll, pitch, yaw) in rows {
        let omega = state(&format!("{rotor}.omega"));
        let label = |axis: &str| format!("{name}, {rotor}: {axis}");
        close(a[(state("p"), omega)], *roll, 2e-4, &label("p"));
        close(a[(state("q"), omega)], *pitch, 2e-4, &label("q"));
        close(a[(state("r"), omega)], *yaw, 2e-5, &label("r"));
        all -= a[(state("w"), omega)];
        close(a[(omega, omega)], -80.0, 1e-6, "motor");
    }
    close(all, heave * rows.len() as f64 / rows.len() as f64, 1e-4, "heave");
    close(a[(state("u"), state("u"))], drag, 2e-3, "X_u");
    close(a[(state("v"), state("v"))], drag, 2e-3, "Y_v");
}

#[test]
fn val_hummingbird_hover_and_control_rows() {
    let rows = [
        ("front", 0.0, 0.1882, -0.01033),
        ("left", 0.1882, 0.0, 0.01033),
        ("back", 0.0, -0.1882, -0.01033),
        ("right", -0.1882, 0.0, 0.01033),
    ];
    assert_rows("hummingbird", 453.15, 0.04328, -0.204, &rows);
}

#[test]
fn val_firefly_hover_and_control_rows() {
    let rows = [
        ("front_left", 0.0286, 0.0375, 0.00151),
        ("left", 0.0572, 0.0, -0.00151),
        ("back_left", 0.0286, -0.0375, 0.00151),
        ("back_right", -0.0286, -0.0375, -0.00151),
        ("right", -0.0572, 0.0, 0.00151),
        ("front_right", -0.0286, 0.0375, -0.00151),
    ];
    assert_rows("firefly", 540.86, 0.03626, -0.171, &rows);
}

/// The published inertia of the Firefly breaks the triangle inequality: a
/// warning that says so with the figures, not an error.
#[test]
fn an_impossible_inertia_is_a_warning() {
    let loaded = coaxdesign::problem::builtin_named("firefly").unwrap();
    let warning = loaded.warnings.iter().find(|warning| warning.key == "mass").unwrap();
    assert!(warning.message.contains("no body has this inertia"), "{}", warning.message);
    assert!(warning.message.contains("principal moments"), "{}", warning.message);
}

/// Level flight against the rotors' drag alone: tan(−θ) = |X_u| V/g.
#[test]
fn val_pitch_attitude_in_level_flight() {
    for (name, degrees) in [("firefly", -4.98), ("hummingbird", -5.94)] {
        let vehicle = vehicle(&problem(name));
        let point = trimmed(&vehicle, FlightCondition::level(5.0), &Options::default());
        let pitch = point.mean_state[Layout::BODY.pitch].to_degrees();
        close(pitch, degrees, 0.03, name);
        assert!(point.power.imbalance().abs() < 1.0, "{}", point.power.imbalance());
    }
}
