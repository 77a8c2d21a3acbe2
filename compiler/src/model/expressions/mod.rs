//! Expressions of the syntax tree to values: names looked up, shapes checked, everything scalar.

pub(crate) mod algebra;
pub(crate) mod builtins;
pub(crate) mod calls;
pub(crate) mod check;
pub(crate) mod rows;
pub(crate) mod tensor;
pub(crate) mod text;
pub(crate) mod unroll;
use std::rc::Rc;

use super::{ModelError, Rounded, Shape, Surface, Tensor};
use crate::diagnostics::{Diagnostics, Fixable};
use crate::expr::Expr;
use crate::model::names::scope::{Hook, Reported, Scope, Value};
use crate::source::Span;
use crate::syntax::{self, ExprKind, Level};

/// Levels of expressions inside each other, through functions and local names: what the stack bears.
///
/// What stands between two levels is kept out of line: frames of one function would hold the locals of all.
const MAX_DEPTH: usize = 300;

/// A name that holds in a part of the model only.
pub(crate) enum Local<'e> {
    /// A loop index or an argument, with the text that stands for it.
    Value {
        name: String,
        value: Value<'e>,
        text: String,
    },
    /// A `let` in a region or loop; computed when first used.
    Let {
        statement: Rc<syntax::Named>,
        value: Lazy<'e>,
        frame: usize,
    },
}

/// A local `let` before and after its first use.
#[derive(Clone)]
pub(crate) enum Lazy<'e> {
    Waiting,
    Running,
    Done(Value<'e>),
    Failed,
}

/// The state of lowering one expression.
pub(crate) struct Lowering<'a, 'e> {
    pub scope: &'a Scope<'e>,
    pub hook: Option<&'a Hook<'a, 'e>>,
    pub diags: &'a mut Diagnostics,
    /// Local names, innermost last.
    pub locals: Vec<Local<'e>>,
    /// True in the body of a function, which sees the file only.
    pub in_function: bool,
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
            scope,
            hook,
            diags,
            locals: vec![],
            in_function: false,
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
        let Some(left) = self.scope.budget.get() else {
            return Err(Reported);
        };
        let rest = left.checked_sub(amount);
        self.scope.budget.set(rest);
        match rest {
            Some(_) => Ok(()),
            None => {
                let what = "the model".to_owned();
                self.error(ModelError::TooLarge { what, span })
            }
        }
    }

    pub fn constant(&self, value: f64) -> Expr<'e> {
        self.scope.exprs.constant(value)
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
            let text = self.written().at_level(expr, Level::Atom);
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
            ExprKind::String(_) => self.error(ModelError::Text { span: expr.span }),
            ExprKind::Name(name) => self.name(name, expr.span),
            ExprKind::Field(base, field) => self.field(expr, base, field),
            ExprKind::Index(base, indices) => self.index(base, indices, expr.span),
            ExprKind::Call(function, args) => calls::call(self, function, args, expr.span),
            ExprKind::Matrix(matrix) => self.matrix(matrix, expr.span).map(Value::from),
            ExprKind::Comprehension(body, binders) => self.comprehension(body, binders, expr.span),
            ExprKind::Negate(inner) => self.negate(inner),
            ExprKind::Binary(op, left, right) => self.power(*op, left, right),
            ExprKind::Chain(first, rest) => algebra::chain(self, first, rest).map(Value::from),
            ExprKind::Compare(first, rest) => self.compare(first, rest),
            ExprKind::Not(inner) => self.not(inner),
            ExprKind::And(members) => self.and(members),
            ExprKind::Or(members) => self.or(members),
            ExprKind::If(c, a, b) => self.choose(c, a, b),
        }
    }

    #[inline(never)]
    fn comprehension(
        &mut self,
        body: &syntax::Expr,
        binders: &[syntax::Binder],
        span: Span,
    ) -> Result<Value<'e>, Reported> {
        let mut data = vec![];
        self.for_each(binders, span, &mut |lowering| {
            data.push(lowering.scalar(body, "an entry of a comprehension")?);
            Ok(())
        })?;
        Ok(Tensor::vector(data).into())
    }

    #[inline(never)]
    fn negate(&mut self, inner: &syntax::Expr) -> Result<Value<'e>, Reported> {
        Ok(self.numbers(inner)?.map(|entry| -entry).into())
    }

    #[inline(never)]
    fn power(
        &mut self,
        op: syntax::BinaryOp,
        left: &syntax::Expr,
        right: &syntax::Expr,
    ) -> Result<Value<'e>, Reported> {
        // Both sides are looked at, so that mistakes in both are reported.
        let (a, b) = (self.numbers(left), self.numbers(right));
        algebra::binary(self, op, (&a?, left.span), (&b?, right.span)).map(Value::from)
    }

    /// not: 1 - a
    #[inline(never)]
    fn not(&mut self, inner: &syntax::Expr) -> Result<Value<'e>, Reported> {
        let inner = self.condition(inner)?;
        Ok(Value::condition(1.0 - inner))
    }

    /// and: Π a
    #[inline(never)]
    fn and(&mut self, members: &[syntax::Expr]) -> Result<Value<'e>, Reported> {
        let members = self.conditions(members)?;
        Ok(Value::condition(self.scope.exprs.product(members)))
    }

    /// or: 1 - Π (1 - a)
    #[inline(never)]
    fn or(&mut self, members: &[syntax::Expr]) -> Result<Value<'e>, Reported> {
        let members = self.conditions(members)?;
        let none = members.into_iter().map(|member| 1.0 - member);
        Ok(Value::condition(1.0 - self.scope.exprs.product(none)))
    }

    /// Several conditions; mistakes in all of them are reported.
    fn conditions(&mut self, members: &[syntax::Expr]) -> Result<Vec<Expr<'e>>, Reported> {
        let members: Vec<_> = members
            .iter()
            .map(|member| self.condition(member))
            .collect();
        members.into_iter().collect()
    }

    /// `if c then a else b`: b + c (a - b), or one of them when c is constant.
    #[inline(never)]
    fn choose(
        &mut self,
        condition: &syntax::Expr,
        a: &syntax::Expr,
        b: &syntax::Expr,
    ) -> Result<Value<'e>, Reported> {
        let c = self.condition(condition)?;
        if let Some(c) = c.as_constant() {
            return self.expr(if c > 0.5 { a } else { b });
        }
        let (first, second) = (self.expr(a), self.expr(b));
        let (first, second) = (first?, second?);
        if first.is_condition != second.is_condition {
            let span = if first.is_condition { a.span } else { b.span };
            return self.error(ModelError::BooleanAsNumber { span });
        }
        match first.tensor.zip(&second.tensor, |a, b| b + c * (a - b)) {
            Some(tensor) => {
                self.spend(tensor.data.len(), condition.span)?;
                Ok(Value {
                    tensor,
                    is_condition: first.is_condition,
                })
            }
            None => self.error(ModelError::Operands {
                operator: "if".to_owned(),
                left: first.tensor.shape.to_string(),
                right: second.tensor.shape.to_string(),
                left_span: a.span,
                right_span: b.span,
                help: Some("both branches must have one shape".to_owned()),
            }),
        }
    }
}

impl Local<'_> {
    pub fn name(&self) -> &str {
        match self {
            Local::Value { name, .. } => name,
            Local::Let { statement, .. } => &statement.name.name,
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
