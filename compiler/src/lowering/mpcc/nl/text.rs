//! Header and segments.

use rustc_hash::FxHashMap;

use super::expressions::{Writer, line, number};
use super::{Ampl, Linear, Program, Row, RowKind};
use crate::expr::Expr;

/// The name of the objective.
const OBJECTIVE: &str = "cost";

impl<'e> Program<'e> {
    /// Orders variables and rows, and writes the file.
    pub(crate) fn write(self) -> Ampl {
        let ordered = Ordered::new(&self);
        let writer = ordered.writer();
        let row_names = ordered.rows().map(|row| row.name.clone());
        let row_names: Vec<String> = row_names.chain([OBJECTIVE.to_owned()]).collect();
        let column_names = ordered.columns.iter().map(|&v| self.names[v].clone());
        let column_names: Vec<String> = column_names.collect();
        let longest = |names: &[String]| names.iter().map(String::len).max().unwrap_or(0);
        let longest = [longest(&row_names), longest(&column_names)];
        let mut out = String::new();
        for text in ordered.header(longest, writer.n_defined()) {
            line(&mut out, &text);
        }
        writer.definitions(&mut out);
        ordered.nonlinear(&writer, &mut out);
        ordered.bounds(&mut out);
        ordered.gradients(&mut out);
        let Ordered { columns, rows, .. } = ordered;
        Ampl {
            text: out,
            columns,
            rows,
            column_names,
            row_names,
        }
    }

    /// The linear terms of a row by column, and 0 for what is in nonlinear ones.
    fn gradient(&self, part: &Linear<'e>, place: &[usize]) -> Gradient {
        let mut entries: FxHashMap<usize, f64> = part.linear.clone();
        for variable in self.nonlinear_in([part].into_iter()) {
            entries.entry(variable).or_insert(0.0);
        }
        let placed = entries.into_iter();
        let mut placed: Gradient = placed.map(|(variable, c)| (place[variable], c)).collect();
        placed.sort_by_key(|&(column, _)| column);
        placed
    }
}

/// Coefficients by column.
type Gradient = Vec<(usize, f64)>;

/// A program in the order of the format.
struct Ordered<'p, 'e> {
    program: &'p Program<'e>,
    /// How many variables are nonlinear in rows and the objective, in rows alone, and in the objective alone.
    classes: [usize; 3],
    columns: Vec<usize>,
    rows: Vec<usize>,
    /// The column of every variable.
    place: Vec<usize>,
    jacobian: Vec<Gradient>,
    /// The gradient of the objective.
    objective: Gradient,
}

