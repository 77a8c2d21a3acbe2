//! Powers without a derivative at zero: √u, |u|^(1/3), max(u, 0)^1.5.
//!
//! A power u^p whose exponent p > 0 is no integer has no Taylor series at u = 0. Where u = c ψ of a switch, as in
//! max(ψ, 0)^p = α ψ^p and |ψ|^p = α ψ^p + (1 - α) (-ψ)^p, it is smooth off the surface, and zero on it.

use crate::expr::{BinaryFunction, Expr, Function, Node, rewrite_all};
use crate::system::{Role, System};

/// u^p with p > 0, no integer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root<'e> {
    /// u.
    pub base: Expr<'e>,
    /// p.
    pub power: f64,
}

impl<'e> Root<'e> {
    /// The root that an expression is, if it is one.
    pub fn of(e: Expr<'e>) -> Option<Root<'e>> {
        if !e.is_function() {
            return None;
        }
        match e.node() {
            Node::Unary(Function::Sqrt, base) => Some(Root { base, power: 0.5 }),
            Node::Binary(BinaryFunction::Pow, base, power) => {
                let power = power.as_constant()?;
                let is_root = power > 0.0 && power.fract() != 0.0;
                is_root.then_some(Root { base, power })
            }
            _ => None,
        }
    }

    /// (`factor` u²)^(p/2), which is u^p for factor 1 and u ≥ 0, and a number for every u.
    pub fn extended(self, factor: Expr<'e>) -> Expr<'e> {
        let half = self.base.exprs().constant(0.5 * self.power);
        (factor * self.base.powi(2)).powf(half)
    }
}

/// What vanishes on the surfaces of a system.
pub struct Vanishing<'e> {
    /// ψ up to a number, with its switch.
    surfaces: Vec<(Expr<'e>, usize)>,
}

impl<'e> Vanishing<'e> {
    /// The switching functions of steps, with the numbers that `switching` has in them.
    pub fn of(system: &System<'e>, switching: &[Expr<'e>]) -> Self {
        let switches = system.switches.iter().enumerate();
        let is_step = |switch: &crate::system::Switch| {
            let is_own = switch.role == Role::Step && switch.relay.is_none();
            let is_contact = switch.unilateral || switch.slip_of.is_some();
            is_own && !is_contact && switch.across.is_none() && !switch.is_nonlinear
        };
        let steps = switches.filter(|(_, switch)| is_step(switch));
        Vanishing {
            surfaces: steps
                .map(|(i, _)| (switching[i].split_scale().1, i))
                .collect(),
        }
    }

    /// Expressions in which roots of switching functions are numbers on both sides of their surface: what has the weight 0
    /// there is no number otherwise.
    pub fn extended(&self, exprs: &[Expr<'e>]) -> Vec<Expr<'e>> {
        rewrite_all(exprs, &mut |e| match self.root(e) {
            Some((root, _)) => root.extended(e.exprs().constant(1.0)),
            None => e,
        })
    }

    /// The root that e is, and the switch on whose surface it vanishes.
    pub fn root(&self, e: Expr<'e>) -> Option<(Root<'e>, usize)> {
        if self.surfaces.is_empty() {
            return None;
        }
        let root = Root::of(e)?;
        let base = root.base.split_scale().1;
        let find = |u: Expr<'e>| {
            let mut surfaces = self.surfaces.iter();
            surfaces.find_map(|&(psi, switch)| (psi == u).then_some(switch))
        };
        let switch = find(base).or_else(|| match base.node() {
            Node::Product(factors) => {
                let mut above = factors.into_iter().filter(|(_, power)| *power > 0);
                above.find_map(|(factor, _)| find(factor.split_scale().1))
            }
            _ => None,
        });
        Some((root, switch?))
    }
}
