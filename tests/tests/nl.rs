//! AMPL files: what another reader makes of them.
//!
//! A small reader of the text, which shares nothing with the writer, finds the values of the rows again. With
//! NSDC_PEER_PYTHON set, CasADi reads the files too, and compares values and derivatives.

#![allow(
    clippy::print_stderr,
    reason = "a skipped comparison says so, and a run one says how close it is"
)]

mod reader;

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::process::Command;

use nsd_solver::integrate::tableau::Family;
use nsd_tests::with_experiment;
use nsdc::expr::Expr;
use nsdc::lowering::dcs::{Formulation, lower_as};
use nsdc::lowering::discretize::{
    Cross, Detection, Elements, Equilibration, Form, Grid, Options, discretize,
};
use nsdc::lowering::mpcc::{Ampl, Evaluator, Kind, Mpcc, Value};

use reader::{File, read};

/// All functions, time, a parameter, two switches that multiply each other, one that is a kink.
const MODEL: &str = "
model everything {
  param k = 2.5;
  state x = 0.3;
  state y = 0.2;
  let s = sign(x - 0.1*time);
  x' = k*s*sign(y) - x^3/(2 + y^2) + sin(x)*cos(y) + tan(x/3) + sqrt(1 + x^2);
  y' = exp(-x) - log(2 + y) + sinh(y/2)*cosh(x) + tanh(k*x) + asin(x/2) - acos(y/2) + atan(x*y)
     + atan2(y + 2, x + 3) + (1 + x)^y + (2 + y)^1.5 + abs(y) + max(x, y)^2 - 1/(1 + x)/(3 + y);
}
simulate run of everything { horizon 1; }
model smooth {
  state x = 1;
  x' = -x;
}
simulate decay of smooth { horizon 1; }
";

/// Calls `check` with programs of all kinds.
fn for_each(mut check: impl FnMut(&str, &Mpcc)) {
    let weight = 0.5;
    let kinds = [
        (
            Cross::All,
            Equilibration::Exact,
            None,
            (Family::RadauIia, 2),
        ),
        (
            Cross::SumTheta,
            Equilibration::Mean { weight },
            None,
            (Family::GaussLegendre, 2),
        ),
        (
            Cross::SumLambda,
            Equilibration::Tanh { weight, scale: 0.1 },
            Some(Form::Differential),
            (Family::RadauIia, 1),
        ),
        (
            Cross::SumBoth,
            Equilibration::None,
            None,
            (Family::LobattoIiic, 2),
        ),
    ];
    let grid = Grid {
        start: 0.0,
        horizon: 1.0,
        steps: 2,
    };
    for experiment in ["run", "decay"] {
        with_experiment(MODEL, experiment, |compiled| {
            for formulation in [Formulation::Stewart, Formulation::Step] {
                let dcs = lower_as(&compiled.system, formulation).expect("the model is small");
                for (i, &(cross, equilibration, form, scheme)) in kinds.iter().enumerate() {
                    let detection = Detection {
                        cross,
                        equilibration,
                        ..Detection::default()
                    };
                    let options = Options {
                        scheme,
                        form,
                        elements: Elements::Detected(detection),
                    };
                    let (mpcc, _) = discretize(&dcs, grid, &options).expect("the model is small");
                    check(&format!("{experiment}_{formulation}_{i}"), &mpcc);
                }
            }
        });
    }
}

/// Numbers between 0.1 and 0.9 that look random and are always the same.
fn scatter(n: usize) -> Vec<f64> {
    let number = |i: usize| {
        (43_758.545 * (12.9898 * (i as f64 + 1.0)).sin())
            .fract()
            .abs()
    };
    (0..n).map(|i| 0.1 + 0.8 * number(i)).collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * (1.0 + a.abs().max(b.abs()))
}

/// The values of columns at w: a slack is what its definition says.
fn point(ampl: &Ampl, w: &[f64]) -> Vec<f64> {
    let mut columns: Vec<f64> = ampl
        .columns
        .iter()
        .map(|&i| w.get(i).copied().unwrap_or(0.0))
        .collect();
    let file = read(&ampl.text, &columns);
    for (row, entries) in file.linear.iter().enumerate() {
        for &(column, coefficient) in entries {
            if ampl.columns[column] >= w.len() {
                assert_eq!(coefficient, -1.0, "a slack is what the rest of its row is");
                columns[column] = file.rows[row] - file.right_hand_side(row);
            }
        }
    }
    columns
}

