//! The equations of contacts that push and of contacts that stick, solved at once.
//!
//! Which these are is guessed from the present impulses, as in the primal-dual active set method (Hintermüller, Ito &
//! Kunisch 2002): a contact pushes where Λ - (J v + c)/(J D) > 0, and sticks where the friction that would stop it is
//! below μ Λ. Friction of contacts that slip stays what it is. Contacts that depend on each other make the matrix
//! singular: it gets a small share of its diagonal, and refinement takes the effect of that away again.

use super::impulse::{Impulses, Island};
use crate::linalg::ldl::SparseLdl;
use crate::linalg::symmetric::KktSolver;
use crate::problem::Pattern;

/// Added to the diagonal, relative to it.
const SHARE: f64 = 1e-12;
/// Refinements at most, and the relative residual that is enough.
const REFINEMENTS: usize = 6;

/// An equation J v + c = 0.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Equation {
    contact: u32,
    is_slip: bool,
}

/// Memory for systems of equations.
#[derive(Default)]
pub(super) struct Direct {
    equations: Vec<Equation>,
    previous: Vec<Equation>,
    /// Equations by velocity.
    by_column: Vec<Vec<u32>>,
    pattern: Option<Pattern>,
    values: Vec<f64>,
    rhs: Vec<f64>,
    ldl: Option<SparseLdl>,
    settled: bool,
    saved: (Vec<f64>, Vec<f64>, Vec<f64>),
}

impl Direct {
    /// Whether the last solution has led to the same equations again.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// Keeps impulses and velocities.
    pub fn save(&mut self, island: &Island, impulses: &Impulses, v: &[f64]) {
        let (normal, tangential, velocities) = &mut self.saved;
        normal.clear();
        tangential.clear();
        for (c, _) in island.iter() {
            normal.push(impulses.normal[c]);
            tangential.push(impulses.tangential[c]);
        }
        velocities.clear();
        velocities.extend_from_slice(v);
    }

    /// Brings back what was kept.
    pub fn restore(&mut self, island: &Island, impulses: &mut Impulses, v: &mut [f64]) {
        let (normal, tangential, velocities) = &self.saved;
        for ((c, _), (normal, tangential)) in island.iter().zip(normal.iter().zip(tangential)) {
            (impulses.normal[c], impulses.tangential[c]) = (*normal, *tangential);
        }
        v.copy_from_slice(velocities);
    }

    /// Solves for the impulses; false where the matrix cannot be factored.
    pub fn solve(&mut self, island: &Island, impulses: &mut Impulses, v: &mut [f64]) -> bool {
        std::mem::swap(&mut self.previous, &mut self.equations);
        self.choose(island, impulses, v);
        self.settled = self.equations == self.previous;
        if !self.factor(island) {
            return false;
        }
        for _ in 0..REFINEMENTS {
            let size = self.defect(island, impulses, v);
            if size == 0.0 {
                break;
            }
            let ldl = self.ldl.as_mut().expect("the matrix has been factored");
            ldl.solve(&mut self.rhs);
            let rows = &island.linear.rows;
            for (equation, &z) in self.equations.iter().zip(&self.rhs) {
                let c = equation.contact as usize;
                let normal = island.linear.contacts[c].normal;
                if equation.is_slip {
                    impulses.tangential[c] -= z;
                    rows.push_by(normal + 1, z, v);
                } else {
                    impulses.normal[c] += z;
                    rows.push_by(normal, z, v);
                }
            }
        }
        true
    }

