//! Contacts as FESD with jumps states them: forces in elements, impulses where elements meet.
//!
//! In an element a contact is the pair 0 ≤ λ ⟂ gap ≥ 0 with a switch α ∈ step(w) of its slip velocity, as the step
//! reformulation of a [`System`] has it. Where elements meet velocities jump,
//!
//! v⁺ - v⁻ = Σ M⁻¹(J_n - μ (2α⁺ - 1) J_t) Λ,   0 ≤ Λ ⟂ gap ≥ 0,   0 ≤ Λ ⟂ J_nᵀ(v⁺ + e v⁻) ≥ 0 at gap = 0,
//! α⁺ ∈ step(w(v⁺))
//!
//! over all contacts. Of one slip velocity, Coulomb's cone and every polyhedral approximation of it are the same
//! interval [-μΛ, μΛ], and -μΛ (2α⁺ - 1) with w⁺ = λᵖ - λⁿ, 0 ≤ λⁿ ⟂ α⁺ ≥ 0, 0 ≤ λᵖ ⟂ 1 - α⁺ ≥ 0 is its force: not a
//! row more, and none that an open contact leaves undetermined. Of two it is the disc -μΛ u⁺, u⁺ = 2α⁺ - 1, with
//!
//! 0 = w⁺ - γ⁺ u⁺,   0 = 1 - |u⁺|² - β⁺,   0 ≤ γ⁺ ⟂ β⁺ ≥ 0
//!
//! Nurkanović, Frey, Pozharskiy & Diehl 2024, with another way to force an impact: see `discretize`.

use super::{Dcs, Disc, heaviside, labels};
use crate::expr::{Expr, Substitution, variables_of};
use crate::source::Span;
use crate::system::{Direction, Slip, System};

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
    /// The e of Newton's law.
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
    /// μ.
    pub coefficient: Expr<'e>,
    /// The directions of slip: one, or two.
    pub tangents: Vec<Tangent<'e>>,
    /// How α⁺ follows from w⁺.
    pub law: SlipLaw<'e>,
}

/// A direction of slip.
#[derive(Clone, Debug)]
pub struct Tangent<'e> {
    /// α⁺, a variable of every boundary.
    pub side: Expr<'e>,
    /// w in the states on one side.
    pub velocity: Expr<'e>,
    /// M⁻¹J_t, by state.
    pub push: Vec<(usize, Expr<'e>)>,
}

/// What α⁺ is.
#[derive(Clone, Copy, Debug)]
pub enum SlipLaw<'e> {
    /// Of one direction: a step of w⁺, with the places of λᵖ and λⁿ among the algebraic variables.
    Interval([usize; 2]),
    /// Of two directions: a point of the unit disc.
    Disc {
        /// Where its γ and α are in elements.
        disc: Disc,
        /// β⁺, a variable of every boundary.
        stick: Expr<'e>,
    },
}

/// The contacts of a system that is lowered in the step formulation.
pub(crate) fn impacts<'e>(
    system: &System<'e>,
    rename: &Substitution<'e>,
    discs: &[Disc],
) -> Vec<Impact<'e>> {
    let labels = labels::of(system);
    let [impulse, side, stick] =
        ["impulse", "side", "side_stick"].map(|word| labels::prefix(system, word));
    let places = heaviside::places(system);
    let place = |switch: usize| places[switch];
    let renamed = |e: Expr<'e>| e.substitute(rename);
    let pushes = |directions: &[Direction<'e>]| -> Vec<(usize, Expr<'e>)> {
        let directions = directions.iter().filter(|d| !d.push.is_zero());
        directions.map(|d| (d.state, renamed(d.push))).collect()
    };
    let impact = |contact: &crate::system::Contact<'e>| {
        let label = &labels[contact.switch];
        let variable = |word: &str, number: &str| {
            let name = format!("{word}[{label}{number}]");
            system.exprs.variable(&name)
        };
        let friction = contact.friction.as_ref().map(|friction| {
            let slips = &friction.slips;
            let tangent = |(number, slip): (usize, &Slip<'e>)| Tangent {
                side: match slips.len() {
                    1 => variable(&side, ""),
                    _ => variable(&side, &format!(",{}", number + 1)),
                },
                velocity: renamed(slip.velocity),
                push: pushes(&slip.tangent),
            };
            let first = place(slips[0].switch);
            let is_own = |disc: &&Disc| disc.switches.contains(&slips[0].switch);
            let law = match discs.iter().find(is_own) {
                None => SlipLaw::Interval([first + 1, first + 2]),
                Some(&disc) => SlipLaw::Disc {
                    disc,
                    stick: variable(&stick, ""),
                },
            };
            Friction {
                coefficient: renamed(friction.coefficient),
                tangents: slips.iter().enumerate().map(tangent).collect(),
                law,
            }
        });
        let newton = (contact.restitution.newton()).expect("lowerings take Newton's law alone");
        Impact {
            name: contact.name.clone(),
            force: place(contact.switch),
            gap: place(contact.switch) + 1,
            impulse: system.exprs.variable(&format!("{impulse}[{label}]")),
            speed: renamed(contact.speed),
            restitution: renamed(newton),
            push: pushes(&contact.normal),
            friction,
            span: contact.span,
        }
    };
    system.jumps.contacts.iter().map(impact).collect()
}