/// What the file should say.
struct Expected {
    rows: Vec<f64>,
    objective: f64,
    /// By row and column; the last row is the gradient of the objective.
    jacobian: Vec<HashMap<usize, f64>>,
}

/// Values and gradients of all rows of a program at a point.
struct Evaluated<'m> {
    mpcc: &'m Mpcc<'m>,
    values: Vec<f64>,
    /// By column of the file.
    gradients: Vec<HashMap<usize, f64>>,
    /// The column of a variable, slacks behind all others.
    column_of: HashMap<usize, usize>,
}

impl<'m> Evaluated<'m> {
    fn at(mpcc: &'m Mpcc<'m>, ampl: &Ampl, w: &[f64]) -> Self {
        let mut evaluator = Evaluator::new(mpcc).expect("kernels are smooth");
        let pattern = evaluator.pattern().clone();
        let (mut values, mut entries) =
            (vec![0.0; mpcc.n_rows()], vec![0.0; pattern.columns.len()]);
        evaluator.values(w, &mut values);
        evaluator.jacobian(w, &mut entries);
        let column_of: HashMap<usize, usize> = (ampl.columns.iter().enumerate())
            .map(|(column, &variable)| (variable, column))
            .collect();
        let gradient = |row: usize| -> HashMap<usize, f64> {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            let variables = pattern.row(row).iter().zip(&entries[places]);
            variables
                .map(|(&variable, &entry)| (column_of[&(variable as usize)], entry))
                .collect()
        };
        Evaluated {
            mpcc,
            gradients: (0..mpcc.n_rows()).map(gradient).collect(),
            values,
            column_of,
        }
    }

    /// Rows in the order of the flat ones with their kinds, those of pairs with their other members.
    fn rows(&self) -> Vec<(Kind, usize, usize)> {
        let mut found = Vec::new();
        for (block, rows) in self.mpcc.rows() {
            let (n, half) = (block.n_places(), block.n_rows() / 2);
            let sources = 0..block.sources.len();
            let places = (0..n).flat_map(|p| sources.clone().map(move |s| rows.start + s * n + p));
            found.extend(places.map(|row| (block.kind, row, row + half)));
        }
        found
    }

    /// The objective with its gradient.
    fn objective(&self) -> (f64, HashMap<usize, f64>) {
        let (mut objective, mut gradient) = (0.0, HashMap::new());
        for (kind, row, _) in self.rows() {
            if matches!(kind, Kind::Objective | Kind::Steering) {
                objective += self.values[row];
                for (&column, entry) in &self.gradients[row] {
                    *gradient.entry(column).or_insert(0.0) += entry;
                }
            }
        }
        (objective, gradient)
    }

    /// The number of each row, or of both members of each pair.
    fn numbers(&self) -> Vec<(usize, Option<usize>)> {
        let rows = self.rows().into_iter();
        rows.filter_map(|(kind, row, other)| match kind {
            Kind::Equation | Kind::Inequality | Kind::Conditional => Some((row, None)),
            Kind::Pair => Some((row, Some(other))),
            Kind::Objective | Kind::Steering => None,
        })
        .collect()
    }
}

/// Which row of the program stands in a row of the file that may complement a variable, and whether a slack stands for the
/// other member of its pair.
fn body(
    row: Value,
    (a, b): (usize, Option<usize>),
    complement: Option<usize>,
    variable: impl Fn(Expr) -> Option<usize>,
) -> (usize, bool) {
    match (row, b, complement) {
        (Value::Pair(_, right), Some(_), Some(of)) if variable(right) == Some(of) => (a, false),
        (Value::Pair(left, _), Some(b), Some(of)) if variable(left) == Some(of) => (b, false),
        (Value::Pair(..), Some(_), Some(_)) => (a, true),
        (_, None, None) => (a, false),
        _ => panic!("a pair on one side alone"),
    }
}

