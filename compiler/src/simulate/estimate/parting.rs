//! When two runs of one model go through other modes.
//!
//! Both are sequences of modes, each with the instant at which it begins. They are the same where one mode after the other
//! is. Events that are closer together than a run is accurate may come in another order, or at once in one run alone: they
//! are a group, and only the mode behind it counts. What one run alone comes to at the end, up to rounding, is none.

use nsd_solver::hybrid::Side;

/// Changes of the mode that are closer than this share of the horizon happen at once: only rounding has told them apart.
const AT_ONCE: f64 = 1e-12;

/// Events of one group, at most.
const MOST: usize = 256;

/// A mode with the instant at which it begins.
type Begins<'r> = (f64, &'r [Side]);

/// Instants this close to each other are not told apart by runs that are known to a share of the horizon.
pub(super) fn closeness(horizon: f64, known: f64) -> f64 {
    horizon * known.max(AT_ONCE)
}

/// When one run first goes on to a mode that the other one does not go through before both end; none where both are the
/// same.
pub(super) fn parted(
    mut one: &[Begins],
    mut other: &[Begins],
    (near, end): (f64, f64),
) -> Option<f64> {
    loop {
        let (a, b) = match (one.first(), other.first()) {
            (None, None) => return None,
            (Some(event), None) | (None, Some(event)) => {
                return (end - event.0 > closeness(end, 0.0)).then_some(event.0);
            }
            (Some(a), Some(b)) => (a, b),
        };
        let (m, n) = if a.1 == b.1 {
            (1, 1)
        } else if let Some(groups) = groups(one, other, near) {
            groups
        } else {
            return Some(a.0.min(b.0));
        };
        (one, other) = (behind(one, m, near), behind(other, n, near));
    }
}

/// The shortest groups of events, one at the start of each sequence, that lead to one mode.
fn groups(one: &[Begins], other: &[Begins], near: f64) -> Option<(usize, usize)> {
    let [lengths, others] = [one, other].map(|all| {
        let first = all[0].0;
        let group = all.iter().take_while(|event| event.0 - first <= near);
        group.take(MOST).count()
    });
    let pairs = (2..=lengths + others).flat_map(|both| {
        let fewest = both.saturating_sub(others).max(1);
        (fewest..=lengths.min(both - 1)).map(move |m| (m, both - m))
    });
    let mut pairs = pairs.filter(|&(m, n)| one[m - 1].1 == other[n - 1].1);
    pairs.next()
}

/// A sequence behind its first n events, and behind jumps at their instant that leave the mode as it is: these may come
/// before what changes it in one run, with it or behind it in the other.
fn behind<'a, 'r>(all: &'a [Begins<'r>], n: usize, near: f64) -> &'a [Begins<'r>] {
    let (first, last) = (all[0].0, all[n - 1].1);
    let rest = &all[n..];
    let is_jump = |event: &&Begins| event.0 - first <= near && event.1 == last;
    &rest[rest.iter().take_while(is_jump).count()..]
}

#[cfg(test)]
mod tests {
    use super::*;
    use Side::{Minus, Plus, Slide};

    const A: &[Side] = &[Plus, Minus];
    const B: &[Side] = &[Minus, Plus];
    const BOTH: &[Side] = &[Plus, Plus];
    const SLIDES: &[Side] = &[Slide, Plus];

    #[test]
    fn events_at_one_instant_have_no_order() {
        let one = [(1.0, A), (1.0 + 1e-9, BOTH), (2.0, B)];
        let other = [(1.0, B), (1.0 + 2e-9, BOTH), (2.1, B)];
        let parted = |one: &[Begins], other: &[Begins], near| parted(one, other, (near, 3.0));
        assert_eq!(parted(&one, &other, 1e-8), None);
        assert_eq!(parted(&one, &[(1.0, BOTH), (2.0, B)], 1e-8), None);
        assert_eq!(parted(&one, &other, 1e-10), Some(1.0));
        let [jump, behind]: [[Begins; 2]; 2] =
            [[(1.0, A), (1.0, BOTH)], [(1.0, BOTH), (1.0 + 1e-12, BOTH)]];
        assert_eq!(parted(&jump, &behind, 1e-8), None);
        assert_eq!(parted(&behind, &jump, 1e-8), None);
        assert_eq!(parted(&jump[1..], &behind, 1e-8), None);
        assert_eq!(parted(&jump[1..], &behind, 1e-13), Some(1.0 + 1e-12));
    }

    #[test]
    fn runs_part_where_one_goes_on_to_another_mode() {
        let one = [(1.0, A), (2.0, BOTH), (3.0, A)];
        let to = |end: f64| {
            move |one: &[Begins], other: &[Begins], near| parted(one, other, (near, end))
        };
        // An event at the end, which rounding takes to either side of it.
        assert_eq!(to(3.0 + 1e-13)(&one, &one[..2], 1e-8), None);
        assert_eq!(to(3.0)(&one[..2], &one, 1e-8), None);
        assert_eq!(to(3.0)(&one, &one[..1], 1e-8), Some(2.0));
        assert_eq!(to(3.0 + 1e-9)(&one, &one[..2], 1e-8), Some(3.0));
        let parted = to(4.0);
        // As many modes, but others.
        assert_eq!(
            parted(&one, &[(1.0, A), (2.1, SLIDES), (3.0, A)], 1e-8),
            Some(2.0)
        );
        assert_eq!(parted(&one, &one[..2], 1e-8), Some(3.0));
        assert_eq!(parted(&[], &one, 1e-8), Some(1.0));
        assert_eq!(parted(&[], &[], 1e-8), None);
    }
}
