//! Signs and sizes of truncated Taylor series.

use wide::f64x4;

/// Σ c[k] τᵏ.
pub(crate) fn value(c: &[f64], tau: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * tau + c)
}

/// Σ c[k] τᵏ and its derivative.
pub(crate) fn value_and_slope(c: &[f64], tau: f64) -> [f64; 2] {
    let next = |[value, slope]: [f64; 2], c: &f64| [value * tau + c, slope * tau + value];
    c.iter().rev().fold([0.0, 0.0], next)
}

/// Σ c[k] τᵏ at several τ side by side.
pub(crate) fn values(c: &[f64], tau: f64x4) -> f64x4 {
    let sum = f64x4::splat(0.0);
    c.iter()
        .rev()
        .fold(sum, |sum, &c| sum * tau + f64x4::splat(c))
}

/// Σ c[k] τᵏ and its derivative at several τ side by side.
pub(crate) fn values_and_slopes(c: &[f64], tau: f64x4) -> [f64x4; 2] {
    let (mut values, mut slopes) = (f64x4::splat(0.0), f64x4::splat(0.0));
    for &c in c.iter().rev() {
        slopes = slopes * tau + values;
        values = values * tau + f64x4::splat(c);
    }
    [values, slopes]
}

/// Derivative of Σ c[k] τᵏ.
pub(crate) fn slope(c: &[f64], tau: f64) -> f64 {
    c.iter()
        .enumerate()
        .skip(1)
        .rev()
        .fold(0.0, |sum, (k, c)| sum * tau + k as f64 * c)
}

/// What the derivative of Σ c[k] τᵏ is at most between -τ and τ.
pub(crate) fn steepest(c: &[f64], tau: f64) -> f64 {
    c.iter()
        .enumerate()
        .skip(1)
        .rev()
        .fold(0.0, |sum, (k, c)| sum * tau + k as f64 * c.abs())
}

/// How far Σ c[k] τᵏ moves at most within a radius of τ: as its slopes up to there allow, or that at τ and second
/// derivatives, which know where it is at rest.
pub(crate) fn motion(c: &[f64], tau: f64, radius: f64) -> f64 {
    let bend = c.iter().enumerate().skip(2).rev().fold(0.0, |sum, (k, c)| {
        sum * (tau + radius) + (k * (k - 1)) as f64 * c.abs()
    });
    let bent = slope(c, tau).abs() + 0.5 * bend * radius;
    radius * bent.min(steepest(c, tau + radius))
}

/// Second derivative of Σ c[k] τᵏ.
pub(crate) fn curvature(c: &[f64], tau: f64) -> f64 {
    c.iter()
        .enumerate()
        .skip(2)
        .rev()
        .fold(0.0, |sum, (k, c)| sum * tau + (k * (k - 1)) as f64 * c)
}

/// The first N coefficients of Σ c[j] τʲ as a series around τ, by Horner's scheme for all of them at once.
pub(crate) fn around<const N: usize>(c: &[f64], tau: f64) -> [f64; N] {
    let mut around = [0.0; N];
    for c in c.iter().rev() {
        for k in (1..N).rev() {
            around[k] = around[k] * tau + around[k - 1];
        }
        around[0] = around[0] * tau + c;
    }
    around
}

/// Largest |c[k]| hᵏ from k = `from`.
pub(crate) fn magnitude(c: &[f64], h: f64, from: usize) -> f64 {
    if h == 0.0 && from == 0 {
        return c.first().map_or(0.0, |c| c.abs().max(0.0));
    }
    let mut power = h.powi(from as i32);
    let mut largest = 0.0_f64;
    for c in &c[from..] {
        let term = c.abs() * power;
        // Unlike `max`, one instruction; NaN is passed over by both.
        if term > largest {
            largest = term;
        }
        power *= h;
    }
    largest
}

/// Σ |c[k]| hᵏ from k = 1: how far the series may move from its start within h.
pub(crate) fn reach(c: &[f64], h: f64) -> f64 {
    c[1..].iter().rev().fold(0.0, |sum, c| (sum + c.abs()) * h)
}

/// Below this fraction of its largest term within the step, what a series does is rounding.
const NEGLIGIBLE: f64 = 1e-13;

/// The k ≥ 1 whose term is the largest when the series leaves `band`, or rounding, within [0, h];
/// none if it stays inside. What it does before is too small to see.
pub(crate) fn leading(c: &[f64], h: f64, band: f64) -> Option<usize> {
    let largest = magnitude(c, h, 1);
    if largest <= band || !largest.is_finite() {
        return None;
    }
    let level = band.max(NEGLIGIBLE * largest);
    let terms = c.iter().copied().enumerate().skip(1);
    soonest(level, terms).map(|(k, _)| k)
}

/// The k for which |c_k| τᵏ comes to a level first, and that τ.
pub(crate) fn soonest(
    level: f64,
    terms: impl Iterator<Item = (usize, f64)>,
) -> Option<(usize, f64)> {
    let mut found = None;
    let mut first = f64::INFINITY;
    for (k, c) in terms {
        // A root is taken only of what is there before the others.
        if c.abs() * first.powi(k as i32) > level {
            first = (level / c.abs()).powf(1.0 / k as f64);
            found = Some((k, first));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_in_front_is_passed_over() {
        assert_eq!(leading(&[1e-17, 1e-16, -2.0, 1.0], 0.1, 0.0), Some(2));
        assert_eq!(leading(&[0.0, 1e-16, 1e-15], 0.1, 1e-12), None);
    }

    #[test]
    fn an_excursion_as_small_as_rounding_is_passed_over() {
        // Rises for τ < 1e-8 to 2.5e-17, then falls.
        assert_eq!(leading(&[0.0, 1e-8, -1.0], 1.0, 1e-12), Some(2));
        assert_eq!(leading(&[0.0, 1e-5, -1.0], 1.0, 1e-12), Some(1));
    }

    #[test]
    fn value_and_slope() {
        let c = [1.0, 2.0, 3.0];
        let tau = f64x4::from([2.0, 0.0, 1.0, -1.0]);
        let [values, slopes] = values_and_slopes(&c, tau);
        assert_eq!(values.to_array(), [17.0, 1.0, 6.0, 2.0]);
        assert_eq!(slopes.to_array(), [14.0, 2.0, 8.0, -4.0]);
        assert_eq!(super::values(&c, tau).to_array(), values.to_array());
        assert_eq!(
            (value(&c, 2.0), slope(&c, 2.0), magnitude(&c, 2.0, 1)),
            (17.0, 14.0, 12.0)
        );
        // (1 - τ)² moves by no more than 2 dr + r² at a distance d from its root.
        let parabola = [1.0, -2.0, 1.0];
        assert!((motion(&parabola, 0.99, 0.01) - 3e-4).abs() < 1e-15);
        assert_eq!(motion(&[1.0, -2.0], 0.5, 0.25), 0.5);
        assert_eq!(around::<4>(&c, 2.0), [17.0, 14.0, 3.0, 0.0]);
    }
}