    /// Picks the equations, and takes the impulses of all others away.
    fn choose(&mut self, island: &Island, impulses: &mut Impulses, v: &mut [f64]) {
        self.equations.clear();
        let rows = &island.linear.rows;
        // All are judged before anything changes.
        for (c, contact) in island.iter() {
            let [normal, tangential] = impulses.diagonal(c);
            let rate = rows.rate(contact.normal, v) + impulses.normal_rate[c];
            if impulses.normal[c] - rate / normal <= 0.0 {
                continue;
            }
            let contact_number = c as u32;
            self.equations.push(Equation {
                contact: contact_number,
                is_slip: false,
            });
            if contact.is_rough && tangential > 0.0 {
                let slip = rows.rate(contact.normal + 1, v) + impulses.slip_rate[c];
                let most = impulses.friction[c] * impulses.normal[c].max(0.0);
                if (impulses.tangential[c] + slip / tangential).abs() < most {
                    self.equations.push(Equation {
                        contact: contact_number,
                        is_slip: true,
                    });
                }
            }
        }
        let mut chosen = self.equations.iter().peekable();
        for (c, contact) in island.iter() {
            let is_of = |equation: &&Equation, is_slip| {
                equation.contact as usize == c && equation.is_slip == is_slip
            };
            let pushes = chosen.next_if(|equation| is_of(equation, false)).is_some();
            let sticks = chosen.next_if(|equation| is_of(equation, true)).is_some();
            if !pushes && impulses.normal[c] != 0.0 {
                rows.push_by(contact.normal, -impulses.normal[c], v);
                impulses.normal[c] = 0.0;
            }
            if contact.is_rough && !sticks {
                let most = impulses.friction[c] * impulses.normal[c].max(0.0);
                let slip = rows.rate(contact.normal + 1, v) + impulses.slip_rate[c];
                let next = match pushes {
                    true => most.copysign(slip),
                    false => 0.0,
                };
                rows.push_by(contact.normal + 1, impulses.tangential[c] - next, v);
                impulses.tangential[c] = next;
            }
        }
    }

    /// Row and sign of an equation: friction acts against its row.
    fn row(&self, island: &Island, equation: Equation) -> usize {
        let normal = island.linear.contacts[equation.contact as usize].normal;
        normal + usize::from(equation.is_slip)
    }

    /// -(J v + c) of all equations; its size.
    fn defect(&mut self, island: &Island, impulses: &Impulses, v: &[f64]) -> f64 {
        let rows = &island.linear.rows;
        let mut size = 0.0_f64;
        let mut rhs = std::mem::take(&mut self.rhs);
        rhs.clear();
        for &equation in &self.equations {
            let c = equation.contact as usize;
            let rate = match equation.is_slip {
                true => impulses.slip_rate[c],
                false => impulses.normal_rate[c],
            };
            let defect = rows.rate(self.row(island, equation), v) + rate;
            size = size.max(defect.abs());
            rhs.push(-defect);
        }
        self.rhs = rhs;
        size
    }

    /// J D of all equations, with a little more on the diagonal.
    fn factor(&mut self, island: &Island) -> bool {
        let rows = &island.linear.rows;
        let n = self.equations.len();
        if n == 0 {
            self.ldl = None;
            return false;
        }
        self.by_column.iter_mut().for_each(Vec::clear);
        for (e, &equation) in self.equations.iter().enumerate() {
            for &column in rows.columns(self.row(island, equation)) {
                let column = column as usize;
                if self.by_column.len() <= column {
                    self.by_column.resize(column + 1, Vec::new());
                }
                self.by_column[column].push(e as u32);
            }
        }
        let mut pattern = Pattern {
            starts: vec![0],
            columns: Vec::new(),
        };
        self.values.clear();
        for (e, &equation) in self.equations.iter().enumerate() {
            let row = self.row(island, equation);
            let first = pattern.columns.len();
            for &column in rows.columns(row) {
                let others = self.by_column[column as usize].iter();
                pattern
                    .columns
                    .extend(others.copied().filter(|&other| other <= e as u32));
            }
            pattern.columns[first..].sort_unstable();
            let mut kept = first;
            for k in first..pattern.columns.len() {
                if k == first || pattern.columns[k] != pattern.columns[kept - 1] {
                    pattern.columns[kept] = pattern.columns[k];
                    kept += 1;
                }
            }
            pattern.columns.truncate(kept);
            for &other in &pattern.columns[first..] {
                let of_other = self.row(island, self.equations[other as usize]);
                let mut value = rows.coupling(row, of_other);
                if other == e as u32 {
                    value *= 1.0 + SHARE;
                }
                self.values.push(value);
            }
            pattern.starts.push(pattern.columns.len());
        }
        if self.pattern.as_ref() != Some(&pattern) || self.ldl.is_none() {
            self.ldl = Some(SparseLdl::new(&pattern));
            self.pattern = Some(pattern);
        }
        let ldl = self.ldl.as_mut().expect("it has just been made");
        ldl.factor(&self.values).is_ok()
    }
}
