//! Margins and rejection against python-control 0.10
//! (`python tests/crosscheck/margins.py` prints the numbers).

use approx::assert_relative_eq;
use coaxdesign::control::metrics::{Sampled, margins, rejection};
use num_complex::Complex64 as C;

struct Reference {
    name: &'static str,
    response: fn(C) -> C,
    crossover: f64,
    phase_deg: f64,
    up: Option<f64>,
    down: Option<f64>,
    disk: f64,
    drb: f64,
    peak: f64,
}

fn attitude(s: C) -> C {
    let delay = (1.0 - 0.05 * s + 0.01 / 12.0 * s * s) / (1.0 + 0.05 * s + 0.01 / 12.0 * s * s);
    (2.0 * s * s + 2.2 * s + 0.4) / (s * s * s) * 900.0 / (s * s + 48.0 * s + 900.0) * delay
}

fn unstable(s: C) -> C {
    6.0 * (s + 1.5) / ((s - 0.8) * (s + 0.2)) * 20.0 / (s + 20.0) * 8.0 / (s + 8.0)
}

fn resonant(s: C) -> C {
    1.2 / s * (s * s + 0.5 * s + 9.0) / (s * s + 0.3 * s + 16.0) * 25.0 / (s + 25.0)
}

const REFERENCES: [Reference; 3] = [
    Reference {
        name: "attitude",
        response: attitude,
        crossover: 2.164501,
        phase_deg: 43.01699,
        up: Some(4.857164),
        down: Some(9.166371),
        disk: 0.778433,
        drb: 1.17471,
        peak: 1.466750,
    },
    Reference {
        name: "unstable",
        response: unstable,
        crossover: 5.060377,
        phase_deg: 20.25460,
        up: Some(2.978740),
        down: Some(7.136198),
        disk: 0.347681,
        drb: 2.69538,
        peak: 3.079272,
    },
    Reference {
        name: "resonant",
        response: resonant,
        crossover: 4.278649,
        phase_deg: 89.96562,
        up: None,
        down: None,
        disk: 1.747525,
        drb: 0.66010,
        peak: 1.042817,
    },
];

/// Tolerances: python-control prints seven digits; its sensitivities are read
/// from a grid of 3.5e-5 relative spacing.
#[test]
fn val_metrics_agree_with_python_control() {
    let omega: Vec<f64> = (0..1500).map(|k| 1e-3 * 10f64.powf(f64::from(k) / 250.0)).collect();
    for r in REFERENCES {
        let l = |w: f64| (r.response)(C::new(0.0, w));
        let s = |w: f64| (1.0 + l(w)).inv();
        let curve: Vec<C> = omega.iter().map(|&w| l(w)).collect();
        let m = margins(Sampled { omega: &omega, value: &curve, exact: Some(&l) });
        println!("{}", r.name);
        assert_relative_eq!(m.crossover.unwrap(), r.crossover, max_relative = 1e-6);
        assert_relative_eq!(m.phase.unwrap().to_degrees(), r.phase_deg, max_relative = 1e-6);
        for (ours, theirs) in [(m.gain_up, r.up), (m.gain_down, r.down)] {
            assert_eq!(ours.is_some(), theirs.is_some());
            if let (Some(ours), Some(theirs)) = (ours, theirs) {
                assert_relative_eq!(ours, theirs, max_relative = 1e-6);
            }
        }
        assert_relative_eq!(m.disk, r.disk, max_relative = 1e-5);
        let curve: Vec<C> = omega.iter().map(|&w| s(w)).collect();
        let d = rejection(Sampled { omega: &omega, value: &curve, exact: Some(&s) });
        assert_relative_eq!(d.bandwidth.unwrap(), r.drb, max_relative = 5e-5);
        assert_relative_eq!(d.peak, r.peak, max_relative = 1e-6);
    }
}

/// Without the exact response, crossings interpolated on the tuning grid agree
/// to a part in a thousand.
#[test]
fn interpolated_crossings_are_close() {
    let omega: Vec<f64> = coaxdesign::control::tuning::default_grid(0.002, 60.0, 300);
    let r = &REFERENCES[0];
    let curve: Vec<C> = omega.iter().map(|&w| (r.response)(C::new(0.0, w))).collect();
    let m = margins(Sampled::new(&omega, &curve));
    assert_relative_eq!(m.crossover.unwrap(), r.crossover, max_relative = 1e-3);
    assert_relative_eq!(m.phase.unwrap().to_degrees(), r.phase_deg, max_relative = 2e-3);
    assert_relative_eq!(m.gain_up.unwrap(), r.up.unwrap(), max_relative = 2e-3);
}
