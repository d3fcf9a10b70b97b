//! The ready-made figures of this field, from plain data.
//!
//! Values come in the units in which they are to be shown; field names or
//! unit strings say which. Every function returns a [`Figure`], so that the
//! caller can still add a subtitle, choose the legend, or read its notes.

use num_complex::Complex64;

use super::plot::{Anchor, Axis, Figure, Legend, Panel, Series, Tone};

/// The level that ends a disturbance rejection bandwidth, dB.
const REJECTION_LEVEL_DB: f64 = -3.01;

/// Gains shown in a Nichols figure, dB, up and down.
const NICHOLS_GAIN_DB: f64 = 30.0;

/// Lowest sensitivity shown, dB; what is below meets every requirement.
const LOWEST_SENSITIVITY_DB: f64 = -40.0;

/// A limit for people: three decimals at most, none that say nothing.
fn tidy(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Whether the points of a curve are marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Marks {
    /// A line only, for dense results.
    #[default]
    Without,
    /// A line and its points, for results at a few conditions.
    With,
    /// Points only, for published or measured values.
    Only,
}

/// One curve of a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Name in the legend; the same name and style in every panel of a figure.
    pub name: String,
    /// Style index: the same thing has the same index everywhere.
    pub style: usize,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates, as many; values that are not finite leave gaps.
    pub y: Vec<f64>,
    /// Whether the points are marked.
    pub marks: Marks,
}

/// A panel of curves of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePanel {
    /// Title above the panel, may be empty.
    pub title: String,
    /// What the ordinates are.
    pub quantity: String,
    /// Their unit, may be empty.
    pub unit: String,
    /// Smallest span to show, so that noise about a constant looks constant; 0 for any.
    pub minimum_span: f64,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// A named quantity along a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// What it is.
    pub name: String,
    /// Its unit, may be empty.
    pub unit: String,
    /// One value for each point of the sweep.
    pub values: Vec<f64>,
}

fn series(name: &str, style: usize, x: &[f64], y: &[f64], marks: Marks) -> Series {
    let line = Series::new(name, x, y).style(style);
    match marks {
        Marks::Without => line,
        Marks::With => line.marks(),
        Marks::Only => line.scatter(),
    }
}

fn curve_panel(x: Axis, data: &CurvePanel) -> Panel {
    let y = Axis::linear(&data.quantity, &data.unit).minimum_span(data.minimum_span);
    let start = Panel::new(x, y).title(&data.title);
    data.curves
        .iter()
        .fold(start, |panel, c| panel.line(series(&c.name, c.style, &c.x, &c.y, c.marks)))
}

// ---------------------------------------------------------------------------
// Trim

/// The trimmed flight conditions of one model over airspeed.
#[derive(Debug, Clone, PartialEq)]
pub struct TrimSweep {
    /// Name of the model, like "interactions on".
    pub name: String,
    /// Style index.
    pub style: usize,
    /// Whether the points are marked.
    pub marks: Marks,
    /// True airspeed, in the unit given to [`trim_figure`].
    pub speed: Vec<f64>,
    /// Pitch attitude, deg, nose up positive.
    pub pitch_attitude_deg: Vec<f64>,
    /// Roll attitude, deg, right side down positive.
    pub roll_attitude_deg: Vec<f64>,
    /// The pilot's controls, the same ones in the same order in each sweep.
    pub controls: Vec<Channel>,
    /// Power.
    pub power: Channel,
    /// Share of the total thrust of each rotor, %; names are those of the rotors.
    pub thrust_share: Vec<Channel>,
}

