//! A law for small deviations.
//!
//! [`LinearLaw::new`] differentiates every block at the numbers of a step and
//! carries the derivatives along the wires. In discrete time the states are
//! what the law stores; in the limit of a short step (a diagram whose step is
//! zero) their derivatives are the rates of its integrals. Delay lines stand
//! outside: what they give are inputs, what enters them are outputs.

use super::diagram::{Diagram, Function, Kind, Wire};
use super::program::{AT_A_BREAKPOINT, Breakpoints, Memory, Program};
use nalgebra::DMatrix;
use num_complex::Complex64 as C;

/// The law as a state space, for deviations from an operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearLaw {
    /// Interval between steps, s; zero in continuous time.
    pub step: f64,
    /// Names of the states.
    pub states: Vec<String>,
    /// Names of the inputs; the last [`LinearLaw::lines`] are what delay lines
    /// give.
    pub inputs: Vec<String>,
    /// Names of the outputs; the last [`LinearLaw::lines`] are what enters
    /// delay lines, in the same order.
    pub outputs: Vec<String>,
    /// Delay lines.
    pub lines: usize,
    /// The next state, or the state's derivative, from states.
    pub a: DMatrix<f64>,
    /// The same from inputs.
    pub b: DMatrix<f64>,
    /// Outputs from states.
    pub c: DMatrix<f64>,
    /// Outputs from inputs.
    pub d: DMatrix<f64>,
}

/// Where a number that is held comes to lie on its limit, it counts as free:
/// trims lie on limits, and what is flown leaves them in both directions.
fn held_slopes(x: f64, low: f64, high: f64) -> [f64; 3] {
    if x < low {
        [0.0, 1.0, 0.0]
    } else if x > high {
        [0.0, 0.0, 1.0]
    } else {
        [1.0, 0.0, 0.0]
    }
}

impl LinearLaw {
    /// The law about the step that `memory` holds the numbers of.
    pub fn new(
        diagram: &Diagram,
        tables: &Breakpoints,
        program: &Program,
        memory: &Memory,
    ) -> Self {
        let value = |w: Wire| program.value(memory, w);
        let blocks = &diagram.blocks;
        let places = |wanted: &dyn Fn(&Kind) -> bool| -> Vec<usize> {
            (0..blocks.len()).filter(|k| wanted(&blocks[*k].kind)).collect()
        };
        // Logical inputs, and memories that only say that the law has started
        // and in which mode, do not deviate.
        let inputs = places(&|k| matches!(k, Kind::Input));
        let stores: Vec<_> = diagram
            .stores
            .iter()
            .filter(|s| matches!(diagram.block(s.memory).kind, Kind::Memory { restart: Some(_) }))
            .collect();
        let (n, m, l) = (stores.len(), inputs.len(), diagram.feeds.len());
        let mut seed = vec![None; blocks.len()];
        for (k, s) in stores.iter().enumerate() {
            seed[s.memory.0] = Some(k);
        }
        for (k, place) in inputs.iter().enumerate() {
            seed[*place] = Some(n + k);
        }
        for (k, f) in diagram.feeds.iter().enumerate() {
            seed[f.line.0] = Some(n + m + k);
        }
        let mut slopes = DMatrix::<f64>::zeros(n + m + l, blocks.len());
        for (k, block) in blocks.iter().enumerate() {
            if let Some(s) = seed[k] {
                slopes[(s, k)] = 1.0;
                continue;
            }
            for (wire, by) in partials(diagram, tables, &block.kind, &value) {
                if by != 0.0 {
                    let from = slopes.column(wire.0).into_owned();
                    slopes.column_mut(k).axpy(by, &from, 1.0);
                }
            }
        }
        let step = diagram.step.map_or(0.0, value);
        let row = |wire: Option<Wire>| {
            wire.map_or_else(
                || nalgebra::RowDVector::zeros(n + m + l),
                |w| slopes.column(w.0).transpose(),
            )
        };
        let mut dynamics = DMatrix::zeros(n, n + m + l);
        for (k, s) in stores.iter().enumerate() {
            dynamics.set_row(k, &row(if step == 0.0 { s.rate } else { Some(s.next) }));
        }
        let seen: Vec<Wire> = diagram
            .outputs
            .iter()
            .chain(&diagram.monitors)
            .copied()
            .chain(diagram.feeds.iter().map(|f| f.input))
            .collect();
        let mut answers = DMatrix::zeros(seen.len(), n + m + l);
        for (k, wire) in seen.iter().enumerate() {
            answers.set_row(k, &row(Some(*wire)));
        }
        let name = |w: Wire| diagram.block(w).name.clone();
        Self {
            step,
            states: stores.iter().map(|s| name(s.memory)).collect(),
            inputs: inputs
                .iter()
                .map(|k| blocks[*k].name.clone())
                .chain(diagram.feeds.iter().map(|f| name(f.line)))
                .collect(),
            outputs: seen.into_iter().map(name).collect(),
            lines: l,
            a: dynamics.columns(0, n).into_owned(),
            b: dynamics.columns(n, m + l).into_owned(),
            c: answers.columns(0, n).into_owned(),
            d: answers.columns(n, m + l).into_owned(),
        }
    }

