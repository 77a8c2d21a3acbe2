//! Which contacts stay closed, which stick, and which open: accelerations decide.
//!
//! Where J_nᵀv = 0 the problem of `coulomb` holds for the accelerations, a₀ those without forces of the contacts
//! that meet. Its solution proposes sides; what is neither clearly closed nor clearly open, neither clearly at
//! rest nor clearly slipping, is tried both ways, and the series of every choice decide.

use super::coulomb::ladder;
use super::coulomb::problem::{Delassus, NoSolution, Problem, Solution};
use super::rows;
use super::rows::{ContactSwitches, Rows};
use crate::event::state::State;
use crate::expansion::scales::TIE;
use crate::hybrid::{Side, Status};
use crate::linalg::norm;
use crate::selector::candidates::{Enumeration, Zeros, product};
use crate::selector::closing::{Bent, Closing, ROUNDING};
use crate::selector::selection::{Choice, Choices};

/// Forces and accelerations below this fraction of their scale are tried both ways.
const NEAR: f64 = 1e-7;

/// A contact is approached no faster than what others were closed against where the square of its speed is at most this
/// times its band and the largest acceleration: four times it is what closes one.
const SHARE: f64 = 64.0;

/// More contacts in doubt than this are tried one by one.
const MAX_DOUBTS: usize = 4;

/// Sides of a contact, and of its slip velocity.
type Sides = (Side, Side);

/// The forces of contacts that meet.
struct Found {
    contacts: Vec<ContactSwitches>,
    w: Delassus,
    forces: Solution,
    /// Contacts that open with a speed of their own, and take no part.
    leaves: Vec<usize>,
    /// α of all switches, of those that meet in the middle of where forces are.
    alpha: Vec<f64>,
    /// Accelerations below this are tried both ways.
    near: f64,
}

impl Found {
    /// Whether a contact on these sides, closed and with friction in two directions, starts to slip.
    fn sets_off(&self, candidate: &[Sides]) -> bool {
        let w = &self.w;
        candidate
            .iter()
            .enumerate()
            .any(|(i, &(of_normal, of_slip))| {
                let rubs = w.slips(i).len() > 1 && w.resistance(i) > 0.0;
                of_normal == Side::Slide && of_slip != Side::Slide && rubs
            })
    }
}

