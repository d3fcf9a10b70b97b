//! Gains to start from: by the equivalent delay of the plants, stable in every
//! model.

use super::super::axis::{Axis, Channel, ChannelGains, GainSet, inner_only};
use super::super::closed_loop::{LawLoop, closed_loop_matrix};
use super::super::law::LawTable;
use super::super::loops::FrequencyModel;
use super::super::plant::{Hardware, Inversion, Plant};
use super::super::stability;
use super::targets::ChannelSpec;
use super::{TuningError, TuningProblem};
use crate::linear::dense;
use nalgebra::DMatrix;
use num_complex::Complex64 as C;
use rayon::prelude::*;

/// Starting bandwidths tried, relative to what the equivalent delay suggests.
const START_SCALES: [f64; 5] = [1.0, 0.7, 1.3, 0.5, 1.7];
/// Largest real part that still counts as stable, 1/s: a heading or position
/// mode at zero is not a divergence.
pub const START_GROWTH: f64 = 1e-6;
/// Largest real part that counts as a drift of the velocities, 1/s: with the
/// attitudes held, u and v are left with what is nearly neutral in hover. It
/// doubles in 14 s, and is for the outer loops to hold; where there are none,
/// it is not let pass.
pub const DRIFT_GROWTH: f64 = 0.05;

impl TuningProblem<'_> {
    /// Starting gains: for each speed the first of a few that stabilises every
    /// model, scaled from the equivalent delay of the nominal plant in each axis;
    /// where none does, from the longest delay of all axes. Heavy propellers whose
    /// speed is the control react on the yaw at once, which makes its delay short
    /// and says nothing of how fast that axis may be.
    pub(super) fn starts(
        &self,
        inversions: &[Inversion],
        table: &LawTable,
    ) -> Result<Vec<GainSet>, TuningError> {
        let speeds = self.set.plants.iter().zip(inversions).collect::<Vec<_>>();
        speeds
            .par_iter()
            .map(|(plants, inversion)| {
                let mut best: Option<(f64, usize, GainSet)> = None;
                let delays = self
                    .channels
                    .iter()
                    .map(|(channel, _)| {
                        equivalent_delay(&plants[0], inversion, channel.axis(), &self.hardware)
                    })
                    .collect::<Result<Vec<f64>, _>>()?;
                let longest = delays.iter().copied().fold(0.0, f64::max);
                let tries = [0.0, longest]
                    .into_iter()
                    .flat_map(|least| START_SCALES.into_iter().map(move |scale| (least, scale)));
                for (least, scale) in tries {
                    let mut g = GainSet::default();
                    for ((channel, spec), delay) in self.channels.iter().zip(&delays) {
                        let delay = delay.max(least);
                        g[channel.index()] =
                            start_gains(*channel, delay / scale, spec.integral_ratio);
                    }
                    let inner = inner_only(&g);
                    let worst = self
                        .growths(plants, table, &inner)
                        .into_iter()
                        .enumerate()
                        .max_by(|a, b| a.1.total_cmp(&b.1));
                    let Some((model, growth)) = worst else { continue };
                    if growth < START_GROWTH {
                        return Ok(g);
                    }
                    if best.is_none_or(|b| growth < b.0) {
                        best = Some((growth, model, g));
                    }
                }
                let (growth, model, gains) = best.unwrap_or((f64::NAN, 0, GainSet::default()));
                // An axis that is left open may be what grows: then the most
                // stable start has to do, and the verification says so.
                let inner = self.channels.iter().filter(|c| !c.0.is_outer()).count();
                if inner < Axis::ALL.len() && growth.is_finite() {
                    return Ok(gains);
                }
                // Attitude holds leave the velocities free, and the outer loops
                // take care of those.
                let outer =
                    self.channels.iter().any(|c| c.0.is_outer() && c.1.applies(plants[0].speed));
                if outer && growth < DRIFT_GROWTH {
                    return Ok(gains);
                }
                Err(TuningError::Unstabilisable {
                    model: self.set.models[model].name.clone(),
                    speed: plants[0].speed,
                    growth,
                })
            })
            .collect()
    }

    /// Largest real part of the closed loop of each model at one speed.
    fn growths(&self, plants: &[Plant], table: &LawTable, gains: &GainSet) -> Vec<f64> {
        let table = table.with_gains(|_| *gains);
        let outer = inner_only(gains) != *gains;
        let Some(plant) = plants.first() else { return Vec::new() };
        let law = LawLoop::new(&table, plant.speed, outer);
        plants
            .iter()
            .zip(&self.set.models)
            .map(|(plant, model)| {
                let late = model.extra_delay;
                closed_loop_matrix(plant, &law, &self.hardware, late, stability::PADE_ORDER)
                    .ok()
                    .and_then(|matrix| dense::eigenvalues(&matrix).ok())
                    .map_or(f64::NAN, |e| stability::growth(&e))
            })
            .collect()
    }

    /// Halves outer gains at each speed until the loop around the tuned inner
    /// one is stable; failing that, leaves them where it grows least.
    pub(super) fn slow_down_outer(
        &self,
        table: &LawTable,
        group: &[(Channel, ChannelSpec)],
        gains: &mut [GainSet],
    ) {
        gains.par_iter_mut().enumerate().for_each(|(v, g)| {
            let mut best = (f64::INFINITY, *g);
            for _ in 0..8 {
                let worst = self
                    .growths(&self.set.plants[v], table, g)
                    .into_iter()
                    .fold(f64::NEG_INFINITY, f64::max);
                if worst < START_GROWTH {
                    return;
                }
                if worst < best.0 {
                    best = (worst, *g);
                }
                for (c, _) in group {
                    let k = &mut g[c.index()];
                    *k = ChannelGains::new(k.k_d, 0.5 * k.k_p, 0.25 * k.k_i);
                }
            }
            *g = best.1;
        });
    }
}

