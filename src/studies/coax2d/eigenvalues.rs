//! Eigenvalues of the printed matrices and of ours, one to one.

use nalgebra::{Complex, DMatrix};

use super::appendix::PRINTED_PRECISION;
use crate::linear::dense::{eigen, eigenvalues};
use crate::linear::modes::{Mode, ModeName, modes};
use crate::linear::{LinearError, StateSpace};
use crate::units::System;

/// Distance that counts as agreement, relative to |λ| of print; what the
/// rounding of print explains comes on top.
pub const AGREEMENT: f64 = 0.1;
/// Most eigenvalues that are paired: the search goes through every subset.
const MOST: usize = 12;
/// Ways in the complex plane in which rounding may push an eigenvalue.
const WAYS: u32 = 16;

/// A printed mode and ours.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenvaluePair {
    /// Eigenvalue of the printed matrix with Im λ ≥ 0, rad/s.
    pub printed: Complex<f64>,
    /// The one of ours that stands for it, rad/s.
    pub ours: Complex<f64>,
    /// Name of the printed mode, where its shape is clear.
    pub printed_name: Option<ModeName>,
    /// Name of our mode.
    pub our_name: Option<ModeName>,
    /// |ours − printed|/|printed|.
    pub distance: f64,
    /// What the rounding of the printed entries may move the printed
    /// eigenvalue by, relative to itself.
    pub rounding: f64,
}

impl EigenvaluePair {
    /// Largest distance that counts as agreement.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        AGREEMENT + self.rounding
    }

    /// Whether the two agree.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.distance <= self.tolerance()
    }
}

/// Pairs every eigenvalue of the printed model with one of ours, such that the
/// sum of their distances, each relative to the printed one, is least. Of a
/// conjugate pair the upper half is listed; where ours are two real ones for
/// it, both are.
///
/// # Errors
/// Models of unlike or too many states, or without eigenvalues.
pub fn pair_eigenvalues(
    printed: &StateSpace,
    ours: &StateSpace,
) -> Result<Vec<EigenvaluePair>, LinearError> {
    let (theirs, own) = (both_halves(printed)?, both_halves(ours)?);
    if theirs.len() != own.len() || theirs.len() > MOST {
        return Err(LinearError::Domain(format!(
            "{} and {} eigenvalues cannot be paired: there must be as many, and at most {MOST}",
            theirs.len(),
            own.len()
        )));
    }
    let cost = DMatrix::from_fn(theirs.len(), own.len(), |i, j| {
        distance(theirs[i].eigenvalue, own[j].eigenvalue)
    });
    let partner = assign(&cost);
    let moves = rounding(printed, &theirs)?;
    let mut pairs: Vec<EigenvaluePair> = Vec::new();
    for ((mode, &j), moved) in theirs.iter().zip(&partner).zip(moves) {
        let (value, own) = (mode.eigenvalue, &own[j]);
        let seen = pairs.iter().any(|pair| {
            pair.printed == value.conj() && value.im < 0.0 && pair.ours == own.eigenvalue.conj()
        });
        if seen {
            continue;
        }
        pairs.push(EigenvaluePair {
            printed: value,
            ours: own.eigenvalue,
            printed_name: mode.name,
            our_name: own.name,
            distance: distance(value, own.eigenvalue),
            rounding: moved / value.norm(),
        });
    }
    pairs.sort_by(|a, b| {
        a.printed.re.total_cmp(&b.printed.re).then(b.printed.im.total_cmp(&a.printed.im))
    });
    Ok(pairs)
}

fn distance(printed: Complex<f64>, ours: Complex<f64>) -> f64 {
    (ours - printed).norm() / printed.norm()
}

/// The modes, the lower half of each conjugate pair right after the upper.
fn both_halves(model: &StateSpace) -> Result<Vec<Mode>, LinearError> {
    let mut list = Vec::new();
    for mode in modes(model)? {
        let lower =
            mode.oscillates().then(|| Mode { eigenvalue: mode.eigenvalue.conj(), ..mode.clone() });
        list.push(mode);
        list.extend(lower);
    }
    Ok(list)
}

/// The assignment of rows to columns with the least sum: the cheapest way to
/// give the first rows any set of columns, from set to set.
fn assign(cost: &DMatrix<f64>) -> Vec<usize> {
    let n = cost.nrows();
    let mut best = vec![(f64::INFINITY, 0_usize); 1 << n];
    best[0].0 = 0.0;
    for set in 0..(1_usize << n) {
        let row = set.count_ones() as usize;
        for column in (0..n).filter(|column| set & (1 << column) == 0) {
            let sum = best[set].0 + cost[(row, column)];
            let next = set | (1 << column);
            if sum < best[next].0 {
                best[next] = (sum, column);
            }
        }
    }
    let mut columns = vec![0; n];
    let mut set = (1 << n) - 1;
    for row in (0..n).rev() {
        columns[row] = best[set].1;
        set &= !(1 << columns[row]);
    }
    columns
}

