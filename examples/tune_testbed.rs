use coaxdesign::control::{axis::*, loops::*, metrics, testbed, tuning::*};
use std::sync::Arc;
fn main() {
    let robust = std::env::args().nth(1).as_deref() == Some("robust");
    let speeds: Vec<f64> = (0..10).map(|k| k as f64 * 10.0 * 69.5 / 80.0).collect();
    let set = testbed::model_set(&speeds, robust);
    let settings = LawSettings {
        kappa: 0.25,
        hybrid_feedforward: true,
        reference_delay: 0.15,
        roll_frequency: 2.0,
        pitch_frequency: 2.0,
        attitude_damping: 0.8,
        yaw_time_constant: 0.5,
        heave_time_constant: 2.0,
    };
    let t = |gm: f64, pm: f64, drb: f64, drp: f64, wmin: Option<f64>, wmax: Option<f64>| Targets {
        gain_up: metrics::from_decibels(gm),
        gain_down: metrics::from_decibels(gm),
        phase: pm.to_radians(),
        drb: Some(drb),
        drp: Some(metrics::from_decibels(drp)),
        crossover_min: wmin,
        crossover_max: wmax,
    };
    let spec =
        |drb: f64, odrb: f64, w: Option<f64>, ow: Option<f64>, x: Option<f64>, ratio: [f64; 2]| {
            ChannelSpec {
                nominal: t(6.0, 45.0, drb, 5.0, w, x),
                off_nominal: t(4.5, 35.0, odrb, 6.0, ow, x.map(|_| 5.0)),
                integral_ratio: ratio,
                priority: 1.0,
                speeds: [0.0, 200.0],
            }
        };
    let ot = |pm: f64| Targets {
        drb: Some(0.1),
        drp: Some(metrics::from_decibels(4.0)),
        ..t(6.0, pm, 0.1, 4.0, None, None)
    };
    let outer = ChannelSpec {
        nominal: ot(43.0),
        off_nominal: Targets {
            drb: Some(0.08),
            drp: Some(metrics::from_decibels(5.0)),
            ..t(4.5, 33.0, 0.1, 4.0, None, None)
        },
        integral_ratio: [0.02, 0.5],
        priority: 1.0,
        speeds: [0.0, 200.0],
    };
    let channels = vec![
        (Channel::Roll, spec(0.7, 0.6, Some(2.0), Some(1.7), Some(4.5), [0.1, 2.0])),
        (Channel::Pitch, spec(0.5, 0.42, Some(1.5), Some(1.25), Some(4.5), [0.1, 2.0])),
        (Channel::Yaw, spec(0.7, 0.6, Some(1.5), Some(1.25), Some(4.5), [0.0, 10.0])),
        (Channel::Heave, spec(1.0, 0.85, None, None, None, [0.1, 10.0])),
        (Channel::Vx, outer),
        (Channel::Vy, outer),
    ];
    let problem = TuningProblem {
        set: &set,
        between: Vec::new(),
        hardware: testbed::HARDWARE,
        settings,
        channels,
        options: TuningOptions::default(),
    };
    let clock = std::time::Instant::now();
    let out = problem.tune(None).unwrap();
    println!(
        "time {:.2} s, {:?}, sweeps {} change {:.3}",
        clock.elapsed().as_secs_f64(),
        out.stats,
        out.sweeps,
        out.last_change
    );
    for (c, m) in &out.merits {
        println!("{c} total {:.4} activity {:.4} worst {:.4}", m.total, m.activity, m.worst());
    }
    let grid: Arc<[f64]> = default_grid(0.01, 100.0, 2400).into();
    for (v, kt) in speeds.iter().enumerate() {
        for (m, model) in set.models.iter().enumerate() {
            if m > 0 && v % 4 != 0 {
                continue;
            }
            let lm = LoopModel::new(
                &set.plants[v][m],
                &out.inversions[v],
                &settings,
                testbed::HARDWARE,
                model.extra_delay,
                grid.clone(),
            )
            .unwrap();
            for c in &Channel::ALL {
                let x = out.gains[v][c.index()].values(*c);
                let l = lm.channel(&out.gains[v], *c, &[Cut::Effector]);
                let curve = l.loop_curve(0, &x);
                let mg = metrics::margins(metrics::Sampled::new(&grid, &curve));
                let s = l.sensitivity_curve(&x);
                let r = metrics::rejection(metrics::Sampled::new(&grid, &s));
                let u = l.activity_curve(&x);
                let j = metrics::activity(metrics::Sampled::new(&grid, &u), metrics::ACTIVITY_BAND);
                println!(
                    "{kt:4.0} {:10} {:6} {:?} wc {:.2} pm {:.1} gu {:.1} gd {:.1} disk {:.2} drb {:.3} drp {:.2} J {:.2}",
                    model.name,
                    c.name(),
                    x.iter().map(|v| (v * 1000.0).round() / 1000.0).collect::<Vec<_>>(),
                    mg.crossover.unwrap_or(0.0),
                    mg.phase.unwrap_or(3.0).to_degrees(),
                    metrics::decibels(mg.gain_up.unwrap_or(99.0)),
                    metrics::decibels(mg.gain_down.unwrap_or(99.0)),
                    mg.disk,
                    r.bandwidth.unwrap_or(99.0),
                    metrics::decibels(r.peak),
                    j
                );
            }
        }
    }
}
