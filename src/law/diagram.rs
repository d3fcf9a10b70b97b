//! Blocks and wires.
//!
//! A [`Diagram`] lists its blocks in the order in which they are computed: a
//! block reads only blocks before it. What a step must remember goes through a
//! *memory* (one number) or a *delay line* (several); their inputs may come
//! later in the list. A block computes one number, real or logical (0 or 1).

use std::collections::BTreeMap;
use std::ops::Neg;

/// The output of a block: its place in the diagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Wire(pub usize);

/// A product of wires in a sum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Term {
    /// Whether the product is subtracted.
    pub negative: bool,
    /// The factors, at least one.
    pub factors: Vec<Wire>,
}

/// The product of these wires, as a term of a sum.
pub fn term(factors: &[Wire]) -> Term {
    Term { negative: false, factors: factors.to_vec() }
}

impl From<Wire> for Term {
    fn from(wire: Wire) -> Self {
        term(&[wire])
    }
}

impl Neg for Term {
    type Output = Self;
    fn neg(mut self) -> Self {
        self.negative = !self.negative;
        self
    }
}

impl Neg for Wire {
    type Output = Term;
    fn neg(self) -> Term {
        -Term::from(self)
    }
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// Sine of an angle in rad.
    Sine,
    /// Cosine of an angle in rad.
    Cosine,
    /// Arc tangent, rad.
    ArcTangent,
    /// Absolute value.
    Absolute,
}

/// What a block computes.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// A number from outside.
    Input,
    /// A logical input: 0 or 1.
    Switch,
    /// A number that never changes. Without a name it is written as a literal.
    Constant(f64),
    /// An entry of the tables at the speed of the schedule; its place in the
    /// flat order of [`tables`](super::tables).
    Entry(usize),
    /// A sum of products: gain, sum, product and row of a matrix.
    Sum(Vec<Term>),
    /// The first over the second.
    Quotient(Wire, Wire),
    /// A function of a wire.
    Function(Function, Wire),
    /// The larger of two.
    Maximum(Wire, Wire),
    /// A number held between two limits.
    Limit {
        /// The number.
        input: Wire,
        /// The lower limit.
        low: Wire,
        /// The upper limit.
        high: Wire,
    },
    /// Whether the first is larger than the second.
    Above(Wire, Wire),
    /// Whether all hold.
    All(Vec<Wire>),
    /// Whether any holds.
    Any(Vec<Wire>),
    /// Whether it does not hold.
    Not(Wire),
    /// One of two numbers.
    Select {
        /// A logical wire.
        condition: Wire,
        /// The number where it holds.
        yes: Wire,
        /// The number where it does not.
        no: Wire,
    },
    /// A crossfade: `(1 − weight) off + weight on`.
    Blend {
        /// 0 to 1.
        weight: Wire,
        /// The number at weight 0.
        off: Wire,
        /// The number at weight 1.
        on: Wire,
    },
    /// What was stored at the last step, or the start value where the
    /// condition holds. See [`Diagram::store`].
    Memory {
        /// Condition and start value; without them the memory starts at 0.
        restart: Option<(Wire, Wire)>,
    },
    /// What went in `steps` steps ago. Where the condition holds, the whole
    /// line is filled with the start value. See [`Diagram::feed`].
    Delay {
        /// Length, at least 1.
        steps: usize,
        /// Condition and start value.
        restart: (Wire, Wire),
    },
    /// The solution of four linear equations, zero where the matrix is
    /// singular; its numbers are read by [`Kind::Part`]. The block itself has
    /// no number.
    Solve {
        /// By rows.
        matrix: Vec<Wire>,
        /// Right-hand side.
        right: Vec<Wire>,
    },
    /// A number of a solution.
    Part {
        /// The block that solves.
        of: Wire,
        /// Which number.
        index: usize,
    },
}

impl Kind {
    /// Whether the block computes 0 or 1.
    pub fn is_logical(&self) -> bool {
        matches!(self, Self::Switch | Self::Above(..) | Self::All(_) | Self::Any(_) | Self::Not(_))
    }

