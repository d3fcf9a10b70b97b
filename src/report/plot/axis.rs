//! Axes: what they measure, their range, and where their ticks go.

use super::svg::{fixed, typographic};

/// Smallest span of a linear axis relative to its largest value. Below it the
/// data are one number and rounding errors, which must not look like a curve.
const SMALLEST_RELATIVE_SPAN: f64 = 1e-9;

/// How values are laid out along an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// Equal lengths are equal differences.
    Linear,
    /// Equal lengths are equal ratios. Values that are not positive are left out.
    Log,
    /// Named places at 0, 1, 2, ...
    Category(Vec<String>),
}

/// What one axis of a panel measures and how it is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(super) label: String,
    pub(super) unit: String,
    pub(super) scale: Scale,
    pub(super) range: Option<(f64, f64)>,
    pub(super) tight: bool,
    pub(super) circular: bool,
    pub(super) minimum_span: f64,
    pub(super) include: Vec<f64>,
}

impl Axis {
    fn new(label: &str, unit: &str, scale: Scale) -> Self {
        Self {
            label: label.to_string(),
            unit: unit.to_string(),
            scale,
            range: None,
            tight: false,
            circular: false,
            minimum_span: 0.0,
            include: Vec::new(),
        }
    }

    /// A linear axis. The unit may be empty for a pure number.
    #[must_use]
    pub fn linear(label: &str, unit: &str) -> Self {
        Self::new(label, unit, Scale::Linear)
    }

    /// A logarithmic axis.
    #[must_use]
    pub fn log(label: &str, unit: &str) -> Self {
        Self::new(label, unit, Scale::Log)
    }

    /// A linear axis of degrees, with ticks at 15, 30, 45 or 90 when they are that far apart.
    #[must_use]
    pub fn degrees(label: &str) -> Self {
        Self { circular: true, ..Self::new(label, "deg", Scale::Linear) }
    }

    /// Named places at 0, 1, 2, ...
    #[must_use]
    pub fn categories(label: &str, unit: &str, names: &[String]) -> Self {
        Self::new(label, unit, Scale::Category(names.to_vec()))
    }

    /// Fixes the range. Curves beyond it are clipped.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Ends the axis exactly at the first and last value, without a margin.
    #[must_use]
    pub fn tight(mut self) -> Self {
        self.tight = true;
        self
    }

    /// Never shows less than `span`, so that noise about a constant looks constant.
    #[must_use]
    pub fn minimum_span(mut self, span: f64) -> Self {
        self.minimum_span = span;
        self
    }

    /// Makes sure that `value` is on the axis.
    #[must_use]
    pub fn include(mut self, value: f64) -> Self {
        self.include.push(value);
        self
    }

    /// Label with the unit in brackets.
    pub(super) fn caption(&self) -> String {
        match (self.label.is_empty(), self.unit.is_empty()) {
            (_, true) => self.label.clone(),
            (true, false) => self.unit.clone(),
            (false, false) => format!("{} ({})", self.label, self.unit),
        }
    }

    /// Number of named places; none on an axis of numbers.
    pub(super) fn places(&self) -> usize {
        match &self.scale {
            Scale::Category(names) => names.len(),
            _ => 0,
        }
    }

    pub(super) fn is_log(&self) -> bool {
        self.scale == Scale::Log
    }

    /// Whether the axis can show `value`.
    pub(super) fn accepts(&self, value: f64) -> bool {
        value.is_finite() && (!self.is_log() || value > 0.0)
    }

