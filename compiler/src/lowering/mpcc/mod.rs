//! Mathematical program with complementarity constraints (MPCC): a finite problem in variables w.
//!
//! minimize F(w)   subject to   c(w) = 0,   lᵍ <= g(w) <= uᵍ,   0 <= a(w) ⟂ b(w) >= 0,   l <= w <= u
//!
//! Conditional rows e(w) = 0 hold for some choices only of which members of pairs are zero.
//!
//! Its rows are not unrolled: a [`Block`] applies one [`Kernel`], a function with formal arguments, at many places.
//! For each place it lists the indices of the variables that are the arguments there, and the numbers that differ from
//! place to place. So a row of collocation is written once, compiled once and evaluated in lanes at all nodes.
//!
//! Rows are numbered block by block. Row `output * places + place` of a block is one output of the kernel at one place;
//! a block of pairs has first the outputs a, then the outputs b, and the sum of all rows of objectives is F.
//!
//! Invariants, checked by [`Mpcc::verify`]:
//!
//! - Blocks of variables follow each other without gaps, and every variable has l <= guess <= u.
//! - A block has as many places as its ranges span, and one index below the number of variables, or one finite number,
//!   for each formal argument and place.
//! - The formal arguments of a kernel are distinct, and its outputs contain them and the parameters only.
//! - No `step`, `sign`, `abs`, `min` or `max` is left in a kernel.
//! - Every output, or pair of outputs, has a [`Source`].
//! - Outputs of inequalities have bounds, one of them finite and the lower not above the upper; others have none.

mod conditions;
mod display;
mod evaluate;
mod flat;
mod nl;
mod program;
mod slack;
mod verify;

use std::collections::BTreeMap;
use std::ops::Range;

pub use conditions::{Branches, Conditions, Group, Impulses, Rests};
pub use evaluate::Evaluator;
pub use flat::{Flat, Row, Value};
pub use nl::Ampl;
pub use program::{Linearized, Others, Program};
pub use slack::Slack;

use crate::expr::{Expr, Exprs, Var};
use crate::lowering::dcs;
use crate::system::Param;

/// minimize F(w) subject to c(w) = 0, lᵍ <= g(w) <= uᵍ, 0 <= a(w) ⟂ b(w) >= 0, l <= w <= u.
#[derive(Clone, Debug)]
pub struct Mpcc<'e> {
    /// The arena of all expressions.
    pub exprs: &'e Exprs,
    /// Name of the model.
    pub name: String,
    /// How it was made; the first lines of the printed form.
    pub remarks: Vec<String>,
    /// Parameters with their values; the same at all places.
    pub params: Vec<Param<'e>>,
    /// What the printed blocks refer to.
    pub definitions: Vec<Definition>,
    /// w, in blocks.
    pub variables: Vec<Variables>,
    /// F, c, g, a and b.
    pub blocks: Vec<Block<'e>>,
    /// The terms that a user adds up to F, each as terms of an objective of its own.
    pub terms: Vec<Vec<Block<'e>>>,
    /// What has become of the constraints of the experiment, in their order.
    pub stated: Vec<Stated>,
    /// When conditional rows hold.
    pub conditions: Conditions,
}

/// A constraint as rows, or as bounds of variables.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stated {
    /// Its blocks.
    pub blocks: Range<usize>,
    /// The variables that it bounds.
    pub variables: Vec<usize>,
    /// By how much it may be missed, where it is soft.
    pub slack: Option<Slack>,
}

/// Functions as they are printed: `f(x, z)` and its lines.
#[derive(Clone, Debug)]
pub struct Definition {
    /// `f(x, z)`
    pub head: String,
    /// One entry per line.
    pub lines: Vec<String>,
}

/// A block of variables: the same components at all places of its ranges, place by place.
#[derive(Clone, Debug)]
pub struct Variables {
    /// What all components together are called: `x`.
    pub name: String,
    /// Names of the components: `q`, `v`.
    pub components: Vec<String>,
    /// The places.
    pub ranges: Vec<Span>,
    /// The index of its first variable.
    pub start: usize,
    /// l, u and a guess of each variable.
    pub bounds: Vec<Bounds>,
}

/// l <= w <= u, and where to start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// l
    pub lower: f64,
    /// u
    pub upper: f64,
    /// A value between them.
    pub guess: f64,
}

/// An index with the values it takes: `k in 1..10`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Its name.
    pub name: &'static str,
    /// The first value.
    pub first: usize,
    /// The last value.
    pub last: usize,
}

