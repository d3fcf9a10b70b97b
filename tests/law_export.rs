//! The law for small deviations is that of the exported C.
//!
//! The C export is compiled with `cc` and differentiated by central
//! differences. Its state space must be the one that is read from the block
//! diagram, and the margins of the loops that it closes must be those that the
//! verification finds.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use coaxdesign::control::axis::{Channel, ChannelGains, GainSet};
use coaxdesign::control::closed_loop::{LawLoop, PlantLoop};
use coaxdesign::control::law::{LawPoint, LawSettings, LawTable, TurnCoordination};
use coaxdesign::control::loops::{Cut, FrequencyModel};
use coaxdesign::control::metrics::{self, Sampled};
use coaxdesign::control::models::build;
use coaxdesign::control::plant::Inversion;
use coaxdesign::control::tuning::{default_grid, start_gains};
use coaxdesign::control::verify::verify;
use coaxdesign::control::{spec, testbed};
use coaxdesign::export::{Format, Options, Precision, export};
use coaxdesign::law::mdi::{Notch, Notches};
use coaxdesign::law::{Diagram, LinearLaw, Program};
use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::{Provenance, Schedule, hash};
use coaxdesign::units::KNOT;
use nalgebra::{DMatrix, Matrix4};
use num_complex::Complex64 as C;

const LIMITS: [[f64; 2]; 4] = [[-1e3, 1e3]; 4];
/// Measurements and demands but for the mode.
const INPUTS: usize = 13;

/// A law over speed of the published matrices, with a notch filter in pitch.
fn table() -> LawTable {
    let settings = LawSettings {
        kappa: 0.25,
        hybrid_feedforward: true,
        reference_delay: 0.15,
        roll_frequency: 2.0,
        pitch_frequency: 1.8,
        attitude_damping: 0.8,
        yaw_time_constant: 0.5,
        heave_time_constant: 2.0,
        notch: Notches {
            pitch: Some(Notch { frequency: 12.0, damping: 0.4, depth: 0.1 }),
            ..Notches::default()
        },
    };
    let points = [0.0, 10.0, 20.0, 30.0, 40.0]
        .map(|speed| {
            let mut gains = GainSet::default();
            for c in Channel::ALL {
                gains[c.index()] = start_gains(c, 0.152, [0.0, 10.0]);
            }
            let plant = testbed::plant(speed, &testbed::NOMINAL);
            LawPoint { speed, gains, inversion: Inversion::new(&plant).unwrap() }
        })
        .to_vec();
    LawTable::new(points, settings, TurnCoordination { speed: 25.7, width: 5.0 }).unwrap()
}

/// The exported law as a program that differentiates itself.
struct Exported {
    directory: tempfile::TempDir,
    diagram: Diagram,
}

impl Exported {
    fn new(table: &LawTable, step: f64) -> Self {
        let provenance = Provenance {
            generator: "test".into(),
            problem_hash: hash(["a"]),
            specification_hash: hash(["b"]),
        };
        let schedule = Schedule::new("test", table, testbed::HARDWARE, LIMITS, true, provenance);
        let options = Options {
            name: "law".into(),
            step,
            precision: Precision::Double,
            speed: 0.0,
            binaries: Vec::new(),
        };
        let directory = tempfile::tempdir().unwrap();
        for file in export(&schedule, Vec::new(), Format::C, &options).unwrap() {
            std::fs::write(directory.path().join(file.name), file.bytes).unwrap();
        }
        let main =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/crosscheck/export/linearise.c");
        let built = Command::new("cc")
            .args(["-std=c99", "-O1", "-I"])
            .arg(directory.path())
            .arg(main)
            .arg(directory.path().join("law_law.c"))
            .args(["-lm", "-o"])
            .arg(directory.path().join("linearise"))
            .output()
            .unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        // As the export makes it.
        let mut diagram = table.diagram(step, LIMITS, false, true);
        diagram.monitors.clear();
        Self { directory, diagram: diagram.pruned() }
    }

