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

/// Where elements begin, with formal arguments for h, x⁺ and x⁻.
struct LeftEnds<'s, 'p, 'e> {
    problem: &'s Problem<'p, 'e>,
    h: Expr<'e>,
    states: Vec<Expr<'e>>,
    before: Vec<Expr<'e>>,
}

impl<'s, 'e> LeftEnds<'s, '_, 'e> {
    fn builder(&self, name: &'static str) -> Builder<2> {
        let problem = self.problem;
        let (dcs, layout) = (problem.dcs, &problem.layout);
        let block = Builder::new(name, [problem.steps(), problem.elements()])
            .vector(&self.states, |[k, j]| layout.x(k, j, 0))
            .vector(&self.before, |[k, j]| layout.before(k, j))
            .vector(&dcs.boundary(), |[k, j]| layout.impulses(k, j).unwrap_or(0))
            .variable(self.h, |[k, j]| layout.h(k, j))
            .number(problem.node, |_| 0.0);
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
        problem.decided(block, |[k, _]| k)
    }

    /// Adds a block of rows, if there are any.
    fn push(
        &self,
        mpcc: &mut Mpcc<'e>,
        (name, kind): (&'static str, Kind),
        rows: &[Expr<'e>],
        origins: Vec<Source>,
        text: &str,
    ) {
        if rows.is_empty() {
            return;
        }
        let rows = self.problem.timed(rows, self.h);
        let block = self.builder(name);
        mpcc.blocks
            .push(block.finish(kind, rows, origins, text.to_owned()));
    }

    /// x⁺ - x⁻ = r y
    fn jumps(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, exprs) = (self.problem.dcs, mpcc.exprs);
        let jumps = dcs.jumps();
        let row = |(i, (&after, &before)): (usize, (&Expr<'e>, &Expr<'e>))| {
            let jump = jumps.iter().find(|(state, _)| *state == i);
            let by = jump.map_or(exprs.constant(0.0), |&(_, by)| by);
            after - before - by
        };
        let sides = self.states.iter().zip(&self.before).enumerate();
        let rows: Vec<Expr> = sides.map(row).collect();
        let text = "0 = x[k,j,0] - before(x)[k,j] - r(x[k,j,0], y[k,j])";
        let origins = sources(&dcs.origins.rates);
        self.push(mpcc, ("jump", Kind::Equation), &rows, origins, text);
    }

    /// The equations of what jumps with states.
    fn equations(&self, mpcc: &mut Mpcc<'e>) {
        let dcs = self.problem.dcs;
        let (_, equations) = jumping(dcs);
        let rows: Vec<Expr> = equations.iter().map(|&row| dcs.equations[row]).collect();
        let origins = equations.iter().map(|&row| dcs.origins.equations[row]);
        let origins = sources(&origins.collect::<Vec<_>>());
        let g = self.problem.arguments("t[k,j]", "x[k,j,0]", "z[k,j,0]");
        let text = format!("0 = g{g}, where states jump");
        self.push(mpcc, ("left", Kind::Equation), &rows, origins, &text);
    }

    /// Friction, with where it comes from.
    fn frictions(&self) -> impl Iterator<Item = (&'s Friction<'e>, Source)> {
        let problem = self.problem;
        let friction =
            |impact: &'s Impact<'e>| Some((impact.friction.as_ref()?, problem.origin(impact)));
        problem.dcs.impacts.iter().filter_map(friction)
    }

    /// Friction in discs with γ⁺ and β⁺, and where it comes from.
    fn discs(&self) -> impl Iterator<Item = (&'s Friction<'e>, [Expr<'e>; 2], Source)> {
        let dcs = self.problem.dcs;
        self.frictions()
            .filter_map(|(friction, origin)| match friction.law {
                SlipLaw::Interval(_) => None,
                SlipLaw::Disc { disc, stick } => {
                    Some((friction, [dcs.algebraics[disc.slip].var, stick], origin))
                }
            })
    }

    /// 0 = w⁺ - γ⁺ u⁺,  0 = 1 - |u⁺|² - β⁺
    fn directions(&self, mpcc: &mut Mpcc<'e>) {
        let rows = self.discs().flat_map(|(friction, [slip, stick], origin)| {
            let tangents = friction.tangents.iter();
            let tangents = tangents.map(move |t| t.velocity - slip * (2.0 * t.side - 1.0));
            let rows = tangents.chain([friction.edge() - stick]);
            rows.map(move |row| (row, origin))
        });
        let (rows, origins): (Vec<Expr>, Vec<Source>) = rows.unzip();
        let text = "0 = after(w) - slip[k,j,0]*u[k,j], 0 = 1 - |u[k,j]|^2 - side_stick[k,j]";
        self.push(mpcc, ("disc", Kind::Equation), &rows, origins, text);
    }

    /// 0 <= Λ ⟂ gap >= 0, and Newton's law.
    fn contacts(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.problem.dcs, &self.problem.layout);
        let gap = |impact: &Impact<'e>| dcs.algebraics[impact.gap].var;
        let impulses = dcs.impacts.iter().map(|impact| impact.impulse);
        let origins = dcs.impacts.iter().map(|i| self.problem.origin(i));
        let origins: Vec<Source> = origins.collect();
        let gaps = dcs.impacts.iter().map(gap);
        let rows: Vec<Expr> = impulses.clone().chain(gaps).collect();
        let text = "0 <= impulse[k,j] perp gap[k,j,0] >= 0";
        self.push(mpcc, ("impulse", Kind::Pair), &rows, origins.clone(), text);

        let sides = self.states.iter().zip(&self.before);
        let sides: Substitution = sides.map(|(&x, &before)| (variable(x), before)).collect();
        let Grid { horizon, steps, .. } = self.problem.grid;
        let window = WINDOW * horizon / (steps * layout.elements) as f64;
        let laws = dcs.impacts.iter().map(|impact| {
            let before = impact.speed.substitute(&sides);
            gap(impact) / window + impact.speed + impact.restitution * before
        });
        let rows: Vec<Expr> = impulses.chain(laws).collect();
        let text = format!(
            "0 <= impulse[k,j] perp gap[k,j,0]/{window} + after(speed) + e*before(speed) >= 0"
        );
        self.push(mpcc, ("restitution", Kind::Pair), &rows, origins, &text);
    }

    /// 0 <= λⁿ ⟂ α⁺ >= 0, 0 <= λᵖ ⟂ 1 - α⁺ >= 0; of discs 0 <= γ⁺ ⟂ β⁺ >= 0.
    fn slips(&self, mpcc: &mut Mpcc<'e>) {
        let dcs = self.problem.dcs;
        let intervals = self
            .frictions()
            .filter_map(|(friction, origin)| match friction.law {
                SlipLaw::Interval(places) => Some((places, friction.tangents[0].side, origin)),
                SlipLaw::Disc { .. } => None,
            });
        let intervals: Vec<([usize; 2], Expr<'e>, Source)> = intervals.collect();
        let multiplier = |which: usize| {
            let places = intervals.iter().map(move |slip| slip.0[which]);
            places.map(|place| dcs.algebraics[place].var)
        };
        let sides = intervals.iter().map(|slip| slip.1);
        let others = sides.clone().map(|side| 1.0 - side);
        let multipliers = multiplier(1).chain(multiplier(0));
        let rows: Vec<Expr> = multipliers.chain(sides).chain(others).collect();
        let origins: Vec<Source> = intervals.iter().map(|slip| slip.2).collect();
        let (name, origins) = (("impulse_friction", Kind::Pair), origins.repeat(2));
        let text = "0 <= lambda_n[k,j,0] perp side[k,j] >= 0, 0 <= lambda_p[k,j,0] perp 1 - side[k,j] >= 0";
        self.push(mpcc, name, &rows, origins, text);

        let member = |which: usize| self.discs().map(move |(_, pair, _)| pair[which]);
        let rows: Vec<Expr> = member(0).chain(member(1)).collect();
        let origins = self.discs().map(|(_, _, origin)| origin).collect();
        let text = "0 <= slip[k,j,0] perp side_stick[k,j] >= 0";
        self.push(mpcc, ("impulse_disc", Kind::Pair), &rows, origins, text);
    }
}

impl<'e> Problem<'_, 'e> {
    /// Jumps, what jumps with states, and the laws of impulses.
    pub(crate) fn impulses(&self, mpcc: &mut Mpcc<'e>) {
        if self.layout.boundaries.is_none() {
            return;
        }
        let (states, h) = (self.states(), mpcc.exprs.variable("h"));
        let left = LeftEnds {
            problem: self,
            h,
            before: mpcc.exprs.variables("before", states.len()),
            states,
        };
        left.jumps(mpcc);
        left.equations(mpcc);
        left.directions(mpcc);
        left.contacts(mpcc);
        left.slips(mpcc);
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
