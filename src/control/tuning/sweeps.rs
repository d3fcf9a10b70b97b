//! Sweeps over the channels of a group until no gain changes.

use super::super::axis::{Channel, GainSet, inner_only};
use super::super::loops::LoopModel;
use super::channel::{ChannelProblem, Merit};
use super::site::WINDING_TOLERANCE;
use super::targets::ChannelSpec;
use super::{Shared, TuningError, TuningOptions, TuningStats};
use num_complex::Complex64 as C;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// Largest trust region at the start of the second and of later sweeps: what
/// the others changed needs only small answers, and a small region leaves out
/// most rows.
pub(super) const LATER_TRUST: [f64; 2] = [0.12, 0.05];

/// Searches over pairs of channels for every part of a tuning.
const PAIR_SEARCHES: usize = 2;
/// Sweeps that follow one that has found something, at least.
const PAIR_SWEEPS: usize = 3;
/// Sweeps after which other answers are searched for.
const SEARCH_SWEEPS: usize = 3;
/// Longest chord of a Nyquist curve near its kite; the sag of an arc of
/// radius 0.5 over it is 0.0009, a twentieth of a degree.
const LONGEST_CHORD: f64 = 0.06;

/// Sweeps end when no gain changes by more than this fraction.
const SWEEP_TOLERANCE: f64 = 0.02;

/// What the sweeps over channels share.
pub(super) struct Run<'a> {
    pub(super) shared: Shared<'a>,
    pub(super) options: &'a TuningOptions,
    /// Whether other answers are searched for.
    pub(super) search: bool,
}

pub(super) struct Sweeps {
    pub(super) merits: Vec<(Channel, Merit)>,
    pub(super) sweeps: usize,
    pub(super) last_change: f64,
}

/// One sweep over a group of channels.
struct Round<'a> {
    /// Size of the kite (1: full).
    growth: f64,
    options: &'a TuningOptions,
    /// Channels that a search has moved: they begin with a wide trust region.
    moved: [bool; Channel::ALL.len()],
    /// That region.
    first_trust: f64,
}