    /// The wires that the block reads in the same step, in order.
    pub fn reads(&self) -> Vec<Wire> {
        match self {
            Self::Input | Self::Switch | Self::Constant(_) | Self::Entry(_) => Vec::new(),
            Self::Sum(terms) => terms.iter().flat_map(|t| t.factors.iter().copied()).collect(),
            Self::Quotient(a, b) | Self::Maximum(a, b) | Self::Above(a, b) => vec![*a, *b],
            Self::Function(_, x) | Self::Not(x) => vec![*x],
            Self::Limit { input, low, high } => vec![*input, *low, *high],
            Self::All(list) | Self::Any(list) => list.clone(),
            Self::Select { condition, yes, no } => vec![*condition, *yes, *no],
            Self::Blend { weight, off, on } => vec![*weight, *off, *on],
            Self::Memory { restart } => restart.iter().flat_map(|r| [r.0, r.1]).collect(),
            Self::Delay { restart, .. } => vec![restart.0, restart.1],
            Self::Solve { matrix, right } => matrix.iter().chain(right).copied().collect(),
            Self::Part { of, .. } => vec![*of],
        }
    }
}

/// A block.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Name: lower-case letters, digits and underscores; empty for a literal.
    pub name: String,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// What it is, in a few words.
    pub comment: String,
    /// What it computes.
    pub kind: Kind,
    /// Place of its group.
    pub group: usize,
}

/// Blocks that belong together: a section of generated code and a box of the
/// drawn diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Heading.
    pub title: String,
    /// What the blocks do together, in a sentence or two.
    pub text: String,
}

/// What a memory takes at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Store {
    /// The memory.
    pub memory: Wire,
    /// What it takes.
    pub next: Wire,
    /// Its derivative with time where it is an integral, for the limit of a
    /// short step; `None` for a number that is only remembered.
    pub rate: Option<Wire>,
    /// What it takes when the law is engaged, if not its start value.
    pub engaged: Option<Wire>,
}

/// What enters a delay line at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Feed {
    /// The line.
    pub line: Wire,
    /// What enters.
    pub input: Wire,
}

/// A port at an entry of the tables; see [`Diagram::tapped`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tap {
    /// Place of the entry in the flat order of [`tables`](super::tables).
    pub entry: usize,
    /// Name of the input.
    pub input: String,
    /// Name of the signal that the entry multiplies.
    pub signal: String,
}

/// A law as blocks and wires.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Diagram {
    /// Blocks in the order of computation.
    pub blocks: Vec<Block>,
    /// Groups in the order of their first blocks.
    pub groups: Vec<Group>,
    /// Memories.
    pub stores: Vec<Store>,
    /// Delay lines.
    pub feeds: Vec<Feed>,
    /// Speed at which the tables are read.
    pub schedule: Option<Wire>,
    /// Interval between steps, s.
    pub step: Option<Wire>,
    /// What the law answers.
    pub outputs: Vec<Wire>,
    /// What else may be looked at.
    pub monitors: Vec<Wire>,
}

impl Diagram {
    /// Begins a group; blocks that follow belong to it.
    pub fn group(&mut self, title: &str, text: &str) {
        self.groups.push(Group { title: title.into(), text: text.into() });
    }

    /// Adds a block.
    pub fn add(&mut self, name: &str, unit: &'static str, comment: &str, kind: Kind) -> Wire {
        debug_assert!(kind.reads().iter().all(|w| w.0 < self.blocks.len()), "{name} reads ahead");
        debug_assert!(name.is_empty() || self.find(name).is_none(), "{name} stands twice");
        self.blocks.push(Block {
            name: name.into(),
            unit,
            comment: comment.into(),
            kind,
            group: self.groups.len().saturating_sub(1),
        });
        Wire(self.blocks.len() - 1)
    }

    /// A literal; equal ones are one block.
    pub fn number(&mut self, value: f64) -> Wire {
        let same = |b: &Block| b.name.is_empty() && b.kind == Kind::Constant(value);
        match self.blocks.iter().position(same) {
            Some(k) => Wire(k),
            None => self.add("", "1", "", Kind::Constant(value)),
        }
    }