impl<'e> Impact<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let friction = self.friction.iter();
        let coefficients = friction.clone().map(|friction| friction.coefficient);
        let tangents = || friction.clone().flat_map(|friction| &friction.tangents);
        let pushes = tangents().flat_map(|tangent| &tangent.push);
        [self.speed, self.restitution]
            .into_iter()
            .chain(coefficients)
            .chain(self.push.iter().chain(pushes).map(|&(_, push)| push))
            .chain(tangents().map(|tangent| tangent.velocity))
    }
}

impl<'e> Friction<'e> {
    /// 1 - |u⁺|².
    pub fn edge(&self) -> Expr<'e> {
        let inside = self.tangents.iter().map(|t| (2.0 * t.side - 1.0).powi(2));
        inside.fold(self.coefficient.exprs().constant(1.0), |rest, square| {
            rest - square
        })
    }

    /// α⁺, and β⁺ of a disc: the variables of every boundary.
    pub fn variables(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let stick = match self.law {
            SlipLaw::Interval(_) => None,
            SlipLaw::Disc { stick, .. } => Some(stick),
        };
        let sides = self.tangents.iter().map(|tangent| tangent.side);
        sides.chain(stick)
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
                let friction = impact.friction.iter();
                for (friction, tangent) in
                    friction.flat_map(|f| f.tangents.iter().map(move |t| (f, t)))
                {
                    let force = friction.coefficient * impact.impulse * (2.0 * tangent.side - 1.0);
                    terms.extend(at(&tangent.push).map(|push| -(push * force)));
                }
            }
            (!terms.is_empty()).then(|| (state, self.exprs.sum(terms)))
        };
        (0..self.states.len()).filter_map(jump).collect()
    }

    /// The variables of a boundary: Λ of all contacts, then what friction has, contact by contact.
    pub fn boundary(&self) -> Vec<Expr<'e>> {
        let impulses = self.impacts.iter().map(|impact| impact.impulse);
        let frictions = self.impacts.iter().flat_map(|impact| &impact.friction);
        impulses
            .chain(frictions.flat_map(Friction::variables))
            .collect()
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
    pub(crate) fn impact_lines(&self) -> Vec<String> {
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
            let Some(friction) = &impact.friction else {
                continue;
            };
            match friction.law {
                SlipLaw::Interval(multipliers) => {
                    let [above, below] = multipliers.map(|place| self.algebraics[place].var);
                    let side = friction.tangents[0].side;
                    lines.push(format!("0 <= after({below}) perp {side} >= 0  // at jumps"));
                    lines.push(format!(
                        "0 <= after({above}) perp {} >= 0  // at jumps",
                        1.0 - side
                    ));
                }
                SlipLaw::Disc { disc, stick } => {
                    let slip = self.algebraics[disc.slip].var;
                    for tangent in &friction.tangents {
                        let (velocity, inside) = (tangent.velocity, 2.0 * tangent.side - 1.0);
                        lines.push(format!(
                            "0 = after({velocity}) - after({slip})*({inside})  // at jumps"
                        ));
                    }
                    let edge = friction.edge() - stick;
                    lines.push(format!("0 = {edge}  // at jumps"));
                    lines.push(format!("0 <= after({slip}) perp {stick} >= 0  // at jumps"));
                }
            }
        }
        lines
    }
}