/// Trim over airspeed: attitudes, controls, power and how the rotors share the thrust.
///
/// Colour, dash and marker tell the models apart in every panel; the shares of the
/// rotors are named beside their curves.
#[must_use]
pub fn trim_figure(title: &str, speed_unit: &str, sweeps: &[TrimSweep]) -> Figure {
    let speed = || Axis::linear("airspeed", speed_unit);
    let panel = |y: Axis, pick: &dyn Fn(&TrimSweep) -> Option<&[f64]>| {
        sweeps
            .iter()
            .filter_map(|s| Some((s, pick(s)?)))
            .fold(Panel::new(speed(), y), |p, (s, values)| {
                p.line(series(&s.name, s.style, &s.speed, values, s.marks))
            })
    };
    // Attitudes and stick positions within a tenth of a degree are the same.
    let small = 0.5;
    let mut figure = Figure::new(title)
        .columns(2)
        .panel_size(290.0, 135.0)
        .share_x()
        .legend(Legend::Above)
        .panel(panel(Axis::degrees("pitch attitude").minimum_span(small), &|s| {
            Some(&s.pitch_attitude_deg)
        }))
        .panel(panel(Axis::degrees("roll attitude").minimum_span(small), &|s| {
            Some(&s.roll_attitude_deg)
        }));
    let count = sweeps.iter().map(|s| s.controls.len()).max().unwrap_or(0);
    for index in 0..count {
        let Some(channel) = sweeps.iter().find_map(|s| s.controls.get(index)) else {
            continue;
        };
        figure = figure
            .panel(panel(Axis::linear(&channel.name, &channel.unit).minimum_span(small), &|s| {
                s.controls.get(index).map(|c| c.values.as_slice())
            }));
    }
    let power = sweeps.first().map(|s| &s.power);
    figure = figure.panel(panel(
        Axis::linear(power.map_or("power", |p| &p.name), power.map_or("", |p| &p.unit))
            .include(0.0),
        &|s| Some(&s.power.values),
    ));
    let mut shares = Panel::new(speed(), Axis::linear("thrust share", "%").minimum_span(10.0));
    for sweep in sweeps {
        for (rotor, share) in sweep.thrust_share.iter().enumerate() {
            // The legend names the models; the rotors are named at their curves.
            let line = series("", sweep.style, &sweep.speed, &share.values, sweep.marks)
                .hint(&format!("{}, {}", share.name, sweep.name));
            shares = shares.line(line);
            // Away from hover, where the curves are steep and close to each other.
            let middle = share.values.len() * 3 / 4;
            let place = (sweep.speed.get(middle), share.values.get(middle));
            if let ((Some(&x), Some(&y)), true) = (place, sweep.style == sweeps[0].style) {
                let others = sweep
                    .thrust_share
                    .iter()
                    .enumerate()
                    .filter(|(i, _)| *i != rotor)
                    .filter_map(|(_, o)| o.values.get(middle));
                let highest = others.clone().all(|&o| o <= y);
                let anchor = if highest { Anchor::Above } else { Anchor::Below };
                shares = shares.text(x, y, &share.name, anchor);
            }
        }
    }
    figure.panel(shares)
}

// ---------------------------------------------------------------------------
// Eigenvalues

/// The eigenvalues of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenvalueSet {
    /// Name of the model.
    pub name: String,
    /// Style index.
    pub style: usize,
    /// Eigenvalues, rad/s.
    pub values: Vec<Complex64>,
    /// Texts beside some of them, such as the speed at which a locus begins.
    pub labels: Vec<(Complex64, String)>,
}

/// A window on the complex plane.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneView {
    /// Title of the panel.
    pub title: String,
    /// Range of the real part, rad/s; `None` to show all.
    pub real: Option<(f64, f64)>,
    /// Range of the imaginary part, rad/s; `None` to show all.
    pub imaginary: Option<(f64, f64)>,
}

/// Eigenvalues in the complex plane, with lines of constant damping ratio and
/// constant frequency. One panel for each view, one of everything if there are none.
///
/// When every set is its own conjugate the lower half plane is left out.
#[must_use]
pub fn eigenvalue_figure(title: &str, sets: &[EigenvalueSet], views: &[PlaneView]) -> Figure {
    let all = [PlaneView { title: String::new(), real: None, imaginary: None }];
    let views = if views.is_empty() { &all } else { views };
    let symmetric = sets.iter().all(|s| is_own_conjugate(&s.values));
    views.iter().fold(
        Figure::new(title).columns(views.len().min(2)).panel_size(330.0, 300.0),
        |figure, view| figure.panel(plane(sets, view, symmetric)),
    )
}

fn is_own_conjugate(values: &[Complex64]) -> bool {
    // The tolerance is that of a drawing, not of a computation.
    values.iter().all(|v| values.iter().any(|w| (w - v.conj()).norm() <= 1e-6 * v.norm() + 1e-9))
}

