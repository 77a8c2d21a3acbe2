//! Which conditional rows hold, given which member of every pair is zero.
//!
//! A pair a ⟂ b of an element is *open* where b is zero in all of it, so that a may be positive. At a boundary within
//! a step,
//!
//! - nothing switches where the same pairs are open on both sides: the lengths of the two elements are equal;
//! - a pair that closes while none opens leaves a sliding mode: a is zero there.
//!
//! What closes for a nonlinear switch is its a times the stability of its sliding mode; where controls are continuous
//! between steps it closes there, too.
//!
//! An impact is a switch, too: a contact that was not closed before has a gap that is zero at the boundary. So is a slip
//! velocity with two entries that turns round: it is zero at the boundary, and not in the elements on both sides.
//!
//! Where a pair opens, b is continuous and zero at the boundary, which is row enough. Of several pairs that close at
//! one boundary, the first fixes it.

use std::ops::Range;

use nsd_solver::optimization::problem::Member;
use serde::{Deserialize, Serialize};

/// The blocks of one grid of elements.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    /// Steps.
    pub steps: usize,
    /// Elements of a step.
    pub elements: usize,
    /// The pairs of elements.
    pub groups: Vec<Group>,
    /// The block of rows that make lengths equal.
    pub equal: Option<usize>,
    /// Whether elements have pairs besides.
    pub has_more: bool,
    /// How sliding modes of nonlinear switches end where a step does.
    pub branches: Branches,
    /// The pairs of impulses, where contacts give them.
    pub impulses: Option<Impulses>,
    /// The pairs of slip velocities with two entries where elements begin.
    pub rests: Option<Rests>,
}

/// Ends of sliding modes where steps end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Branches {
    /// Members, of all groups, that close where a nonlinear switch leaves its surface.
    pub members: Vec<usize>,
    /// The block of rows by which they do.
    pub leave: Option<usize>,
}

/// Pairs of an impulse and a gap where elements begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impulses {
    /// The number of the first of them among all pairs.
    pub first_pair: usize,
    /// The algebraic variable that the gap of every contact is.
    pub gaps: Vec<usize>,
}

/// Pairs of |w| and 1 - |u|² where elements begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rests {
    /// The number of the first of them among all pairs.
    pub first_pair: usize,
    /// The algebraic variable that every |w| is.
    pub slips: Vec<usize>,
}

/// Pairs of elements, and their conditional rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The number of the first of these pairs among all pairs.
    pub first_pair: usize,
    /// Pairs of an element that belong to one member.
    pub per_element: usize,
    /// Members.
    pub members: usize,
    /// The algebraic variable that b of every member is.
    pub continuous: Vec<usize>,
    /// The algebraic variable in a of every member, and its derivative by it: 1, or -1 for 1 - z.
    pub jumps: Vec<(usize, f64)>,
    /// The block of rows by which a closes.
    pub leave: usize,
}

/// A block of conditional rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    /// Its number.
    pub number: usize,
    /// How many there are.
    pub rows: usize,
}

/// Rows that hold.
#[derive(Clone, Debug, Default)]
pub(crate) struct Holding {
    rows: Vec<(usize, usize)>,
}

impl Holding {
    /// Whether a row of a block does.
    pub fn contains(&self, block: usize, row: usize) -> bool {
        self.rows.binary_search(&(block, row)).is_ok()
    }
}

impl Conditions {
    fn boundaries(&self) -> usize {
        self.steps * self.elements.saturating_sub(1)
    }

