//! Which contacts stay closed, which stick, and which open: accelerations decide.
//!
//! Where J_nᵀv = 0 the problem of `meeting` holds for the accelerations, a₀ those without forces of the contacts
//! that meet. Its solution proposes sides; what is neither clearly closed nor clearly open, neither clearly at
//! rest nor clearly slipping, is tried both ways, and the series of every choice decide.

use super::candidates::{Zeros, product};
use super::meeting::{Forces, Meeting, NoForces};
use super::mode::Mode;
use super::select::{Choice, Choices};
use super::state::State;
use super::system::{Guard, Law};
use super::{Role, Side, Simulator, Status, SwitchedSystem};

/// Forces and accelerations below this fraction of their scale are tried both ways.
const NEAR: f64 = 1e-7;

/// More contacts in doubt than this are tried one by one.
const MAX_DOUBTS: usize = 4;

/// Sides of a contact, and of its slip velocity.
type Sides = (Side, Side);

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// True for a unilateral switch whose surface is struck; what keeps the others, as the constraints of
    /// projections, acts on their rate itself.
    fn is_struck(&self, switch: usize) -> bool {
        let strikes = |law: &Law| matches!(law.guard, Guard::Strikes(struck) if struck == switch);
        self.system.laws().iter().any(strikes)
    }

    /// True for a group that nothing but contacts and their friction belong to.
    pub(super) fn is_of_contacts(&self, group: &[usize]) -> bool {
        let is_contact = |&i: &usize| {
            let slips = self.system.slip_of(i);
            self.is_struck(i) || slips.is_some_and(|of| group.contains(&of))
        };
        group.iter().all(is_contact)
    }

    /// The choices that the forces of contacts leave.
    pub(super) fn contact_choices(
        &mut self,
        state: &mut State,
        group: &[usize],
    ) -> Result<Choices, Status> {
        let system = self.system;
        let slip_of = |normal: usize| {
            let mut slips = group.iter().copied();
            slips.find(|&i| system.slip_of(i) == Some(normal))
        };
        // What opens with a speed of its own takes no part.
        let normals = group.iter().copied().filter(|&i| system.is_unilateral(i));
        let (meets, leaves): (Vec<usize>, Vec<usize>) =
            normals.partition(|&i| self.mode.surfaces.is_deep(i));
        let contacts: Vec<_> = meets.iter().map(|&i| (i, slip_of(i))).collect();
        let mut alpha = state.alpha.clone();
        for &i in group {
            alpha[i] = if system.is_unilateral(i) { 1.0 } else { 0.5 };
        }
        let mode = &mut self.mode;
        mode.vary(&alpha);
        mode.linearize(group);
        let a: Vec<f64> = contacts.iter().map(|c| mode.phi(c.0)).collect();
        let b: Vec<f64> = contacts
            .iter()
            .map(|c| c.1.map_or(0.0, |t| mode.phi(t)))
            .collect();
        for &i in &meets {
            alpha[i] = 0.0;
        }
        mode.vary(&alpha);
        mode.linearize(group);
        let meeting = Meeting::of(mode, contacts);
        let at_rest = vec![0.0; a.len()];
        let forces = meeting.solve(&a, &b, &at_rest).map_err(|why| match why {
            NoForces::Paradox(at) => Status::Painleve {
                switch: meeting.contacts[at].0,
            },
            NoForces::NotFound => Status::NoSolution {
                switches: group.to_vec(),
            },
        })?;
        state.complementarity = state.complementarity.max(forces.residual);
        let size = a.iter().chain(&b).fold(0.0_f64, |s, v| s.max(v.abs()));
        let options: Vec<Vec<Sides>> = (0..meeting.contacts.len())
            .map(|i| options(&meeting, &forces, i, NEAR * size))
            .collect();
        let mut choices = Choices {
            found: Vec::new(),
            singular: false,
            all: true,
        };
        for candidate in tried(&options) {
            let mut sides = vec![Side::Plus; group.len()];
            let mut set = |switch: usize, side: Side, value: f64| {
                if let Ok(at) = group.binary_search(&switch) {
                    sides[at] = side;
                }
                alpha[switch] = match side {
                    Side::Minus => 0.0,
                    Side::Slide => value,
                    Side::Plus => 1.0,
                };
            };
            for &i in &leaves {
                set(i, Side::Plus, 1.0);
                if let Some(slip) = slip_of(i) {
                    set(slip, Side::Plus, 1.0);
                }
            }
            for (i, &(of_normal, of_slip)) in candidate.iter().enumerate() {
                let (normal, slip) = meeting.contacts[i];
                let (force, drag) = (forces.normal[i], forces.friction[i]);
                set(normal, of_normal, 1.0 - force);
                let share = if force > 0.0 { drag / force } else { 0.0 };
                if let Some(slip) = slip {
                    set(slip, of_slip, 0.5 + 0.5 * share);
                }
            }
            self.enter_surfaces(state, group, &sides);
            let found = self.refine(group, &sides, &alpha);
            choices.singular |= found.is_none();
            choices.found.extend(found);
        }
        Ok(choices)
    }

    /// The α of a choice exactly, from close by.
    fn refine(&mut self, group: &[usize], sides: &[Side], alpha: &[f64]) -> Option<Choice> {
        let mode = &mut self.mode;
        let sliding = group.iter().zip(sides);
        let unknowns: Vec<usize> = sliding
            .filter(|(_, side)| **side == Side::Slide)
            .map(|(&i, _)| i)
            .collect();
        let mut zeros = Zeros::new(mode, alpha.to_vec(), unknowns);
        let values = zeros.near()?;
        let mut alpha = alpha.to_vec();
        for (&i, value) in zeros.unknowns.iter().zip(values) {
            alpha[i] = value;
        }
        mode.vary(&alpha);
        let states = mode.states_in_focus().iter();
        Some(Choice {
            sides: sides.to_vec(),
            alpha: group.iter().map(|&i| alpha[i]).collect(),
            f: states.map(|&state| mode.f()[state]).collect(),
        })
    }
}

