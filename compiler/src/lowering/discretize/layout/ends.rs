//! What of z has values where elements begin and end, and which equations say what they are.
//!
//! What is continuous along solutions has the same values at both sides of a boundary, unless it jumps there: with states
//! where contacts give impulses, with switches of time, or with controls and data where steps begin.

use rustc_hash::FxHashSet;

use crate::expr::{Expr, Var, variables_of};
use crate::lowering::dcs::{Data, Dcs};
use crate::lowering::discretize::formals::block::variable;
use crate::source::table::Fit;
use crate::system::task::Shape;

/// What holds at a right end that is no node: the continuous z, the equations that contain them, what else these
/// contain, the equations of that, and so on. Of a disc these are its own equations: what contains its α besides is a
/// force, which acts at nodes alone.
#[derive(Clone, Debug)]
pub(crate) struct End {
    pub algebraics: Vec<usize>,
    pub equations: Vec<usize>,
}

impl End {
    pub fn new(dcs: &Dcs) -> Self {
        let occurring = |row: &Expr<'_>| variables_of(&[*row]);
        let occurring: Vec<Vec<Var>> = dcs.rows.equations.iter().map(occurring).collect();
        let declared: FxHashSet<Var> = dcs.algebraics.iter().map(|z| variable(z.var)).collect();
        let continuous = dcs.algebraics.iter().filter(|z| z.continuous);
        let place = |i: usize| variable(dcs.algebraics[i].var);
        let sticks = dcs.switches.discs.iter().map(|disc| place(disc.stick));
        let mut known: FxHashSet<Var> = continuous.map(|z| variable(z.var)).chain(sticks).collect();
        let directions = dcs.switches.discs.iter().flat_map(|disc| disc.alphas);
        let directions: FxHashSet<Var> = directions.map(place).collect();
        let spreads = |var: &&Var| !directions.contains(var);
        loop {
            let before = known.len();
            for row in &occurring {
                if row.iter().filter(spreads).any(|var| known.contains(var)) {
                    known.extend(row.iter().filter(|var| declared.contains(var)));
                }
            }
            if known.len() == before {
                break;
            }
        }
        let contains = |row: &Vec<Var>| row.iter().filter(spreads).any(|var| known.contains(var));
        End {
            algebraics: (0..dcs.algebraics.len())
                .filter(|&i| known.contains(&variable(dcs.algebraics[i].var)))
                .collect(),
            equations: (0..occurring.len())
                .filter(|&row| contains(&occurring[row]))
                .collect(),
        }
    }
}

/// The continuous z that jump with states, and the equations that say what they are; those of discs are stated with
/// α⁺ and β⁺.
pub(crate) fn jumping_with_states(dcs: &Dcs) -> (Vec<usize>, Vec<usize>) {
    let mut algebraics: Vec<usize> = dcs.switches.discs.iter().map(|disc| disc.slip).collect();
    let mut equations = Vec::new();
    let discs = dcs.switches.discs.iter();
    let of_discs: Vec<usize> = discs.flat_map(|disc| disc.inside()).collect();
    for row in End::new(dcs).equations {
        let occurring = variables_of(&[dcs.rows.equations[row]]);
        let occurs = |e: Expr| occurring.contains(&variable(e));
        if of_discs.iter().any(|&i| occurs(dcs.algebraics[i].var)) {
            continue;
        }
        let jumps = dcs.jumps_in(dcs.rows.equations[row])
            || algebraics
                .iter()
                .any(|&i: &usize| occurs(dcs.algebraics[i].var));
        if jumps {
            equations.push(row);
            let of_row = |&i: &usize| occurs(dcs.algebraics[i].var) && !algebraics.contains(&i);
            let new: Vec<usize> = (0..dcs.algebraics.len()).filter(of_row).collect();
            algebraics.extend(new);
        }
    }
    algebraics.sort_unstable();
    (algebraics, equations)
}

