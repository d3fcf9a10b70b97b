//! Block diagrams: blocks, sums, wires and their names, written as SVG.
//!
//! Places are pixels of the diagram, x to the right and y down. The look is
//! that of the figures, dark pages included.
//!
//! ```
//! use coaxdesign::report::plot::diagram::{Anchor, Diagram};
//!
//! let svg = Diagram::new("A loop", 300.0, 80.0)
//!     .sum([40.0, 40.0], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
//!     .wire(&[[50.0, 40.0], [90.0, 40.0]], "e")
//!     .block([140.0, 40.0], [100.0, 36.0], &["controller"])
//!     .to_svg("loop");
//! assert!(svg.starts_with("<svg"));
//! ```

use std::fmt::Write as _;

pub use super::Anchor;
use super::draw::ink::{FONTS, fill, halo_text, plain, rich, rule, stroke, text};
use super::svg::{coordinate as px, escape};

const TITLE_SIZE: f64 = 11.0;
const BLOCK_SIZE: f64 = 11.0;
const WIRE_SIZE: f64 = 10.5;
const SUM_RADIUS: f64 = 9.0;
const LINE: f64 = 14.0;
/// Length and half width of an arrow head.
const HEAD: [f64; 2] = [7.0, 3.2];

/// A block diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagram {
    title: String,
    description: String,
    size: [f64; 2],
    items: Vec<Item>,
}

#[derive(Debug, Clone, PartialEq)]
enum Item {
    Region { corner: [f64; 2], size: [f64; 2], label: String },
    Block { center: [f64; 2], size: [f64; 2], lines: Vec<String>, strong: bool },
    Sum { center: [f64; 2], signs: Vec<(Anchor, String)> },
    Wire { points: Vec<[f64; 2]>, arrow: bool, label: String },
    Dot([f64; 2]),
    Text { at: [f64; 2], anchor: Anchor, text: String },
}

impl Diagram {
    /// An empty diagram of a size, px.
    #[must_use]
    pub fn new(title: &str, width: f64, height: f64) -> Self {
        Self {
            title: title.to_string(),
            description: String::new(),
            size: [width, height],
            items: Vec::new(),
        }
    }

    /// What the diagram shows, for readers who cannot see it.
    #[must_use]
    pub fn description(mut self, description: &str) -> Self {
        self.description = description.to_string();
        self
    }

    fn with(mut self, item: Item) -> Self {
        self.items.push(item);
        self
    }

    /// A dashed region around what belongs together.
    #[must_use]
    pub fn region(self, corner: [f64; 2], size: [f64; 2], label: &str) -> Self {
        self.with(Item::Region { corner, size, label: label.to_string() })
    }

    /// A block about its centre with lines of text.
    #[must_use]
    pub fn block(self, center: [f64; 2], size: [f64; 2], lines: &[&str]) -> Self {
        let lines = lines.iter().map(|l| (*l).to_string()).collect();
        self.with(Item::Block { center, size, lines, strong: false })
    }

    /// A block that stands out.
    #[must_use]
    pub fn strong_block(self, center: [f64; 2], size: [f64; 2], lines: &[&str]) -> Self {
        let lines = lines.iter().map(|l| (*l).to_string()).collect();
        self.with(Item::Block { center, size, lines, strong: true })
    }

    /// A sum with a sign beside each input.
    #[must_use]
    pub fn sum(self, center: [f64; 2], signs: &[(Anchor, &str)]) -> Self {
        let signs = signs.iter().map(|(side, sign)| (*side, (*sign).to_string())).collect();
        self.with(Item::Sum { center, signs })
    }

    /// A wire with an arrow head at its end, named above its first stretch.
    #[must_use]
    pub fn wire(self, points: &[[f64; 2]], label: &str) -> Self {
        self.with(Item::Wire { points: points.to_vec(), arrow: true, label: label.to_string() })
    }

    /// A wire without an arrow head.
    #[must_use]
    pub fn line(self, points: &[[f64; 2]], label: &str) -> Self {
        self.with(Item::Wire { points: points.to_vec(), arrow: false, label: label.to_string() })
    }

    /// A place where a wire branches.
    #[must_use]
    pub fn dot(self, at: [f64; 2]) -> Self {
        self.with(Item::Dot(at))
    }

