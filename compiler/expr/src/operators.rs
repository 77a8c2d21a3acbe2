//! Arithmetic on handles, and the functions as methods.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{BinaryFunction, Expr, Exprs, Function};

/// The operators between two expressions and between an expression and a number.
macro_rules! operator {
    ($Trait:ident, $method:ident, |$exprs:ident, $a:ident, $b:ident| $body:expr) => {
        impl<'e> $Trait for Expr<'e> {
            type Output = Expr<'e>;

            fn $method(self, other: Expr<'e>) -> Expr<'e> {
                let ($exprs, $a, $b) = (self.exprs, self.id, other.id);
                debug_assert!(
                    std::ptr::eq(self.exprs, other.exprs),
                    "operands share their owner"
                );
                $body
            }
        }

        impl<'e> $Trait<f64> for Expr<'e> {
            type Output = Expr<'e>;

            fn $method(self, other: f64) -> Expr<'e> {
                self.$method(self.exprs.constant(other))
            }
        }

        impl<'e> $Trait<Expr<'e>> for f64 {
            type Output = Expr<'e>;

            fn $method(self, other: Expr<'e>) -> Expr<'e> {
                other.exprs.constant(self).$method(other)
            }
        }
    };
}

operator!(Add, add, |exprs, a, b| exprs
    .build(|arena| arena.sum(0.0, [(a, 1.0), (b, 1.0)])));
operator!(Sub, sub, |exprs, a, b| exprs
    .build(|arena| arena.sum(0.0, [(a, 1.0), (b, -1.0)])));
operator!(Mul, mul, |exprs, a, b| exprs
    .build(|arena| arena.product(1.0, [(a, 1), (b, 1)])));
operator!(Div, div, |exprs, a, b| exprs
    .build(|arena| arena.quotient(a, b)));

impl<'e> Neg for Expr<'e> {
    type Output = Expr<'e>;

    fn neg(self) -> Expr<'e> {
        self.exprs.build(|arena| arena.scale(self.id, -1.0))
    }
}

impl Exprs {
    /// The sum of any number of terms, built in one go.
    pub fn sum<'e>(&'e self, terms: impl IntoIterator<Item = Expr<'e>>) -> Expr<'e> {
        let terms = terms
            .into_iter()
            .map(|term| (term.id, 1.0))
            .collect::<Vec<_>>();
        self.build(|arena| arena.sum(0.0, terms))
    }

    /// The product of any number of factors, built in one go.
    pub fn product<'e>(&'e self, factors: impl IntoIterator<Item = Expr<'e>>) -> Expr<'e> {
        let factors = factors
            .into_iter()
            .map(|factor| (factor.id, 1))
            .collect::<Vec<_>>();
        self.build(|arena| arena.product(1.0, factors))
    }

    /// `aᵀb`.
    pub fn dot<'e>(&'e self, a: &[Expr<'e>], b: &[Expr<'e>]) -> Expr<'e> {
        assert_eq!(
            a.len(),
            b.len(),
            "the vectors of a scalar product are equally long"
        );
        self.sum(a.iter().zip(b).map(|(&a, &b)| a * b))
    }
}

/// The sum of one or more terms; use [`Exprs::sum`] where there may be none.
pub fn sum<'e>(terms: impl IntoIterator<Item = Expr<'e>>) -> Expr<'e> {
    let mut terms = terms.into_iter();
    let first = terms
        .next()
        .expect("a sum without terms does not know its owner");
    first.exprs.sum(std::iter::once(first).chain(terms))
}

/// `aᵀb` of one or more entries; use [`Exprs::dot`] where there may be none.
pub fn dot<'e>(a: &[Expr<'e>], b: &[Expr<'e>]) -> Expr<'e> {
    let first = a
        .first()
        .expect("a scalar product without entries does not know its owner");
    first.exprs.dot(a, b)
}

impl<'e> Expr<'e> {
    /// `function(self)`.
    pub fn apply(self, function: Function) -> Expr<'e> {
        self.exprs.build(|arena| arena.apply(function, self.id))
    }

    /// `function(self, other)`.
    pub fn apply_binary(self, function: BinaryFunction, other: Expr<'e>) -> Expr<'e> {
        self.exprs
            .build(|arena| arena.apply_binary(function, self.id, other.id))
    }

    /// `self ^ power`.
    pub fn powi(self, power: i32) -> Expr<'e> {
        self.exprs
            .build(|arena| arena.product(1.0, [(self.id, power)]))
    }

    /// `self ^ power`; a constant integer power becomes part of the product.
    pub fn powf(self, power: Expr<'e>) -> Expr<'e> {
        self.apply_binary(BinaryFunction::Pow, power)
    }

    /// The angle of the point with the ordinate `self` and the abscissa `x`.
    pub fn atan2(self, x: Expr<'e>) -> Expr<'e> {
        self.apply_binary(BinaryFunction::Atan2, x)
    }

    /// The smaller of two values.
    pub fn min(self, other: Expr<'e>) -> Expr<'e> {
        self.apply_binary(BinaryFunction::Min, other)
    }

    /// The larger of two values.
    pub fn max(self, other: Expr<'e>) -> Expr<'e> {
        self.apply_binary(BinaryFunction::Max, other)
    }
}