    /// Place of an input.
    pub fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|n| n == name)
    }

    /// Place of an output.
    pub fn output(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|n| n == name)
    }

    /// The part of the law that leads from the named inputs to the named
    /// outputs, in continuous time: states and delay lines that these inputs do
    /// not move, or that these outputs do not see, are left out. Names that are
    /// not there are left out, too.
    pub fn part(&self, inputs: &[&str], outputs: &[&str]) -> Self {
        let (n, lines) = (self.states.len(), self.lines);
        let columns: Vec<usize> = inputs.iter().filter_map(|name| self.input(name)).collect();
        let rows: Vec<usize> = outputs.iter().filter_map(|name| self.output(name)).collect();
        let first_line = self.outputs.len() - lines;
        let first_late = self.inputs.len() - lines;
        // States, then delay lines: what moves one of them, and what moves it.
        let size = n + lines;
        let by = |to: usize, from: usize| -> f64 {
            match (to < n, from < n) {
                (true, true) => self.a[(to, from)],
                (true, false) => self.b[(to, first_late + from - n)],
                (false, true) => self.c[(first_line + to - n, from)],
                (false, false) => self.d[(first_line + to - n, first_late + from - n)],
            }
        };
        let from_input = |to: usize, column: usize| -> f64 {
            if to < n { self.b[(to, column)] } else { self.d[(first_line + to - n, column)] }
        };
        let to_output = |row: usize, from: usize| -> f64 {
            if from < n { self.c[(row, from)] } else { self.d[(row, first_late + from - n)] }
        };
        let spread = |mut set: Vec<bool>, joins: &dyn Fn(usize, usize) -> bool| -> Vec<bool> {
            let mut open: Vec<usize> = (0..size).filter(|k| set[*k]).collect();
            while let Some(k) = open.pop() {
                for (other, known) in set.iter_mut().enumerate() {
                    if !*known && joins(k, other) {
                        *known = true;
                        open.push(other);
                    }
                }
            }
            set
        };
        let moved = spread(
            (0..size).map(|k| columns.iter().any(|c| from_input(k, *c) != 0.0)).collect(),
            &|k, other| by(other, k) != 0.0,
        );
        let seen = spread(
            (0..size).map(|k| rows.iter().any(|r| to_output(*r, k) != 0.0)).collect(),
            &|k, other| by(k, other) != 0.0,
        );
        let kept: Vec<usize> = (0..n).filter(|k| moved[*k] && seen[*k]).collect();
        let kept_lines: Vec<usize> = (0..lines).filter(|k| moved[n + k] && seen[n + k]).collect();
        let columns: Vec<usize> =
            columns.into_iter().chain(kept_lines.iter().map(|k| first_late + k)).collect();
        let rows: Vec<usize> =
            rows.into_iter().chain(kept_lines.iter().map(|k| first_line + k)).collect();
        Self {
            step: self.step,
            states: kept.iter().map(|k| self.states[*k].clone()).collect(),
            inputs: columns.iter().map(|k| self.inputs[*k].clone()).collect(),
            outputs: rows.iter().map(|k| self.outputs[*k].clone()).collect(),
            lines: kept_lines.len(),
            a: self.a.select_rows(&kept).select_columns(&kept),
            b: self.b.select_rows(&kept).select_columns(&columns),
            c: self.c.select_rows(&rows).select_columns(&kept),
            d: self.d.select_rows(&rows).select_columns(&columns),
        }
    }

    /// The part that leads from any input to the named outputs.
    pub fn seen_by(&self, outputs: &[&str]) -> Self {
        let inputs: Vec<&str> =
            self.inputs[..self.inputs.len() - self.lines].iter().map(String::as_str).collect();
        self.part(&inputs, outputs)
    }

    /// The same law where one input is a sum of others: `input` moves as `by`
    /// says, a number for each of the first inputs, and counts no more by
    /// itself.
    pub fn with_input_from(&self, input: usize, by: &[f64]) -> Self {
        let mut out = self.clone();
        for m in [&mut out.b, &mut out.d] {
            let own = m.column(input).into_owned();
            for (k, by) in by.iter().enumerate() {
                m.column_mut(k).axpy(*by, &own, 1.0);
            }
            m.column_mut(input).fill(0.0);
        }
        out
    }

    /// Response from inputs to outputs at s (z, in discrete time), the delay
    /// lines closed, each giving `late` times what enters it. `None` where the
    /// law has a pole there.
    pub fn response(&self, at: C, late: C) -> Option<DMatrix<C>> {
        let n = self.states.len();
        let (outputs, inputs) = (self.outputs.len() - self.lines, self.inputs.len() - self.lines);
        let complex = |m: &DMatrix<f64>| m.map(|v| C::new(v, 0.0));
        let resolvent = DMatrix::from_fn(n, n, |i, j| {
            C::new(-self.a[(i, j)], 0.0) + if i == j { at } else { C::new(0.0, 0.0) }
        });
        let inner = resolvent.lu().solve(&complex(&self.b))?;
        let whole = complex(&self.c) * inner + complex(&self.d);
        let direct = whole.view((0, 0), (outputs, inputs)).into_owned();
        if self.lines == 0 {
            return Some(direct);
        }
        let size = (self.lines, self.lines);
        let around = DMatrix::<C>::identity(size.0, size.1)
            - whole.view((outputs, inputs), size).into_owned() * late;
        let entering = whole.view((outputs, 0), (self.lines, inputs)).into_owned() * late;
        let given = around.lu().solve(&entering)?;
        Some(direct + whole.view((0, inputs), (outputs, self.lines)).into_owned() * given)
    }
}

