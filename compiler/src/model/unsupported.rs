//! What the language has and this version does not lower yet: one error per construct.

use super::ModelError;
use crate::diagnostics::Diagnostics;
use crate::syntax::{DeclKind, Domain, Expr, ExprKind, NamedKind, RegionGuard, Stmt};

/// Reports a statement that cannot be lowered.
pub(super) fn check(stmt: &Stmt, diags: &mut Diagnostics) {
    if let Some(error) = refusal(stmt) {
        diags.push(error);
    }
}

/// True for a declaration whose name cannot be used either.
pub(super) fn is_refused(stmt: &Stmt) -> bool {
    !matches!(stmt, Stmt::Region(_)) && refusal(stmt).is_some()
}

fn refusal(stmt: &Stmt) -> Option<ModelError> {
    Some(match stmt {
        Stmt::Part(part) => ModelError::Parts { span: part.span },
        Stmt::Mechanics(mechanics) => ModelError::Mechanics {
            span: mechanics.span,
        },
        Stmt::Contact(contact) => ModelError::Mechanics { span: contact.span },
        Stmt::Jump(jump) => ModelError::Jumps { span: jump.span },
        Stmt::Project(project) => ModelError::Projections { span: project.span },
        Stmt::Program(program) => ModelError::Programs { span: program.span },
        Stmt::Equation { span, .. } | Stmt::Complementarity { span, .. } => {
            ModelError::Algebraic { span: *span }
        }
        Stmt::Decl(decl) if decl.kind == DeclKind::Algebraic => {
            ModelError::Algebraic { span: decl.span }
        }
        Stmt::Decl(decl) => match &decl.domain {
            Some(Domain::Set(_)) => ModelError::FiniteSets { span: decl.span },
            _ => return None,
        },
        Stmt::Switch(switch) if calls(&switch.value, "hysteresis") => ModelError::Hysteresis {
            span: switch.value.span,
        },
        Stmt::Named(named) if named.kind == NamedKind::Signal && calls(&named.value, "table") => {
            ModelError::Tables {
                span: named.value.span,
            }
        }
        Stmt::Region(region) => match &region.guard {
            RegionGuard::Indicator(indicator) => ModelError::Indicators {
                span: indicator.span,
            },
            _ => return None,
        },
        _ => return None,
    })
}

/// True for a call of a function of that name.
fn calls(expr: &Expr, name: &str) -> bool {
    matches!(&expr.kind, ExprKind::Call(function, _) if matches!(&function.kind, ExprKind::Name(n) if n == name))
}
