//! From a described figure to the text of its SVG.
//!
//! Two passes: the first chooses ranges and ticks, and from the width of their
//! labels the margins; the second draws each panel in its final place.

use std::fmt::Write as _;

use super::axis::{Map, Tick, TickLabel, Ticks};
use super::colors::{LIGHT_PALETTE, STYLESHEET, luminance, role, sequential_color};
use super::svg::{
    Frame, clip_segment, coordinate as px, escape, fixed, polygon, polyline, text_width, thinned,
    typographic,
};
use super::{Anchor, Figure, Heatmap, Item, Legend, Panel, STYLE_COUNT, Series, Tone};

const TITLE_SIZE: f64 = 14.0;
const SUBTITLE_SIZE: f64 = 11.0;
const PANEL_TITLE_SIZE: f64 = 11.5;
const LABEL_SIZE: f64 = 11.0;
const TICK_SIZE: f64 = 10.0;
const NOTE_SIZE: f64 = 9.5;
const LEGEND_SIZE: f64 = 10.5;
const LEGEND_LINE: f64 = 15.0;
const LEGEND_SAMPLE: f64 = 28.0;
const TICK_LENGTH: f64 = 4.0;
const OUTER_MARGIN: f64 = 10.0;
/// Curves are cut this far outside the frame; the clip path does the rest.
const CLIP_MARGIN: f64 = 20.0;
/// Series with more points than this get no mark or hover text on each of them.
const MOST_MARKS: usize = 400;
/// Stands for the figure's identifier until its contents are known.
const ID: &str = "\u{1}";

const DASHES: [&str; STYLE_COUNT] = [
    "",
    "7 3.2",
    "1.8 2.6",
    "8 3 1.8 3",
    "3.6 2.2",
    "10 3 1.8 2.6 1.8 3",
    "13 4",
    "1.2 4",
];

const FONTS: &str =
    "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";

/// Attributes for a stroke in a role's colour.
fn stroke(name: &str) -> String {
    format!("class=\"cx-s-{name}\" stroke=\"{}\"", role(name))
}

/// Attributes for a fill in a role's colour.
fn fill(name: &str) -> String {
    format!("class=\"cx-f-{name}\" fill=\"{}\"", role(name))
}

/// Class and colour of a tone, for use with `cx-s-` and `cx-f-`.
fn tone_color(tone: Tone) -> (String, &'static str) {
    match tone {
        Tone::Forbidden => ("forbidden".to_string(), role("forbidden")),
        Tone::Neutral => ("muted".to_string(), role("muted")),
        Tone::Style(i) => {
            let i = i % STYLE_COUNT;
            (i.to_string(), LIGHT_PALETTE[i])
        }
    }
}

fn tone_opacity(tone: Tone) -> f64 {
    match tone {
        Tone::Forbidden => 0.13,
        Tone::Neutral => 0.12,
        Tone::Style(_) => 0.18,
    }
}

/// Text at a place: `anchor` is start, middle or end.
fn text(x: f64, y: f64, anchor: &str, size: f64, color: &str, content: &str) -> String {
    format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" font-size=\"{size}\" {}>{}</text>",
        px(x),
        px(y),
        fill(color),
        rich(content, size)
    )
}

/// Text with a halo of the background, readable on top of lines.
fn halo_text(x: f64, y: f64, anchor: &str, size: f64, color: &str, content: &str) -> String {
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
fn runs(label: &str) -> Vec<(&str, f64)> {
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
        let shift = if rest[at..].starts_with('_') {
            3.0
        } else {
            -4.0
        };
        found.push((&rest[..at], 0.0));
        found.push((&rest[at + 2..at + length], shift));
        rest = &rest[at + length + 1..];
    }
    found.push((rest, 0.0));
    found.retain(|(run, _)| !run.is_empty());
    found
}

