//! Sizes, colours, lettering and marks: the strokes that everything is drawn with.

use std::fmt::Write as _;

use super::super::axis::TickLabel;
use super::super::colors::{LIGHT_PALETTE, role};
use super::super::svg::{coordinate as px, escape, fixed, text_width, typographic};
use super::super::{STYLE_COUNT, Tone};

pub(in crate::report::plot) const TITLE_SIZE: f64 = 14.0;
pub(in crate::report::plot) const SUBTITLE_SIZE: f64 = 11.0;
pub(in crate::report::plot) const PANEL_TITLE_SIZE: f64 = 11.5;
pub(in crate::report::plot) const LABEL_SIZE: f64 = 11.0;
pub(in crate::report::plot) const TICK_SIZE: f64 = 10.0;
pub(in crate::report::plot) const NOTE_SIZE: f64 = 9.5;
pub(in crate::report::plot) const LEGEND_SIZE: f64 = 10.5;
pub(in crate::report::plot) const LEGEND_LINE: f64 = 15.0;
pub(in crate::report::plot) const LEGEND_SAMPLE: f64 = 28.0;
pub(in crate::report::plot) const TICK_LENGTH: f64 = 4.0;
pub(in crate::report::plot) const OUTER_MARGIN: f64 = 10.0;
/// Curves are cut this far outside the frame; the clip path does the rest.
pub(in crate::report::plot) const CLIP_MARGIN: f64 = 20.0;
/// Series with more points than this get no mark or hover text on each of them.
pub(in crate::report::plot) const MOST_MARKS: usize = 400;
/// Stands for the figure's identifier until its contents are known.
pub(in crate::report::plot) const ID: &str = "\u{1}";

pub(in crate::report::plot) const DASHES: [&str; STYLE_COUNT] =
    ["", "7 3.2", "1.8 2.6", "8 3 1.8 3", "3.6 2.2", "10 3 1.8 2.6 1.8 3", "13 4", "1.2 4"];

pub(in crate::report::plot) const FONTS: &str =
    "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";

/// Attributes for a stroke in a role's colour.
pub(in crate::report::plot) fn stroke(name: &str) -> String {
    format!("class=\"cx-s-{name}\" stroke=\"{}\"", role(name))
}

/// Attributes for a fill in a role's colour.
pub(in crate::report::plot) fn fill(name: &str) -> String {
    format!("class=\"cx-f-{name}\" fill=\"{}\"", role(name))
}

/// Class and colour of a tone, for use with `cx-s-` and `cx-f-`.
pub(in crate::report::plot) fn tone_color(tone: Tone) -> (String, &'static str) {
    match tone {
        Tone::Forbidden => ("forbidden".to_string(), role("forbidden")),
        Tone::Neutral => ("muted".to_string(), role("muted")),
        Tone::Style(i) => {
            let i = i % STYLE_COUNT;
            (i.to_string(), LIGHT_PALETTE[i])
        }
    }
}

pub(in crate::report::plot) fn tone_opacity(tone: Tone) -> f64 {
    match tone {
        Tone::Forbidden => 0.13,
        Tone::Neutral => 0.12,
        Tone::Style(_) => 0.18,
    }
}

/// Text at a place: `anchor` is start, middle or end.
pub(in crate::report::plot) fn text(
    x: f64,
    y: f64,
    anchor: &str,
    size: f64,
    color: &str,
    content: &str,
) -> String {
    format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" font-size=\"{size}\" {}>{}</text>",
        px(x),
        px(y),
        fill(color),
        rich(content, size)
    )
}

/// Text with a halo of the background, readable on top of lines.
pub(in crate::report::plot) fn halo_text(
    x: f64,
    y: f64,
    anchor: &str,
    size: f64,
    color: &str,
    content: &str,
) -> String {
    format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" font-size=\"{size}\" \
         class=\"cx-f-{color} cx-s-bg\" fill=\"{}\" stroke=\"{}\" stroke-width=\"3\" \
         stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>",
        px(x),
        px(y),
        role(color),
        role("bg"),
        rich(content, size)
    )
}

