//! Writes every kind of figure, drawn from made-up but realistic numbers, into a
//! folder, each as a file and all of them as one page.
//!
//! ```text
//! cargo run --example plot_gallery -- FOLDER
//! ```

use std::f64::consts::PI;
use std::path::PathBuf;

use coaxdesign::report::figures::{
    BodeChannel, Channel, Curve, CurvePanel, EigenvalueSet, ExclusionRegion, FrequencyResponse,
    MarginMap, Marks, PlaneView, SensitivityPanel, TrimSweep, bode_figure, eigenvalue_figure,
    gain_schedule_figure, heatmap_figure, interference_figure, nichols_figure, nyquist_figure,
    orbit_figure, sensitivity_figure, time_history_figure, trim_figure,
};
use coaxdesign::report::html::{Page, Section};
use coaxdesign::report::plot::{Axis, Figure, Legend, Panel, Series, Tone};
use coaxdesign::report::table::{Cell, Column, Digits, Highlight, Table};
use num_complex::Complex64;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder: PathBuf = std::env::args_os().nth(1).ok_or("usage: plot_gallery FOLDER")?.into();
    std::fs::create_dir_all(&folder)?;
    let figures = [
        ("trim", trim()),
        ("eigenvalues", eigenvalues()),
        ("bode", bode()),
        ("nyquist", nyquist_figure("Pitch loop cut at the actuator", &loops(), Some(&KITE))),
        ("nichols", nichols_figure("Pitch loop cut at the actuator", &loops(), Some(&KITE))),
        ("sensitivity", sensitivity()),
        ("gains", gains()),
        ("step", step()),
        ("orbit", orbit()),
        ("margins", margins()),
        ("interference", interference()),
        ("corner-cases", corner_cases()),
    ];
    let mut page = Page::new("Gallery").summary("Made-up numbers, to look at the figures.");
    for (name, figure) in figures {
        std::fs::write(folder.join(format!("{name}.svg")), figure.to_svg())?;
        for note in figure.notes() {
            println!("{name}: {note}");
        }
        page = page.section(Section::new(name).figure(figure, ""));
    }
    let mut table = Table::new(
        "Trim",
        vec![
            Column::number("airspeed", "kt", Digits::Decimals(0)),
            Column::number("power", "hp", Digits::Significant(4)),
            Column::text("status"),
        ],
    );
    table.row([
        Cell::from(0.0),
        Cell::from(74.88),
        Cell::from("converged").highlight(Highlight::Good),
    ]);
    table.row([
        Cell::from(80.0),
        Cell::from(8.125),
        Cell::from("stalled").highlight(Highlight::Bad),
    ]);
    page = page.section(Section::new("table").table(table));
    std::fs::write(folder.join("index.html"), page.to_html())?;
    Ok(())
}

const KITE: ExclusionRegion = ExclusionRegion { gain_margin_db: 6.0, phase_margin_deg: 45.0 };

fn sample(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from + (to - from) * i as f64 / (count - 1) as f64).collect()
}

fn log_sample(from: f64, to: f64, count: usize) -> Vec<f64> {
    sample(from.ln(), to.ln(), count).into_iter().map(f64::exp).collect()
}

fn map(x: &[f64], f: impl Fn(f64) -> f64) -> Vec<f64> {
    x.iter().map(|&x| f(x)).collect()
}

fn channel(name: &str, unit: &str, values: Vec<f64>) -> Channel {
    Channel { name: name.into(), unit: unit.into(), values }
}

fn curve(name: &str, style: usize, x: &[f64], y: Vec<f64>, marks: Marks) -> Curve {
    Curve { name: name.into(), style, x: x.to_vec(), y, marks }
}

fn panel(title: &str, quantity: &str, unit: &str, curves: Vec<Curve>) -> CurvePanel {
    CurvePanel {
        title: title.into(),
        quantity: quantity.into(),
        unit: unit.into(),
        minimum_span: 0.0,
        curves,
    }
}

