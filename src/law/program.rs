//! A diagram as a flat list of operations, for stepping.
//!
//! Compiled once: every block has a slot among the numbers, constants are
//! folded, products with entries of tables that are zero at every breakpoint
//! are left out. A step allocates nothing.

use super::diagram::{Diagram, Function, Kind, Wire};

/// The tables over airspeed in the flat order.
#[derive(Debug, Clone, PartialEq)]
pub struct Breakpoints {
    /// Speeds, m/s, strictly increasing, at least one.
    pub speeds: Vec<f64>,
    /// Numbers of each breakpoint in the order of [`tables`](super::tables).
    pub values: Vec<Vec<f64>>,
}

impl Breakpoints {
    /// The two breakpoints around a speed, and the share of the second:
    /// linear between, constant beyond the ends.
    pub fn around(&self, speed: f64) -> (usize, usize, f64) {
        let k = self.speeds.partition_point(|v| *v <= speed);
        if k == 0 || k == self.speeds.len() {
            let end = k.saturating_sub(1);
            return (end, end, 0.0);
        }
        let (a, b) = (self.speeds[k - 1], self.speeds[k]);
        (k - 1, k, (speed - a) / (b - a))
    }

    /// A number at a speed.
    pub fn at(&self, speed: f64, place: usize) -> f64 {
        let (low, high, t) = self.around(speed);
        (1.0 - t) * self.values[low][place] + t * self.values[high][place]
    }

    /// Slope of a number over speed. At a breakpoint, where the slope jumps, it
    /// is the mean of both sides: what a small swing about it sees.
    pub fn slope(&self, speed: f64, place: usize) -> f64 {
        let of = |low: usize, high: usize| {
            let gap = self.speeds[high] - self.speeds[low];
            if gap > 0.0 { (self.values[high][place] - self.values[low][place]) / gap } else { 0.0 }
        };
        // Trims reach the speed of their breakpoint to rounding.
        let near = |v: &f64| (*v - speed).abs() <= AT_A_BREAKPOINT;
        match self.speeds.iter().position(near) {
            Some(k) => {
                let last = self.speeds.len() - 1;
                0.5 * (of(k.saturating_sub(1), k) + of(k, (k + 1).min(last)))
            }
            None => {
                let (low, high, _) = self.around(speed);
                of(low, high)
            }
        }
    }
}

/// How near a speed must be to a breakpoint to count as the same, m/s.
pub(super) const AT_A_BREAKPOINT: f64 = 1e-6;

/// Product of two numbers and a coefficient.
#[derive(Debug, Clone, Copy)]
struct Product {
    coefficient: f64,
    a: u32,
    b: u32,
}

#[derive(Debug, Clone, Copy)]
enum Op {
    Sum { out: u32, first: u32, count: u32 },
    Quotient { out: u32, a: u32, b: u32 },
    Sine { out: u32, x: u32 },
    Cosine { out: u32, x: u32 },
    ArcTangent { out: u32, x: u32 },
    Absolute { out: u32, x: u32 },
    Maximum { out: u32, a: u32, b: u32 },
    Limit { out: u32, x: u32, low: u32, high: u32 },
    Above { out: u32, a: u32, b: u32 },
    All { out: u32, first: u32, count: u32 },
    Any { out: u32, first: u32, count: u32 },
    Not { out: u32, x: u32 },
    Select { out: u32, condition: u32, yes: u32, no: u32 },
    Blend { out: u32, weight: u32, off: u32, on: u32 },
    Memory { out: u32, stored: u32, when: u32, at: u32 },
    Recall { out: u32, stored: u32 },
    Delay { out: u32, line: u32, when: u32, at: u32 },
    Solve { first: u32, out: u32 },
    Lookup,
}

/// A memory's way through a step.
#[derive(Debug, Clone, Copy)]
struct Stored {
    next: u32,
    engaged: u32,
}

#[derive(Debug, Clone, Copy)]
struct Line {
    offset: usize,
    steps: usize,
    input: u32,
}