/// The runs of a label and how far each is shifted down, px: `_{...}` is a
/// subscript, `^{...}` a superscript.
pub(in crate::report::plot) fn runs(label: &str) -> Vec<(&str, f64)> {
    let mut found = Vec::new();
    let mut rest = label;
    let next = |s: &str| match (s.find("_{"), s.find("^{")) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    };
    while let Some(at) = next(rest) {
        let Some(length) = rest[at..].find('}') else {
            break;
        };
        let shift = if rest[at..].starts_with('_') { 3.0 } else { -4.0 };
        found.push((&rest[..at], 0.0));
        found.push((&rest[at + 2..at + length], shift));
        rest = &rest[at + length + 1..];
    }
    found.push((rest, 0.0));
    found.retain(|(run, _)| !run.is_empty());
    found
}

/// A label as SVG text content.
pub(in crate::report::plot) fn rich(label: &str, size: f64) -> String {
    let mut out = String::new();
    // In SVG a shift holds for all that follows.
    let mut now = 0.0;
    for (run, shift) in runs(label) {
        let dy = shift - now;
        // Some viewers drop a blank at the start of a run: move instead.
        let blank = dy != 0.0 && run.starts_with(' ');
        let words = escape(if blank { &run[1..] } else { run });
        let dx = if blank { format!(" dx=\"{}\"", px(0.3 * size)) } else { String::new() };
        let _ = if shift != 0.0 {
            let small = px(0.75 * size);
            write!(out, "<tspan dy=\"{dy}\"{dx} font-size=\"{small}\">{words}</tspan>")
        } else if dy != 0.0 {
            write!(out, "<tspan dy=\"{dy}\"{dx}>{words}</tspan>")
        } else {
            write!(out, "{words}")
        };
        now = shift;
    }
    out
}

/// A label without the markup of [`rich`].
pub(in crate::report::plot) fn plain(label: &str) -> String {
    runs(label).into_iter().map(|(run, _)| run).collect()
}

pub(in crate::report::plot) fn rule(a: [f64; 2], b: [f64; 2]) -> String {
    format!("M{} {}L{} {}", px(a[0]), px(a[1]), px(b[0]), px(b[1]))
}

pub(in crate::report::plot) fn label_width(label: &TickLabel) -> f64 {
    match label {
        TickLabel::Plain(s) => text_width(s, TICK_SIZE),
        TickLabel::Decade(e) => {
            text_width("10", TICK_SIZE) + text_width(&e.to_string(), 0.75 * TICK_SIZE)
        }
    }
}

pub(in crate::report::plot) fn tick_text(
    x: f64,
    y: f64,
    anchor: &str,
    label: &TickLabel,
) -> String {
    match label {
        TickLabel::Plain(s) => text(x, y, anchor, TICK_SIZE, "fg", s),
        TickLabel::Decade(e) => format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" font-size=\"{TICK_SIZE}\" {}>10\
             <tspan dy=\"-4\" font-size=\"{}\">{}</tspan></text>",
            px(x),
            px(y),
            fill("fg"),
            0.75 * TICK_SIZE,
            typographic(&e.to_string())
        ),
    }
}

pub(in crate::report::plot) fn factor_text(exponent: i32) -> String {
    let digits: String = exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '0' => '⁰',
            d => char::from_u32('⁰' as u32 + d.to_digit(10).unwrap_or(0)).unwrap_or(d),
        })
        .collect();
    format!("×10{digits}")
}