fn plane(sets: &[EigenvalueSet], view: &PlaneView, symmetric: bool) -> Panel {
    let finite =
        || sets.iter().flat_map(|s| &s.values).filter(|v| v.re.is_finite() && v.im.is_finite());
    let span = |pick: fn(&Complex64) -> f64| {
        let low = finite().map(pick).fold(0.0, f64::min);
        let high = finite().map(pick).fold(0.0, f64::max);
        let margin = 0.07 * (high - low).max(1e-3);
        (low - margin, high + margin)
    };
    let real = view.real.unwrap_or_else(|| span(|v| v.re));
    let imaginary = view.imaginary.unwrap_or_else(|| {
        let (low, high) = span(|v| v.im);
        if symmetric { (-0.04 * high, high) } else { (low, high) }
    });
    let mut panel = Panel::new(
        Axis::linear("real part", "rad/s").range(real.0, real.1),
        Axis::linear("imaginary part", "rad/s").range(imaginary.0, imaginary.1),
    )
    .title(&view.title)
    .vertical_band(0.0, f64::INFINITY, Tone::Forbidden, "")
    .vertical_line(0.0, "")
    .horizontal_line(0.0, "");
    let reach = real.0.abs().max(imaginary.0.abs()).max(imaginary.1) * 2.0;
    let halves: &[f64] = if imaginary.0 < -0.1 * imaginary.1 { &[1.0, -1.0] } else { &[1.0] };
    if real.0 < 0.0 {
        for damping in [0.1, 0.2, 0.4, 0.6, 0.8] {
            let angle = f64::acos(-damping);
            for half in halves {
                let end = [reach * angle.cos(), half * reach * angle.sin()];
                let label = if *half > 0.0 { format!("ζ {damping}") } else { String::new() };
                panel = panel.guide(&[[0.0, 0.0], end], &label);
            }
        }
        for radius in round_radii(imaginary.1.abs().max(imaginary.0.abs())) {
            // The label stands at the end on the imaginary axis.
            let arc: Vec<[f64; 2]> = (0..=90)
                .map(|i| {
                    let angle = std::f64::consts::PI * (1.0 - 0.5 * f64::from(i) / 90.0);
                    [radius * angle.cos(), radius * angle.sin()]
                })
                .collect();
            panel = panel.guide(&arc, "");
            if halves.len() > 1 {
                let mirrored: Vec<[f64; 2]> = arc.iter().map(|p| [p[0], -p[1]]).collect();
                panel = panel.guide(&mirrored, "");
            }
        }
    }
    for set in sets {
        let points = set
            .values
            .iter()
            .filter(|v| !symmetric || v.im >= -1e-9 * v.norm())
            .map(|v| [v.re, v.im])
            .collect();
        panel = panel.line(Series::from_points(&set.name, points).style(set.style).scatter());
        let inside = |v: &Complex64| {
            (real.0..=real.1).contains(&v.re) && (imaginary.0..=imaginary.1).contains(&v.im)
        };
        for (at, text) in set.labels.iter().filter(|(at, _)| inside(at)) {
            panel = panel.text(at.re, at.im, text, Anchor::Left);
        }
    }
    panel
}

/// About four round radii up to `largest`.
fn round_radii(largest: f64) -> Vec<f64> {
    if !(largest.is_finite() && largest > 0.0) {
        return Vec::new();
    }
    let decade = 10f64.powf((largest / 4.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * decade)
        .into_iter()
        .find(|s| largest / s <= 5.0)
        .unwrap_or(10.0 * decade);
    (1..=8).map(|i| f64::from(i) * step).collect()
}

// ---------------------------------------------------------------------------
// Frequency responses

/// A frequency response as it is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// Name of the model.
    pub name: String,
    /// Style index.
    pub style: usize,
    /// Frequencies, rad/s.
    pub frequency: Vec<f64>,
    /// Complex values at these frequencies.
    pub response: Vec<Complex64>,
}