    /// The range to draw for data between `extent`, if there is any to draw.
    pub(super) fn resolve(&self, extent: Option<(f64, f64)>) -> Option<(f64, f64)> {
        if let Scale::Category(names) = &self.scale {
            return (!names.is_empty()).then(|| (-0.5, names.len() as f64 - 0.5));
        }
        if let Some((low, high)) = self.range {
            let usable = self.accepts(low) && self.accepts(high) && low != high;
            return usable.then(|| (low.min(high), low.max(high)));
        }
        let (mut low, mut high) = extent?;
        for &value in self.include.iter().filter(|v| self.accepts(**v)) {
            low = low.min(value);
            high = high.max(value);
        }
        if self.is_log() {
            let (mut a, mut b) = (low.log10(), high.log10());
            if b - a < 1e-6 {
                (a, b) = (a - 0.5, b + 0.5);
            } else if !self.tight {
                let margin = 0.04 * (b - a);
                (a, b) = (a - margin, b + margin);
            }
            return Some((10f64.powf(a), 10f64.powf(b)));
        }
        let size = low.abs().max(high.abs());
        let smallest = self.minimum_span.max(SMALLEST_RELATIVE_SPAN * size);
        if high - low <= smallest {
            let middle = 0.5 * low + 0.5 * high;
            let half = if self.minimum_span > 0.0 {
                0.5 * smallest
            } else if size > 0.0 {
                0.1 * size
            } else {
                1.0
            };
            return Some((middle - half, middle + half));
        }
        if !self.tight {
            let margin = 0.05 * (high - low);
            (low, high) = (low - margin, high + margin);
        }
        Some((low, high))
    }

    /// Ticks for a range, at most `most` of them labelled.
    pub(super) fn ticks(&self, low: f64, high: f64, most: usize) -> Ticks {
        match &self.scale {
            Scale::Linear => linear_ticks(low, high, most, self.circular),
            Scale::Log => log_ticks(low, high, most),
            Scale::Category(names) => {
                let stride = names.len().div_ceil(most.max(1)).max(1);
                let major = names
                    .iter()
                    .enumerate()
                    .step_by(stride)
                    .map(|(i, name)| Tick {
                        value: i as f64,
                        label: TickLabel::Plain(name.clone()),
                    })
                    .collect();
                Ticks { major, minor: Vec::new(), exponent: 0 }
            }
        }
    }
}

/// A value along an axis between two pixel positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Map {
    pub low: f64,
    pub high: f64,
    pub log: bool,
    pub start: f64,
    pub end: f64,
}

impl Map {
    /// Pixel position of `value`; NaN where a log axis cannot show it.
    pub fn pixel(&self, value: f64) -> f64 {
        let fraction = if self.log {
            if value <= 0.0 {
                return f64::NAN;
            }
            (value.log10() - self.low.log10()) / (self.high.log10() - self.low.log10())
        } else {
            // Halved, so that the widest finite range does not overflow.
            (0.5 * value - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
        };
        self.start + fraction * (self.end - self.start)
    }
}

/// The text of a tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum TickLabel {
    Plain(String),
    /// Ten to this power.
    Decade(i32),
}

/// A labelled tick.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub value: f64,
    pub label: TickLabel,
}

/// The ticks of an axis; labels are to be multiplied by ten to `exponent`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub major: Vec<Tick>,
    pub minor: Vec<f64>,
    pub exponent: i32,
}

/// Ten to an integer power, exact where a double can be exact.
fn power_of_ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// `multiple * mantissa * 10^exponent`, rounded once.
fn decimal(multiple: f64, mantissa: f64, exponent: i32) -> f64 {
    if exponent < 0 && exponent > -300 {
        multiple * mantissa / power_of_ten(-exponent)
    } else {
        multiple * mantissa * power_of_ten(exponent)
    }
}

/// The smallest step of the family 1-2-5 (or of a circle) with at most `most` ticks.
fn step_for(span: f64, most: usize, circular: bool) -> (f64, i32) {
    let target = span / most.max(1) as f64;
    if circular && (10.0..=360.0).contains(&target) {
        for step in [15.0, 30.0, 45.0, 90.0, 180.0, 360.0] {
            if step >= target {
                return (step, 0);
            }
        }
    }
    let mut exponent = target.log10().floor() as i32;
    loop {
        for mantissa in [1.0, 2.0, 5.0] {
            if decimal(1.0, mantissa, exponent) >= target * (1.0 - 1e-12) {
                return (mantissa, exponent);
            }
        }
        exponent += 1;
    }
}