fn trim() -> Figure {
    let sweep = |name: &str, style: usize, on: f64, marks: Marks| {
        let speed = sample(0.0, 80.0, if marks == Marks::Only { 5 } else { 17 });
        let wake = |v: f64| on * (-(v / 25.0).powi(2)).exp();
        let power = map(&speed, |v| {
            46.0 / (1.0 + (v / 28.0).powi(2)).sqrt() + 29.0 * wake(v) + 6e-5 * v.powi(3) + 6.0
        });
        let upper = map(&speed, |v| 50.0 + 7.6 * wake(v) + 2.0 * on * v / 80.0);
        TrimSweep {
            name: name.into(),
            style,
            marks,
            pitch_attitude_deg: map(&speed, |v| 3.2 - 0.0012 * v * v - 0.9 * wake(v)),
            roll_attitude_deg: map(&speed, |v| 0.02 * wake(v) * v),
            controls: vec![
                channel(
                    "collective",
                    "deg",
                    map(&speed, |v| {
                        9.8 + 1.6 * wake(v) - 2.8 * (v / 80.0) + 4.1 * (v / 80.0).powi(3)
                    }),
                ),
                channel("longitudinal cyclic", "deg", map(&speed, |v| 0.04 * v - 1.1 * wake(v))),
                channel(
                    "lateral cyclic",
                    "deg",
                    map(&speed, |v| 0.4 * (v / 20.0) * (-(v / 25.0)).exp() + 0.2 * wake(v)),
                ),
                channel("differential collective", "deg", map(&speed, |v| 0.8 * wake(v) - 0.1)),
            ],
            power: channel("power", "hp", power),
            thrust_share: vec![
                channel("lower", "%", map(&upper, |u| 100.0 - u)),
                channel("upper", "%", upper),
            ],
            speed,
        }
    };
    trim_figure(
        "Trim in level flight",
        "kt",
        &[
            sweep("interactions on", 0, 1.0, Marks::With),
            sweep("interactions off", 1, 0.0, Marks::With),
            sweep("published", 2, 0.93, Marks::Only),
        ],
    )
    .subtitle("CoAX 2D, 990 lb, sea level, standard day")
}

fn pair(frequency: f64, damping: f64) -> [Complex64; 2] {
    let re = -damping * frequency;
    let im = frequency * (1.0 - damping * damping).sqrt();
    [Complex64::new(re, im), Complex64::new(re, -im)]
}

fn eigenvalues() -> Figure {
    let set = |name: &str, style: usize, shift: f64| EigenvalueSet {
        name: name.into(),
        style,
        labels: Vec::new(),
        values: [
            pair(0.42 + shift, -0.25),
            pair(0.47 + shift, -0.12),
            pair(44.0 + 2.0 * shift, 0.31),
            pair(51.5, 0.28),
            pair(97.0, 0.13 + 0.1 * shift),
            pair(31.0, 0.8),
        ]
        .concat()
        .into_iter()
        .chain(
            [-1.15 - shift, -0.86, -0.38, -0.02, -12.0 - shift, -17.0]
                .map(|r| Complex64::new(r, 0.0)),
        )
        .collect(),
    };
    eigenvalue_figure(
        "Eigenvalues in hover",
        &[set("full order", 0, 0.0), set("averaged", 1, 0.06), set("reduced", 5, 0.12)],
        &[
            PlaneView { title: "all modes".into(), real: None, imaginary: None },
            PlaneView {
                title: "flight dynamics".into(),
                real: Some((-1.5, 0.3)),
                imaginary: Some((-0.05, 1.2)),
            },
        ],
    )
}

fn s(w: f64) -> Complex64 {
    Complex64::new(0.0, w)
}

fn respond(
    name: &str,
    style: usize,
    from: f64,
    to: f64,
    g: impl Fn(Complex64) -> Complex64,
) -> FrequencyResponse {
    let frequency = log_sample(from, to, 400);
    FrequencyResponse {
        name: name.into(),
        style,
        response: frequency.iter().map(|&w| g(s(w))).collect(),
        frequency,
    }
}

fn second_order(s: Complex64, w: f64, z: f64) -> Complex64 {
    w * w / (s * s + 2.0 * z * w * s + w * w)
}

fn bode() -> Figure {
    let rate = |gain: f64, pole: f64| {
        move |s: Complex64| {
            gain * s / (s * s - 0.1 * s + 0.18) * second_order(s, 42.0, 0.3) * pole / (s + pole)
        }
    };
    let channel = |title: &str, gain: f64| BodeChannel {
        title: title.into(),
        magnitude_unit: "dB".into(),
        valid: Some((0.2, 30.0)),
        responses: vec![
            respond("full order", 0, 0.03, 200.0, rate(gain, 60.0)),
            respond("averaged", 1, 0.03, 200.0, rate(0.93 * gain, 45.0)),
            respond("reduced, 8 states", 2, 0.03, 200.0, move |s| {
                gain * s / (s * s - 0.1 * s + 0.18)
            }),
        ],
    };
    bode_figure(
        "Rate responses in hover",
        &[
            channel("longitudinal cyclic to pitch rate", 0.35),
            channel("lateral cyclic to roll rate", 1.1),
        ],
    )
}