impl FrequencyResponse {
    /// Magnitudes, dB; a zero response has none (NaN).
    #[must_use]
    pub fn magnitude_db(&self) -> Vec<f64> {
        self.response
            .iter()
            .map(|r| {
                let magnitude = 20.0 * r.norm().log10();
                if magnitude.is_finite() { magnitude } else { f64::NAN }
            })
            .collect()
    }

    /// Continuous phase, deg: steps between neighbours are less than half a turn,
    /// and the phase where the magnitude is nearest to 1 lies in (−360, 0]
    /// unless `around` asks for the first value to lie within half a turn of it.
    fn phase_deg(&self, around: Option<f64>) -> Vec<f64> {
        let mut turns = 0.0;
        let mut before: Option<f64> = None;
        let mut phase: Vec<f64> = self
            .response
            .iter()
            .map(|r| {
                let here = r.arg().to_degrees();
                if !here.is_finite() || r.norm() == 0.0 {
                    return f64::NAN;
                }
                if let Some(last) = before {
                    turns -= ((here - last) / 360.0).round();
                }
                before = Some(here);
                here + 360.0 * turns
            })
            .collect();
        let shift = match around {
            Some(target) => {
                phase.iter().find(|p| p.is_finite()).map_or(0.0, |p| ((target - p) / 360.0).round())
            }
            None => self
                .response
                .iter()
                .zip(&phase)
                .filter(|(_, p)| p.is_finite())
                .min_by(|a, b| {
                    let off = |r: &Complex64| r.norm().ln().abs();
                    off(a.0).total_cmp(&off(b.0))
                })
                .map_or(0.0, |(_, p)| -(p / 360.0).ceil()),
        };
        for p in &mut phase {
            *p += 360.0 * shift;
        }
        phase
    }
}

/// One input-output pair of a Bode figure.
#[derive(Debug, Clone, PartialEq)]
pub struct BodeChannel {
    /// Title, like "longitudinal stick to pitch rate".
    pub title: String,
    /// Unit of the magnitude, like "dB" or "dB re deg/s per deg".
    pub magnitude_unit: String,
    /// Frequencies between which the responses are valid, rad/s.
    pub valid: Option<(f64, f64)>,
    /// The responses of the models.
    pub responses: Vec<FrequencyResponse>,
}

/// Magnitude and phase over frequency, one column for each channel. Frequencies
/// where the models are not valid are shaded.
#[must_use]
pub fn bode_figure(title: &str, channels: &[BodeChannel]) -> Figure {
    let shade = |panel: Panel, channel: &BodeChannel| match channel.valid {
        Some((low, high)) => panel
            .vertical_band(0.0, low, Tone::Neutral, "outside validity")
            .vertical_band(high, f64::INFINITY, Tone::Neutral, "outside validity"),
        None => panel,
    };
    let frequency = || Axis::log("frequency", "rad/s").tight();
    let mut figure = Figure::new(title)
        .columns(channels.len().max(1))
        .panel_size(if channels.len() > 2 { 250.0 } else { 330.0 }, 165.0)
        .share_x()
        .legend(Legend::Above);
    for channel in channels {
        let panel = Panel::new(
            frequency(),
            Axis::linear("magnitude", &channel.magnitude_unit).minimum_span(1.0),
        )
        .title(&channel.title);
        let panel = channel.responses.iter().fold(panel, |p, r| {
            p.line(Series::new(&r.name, &r.frequency, &r.magnitude_db()).style(r.style))
        });
        figure = figure.panel(shade(panel, channel));
    }
    for channel in channels {
        let panel = Panel::new(frequency(), Axis::degrees("phase").minimum_span(45.0));
        // Models of one channel start in the same turn.
        let first = channel
            .responses
            .first()
            .and_then(|r| r.phase_deg(Some(0.0)).into_iter().find(|p| p.is_finite()));
        let panel = channel.responses.iter().fold(panel, |p, r| {
            let phase = r.phase_deg(Some(first.unwrap_or(0.0)));
            p.line(Series::new(&r.name, &r.frequency, &phase).style(r.style))
        });
        figure = figure.panel(shade(panel, channel));
    }
    figure
}

/// The region that a loop must keep out of: the kite around −1 whose corners
/// are the gain margin up and down and the phase margin on both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExclusionRegion {
    /// Gain margin, dB, up and down.
    pub gain_margin_db: f64,
    /// Phase margin, deg, on both sides.
    pub phase_margin_deg: f64,
}