fn linear_ticks(low: f64, high: f64, most: usize, circular: bool) -> Ticks {
    let span = high - low;
    let none = Ticks { major: Vec::new(), minor: Vec::new(), exponent: 0 };
    if !(span > 0.0 && span.is_finite()) {
        return none;
    }
    // One less, because a span of n steps can hold n + 1 ticks.
    let (mantissa, exponent) = step_for(span, most.saturating_sub(1).max(1), circular);
    let step = decimal(1.0, mantissa, exponent);
    let slack = 1e-9;
    let first = (low / step - slack).ceil();
    let last = (high / step + slack).floor();
    if !(first.is_finite() && last.is_finite()) || last - first > 1000.0 {
        return none;
    }
    let values: Vec<f64> = (0..=((last - first) as usize))
        .map(|i| decimal(first + i as f64, mantissa, exponent) + 0.0)
        .collect();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let magnitude = if largest > 0.0 { largest.log10().floor() as i32 } else { 0 };
    let shift = if (-3..=4).contains(&magnitude) { 0 } else { magnitude.div_euclid(3) * 3 };
    let decimals = usize::try_from((shift - exponent).max(0)).unwrap_or(0);
    let major = values
        .into_iter()
        .map(|value| Tick {
            value,
            label: TickLabel::Plain(typographic(&fixed(decimal(value, 1.0, -shift), decimals))),
        })
        .collect();
    Ticks { major, minor: Vec::new(), exponent: shift }
}