/// A diagram made ready for stepping.
#[derive(Debug, Clone)]
pub struct Program {
    ops: Vec<Op>,
    engaging: Vec<Op>,
    products: Vec<Product>,
    list: Vec<u32>,
    /// Numbers before the first step: constants in their slots.
    initial: Vec<f64>,
    /// Slot of each block.
    slots: Vec<u32>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    monitors: Vec<u32>,
    stored: Vec<Stored>,
    lines: Vec<Line>,
    line_values: usize,
    speeds: Vec<f64>,
    /// Entries that change over speed, one breakpoint after the other.
    entries: Vec<f64>,
    entry_count: usize,
    first_entry: usize,
    schedule: u32,
}

/// The memory of a law, and the numbers of its last step.
#[derive(Debug, Clone)]
pub struct Memory {
    values: Vec<f64>,
    stored: Vec<f64>,
    lines: Vec<f64>,
    oldest: Vec<usize>,
}

/// The compiler's view of the slots.
struct Compiler<'a> {
    diagram: &'a Diagram,
    program: Program,
    fixed: Vec<Option<f64>>,
    one: u32,
}

fn short(k: usize) -> u32 {
    // A diagram has some hundreds of blocks.
    u32::try_from(k).unwrap_or(u32::MAX)
}

impl Program {
    /// Compiles a diagram whose tables are these.
    pub fn new(diagram: &Diagram, tables: &Breakpoints) -> Self {
        let count = diagram.blocks.len();
        // The value of a block that never changes.
        let mut fixed: Vec<Option<f64>> = Vec::with_capacity(count);
        for block in &diagram.blocks {
            let value = match &block.kind {
                Kind::Constant(v) => Some(*v),
                Kind::Entry(place) => {
                    let first = tables.values[0][*place];
                    tables.values.iter().all(|v| v[*place] == first).then_some(first)
                }
                Kind::Sum(terms) => terms.iter().try_fold(0.0, |sum, term| {
                    let product =
                        term.factors.iter().try_fold(1.0, |p, w| Some(p * fixed[w.0]?))?;
                    Some(if term.negative { sum - product } else { sum + product })
                }),
                Kind::Quotient(a, b) => fixed[a.0].zip(fixed[b.0]).map(|(a, b)| a / b),
                _ => None,
            };
            fixed.push(value);
        }
        let varying: Vec<usize> = (0..count)
            .filter(|k| matches!(diagram.blocks[*k].kind, Kind::Entry(_)) && fixed[*k].is_none())
            .collect();
        // Blocks in their order, then the number one, then the entries that
        // change, side by side.
        let mut slots: Vec<u32> = (0..count).map(short).collect();
        let first_entry = count + 1;
        for (n, k) in varying.iter().enumerate() {
            slots[*k] = short(first_entry + n);
        }
        let mut initial = vec![0.0; first_entry + varying.len()];
        initial[count] = 1.0;
        for (k, value) in fixed.iter().enumerate() {
            initial[k] = value.unwrap_or(0.0);
        }
        let mut entries = Vec::new();
        for values in &tables.values {
            entries.extend(varying.iter().map(|k| match diagram.blocks[*k].kind {
                Kind::Entry(place) => values[place],
                _ => 0.0,
            }));
        }
        let slot = |w: &Wire| slots[w.0];
        let inputs = (0..count)
            .filter(|k| matches!(diagram.blocks[*k].kind, Kind::Input | Kind::Switch))
            .map(short)
            .collect();
        let stored = diagram
            .stores
            .iter()
            .map(|s| {
                let restarts =
                    matches!(diagram.block(s.memory).kind, Kind::Memory { restart: Some(_) });
                let otherwise = if restarts { s.memory } else { s.next };
                Stored { next: slot(&s.next), engaged: slot(&s.engaged.unwrap_or(otherwise)) }
            })
            .collect();
        let mut lines = Vec::new();
        let mut line_values = 0;
        for feed in &diagram.feeds {
            if let Kind::Delay { steps, .. } = diagram.block(feed.line).kind {
                lines.push(Line { offset: line_values, steps, input: slot(&feed.input) });
                line_values += steps;
            }
        }
        let program = Self {
            ops: Vec::new(),
            engaging: Vec::new(),
            products: Vec::new(),
            list: Vec::new(),
            initial,
            inputs,
            outputs: diagram.outputs.iter().map(slot).collect(),
            monitors: diagram.monitors.iter().map(slot).collect(),
            stored,
            lines,
            line_values,
            speeds: tables.speeds.clone(),
            entries,
            entry_count: varying.len(),
            first_entry,
            schedule: diagram.schedule.as_ref().map_or(0, slot),
            slots,
        };
        let mut compiler = Compiler { diagram, program, fixed, one: short(count) };
        compiler.compile();
        compiler.program
    }

