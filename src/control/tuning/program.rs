//! The conic program of a channel about its gains, its solution by a growing
//! set of rows, and the sequence of programs.

use super::super::axis::GainSet;
use super::super::kite::magnitude;
use super::TuningError;
use super::channel::{ChannelProblem, Merit};
use super::rows::{Cone, HalfSpace, Region, SiteRows};
use super::targets::{KINDS, Price, Requirement, Target};
use crate::numerics::conic::{AffineRow, Program, Solution};
use num_complex::Complex64 as C;
use rayon::prelude::*;
use std::time::Instant;

/// Trust region at most and at least, in scaled gains.
const TRUST: [f64; 2] = [0.6, 1e-3];
/// A step smaller than this in scaled gains ends the sequence.
const STEP_TOLERANCE: f64 = 3e-3;
/// So does a relative fall of the merit below this.
const MERIT_TOLERANCE: f64 = 2e-5;
/// Trust region of the program whose duals are the prices, in scaled gains:
/// small against a step that matters, wide against the answer's accuracy.
const PRICE_REGION: f64 = 0.05;

/// A slack above this in the program of the prices is a miss, which has no price.
const SLACK: f64 = 1e-3;
/// Stick activity below this, % per unit of noise, is none: no share of it is a
/// price.
const LEAST_ACTIVITY: f64 = 1e-3;

/// Rows with an ease below this are in the first round of a program.
const FIRST_ROWS: f64 = 0.25;
/// Rounds at most; the last has all rows.
const MAX_ROUNDS: usize = 5;
/// Violation of a row that brings it into the next round, in units of the row:
/// far below what the dense verification resolves.
const ROW_TOLERANCE: f64 = 1e-6;

/// A program in parts: objective, bounds and slacks, and the rows of the
/// sites, of which few bind.
struct Step {
    base: Program,
    half_spaces: Vec<HalfSpace>,
    cones: Vec<Cone>,
    scale: Vec<Vec<f64>>,
}

/// An answer, and the places of its rows among the duals.
struct Solved {
    solution: Solution,
    half_spaces: Vec<(usize, usize)>,
    cones: Vec<(usize, usize)>,
}

