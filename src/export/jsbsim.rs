//! The whole law as a JSBSim system.
//!
//! One `fcs_function` a block, in the order of the diagram: JSBSim runs them
//! one after the other once a frame, and a function that names a property set
//! further down reads the last frame's value. Numbers that are the same at
//! every breakpoint are written where they are used, the others are tables over
//! airspeed. SI units and radians, as everywhere in the law; the properties'
//! names say so.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::text::{comment, number};
use super::{File, Input, Precision};
use crate::law::diagram::{Function, Term};
use crate::law::{Diagram, Kind, Wire, mdi, tables};

/// Names of the inputs as properties, in the order of the diagram's inputs.
const INPUTS: [&str; 14] = [
    "u-m_sec",
    "v-m_sec",
    "w-m_sec",
    "p-rad_sec",
    "q-rad_sec",
    "r-rad_sec",
    "phi-rad",
    "theta-rad",
    "airspeed-m_sec",
    "velocity-mode",
    "command-1",
    "command-2",
    "heading-rate-rad_sec",
    "v-z-m_sec",
];

/// An expression: text of a function's operand.
type X = String;

fn op(name: &str, operands: &[X]) -> X {
    format!("<{name}>{}</{name}>", operands.concat())
}

fn v(value: f64) -> X {
    format!("<v>{}</v>", number(value, Precision::Double))
}

fn sum(operands: &[X]) -> X {
    match operands {
        [] => v(0.0),
        [one] => one.clone(),
        many => op("sum", many),
    }
}

fn pick(condition: X, yes: X, no: X) -> X {
    op("ifthen", &[op("gt", &[condition, v(0.5)]), yes, no])
}

/// The system as it is written.
struct Writer<'a> {
    input: &'a Input<'a>,
    diagram: &'a Diagram,
    /// Property of each block that has one.
    properties: BTreeMap<usize, String>,
    declared: String,
    channel: String,
}

fn slug(text: &str) -> String {
    text.replace([' ', '_'], "-")
}