    /// Whether all pairs are among so many, and the elements no more than pairs or rows.
    pub(crate) fn fit(&self, n_pairs: usize, n_rows: usize) -> bool {
        let Some(n) = self.steps.checked_mul(self.elements) else {
            return false;
        };
        let are_pairs = |first: usize, count: Option<usize>| {
            let end = count.and_then(|count| first.checked_add(count));
            end.is_some_and(|end| end <= n_pairs)
        };
        let mut groups = self.groups.iter();
        let fit = groups.all(|group| {
            let of_members = n.checked_mul(group.members);
            let count = of_members.and_then(|count| count.checked_mul(group.per_element));
            let is_whole = group.per_element > 0 && group.continuous.len() <= group.members;
            is_whole && are_pairs(group.first_pair, count)
        });
        let n_members: usize = self.groups.iter().map(|group| group.members).sum();
        let (impulses, rests) = (self.impulses.iter(), self.rests.iter());
        let impulses = impulses.map(|impulses| (impulses.first_pair, impulses.gaps.len()));
        let rests = rests.map(|rests| (rests.first_pair, rests.slips.len()));
        let mut beginnings = impulses.chain(rests);
        fit && n <= n_pairs.max(n_rows)
            && beginnings.all(|(first, count)| are_pairs(first, n.checked_mul(count)))
            && self
                .branches
                .members
                .iter()
                .all(|member| *member < n_members)
            && (self.branches.leave.is_none() || self.steps > 0)
    }

    /// All blocks of conditional rows.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Rows> + '_ {
        let equal = self.equal.map(|number| Rows {
            number,
            rows: self.boundaries(),
        });
        let leave = self.groups.iter().map(|group| Rows {
            number: group.leave,
            rows: group.members * self.boundaries(),
        });
        let branches = &self.branches;
        let between = branches.leave.map(|number| Rows {
            number,
            rows: branches.members.len() * (self.steps - 1),
        });
        equal.into_iter().chain(leave).chain(between)
    }

    /// Which pairs are open in an element, counted from 0: those of all groups, one after the other.
    pub fn open(&self, element: usize, zeros: &[Member]) -> Vec<bool> {
        let n = self.steps * self.elements;
        let of_group = |group: &Group| {
            let open = |member| group.is_open(member, element, n, zeros);
            (0..group.members).map(open).collect::<Vec<bool>>()
        };
        self.groups.iter().flat_map(of_group).collect()
    }

    /// The pairs of an element with the member that is zero where these are open, and the others are not.
    pub fn zeros(
        &self,
        element: usize,
        open: &[bool],
    ) -> impl Iterator<Item = (Range<usize>, Member)> {
        let n = self.steps * self.elements;
        let members = (self.groups.iter())
            .flat_map(|group| (0..group.members).map(move |member| (group, member)));
        members.zip(open).map(move |((group, member), &open)| {
            let zero = if open { Member::B } else { Member::A };
            (group.pairs(member, element, n), zero)
        })
    }

    /// Whether a contact that was open before gives an impulse where an element begins.
    fn is_struck(&self, element: usize, zeros: &[Member]) -> bool {
        let n = self.steps * self.elements;
        let Some(impulses) = &self.impulses else {
            return false;
        };
        let was_closed = |gap: usize| {
            self.groups.iter().any(|group| {
                let member = group.continuous.iter().position(|&b| b == gap);
                member.is_some_and(|member| group.is_open(member, element - 1, n, zeros))
            })
        };
        let mut contacts = impulses.gaps.iter().enumerate();
        contacts.any(|(c, &gap)| {
            let pair = impulses.first_pair + c * n + element;
            zeros[pair] == Member::B && !was_closed(gap)
        })
    }

    /// Whether a slip velocity with two entries is at rest where an element begins, and slips in it and before.
    fn turns_round(&self, element: usize, zeros: &[Member]) -> bool {
        let n = self.steps * self.elements;
        let Some(rests) = &self.rests else {
            return false;
        };
        let slips_around = |slip: usize| {
            self.groups.iter().any(|group| {
                let member = group.continuous.iter().position(|&b| b == slip);
                let is_open = |member, element| group.is_open(member, element, n, zeros);
                member.is_some_and(|at| !is_open(at, element - 1) && !is_open(at, element))
            })
        };
        let mut slips = rests.slips.iter().enumerate();
        slips.any(|(c, &slip)| {
            let pair = rests.first_pair + c * n + element;
            zeros[pair] == Member::A && slips_around(slip)
        })
    }

    /// The rows that hold.
    pub(crate) fn holding(&self, zeros: &[Member]) -> Holding {
        let mut rows = Vec::new();
        let inner = self.elements.saturating_sub(1);
        for boundary in 0..self.boundaries() {
            let (step, element) = (boundary / inner, boundary % inner);
            let element = step * self.elements + element;
            let mut closing = None;
            let met = self.is_struck(element + 1, zeros) || self.turns_round(element + 1, zeros);
            let (mut opens, mut changes) = (met, met);
            for group in &self.groups {
                for member in 0..group.members {
                    let n_elements = self.steps * self.elements;
                    let open = |element| group.is_open(member, element, n_elements, zeros);
                    match (open(element), open(element + 1)) {
                        (true, false) => {
                            changes = true;
                            let row = member * self.boundaries() + boundary;
                            closing = closing.or(Some((group.leave, row)));
                        }
                        (false, true) => (opens, changes) = (true, true),
                        _ => {}
                    }
                }
            }
            if !opens {
                rows.extend(closing);
            }
            if let (false, Some(equal)) = (changes, self.equal) {
                rows.push((equal, boundary));
            }
        }
        if let Some(leave) = self.branches.leave {
            for step in 1..self.steps {
                let element = step * self.elements - 1;
                let [before, behind] = [element, element + 1].map(|e| self.open(e, zeros));
                let members = self.branches.members.iter().enumerate();
                let closing = members.filter(|&(_, &member)| before[member] && !behind[member]);
                rows.extend(closing.map(|(at, _)| (leave, at * (self.steps - 1) + step - 1)));
            }
        }
        rows.sort_unstable();
        Holding { rows }
    }
}