/// Breaks `content` at blanks into lines no wider than `width`.
pub(in crate::report::plot) fn wrap(content: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in content.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(&plain(&format!("{line} {word}")), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

/// A number for a hover text: five significant digits.
pub(in crate::report::plot) fn readable(value: f64) -> String {
    if !value.is_finite() {
        return "not finite".to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..=6).contains(&magnitude) {
        return typographic(&format!("{value:.4e}"));
    }
    let decimals = usize::try_from((4 - magnitude).clamp(0, 8)).unwrap_or(0);
    let mut digits = fixed(value, decimals);
    if digits.contains('.') {
        digits.truncate(digits.trim_end_matches('0').trim_end_matches('.').len());
    }
    typographic(&digits)
}

pub(in crate::report::plot) fn curve_path(
    d: &str,
    color: usize,
    dash: usize,
    width: f64,
) -> String {
    let pattern = match DASHES[dash % STYLE_COUNT] {
        "" => String::new(),
        dashes => format!(" stroke-dasharray=\"{dashes}\""),
    };
    let cap = if dash.is_multiple_of(STYLE_COUNT) { " stroke-linecap=\"round\"" } else { "" };
    format!(
        "<path d=\"{d}\" class=\"cx-s-{color}\" fill=\"none\" stroke=\"{}\" \
         stroke-width=\"{width}\" stroke-linejoin=\"round\"{cap}{pattern}/>",
        LIGHT_PALETTE[color % STYLE_COUNT]
    )
}

/// A mark with an optional hover text. Even markers are filled, odd ones open;
/// open ones cover the line they are on, but not other marks.
pub(in crate::report::plot) fn mark(
    marker: usize,
    color: usize,
    [x, y]: [f64; 2],
    on_line: bool,
    hover: &str,
) -> String {
    let corners = |points: &[[f64; 2]]| -> String {
        let mut d = String::new();
        for (i, p) in points.iter().enumerate() {
            let command = if i == 0 { 'M' } else { 'L' };
            let _ = write!(d, "{command}{} {}", px(x + p[0]), px(y + p[1]));
        }
        d + "Z"
    };
    let circle = |r: f64| {
        format!(
            "M{} {}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0Z",
            px(x - r),
            px(y),
            2.0 * r,
            -2.0 * r
        )
    };
    let d = match marker % STYLE_COUNT {
        0 => circle(3.0),
        1 => corners(&[[-2.8, -2.8], [2.8, -2.8], [2.8, 2.8], [-2.8, 2.8]]),
        2 => corners(&[[0.0, -3.8], [3.4, 2.4], [-3.4, 2.4]]),
        3 => corners(&[[0.0, -4.0], [4.0, 0.0], [0.0, 4.0], [-4.0, 0.0]]),
        4 => corners(&[[-2.6, -2.6], [2.6, -2.6], [2.6, 2.6], [-2.6, 2.6]]),
        5 => {
            rule([x - 3.2, y - 3.2], [x + 3.2, y + 3.2])
                + &rule([x - 3.2, y + 3.2], [x + 3.2, y - 3.2])
        }
        6 => corners(&[[0.0, 3.8], [3.4, -2.4], [-3.4, -2.4]]),
        _ => rule([x - 4.0, y], [x + 4.0, y]) + &rule([x, y - 4.0], [x, y + 4.0]),
    };
    let solid = marker.is_multiple_of(2);
    let ink = LIGHT_PALETTE[color % STYLE_COUNT];
    let (class, inside) = if solid {
        (format!("cx-f-{color}"), ink)
    } else if on_line {
        ("cx-f-bg".to_string(), role("bg"))
    } else {
        ("cx-open".to_string(), "none")
    };
    let title =
        if hover.is_empty() { String::new() } else { format!("<title>{}</title>", escape(hover)) };
    // Where a script finds the mark that it belongs to.
    let at =
        if hover.is_empty() { String::new() } else { format!(" data-at=\"{} {}\"", px(x), px(y)) };
    format!(
        "<path d=\"{d}\"{at} class=\"{class} cx-s-{color}\" fill=\"{inside}\" stroke=\"{ink}\" \
         stroke-width=\"1.2\">{title}</path>"
    )
}
