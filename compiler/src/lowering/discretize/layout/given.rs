//! What a program takes from initial values and parameters: where it starts from, what is known before the first element,
//! and what bounds controls.

use super::ends::Start;
use super::{Layout, bounds_of};
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Bounds, Stated};
use crate::system::Param;
use crate::system::task::TaskRow;

impl Layout {
    /// The variables that are fixed where the first element begins, with their values: x(0) that are not free, and the
    /// continuous z there, where these are known.
    pub fn given<'d>(&'d self, dcs: &'d Dcs) -> impl Iterator<Item = (usize, f64)> + 'd {
        let first = self.before(1, 1);
        let is_free = |i: usize| {
            let mut freed = dcs.task.iter().flat_map(|task| &task.initial);
            freed.any(|free| free.place == i)
        };
        let states = (0..self.n_states()).filter(move |&i| !is_free(i));
        let states = states.map(move |i| (first + i, dcs.states[i].initial));
        let knows_z = !Start::of(dcs).is_free;
        let z = self.algebraics.fixed_at_start().filter(move |_| knows_z);
        states.chain(z.map(|(index, i)| (index, dcs.algebraics[i].guess)))
    }

    /// The bounds of a control in all steps: its range, cut by the constraints that are bounds of it.
    pub(crate) fn control_bounds(
        &self,
        dcs: &Dcs,
        stated: &[Stated],
        control: usize,
    ) -> Vec<(usize, Bounds)> {
        let task = dcs.task.iter();
        let rows: Vec<_> = task.flat_map(|task| &task.rows).zip(stated).collect();
        let range = dcs.task.as_ref().map(|task| &task.controls[control]);
        let range = range.map_or(Bounds::free(0.0), bounds_of);
        let bounds = self.control_instants().map(|(k, _)| {
            let index = self.u(k) + control;
            let own = rows.iter().filter(|(_, s)| s.variables.contains(&index));
            let cut = |bounds: Bounds, row: &TaskRow| bounds.within(row.lower, row.upper);
            (index, own.fold(range, |bounds, (row, _)| cut(bounds, row)))
        });
        bounds.collect()
    }

    /// What x and z are guessed to be everywhere: x(0), and z there.
    pub fn guesses<'d>(&'d self, dcs: &'d Dcs) -> impl Iterator<Item = (usize, f64)> + 'd {
        let states = |first: usize| {
            let states = dcs.states[..self.n_states()].iter().enumerate();
            states.map(move |(i, state)| (first + i, state.initial))
        };
        let place = move |(k, j, m): (usize, usize, usize)| {
            let z = dcs.algebraics.iter().enumerate();
            let z = z.filter_map(move |(i, z)| Some((self.z(k, j, m, i)?, z.guess)));
            let started = dcs.states[..self.n_states()].iter().enumerate();
            let started = started.filter(move |_| (j, m) == (1, 0));
            let started =
                started.filter_map(move |(i, state)| Some((self.started(k, i)?, state.initial)));
            states(self.x(k, j, m)).chain(z).chain(started)
        };
        let nodes = move |(k, j)| (0..=self.end).flat_map(move |m| place((k, j, m)));
        let elements = self.all_elements().flat_map(nodes);
        states(self.before(1, 1)).chain(elements)
    }
}

/// Parameters that stay numbers.
pub(crate) fn fixed_params<'e>(dcs: &Dcs<'e>) -> Vec<Param<'e>> {
    let free = |place: usize| {
        let mut free = dcs.task.iter().flat_map(|task| &task.params);
        free.any(|free| free.place == place)
    };
    let params = dcs.params.iter().enumerate();
    params
        .filter(|(place, _)| !free(*place))
        .map(|(_, param)| param.clone())
        .collect()
}
