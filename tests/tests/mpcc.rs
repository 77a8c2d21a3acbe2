//! Two roads through finite elements: a run by active sets, and the rows of the discretized program.
//!
//! With the members of pairs that are zero in each element given, the rows are a system of equations. It has one
//! solution near the true one, and that is the solution of the run.

use nalgebra::{DMatrix, DVector};
use nsd_solver::integrate::tableau::{Family, Tableau};
use nsd_tests::{end, run, with_experiment};
use nsdc::lowering::dcs::{Formulation, lower_as};
use nsdc::lowering::discretize::{
    Cross, Detection, Elements, Equilibration, Form, Grid, Layout, Options, discretize,
};
use nsdc::lowering::mpcc::{Bounds, Evaluator, Kind, Mpcc};

const HORIZON: f64 = 2.0;

/// x reaches 0, from above, and slides from then on, where sign(x) = sin(t)/2; y feels it.
fn model(method: &str) -> String {
    format!(
        "model slider {{
           state x = 0.3;
           state y = 0.5;
           let s = sign(x);
           x' = -s + 0.5*sin(time);
           y' = s - y^2 + x*y;
         }}
         simulate run of slider {{ horizon {HORIZON}; {method} output y; }}"
    )
}

/// x before it reaches 0.
fn falling(t: f64) -> f64 {
    0.3 - t + 0.5 * (1.0 - t.cos())
}

/// When it does, by bisection.
fn reached() -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle: f64 = 0.5 * (low + high);
        if falling(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// A point near the solution: x is exact, y constant.
fn guess(mpcc: &Mpcc, layout: &Layout, nodes: &[f64]) -> Vec<f64> {
    let names = mpcc.names();
    let mut w: Vec<f64> = mpcc.bounds().iter().map(|bounds| bounds.guess).collect();
    let step = HORIZON / layout.steps as f64;
    let switch = reached();
    for k in 1..=layout.steps {
        let mut start = step * (k as f64 - 1.0);
        for j in 1..=layout.elements {
            let inside = (start.max(step * (k as f64 - 1.0))..step * k as f64).contains(&switch);
            let h = match (inside, j) {
                (true, 1) => switch - start,
                (true, _) => (step * k as f64 - switch) / (layout.elements - 1) as f64,
                _ => step / layout.elements as f64,
            };
            w[layout.h(k, j)] = h;
            w[layout.t(k, j).expect("the model depends on time")] = start;
            let slides = start + 0.5 * h > switch;
            for m in 1..=layout.end {
                let t = start + nodes.get(m - 1).copied().unwrap_or(1.0) * h;
                let x = if slides { 0.0 } else { falling(t) };
                w[layout.x(k, j, m)] = x;
                for i in 0..layout.n_algebraics() {
                    let Some(z) = layout.z(k, j, m, i) else {
                        continue;
                    };
                    let alpha = if slides { 0.5 + 0.25 * t.sin() } else { 1.0 };
                    w[z] = match names[z].split('[').next().unwrap_or("") {
                        "theta" if names[z].contains("-]") => 1.0 - alpha,
                        "theta" | "alpha" => alpha,
                        "lambda" if names[z].contains("-]") => 2.0 * x,
                        "lambda_p" => x,
                        "lambda" | "lambda_n" => 0.0,
                        _ => -x,
                    };
                }
            }
            start += h;
        }
    }
    w
}

/// Solves the rows by Newton's method, with the smaller member of each pair at the guess equal to zero.
///
/// Members are sums of terms that are not negative, so each of them is zero. The system has more rows than unknowns and
/// is consistent; it must determine all of them.
fn solve(mpcc: &Mpcc, mut w: Vec<f64>) -> Vec<f64> {
    let mut evaluator = Evaluator::new(mpcc).expect("kernels are smooth");
    let pattern = evaluator.pattern().clone();
    let (mut values, mut entries) = (vec![0.0; mpcc.n_rows()], vec![0.0; pattern.columns.len()]);
    evaluator.values(&w, &mut values);
    evaluator.jacobian(&w, &mut entries);
    let bounds = mpcc.bounds();
    let mut is_free: Vec<bool> = bounds.iter().map(|bounds| !bounds.is_fixed()).collect();
    let (mut equations, mut pairs) = (Vec::new(), Vec::new());
    for (block, rows) in mpcc.rows() {
        let half = block.n_rows() / 2;
        match block.kind {
            Kind::Equation => equations.extend(rows),
            Kind::Pair => pairs.extend((rows.start..rows.start + half).map(|a| (a, a + half))),
            Kind::Objective | Kind::Steering => {}
            Kind::Inequality | Kind::Conditional => panic!("simulations have equations alone"),
        }
    }
    for &(a, b) in &pairs {
        let zero = if values[a] < values[b] { a } else { b };
        let places = pattern.starts[zero]..pattern.starts[zero + 1];
        for (&column, &entry) in pattern.row(zero).iter().zip(&entries[places]) {
            let column = column as usize;
            let Bounds { lower, upper, .. } = bounds[column];
            w[column] = if entry > 0.0 { lower } else { upper };
            is_free[column] = false;
        }
    }
    let free: Vec<usize> = (0..w.len()).filter(|&i| is_free[i]).collect();
    let mut upper = DMatrix::zeros(0, 0);
    for _ in 0..8 {
        evaluator.values(&w, &mut values);
        evaluator.jacobian(&w, &mut entries);
        let mut jacobian = DMatrix::zeros(equations.len(), free.len());
        for (i, &row) in equations.iter().enumerate() {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, &entry) in pattern.row(row).iter().zip(&entries[places]) {
                if let Ok(column) = free.binary_search(&(column as usize)) {
                    jacobian[(i, column)] = entry;
                }
            }
        }
        let residual = equations.iter().map(|&row| values[row]);
        let residual = DVector::from_iterator(equations.len(), residual);
        let factors = jacobian.qr();
        upper = factors.r();
        let mut step = residual;
        factors.q_tr_mul(&mut step);
        let step = upper
            .solve_upper_triangular(&step.rows(0, free.len()))
            .expect("the rows leave nothing open");
        for (&i, step) in free.iter().zip(step.iter()) {
            w[i] -= step;
        }
        if step.amax() < 1e-14 {
            break;
        }
    }
    let smallest = upper.singular_values().min();
    assert!(
        smallest > 1e-6,
        "the rows leave something open: {smallest:e}"
    );
    evaluator.values(&w, &mut values);
    let residuals = equations.iter().map(|&row| values[row].abs());
    let smaller = pairs.iter().map(|&(a, b)| values[a].min(values[b]).abs());
    let residual = residuals
        .chain(smaller)
        .fold(0.0, |m, r| if r <= m { m } else { r });
    assert!(residual < 1e-12, "the rows are not satisfied: {residual:e}");
    w
}

