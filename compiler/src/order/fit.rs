//! Slopes of straight lines through points in logarithmic axes.

use super::{COARSE, Point, Reference};

/// Points that a line needs.
const FEWEST: usize = 3;

/// p of error ≈ C knob^p by least squares, over the errors that are about convergence.
pub fn order(points: &[Point], reference: &Reference) -> Option<f64> {
    let range = reference.floor..COARSE * reference.size;
    let logs = points.iter().filter_map(|point| {
        let error = *point.error.as_ref().ok()?;
        range
            .contains(&error)
            .then(|| (point.knob.ln(), error.ln()))
    });
    slope(&logs.collect::<Vec<_>>())
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

/// Σ (x - x̄)(y - ȳ) / Σ (x - x̄)².
fn slope(points: &[(f64, f64)]) -> Option<f64> {
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
    (below > 0.0).then(|| above / below)
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

    #[test]
    fn a_power_is_found_between_what_is_coarse_and_the_floor() {
        let reference = Reference {
            x: vec![2.0],
            source: String::new(),
            remark: None,
            floor: 1e-9,
            size: 2.0,
        };
        let mut points = vec![point(1.0, Ok(0.9)), point(0.5, Err("no".into()))];
        points.extend([0.1, 0.05, 0.01].map(|h: f64| point(h, Ok(3.0 * h.powi(4)))));
        points.extend([0.001, 0.0005].map(|h| point(h, Ok(2e-10))));
        let found = order(&points, &reference).expect("three errors are in range");
        assert!((found - 4.0).abs() < 1e-12, "{found}");
        let local = local_orders(&points);
        assert_eq!(local.len(), points.len());
        assert!(local[..3].iter().all(Option::is_none));
        assert!((local[3].expect("both ran") - 4.0).abs() < 1e-12);
        assert_eq!(order(&points[..4], &reference), None);
    }
}
