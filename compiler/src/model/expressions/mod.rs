//! Expressions of the syntax tree to values: names looked up, shapes checked, everything scalar.

pub(crate) mod algebra;
pub(crate) mod brackets;
pub(crate) mod builtins;
pub(crate) mod calls;
pub(crate) mod check;
pub(crate) mod environment;
pub(crate) mod logic;
pub(crate) mod periodic;
pub(crate) mod quantity;
pub(crate) mod rows;
pub(crate) mod tensor;
pub(crate) mod text;
pub(crate) mod unroll;
pub(crate) mod values;

use self::environment::Environment;
use super::{ModelError, Rounded, Shape, Surface, Tensor};
use crate::diagnostics::{Diagnostics, Fixable};
use crate::expr::Expr;
use crate::model::names::scope::{Hook, Reported, Scope, Value};
use crate::model::names::{fields, lookup};
use crate::source::Span;
use crate::syntax::{self, ExprKind, Level};

/// Levels of expressions inside each other, through functions and local names: what the stack bears.
///
/// What stands between two levels is kept out of line: frames of one function would hold the locals of all.
const MAX_DEPTH: usize = 300;

/// The state of lowering one expression.
pub(crate) struct Lowering<'a, 'e> {
    pub names: Environment<'a, 'e>,
    pub hook: Option<&'a Hook<'a, 'e>>,
    pub diags: &'a mut Diagnostics,
    /// True in the guard of a region, where a comparison must not be constant.
    pub in_guard: bool,
    /// True once a name was looked up that is neither a structural constant nor a constant local one.
    pub varies: bool,
    /// Switching functions met so far.
    pub surfaces: Vec<Surface<'e>>,
    /// Calls of `floor` and `mod` met so far.
    pub rounded: Vec<Rounded<'e>>,
    depth: usize,
}

impl<'a, 'e> Lowering<'a, 'e> {
    pub fn new(
        scope: &'a Scope<'e>,
        hook: Option<&'a Hook<'a, 'e>>,
        diags: &'a mut Diagnostics,
    ) -> Self {
        Lowering {
            names: Environment::of_model(scope),
            hook,
            diags,
            in_guard: false,
            varies: false,
            surfaces: vec![],
            rounded: vec![],
            depth: 0,
        }
    }

    #[inline(never)]
    pub fn error<T>(&mut self, error: impl Fixable) -> Result<T, Reported> {
        self.diags.push(error);
        Err(Reported)
    }

    /// Reports an error, where there is one to report.
    pub fn refuse<T>(&mut self, error: Option<ModelError>) -> Result<T, Reported> {
        error.into_iter().for_each(|error| self.diags.push(error));
        Err(Reported)
    }

    /// Takes work off the budget of the model.
    pub fn spend(&mut self, amount: usize, span: Span) -> Result<(), Reported> {
        // Once it is used up, everything fails without further words.
        let Some(left) = self.names.scope.budget.get() else {
            return Err(Reported);
        };
        let rest = left.checked_sub(amount);
        self.names.scope.budget.set(rest);
        match rest {
            Some(_) => Ok(()),
            None => {
                let what = "the model".to_owned();
                self.error(ModelError::TooLarge { what, span })
            }
        }
    }

