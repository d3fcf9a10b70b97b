//! Which of several solutions is *the* trim of a condition.
//!
//! A condition can have several periodic orbits, or none. The trim is the one
//! that continues level flight: from hover to level flight at the horizontal
//! speed, from there to the rate of climb, then to the rate of turn, and last
//! to the sideslip or bank. Flight in another direction than the nose's goes
//! from hover straight to its speed. Each leg is a straight line in the
//! condition, and the way along it is a function of its ends alone. So the trim of a condition
//! does not depend on what else was asked for, in which order, or by how many
//! threads.
//!
//! The way is walked with a coarse step of integration, which is enough to stay
//! on the branch. Each step starts from Newton's step for the next condition;
//! one that ends far from there may have changed the branch, and is taken again
//! in halves. Where even short steps fail, the branch folds: it is followed
//! round the fold by its arc length, until it reaches the end of the leg after
//! all, or comes back to where the leg began.
//!
//! Level flight is kept at a few speeds, even parts of the tip speed apart, and
//! every level condition starts from the nearest one on the side of hover.

use crate::numerics::least_squares::{Residuals, Solution};
use crate::trim::condition::{FlightCondition, Lateral};
use crate::trim::shooting::{Flown, Shooting};
use crate::trim::solve::{
    Branch, COARSE_TOLERANCE, Guess, Options, Start, Status, TrimPoint, bounds, coarse_steps,
    newton, refine, solve, trim, whole_period,
};
use crate::vehicle::{Layout, Vehicle};
use nalgebra::{DMatrix, DVector};

/// Level flight is kept this part of the fastest tip speed apart: some 5 m/s.
const SPEED_SPACING: f64 = 1.0 / 32.0;
/// Speeds that are tried where hover itself does not trim.
const ROOTS: usize = 9;
/// Longest step in turn rate, rad/s.
const TURN_STEP: f64 = 0.2;
/// Longest step in sideslip or bank, rad.
const LATERAL_STEP: f64 = 0.2;
/// Smallest part of the longest step.
const SMALLEST_PART: f64 = 1.0 / 64.0;
/// How far a solution may lie from where Newton's first step put it, in scales
/// of the unknowns: the branches of the CoAX 2D lie some 20 apart, and its
/// usual steps end within 2.
const LARGEST_SURPRISE: f64 = 6.0;
/// Most steps along the arc of a fold.
const ARC_STEPS: usize = 120;
/// First, least and largest length of such a step, scales of the unknowns.
const ARC: [f64; 3] = [0.5, 2e-3, 4.0];
/// Most corrections of one step along the arc.
const ARC_CORRECTIONS: usize = 6;
/// Least cosine between the directions at both ends of a step along the arc.
const ARC_COSINE: f64 = 0.8;
/// Tolerance of a point along the arc, norm of the scaled residuals.
const ARC_TOLERANCE: f64 = 1e-6;

/// A coarse solution on the way.
#[derive(Debug, Clone)]
struct Node {
    condition: FlightCondition,
    solution: Solution,
    flown: Flown,
    folds: usize,
}

/// Where and how a way ended short of its condition.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Break {
    /// Neither hover nor level flight at a few speeds trims.
    NoLevelFlight,
    /// The branch turns back here.
    Fold(FlightCondition),
    /// No step leads on from here.
    End(FlightCondition),
}

impl Break {
    /// The end of the way in words.
    fn reason(&self) -> &'static str {
        match self {
            Self::NoLevelFlight => "no level flight trims from which the condition can be reached",
            Self::Fold(_) => {
                "no solution exists nearby: the trims that continue level flight fold back before \
                 this condition"
            }
            Self::End(_) => {
                "no solution was found nearby: the trims that continue level flight could not be \
                 followed to this condition"
            }
        }
    }

    /// The last condition on the way.
    fn last(&self) -> Option<FlightCondition> {
        match self {
            Self::NoLevelFlight => None,
            Self::Fold(last) | Self::End(last) => Some(*last),
        }
    }
}

/// Level flight of a vehicle, from hover as far as it was asked for.
#[derive(Debug)]
pub(super) struct LevelFlight<'a> {
    vehicle: &'a Vehicle,
    options: &'a Options,
    /// The same with the steps of a whole period.
    whole: Options,
    /// Speed between two nodes, m/s.
    spacing: f64,
    /// Index of the first node: 0 in hover.
    root: usize,
    /// From the root to faster flight.
    faster: Vec<Node>,
    /// From the root to slower flight, without the root.
    slower: Vec<Node>,
    /// What ended either.
    ends: [Option<Break>; 2],
}

