//! Laws by which states jump, as the simulator sees them.

use nsd_solver::simulate::{Guard, Input, Law, Reset};
use rustc_hash::FxHashMap;

use super::functions::tape;
use crate::expr::{self, Expr, Substitution, Var};
use crate::system::{self, System};

/// Compiles the laws; `inputs` are what variables stand for, and `numbers` what takes the place of the others.
pub(super) fn compile<'e>(
    system: &System<'e>,
    inputs: &FxHashMap<Var, Input>,
    numbers: &[&Substitution<'e>],
) -> Vec<Law> {
    let compile = |law: &system::Law<'e>| {
        let in_numbers = |e: Expr<'e>| numbers.iter().fold(e, |e, numbers| e.substitute(numbers));
        let guard = in_numbers(law.guard);
        let alphas = expr::variables_of(&[guard]);
        let switches = alphas.iter().filter_map(|alpha| match inputs.get(alpha) {
            Some(Input::Alpha(switch)) => Some(*switch),
            _ => None,
        });
        let values: Vec<Expr<'e>> = law
            .resets
            .iter()
            .map(|&(_, value)| in_numbers(value))
            .collect();
        let vars = expr::variables_of(&values);
        Law {
            guard: match law.strikes {
                Some(switch) => Guard::Strikes(switch),
                None => Guard::Sides {
                    switches: switches.collect(),
                    holds: tape(&alphas, &[guard]),
                },
            },
            reset: Reset {
                inputs: vars.iter().map(|var| inputs[var]).collect(),
                states: law.resets.iter().map(|&(state, _)| state).collect(),
                values: tape(&vars, &values),
            },
        }
    };
    system.laws.iter().map(compile).collect()
}