impl ExclusionRegion {
    /// The corners: lower gain limit, lag side, upper gain limit, lead side.
    #[must_use]
    pub fn corners(&self) -> [Complex64; 4] {
        let gain = 10f64.powf(self.gain_margin_db / 20.0);
        let lag = (self.phase_margin_deg - 180.0).to_radians();
        [
            Complex64::new(-gain, 0.0),
            Complex64::from_polar(1.0, lag),
            Complex64::new(-1.0 / gain, 0.0),
            Complex64::from_polar(1.0, -lag),
        ]
    }

    fn label(&self) -> String {
        format!("less than {} dB, {} deg", tidy(self.gain_margin_db), tidy(self.phase_margin_deg))
    }
}

/// Frequencies to name on a polar curve.
fn landmarks(response: &FrequencyResponse) -> Vec<(f64, Complex64)> {
    let mut found = Vec::new();
    for decade in -3..=4 {
        for mantissa in [1.0, 2.0, 5.0] {
            let target = mantissa * 10f64.powi(decade);
            let pairs = response.frequency.windows(2).zip(response.response.windows(2));
            for (w, r) in pairs {
                if w[0] <= target && target < w[1] && w[0] > 0.0 {
                    let t = (target / w[0]).ln() / (w[1] / w[0]).ln();
                    found.push((target, r[0] + (r[1] - r[0]) * t));
                    break;
                }
            }
        }
    }
    found
}

/// Open-loop responses in the complex plane around −1, with the unit circle.
/// The view is fixed; dots on the first curve name frequencies in rad/s.
#[must_use]
pub fn nyquist_figure(
    title: &str,
    responses: &[FrequencyResponse],
    region: Option<&ExclusionRegion>,
) -> Figure {
    let circle: Vec<[f64; 2]> = (0..=180)
        .map(|i| {
            let angle = f64::from(i) * 2.0 * std::f64::consts::PI / 180.0;
            [angle.cos(), angle.sin()]
        })
        .collect();
    let mut panel = Panel::new(
        Axis::linear("real part", "").range(-2.6, 1.4),
        Axis::linear("imaginary part", "").range(-2.2, 1.8),
    )
    .equal_aspect()
    .guide(&circle, "")
    .horizontal_line(0.0, "")
    .vertical_line(0.0, "");
    if let Some(region) = region {
        let corners = region.corners().map(|c| [c.re, c.im]);
        panel = panel.polygon(&corners, Tone::Forbidden, &region.label());
    }
    for r in responses {
        let points = r.response.iter().map(|v| [v.re, v.im]).collect();
        panel = panel.line(Series::from_points(&r.name, points).style(r.style));
    }
    panel = panel.line(Series::from_points("", vec![[-1.0, 0.0]]).color(6).marker(7).scatter());
    if let Some(first) = responses.first() {
        let mut last: Option<[f64; 2]> = None;
        for (frequency, value) in landmarks(first) {
            let at = [value.re, value.im];
            // Names closer than this would overlap.
            if last.is_some_and(|l: [f64; 2]| (l[0] - at[0]).hypot(l[1] - at[1]) < 0.2) {
                continue;
            }
            last = Some(at);
            panel = panel
                .line(Series::from_points("", vec![at]).style(first.style).scatter())
                .text(at[0], at[1], &format!("{frequency}"), Anchor::Right);
        }
    }
    Figure::new(title).panel_size(400.0, 400.0).panel(panel)
}

