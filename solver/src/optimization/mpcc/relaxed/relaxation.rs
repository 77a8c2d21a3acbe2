//! Relaxations of 0 <= a ⟂ b >= 0 with a parameter σ >= 0; t = √σ.
//!
//! Each replaces the product ab = 0 by rows Φ(a, b, σ) <= 0, and relaxes a, b >= 0 where its definition asks for it.
//! The boundary of every one passes through (t, t) and tends to the two half-axes as σ -> 0.

use std::f64::consts::PI;

use super::dual::Dual;

/// How a pair is relaxed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Relaxation {
    /// ab <= σ. Scholtes 2001.
    #[default]
    Scholtes,
    /// a + b - √(a² + b² + 2σ) <= 0. Fischer 1992, Burmeister; smoothed as by Kanzow 1996.
    FischerBurmeister,
    /// ½ (a + b - √((a - b)² + 4σ)) <= 0, the smoothed minimum. Chen and Harker 1993, Kanzow 1996.
    NaturalResidual,
    /// Half of Fischer and Burmeister's function and half of ab - σ. Chen, Chen and Kanzow 2000.
    ChenChenKanzow,
    /// -σ <= ab <= σ with a, b >= -t. DeMiguel, Friedlander, Nogales and Scholtes 2005.
    TwoSided,
    /// ab <= σ and (a + t)(b + t) >= σ, without a, b >= 0. Lin and Fukushima 2005.
    LinFukushima,
    /// (a - t)(b - t) <= 0 where a + b >= 2t, else -½ ((a - t)² + (b - t)²) <= 0. Kanzow and Schwartz 2013.
    KanzowSchwartz,
    /// (a - t)(b - t) <= 0 with a, b >= -t. Kadrani, Dussault and Benchakroun 2009.
    Kadrani,
    /// a + b - |a - b| <= 0 rounded for |a - b| < r by 1 + (2/π) sin(πz/2 + 3π/2). Steffensen and Ulbrich 2010.
    SteffensenUlbrichTrigonometric,
    /// The same rounded by the polynomial ⅛ (-z⁴ + 6z² + 3). Steffensen and Ulbrich 2010.
    SteffensenUlbrichPolynomial,
}

/// How σ enters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Steering {
    /// σ is a parameter.
    #[default]
    Direct,
    /// Every pair has a σ of its own as a variable, and their sum, over σ, is added to the objective: Scholtes' rows
    /// then are the exact penalty f + Σ ab / σ.
    L1,
    /// One variable takes the place of σ for all pairs and is penalized likewise.
    LInfinity,
}

impl Steering {
    /// How many variables are behind the others.
    pub(crate) fn n_variables(self, n_pairs: usize) -> usize {
        match self {
            Steering::Direct => 0,
            Steering::L1 => n_pairs,
            Steering::LInfinity => usize::from(n_pairs > 0),
        }
    }

    /// The one of a pair, behind `n` others.
    pub(crate) fn variable(self, n: usize, pair: usize) -> Option<usize> {
        match self {
            Steering::Direct => None,
            Steering::L1 => Some(n + pair),
            Steering::LInfinity => Some(n),
        }
    }
}

impl Relaxation {
    /// All of them.
    pub const ALL: [Relaxation; 10] = [
        Relaxation::Scholtes,
        Relaxation::FischerBurmeister,
        Relaxation::NaturalResidual,
        Relaxation::ChenChenKanzow,
        Relaxation::TwoSided,
        Relaxation::LinFukushima,
        Relaxation::KanzowSchwartz,
        Relaxation::Kadrani,
        Relaxation::SteffensenUlbrichTrigonometric,
        Relaxation::SteffensenUlbrichPolynomial,
    ];

    /// How many rows Φ a pair has.
    pub fn n_rows(self) -> usize {
        match self {
            Relaxation::TwoSided | Relaxation::LinFukushima => 2,
            _ => 1,
        }
    }

    /// By how much a and b may be negative.
    pub fn excess(self, sigma: f64) -> f64 {
        match self {
            Relaxation::TwoSided | Relaxation::Kadrani => sigma.sqrt(),
            Relaxation::LinFukushima => f64::INFINITY,
            _ => 0.0,
        }
    }

    /// Whether Φ = 0 is the smooth curve ab = σ in the quadrant a, b > 0, and may stand as an equation.
    pub fn is_curve(self) -> bool {
        use Relaxation::*;
        matches!(
            self,
            Scholtes | FischerBurmeister | NaturalResidual | ChenChenKanzow
        )
    }

    /// Φ of a row, with derivatives.
    pub fn row(self, row: usize, a: Dual, b: Dual, sigma: Dual) -> Dual {
        match self {
            Relaxation::Scholtes => a * b - sigma,
            Relaxation::FischerBurmeister => fischer_burmeister(a, b, sigma),
            Relaxation::NaturalResidual => {
                let root = ((a - b).square() + 4.0 * sigma).sqrt();
                0.5 * stable_difference(a + b, root, 4.0 * (a * b - sigma))
            }
            Relaxation::ChenChenKanzow => {
                0.5 * fischer_burmeister(a, b, sigma) + 0.5 * (a * b - sigma)
            }
            Relaxation::TwoSided if row == 0 => a * b - sigma,
            Relaxation::TwoSided => -(a * b) - sigma,
            Relaxation::LinFukushima if row == 0 => a * b - sigma,
            Relaxation::LinFukushima => {
                // (a + t)(b + t) - σ without the cancellation of t² - σ.
                -(a * b + sigma.sqrt() * (a + b))
            }
            Relaxation::KanzowSchwartz => {
                let t = sigma.sqrt();
                let (a, b) = (a - t, b - t);
                if a.value + b.value >= 0.0 {
                    a * b
                } else {
                    -0.5 * (a.square() + b.square())
                }
            }
            Relaxation::Kadrani => {
                let t = sigma.sqrt();
                (a - t) * (b - t)
            }
            Relaxation::SteffensenUlbrichTrigonometric => {
                let r = 2.0 / (1.0 - 2.0 / PI) * sigma.sqrt();
                rounded(a, b, r, |z| {
                    let phase = 0.5 * PI * z + Dual::constant(1.5 * PI);
                    Dual::constant(1.0) + 2.0 / PI * phase.sin()
                })
            }
            Relaxation::SteffensenUlbrichPolynomial => {
                let r = 16.0 / 3.0 * sigma.sqrt();
                rounded(a, b, r, |z| {
                    let square = z.square();
                    0.125 * (6.0 * square - square.square() + Dual::constant(3.0))
                })
            }
        }
    }
}

/// a + b - √(a² + b² + 2σ).
fn fischer_burmeister(a: Dual, b: Dual, sigma: Dual) -> Dual {
    let root = (a.square() + b.square() + 2.0 * sigma).sqrt();
    stable_difference(a + b, root, 2.0 * (a * b - sigma))
}

/// sum - root = (sum² - root²) / (sum + root) where that has no cancellation.
fn stable_difference(sum: Dual, root: Dual, difference_of_squares: Dual) -> Dual {
    if sum.value > 0.0 {
        difference_of_squares * (sum + root).recip()
    } else {
        sum - root
    }
}

/// a + b - |a - b|, where |x| is replaced by r ϑ(x / r) for |x| < r.
fn rounded(a: Dual, b: Dual, r: Dual, theta: impl Fn(Dual) -> Dual) -> Dual {
    let x = a - b;
    let modulus = if x.value.abs() >= r.value {
        x.abs()
    } else {
        r * theta(x * r.recip())
    };
    a + b - modulus
}