    /// A memory that has seen nothing: the next step starts from its inputs.
    pub fn memory(&self) -> Memory {
        Memory {
            values: self.initial.clone(),
            stored: vec![0.0; self.stored.len()],
            lines: vec![0.0; self.line_values],
            oldest: vec![0; self.lines.len()],
        }
    }

    /// How many inputs there are; their order is that of the diagram.
    pub fn input_count(&self) -> usize {
        self.inputs.len()
    }

    /// Computes every block from the inputs and the memory, which stays as it
    /// is but for what starts anew.
    pub fn run(&self, memory: &mut Memory, inputs: &[f64]) {
        for (slot, value) in self.inputs.iter().zip(inputs) {
            memory.values[*slot as usize] = *value;
        }
        self.execute(&self.ops, memory);
    }

    /// Ends a step: memories and delay lines take what they are given.
    pub fn advance(&self, memory: &mut Memory) {
        for (stored, s) in memory.stored.iter_mut().zip(&self.stored) {
            *stored = memory.values[s.next as usize];
        }
        for (oldest, line) in memory.oldest.iter_mut().zip(&self.lines) {
            memory.lines[line.offset + *oldest] = memory.values[line.input as usize];
            *oldest = if *oldest + 1 == line.steps { 0 } else { *oldest + 1 };
        }
    }

    /// Takes the step back but keeps what has started: memories hold what they
    /// were at its begin, and those that engaging sets take that.
    pub fn hold(&self, memory: &mut Memory) {
        self.execute(&self.engaging, memory);
        for (stored, s) in memory.stored.iter_mut().zip(&self.stored) {
            *stored = memory.values[s.engaged as usize];
        }
    }

    /// The number of a block at the last step.
    pub fn value(&self, memory: &Memory, wire: Wire) -> f64 {
        memory.values[self.slots[wire.0] as usize]
    }

    /// An output of the last step.
    pub fn output(&self, memory: &Memory, k: usize) -> f64 {
        memory.values[self.outputs[k] as usize]
    }

    /// A monitored number of the last step.
    pub fn monitor(&self, memory: &Memory, k: usize) -> f64 {
        memory.values[self.monitors[k] as usize]
    }

