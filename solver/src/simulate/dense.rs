//! The polynomials of a step, whichever method made them.

use super::mode::Mode;
use super::radau::Radau;
use super::{Side, series};

/// Series of states, sliding α and ψ around the start of a step.
#[derive(Clone, Copy)]
pub(super) enum Dense<'a> {
    /// Taylor series, in the mode.
    Taylor(&'a Mode),
    /// Collocation polynomials, and those of the ψ that are watched, which the mode holds.
    Collocation(&'a Mode, &'a Radau),
}

impl<'a> Dense<'a> {
    pub(super) fn mode(self) -> &'a Mode {
        match self {
            Dense::Taylor(mode) | Dense::Collocation(mode, _) => mode,
        }
    }

    /// Degree of the polynomials.
    pub(super) fn order(self) -> usize {
        match self {
            Dense::Taylor(mode) => mode.order,
            Dense::Collocation(_, radau) => radau.degree(),
        }
    }

    /// Series of state i.
    pub(super) fn x(self, i: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.x_series(i),
            Dense::Collocation(_, radau) => radau.series(i),
        }
    }

    /// Series of α of a sliding switch.
    pub(super) fn alpha(self, switch: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.alpha_series(switch),
            Dense::Collocation(mode, radau) => radau.series(mode.unknown(switch)),
        }
    }

    /// Series of ψ of a switch that is watched.
    pub(super) fn psi(self, switch: usize) -> &'a [f64] {
        match self {
            Dense::Taylor(mode) => mode.psi_series(switch),
            Dense::Collocation(mode, radau) => mode.interpolant(switch, radau.degree()),
        }
    }

    /// The state `tau` after the start.
    pub(super) fn states_at(self, tau: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = series::value(self.x(i), tau);
        }
    }

    /// α of every switch `tau` after the start.
    pub(super) fn alphas_at(self, tau: f64, alpha: &mut [f64]) {
        let mode = self.mode();
        for (alpha, side) in alpha.iter_mut().zip(&mode.sides) {
            *alpha = if *side == Side::Plus { 1.0 } else { 0.0 };
        }
        for &i in &mode.sliding {
            alpha[i] = series::value(self.alpha(i), tau);
        }
    }
}