    /// Free text.
    #[must_use]
    pub fn text(self, at: [f64; 2], anchor: Anchor, text: &str) -> Self {
        self.with(Item::Text { at, anchor, text: text.to_string() })
    }

    /// The title.
    #[must_use]
    pub fn title_text(&self) -> &str {
        &self.title
    }

    /// The radius of a sum, px: wires end there.
    #[must_use]
    pub fn sum_radius() -> f64 {
        SUM_RADIUS
    }

    /// The diagram as one `<svg>` element with identifiers that begin with `id`.
    #[must_use]
    pub fn to_svg(&self, id: &str) -> String {
        let mut out = String::new();
        // Wires below blocks, names above both.
        for item in &self.items {
            if let Item::Region { corner: [x, y], size: [w, h], label } = item {
                let _ = writeln!(
                    out,
                    "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"6\" fill=\"none\" \
                     stroke-width=\"1\" stroke-dasharray=\"5 3\" {}/>\n{}",
                    px(*x),
                    px(*y),
                    px(*w),
                    px(*h),
                    stroke("muted"),
                    text(x + 8.0, y + 14.0, "start", TITLE_SIZE, "muted", label)
                );
            }
        }
        for item in &self.items {
            if let Item::Wire { points, arrow, .. } = item {
                write_wire(&mut out, points, *arrow);
            }
        }
        for item in &self.items {
            match item {
                Item::Block { center, size, lines, strong } => {
                    write_block(&mut out, *center, *size, lines, *strong);
                }
                Item::Sum { center, signs } => write_sum(&mut out, *center, signs),
                Item::Dot([x, y]) => {
                    let _ = writeln!(
                        out,
                        "<circle cx=\"{}\" cy=\"{}\" r=\"2.6\" {}/>",
                        px(*x),
                        px(*y),
                        fill("fg")
                    );
                }
                _ => {}
            }
        }
        for item in &self.items {
            match item {
                Item::Wire { points, label, .. } if !label.is_empty() => {
                    let _ = writeln!(out, "{}", wire_name(points, label));
                }
                Item::Text { at, anchor, text } => {
                    let _ = writeln!(out, "{}", beside(*at, *anchor, text));
                }
                _ => {}
            }
        }
        let [width, height] = self.size;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"cx-plot\" width=\"{w}\" \
             height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             aria-labelledby=\"{id}-title {id}-desc\" font-family=\"{FONTS}\">\n\
             <title id=\"{id}-title\">{title}</title>\n<desc id=\"{id}-desc\">{description}</desc>\n\
             <rect width=\"{w}\" height=\"{h}\" {background}/>\n{out}</svg>\n",
            w = px(width),
            h = px(height),
            id = escape(id),
            title = escape(&plain(&self.title)),
            description = escape(&self.spoken()),
            background = fill("bg"),
        )
    }

    /// The description, or the blocks by name.
    fn spoken(&self) -> String {
        if !self.description.is_empty() {
            return self.description.clone();
        }
        let blocks: Vec<String> = self
            .items
            .iter()
            .filter_map(|item| match item {
                Item::Block { lines, .. } => Some(plain(&lines.join(" "))),
                _ => None,
            })
            .collect();
        format!("Blocks: {}.", blocks.join(", "))
    }
}

fn write_wire(out: &mut String, points: &[[f64; 2]], arrow: bool) {
    let d: String = points.windows(2).map(|pair| rule(pair[0], pair[1])).collect();
    let _ = writeln!(
        out,
        "<path d=\"{d}\" fill=\"none\" stroke-width=\"1.1\" stroke-linecap=\"round\" {}/>",
        stroke("fg")
    );
    let [.., from, to] = points else { return };
    if arrow {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy).max(1e-9);
        let (ux, uy) = (dx / length, dy / length);
        let [long, half] = HEAD;
        let corner = |side: f64| {
            [to[0] - long * ux - side * half * uy, to[1] - long * uy + side * half * ux]
        };
        let (a, b) = (corner(1.0), corner(-1.0));
        let _ = writeln!(
            out,
            "<path d=\"M{} {}L{} {}L{} {}Z\" {}/>",
            px(to[0]),
            px(to[1]),
            px(a[0]),
            px(a[1]),
            px(b[0]),
            px(b[1]),
            fill("fg")
        );
    }
}

