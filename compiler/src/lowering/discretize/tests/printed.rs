//! Printed forms of small systems.

use insta::assert_snapshot;

use super::*;
use crate::expr::Exprs;
use crate::lowering::dcs::fixtures;
use crate::lowering::dcs::fixtures::Fixture;

const GRID: Grid = Grid::new(1.0, 10);

fn printed(make: fn(&Exprs) -> Fixture<'_>, formulation: Formulation, options: &Options) -> String {
    let exprs = Exprs::new();
    discretized(&make(&exprs).system, formulation, GRID, options)
        .0
        .to_string()
}

#[test]
fn relay() {
    let options = options((Family::RadauIia, 4), Detection::default());
    assert_snapshot!(printed(fixtures::relay, Formulation::Stewart, &options), @"
    // stewart
    // radau_iia(4), integral form, 10 steps of 2 elements to T = 1, pairs across all nodes
    f(x, z):
      der(x) = 3*theta[x-] + theta[x+]
    g(x, z):
      0 = x - lambda[x-] - mu
      0 = -x - lambda[x+] - mu
      0 = 1 - theta[x-] - theta[x+]
    a(z), b(z):
      theta[x-] perp lambda[x-]
      theta[x+] perp lambda[x+]
    eta[k,j]:
      product over pairs of sum(b(z[k,j,l]), l in 0..4)*sum(b(z[k,j+1,l]), l in 0..4) + sum(a(z[k,j,m]), m in 1..4)*sum(a(z[k,j+1,m]), m in 1..4)
    variables:
      h[k in 1..10, j in 1..2] = (0 <= h <= 0.1)
      x[k = 1, j = 1, m = 0] = (x = 1)
      x[k in 1..10, j in 1..2, m in 1..4] = (x)
      z[k = 1, j = 1, m = 0] = (lambda[x-] = 2, lambda[x+] = 0, mu = -1)
      z[k in 1..10, j in 1..2, m in 1..4] = (theta[x-] >= 0, theta[x+] >= 0, lambda[x-] >= 0, lambda[x+] >= 0, mu)
    equations:
      collocation[k in 1..10, j in 1..2, m in 1..4]: 0 = sum(d[m,l]*x[k,j,l], l in 0..4) - h[k,j]*f(x[k,j,m], z[k,j,m])
      algebraic[k in 1..10, j in 1..2, m in 1..4]: 0 = g(x[k,j,m], z[k,j,m])
      steps[k in 1..10]: 0 = sum(h[k,j], j in 1..2) - 0.1
      equilibration[k in 1..10, j = 1]: 0 = eta[k,j]*(h[k,j+1] - h[k,j])
    pairs:
      complementarity[k in 1..10, j in 1..2, m in 1..4, l in 0..4]: 0 <= a(z[k,j,m]) perp b(z[k,j,l]) >= 0
    // 504 variables (4 fixed), 340 equations, 800 pairs
    ");
    assert_snapshot!(printed(fixtures::relay, Formulation::Step, &options), @"
    // step
    // radau_iia(4), integral form, 10 steps of 2 elements to T = 1, pairs across all nodes
    f(x, z):
      der(x) = 3 - 2*alpha[x]
    g(x, z):
      0 = x - lambda_p[x] + lambda_n[x]
    a(z), b(z):
      alpha[x] perp lambda_n[x]
      1 - alpha[x] perp lambda_p[x]
    eta[k,j]:
      product over pairs of sum(b(z[k,j,l]), l in 0..4)*sum(b(z[k,j+1,l]), l in 0..4) + sum(a(z[k,j,m]), m in 1..4)*sum(a(z[k,j+1,m]), m in 1..4)
    variables:
      h[k in 1..10, j in 1..2] = (0 <= h <= 0.1)
      x[k = 1, j = 1, m = 0] = (x = 1)
      x[k in 1..10, j in 1..2, m in 1..4] = (x)
      z[k = 1, j = 1, m = 0] = (lambda_p[x] = 1, lambda_n[x] = 0)
      z[k in 1..10, j in 1..2, m in 1..4] = (0 <= alpha[x] <= 1, lambda_p[x] >= 0, lambda_n[x] >= 0)
    equations:
      collocation[k in 1..10, j in 1..2, m in 1..4]: 0 = sum(d[m,l]*x[k,j,l], l in 0..4) - h[k,j]*f(x[k,j,m], z[k,j,m])
      algebraic[k in 1..10, j in 1..2, m in 1..4]: 0 = g(x[k,j,m], z[k,j,m])
      steps[k in 1..10]: 0 = sum(h[k,j], j in 1..2) - 0.1
      equilibration[k in 1..10, j = 1]: 0 = eta[k,j]*(h[k,j+1] - h[k,j])
    pairs:
      complementarity[k in 1..10, j in 1..2, m in 1..4, l in 0..4]: 0 <= a(z[k,j,m]) perp b(z[k,j,l]) >= 0
    // 343 variables (3 fixed), 180 equations, 800 pairs
    ");
}

fn gauss() -> Options {
    let detection = Detection {
        elements: 3,
        cross: Cross::SumBoth,
        equilibration: Equilibration::Tanh {
            weight: 0.1,
            scale: 0.01,
        },
        spread: 0.5,
    };
    options((Family::GaussLegendre, 2), detection)
}

#[test]
fn gauss_by_stewart() {
    let options = gauss();
    assert_snapshot!(printed(fixtures::open_sign, Formulation::Stewart, &options), @"
    // stewart
    // gauss(2), integral form, 10 steps of 3 elements to T = 1, pairs of sums
    f(x, z):
      der(x) = -x*theta[below] + y*(theta[right,(y - x^2)-] + theta[right,(y - x^2)+]) + 2*theta[above]
      der(y) = 1
    g(x, z):
      0 = -x^2 - x + y - lambda[right,(y - x^2)-] - mu
      0 = x^2 - x - y - lambda[right,(y - x^2)+] - mu
      0 = x^2 + x - y - lambda[above] - mu
      0 = -x^2 + x + y - lambda[below] - mu
      0 = 1 - theta[right,(y - x^2)-] - theta[right,(y - x^2)+] - theta[above] - theta[below]
    a(z), b(z):
      theta[right,(y - x^2)-] perp lambda[right,(y - x^2)-]
      theta[right,(y - x^2)+] perp lambda[right,(y - x^2)+]
      theta[above] perp lambda[above]
      theta[below] perp lambda[below]
    eta[k,j]:
      product over pairs of sum(b(z[k,j,l]), l in 0..3)*sum(b(z[k,j+1,l]), l in 0..3) + sum(a(z[k,j,m]), m in 1..2)*sum(a(z[k,j+1,m]), m in 1..2)
    variables:
      h[k in 1..10, j in 1..3] = (0.016666666666666666 <= h <= 0.05)
      x[k = 1, j = 1, m = 0] = (x = 1, y = 1)
      x[k in 1..10, j in 1..3, m in 1..3] = (x, y)
      z[k = 1, j = 1, m = 0] = (lambda[right,(y - x^2)-] = 0, lambda[right,(y - x^2)+] = 0, lambda[above] = 2, lambda[below] = 2, mu = -1)
      z[k in 1..10, j in 1..3, m in 1..2] = (theta[right,(y - x^2)-] >= 0, theta[right,(y - x^2)+] >= 0, theta[above] >= 0, theta[below] >= 0, lambda[right,(y - x^2)-] >= 0, lambda[right,(y - x^2)+] >= 0, lambda[above] >= 0, lambda[below] >= 0, mu)
      z[k in 1..10, j in 1..3, m = 3] = (lambda[right,(y - x^2)-] >= 0, lambda[right,(y - x^2)+] >= 0, lambda[above] >= 0, lambda[below] >= 0, mu)
    minimize the sum of:
      equilibration[k in 1..10, j in 1..2]: 0.1*tanh(eta[k,j]/0.01)*(h[k,j+1] - h[k,j])^2
    equations:
      collocation[k in 1..10, j in 1..3, m in 1..2]: 0 = sum(d[m,l]*x[k,j,l], l in 0..2) - h[k,j]*f(x[k,j,m], z[k,j,m])
      end[k in 1..10, j in 1..3]: 0 = sum(e[l]*x[k,j,l], l in 0..2) - x[k,j,3]
      algebraic[k in 1..10, j in 1..3, m in 1..2]: 0 = g(x[k,j,m], z[k,j,m])
      algebraic_end[k in 1..10, j in 1..3]: 0 = g[1,2,3,4](x[k,j,3], z[k,j,3])
      steps[k in 1..10]: 0 = sum(h[k,j], j in 1..3) - 0.1
    pairs:
      complementarity[k in 1..10, j in 1..3]: 0 <= sum(a(z[k,j,m]), m in 1..2) perp sum(b(z[k,j,l]), l in 0..3) >= 0
    // 907 variables (7 fixed), 610 equations, 120 pairs
    ");
}

#[test]
fn gauss_by_step() {
    let options = gauss();
    assert_snapshot!(printed(fixtures::open_sign, Formulation::Step, &options), @"
    // step
    // gauss(2), integral form, 10 steps of 3 elements to T = 1, pairs of sums
    f(x, z):
      der(x) = -x*(1 - alpha[x] - alpha[y - x^2] + beta[x,(y - x^2)]) + y*alpha[x] + 2*alpha[y - x^2] - 2*beta[x,(y - x^2)]
      der(y) = 1
    g(x, z):
      0 = x - lambda_p[x] + lambda_n[x]
      0 = -x^2 + y - lambda_p[y - x^2] + lambda_n[y - x^2]
      0 = -alpha[x]*alpha[y - x^2] + beta[x,(y - x^2)]
    a(z), b(z):
      alpha[x] perp lambda_n[x]
      1 - alpha[x] perp lambda_p[x]
      alpha[y - x^2] perp lambda_n[y - x^2]
      1 - alpha[y - x^2] perp lambda_p[y - x^2]
    eta[k,j]:
      product over pairs of sum(b(z[k,j,l]), l in 0..3)*sum(b(z[k,j+1,l]), l in 0..3) + sum(a(z[k,j,m]), m in 1..2)*sum(a(z[k,j+1,m]), m in 1..2)
    variables:
      h[k in 1..10, j in 1..3] = (0.016666666666666666 <= h <= 0.05)
      x[k = 1, j = 1, m = 0] = (x = 1, y = 1)
      x[k in 1..10, j in 1..3, m in 1..3] = (x, y)
      z[k = 1, j = 1, m = 0] = (lambda_p[x] = 1, lambda_n[x] = 0, lambda_p[y - x^2] = 0, lambda_n[y - x^2] = 0)
      z[k in 1..10, j in 1..3, m in 1..2] = (0 <= alpha[x] <= 1, lambda_p[x] >= 0, lambda_n[x] >= 0, 0 <= alpha[y - x^2] <= 1, lambda_p[y - x^2] >= 0, lambda_n[y - x^2] >= 0, beta[x,(y - x^2)])
      z[k in 1..10, j in 1..3, m = 3] = (lambda_p[x] >= 0, lambda_n[x] >= 0, lambda_p[y - x^2] >= 0, lambda_n[y - x^2] >= 0)
    minimize the sum of:
      equilibration[k in 1..10, j in 1..2]: 0.1*tanh(eta[k,j]/0.01)*(h[k,j+1] - h[k,j])^2
    equations:
      collocation[k in 1..10, j in 1..3, m in 1..2]: 0 = sum(d[m,l]*x[k,j,l], l in 0..2) - h[k,j]*f(x[k,j,m], z[k,j,m])
      end[k in 1..10, j in 1..3]: 0 = sum(e[l]*x[k,j,l], l in 0..2) - x[k,j,3]
      algebraic[k in 1..10, j in 1..3, m in 1..2]: 0 = g(x[k,j,m], z[k,j,m])
      algebraic_end[k in 1..10, j in 1..3]: 0 = g[1,2](x[k,j,3], z[k,j,3])
      steps[k in 1..10]: 0 = sum(h[k,j], j in 1..3) - 0.1
    pairs:
      complementarity[k in 1..10, j in 1..3]: 0 <= sum(a(z[k,j,m]), m in 1..2) perp sum(b(z[k,j,l]), l in 0..3) >= 0
    // 756 variables (6 fixed), 430 equations, 120 pairs
    ");
}

/// α of a kink below another switch is there at the right end too, and so are its products.
#[test]
fn nested() {
    let detection = Detection {
        cross: Cross::SumTheta,
        equilibration: Equilibration::Mean { weight: 1.0 },
        ..Detection::default()
    };
    let options = Options {
        form: Some(Form::Differential),
        ..options((Family::GaussLegendre, 2), detection)
    };
    assert_snapshot!(printed(fixtures::many, Formulation::Step, &options), @"
    // step
    // gauss(2), differential form, 10 steps of 2 elements to T = 1, pairs with sums of what jumps
    f(x, z):
      der(x) = beta[5]
      der(y) = -x*(alpha[s[1]] - beta[s[1],s[2]]) + alpha[abs(x) - y]
    g(x, z):
      0 = x - lambda_p[x] + lambda_n[x]
      0 = x*(2*alpha[x] - 1) - y - lambda_p[abs(x) - y] + lambda_n[abs(x) - y]
      0 = sin(x) - y - lambda_p[s[1]] + lambda_n[s[1]]
      0 = sin(2*x) - y - lambda_p[s[2]] + lambda_n[s[2]]
      0 = sin(3*x) - y - lambda_p[s[3]] + lambda_n[s[3]]
      0 = sin(4*x) - y - lambda_p[s[4]] + lambda_n[s[4]]
      0 = sin(5*x) - y - lambda_p[s[5]] + lambda_n[s[5]]
      0 = -(2*alpha[abs(x) - y] - 1)*(2*alpha[s[1]] - 1) + beta[1]
      0 = -(2*alpha[s[2]] - 1)*beta[1] + beta[2]
      0 = -(2*alpha[s[3]] - 1)*beta[2] + beta[3]
      0 = -(2*alpha[s[4]] - 1)*beta[3] + beta[4]
      0 = -(2*alpha[s[5]] - 1)*beta[4] + beta[5]
      0 = -alpha[s[1]]*alpha[s[2]] + beta[s[1],s[2]]
    a(z), b(z):
      alpha[abs(x) - y] perp lambda_n[abs(x) - y]
      1 - alpha[abs(x) - y] perp lambda_p[abs(x) - y]
      alpha[s[1]] perp lambda_n[s[1]]
      1 - alpha[s[1]] perp lambda_p[s[1]]
      alpha[s[2]] perp lambda_n[s[2]]
      1 - alpha[s[2]] perp lambda_p[s[2]]
      alpha[s[3]] perp lambda_n[s[3]]
      1 - alpha[s[3]] perp lambda_p[s[3]]
      alpha[s[4]] perp lambda_n[s[4]]
      1 - alpha[s[4]] perp lambda_p[s[4]]
      alpha[s[5]] perp lambda_n[s[5]]
      1 - alpha[s[5]] perp lambda_p[s[5]]
    a_end(z), b_end(z):
      alpha[x] perp lambda_n[x]
      1 - alpha[x] perp lambda_p[x]
    variables:
      h[k in 1..10, j in 1..2] = (0 <= h <= 0.1)
      x[k = 1, j = 1, m = 0] = (x = 1, y = 1)
      x[k in 1..10, j in 1..2, m in 1..3] = (x, y)
      v[k in 1..10, j in 1..2, m in 1..2] = (der(x), der(y))
      z[k = 1, j = 1, m = 0] = (lambda_p[x] = 1, lambda_n[x] = 0, lambda_p[abs(x) - y] = 0, lambda_n[abs(x) - y] = 0, lambda_p[s[1]] = 0, lambda_n[s[1]] = 0.1585290151921035, lambda_p[s[2]] = 0, lambda_n[s[2]] = 0.09070257317431829, lambda_p[s[3]] = 0, lambda_n[s[3]] = 0.8588799919401328, lambda_p[s[4]] = 0, lambda_n[s[4]] = 1.7568024953079282, lambda_p[s[5]] = 0, lambda_n[s[5]] = 1.9589242746631386)
      z[k in 1..10, j in 1..2, m in 1..2] = (0 <= alpha[x] <= 1, lambda_p[x] >= 0, lambda_n[x] >= 0, 0 <= alpha[abs(x) - y] <= 1, lambda_p[abs(x) - y] >= 0, lambda_n[abs(x) - y] >= 0, 0 <= alpha[s[1]] <= 1, lambda_p[s[1]] >= 0, lambda_n[s[1]] >= 0, 0 <= alpha[s[2]] <= 1, lambda_p[s[2]] >= 0, lambda_n[s[2]] >= 0, 0 <= alpha[s[3]] <= 1, lambda_p[s[3]] >= 0, lambda_n[s[3]] >= 0, 0 <= alpha[s[4]] <= 1, lambda_p[s[4]] >= 0, lambda_n[s[4]] >= 0, 0 <= alpha[s[5]] <= 1, lambda_p[s[5]] >= 0, lambda_n[s[5]] >= 0, beta[1], beta[2], beta[3], beta[4], beta[5], beta[s[1],s[2]])
      z[k in 1..10, j in 1..2, m = 3] = (0 <= alpha[x] <= 1, lambda_p[x] >= 0, lambda_n[x] >= 0, lambda_p[abs(x) - y] >= 0, lambda_n[abs(x) - y] >= 0, lambda_p[s[1]] >= 0, lambda_n[s[1]] >= 0, lambda_p[s[2]] >= 0, lambda_n[s[2]] >= 0, lambda_p[s[3]] >= 0, lambda_n[s[3]] >= 0, lambda_p[s[4]] >= 0, lambda_n[s[4]] >= 0, lambda_p[s[5]] >= 0, lambda_n[s[5]] >= 0)
    minimize the sum of:
      equilibration[k in 1..10, j in 1..2]: (h[k,j] - 0.05)^2
    equations:
      nodes[k in 1..10, j in 1..2, m in 1..2]: 0 = x[k,j,0] + h[k,j]*sum(a[m,l]*v[k,j,l], l in 1..2) - x[k,j,m]
      end[k in 1..10, j in 1..2]: 0 = x[k,j,0] + h[k,j]*sum(b[l]*v[k,j,l], l in 1..2) - x[k,j,3]
      slopes[k in 1..10, j in 1..2, m in 1..2]: 0 = f(x[k,j,m], z[k,j,m]) - v[k,j,m]
      algebraic[k in 1..10, j in 1..2, m in 1..2]: 0 = g(x[k,j,m], z[k,j,m])
      algebraic_end[k in 1..10, j in 1..2]: 0 = g[1,2,3,4,5,6,7](x[k,j,3], z[k,j,3])
      steps[k in 1..10]: 0 = sum(h[k,j], j in 1..2) - 0.1
    pairs:
      complementarity[k in 1..10, j in 1..2, l in 0..3]: 0 <= sum(a(z[k,j,m]), m in 1..2) perp b(z[k,j,l]) >= 0
      complementarity_end[k in 1..10, j in 1..2, l in 0..3]: 0 <= sum(a_end(z[k,j,m]), m in 1..3) perp b_end(z[k,j,l]) >= 0
    // 1616 variables (16 fixed), 870 equations, 1120 pairs
    ");
}

#[test]
fn time_stepping() {
    let options = Options {
        scheme: (Family::Explicit, 2),
        form: None,
        elements: Elements::Plain(1),
    };
    assert_snapshot!(printed(fixtures::two_relays, Formulation::Stewart, &options), @"
    // stewart
    // explicit(2), differential form, time stepping, 10 steps to T = 1
    f(x, z):
      der(x[1]) = theta[x[1]-] - theta[x[1]+] - 2*theta[x[2]-] + 2*theta[x[2]+]
      der(x[2]) = 2*theta[x[1]-] - 2*theta[x[1]+] + theta[x[2]-] - theta[x[2]+]
    g(x, z):
      0 = x[1] - lambda[x[1]-] - mu[1]
      0 = -x[1] - lambda[x[1]+] - mu[1]
      0 = 1 - theta[x[1]-] - theta[x[1]+]
      0 = x[2] - lambda[x[2]-] - mu[2]
      0 = -x[2] - lambda[x[2]+] - mu[2]
      0 = 1 - theta[x[2]-] - theta[x[2]+]
    a(z), b(z):
      theta[x[1]-] perp lambda[x[1]-]
      theta[x[1]+] perp lambda[x[1]+]
      theta[x[2]-] perp lambda[x[2]-]
      theta[x[2]+] perp lambda[x[2]+]
    variables:
      h[k in 1..10, j = 1] = (h = 0.1)
      x[k = 1, j = 1, m = 0] = (x[1] = 1, x[2] = 1)
      x[k in 1..10, j = 1, m in 1..3] = (x[1], x[2])
      v[k in 1..10, j = 1, m in 1..2] = (der(x[1]), der(x[2]))
      z[k in 1..10, j = 1, m in 1..2] = (theta[x[1]-] >= 0, theta[x[1]+] >= 0, lambda[x[1]-] >= 0, lambda[x[1]+] >= 0, mu[1], theta[x[2]-] >= 0, theta[x[2]+] >= 0, lambda[x[2]-] >= 0, lambda[x[2]+] >= 0, mu[2])
    equations:
      nodes[k in 1..10, j = 1, m in 1..2]: 0 = x[k,j,0] + h[k,j]*sum(a[m,l]*v[k,j,l], l in 1..2) - x[k,j,m]
      end[k in 1..10, j = 1]: 0 = x[k,j,0] + h[k,j]*sum(b[l]*v[k,j,l], l in 1..2) - x[k,j,3]
      slopes[k in 1..10, j = 1, m in 1..2]: 0 = f(x[k,j,m], z[k,j,m]) - v[k,j,m]
      algebraic[k in 1..10, j = 1, m in 1..2]: 0 = g(x[k,j,m], z[k,j,m])
    pairs:
      complementarity_node[k in 1..10, j = 1, m in 1..2]: 0 <= a_node(z[k,j,m]) perp b_node(z[k,j,m]) >= 0
    // 312 variables (12 fixed), 220 equations, 80 pairs
    ");
    assert_snapshot!(printed(fixtures::two_relays, Formulation::Step, &options), @"
    // step
    // explicit(2), differential form, time stepping, 10 steps to T = 1
    f(x, z):
      der(x[1]) = -2*alpha[x[1]] + 4*alpha[x[2]] - 1
      der(x[2]) = 3 - 4*alpha[x[1]] - 2*alpha[x[2]]
    g(x, z):
      0 = x[1] - lambda_p[x[1]] + lambda_n[x[1]]
      0 = x[2] - lambda_p[x[2]] + lambda_n[x[2]]
    a(z), b(z):
      lambda_n[x[1]] perp alpha[x[1]]
      lambda_p[x[1]] perp 1 - alpha[x[1]]
      lambda_n[x[2]] perp alpha[x[2]]
      lambda_p[x[2]] perp 1 - alpha[x[2]]
    variables:
      h[k in 1..10, j = 1] = (h = 0.1)
      x[k = 1, j = 1, m = 0] = (x[1] = 1, x[2] = 1)
      x[k in 1..10, j = 1, m in 1..3] = (x[1], x[2])
      v[k in 1..10, j = 1, m in 1..2] = (der(x[1]), der(x[2]))
      z[k in 1..10, j = 1, m in 1..2] = (0 <= alpha[x[1]] <= 1, lambda_p[x[1]] >= 0, lambda_n[x[1]] >= 0, 0 <= alpha[x[2]] <= 1, lambda_p[x[2]] >= 0, lambda_n[x[2]] >= 0)
    equations:
      nodes[k in 1..10, j = 1, m in 1..2]: 0 = x[k,j,0] + h[k,j]*sum(a[m,l]*v[k,j,l], l in 1..2) - x[k,j,m]
      end[k in 1..10, j = 1]: 0 = x[k,j,0] + h[k,j]*sum(b[l]*v[k,j,l], l in 1..2) - x[k,j,3]
      slopes[k in 1..10, j = 1, m in 1..2]: 0 = f(x[k,j,m], z[k,j,m]) - v[k,j,m]
      algebraic[k in 1..10, j = 1, m in 1..2]: 0 = g(x[k,j,m], z[k,j,m])
    pairs:
      complementarity_node[k in 1..10, j = 1, m in 1..2]: 0 <= a_node(z[k,j,m]) perp b_node(z[k,j,m]) >= 0
    // 232 variables (12 fixed), 140 equations, 80 pairs
    ");
}

#[test]
fn rows_one_by_one() {
    let exprs = Exprs::new();
    let system = fixtures::relay(&exprs).system;
    let options = options((Family::RadauIia, 1), Detection::default());
    let grid = Grid::new(1.0, 1);
    let (mpcc, _) = discretized(&system, Formulation::Step, grid, &options);
    assert_snapshot!(mpcc.flat(), @"
    collocation[1,1,1]: 0 = -h[1,1]*(3 - 2*alpha[x][1,1,1]) - x[1,1,0] + x[1,1,1]
    collocation[1,2,1]: 0 = -h[1,2]*(3 - 2*alpha[x][1,2,1]) - x[1,1,1] + x[1,2,1]
    algebraic[1,1,1]: 0 = x[1,1,1] - lambda_p[x][1,1,1] + lambda_n[x][1,1,1]
    algebraic[1,2,1]: 0 = x[1,2,1] - lambda_p[x][1,2,1] + lambda_n[x][1,2,1]
    steps[1]: 0 = h[1,1] + h[1,2] - 1
    complementarity[1,1,1,0]: 0 <= alpha[x][1,1,1] perp lambda_n[x][1,1,0] >= 0
    complementarity[1,1,1,0]: 0 <= 1 - alpha[x][1,1,1] perp lambda_p[x][1,1,0] >= 0
    complementarity[1,1,1,1]: 0 <= alpha[x][1,1,1] perp lambda_n[x][1,1,1] >= 0
    complementarity[1,1,1,1]: 0 <= 1 - alpha[x][1,1,1] perp lambda_p[x][1,1,1] >= 0
    complementarity[1,2,1,0]: 0 <= alpha[x][1,2,1] perp lambda_n[x][1,1,1] >= 0
    complementarity[1,2,1,0]: 0 <= 1 - alpha[x][1,2,1] perp lambda_p[x][1,1,1] >= 0
    complementarity[1,2,1,1]: 0 <= alpha[x][1,2,1] perp lambda_n[x][1,2,1] >= 0
    complementarity[1,2,1,1]: 0 <= 1 - alpha[x][1,2,1] perp lambda_p[x][1,2,1] >= 0
    equilibration[1,1]: 0 = (-h[1,1] + h[1,2])*((lambda_p[x][1,1,0] + lambda_p[x][1,1,1])*(lambda_p[x][1,1,1] + lambda_p[x][1,2,1]) + (1 - alpha[x][1,1,1])*(1 - alpha[x][1,2,1]))*((lambda_n[x][1,1,0] + lambda_n[x][1,1,1])*(lambda_n[x][1,1,1] + lambda_n[x][1,2,1]) + alpha[x][1,1,1]*alpha[x][1,2,1])
    ");
}
