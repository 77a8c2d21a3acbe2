//! Bodies and their contacts, as a [`System`](crate::system::System) has them.

use crate::expr::Expr;
use crate::model::Restitution;
use crate::source::Span;

/// A block of mechanics, M(q) v' = f + Σ J_n λ_n + J_t λ_t.
#[derive(Clone, Debug)]
pub struct Body<'e> {
    /// Indices of the states q.
    pub positions: Vec<usize>,
    /// Indices of the states v.
    pub velocities: Vec<usize>,
    /// M, row by row.
    pub mass: Vec<Expr<'e>>,
    /// f.
    pub force: Vec<Expr<'e>>,
    /// The statement.
    pub span: Span,
}

/// A contact between bodies: gap ≥ 0 ⟂ λ_n ≥ 0, and at an impact what its law of restitution says.
#[derive(Clone, Debug)]
pub struct Contact<'e> {
    /// Name in the model, with the number of a feature.
    pub name: String,
    /// The contact of the model whose gap has this feature and others.
    pub feature_of: Option<String>,
    /// What is never negative.
    pub gap: Expr<'e>,
    /// Its rate J_nᵀv + ∂gap/∂t.
    pub speed: Expr<'e>,
    /// J_n, which may depend on q and t.
    pub normal: Vec<Direction<'e>>,
    /// What it gives back of an impact.
    pub restitution: Restitution<'e>,
    /// None where it is smooth.
    pub friction: Option<Friction<'e>>,
    /// The unilateral switch of the gap: λ_n = 1 - α.
    pub switch: usize,
    /// The statement.
    pub span: Span,
}

/// A contact without a switch, and without a force in the rates.
#[derive(Clone, Debug)]
pub struct Impulsive<'e> {
    /// Name in the model, with the number of a feature.
    pub name: String,
    /// The contact of the model whose gap has this feature and others.
    pub feature_of: Option<String>,
    /// What is never negative.
    pub gap: Expr<'e>,
    /// What it gives back of an impact.
    pub restitution: Restitution<'e>,
    /// μ, and the one or two entries of the slip velocity, affine in velocities; none where it is smooth.
    pub friction: Option<(Expr<'e>, Vec<Expr<'e>>)>,
    /// The statement.
    pub span: Span,
}

/// Coulomb's law -λ_t ∈ μ λ_n ∂|w|, of impulses, too.
#[derive(Clone, Debug)]
pub struct Friction<'e> {
    /// μ.
    pub coefficient: Expr<'e>,
    /// The entries of w: one, or two along directions at right angles.
    pub slips: Vec<Slip<'e>>,
}

/// One entry of a slip velocity.
#[derive(Clone, Debug)]
pub struct Slip<'e> {
    /// w_k, J_tᵀv and what does not depend on v.
    pub velocity: Expr<'e>,
    /// J_t.
    pub tangent: Vec<Direction<'e>>,
    /// Its switch: λ_t = -μ λ_n (2α - 1).
    pub switch: usize,
}

/// What a force of a contact does to a velocity.
#[derive(Clone, Copy, Debug)]
pub struct Direction<'e> {
    /// Index of the velocity among the states.
    pub state: usize,
    /// Entry of J.
    pub row: Expr<'e>,
    /// Entry of M⁻¹J.
    pub push: Expr<'e>,
}

impl<'e> Body<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.mass.iter().chain(&self.force).copied()
    }
}

impl<'e> Impulsive<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let friction = self.friction.iter();
        let friction =
            friction.flat_map(|(coefficient, slip)| [coefficient].into_iter().chain(slip));
        let friction = friction.copied();
        [self.gap, self.restitution.coefficient]
            .into_iter()
            .chain(friction)
    }
}

impl<'e> Contact<'e> {
    /// The entries of its slip velocity, none where it is smooth.
    pub fn slips(&self) -> &[Slip<'e>] {
        self.friction
            .as_ref()
            .map_or(&[], |friction| &friction.slips)
    }

    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let slips = || self.slips().iter();
        let directions = self
            .normal
            .iter()
            .chain(slips().flat_map(|slip| &slip.tangent));
        [self.gap, self.speed, self.restitution.coefficient]
            .into_iter()
            .chain(self.friction.iter().map(|friction| friction.coefficient))
            .chain(slips().map(|slip| slip.velocity))
            .chain(directions.flat_map(|direction| [direction.row, direction.push]))
    }
}
