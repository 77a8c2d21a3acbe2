//! Right models, as text.

use insta::assert_snapshot;

use super::super::{TargetKind, resolve};
use super::{errors, model};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::source::SourceMap;
use crate::syntax::{self, Item, SettingKind, parse};

#[test]
fn resolves_an_oscillator() {
    let text = "
        model oscillator {
          param omega = 2*pi;
          state x[2] = [exp(-1), 0];
          let A1 = [1, omega; -omega, 1];
          let A2 = [1, -omega; omega, 1];
          let c  = dot(x, x) - 1;
          region inside  where c < 0 { x' = A1*x; }
          region outside where c > 0 { x' = A2*x; }
        }";
    assert_snapshot!(model(text), @r"
    model oscillator
    param omega = 6.283185307179586
    state x[2] = [0.36787944117144233, 0]
    let A1 = [1, omega; -omega, 1]
    let A2 = [1, -omega; omega, 1]
    let c = x[1]^2 + x[2]^2 - 1
    region inside 1 - step(x[1]^2 + x[2]^2 - 1)
      x[1]' = omega*x[2] + x[1]
      x[2]' = -omega*x[1] + x[2]
    region outside step(x[1]^2 + x[2]^2 - 1)
      x[1]' = -omega*x[2] + x[1]
      x[2]' = omega*x[1] + x[2]
    ");
}

#[test]
fn gives_loops_indices() {
    let text = "
        model chain {
          const n = 3;
          state v[n] = [0.4*i for i in 1..n];
          for i in 1..n {
            let pull = sum(v[j] for j in i+1..n);
            switch s = sign(v[i] - pull);
            v[i]' = -s + pull;
            region fast where v[i] > 1 { v[i]' += -v[i]; }
          }
          output first = s[1] + s[n];
        }";
    assert_snapshot!(model(text), @r"
    model chain
    state v[3] = [0.4, 0.8, 1.2000000000000002]
    switch s[1] = sign(v[1] - v[2] - v[3])
    switch s[2] = sign(v[2] - v[3])
    switch s[3] = sign(v[3])
    v[1]' = v[2] + v[3] - s[1]
    v[2]' = v[3] - s[2]
    v[3]' = -s[3]
    region fast[1] step(v[1] - 1)
      v[1]' += -v[1]
    region fast[2] step(v[2] - 1)
      v[2]' += -v[2]
    region fast[3] step(v[3] - 1)
      v[3]' += -v[3]
    output first = s[1] + s[3]
    ");
}

#[test]
fn inlines_functions_for_any_shape() {
    let text = "
        const g = 9.81;
        fn twice(a) = 2*a;
        fn energy(m, v) = m/2*dot(v, v) + twice(g);
        model m {
          state v[2] = twice([1, 2]);
          v' = -twice(v);
          output E = energy(3, v);
        }";
    assert_snapshot!(model(text), @r"
    model m
    state v[2] = [2, 4]
    v[1]' = -2*v[1]
    v[2]' = -2*v[2]
    output E = 1.5*v[1]^2 + 1.5*v[2]^2 + 19.62
    ");
}

#[test]
fn reads_conditions_as_numbers() {
    let text = "
        model m {
          state x = 1;
          state y = 0;
          region a where -1 < x < 1 or not y >= x { x' = 1; }
          region b else { x' = if 0 > y and x > 2 then x else -x; }
          y' = sat(x) + deadzone(y, 0.5) + max(0, x - 1) + sign(x - y);
        }";
    assert_snapshot!(model(text), @r"
    model m
    state x = 1
    state y = 0
    y' = max(x + 1, 0) - max(x - 1, 0) + max(0, x - 1) + sign(x - y) + y - max(y + 0.5, 0) + max(y - 0.5, 0) - 0.5
    region a 1 - step(-x + y)*(1 - step(x + 1)*(1 - step(x - 1)))
      x' = 1
    region b else step(-x + y)*(1 - step(x + 1)*(1 - step(x - 1)))
      x' = -x + 2*x*step(x - 2)*(1 - step(y))
    ");
}

#[test]
fn keeps_hidden_terms_and_bounds() {
    let text = "
        model belt {
          param c in [0, 1] = 0.3;
          param k = 2*c;
          state u in [-k, inf] = k;
          control f[2] in [-1, 1] = [0, 0];
          input w;
          signal r = sin(c*time);
          switch s = sign(u) sliding nonlinear;
          u' = -s - c*u + f[1] + w + r;
          hidden on s { u' += -2*s*(1 - s^2); }
        }";
    assert_snapshot!(model(text), @r"
    model belt
    param c in [0, 1] = 0.3
    param k = 2*c
    state u in [-k, inf] = k
    control f[2] in [-1, 1] = [0, 0]
    input w
    signal r = sin(time*c)
    switch s = sign(u) sliding nonlinear
    u' = sin(time*c) - c*u + f[1] + w - s
    hidden on s
      u' += -2*s*(1 - s^2)
    sliding on s: [chord] + gamma*[g]
      u' = [sin(time*c) - c*u + f[1] + w - s] + (1 - s^2)*[-2*s]
    ");
}

#[test]
fn differentiates() {
    let text = "
        model m {
          param k = 1;
          state q[2] = [1, 0];
          let V = k/2*dot(q, q) + q[1]^3;
          q' = -grad(V, q);
          output J = jacobian([q[1]*q[2], k], q);
          output dk = grad(V, k);
        }";
    assert_snapshot!(model(text), @r"
    model m
    param k = 1
    state q[2] = [1, 0]
    let V = 0.5*k*(q[1]^2 + q[2]^2) + q[1]^3
    q[1]' = -k*q[1] - 3*q[1]^2
    q[2]' = -k*q[2]
    output J = [q[2], q[1]; 0, 0]
    output dk = 0.5*q[1]^2 + 0.5*q[2]^2
    ");
}

#[test]
fn names_surfaces_as_written() {
    let text = "
        fn law(v) = sign(v - 1);
        model m {
          state x[2] = [1, 2];
          let c = x[1] - x[2];
          x[1]' = law(x[2]) + sign(c);
          for i in 2..2 { x[i]' = step(x[i] + 1) + abs(2*x[i]) + (if x[i] > c - 1 then 1 else 0); }
        }";
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let exprs = Exprs::new();
    let model = resolve(&exprs, &file, "m", &[], &mut diags).expect("the model is right");
    let names: Vec<String> = model
        .surfaces
        .iter()
        .map(|surface| format!("{}: {}", surface.name, surface.psi))
        .collect();
    assert_snapshot!(names.join("\n"), @r"
    x[2] - 1: x[2] - 1
    c: x[1] - x[2]
    x[2] + 1: x[2] + 1
    2*x[2]: 2*x[2]
    x[2] - (c - 1): 1 - x[1] + 2*x[2]
    ");
}

#[test]
fn answers_for_experiments() {
    let text = "
        const h = 2;
        model m {
          const n = 2;
          param k[n] = 1;
          state x[n] = ones(n);
          for i in 1..n { switch s = sign(x[i]); x[i]' = -k[i]*s; }
        }
        simulate run of m { with { n = 1 + h; k[2] = 3; x[2..3] = 0; s[2].sliding = linear; q = 1; x[9] = 0; } horizon h*pi; }";
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let settings = file.items.iter().find_map(|item| match item {
        Item::Experiment(experiment) => Some(&experiment.settings),
        _ => None,
    });
    let with = settings
        .into_iter()
        .flatten()
        .find_map(|setting| match &setting.kind {
            SettingKind::With(binds) => Some(binds.as_slice()),
            _ => None,
        });
    let exprs = Exprs::new();
    let text = model_text_with(&exprs, &file, with.unwrap_or_default(), &mut diags);
    assert_snapshot!(text + &errors(&diags, &sources), @r"
    3 switches
    Const [0] Scalar
    Param(0) [1] Scalar
    State(0) [1, 2] Vector(2)
    Sliding(1) [0] Scalar
    E0101: unknown name `q` | q: not declared here
    E0205: index 9 is out of range for `x` | 9: out of range | valid indices are 1..3
    ");
}

fn model_text_with(
    exprs: &Exprs,
    file: &syntax::File,
    with: &[syntax::Bind],
    diags: &mut Diagnostics,
) -> String {
    let Some(model) = resolve(exprs, file, "m", with, diags) else {
        return "none".to_owned();
    };
    let mut text = format!("{} switches\n", model.switches.len());
    for bind in with {
        let target = model.scope.target(&bind.target, diags);
        if let Some(target) = target {
            text += &format!(
                "{:?} {:?} {:?}\n",
                target.kind, target.entries, target.shape
            );
            assert_eq!(target.shape.len(), target.entries.len());
            if let TargetKind::State(index) = target.kind {
                assert!(
                    target
                        .entries
                        .iter()
                        .all(|&entry| entry < model.quantities.states[index].vars.len())
                );
            }
        }
    }
    text
}

/// A value may have the name of a function, and is not what a call of it means; a declaration that of a model.
#[test]
fn names_of_functions_and_models_name_values_too() {
    assert_snapshot!(model("
        const cross = 2.;
        const dot = dot([1, 2], [3, 4]);
        fn f(norm, v) = norm*.5 + norm(v);
        model ball { state x = 1; x' = -x; }
        model m {
          param len = 3.;
          let norm = norm([3, 4]) + len + len([1, 2]);
          state ball = 0;
          let mod = mod(7, 4);
          part fall = ball;
          ball' = norm + cross + dot + mod + f(1, [3, 4]) + sum(step*len for step in 1..2);
        }"), @r"
    W0104: `cross` is the name of a function, too | cross: declared here | `cross` is now what is declared here, and `cross(..)` still the function; another name keeps them apart
    W0104: `dot` is the name of a function, too | dot: declared here | `dot` is now what is declared here, and `dot(..)` still the function; another name keeps them apart
    W0104: `norm` is the name of a function, too | norm: declared here | `norm` is now what is declared here, and `norm(..)` still the function; another name keeps them apart
    W0104: `len` is the name of a function, too | len: declared here | `len` is now what is declared here, and `len(..)` still the function; another name keeps them apart
    W0104: `norm` is the name of a function, too | norm: declared here | `norm` is now what is declared here, and `norm(..)` still the function; another name keeps them apart
    model m
    param len = 3
    state ball = 0
    state fall.x = 1
    let norm = len + 7
    let mod = 3
    ball' = 4*len + 28.5
    fall.x' = -fall.x
    ");
}
