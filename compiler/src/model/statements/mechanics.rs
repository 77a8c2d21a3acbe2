//! `mechanics q, v { .. }` and `contact C { .. }`.
//!
//! M v' = f + J_n λ_n + J_t λ_t: v' = M⁻¹ f is dynamics as any other; contacts keep what their forces are made
//! of, for when they are lowered.

use super::dynamics::Walk;
use super::restitution;
use crate::diagnostics::counted;
use crate::expr::Expr;
use crate::model::expressions::{Lowering, algebra};
use crate::model::names::scope::{Meaning, Reported};
use crate::model::names::target;
use crate::model::{Body, Contact, DynamicsError, Rate, Shape, Target, TargetKind, Tensor};
use crate::source::Span;
use crate::syntax::{self, Setting};

/// Symbolic matrices up to this size are inverted by Cramer's rule, larger ones by elimination.
const MAX_CRAMER: usize = 3;

/// Directions of a surface in space.
const MAX_SLIPS: usize = 2;

/// Rows of a matrix in a help.
const MAX_SHOWN: usize = 6;

/// What a block and a contact consist of.
const FORM: &str = "write `mechanics q, v { mass = M; force = f; }`, and `contact C { gap = c; restitution = e; }` with \
     `friction = mu; slip = w;` where it is rough, in space `slip = [w1, w2];`";

impl<'e> Walk<'e> {
    /// One block: the dynamics of its velocities, and the contacts inside.
    pub(crate) fn mechanics(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        mechanics: &syntax::Mechanics,
    ) -> Result<(), Reported> {
        let body = self.body(lowering, mechanics);
        if body.is_err() {
            let name = &mechanics.v.head.name;
            self.touched
                .insert(format!("{}{name}", lowering.names.scope.prefix));
        }
        let velocities = body.as_ref().ok().map(|body| body.velocities.clone());
        let mut result = body.map(|body| self.found.bodies.push(body));
        for contact in &mechanics.contacts {
            result = result.and(self.contact(lowering, contact, velocities.as_deref()));
        }
        result
    }

