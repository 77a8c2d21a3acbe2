//! Which sides of several surfaces occur together.
//!
//! ψ_k = b_k + Σ_j a_kj y_j
//!
//! where y_j are states, time, or whatever else ψ adds up, as x^2 or sin(x). With y as independent coordinates, the
//! surfaces are planes, and a combination of sides is a polyhedron (see `nsd_solver::optimization::cell`). Where it is empty, the sides
//! never occur together; where it has an interior and every y is a state or time, there is a point with these sides.
//! Coordinates are relative to the initial point and scaled so that the surfaces are of the order of one away from it.
//!
//! ψ that holds α of other switches is a plane once these are on a side.

use std::cell::RefCell;

use nsd_solver::optimization::cell;
use nsd_solver::optimization::cell::Part;
use nsd_solver::optimization::qp::HalfSpace;
use rustc_hash::FxHashMap;

use crate::expr::{Expr, Node, Substitution, Var, variables_of};
use crate::system::switches::known::Known;
use crate::system::switches::surface::definite;
use crate::system::{Switch, System};

/// Surfaces of which combinations of sides are asked for.
pub struct Arrangement<'e> {
    /// (α, ψ), inner ones first; ψ without parameters.
    surfaces: Vec<(Var, Expr<'e>)>,
    /// Those surfaces that are planes without further ado.
    planes: Vec<Option<HalfSpace>>,
    atoms: RefCell<Atoms<'e>>,
    /// The initial point, by variable.
    origin: FxHashMap<Var, f64>,
    /// Linear programs that have been solved.
    programs: RefCell<usize>,
}

/// The coordinates y.
#[derive(Default)]
struct Atoms<'e> {
    place: FxHashMap<Expr<'e>, usize>,
    list: Vec<Atom<'e>>,
}

/// y = origin + scale * coordinate.
#[derive(Clone, Copy)]
struct Atom<'e> {
    expr: Expr<'e>,
    origin: f64,
    scale: f64,
}

/// A combination of sides of the first few surfaces.
#[derive(Clone)]
pub struct Sides {
    /// The side of every surface that has been decided.
    pub signs: Vec<Option<bool>>,
    cell: cell::Cell,
}

/// What is on one side of a surface.
pub enum Side {
    /// Points, perhaps.
    Cell(Sides),
    /// No point.
    Empty,
    /// Unknown: the linear program has failed. The sides go on without this one's plane.
    Unknown(Sides),
}

/// What a ψ is between surfaces.
enum Form {
    Plane(HalfSpace),
    Number(f64),
}

impl Sides {
    /// True where the sides occur on a set without interior at most, to rounding.
    pub fn is_thin(&self) -> bool {
        self.cell.is_thin()
    }

    /// With a side of surface `k`, whether or not it occurs with the others.
    pub fn with(&self, k: usize, above: bool) -> Self {
        let mut sides = self.clone();
        sides.signs[k] = Some(above);
        sides
    }
}

impl<'e> Switch<'e> {
    /// ψ where it decides the side; α itself of a relay, which may have either value.
    pub(crate) fn surface(&self) -> Expr<'e> {
        if self.relay.is_some() {
            self.alpha
        } else {
            self.psi
        }
    }
}

impl<'e> System<'e> {
    /// The arrangement of the surfaces of some switches, in ascending order, at the initial point; parameters that are open,
    /// by their numbers, are coordinates.
    pub fn arrangement(
        &self,
        switches: &[usize],
        is_open: impl Fn(usize) -> bool,
    ) -> Arrangement<'e> {
        let surfaces = switches.iter().filter_map(|&k| {
            let switch = &self.switches[k];
            Some((switch.alpha.as_variable()?, switch.surface()))
        });
        let surfaces: Vec<_> = surfaces.collect();
        let psi: Vec<Expr> = surfaces.iter().map(|&(_, psi)| psi).collect();
        let occurring = variables_of(&psi);
        let occurs = |place: usize| {
            let var = self.exogenous.params[place].var.as_variable();
            var.is_some_and(|var| occurring.contains(&var))
        };
        let is_free = |place: usize| self.is_free(place) || is_open(place);
        let params = self.params_as_numbers(|place| occurs(place) && !is_free(place));
        let freed = self.exogenous.params.iter().enumerate();
        let freed = freed.filter(|(place, _)| is_free(*place));
        let freed = freed.map(|(_, param)| (param.var, param.value));
        let states = self
            .states
            .iter()
            .map(|state| (state.var, state.initial))
            .chain(freed);
        let data = self
            .exogenous
            .data
            .iter()
            .map(|data| (data.var, data.table.value(0.0)));
        let origin = states.chain([(self.time, 0.0)]).chain(data);
        let origin = origin.filter_map(|(var, value)| Some((var.as_variable()?, value)));
        Arrangement::new(&surfaces, &params, origin)
    }
}