/// The continuous z that jump with switches of time, and the equations that say what they are.
pub(crate) fn jumping_with_time(dcs: &Dcs) -> (Vec<usize>, Vec<usize>) {
    let leading = dcs.switches.leading.iter();
    let steps = leading.map(|&switch| dcs.switches.alphas[switch]);
    let mut known: Vec<Var> = variables_of(&steps.collect::<Vec<Expr>>());
    let rows = End::new(dcs).equations;
    let continuous = dcs.algebraics.iter().filter(|z| z.continuous);
    let continuous: Vec<Var> = continuous.map(|z| variable(z.var)).collect();
    let mut equations: Vec<usize> = Vec::new();
    loop {
        let jumps = |row: &&usize| {
            let occurring = variables_of(&[dcs.rows.equations[**row]]);
            !equations.contains(*row) && occurring.iter().any(|var| known.contains(var))
        };
        let Some(&row) = rows.iter().find(jumps) else {
            break;
        };
        let occurring = variables_of(&[dcs.rows.equations[row]]).into_iter();
        known.extend(occurring.filter(|var| continuous.contains(var)));
        equations.push(row);
    }
    equations.sort_unstable();
    let is_new = |i: &usize| {
        let z = &dcs.algebraics[*i];
        z.continuous && known.contains(&variable(z.var))
    };
    (
        (0..dcs.algebraics.len()).filter(is_new).collect(),
        equations,
    )
}

/// What is known where elements begin.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    /// Whether the continuous z of the first element are variables.
    pub is_free: bool,
    /// Whether those of every step are.
    pub restarts: bool,
    /// Their equations; where these hold algebraic states that follow what is decided, the equations of all of those,
    /// too.
    pub rows: Vec<usize>,
    /// The states that have values of their own where an element begins with free z.
    pub states: Vec<usize>,
}

impl Start {
    pub fn of(dcs: &Dcs) -> Self {
        let mut start = Start {
            is_free: false,
            restarts: false,
            rows: Start::rows(dcs),
            states: Vec::new(),
        };
        let Some(task) = &dcs.task else {
            return start;
        };
        let rows = start.rows.iter().map(|&row| dcs.rows.equations[row]);
        let occurring = variables_of(&rows.collect::<Vec<Expr>>());
        let occurs = |e: Expr| occurring.contains(&variable(e));
        let controls = task.controls.iter().any(|control| occurs(control.var));
        let mut params = task.params.iter().map(|free| dcs.params[free.place].var);
        let mut states = task.initial.iter().map(|free| dcs.states[free.place].var);
        let is_known = !params.any(occurs) && !states.any(occurs);
        let jumps = jumping_with_data(dcs, &occurring);
        start.is_free = controls || !is_known || jumps;
        start.restarts = controls && task.shape == Shape::Constant || jumps;
        if start.is_free {
            let follows = |i: &usize| dcs.states[*i].follows && occurs(dcs.states[*i].var);
            start.states = (0..dcs.states.len()).filter(follows).collect();
        }
        start
    }

    fn rows(dcs: &Dcs) -> Vec<usize> {
        let mut rows = End::new(dcs).equations;
        let followed = dcs.states.iter().filter(|state| state.follows);
        let followed: Vec<Var> = followed.map(|state| variable(state.var)).collect();
        let follows = |row: &usize| {
            let vars = variables_of(&[dcs.rows.equations[*row]]);
            vars.iter().any(|var| followed.contains(var))
        };
        if rows.iter().any(follows) {
            rows.extend((0..dcs.rows.equations.len()).filter(follows));
            rows.sort_unstable();
            rows.dedup();
        }
        rows
    }
}

/// Whether what is continuous in other respects may jump with the data, where steps begin.
fn jumping_with_data(dcs: &Dcs, occurring: &[Var]) -> bool {
    let is_held = |data: &Data| data.table.fit == Fit::Hold;
    let mut held = dcs.data.iter().filter(|data| is_held(data));
    held.any(|data| occurring.contains(&variable(data.var)))
}