/// The name of a wire, above the middle of its first stretch or beside it.
fn wire_name(points: &[[f64; 2]], label: &str) -> String {
    let (Some(a), Some(b)) = (points.first(), points.get(1)) else { return String::new() };
    let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    let level = (a[1] - b[1]).abs() < (a[0] - b[0]).abs();
    beside(middle, if level { Anchor::Above } else { Anchor::Right }, label)
}

fn beside([x, y]: [f64; 2], anchor: Anchor, label: &str) -> String {
    let (x, y, side) = match anchor {
        Anchor::Above => (x, y - 5.0, "middle"),
        Anchor::Below => (x, y + 13.0, "middle"),
        Anchor::Left => (x - 5.0, y + 3.5, "end"),
        Anchor::Right => (x + 5.0, y + 3.5, "start"),
    };
    halo_text(x, y, side, WIRE_SIZE, "fg", label)
}

fn write_block(out: &mut String, [x, y]: [f64; 2], size: [f64; 2], lines: &[String], strong: bool) {
    let (class, width) = if strong { ("0", 1.8) } else { ("frame", 1.1) };
    let edge = if strong {
        "class=\"cx-f-bg cx-s-0\" stroke=\"#0072b2\"".to_string()
    } else {
        format!("class=\"cx-f-bg cx-s-{class}\" stroke=\"#3b4249\"")
    };
    let _ = writeln!(
        out,
        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"3\" fill=\"#ffffff\" \
         stroke-width=\"{width}\" {edge}/>",
        px(x - 0.5 * size[0]),
        px(y - 0.5 * size[1]),
        px(size[0]),
        px(size[1]),
    );
    let top = y - 0.5 * LINE * (lines.len() as f64 - 1.0) + 4.0;
    for (k, line) in lines.iter().enumerate() {
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{BLOCK_SIZE}\" {}>{}</text>",
            px(x),
            px(top + LINE * k as f64),
            fill("fg"),
            rich(line, BLOCK_SIZE)
        );
    }
}

fn write_sum(out: &mut String, [x, y]: [f64; 2], signs: &[(Anchor, String)]) {
    let _ = writeln!(
        out,
        "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"#ffffff\" stroke-width=\"1.1\" \
         class=\"cx-f-bg cx-s-frame\" stroke=\"#3b4249\"/>",
        px(x),
        px(y),
        px(SUM_RADIUS)
    );
    for (side, sign) in signs {
        // Beside the arrow that comes in from that side.
        let (dx, dy) = match side {
            Anchor::Left => (-16.0, -6.0),
            Anchor::Right => (16.0, -6.0),
            Anchor::Above => (9.0, -13.0),
            Anchor::Below => (9.0, 20.0),
        };
        let _ = writeln!(out, "{}", text(x + dx, y + dy, "middle", WIRE_SIZE, "fg", sign));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quick_xml::events::Event;

    fn sample() -> Diagram {
        Diagram::new("A <loop>", 300.0, 80.0)
            .region([5.0, 5.0], [200.0, 70.0], "in & out")
            .sum([40.0, 40.0], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
            .wire(&[[49.0, 40.0], [90.0, 40.0]], "e_{θ}")
            .strong_block([140.0, 40.0], [100.0, 36.0], &["controller", "K_{P}"])
            .line(&[[190.0, 40.0], [260.0, 40.0]], "")
            .dot([220.0, 40.0])
            .wire(&[[220.0, 40.0], [220.0, 70.0], [40.0, 70.0], [40.0, 49.0]], "")
    }

    #[test]
    fn the_output_is_well_formed_and_repeatable() {
        let svg = sample().to_svg("loop");
        let mut reader = quick_xml::Reader::from_str(&svg);
        let mut depth = 0;
        loop {
            match reader.read_event().expect("well-formed") {
                Event::Start(_) => depth += 1,
                Event::End(_) => depth -= 1,
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(depth, 0);
        assert_eq!(svg, sample().to_svg("loop"));
        // The blocks can be heard as well as seen.
        assert!(svg.contains("Blocks: controller KP."));
        assert!(svg.contains("A &lt;loop&gt;"));
    }

    #[test]
    fn an_arrow_ends_at_the_end_of_its_wire() {
        let mut out = String::new();
        write_wire(&mut out, &[[0.0, 0.0], [30.0, 0.0], [30.0, 40.0]], true);
        // Downwards: the head's base is seven pixels above its tip.
        assert!(out.contains("M30.00 40.00L26.80 33.00L33.20 33.00Z"), "{out}");
    }
}
