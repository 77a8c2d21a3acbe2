//! Polynomials in numerical time as polynomials in physical time, where the clock is slower.
//!
//! With t = c(τ) and the series of its inverse τ = g(t), a state x(τ) is x(g(t)); λ = a (τ'(t) - 1) is the force of
//! a contact that lasts.

use nsd_solver::simulate::Polynomials;

/// The series of a segment, one row each.
pub(super) struct Stretched {
    degree: usize,
    n_states: usize,
    rows: Vec<Vec<f64>>,
}

impl Stretched {
    /// For the first states; `forces` are the strengths a of switches that are contacts, `places` say where others
    /// are that slide.
    pub fn new(
        inner: &dyn Polynomials,
        clock: usize,
        n_states: usize,
        places: &[Option<usize>],
        forces: &[Option<f64>],
    ) -> Self {
        let degree = inner.degree();
        let inverse = inverse(&inner.x(clock)[..=degree]);
        let state = |i: usize| compose(&inner.x(i)[..=degree], &inverse);
        let alpha = |(place, force): (&Option<usize>, &Option<f64>)| match (place, force) {
            (_, Some(strength)) => {
                let slope = |k: usize| inverse.get(k + 1).map_or(0.0, |g| (k + 1) as f64 * g);
                let mut alpha: Vec<f64> = (0..=degree).map(|k| -strength * slope(k)).collect();
                alpha[0] += 1.0 + strength;
                alpha
            }
            (Some(place), None) => compose(&inner.alpha(*place)[..=degree], &inverse),
            (None, None) => Vec::new(),
        };
        Stretched {
            degree,
            n_states,
            rows: (0..n_states)
                .map(state)
                .chain(places.iter().zip(forces).map(alpha))
                .collect(),
        }
    }
}

impl Polynomials for Stretched {
    fn degree(&self) -> usize {
        self.degree
    }

    fn x(&self, i: usize) -> &[f64] {
        &self.rows[i]
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        &self.rows[self.n_states + switch]
    }
}

/// a b, up to the degree of a.
fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let coefficient = |n: usize| (0..=n).map(|k| a[k] * b[n - k]).sum();
    (0..a.len()).map(coefficient).collect()
}

/// g with c(g(t)) = c(0) + t: one coefficient follows from those before.
fn inverse(c: &[f64]) -> Vec<f64> {
    let mut g = vec![0.0; c.len()];
    if let Some(first) = g.get_mut(1) {
        *first = 1.0 / c[1];
    }
    for n in 2..c.len() {
        let mut power = g[..=n].to_vec();
        let mut sum = 0.0;
        for slope in &c[2..=n] {
            power = product(&power, &g[..=n]);
            sum += slope * power[n];
        }
        g[n] = -sum / c[1];
    }
    g
}

/// x(g(t))
fn compose(x: &[f64], g: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; x.len()];
    for &coefficient in x.iter().rev() {
        sum = product(&sum, g);
        sum[0] += coefficient;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{compose, inverse};

    #[test]
    fn a_series_of_its_inverse_is_the_identity() {
        // t = 3 + e^τ - 1 has τ = log(1 + t).
        let c = [3.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0];
        let g = inverse(&c);
        for (k, g) in g.iter().enumerate().skip(1) {
            let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
            assert!((g - sign / k as f64).abs() <= 1e-15, "{k}: {g}");
        }
        let identity = compose(&c, &g);
        let expected = [3.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let pairs = identity.iter().zip(expected);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-15));
    }
}