/// Open-loop responses as gain over phase, with the exclusion region around every
/// odd half turn in sight.
#[must_use]
pub fn nichols_figure(
    title: &str,
    responses: &[FrequencyResponse],
    region: Option<&ExclusionRegion>,
) -> Figure {
    let phases: Vec<Vec<f64>> = responses.iter().map(|r| r.phase_deg(None)).collect();
    // Only what happens within the range of gains that is shown.
    let finite = || {
        responses
            .iter()
            .zip(&phases)
            .flat_map(|(r, phase)| r.magnitude_db().into_iter().zip(phase.iter().copied()))
            .filter(|(gain, p)| p.is_finite() && gain.abs() <= NICHOLS_GAIN_DB)
            .map(|(_, p)| p)
    };
    let low = finite().fold(-270.0, f64::min).max(-540.0);
    let high = finite().fold(-90.0, f64::max).min(360.0);
    let mut panel = Panel::new(
        Axis::degrees("open-loop phase").range(low - 10.0, high + 35.0),
        Axis::linear("open-loop gain", "dB").range(-NICHOLS_GAIN_DB, NICHOLS_GAIN_DB),
    )
    .horizontal_line(0.0, "");
    if let Some(region) = region {
        let corners = region.corners();
        let outline: Vec<Complex64> = (0..4)
            .flat_map(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                (0..24).map(move |i| a + (b - a) * (f64::from(i) / 24.0))
            })
            .collect();
        let mut label = region.label();
        let mut center = -180.0 - 360.0 * 2.0;
        while center <= high + 90.0 {
            if center >= low - 90.0 {
                let points: Vec<[f64; 2]> = outline
                    .iter()
                    // Seen from −1 the phase is continuous across the half turn.
                    .map(|z| [center + (-z).arg().to_degrees(), 20.0 * z.norm().log10()])
                    .collect();
                panel = panel.polygon(&points, Tone::Forbidden, &label);
                label.clear();
            }
            panel = panel
                .line(Series::from_points("", vec![[center, 0.0]]).color(6).marker(7).scatter());
            center += 360.0;
        }
    }
    for (r, phase) in responses.iter().zip(&phases) {
        panel = panel.line(Series::new(&r.name, phase, &r.magnitude_db()).style(r.style));
    }
    if let (Some(first), Some(phase)) = (responses.first(), phases.first()) {
        let frequency = &first.frequency;
        let magnitude = first.magnitude_db();
        let mut last: Option<f64> = None;
        for (target, value) in landmarks(first) {
            let gain = 20.0 * value.norm().log10();
            let nearest = frequency
                .iter()
                .zip(phase.iter().zip(&magnitude))
                .min_by(|a, b| (a.0 - target).abs().total_cmp(&(b.0 - target).abs()));
            let Some((_, (near, _))) = nearest else {
                continue;
            };
            if last.is_some_and(|l| (l - gain).abs() < 3.0) {
                continue;
            }
            last = Some(gain);
            let raw = value.arg().to_degrees();
            let at = raw + 360.0 * ((near - raw) / 360.0).round();
            panel = panel
                .line(Series::from_points("", vec![[at, gain]]).style(first.style).scatter())
                .text(at, gain, &format!("{target}"), Anchor::Right);
        }
    }
    Figure::new(title).panel_size(400.0, 330.0).panel(panel)
}

/// Sensitivity of one axis and what it must satisfy.
#[derive(Debug, Clone, PartialEq)]
pub struct SensitivityPanel {
    /// Title, like "roll".
    pub title: String,
    /// Smallest disturbance rejection bandwidth, rad/s: below it the sensitivity
    /// stays under −3 dB.
    pub bandwidth_spec: Option<f64>,
    /// Largest disturbance rejection peak, dB.
    pub peak_spec_db: Option<f64>,
    /// Sensitivities.
    pub responses: Vec<FrequencyResponse>,
}

