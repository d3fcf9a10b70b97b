//! What the paper says of its figures in words, as claims on our figures.
//!
//! Figures 13 to 16 hold curves and no numbers, and beside our kind of curves
//! those identified in flight, which are not printed as numbers anywhere. What
//! the text says of the model's own curves can be looked at; what it says of
//! flight cannot.

use crate::linear::dense::eigenvalues;
use crate::linear::frequency::{Bode, compare, log_grid};
use crate::linear::{LinearError, StateSpace};
use crate::problem::STICKS;
use crate::trim::TrimPoint;
use crate::units::KNOT;
use crate::validation::{Bound, Claim};
use crate::vehicle::Layout;
use nalgebra::Complex;

/// Frequencies at which Fig. 16 is compared, rad/s: from where the paper says
/// that interactions raise the gain, to where the rotor's own modes begin.
const BAND: [f64; 2] = [0.5, 10.0];
const POINTS: usize = 100;

fn airspeed(point: &TrimPoint) -> f64 {
    point.condition.airspeed / KNOT
}

fn stick(name: &str) -> usize {
    STICKS.iter().position(|stick| *stick == name).unwrap_or(0)
}

/// Largest of the values by size, NaN where one is missing.
fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().map(f64::abs).fold(0.0, |most, x| if x <= most { most } else { x })
}

/// Claims on trim: Figs. 13 and 14, and the words around Table 2. The sweeps
/// are of the same speeds, rotor-on-rotor interactions on and off, hover first.
#[must_use]
pub fn trim_claims(on: &[TrimPoint], off: &[TrimPoint]) -> Vec<Claim> {
    let both = || on.iter().zip(off);
    let bank = |point: &TrimPoint| point.mean_state[Layout::BODY.roll].to_degrees();
    let most_bank = largest(on.iter().map(bank));
    let at = on.iter().find(|point| bank(point).abs() >= most_bank).map_or(f64::NAN, airspeed);
    let mut list = vec![
        Claim::new(
            "Fig. 13",
            "bank with interactions, largest",
            most_bank,
            "deg",
            Bound::AtMost(1.0),
        ),
        Claim::new("Fig. 13", "speed of that", at, "kt", Bound::AtMost(40.0)),
        Claim::new(
            "Fig. 13",
            "bank without interactions, largest",
            largest(off.iter().map(bank)),
            "deg",
            Bound::AtMost(1e-3),
        ),
    ];
    if let (Some(on), Some(off)) = (on.first(), off.first()) {
        list.extend(hover_claims(on, off));
    }

    let [lat, lon, col, ped] = ["lat", "lon", "col", "ped"].map(stick);
    let change = |k: usize| both().map(move |(on, off)| on.sticks[k] - off.sticks[k]);
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let rise = |from: f64, to: f64| -> Vec<f64> {
        both()
            .filter(|(on, _)| airspeed(on) > from && airspeed(on) < to)
            .map(|(on, off)| 100.0 * (on.sticks[col] / off.sticks[col] - 1.0))
            .collect()
    };
    let rises = rise(-1.0, f64::INFINITY);
    let growth = rises.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::MIN, f64::max);
    let beyond = |k: usize, from: f64| {
        largest(
            both()
                .filter(move |(on, _)| airspeed(on) > from - 1.0)
                .map(move |(on, off)| on.sticks[k] - off.sticks[k]),
        )
    };
    let pedal_in_hover = change(ped).next().unwrap_or(f64::NAN);
    let fig = "Fig. 14";
    list.extend([
        Claim::new(
            fig,
            "longitudinal stick, on less off, largest",
            largest(change(lon)),
            "%",
            Bound::AtMost(1.0),
        ),
        Claim::new(
            fig,
            "lateral stick, on less off, mean over speed",
            mean(change(lat).collect()),
            "%",
            Bound::AtLeast(0.0),
        ),
        Claim::new(
            fig,
            "lateral stick, on less off, largest",
            largest(change(lat)),
            "%",
            Bound::AtMost(1.0),
        ),
        Claim::new(
            fig,
            "collective, on over off, least below 50 kt",
            rise(-1.0, 49.0).into_iter().fold(f64::INFINITY, f64::min),
            "% more",
            Bound::AtLeast(3.0),
        ),
        Claim::new(
            fig,
            "collective, on over off, largest beyond 60 kt",
            largest(rise(61.0, f64::INFINITY)),
            "% more",
            Bound::AtMost(3.0),
        ),
        Claim::new(fig, "the same in stick travel", beyond(col, 65.0), "%", Bound::AtMost(3.0)),
        Claim::new(
            fig,
            "collective, on over off, largest growth from one speed to the next",
            growth,
            "% more",
            Bound::AtMost(0.0),
        ),
        Claim::new(
            fig,
            "pedal, on less off, in hover",
            pedal_in_hover.abs(),
            "%",
            Bound::AtLeast(1.0),
        ),
        Claim::new(
            fig,
            "the same beyond 20 kt, of that in hover",
            100.0 * beyond(ped, 20.0) / pedal_in_hover.abs(),
            "%",
            Bound::AtMost(20.0),
        ),
        Claim::new(
            fig,
            "pedal, on less off, largest from 50 kt",
            beyond(ped, 50.0),
            "%",
            Bound::AtMost(0.5),
        ),
    ]);
    list
}

