//! Values of expressions over the names of a model.

use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::expressions::Lowering;
use crate::model::names::scope::{Hook, Scope};
use crate::model::names::target;
use crate::model::{Shape, Target, Tensor};
use crate::syntax;

impl<'e> Scope<'e> {
    /// The value of an expression over the model; `hook` is asked first about names and calls.
    pub fn expr(
        &self,
        expr: &syntax::Expr,
        hook: Option<&Hook<'_, 'e>>,
        diags: &mut Diagnostics,
    ) -> Option<Tensor<'e>> {
        Lowering::new(self, hook, diags).numbers(expr).ok()
    }

    /// The value of an expression, in a shape: itself or a repeated scalar.
    ///
    /// `what` names the thing that gets it, as in "initial value of `x`".
    pub fn expr_as(
        &self,
        expr: &syntax::Expr,
        shape: Shape,
        what: &str,
        hook: Option<&Hook<'_, 'e>>,
        diags: &mut Diagnostics,
    ) -> Option<Tensor<'e>> {
        Lowering::new(self, hook, diags)
            .numbers_as(expr, shape, what)
            .ok()
    }

    /// A condition as a number in [0, 1].
    pub fn condition(
        &self,
        expr: &syntax::Expr,
        hook: Option<&Hook<'_, 'e>>,
        diags: &mut Diagnostics,
    ) -> Option<Expr<'e>> {
        Lowering::new(self, hook, diags).condition(expr).ok()
    }

    /// The entries of an expression without variables: structural constants and numbers only.
    pub fn constants(
        &self,
        expr: &syntax::Expr,
        what: &str,
        diags: &mut Diagnostics,
    ) -> Option<Vec<f64>> {
        let mut lowering = Lowering::new(self, None, diags);
        let value = lowering.numbers(expr).ok()?;
        lowering.as_constants(&value, what, expr.span).ok()
    }

    /// What a path names: `x`, `x[2]`, `k`, `s.sliding`.
    pub fn target(&self, path: &syntax::Path, diags: &mut Diagnostics) -> Option<Target> {
        target::resolve(&mut Lowering::new(self, None, diags), path).ok()
    }
}