impl Writer<'_> {
    fn name(&self, property: &str) -> String {
        format!("{}/{property}", self.input.options.name)
    }

    /// A property as an operand.
    fn p(&self, property: &str) -> X {
        format!("<p>{}</p>", self.name(property))
    }

    fn declare(&mut self, property: &str, value: f64, meaning: &str) {
        let name = self.name(property);
        let value = number(value, Precision::Double);
        let meaning =
            if meaning.is_empty() { String::new() } else { format!(" <!-- {meaning} -->") };
        // Writing to a String cannot fail.
        let _ = writeln!(self.declared, "  <property value=\"{value}\">{name}</property>{meaning}");
    }

    /// A quantity.
    fn set(&mut self, property: &str, expression: &X) {
        self.declare(property, 0.0, "");
        let _ = writeln!(
            self.channel,
            "    <fcs_function name=\"{}\">\n      <function>{expression}</function>\n    \
             </fcs_function>",
            self.name(property)
        );
    }

    /// An input that is declared already: a component of its name would define
    /// it a second time.
    fn link(&mut self, input: &str, expression: &X) {
        let _ = writeln!(
            self.channel,
            "    <fcs_function name=\"{}\">\n      <function>{expression}</function>\n      \
             <output>{}</output>\n    </fcs_function>",
            self.name(&format!("link/{input}")),
            self.name(&format!("in/{input}")),
        );
    }

    fn remark(&mut self, text: &str) {
        let _ = writeln!(self.channel, "    <!-- {} -->", plain(text));
    }

    /// The number of an entry that is the same at every breakpoint.
    fn fixed(&self, place: usize) -> Option<f64> {
        let points = self.input.law.points();
        let first = points[0].flat()[place];
        points.iter().all(|p| p.flat()[place] == first).then_some(first)
    }

    fn operand(&self, wire: Wire) -> X {
        let block = self.diagram.block(wire);
        match block.kind {
            Kind::Constant(value) => v(value),
            Kind::Entry(place) => match self.fixed(place) {
                Some(value) => v(value),
                None => self.p(&entry_property(place)),
            },
            _ => self.p(&self.properties[&wire.0]),
        }
    }

    /// A term's product; `None` where a factor is zero at every breakpoint.
    fn product(&self, term: &Term) -> Option<X> {
        let zero = |w: &Wire| match self.diagram.block(*w).kind {
            Kind::Entry(place) => self.fixed(place) == Some(0.0),
            _ => false,
        };
        if term.factors.iter().any(zero) {
            return None;
        }
        let factors: Vec<X> = term.factors.iter().map(|w| self.operand(*w)).collect();
        Some(if factors.len() == 1 { factors[0].clone() } else { op("product", &factors) })
    }

    fn expression(&self, wire: Wire) -> X {
        let block = self.diagram.block(wire);
        let o = |w: &Wire| self.operand(*w);
        let list = |name: &str, list: &[Wire]| op(name, &list.iter().map(o).collect::<Vec<_>>());
        match &block.kind {
            Kind::Sum(terms) => {
                let of = |negative: bool| -> Vec<X> {
                    let chosen = terms.iter().filter(|t| t.negative == negative);
                    chosen.filter_map(|t| self.product(t)).collect()
                };
                let (more, less) = (of(false), of(true));
                match (more.is_empty(), less.is_empty()) {
                    (_, true) => sum(&more),
                    (true, false) => op("product", &[v(-1.0), sum(&less)]),
                    (false, false) => op("difference", &[sum(&more), sum(&less)]),
                }
            }
            Kind::Quotient(a, b) => list("quotient", &[*a, *b]),
            Kind::Function(f, x) => {
                let name = match f {
                    Function::Sine => "sin",
                    Function::Cosine => "cos",
                    Function::ArcTangent => "atan",
                    Function::Absolute => "abs",
                };
                list(name, &[*x])
            }
            Kind::Maximum(a, b) => list("max", &[*a, *b]),
            Kind::Limit { input, low, high } => op("min", &[list("max", &[*input, *low]), o(high)]),
            Kind::Above(a, b) => list("gt", &[*a, *b]),
            Kind::All(wires) => list("and", wires),
            Kind::Any(wires) => list("or", wires),
            Kind::Not(x) => op("lt", &[o(x), v(0.5)]),
            Kind::Select { condition, yes, no } => pick(o(condition), o(yes), o(no)),
            Kind::Blend { weight, off, on } => {
                let w = o(weight);
                let rest = op("difference", &[v(1.0), w.clone()]);
                sum(&[op("product", &[rest, o(off)]), op("product", &[w, o(on)])])
            }
            Kind::Memory { restart } => {
                let stored = self.p(&format!("store/{}", slug(&block.name)));
                match restart {
                    Some((when, at)) => pick(o(when), o(at), stored),
                    // What says that the law has started is taken back by the
                    // reset.
                    None => pick(self.p("in/reset"), v(0.0), stored),
                }
            }
            // Inputs are properties; the rest has no place in this form.
            _ => v(0.0),
        }
    }

    /// A delay line: from the oldest on, each place takes the next one's last
    /// number.
    fn delay(&mut self, wire: Wire, steps: usize, (when, at): (Wire, Wire)) {
        let name = slug(&self.diagram.block(wire).name);
        let (when, at) = (self.operand(when), self.operand(at));
        for k in (2..=steps).rev() {
            let next = self.p(&format!("delay/{name}-{}", k - 1));
            self.set(&format!("delay/{name}-{k}"), &pick(when.clone(), at.clone(), next));
        }
        let entered = self.p(&format!("store/{name}"));
        self.set(&format!("delay/{name}-1"), &pick(when, at, entered));
    }

    /// Tables over airspeed.
    fn tables(&mut self) {
        self.remark("tables over true airspeed, linear between breakpoints, constant beyond");
        let flat: Vec<(f64, Vec<f64>)> =
            self.input.law.points().iter().map(|p| (p.speed, p.flat())).collect();
        let schedule =
            self.diagram.schedule.map_or(String::new(), |w| self.properties[&w.0].clone());
        for place in 0..tables::count() {
            if self.fixed(place).is_some() {
                continue;
            }
            let mut data = String::new();
            for (speed, values) in &flat {
                let _ = write!(
                    data,
                    "\n        {}  {}",
                    number(*speed, Precision::Double),
                    number(values[place], Precision::Double)
                );
            }
            let table = format!(
                "<table><independentVar lookup=\"row\">{}</independentVar><tableData>{data}\n\
                 \x20     </tableData></table>",
                self.name(&schedule)
            );
            self.set(&entry_property(place), &table);
        }
    }
}

fn entry_property(place: usize) -> String {
    tables::entry(place).map_or_else(String::new, |(form, i, j)| {
        let (row, column) = (form.rows[i].0, form.columns[j].0);
        if column == "value" {
            format!("at/{}/{row}", form.name)
        } else {
            format!("at/{}/{row}/{column}", form.name)
        }
    })
}

/// Text that may stand in a comment.
fn plain(text: &str) -> String {
    text.replace('&', "and").replace('<', "(").replace('>', ")").replace("--", "- -")
}