/// Rows: one kernel at many places.
#[derive(Clone, Debug)]
pub struct Block<'e> {
    /// What the rows are called.
    pub name: &'static str,
    /// What is asked of them.
    pub kind: Kind,
    /// The places, the last index fastest.
    pub ranges: Vec<Span>,
    /// The row as it is printed, in terms of the definitions.
    pub text: String,
    /// What is applied.
    pub kernel: Kernel<'e>,
    /// Index of the variable that is argument i at place p, at `i * places + p`.
    pub arguments: Vec<u32>,
    /// Number i at place p, at `i * places + p`.
    pub numbers: Vec<f64>,
    /// lᵍ and uᵍ of each output, for inequalities.
    pub bounds: Vec<(f64, f64)>,
    /// Where each output comes from; for pairs, each pair of outputs.
    pub sources: Vec<Source>,
}

/// What is asked of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// c = 0.
    Equation,
    /// lᵍ <= g <= uᵍ.
    Inequality,
    /// e = 0 for some choices of the members of pairs that are zero, and nothing otherwise.
    Conditional,
    /// 0 <= a ⟂ b >= 0: the first half of the outputs is a, the second b.
    Pair,
    /// A term of F.
    Objective,
    /// A term of F that steers relaxations, and leaves F once it is known which members of pairs are zero.
    Steering,
}

/// A function with formal arguments.
#[derive(Clone, Debug)]
pub struct Kernel<'e> {
    /// Arguments that are variables.
    pub variables: Vec<Var>,
    /// Arguments that are numbers.
    pub numbers: Vec<Var>,
    /// The values.
    pub outputs: Vec<Expr<'e>>,
}

/// What a row states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A row of the DCS.
    Dcs(dcs::Origin),
    /// The grid in time.
    Grid,
    /// A cost or constraint of the experiment.
    Task(crate::source::Span),
}

/// Where a row comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// What it states.
    pub source: Source,
    /// The indices of its place: for a row of collocation step, element and node.
    pub place: Vec<usize>,
}

/// How many of what there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Variables.
    pub variables: usize,
    /// Variables with l = u.
    pub fixed: usize,
    /// Equations.
    pub equations: usize,
    /// Inequalities.
    pub inequalities: usize,
    /// Rows that hold for some choices only.
    pub conditional: usize,
    /// Pairs.
    pub pairs: usize,
    /// Terms of the objective.
    pub terms: usize,
}

impl Span {
    /// `name in first..last`
    pub fn new(name: &'static str, first: usize, last: usize) -> Self {
        Span { name, first, last }
    }

    /// The number of values.
    pub fn len(self) -> usize {
        (self.last + 1).saturating_sub(self.first)
    }

    /// Whether there is no value.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

/// The number of places.
pub(crate) fn n_places(ranges: &[Span]) -> usize {
    ranges.iter().map(|range| range.len()).product()
}

/// The indices of a place, the last one fastest.
pub(crate) fn place_of(ranges: &[Span], mut number: usize) -> Vec<usize> {
    let mut place: Vec<usize> = ranges.iter().map(|range| range.first).collect();
    for (index, range) in place.iter_mut().zip(ranges).rev() {
        *index += number % range.len();
        number /= range.len();
    }
    place
}

impl Bounds {
    /// No bounds.
    pub fn free(guess: f64) -> Self {
        Bounds {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            guess,
        }
    }

    /// l = u.
    pub fn fixed(value: f64) -> Self {
        // -0 becomes 0.
        let value = value + 0.0;
        Bounds {
            lower: value,
            upper: value,
            guess: value,
        }
    }

    /// l <= w <= u, with a guess that is moved between them.
    pub fn between(lower: f64, upper: f64, guess: f64) -> Self {
        Bounds {
            lower,
            upper,
            guess: guess.max(lower).min(upper),
        }
    }

    /// Within other bounds too.
    pub fn within(self, lower: f64, upper: f64) -> Self {
        Bounds::between(self.lower.max(lower), self.upper.min(upper), self.guess)
    }

    /// Whether l = u.
    pub fn is_fixed(self) -> bool {
        self.lower == self.upper
    }
}

impl Block<'_> {
    /// The number of places.
    pub fn n_places(&self) -> usize {
        n_places(&self.ranges)
    }

    /// The number of rows.
    pub fn n_rows(&self) -> usize {
        self.kernel.outputs.len() * self.n_places()
    }

    /// Where row `row` of the block comes from.
    pub fn origin(&self, row: usize) -> Origin {
        let (output, place) = (row / self.n_places(), row % self.n_places());
        Origin {
            source: self.sources[output % self.sources.len()],
            place: place_of(&self.ranges, place),
        }
    }
}

impl<'e> Mpcc<'e> {
    /// Adds a block of variables, unless it is empty, and gives the index of its first one.
    pub(crate) fn declare(
        &mut self,
        name: &str,
        components: Vec<String>,
        ranges: &[Span],
        bounds: Vec<Bounds>,
    ) -> usize {
        let start = self.n_variables();
        if !bounds.is_empty() {
            self.variables.push(Variables {
                name: name.to_owned(),
                components,
                ranges: ranges.to_vec(),
                start,
                bounds,
            });
        }
        start
    }