impl Mode {
    /// True for a switch that is never below its surface.
    pub(super) fn is_unilateral(&self, switch: usize) -> bool {
        self.unilateral[switch]
    }

    /// True for the slip velocity of a contact that is open, which does not matter.
    pub(super) fn is_idle(&self, switch: usize, sides: &[Side]) -> bool {
        self.slip_of[switch].is_some_and(|of| sides[of] != Side::Slide)
    }

    /// What α of a sliding switch must not pass.
    pub(super) fn limits(&self, switch: usize) -> &'static [f64] {
        match self.roles[switch] {
            Role::Step if self.unilateral[switch] => &[1.0],
            Role::Step => &[0.0, 1.0],
            Role::Equation | Role::Member(_) => &[],
        }
    }
}

/// The sides of a contact that its force and its accelerations stand for, the first one more likely.
fn options(meeting: &Meeting, forces: &Forces, i: usize, near: f64) -> Vec<Sides> {
    let pushes = forces.normal[i] * meeting.push(i) > near;
    let opens = forces.rates[i] > near;
    let open = (Side::Plus, Side::Plus);
    if opens && !pushes {
        return vec![open];
    }
    let (drag, bend) = (forces.friction[i], forces.slips[i]);
    let turned = if drag + bend < 0.0 {
        Side::Minus
    } else {
        Side::Plus
    };
    let slips: &[Side] = if meeting.contacts[i].1.is_none() {
        &[Side::Plus]
    } else if meeting.resistance(i) <= 0.0 || bend.abs() > near {
        &[turned]
    } else if !pushes {
        &[Side::Slide, Side::Plus, Side::Minus]
    } else if drag.abs() < (1.0 - NEAR) * forces.normal[i] {
        &[Side::Slide]
    } else {
        &[Side::Slide, turned]
    };
    let closed = slips.iter().map(|&slip| (Side::Slide, slip));
    let open = (!pushes).then_some(open);
    closed.chain(open).collect()
}

/// Combinations of options: all, or where that is too many the first or the last ones everywhere or but for one
/// contact. Normals that depend on each other leave contacts in doubt whose force is zero: with the last options
/// these are open, which holds what the others hold.
fn tried(options: &[Vec<Sides>]) -> Vec<Vec<Sides>> {
    let doubts = options.iter().filter(|sides| sides.len() > 1).count();
    if doubts <= MAX_DOUBTS {
        return product(options);
    }
    let first: Vec<Sides> = options.iter().map(|sides| sides[0]).collect();
    let last: Vec<Sides> = options.iter().map(|sides| sides[sides.len() - 1]).collect();
    let mut found = vec![first.clone(), last.clone()];
    for (i, others) in options.iter().enumerate() {
        for &other in &others[1..] {
            let mut sides = first.clone();
            sides[i] = other;
            found.push(sides);
        }
        for &other in &others[..others.len() - 1] {
            let mut sides = last.clone();
            sides[i] = other;
            found.push(sides);
        }
    }
    found
}
