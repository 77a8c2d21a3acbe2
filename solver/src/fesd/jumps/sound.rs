//! What every [`System`] satisfies: whatever one refers to is there.

use super::{Element, Program, StepProgram, System};
use crate::hybrid::check::{Fault, must};

impl<P: Program> System<P> {
    /// Checks that it is one.
    ///
    /// # Errors
    ///
    /// What refers to something that is not there, or does not fit.
    pub fn check(&self) -> Result<(), Fault> {
        let (n_states, n_switches) = (self.events.n_states(), self.events.n_switches());
        must(
            self.points.has(n_states, n_switches, self.parameters.len()),
            "functions at points are those of the system from event to event",
        )?;
        let mut open = self.open.iter();
        must(
            self.open.len() == self.events.parameters.len()
                && open.all(|place| *place < self.parameters.len()),
            "open parameters are parameters",
        )?;
        let mut programs = self.programs.iter();
        programs.try_for_each(|(&elements, step)| {
            let is_of = elements == step.elements.len()
                && step.n_states == n_states
                && step.numbers.len() == self.parameters.len() + 1
                && self.shape.fits(step.points.len(), step.nodes, n_switches);
            must(is_of, "programs are those of steps of the system")?;
            let n_contacts = self.points.contacts.impacts.len();
            step.check(self.points.n_algebraics(), n_contacts)
        })
    }
}

impl<P: Program> StepProgram<P> {
    /// Checks that all places are there, among z and among the variables of the program.
    fn check(&self, n_z: usize, n_contacts: usize) -> Result<(), Fault> {
        let n = self.program.n_variables();
        must(
            self.program.n_parameters() <= self.numbers.len(),
            "functions have their numbers",
        )?;
        must(
            !self.elements.is_empty() && self.shares.len() == self.elements.len(),
            "every element has its length",
        )?;
        let mut elements = self.elements.iter();
        must(
            elements.all(|element| self.has(element, n, [n_z, n_contacts])),
            "elements have their variables",
        )?;
        let mut continuous = self.continuous.iter();
        must(
            continuous.all(|&(variable, place)| variable < n && place < n_z),
            "what is continuous is among z",
        )
    }

    /// Whether the variables of an element are among n, with so many z and contacts.
    fn has(&self, element: &Element, n: usize, [n_z, n_contacts]: [usize; 2]) -> bool {
        let are_there = |first: usize, count: usize| first <= n && count <= n - first;
        let (n_points, mut states) = (self.points.len(), element.states.iter());
        let mut z = element.algebraics.iter();
        let at_nodes = &element.algebraics[1..=self.nodes.min(element.algebraics.len() - 1)];
        let mut closed = self.closed.iter();
        element.length < n
            && element.start.is_none_or(|start| start < n)
            && are_there(element.before, self.n_states)
            && are_there(element.impulses, n_contacts)
            && element.states.len() == n_points
            && states.all(|&first| are_there(first, self.n_states))
            && element.algebraics.len() == n_points
            && z.all(|z| z.len() >= n_z && z.iter().flatten().all(|&index| index < n))
            && closed.all(|&place| {
                let is_there = |z: &Vec<Option<usize>>| z.get(place).is_some_and(Option::is_some);
                at_nodes.iter().all(is_there)
            })
    }
}

crate::checked_when_read!(System<P>, P: Program);