    /// The law for small deviations after some steps at these inputs: its
    /// delay lines stand outside, as in [`LinearLaw`].
    fn linear(&self, inputs: &[f64; 14], steps: usize) -> LinearLaw {
        let (memories, lines) = (self.diagram.stores.len(), self.diagram.feeds.len());
        let mut process = Command::new(self.directory.path().join("linearise"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let numbers: Vec<String> = inputs.iter().map(|x| format!("{x:?}")).collect();
        let mut to = process.stdin.take().unwrap();
        writeln!(to, "{memories} {lines} {steps} 1e-5 {}", numbers.join(" ")).unwrap();
        drop(to);
        let out = process.wait_with_output().unwrap();
        assert!(out.status.success());
        let rows: Vec<Vec<f64>> = String::from_utf8(out.stdout)
            .unwrap()
            .lines()
            .map(|l| l.split_whitespace().map(|x| x.parse().unwrap()).collect())
            .collect();
        assert_eq!(rows.len(), memories + INPUTS + lines);
        // Seeds by answers; memories without a start say start and mode.
        let by = DMatrix::from_fn(memories + lines + 4, rows.len(), |i, j| rows[j][i]);
        let kept: Vec<usize> = (2..memories).collect();
        let seeds: Vec<usize> = (memories..rows.len()).collect();
        let answers: Vec<usize> =
            (memories + lines..memories + lines + 4).chain(memories..memories + lines).collect();
        let name = |w: coaxdesign::law::Wire| self.diagram.block(w).name.clone();
        let outputs = self.diagram.outputs.iter().copied();
        LinearLaw {
            step: 0.0,
            states: self.diagram.stores[2..].iter().map(|s| name(s.memory)).collect(),
            inputs: (0..INPUTS)
                .map(|k| format!("input {k}"))
                .chain(self.diagram.feeds.iter().map(|f| name(f.line)))
                .collect(),
            outputs: outputs.chain(self.diagram.feeds.iter().map(|f| f.input)).map(name).collect(),
            lines,
            a: by.select_rows(&kept).select_columns(&kept),
            b: by.select_rows(&kept).select_columns(&seeds),
            c: by.select_rows(&answers).select_columns(&kept),
            d: by.select_rows(&answers).select_columns(&seeds),
        }
    }
}

/// Trimmed flight in still air, and demands that hold it.
fn inputs(table: &LawTable, speed: f64, velocity_mode: bool) -> [f64; 14] {
    let trim = table.at(speed).inversion.trim;
    let [u, v, w] = trim.velocity_body;
    let ((sp, cp), (st, ct)) = (trim.roll.sin_cos(), trim.pitch.sin_cos());
    let lifted = v * sp + w * cp;
    let (forward, right, down) = (u * ct + lifted * st, v * cp - w * sp, lifted * ct - u * st);
    let (mode, first, second) =
        if velocity_mode { (1.0, forward, right) } else { (0.0, trim.roll, trim.pitch) };
    [u, v, w, 0.0, 0.0, 0.0, trim.roll, trim.pitch, forward, mode, first, second, 0.0, down]
}

/// At twelve conditions, with demands that move the references: every entry of
/// the state space to 1e-6 of its size.
#[test]
fn the_linear_law_is_the_differences_of_the_exported_c() {
    let table = table();
    let step = 0.01;
    let exported = Exported::new(&table, step);
    let tables = table.breakpoints();
    let diagram = &exported.diagram;
    let program = Program::new(diagram, &tables);
    let mut compared = 0;
    for speed in [2.0, 8.0, 17.0, 24.0, 26.5, 33.0] {
        for velocity_mode in [false, true] {
            let mut x = inputs(&table, speed, velocity_mode);
            x[10] += 0.02;
            x[11] -= 0.03;
            x[12] = 0.02;
            x[13] += 0.2;
            let steps = 40;
            let found = exported.linear(&x, steps);
            let mut all = vec![0.0; program.input_count()];
            all[..14].copy_from_slice(&x);
            let mut memory = program.memory();
            for _ in 0..steps {
                program.run(&mut memory, &all);
                program.advance(&mut memory);
            }
            program.run(&mut memory, &all);
            let law = LinearLaw::new(diagram, &tables, &program, &memory);
            assert_eq!(law.states, found.states);
            // What the law is engaged with does not count when it flies.
            let flown = law.inputs.len() - law.lines;
            let columns: Vec<usize> = (0..INPUTS).chain(flown..law.inputs.len()).collect();
            for (name, wanted, found) in [
                ("a", law.a.clone(), &found.a),
                ("b", law.b.select_columns(&columns), &found.b),
                ("c", law.c.clone(), &found.c),
                ("d", law.d.select_columns(&columns), &found.d),
            ] {
                assert_eq!(wanted.shape(), found.shape(), "{name}");
                for (k, (a, b)) in wanted.iter().zip(found.iter()).enumerate() {
                    assert!(
                        (a - b).abs() < 1e-6 * a.abs().max(1.0),
                        "{name} {k} at {speed}: {a} {b}"
                    );
                }
            }
            compared += 1;
        }
    }
    assert_eq!(compared, 12);
}

/// Margins at every effector, inner loops alone and with the outer ones, and
/// rejection in bank, pitch, V_z and V_y: the verification's loops, in the
/// limit of a short step, and those that the compiled export closes at its
/// shortest step.
#[test]
fn margins_are_those_of_the_exported_c() {
    let table = table();
    let step = 1e-4;
    let exported = Exported::new(&table, step);
    let steps = (table.settings.reference_delay / step).round() as i32;
    let mut grid = default_grid(0.01, 100.0, 500);
    grid.push(metrics::LOWEST_REJECTION_FREQUENCY);
    grid.sort_by(f64::total_cmp);
    let grid: Arc<[f64]> = grid.into();
    let (mut compared, mut turns) = (0, 0);
    for speed in [2.0, 13.0, 24.5, 33.0] {
        let plant = testbed::plant(speed, &testbed::NOMINAL);
        let frequency = FrequencyModel::new(&plant, testbed::HARDWARE, 0.0).unwrap();
        let plants: Vec<_> = grid.iter().map(|&w| frequency.states(w)).collect();
        for velocity_mode in [false, true] {
            // Started, and at rest: one step.
            let law = exported.linear(&inputs(&table, speed, velocity_mode), 1);
            let own = LawLoop::new(&table, speed, velocity_mode);
            let of = PlantLoop::new(&frequency, &own);
            // The exported loop: M = I - K X, in still air.
            let (mut matrices, mut wholes) = (Vec::new(), Vec::new());
            for (&w, x) in grid.iter().zip(&plants) {
                let z = C::from_polar(1.0, w * step);
                // Delay lines stay open here, so that what they give can be
                // moved; closed, they are z^-n.
                let closed = law.response(z, z.powi(-steps)).unwrap();
                let forward = |k: usize| {
                    // Differences of the law's own airspeed.
                    own.law().d[(own.law().output("v_x").unwrap(), k)]
                };
                let k = |i: usize, s: usize| closed[(i, s)] + closed[(i, 8)] * forward(s);
                let m = Matrix4::from_fn(|i, j| {
                    let unit = if i == j { C::new(1.0, 0.0) } else { C::new(0.0, 0.0) };
                    (0..8).fold(unit, |sum, s| sum - k(i, s) * x[s][j])
                });
                matrices.push(m);
                // What the lines give, moved while they stay closed.
                wholes.push(moved(&law, z, z.powi(-steps)));
            }
            for channel in [Channel::Roll, Channel::Pitch, Channel::Yaw, Channel::Heave] {
                let e = channel.axis().effector().index();
                let found: Vec<C> = matrices
                    .iter()
                    .map(|m| {
                        let minor = m.remove_row(e).remove_column(e);
                        m.determinant() / minor.determinant() - 1.0
                    })
                    .collect();
                let wanted: Vec<C> =
                    grid.iter().map(|&w| of.at(w).cut(channel, Cut::Effector)).collect();
                let margins = [&found, &wanted]
                    .map(|l| metrics::margins(Sampled { omega: &grid, value: l, exact: None }));
                let [a, b] = margins.map(|m| [m.phase, m.gain_up, m.gain_down, m.crossover]);
                for (a, b) in a.into_iter().zip(b) {
                    match (a, b) {
                        (Some(a), Some(b)) => {
                            assert!(
                                (a - b).abs() < 1e-3 * b.max(1.0),
                                "{channel} {speed}: {a} {b}"
                            );
                        }
                        (a, b) => assert_eq!(a.is_some(), b.is_some(), "{channel} {speed}"),
                    }
                }
                compared += 1;
            }
            let mut held =
                vec![(Channel::Roll, "delayed_phi", 6), (Channel::Pitch, "delayed_theta", 7)];
            if velocity_mode {
                held.push((Channel::Vy, "due_v_y", 8));
            }
            for (channel, line, state) in held {
                let place = law.inputs.iter().position(|n| n == line).unwrap() - INPUTS;
                let found: Vec<C> = grid
                    .iter()
                    .enumerate()
                    .map(|(n, _)| {
                        // An error less by p is a line that gives less by p.
                        let p = nalgebra::Vector4::from_fn(|i, _| -wholes[n][(i, place)]);
                        let sticks = matrices[n].lu().solve(&p).unwrap();
                        let state_of = |s: usize| {
                            (0..4)
                                .fold(C::new(0.0, 0.0), |sum, j| sum + plants[n][s][j] * sticks[j])
                        };
                        let moved = if state < 8 {
                            state_of(state)
                        } else {
                            let row = own.law().output("v_y").unwrap();
                            (0..8).fold(C::new(0.0, 0.0), |sum, s| {
                                sum + state_of(s) * own.law().d[(row, s)]
                            })
                        };
                        C::new(1.0, 0.0) + moved
                    })
                    .collect();
                let wanted: Vec<C> = grid.iter().map(|&w| of.at(w).sensitivity(channel)).collect();
                let [a, b] = [&found, &wanted]
                    .map(|s| metrics::rejection(Sampled { omega: &grid, value: s, exact: None }));
                assert!((a.peak - b.peak).abs() < 1e-3 * b.peak, "{channel} {speed}");
                match (a.bandwidth, b.bandwidth) {
                    (Some(a), Some(b)) => {
                        assert!((a - b).abs() < 1e-3, "{channel} {speed}: {a} {b}")
                    }
                    (a, b) => assert_eq!(a.is_some(), b.is_some(), "{channel} {speed}"),
                }
                turns += usize::from(channel == Channel::Vy);
            }
        }
    }
    assert_eq!((compared, turns), (32, 4));
}

/// Sticks per change of what each delay line gives, the lines closed.
fn moved(law: &LinearLaw, z: C, late: C) -> DMatrix<C> {
    let n = law.states.len();
    let complex = |m: &DMatrix<f64>| m.map(|v| C::new(v, 0.0));
    let resolvent = DMatrix::<C>::identity(n, n) * z - complex(&law.a);
    let lines = law.lines;
    let b = complex(&law.b).columns(INPUTS, lines).into_owned();
    let whole = complex(&law.c) * resolvent.lu().solve(&b).unwrap()
        + complex(&law.d).columns(INPUTS, lines).into_owned();
    let around = DMatrix::<C>::identity(lines, lines) - whole.rows(4, lines).into_owned() * late;
    let given = around.lu().try_inverse().unwrap();
    whole.rows(0, 4).into_owned() * given
}

/// Loops that the compiled export closes around a plant.
struct ExportedLoop<'a> {
    law: LinearLaw,
    /// Derivative of the velocity forward by states: the airspeed in still air.
    forward: Vec<f64>,
    step: f64,
    late: i32,
    frequency: &'a FrequencyModel,
}

impl ExportedLoop<'_> {
    /// M = I − K X.
    fn matrix(&self, omega: f64) -> Matrix4<C> {
        let z = C::from_polar(1.0, omega * self.step);
        let closed = self.law.response(z, z.powi(-self.late)).unwrap();
        let x = self.frequency.states(omega);
        let k = |i: usize, s: usize| closed[(i, s)] + closed[(i, 8)] * self.forward[s];
        Matrix4::from_fn(|i, j| {
            let unit = if i == j { C::new(1.0, 0.0) } else { C::new(0.0, 0.0) };
            (0..8).fold(unit, |sum, s| sum - k(i, s) * x[s][j])
        })
    }

