//! Margins measured in flight against those that the tuning works with.
//!
//! The two share neither models nor methods: sweeps through the full nonlinear
//! vehicle with the discrete law, and frequency responses of linear models.

use std::sync::Arc;

use coaxdesign::control::axis::{Axis, Channel};
use coaxdesign::control::loops::{Cut, LoopModel};
use coaxdesign::control::metrics::{self, Sampled};
use coaxdesign::control::models::{airframe, from_state_space};
use coaxdesign::control::tuning::default_grid;
use coaxdesign::control::verify::inner_only;
use coaxdesign::linear::linearize::{self, averaged};
use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::Options;
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::identify::{Sweep, measure_axes};
use coaxdesign::trim::{FlightCondition, Guess, trim};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;

/// Crossover, phase margin and rejection in roll at 40 kt agree within ten per
/// cent, and so do the loops themselves, frequency by frequency.
#[test]
fn val_measured_margins_are_those_predicted() {
    let vehicle = Vehicle::new(&builtin_named("coax2d").unwrap().problem).unwrap();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    let schedule = Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let table = schedule.law().unwrap();
    let speed = 40.0 * KNOT;
    let condition = FlightCondition::level(speed);
    let guess = Guess::estimate(&vehicle, &condition);
    let start = trim(&vehicle, condition, &guess, &Default::default()).into_converged().unwrap();
    let full = averaged(&vehicle, &start, &linearize::Options::default()).unwrap();
    let plant = from_state_space(&full, speed, airframe(start.point())).unwrap();
    let point = table.at(speed);
    let grid: Arc<[f64]> = default_grid(0.01, 100.0, 300).into();
    let model = LoopModel::new(
        &plant,
        &point.inversion,
        &table.settings,
        schedule.hardware,
        0.0,
        grid.clone(),
    )
    .unwrap();
    let gains = inner_only(&point.gains);
    let law = Autopilot { table, stick_limits: schedule.stick_limits };
    let options = Options::new(schedule.hardware, 1.0);
    let measured =
        measure_axes(&vehicle, &start, &law, &options, &Sweep::default(), &[Axis::Roll]).unwrap();
    let roll = &measured[0];

    let cut = roll.cut.coherent();
    let predicted = |w: f64| model.loop_at(&gains, Channel::Roll, Cut::Effector, w);
    let mut compared = 0;
    for (w, value) in cut.omega.iter().zip(&cut.value) {
        if (0.6..=12.0).contains(w) {
            assert!((value / predicted(*w) - 1.0).norm() < 0.1, "{w} rad/s");
            compared += 1;
        }
    }
    assert!(compared > 20);
    let near = |what: &str, measured: Option<f64>, predicted: Option<f64>| {
        let (m, p) = (measured.unwrap(), predicted.unwrap());
        assert!((m / p - 1.0).abs() < 0.1, "{what}: measured {m}, predicted {p}");
    };
    let values: Vec<_> = grid.iter().map(|&w| predicted(w)).collect();
    let linear = metrics::margins(Sampled::new(&grid, &values));
    let flown = cut.margins();
    near("crossover", flown.crossover, linear.crossover);
    near("phase margin", flown.phase, linear.phase);
    near("gain margin", flown.gain_up, linear.gain_up);
    let values: Vec<_> =
        grid.iter().map(|&w| model.sensitivity_at(&gains, Channel::Roll, w)).collect();
    let linear = metrics::rejection(Sampled::new(&grid, &values));
    let flown = roll.sensitivity.as_ref().unwrap().coherent().rejection();
    near("DRB", flown.bandwidth, linear.bandwidth);
    near("DRP", Some(flown.peak), Some(linear.peak));
}
