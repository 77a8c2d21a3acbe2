//! Impulses of contacts where elements meet (FESD-J).
//!
//! Every element has a state x⁺ of its own at its left end, behind the end x⁻ of the one before, or the initial state:
//!
//! x⁺ - x⁻ = Σ_c r_c(x⁺) y_c,   0 <= Λ_c ⟂ gap_c >= 0,   0 <= Λ_c ⟂ gap_c/τ + J_nᵀ(v⁺ + e v⁻) >= 0
//!
//! with the impulses y = (Λ, α⁺) of [`crate::lowering::dcs::Impact`]. At gap = 0 the last pair is Newton's law of impacts, which
//! a contact cannot refuse: Λ = 0 needs J_nᵀ(v⁺ + e v⁻) >= 0. The published block, 0 <= Λ_n ⟂ gap + P + N >= 0 with
//! P - N = J_nᵀ(v⁺ + e v⁻), can always be met by Λ = 0, and leaves it to the next element to exclude that. At gap > 0
//! the price is that elements do not meet within τ (1 + e) before an impact; τ is a small share of their mean length.
//!
//! What is continuous along solutions but for jumps, as λᵖ and λⁿ of a slip velocity, starts anew in every element. Of
//! two slip velocities that is γ; α⁺ and β⁺ are in the equations of the disc there.
//!
//! Nurkanović, Frey, Pozharskiy & Diehl 2024.

use super::block::{Builder, variable};
use super::dynamics::sources;
use super::layout::{End, Layout};
use super::{Grid, Problem};
use crate::expr::{Expr, Substitution, variables_of};
use crate::lowering::dcs::{Dcs, Friction, Impact, SlipLaw};
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Bounds, Kind, Mpcc, Source, Span, n_places};

/// τ as a share of the mean length of elements.
pub const WINDOW: f64 = 1e-3;

/// First indices of what elements begin with.
#[derive(Clone, Debug)]
pub(crate) struct Boundaries {
    pub states: usize,
    impulses: usize,
    n_impulses: usize,
    pub algebraics: usize,
    /// Which continuous z jump with states.
    pub jumping: Vec<usize>,
}

/// The continuous z that jump with states, and the equations that say what they are; those of discs are stated with
/// α⁺ and β⁺.
pub(crate) fn jumping(dcs: &Dcs) -> (Vec<usize>, Vec<usize>) {
    let mut algebraics: Vec<usize> = dcs.discs.iter().map(|disc| disc.slip).collect();
    let mut equations = Vec::new();
    let of_discs: Vec<usize> = dcs.discs.iter().flat_map(|disc| disc.inside()).collect();
    for row in End::new(dcs).equations {
        let occurring = variables_of(&[dcs.equations[row]]);
        let occurs = |e: Expr| occurring.contains(&variable(e));
        if of_discs.iter().any(|&i| occurs(dcs.algebraics[i].var)) {
            continue;
        }
        let jumps = dcs.jumps_in(dcs.equations[row])
            || algebraics
                .iter()
                .any(|&i: &usize| occurs(dcs.algebraics[i].var));
        if jumps {
            equations.push(row);
            let of_row = |&i: &usize| occurs(dcs.algebraics[i].var) && !algebraics.contains(&i);
            let new: Vec<usize> = (0..dcs.algebraics.len()).filter(of_row).collect();
            algebraics.extend(new);
        }
    }
    algebraics.sort_unstable();
    (algebraics, equations)
}

/// Declares x⁺, y and the z that jump, for every element; `states` and `algebraics` are bounds of all of them.
pub(crate) fn declare(
    mpcc: &mut Mpcc,
    dcs: &Dcs,
    elements: [Span; 2],
    states: &[Bounds],
    algebraics: &[Bounds],
) -> Option<Boundaries> {
    if dcs.impacts.is_empty() {
        return None;
    }
    let n = n_places(&elements);
    let [k, j] = elements;
    let left = [k, j, Span::new("m", 0, 0)];
    let names = |vars: Vec<Expr>| vars.iter().map(Expr::to_string).collect::<Vec<_>>();
    let all = dcs.states.iter().map(|state| state.var);
    let first_state = mpcc.declare("x", names(all.collect()), &left, states.repeat(n));
    let impulse = Bounds::between(0.0, f64::INFINITY, 0.0);
    let frictions = dcs.impacts.iter().flat_map(|impact| &impact.friction);
    let of_friction = |friction: &Friction| match friction.law {
        SlipLaw::Interval(_) => vec![Bounds::between(0.0, 1.0, 0.5)],
        // |u⁺| ≤ 1 says more than bounds of α⁺.
        SlipLaw::Disc { .. } => vec![
            Bounds::free(0.5),
            Bounds::free(0.5),
            Bounds::between(0.0, f64::INFINITY, 1.0),
        ],
    };
    let bounds: Vec<Bounds> = (dcs.impacts.iter().map(|_| impulse))
        .chain(frictions.flat_map(of_friction))
        .collect();
    let n_impulses = bounds.len();
    let impulses = mpcc.declare("y", names(dcs.boundary()), &elements, bounds.repeat(n));
    let (jumping, _) = jumping(dcs);
    let vars = jumping.iter().map(|&i| dcs.algebraics[i].var);
    let bounds: Vec<Bounds> = jumping.iter().map(|&i| algebraics[i]).collect();
    let algebraics = mpcc.declare("z", names(vars.collect()), &left, bounds.repeat(n));
    Some(Boundaries {
        states: first_state,
        impulses,
        n_impulses,
        algebraics,
        jumping,
    })
}

