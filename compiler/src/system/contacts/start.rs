//! What contacts look like where a run starts.
//!
//! Bodies must not overlap. Closed contacts whose normals depend on each other, Σ c_i J_i = 0, leave their forces
//! open and nothing else, which is a warning, found by orthogonalization in the norm of M⁻¹; so is friction that may
//! pull a body into its contact, J_nᵀM⁻¹(J_n ± μ J_t) <= 0 (Painlevé's paradox; Génot & Brogliato 1999), and directions
//! of friction that are none, see `directions`.

use rustc_hash::FxHashMap;

use super::directions;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::system::{Contact, Direction, System, SystemError};

/// A gap below this fraction of its terms is zero.
const TOUCH: f64 = 1e-9;

/// The same where all terms are zero.
const ROUNDING: f64 = 1e-12;

/// What is left of the square of a normal by others, below this fraction, is rounding.
const DEPENDENT: f64 = 1e-12;

/// Values of time, parameters and states at the start.
pub(crate) struct Start(FxHashMap<Var, f64>);

impl Start {
    /// NaN where it is not known before the run.
    pub(crate) fn value(&self, e: Expr<'_>) -> f64 {
        e.eval(&|var| self.0.get(&var).copied().unwrap_or(f64::NAN))
    }

    /// The same where one of the variables that are not known is 0.
    pub(crate) fn value_at_zero(&self, e: Expr<'_>, zero: Option<Var>) -> f64 {
        let value = |var| {
            if Some(var) == zero {
                0.0
            } else {
                self.0.get(&var).copied().unwrap_or(f64::NAN)
            }
        };
        e.eval(&value)
    }

    /// How far a gap is from zero: 0 where it is within rounding, NaN where it is not known.
    pub(crate) fn gap(&self, gap: Expr<'_>) -> f64 {
        let value = self.value(gap);
        if value >= ROUNDING.sqrt() {
            return value;
        }
        let vars = variables_of(&[gap]).into_iter();
        let known = vars.filter_map(|var| Some((var, self.0.get(&var)?)));
        let terms = known.map(|(var, value)| (self.value(gap.diff(var)) * value).abs());
        let terms: f64 = terms.sum();
        match value.abs() <= f64::max(TOUCH * terms, ROUNDING) {
            true => 0.0,
            false => value,
        }
    }

    /// J_a M⁻¹ J_b.
    fn effect(&self, by: &[Direction<'_>], on: &[Direction<'_>]) -> f64 {
        let terms = by.iter().flat_map(|by| {
            let same = on.iter().filter(|on| on.state == by.state);
            same.map(|on| self.value(on.row) * self.value(by.push))
        });
        terms.sum()
    }
}

impl<'e> System<'e> {
    /// Says what is wrong, and what may become so.
    pub(crate) fn check_start(&self, diags: &mut Diagnostics) {
        if self.jumps.contacts.is_empty() && self.jumps.impulsive.is_empty() {
            return;
        }
        let start = self.start();
        let named = (self.jumps.contacts.iter()).map(|c| (&c.name, c.gap, c.span));
        let impulsive = (self.jumps.impulsive.iter()).map(|c| (&c.name, c.gap, c.span));
        for (name, gap, span) in named.chain(impulsive) {
            let gap = start.gap(gap);
            if gap < 0.0 {
                let name = name.clone();
                diags.push(SystemError::StartsBelow { name, gap, span });
            }
        }
        self.check_coefficients(&start, diags);
        let closed = |contact: &&Contact<'e>| start.gap(contact.gap) == 0.0;
        let closed: Vec<&Contact<'e>> = self.jumps.contacts.iter().filter(closed).collect();
        if let Some(error) = self.dependent(&start, &closed) {
            diags.push(error);
        }
        directions::check(self, &start, diags);
        for contact in &self.jumps.contacts {
            let Some(friction) = &contact.friction else {
                continue;
            };
            let push = start.effect(&contact.normal, &contact.normal);
            let slips = friction.slips.iter();
            let drags = slips.map(|slip| start.effect(&slip.tangent, &contact.normal));
            let drag = drags.fold(0.0, f64::hypot);
            if push <= start.value(friction.coefficient) * drag {
                diags.push(SystemError::Pulls {
                    name: contact.name.clone(),
                    span: contact.span,
                });
            }
        }
    }

