//! Contacts as FESD with jumps states them: forces in elements, impulses where elements meet.
//!
//! In an element a contact is the pair 0 ≤ λ ⟂ gap ≥ 0 with a switch α ∈ step(w) of its slip velocity, as the step
//! reformulation of a [`System`] has it. Where elements meet velocities jump,
//!
//! v⁺ - v⁻ = Σ M⁻¹(J_n - μ (2α⁺ - 1) J_t) Λ,   0 ≤ Λ ⟂ gap ≥ 0,   0 ≤ Λ ⟂ J_nᵀ(v⁺ + e v⁻) ≥ 0 at gap = 0,
//! α⁺ ∈ step(w(v⁺))
//!
//! over all contacts. A slip velocity is one number, so that Coulomb's cone and every polyhedral approximation of it
//! are the same interval [-μΛ, μΛ], and -μΛ (2α⁺ - 1) with w⁺ = λᵖ - λⁿ, 0 ≤ λⁿ ⟂ α⁺ ≥ 0, 0 ≤ λᵖ ⟂ 1 - α⁺ ≥ 0 is
//! its force: not a row more, and none that an open contact leaves undetermined.
//!
//! Nurkanović, Frey, Pozharskiy & Diehl 2024, with another way to force an impact: see `discretize`.

use super::{Dcs, labels};
use crate::expr::{Expr, Substitution, variables_of};
use crate::source::Span;
use crate::system::{Direction, System};

/// A contact whose impulse acts where elements meet.
#[derive(Clone, Debug)]
pub struct Impact<'e> {
    /// Its name.
    pub name: String,
    /// The place of λ among the algebraic variables.
    pub force: usize,
    /// The place of its gap.
    pub gap: usize,
    /// Λ, a variable of every boundary.
    pub impulse: Expr<'e>,
    /// J_nᵀv + ∂gap/∂t in the states on one side.
    pub speed: Expr<'e>,
    /// e.
    pub restitution: Expr<'e>,
    /// M⁻¹J_n, by state.
    pub push: Vec<(usize, Expr<'e>)>,
    /// None where it is smooth.
    pub friction: Option<Friction<'e>>,
    /// The statement.
    pub span: Span,
}

/// Friction of impulses.
#[derive(Clone, Debug)]
pub struct Friction<'e> {
    /// α⁺, a variable of every boundary.
    pub side: Expr<'e>,
    /// Places of λᵖ and λⁿ of the slip velocity among the algebraic variables.
    pub multipliers: [usize; 2],
    /// μ.
    pub coefficient: Expr<'e>,
    /// M⁻¹J_t, by state.
    pub push: Vec<(usize, Expr<'e>)>,
}

/// The contacts of a system that is lowered in the step formulation.
pub(super) fn impacts<'e>(system: &System<'e>, rename: &Substitution<'e>) -> Vec<Impact<'e>> {
    let labels = labels::of(system);
    let [impulse, side] = ["impulse", "side"].map(|word| labels::prefix(system, word));
    // The places of what `heaviside` declares: force and gap, or α, λᵖ and λⁿ.
    let place = |switch: usize| -> usize {
        let before = system.switches[..switch].iter();
        before.map(|s| if s.unilateral { 2 } else { 3 }).sum()
    };
    let renamed = |e: Expr<'e>| e.substitute(rename);
    let pushes = |directions: &[Direction<'e>]| -> Vec<(usize, Expr<'e>)> {
        let directions = directions.iter().filter(|d| !d.push.is_zero());
        directions.map(|d| (d.state, renamed(d.push))).collect()
    };
    let impact = |contact: &crate::system::Contact<'e>| {
        let label = &labels[contact.switch];
        let friction = contact.friction.as_ref().map(|friction| {
            let slip = place(friction.slips[0].switch);
            Friction {
                side: system.exprs.variable(&format!("{side}[{label}]")),
                multipliers: [slip + 1, slip + 2],
                coefficient: renamed(friction.coefficient),
                push: pushes(&friction.slips[0].tangent),
            }
        });
        Impact {
            name: contact.name.clone(),
            force: place(contact.switch),
            gap: place(contact.switch) + 1,
            impulse: system.exprs.variable(&format!("{impulse}[{label}]")),
            speed: renamed(contact.speed),
            restitution: renamed(contact.restitution),
            push: pushes(&contact.normal),
            friction,
            span: contact.span,
        }
    };
    system.contacts.iter().map(impact).collect()
}

impl<'e> Impact<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let friction = self.friction.iter();
        let coefficients = friction.clone().map(|friction| friction.coefficient);
        let tangents = friction.flat_map(|friction| &friction.push);
        [self.speed, self.restitution]
            .into_iter()
            .chain(coefficients)
            .chain(self.push.iter().chain(tangents).map(|&(_, push)| push))
    }
}

impl<'e> Dcs<'e> {
    /// v⁺ - v⁻ of every state that jumps, in order of the states.
    pub fn jumps(&self) -> Vec<(usize, Expr<'e>)> {
        let jump = |state: usize| {
            let mut terms = Vec::new();
            let at = |pushes: &[(usize, Expr<'e>)]| {
                let push = pushes.iter().find(|(place, _)| *place == state);
                push.map(|&(_, push)| push)
            };
            for impact in &self.impacts {
                terms.extend(at(&impact.push).map(|push| push * impact.impulse));
                if let Some(friction) = &impact.friction {
                    let force = friction.coefficient * impact.impulse * (2.0 * friction.side - 1.0);
                    terms.extend(at(&friction.push).map(|push| -(push * force)));
                }
            }
            (!terms.is_empty()).then(|| (state, self.exprs.sum(terms)))
        };
        (0..self.states.len()).filter_map(jump).collect()
    }

    /// Whether an expression contains a state that jumps.
    pub fn jumps_in(&self, e: Expr<'e>) -> bool {
        let occurring = variables_of(&[e]);
        self.jumps().iter().any(|&(state, _)| {
            let var = self.states[state].var.as_variable();
            var.is_some_and(|var| occurring.contains(&var))
        })
    }

    /// The laws of impulses, one per line.
    pub(super) fn impact_lines(&self) -> Vec<String> {
        let jumps = self.jumps().into_iter();
        let jumps = jumps.map(|(state, by)| format!("jump({}) = {by}", self.states[state].var));
        let mut lines: Vec<String> = jumps.collect();
        for impact in &self.impacts {
            let gap = self.algebraics[impact.gap].var;
            let (impulse, speed, e) = (impact.impulse, impact.speed, impact.restitution);
            lines.push(format!("0 <= {impulse} perp {gap} >= 0  // at jumps"));
            let law = match e.is_zero() {
                true => format!("after({speed})"),
                false => format!("after({speed}) + {e}*before({speed})"),
            };
            lines.push(format!(
                "0 <= {impulse} perp {law} >= 0  // at jumps, where {gap} = 0"
            ));
            if let Some(friction) = &impact.friction {
                let [above, below] = friction.multipliers.map(|place| self.algebraics[place].var);
                let side = friction.side;
                lines.push(format!("0 <= after({below}) perp {side} >= 0  // at jumps"));
                lines.push(format!(
                    "0 <= after({above}) perp {} >= 0  // at jumps",
                    1.0 - side
                ));
            }
        }
        lines
    }
}