impl<'a> LevelFlight<'a> {
    /// Level flight as far as these conditions need it.
    pub fn new(vehicle: &'a Vehicle, conditions: &[FlightCondition], options: &'a Options) -> Self {
        let tip_speed = vehicle.rotors.iter().map(|rotor| rotor.tip_speed()).fold(0.0, f64::max);
        let spacing = SPEED_SPACING * tip_speed;
        let mut level = Self {
            vehicle,
            options,
            whole: whole_period(vehicle, options),
            spacing,
            root: 0,
            faster: Vec::new(),
            slower: Vec::new(),
            ends: [None, None],
        };
        let root = (0..ROOTS).find_map(|index| Some((index, level.estimated(index)?)));
        let Some((root, first)) = root else {
            level.ends = [Some(Break::NoLevelFlight), Some(Break::NoLevelFlight)];
            return level;
        };
        level.root = root;
        level.faster.push(first);
        let places = conditions.iter().map(|condition| level.place(condition));
        let (slowest, fastest) =
            places.fold((root, root), |(low, high), place| (low.min(place), high.max(place)));
        for index in root + 1..=fastest {
            let from = &level.faster[index - 1 - root];
            match level.walk(from, level.node_condition(index)) {
                Ok(node) => level.faster.push(node),
                Err(end) => {
                    level.ends[1] = Some(end);
                    break;
                }
            }
        }
        for index in (slowest..root).rev() {
            let from = level.slower.last().unwrap_or(&level.faster[0]);
            match level.walk(from, level.node_condition(index)) {
                Ok(node) => level.slower.push(node),
                Err(end) => {
                    level.ends[0] = Some(end);
                    break;
                }
            }
        }
        level
    }

    /// Index of the node that a condition starts from: the nearest one on the
    /// side of the root.
    fn place(&self, condition: &FlightCondition) -> usize {
        if let Lateral::WindAzimuth(_) = condition.lateral {
            // From hover, or from as near to it as level flight trims.
            return self.root;
        }
        let place = condition.horizontal_speed() / self.spacing;
        if place < self.root as f64 { place.ceil() as usize } else { place.floor() as usize }
    }

    fn node_condition(&self, index: usize) -> FlightCondition {
        FlightCondition::level(index as f64 * self.spacing)
    }