/// Sensitivities over frequency; where a curve must not go is shaded.
#[must_use]
pub fn sensitivity_figure(title: &str, panels: &[SensitivityPanel]) -> Figure {
    let mut figure = Figure::new(title)
        .columns(panels.len().clamp(1, 2))
        .panel_size(320.0, 180.0)
        .legend(Legend::Above)
        .share_x();
    for data in panels {
        let values = || data.responses.iter().flat_map(FrequencyResponse::magnitude_db);
        let top = values().fold(data.peak_spec_db.unwrap_or(0.0), f64::max).max(3.0);
        let low = values().fold(f64::INFINITY, f64::min);
        let bottom = if low.is_finite() {
            low.clamp(LOWEST_SENSITIVITY_DB, -10.0)
        } else {
            LOWEST_SENSITIVITY_DB
        };
        let mut panel = Panel::new(
            Axis::log("frequency", "rad/s").tight(),
            Axis::linear("sensitivity", "dB").range(bottom - 1.0, top + 2.5),
        )
        .title(&data.title)
        .horizontal_line(REJECTION_LEVEL_DB, "");
        if let Some(peak) = data.peak_spec_db {
            panel = panel
                .horizontal_band(peak, f64::INFINITY, Tone::Forbidden, "not allowed")
                .horizontal_line(peak, &format!("peak {} dB", tidy(peak)));
        }
        if let Some(bandwidth) = data.bandwidth_spec {
            panel = panel
                .band(
                    (f64::NEG_INFINITY, bandwidth),
                    (REJECTION_LEVEL_DB, data.peak_spec_db.unwrap_or(f64::INFINITY)),
                    Tone::Forbidden,
                    "not allowed",
                )
                .text(
                    bandwidth,
                    0.5 * (REJECTION_LEVEL_DB + data.peak_spec_db.unwrap_or(0.0)),
                    &format!("{} rad/s", tidy(bandwidth)),
                    Anchor::Right,
                );
        }
        panel = data.responses.iter().fold(panel, |p, r| {
            p.line(Series::new(&r.name, &r.frequency, &r.magnitude_db()).style(r.style))
        });
        figure = figure.panel(panel);
    }
    figure
}

// ---------------------------------------------------------------------------
// Curves over speed, time and azimuth

fn curve_figure(
    title: &str,
    columns: usize,
    panels: &[CurvePanel],
    x: impl Fn() -> Axis,
) -> Figure {
    panels.iter().fold(Figure::new(title).columns(columns).share_x(), |figure, data| {
        figure.panel(curve_panel(x(), data))
    })
}

/// Gains over airspeed.
#[must_use]
pub fn gain_schedule_figure(title: &str, speed_unit: &str, panels: &[CurvePanel]) -> Figure {
    let columns = panels.len().clamp(1, 3);
    curve_figure(title, columns, panels, || Axis::linear("airspeed", speed_unit))
        .panel_size(225.0, 140.0)
}

/// Time histories, s, one above the other.
#[must_use]
pub fn time_history_figure(title: &str, columns: usize, panels: &[CurvePanel]) -> Figure {
    curve_figure(title, columns, panels, || Axis::linear("time", "s").tight())
        .panel_size(if columns > 1 { 300.0 } else { 460.0 }, 125.0)
}

/// Quantities over one revolution; abscissae are azimuths in degrees from 0 to 360.
#[must_use]
pub fn orbit_figure(title: &str, panels: &[CurvePanel]) -> Figure {
    let columns = panels.len().clamp(1, 2);
    curve_figure(title, columns, panels, || {
        Axis::degrees("azimuth of the reference blade").range(0.0, 360.0)
    })
    .panel_size(300.0, 140.0)
}

/// How the rotors act on each other over airspeed (or what `abscissa` and its
/// `unit` say): inflow, induced power or interference factors, a panel each.
#[must_use]
pub fn interference_figure(
    title: &str,
    abscissa: &str,
    unit: &str,
    panels: &[CurvePanel],
) -> Figure {
    let columns = panels.len().clamp(1, 2);
    curve_figure(title, columns, panels, || Axis::linear(abscissa, unit)).panel_size(310.0, 170.0)
}

// ---------------------------------------------------------------------------
// Margins

/// Design margins of several requirements at several speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct MarginMap {
    /// Names of the requirements, top to bottom.
    pub requirements: Vec<String>,
    /// Speeds as they are to be written, left to right.
    pub speeds: Vec<String>,
    /// Unit of the speeds.
    pub speed_unit: String,
    /// Margins by requirement, then speed; NaN where there is none.
    pub values: Vec<Vec<f64>>,
    /// What the numbers are, with their unit, like "design margin (%)".
    pub label: String,
    /// Decimals to write.
    pub decimals: usize,
    /// Margins below this are framed and underlined.
    pub required: f64,
}

