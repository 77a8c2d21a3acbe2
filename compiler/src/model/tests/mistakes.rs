//! Wrong models: codes, words and what they point at.

use insta::assert_snapshot;

use super::{model, value};

#[test]
fn refuses_wrong_names() {
    assert_snapshot!(model("model m { param rate = 1; state x = 1; x' = rat*x + sinn(x); }"), @r"
    E0101: unknown name `rat` | rat: not declared here | did you mean `rate`?
    E0109: unknown function `sinn` | sinn: not a function | did you mean `sign`?
    ");
    assert_snapshot!(model("model m { param k = 1.2 (1/h); state x = 2/ms; x' = 0; }"), @r"
    E0109: unknown function `1.2` | 1.2: not a function | a product has a `*`, as in `1.2*(x + 1)`; a unit without a numerator is a quotient, as in `1.2/(1 h)`
    E0101: unknown name `ms` | ms: not declared here | as a unit it stands behind a number: `1 ms`, `x/(1 ms)`
    ");
    assert_snapshot!(model("model m { state x[2] = 0; for i in 1..2, j in 1..1 { switch s = sign(x[i] + j); } x' = s[2, 3]; }"), @"E0205: index 2,3 is out of range for `s` | s[2, 3]: out of range | valid indices are from 1,1 to 2,1");
    assert_snapshot!(model("model m { state x = 1; let x = 2; param pi = 1; x' = -x; }"), @r"
    E0102: `x` is declared twice | x: declared here | x: and again here | rename one of them
    E0104: `pi` is built in and cannot be redeclared | pi: declared here | choose another name
    ");
    assert_snapshot!(model("const g = 1; fn g(x) = x; model m { param g = 2; state x = g; x' = 1; }"), @r"
    E0102: `g` is declared twice | g: declared here | g: and again here | rename one of them
    E0103: `g` already names a constant of the file | g: the constant | g: redeclared here | rename one of them
    ");
    assert_snapshot!(model("model m { let a = b; let b = 2*c; let c = a; }"), @"E0105: `a` depends on itself: a -> b -> c -> a | a: needed to compute itself | b: needs `c` | c: needs `a` | write one of them without the others");
    assert_snapshot!(model("model m { param a = b; param b = 2*a; }"), @"E0105: the default of `a` depends on itself: a -> b -> a | param a = b;: needed to compute itself | param b = 2*a;: needs `a` | write one of them without the others");
    assert_snapshot!(model("const a = 2*b; const b = a; model m { state x = a; x' = 1; }"), @"E0105: `a` depends on itself: a -> b -> a | a: needed to compute itself | b: needs `a` | write one of them without the others");
    assert_snapshot!(model("fn f(x) = g(x); fn g(x) = f(x); model m { state x = 1; x' = f(x); }"), @"E0106: function `f` calls itself: f -> g -> f | f: recursive | functions are inlined; use `for` or a reduction to repeat");
    assert_snapshot!(model("fn f(x) = x + k; model m { param k = 1; state x = 1; x' = f(x) + f; }"), @"E0101: unknown name `k` | k: not declared here | a function sees its arguments, constants and functions only");
    assert_snapshot!(model("model m { state x = 1; region r where x > 0 { let y = y; x' = y; } region s else { x' = 0; } }"), @"E0105: `y` depends on itself: y -> .. -> y | y: needed to compute itself | y: while this is computed | write one of them without the others");
    assert_snapshot!(model("model m { state x = 1; x' = x(1) + x.y; }"), @r"
    E0109: unknown function `x` | x: not a function | `x` is not a function; index it as `x[..]`, multiply with `*`
    E0110: `x` has no field `y` | y: no such field | only parts have fields
    ");
    assert_snapshot!(model("model m { state x[2] = 1; for i in 1..2 { switch s = sign(x[i]); x[i]' = s; } output y = s + s[3]; }"), @r"
    E0112: `s` is declared in a loop and needs its indices | s: which one | write 1 index in brackets: `s[..]`
    E0205: index 3 is out of range for `s` | s[3]: out of range | valid indices are 1..2
    ");
    assert_snapshot!(model("model m { state x = 1; x' = 0; for i in 1..2 { param k = 1; } }"), @"E0111: a declaration cannot stand inside a loop | param k = 1;: declared too deep | move it to the top of the model");
}

#[test]
fn refuses_wrong_shapes() {
    assert_snapshot!(value("[1, 2]*[1, 2]"), @"E0202: `*` does not multiply two vectors | [1, 2]: a vector of 2 | [1, 2]: a vector of 2 | use `dot(a, b)` for the inner product or `a .* b` entry by entry");
    assert_snapshot!(value("[1, 2] + [1, 2, 3]"), @"E0201: `+` does not fit a vector of 2 and a vector of 3 | [1, 2]: a vector of 2 | [1, 2, 3]: a vector of 3");
    assert_snapshot!(value("[1, 2; 3, 4]*[1, 2, 3]"), @"E0201: `*` does not fit a 2 by 2 matrix and a vector of 3 | [1, 2; 3, 4]: a 2 by 2 matrix | [1, 2, 3]: a vector of 3 | the left side has 2 columns, the right side 3 rows");
    assert_snapshot!(value("1/[1, 2]"), @"E0201: `/` does not fit a scalar and a vector of 2 | 1: a scalar | [1, 2]: a vector of 2 | divide by a scalar, entry by entry with `./`, or use `solve`");
    assert_snapshot!(value("[1, 2]^2"), @"E0201: `^` does not fit a vector of 2 and a scalar | [1, 2]: a vector of 2 | 2: a scalar | `^` is for scalars; `.^` works entry by entry");
    assert_snapshot!(value("[1, 2; 3]"), @"E0211: the rows of this matrix do not fit | 3: 1 column, the first row has 2 columns | every row must have the same number of columns");
    assert_snapshot!(value("[eye(2), 1; 1, 2, 3]"), @"E0211: the blocks of this row do not fit | 1: 1 row, the first block has 2 rows | blocks side by side must have the same number of rows");
    assert_snapshot!(value("[1, 2][3] + [1, 2][0]"), @r"
    E0205: index 3 is out of range for `[1, 2]` | 3: out of range | valid indices are 1..2
    E0205: index 0 is out of range for `[1, 2]` | 0: out of range | valid indices are 1..2
    ");
    assert_snapshot!(value("[1, 2; 3, 4][1] + 5[1]"), @r"
    E0215: `[1, 2; 3, 4]` takes two indices, not 1 | [1, 2; 3, 4][1]: indexed here
    E0215: `5` takes no index, not 1 | 5[1]: indexed here
    ");
    assert_snapshot!(value("[1, 2][1.5]"), @"E0206: an index must be an integer, not 1.5 | 1.5: 1.5");
    assert_snapshot!(value("[1, 2][time]"), @"E0207: an index must be a structural constant | time: depends on `time` | declare what it is made of with `const`");
    assert_snapshot!(value("1 + (2 > 1)"), @"E0208: a condition is not a number | (2 > 1): true or false | write `if .. then 1 else 0` to make a number of it");
    assert_snapshot!(value("if 1 then 2 else 3"), @"E0209: a number is not a condition | 1: must be true or false | compare it, as in `1 > 0`");
    assert_snapshot!(value("if 2 > time then 2 else [3, 4, 5; 6, 7, 8]"), @"[step(time - 2) + 2, 2*step(time - 2) + 2, 3*step(time - 2) + 2; 4*step(time - 2) + 2, 5*step(time - 2) + 2, 6*step(time - 2) + 2]");
    assert_snapshot!(value("sin(1, 2) + min() + sat(1, 2)"), @r"
    E0210: `sin` takes 1 argument, not 2 arguments | sin(1, 2): called here
    E0210: `min` takes at least 1 argument, not no arguments | min(): called here
    E0210: `sat` takes 1 or 3 arguments, not 2 arguments | sat(1, 2): called here
    ");
    assert_snapshot!(value("inv([1, 2; 2, 4])"), @"E0214: the matrix is singular | inv([1, 2; 2, 4]): has no inverse | its determinant is zero");
    assert_snapshot!(value("inv(time*eye(5))"), @"E0912: the inverse of a 5 by 5 matrix is not supported yet | inv(time*eye(5)): 5 by 5 | symbolic matrices can be inverted up to 4 by 4");
    assert_snapshot!(value("time/0"), @"E0216: division by zero | 0: is zero");
    assert_snapshot!(value("grad(time^2, 2*time)"), @"E0212: `grad` differentiates by states, params and other variables only | 2*time: an expression | write the second argument as a declared name or its entry");
    assert_snapshot!(value("max(i for i in 1..0)"), @"E0219: `max` of nothing | max(i for i in 1..0): has no entries | the range must not be empty");
    assert_snapshot!(model("model m { state x = [1, 2]; x' = eye(3); }"), @r"
    E0203: `x` is a scalar, its value is a vector of 2 | [1, 2]: a vector of 2 | declare the size in brackets, as in `x[2]`, or take one entry
    E0203: `x'` is a scalar, its value is a 3 by 3 matrix | eye(3): a 3 by 3 matrix | declare the size in brackets, as in `A[3,3]`, or take one entry
    ");
    assert_snapshot!(model("model m { state x = y; state y = 1; param k in [2, 1] = time; x' = k; y' = 1; }"), @r"
    E0217: the initial value of `x` may depend on params only | y: depends on `y`
    E0221: the lower bound of `k` is above the upper one | 2, 1: contains no number | write `in [lower, upper]`
    E0217: the default of `k` may depend on params only | time: depends on `time`
    ");
}

#[test]
fn bounds_the_work() {
    assert_snapshot!(value("eye(100000)[1, 1]"), @"E0213: the model is too large | eye(100000): grows too large here | a model may have about a million entries");
    assert_snapshot!(value("sum(1 for i in 1..1000000, j in 1..1000000)"), @"E0213: the model is too large | i in 1..1000000, j in 1..1000000: grows too large here | a model may have about a million entries");
    assert_snapshot!(model("model m { state x[1e12]; x' = 0; }"), @"E0213: the model is too large | state x[1e12];: grows too large here | a model may have about a million entries");
    assert_snapshot!(model("model m { for i in 1..1000000000 { let a = i; } }"), @"E0213: the model is too large | 1..1000000000: grows too large here | a model may have about a million entries");
    let doubling: String = (1..60)
        .map(|i| format!("fn f{i}(x) = f{}(x) + f{}(x);\n", i + 1, i + 1))
        .collect();
    assert_snapshot!(model(&format!("{doubling} fn f60(x) = x; model m {{ state x = 1; x' = f1(x); }}")), @"E0213: the model is too large | f59(x): grows too large here | a model may have about a million entries");
}

#[test]
fn long_chains_do_not_overflow() {
    let lets: String = (0..20_000)
        .map(|i| format!("let a{i} = a{} + 1;\n", i + 1))
        .collect();
    let shown = model(&format!(
        "model m {{ state a20000 = 0; a20000' = a0; {lets} }}"
    ));
    assert!(
        shown.contains("a20000' = a20000 + 20000"),
        "{}",
        &shown[..200.min(shown.len())]
    );
    let calls: String = (0..400)
        .map(|i| format!("fn f{i}(x) = 1 + f{}(x);\n", i + 1))
        .collect();
    let shown = model(&format!(
        "{calls} fn f400(x) = x; model m {{ state x = 1; x' = f0(x); }}"
    ));
    assert!(
        shown.starts_with("E0220"),
        "{}",
        &shown[..200.min(shown.len())]
    );
    let terms = " + x".repeat(50_000);
    assert!(model(&format!("model m {{ state x = 1; x' = x{terms}; }}")).contains("50001*x"));
}

#[test]
fn every_state_is_set_once() {
    assert_snapshot!(model("model m { state x = 1; state y[2] = 0; y[2]' = 1; }"), @r"
    E0301: state `x` has no dynamics | state x = 1;: `x` is never set | add `x' = ..;`, or declare `discrete` what only jumps set
    E0301: state `y` has no dynamics | state y[2] = 0;: `y[1]` is never set | add `y[1]' = ..;`, or declare `discrete` what only jumps set
    ");
    assert_snapshot!(model("model m { state x[3] = 0; x[1..2]' = [1, 2]; x' = 0; }"), @"E0302: the dynamics of `x[1]` are set twice | x[1..2]' = [1, 2];: set here | x' = 0;: and again here | use `+=` to add a term");
    assert_snapshot!(model("model m { param k = 1; state x = 0; k' = 1; x' = 1; z' = 2; r' = 1; region r where x > 0 { x' += 1; } }"), @r"
    E0303: `k` is a param, not a state | k: has no dynamics | declare `state k = ..;`
    E0101: unknown name `z` | z: not declared here
    E0303: `r` is a region, not a state | r: has no dynamics
    ");
    assert_snapshot!(model("model m { state x = 0; state y = 0; y' = 0; region a where x > 0 { x' = 1; y' = 1; } region b where x < 0 { x' = 2; } }"), @r"
    E0302: the dynamics of `y` are set twice | y' = 0;: set here | y' = 1;: and again here | use `+=` to add a term
    E0304: region `b` does not set `y` | y' = 1;: set here, in region `a` | region b where x < 0 { x' = 2; }: not set here | add `y' = ..;` to region `b`
    ");
    assert_snapshot!(model("model m { state x = 0; region a where x > 0 { x' = 1; } }"), @"E0307: nothing sets `x` outside region `a` | x' = 1;: set here only | add the other regions, or one with `else`");
    assert_snapshot!(model("model m { state x = 0; x' = 1; region a else { x' += 1; } }"), @"E0305: region `a` is the rest of nothing | region a else { x' += 1; }: no other region sets these states | an `else` region sets the states that other regions set");
    assert_snapshot!(model("model m { state x = 0; region a where x > 0 { x' = 1; } region b else { x' = 2; } region c else { x' = 3; } }"), @"E0306: two `else` regions set `x` | region b else { x' = 2; }: the rest | region c else { x' = 3; }: the rest again | give one of them a guard");
    assert_snapshot!(model("model m { state x = 0; region a where x > 0 and x < 0 { x' = 1; } region b where 1 > 2 { x' = 2; } }"), @r"
    E0309: this guard holds on a thin set at most | x > 0 and x < 0: needs both sides of one surface at once | `<` and `<=` are the same; a surface belongs to no region
    E0308: this comparison is always false | 1 > 2: constant | a guard must depend on the state or on time
    ");
    assert_snapshot!(model("model m { state x = 0; switch s = 2*sign(x); switch t = step(3); x' = s + t; }"), @r"
    E0313: a switch is `sign(..)`, `step(..)` or `hysteresis(..)` | 2*sign(x): something else | use `let` for other expressions
    E0308: this comparison is always true | 3: constant | a guard must depend on the state or on time
    ");
    assert_snapshot!(model("model m { state x = 0; switch s = step(x); x' = s; hidden on s { x' += s; } hidden on x { x' = 1; } }"), @r"
    E0311: this hidden term does not vanish at `s = 1` | x' += s;: is 1 there | multiply it by `s*(1 - s)`
    E0312: `x` is not a named `sign` or `step` | x: needs a switch | declare `switch s = sign(..);`
    ");
}

#[test]
fn a_surface_has_two_directions_at_most() {
    let text = "
        model m {
          state x = 1;
          state T : K = 17;
          jump hit when x <= 0 { x := 1; }
          mechanics x, T { mass = 1; force = 0; contact wall { gap = x; restitution = 0; slip = [T, T, T]; } }
          x' = 1;
        }";
    assert_snapshot!(model(text), @"E0319: a surface has no 3 directions | [T, T, T]: here | write `slip = [w1, w2];`, the velocities along two directions at right angles, or `slip = w;` where a body moves in a plane");
}

#[test]
fn forgives_what_cannot_be_read() {
    assert_snapshot!(model("model m { state = 1; param k = 2; let a = x + k*[1, 2] + [1, 2, 3]; y' = f(x); }"), @"E0016: `state =` sets nothing in a model | state =: neither a declaration nor dynamics | write `state' = ...;` for dynamics, or `let state = ...;` for a name");
    assert_snapshot!(model("use std.friction.{coulomb, stribeck as curve}; model m { state v = 1; v' = -curve(v); }"), @"E0119: cannot import `..` | use std.friction.{coulomb, stribeck as curve};: files are not read here");
    assert_snapshot!(model("model m { param exp = 2; let a = b; let b = a; let a = 2; state x = exp; x' = a + exp(b); }"), @r"
    W0104: `exp` is the name of a function, too | exp: declared here | `exp` is now what is declared here, and `exp(..)` still the function; another name keeps them apart
    E0102: `a` is declared twice | a: declared here | a: and again here | rename one of them
    ");
}

#[test]
fn deep_expressions_do_not_overflow() {
    let forms = [
        "sum(_ for i in 1..1)",
        "[_ for i in 1..1][1]",
        "[_, 1; 2, 3][1, 1]",
        "(if _ > x then 1 else 2)",
        "max(_, 1)",
        "-(_ - 1)^2",
    ];
    for form in forms {
        let deep =
            |inner: &str| (0..20).fold(inner.to_owned(), |inner, _| form.replace('_', &inner));
        let functions = (0..40).map(|k| {
            let body = if k == 39 {
                "x".to_owned()
            } else {
                format!("f{}(x)", k + 1)
            };
            format!("fn f{k}(x) = {};\n", deep(&body))
        });
        let shown = model(&format!(
            "{} model m {{ state x = 1; x' = f0(x); }}",
            functions.collect::<String>()
        ));
        assert!(
            shown.starts_with("E0220"),
            "{form}: {}",
            &shown[..200.min(shown.len())]
        );
    }
}