    fn shooting(&self, condition: FlightCondition) -> Shooting<'a> {
        Shooting::new(self.vehicle, condition, self.options.method, coarse_steps(self.vehicle))
    }

    /// A coarse solution from the estimate.
    fn estimated(&self, index: usize) -> Option<Node> {
        let condition = self.node_condition(index);
        let shooting = self.shooting(condition);
        let guess = Guess::estimate(self.vehicle, &condition);
        let x = shooting.pack(&guess.state, &guess.sticks);
        let limited = bounds(self.vehicle, &shooting);
        let free = self.free_bounds(&shooting);
        [limited, free]
            .into_iter()
            .find_map(|bounds| self.solved(&shooting, &x, None, bounds))
            .map(|(solution, flown)| Node { condition, solution, flown, folds: 0 })
    }

    /// Bounds without the limits of the sticks: a way may lead beyond them.
    fn free_bounds(&self, shooting: &Shooting<'_>) -> Vec<[f64; 2]> {
        let mut free = bounds(self.vehicle, shooting);
        let count = free.len();
        for stick in &mut free[count - 4..] {
            *stick = [f64::NEG_INFINITY, f64::INFINITY];
        }
        free
    }

    fn solved(
        &self,
        shooting: &Shooting<'_>,
        x: &DVector<f64>,
        jacobian: Option<&DMatrix<f64>>,
        bounds: Vec<[f64; 2]>,
    ) -> Option<(Solution, Flown)> {
        let tolerance = self.options.residual_tolerance.max(COARSE_TOLERANCE);
        let mut solution = solve(shooting, x, jacobian, bounds, tolerance, self.options).ok()?;
        if !solution.converged() {
            return None;
        }
        if solution.jacobian.is_none() {
            solution.jacobian = Some(shooting.jacobian(&solution.x).ok()?);
        }
        let flown = shooting.flown(&solution.x);
        Some((solution, flown))
    }

    /// The trim of a condition.
    pub fn trim(&self, condition: FlightCondition) -> TrimPoint {
        match self.reach(condition) {
            Ok(node) => {
                let shooting = self.shooting(node.condition);
                shooting.keep(node.flown);
                let start = Start::from_coarse(&shooting, &node.solution, &self.whole);
                let mut point = refine(self.vehicle, condition, start, &self.whole);
                point.branch = match node.folds {
                    0 => Branch::LevelFlight,
                    folds => Branch::Folded { folds },
                };
                point
            }
            Err(end) => self.apart(condition, &end),
        }
    }

    /// Where no way leads to a condition: a solution from the estimate, or the
    /// failure with the end of the way.
    fn apart(&self, condition: FlightCondition, end: &Break) -> TrimPoint {
        tracing::debug!(condition = condition.in_words(), ?end, "trim: the way ends");
        let guess = Guess::estimate(self.vehicle, &condition);
        let mut point = trim(self.vehicle, condition, &guess, self.options);
        point.branch = Branch::Separate { last: end.last() };
        if let Status::Failed { reason, .. } = &mut point.status {
            *reason = format!("{}; from an estimate: {reason}", end.reason());
            point.branch = Branch::Ended { last: end.last() };
        }
        point
    }

    /// The coarse solution of a condition at the end of its way.
    fn reach(&self, condition: FlightCondition) -> Result<Node, Break> {
        let speed = condition.horizontal_speed();
        let index = self.place(&condition);
        let [slow_end, fast_end] = &self.ends;
        let (nodes, at, end) = if index >= self.root {
            (&self.faster, index - self.root, fast_end)
        } else {
            (&self.slower, self.root - 1 - index, slow_end)
        };
        let missing = || end.clone().unwrap_or(Break::NoLevelFlight);
        let mut node = nodes.get(at).ok_or_else(missing)?.clone();
        node.solution.history.clear();
        node.solution.iterations = 0;
        let here = |node: &Node, climb_rate: f64, turn_rate: f64| FlightCondition {
            turn_rate,
            lateral: node.condition.lateral,
            ..FlightCondition::climbing(speed, climb_rate)
        };
        if let Lateral::WindAzimuth(azimuth) = condition.lateral {
            if node.condition.horizontal_speed() > 0.0 && azimuth != 0.0 {
                return Err(Break::End(node.condition));
            }
            // The same hover, told by the direction that it is left in.
            node.condition.lateral = condition.lateral;
        }
        node = self.walk(&node, here(&node, 0.0, 0.0))?;
        node = self.walk(&node, here(&node, condition.climb_rate, 0.0))?;
        node = self.walk(&node, here(&node, condition.climb_rate, condition.turn_rate))?;
        if let Lateral::Bank(_) = condition.lateral {
            // The same flight, told by its bank.
            let bank = node.flown.period.mean[Layout::BODY.roll];
            node.condition.lateral = Lateral::Bank(bank);
        }
        self.walk(&node, condition)
    }

    /// Follows the branch from a solution along one leg.
    fn walk(&self, from: &Node, goal: FlightCondition) -> Result<Node, Break> {
        if from.condition == goal {
            return Ok(from.clone());
        }
        let leg = Leg { from: from.condition, goal, longest: self.longest(from.condition, goal) };
        let mut here = from.clone();
        let (mut done, mut part) = (0.0, leg.longest);
        while done < 1.0 {
            let t = f64::min(done + part, 1.0);
            if let Some(node) = self.step(&here, leg.at(t)) {
                here = node;
                done = t;
                part = (2.0 * part).min(leg.longest);
            } else {
                part *= 0.5;
                tracing::debug!(done, part, "trim: a smaller part of the way");
                if part < SMALLEST_PART * leg.longest {
                    return self.around(&here, done, &leg);
                }
            }
        }
        Ok(here)
    }

    /// Longest step along a leg, as a part of it.
    fn longest(&self, from: FlightCondition, goal: FlightCondition) -> f64 {
        let angle = |lateral: Lateral| match lateral {
            Lateral::Sideslip(angle) | Lateral::Bank(angle) | Lateral::WindAzimuth(angle) => angle,
        };
        let lengths = [
            (goal.horizontal_speed() - from.horizontal_speed()) / self.spacing,
            (goal.climb_rate - from.climb_rate) / self.spacing,
            (goal.turn_rate - from.turn_rate) / TURN_STEP,
            (angle(goal.lateral) - angle(from.lateral)) / LATERAL_STEP,
        ];
        let longest = lengths.iter().fold(0.0_f64, |most, length| most.max(length.abs()));
        1.0 / longest.max(1.0)
    }

    /// One step of the way; `None` where it fails or may have left the branch.
    fn step(&self, here: &Node, condition: FlightCondition) -> Option<Node> {
        let shooting = self.shooting(condition);
        let (start, _) = shooting.unpack(&here.solution.x);
        let residuals = shooting.residuals_of(&start, &here.flown.period);
        let jacobian = here.solution.jacobian.as_ref()?;
        let x = &here.solution.x + newton(jacobian, &residuals)?;
        let (mut solution, flown) =
            self.solved(&shooting, &x, Some(jacobian), self.free_bounds(&shooting))?;
        let surprise = (&solution.x - &x).amax();
        tracing::trace!(to = condition.in_words(), surprise, "trim: a step of the way");
        if surprise > LARGEST_SURPRISE {
            return None;
        }
        solution.iterations += here.solution.iterations;
        let mut history = here.solution.history.clone();
        history.append(&mut solution.history);
        solution.history = history;
        Some(Node { condition, solution, flown, folds: here.folds })
    }

    /// Follows the branch by its arc length from a solution near a fold until
    /// it reaches the end of the leg.
    fn around(&self, here: &Node, done: f64, leg: &Leg) -> Result<Node, Break> {
        let mut arc = Arc::new(self.shooting(here.condition), leg, here, done)
            .ok_or(Break::End(here.condition))?;
        let mut folds = here.folds;
        // The farthest that the branch came before it turned back.
        let (mut farthest, mut turned) = (done, false);
        for _ in 0..ARC_STEPS {
            let before = (arc.x.clone(), arc.place, arc.tangent[arc.x.len()]);
            if !arc.advance() {
                break;
            }
            if arc.place > farthest {
                farthest = arc.place;
            }
            if before.2 * arc.tangent[arc.x.len()] < 0.0 {
                folds += 1;
                turned = true;
            }
            if arc.place >= 1.0 {
                let part = (1.0 - before.1) / (arc.place - before.1);
                let x = &before.0 + (&arc.x - &before.0) * part;
                let shooting = self.shooting(leg.goal);
                let jacobian = arc.jacobian.as_ref();
                let reach = (&arc.x - &before.0).amax().max(1.0);
                let bounds = self.free_bounds(&shooting);
                if let Some((solution, flown)) = self.solved(&shooting, &x, jacobian, bounds)
                    && (&solution.x - &x).amax() < reach
                {
                    return Ok(Node { condition: leg.goal, solution, flown, folds });
                }
                break;
            }
            if arc.place < 0.0 {
                break;
            }
        }
        let last = leg.at(farthest);
        Err(if turned { Break::Fold(last) } else { Break::End(last) })
    }
}