impl Run<'_> {
    /// Growth of the kite, then Gauss–Seidel sweeps over a group of channels.
    pub(super) fn sweeps(
        &self,
        group: &[(Channel, ChannelSpec)],
        gains: &mut [GainSet],
        stats: &mut TuningStats,
    ) -> Result<Sweeps, TuningError> {
        let group: Vec<(Channel, &ChannelSpec)> = group.iter().map(|c| (c.0, &c.1)).collect();
        let mut merits: Vec<(Channel, Merit)> = Vec::new();
        let mut last_change = f64::INFINITY;
        let mut sweeps = 0;
        let mut moved = [false; Channel::ALL.len()];
        let growing = !self.options.growth.is_empty();
        if self.search && growing {
            for &(channel, _) in &group {
                self.search(channel, &group, gains, self.options, false, stats)?;
            }
        }
        // Sizes of the kite, and programs at most.
        let full = (1.0, self.options.iterations);
        let mut stages: VecDeque<(f64, usize)> =
            self.options.growth.iter().map(|&g| (g, 6)).collect();
        stages.extend(std::iter::repeat_n(full, self.options.sweeps));
        let mut pair_searches = if self.search { PAIR_SEARCHES } else { 0 };
        while let Some((growth, iterations)) = stages.pop_front() {
            let trust = match sweeps {
                0 => self.options.trust,
                k => self.options.trust.min(LATER_TRUST[(k - 1).min(1)]),
            };
            let options = TuningOptions { iterations, trust, ..self.options.clone() };
            let before = gains.to_vec();
            merits.clear();
            let round = Round { growth, options: &options, moved, first_trust: self.options.trust };
            merits.extend(self.sweep(&group, &round, gains, stats)?);
            tracing::debug!(
                "kite {growth}, sweep {sweeps}: change {:.3}, {} programs, solver {:.2} s, assembly {:.2} s: {:?}",
                change(&before, gains),
                stats.programs,
                stats.solver_time,
                stats.assembly_time,
                merits.iter().map(|m| (m.0.name(), m.1.activity, m.1.worst())).collect::<Vec<_>>()
            );
            if growth < 1.0 {
                continue;
            }
            let settled = change(&before, gains) < SWEEP_TOLERANCE;
            moved = [false; Channel::ALL.len()];
            if self.search && (settled || (growing && sweeps < SEARCH_SWEEPS)) {
                for (place, &(channel, _)) in group.iter().enumerate() {
                    let found = self.search(channel, &group, gains, &options, true, stats)?;
                    if let Some(merit) = found {
                        merits[place].1 = merit;
                        moved[channel.index()] = true;
                    }
                }
            }
            sweeps += 1;
            last_change = change(&before, gains);
            let last = last_change < SWEEP_TOLERANCE || stages.is_empty();
            if last && pair_searches > 0 {
                pair_searches -= 1;
                if self.search_pairs(&group, &merits, gains, &options, stats) {
                    moved = [true; Channel::ALL.len()];
                    stages.resize(stages.len().max(PAIR_SWEEPS), full);
                    continue;
                }
            }
            if last_change < SWEEP_TOLERANCE {
                break;
            }
        }
        Ok(Sweeps { merits, sweeps, last_change })
    }

    /// Tunes each channel of a group once. Two channels at a time start from the
    /// same point, as long as moving both keeps the number of unstable poles;
    /// otherwise one follows the other.
    fn sweep(
        &self,
        group: &[(Channel, &ChannelSpec)],
        round: &Round<'_>,
        gains: &mut [GainSet],
        stats: &mut TuningStats,
    ) -> Result<Vec<(Channel, Merit)>, TuningError> {
        let solve = |channel: Channel, spec: &ChannelSpec, gains: &mut [GainSet]| {
            let clock = Instant::now();
            let trust =
                if round.moved[channel.index()] { round.first_trust } else { round.options.trust };
            let options = TuningOptions { trust, ..round.options.clone() };
            let mut problem =
                ChannelProblem::new(channel, spec, self.shared, gains, round.growth, &options);
            problem.stats.assembly_time += clock.elapsed().as_secs_f64();
            let merit = problem.run(gains)?;
            Ok::<_, TuningError>((merit, problem.stats))
        };
        let mut merits = Vec::with_capacity(group.len());
        for pair in group.chunks(2) {
            let results: Vec<(Vec<GainSet>, Merit, TuningStats)> = pair
                .par_iter()
                .map(|&(channel, spec)| {
                    let mut own = gains.to_vec();
                    let (merit, stats) = solve(channel, spec, &mut own)?;
                    Ok((own, merit, stats))
                })
                .collect::<Result<_, TuningError>>()?;
            let mut joint = gains.to_vec();
            for ((channel, _), (own, _, s)) in pair.iter().zip(&results) {
                let c = channel.index();
                for (joint, own) in joint.iter_mut().zip(own) {
                    joint[c] = own[c];
                }
                stats.add(s);
            }
            if pair.len() == 1 || same_winding(&self.shared.models.nodes, gains, &joint) {
                gains.copy_from_slice(&joint);
                merits.extend(pair.iter().zip(results).map(|(c, r)| (c.0, r.1)));
            } else {
                for &(channel, spec) in pair {
                    let (merit, s) = solve(channel, spec, gains)?;
                    stats.add(&s);
                    merits.push((channel, merit));
                }
            }
        }
        Ok(merits)
    }

    /// The grid with points added where a Nyquist curve passes close to its
    /// kite and its chord is long: between two points it may bulge inwards.
    pub(super) fn refined_grid(
        &self,
        grid: &[f64],
        group: &[(Channel, ChannelSpec)],
        gains: &[GainSet],
    ) -> Arc<[f64]> {
        let mut parts = vec![1usize; grid.len()];
        for (channel, spec) in group {
            let problem =
                ChannelProblem::new(*channel, spec, self.shared, gains, 1.0, self.options);
            let x = problem.values(gains);
            for site in &problem.sites {
                for (cut, kite) in site.kites.iter().enumerate() {
                    let curve = site.loops.loop_curve(cut, &site.gains(&x));
                    for k in 0..grid.len() - 1 {
                        let chord = (curve[k + 1] - curve[k]).norm();
                        if chord > LONGEST_CHORD
                            && chord < 2.0
                            && kite.separation(curve[k], curve[k + 1]) < 0.5 * chord
                        {
                            let wanted = (chord / LONGEST_CHORD).ceil() as usize;
                            parts[k] = parts[k].max(wanted.min(8));
                        }
                    }
                }
            }
        }
        let mut out = Vec::with_capacity(grid.len());
        for (k, &n) in parts.iter().enumerate() {
            out.push(grid[k]);
            if k + 1 < grid.len() {
                let ratio = (grid[k + 1] / grid[k]).powf(1.0 / n as f64);
                out.extend((1..n).map(|i| grid[k] * ratio.powi(i as i32)));
            }
        }
        out.into()
    }
}

/// Whether det(I + Λ) turns as often about zero at both gain sets, for every
/// speed and model, with the outer loops open and closed.
fn same_winding(models: &[Vec<LoopModel>], a: &[GainSet], b: &[GainSet]) -> bool {
    let same = |m: &LoopModel, a: &GainSet, b: &GainSet| {
        let (da, db) = (m.determinant(a), m.determinant(b));
        let ratio: Vec<C> = da.iter().zip(&db).map(|(a, b)| b / a).collect();
        let turned: f64 = ratio.windows(2).map(|r| (r[1] / r[0]).arg()).sum();
        turned.abs() < WINDING_TOLERANCE
    };
    models.iter().zip(a.iter().zip(b)).all(|(models, (a, b))| {
        let (inner_a, inner_b) = (inner_only(a), inner_only(b));
        models.par_iter().all(|m| {
            same(m, a, b) && ((inner_a, inner_b) == (*a, *b) || same(m, &inner_a, &inner_b))
        })
    })
}

/// Largest relative change of a gain.
fn change(a: &[GainSet], b: &[GainSet]) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.iter().zip(b) {
            for (a, b) in a.array().into_iter().zip(b.array()) {
                worst = worst.max((b - a).abs() / (a.abs() + 1e-2));
            }
        }
    }
    worst
}
