//! Algebraic states that follow at once what an optimization decides.
//!
//! They jump where controls do, and start where free parameters and initial values put them. In a program of an
//! optimization their values where an element begins are those of the element before, or of the guess: no row reads
//! them, as the rates of algebraic states are free, so that values at nodes are right all the same. Where members of
//! pairs and switching functions hold them, they have values of their own where a control interval begins. What needs
//! more than that is not allowed, see [`reader`].

use crate::expr::{Expr, Var, variables_of};
use crate::source::Span;
use crate::system::task::{At, Task};
use crate::system::{Role, Switch, System};

/// What algebraic states follow.
#[derive(Clone, Debug, Default)]
pub struct Following {
    /// One of what is decided, in words.
    pub what: &'static str,
    /// By the place of states, whether it follows.
    pub states: Vec<bool>,
}

fn vars<'e>(exprs: impl Iterator<Item = Expr<'e>>) -> Vec<Var> {
    exprs.filter_map(Expr::as_variable).collect()
}

/// The states with free initial values.
fn freed(system: &System, task: &Task) -> Vec<Var> {
    vars(task.initial.iter().map(|x| system.states[x.place].var))
}

/// What is decided, by kind: controls, free parameters, free initial values; and what changes at any time as these do.
fn decided(system: &System, task: &Task) -> [(&'static str, Vec<Var>); 4] {
    let all = &system.exogenous.params;
    let params = task.params.iter().map(|p| all[p.place].var);
    let data = system.exogenous.data.iter().map(|data| data.var);
    [
        ("controls", vars(task.controls.iter().map(|u| u.var))),
        ("free parameters", vars(params)),
        ("free initial values", freed(system, task)),
        ("signals from tables and `floor`", vars(data)),
    ]
}

/// The algebraic states that controls, free parameters, free initial values or signals from tables determine, alone or
/// with others of an equation.
pub fn following(system: &System) -> Following {
    let mut following = Following {
        what: "",
        states: vec![false; system.states.len()],
    };
    let Some(task) = &system.task else {
        return following;
    };
    let decided = decided(system, task);
    let kept = system.switches.iter().filter(|k| k.role != Role::Step);
    let rows: Vec<Vec<Var>> = kept.map(|k| variables_of(&[k.psi])).collect();
    let found = (decided.iter()).find(|(_, vars)| rows.iter().flatten().any(|v| vars.contains(v)));
    let Some((what, _)) = found else {
        return following;
    };
    following.what = what;
    let algebraic = system.algebraic_states();
    let mut known: Vec<Var> = decided.into_iter().flat_map(|(_, vars)| vars).collect();
    loop {
        let before = known.len();
        for row in &rows {
            if !row.iter().any(|var| known.contains(var)) {
                continue;
            }
            for (i, state) in system.states.iter().enumerate() {
                let var = state.var.as_variable();
                let new = var.filter(|var| algebraic.contains(&i) && row.contains(var));
                if let Some(var) = new.filter(|_| !following.states[i]) {
                    following.states[i] = true;
                    known.push(var);
                }
            }
        }
        if known.len() == before {
            return following;
        }
    }
}

/// What would read more of such states where an element begins: rows at the start, and α in their equations.
pub fn reader(system: &System, following: &Following) -> Option<Span> {
    let states = system.states.iter().zip(&following.states);
    let followed: Vec<Var> = (states.filter(|(_, follows)| **follows))
        .filter_map(|(state, _)| state.var.as_variable())
        .collect();
    let task = system.task.as_ref()?;
    let initial = freed(system, task);
    let steps = system.switches.iter().filter(|k| k.role == Role::Step);
    let alphas: Vec<Var> = steps.filter_map(|k| k.alpha.as_variable()).collect();
    let holds = |e: Expr, vars: &[Var]| variables_of(&[e]).iter().any(|var| vars.contains(var));
    let bent = |k: &&Switch| holds(k.psi, &followed) && holds(k.psi, &alphas);
    let switch = system.switches.iter().find(bent);
    let row = task.rows.iter().find(|row| {
        let holds = |vars: &[Var]| row.exprs().any(|e| holds(e, vars));
        holds(&followed) && (row.at == At::Start || holds(&initial))
    });
    let switch = switch.map(|switch| switch.spans[0]);
    switch.or(row.map(|row| row.span))
}