/// A straight line in the condition.
#[derive(Debug, Clone, Copy)]
struct Leg {
    from: FlightCondition,
    goal: FlightCondition,
    /// Longest step, as a part of the leg.
    longest: f64,
}

impl Leg {
    /// The condition at a part of the way; the goal itself at 1.
    fn at(&self, t: f64) -> FlightCondition {
        let (a, b) = (&self.from, &self.goal);
        if t == 1.0 {
            return *b;
        }
        let mix = |a: f64, b: f64| if a == b { a } else { a + t * (b - a) };
        let lateral = match (a.lateral, b.lateral) {
            (Lateral::Sideslip(from), Lateral::Sideslip(to)) => Lateral::Sideslip(mix(from, to)),
            (Lateral::Bank(from), Lateral::Bank(to)) => Lateral::Bank(mix(from, to)),
            (_, lateral) => lateral,
        };
        let speed = mix(a.horizontal_speed(), b.horizontal_speed()).max(0.0);
        FlightCondition {
            turn_rate: mix(a.turn_rate, b.turn_rate),
            lateral,
            ..FlightCondition::climbing(speed, mix(a.climb_rate, b.climb_rate))
        }
    }
}

/// A branch as a curve in the unknowns and the place along a leg.
struct Arc<'a> {
    shooting: Shooting<'a>,
    leg: Leg,
    x: DVector<f64>,
    /// Part of the leg.
    place: f64,
    /// Direction of the curve; the last component is in longest steps of the
    /// leg.
    tangent: DVector<f64>,
    length: f64,
    jacobian: Option<DMatrix<f64>>,
}

