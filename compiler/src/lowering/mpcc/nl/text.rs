//! Header and segments.

use rustc_hash::FxHashMap;

use super::expressions::{Writer, line, number};
use super::{Ampl, Linear, Program, RowKind};
use crate::expr::{Expr, Var};

/// The name of the objective.
const OBJECTIVE: &str = "cost";

impl<'e> Program<'e> {
    /// Orders variables and rows, and writes the file.
    pub(crate) fn write(self) -> Ampl {
        let in_rows = self.nonlinear_in(self.rows.iter().map(|row| &row.body));
        let in_objective = self.nonlinear_in([&self.objective].into_iter());
        let class = |variable: &usize| match (
            in_rows.contains(variable),
            in_objective.contains(variable),
        ) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (false, false) => 3,
        };
        let mut columns: Vec<usize> = (0..self.bounds.len()).collect();
        columns.sort_by_key(class);
        let is_linear = |row: &usize| self.rows[*row].body.nonlinear.is_empty();
        let mut rows: Vec<usize> = (0..self.rows.len()).collect();
        rows.sort_by_key(is_linear);

        let mut place = vec![0; columns.len()];
        for (column, &variable) in columns.iter().enumerate() {
            place[variable] = column;
        }
        let columns_of: FxHashMap<Var, usize> = (self.numbers.iter())
            .map(|(&var, &variable)| (var, place[variable]))
            .collect();
        let parts = self
            .rows
            .iter()
            .map(|row| &row.body)
            .chain([&self.objective]);
        let terms = parts.flat_map(|part| part.nonlinear.iter().map(|&(_, term)| term));
        let writer = Writer::new(columns_of, &terms.collect::<Vec<Expr>>());

