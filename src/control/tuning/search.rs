//! Searches for other local answers, of one channel and of pairs.

use super::super::axis::{Channel, ChannelGains, GainSet};
use super::channel::{ChannelProblem, Merit};
use super::sweeps::Run;
use super::targets::ChannelSpec;
use super::{TuningError, TuningOptions, TuningStats};
use rayon::prelude::*;
use std::time::Instant;

/// Speeds looked at in one of them.
const PAIR_SPEEDS: usize = 4;
/// Density of the lattice of the first channel of a pair.
const PAIR_DENSITY: f64 = 0.5;
/// Fall of the sum of the merits, relative, that is worth moving for.
const SCAN_PAIR_GAIN: f64 = 1e-3;
/// A violation beyond this, in slack units, is worth a search over pairs.
const MISSED: f64 = 5e-3;
/// Relative fall of the joint merit that is worth moving for.
const SEARCH_TOLERANCE: f64 = 1e-4;

impl Run<'_> {
    /// Looks for other answers of a channel, speed by speed, and moves to them:
    /// the sequence is local, and a loop with several crossings has several
    /// local answers. With `settled`, a move is made only where the joint merit
    /// falls, and where the other channels of the group do not lose more than
    /// this one wins. Returns the merit if something has changed.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn search(
        &self,
        channel: Channel,
        group: &[(Channel, &ChannelSpec)],
        gains: &mut [GainSet],
        options: &TuningOptions,
        settled: bool,
        stats: &mut TuningStats,
    ) -> Result<Option<Merit>, TuningError> {
        let Some(&(_, spec)) = group.iter().find(|c| c.0 == channel) else {
            return Ok(None);
        };
        let clock = Instant::now();
        let problem = ChannelProblem::new(channel, spec, self.shared, gains, 1.0, options);
        let x = problem.values(gains);
        let Some(now) = problem.merit(&x, None) else {
            return Ok(None);
        };
        let found = problem.scan(&x);
        let mut candidate = x.clone();
        let mut best: Option<Merit> = None;
        // One speed after the other, since neighbours want to be alike.
        for (v, found) in found.iter().enumerate() {
            let Some((own, won)) = found else { continue };
            let place = problem.places[v];
            let old = std::mem::replace(&mut candidate[v], own.clone());
            let Some(merit) = problem.merit(&candidate, Some(&x)) else {
                candidate[v] = old;
                continue;
            };
            let least = best.as_ref().map_or(now.total, |b| b.total);
            let mut moved = gains[place];
            moved[channel.index()] = ChannelGains::from_values(channel, own);
            let good = !settled
                || (merit.total < least * (1.0 - SEARCH_TOLERANCE)
                    && self.loss_of_others(channel, group, gains, place, &moved, options) < *won);
            if good {
                gains[place] = moved;
                best = Some(merit);
            } else {
                candidate[v] = old;
            }
        }
        stats.assembly_time += clock.elapsed().as_secs_f64();
        tracing::debug!(
            "{channel}: {} of {} speeds have better gains by {:.4}, won {:.4}, {:.3} s",
            found.iter().flatten().count(),
            x.len(),
            found.iter().flatten().map(|f| f.1).sum::<f64>() / x.len() as f64,
            best.as_ref().map_or(0.0, |b| now.total - b.total),
            clock.elapsed().as_secs_f64()
        );
        Ok(best)
    }

    /// Rise of the merits of the other channels of a group at one speed if its
    /// gains become `moved`; infinite if one of them cannot be judged.
    fn loss_of_others(
        &self,
        channel: Channel,
        group: &[(Channel, &ChannelSpec)],
        gains: &[GainSet],
        place: usize,
        moved: &GainSet,
        options: &TuningOptions,
    ) -> f64 {
        let mut after = gains.to_vec();
        after[place] = *moved;
        let others = group
            .par_iter()
            .filter(|c| c.0 != channel && c.1.applies(self.shared.speeds[place]))
            .map(|&(other, spec)| {
                let (before, mut after) = (
                    self.problem_at(other, spec, gains, place, options),
                    self.problem_at(other, spec, &after, place, options),
                );
                after.reference_activity.clone_from(&before.reference_activity);
                let x = gains[place][other.index()].values(other);
                let judge = |p: &ChannelProblem| p.merit_at(0, &x, &x, f64::INFINITY);
                match (judge(&before), judge(&after)) {
                    (Some(a), Some(b)) => b - a,
                    _ => f64::INFINITY,
                }
            })
            .collect::<Vec<_>>();
        others.iter().sum()
    }

    /// The problem of a channel at one speed.
    fn problem_at<'a>(
        &self,
        channel: Channel,
        spec: &'a ChannelSpec,
        gains: &[GainSet],
        place: usize,
        options: &'a TuningOptions,
    ) -> ChannelProblem<'a> {
        ChannelProblem::at_places(channel, spec, self.shared, gains, 1.0, options, vec![place])
    }

    /// Where a requirement is missed: looks for other gains of the channel
    /// that misses it and of its partner at once, since each may have settled
    /// around the other. Returns whether something has changed.
    pub(super) fn search_pairs(
        &self,
        group: &[(Channel, &ChannelSpec)],
        merits: &[(Channel, Merit)],
        gains: &mut [GainSet],
        options: &TuningOptions,
        stats: &mut TuningStats,
    ) -> bool {
        let clock = Instant::now();
        let spec_of = |c: Channel| group.iter().find(|g| g.0 == c).map(|g| g.1);
        // The speeds with the worst misses, and who misses.
        let mut missed: Vec<(usize, Channel, f64)> = Vec::new();
        for place in 0..self.shared.speeds.len() {
            let at = |channel: Channel, merit: &Merit| {
                let spec = spec_of(channel)?;
                let own = (0..place).filter(|&v| spec.applies(self.shared.speeds[v])).count();
                let worst = merit.violation.get(own)?.iter().copied().fold(0.0, f64::max);
                (spec.applies(self.shared.speeds[place]) && !channel.is_outer())
                    .then_some((place, channel, worst))
            };
            let worst = merits
                .iter()
                .filter_map(|(c, m)| at(*c, m))
                .max_by(|a, b| a.2.total_cmp(&b.2))
                .filter(|w| w.2 > MISSED);
            missed.extend(worst);
        }
        missed.sort_by(|a, b| b.2.total_cmp(&a.2));
        missed.truncate(PAIR_SPEEDS);
        let mut changed = false;
        for (place, second, worst) in missed {
            let first = second.partner();
            let (Some(first_spec), Some(second_spec)) = (spec_of(first), spec_of(second)) else {
                continue;
            };
            let reference: Vec<f64> = group
                .iter()
                .map(|&(c, spec)| {
                    let applies = spec.applies(self.shared.speeds[place]);
                    if applies {
                        self.problem_at(c, spec, gains, place, options).reference_activity[0]
                    } else {
                        1.0
                    }
                })
                .collect();
            // All channels' merits at this speed with some gains there.
            let total = |at: &GainSet| -> Option<f64> {
                let mut all = gains.to_vec();
                all[place] = *at;
                let mut sum = 0.0;
                for (&(c, spec), reference) in group.iter().zip(&reference) {
                    if spec.applies(self.shared.speeds[place]) {
                        let mut problem = self.problem_at(c, spec, &all, place, options);
                        problem.reference_activity[0] = *reference;
                        let x = at[c.index()].values(c);
                        sum += problem.merit_at(0, &x, &x, f64::INFINITY)?;
                    }
                }
                Some(sum)
            };
            let Some(now) = total(&gains[place]) else { continue };
            let x = gains[place][first.index()].values(first);
            let problem = self.problem_at(first, first_spec, gains, place, options);
            let tried: Vec<Option<(GainSet, f64)>> = problem
                .lattice(&x, PAIR_DENSITY)
                .par_iter()
                .map(|candidate| {
                    // The same number of unstable poles.
                    problem.merit_at(0, candidate, &x, f64::INFINITY)?;
                    let mut all = gains.to_vec();
                    all[place][first.index()] = ChannelGains::from_values(first, candidate);
                    let other = self.problem_at(second, second_spec, &all, place, options);
                    let own = gains[place][second.index()].values(second);
                    let (own, _) = other.best_of_lattice(0, &own, now)?;
                    all[place][second.index()] = ChannelGains::from_values(second, &own);
                    Some((all[place], total(&all[place])?))
                })
                .collect();
            let best = tried.into_iter().flatten().reduce(|a, b| if b.1 < a.1 { b } else { a });
            tracing::debug!(
                "{second} misses by {worst:.4} at {:.1} m/s: merit {now:.4}, with {first} {:.4}",
                self.shared.speeds[place],
                best.as_ref().map_or(f64::NAN, |b| b.1)
            );
            if let Some((moved, merit)) = best
                && merit < now * (1.0 - SCAN_PAIR_GAIN)
            {
                gains[place] = moved;
                changed = true;
            }
        }
        stats.assembly_time += clock.elapsed().as_secs_f64();
        changed
    }
}