impl Layout {
    /// The first impulse where an element begins: Λ of every contact.
    pub fn impulses(&self, k: usize, j: usize) -> Option<usize> {
        let boundaries = self.boundaries.as_ref()?;
        Some(boundaries.impulses + self.element(k, j) * boundaries.n_impulses)
    }
}

impl<'e> Problem<'_, 'e> {
    /// Jumps, what jumps with states, and the laws of impulses.
    pub(crate) fn impulses(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        if layout.boundaries.is_none() {
            return;
        }
        let exprs = mpcc.exprs;
        let (states, h) = (self.states(), exprs.variable("h"));
        let before = exprs.variables("before", states.len());
        let at_left = |name: &'static str| {
            let block = Builder::new(name, [self.steps(), self.elements()])
                .vector(&states, |[k, j]| layout.x(k, j, 0))
                .vector(&before, |[k, j]| layout.before(k, j))
                .vector(&dcs.boundary(), |[k, j]| layout.impulses(k, j).unwrap_or(0))
                .variable(h, |[k, j]| layout.h(k, j))
                .number(self.node, |_| 0.0);
            let z = layout.continuous.iter();
            let block = z.fold(block, |block, &i| {
                let index = |[k, j]: [usize; 2]| layout.z(k, j, 0, i);
                block.variable(dcs.algebraics[i].var, |place| {
                    index(place).expect("what is continuous is there at left ends")
                })
            });
            let block = match layout.t(1, 1) {
                Some(_) => block.variable(dcs.time, |[k, j]| layout.t(k, j).unwrap_or(0)),
                None => block,
            };
            self.decided(block, |[k, _]| k)
        };

        // x⁺ - x⁻ = r y
        let jumps = dcs.jumps();
        let row = |(i, (&after, &before)): (usize, (&Expr<'e>, &Expr<'e>))| {
            let jump = jumps.iter().find(|(state, _)| *state == i);
            let by = jump.map_or(exprs.constant(0.0), |&(_, by)| by);
            after - before - by
        };
        let rows: Vec<Expr> = states.iter().zip(&before).enumerate().map(row).collect();
        let text = "0 = x[k,j,0] - before(x)[k,j] - r(x[k,j,0], y[k,j])".to_owned();
        let origins = sources(&dcs.origins.rates);
        let block = at_left("jump");
        let rows = self.timed(&rows, h);
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows, origins, text));

        let (_, equations) = jumping(dcs);
        if !equations.is_empty() {
            let rows: Vec<Expr> = equations.iter().map(|&row| dcs.equations[row]).collect();
            let origins: Vec<_> = equations
                .iter()
                .map(|&row| dcs.origins.equations[row])
                .collect();
            let g = self.arguments("t[k,j]", "x[k,j,0]", "z[k,j,0]");
            let block = at_left("left");
            let rows = self.timed(&rows, h);
            let text = format!("0 = g{g}, where states jump");
            mpcc.blocks
                .push(block.finish(Kind::Equation, rows, sources(&origins), text));
        }

        let sides = states
            .iter()
            .map(|&x| variable(x))
            .zip(before.iter().copied());
        let sides: Substitution = sides.collect();
        let Grid { horizon, steps, .. } = self.grid;
        let window = WINDOW * horizon / (steps * layout.elements) as f64;
        let gap = |impact: &Impact<'e>| dcs.algebraics[impact.gap].var;
        let law = |impact: &Impact<'e>| {
            let before = impact.speed.substitute(&sides);
            gap(impact) / window + impact.speed + impact.restitution * before
        };
        let impulses = dcs.impacts.iter().map(|impact| impact.impulse);
        let rubbing = |takes: fn(&SlipLaw) -> bool| {
            let rubbing = dcs.impacts.iter().filter_map(move |impact| {
                let friction = impact.friction.as_ref()?;
                takes(&friction.law).then(|| (friction, self.origin(impact)))
            });
            rubbing.collect::<Vec<(&Friction<'e>, Source)>>()
        };
        let intervals = rubbing(|law| matches!(law, SlipLaw::Interval(_)));
        let discs = rubbing(|law| matches!(law, SlipLaw::Disc { .. }));
        let multiplier = |which: usize| {
            let places = intervals
                .iter()
                .filter_map(move |(friction, _)| match friction.law {
                    SlipLaw::Interval(multipliers) => Some(multipliers[which]),
                    SlipLaw::Disc { .. } => None,
                });
            places.map(|place| dcs.algebraics[place].var)
        };
        let sides = || {
            intervals
                .iter()
                .map(|(friction, _)| friction.tangents[0].side)
        };
        let others = sides().map(|side| 1.0 - side);
        let contacts: Vec<Source> = dcs.impacts.iter().map(|i| self.origin(i)).collect();
        let rubbing: Vec<Source> = intervals.iter().map(|(_, origin)| *origin).collect();

        // 0 = w⁺ - γ⁺ u⁺,  0 = 1 - |u⁺|² - β⁺
        let of_disc = |(friction, _): &(&Friction<'e>, Source)| match friction.law {
            SlipLaw::Interval(_) => None,
            SlipLaw::Disc { disc, stick } => Some((dcs.algebraics[disc.slip].var, stick)),
        };
        let rows = discs.iter().filter_map(|disc| Some((disc, of_disc(disc)?)));
        let rows = rows.flat_map(|((friction, origin), (slip, stick))| {
            let tangents = friction.tangents.iter();
            let tangents = tangents.map(move |t| t.velocity - slip * (2.0 * t.side - 1.0));
            let rows = tangents.chain([friction.edge() - stick]);
            rows.map(|row| (row, *origin))
        });
        let (rows, origins): (Vec<Expr>, Vec<Source>) = rows.unzip();
        if !rows.is_empty() {
            let rows = self.timed(&rows, h);
            let text = "0 = after(w) - slip[k,j,0]*u[k,j], 0 = 1 - |u[k,j]|^2 - side_stick[k,j]";
            let block = at_left("disc").finish(Kind::Equation, rows, origins, text.to_owned());
            mpcc.blocks.push(block);
        }
        let mut pair = |name, a: Vec<Expr<'e>>, b: Vec<Expr<'e>>, origins: Vec<Source>, text| {
            if a.is_empty() {
                return;
            }
            let outputs = self.timed(&[a, b].concat(), h);
            let block = at_left(name).finish(Kind::Pair, outputs, origins, text);
            mpcc.blocks.push(block);
        };
        pair(
            "impulse",
            impulses.clone().collect(),
            dcs.impacts.iter().map(gap).collect(),
            contacts.clone(),
            "0 <= impulse[k,j] perp gap[k,j,0] >= 0".to_owned(),
        );
        pair(
            "restitution",
            impulses.collect(),
            dcs.impacts.iter().map(law).collect(),
            contacts,
            format!(
                "0 <= impulse[k,j] perp gap[k,j,0]/{window} + after(speed) + e*before(speed) >= 0"
            ),
        );
        pair(
            "impulse_friction",
            multiplier(1).chain(multiplier(0)).collect(),
            sides().chain(others).collect(),
            rubbing.repeat(2),
            "0 <= lambda_n[k,j,0] perp side[k,j] >= 0, 0 <= lambda_p[k,j,0] perp 1 - side[k,j] >= 0"
                .to_owned(),
        );
        let (slips, sticks) = discs.iter().filter_map(of_disc).unzip();
        pair(
            "impulse_disc",
            slips,
            sticks,
            discs.iter().map(|(_, origin)| *origin).collect(),
            "0 <= slip[k,j,0] perp side_stick[k,j] >= 0".to_owned(),
        );
    }

    /// Where the pair of a contact comes from.
    pub(crate) fn origin(&self, impact: &Impact<'e>) -> Source {
        let gap = self.dcs.algebraics[impact.gap].var;
        let pairs = &self.dcs.pairs;
        let place = pairs
            .iter()
            .position(|pair| pair.left == gap || pair.right == gap);
        let place = place.expect("a contact has a pair");
        Source::Dcs(self.dcs.origins.pairs[place])
    }

    /// The contact whose gap is this continuous member.
    pub(crate) fn impact_of(&self, continuous: Expr<'e>) -> Option<&Impact<'e>> {
        let i = self.algebraic(continuous);
        self.dcs.impacts.iter().find(|impact| impact.gap == i)
    }

    /// Which pairs of the program say that there is an impact.
    pub(crate) fn impact_pairs(&self, mpcc: &Mpcc<'e>) -> Option<mpcc::Impulses> {
        let gaps = self.dcs.impacts.iter().map(|impact| impact.gap);
        self.layout.boundaries.as_ref().map(|_| mpcc::Impulses {
            first_pair: mpcc.first_pair("impulse"),
            gaps: gaps.collect(),
        })
    }
}