    fn cut_at_effector(&self, channel: Channel, omega: f64) -> C {
        let e = channel.axis().effector().index();
        let m = self.matrix(omega);
        m.determinant() / m.remove_row(e).remove_column(e).determinant() - 1.0
    }
}

/// Without the gains that hold a channel's quantity.
fn without_hold(table: &LawTable, channel: Channel) -> LawTable {
    table.with_gains(|k| {
        let mut gains = table.points()[k].gains;
        let mut values = gains[channel.index()].array();
        for gain in channel.gains().iter().filter(|g| channel.holds(**g)) {
            values[gain.index()] = 0.0;
        }
        gains[channel.index()] = ChannelGains::new(values[0], values[1], values[2]);
        gains
    })
}

/// Every margin and rejection of the kept design's verification is that of the
/// loops that its compiled export closes around the same aircraft: all channels
/// in hover and at the speeds at which tuning once knew less than flight. The
/// outer loops meet what is asked of them there.
#[test]
fn val_verification_of_the_kept_design_is_that_of_its_exported_c() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    let schedule = Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let table = schedule.law().unwrap();
    let mut spec = spec::builtin().unwrap_or_else(|r| panic!("{r}"));
    spec.models.truncate(1);
    let problem = builtin_named("coax2d").unwrap_or_else(|r| panic!("{r}")).problem;
    // Breakpoints, and beside three of them: there the tables have one slope.
    let speeds = [0.0, 10.0, 25.0, 50.0, 52.5, 77.5, 80.0, 87.5, 90.0].map(|kt| kt * KNOT);
    let built = build(&problem, &spec.models, &speeds, &|| ()).unwrap_or_else(|e| panic!("{e}"));
    let found = verify(&table, &built.set, &spec.hardware, &spec).unwrap();
    let step = 1e-4;
    let late = (table.settings.reference_delay / step).round() as i32;
    let whole = Exported::new(&table, step);
    let free = Channel::ALL.map(|c| Exported::new(&without_hold(&table, c), step));
    let mut grid = default_grid(0.01, 100.0, 900);
    grid.push(metrics::LOWEST_REJECTION_FREQUENCY);
    grid.sort_by(f64::total_cmp);
    let mut compared = 0;
    for (plants, speed) in built.set.plants.iter().zip(speeds) {
        let frequency = FrequencyModel::new(&plants[0], spec.hardware, 0.0).unwrap();
        let forward: Vec<f64> = {
            let law = table.linear(speed, false);
            law.d.row(law.output("v_x").unwrap()).iter().take(8).copied().collect()
        };
        let of = |exported: &Exported, velocity_mode: bool| ExportedLoop {
            law: exported.linear(&inputs(&table, speed, velocity_mode), 1),
            forward: forward.clone(),
            step,
            late,
            frequency: &frequency,
        };
        let modes = [of(&whole, false), of(&whole, true)];
        for row in found.rows.iter().filter(|r| (r.speed_m_s - speed).abs() < 1e-6) {
            let channel = *Channel::ALL.iter().find(|c| c.name() == row.axis).unwrap();
            let outer = channel.is_outer();
            let own = &modes[usize::from(outer)];
            let open = of(&free[channel.index()], outer);
            let sensitivity = |w: f64| open.matrix(w).determinant() / own.matrix(w).determinant();
            let sampled = |f: &dyn Fn(f64) -> C| -> Vec<C> { grid.iter().map(|&w| f(w)).collect() };
            let rejection = metrics::rejection(Sampled {
                omega: &grid,
                value: &sampled(&sensitivity),
                exact: Some(&sensitivity),
            });
            let margins = |f: &dyn Fn(f64) -> C| {
                let value = sampled(f);
                metrics::margins(Sampled { omega: &grid, value: &value, exact: Some(f) })
            };
            let first = if outer {
                margins(&|w| sensitivity(w).inv() - 1.0)
            } else {
                margins(&|w| own.cut_at_effector(channel, w))
            };
            let second = margins(&|w| modes[1].cut_at_effector(channel, w));
            let least = |a: Option<f64>, b: Option<f64>| match (a, b) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            };
            let decibels = |x: Option<f64>| x.map(metrics::decibels);
            let phase = least(first.phase, second.phase).map(f64::to_degrees);
            for (what, ours, theirs) in [
                ("DRB", row.drb_rad_s, rejection.bandwidth),
                ("DRP", Some(row.drp_db), Some(metrics::decibels(rejection.peak))),
                ("crossover", row.crossover_rad_s, first.crossover),
                ("GM up", row.gm_up_db, decibels(least(first.gain_up, second.gain_up))),
                ("GM down", row.gm_down_db, decibels(least(first.gain_down, second.gain_down))),
                ("PM", row.pm_deg, phase),
            ] {
                // Decibels as the factors that they are; what is left is the
                // export's step.
                let factor = what.starts_with('G') || what == "DRP";
                // At a breakpoint slopes of the tables jump; the export's differences
                // straddle it off the middle, since trims reach it to rounding only.
                let [room, part] = if row.breakpoint { [1.01, 5e-3] } else { [1.001, 1e-3] };
                let same = match (ours, theirs) {
                    (Some(a), Some(b)) if factor => (a - b).abs() < metrics::decibels(room),
                    (Some(a), Some(b)) => (a - b).abs() < part * b.abs(),
                    (a, b) => a.is_none() && b.is_none(),
                };
                let kt = speed / KNOT;
                assert!(same, "{channel} {what} at {kt:.0} kt: {ours:?}, exported {theirs:?}");
            }
            if outer {
                assert!(rejection.bandwidth.unwrap() > 0.0999, "{channel} {speed}");
                assert!(phase.unwrap() > 44.99, "{channel} {speed}: {phase:?}");
            }
            compared += 1;
        }
    }
    // Four inner axes and vx everywhere; vy has the whole bank at the first three.
    assert_eq!(compared, 9 * 5 + 3);
    let fading: Vec<&str> = found.not_required.iter().map(|n| n.axis.as_str()).collect();
    assert!(!fading.is_empty() && fading.iter().all(|axis| *axis == "vy"), "{fading:?}");
}