    pub fn constant(&self, value: f64) -> Expr<'e> {
        self.names.scope.exprs.constant(value)
    }

    /// The value of an expression that must consist of numbers.
    pub fn numbers(&mut self, expr: &syntax::Expr) -> Result<Tensor<'e>, Reported> {
        let value = self.expr(expr)?;
        match value.is_condition {
            false => Ok(value.tensor),
            true => self.error(ModelError::BooleanAsNumber { span: expr.span }),
        }
    }

    /// The value of an expression in a given shape.
    pub fn numbers_as(
        &mut self,
        expr: &syntax::Expr,
        shape: Shape,
        what: &str,
    ) -> Result<Tensor<'e>, Reported> {
        let value = self.numbers(expr)?;
        match value.conform(shape) {
            Some(value) => {
                self.spend(value.data.len(), expr.span)?;
                Ok(value)
            }
            None => self.error(ModelError::WrongShape {
                what: what.to_owned(),
                expected: shape.to_string(),
                found: value.shape.to_string(),
                span: expr.span,
                help: check::shape_help(shape, value.shape),
            }),
        }
    }

    /// One number.
    pub fn scalar(&mut self, expr: &syntax::Expr, what: &str) -> Result<Expr<'e>, Reported> {
        let value = self.numbers(expr)?;
        self.only_entry(&value, what, expr.span)
    }

    pub fn only_entry(
        &mut self,
        value: &Tensor<'e>,
        what: &str,
        span: Span,
    ) -> Result<Expr<'e>, Reported> {
        match value.as_scalar() {
            Some(only) => Ok(only),
            None => self.error(ModelError::ScalarExpected {
                what: what.to_owned(),
                found: value.shape.to_string(),
                span,
                help: None,
            }),
        }
    }

    /// A condition as a number in [0, 1].
    pub fn condition(&mut self, expr: &syntax::Expr) -> Result<Expr<'e>, Reported> {
        let value = self.expr(expr)?;
        if !value.is_condition {
            let text = self.names.written().at_level(expr, Level::Atom);
            return self.error(ModelError::NumberAsCondition {
                text,
                span: expr.span,
            });
        }
        self.only_entry(&value.tensor, "a condition", expr.span)
    }

    /// An integer known before the run.
    pub fn integer(&mut self, expr: &syntax::Expr, what: &str) -> Result<i64, Reported> {
        let value = self.scalar(expr, what)?;
        let value = self.as_constants(&Tensor::scalar(value), what, expr.span)?[0];
        // Rounding in `0.1*30` must not matter; 2^52 bounds what a number holds exactly.
        let rounded = value.round();
        if !value.is_finite()
            || rounded.abs() > 4.5e15
            || (value - rounded).abs() > 1e-9 * rounded.abs().max(1.0)
        {
            return self.error(ModelError::NotInteger {
                what: what.to_owned(),
                found: value,
                span: expr.span,
            });
        }
        Ok(rounded as i64)
    }

    /// A size: an integer from 0, small enough for memory.
    pub fn size(&mut self, expr: &syntax::Expr, what: &str) -> Result<usize, Reported> {
        let size = self.integer(expr, what)?;
        match usize::try_from(size) {
            Ok(size) => Ok(size),
            Err(_) => self.error(ModelError::OutOfRange {
                index: size.to_string(),
                what: what.to_owned(),
                valid: "0, 1, 2, ..".to_owned(),
                span: expr.span,
            }),
        }
    }

    /// The entries of a value that depends on structural constants only.
    pub fn as_constants(
        &mut self,
        value: &Tensor<'e>,
        what: &str,
        span: Span,
    ) -> Result<Vec<f64>, Reported> {
        match value.constants() {
            Some(constants) => Ok(constants),
            None => {
                let Some(cause) = check::first_variable(&value.data) else {
                    let values = value.data.iter().map(|e| e.eval(&|_| f64::NAN));
                    return self.error(ModelError::NotFinite {
                        what: what.to_owned(),
                        span,
                        value: values
                            .into_iter()
                            .find(|v| !v.is_finite())
                            .unwrap_or(f64::NAN),
                    });
                };
                self.error(ModelError::NotConstant {
                    what: what.to_owned(),
                    span,
                    cause,
                })
            }
        }
    }

    /// The value of any expression.
    pub fn expr(&mut self, expr: &syntax::Expr) -> Result<Value<'e>, Reported> {
        if self.depth >= MAX_DEPTH {
            return self.error(ModelError::TooDeep { span: expr.span });
        }
        self.spend(1, expr.span)?;
        self.depth += 1;
        let value = self.any(expr);
        self.depth -= 1;
        value
    }

    #[inline(never)]
    fn any(&mut self, expr: &syntax::Expr) -> Result<Value<'e>, Reported> {
        if let Some(hook) = self.hook
            && matches!(
                expr.kind,
                ExprKind::Name(_) | ExprKind::Call(..) | ExprKind::Index(..) | ExprKind::Field(..)
            )
            && let Some(tensor) = hook(expr)
        {
            return Ok(tensor.into());
        }
        match &expr.kind {
            ExprKind::Number(value) => Ok(Tensor::scalar(self.constant(*value)).into()),
            ExprKind::Quantity(value, unit) => quantity::quantity(self, *value, unit, expr.span),
            ExprKind::String(_) => self.error(ModelError::Text { span: expr.span }),
            ExprKind::Name(name) => lookup::name(self, name, expr.span),
            ExprKind::Field(base, field) => fields::field(self, expr, base, field),
            ExprKind::Index(base, indices) => lookup::index(self, base, indices, expr.span),
            ExprKind::Call(function, args) => calls::call(self, function, args, expr.span),
            ExprKind::Matrix(matrix) => brackets::matrix(self, matrix, expr.span).map(Value::from),
            ExprKind::Comprehension(body, binders) => {
                logic::comprehension(self, body, binders, expr.span)
            }
            ExprKind::Negate(inner) => logic::negate(self, inner),
            ExprKind::Binary(op, left, right) => logic::power(self, *op, left, right),
            ExprKind::Chain(first, rest) => algebra::chain(self, first, rest).map(Value::from),
            ExprKind::Compare(first, rest) => check::compare(self, first, rest),
            ExprKind::Not(inner) => logic::not(self, inner),
            ExprKind::And(members) => logic::and(self, members),
            ExprKind::Or(members) => logic::or(self, members),
            ExprKind::If(c, a, b) => logic::choose(self, c, a, b),
        }
    }
}

impl<'e> Value<'e> {
    /// A condition as a number in [0, 1].
    pub fn condition(truth: Expr<'e>) -> Self {
        Value {
            tensor: Tensor::scalar(truth),
            is_condition: true,
        }
    }
}

impl<'e> From<Tensor<'e>> for Value<'e> {
    fn from(tensor: Tensor<'e>) -> Self {
        Value {
            tensor,
            is_condition: false,
        }
    }
}
