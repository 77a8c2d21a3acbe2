//! Polynomials in numerical time as polynomials in physical time, where the clock is slower.
//!
//! With t = c(τ) and the series of its inverse τ = g(t), a state x(τ) is x(g(t)). Where contacts last,
//! x' = Π ϑ_k f + Σ (1 - ϑ_k) a_k n_k and t' = Π ϑ_k, so that contact k has the force
//!
//! λ_k = a_k (1 - ϑ_k) g'(t).

use nsd_solver::expansion::Polynomials;

/// A contact that lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lasting {
    /// Its switch in the original.
    pub contact: usize,
    /// The switch of the gap's rate, whose α is ϑ.
    pub speed: usize,
    /// a
    pub strength: f64,
}

/// The series of a segment, one row each.
pub(crate) struct Stretched {
    degree: usize,
    n_states: usize,
    rows: Vec<Vec<f64>>,
    blind: Vec<usize>,
}

impl Stretched {
    /// For the first states; `lasting` are contacts, `places` say where other switches are that slide.
    pub fn new(
        inner: &dyn Polynomials,
        clock: usize,
        n_states: usize,
        places: &[Option<usize>],
        lasting: &[Lasting],
    ) -> Self {
        let degree = inner.degree();
        let inverse = inverse(&inner.x(clock)[..=degree]);
        let state = |i: usize| compose(&inner.x(i)[..=degree], &inverse);
        let slope = |k: usize| inverse.get(k + 1).map_or(0.0, |g| (k + 1) as f64 * g);
        let pace: Vec<f64> = (0..=degree).map(slope).collect();
        let free = |contact: &Lasting| compose(&inner.alpha(contact.speed)[..=degree], &inverse);
        let free: Vec<Vec<f64>> = lasting.iter().map(free).collect();
        // 1 - λ
        let closed = |k: usize| {
            let mut share: Vec<f64> = free[k].iter().map(|c| -lasting[k].strength * c).collect();
            share[0] += lasting[k].strength;
            let force = product(&share, &pace);
            let mut alpha: Vec<f64> = force.iter().map(|c| -c).collect();
            alpha[0] += 1.0;
            alpha
        };
        let alpha = |(switch, place): (usize, &Option<usize>)| match lasting
            .iter()
            .position(|contact| contact.contact == switch)
        {
            Some(k) => closed(k),
            None => place.map_or_else(
                || constant(1.0, degree),
                |place| compose(&inner.alpha(place)[..=degree], &inverse),
            ),
        };
        Stretched {
            degree,
            n_states,
            rows: (0..n_states)
                .map(state)
                .chain(places.iter().enumerate().map(alpha))
                .collect(),
            blind: Vec::new(),
        }
    }

    /// Without knowing α of these switches.
    pub fn without(mut self, blind: &[usize]) -> Self {
        self.blind = blind.to_vec();
        self
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

    fn unobserved(&self) -> &[usize] {
        &self.blind
    }
}

/// A constant as a series.
pub(super) fn constant(value: f64, degree: usize) -> Vec<f64> {
    let mut series = vec![0.0; degree + 1];
    series[0] = value;
    series
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
    use super::{Lasting, Polynomials, Stretched, compose, inverse};

    /// A state that is the clock, and the ϑ of two contacts.
    struct Two([Vec<f64>; 3]);

    impl Polynomials for Two {
        fn degree(&self) -> usize {
            1
        }

        fn x(&self, _: usize) -> &[f64] {
            &self.0[0]
        }

        fn alpha(&self, switch: usize) -> &[f64] {
            &self.0[1 + switch]
        }
    }

    #[test]
    fn contacts_that_last_together_have_forces_of_their_own() {
        // ϑ = 3/4 and 1/2, t' = 3/8: in physical time the forces are a₁ (1/4)/(3/8) and a₂ (1/2)/(3/8).
        let inner = Two([vec![0.0, 0.375], vec![0.75, 0.0], vec![0.5, 0.0]]);
        let contact = |contact: usize, strength: f64| Lasting {
            contact,
            speed: contact,
            strength,
        };
        let seen = Stretched::new(
            &inner,
            0,
            1,
            &[None, None],
            &[contact(0, 3.0), contact(1, 9.0)],
        );
        assert!((1.0 - seen.alpha(0)[0] - 2.0).abs() <= 1e-14);
        assert!((1.0 - seen.alpha(1)[0] - 12.0).abs() <= 1e-14);
    }

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