/// A label as SVG text content.
fn rich(label: &str, size: f64) -> String {
    let mut out = String::new();
    // In SVG a shift holds for all that follows.
    let mut now = 0.0;
    for (run, shift) in runs(label) {
        let dy = shift - now;
        // Some viewers drop a blank at the start of a run: move instead.
        let blank = dy != 0.0 && run.starts_with(' ');
        let words = escape(if blank { &run[1..] } else { run });
        let dx = if blank {
            format!(" dx=\"{}\"", px(0.3 * size))
        } else {
            String::new()
        };
        let _ = if shift != 0.0 {
            let small = px(0.75 * size);
            write!(
                out,
                "<tspan dy=\"{dy}\"{dx} font-size=\"{small}\">{words}</tspan>"
            )
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
fn plain(label: &str) -> String {
    runs(label).into_iter().map(|(run, _)| run).collect()
}

fn rule(a: [f64; 2], b: [f64; 2]) -> String {
    format!("M{} {}L{} {}", px(a[0]), px(a[1]), px(b[0]), px(b[1]))
}

fn label_width(label: &TickLabel) -> f64 {
    match label {
        TickLabel::Plain(s) => text_width(s, TICK_SIZE),
        TickLabel::Decade(e) => {
            text_width("10", TICK_SIZE) + text_width(&e.to_string(), 0.75 * TICK_SIZE)
        }
    }
}

fn tick_text(x: f64, y: f64, anchor: &str, label: &TickLabel) -> String {
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

fn factor_text(exponent: i32) -> String {
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
fn wrap(content: &str, size: f64, width: f64) -> Vec<String> {
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
fn readable(value: f64) -> String {
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

/// One line of a legend.
#[derive(Debug, Clone, PartialEq)]
struct Entry {
    label: String,
    sample: Sample,
}

#[derive(Debug, Clone, PartialEq)]
enum Sample {
    Curve {
        color: usize,
        dash: usize,
        marker: usize,
        has_line: bool,
        has_marks: bool,
        width: f64,
        opacity: f64,
    },
    Swatch(Tone),
}

fn entries(panel: &Panel) -> Vec<Entry> {
    let mut found: Vec<Entry> = Vec::new();
    for item in &panel.items {
        let entry = match item {
            Item::Line(s) => Entry {
                label: s.label.clone(),
                sample: Sample::Curve {
                    color: s.color,
                    dash: s.dash,
                    marker: s.marker,
                    has_line: s.has_line,
                    has_marks: s.has_marks,
                    width: s.width,
                    opacity: s.opacity,
                },
            },
            Item::Region { label, tone, .. } | Item::Band { label, tone, .. } => Entry {
                label: label.clone(),
                sample: Sample::Swatch(*tone),
            },
            _ => continue,
        };
        if !entry.label.is_empty() && !found.contains(&entry) {
            found.push(entry);
        }
    }
    // Curves before regions.
    found.sort_by_key(|e| matches!(e.sample, Sample::Swatch(_)));
    found
}

fn entry_width(entry: &Entry) -> f64 {
    LEGEND_SAMPLE + 6.0 + text_width(&plain(&entry.label), LEGEND_SIZE)
}

/// Ranges and ticks of a panel, before its place is known.
struct Plan {
    x: Option<(f64, f64)>,
    y: Option<(f64, f64)>,
    x_ticks: Ticks,
    y_ticks: Ticks,
    labels_x: bool,
}

/// Smallest and largest value along an axis over all that asks to be seen.
fn extent(panel: &Panel, axis: usize) -> Option<(f64, f64)> {
    let along = if axis == 0 { &panel.x } else { &panel.y };
    let other = if axis == 0 { &panel.y } else { &panel.x };
    let mut range: Option<(f64, f64)> = None;
    let mut widen = |value: f64| {
        if along.accepts(value) {
            range = Some(range.map_or((value, value), |(a, b)| (a.min(value), b.max(value))));
        }
    };
    let mut has_data = false;
    for item in &panel.items {
        match item {
            Item::Line(Series { points, .. }) | Item::Region { points, .. } => {
                for p in points {
                    if other.accepts(p[1 - axis]) && along.accepts(p[axis]) {
                        has_data = true;
                        widen(p[axis]);
                    }
                }
            }
            Item::HorizontalLine { value, .. } if axis == 1 => widen(*value),
            Item::VerticalLine { value, .. } if axis == 0 => widen(*value),
            _ => {}
        }
    }
    // Reference lines alone are not data.
    if has_data { range } else { None }
}

fn empty_ticks() -> Ticks {
    Ticks {
        major: Vec::new(),
        minor: Vec::new(),
        exponent: 0,
    }
}

/// Widens one of two ranges so that both have the same scale.
fn equalize(x: (f64, f64), y: (f64, f64), size: (f64, f64)) -> ((f64, f64), (f64, f64)) {
    let unit = ((x.1 - x.0) / size.0).max((y.1 - y.0) / size.1);
    let around = |r: (f64, f64), length: f64| {
        let middle = 0.5 * (r.0 + r.1);
        let half = 0.5 * unit * length;
        (middle - half, middle + half)
    };
    (around(x, size.0), around(y, size.1))
}

fn plans(figure: &Figure) -> Vec<Plan> {
    let (width, height) = figure.panel_size;
    let columns = figure.columns;
    let extents: Vec<_> = figure.panels.iter().map(|p| extent(p, 0)).collect();
    figure
        .panels
        .iter()
        .enumerate()
        .map(|(index, panel)| {
            let mut x_extent = extents[index];
            if figure.share_x {
                for other in (index % columns..figure.panels.len()).step_by(columns) {
                    x_extent = match (x_extent, extents[other]) {
                        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
                        (a, b) => a.or(b),
                    };
                }
            }
            let mut x = panel.x.resolve(x_extent);
            let mut y = panel.y.resolve(extent(panel, 1));
            if panel.heatmap.is_none() && extent(panel, 1).is_none() {
                // Fixed ranges without data would look like data that are elsewhere.
                y = None;
            }
            if let (true, Some(xr), Some(yr)) = (panel.equal_aspect, x, y)
                && !panel.x.is_log()
                && !panel.y.is_log()
            {
                let (a, b) = equalize(xr, yr, figure.panel_size);
                (x, y) = (Some(a), Some(b));
            }
            let x_ticks = x.map_or_else(empty_ticks, |(low, high)| {
                // Fewer ticks where their labels are long.
                let mut most = (width / 32.0).clamp(3.0, 12.0) as usize;
                loop {
                    let ticks = panel.x.ticks(low, high, most);
                    let widest = ticks
                        .major
                        .iter()
                        .map(|t| label_width(&t.label))
                        .fold(0.0, f64::max);
                    let fits = (widest + 10.0) * ticks.major.len() as f64 <= width;
                    if fits || most <= 2 {
                        break ticks;
                    }
                    most -= 1;
                }
            });
            let y_ticks = y.map_or_else(empty_ticks, |(low, high)| {
                let most = if panel.heatmap.is_some() {
                    usize::MAX
                } else {
                    (height / 19.0).clamp(3.0, 10.0) as usize
                };
                panel.y.ticks(low, high, most)
            });
            Plan {
                x,
                y,
                x_ticks,
                y_ticks,
                labels_x: !figure.share_x || index + columns >= figure.panels.len(),
            }
        })
        .collect()
}

/// Space around the frame of a panel.
#[derive(Clone, Copy, Default)]
struct Margins {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

/// The label of the y axis, broken where it is longer than the axis.
fn y_caption(panel: &Panel, height: f64) -> Vec<String> {
    wrap(&panel.y.caption(), LABEL_SIZE, height + 8.0)
}

fn margins(panel: &Panel, plan: &Plan, height: f64, legend_right: bool) -> Margins {
    let widest = plan
        .y_ticks
        .major
        .iter()
        .map(|t| label_width(&t.label))
        .fold(12.0, f64::max);
    let mut m = Margins {
        left: TICK_LENGTH + 4.0 + widest + 4.0,
        right: 14.0,
        top: 8.0,
        bottom: 10.0,
    };
    let lines = y_caption(panel, height).len();
    if lines > 0 {
        m.left += 5.0 + lines as f64 * (LABEL_SIZE + 2.0);
    }
    if !panel.title.is_empty() {
        m.top += PANEL_TITLE_SIZE + 5.0;
    }
    if plan.y_ticks.exponent != 0 {
        m.top += TICK_SIZE + 3.0;
    }
    if plan.labels_x {
        m.bottom += TICK_LENGTH + TICK_SIZE + 3.0;
        if !panel.x.caption().is_empty() {
            m.bottom += LABEL_SIZE + 6.0;
        }
    }
    if panel.heatmap.is_some() {
        m.right += 62.0;
    }
    if legend_right {
        let widest = entries(panel).iter().map(entry_width).fold(0.0, f64::max);
        if widest > 0.0 {
            m.right += widest + 10.0;
        }
    }
    m
}

/// The whole figure.
pub(super) fn figure(figure: &Figure) -> String {
    let plans = plans(figure);
    let columns = figure.columns.min(figure.panels.len().max(1));
    let rows = figure.panels.len().div_ceil(columns);
    let (width, height) = figure.panel_size;

    let mut shared: Vec<Entry> = Vec::new();
    for entry in figure.panels.iter().flat_map(entries) {
        if !shared.contains(&entry) {
            shared.push(entry);
        }
    }
    shared.sort_by_key(|e| matches!(e.sample, Sample::Swatch(_)));
    let above = match figure.legend {
        Legend::Above => true,
        Legend::Auto => {
            figure.panels.len() > 1
                && figure
                    .panels
                    .iter()
                    .map(entries)
                    .any(|e| e.len() == shared.len())
        }
        _ => false,
    };
    let inside = match figure.legend {
        Legend::Inside => true,
        Legend::Auto => !above,
        _ => false,
    };
    let right = figure.legend == Legend::Right;

    let all: Vec<Margins> = figure
        .panels
        .iter()
        .zip(&plans)
        .map(|(panel, plan)| margins(panel, plan, height, right))
        .collect();
    let over = |pick: fn(&Margins) -> f64, stride: (usize, usize)| -> f64 {
        all.iter()
            .skip(stride.0)
            .step_by(stride.1.max(1))
            .map(pick)
            .fold(0.0, f64::max)
    };
    let lefts: Vec<f64> = (0..columns)
        .map(|c| over(|m| m.left, (c, columns)))
        .collect();
    let rights: Vec<f64> = (0..columns)
        .map(|c| over(|m| m.right, (c, columns)))
        .collect();
    let in_row = |r: usize| &all[(r * columns).min(all.len())..((r + 1) * columns).min(all.len())];
    let tops: Vec<f64> = (0..rows)
        .map(|r| in_row(r).iter().map(|m| m.top).fold(0.0, f64::max))
        .collect();
    let bottoms: Vec<f64> = (0..rows)
        .map(|r| in_row(r).iter().map(|m| m.bottom).fold(0.0, f64::max))
        .collect();
    let total_width = if figure.panels.is_empty() {
        320.0
    } else {
        2.0 * OUTER_MARGIN
            + lefts.iter().sum::<f64>()
            + rights.iter().sum::<f64>()
            + columns as f64 * width
    };

    let mut body = String::new();
    let mut y = OUTER_MARGIN;
    let room = total_width - 2.0 * OUTER_MARGIN;
    let start = OUTER_MARGIN + lefts.first().copied().unwrap_or(0.0);
    for line in wrap(&figure.title, 1.06 * TITLE_SIZE, room) {
        y += TITLE_SIZE;
        let _ = writeln!(
            body,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{TITLE_SIZE}\" \
             font-weight=\"600\" {}>{}</text>",
            px(0.5 * total_width),
            px(y),
            fill("fg"),
            escape(&line)
        );
        y += 5.0;
    }
    for line in wrap(&figure.subtitle, SUBTITLE_SIZE, room) {
        y += SUBTITLE_SIZE;
        let _ = writeln!(
            body,
            "{}",
            text(
                0.5 * total_width,
                y,
                "middle",
                SUBTITLE_SIZE,
                "muted",
                &line
            )
        );
        y += 4.0;
    }
    if above && !shared.is_empty() {
        y += 4.0;
        y = legend_above(&mut body, &shared, start, y, total_width - OUTER_MARGIN);
    }
    if figure.panels.is_empty() {
        y += 30.0;
        let _ = writeln!(
            body,
            "{}",
            text(
                0.5 * total_width,
                y,
                "middle",
                LABEL_SIZE,
                "muted",
                "no data"
            )
        );
        y += 20.0;
    }

    for row in 0..rows {
        y += tops[row];
        let mut x = OUTER_MARGIN;
        for column in 0..columns {
            x += lefts[column];
            let index = row * columns + column;
            if let (Some(panel), Some(plan)) = (figure.panels.get(index), plans.get(index)) {
                let frame = Frame {
                    x,
                    y,
                    width,
                    height,
                };
                let mut artist = Artist {
                    out: &mut body,
                    panel,
                    plan,
                    frame,
                    left: lefts[column],
                    index,
                };
                artist.draw(inside, right);
            }
            x += width + rights[column];
        }
        y += height + bottoms[row];
    }
    let total_height = y + 2.0;

    let description = if figure.description.is_empty() {
        describe(figure)
    } else {
        figure.description.clone()
    };
    let id = figure
        .id
        .clone()
        .map_or_else(|| format!("f{:016x}", fingerprint(&body)), |s| slug(&s));
    let body = body.replace(ID, &id);
    let style = if figure.adaptive {
        format!("<style>{STYLESHEET}</style>\n")
    } else {
        String::new()
    };
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"cx-plot\" width=\"{w}\" height=\"{h}\" \
         viewBox=\"0 0 {w} {h}\" role=\"img\" aria-labelledby=\"{id}-title {id}-desc\" \
         font-family=\"{FONTS}\">\n<title id=\"{id}-title\">{title}</title>\n\
         <desc id=\"{id}-desc\">{description}</desc>\n{style}\
         <rect width=\"{w}\" height=\"{h}\" {background}/>\n{body}</svg>\n",
        w = px(total_width),
        h = px(total_height),
        title = escape(&figure.title),
        description = escape(&description),
        background = fill("bg"),
    )
}

/// A description made from the panels, for readers who cannot see the figure.
fn describe(figure: &Figure) -> String {
    let panels: Vec<String> = figure
        .panels
        .iter()
        .map(|panel| {
            let names: Vec<String> = panel
                .series()
                .map(|s| plain(&s.label))
                .filter(|l| !l.is_empty())
                .collect();
            let what = plain(&format!(
                "{} against {}",
                panel.y.caption(),
                panel.x.caption()
            ));
            if names.is_empty() {
                what
            } else {
                format!("{what}: {}", names.join(", "))
            }
        })
        .collect();
    format!("{} panels. {}.", figure.panels.len(), panels.join("; "))
}

/// FNV-1a, to tell figures of a page apart without a counter.
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// An XML identifier made from free text.
fn slug(text: &str) -> String {
    let mut out = String::from("f-");
    for c in text.chars() {
        out.push(if c.is_ascii_alphanumeric() || c == '-' {
            c
        } else {
            '-'
        });
    }
    out
}

/// Draws the shared legend in lines from `start`; returns the y below it.
fn legend_above(out: &mut String, shared: &[Entry], start: f64, top: f64, limit: f64) -> f64 {
    let gap = 20.0;
    let mut x = start;
    let mut y = top + LEGEND_LINE - 4.0;
    for entry in shared {
        let width = entry_width(entry);
        if x > start && x + width > limit {
            x = start;
            y += LEGEND_LINE;
        }
        legend_entry(out, entry, x, y);
        x += width + gap;
    }
    y + 6.0
}

fn legend_entry(out: &mut String, entry: &Entry, x: f64, baseline: f64) {
    let middle = baseline - 3.6;
    match &entry.sample {
        Sample::Curve {
            color,
            dash,
            marker,
            has_line,
            has_marks,
            width,
            opacity,
        } => {
            let _ = write!(out, "<g opacity=\"{opacity}\">");
            if *has_line {
                let d = rule([x, middle], [x + LEGEND_SAMPLE, middle]);
                let _ = write!(out, "{}", curve_path(&d, *color, *dash, *width));
            }
            if *has_marks {
                let _ = write!(
                    out,
                    "{}",
                    mark(
                        *marker,
                        *color,
                        [x + 0.5 * LEGEND_SAMPLE, middle],
                        *has_line,
                        ""
                    )
                );
            }
            let _ = write!(out, "</g>");
        }
        Sample::Swatch(tone) => {
            let (class, color) = tone_color(*tone);
            let _ = write!(
                out,
                "<rect x=\"{}\" y=\"{}\" width=\"{LEGEND_SAMPLE}\" height=\"9\" \
                 class=\"cx-f-{class} cx-s-{class}\" fill=\"{color}\" fill-opacity=\"{}\" \
                 stroke=\"{color}\" stroke-opacity=\"0.5\" stroke-width=\"0.8\"/>",
                px(x),
                px(middle - 4.5),
                tone_opacity(*tone)
            );
        }
    }
    let _ = writeln!(
        out,
        "{}",
        text(
            x + LEGEND_SAMPLE + 6.0,
            baseline,
            "start",
            LEGEND_SIZE,
            "fg",
            &entry.label
        )
    );
}

fn curve_path(d: &str, color: usize, dash: usize, width: f64) -> String {
    let pattern = match DASHES[dash % STYLE_COUNT] {
        "" => String::new(),
        dashes => format!(" stroke-dasharray=\"{dashes}\""),
    };
    let cap = if dash.is_multiple_of(STYLE_COUNT) {
        " stroke-linecap=\"round\""
    } else {
        ""
    };
    format!(
        "<path d=\"{d}\" class=\"cx-s-{color}\" fill=\"none\" stroke=\"{}\" \
         stroke-width=\"{width}\" stroke-linejoin=\"round\"{cap}{pattern}/>",
        LIGHT_PALETTE[color % STYLE_COUNT]
    )
}

/// A mark with an optional hover text. Even markers are filled, odd ones open;
/// open ones cover the line they are on, but not other marks.
fn mark(marker: usize, color: usize, [x, y]: [f64; 2], on_line: bool, hover: &str) -> String {
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
    let title = if hover.is_empty() {
        String::new()
    } else {
        format!("<title>{}</title>", escape(hover))
    };
    format!(
        "<path d=\"{d}\" class=\"{class} cx-s-{color}\" fill=\"{inside}\" stroke=\"{ink}\" \
         stroke-width=\"1.2\">{title}</path>"
    )
}

/// Draws one panel.
struct Artist<'a> {
    out: &'a mut String,
    panel: &'a Panel,
    plan: &'a Plan,
    frame: Frame,
    /// Space of the column to the left of its frames.
    left: f64,
    index: usize,
}

impl Artist<'_> {
    fn put(&mut self, element: &str) {
        self.out.push_str(element);
        self.out.push('\n');
    }

    fn draw(&mut self, legend_inside: bool, legend_right: bool) {
        let frame = self.frame;
        let clip = format!("{ID}-clip{}", self.index);
        let (Some(x), Some(y)) = (self.plan.x, self.plan.y) else {
            self.put("<g>");
            self.titles();
            self.border();
            let note = text(
                frame.x + 0.5 * frame.width,
                frame.y + 0.5 * frame.height + 4.0,
                "middle",
                LABEL_SIZE,
                "muted",
                "no data",
            );
            self.put(&note);
            self.notes();
            self.put("</g>");
            return;
        };
        let to_x = Map {
            low: x.0,
            high: x.1,
            log: self.panel.x.is_log(),
            start: frame.x,
            end: frame.right(),
        };
        let (start, end) = if self.panel.heatmap.is_some() {
            (frame.y, frame.bottom())
        } else {
            (frame.bottom(), frame.y)
        };
        let to_y = Map {
            low: y.0,
            high: y.1,
            log: self.panel.y.is_log(),
            start,
            end,
        };
        let kind = |log: bool| if log { "log" } else { "linear" };
        let head = if self.panel.heatmap.is_some() {
            "<g>".to_string()
        } else {
            // What a script needs to turn a place in the frame into values.
            format!(
                "<g data-frame=\"{} {} {} {}\" data-x=\"{:e} {:e} {}\" data-y=\"{:e} {:e} {}\" \
                 data-x-unit=\"{}\" data-y-unit=\"{}\">",
                px(frame.x),
                px(frame.y),
                px(frame.width),
                px(frame.height),
                x.0,
                x.1,
                kind(to_x.log),
                y.0,
                y.1,
                kind(to_y.log),
                escape(&self.panel.x.unit),
                escape(&self.panel.y.unit),
            )
        };
        self.put(&head);
        self.put(&format!(
            "<clipPath id=\"{clip}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>",
            px(frame.x),
            px(frame.y),
            px(frame.width),
            px(frame.height)
        ));
        if let Some(map) = self.panel.heatmap.as_ref() {
            self.cells(map, &to_x, &to_y);
        } else {
            self.put(&format!("<g clip-path=\"url(#{clip})\">"));
            self.regions(&to_x, &to_y);
            self.grid(&to_x, &to_y);
            self.reference_lines(&to_x, &to_y);
            self.curves(&to_x, &to_y);
            self.put("</g>");
        }
        self.border();
        self.ticks(&to_x, &to_y);
        self.titles();
        if self.panel.heatmap.is_none() {
            self.marks(&to_x, &to_y);
            self.writing(&to_x, &to_y);
        }
        self.notes();
        if legend_inside {
            self.legend_in_corner(&to_x, &to_y);
        } else if legend_right {
            let (x, mut y) = (frame.right() + 12.0, frame.y + 11.0);
            for entry in entries(self.panel) {
                legend_entry(self.out, &entry, x, y);
                y += LEGEND_LINE;
            }
        }
        self.put("</g>");
    }

    fn regions(&mut self, to_x: &Map, to_y: &Map) {
        let wide = self.frame.grown(CLIP_MARGIN);
        for item in &self.panel.items {
            match item {
                Item::Band { tone, x, y, label } => {
                    let side = |map: &Map, value: f64| {
                        if value == f64::NEG_INFINITY || (map.log && value <= 0.0) {
                            map.start
                        } else if value == f64::INFINITY {
                            map.end
                        } else {
                            let (a, b) = (map.start.min(map.end), map.start.max(map.end));
                            map.pixel(value).clamp(a - CLIP_MARGIN, b + CLIP_MARGIN)
                        }
                    };
                    let (x0, x1) = (side(to_x, x.0), side(to_x, x.1));
                    let (y0, y1) = (side(to_y, y.0), side(to_y, y.1));
                    let (class, color) = tone_color(*tone);
                    self.put(&format!(
                        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"cx-f-{class}\" \
                         fill=\"{color}\" fill-opacity=\"{}\"><title>{}</title></rect>",
                        px(x0.min(x1)),
                        px(y0.min(y1)),
                        px((x1 - x0).abs()),
                        px((y1 - y0).abs()),
                        tone_opacity(*tone),
                        escape(label)
                    ));
                }
                Item::Region {
                    tone,
                    points,
                    outlined,
                    label,
                    ..
                } => {
                    let pixels: Vec<[f64; 2]> = points
                        .iter()
                        .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                        .collect();
                    let d = polygon(&wide, &pixels);
                    if d.is_empty() {
                        continue;
                    }
                    let (class, color) = tone_color(*tone);
                    let outline = if *outlined {
                        format!("stroke=\"{color}\" stroke-opacity=\"0.6\" stroke-width=\"0.9\"")
                    } else {
                        "stroke=\"none\"".to_string()
                    };
                    let stroke_class = if *outlined {
                        format!(" cx-s-{class}")
                    } else {
                        String::new()
                    };
                    self.put(&format!(
                        "<path d=\"{d}\" class=\"cx-f-{class}{stroke_class}\" fill=\"{color}\" \
                         fill-opacity=\"{}\" {outline}><title>{}</title></path>",
                        tone_opacity(*tone),
                        escape(label)
                    ));
                }
                _ => {}
            }
        }
    }

    fn grid(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let vertical = |v: f64| {
            let x = to_x.pixel(v);
            rule([x, frame.y], [x, frame.bottom()])
        };
        let horizontal = |v: f64| {
            let y = to_y.pixel(v);
            rule([frame.x, y], [frame.right(), y])
        };
        let plan = self.plan;
        let mut minor = String::new();
        minor.extend(plan.x_ticks.minor.iter().map(|&v| vertical(v)));
        minor.extend(plan.y_ticks.minor.iter().map(|&v| horizontal(v)));
        let mut major = String::new();
        major.extend(plan.x_ticks.major.iter().map(|t| vertical(t.value)));
        major.extend(plan.y_ticks.major.iter().map(|t| horizontal(t.value)));
        for (d, name) in [(minor, "minor"), (major, "grid")] {
            if !d.is_empty() {
                self.put(&format!(
                    "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.8\" {}/>",
                    stroke(name)
                ));
            }
        }
    }

    fn reference_lines(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let wide = frame.grown(CLIP_MARGIN);
        for item in &self.panel.items {
            let d = match item {
                Item::HorizontalLine { value, .. } if self.panel.y.accepts(*value) => {
                    let y = to_y.pixel(*value);
                    polyline(&wide, &[[frame.x, y], [frame.right(), y]])
                }
                Item::VerticalLine { value, .. } if self.panel.x.accepts(*value) => {
                    let x = to_x.pixel(*value);
                    polyline(&wide, &[[x, frame.y], [x, frame.bottom()]])
                }
                Item::Guide { points, .. } => {
                    let pixels: Vec<[f64; 2]> = points
                        .iter()
                        .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                        .collect();
                    let d = polyline(&wide, &pixels);
                    self.put(&format!(
                        "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.7\" \
                         stroke-opacity=\"0.55\" {}/>",
                        stroke("muted")
                    ));
                    continue;
                }
                _ => continue,
            };
            self.put(&format!(
                "<path d=\"{d}\" fill=\"none\" stroke-width=\"1\" stroke-dasharray=\"5 3\" {}/>",
                stroke("muted")
            ));
        }
    }

    fn curves(&mut self, to_x: &Map, to_y: &Map) {
        let wide = self.frame.grown(CLIP_MARGIN);
        let panel = self.panel;
        for series in panel.series().filter(|s| s.has_line) {
            let pixels: Vec<[f64; 2]> = series
                .points
                .iter()
                .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                .collect();
            let d = polyline(&wide, &thinned(pixels));
            if d.is_empty() {
                continue;
            }
            let path = curve_path(&d, series.color, series.dash, series.width);
            self.put(&format!(
                "<g opacity=\"{}\"><title>{}</title>{path}</g>",
                series.opacity,
                escape(&self.summary(series))
            ));
        }
    }

    /// What a series holds, for hovering readers.
    fn summary(&self, series: &Series) -> String {
        let shown: Vec<f64> = series
            .points
            .iter()
            .filter(|p| p[0].is_finite() && p[1].is_finite())
            .map(|p| p[1])
            .collect();
        let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
        let high = shown.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let gaps = series.points.len() - shown.len();
        let mut out = format!(
            "{}: {} points, {} to {} {}",
            plain(&series.label),
            shown.len(),
            readable(low),
            readable(high),
            self.panel.y.unit
        );
        if gaps > 0 {
            let _ = write!(out, ", {gaps} missing");
        }
        out.trim_start_matches(": ").trim_end().to_string()
    }

    fn marks(&mut self, to_x: &Map, to_y: &Map) {
        let panel = self.panel;
        let reach = self.frame.grown(0.01);
        for series in panel.series().filter(|s| s.has_marks) {
            let few = series.points.len() <= MOST_MARKS;
            let mut group = format!("<g opacity=\"{}\">", series.opacity);
            for p in &series.points {
                let pixel = [to_x.pixel(p[0]), to_y.pixel(p[1])];
                if !reach.contains(pixel) {
                    continue;
                }
                let hover = if few {
                    format!(
                        "{}: {} {}, {} {}",
                        plain(&series.label),
                        readable(p[0]),
                        panel.x.unit,
                        readable(p[1]),
                        panel.y.unit
                    )
                } else {
                    String::new()
                };
                group.push_str(&mark(
                    series.marker,
                    series.color,
                    pixel,
                    series.has_line,
                    hover.trim_start_matches(": ").trim_end(),
                ));
            }
            group.push_str("</g>");
            self.put(&group);
        }
    }

    /// Labels of reference lines and guides, and free text.
    fn writing(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let mut verticals = 0;
        let mut placed: Vec<Frame> = Vec::new();
        let panel = self.panel;
        for item in &panel.items {
            match item {
                Item::HorizontalLine { value, label }
                    if !label.is_empty() && panel.y.accepts(*value) =>
                {
                    let y = to_y.pixel(*value);
                    if y < frame.y - 0.5 || y > frame.bottom() + 0.5 {
                        continue;
                    }
                    let above = y - frame.y > NOTE_SIZE + 4.0;
                    let baseline = if above { y - 3.5 } else { y + NOTE_SIZE + 2.0 };
                    let note = halo_text(
                        frame.right() - 5.0,
                        baseline,
                        "end",
                        NOTE_SIZE,
                        "muted",
                        label,
                    );
                    self.put(&note);
                }
                Item::VerticalLine { value, label }
                    if !label.is_empty() && panel.x.accepts(*value) =>
                {
                    let x = to_x.pixel(*value);
                    if x < frame.x - 0.5 || x > frame.right() + 0.5 {
                        continue;
                    }
                    let width = text_width(label, NOTE_SIZE);
                    let fits = x + 5.0 + width < frame.right();
                    let (at, anchor) = if fits {
                        (x + 4.0, "start")
                    } else {
                        (x - 4.0, "end")
                    };
                    let baseline = frame.y + 12.0 + f64::from(verticals) * (NOTE_SIZE + 3.0);
                    verticals += 1;
                    let note = halo_text(at, baseline, anchor, NOTE_SIZE, "muted", label);
                    self.put(&note);
                }
                Item::Guide { points, label } if !label.is_empty() => {
                    let pixels: Vec<[f64; 2]> = points
                        .iter()
                        .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                        .collect();
                    if let Some((note, place)) = guide_label(&frame, &pixels, label) {
                        // Crowded guides are named as far as there is room.
                        if !placed.iter().any(|p| p.overlaps(&place)) {
                            self.put(&note);
                            placed.push(place);
                        }
                    }
                }
                Item::Text {
                    at,
                    text: note,
                    anchor,
                } => {
                    let pixel = [to_x.pixel(at[0]), to_y.pixel(at[1])];
                    if !frame.contains(pixel) {
                        continue;
                    }
                    let [x, y] = pixel;
                    let (x, y, side) = match anchor {
                        Anchor::Right => (x + 6.0, y + 3.4, "start"),
                        Anchor::Left => (x - 6.0, y + 3.4, "end"),
                        Anchor::Above => (x, y - 8.0, "middle"),
                        Anchor::Below => (x, y + NOTE_SIZE + 6.0, "middle"),
                    };
                    let note = halo_text(x, y, side, NOTE_SIZE, "fg", note);
                    self.put(&note);
                }
                _ => {}
            }
        }
    }

    fn border(&mut self) {
        let f = self.frame;
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" \
             stroke-width=\"0.9\" {}/>",
            px(f.x),
            px(f.y),
            px(f.width),
            px(f.height),
            stroke("frame")
        ));
    }

    fn ticks(&mut self, to_x: &Map, to_y: &Map) {
        let f = self.frame;
        let plan = self.plan;
        let mut d = String::new();
        for (list, length) in [
            (
                plan.x_ticks
                    .major
                    .iter()
                    .map(|t| t.value)
                    .collect::<Vec<_>>(),
                TICK_LENGTH,
            ),
            (plan.x_ticks.minor.clone(), 0.5 * TICK_LENGTH),
        ] {
            for value in list {
                let x = to_x.pixel(value);
                d.push_str(&rule([x, f.bottom()], [x, f.bottom() + length]));
            }
        }
        for (list, length) in [
            (
                plan.y_ticks
                    .major
                    .iter()
                    .map(|t| t.value)
                    .collect::<Vec<_>>(),
                TICK_LENGTH,
            ),
            (plan.y_ticks.minor.clone(), 0.5 * TICK_LENGTH),
        ] {
            for value in list {
                let y = to_y.pixel(value);
                d.push_str(&rule([f.x - length, y], [f.x, y]));
            }
        }
        if !d.is_empty() {
            self.put(&format!(
                "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.9\" {}/>",
                stroke("frame")
            ));
        }
        let mut labels = String::new();
        if plan.labels_x {
            let baseline = f.bottom() + TICK_LENGTH + TICK_SIZE + 1.0;
            for Tick { value, label } in &plan.x_ticks.major {
                labels.push_str(&tick_text(to_x.pixel(*value), baseline, "middle", label));
            }
            if plan.x_ticks.exponent != 0 {
                labels.push_str(&text(
                    f.right(),
                    baseline + LABEL_SIZE + 5.0,
                    "end",
                    TICK_SIZE,
                    "fg",
                    &factor_text(plan.x_ticks.exponent),
                ));
            }
        }
        for Tick { value, label } in &plan.y_ticks.major {
            labels.push_str(&tick_text(
                f.x - TICK_LENGTH - 3.0,
                to_y.pixel(*value) + 3.5,
                "end",
                label,
            ));
        }
        if plan.y_ticks.exponent != 0 {
            labels.push_str(&text(
                f.x,
                f.y - 5.0,
                "start",
                TICK_SIZE,
                "fg",
                &factor_text(plan.y_ticks.exponent),
            ));
        }
        if !labels.is_empty() {
            self.put(&labels);
        }
    }

    fn titles(&mut self) {
        let f = self.frame;
        let panel = self.panel;
        if !panel.title.is_empty() {
            let lift = if self.plan.y_ticks.exponent != 0 {
                TICK_SIZE + 8.0
            } else {
                6.0
            };
            self.put(&format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{PANEL_TITLE_SIZE}\" \
                 font-weight=\"600\" {}>{}</text>",
                px(f.x + 0.5 * f.width),
                px(f.y - lift),
                fill("fg"),
                rich(&panel.title, PANEL_TITLE_SIZE)
            ));
        }
        let caption = panel.x.caption();
        if self.plan.labels_x && !caption.is_empty() {
            let y = f.bottom() + TICK_LENGTH + TICK_SIZE + LABEL_SIZE + 6.0;
            self.put(&text(
                f.x + 0.5 * f.width,
                y,
                "middle",
                LABEL_SIZE,
                "fg",
                &caption,
            ));
        }
        // At the edge of the column, so that the labels of a column line up.
        let x = f.x - self.left + LABEL_SIZE;
        let y = f.y + 0.5 * f.height;
        for (line, words) in y_caption(panel, f.height).iter().enumerate() {
            self.put(&format!(
                "<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\" \
                 font-size=\"{LABEL_SIZE}\" {}>{}</text>",
                px(x + line as f64 * (LABEL_SIZE + 2.0)),
                px(y),
                fill("fg"),
                rich(words, LABEL_SIZE)
            ));
        }
    }

    /// Says in the panel what it does not show.
    fn notes(&mut self) {
        let f = self.frame;
        let notes: Vec<String> = self
            .panel
            .notes()
            .iter()
            .flat_map(|note| wrap(&plain(note), NOTE_SIZE, f.width - 12.0))
            .collect();
        for (i, note) in notes.iter().rev().enumerate() {
            let y = f.bottom() - 6.0 - i as f64 * (NOTE_SIZE + 3.0);
            if y < f.y + NOTE_SIZE {
                break;
            }
            let note = halo_text(f.x + 6.0, y, "start", NOTE_SIZE, "forbidden", note);
            self.put(&note);
        }
    }

    fn legend_in_corner(&mut self, to_x: &Map, to_y: &Map) {
        let list = entries(self.panel);
        if list.is_empty() {
            return;
        }
        let f = self.frame;
        let width = list.iter().map(entry_width).fold(0.0, f64::max) + 12.0;
        let height = list.len() as f64 * LEGEND_LINE + 6.0;
        let gap = 6.0;
        let samples = self.samples(to_x, to_y);
        let lefts = [
            f.right() - width - gap,
            f.x + gap,
            f.x + 0.5 * (f.width - width),
        ];
        let tops = [f.y + gap, f.bottom() - height - gap];
        let mut best: Option<(usize, Frame)> = None;
        for left in lefts {
            for top in tops {
                let place = Frame {
                    x: left,
                    y: top,
                    width,
                    height,
                };
                let near = place.grown(3.0);
                let covered = samples.iter().filter(|p| near.contains(**p)).count();
                if best.as_ref().is_none_or(|(least, _)| covered < *least) {
                    best = Some((covered, place));
                }
            }
        }
        let Some((_, place)) = best else { return };
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"2\" \
             class=\"cx-f-bg cx-s-grid\" fill=\"{}\" fill-opacity=\"0.88\" stroke=\"{}\" \
             stroke-width=\"0.8\"/>",
            px(place.x),
            px(place.y),
            px(width),
            px(height),
            role("bg"),
            role("grid")
        ));
        for (i, entry) in list.iter().enumerate() {
            let baseline = place.y + 14.0 + i as f64 * LEGEND_LINE;
            legend_entry(self.out, entry, place.x + 6.0, baseline);
        }
    }

    /// Pixels covered by curves, marks and text, to keep the legend off them.
    fn samples(&self, to_x: &Map, to_y: &Map) -> Vec<[f64; 2]> {
        const SPACING: f64 = 4.0;
        let mut found = Vec::new();
        for item in &self.panel.items {
            match item {
                Item::Line(series) => {
                    let pixels: Vec<[f64; 2]> = series
                        .points
                        .iter()
                        .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                        .collect();
                    if series.has_marks {
                        // A mark weighs as much as the ink of its outline.
                        found.extend(pixels.iter().flat_map(|p| [*p; 4]));
                    }
                    if series.has_line {
                        for pair in pixels.windows(2) {
                            let finite = pair.iter().flatten().all(|v| v.is_finite());
                            if let (true, Some([a, b])) =
                                (finite, clip_segment(&self.frame, pair[0], pair[1]))
                            {
                                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                                let count = (length / SPACING).ceil().max(1.0);
                                found.extend((0..count as usize).map(|i| {
                                    let t = i as f64 / count;
                                    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
                                }));
                            }
                        }
                    }
                }
                Item::Text { at, text, .. } => {
                    let (x, y) = (to_x.pixel(at[0]), to_y.pixel(at[1]));
                    let half = 0.5 * text_width(text, NOTE_SIZE);
                    found.extend([[x - half, y], [x, y], [x + half, y]]);
                }
                Item::HorizontalLine { value, label } if !label.is_empty() => {
                    let y = to_y.pixel(*value) - 6.0;
                    let reach = text_width(label, NOTE_SIZE);
                    found.extend(
                        (0..=8).map(|i| [self.frame.right() - reach * f64::from(i) / 8.0, y]),
                    );
                }
                Item::VerticalLine { value, label } if !label.is_empty() => {
                    let x = to_x.pixel(*value);
                    let reach = text_width(label, NOTE_SIZE);
                    found.extend(
                        (0..=8).map(|i| [x + reach * f64::from(i) / 8.0, self.frame.y + 10.0]),
                    );
                }
                _ => {}
            }
        }
        found
    }

    fn cells(&mut self, map: &Heatmap, to_x: &Map, to_y: &Map) {
        let finite: Vec<f64> = map
            .values
            .iter()
            .flatten()
            .copied()
            .filter(|v| v.is_finite())
            .collect();
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
        let name = |names: &super::Scale, i: usize| match names {
            super::Scale::Category(names) => names.get(i).cloned().unwrap_or_default(),
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
                let size = TICK_SIZE
                    .min(0.55 * (y1 - y0))
                    .min(0.9 * (x1 - x0) / text_width(&number, 1.0));
                let emphasis = if below {
                    " font-weight=\"700\" text-decoration=\"underline\""
                } else {
                    ""
                };
                let hover = format!(
                    "{}, {}{} {}: {number} {}",
                    name(&self.panel.y.scale, row),
                    self.panel.x.label,
                    if self.panel.x.label.is_empty() {
                        ""
                    } else {
                        " "
                    }
                    .to_string()
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
        let bar = Map {
            low,
            high,
            log: false,
            start: f.bottom(),
            end: f.y,
        };
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
        let ticks = super::Axis::linear("", "").ticks(low, high, most);
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

/// The label of a guide, just inside where it leaves the frame.
fn guide_label(frame: &Frame, pixels: &[[f64; 2]], label: &str) -> Option<(String, Frame)> {
    let last = pixels
        .windows(2)
        .filter(|pair| pair.iter().flatten().all(|v| v.is_finite()))
        .filter_map(|pair| clip_segment(frame, pair[0], pair[1]))
        .next_back()?[1];
    let [x, y] = last;
    let near = 12.0;
    let (anchor, x) = if frame.right() - x < near + 0.5 * text_width(label, NOTE_SIZE) {
        ("end", x - 3.0)
    } else if x - frame.x < near + 0.5 * text_width(label, NOTE_SIZE) {
        ("start", x + 3.0)
    } else {
        ("middle", x)
    };
    let y = if y - frame.y < near {
        y + NOTE_SIZE + 1.0
    } else if frame.bottom() - y < near {
        y - 3.0
    } else {
        y - 2.0
    };
    let width = text_width(label, NOTE_SIZE);
    let left = match anchor {
        "start" => x,
        "end" => x - width,
        _ => x - 0.5 * width,
    };
    let place = Frame {
        x: left,
        y: y - NOTE_SIZE,
        width,
        height: NOTE_SIZE,
    };
    let note = halo_text(x, y, anchor, NOTE_SIZE - 0.5, "muted", label);
    Some((note, place))
}
