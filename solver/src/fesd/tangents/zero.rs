//! What is zero where an element starts or ends, and has to stay so to first order.

use super::active::Here;
use crate::fesd::system::{ComplementaritySystem, Reduced};
use crate::linalg::{DenseLu, Singular};
use crate::sensitivity::{Moved, Slope, is_off};

/// What is known of a point.
pub(super) struct Known<'a> {
    pub t: f64,
    /// The share of its terms up to which a member is zero, and how far the instant may be off.
    pub share: f64,
    pub instant: f64,
    /// How large states have been.
    pub sizes: &'a [f64],
}

/// How a function changes in time.
pub(super) fn rate(slope: &Slope, f: &[f64]) -> f64 {
    let terms = slope.x.iter().zip(f).map(|(slope, f)| slope * f);
    slope.time + terms.sum::<f64>()
}

/// How large its terms are, by the sizes of states.
pub(super) fn weigh(slope: &Slope, size: impl Fn(usize) -> f64) -> f64 {
    let terms = slope.x.iter().enumerate();
    terms.map(|(i, slope)| slope.abs() * size(i)).sum()
}

impl Here {
    /// The watched members that are zero, as far as is known.
    pub fn zero<'a>(&'a self, known: &'a Known<'a>) -> impl Iterator<Item = usize> + 'a {
        let is_zero = |(value, slope): &(f64, Slope)| {
            let terms = weigh(slope, |i| known.sizes[i]) + (slope.time * known.t).abs();
            let moves = rate(slope, &self.f).abs() * known.instant;
            value.abs() <= known.share * terms + moves
        };
        (0..self.members.len()).filter(move |&k| is_zero(&self.members[k]))
    }

    /// The first of some members that does not stay zero in a direction.
    pub fn left(
        &self,
        mut members: impl Iterator<Item = usize>,
        moved: Moved,
        direction: usize,
    ) -> Option<usize> {
        members.find(|&k| is_left(&self.members[k].1, moved, direction))
    }

    /// Whether what the active set keeps at zero does not stay so in a direction.
    pub fn is_not_kept(&self, moved: Moved, direction: usize) -> bool {
        self.kept
            .iter()
            .any(|slope| is_left(slope, moved, direction))
    }

    /// The tangent of the states that equations determine, for one of the others.
    ///
    /// # Errors
    ///
    /// Where they do not determine it.
    pub fn keep(
        &self,
        algebraic: &[usize],
        x: &mut [f64],
        direction: usize,
    ) -> Result<(), Singular> {
        algebraic.iter().for_each(|&i| x[i] = 0.0);
        let m = algebraic.len();
        let (mut matrix, mut rhs) = (vec![0.0; m * m], vec![0.0; m]);
        for slope in &self.kept {
            let own: Vec<f64> = algebraic.iter().map(|&i| slope.x[i]).collect();
            let [off, _] = slope.along(Moved::still(x), direction);
            for (j, a) in own.iter().enumerate() {
                rhs[j] -= a * off;
                own.iter()
                    .enumerate()
                    .for_each(|(k, b)| matrix[j * m + k] += a * b);
            }
        }
        let mut lu = DenseLu::new(m);
        lu.factor(&matrix)?;
        lu.solve(&mut rhs);
        algebraic
            .iter()
            .zip(rhs)
            .for_each(|(&i, value)| x[i] = value);
        Ok(())
    }
}

fn is_left(slope: &Slope, moved: Moved, direction: usize) -> bool {
    let [sum, size] = slope.along(moved, direction);
    is_off(sum, size)
}

/// The switches that a watched member is about.
pub(super) fn switches(
    system: &ComplementaritySystem,
    reduced: &Reduced,
    member: usize,
) -> Vec<usize> {
    let watched = reduced.watched.get(member);
    watched.map_or(Vec::new(), |watched| {
        system.switches_of[watched.pair].clone()
    })
}
