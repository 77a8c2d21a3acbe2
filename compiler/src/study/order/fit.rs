//! Slopes of straight lines through points in logarithmic axes.
//!
//! error ≈ C knob^p holds for small knobs only, and down to the accuracy of the reference. The line is
//! fitted to errors between the two: coarse runs are left out while the slopes of both halves of the
//! rest differ, up to one half of the runs.

use super::{COARSE, Point, Reference};

/// Points that a line needs.
const FEWEST: usize = 3;
/// Errors that are this much larger than the accuracy of the reference are known to a few percent at
/// worst, on average over the points of a line.
const ABOVE_FLOOR: f64 = 3.0;
/// Least errors below this, relative to the size of the state, may be those of rounding; what is this
/// much larger is not.
const NEAR_ROUNDING: f64 = 1e-8;
const ABOVE_LEAST: f64 = 5.0;
/// Slopes of two halves that differ by this share of one are the same.
const SETTLED: f64 = 0.05;

/// A line through errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// p of error ≈ C knob^p.
    pub order: f64,
    /// Its standard error, as the scatter about the line says.
    pub spread: f64,
    /// Places of the runs it goes through, ascending.
    pub used: Vec<usize>,
}

/// p of error ≈ C knob^p by least squares, over the errors that are about convergence.
pub fn order(points: &[Point], reference: &Reference) -> Option<Fit> {
    let (level, last) = rounding(points, reference);
    let range = level..COARSE * reference.size;
    let known = points.iter().enumerate().take(last + 1);
    let known = known.filter_map(|(at, point)| {
        let error = *point.error.as_ref().ok()?;
        range
            .contains(&error)
            .then(|| (at, (point.knob.ln(), error.ln())))
    });
    let (places, logs): (Vec<usize>, Vec<(f64, f64)>) = known.unzip();
    let most = logs.len() / 2;
    let settled = (0..=most).find(|&first| has_settled(&logs[first..]));
    let first = settled.unwrap_or(most);
    let first = first.min(logs.len().saturating_sub(FEWEST));
    let (order, spread) = line(&logs[first..])?;
    Some(Fit {
        order,
        spread,
        used: places[first..].to_vec(),
    })
}

/// Errors below this are those of the reference or rounding, and the last run that may be used: where
/// errors fall as low as rounding can be, the least of them says what rounding is, and finer runs than
/// that one are no better. The median of each error and its neighbours counts, so that no error is low
/// by chance.
fn rounding(points: &[Point], reference: &Reference) -> (f64, usize) {
    let known = points.iter().enumerate();
    let known = known.filter_map(|(at, point)| Some((at, *point.error.as_ref().ok()?)));
    let known: Vec<(usize, f64)> = known.collect();
    let median = |three: &[(usize, f64)]| {
        let [mut a, mut b, c] = [three[0].1, three[1].1, three[2].1];
        if a > b {
            std::mem::swap(&mut a, &mut b);
        }
        (three[1].0, c.clamp(a, b))
    };
    let medians = known.windows(3).map(median);
    let least = medians.min_by(|a, b| a.1.total_cmp(&b.1));
    let level = ABOVE_FLOOR * reference.floor;
    match least.filter(|(_, error)| *error < NEAR_ROUNDING * reference.size) {
        Some((at, error)) => (level.max(ABOVE_LEAST * error), at),
        None => (level, points.len()),
    }
}

/// Whether both halves have one slope.
fn has_settled(points: &[(f64, f64)]) -> bool {
    let half = points.len().div_ceil(2).max(FEWEST);
    let Some(rest) = points.len().checked_sub(half) else {
        return true;
    };
    match (line(&points[..half]), line(&points[rest..])) {
        (Some((coarse, _)), Some((fine, _))) => (coarse - fine).abs() <= SETTLED * fine.abs(),
        _ => true,
    }
}

/// The slope from the point before each; none at the first, and where a run failed.
pub fn local_orders(points: &[Point]) -> Vec<Option<f64>> {
    let log = |point: &Point| {
        let error = point.error.as_ref().ok().filter(|error| **error > 0.0)?;
        Some((point.knob.ln(), error.ln()))
    };
    let between = |pair: &[Point]| {
        let (a, b) = (log(&pair[0])?, log(&pair[1])?);
        Some((b.1 - a.1) / (b.0 - a.0))
    };
    let rest = points.windows(2).map(between);
    points.iter().take(1).map(|_| None).chain(rest).collect()
}