fn loops() -> Vec<FrequencyResponse> {
    let open = |gain: f64, lag: f64| {
        move |s: Complex64| {
            gain * (1.0 + s / 1.2) * (1.0 + s / 0.4) / (s * s * (1.0 + s / 12.0))
                * (-s * lag).exp()
                * 0.4
        }
    };
    vec![
        respond("nominal", 0, 0.1, 300.0, open(1.0, 0.05)),
        respond("mass +10 %", 1, 0.1, 300.0, open(0.86, 0.05)),
        respond("slow actuator", 3, 0.1, 300.0, open(1.0, 0.16)),
    ]
}

fn sensitivity() -> Figure {
    let axis = |title: &str, k: f64, drb: f64| SensitivityPanel {
        title: title.into(),
        bandwidth_spec: Some(drb),
        peak_spec_db: Some(5.0),
        responses: loops()
            .into_iter()
            .map(|r| FrequencyResponse {
                response: r.response.iter().map(|l| 1.0 / (1.0 + k * l)).collect(),
                ..r
            })
            .collect(),
    };
    sensitivity_figure(
        "Disturbance rejection at 40 kt",
        &[
            axis("roll", 1.0, 0.9),
            axis("pitch", 0.7, 0.5),
            axis("yaw", 0.8, 0.7),
            axis("heave", 0.45, 1.0),
        ],
    )
}

fn gains() -> Figure {
    let speed = sample(0.0, 80.0, 9);
    let names = ["roll", "pitch", "yaw"];
    let mut panels = Vec::new();
    for (row, (gain, unit)) in
        [("K_{P}", "1/s²"), ("K_{I}", "1/s³"), ("K_{D}", "1/s")].into_iter().enumerate()
    {
        for (column, axis) in names.iter().enumerate() {
            let base = 1.5 + row as f64 + 0.4 * column as f64;
            let tuned = map(&speed, |v| base * (1.0 - 0.2 * (v / 80.0)) + 0.05 * (v / 9.0).sin());
            let rough = map(&speed, |v| base * 1.1 + 0.3 * (v / 7.0).sin());
            panels.push(panel(
                if row == 0 { axis } else { "" },
                gain,
                unit,
                vec![
                    curve("scheduled", 0, &speed, tuned, Marks::With),
                    curve("tuned alone", 1, &speed, rough, Marks::Only),
                ],
            ));
        }
    }
    gain_schedule_figure("Gain schedule", "kt", &panels)
}

fn step() -> Figure {
    let t = sample(0.0, 8.0, 400);
    let answer = |delay: f64, w: f64, z: f64| {
        map(&t, |t| {
            let t = t - delay;
            if t < 0.0 {
                return 0.0;
            }
            let d = w * (1.0 - z * z).sqrt();
            10.0 * (1.0 - (-z * w * t).exp() * ((d * t).cos() + z * w / d * (d * t).sin()))
        })
    };
    let tiny = map(&t, |t| 0.08 * (3.0 * t).sin() * (-0.5 * t).exp());
    time_history_figure(
        "Ten degrees of roll command at 40 kt",
        1,
        &[
            panel(
                "",
                "roll attitude",
                "deg",
                vec![
                    curve("command model", 6, &t, answer(0.0, 2.0, 0.8), Marks::Without),
                    curve("nonlinear", 0, &t, answer(0.12, 2.1, 0.74), Marks::Without),
                    curve("linear", 1, &t, answer(0.12, 2.05, 0.78), Marks::Without),
                ],
            ),
            CurvePanel {
                minimum_span: 2.0,
                ..panel(
                    "",
                    "pitch attitude",
                    "deg",
                    vec![
                        curve("nonlinear", 0, &t, tiny.clone(), Marks::Without),
                        curve("linear", 1, &t, map(&tiny, |v| 0.7 * v), Marks::Without),
                    ],
                )
            },
            panel(
                "",
                "lateral cyclic",
                "deg",
                vec![
                    curve(
                        "nonlinear",
                        0,
                        &t,
                        map(&t, |t| 6.0 * (1.0 - t / 1.2) * (-1.9 * t).exp()),
                        Marks::Without,
                    ),
                    curve(
                        "linear",
                        1,
                        &t,
                        map(&t, |t| 5.6 * (1.0 - t / 1.2) * (-1.8 * t).exp()),
                        Marks::Without,
                    ),
                ],
            ),
        ],
    )
}