    /// A named constant.
    pub fn constant(&mut self, name: &str, unit: &'static str, comment: &str, v: f64) -> Wire {
        self.add(name, unit, comment, Kind::Constant(v))
    }

    /// An input.
    pub fn input(&mut self, name: &str, unit: &'static str, comment: &str) -> Wire {
        self.add(name, unit, comment, Kind::Input)
    }

    /// A sum of products.
    pub fn sum(&mut self, name: &str, unit: &'static str, comment: &str, terms: &[Term]) -> Wire {
        self.add(name, unit, comment, Kind::Sum(terms.to_vec()))
    }

    /// A quotient.
    pub fn over(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        (a, b): (Wire, Wire),
    ) -> Wire {
        self.add(name, unit, comment, Kind::Quotient(a, b))
    }

    /// A function of a wire.
    pub fn function(&mut self, name: &str, comment: &str, f: Function, x: Wire) -> Wire {
        let unit = if f == Function::ArcTangent { "rad" } else { "1" };
        self.add(name, unit, comment, Kind::Function(f, x))
    }

    /// A number held between two limits.
    pub fn limit(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        input: Wire,
        [low, high]: [Wire; 2],
    ) -> Wire {
        self.add(name, unit, comment, Kind::Limit { input, low, high })
    }

    /// One of two numbers.
    pub fn select(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        condition: Wire,
        [yes, no]: [Wire; 2],
    ) -> Wire {
        self.add(name, unit, comment, Kind::Select { condition, yes, no })
    }

    /// A crossfade.
    pub fn blend(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        weight: Wire,
        [off, on]: [Wire; 2],
    ) -> Wire {
        self.add(name, unit, comment, Kind::Blend { weight, off, on })
    }

    /// A memory. What it takes is said by [`Diagram::store`].
    pub fn memory(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        restart: Option<(Wire, Wire)>,
    ) -> Wire {
        self.add(name, unit, comment, Kind::Memory { restart })
    }

    /// What a memory takes at the end of a step.
    pub fn store(&mut self, memory: Wire, next: Wire, rate: Option<Wire>) {
        self.stores.push(Store { memory, next, rate, engaged: None });
    }

    /// What a memory takes when the law is engaged.
    pub fn engage(&mut self, memory: Wire, value: Wire) {
        for store in self.stores.iter_mut().filter(|s| s.memory == memory) {
            store.engaged = Some(value);
        }
    }

    /// A memory as an integral: gives what it is after this step, `memory +
    /// step · rate`.
    pub fn integrate(&mut self, memory: Wire, name: &str, comment: &str, rate: Wire) -> Wire {
        let unit = self.blocks[memory.0].unit;
        let step = self.time_step();
        let next = self.sum(name, unit, comment, &[memory.into(), term(&[step, rate])]);
        self.store(memory, next, Some(rate));
        next
    }

    /// The interval between steps.
    ///
    /// # Panics
    /// A diagram without one: a mistake of whoever builds it.
    pub fn time_step(&self) -> Wire {
        self.step.unwrap_or(Wire(usize::MAX))
    }

    /// What went in `steps` steps ago; [`Diagram::feed`] says what goes in.
    pub fn delay(
        &mut self,
        name: &str,
        unit: &'static str,
        comment: &str,
        steps: usize,
        restart: (Wire, Wire),
    ) -> Wire {
        self.add(name, unit, comment, Kind::Delay { steps: steps.max(1), restart })
    }

    /// What enters a delay line.
    pub fn feed(&mut self, line: Wire, input: Wire) {
        self.feeds.push(Feed { line, input });
    }

    /// A block by name.
    pub fn find(&self, name: &str) -> Option<Wire> {
        self.blocks.iter().position(|b| b.name == name).map(Wire)
    }

    /// A block.
    pub fn block(&self, wire: Wire) -> &Block {
        &self.blocks[wire.0]
    }