    fn body(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        mechanics: &syntax::Mechanics,
    ) -> Result<Body<'e>, Reported> {
        let span = mechanics.span;
        let [mass, force] = options(lowering, &mechanics.options, ["mass", "force"])?;
        let mass = required(lowering, mass, "mass", span)?;
        let force = required(lowering, force, "force", span)?;
        let q = self.states(lowering, &mechanics.q)?;
        let v = self.states(lowering, &mechanics.v)?;
        let n = v.entries.len();
        let force = lowering.numbers_as(&force.value, v.shape, "`force`")?;
        let matrix = lowering.numbers(&mass.value)?;
        let matrix = match matrix.as_scalar() {
            Some(mass) => diagonal(lowering, n, mass),
            None if matrix.shape == Shape::Matrix(n, n) => matrix,
            None => {
                let what = format!("`mass` is {}, not a matrix of {n} by {n}", matrix.shape);
                let help = "write a row and a column for each velocity, or a number where all have the same mass";
                return wrong(lowering, (what, help), mass.value.span);
            }
        };
        let inverse = inverse(lowering, &matrix, mass.value.span)?;
        let first = self.offset(&v);
        let velocities: Vec<usize> = v.entries.iter().map(|&entry| first + entry).collect();
        for (i, &entry) in velocities.iter().enumerate() {
            let row = (0..n).map(|j| inverse[i * n + j] * force.data[j]);
            self.found.dynamics.push(Rate {
                entry,
                value: lowering.names.scope.exprs.sum(row),
                adds: false,
                span,
            });
        }
        let first = self.offset(&q);
        Ok(Body {
            positions: q.entries.iter().map(|&entry| first + entry).collect(),
            velocities,
            mass: matrix.data,
            inverse,
            force: force.data,
            span,
        })
    }

    /// One contact; `velocities` are those of the block around it.
    pub(crate) fn contact(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        contact: &syntax::Contact,
        velocities: Option<&[usize]>,
    ) -> Result<(), Reported> {
        let span = contact.span;
        let names = ["gap", "restitution", "friction", "slip", "along"];
        let [gap, restitution, friction, slip, along] = options(lowering, &contact.options, names)?;
        let gap = required(lowering, gap, "gap", span)?;
        let restitution = required(lowering, restitution, "restitution", span)?;
        let gap_value = lowering.scalar(&gap.value, "a gap");
        let restitution = restitution::read(lowering, &restitution.value);
        let friction = friction.map(|friction| {
            let value = lowering.scalar(&friction.value, "a coefficient of friction");
            value.map(|value| (value, friction.value.span))
        });
        let friction = friction.transpose()?;
        let slip = match (slip, along) {
            (Some(_), Some(along)) => {
                let what = "`slip` and `along` say the same".to_owned();
                return wrong(lowering, (what, "leave out one of them"), along.span);
            }
            (Some(slip), None) => {
                let value = lowering.numbers(&slip.value)?;
                (value.data, slip.value.span)
            }
            (None, Some(along)) => self.along(lowering, along, velocities)?,
            (None, None) => (Vec::new(), span),
        };
        if slip.0.len() > MAX_SLIPS {
            let what = format!("a surface has no {} directions", slip.0.len());
            let help = "write `slip = [w1, w2];`, the velocities along two directions at right angles, or `slip = w;` where a body moves in a plane";
            return wrong(lowering, (what, help), slip.1);
        }
        let name = self.indexed(&contact.name.name);
        self.found.contacts.push(Contact {
            name: format!("{}{name}", lowering.names.scope.prefix),
            gap: gap_value?,
            gap_span: gap.value.span,
            restitution: restitution?,
            friction,
            slip,
            span,
        });
        Ok(())
    }

    /// Dᵀv of `along = D`, a vector, or a matrix with two columns.
    fn along(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        along: &Setting,
        velocities: Option<&[usize]>,
    ) -> Result<(Vec<Expr<'e>>, Span), Reported> {
        let span = along.value.span;
        let Some(velocities) = velocities else {
            let what = "`along` belongs to a contact inside `mechanics`".to_owned();
            let help = "write the velocity itself, `slip = w;`, or `slip = [w1, w2];` in space";
            return wrong(lowering, (what, help), along.span);
        };
        let directions = lowering.numbers(&along.value)?;
        let n = velocities.len();
        let (rows, columns, word) = match directions.shape {
            Shape::Matrix(rows, columns) => (rows, columns, "row"),
            _ => (directions.data.len(), 1, "entry"),
        };
        if rows != n {
            let found = counted(rows, word);
            let what = format!("`along` has {found}, and there are {n} velocities");
            // What has a column for each velocity lies on its side.
            let directions = if columns == n { rows } else { columns };
            let help = form_of_along(n, directions.min(MAX_SLIPS));
            return wrong(lowering, (what, &help), span);
        }
        let column = |k: usize| {
            let entries = directions.data.iter().skip(k).step_by(columns);
            let terms = velocities.iter().zip(entries);
            let terms = terms.map(|(&v, &d)| self.vars[v] * d);
            lowering.names.scope.exprs.sum(terms)
        };
        Ok(((0..columns).map(column).collect(), span))
    }

    /// The entries of a state that a path names.
    pub(crate) fn states(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        path: &syntax::Path,
    ) -> Result<Target, Reported> {
        let meaning = lowering.names.scope.get(&path.head.name);
        if let Some(Meaning::Part(_) | Meaning::Parts(_)) = meaning {
            let (part, span) = (path.head.name.clone(), path.span);
            return lowering.error(DynamicsError::OfAPart { part, span });
        }
        let target = target::resolve(lowering, path)?;
        match target.kind {
            TargetKind::State(_) => Ok(target),
            kind => lowering.error(DynamicsError::not_a_state(path, kind.word())),
        }
    }

    pub(crate) fn offset(&self, target: &Target) -> usize {
        match target.kind {
            TargetKind::State(state) => self.offsets[state],
            _ => 0,
        }
    }
}