fn orbit() -> Figure {
    let azimuth = sample(0.0, 360.0, 181);
    let wave = |mean: f64, one: f64, two: f64, lag: f64| {
        map(&azimuth, |a| {
            let a = a * PI / 180.0;
            mean + one * (a - lag).cos() + two * (2.0 * a + lag).cos()
        })
    };
    let both = |title: &str, unit: &str, m: f64, a: f64, b: f64| {
        panel(
            "",
            title,
            unit,
            vec![
                curve("upper", 0, &azimuth, wave(m, a, b, 0.4), Marks::Without),
                curve("lower", 1, &azimuth, wave(m * 0.8, a * 1.1, b * 1.4, -0.4), Marks::Without),
            ],
        )
    };
    orbit_figure(
        "One revolution at 60 kt",
        &[
            both("flap angle", "deg", 0.0, 1.1, 0.08),
            both("thrust", "lbf", 510.0, 20.0, 60.0),
            both("uniform inflow", "", 0.031, 0.0005, 0.001),
            both("torque", "lbf ft", 300.0, 6.0, 18.0),
        ],
    )
}

fn margins() -> Figure {
    let names = [
        "roll gain margin",
        "roll phase margin",
        "roll rejection bandwidth",
        "roll rejection peak",
        "pitch gain margin",
        "pitch phase margin",
        "yaw phase margin",
        "yaw rejection peak",
        "heave bandwidth",
    ];
    let speeds: Vec<String> = (0..=8).map(|i| format!("{}", 10 * i)).collect();
    let values = (0..names.len())
        .map(|r| {
            (0..speeds.len())
                .map(|c| {
                    if r == 8 && c == 0 {
                        return f64::NAN;
                    }
                    14.0 + 16.0 * (1.3 * r as f64 + 0.35 * c as f64).sin() + c as f64
                })
                .collect()
        })
        .collect();
    heatmap_figure(
        "Design margin of each requirement",
        &MarginMap {
            requirements: names.map(String::from).to_vec(),
            speeds,
            speed_unit: "kt".into(),
            values,
            label: "design margin (%)".into(),
            decimals: 0,
            required: 0.0,
        },
    )
}

fn interference() -> Figure {
    let speed = sample(0.0, 80.0, 41);
    let own = map(&speed, |v| 0.056 / (1.0 + (v / 22.0).powi(2)).sqrt());
    let more = |k: f64| {
        map(&speed, |v| {
            0.056 / (1.0 + (v / 22.0).powi(2)).sqrt() * (1.0 + k * (-(v / 30.0).powi(2)).exp())
        })
    };
    interference_figure(
        "Rotor-on-rotor interference",
        "airspeed",
        "kt",
        &[
            panel(
                "",
                "uniform inflow ratio",
                "",
                vec![
                    curve("upper", 0, &speed, more(0.35), Marks::Without),
                    curve("lower", 1, &speed, more(0.9), Marks::Without),
                    curve("isolated", 2, &speed, own, Marks::Without),
                ],
            ),
            panel(
                "",
                "interference factor 2G_{11}",
                "",
                vec![
                    curve(
                        "lower on upper",
                        3,
                        &speed,
                        map(&speed, |v| 0.6557 * (1.0 - 0.3 * (v / 80.0))),
                        Marks::Without,
                    ),
                    curve(
                        "upper on lower",
                        4,
                        &speed,
                        map(&speed, |v| 1.3443 - 0.7 * (v / 80.0).powi(2)),
                        Marks::Without,
                    ),
                ],
            ),
        ],
    )
}

fn corner_cases() -> Figure {
    let x = sample(0.0, 10.0, 41);
    let gap: Vec<f64> = map(&x, |v| if (4.0..5.5).contains(&v) { f64::NAN } else { v.sin() * 3e5 });
    let many = (0..8).fold(
        Panel::new(Axis::linear("x", "m"), Axis::linear("styles", "")).title("eight styles"),
        |p, i| {
            p.line(
                Series::new(&format!("style {i}"), &x, &map(&x, |v| i as f64 + 0.3 * v.sin()))
                    .style(i)
                    .marks(),
            )
        },
    );
    Figure::new("Corner cases: a title that is long enough to need a second line when the figure is narrow, as figures are")
        .columns(2)
        .legend(Legend::Right)
        .panel_size(260.0, 190.0)
        .panel(many)
        .panel(
            Panel::new(Axis::linear("x", "m"), Axis::linear("large numbers and a gap", "N"))
                .line(Series::new("with a gap", &x, &gap))
                .fill_between(&x, &map(&x, |v| v.sin() * 3e5 - 5e4), &map(&x, |v| v.sin() * 3e5 + 5e4), Tone::Style(0), "spread"),
        )
        .panel(
            Panel::new(Axis::linear("x", "m"), Axis::linear("nothing", ""))
                .title("no data")
                .line(Series::new("empty", &[], &[])),
        )
        .panel(
            Panel::new(Axis::log("frequency", "rad/s"), Axis::log("magnitude", ""))
                .title("log, less than a decade across")
                .line(Series::new("short", &[1.1, 2.0, 6.0], &[-0.2, 3.0, 5.0]).style(1).marks()),
        )
}