/// Values and derivatives of the rows of the file by our own evaluation.
fn expected(mpcc: &Mpcc, ampl: &Ampl, w: &[f64], columns: &[f64], file: &File) -> Expected {
    let evaluated = Evaluated::at(mpcc, ampl, w);
    let (objective, objective_gradient) = evaluated.objective();
    let numbers = evaluated.numbers();
    let flat = mpcc.flat();
    let rows = flat.rows.iter();
    let rows = rows.filter(|row| !matches!(row.value, Value::Objective(_)));
    let members: Vec<Value> = rows.map(|row| row.value).collect();
    let variable = |member: Expr| {
        let mut variables = flat.variables.iter();
        variables.position(|&variable| variable == member)
    };

    let mut found = BTreeMap::new();
    let mut with_slack: Vec<usize> = Vec::new();
    let of_rows = ampl.rows.iter().enumerate();
    let (of_program, of_slacks): (Vec<_>, Vec<_>) =
        of_rows.partition(|(_, id)| **id < numbers.len());
    for (row, &id) in of_program {
        let complement = file.complement(row).map(|column| ampl.columns[column]);
        let (body, has_slack) = body(members[id], numbers[id], complement, variable);
        with_slack.extend(has_slack.then_some(id));
        let gradient = evaluated.gradients[body].clone();
        found.insert(row, (evaluated.values[body], gradient));
    }
    with_slack.sort_unstable();
    for (row, &id) in of_slacks {
        let pair = with_slack[id - numbers.len()];
        let b = numbers[pair].1.expect("only pairs have slacks");
        let slack = mpcc.n_variables() + id - numbers.len();
        let column = evaluated.column_of[&slack];
        let mut gradient = evaluated.gradients[b].clone();
        gradient.insert(column, -1.0);
        found.insert(row, (evaluated.values[b] - columns[column], gradient));
    }
    assert_eq!(found.len(), ampl.rows.len());
    let (rows, mut jacobian): (Vec<_>, Vec<_>) = found.into_values().unzip();
    jacobian.push(objective_gradient);
    Expected {
        rows,
        objective,
        jacobian,
    }
}

#[test]
fn rows_are_found_again() {
    for_each(|name, mpcc| {
        let ampl = mpcc.nl();
        let w = scatter(mpcc.n_variables());
        let columns = point(&ampl, &w);
        let file = read(&ampl.text, &columns);
        let expected = expected(mpcc, &ampl, &w, &columns, &file);
        for (row, &value) in expected.rows.iter().enumerate() {
            let found = file.rows[row] - file.right_hand_side(row);
            assert!(
                close(found, value),
                "{name}: row {row} is {found}, not {value}"
            );
            if let Some(column) = file.complement(row) {
                assert_eq!(file.bounds[column], ["2", "0"], "{name}: column {column}");
            }
        }
        assert!(
            close(file.objective, expected.objective),
            "{name}: {}",
            file.objective
        );
        // The file has every derivative that is not zero, and each variable complements one row.
        for (row, gradient) in expected.jacobian.iter().enumerate() {
            let entries = file.linear.get(row).unwrap_or(&file.gradient);
            let found: Vec<usize> = entries.iter().map(|&(column, _)| column).collect();
            assert!(found.is_sorted(), "{name}: row {row}");
            assert!(
                found.iter().all(|c| gradient.contains_key(c)),
                "{name}: row {row}"
            );
            let mut missing = gradient
                .iter()
                .filter(|(column, _)| !found.contains(column));
            assert!(missing.all(|(_, &entry)| entry == 0.0), "{name}: row {row}");
        }
        let complements: Vec<usize> = (0..file.rows.len())
            .filter_map(|row| file.complement(row))
            .collect();
        let distinct: std::collections::HashSet<_> = complements.iter().collect();
        assert_eq!(distinct.len(), complements.len(), "{name}");
        assert_eq!(complements.len(), mpcc.sizes().pairs, "{name}");
    });
}

