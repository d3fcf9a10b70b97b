//! A notch filter asked for in a specification is in every reading of the law.

use std::sync::Arc;

use coaxdesign::control::axis::{Channel, GainSet, inner_only};
use coaxdesign::control::closed_loop::{LawLoop, PlantLoop};
use coaxdesign::control::law::{
    Controller, Demand, Horizontal, LawPoint, LawSettings, LawTable, Measurement, TurnCoordination,
};
use coaxdesign::control::loops::{Cut, FrequencyModel, GainGrid, LoopModel};
use coaxdesign::control::plant::Inversion;
use coaxdesign::control::tuning::start_gains;
use coaxdesign::control::{spec, testbed};
use coaxdesign::export::{Description, Format, Options, Precision, export};
use coaxdesign::law::mdi::{Notch, Notches};
use coaxdesign::schedule::{Provenance, Schedule, hash};

const NOTCH: Notch = Notch { frequency: 9.0, damping: 0.5, depth: 0.1 };

fn table(notch: Notches) -> LawTable {
    let settings = LawSettings {
        kappa: 0.25,
        hybrid_feedforward: true,
        reference_delay: 0.15,
        roll_frequency: 2.0,
        pitch_frequency: 1.8,
        attitude_damping: 0.8,
        yaw_time_constant: 0.5,
        heave_time_constant: 2.0,
        notch,
    };
    let speed = 15.0;
    let mut gains = GainSet::default();
    for c in Channel::ALL {
        gains[c.index()] = start_gains(c, 0.152, [0.0, 10.0]);
    }
    let plant = testbed::plant(speed, &testbed::NOMINAL);
    let point = LawPoint { speed, gains, inversion: Inversion::new(&plant).unwrap() };
    LawTable::new(vec![point], settings, TurnCoordination { speed: 300.0, width: 5.0 }).unwrap()
}

fn pitch() -> Notches {
    Notches { pitch: Some(NOTCH), ..Notches::default() }
}

fn schedule(table: &LawTable) -> Schedule {
    let provenance = Provenance {
        generator: "test".into(),
        problem_hash: hash(["a"]),
        specification_hash: hash(["b"]),
    };
    Schedule::new("test", table, testbed::HARDWARE, [[-100.0, 100.0]; 4], true, provenance)
}

/// The tuning's loops and those of the law as it is flown have the same notch,
/// and it is felt: at its frequency the pitch loop is nearly open.
#[test]
fn the_loops_have_it() {
    let plant = testbed::plant(15.0, &testbed::NOMINAL);
    let frequency = FrequencyModel::new(&plant, testbed::HARDWARE, 0.0).unwrap();
    let omega: Arc<[f64]> = vec![0.3, 1.0, 3.0, 9.0, 20.0].into();
    let mut at_notch = Vec::new();
    for notch in [Notches::default(), pitch()] {
        let table = table(notch);
        let point = &table.points()[0];
        let grid = GainGrid::new(&table, 15.0, omega.clone());
        let affine = LoopModel::new(&plant, &grid, testbed::HARDWARE, 0.0).unwrap();
        let law = LawLoop::new(&table, 15.0, false);
        let of = PlantLoop::new(&frequency, &law);
        let inner = inner_only(&point.gains);
        for channel in [Channel::Roll, Channel::Pitch, Channel::Yaw, Channel::Heave] {
            for &w in omega.iter() {
                let (a, b) = (
                    affine.loop_at(&inner, channel, Cut::Effector, w),
                    of.at(w).cut(channel, Cut::Effector),
                );
                assert!((a - b).norm() < 1e-4 * (1.0 + a.norm()), "{channel} {w}: {a} {b}");
            }
        }
        at_notch.push(of.at(NOTCH.frequency).cut(Channel::Pitch, Cut::Effector).norm());
    }
    assert!(at_notch[1] < 0.2 * at_notch[0], "{at_notch:?}");
}

/// Engaged with given sticks, the first steps keep them.
#[test]
fn engaging_keeps_the_sticks() {
    let table = table(pitch());
    let trim = table.points()[0].inversion.trim;
    let [u, v, w] = trim.velocity_body;
    let ((sp, cp), (st, ct)) = (trim.roll.sin_cos(), trim.pitch.sin_cos());
    let lifted = v * sp + w * cp;
    let m = Measurement {
        velocity_body: [u, v, w],
        rates: [0.0; 3],
        roll: trim.roll,
        pitch: trim.pitch,
        airspeed: u * ct + lifted * st,
    };
    let demand = Demand {
        horizontal: Horizontal::Attitude { roll: trim.roll, pitch: trim.pitch },
        heading_rate: 0.0,
        vertical_velocity: lifted * ct - u * st,
    };
    let mut sticks = trim.sticks;
    for (stick, change) in sticks.iter_mut().zip([2.0, -5.0, 3.0, 1.0]) {
        *stick += change;
    }
    let mut c = Controller::new(table, 0.01, [[-1e3, 1e3]; 4]);
    c.engage(&m, &demand, sticks).unwrap();
    for _ in 0..20 {
        for (found, wanted) in c.step(&m, &demand).unwrap().iter().zip(sticks) {
            assert!((found - wanted).abs() < 0.02, "{found} {wanted}");
        }
    }
}

/// Files and generated code hold it, and give it back.
#[test]
fn files_and_code_hold_it() {
    let plain = schedule(&table(Notches::default()));
    assert!(!plain.to_json().unwrap().contains("notch"));
    let schedule = schedule(&table(pitch()));
    let read = Schedule::from_json(&schedule.to_json().unwrap()).unwrap();
    assert_eq!(read, schedule);
    let description = Description::new(&schedule, Vec::new()).unwrap();
    assert_eq!(description.constant("notch_pitch_frequency").unwrap(), NOTCH.frequency);
    assert_eq!(description.schedule().unwrap(), schedule);
    let options = Options {
        name: "law".into(),
        step: 0.01,
        precision: Precision::Double,
        speed: 0.0,
        binaries: Vec::new(),
    };
    for format in [Format::C, Format::Rust, Format::Python, Format::Jsbsim] {
        let has = |schedule: &Schedule| {
            let files = export(schedule, Vec::new(), format, &options).unwrap();
            files.iter().any(|f| {
                let text = String::from_utf8_lossy(&f.bytes).replace('-', "_");
                text.contains("theta_notch_follower")
            })
        };
        assert!(has(&schedule) && !has(&plain), "{format:?}");
    }
}

/// A specification asks for it in a table of its own.
#[test]
fn specifications_ask_for_it() {
    let text = spec::BUILTIN.to_string()
        + "\n[notch.pitch]\nfrequency = \"9 rad/s\"\ndamping = 0.5\ndepth = 0.1\n";
    assert_eq!(spec::parse("spec.toml", &text).unwrap().law.notch, pitch());
    assert!(spec::builtin().unwrap().law.notch.is_empty());
    let wrong = text.replace("depth = 0.1", "deep = 0.1");
    let report = spec::parse("spec.toml", &wrong).unwrap_err().to_string();
    assert!(report.contains("depth"), "{report}");
}