    /// What is stored, in the order of the diagram's stores.
    pub fn stored<'a>(&self, memory: &'a mut Memory) -> &'a mut [f64] {
        &mut memory.stored
    }

    /// What a delay line will give next, in the order of the diagram's feeds.
    pub fn due<'a>(&self, memory: &'a mut Memory, line: usize) -> &'a mut f64 {
        &mut memory.lines[self.lines[line].offset + memory.oldest[line]]
    }

    fn lookup(&self, v: &mut [f64]) {
        let speed = v[self.schedule as usize];
        let n = self.entry_count;
        let k = self.speeds.partition_point(|s| *s <= speed);
        let target = &mut v[self.first_entry..self.first_entry + n];
        if k == 0 || k == self.speeds.len() {
            let end = k.saturating_sub(1);
            target.copy_from_slice(&self.entries[end * n..(end + 1) * n]);
            return;
        }
        let (a, b) = (self.speeds[k - 1], self.speeds[k]);
        let t = (speed - a) / (b - a);
        let s = 1.0 - t;
        let low = &self.entries[(k - 1) * n..k * n];
        let high = &self.entries[k * n..(k + 1) * n];
        for ((target, low), high) in target.iter_mut().zip(low).zip(high) {
            *target = s * low + t * high;
        }
    }

    fn execute(&self, ops: &[Op], memory: &mut Memory) {
        let v = memory.values.as_mut_slice();
        for op in ops {
            match *op {
                Op::Sum { out, first, count } => {
                    let mut sum = 0.0;
                    for p in &self.products[first as usize..(first + count) as usize] {
                        sum += p.coefficient * v[p.a as usize] * v[p.b as usize];
                    }
                    v[out as usize] = sum;
                }
                Op::Quotient { out, a, b } => v[out as usize] = v[a as usize] / v[b as usize],
                Op::Sine { out, x } => v[out as usize] = v[x as usize].sin(),
                Op::Cosine { out, x } => v[out as usize] = v[x as usize].cos(),
                Op::ArcTangent { out, x } => v[out as usize] = v[x as usize].atan(),
                Op::Absolute { out, x } => v[out as usize] = v[x as usize].abs(),
                Op::Maximum { out, a, b } => {
                    let (a, b) = (v[a as usize], v[b as usize]);
                    v[out as usize] = if a > b { a } else { b };
                }
                Op::Limit { out, x, low, high } => {
                    let (x, low, high) = (v[x as usize], v[low as usize], v[high as usize]);
                    v[out as usize] = if x < low {
                        low
                    } else if x > high {
                        high
                    } else {
                        x
                    };
                }
                Op::Above { out, a, b } => {
                    v[out as usize] = f64::from(v[a as usize] > v[b as usize]);
                }
                Op::All { out, first, count } => {
                    let list = &self.list[first as usize..(first + count) as usize];
                    v[out as usize] = f64::from(list.iter().all(|x| v[*x as usize] > 0.5));
                }
                Op::Any { out, first, count } => {
                    let list = &self.list[first as usize..(first + count) as usize];
                    v[out as usize] = f64::from(list.iter().any(|x| v[*x as usize] > 0.5));
                }
                Op::Not { out, x } => v[out as usize] = f64::from(v[x as usize] <= 0.5),
                Op::Select { out, condition, yes, no } => {
                    v[out as usize] =
                        if v[condition as usize] > 0.5 { v[yes as usize] } else { v[no as usize] };
                }
                Op::Blend { out, weight, off, on } => {
                    let w = v[weight as usize];
                    v[out as usize] = (1.0 - w) * v[off as usize] + w * v[on as usize];
                }
                Op::Memory { out, stored, when, at } => {
                    v[out as usize] = if v[when as usize] > 0.5 {
                        v[at as usize]
                    } else {
                        memory.stored[stored as usize]
                    };
                }
                Op::Recall { out, stored } => v[out as usize] = memory.stored[stored as usize],
                Op::Delay { out, line, when, at } => {
                    let l = &self.lines[line as usize];
                    if v[when as usize] > 0.5 {
                        memory.lines[l.offset..l.offset + l.steps].fill(v[at as usize]);
                    }
                    v[out as usize] = memory.lines[l.offset + memory.oldest[line as usize]];
                }
                Op::Solve { first, out } => {
                    let list = &self.list[first as usize..first as usize + 20];
                    let matrix = nalgebra::Matrix4::from_fn(|i, j| v[list[4 * i + j] as usize]);
                    let right = nalgebra::Vector4::from_fn(|i, _| v[list[16 + i] as usize]);
                    let solution = matrix.lu().solve(&right).unwrap_or_default();
                    for (i, x) in solution.iter().enumerate() {
                        v[out as usize + i] = *x;
                    }
                }
                Op::Lookup => self.lookup(v),
            }
        }
    }
}