impl ChannelProblem<'_> {
    /// Runs the sequence from `gains` and writes the result back.
    pub fn run(&mut self, gains: &mut [GainSet]) -> Result<Merit, TuningError> {
        let mut x = self.values(gains);
        let clock = Instant::now();
        let Some(mut best) = self.merit(&x, None) else {
            return Err(TuningError::Empty("the starting gains give a non-finite loop"));
        };
        self.stats.assembly_time += clock.elapsed().as_secs_f64();
        let mut trust = self.options.trust;
        for _ in 0..self.options.iterations {
            let clock = Instant::now();
            let step = self.program(&x, trust);
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            let solution = self.solve(&step)?.solution;
            if !solution.status.usable() {
                // Elastic rows make every program feasible and bounded but for
                // the hard ones, which hold at the centre: a smaller region is
                // better conditioned.
                self.stats.refused += 1;
                trust *= 0.4;
                if trust < TRUST[1] {
                    break;
                }
                continue;
            }
            let n = self.gain_count();
            let mut size = 0.0f64;
            let next: Vec<Vec<f64>> = x
                .iter()
                .enumerate()
                .map(|(v, x)| {
                    (0..n)
                        .map(|g| {
                            let d = solution.x[v * n + g];
                            size = size.max(d.abs());
                            (x[g] + step.scale[v][g] * d).max(0.0)
                        })
                        .collect()
                })
                .collect();
            let clock = Instant::now();
            let merit = self.merit(&next, Some(&x));
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            match merit {
                Some(m) if m.total <= best.total + 1e-9 => {
                    let gain = (best.total - m.total) / best.total.abs().max(1.0);
                    x = next;
                    best = m;
                    trust = (trust * 1.5).min(TRUST[0]);
                    if size < STEP_TOLERANCE || gain < MERIT_TOLERANCE {
                        break;
                    }
                }
                _ => {
                    trust = trust.min(size) * 0.4;
                    if trust < TRUST[1] {
                        break;
                    }
                }
            }
        }
        self.write(&x, gains);
        Ok(best)
    }

    /// Prices of the targets at these gains, which should be a converged
    /// answer: from the duals of the program there. None at a speed where a
    /// requirement is missed, since its dual is the price of missing it, nor where
    /// the gains vanish.
    ///
    /// # Errors
    /// A program that cannot be posed.
    pub fn prices(&mut self, gains: &[GainSet]) -> Result<Vec<Price>, TuningError> {
        let x = self.values(gains);
        let step = self.program(&x, PRICE_REGION);
        let solved = self.solve(&step)?;
        if !solved.solution.status.usable() {
            return Ok(Vec::new());
        }
        let mut totals = vec![[0.0f64; Target::ALL.len()]; self.speeds.len()];
        // A row's dual is the fall of the optimum for a unit rise of the row.
        for &(k, place) in &solved.half_spaces {
            let row = &step.half_spaces[k];
            for (target, slope) in &row.tightening {
                totals[row.speed][*target as usize] -=
                    solved.solution.half_space_duals[place] * slope;
            }
        }
        for &(k, place) in &solved.cones {
            let cone = &step.cones[k];
            for (target, slope) in &cone.tightening {
                totals[cone.speed][*target as usize] -=
                    solved.solution.cone_duals[place][0] * slope;
            }
        }
        let n = self.speeds.len() as f64;
        let mut own = vec![1.0; self.speeds.len()];
        let mut absent = vec![false; self.speeds.len()];
        for site in self.sites.iter().filter(|s| s.nominal) {
            let squared = site.activity_squared(&site.gains(&x));
            own[site.speed] = squared / self.reference_activity[site.speed];
            absent[site.speed] = squared < LEAST_ACTIVITY * LEAST_ACTIVITY;
        }
        let slack = |v: usize, k: usize| {
            solved.solution.x[self.speeds.len() * self.gain_count() + v * KINDS + k]
        };
        let priced = |v: usize| !absent[v] && (0..KINDS).all(|k| slack(v, k) < SLACK);
        let mut out = Vec::new();
        for (v, totals) in totals.iter().enumerate().filter(|(v, _)| priced(*v)) {
            for target in Target::PRICED {
                let by = target.unit_tightening().0;
                // The objective is the mean over speeds of activity².
                // Duals are not negative but for rounding.
                let percent = (100.0 * by * totals[target as usize] * n / (2.0 * own[v])).max(0.0);
                let (channel, speed) = (self.channel, self.speeds[v]);
                out.push(Price { channel, speed, target, percent });
            }
        }
        Ok(out)
    }

    /// Solves a program by a growing set of its rows: first those that bind
    /// most easily, then also those that the answer violates, until it
    /// violates none. The last answer is that of the whole program.
    fn solve(&mut self, step: &Step) -> Result<Solved, TuningError> {
        let mut half_spaces: Vec<bool> =
            step.half_spaces.iter().map(|r| r.ease < FIRST_ROWS).collect();
        let mut cones: Vec<bool> = step.cones.iter().map(|r| r.ease < FIRST_ROWS).collect();
        self.stats.programs += 1;
        for round in 1.. {
            let clock = Instant::now();
            let mut program = step.base.clone();
            let chosen = |flags: &[bool]| -> Vec<usize> {
                flags.iter().enumerate().filter(|f| *f.1).map(|f| f.0).collect()
            };
            let places = chosen(&half_spaces)
                .into_iter()
                .map(|k| (k, program.require_nonnegative(step.half_spaces[k].row.clone())))
                .collect();
            let cone_places = chosen(&cones)
                .into_iter()
                .map(|k| (k, program.require_cone(step.cones[k].rows.clone())))
                .collect();
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            let solution = program
                .solve()
                .map_err(|source| TuningError::Program { channel: self.channel, source })?;
            self.stats.solves += 1;
            self.stats.largest_rows = self.stats.largest_rows.max(program.row_count());
            self.stats.interior_iterations += solution.iterations;
            self.stats.solver_time += solution.solve_time;
            tracing::trace!(
                axis = self.channel.name(),
                round,
                rows = program.row_count(),
                status = ?solution.status,
                iterations = solution.iterations,
                objective = solution.objective,
                "conic program"
            );
            let clock = Instant::now();
            let mut complete = true;
            if solution.status.usable() {
                let all = round + 1 == MAX_ROUNDS;
                for (row, used) in step.half_spaces.iter().zip(&mut half_spaces) {
                    if !*used && (all || row.row.value(&solution.x) < -ROW_TOLERANCE) {
                        *used = true;
                        complete = false;
                    }
                }
                for (cone, used) in step.cones.iter().zip(&mut cones) {
                    let [bound, re, im] = &cone.rows;
                    let excess = || {
                        magnitude(C::new(re.value(&solution.x), im.value(&solution.x)))
                            - bound.value(&solution.x)
                    };
                    if !*used && (all || excess() > ROW_TOLERANCE) {
                        *used = true;
                        complete = false;
                    }
                }
            }
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            if complete || round == MAX_ROUNDS {
                return Ok(Solved { solution, half_spaces: places, cones: cone_places });
            }
        }
        unreachable!("the rounds end by themselves")
    }

    /// The conic program at `x` within a trust region.
    fn program(&self, x: &[Vec<f64>], trust: f64) -> Step {
        let (speeds, gains) = (self.speeds.len(), self.gain_count());
        let slack0 = speeds * gains;
        let mut program = Program::new(slack0 + speeds * KINDS);
        let largest: Vec<f64> =
            (0..gains).map(|g| x.iter().map(|x| x[g].abs()).fold(0.0, f64::max)).collect();
        let scale: Vec<Vec<f64>> = x
            .iter()
            .map(|x| (0..gains).map(|g| x[g].abs().max(0.08 * largest[g] + 1e-3)).collect())
            .collect();
        let n = speeds as f64;
        let rows: Vec<SiteRows> = self
            .sites
            .par_iter()
            .map(|site| {
                let region = Region {
                    x: &site.gains(x),
                    dependence: &site.dependence(&scale),
                    slack: slack0 + site.speed * KINDS,
                    trust,
                };
                site.rows(region, self.options, self.reference_activity[site.speed] * n)
            })
            .collect();
        let (mut half_spaces, mut cones) = (Vec::new(), Vec::new());
        for (mut r, site) in rows.into_iter().zip(&self.sites) {
            for row in &mut r.half_spaces {
                row.speed = site.speed;
            }
            for cone in &mut r.cones {
                cone.speed = site.speed;
            }
            half_spaces.append(&mut r.half_spaces);
            cones.append(&mut r.cones);
            for (i, j, v) in r.quadratic {
                program.add_quadratic(i, j, v);
            }
            for (i, v) in r.linear {
                program.add_linear(i, v);
            }
        }
        let smooth = self.smoothness_scales(x);
        for v in 0..speeds {
            self.bounds(&mut program, v, &x[v], &scale[v], trust);
            if v + 1 < speeds && self.options.smoothing > 0.0 {
                self.smoothing(&mut program, v, x, &scale, &smooth);
            }
        }
        Step { base: program, half_spaces, cones, scale }
    }

    /// Bounds on the gains of a speed and their ratio, the trust region, and the
    /// prices of the slacks.
    fn bounds(&self, program: &mut Program, v: usize, x: &[f64], scale: &[f64], trust: f64) {
        let (speeds, gains) = (self.speeds.len(), self.gain_count());
        let (first, slack) = (v * gains, speeds * gains + v * KINDS);
        let [p, i] = self.ratio_places();
        let [low, high] = self.spec.integral_ratio;
        // K_I ≥ low K_P and K_I ≤ high K_P, elastic only in the merit.
        for (sign, ratio) in [(1.0, low), (-1.0, high)] {
            if !ratio.is_finite() || ratio <= 0.0 {
                continue;
            }
            let value = sign * (x[i] - ratio * x[p]);
            // A start outside must be able to come in within one region.
            let reach = trust * (scale[i] + ratio * scale[p]);
            let constant = if value < 0.0 { (-0.5 * reach).max(value) } else { value };
            program.require_nonnegative(AffineRow::new(
                constant,
                vec![(first + i, sign * scale[i]), (first + p, -sign * ratio * scale[p])],
            ));
        }
        for g in 0..gains {
            // Gains stay positive.
            let down = trust.min(x[g] / scale[g]);
            program.require_nonnegative(AffineRow::new(down, vec![(first + g, 1.0)]));
            program.require_nonnegative(AffineRow::new(trust, vec![(first + g, -1.0)]));
            // A little curvature where activity has none.
            program.add_quadratic(first + g, first + g, 1e-6);
        }
        for (k, kind) in Requirement::ALL.into_iter().enumerate() {
            program.require_nonnegative(AffineRow::new(0.0, vec![(slack + k, 1.0)]));
            program.add_linear(slack + k, self.price(kind) / speeds as f64);
        }
    }

    /// The cost of the difference between a speed and the next.
    fn smoothing(
        &self,
        program: &mut Program,
        v: usize,
        x: &[Vec<f64>],
        scale: &[Vec<f64>],
        smooth: &[f64],
    ) {
        let gains = self.gain_count();
        let weight = self.options.smoothing / self.speed_gap(v);
        for g in 0..gains {
            // ((x₁ + s₁d₁) − (x₀ + s₀d₀))² / scale².
            let (a, b) = (scale[v][g] / smooth[g], scale[v + 1][g] / smooth[g]);
            let c = (x[v + 1][g] - x[v][g]) / smooth[g];
            let (i0, i1) = (v * gains + g, (v + 1) * gains + g);
            program.add_quadratic(i0, i0, weight * a * a);
            program.add_quadratic(i1, i1, weight * b * b);
            program.add_quadratic(i0, i1, -2.0 * weight * a * b);
            program.add_linear(i0, -2.0 * weight * c * a);
            program.add_linear(i1, 2.0 * weight * c * b);
        }
    }
}