impl<'e> Arrangement<'e> {
    /// `surfaces` are (α, ψ), inner ones first, `params` the numbers of parameters, and `origin` gives the initial
    /// values of states, time and data, all variables that points consist of.
    pub fn new(
        surfaces: &[(Var, Expr<'e>)],
        params: &Substitution<'e>,
        origin: impl IntoIterator<Item = (Var, f64)>,
    ) -> Self {
        let numbers = |&(alpha, psi): &(Var, Expr<'e>)| (alpha, psi.substitute(params));
        let mut arrangement = Arrangement {
            surfaces: surfaces.iter().map(numbers).collect(),
            planes: Vec::new(),
            atoms: RefCell::default(),
            origin: origin.into_iter().collect(),
            programs: RefCell::new(0),
        };
        arrangement.scale();
        let outermost = arrangement.all().signs;
        let plane = |k: usize| {
            let below = variables_of(&[arrangement.surfaces[k].1]);
            let mut inner = arrangement.surfaces[..k].iter();
            if inner.any(|(alpha, _)| below.binary_search(alpha).is_ok()) {
                return None;
            }
            match arrangement.form(&outermost, k) {
                Form::Plane(row) => Some(row),
                Form::Number(_) => None,
            }
        };
        arrangement.planes = (0..surfaces.len()).map(plane).collect();
        arrangement
    }

    /// The number of surfaces.
    pub fn n_surfaces(&self) -> usize {
        self.surfaces.len()
    }

    /// How many linear programs have been solved.
    pub fn n_programs(&self) -> usize {
        *self.programs.borrow()
    }

    /// All of the space.
    pub fn all(&self) -> Sides {
        let atoms = self.atoms.borrow().list.clone();
        let mut whole = Sides {
            signs: vec![None; self.surfaces.len()],
            cell: cell::Cell::space(),
        };
        // What is never negative by its form, as x^2.
        for (place, atom) in atoms.iter().enumerate() {
            if let Some(sign) = definite(atom.expr, &Known::default()) {
                let row = HalfSpace {
                    normal: vec![(place, sign)],
                    offset: sign * atom.origin / atom.scale,
                };
                if let Part::Cell(cell) = whole.cell.part(&row, &mut self.programs.borrow_mut()) {
                    whole.cell = cell;
                }
            }
        }
        whole
    }

    /// The part of `sides` where a variable is between two numbers.
    pub fn between(&self, sides: &Sides, var: Expr<'e>, lower: f64, upper: f64) -> Sides {
        let (place, atom) = self.atom(var);
        let mut cell = sides.cell.clone();
        let ends = [(1.0, lower), (-1.0, upper)];
        for (sign, bound) in ends.into_iter().filter(|(_, bound)| bound.is_finite()) {
            let row = HalfSpace {
                normal: vec![(place, sign)],
                offset: sign * (atom.origin - bound) / atom.scale,
            };
            if let Part::Cell(part) = cell.part(&row, &mut self.programs.borrow_mut()) {
                cell = part;
            }
        }
        Sides {
            signs: sides.signs.clone(),
            cell,
        }
    }

    /// What is on a side of surface `k`; the surfaces inside ψ_k must have been decided.
    pub fn side(&self, sides: &Sides, k: usize, above: bool) -> Side {
        let programs = &mut *self.programs.borrow_mut();
        let form = self.planes[k].clone().map(Form::Plane);
        let part = match form.unwrap_or_else(|| self.form(&sides.signs, k)) {
            Form::Plane(row) if above => sides.cell.part(&row, programs),
            Form::Plane(row) => sides.cell.part(&row.opposite(), programs),
            Form::Number(value) if (value > 0.0) == above || value == 0.0 => {
                Part::Cell(sides.cell.clone())
            }
            Form::Number(_) => Part::Empty,
        };
        match part {
            Part::Cell(cell) => {
                let signs = sides.with(k, above).signs;
                Side::Cell(Sides { signs, cell })
            }
            Part::Empty => Side::Empty,
            Part::Unknown => Side::Unknown(sides.with(k, above)),
        }
    }

    /// The values of states and time at a point with these sides, near the initial point; `None` where the
    /// coordinates are not states and time, so that the cell proves nothing.
    pub fn witness(&self, sides: &Sides) -> Option<Vec<(Var, f64)>> {
        let atoms = self.atoms.borrow();
        let mut used = vec![false; atoms.list.len()];
        for row in sides.cell.rows() {
            row.normal.iter().for_each(|&(place, _)| used[place] = true);
        }
        let nearest = sides.cell.nearest();
        let point = nearest.as_deref().unwrap_or(sides.cell.centre());
        let used = (0..used.len()).filter(|&place| used[place]);
        used.map(|place| {
            let atom = &atoms.list[place];
            let var = atom.expr.as_variable()?;
            self.origin.get(&var)?;
            Some((var, atom.origin + atom.scale * point[place]))
        })
        .collect()
    }

    /// ψ_k as a plane, given the sides of what is inside it.
    fn form(&self, signs: &[Option<bool>], k: usize) -> Form {
        let inner = self.surfaces[..k].iter().zip(signs);
        let inner = inner.filter_map(|(&(alpha, psi), side)| {
            Some((alpha, psi.exprs().constant(f64::from((*side)?))))
        });
        let (terms, mut offset) = affine(self.surfaces[k].1.substitute(&inner.collect()));
        let mut normal: Vec<(usize, f64)> = Vec::with_capacity(terms.len());
        for (term, c) in terms {
            let (place, atom) = self.atom(term);
            offset += c * atom.origin;
            normal.push((place, c * atom.scale));
        }
        normal.sort_by_key(|&(place, _)| place);
        match (HalfSpace { normal, offset }).normalized() {
            Some(row) => Form::Plane(row),
            None => Form::Number(offset),
        }
    }

    /// The coordinate of a term.
    fn atom(&self, expr: Expr<'e>) -> (usize, Atom<'e>) {
        let mut atoms = self.atoms.borrow_mut();
        let next = atoms.list.len();
        let place = *atoms.place.entry(expr).or_insert(next);
        if place == atoms.list.len() {
            let value = expr.eval(&|var| self.origin.get(&var).copied().unwrap_or(0.0));
            atoms.list.push(Atom {
                expr,
                origin: if value.is_finite() { value } else { 0.0 },
                scale: 1.0,
            });
        }
        (place, atoms.list[place])
    }

    /// Gives every coordinate the scale at which the farthest surface is met along it.
    fn scale(&self) {
        let mut farthest: FxHashMap<usize, f64> = FxHashMap::default();
        for k in 0..self.surfaces.len() {
            for above in [false, true] {
                let Form::Plane(row) = self.form(&vec![Some(above); k], k) else {
                    continue;
                };
                for (place, a) in row.normal {
                    let distance = (row.offset / a).abs();
                    if distance.is_finite() {
                        let known = farthest.entry(place).or_insert(0.0);
                        *known = known.max(distance);
                    }
                }
            }
        }
        for (place, distance) in farthest {
            if distance.is_normal() {
                self.atoms.borrow_mut().list[place].scale = distance;
            }
        }
    }
}

/// e = Σ c_j y_j + constant, as (y_j, c_j) and the constant.
fn affine(e: Expr<'_>) -> (Vec<(Expr<'_>, f64)>, f64) {
    let exprs = e.exprs();
    let vars = variables_of(&[e]).into_iter();
    let linear = vars.filter_map(|var| Some((var, e.diff(var).as_constant()?)));
    let linear: Vec<(Var, f64)> = linear.collect();
    let zero = |&(var, _): &(Var, f64)| (var, exprs.constant(0.0));
    let rest = e.substitute(&linear.iter().map(zero).collect());
    let linear = linear.into_iter().filter(|&(_, c)| c != 0.0);
    let mut terms: Vec<(Expr<'_>, f64)> = linear.map(|(var, c)| (exprs.expr(var), c)).collect();
    let mut constant = 0.0;
    let mut open = vec![(rest, 1.0)];
    while let Some((e, factor)) = open.pop() {
        match e.node() {
            Node::Constant(value) => constant += factor * value,
            Node::Sum {
                constant: value,
                terms,
            } => {
                constant += factor * value;
                open.extend(terms.into_iter().map(|(c, term)| (term, factor * c)));
            }
            _ => match terms.iter_mut().find(|(known, _)| *known == e) {
                Some((_, c)) => *c += factor,
                None => terms.push((e, factor)),
            },
        }
    }
    terms.retain(|&(_, c)| c != 0.0);
    (terms, constant)
}

#[cfg(test)]
mod tests {
    use super::{Arrangement, Side, Sides};
    use crate::expr::{Expr, Exprs, Substitution, Var};

    fn arrangement<'e>(states: &[Expr<'e>], psi: &[Expr<'e>]) -> (Arrangement<'e>, Vec<Var>) {
        let exprs = psi[0].exprs();
        let alphas = exprs.variables("alpha", psi.len());
        let alphas: Vec<Var> = alphas.iter().filter_map(|e| e.as_variable()).collect();
        let surfaces: Vec<(Var, Expr)> = alphas.iter().copied().zip(psi.iter().copied()).collect();
        let origin = states.iter().map(|x| (x.as_variable().unwrap(), 0.5));
        let made = Arrangement::new(&surfaces, &Substitution::new(), origin);
        (made, alphas)
    }

    /// The combinations of sides that are not proven to be empty, and whether they have an interior.
    fn combinations(arrangement: &Arrangement) -> Vec<(String, bool)> {
        let mut cells: Vec<Sides> = vec![arrangement.all()];
        for k in 0..arrangement.n_surfaces() {
            let sides = cells
                .iter()
                .flat_map(|cell| [false, true].map(|above| arrangement.side(cell, k, above)));
            let found = sides.filter_map(|side| match side {
                Side::Cell(sides) => Some(sides),
                Side::Empty => None,
                Side::Unknown(_) => panic!("a program failed"),
            });
            cells = found.collect();
        }
        let name = |side: &Option<bool>| if *side == Some(true) { '+' } else { '-' };
        let named = cells
            .iter()
            .map(|sides| (sides.signs.iter().map(name).collect(), !sides.is_thin()));
        named.collect()
    }

    fn names(found: &[(String, bool)]) -> String {
        let words = found
            .iter()
            .map(|(name, open)| format!("{name}{}", if *open { "" } else { "?" }));
        words.collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn planes_and_concentric_circles() {
        let exprs = Exprs::new();
        let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
        let parallel = [x, x - 1e-5, 3.0 * x - 6.0];
        assert_eq!(
            names(&combinations(&arrangement(&[x], &parallel).0)),
            "--- +-- ++- +++"
        );
        let lines = [x, y, x + y];
        let (made, _) = arrangement(&[x, y], &lines);
        assert_eq!(
            names(&combinations(&made)),
            "--- --+? -+- -++ +-- +-+ ++-? +++"
        );
        let r = x * x + y * y;
        let (made, _) = arrangement(&[x, y], &[r - 1.0, r - 4.0]);
        assert_eq!(names(&combinations(&made)), "-- +- ++");
        // (x - 1)^2 - (x + 1)^2 is affine, though it does not look so.
        let (made, _) = arrangement(&[x], &[(x - 1.0).powi(2) - (x + 1.0).powi(2), x - 1.0]);
        assert_eq!(names(&combinations(&made)), "-- -+ +-");
    }

    #[test]
    fn squares_are_never_negative() {
        let exprs = Exprs::new();
        let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
        let (made, _) = arrangement(&[x, y], &[x * x + y, y + 1.0]);
        assert_eq!(names(&combinations(&made)), "-- -+ +- ++");
        let (made, _) = arrangement(&[x, y], &[x * x + y, y - 1.0]);
        assert_eq!(names(&combinations(&made)), "-- +- ++");
    }

    #[test]
    fn nested_surfaces_are_planes_on_each_side() {
        let exprs = Exprs::new();
        let x = exprs.variable("x");
        let alpha = exprs.variable("a");
        let var = |e: Expr| e.as_variable().unwrap();
        let surfaces = [
            (var(alpha), x),
            // abs(x) - 1
            (var(exprs.variable("b")), (2.0 * alpha - 1.0) * x - 1.0),
            (var(exprs.variable("c")), x + 2.0),
        ];
        let made = Arrangement::new(&surfaces, &Substitution::new(), [(var(x), 0.5)]);
        assert_eq!(names(&combinations(&made)), "--+ -+- -++ +-+ +++");
    }

    #[test]
    fn witnesses_are_near_the_start() {
        let exprs = Exprs::new();
        let [x, y] = ["x", "y"].map(|name| exprs.variable(name));
        let (made, _) = arrangement(&[x, y], &[x - 3.0, x - 3.5, y]);
        let side = |sides: &Sides, k, above| match made.side(sides, k, above) {
            Side::Cell(sides) => sides,
            _ => panic!("there are such points"),
        };
        let sides = side(&side(&made.all(), 0, true), 1, false);
        let point = made.witness(&sides).expect("states are coordinates");
        assert!(
            matches!(point[..], [(_, x)] if x > 3.0 && x < 3.5),
            "{point:?}"
        );
    }
}