impl Compiler<'_> {
    fn slot(&self, w: Wire) -> u32 {
        self.program.slots[w.0]
    }

    fn compile(&mut self) {
        let only_engaging = self.diagram.only_engaging();
        let mut looked_up = false;
        for (k, only_engaging) in only_engaging.into_iter().enumerate() {
            if self.fixed[k].is_some() {
                continue;
            }
            let kind = self.diagram.blocks[k].kind.clone();
            if matches!(kind, Kind::Entry(_)) {
                if !looked_up {
                    self.program.ops.push(Op::Lookup);
                    looked_up = true;
                }
                continue;
            }
            let mut ops = Vec::new();
            self.block(k, &kind, &mut ops);
            if only_engaging {
                self.program.engaging.extend(ops);
            } else {
                self.program.ops.extend(ops);
            }
        }
    }

    fn list(&mut self, wires: impl IntoIterator<Item = Wire>) -> (u32, u32) {
        let first = self.program.list.len();
        let slots: Vec<u32> = wires.into_iter().map(|w| self.slot(w)).collect();
        self.program.list.extend(&slots);
        (short(first), short(slots.len()))
    }

    fn block(&mut self, k: usize, kind: &Kind, ops: &mut Vec<Op>) {
        let out = self.program.slots[k];
        let s = |w: &Wire| self.program.slots[w.0];
        let op = match kind {
            // A part's number is written by the block that solves.
            Kind::Input | Kind::Switch | Kind::Constant(_) | Kind::Entry(_) => return,
            Kind::Part { .. } => return,
            Kind::Sum(terms) => {
                let mut products = Vec::new();
                for term in terms {
                    let mut coefficient = if term.negative { -1.0 } else { 1.0 };
                    let mut factors: Vec<u32> = Vec::new();
                    for w in &term.factors {
                        match self.fixed[w.0] {
                            Some(value) => coefficient *= value,
                            None => factors.push(self.slot(*w)),
                        }
                    }
                    if coefficient == 0.0 {
                        continue;
                    }
                    while factors.len() > 2 {
                        let (a, b) = (factors.remove(0), factors.remove(0));
                        let between = short(self.program.initial.len());
                        self.program.initial.push(0.0);
                        let first = short(self.program.products.len());
                        self.program.products.push(Product { coefficient: 1.0, a, b });
                        ops.push(Op::Sum { out: between, first, count: 1 });
                        factors.insert(0, between);
                    }
                    let a = factors.first().copied().unwrap_or(self.one);
                    let b = factors.get(1).copied().unwrap_or(self.one);
                    products.push(Product { coefficient, a, b });
                }
                let first = short(self.program.products.len());
                let count = short(products.len());
                self.program.products.extend(products);
                Op::Sum { out, first, count }
            }
            Kind::Quotient(a, b) => Op::Quotient { out, a: s(a), b: s(b) },
            Kind::Function(f, x) => {
                let x = s(x);
                match f {
                    Function::Sine => Op::Sine { out, x },
                    Function::Cosine => Op::Cosine { out, x },
                    Function::ArcTangent => Op::ArcTangent { out, x },
                    Function::Absolute => Op::Absolute { out, x },
                }
            }
            Kind::Maximum(a, b) => Op::Maximum { out, a: s(a), b: s(b) },
            Kind::Limit { input, low, high } => {
                Op::Limit { out, x: s(input), low: s(low), high: s(high) }
            }
            Kind::Above(a, b) => Op::Above { out, a: s(a), b: s(b) },
            Kind::All(list) => {
                let (first, count) = self.list(list.iter().copied());
                Op::All { out, first, count }
            }
            Kind::Any(list) => {
                let (first, count) = self.list(list.iter().copied());
                Op::Any { out, first, count }
            }
            Kind::Not(x) => Op::Not { out, x: s(x) },
            Kind::Select { condition, yes, no } => {
                Op::Select { out, condition: s(condition), yes: s(yes), no: s(no) }
            }
            Kind::Blend { weight, off, on } => {
                Op::Blend { out, weight: s(weight), off: s(off), on: s(on) }
            }
            Kind::Memory { restart } => {
                let place = self.diagram.stores.iter().position(|x| x.memory == Wire(k));
                let stored = short(place.unwrap_or(usize::MAX));
                match restart {
                    Some((when, at)) => Op::Memory { out, stored, when: s(when), at: s(at) },
                    None => Op::Recall { out, stored },
                }
            }
            Kind::Delay { restart: (when, at), .. } => {
                let place = self.diagram.feeds.iter().position(|x| x.line == Wire(k));
                let line = short(place.unwrap_or(usize::MAX));
                Op::Delay { out, line, when: s(when), at: s(at) }
            }
            Kind::Solve { matrix, right } => {
                let (first, _) = self.list(matrix.iter().chain(right).copied());
                // The parts stand at the end, side by side.
                let start = short(self.program.initial.len());
                self.program.initial.extend([0.0; 4]);
                for (n, block) in self.diagram.blocks.iter().enumerate() {
                    if let Kind::Part { of, index } = block.kind
                        && of == Wire(k)
                    {
                        self.program.slots[n] = start + short(index);
                    }
                }
                Op::Solve { first, out: start }
            }
        };
        ops.push(op);
    }
}
