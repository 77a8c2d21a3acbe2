//! Where a polynomial comes close to zero and turns back.

use crate::expansion::series;

/// How a polynomial of one sign turns away from zero within an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Turn {
    /// Not at all, or only far from zero.
    None,
    /// Once, at the start of the interval.
    Start,
    /// Once, inside.
    Inside,
    /// Once, at the end.
    End,
    /// Maybe more than once.
    Several,
}

/// Slopes below this fraction of the largest are zero.
const FLAT: f64 = 1e-10;

/// What Bernstein coefficients of one sign, which are the slopes of no more turns than their differences
/// have changes of sign, say about turns no farther than `level` from zero.
pub(crate) fn turn(b: &[f64], level: f64) -> Turn {
    if level <= 0.0 || b.iter().all(|b| b.abs() > level) {
        return Turn::None;
    }
    let side = b[0].signum();
    let slopes = || b.windows(2).map(|pair| side * (pair[1] - pair[0]));
    let flat = FLAT * slopes().fold(0.0_f64, |m, slope| m.max(slope.abs()));
    let mut signs = slopes().filter(|slope| slope.abs() > flat);
    let Some(first) = signs.next() else {
        return Turn::None;
    };
    let (mut last, mut changes) = (first, 0);
    for slope in signs {
        changes += usize::from(slope * last < 0.0);
        last = slope;
    }
    let is_flat = |slope: Option<f64>| slope.is_some_and(|slope| slope.abs() <= flat);
    let starts = first > 0.0 && is_flat(slopes().next());
    let ends = last < 0.0 && is_flat(slopes().next_back());
    match (changes, starts, ends) {
        (0, false, false) => Turn::None,
        (0 | 1, true, false) => Turn::Start,
        (0 | 1, false, true) => Turn::End,
        (1, false, false) if first < 0.0 => Turn::Inside,
        (1, false, false) => Turn::None,
        _ => Turn::Several,
    }
}

/// Where c, of one sign between `low` and `high`, is closest to zero, by bisection on its slope.
pub(crate) fn lowest(c: &[f64], mut low: f64, mut high: f64) -> f64 {
    let side = series::value(c, low).signum();
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if side * series::slope(c, middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use crate::events::roots::RootFinder;

    /// Where c turns back, closer to zero than `level`.
    fn close(c: &[f64], h: f64, level: f64) -> Vec<f64> {
        let mut roots = RootFinder::new(8);
        roots.first(c[0], &c[1..], h, level);
        roots.close
    }

    fn assert_close(found: &[f64], exact: &[f64]) {
        assert_eq!(found.len(), exact.len(), "{found:?} {exact:?}");
        for (found, exact) in found.iter().zip(exact) {
            assert!((found - exact).abs() < 1e-7, "{found:?} {exact:?}");
        }
    }

    #[test]
    fn a_minimum_is_found_wherever_it_is() {
        for sign in [1.0, -1.0] {
            // (t - 1)² + 1e-5.
            let c = [1.0 + 1e-5, -2.0, 1.0].map(|c| sign * c);
            for h in [1.7, 2.0, 4.0] {
                assert_close(&close(&c, h, 1e-4), &[1.0]);
                assert_close(&close(&c, h, 1e-6), &[]);
            }
            assert_close(&close(&c, 1.0, 1e-4), &[1.0]);
            assert_close(&close(&c, 0.9, 1e-4), &[]);
            assert_close(&close(&[sign * 1e-5, 0.0, sign], 1.0, 1e-4), &[0.0]);
        }
    }

    #[test]
    fn two_minima_of_one_step() {
        // (t - 1)² (t - 3)² + 1e-6.
        let c = [9.0 + 1e-6, -24.0, 22.0, -8.0, 1.0];
        for h in [4.0, 5.3] {
            assert_close(&close(&c, h, 1e-5), &[1.0, 3.0]);
        }
        assert_close(&close(&c, 2.9, 1e-5), &[1.0]);
    }

    #[test]
    fn a_maximum_of_a_small_polynomial_is_no_approach() {
        assert_close(&close(&[0.1, 1.0, -0.5], 1.5, 10.0), &[]);
        // Falls towards zero and does not turn.
        assert_close(&close(&[1.0, -1.0, 0.1], 1.0, 1.0), &[]);
    }
}