impl<'p, 'e> Ordered<'p, 'e> {
    fn new(program: &'p Program<'e>) -> Self {
        let in_rows = program.nonlinear_in(program.rows.iter().map(|row| &row.body));
        let in_objective = program.nonlinear_in([&program.objective].into_iter());
        let class = |variable: &usize| match (
            in_rows.contains(variable),
            in_objective.contains(variable),
        ) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (false, false) => 3,
        };
        let mut columns: Vec<usize> = (0..program.bounds.len()).collect();
        columns.sort_by_key(class);
        let mut rows: Vec<usize> = (0..program.rows.len()).collect();
        rows.sort_by_key(|&row| program.rows[row].body.nonlinear.is_empty());
        let mut place = vec![0; columns.len()];
        for (column, &variable) in columns.iter().enumerate() {
            place[variable] = column;
        }
        let count = |wanted: usize| columns.iter().filter(|v| class(v) == wanted).count();
        let jacobian = rows.iter().map(|&row| &program.rows[row].body);
        Ordered {
            program,
            classes: [0, 1, 2].map(count),
            jacobian: jacobian
                .map(|body| program.gradient(body, &place))
                .collect(),
            objective: program.gradient(&program.objective, &place),
            columns,
            rows,
            place,
        }
    }

    fn rows(&self) -> impl Iterator<Item = &'p Row<'e>> {
        let program = self.program;
        self.rows.iter().map(|&row| &program.rows[row])
    }

    /// The writer of all nonlinear terms.
    fn writer(&self) -> Writer<'e> {
        let program = self.program;
        let numbers = program.numbers.iter();
        let columns = numbers.map(|(&var, &variable)| (var, self.place[variable]));
        let parts = program.rows.iter().map(|row| &row.body);
        let parts = parts.chain([&program.objective]);
        let terms = parts.flat_map(|part| part.nonlinear.iter().map(|&(_, term)| term));
        Writer::new(columns.collect(), &terms.collect::<Vec<Expr>>())
    }

    /// How much there is of what, with the longest names of rows and columns.
    fn header(&self, [row_name, column_name]: [usize; 2], n_defined: usize) -> [String; 10] {
        let count = |holds: &dyn Fn(&Row<'e>) -> bool| self.rows().filter(|row| holds(row)).count();
        let is_linear = |row: &Row<'e>| row.body.nonlinear.is_empty();
        let is_pair = |row: &Row<'e>| matches!(row.kind, RowKind::Complements(_));
        let n_nonlinear = count(&|row| !is_linear(row));
        let linear_pairs = count(&|row| is_pair(row) && is_linear(row));
        let nonlinear_pairs = count(&|row| is_pair(row) && !is_linear(row));
        let between = |holds: fn(f64, f64) -> bool| {
            count(&|row| match row.kind {
                RowKind::Between(lower, upper) => holds(lower, upper),
                RowKind::Complements(_) => false,
            })
        };
        let equations = between(|lower, upper| lower == upper);
        let ranges =
            between(|lower, upper| lower != upper && lower.is_finite() && upper.is_finite());
        let [both, only_rows, only_objective] = self.classes;
        let in_rows = both + only_rows;
        // Variables of objectives alone come behind those of rows, which are then counted too.
        let objectives = match only_objective {
            0 => both,
            n => in_rows + n,
        };
        let nonlinear_objectives = usize::from(!self.program.objective.nonlinear.is_empty());
        let (n_columns, n_rows) = (self.columns.len(), self.rows.len());
        let nonzeros: usize = self.jacobian.iter().map(Vec::len).sum();
        let gradients = self.objective.len();
        [
            format!("g3 1 1 0\t# problem {}", self.program.name),
            format!(
                " {n_columns} {n_rows} 1 {ranges} {equations}\t# vars, constraints, objectives, ranges, eqns"
            ),
            format!(
                " {n_nonlinear} {nonlinear_objectives} {linear_pairs} {nonlinear_pairs} 0 0\t# nonlinear constrs, objs; ccons: lin, nonlin, nd, nzlb"
            ),
            " 0 0\t# network constraints: nonlinear, linear".to_owned(),
            format!(
                " {in_rows} {objectives} {both}\t# nonlinear vars in constraints, objectives, both"
            ),
            " 0 0 0 1\t# linear network variables; functions; arith, flags".to_owned(),
            " 0 0 0 0 0\t# discrete variables: binary, integer, nonlinear (b,c,o)".to_owned(),
            format!(" {nonzeros} {gradients}\t# nonzeros in Jacobian, gradients"),
            format!(" {row_name} {column_name}\t# max name lengths: constraints, variables"),
            format!(" {n_defined} 0 0 0 0\t# common exprs: b,c,o,c1,o1"),
        ]
    }

    /// The nonlinear parts of the rows and the objective.
    fn nonlinear(&self, writer: &Writer<'e>, out: &mut String) {
        for (i, row) in self.rows().enumerate() {
            // The constant of an equation is its right-hand side.
            let constant = match row.kind {
                RowKind::Complements(_) => row.body.constant,
                RowKind::Between(..) => 0.0,
            };
            line(out, &format!("C{i}"));
            writer.sum(constant, &row.body.nonlinear, out);
        }
        let objective = &self.program.objective;
        line(out, "O0 0");
        writer.sum(objective.constant, &objective.nonlinear, out);
    }

    /// Guesses of variables, and bounds of rows and variables.
    fn bounds(&self, out: &mut String) {
        let columns = self.columns.iter().map(|&v| self.program.bounds[v]);
        line(out, &format!("x{}", self.columns.len()));
        for (column, bounds) in columns.clone().enumerate() {
            line(out, &format!("{column} {}", number(bounds.guess)));
        }
        line(out, "r");
        for row in self.rows() {
            let constant = row.body.constant;
            let text = match row.kind {
                RowKind::Complements(variable) => format!("5 1 {}", self.place[variable] + 1),
                RowKind::Between(lower, upper) => {
                    between_text(0.0 - constant + lower, 0.0 - constant + upper)
                }
            };
            line(out, &text);
        }
        line(out, "b");
        for bounds in columns {
            line(out, &between_text(bounds.lower, bounds.upper));
        }
    }

    /// The Jacobian and the gradient of the objective, behind the ends of the columns of the Jacobian.
    fn gradients(&self, out: &mut String) {
        let mut per_column = vec![0; self.columns.len()];
        for &(column, _) in self.jacobian.iter().flatten() {
            per_column[column] += 1;
        }
        let n_ends = self.columns.len().saturating_sub(1);
        line(out, &format!("k{n_ends}"));
        let mut total = 0;
        for n in per_column.iter().take(n_ends) {
            total += n;
            line(out, &total.to_string());
        }
        let segments = self.jacobian.iter().enumerate();
        let segments = segments.map(|(i, entries)| (format!("J{i}"), entries));
        for (head, entries) in segments.chain([("G0".to_owned(), &self.objective)]) {
            if entries.is_empty() {
                continue;
            }
            line(out, &format!("{head} {}", entries.len()));
            for &(column, coefficient) in entries {
                line(out, &format!("{column} {}", number(coefficient)));
            }
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