/// The options of a block by name, each at most once.
fn options<'s, const N: usize>(
    lowering: &mut Lowering<'_, '_>,
    given: &'s [Setting],
    names: [&str; N],
) -> Result<[Option<&'s Setting>; N], Reported> {
    let mut found = [None; N];
    for setting in given {
        let name = &setting.name.name;
        let Some(place) = names.iter().position(|known| known == name) else {
            let what = format!("there is no option `{name}`");
            let known: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            let help = format!("there are {}", known.join(", "));
            return wrong(lowering, (what, &help), setting.name.span);
        };
        if found[place].replace(setting).is_some() {
            let what = format!("`{name}` is given twice");
            return wrong(lowering, (what, "leave out one of them"), setting.name.span);
        }
    }
    Ok(found)
}

fn required<'s>(
    lowering: &mut Lowering<'_, '_>,
    option: Option<&'s Setting>,
    name: &str,
    span: Span,
) -> Result<&'s Setting, Reported> {
    match option {
        Some(option) => Ok(option),
        None => wrong(lowering, (format!("`{name}` is missing"), FORM), span),
    }
}

/// Says what is wrong, and what to do about it.
fn wrong<T>(
    lowering: &mut Lowering<'_, '_>,
    (what, help): (String, &str),
    span: Span,
) -> Result<T, Reported> {
    let help = help.to_owned();
    lowering.error(DynamicsError::MechanicsForm { what, help, span })
}

/// How `along` is written for so many velocities and directions.
fn form_of_along(velocities: usize, directions: usize) -> String {
    let rule = "write a row for each velocity and a column for each direction";
    if velocities > MAX_SHOWN {
        return rule.to_owned();
    }
    let row = |i: usize| {
        let entries = (0..directions).map(|k| if i == k { "1" } else { "0" });
        entries.collect::<Vec<_>>().join(", ")
    };
    let separator = if directions == 1 { ", " } else { "; " };
    let rows = (0..velocities).map(row).collect::<Vec<_>>();
    format!("{rule}, as in `along = [{}];`", rows.join(separator))
}

/// m I
fn diagonal<'e>(lowering: &Lowering<'_, 'e>, n: usize, mass: Expr<'e>) -> Tensor<'e> {
    let zero = lowering.constant(0.0);
    let entry = |k: usize| if k / n == k % n { mass } else { zero };
    Tensor {
        shape: Shape::Matrix(n, n),
        data: (0..n * n).map(entry).collect(),
    }
}

/// M⁻¹ of a positive definite M.
fn inverse<'e>(
    lowering: &mut Lowering<'_, 'e>,
    mass: &Tensor<'e>,
    span: Span,
) -> Result<Vec<Expr<'e>>, Reported> {
    let n = mass.shape.size().0;
    let is_diagonal = (0..n * n).all(|k| k / n == k % n || mass.data[k].is_zero());
    if !is_diagonal && (n <= MAX_CRAMER || mass.constants().is_some()) {
        return Ok(algebra::inverse(lowering, mass, span)?.data);
    }
    if (0..n).any(|i| mass.at(i, i).is_zero()) {
        let what = "`mass` is singular".to_owned();
        let help = "give every velocity a mass: the matrix is positive definite";
        return wrong(lowering, (what, help), span);
    }
    lowering.spend(n.pow(3), span)?;
    // Elimination without exchanges, which a positive definite matrix does not need.
    let (mut a, one) = (mass.data.clone(), lowering.constant(1.0));
    let mut inverse = diagonal(lowering, n, one).data;
    for column in 0..n {
        let pivot = a[column * n + column];
        for k in 0..n {
            a[column * n + k] = a[column * n + k] / pivot;
            inverse[column * n + k] = inverse[column * n + k] / pivot;
        }
        for row in (0..n).filter(|&row| row != column) {
            let factor = a[row * n + column];
            if factor.is_zero() {
                continue;
            }
            for k in 0..n {
                a[row * n + k] = a[row * n + k] - factor * a[column * n + k];
                inverse[row * n + k] = inverse[row * n + k] - factor * inverse[column * n + k];
            }
        }
    }
    Ok(inverse)
}
