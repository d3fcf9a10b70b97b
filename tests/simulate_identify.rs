//! What is measured in flight against what the tuning works with.
//!
//! The two share neither models nor methods: sweeps and steps through the full
//! nonlinear vehicle with the discrete law, and linear models.

use std::sync::LazyLock;

use coaxdesign::control::axis::{Axis, Channel};
use coaxdesign::control::closed_loop::{LawLoop, PlantLoop};
use coaxdesign::control::loops::{Cut, FrequencyModel};
use coaxdesign::control::metrics;
use coaxdesign::control::models::{airframe, from_state_space};
use coaxdesign::control::plant::{Plant, rigid};
use coaxdesign::linear::linearize::{self, averaged};
use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::Options;
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::identify::{
    Record, Response, SLOWEST_REJECTION, Sweep, measure_axes, mismatch, plant as identified,
};
use coaxdesign::simulate::steps;
use coaxdesign::trim::{ConvergedTrim, FlightCondition, Options as TrimOptions, sweep};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;

static VEHICLE: LazyLock<Vehicle> =
    LazyLock::new(|| Vehicle::new(&builtin_named("coax2d").unwrap().problem).unwrap());

static DESIGN: LazyLock<Schedule> = LazyLock::new(|| {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap()
});

/// The trim at a speed, the plant about it, the law and how to simulate.
fn ready(speed: f64) -> (ConvergedTrim, Plant, Autopilot, Options) {
    let conditions = [FlightCondition::level(speed)];
    let mut found = sweep(&VEHICLE, &conditions, &TrimOptions::default(), |_| {});
    let start = found.points.pop().unwrap().into_converged().unwrap();
    let full = averaged(&VEHICLE, &start, &linearize::Options::default()).unwrap();
    let plant = from_state_space(&full, speed, airframe(start.point())).unwrap();
    let law = Autopilot { table: DESIGN.law().unwrap(), stick_limits: DESIGN.stick_limits };
    (start, plant, law, Options::new(DESIGN.hardware, 1.0))
}

/// How near measured and predicted |S| are at every frequency, dB: half of one
/// in hover, where roll moves speed, a third elsewhere.
const REJECTION_GAP: f64 = 0.6;

/// Measured numbers lie within a tenth of those predicted.
fn near(what: &str, measured: Option<f64>, predicted: Option<f64>) {
    let (Some(m), Some(p)) = (measured, predicted) else {
        // What the linear loop does not have is not measured either.
        assert_eq!(measured.is_some(), predicted.is_some(), "{what}: {measured:?} {predicted:?}");
        return;
    };
    assert!((m / p - 1.0).abs() < 0.1, "{what}: measured {m}, predicted {p}");
}

/// The prediction where it was measured, so that both see the same crossings.
fn predict(measured: &Response, exact: impl Fn(f64) -> num_complex::Complex64) -> Response {
    Response {
        omega: measured.omega.clone(),
        value: measured.omega.iter().map(|&w| exact(w)).collect(),
        coherence: vec![1.0; measured.omega.len()],
        lines: measured.lines.clone(),
    }
}

