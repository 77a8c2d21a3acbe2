//! One kernel, bound to variables and numbers at many places.

use crate::expr::{Expr, Var, variables_of};
use crate::lowering::mpcc::{Block, Kernel, Kind, Mpcc, Source, Span, n_places, place_of};

/// A block to whose formal arguments actual ones are bound. The first of several bindings of an argument counts, and
/// what the kernel does not contain is dropped in the end.
#[derive(Clone)]
pub(crate) struct Builder<const N: usize> {
    name: &'static str,
    ranges: [Span; N],
    places: Vec<[usize; N]>,
    variables: Vec<(Var, Vec<u32>)>,
    numbers: Vec<(Var, Vec<f64>)>,
    bounds: Vec<(f64, f64)>,
}

impl<const N: usize> Builder<N> {
    /// At all places of the ranges.
    pub fn new(name: &'static str, ranges: [Span; N]) -> Self {
        let place = |number| {
            let place = place_of(&ranges, number);
            std::array::from_fn(|i| place[i])
        };
        Builder {
            name,
            places: (0..n_places(&ranges)).map(place).collect(),
            ranges,
            variables: Vec::new(),
            numbers: Vec::new(),
            bounds: Vec::new(),
        }
    }

    /// The outputs are between these.
    pub fn bounds(mut self, bounds: Vec<(f64, f64)>) -> Self {
        self.bounds = bounds;
        self
    }

    /// All places.
    pub fn places(&self) -> impl Iterator<Item = [usize; N]> + '_ {
        self.places.iter().copied()
    }

    /// The argument `formal` is this variable at a place.
    pub fn variable(mut self, formal: Expr, index: impl Fn([usize; N]) -> usize) -> Self {
        if self.is_bound(formal) {
            return self;
        }
        let index = |&place: &[usize; N]| {
            u32::try_from(index(place)).expect("a problem has fewer than 2^32 variables")
        };
        let actual = self.places.iter().map(index).collect();
        self.variables.push((variable(formal), actual));
        self
    }

    /// The arguments `formals` are consecutive variables place by place, from this one on.
    pub fn place_by_place(self, formals: &[Expr], first: usize) -> Self {
        let ranges = self.ranges;
        let number = move |place: [usize; N]| {
            let indices = ranges.iter().zip(place);
            indices.fold(0, |number, (range, index)| {
                number * range.len() + index - range.first
            })
        };
        self.vector(formals, |place| first + number(place) * formals.len())
    }

    /// The ranges of its places.
    pub fn ranges(&self) -> &[Span; N] {
        &self.ranges
    }

    /// Whether an argument is a variable at all places.
    pub fn is_bound(&self, formal: Expr) -> bool {
        let formal = variable(formal);
        self.variables.iter().any(|(var, _)| *var == formal)
    }

    /// The arguments `formals` are consecutive variables from this one on.
    pub fn vector(self, formals: &[Expr], first: impl Fn([usize; N]) -> usize) -> Self {
        let numbered = formals.iter().enumerate();
        numbered.fold(self, |builder, (i, &formal)| {
            builder.variable(formal, |place| first(place) + i)
        })
    }

    /// The argument `formal` is this number at a place.
    pub fn number(mut self, formal: Expr, value: impl Fn([usize; N]) -> f64) -> Self {
        let actual = self.places.iter().map(|&place| value(place)).collect();
        self.numbers.push((variable(formal), actual));
        self
    }

    /// Adds the block to a program.
    pub fn state<'e>(
        self,
        mpcc: &mut Mpcc<'e>,
        kind: Kind,
        outputs: Vec<Expr<'e>>,
        sources: Vec<Source>,
        text: impl Into<String>,
    ) {
        mpcc.blocks
            .push(self.finish(kind, outputs, sources, text.into()));
    }

    /// The block; its outputs contain what was bound.
    pub fn finish<'e>(
        mut self,
        kind: Kind,
        outputs: Vec<Expr<'e>>,
        sources: Vec<Source>,
        text: String,
    ) -> Block<'e> {
        let occurring = variables_of(&outputs);
        let occurs = |var: &Var| occurring.binary_search(var).is_ok();
        self.variables.retain(|(var, _)| occurs(var));
        self.numbers.retain(|(var, _)| occurs(var));
        let (variables, arguments): (Vec<Var>, Vec<Vec<u32>>) = self.variables.into_iter().unzip();
        let (numbers, values): (Vec<Var>, Vec<Vec<f64>>) = self.numbers.into_iter().unzip();
        Block {
            name: self.name,
            kind,
            ranges: self.ranges.to_vec(),
            text,
            kernel: Kernel {
                variables,
                numbers,
                outputs,
            },
            arguments: arguments.concat(),
            numbers: values.concat(),
            bounds: self.bounds,
            sources,
        }
    }
}

/// What is declared as a variable.
pub(crate) fn variable(expr: Expr) -> Var {
    expr.as_variable().expect("arguments are variables")
}