    /// Which blocks are needed for these wires, themselves included: through
    /// blocks, and through memories and delay lines where `through_time` says
    /// so. Entries of tables need the speed of the schedule.
    pub fn needed(&self, wires: &[Wire], through_time: bool) -> Vec<bool> {
        let mut needed = vec![false; self.blocks.len()];
        let mut open: Vec<Wire> = wires.to_vec();
        while let Some(wire) = open.pop() {
            if std::mem::replace(&mut needed[wire.0], true) {
                continue;
            }
            let block = self.block(wire);
            open.extend(block.kind.reads());
            if matches!(block.kind, Kind::Entry(_)) {
                open.extend(self.schedule);
            }
            if through_time {
                open.extend(self.stores.iter().filter(|s| s.memory == wire).map(|s| s.next));
                open.extend(self.feeds.iter().filter(|f| f.line == wire).map(|f| f.input));
            }
        }
        needed
    }

    /// The diagram without blocks that neither outputs nor monitors nor
    /// engaging needs.
    pub fn pruned(&self) -> Self {
        let mut wanted: Vec<Wire> = self.outputs.iter().chain(&self.monitors).copied().collect();
        let mut needed = self.needed(&wanted, true);
        loop {
            // What engaging sets counts only where the memory itself counts.
            let engaged = |s: &&Store| needed[s.memory.0];
            let more: Vec<Wire> =
                self.stores.iter().filter(engaged).filter_map(|s| s.engaged).collect();
            let before = wanted.len();
            wanted.extend(more.into_iter().filter(|w| !needed[w.0]));
            if wanted.len() == before {
                break;
            }
            needed = self.needed(&wanted, true);
        }
        // Inputs stay: they are the law's interface.
        for (flag, block) in needed.iter_mut().zip(&self.blocks) {
            *flag |= matches!(block.kind, Kind::Input | Kind::Switch);
        }
        if let Some(step) = self.step {
            needed[step.0] = true;
        }
        self.keep(&needed)
    }

    /// What flows from group to group: places of both, and the names of the
    /// blocks whose numbers do, each once, in the order of the diagram. What
    /// goes through a memory or a delay line flows from where it is set.
    /// Constants, tables and inputs are left out.
    pub fn flow(&self) -> Vec<(usize, usize, Vec<&str>)> {
        let mut found: BTreeMap<(usize, usize), Vec<&str>> = BTreeMap::new();
        let mut join = |from: Wire, to: Wire| {
            let (a, b) = (self.block(from), self.block(to));
            let apart =
                !matches!(a.kind, Kind::Constant(_) | Kind::Entry(_) | Kind::Input | Kind::Switch);
            if apart && a.group != b.group {
                let names = found.entry((a.group, b.group)).or_default();
                if !names.contains(&a.name.as_str()) {
                    names.push(&a.name);
                }
            }
        };
        for (k, block) in self.blocks.iter().enumerate() {
            for from in block.kind.reads() {
                join(from, Wire(k));
            }
        }
        for store in &self.stores {
            join(store.next, store.memory);
        }
        for feed in &self.feeds {
            join(feed.input, feed.line);
        }
        found.into_iter().map(|((from, to), names)| (from, to, names)).collect()
    }

    /// The part that computes the named blocks: they are its outputs, and its
    /// inputs are those that they need. For parts without memory.
    pub fn only(&self, outputs: &[&str]) -> Self {
        let outputs: Vec<Wire> = outputs.iter().filter_map(|name| self.find(name)).collect();
        let mut needed = self.needed(&outputs, true);
        if let Some(step) = self.step {
            needed[step.0] = true;
        }
        Self { outputs, monitors: Vec::new(), ..self.clone() }.keep(&needed)
    }