impl<'a> Arc<'a> {
    /// The curve at a solution, towards the goal.
    fn new(shooting: Shooting<'a>, leg: &Leg, node: &Node, place: f64) -> Option<Self> {
        let x = node.solution.x.clone();
        let mut onwards = DVector::zeros(x.len() + 1);
        onwards[x.len()] = 1.0;
        let length = ARC[0];
        let mut arc =
            Self { shooting, leg: *leg, x, place, tangent: onwards, length, jacobian: None };
        let (_, matrix) = arc.system(&arc.x.clone(), place, &arc.tangent.clone())?;
        arc.tangent = direction(&matrix)?;
        Some(arc)
    }

    /// Residuals, and the matrix of their derivatives with the unknowns and
    /// the place over the row of a direction.
    fn system(
        &self,
        x: &DVector<f64>,
        place: f64,
        along: &DVector<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        /// Difference in the place: conditions enter smoothly.
        const DIFFERENCE: f64 = 1e-5;
        let n = x.len();
        let shooting = self.shooting.towards(self.leg.at(place));
        let residuals = shooting.evaluate(x).ok()?;
        let flown = shooting.flown(x);
        let (start, _) = shooting.unpack(x);
        let step = DIFFERENCE * self.leg.longest;
        let nearby = |by: f64| {
            let there = shooting.towards(self.leg.at(place + by));
            there.residuals_of(&start, &flown.period)
        };
        let by_place = (nearby(step) - nearby(-step)) / (2.0 * DIFFERENCE);
        let mut matrix = DMatrix::zeros(n + 1, n + 1);
        matrix.view_mut((0, 0), (n, n)).copy_from(&shooting.jacobian(x).ok()?);
        matrix.view_mut((0, n), (n, 1)).copy_from(&by_place);
        matrix.row_mut(n).copy_from(&along.transpose());
        let finite = residuals.iter().chain(matrix.iter()).all(|value| value.is_finite());
        finite.then_some((residuals, matrix))
    }

    /// One step along the curve, as long as it can be; `false` where none can.
    fn advance(&mut self) -> bool {
        while self.length >= ARC[1] {
            if let Some((x, place, tangent, jacobian, corrections)) = self.tried() {
                self.x = x;
                self.place = place;
                self.tangent = tangent;
                self.jacobian = Some(jacobian);
                if corrections <= 2 {
                    self.length = (1.5 * self.length).min(ARC[2]);
                }
                return true;
            }
            self.length *= 0.5;
        }
        false
    }

    #[allow(clippy::type_complexity)]
    fn tried(&self) -> Option<(DVector<f64>, f64, DVector<f64>, DMatrix<f64>, usize)> {
        let n = self.x.len();
        let longest = self.leg.longest;
        let mut x = &self.x + self.tangent.rows(0, n) * self.length;
        let mut place = self.place + self.tangent[n] * self.length * longest;
        for corrections in 0..ARC_CORRECTIONS {
            let (residuals, matrix) = self.system(&x, place, &self.tangent)?;
            if residuals.norm() < ARC_TOLERANCE {
                let tangent = direction(&matrix)?;
                let straight = tangent.dot(&self.tangent) > ARC_COSINE;
                let jacobian = matrix.view((0, 0), (n, n)).into_owned();
                return straight.then_some((x, place, tangent, jacobian, corrections));
            }
            let mut right = DVector::zeros(n + 1);
            right.rows_mut(0, n).copy_from(&-residuals);
            let shift = matrix.lu().solve(&right)?;
            if !shift.iter().all(|value| value.is_finite()) || shift.amax() > LARGEST_SURPRISE {
                return None;
            }
            x += shift.rows(0, n);
            place += shift[n] * longest;
        }
        None
    }
}

/// Unit direction of a curve whose derivatives stand over the row of a former
/// direction, on the same side.
fn direction(matrix: &DMatrix<f64>) -> Option<DVector<f64>> {
    let n = matrix.nrows();
    let mut right = DVector::zeros(n);
    right[n - 1] = 1.0;
    let tangent = matrix.clone().lu().solve(&right)?;
    let norm = tangent.norm();
    (norm.is_finite() && norm > 0.0).then(|| tangent / norm)
}