/// Derivatives of a block by the wires that it reads.
fn partials(
    diagram: &Diagram,
    tables: &Breakpoints,
    kind: &Kind,
    value: &dyn Fn(Wire) -> f64,
) -> Vec<(Wire, f64)> {
    match kind {
        Kind::Input
        | Kind::Switch
        | Kind::Constant(_)
        | Kind::Above(..)
        | Kind::All(_)
        | Kind::Any(_)
        | Kind::Not(_)
        | Kind::Solve { .. }
        | Kind::Part { .. } => Vec::new(),
        Kind::Entry(place) => {
            diagram.schedule.map(|w| (w, tables.slope(value(w), *place))).into_iter().collect()
        }
        Kind::Sum(terms) => {
            let mut out = Vec::new();
            for term in terms {
                let sign = if term.negative { -1.0 } else { 1.0 };
                for (k, wire) in term.factors.iter().enumerate() {
                    let others = term
                        .factors
                        .iter()
                        .enumerate()
                        .filter(|(j, _)| *j != k)
                        .fold(sign, |product, (_, w)| product * value(*w));
                    out.push((*wire, others));
                }
            }
            out
        }
        Kind::Quotient(a, b) => {
            let over = 1.0 / value(*b);
            vec![(*a, over), (*b, -value(*a) * over * over)]
        }
        Kind::Function(f, x) => {
            let at = value(*x);
            let slope = match f {
                Function::Sine => at.cos(),
                Function::Cosine => -at.sin(),
                Function::ArcTangent => 1.0 / (1.0 + at * at),
                Function::Absolute => at.signum(),
            };
            vec![(*x, slope)]
        }
        Kind::Maximum(a, b) => {
            // On the edge the first counts, as in `held_slopes`: a speed of the
            // schedule that is zero but for rounding is at the first breakpoint.
            let first = value(*a) >= value(*b) - AT_A_BREAKPOINT;
            vec![(if first { *a } else { *b }, 1.0)]
        }
        Kind::Limit { input, low, high } => {
            let [x, l, h] = held_slopes(value(*input), value(*low), value(*high));
            vec![(*input, x), (*low, l), (*high, h)]
        }
        Kind::Select { condition, yes, no } => {
            vec![(if value(*condition) > 0.5 { *yes } else { *no }, 1.0)]
        }
        Kind::Blend { weight, off, on } => {
            let w = value(*weight);
            vec![(*weight, value(*on) - value(*off)), (*off, 1.0 - w), (*on, w)]
        }
        // States and what delay lines give are where the derivatives begin;
        // the others do not deviate.
        Kind::Memory { .. } | Kind::Delay { .. } => Vec::new(),
    }
}