    /// The diagram with ports at entries of the tables: for each, an input that
    /// is added where the entry's product stands, and the signal that the entry
    /// multiplies, among the monitors. Entries without a product of that form
    /// get none.
    ///
    /// With the entries at zero and each input set to the entry times its
    /// signal, the diagram is the one that it was: so the derivative of whatever
    /// it computes by an entry is the answer to the input times the signal.
    pub fn tapped(&self, entries: &[usize]) -> (Self, Vec<Tap>) {
        // Places of sums and of their terms, and what the entry multiplies.
        let found: Vec<(usize, usize, usize, Wire)> = entries
            .iter()
            .filter_map(|&entry| {
                let is_entry = |w: &Wire| self.block(*w).kind == Kind::Entry(entry);
                self.blocks.iter().enumerate().find_map(|(k, b)| {
                    let Kind::Sum(terms) = &b.kind else { return None };
                    terms.iter().enumerate().find_map(|(t, term)| match term.factors[..] {
                        [a, b] if is_entry(&a) => Some((entry, k, t, b)),
                        [a, b] if is_entry(&b) => Some((entry, k, t, a)),
                        _ => None,
                    })
                })
            })
            .collect();
        // New inputs follow those that there are.
        let is_input = |b: &Block| matches!(b.kind, Kind::Input | Kind::Switch);
        let at = self.blocks.iter().rposition(is_input).map_or(0, |k| k + 1);
        let place: Vec<Wire> = (0..self.blocks.len())
            .map(|k| Wire(if k < at { k } else { k + found.len() }))
            .collect();
        let mut out = self.clone();
        for block in &mut out.blocks {
            rename(&mut block.kind, &place);
        }
        let mut taps = Vec::with_capacity(found.len());
        let mut inputs = Vec::with_capacity(found.len());
        for (n, (entry, sum, term, signal)) in found.into_iter().enumerate() {
            let name = super::tables::entry(entry).map_or_else(
                || format!("tap_{entry}"),
                |(form, i, j)| {
                    format!("tap_{}_{}_{}", form.name, form.rows[i].0, form.columns[j].0)
                },
            );
            let unit = out.blocks[sum].unit;
            if let Kind::Sum(terms) = &mut out.blocks[sum].kind {
                let negative = terms[term].negative;
                terms.push(Term { negative, factors: vec![Wire(at + n)] });
            }
            inputs.push(Block {
                name: name.clone(),
                unit,
                comment: "added where the entry's product stands".into(),
                kind: Kind::Input,
                group: 0,
            });
            taps.push(Tap { entry, input: name, signal: self.block(signal).name.clone() });
            out.monitors.push(signal);
        }
        out.blocks.splice(at..at, inputs);
        let to = |w: Wire| place[w.0];
        for store in &mut out.stores {
            (store.memory, store.next) = (to(store.memory), to(store.next));
            (store.rate, store.engaged) = (store.rate.map(to), store.engaged.map(to));
        }
        for feed in &mut out.feeds {
            (feed.line, feed.input) = (to(feed.line), to(feed.input));
        }
        (out.schedule, out.step) = (out.schedule.map(to), out.step.map(to));
        for list in [&mut out.outputs, &mut out.monitors] {
            list.iter_mut().for_each(|w| *w = to(*w));
        }
        (out, taps)
    }

    fn keep(&self, needed: &[bool]) -> Self {
        let mut place = vec![Wire(usize::MAX); self.blocks.len()];
        let mut out = Self { groups: self.groups.clone(), ..Self::default() };
        for (k, block) in self.blocks.iter().enumerate().filter(|(k, _)| needed[*k]) {
            place[k] = Wire(out.blocks.len());
            let mut block = block.clone();
            rename(&mut block.kind, &place);
            out.blocks.push(block);
        }
        let to = |w: Wire| place[w.0];
        out.stores = self
            .stores
            .iter()
            .filter(|s| needed[s.memory.0])
            .map(|s| Store {
                memory: to(s.memory),
                next: to(s.next),
                rate: s.rate.filter(|r| needed[r.0]).map(to),
                engaged: s.engaged.map(to),
            })
            .collect();
        out.feeds = self
            .feeds
            .iter()
            .filter(|f| needed[f.line.0])
            .map(|f| Feed { line: to(f.line), input: to(f.input) })
            .collect();
        out.schedule = self.schedule.filter(|w| needed[w.0]).map(to);
        out.step = self.step.map(to);
        out.outputs = self.outputs.iter().map(|w| to(*w)).collect();
        out.monitors = self.monitors.iter().map(|w| to(*w)).collect();
        out
    }