/// Crossover, phase and gain margins, rejection bandwidth and peak in every
/// axis, bandwidth and phase delay in roll and pitch: within ten per cent. And
/// the aircraft alone, told apart from its law: a mismatch cost below 100, which is
/// held acceptable.
fn everything_agrees(speed: f64) {
    let (start, plant, law, options) = ready(speed);
    let frequency = FrequencyModel::new(&plant, DESIGN.hardware, 0.0).unwrap();
    // Measured with the outer loops open.
    let linear = LawLoop::new(&law.table, speed, false);
    let model = PlantLoop::new(&frequency, &linear);
    let settings = Sweep::default();
    let all =
        measure_axes((&*VEHICLE).into(), &(&start).into(), &law, &options, &settings, &Axis::ALL)
            .unwrap();
    for measured in &all {
        let axis = measured.axis;
        let channel = Channel::from(axis);
        let cut = measured.cut.coherent();
        let linear = predict(&cut, |w| model.at(w).cut(channel, Cut::Effector));
        let (flown, linear) = (cut.margins(), linear.margins());
        near(&format!("{axis} crossover"), flown.crossover, linear.crossover);
        near(&format!("{axis} phase margin"), flown.phase, linear.phase);
        near(&format!("{axis} gain margin"), flown.gain_up, linear.gain_up);
        let s = measured.sensitivity.as_ref().unwrap().coherent();
        let linear = predict(&s, |w| model.at(w).sensitivity(channel));
        let flown = s.rejection();
        let gap = s.largest_gap(&linear.value, SLOWEST_REJECTION).unwrap();
        assert!(gap < REJECTION_GAP, "{axis}: |S| is {gap} dB off");
        // Where |S| runs along −3 dB its crossing says little: the measurement
        // then says between which two it lies, and so must the prediction.
        let predicted = linear.rejection();
        let [least, most] = s.rejection_interval();
        let bandwidth = predicted.bandwidth;
        assert_eq!(bandwidth.is_some(), most.is_some(), "{axis}: {bandwidth:?}, {most:?}");
        if let (Some(least), Some(most), Some(w)) = (least, most, bandwidth) {
            // As far as the measured |S| stays as close to −3 dB as the two are
            // held to each other, it says no more.
            let level = metrics::decibels(metrics::DRB_LEVEL);
            let along = |from: f64, to: f64| {
                let between = s.omega.iter().zip(&s.value).filter(|(w, _)| (from..to).contains(*w));
                let gaps = between.map(|(_, v)| (metrics::decibels(v.norm()) - level).abs());
                gaps.fold(0.0, f64::max) < REJECTION_GAP
            };
            let near = (0.9 * least..1.1 * most).contains(&w)
                || (w > most && along(most, w))
                || (w < least && along(w, least));
            assert!(near, "{axis} DRB: {w}, measured {least} to {most}");
            if most < 1.2 * least && (0.9 * least..1.1 * most).contains(&w) {
                self::near(&format!("{axis} DRB"), flown.bandwidth, bandwidth);
            }
        }
        let db = |peak: f64| Some(metrics::decibels(peak));
        near(&format!("{axis} DRP"), db(flown.peak), db(predicted.peak));
        if let Some(c) = &measured.command {
            let c = c.coherent();
            let linear = predict(&c, |w| model.at(w).attitude(axis));
            let (flown, linear) = (c.bandwidth(), linear.bandwidth());
            near(&format!("{axis} bandwidth"), flown.phase_limited, linear.phase_limited);
            near(&format!("{axis} phase delay"), flown.phase_delay, linear.phase_delay);
        }
    }
    let records: Vec<Record> = all.iter().map(|m| m.record.clone()).collect();
    let alone = identified(&records, 0.01, [1.0, 12.0], settings.points);
    let exact = FrequencyModel::new(&plant, DESIGN.hardware, 0.0).unwrap();
    for (state, axis) in [
        (rigid::P, Axis::Roll),
        (rigid::Q, Axis::Pitch),
        (rigid::R, Axis::Yaw),
        (rigid::W, Axis::Heave),
    ] {
        let stick = axis.effector().index();
        let measured = alone.element(state, stick).coherent();
        assert!(measured.omega.len() > 20, "{axis}: {} points", measured.omega.len());
        let cost = mismatch(&measured, |w| exact.states(w)[state][stick]).unwrap();
        assert!(cost < 100.0, "{axis}: mismatch {cost}");
    }
}

#[test]
fn val_measured_in_hover_is_what_was_predicted() {
    everything_agrees(0.0);
}

#[test]
fn val_measured_at_60_kt_is_what_was_predicted() {
    everything_agrees(60.0 * KNOT);
}

/// Small steps in every channel, outer loops included, follow the linear
/// closed loop within five per cent of RMS.
#[test]
fn val_small_steps_follow_the_linear_closed_loop() {
    for knots in [0.0, 40.0, 60.0] {
        let speed = knots * KNOT;
        let (start, plant, law, options) = ready(speed);
        let channels = steps::channels(&law.table, speed);
        assert!(channels.len() >= 4);
        let list =
            steps::compare((&*VEHICLE).into(), &(&start).into(), &plant, &law, &options, &channels)
                .unwrap();
        for step in &list {
            let difference = 100.0 * step.difference();
            assert!(difference < 5.0, "{} at {knots} kt: {difference:.2} %", step.channel);
            // It is a step: what was asked for is there at the end.
            let last = step.linear[step.linear.len() - 1];
            let asked = steps::size(step.channel);
            assert!(last.abs() > 0.5 * asked, "{} at {knots} kt: {last}", step.channel);
        }
    }
}