/// A table of margins with the colour of each cell showing its value.
#[must_use]
pub fn heatmap_figure(title: &str, map: &MarginMap) -> Figure {
    let width = 44.0 * map.speeds.len() as f64;
    let height = 23.0 * map.requirements.len() as f64;
    Figure::new(title).panel_size(width, height).panel(
        Panel::new(
            Axis::categories("airspeed", &map.speed_unit, &map.speeds),
            Axis::categories("", "", &map.requirements),
        )
        .heatmap(&map.values, &map.label, map.decimals, Some(map.required)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(values: Vec<Complex64>) -> FrequencyResponse {
        FrequencyResponse {
            name: "model".into(),
            style: 0,
            frequency: (0..values.len()).map(|i| 0.1 * 1.05f64.powi(i as i32)).collect(),
            response: values,
        }
    }

    #[test]
    fn phase_follows_a_pure_delay_without_jumps() {
        let frequency: Vec<f64> = (0..200).map(|i| 0.1 * 1.05f64.powi(i)).collect();
        let delay = 0.1;
        let values = frequency.iter().map(|w| Complex64::from_polar(1.0, -w * delay)).collect();
        let phase = FrequencyResponse { frequency: frequency.clone(), ..response(values) }
            .phase_deg(Some(0.0));
        // Below half a turn a step, unwrapping is exact.
        for (w, p) in frequency.iter().zip(&phase).take_while(|(w, _)| **w < 500.0) {
            assert!((p + (w * delay).to_degrees()).abs() < 1e-9, "{w} {p}");
        }
    }

    #[test]
    fn phase_at_crossover_is_within_one_turn_below_zero() {
        // 1/s^3-like: -270 deg, which arg() calls +90.
        let values =
            (0..50).map(|i| Complex64::new(0.0, 10f64.powf(1.0 - 0.05 * f64::from(i)))).collect();
        let phase = response(values).phase_deg(None);
        assert!(phase.iter().all(|p| (p + 270.0).abs() < 1e-9));
    }

    #[test]
    fn zero_response_is_a_gap() {
        let r = response(vec![Complex64::new(1.0, 0.0), Complex64::new(0.0, 0.0)]);
        assert!(r.magnitude_db()[1].is_nan());
        assert!(r.phase_deg(None)[1].is_nan());
        assert_eq!(r.magnitude_db()[0], 0.0);
    }

    #[test]
    fn exclusion_region_is_its_margins() {
        let corners = ExclusionRegion { gain_margin_db: 6.0, phase_margin_deg: 45.0 }.corners();
        // Raising or lowering the gain by the margin takes the corner to -1.
        let six = 10f64.powf(0.3);
        assert!((corners[0] / six + 1.0).norm() < 1e-12);
        assert!((corners[2] * six + 1.0).norm() < 1e-12);
        // So does 45 deg of phase, lag on one side and lead on the other.
        let turn = Complex64::from_polar(1.0, 45f64.to_radians());
        assert!((corners[1] / turn + 1.0).norm() < 1e-12);
        assert!((corners[3] * turn + 1.0).norm() < 1e-12);
    }

    #[test]
    fn conjugate_sets_are_known() {
        let pair = [Complex64::new(-1.0, 2.0), Complex64::new(-1.0, -2.0)];
        assert!(is_own_conjugate(&pair));
        assert!(!is_own_conjugate(&pair[..1]));
    }

    #[test]
    fn landmarks_lie_on_the_curve() {
        let frequency: Vec<f64> = (0..100).map(|i| 0.1 * 1.1f64.powi(i)).collect();
        let r = FrequencyResponse {
            response: frequency
                .iter()
                .map(|w| Complex64::new(1.0, 0.0) / Complex64::new(0.0, *w))
                .collect(),
            frequency,
            ..response(Vec::new())
        };
        for (w, value) in landmarks(&r) {
            let exact = Complex64::new(1.0, 0.0) / Complex64::new(0.0, w);
            assert!((value / exact - 1.0).norm() < 5e-3, "{w}");
        }
    }

    #[test]
    fn figures_without_data_say_so() {
        for figure in [
            trim_figure("t", "kt", &[]),
            eigenvalue_figure("t", &[], &[]),
            bode_figure("t", &[]),
            sensitivity_figure("t", &[]),
            gain_schedule_figure("t", "kt", &[]),
            time_history_figure("t", 1, &[]),
            orbit_figure("t", &[]),
        ] {
            assert!(figure.to_svg().contains(">no data</text>"));
        }
    }
}