impl Enumeration<'_> {
    /// True for a group that nothing but contacts and their friction belong to.
    pub(crate) fn is_of_contacts(&self, group: &[usize]) -> bool {
        let is_contact = |&i: &usize| {
            let slips = self.system.slip_of(i);
            self.system.is_struck(i) || slips.is_some_and(|of| group.contains(&of))
        };
        group.iter().all(is_contact)
    }

    /// The choices that the forces of contacts leave.
    pub(crate) fn contact_choices(
        &mut self,
        state: &mut State,
        group: &[usize],
    ) -> Result<Choices, Status> {
        let mut found = loop {
            self.meet(state, group);
            let found = self.contact_forces(state, group)?;
            if !self.shut_bent(state, &found) {
                break found;
            }
        };
        let options: Vec<Vec<Sides>> = (0..found.contacts.len())
            .map(|i| options(&found.w, &found.forces, i, found.near))
            .collect();
        let mut choices = Choices {
            found: Vec::new(),
            singular: false,
            all: true,
        };
        for candidate in tried(&options) {
            let held = candidate
                .iter()
                .map(|(of_normal, of_slip)| (*of_normal == Side::Slide, *of_slip == Side::Slide));
            if found.w.keeps_slipping_one(&held.collect::<Vec<_>>()) {
                continue;
            }
            let sides = self.propose(group, &mut found, &candidate);
            self.mode.enter_choice(&state.point, group, &sides);
            let choice = self.refine(group, &sides, &found.alpha);
            choices.singular |= choice.is_none();
            // When it does depends on what each of them has taken, which nothing determines.
            if choice.is_some()
                && found.sets_off(&candidate)
                && found.w.wedges(&found.forces.normal)
            {
                let switches = group.to_vec();
                return Err(Status::Undetermined { switches });
            }
            choices.found.extend(choice);
        }
        Ok(choices)
    }

    /// The sides of a group where the contacts that meet are on these, and α from their forces.
    fn propose(&self, group: &[usize], found: &mut Found, candidate: &[Sides]) -> Vec<Side> {
        let Found {
            contacts,
            w,
            forces,
            leaves,
            alpha,
            ..
        } = found;
        let mut sides = vec![Side::Plus; group.len()];
        let mut set = |switch: usize, side: Side, value: f64| {
            if let Ok(at) = group.binary_search(&switch) {
                sides[at] = side;
            }
            alpha[switch] = value;
        };
        let alpha_on = |side: Side, sliding: f64| match side {
            Side::Minus => 0.0,
            Side::Slide => sliding,
            Side::Plus => 1.0,
        };
        for &i in &*leaves {
            set(i, Side::Plus, 1.0);
            for slip in self.slips_among(group, i) {
                set(slip, Side::Plus, 1.0);
            }
        }
        for (i, &(of_normal, of_slip)) in candidate.iter().enumerate() {
            let ContactSwitches { normal, slips } = &contacts[i];
            let force = forces.normal[i];
            set(*normal, of_normal, alpha_on(of_normal, 1.0 - force));
            if slips.len() > 1 && of_slip != Side::Slide {
                // The direction in which it slips.
                for (&slip, d) in slips.iter().zip(direction(w, forces, i)) {
                    set(slip, of_slip, 0.5 + 0.5 * d);
                }
                continue;
            }
            let drags = &forces.tangential[w.slips(i)];
            for (&slip, drag) in slips.iter().zip(drags) {
                let share = if force > 0.0 { drag / force } else { 0.0 };
                set(slip, of_slip, alpha_on(of_slip, 0.5 + 0.5 * share));
            }
        }
        sides
    }

    /// Lets contacts meet that others were closed against: their rates are negative by less than what that took away.
    fn meet(&mut self, state: &State, group: &[usize]) {
        let mode = &mut self.mode;
        let normals = group
            .iter()
            .copied()
            .filter(|&i| mode.system.is_unilateral(i));
        let normals: Vec<usize> = normals.collect();
        let is_open = |i: &usize| !mode.surfaces.is_deep(*i) && !state.jumps.grazed.contains(i);
        let open: Vec<usize> = normals.iter().copied().filter(is_open).collect();
        open.iter().for_each(|&i| mode.surfaces.stand_for(i, 1));
        mode.eval(state.point.t, &state.point.x, &state.point.alpha);
        let closes = open.iter().any(|&i| mode.psi(i) < 0.0);
        let bend = if closes {
            self.bend(state, &normals)
        } else {
            0.0
        };
        let mode = &mut self.mode;
        for i in open {
            let speed = mode.psi(i);
            let meets = speed < 0.0 && speed * speed <= SHARE * state.bands.width[i] * bend;
            mode.surfaces.stand_for(i, usize::from(meets));
        }
        mode.focus(state.point.t, &state.point.x, &state.point.alpha, group);
    }

    /// The largest terms of the accelerations of gaps, with and without the forces of contacts: where forces hold bodies at
    /// rest, what they hold shows how fast gaps bend. What closes one of them acts on the others.
    fn bend(&mut self, state: &State, normals: &[usize]) -> f64 {
        let mode = &mut self.mode;
        let mut free = state.point.alpha.clone();
        normals.iter().for_each(|&i| free[i] = 1.0);
        let mut bend = 0.0_f64;
        for alpha in [&free, &state.point.alpha] {
            mode.eval(state.point.t, &state.point.x, alpha);
            mode.linearize(normals);
            let terms = normals.iter().map(|&i| mode.terms_of_phi(i));
            bend = terms.fold(bend, f64::max);
        }
        bend
    }

    /// The entries of the slip velocity of a contact, among these.
    fn slips_among(&self, group: &[usize], normal: usize) -> Vec<usize> {
        let slips = group.iter().copied();
        slips
            .filter(|&i| self.system.slip_of(i) == Some(normal))
            .collect()
    }

    /// The forces of the contacts of a group that do not open with a speed of their own.
    fn contact_forces(&mut self, state: &mut State, group: &[usize]) -> Result<Found, Status> {
        let system = self.system.clone();
        let normals = group.iter().copied().filter(|&i| system.is_unilateral(i));
        let (meets, leaves): (Vec<usize>, Vec<usize>) =
            normals.partition(|&i| self.mode.surfaces.is_deep(i));
        let of_normal = |&normal: &usize| ContactSwitches {
            normal,
            slips: self.slips_among(group, normal),
        };
        let contacts: Vec<ContactSwitches> = meets.iter().map(of_normal).collect();
        let mut alpha = state.point.alpha.clone();
        for &i in group {
            alpha[i] = if system.is_unilateral(i) { 1.0 } else { 0.5 };
        }
        if contacts.is_empty() {
            return Ok(Found {
                contacts,
                w: Delassus::new(std::iter::empty(), |_, _| 0.0),
                forces: Solution::default(),
                leaves,
                alpha,
                near: 0.0,
            });
        }
        let mode = &mut self.mode;
        mode.vary(&alpha);
        mode.linearize(group);
        let rows = rows::in_order(&contacts);
        let q: Vec<f64> = rows.iter().map(|&i| mode.phi(i)).collect();
        let (mut terms, mut tie) = (0.0_f64, 0.0_f64);
        for &i in &rows {
            terms = terms.max(mode.terms_of_phi(i));
            tie = tie.max(TIE * mode.surfaces.weigh(i, |j| state.scales.activity[j]));
        }
        let size = q.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        for &i in &meets {
            alpha[i] = 0.0;
        }
        mode.vary(&alpha);
        mode.linearize(group);
        let w = Rows::of(mode).delassus(&contacts);
        // Where accelerations cancel, what is left is rounding: of their terms, and of α = 1, which is no force. What
        // series will take for a tie is tried both ways.
        let push = (0..contacts.len()).fold(0.0_f64, |push, i| push.max(w.push(i).abs()));
        let rounding = f64::max(ROUNDING * terms, 8.0 * f64::EPSILON * push);
        let near = f64::max(NEAR * size, rounding).max(tie);
        let at_rest = vec![0.0; w.n_slips()];
        // Friction has μ in its rows.
        let problem = Problem::new(w, vec![1.0; contacts.len()], q);
        let forces = ladder::solve(&problem, &at_rest).map_err(|why| match why {
            NoSolution::Paradox(at) => Status::Painleve {
                switch: contacts[at].normal,
            },
            NoSolution::NotFound => Status::NoSolution {
                switches: group.to_vec(),
            },
        })?;
        state.report.complementarity = state.report.complementarity.max(forces.residual);
        Ok(Found {
            contacts,
            w: problem.w,
            forces,
            leaves,
            alpha,
            near,
        })
    }

    /// Closes a contact that the forces of the others bend back before its ψ is known to be open; false where there
    /// is none.
    fn shut_bent(&mut self, state: &mut State, found: &Found) -> bool {
        let mut alpha = found.alpha.clone();
        let Found { w, forces, .. } = found;
        for (i, ContactSwitches { normal, slips }) in found.contacts.iter().enumerate() {
            let force = forces.normal[i];
            alpha[*normal] = 1.0 - force;
            let drags = &forces.tangential[w.slips(i)];
            for (&slip, drag) in slips.iter().zip(drags).filter(|_| force > 0.0) {
                alpha[slip] = 0.5 + 0.5 * drag / force;
            }
        }
        self.mode.vary(&alpha);
        found.leaves.iter().any(|&i| {
            let mode = &mut self.mode;
            mode.surfaces.stand_for(i, 1);
            mode.linearize(&[i]);
            let bent = Bent {
                speed: mode.psi(i),
                bend: mode.phi(i),
            };
            let shut = Closing { mode: self.mode }.shut(state, i, bent);
            self.mode.surfaces.stand_for(i, usize::from(shut));
            shut
        })
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
        let states = mode.focus.states.iter();
        Some(Choice {
            sides: sides.into(),
            alpha: group.iter().map(|&i| alpha[i]).collect(),
            f: states.map(|&state| mode.field.f[state]).collect(),
        })
    }
}