/// Claims on hover: the words around Table 2, and the second conclusion.
fn hover_claims(on: &TrimPoint, off: &TrimPoint) -> Vec<Claim> {
    let ([upper, lower], [up, low]) = (on.rotors.as_slice(), off.rotors.as_slice()) else {
        return Vec::new();
    };
    let table = "Table 2";
    vec![
        Claim::new(
            table,
            "hover, off: total less self-induced inflow, largest",
            largest([up, low].map(|rotor| rotor.inflow[0] - rotor.self_inflow[0])),
            "",
            Bound::AtMost(5e-4),
        ),
        Claim::new(
            table,
            "hover, off: thrust of the upper over the lower rotor, off 1 by",
            100.0 * (up.thrust / low.thrust - 1.0).abs(),
            "%",
            Bound::AtMost(0.1),
        ),
        Claim::new(
            table,
            "hover, on: total inflow of the lower over the upper rotor",
            lower.inflow[0] / upper.inflow[0],
            "",
            Bound::AtLeast(1.1),
        ),
        Claim::new(
            table,
            "hover, on: self-induced inflow of the lower over the upper rotor",
            lower.self_inflow[0] / upper.self_inflow[0],
            "",
            Bound::AtMost(0.95),
        ),
        Claim::new(
            table,
            "hover, on: thrust of the upper over the lower rotor",
            upper.thrust / lower.thrust,
            "",
            Bound::AtLeast(1.1),
        ),
        Claim::new(
            table,
            "hover, on: power of the upper over the lower rotor, off 1 by",
            100.0 * (upper.power / lower.power - 1.0).abs(),
            "%",
            Bound::AtMost(1.0),
        ),
        Claim::new(
            "conclusion 2",
            "hover: power of both rotors, on over off",
            100.0 * (on.power.shaft / off.power.shaft - 1.0),
            "% more",
            Bound::AtLeast(60.0),
        ),
    ]
}

/// Claims on the eigenvalues of the residualised hover models: Fig. 15.
///
/// # Errors
/// A model without eigenvalues.
pub fn eigenvalue_claims(on: &StateSpace, off: &StateSpace) -> Result<Vec<Claim>, LinearError> {
    let fig = "Fig. 15";
    let mut list = Vec::new();
    let mut frequencies = Vec::new();
    for (words, model) in [("on", on), ("off", off)] {
        let values = eigenvalues(model.a())?;
        let mut growing: Vec<&Complex<f64>> =
            values.iter().filter(|z| z.re > 0.0 && z.im > 0.0).collect();
        growing.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        let slowest = growing.first().map_or(f64::NAN, |z| z.norm());
        // Each hovering cubic has a stable root faster than its pair.
        let fast = values.iter().filter(|z| z.re < 0.0 && z.norm() >= slowest).count();
        let mut real: Vec<f64> = values.iter().filter(|z| z.im == 0.0).map(|z| -z.re).collect();
        real.sort_by(f64::total_cmp);
        list.extend([
            Claim::new(
                fig,
                format!("{words}: growing oscillations"),
                growing.len() as f64,
                "",
                Bound::Exactly(2.0),
            ),
            Claim::new(
                fig,
                format!("{words}: stable roots faster than the slower of those"),
                fast as f64,
                "",
                Bound::AtLeast(2.0),
            ),
            Claim::new(
                fig,
                format!("{words}: real roots that decay, two at least: rate of the second"),
                real.iter().copied().filter(|rate| *rate > 0.0).nth(1).unwrap_or(f64::NAN),
                "rad/s",
                Bound::AtMost(0.1),
            ),
        ]);
        frequencies.push([0, 1].map(|k| growing.get(k).map_or(f64::NAN, |z| z.norm())));
        if words == "on" {
            let damped = values.iter().filter(|z| z.re < 0.0 && z.norm() >= slowest);
            list.push(Claim::new(
                fig,
                "on: the fast roots are an oscillating pair, imaginary part",
                damped.map(|z| z.im).fold(0.0, f64::max),
                "rad/s",
                Bound::AtLeast(0.05),
            ));
        }
    }
    for (k, which) in ["slower", "faster"].into_iter().enumerate() {
        list.push(Claim::new(
            fig,
            format!("natural frequency of the {which} growing oscillation, on over off"),
            frequencies[0][k] / frequencies[1][k],
            "",
            Bound::AtLeast(1.0),
        ));
    }
    Ok(list)
}