/// What the rounding of print may move each eigenvalue of `modes` by, rad/s:
/// every entry that is not zero is off by half a unit of its last printed
/// decimal, with the signs that push the eigenvalue one way, for ways all
/// round; the eigenvalues of each such matrix are computed, since two that lie
/// close together move by more than first order says, or less.
fn rounding(printed: &StateSpace, modes: &[Mode]) -> Result<Vec<f64>, LinearError> {
    let a = printed.matrices_in(System::Us).a;
    let e = eigen(&a)?;
    let mut moves = Vec::with_capacity(modes.len());
    for (place, mode) in modes.iter().enumerate() {
        let value = mode.eigenvalue;
        let nearest = (0..e.values.len())
            .min_by(|&i, &j| (e.values[i] - value).norm().total_cmp(&(e.values[j] - value).norm()));
        let Some((v, w)) = nearest.and_then(|k| Some((e.right.column(k), e.left[k].as_ref()?)))
        else {
            moves.push(0.0);
            continue;
        };
        let mut most: f64 = 0.0;
        for way in 0..WAYS {
            let turn = Complex::cis(-std::f64::consts::TAU * f64::from(way) / f64::from(WAYS));
            let moved = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| match a[(i, j)] {
                0.0 => 0.0,
                entry => entry + PRINTED_PRECISION * (w[i].conj() * v[j] * turn).re.signum(),
            });
            let values = eigenvalues(&moved)?;
            let cost = DMatrix::from_fn(modes.len(), values.len(), |i, j| {
                distance(modes[i].eigenvalue, values[j])
            });
            most = most.max((values[assign(&cost)[place]] - value).norm());
        }
        moves.push(most);
    }
    Ok(moves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::coax2d::appendix::{Condition, appendix};

    #[test]
    fn a_model_pairs_with_itself() {
        for condition in [Condition::Hover, Condition::Forward] {
            let model = appendix(condition).unwrap();
            let pairs = pair_eigenvalues(&model, &model).unwrap();
            let upper = modes(&model).unwrap().len();
            assert_eq!(pairs.len(), upper);
            for pair in &pairs {
                assert_eq!(pair.distance, 0.0);
                assert!(pair.agrees() && pair.printed.im >= 0.0);
                assert_eq!(pair.printed_name, pair.our_name);
                // Heave and yaw in hover lie so close together that four
                // decimals hardly tell them apart; the rest is well known.
                let blurred = pair.printed.im == 0.0;
                assert!(pair.rounding > 0.0, "{pair:?}");
                assert!(pair.rounding < if blurred { 0.5 } else { 0.1 }, "{pair:?}");
            }
        }
    }

    #[test]
    fn the_bound_of_rounding_holds() {
        let printed = appendix(Condition::Hover).unwrap();
        let pairs = pair_eigenvalues(&printed, &printed).unwrap();
        // Every entry rounded the other way, in a pattern of signs.
        for pattern in [1, 2, 3, 5, 7] {
            let mut matrices = printed.matrices_in(System::Us);
            for (k, entry) in matrices.a.iter_mut().enumerate().filter(|(_, x)| **x != 0.0) {
                *entry += PRINTED_PRECISION * if (k * pattern) % 4 < 2 { 1.0 } else { -1.0 };
            }
            let moved = StateSpace::from_matrices_in(
                System::Us,
                printed.states().to_vec(),
                printed.inputs().to_vec(),
                printed.outputs().to_vec(),
                matrices,
            )
            .unwrap();
            for (pair, whole) in pair_eigenvalues(&printed, &moved).unwrap().iter().zip(&pairs) {
                assert!(pair.distance <= whole.rounding, "{pair:?} {whole:?}");
            }
        }
    }

    #[test]
    fn the_assignment_is_the_cheapest() {
        // Greedy choices, row by row or smallest first, cost more.
        let cost = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 9.0, 1.1, 9.0, 9.0, 9.0, 3.0, 4.0]);
        assert_eq!(assign(&cost), [1, 0, 2]);
        let n = 5;
        let cost = DMatrix::from_fn(n, n, |i, j| (1.0 + 3.7 * (i * n + j) as f64).sin().abs());
        let sum = |columns: &[usize]| (0..n).map(|i| cost[(i, columns[i])]).sum::<f64>();
        let found = sum(&assign(&cost));
        let mut columns: Vec<usize> = (0..n).collect();
        permutations(&mut columns, n, &mut |columns| {
            assert!(sum(columns) >= found - 1e-12, "{columns:?}");
        });
    }

    fn permutations(list: &mut [usize], k: usize, see: &mut impl FnMut(&[usize])) {
        if k <= 1 {
            see(list);
            return;
        }
        for i in 0..k {
            permutations(list, k - 1, see);
            list.swap(if k.is_multiple_of(2) { i } else { 0 }, k - 1);
        }
    }
}