    /// Which blocks only engaging needs.
    pub fn only_engaging(&self) -> Vec<bool> {
        let mut wanted: Vec<Wire> = self.outputs.iter().chain(&self.monitors).copied().collect();
        wanted.extend(self.stores.iter().flat_map(|s| [Some(s.next), s.rate]).flatten());
        wanted.extend(self.stores.iter().map(|s| s.memory));
        wanted.extend(self.feeds.iter().flat_map(|f| [f.line, f.input]));
        let steps = self.needed(&wanted, true);
        self.blocks
            .iter()
            .zip(steps)
            .map(|(b, needed)| !needed && !matches!(b.kind, Kind::Input | Kind::Switch))
            .collect()
    }
}

fn rename(kind: &mut Kind, place: &[Wire]) {
    let to = |w: &mut Wire| *w = place[w.0];
    match kind {
        Kind::Input | Kind::Switch | Kind::Constant(_) | Kind::Entry(_) => {}
        Kind::Sum(terms) => terms.iter_mut().flat_map(|t| &mut t.factors).for_each(to),
        Kind::Quotient(a, b) | Kind::Maximum(a, b) | Kind::Above(a, b) => {
            [a, b].into_iter().for_each(to);
        }
        Kind::Function(_, x) | Kind::Not(x) => to(x),
        Kind::Limit { input, low, high } => [input, low, high].into_iter().for_each(to),
        Kind::All(list) | Kind::Any(list) => list.iter_mut().for_each(to),
        Kind::Select { condition, yes, no } => [condition, yes, no].into_iter().for_each(to),
        Kind::Blend { weight, off, on } => [weight, off, on].into_iter().for_each(to),
        Kind::Memory { restart } => {
            restart.iter_mut().flat_map(|r| [&mut r.0, &mut r.1]).for_each(to);
        }
        Kind::Delay { restart, .. } => [&mut restart.0, &mut restart.1].into_iter().for_each(to),
        Kind::Solve { matrix, right } => matrix.iter_mut().chain(right).for_each(to),
        Kind::Part { of, .. } => to(of),
    }
}

// --- Parts that laws are made of ---------------------------------------------

/// When a part starts anew, and where.
#[derive(Debug, Clone, Copy)]
pub struct Restart {
    /// Logical: whether it starts in this step.
    pub when: Wire,
    /// Value that it starts at.
    pub at: Wire,
}

/// A command model after a step.
#[derive(Debug, Clone, Copy)]
pub struct Model {
    /// What it was before the step.
    pub last: Wire,
    /// Its value.
    pub value: Wire,
    /// Its derivative.
    pub rate: Wire,
    /// Its second derivative; that of a first-order model is its rate.
    pub acceleration: Wire,
}

/// Names and unit of a command model.
#[derive(Debug, Clone, Copy)]
pub struct Label<'a> {
    /// Prefix of the blocks' names.
    pub name: &'a str,
    /// What is modelled.
    pub of: &'a str,
    /// Units of value, rate and acceleration.
    pub units: [&'static str; 3],
}

impl Diagram {
    /// A second-order command model, `x'' = ω² (command − x) − 2 ζ ω x'`,
    /// stepped by its new rate. Where `running` is given and does not hold, it
    /// stands still.
    pub fn second_order(
        &mut self,
        label: Label,
        command: Wire,
        [frequency, damping]: [Wire; 2],
        restart: Restart,
        running: Option<Wire>,
    ) -> Model {
        let Label { name, of, units } = label;
        let (zero, two) = (self.number(0.0), self.number(2.0));
        let last = self.memory(
            &format!("last_{name}_ref"),
            units[0],
            &format!("reference of {of} at the last step"),
            Some((restart.when, restart.at)),
        );
        let last_rate = self.memory(
            &format!("last_{name}_ref_rate"),
            units[1],
            &format!("rate of the reference of {of} at the last step"),
            Some((restart.when, zero)),
        );
        let away = self.sum(
            &format!("{name}_ref_away"),
            units[0],
            &format!("command less reference of {of}"),
            &[command.into(), -last],
        );
        let mut acceleration = self.sum(
            &format!("{name}_ref_acceleration"),
            units[2],
            "second-order command model",
            &[term(&[frequency, frequency, away]), -term(&[two, damping, frequency, last_rate])],
        );
        if let Some(running) = running {
            acceleration = self.select(
                &format!("{name}_ref_running"),
                units[2],
                "the model stands still in the other mode",
                running,
                [acceleration, zero],
            );
        }
        let rate = self.integrate(
            last_rate,
            &format!("{name}_ref_rate"),
            &format!("rate of the reference of {of}"),
            acceleration,
        );
        let moving = match running {
            Some(running) => self.select(
                &format!("{name}_ref_moving"),
                units[1],
                "the model stands still in the other mode",
                running,
                [rate, zero],
            ),
            None => rate,
        };
        let value =
            self.integrate(last, &format!("{name}_ref"), &format!("reference of {of}"), moving);
        Model { last, value, rate, acceleration }
    }