fn log_ticks(low: f64, high: f64, most: usize) -> Ticks {
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Ticks { major: Vec::new(), minor: Vec::new(), exponent: 0 };
    }
    let slack = 1.0 + 1e-9;
    let inside = |v: f64| v >= low / slack && v <= high * slack;
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades: Vec<i32> = (first..=last).filter(|&e| inside(power_of_ten(e))).collect();
    let marks = |mantissas: &[f64]| -> Vec<(f64, i32)> {
        (first..=last)
            .flat_map(|e| mantissas.iter().map(move |&m| (decimal(1.0, m, e), e)))
            .filter(|&(v, _)| inside(v))
            .collect()
    };
    if (high / low).log10() >= 1.5 && decades.len() >= 2 {
        let stride = decades.len().div_ceil(most.max(2)).max(1) as i32;
        let major = decades
            .iter()
            .filter(|e| e.rem_euclid(stride) == 0)
            .map(|&e| Tick { value: power_of_ten(e), label: TickLabel::Decade(e) })
            .collect();
        let minor = if stride == 1 {
            marks(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).into_iter().map(|(v, _)| v).collect()
        } else {
            decades.iter().filter(|e| e.rem_euclid(stride) != 0).map(|&e| power_of_ten(e)).collect()
        };
        return Ticks { major, minor, exponent: 0 };
    }
    // Less than a decade and a half: label 1, 2 and 5 in plain numbers, and
    // ordinary ticks where not even two of those are in sight.
    let labelled = marks(&[1.0, 2.0, 5.0]);
    if labelled.len() < 2 {
        return linear_ticks(low, high, most, false);
    }
    let major: Vec<Tick> = labelled
        .into_iter()
        .map(|(value, e)| Tick {
            value,
            label: if (-3..=4).contains(&e) {
                TickLabel::Plain(fixed(value, usize::try_from(-e).unwrap_or(0)))
            } else {
                TickLabel::Plain(format!("{value:e}"))
            },
        })
        .collect();
    let minor = marks(&[3.0, 4.0, 6.0, 7.0, 8.0, 9.0]).into_iter().map(|(v, _)| v).collect();
    Ticks { major, minor, exponent: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(ticks: &Ticks) -> Vec<String> {
        ticks
            .major
            .iter()
            .map(|t| match &t.label {
                TickLabel::Plain(s) => s.clone(),
                TickLabel::Decade(e) => format!("10^{e}"),
            })
            .collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(
            labels(&linear_ticks(-0.3, 1.1, 8, false)),
            ["−0.2", "0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(&linear_ticks(-190.0, 100.0, 8, true)),
            ["−180", "−135", "−90", "−45", "0", "45", "90"]
        );
    }

    #[test]
    fn large_numbers_share_an_exponent() {
        let ticks = linear_ticks(0.0, 3.0e6, 5, false);
        assert_eq!(ticks.exponent, 6);
        assert_eq!(labels(&ticks), ["0", "1", "2", "3"]);
        let ticks = linear_ticks(0.0, 4.0e-5, 5, false);
        assert_eq!(ticks.exponent, -6);
        assert_eq!(labels(&ticks), ["0", "10", "20", "30", "40"]);
    }

    #[test]
    fn log_axes_label_decades_or_one_two_five() {
        assert_eq!(labels(&log_ticks(0.05, 200.0, 8)), ["10^-1", "10^0", "10^1", "10^2"]);
        assert_eq!(labels(&log_ticks(0.9, 11.0, 8)), ["1", "2", "5", "10"]);
        assert_eq!(labels(&log_ticks(0.1, 0.5, 8)), ["0.1", "0.2", "0.5"]);
        assert_eq!(labels(&log_ticks(2.1, 2.9, 5)), ["2.2", "2.4", "2.6", "2.8"]);
        let wide = log_ticks(1e-12, 1e12, 8);
        assert!(wide.major.len() <= 8 && wide.major.len() >= 4);
        assert!(wide.major.iter().any(|t| t.label == TickLabel::Decade(0)));
    }

    #[test]
    fn a_constant_is_shown_as_a_constant() {
        let axis = Axis::linear("power", "hp");
        let (low, high) = axis.resolve(Some((75.0, 75.0 + 1e-12))).unwrap();
        assert!(high - low > 10.0, "{low} {high}");
        assert_eq!(axis.resolve(Some((0.0, 0.0))), Some((-1.0, 1.0)));
        let (low, high) = axis.clone().minimum_span(2.0).resolve(Some((0.0, 1e-3))).unwrap();
        assert!((high - low - 2.0).abs() < 1e-12);
    }

    #[test]
    fn an_axis_refuses_what_it_cannot_show() {
        assert_eq!(Axis::log("f", "").range(0.0, 1.0).resolve(None), None);
        assert_eq!(Axis::linear("f", "").range(f64::NAN, 1.0).resolve(None), None);
        assert!(!Axis::log("f", "").accepts(-1.0));
    }

    proptest! {
        #[test]
        fn linear_ticks_lie_in_range_evenly(
            low in -1e6..1e6f64, exponent in -6..6i32, most in 4usize..12, circular: bool,
        ) {
            let span = 10f64.powi(exponent) * 3.7;
            prop_assume!(span > 1e-9 * low.abs());
            let high = low + span;
            let ticks = linear_ticks(low, high, most, circular);
            let values: Vec<f64> = ticks.major.iter().map(|t| t.value).collect();
            prop_assert!(values.len() <= most, "{values:?}");
            // A step is at most 2.5 times (3 on a circle) the ideal one.
            prop_assert!(values.len() + 1 >= most / 4, "{values:?}");
            let slack = 1e-6 * span;
            for pair in values.windows(2) {
                prop_assert!(pair[1] > pair[0]);
                let step = values[1] - values[0];
                prop_assert!((pair[1] - pair[0] - step).abs() < slack);
            }
            for value in &values {
                prop_assert!(*value >= low - slack && *value <= high + slack);
            }
            // No two ticks read the same.
            let texts = labels(&ticks);
            let distinct: std::collections::BTreeSet<_> = texts.iter().collect();
            prop_assert_eq!(distinct.len(), texts.len());
        }

        #[test]
        fn linear_labels_say_the_value(low in -1e3..1e3f64, span in 1e-2..1e5f64) {
            let ticks = linear_ticks(low, low + span, 7, false);
            for tick in &ticks.major {
                let TickLabel::Plain(text) = &tick.label else { panic!("decade on a linear axis") };
                let read: f64 = text.replace('−', "-").parse().unwrap();
                let read = read * 10f64.powi(ticks.exponent);
                prop_assert!((read - tick.value).abs() <= 1e-9 * span.max(tick.value.abs()));
            }
        }

        #[test]
        fn log_ticks_lie_in_range_and_never_clash(
            start in -9.0..9.0f64, decades in 0.05..20.0f64, most in 4usize..12,
        ) {
            let (low, high) = (10f64.powf(start), 10f64.powf(start + decades));
            let ticks = log_ticks(low, high, most);
            prop_assert!(!ticks.major.is_empty());
            for pair in ticks.major.windows(2) {
                prop_assert!(pair[1].value > pair[0].value);
            }
            for value in ticks.major.iter().map(|t| t.value).chain(ticks.minor.iter().copied()) {
                prop_assert!(value >= low * (1.0 - 1e-6) && value <= high * (1.0 + 1e-6));
            }
            for minor in &ticks.minor {
                prop_assert!(ticks.major.iter().all(|t| (t.value / minor - 1.0).abs() > 1e-6));
            }
        }
    }
}
