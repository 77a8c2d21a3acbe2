//! A system as a `.nsd` file with one experiment, `run`.

use std::fmt::Write as _;

use nalgebra::{DMatrix, DVector};

use super::{Affine, Form, Kind, Surface};

impl Affine {
    /// With an experiment at a tolerance. Surface i has the name `psi1`, `psi2`, ... in trajectories.
    pub fn text(&self, tolerance: f64) -> String {
        let (model, horizon) = (self.model(), self.horizon);
        format!(
            "model m {{\n{model}}}\nsimulate run of m {{ horizon {horizon}; tolerance {tolerance:e}; }}\n"
        )
    }

    /// What stands between the braces of the model.
    pub fn model(&self) -> String {
        let mut text = format!("  state x[{}] = {};\n", self.n, vector(&self.start));
        for (i, surface) in self.surfaces.iter().enumerate() {
            let (x, constant, time) = (
                surface.normal.rows(0, self.n).into_owned(),
                surface.normal[self.n],
                surface.normal[self.n + 1],
            );
            let i = i + 1;
            let x = vector(&x);
            let _ = writeln!(
                text,
                "  let psi{i} = dot({x}, x) + {constant} + {time}*time;"
            );
        }
        text += &match self.form {
            // Only of surfaces that do not depend on each other do all combinations of sides occur.
            Form::Regions if self.has_independent_surfaces() => self.regions(),
            Form::Regions | Form::Terms => self.terms(),
            Form::Mixed => self.mixed(),
        };
        text
    }

    /// Whether the gradients of all surfaces, in states and time, are linearly independent.
    fn has_independent_surfaces(&self) -> bool {
        let m = self.surfaces.len();
        let gradients = DMatrix::from_fn(m, self.n + 1, |i, k| {
            let normal = &self.surfaces[i].normal;
            if k < self.n {
                normal[k]
            } else {
                normal[self.n + 1]
            }
        });
        m <= self.n + 1 && gradients.rank(1e-9) == m
    }

    fn regions(&self) -> String {
        let mut text = String::new();
        let m = self.surfaces.len();
        for combination in 0..1_usize << m {
            let above = |i: usize| combination >> i & 1 == 1;
            let mut field = self.field.clone();
            for (i, surface) in self.surfaces.iter().enumerate() {
                field += if above(i) { 1.0 } else { -1.0 } * &surface.jump;
            }
            let guard = |i: usize| format!("psi{} {} 0", i + 1, if above(i) { ">" } else { "<" });
            let guards = (0..m).map(guard).collect::<Vec<_>>().join(" and ");
            let field = affine(&field);
            let _ = writeln!(
                text,
                "  region r{combination} where {guards} {{ x' = {field}; }}"
            );
        }
        text
    }

    fn terms(&self) -> String {
        let mut text = format!("  x' = {}", affine(&self.field));
        for (i, surface) in self.surfaces.iter().enumerate() {
            let _ = write!(text, "\n    + {}", term(i + 1, surface));
        }
        text + ";\n"
    }

    fn mixed(&self) -> String {
        let mut text = String::new();
        for (name, comparison, side) in [("up", ">", 1.0), ("down", "<", -1.0)] {
            let field = affine(&(&self.field + side * &self.surfaces[0].jump));
            let _ = writeln!(
                text,
                "  region {name} where psi1 {comparison} 0 {{ x' = {field}; }}"
            );
        }
        for (i, surface) in self.surfaces.iter().enumerate().skip(1) {
            let i = i + 1;
            if i % 2 == 0 {
                let jump = affine(&surface.jump);
                let _ = writeln!(text, "  x' += -({jump});");
                let _ = writeln!(
                    text,
                    "  region more{i} where psi{i} > 0 {{ x' += 2*({jump}); }}"
                );
            } else {
                let _ = writeln!(text, "  x' += {};", term(i, surface));
            }
        }
        text
    }
}

/// s J z of surface i, in one of the ways to write it.
fn term(i: usize, surface: &Surface) -> String {
    let jump = affine(&surface.jump);
    if surface.kind == Kind::Kink {
        let row = surface.normal.iamax();
        let slope = surface.jump.column(row) / surface.normal[row];
        return format!("{}*abs(psi{i})", vector(&slope.into_owned()));
    }
    match i % 3 {
        0 => format!("({jump})*(2*step(psi{i}) - 1)"),
        1 => format!("({jump})*sign(psi{i})"),
        _ => format!("(if psi{i} > 0 then {jump} else -({jump}))"),
    }
}

/// `[..; ..]*x + [..] + [..]*time`, exactly.
fn affine(field: &DMatrix<f64>) -> String {
    let n = field.nrows();
    let rows = field.columns(0, n);
    let rows: Vec<String> = rows.row_iter().map(|row| list(row.iter())).collect();
    let column = |j: usize| vector(&field.column(j).into_owned());
    format!(
        "[{}]*x + {} + {}*time",
        rows.join("; "),
        column(n),
        column(n + 1)
    )
}

fn vector(x: &DVector<f64>) -> String {
    format!("[{}]", list(x.iter()))
}

fn list<'a>(numbers: impl Iterator<Item = &'a f64>) -> String {
    numbers.map(f64::to_string).collect::<Vec<_>>().join(", ")
}