    /// A first-order command model, `x' = (command − x)/T`.
    pub fn first_order(
        &mut self,
        label: Label,
        command: Wire,
        time_constant: Wire,
        restart: Restart,
    ) -> Model {
        let Label { name, of, units } = label;
        let last = self.memory(
            &format!("last_{name}_ref"),
            units[0],
            &format!("reference of {of} at the last step"),
            Some((restart.when, restart.at)),
        );
        let away = self.sum(
            &format!("{name}_ref_away"),
            units[0],
            &format!("command less reference of {of}"),
            &[command.into(), -last],
        );
        let rate = self.over(
            &format!("{name}_ref_rate"),
            units[1],
            "first-order command model",
            (away, time_constant),
        );
        let value =
            self.integrate(last, &format!("{name}_ref"), &format!("reference of {of}"), rate);
        Model { last, value, rate, acceleration: rate }
    }

    /// A notch filter, `(s² + 2 ζ d ω s + ω²)/(s² + 2 ζ ω s + ω²)`: what is
    /// near ω passes with the factor d, slow and fast signals pass unchanged.
    /// It starts at rest on its input.
    pub fn notch(
        &mut self,
        label: Label,
        input: Wire,
        [frequency, damping, depth]: [Wire; 3],
        when: Wire,
    ) -> Notch {
        let Label { name, of, units } = label;
        let (zero, one, two) = (self.number(0.0), self.number(1.0), self.number(2.0));
        let follower = self.memory(
            &format!("{name}_notch_follower"),
            units[0],
            &format!("second-order lag of {of}"),
            Some((when, input)),
        );
        let rate =
            self.memory(&format!("{name}_notch_rate"), units[1], "its rate", Some((when, zero)));
        let away = self.sum(
            &format!("{name}_notch_away"),
            units[0],
            "input less its lag",
            &[input.into(), -follower],
        );
        let acceleration = self.sum(
            &format!("{name}_notch_acceleration"),
            units[2],
            "second-order lag",
            &[term(&[frequency, frequency, away]), -term(&[two, damping, frequency, rate])],
        );
        let moved = self.integrate(
            rate,
            &format!("{name}_notch_rate_now"),
            "rate of the lag after this step",
            acceleration,
        );
        self.integrate(
            follower,
            &format!("{name}_notch_follower_now"),
            "the lag after this step",
            moved,
        );
        let band = self.over(
            &format!("{name}_notch_band"),
            units[0],
            "the lag's rate over its frequency",
            (rate, frequency),
        );
        let blocked = self.sum(
            &format!("{name}_notch_blocked"),
            "1",
            "share that the notch takes out",
            &[one.into(), -depth],
        );
        let output = self.sum(
            &format!("{name}_notched"),
            units[0],
            &format!("{of} without what is near the notch"),
            &[input.into(), -term(&[two, damping, blocked, band])],
        );
        Notch { output, follower }
    }
}

/// A notch filter after a step.
#[derive(Debug, Clone, Copy)]
pub struct Notch {
    /// What passes.
    pub output: Wire,
    /// The memory that follows the input; at rest it is the input.
    pub follower: Wire,
}