/// Delay that the hardware and the full-order plant add to the reduced model in
/// an axis, s: the phase between the two responses of ν to the output's rate,
/// divided by frequency, at about the frequency where it matters (0.4/τ).
pub fn equivalent_delay(
    plant: &Plant,
    inversion: &Inversion,
    axis: Axis,
    hardware: &Hardware,
) -> Result<f64, TuningError> {
    let full = FrequencyModel::new(plant, *hardware, 0.0)?;
    let mut reduced_plant = plant.clone();
    reduced_plant.a = DMatrix::from_iterator(8, 8, plant.reduced_a.iter().copied());
    reduced_plant.b = DMatrix::from_iterator(8, 4, plant.reduced_b.iter().copied());
    reduced_plant.measured = std::array::from_fn(|k| k);
    let reduced = FrequencyModel::new(&reduced_plant, *hardware, 0.0)?;
    let i = axis.index();
    let response = |model: &FrequencyModel, w: f64| {
        let x = model.states(w);
        (0..8).fold(C::new(0.0, 0.0), |sum, k| {
            let column =
                (0..4).fold(C::new(0.0, 0.0), |s, j| s + x[k][j] * inversion.allocation[(j, i)]);
            sum + column * inversion.outputs[(i, k)]
        })
    };
    let mut delay = hardware.equivalent_delay().max(0.01);
    for _ in 0..4 {
        let w = 0.4 / delay;
        let extra = response(&full, w) / response(&reduced, w);
        let path = hardware.response(w, 0.0);
        // Phase of hardware and of what the reduced model leaves out.
        delay = (-(path.arg() + extra.arg()) / w).clamp(0.01, 1.0);
    }
    if !delay.is_finite() {
        return Err(TuningError::NotFinite { model: "nominal".into(), speed: plant.speed });
    }
    Ok(delay)
}

/// Starting gains from an equivalent delay: K_D = 0.33/τ, K_P = 0.05/τ² and
/// K_I at a fifth of K_P for an attitude; the same K_P, K_I one order lower
/// for a rate or velocity. `ratio` bounds K_I/K_P.
pub fn start_gains(channel: Channel, delay: f64, ratio: [f64; 2]) -> ChannelGains {
    if channel.is_outer() {
        // A quarter of the inner loop's bandwidth.
        let k_p = 0.05 / delay;
        return ChannelGains::new(0.0, k_p, k_p * 0.05f64.clamp(ratio[0], ratio[1]));
    }
    let (first, second) = (0.33 / delay, 0.05 / (delay * delay));
    match channel {
        Channel::Roll | Channel::Pitch => {
            ChannelGains::new(first, second, second * 0.2f64.clamp(ratio[0], ratio[1]))
        }
        Channel::Yaw | Channel::Heave | Channel::Vx | Channel::Vy => {
            ChannelGains::new(0.0, first, first * (second / first).clamp(ratio[0], ratio[1]))
        }
    }
}
