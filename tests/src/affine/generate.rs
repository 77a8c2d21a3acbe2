//! Systems from seeds.

use nalgebra::{DMatrix, DVector};

use super::{Affine, Form, Kind, Surface};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [-1, 1), a multiple of 1/1024: sums and products of few such numbers are exact.
    pub(crate) fn dyadic(&mut self) -> f64 {
        (self.bits() % 2048) as f64 / 1024.0 - 1.0
    }

    /// In [lo, hi), of numbers that are multiples of 1/64.
    pub(crate) fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * 0.5 * (self.dyadic() + 1.0)
    }

    /// One of the first `n` numbers.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// Rounds to a multiple of 1/1024.
fn dyadic(x: f64) -> f64 {
    (x * 1024.0).round() / 1024.0
}

impl Affine {
    /// The system of a seed: 2 to 8 states, 1 to 4 surfaces.
    pub fn random(seed: u64) -> Self {
        Affine::generate(seed, false)
    }

    /// The same, with a second surface that is turned against the first by a thousandth.
    pub fn nearly_parallel(seed: u64) -> Self {
        Affine::generate(seed, true)
    }

    fn generate(seed: u64, nearly_parallel: bool) -> Self {
        let mut random = Random(seed);
        let (n, m) = (2 + random.below(7), [1, 2, 3, 4, 4][random.below(5)]);
        let form = [Form::Regions, Form::Terms, Form::Mixed][random.below(3)];

        // Turns at about two radians per unit of time and shrinks slowly.
        let mut field = DMatrix::from_fn(n, n + 2, |_, _| random.dyadic());
        for i in 0..n {
            field[(i, i)] -= 0.5;
            field[(i, n + 1)] *= 0.5;
        }
        for i in 1..n {
            field[(i - 1, i)] += 2.0;
            field[(i, i - 1)] -= 2.0;
        }
        let start = DVector::from_fn(n, |_, _| 2.0 * random.dyadic());

        // From surfaces that attract to surfaces that repel.
        let attraction = [-1.0, 2.0, 4.0, 8.0, 12.0][random.below(5)];
        let wildness = [0.25, 1.0][random.below(2)];
        let on_surface = random.below(4) == 0;
        let mut first: Option<DVector<f64>> = None;
        let surfaces = (0..m).map(|i| {
            let kind = match random.below(16) {
                0 => Kind::Kink,
                1 => Kind::Cross,
                _ => Kind::Jump,
            };
            let mut normal = DVector::from_fn(n + 2, |_, _| random.dyadic());
            // Not small, so that the multiple of it below points across the surface.
            normal[i % n] += if normal[i % n] < 0.0 { -1.0 } else { 1.0 };
            normal[n] *= 0.5;
            if random.below(4) > 0 {
                normal[n + 1] = 0.0;
            }
            if on_surface && i == 0 {
                normal[n] = -normal.rows(0, n).dot(&start);
            }
            if let (Some(first), 1, true) = (&first, i, nearly_parallel) {
                normal.clone_from(first);
                normal[random.below(n)] += 1.0 / 1024.0;
            }
            first.get_or_insert_with(|| normal.clone());
            let x = normal.rows(0, n);
            let pull = attraction / x.norm_squared();
            let constant =
                DVector::from_fn(n, |k, _| dyadic(wildness * random.dyadic() - pull * x[k]));
            let slope = DVector::from_fn(n, |_, _| 0.5 * random.dyadic());
            let mut jump = match kind {
                Kind::Jump | Kind::Kink => slope * normal.transpose(),
                Kind::Cross => DMatrix::from_fn(n, n + 2, |_, _| 0.25 * random.dyadic()),
            };
            if kind != Kind::Kink {
                jump.set_column(n, &(jump.column(n) + constant));
            }
            Surface { normal, jump, kind }
        });
        let surfaces = surfaces.collect();
        Affine {
            n,
            field,
            surfaces,
            start,
            horizon: 1.0 + random.below(4) as f64,
            form,
        }
    }
}
