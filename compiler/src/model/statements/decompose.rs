//! Rates in a switch that is read nonlinearly: f(s) = chord(s) + γ(s) g(s), with γ = 0 on both sides.
//!
//! The chord is what Filippov's reading keeps, the straight line between the rates of both sides. γ is 1 - s² for a
//! sign and s (1 - s) for a step; g follows by polynomial division where f is a polynomial in s
//! (Jeffrey 2014, equation 6).

use std::fmt;

use crate::expr::{Expr, Substitution, Var};
use crate::model::{Model, SwitchKind};
use crate::syntax::Sliding;

/// f = chord + γ g.
pub(crate) struct Decomposition<'e> {
    pub chord: Expr<'e>,
    /// γ g.
    pub hidden: Expr<'e>,
    /// γ and g, where f is a polynomial in s.
    pub factors: Option<[Expr<'e>; 2]>,
}

/// Degrees in which g is looked for.
const HIGHEST_DEGREE: usize = 12;

fn at<'e>(f: Expr<'e>, var: Var, value: f64) -> Expr<'e> {
    let value = f.exprs().constant(value);
    f.substitute(&Substitution::from_iter([(var, value)]))
}

impl<'e> Decomposition<'e> {
    /// Of f in a switch, a sign or a step.
    pub fn of(f: Expr<'e>, s: Var, is_sign: bool) -> Self {
        let low = if is_sign { -1.0 } else { 0.0 };
        let value = f.exprs().expr(s);
        let (below, above) = (at(f, s, low), at(f, s, 1.0));
        let chord = match is_sign {
            true => 0.5 * (above + below) + 0.5 * (above - below) * value,
            false => below + (above - below) * value,
        };
        let hidden = f - chord;
        // Coefficients of γ g.
        let mut coefficients = Vec::new();
        let (mut derivative, mut factorial) = (hidden, 1.0);
        for k in 0..=HIGHEST_DEGREE {
            coefficients.push(at(derivative, s, 0.0) * (1.0 / factorial));
            derivative = derivative.diff(s);
            factorial *= (k + 1) as f64;
        }
        let factors = derivative.is_zero().then(|| {
            let zero = f.exprs().constant(0.0);
            let mut quotient: Vec<Expr<'e>> = Vec::new();
            for k in 0..HIGHEST_DEGREE {
                let before = |back: usize| k.checked_sub(back).map_or(zero, |at| quotient[at]);
                // (1 - s²) q has q_k - q_{k-2}, s (1 - s) q has q_{k-1} - q_{k-2}.
                let next = match is_sign {
                    true => coefficients[k] + before(2),
                    false => coefficients[k + 1] + before(1),
                };
                quotient.push(next);
            }
            let terms = (0..).zip(&quotient);
            let g = terms.fold(zero, |sum, (k, &q)| sum + q * value.powi(k));
            let gamma = match is_sign {
                true => 1.0 - value * value,
                false => value * (1.0 - value),
            };
            [gamma, g]
        });
        Decomposition {
            chord,
            hidden,
            factors,
        }
    }
}

impl fmt::Display for Decomposition<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.factors {
            Some([gamma, g]) => write!(f, "[{}] + ({gamma})*[{g}]", self.chord),
            None => write!(f, "[{}] + [{}]", self.chord, self.hidden),
        }
    }
}

impl Model<'_> {
    /// Writes the rates that contain a switch in another way than affine, cut in two.
    pub(crate) fn write_decompositions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, switch) in self.switches.iter().enumerate() {
            if switch.sliding != Some(Sliding::Nonlinear) {
                continue;
            }
            let is_sign = matches!(switch.kind, SwitchKind::Sign);
            let hidden = self
                .statements
                .hidden
                .iter()
                .filter(|hidden| hidden.switch == k);
            let rates = self.statements.dynamics.iter();
            let rates: Vec<_> = rates
                .chain(hidden.flat_map(|hidden| &hidden.rates))
                .collect();
            for (entry, var) in switch.vars.iter().enumerate() {
                let Some(s) = var.as_variable() else {
                    continue;
                };
                let name = switch.shape.entry_name(&switch.name, entry);
                writeln!(f, "sliding on {name}: [chord] + gamma*[g]")?;
                for (state, _) in self.state_vars().enumerate() {
                    let of_state = rates.iter().filter(|rate| rate.entry == state);
                    let Some(whole) = of_state.map(|rate| rate.value).reduce(|a, b| a + b) else {
                        continue;
                    };
                    let parts = Decomposition::of(whole, s, is_sign);
                    if !parts.hidden.is_zero() {
                        writeln!(f, "  {}' = {parts}", self.entry_name(state))?;
                    }
                }
            }
        }
        Ok(())
    }
}
