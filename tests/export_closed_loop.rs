//! The exported C law flies the paper's manoeuvre as the library's own law does.
//!
//! The C export is compiled with `cc` into a program that is asked for sticks
//! once a control period; the simulator and the manoeuvre are the library's.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use coaxdesign::control::law::{Demand, Horizontal, Measurement};
use coaxdesign::export::{Format, Options as ExportOptions, Precision, export};
use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::{Flight, Options, Status, maneuver};
use coaxdesign::trim::{Guess, trim};
use coaxdesign::vehicle::Vehicle;

/// What the flights may differ by, relative to each state's usual changes, and
/// for sticks to their full travel of 100 %.
const TOLERANCE: f64 = 1e-6;

/// A law in another process.
struct Foreign {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Foreign {
    fn new(schedule: &Schedule, step: f64, directory: &Path) -> Self {
        let options = ExportOptions {
            name: "law".into(),
            step,
            precision: Precision::Double,
            speed: 0.0,
            binaries: Vec::new(),
        };
        for file in export(schedule, Vec::new(), Format::C, &options).unwrap() {
            std::fs::write(directory.join(file.name), file.bytes).unwrap();
        }
        let server = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/crosscheck/export/server.c");
        let program = directory.join("server");
        let built = Command::new("cc")
            .args(["-std=c99", "-O1", "-I"])
            .arg(directory)
            .arg(server)
            .arg(directory.join("law_law.c"))
            .args(["-lm", "-o"])
            .arg(&program)
            .output()
            .unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        let mut process =
            Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (to, from) = (process.stdin.take().unwrap(), process.stdout.take().unwrap());
        Self { process, to, from: BufReader::new(from) }
    }

    /// Engages with given sticks, or steps.
    fn ask(&mut self, m: &Measurement, demand: &Demand, given: Option<[f64; 4]>) -> [f64; 4] {
        let (mode, commands) = match demand.horizontal {
            Horizontal::Attitude { roll, pitch } => (0.0, [roll, pitch]),
            Horizontal::Velocity { forward, right } => (1.0, [forward, right]),
        };
        let mut numbers = vec![f64::from(given.is_some())];
        numbers.extend(m.velocity_body.iter().chain(&m.rates));
        numbers.extend([m.roll, m.pitch, m.airspeed, mode]);
        numbers.extend(commands);
        numbers.extend([demand.heading_rate, demand.vertical_velocity]);
        numbers.extend(given.unwrap_or_default());
        let line: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
        writeln!(self.to, "{}", line.join(" ")).unwrap();
        self.to.flush().unwrap();
        let mut answer = String::new();
        self.from.read_line(&mut answer).unwrap();
        let sticks: Vec<f64> = answer.split_whitespace().map(|x| x.parse().unwrap()).collect();
        sticks.try_into().unwrap()
    }
}

impl Drop for Foreign {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn the_c_export_flies_the_papers_manoeuvre_like_our_own_law() {
    // Without interactions, whose tables take long to build.
    let mut problem = builtin_named("coax2d").unwrap().problem;
    problem.inflow.interactions = false;
    let vehicle = Vehicle::new(&problem).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("designs/coax2d/schedule.json");
    let schedule = Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let law = Autopilot { table: schedule.law().unwrap(), stick_limits: schedule.stick_limits };
    let maneuver = maneuver::builtin("accel-climb-turn").unwrap().unwrap();
    let condition = maneuver.start.condition;
    let guess = Guess::estimate(&vehicle, &condition);
    let start = trim(&vehicle, condition, &guess, &Default::default()).into_converged().unwrap();
    let specification = coaxdesign::control::spec::builtin().unwrap();
    let options = Options::new(specification.hardware, specification.pitch_rate_limit);

    let mut own = Flight::new(&vehicle, &start, Some(&law), &maneuver, &options).unwrap();
    let mut track: Vec<(Vec<f64>, [f64; 3], [f64; 4])> = Vec::new();
    let status = own.fly(|flight| {
        let s = &flight.simulator;
        track.push((s.state().to_vec(), s.position(), flight.sticks()));
    });
    assert_eq!(status, Status::Completed);

    let flight = Flight::new(&vehicle, &start, Some(&law), &maneuver, &options).unwrap();
    let held = *flight.held();
    let mut simulator = flight.simulator;
    let directory = tempfile::tempdir().unwrap();
    let mut foreign = Foreign::new(&schedule, simulator.period(), directory.path());
    let demand = maneuver.demand(0.0, &held).unwrap();
    foreign.ask(&simulator.settled(), &demand, Some(start.point().sticks));
    let scales: Vec<f64> = vehicle.layout.states.iter().map(|s| s.scale).collect();
    let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
    for (state, position, own_sticks) in &track {
        let demand = maneuver.demand(simulator.time(), &held).unwrap();
        let base = foreign.ask(&simulator.measure(), &demand, None);
        let inputs = maneuver.inputs(simulator.time());
        let sticks: [f64; 4] = std::array::from_fn(|j| {
            let [low, high] = schedule.stick_limits[j];
            (base[j] + inputs[j]).clamp(low, high)
        });
        for ((a, b), scale) in simulator.state().iter().zip(state).zip(&scales) {
            worst = worst.max((a - b).abs() / scale);
        }
        for (a, b) in simulator.position().iter().zip(position) {
            worst = worst.max((a - b).abs());
        }
        for ((a, b), first) in sticks.iter().zip(own_sticks).zip(track[0].2) {
            worst = worst.max((a - b).abs() / 100.0);
            moved = moved.max((b - first).abs());
        }
        simulator.advance(sticks).unwrap();
    }
    // It was a manoeuvre, and both flew it.
    assert!(moved > 5.0, "{moved}");
    assert!(worst < TOLERANCE, "the flights differ by {worst:e}");
}