#[test]
fn headers_count_what_is_there() {
    for_each(|name, mpcc| {
        let ampl = mpcc.nl();
        let file = read(&ampl.text, &scatter(ampl.columns.len()));
        let [n, m] = [ampl.columns.len(), ampl.rows.len()];
        let pairs = mpcc.sizes().pairs;
        let head = &file.header;
        assert_eq!(head[1], [n, m, 1, 0, m - pairs], "{name}");
        let nonlinear = head[2][0];
        assert!(
            file.is_constant[..nonlinear]
                .iter()
                .all(|constant| !constant),
            "{name}"
        );
        assert!(
            file.is_constant[nonlinear..]
                .iter()
                .all(|&constant| constant),
            "{name}"
        );
        assert_eq!(head[2][2] + head[2][3], pairs, "{name}");
        let [in_rows, in_objective, both] = [head[4][0], head[4][1], head[4][2]];
        assert!(both <= in_rows.min(in_objective), "{name}");
        let last = file
            .used
            .iter()
            .rposition(|&used| used)
            .map_or(0, |last| last + 1);
        assert_eq!(last, in_rows.max(in_objective), "{name}");
        assert!(file.used[..last].iter().all(|&used| used), "{name}");
        assert_eq!(
            head[7][0],
            file.linear.iter().map(Vec::len).sum::<usize>(),
            "{name}"
        );
        assert_eq!(head[7][1], file.gradient.len(), "{name}");
        assert_eq!(head[9][0], file.n_defined, "{name}");
        let below = |column: usize| {
            let columns = file.linear.iter().flatten().map(|&(column, _)| column);
            columns.filter(|&c| c < column).count()
        };
        let counts: Vec<usize> = (1..n).map(below).collect();
        assert_eq!(file.cumulative, counts, "{name}");
        let guesses = mpcc.bounds();
        for (column, &variable) in ampl.columns.iter().enumerate() {
            let guess = guesses.get(variable).map_or(0.0, |bounds| bounds.guess);
            assert_eq!(file.guesses[column], guess, "{name}: column {column}");
        }
    });
}

/// One step of implicit Euler for a relay: pairs of sums, two of them with a slack.
#[test]
fn a_small_file() {
    let model = "model m { param k = 2; state x = 1; x' = -k*sign(x); }
      simulate run of m { horizon 1; }";
    let detection = Detection {
        cross: Cross::SumBoth,
        ..Detection::default()
    };
    let options = Options {
        scheme: (Family::RadauIia, 1),
        form: None,
        elements: Elements::Detected(detection),
    };
    let grid = Grid {
        start: 0.0,
        horizon: 1.0,
        steps: 1,
    };
    with_experiment(model, "run", |compiled| {
        let dcs = lower_as(&compiled.system, Formulation::Step).expect("the model is small");
        let (mpcc, _) = discretize(&dcs, grid, &options).expect("the model is small");
        insta::assert_snapshot!("small", mpcc.nl().text);
    });
}

#[test]
fn casadi_reads_the_same_program() {
    let Some(python) = std::env::var_os("NSDC_PEER_PYTHON") else {
        eprintln!("skipped: NSDC_PEER_PYTHON does not name a Python interpreter with casadi");
        return;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/read_nl.py");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    for_each(|name, mpcc| {
        let ampl = mpcc.nl();
        let w = scatter(mpcc.n_variables());
        let columns = point(&ampl, &w);
        let file = read(&ampl.text, &columns);
        let expected = expected(mpcc, &ampl, &w, &columns, &file);
        let entries =
            |row: &HashMap<usize, f64>| row.iter().map(|(&c, &v)| (c, v)).collect::<Vec<_>>();
        let values = serde_json::json!({
            "x": columns,
            "rows": expected.rows,
            "objective": expected.objective,
            "jacobian": expected.jacobian.iter().map(entries).collect::<Vec<_>>(),
        });
        let [program, point] = ["nl", "json"].map(|ending| folder.join(format!("{name}.{ending}")));
        std::fs::write(&program, &ampl.text).expect("the folder of the tests is writable");
        std::fs::write(&point, values.to_string()).expect("the folder of the tests is writable");
        let ran = Command::new(&python)
            .arg(&script)
            .arg(&program)
            .arg(&point)
            .output();
        let ran = ran.expect("NSDC_PEER_PYTHON is an interpreter");
        let text = String::from_utf8_lossy(&ran.stdout);
        assert!(
            ran.status.success(),
            "{name}: {text}{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        eprintln!("{name}: {}", text.trim());
    });
}