/// What interactions do to an on-axis response in hover, from 0.5 to 10 rad/s.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseChange {
    /// Axis by name.
    pub axis: &'static str,
    /// Stick and state of the response.
    pub channel: [&'static str; 2],
    /// Gain on over off, dB: least, mean and largest over log frequency.
    pub gain_db: [f64; 3],
    /// Phase on less off, deg: mean over log frequency.
    pub phase_deg: f64,
}

/// On-axis responses in hover with interactions beside those without: Fig. 16.
///
/// # Errors
/// A model without the sticks and rates, or with an undamped mode in the band.
pub fn response_changes(
    on: &StateSpace,
    off: &StateSpace,
) -> Result<Vec<ResponseChange>, LinearError> {
    let omega = log_grid(BAND[0], BAND[1], POINTS)?;
    [
        ("roll", ["lat", "p"]),
        ("pitch", ["lon", "q"]),
        ("yaw", ["ped", "r"]),
        ("heave", ["col", "w"]),
    ]
    .into_iter()
    .map(|(axis, [input, output])| {
        let compared = compare(&[("on", on), ("off", off)], input, output, &omega)?;
        let curves: Vec<&Bode> = compared.curves.iter().map(|(_, bode)| bode).collect();
        let gains: Vec<f64> = curves[0]
            .gain
            .iter()
            .zip(&curves[1].gain)
            .map(|(on, off)| 20.0 * (on / off).log10())
            .collect();
        let phases = curves[0].phase.iter().zip(&curves[1].phase).map(|(on, off)| on - off);
        let mean = |sum: f64| sum / POINTS as f64;
        Ok(ResponseChange {
            axis,
            channel: [input, output],
            gain_db: [
                gains.iter().copied().fold(f64::INFINITY, f64::min),
                mean(gains.iter().sum()),
                gains.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
            phase_deg: mean(phases.sum::<f64>()).to_degrees(),
        })
    })
    .collect()
}

/// Claims on those responses: the words around Fig. 16.
#[must_use]
pub fn response_claims(changes: &[ResponseChange]) -> Vec<Claim> {
    let fig = "Fig. 16";
    let of = |axis: &str| changes.iter().find(|change| change.axis == axis);
    let mut list: Vec<Claim> = ["roll", "yaw", "heave"]
        .into_iter()
        .map(|axis| {
            Claim::new(
                fig,
                format!("{axis}: gain on over off, least"),
                of(axis).map_or(f64::NAN, |change| change.gain_db[0]),
                "dB",
                Bound::AtLeast(0.0),
            )
        })
        .collect();
    let mean = |axis: &str| of(axis).map_or(f64::NAN, |change| change.gain_db[1].abs());
    let others = ["roll", "yaw", "heave"].map(mean).into_iter().fold(f64::INFINITY, f64::min);
    list.push(Claim::new(
        fig,
        "pitch: mean change of gain, of the least of the other three",
        mean("pitch") / others,
        "",
        Bound::AtMost(1.0),
    ));
    let phase = |axis: &str| of(axis).map_or(f64::NAN, |change| change.phase_deg);
    list.push(Claim::new(
        fig,
        "heave: mean phase on less off (the paper: more lag)",
        phase("heave"),
        "deg",
        Bound::AtMost(0.0),
    ));
    list.push(Claim::new(
        fig,
        "heave: that change, over the largest of the other axes",
        phase("heave").abs() / largest(["roll", "pitch", "yaw"].map(phase)),
        "",
        Bound::AtLeast(1.0),
    ));
    list
}
