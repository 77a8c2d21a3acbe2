//! The polynomials of a step, whichever method made them.

use super::mode::Mode;
use super::series;
use crate::hybrid::Side;
use crate::integrate::radau::Radau;

/// Series of states, sliding α and ψ around the start of a step.
#[derive(Clone, Copy)]
pub(crate) enum Dense<'a> {
    /// Taylor series, in the mode.
    Taylor(&'a Mode),
    /// Collocation polynomials, and those of the ψ that are monitored, one after another.
    Collocation(&'a Mode, &'a Radau, &'a [f64]),
}

impl<'a> Dense<'a> {
    pub(crate) fn mode(self) -> &'a Mode {
        match self {
            Dense::Taylor(mode) | Dense::Collocation(mode, ..) => mode,
        }
    }

    /// Degree of the polynomials.
    pub(crate) fn order(self) -> usize {
        match self {
            Dense::Taylor(mode) => mode.memory.order,
            Dense::Collocation(_, radau, _) => radau.degree(),
        }
    }

    /// Series of state i.
    pub(crate) fn x(self, i: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.x_series(i),
            Dense::Collocation(_, radau, _) => radau.series(i),
        }
    }

    /// Series of α of a sliding switch.
    pub(crate) fn alpha(self, switch: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.alpha_series(switch),
            Dense::Collocation(mode, radau, _) => radau.series(place_of(mode, switch)),
        }
    }

    /// Series of ψ of a switch that is monitored.
    pub(crate) fn psi(self, switch: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.psi_series(switch),
            Dense::Collocation(mode, radau, psi) => {
                let place = mode.monitored.switches.partition_point(|&i| i < switch);
                &psi[place * (radau.degree() + 1)..][..=radau.degree()]
            }
        }
    }

    /// The state `tau` after the start.
    pub(crate) fn states_at(self, tau: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = series::value(self.x(i), tau);
        }
    }

    /// α of every switch `tau` after the start.
    pub(crate) fn alphas_at(self, tau: f64, alpha: &mut [f64]) {
        let mode = self.mode();
        for (alpha, side) in alpha.iter_mut().zip(&mode.sides) {
            *alpha = if *side == Side::Plus { 1.0 } else { 0.0 };
        }
        for &i in &mode.sliding {
            alpha[i] = series::value(self.alpha(i), tau);
        }
    }
}

/// The polynomials of a segment.
pub trait Polynomials {
    /// Their degree.
    fn degree(&self) -> usize;
    /// Series of state i.
    fn x(&self, i: usize) -> &[f64];
    /// Series of α of a sliding switch.
    fn alpha(&self, switch: usize) -> &[f64];
    /// Switches that nothing but outputs looks at, whose α is not known here.
    fn unobserved(&self) -> &[usize] {
        &[]
    }
}

impl Polynomials for Dense<'_> {
    fn unobserved(&self) -> &[usize] {
        &self.mode().monitored.unobserved
    }

    fn degree(&self) -> usize {
        self.order()
    }

    fn x(&self, i: usize) -> &[f64] {
        Dense::x(*self, i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        Dense::alpha(*self, switch)
    }
}

/// Series of states and of α, one row each, around the start of a finite element.
#[derive(Default)]
pub(crate) struct ElementSeries {
    n: usize,
    degree: usize,
    coefficients: Vec<f64>,
}

impl ElementSeries {
    /// Memory for n states and m switches, zero.
    pub(crate) fn shape(&mut self, n: usize, m: usize, degree: usize) {
        (self.n, self.degree) = (n, degree);
        self.coefficients.clear();
        self.coefficients.resize((n + m) * (degree + 1), 0.0);
    }

    pub(crate) fn row(&self, at: usize) -> &[f64] {
        &self.coefficients[at * (self.degree + 1)..(at + 1) * (self.degree + 1)]
    }

    pub(crate) fn row_mut(&mut self, at: usize) -> &mut [f64] {
        &mut self.coefficients[at * (self.degree + 1)..(at + 1) * (self.degree + 1)]
    }
}

impl Polynomials for ElementSeries {
    fn degree(&self) -> usize {
        self.degree
    }

    fn x(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        self.row(self.n + switch)
    }
}

/// The place of a sliding α in y = (x, α_K).
pub(crate) fn place_of(mode: &Mode, switch: usize) -> usize {
    mode.n + mode.sliding.partition_point(|&i| i < switch)
}
