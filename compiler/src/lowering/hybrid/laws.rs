//! Laws by which states jump, and impacts, as the simulator sees them.

use nsd_solver::hybrid::{Effect, Guard, Impact, Input, Law, Periodic, Reset};
use rustc_hash::FxHashMap;

use super::{tape, variable};
use crate::expr::{self, Expr, Substitution, Var};
use crate::model::{self, When};
use crate::system::{self, System};

/// Compiles the laws of a system, jumps first and then contacts; `inputs` are what variables stand for, and
/// `numbers` what takes the place of the others.
pub(crate) fn compile<'e>(
    system: &System<'e>,
    inputs: &FxHashMap<Var, Input>,
    numbers: &[&Substitution<'e>],
) -> Vec<Law> {
    let in_numbers = |e: Expr<'e>| numbers.iter().fold(e, |e, numbers| e.substitute(numbers));
    let inputs_of = |vars: &[Var]| vars.iter().map(|var| inputs[var]).collect();
    let jump = |law: &system::Law<'e>| {
        let guard = |guard: Expr<'e>| {
            let guard = in_numbers(guard);
            let alphas = expr::variables_of(&[guard]);
            let switches = alphas.iter().filter_map(|alpha| match inputs.get(alpha) {
                Some(Input::Alpha(switch)) => Some(*switch),
                _ => None,
            });
            Guard::Sides {
                switches: switches.collect(),
                compared: compared(system, &alphas),
                holds: tape(&alphas, &[guard]),
            }
        };
        let values = law.resets.iter().map(|&(_, value)| in_numbers(value));
        let values: Vec<Expr<'e>> = values.collect();
        let vars = expr::variables_of(&values);
        Law {
            guard: match (law.strikes, law.when) {
                (Some(switch), _) => Guard::Strikes(switch),
                (None, When::Guard(condition)) => guard(condition),
                (None, When::Every(model::Periodic { period, offset })) => Guard::Every(Periodic {
                    period: number_of(system, period),
                    offset: number_of(system, offset),
                }),
            },
            effect: match law.stops {
                true => Effect::Stop,
                false => Effect::Reset(Reset {
                    inputs: inputs_of(&vars),
                    compared: compared(system, &vars),
                    states: law.resets.iter().map(|&(state, _)| state).collect(),
                    values: tape(&vars, &values),
                }),
            },
        }
    };
    let impact = |contact: &system::Contact<'e>| {
        let friction = contact.friction.as_ref();
        let mut numbers = vec![in_numbers(contact.restitution.coefficient)];
        numbers.extend(friction.map(|friction| in_numbers(friction.coefficient)));
        let vars = expr::variables_of(&numbers);
        Law {
            guard: Guard::Strikes(contact.switch),
            effect: Effect::Impact(Impact {
                law: contact.restitution.law,
                inputs: inputs_of(&vars),
                numbers: tape(&vars, &numbers),
                slips: contact.slips().iter().map(|slip| slip.switch).collect(),
            }),
        }
    };
    let (laws, contacts) = (system.jumps.laws.iter(), system.jumps.contacts.iter());
    laws.map(jump).chain(contacts.map(impact)).collect()
}

/// Which inputs are comparisons, with their values on the surface.
fn compared(system: &System, inputs: &[Var]) -> Vec<(usize, f64)> {
    let inputs = inputs.iter().enumerate();
    let compared = inputs.filter_map(|(place, var)| {
        let mut comparisons = system.jumps.comparisons.iter();
        let comparison = comparisons.find(|comparison| comparison.var == *var)?;
        Some((place, comparison.on_surface))
    });
    compared.collect()
}

/// The value of a function of parameters that are not open.
fn number_of(system: &System, e: Expr) -> f64 {
    let params: FxHashMap<Var, f64> = (system.exogenous.numbers())
        .map(|(var, value)| (variable(var), value))
        .collect();
    e.eval(&|var| params[&var])
}