/// Where each block's number is found.
fn properties(d: &Diagram) -> BTreeMap<usize, String> {
    let sticks = tables::STICKS.map(|s| s.0);
    let mut inputs = INPUTS.iter();
    let mut out = BTreeMap::new();
    for (k, block) in d.blocks.iter().enumerate() {
        let property = match block.kind {
            Kind::Constant(_) | Kind::Entry(_) => continue,
            Kind::Input | Kind::Switch => format!("in/{}", inputs.next().unwrap_or(&"")),
            Kind::Delay { steps, .. } => format!("delay/{}-{steps}", slug(&block.name)),
            _ => match d.outputs.iter().position(|w| *w == Wire(k)) {
                Some(j) => format!("sticks/{}", sticks[j]),
                None if block.name == "turn_blend" => "turn/blend".into(),
                None => format!("{}/{}", slug(&d.groups[block.group].title), slug(&block.name)),
            },
        };
        out.insert(k, property);
    }
    out
}

/// The system.
pub(super) fn files(input: &Input) -> Vec<File> {
    let diagram = super::diagram(input, false);
    let mut w = Writer {
        input,
        diagram: &diagram,
        properties: properties(&diagram),
        declared: String::new(),
        channel: String::new(),
    };
    let meanings = mdi::MEASUREMENTS.iter().chain(&mdi::DEMANDS).map(|(_, _, meaning)| *meaning);
    for (name, meaning) in INPUTS.iter().zip(meanings) {
        w.declare(&format!("in/{name}"), 0.0, meaning);
    }
    w.declare("in/reset", 0.0, "while 1, the law starts anew in every frame");
    w.declare("in/linked", 1.0, "1: measures the aircraft that it stands in; 0: inputs are given");
    w.remark("what the law measures of the aircraft");
    for (input, expression) in INPUTS.iter().zip(measured()) {
        let linked = pick(w.p("in/linked"), expression, w.p(&format!("in/{input}")));
        w.link(input, &linked);
    }
    let mut group = usize::MAX;
    for (k, block) in diagram.blocks.iter().enumerate() {
        let wire = Wire(k);
        match block.kind {
            Kind::Constant(_) | Kind::Entry(_) | Kind::Input | Kind::Switch => continue,
            _ => {}
        }
        if block.group != group {
            group = block.group;
            let g = &diagram.groups[group];
            let _ = writeln!(w.channel);
            w.remark(&format!("{}: {}", g.title, g.text));
        }
        w.remark(&format!("{}, {}", block.comment, block.unit));
        if let Kind::Delay { steps, restart } = block.kind {
            w.delay(wire, steps, restart);
        } else {
            let expression = w.expression(wire);
            let property = w.properties[&k].clone();
            w.set(&property, &expression);
        }
        if diagram.schedule == Some(wire) {
            w.tables();
        }
    }
    let _ = writeln!(w.channel);
    w.remark("what the next frame remembers");
    for store in &diagram.stores {
        let name = slug(&diagram.block(store.memory).name);
        let next = w.operand(store.next);
        w.set(&format!("store/{name}"), &next);
    }
    for feed in &diagram.feeds {
        let name = slug(&diagram.block(feed.line).name);
        let next = w.operand(feed.input);
        w.set(&format!("store/{name}"), &next);
    }
    let o = input.options;
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!--\n{}\nThe frame time of the simulation \
         must be {} s. Inputs are {}/in/..., outputs {}/sticks/..., percent.\n-->\n\
         <system name=\"{}_law\">\n{}\n  <channel name=\"{} law\">\n{}  </channel>\n</system>\n",
        plain(&comment(&input.description.banner(), "  ", 96)),
        number(o.step, Precision::Double),
        o.name,
        o.name,
        o.name,
        w.declared,
        o.name,
        w.channel
    );
    vec![File::text(format!("{}_law.xml", o.name), text)]
}

/// What the law measures as JSBSim has it, in the order of [`INPUTS`]:
/// velocities over the ground in body axes, rates, attitude, and the component
/// of the velocity through the air along the heading.
fn measured() -> [X; 9] {
    let p = |property: &str| format!("<p>{property}</p>");
    let metres = |x: X| op("product", &[x, v(0.3048)]);
    let (phi, theta) = (p("attitude/phi-rad"), p("attitude/theta-rad"));
    let times = |a: X, function: &str, angle: &X| {
        op("product", &[a, op(function, std::slice::from_ref(angle))])
    };
    let lifted = sum(&[
        times(p("velocities/v-aero-fps"), "sin", &phi),
        times(p("velocities/w-aero-fps"), "cos", &phi),
    ]);
    let forward =
        sum(&[times(p("velocities/u-aero-fps"), "cos", &theta), times(lifted, "sin", &theta)]);
    [
        metres(p("velocities/u-fps")),
        metres(p("velocities/v-fps")),
        metres(p("velocities/w-fps")),
        p("velocities/p-rad_sec"),
        p("velocities/q-rad_sec"),
        p("velocities/r-rad_sec"),
        phi,
        theta,
        metres(forward),
    ]
}