    /// 0 <= e <= 1 and 0 <= μ where parameters alone decide: those that stay open when a system is lowered have values now.
    fn check_coefficients(&self, start: &Start, diags: &mut Diagnostics) {
        let is_param = |var: &Var| {
            let mut params = self.exogenous.params.iter();
            params.any(|param| param.var.as_variable() == Some(*var))
        };
        let value = |e: Expr<'e>| match variables_of(&[e]).iter().all(is_param) {
            true => start.value(e),
            false => f64::NAN,
        };
        for contact in &self.jumps.contacts {
            let e = value(contact.restitution.coefficient);
            let friction = contact.friction.as_ref();
            let friction = friction.map(|friction| value(friction.coefficient));
            let what = match friction.unwrap_or(0.0) {
                _ if (e - 0.5).abs() > 0.5 => "its restitution is not in [0, 1]",
                mu if mu < 0.0 => "its friction is negative",
                _ => continue,
            };
            diags.push(SystemError::NoContact {
                name: contact.name.clone(),
                what: what.to_owned(),
                span: contact.span,
            });
        }
    }

    pub(crate) fn start(&self) -> Start {
        let params = self.exogenous.params.iter().enumerate();
        let params = params.filter(|(place, _)| !self.is_free(*place));
        let params = params.map(|(_, param)| (param.var, param.value));
        let states = self.states.iter().map(|state| (state.var, state.initial));
        let all = params.chain(states).chain([(self.time, 0.0)]);
        let mut known: FxHashMap<Var, f64> = all
            .filter_map(|(var, value)| Some((var.as_variable()?, value)))
            .collect();
        let free = self.task.iter().flat_map(|task| &task.initial);
        for var in free.filter_map(|free| self.states[free.place].var.as_variable()) {
            known.remove(&var);
        }
        Start(known)
    }

    /// The first contact whose normal the others make up, with these.
    fn dependent(&self, start: &Start, closed: &[&Contact<'e>]) -> Option<SystemError> {
        /// J, M⁻¹J and what they are made of.
        struct Normal([Vec<f64>; 2], Vec<f64>);
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let mut basis: Vec<Normal> = Vec::new();
        for (i, contact) in closed.iter().enumerate() {
            let mut normal = [vec![0.0; self.states.len()], vec![0.0; self.states.len()]];
            for direction in &contact.normal {
                normal[0][direction.state] = start.value(direction.row);
                normal[1][direction.state] = start.value(direction.push);
            }
            let mut made = vec![0.0; closed.len()];
            made[i] = 1.0;
            let whole = dot(&normal[0], &normal[1]);
            // Twice is enough.
            for Normal(other, of) in basis.iter().chain(&basis) {
                let share = dot(&normal[0], &other[1]);
                for (v, other) in normal.iter_mut().zip(other) {
                    v.iter_mut().zip(other).for_each(|(v, o)| *v -= share * o);
                }
                made.iter_mut().zip(of).for_each(|(v, o)| *v -= share * o);
            }
            let left = dot(&normal[0], &normal[1]);
            if left <= DEPENDENT * whole {
                let takes_part = |k: &usize| *k != i && made[*k].abs() > DEPENDENT.sqrt();
                let others = (0..i).filter(takes_part);
                let others: Vec<String> = others.map(|k| format!("`{}`", closed[k].name)).collect();
                return Some(SystemError::DependentNormals {
                    name: contact.name.clone(),
                    others: others.join(", "),
                    span: contact.span,
                });
            }
            if !left.is_finite() {
                continue;
            }
            let unit = 1.0 / left.sqrt();
            let all = normal.iter_mut().chain([&mut made]);
            all.flatten().for_each(|v| *v *= unit);
            basis.push(Normal(normal, made));
        }
        None
    }
}
