//! Coloured cells with their numbers, and the bar that explains the colours.

use std::fmt::Write as _;

use super::super::axis::Map;
use super::super::colors::{luminance, role, sequential_color};
use super::super::svg::{coordinate as px, escape, fixed, text_width, typographic};
use super::super::{Axis, Heatmap, Scale};
use super::ink::*;
use super::panel::Artist;

impl Artist<'_> {
    pub(super) fn cells(&mut self, map: &Heatmap, to_x: &Map, to_y: &Map) {
        let finite: Vec<f64> =
            map.values.iter().flatten().copied().filter(|v| v.is_finite()).collect();
        let low = finite.iter().copied().fold(f64::INFINITY, f64::min);
        let high = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if finite.is_empty() {
            (0.0, 1.0)
        } else if high - low > 1e-12 * high.abs().max(low.abs()) {
            (low, high)
        } else {
            (low - 0.5, high + 0.5)
        };
        let fraction = |v: f64| (v - low) / (high - low);
        let name = |names: &Scale, i: usize| match names {
            Scale::Category(names) => names.get(i).cloned().unwrap_or_default(),
            _ => String::new(),
        };
        let mut frames = String::new();
        let (rows, columns) = (self.panel.y.places(), self.panel.x.places());
        for (row, values) in map.values.iter().enumerate().take(rows) {
            for (column, &value) in values.iter().enumerate().take(columns) {
                let (c, r) = (column as f64, row as f64);
                let (x0, x1) = (to_x.pixel(c - 0.5), to_x.pixel(c + 0.5));
                let (y0, y1) = (to_y.pixel(r - 0.5), to_y.pixel(r + 0.5));
                let below = map.threshold.is_some_and(|t| value < t);
                let (color, number) = if value.is_finite() {
                    let [r, g, b] = sequential_color(fraction(value));
                    (
                        format!("#{r:02x}{g:02x}{b:02x}"),
                        typographic(&honest(value, map.decimals, map.threshold)),
                    )
                } else {
                    ("none".to_string(), "–".to_string())
                };
                // The ink with the higher contrast; 0.18 is the luminance where
                // black and white are equally far.
                let ink = if !value.is_finite() {
                    role("muted")
                } else if luminance(sequential_color(fraction(value))) < 0.18 {
                    "#ffffff"
                } else {
                    "#111111"
                };
                let size =
                    TICK_SIZE.min(0.55 * (y1 - y0)).min(0.9 * (x1 - x0) / text_width(&number, 1.0));
                let emphasis =
                    if below { " font-weight=\"700\" text-decoration=\"underline\"" } else { "" };
                let hover = format!(
                    "{}, {}{} {}: {number} {}",
                    name(&self.panel.y.scale, row),
                    self.panel.x.label,
                    if self.panel.x.label.is_empty() { "" } else { " " }.to_string()
                        + &name(&self.panel.x.scale, column),
                    self.panel.x.unit,
                    map.label,
                );
                self.put(&format!(
                    "<g><title>{}</title><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" \
                     fill=\"{color}\"/><text x=\"{}\" y=\"{}\" text-anchor=\"middle\" \
                     font-size=\"{}\" fill=\"{ink}\"{emphasis}>{number}</text></g>",
                    escape(&hover),
                    px(x0),
                    px(y0),
                    px(x1 - x0),
                    px(y1 - y0),
                    px(0.5 * (x0 + x1)),
                    px(0.5 * (y0 + y1) + 0.36 * size),
                    px(size)
                ));
                if below {
                    let _ = write!(
                        frames,
                        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" \
                         stroke-width=\"2\" {}/>",
                        px(x0 + 1.5),
                        px(y0 + 1.5),
                        px(x1 - x0 - 3.0),
                        px(y1 - y0 - 3.0),
                        stroke("forbidden")
                    );
                }
            }
        }
        if !frames.is_empty() {
            self.put(&frames);
        }
        self.color_bar(map, low, high);
    }

    fn color_bar(&mut self, map: &Heatmap, low: f64, high: f64) {
        let f = self.frame;
        let (x, width) = (f.right() + 14.0, 11.0);
        let bar = Map { low, high, log: false, start: f.bottom(), end: f.y };
        let steps = 48;
        for i in 0..steps {
            let top = f.y + f.height * f64::from(i) / f64::from(steps);
            let [r, g, b] = sequential_color(1.0 - (f64::from(i) + 0.5) / f64::from(steps));
            // Overlapping a little, so that no seam shows between the steps.
            let height = (f.height / f64::from(steps) + 0.5).min(f.bottom() - top);
            let _ = write!(
                self.out,
                "<rect x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{}\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
                px(x),
                px(top),
                px(height)
            );
        }
        self.put("");
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{}\" fill=\"none\" \
             stroke-width=\"0.8\" {}/>",
            px(x),
            px(f.y),
            px(f.height),
            stroke("frame")
        ));
        let most = (f.height / 26.0).clamp(3.0, 8.0) as usize;
        let ticks = Axis::linear("", "").ticks(low, high, most);
        let mut widest = 0.0_f64;
        for tick in &ticks.major {
            let y = bar.pixel(tick.value);
            widest = widest.max(label_width(&tick.label));
            let mark = format!(
                "<path d=\"{}\" stroke-width=\"0.8\" {}/>{}",
                rule([x + width, y], [x + width + 3.0, y]),
                stroke("frame"),
                tick_text(x + width + 5.0, y + 3.5, "start", &tick.label)
            );
            self.put(&mark);
        }
        let label = format!(
            "<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\" \
             font-size=\"{TICK_SIZE}\" {}>{}</text>",
            px(x + width + 5.0 + widest + 12.0),
            px(f.y + 0.5 * f.height),
            fill("fg"),
            escape(&map.label)
        );
        self.put(&label);
    }
}

/// A number that does not round up to a threshold it is below: up to three more
/// decimals are written to show the difference.
fn honest(value: f64, decimals: usize, threshold: Option<f64>) -> String {
    let reads = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
    match threshold {
        Some(limit) if value < limit => (decimals..=decimals + 3)
            .map(|d| fixed(value, d))
            .find(|text| reads(text) < limit)
            .unwrap_or_else(|| fixed(value, decimals)),
        _ => fixed(value, decimals),
    }
}
