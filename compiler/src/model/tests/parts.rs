//! Parts: what they become, and who reads whom.

use insta::assert_snapshot;

use super::model;

const DISC: &str = "
const g = 10;
fn law(v) = -sign(v - 1);
model disc {
  const n = 2;
  param m = 1;
  state q[n] = zeros(n);
  control u = 0;
  input push;
  input aim = m;
  let twice = 2*q;
  output y = push*g;
  switch s = sign(q[1] - aim);
  region low where twice[1] < 0 { q' = -s*ones(n); }
  region high else { q' = (u + law(q[2]) + push)*ones(n); }
}
";

#[test]
fn instances_have_names_of_their_own() {
    let text = format!(
        "{DISC} model pair {{
           param k = 3;
           part a = disc {{ m = k; q = [k, k]; push = b.y; u = -k*b.q[1]; }}
           part b = disc {{ n = 1 + 1; push = sign(k*time - 1); aim = 0; s.sliding = linear; }}
           output e = a.m + b.s + b.n;
         }}"
    );
    assert_snapshot!(model(&text), @r"
    model pair
    param k = 3
    param a.m = k
    param b.m = 1
    state a.q[2] = [k, k]
    state b.q[2] = [0, 0]
    control b.u = 0
    input a.aim = a.m
    let a.twice = [2*a.q[1], 2*a.q[2]]
    let b.twice = [2*b.q[1], 2*b.q[2]]
    let a.push = 10*sign(time*k - 1)
    let b.push = sign(time*k - 1)
    let b.aim = 0
    let a.u = -k*b.q[1]
    switch a.s = sign(a.q[1] - a.aim)
    switch b.s = sign(b.q[1]) sliding linear
    region a.low 1 - step(2*a.q[1])
      a.q[1]' = -a.s
      a.q[2]' = -a.s
    region a.high else step(2*a.q[1])
      a.q[1]' = 10*sign(time*k - 1) - k*b.q[1] - sign(a.q[2] - 1)
      a.q[2]' = 10*sign(time*k - 1) - k*b.q[1] - sign(a.q[2] - 1)
    region b.low 1 - step(2*b.q[1])
      b.q[1]' = -b.s
      b.q[2]' = -b.s
    region b.high else step(2*b.q[1])
      b.q[1]' = sign(time*k - 1) - sign(b.q[2] - 1) + b.u
      b.q[2]' = sign(time*k - 1) - sign(b.q[2] - 1) + b.u
    output a.y = 100*sign(time*k - 1)
    output b.y = 10*sign(time*k - 1)
    output e = a.m + b.s + 2
    ");
}

#[test]
fn arrays_give_indices_to_their_parts() {
    let text = "model mass { param m = 1; input f; state x; x' = f/m; }
        model row {
          const n = 3;
          part b[i in 0..n - 1] = mass { m = i + 1; x = i^2; f = if i > 0 then b[i - 1].x else total; }
          let total = sum(b[i].x for i in 0..n - 1);
          part none[i in 1..0] = mass { f = 0; }
        }";
    assert_snapshot!(model(text), @r"
    model row
    param b[0].m = 1
    param b[1].m = 2
    param b[2].m = 3
    state b[0].x = 0
    state b[1].x = 1
    state b[2].x = 4
    let total = b[0].x + b[1].x + b[2].x
    let b[0].f = b[0].x + b[1].x + b[2].x
    let b[1].f = b[0].x
    let b[2].f = b[1].x
    b[0].x' = (b[0].x + b[1].x + b[2].x)/b[0].m
    b[1].x' = b[0].x/b[1].m
    b[2].x' = b[1].x/b[2].m
    ");
}

#[test]
fn what_stands_outside_counts() {
    let text = "model inner { const n = 1; param k = 1; state x[n] = ones(n); input u = 1; x' = -k*u*x; }
        model middle { const n = 2; param k = 2; part deep = inner { n = n; k = k; u = 2; } }
        model whole { part a = middle { deep.k = 5; deep.u = time; } part b = middle { deep.n = 1; n = 3; } }";
    assert_snapshot!(model(text), @r"
    model whole
    param a.k = 2
    param a.deep.k = 5
    param b.k = 2
    param b.deep.k = b.k
    state a.deep.x[2] = [1, 1]
    state b.deep.x[1] = [1]
    let a.deep.u = time
    let b.deep.u = 2
    a.deep.x[1]' = -time*a.deep.k*a.deep.x[1]
    a.deep.x[2]' = -time*a.deep.k*a.deep.x[2]
    b.deep.x[1]' = -2*b.deep.k*b.deep.x[1]
    ");
}

#[test]
fn switches_come_after_those_they_read() {
    let text = "model relay { input u; switch s = sign(u); output y = -s; }
        model chain {
          state x = 1;
          part first = relay { u = second.y + x; }
          part second = relay { u = x - 1; }
          x' = first.y;
          hidden on first.s { x' += 1 - first.s^2; }
        }";
    assert_snapshot!(model(text), @r"
    model chain
    state x = 1
    let first.u = x - second.s
    let second.u = x - 1
    switch second.s = sign(x - 1)
    switch first.s = sign(x - second.s)
    x' = -first.s
    hidden on first.s
      x' += 1 - first.s^2
    output first.y = -first.s
    output second.y = -second.s
    ");
}

#[test]
fn mistakes_in_a_model_are_told_once() {
    let text =
        "model bad { state x = 1; state y = 1; region r where x > 0 { x' = 1; } output z = x + w; }
        model pair { part a = bad; part b[i in 1..2] = bad; output e = a.z + b[1].z; }";
    assert_snapshot!(model(text), @r"
    E0301: state `y` has no dynamics | state y = 1;: `y` is never set | add `y' = ..;`, or declare `discrete` what only jumps set
    E0307: nothing sets `x` outside region `r` | x' = 1;: set here only | add the other regions, or one with `else`
    E0101: unknown name `w` | w: not declared here
    ");
    assert_snapshot!(model("model m { region r where true { part a = m; } for i in 1..2 { part b = m; } }"), @r"
    E0308: this comparison is always true | true: constant | a guard must depend on the state or on time
    E0111: a `part` cannot stand inside a region | part a = m;: declared too deep | move it to the top of the model
    E0111: a `part` cannot stand inside a loop | part b = m;: declared too deep | move it to the top of the model
    ");
    assert_snapshot!(model("model leaf { } model m { part a[i in 1..1.5] = leaf; part a2 = leaf[2]; part c[i in 1..9999999999] = leaf; }"), @r"
    E0206: the last index of a part must be an integer, not 1.5 | 1.5: 1.5
    E0107: unknown model `leaf` | leaf[2]: no model of that name | did you mean `leaf`?
    E0213: the model is too large | part c[i in 1..9999999999] = leaf;: grows too large here | a model may have about a million entries
    ");
}

#[test]
fn nesting_is_bounded() {
    let mut text = String::from("model m0 { state x = 1; x' = 1; } ");
    for k in 1..100 {
        text += &format!(
            "model m{k} {{ part a = m{}; part b = m{}; }} ",
            k - 1,
            k - 1
        );
    }
    assert_snapshot!(model(&text).lines().next().unwrap_or_default(), @"E0116: parts are nested more than 64 deep | m34: too deep | put some of the models into one");
}