    /// The number of variables.
    pub fn n_variables(&self) -> usize {
        let last = self.variables.last();
        last.map_or(0, |block| block.start + block.bounds.len())
    }

    /// The number of rows.
    pub fn n_rows(&self) -> usize {
        self.blocks.iter().map(Block::n_rows).sum()
    }

    /// The blocks with the numbers of their rows.
    pub fn rows(&self) -> impl Iterator<Item = (&Block<'e>, Range<usize>)> {
        self.blocks.iter().scan(0, |start, block| {
            let rows = *start..*start + block.n_rows();
            *start = rows.end;
            Some((block, rows))
        })
    }

    /// The number of the first pair of a block among all pairs, or of all pairs where there is no such block.
    pub fn first_pair(&self, name: &str) -> usize {
        let pairs = self.blocks.iter().filter(|block| block.kind == Kind::Pair);
        let before = pairs.take_while(|block| block.name != name);
        before.map(|block| block.n_rows() / 2).sum()
    }

    /// l, u and guess of all variables.
    pub fn bounds(&self) -> Vec<Bounds> {
        let blocks = self.variables.iter();
        blocks.flat_map(|block| &block.bounds).copied().collect()
    }

    /// Takes the bounds off a variable whose value a [`Program`] is given: as a member of a pair it is a row there.
    ///
    /// # Panics
    ///
    /// When there is no such variable.
    pub fn free(&mut self, index: usize) {
        let bounds = self.bound_mut(index);
        *bounds = Bounds::free(bounds.guess);
    }

    /// Gives a variable a value.
    ///
    /// # Panics
    ///
    /// When there is no such variable.
    pub fn give(&mut self, index: usize, value: f64) {
        *self.bound_mut(index) = Bounds::fixed(value);
    }

    /// Changes where solvers start, as far as the bounds of a variable allow.
    ///
    /// # Panics
    ///
    /// When there is no such variable.
    pub fn guess(&mut self, index: usize, value: f64) {
        let bounds = self.bound_mut(index);
        *bounds = Bounds::between(bounds.lower, bounds.upper, value);
    }

    pub(crate) fn bound_mut(&mut self, index: usize) -> &mut Bounds {
        let after = self.variables.partition_point(|block| block.start <= index);
        let block = &mut self.variables[after - 1];
        &mut block.bounds[index - block.start]
    }

    /// Changes where solvers start.
    ///
    /// # Panics
    ///
    /// When there are fewer values than variables.
    pub fn set_guess(&mut self, w: &[f64]) {
        for block in &mut self.variables {
            let values = &w[block.start..block.start + block.bounds.len()];
            for (bounds, &value) in block.bounds.iter_mut().zip(values) {
                bounds.guess = value;
            }
        }
    }

    /// Names of all variables: `q[1,2,3]`.
    pub fn names(&self) -> Vec<String> {
        let blocks = self.variables.iter();
        blocks.flat_map(Variables::names).collect()
    }

    /// The number of the quantity that every variable is a value of: a component of a block, or of several of one name.
    pub fn quantities(&self) -> Vec<usize> {
        let mut numbers = BTreeMap::new();
        let mut quantities = Vec::with_capacity(self.n_variables());
        for block in &self.variables {
            let components = block.components.iter().map(|component| {
                let next = numbers.len();
                *numbers.entry((&block.name, component)).or_insert(next)
            });
            let components: Vec<usize> = components.collect();
            for _ in 0..n_places(&block.ranges) {
                quantities.extend(&components);
            }
        }
        quantities
    }

    /// How many variables, equations and pairs there are.
    pub fn sizes(&self) -> Sizes {
        let mut sizes = Sizes {
            variables: self.n_variables(),
            ..Sizes::default()
        };
        let bounds = self.variables.iter().flat_map(|block| &block.bounds);
        sizes.fixed = bounds.filter(|bounds| bounds.is_fixed()).count();
        for block in &self.blocks {
            match block.kind {
                Kind::Equation => sizes.equations += block.n_rows(),
                Kind::Inequality => sizes.inequalities += block.n_rows(),
                Kind::Conditional => sizes.conditional += block.n_rows(),
                Kind::Pair => sizes.pairs += block.n_rows() / 2,
                Kind::Objective | Kind::Steering => sizes.terms += block.n_rows(),
            }
        }
        sizes
    }
}

impl Variables {
    fn names(&self) -> impl Iterator<Item = String> {
        (0..n_places(&self.ranges)).flat_map(move |number| {
            let place = place_of(&self.ranges, number);
            let place: Vec<String> = place.iter().map(usize::to_string).collect();
            let place = match place.join(",") {
                place if place.is_empty() => place,
                place => format!("[{place}]"),
            };
            let components = self.components.iter();
            components.map(move |component| format!("{component}{place}"))
        })
    }
}