        // The linear terms of a row, and 0 for what is in nonlinear ones.
        let gradient = |part: &Linear<'e>| -> Vec<(usize, f64)> {
            let mut entries: FxHashMap<usize, f64> = part.linear.clone();
            for variable in self.nonlinear_in([part].into_iter()) {
                entries.entry(variable).or_insert(0.0);
            }
            let placed = entries
                .into_iter()
                .map(|(variable, c)| (place[variable], c));
            let mut placed: Vec<(usize, f64)> = placed.collect();
            placed.sort_by_key(|&(column, _)| column);
            placed
        };
        let jacobian: Vec<Vec<(usize, f64)>> = rows
            .iter()
            .map(|&row| gradient(&self.rows[row].body))
            .collect();
        let objective = gradient(&self.objective);

        let mut out = String::new();
        let n_nonlinear = rows.iter().filter(|row| !is_linear(row)).count();
        let complementary = |linear: bool| {
            let is_pair = |row: &&super::Row| matches!(row.kind, RowKind::Complements(_));
            let pairs = self.rows.iter().filter(is_pair);
            pairs
                .filter(|row| row.body.nonlinear.is_empty() == linear)
                .count()
        };
        let (linear_pairs, nonlinear_pairs) = (complementary(true), complementary(false));
        let between = |is_one: fn(f64, f64) -> bool| {
            let is_one = |row: &&super::Row| match row.kind {
                RowKind::Between(lower, upper) => is_one(lower, upper),
                RowKind::Complements(_) => false,
            };
            self.rows.iter().filter(is_one).count()
        };
        let equations = between(|lower, upper| lower == upper);
        let ranges =
            between(|lower, upper| lower != upper && lower.is_finite() && upper.is_finite());
        let count = |wanted: usize| {
            columns
                .iter()
                .filter(|variable| class(variable) == wanted)
                .count()
        };
        let (both, only_rows, only_objective) = (count(0), count(1), count(2));
        // Variables of objectives alone come behind those of rows, which are then counted too.
        let objectives = match only_objective {
            0 => both,
            n => both + only_rows + n,
        };
        let nonzeros: usize = jacobian.iter().map(Vec::len).sum();
        line(&mut out, &format!("g3 1 1 0\t# problem {}", self.name));
        line(
            &mut out,
            &format!(
                " {} {} 1 {ranges} {equations}\t# vars, constraints, objectives, ranges, eqns",
                columns.len(),
                rows.len()
            ),
        );
        line(
            &mut out,
            &format!(
                " {n_nonlinear} {} {linear_pairs} {nonlinear_pairs} 0 0\t# nonlinear constrs, objs; ccons: lin, nonlin, nd, nzlb",
                usize::from(!self.objective.nonlinear.is_empty())
            ),
        );
        line(&mut out, " 0 0\t# network constraints: nonlinear, linear");
        line(
            &mut out,
            &format!(
                " {} {objectives} {both}\t# nonlinear vars in constraints, objectives, both",
                both + only_rows
            ),
        );
        line(
            &mut out,
            " 0 0 0 1\t# linear network variables; functions; arith, flags",
        );
        line(
            &mut out,
            " 0 0 0 0 0\t# discrete variables: binary, integer, nonlinear (b,c,o)",
        );
        line(
            &mut out,
            &format!(
                " {nonzeros} {}\t# nonzeros in Jacobian, gradients",
                objective.len()
            ),
        );
        let row_names = rows.iter().map(|&row| self.rows[row].name.clone());
        let row_names: Vec<String> = row_names.chain([OBJECTIVE.to_owned()]).collect();
        let column_names = columns.iter().map(|&variable| self.names[variable].clone());
        let column_names: Vec<String> = column_names.collect();
        let longest = |names: &[String]| names.iter().map(String::len).max().unwrap_or(0);
        line(
            &mut out,
            &format!(
                " {} {}\t# max name lengths: constraints, variables",
                longest(&row_names),
                longest(&column_names)
            ),
        );
        line(
            &mut out,
            &format!(
                " {} 0 0 0 0\t# common exprs: b,c,o,c1,o1",
                writer.n_defined()
            ),
        );

        writer.definitions(&mut out);
        for (i, &row) in rows.iter().enumerate() {
            let row = &self.rows[row];
            // The constant of an equation is its right-hand side.
            let constant = match row.kind {
                RowKind::Complements(_) => row.body.constant,
                RowKind::Between(..) => 0.0,
            };
            line(&mut out, &format!("C{i}"));
            writer.sum(constant, &row.body.nonlinear, &mut out);
        }
        line(&mut out, "O0 0");
        writer.sum(self.objective.constant, &self.objective.nonlinear, &mut out);
        line(&mut out, &format!("x{}", columns.len()));
        for (column, &variable) in columns.iter().enumerate() {
            line(
                &mut out,
                &format!("{column} {}", number(self.bounds[variable].guess)),
            );
        }
        line(&mut out, "r");
        for &row in &rows {
            let row = &self.rows[row];
            line(
                &mut out,
                &match row.kind {
                    RowKind::Complements(variable) => format!("5 1 {}", place[variable] + 1),
                    RowKind::Between(lower, upper) => {
                        let constant = row.body.constant;
                        between_text(0.0 - constant + lower, 0.0 - constant + upper)
                    }
                },
            );
        }
        line(&mut out, "b");
        for &variable in &columns {
            let bounds = self.bounds[variable];
            line(&mut out, &between_text(bounds.lower, bounds.upper));
        }
        let mut per_column = vec![0; columns.len()];
        for &(column, _) in jacobian.iter().flatten() {
            per_column[column] += 1;
        }
        line(&mut out, &format!("k{}", columns.len().saturating_sub(1)));
        let mut total = 0;
        for n in per_column.iter().take(columns.len().saturating_sub(1)) {
            total += n;
            line(&mut out, &total.to_string());
        }
        let segments = jacobian
            .iter()
            .enumerate()
            .map(|(i, entries)| (format!("J{i}"), entries));
        for (head, entries) in segments.chain([("G0".to_owned(), &objective)]) {
            if entries.is_empty() {
                continue;
            }
            line(&mut out, &format!("{head} {}", entries.len()));
            for &(column, coefficient) in entries {
                line(&mut out, &format!("{column} {}", number(coefficient)));
            }
        }
        Ampl {
            text: out,
            columns,
            rows,
            column_names,
            row_names,
        }
    }
}

/// Bounds of a row or variable.
fn between_text(low: f64, high: f64) -> String {
    let [lower, upper] = [low, high].map(number);
    match (low.is_finite(), high.is_finite()) {
        (true, true) if low == high => format!("4 {lower}"),
        (true, true) => format!("0 {lower} {upper}"),
        (false, true) => format!("1 {upper}"),
        (true, false) => format!("2 {lower}"),
        (false, false) => "3".to_owned(),
    }
}