/// The sides of a contact that its force and its accelerations stand for, the first one more likely.
fn options(w: &Delassus, forces: &Solution, i: usize, near: f64) -> Vec<Sides> {
    let pushes = forces.normal[i] * w.push(i) > near;
    let opens = forces.rates[i] > near;
    let open = (Side::Plus, Side::Plus);
    if opens && !pushes {
        return vec![open];
    }
    let entries = w.slips(i);
    let [drags, bends] = [&forces.tangential, &forces.slips].map(|v| &v[entries.clone()]);
    let (drag, bend) = (norm(drags), norm(bends));
    let turned = match (drags, bends) {
        (&[drag], &[bend]) if drag + bend < 0.0 => Side::Minus,
        _ => Side::Plus,
    };
    let slips: &[Side] = if entries.is_empty() {
        &[Side::Plus]
    } else if entries.len() > 1 {
        match drag <= (1.0 - NEAR) * forces.normal[i] {
            _ if w.resistance(i) <= 0.0 || bend > near => &[Side::Plus],
            true => &[Side::Slide],
            // At the rim of its cone.
            false => &[Side::Slide, Side::Plus],
        }
    } else if w.resistance(i) <= 0.0 || bend > near {
        &[turned]
    } else if !pushes {
        &[Side::Slide, Side::Plus, Side::Minus]
    } else if drag < (1.0 - NEAR) * forces.normal[i] {
        &[Side::Slide]
    } else {
        &[Side::Slide, turned]
    };
    let closed = slips.iter().map(|&slip| (Side::Slide, slip));
    let open = (!pushes).then_some(open);
    closed.chain(open).collect()
}

/// The direction in which a contact slips from rest in a plane: against its friction, or as it is accelerated.
fn direction(w: &Delassus, forces: &Solution, i: usize) -> Vec<f64> {
    let of_contact = |v: &[f64]| v[w.slips(i)].to_vec();
    let (drag, bend) = (of_contact(&forces.tangential), of_contact(&forces.slips));
    let along = if norm(&drag) > 0.0 { drag } else { bend };
    let length = norm(&along);
    match length > 0.0 {
        true => along.iter().map(|v| v / length).collect(),
        false => vec![1.0, 0.0],
    }
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