/// y at the end, by the rows.
fn by_rows(formulation: Formulation, steps: usize, options: &Options) -> f64 {
    with_experiment(&model(""), "run", |compiled| {
        let dcs = lower_as(&compiled.system, formulation).expect("the model is small");
        let grid = Grid {
            start: 0.0,
            horizon: HORIZON,
            steps,
        };
        let (mpcc, layout) = discretize(&dcs, grid, options).expect("the model is small");
        let (family, n) = options.scheme;
        let nodes = Tableau::new(family, n)
            .expect("there is such a method")
            .nodes;
        let w = solve(&mpcc, guess(&mpcc, &layout, &nodes));
        w[layout.x(steps, layout.elements, layout.end) + 1]
    })
}

fn options(scheme: (Family, usize), form: Form, cross: Cross) -> Options {
    Options {
        scheme,
        form: Some(form),
        elements: Elements::Detected(Detection {
            cross,
            equilibration: Equilibration::Exact,
            ..Detection::default()
        }),
    }
}

/// Both forms, all sums of pairs and both formulations have the solution of the run on the same grid.
#[test]
fn the_rows_have_the_solution_of_the_run() {
    let all = [
        Cross::All,
        Cross::SumTheta,
        Cross::SumLambda,
        Cross::SumBoth,
    ];
    for (n, steps, cross) in [(2, 2, &all[..]), (4, 3, &all[..1])] {
        let method =
            format!("method fesd {{ scheme = radau_iia({n}); steps = {steps}; elements = 2; }}");
        let run = end(&run(&model(&method), "run"), "y")[0];
        let forms = [Form::Integral, Form::Differential];
        for (&cross, form) in cross.iter().flat_map(|c| forms.map(|f| (c, f))) {
            for formulation in [Formulation::Stewart, Formulation::Step] {
                let options = options((Family::RadauIia, n), form, cross);
                let rows = by_rows(formulation, steps, &options);
                let close = (rows - run).abs() < 1e-12;
                assert!(
                    close,
                    "{formulation}, {options:?}: {rows} by rows, {run} by a run"
                );
            }
        }
    }
}

/// Where the end of an element is no node, it has rows of its own, with the weights of the scheme or the polynomial.
#[test]
fn ends_that_are_no_nodes_are_those_of_the_run() {
    let [radau, gauss] = [Family::RadauIa, Family::GaussLegendre];
    for (family, word, form) in [
        (radau, "radau_ia", Form::Differential),
        (gauss, "gauss", Form::Differential),
        (gauss, "gauss", Form::Integral),
    ] {
        let method = format!("method fesd {{ scheme = {word}(2); steps = 2; elements = 2; }}");
        let run = end(&run(&model(&method), "run"), "y")[0];
        let options = options((family, 2), form, Cross::All);
        let rows = by_rows(Formulation::Step, 2, &options);
        let close = (rows - run).abs() < 1e-12;
        assert!(close, "{options:?}: {rows} by rows, {run} by a run");
    }
}