/// The slope Σ (x - x̄)(y - ȳ) / Σ (x - x̄)² and its standard error, √(Σ r²/(n - 2) / Σ (x - x̄)²) with
/// the residuals r.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    if points.len() < FEWEST {
        return None;
    }
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let (x, y) = (x / n, y / n);
    let (above, below) = points.iter().fold((0.0, 0.0), |s, p| {
        let dx = p.0 - x;
        (s.0 + dx * (p.1 - y), s.1 + dx * dx)
    });
    let slope = (below > 0.0).then(|| above / below)?;
    let residual = |p: &(f64, f64)| p.1 - y - slope * (p.0 - x);
    let squares: f64 = points.iter().map(|p| residual(p).powi(2)).sum();
    Some((slope, (squares / (n - 2.0) / below).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::super::{Point, Reference};
    use super::{local_orders, order};

    fn point(knob: f64, error: Result<f64, String>) -> Point {
        Point {
            knob,
            steps: 1,
            step: knob,
            error,
            seconds: 1.0,
        }
    }

    fn reference() -> Reference {
        Reference {
            x: vec![2.0],
            source: String::new(),
            remark: None,
            floor: 1e-9,
            size: 2.0,
        }
    }

    #[test]
    fn a_power_is_found_between_what_is_coarse_and_the_floor() {
        let mut points = vec![point(1.0, Ok(0.9)), point(0.5, Err("no".into()))];
        points.extend([0.1, 0.05, 0.02].map(|h: f64| point(h, Ok(3.0 * h.powi(4)))));
        points.extend([0.001, 0.0005].map(|h| point(h, Ok(2e-10))));
        let found = order(&points, &reference()).expect("three errors are in range");
        assert!((found.order - 4.0).abs() < 1e-12, "{found:?}");
        assert!(found.spread < 1e-10, "{found:?}");
        assert_eq!(found.used, [2, 3, 4]);
        let local = local_orders(&points);
        assert_eq!(local.len(), points.len());
        assert!(local[..3].iter().all(Option::is_none));
        assert!((local[3].expect("both ran") - 4.0).abs() < 1e-12);
        assert_eq!(order(&points[..4], &reference()), None);
    }

    #[test]
    fn coarse_runs_are_left_out_until_the_slopes_agree() {
        // h⁴ (1 + (10 h)⁴): of order 8 where h is large.
        let error = |h: f64| 10.0 * h.powi(4) * (1.0 + (10.0 * h).powi(4));
        let sizes: Vec<f64> = (0..12).map(|k| 0.4 * 0.7_f64.powi(k)).collect();
        let points: Vec<Point> = sizes.iter().map(|&h| point(h, Ok(error(h)))).collect();
        let found = order(&points, &reference()).expect("there are errors in range");
        assert!((found.order - 4.0).abs() < 0.2, "{found:?}");
        let last = sizes.len() - 1;
        assert_eq!(found.used.last(), Some(&last));
        assert!(found.used[0] >= 2, "{found:?}");
        assert!(found.used.len() >= last / 2, "{found:?}");
    }

    #[test]
    fn rounding_is_no_convergence() {
        // h⁶, and what rounding adds up to over many steps.
        let error = |h: f64| h.powi(6) + 1e-8 * (1e-2 / h);
        let sizes: Vec<f64> = (0..24).map(|k| 0.5 * 0.8_f64.powi(k)).collect();
        let points: Vec<Point> = sizes.iter().map(|&h| point(h, Ok(error(h)))).collect();
        let reference = Reference {
            floor: 1e-13,
            ..reference()
        };
        let found = order(&points, &reference).expect("there are errors in range");
        assert!((found.order - 6.0).abs() < 0.3, "{found:?}");
    }

    #[test]
    fn scatter_is_told() {
        // Errors twice and half as large in turn: the line is between them.
        let error = |k: i32| 2.0_f64.powi(if k % 2 == 0 { 1 } else { -1 });
        let sizes = (0..8).map(|k| (k, 0.1 * 0.5_f64.powi(k)));
        let points: Vec<Point> = sizes.map(|(k, h)| point(h, Ok(error(k) * h * h))).collect();
        let found = order(&points, &reference()).expect("there are errors in range");
        assert!((found.order - 2.0).abs() < 2.0 * found.spread, "{found:?}");
        assert!(found.spread > 0.1, "{found:?}");
    }
}
