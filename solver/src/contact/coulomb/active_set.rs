//! The equations of contacts that push and of contacts that stick, solved at once.
//!
//! Which these are is guessed from the present impulses, as in the primal-dual active set method (Hintermüller, Ito &
//! Kunisch 2002): a contact pushes where Λ - (J v + c)/(J D) > 0, and sticks where the friction that would stop it is
//! below μ Λ. Friction of contacts that slip stays what it is. Contacts that depend on each other make the matrix
//! singular: it gets a small share of its diagonal, and refinement takes the effect of that away again.

use super::island::{Island, Motion};
use super::law;
use crate::linalg::envelope::Envelope;

/// Added to the diagonal, relative to it.
const SHARE: f64 = 1e-12;
/// Refinements at most, and the relative residual that is enough.
const REFINEMENTS: usize = 6;

const NONE: u32 = u32::MAX;

/// An equation J v + c = 0.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Equation {
    contact: u32,
    /// 0 of the normal, k of the k-th entry of the slip velocity.
    row: u8,
}

/// Memory for systems of equations.
#[derive(Default)]
pub(crate) struct ActiveSet {
    equations: Vec<Equation>,
    previous: Vec<Equation>,
    /// By velocity the last of its equations, which are linked: (equation, the one before).
    last: Vec<u32>,
    links: Vec<(u32, u32)>,
    /// By equation those with which it has a velocity in common.
    starts: Vec<usize>,
    beside: Vec<u32>,
    seen: Vec<u32>,
    factors: Envelope,
    rhs: Vec<f64>,
    settled: bool,
}

impl ActiveSet {
    /// Whether the last solution has led to the same equations again.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// Solves for the impulses; false where the matrix cannot be factored.
    pub fn solve(&mut self, island: &Island, motion: &mut Motion) -> bool {
        std::mem::swap(&mut self.previous, &mut self.equations);
        self.choose(island, motion);
        self.settled = self.equations == self.previous;
        if !self.factor(island) {
            return false;
        }
        for _ in 0..REFINEMENTS {
            let size = self.defect(island, motion);
            if size == 0.0 {
                break;
            }
            self.factors.solve(&mut self.rhs);
            let rows = island.rows;
            for (equation, &z) in self.equations.iter().zip(&self.rhs) {
                let c = equation.contact as usize;
                let normal = island.laws.contacts()[c].normal;
                match equation.row {
                    0 => motion.impulses.normal[c] += z,
                    k => motion.impulses.tangential[c][usize::from(k) - 1] -= z,
                }
                rows.add_impulse(normal + usize::from(equation.row), z, motion.v);
            }
        }
        true
    }

    /// Picks the equations, and takes the impulses of all others away.
    fn choose(&mut self, island: &Island, motion: &mut Motion) {
        self.equations.clear();
        let most = |c: usize, motion: &Motion| {
            island.laws.friction[c] * motion.impulses.normal[c].max(0.0)
        };
        // All are judged before anything changes.
        for (c, contact) in island.iter() {
            if motion.trial_normal(island, c) <= 0.0 {
                continue;
            }
            let equation = |row| Equation {
                contact: c as u32,
                row,
            };
            self.equations.push(equation(0));
            let has_friction = contact.is_rough() && island.diagonal(c)[1] > 0.0;
            if has_friction && law::length(motion.trial_friction(island, c)) < most(c, motion) {
                self.equations
                    .extend((1..=contact.slips as u8).map(equation));
            }
        }
        let mut chosen = self.equations.iter().peekable();
        for (c, contact) in island.iter() {
            let is_of = |equation: &&Equation, is_slip: bool| {
                equation.contact as usize == c && (equation.row > 0) == is_slip
            };
            let pushes = chosen.next_if(|equation| is_of(equation, false)).is_some();
            let mut sticks = false;
            while chosen.next_if(|equation| is_of(equation, true)).is_some() {
                sticks = true;
            }
            if !pushes && motion.impulses.normal[c] != 0.0 {
                motion.set_normal(island, c, 0.0);
            }
            if contact.is_rough() && !sticks {
                let most = most(c, motion);
                let is_fixed = contact.is_conic() && island.diagonal(c)[1] == 0.0;
                let next = match (pushes && !is_fixed, contact.is_conic()) {
                    (false, _) => [0.0; 2],
                    (true, false) => [most.copysign(island.slip(c, motion.v)[0]), 0.0],
                    (true, true) => law::bounded(motion.trial_friction(island, c), most),
                };
                motion.set_tangential(island, c, next);
            }
        }
    }

    /// Row and sign of an equation: friction acts against its row.
    fn row(&self, island: &Island, equation: Equation) -> usize {
        let normal = island.laws.contacts()[equation.contact as usize].normal;
        normal + usize::from(equation.row)
    }

    /// -(J v + c) of all equations; its size.
    fn defect(&mut self, island: &Island, motion: &Motion) -> f64 {
        let rows = island.rows;
        let mut size = 0.0_f64;
        let mut rhs = std::mem::take(&mut self.rhs);
        rhs.clear();
        for &equation in &self.equations {
            let c = equation.contact as usize;
            let rate = match equation.row {
                0 => island.laws.normal_rate[c],
                k => island.laws.slip_rate[c][usize::from(k) - 1],
            };
            let defect = rows.rate(self.row(island, equation), motion.v) + rate;
            size = size.max(defect.abs());
            rhs.push(-defect);
        }
        self.rhs = rhs;
        size
    }

    /// J D of all equations, with a little more on the diagonal.
    fn factor(&mut self, island: &Island) -> bool {
        if self.equations.is_empty() {
            return false;
        }
        self.find_beside(island);
        self.factors.arrange(&self.starts, &self.beside);
        let rows = island.rows;
        for (e, &equation) in self.equations.iter().enumerate() {
            let row = self.row(island, equation);
            let beside = &self.beside[self.starts[e]..self.starts[e + 1]];
            for &other in beside.iter().filter(|&&other| other < e as u32) {
                let of_other = self.row(island, self.equations[other as usize]);
                let value = rows.coupling(row, of_other);
                self.factors.set(e, other as usize, value);
            }
            let diagonal = (1.0 + SHARE) * rows.diagonal(row);
            self.factors.set(e, e, diagonal);
        }
        self.factors.factor()
    }

    /// Finds which equations have velocities in common.
    fn find_beside(&mut self, island: &Island) {
        let rows = island.rows;
        let n = self.equations.len();
        self.links.clear();
        for e in 0..n {
            for &column in rows.columns(self.row(island, self.equations[e])) {
                let column = column as usize;
                if self.last.len() <= column {
                    self.last.resize(column + 1, NONE);
                }
                let link = self.links.len() as u32;
                self.links
                    .push((e as u32, std::mem::replace(&mut self.last[column], link)));
            }
        }
        self.seen.clear();
        self.seen.resize(n, NONE);
        self.beside.clear();
        self.starts.clear();
        self.starts.push(0);
        for e in 0..n {
            for &column in rows.columns(self.row(island, self.equations[e])) {
                let mut link = self.last[column as usize];
                while link != NONE {
                    let (other, before) = self.links[link as usize];
                    if std::mem::replace(&mut self.seen[other as usize], e as u32) != e as u32 {
                        self.beside.push(other);
                    }
                    link = before;
                }
            }
            self.starts.push(self.beside.len());
        }
        for e in 0..n {
            for &column in rows.columns(self.row(island, self.equations[e])) {
                self.last[column as usize] = NONE;
            }
        }
    }
}