impl Group {
    fn is_open(&self, member: usize, element: usize, n_elements: usize, zeros: &[Member]) -> bool {
        zeros[self.pairs(member, element, n_elements)].contains(&Member::B)
    }

    fn pairs(&self, member: usize, element: usize, n_elements: usize) -> Range<usize> {
        let places = n_elements * self.per_element;
        let first = self.first_pair + member * places + element * self.per_element;
        first..first + self.per_element
    }
}

#[cfg(test)]
mod tests {
    use super::{Conditions, Group, Rests};
    use nsd_solver::optimization::problem::Member;

    #[test]
    fn a_mode_that_ends_has_the_row_of_its_member_and_boundary() {
        // Two steps of three elements, two members: the second one is open in the first element.
        let conditions = Conditions {
            steps: 2,
            elements: 3,
            groups: vec![Group {
                first_pair: 0,
                per_element: 1,
                members: 2,
                continuous: vec![0, 1],
                jumps: vec![(2, 1.0), (3, 1.0)],
                leave: 5,
            }],
            equal: Some(4),
            ..Conditions::default()
        };
        let mut zeros = [Member::A; 12];
        zeros[6] = Member::B;
        let holding = conditions.holding(&zeros);
        // It ends at the first of four boundaries within steps; at the others nothing changes.
        let leaves: Vec<usize> = (0..8).filter(|&row| holding.contains(5, row)).collect();
        let equal: Vec<usize> = (0..4).filter(|&row| holding.contains(4, row)).collect();
        assert_eq!((leaves, equal), (vec![4], vec![1, 2, 3]));
    }

    #[test]
    fn lengths_are_free_where_slip_in_a_plane_turns_round() {
        // A step of three elements; γ is the variable 1, and not zero in any of them.
        let conditions = Conditions {
            steps: 1,
            elements: 3,
            groups: vec![Group {
                first_pair: 0,
                per_element: 1,
                members: 1,
                continuous: vec![1],
                jumps: vec![(2, 1.0)],
                leave: 5,
            }],
            equal: Some(4),
            rests: Some(Rests {
                first_pair: 3,
                slips: vec![1],
            }),
            ..Conditions::default()
        };
        // γ⁺ is zero where the third element begins, and not where the second one does.
        let mut zeros = [Member::A, Member::A, Member::A].to_vec();
        zeros.extend([Member::B, Member::B, Member::A]);
        let holding = conditions.holding(&zeros);
        let equal: Vec<usize> = (0..2).filter(|&row| holding.contains(4, row)).collect();
        assert_eq!(equal, vec![0]);
        // Where the contact sticks on both sides, γ⁺ is zero, and nothing switches.
        zeros[1] = Member::B;
        zeros[2] = Member::B;
        let holding = conditions.holding(&zeros);
        assert!(holding.contains(4, 1));
    }
}
