//! Laws of dimensions, and models with units that fit or not.

use insta::assert_snapshot;
use proptest::prelude::*;

use super::dimension::{Dimension, Ratio};
use super::{check_experiment, names};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::resolve;
use crate::model::tests::errors;
use crate::source::SourceMap;
use crate::syntax::{Item, parse};

fn dimension() -> impl Strategy<Value = Dimension> {
    let exponents = proptest::array::uniform7(-4..=4_i32);
    (exponents, 1..=3_i64).prop_map(|(exponents, denominator)| {
        let root = Ratio::new(1, denominator).expect("a fraction");
        Dimension::of(exponents).power(root).expect("small")
    })
}

fn ratio() -> impl Strategy<Value = Ratio> {
    (-6..=6_i64, 1..=6_i64).prop_map(|(n, d)| Ratio::new(n, d).expect("a fraction"))
}

/// The dimension of a unit as text.
fn unit(text: &str) -> Option<Dimension> {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let source = sources.add("unit", format!("model m {{ param p : {text}; }}"));
    let file = parse(&source, &mut diags);
    let unit = file.items.iter().find_map(|item| match item {
        Item::Model(model) => model.body.iter().find_map(|stmt| match stmt {
            crate::syntax::Stmt::Decl(decl) => decl.unit.clone(),
            _ => None,
        }),
        _ => None,
    });
    names::read(&unit?, &mut diags).filter(|_| !diags.has_errors())
}

proptest! {
    #[test]
    fn dimensions_are_a_vector_space(
        a in dimension(),
        b in dimension(),
        c in dimension(),
        p in ratio(),
        q in ratio(),
    ) {
        let product = |a: Dimension, b: Dimension| a.multiply(b).expect("small");
        let power = |a: Dimension, p: Ratio| a.power(p).expect("small");
        prop_assert_eq!(product(a, b), product(b, a));
        prop_assert_eq!(product(product(a, b), c), product(a, product(b, c)));
        prop_assert_eq!(product(a, Dimension::NUMBER), a);
        prop_assert_eq!(a.divide(a), Some(Dimension::NUMBER));
        prop_assert_eq!(product(a, b).divide(b), Some(a));
        prop_assert_eq!(power(a, Ratio::ONE), a);
        prop_assert_eq!(power(a, Ratio::ZERO), Dimension::NUMBER);
        prop_assert_eq!(power(product(a, b), p), product(power(a, p), power(b, p)));
        prop_assert_eq!(power(power(a, p), q), power(a, p.multiply(q).expect("small")));
        prop_assert_eq!(
            product(power(a, p), power(a, q)),
            power(a, p.add(q).expect("small"))
        );
    }

    #[test]
    fn a_dimension_reads_back_as_it_is_shown(a in dimension()) {
        prop_assert_eq!(unit(&a.to_string()), Some(a));
    }

    #[test]
    fn fractions_are_what_they_are_written_as(n in -100_000..100_000_i64, digits in 0..4_u32) {
        let scale = 10_i64.pow(digits);
        prop_assert_eq!(Ratio::from_number(n as f64 / scale as f64), Ratio::new(n, scale));
    }
}

#[test]
fn knows_the_coherent_units() {
    for (a, b) in [
        ("N", "kg*m/s^2"),
        ("J", "N*m"),
        ("W", "J/s"),
        ("Pa", "N/m^2"),
        ("C", "A*s"),
        ("V", "W/A"),
        ("Ohm", "V/A"),
        ("Ω", "V/A"),
        ("\u{2126}", "V/A"),
        ("F", "C/V"),
        ("S", "A/V"),
        ("Wb", "V*s"),
        ("T", "Wb/m^2"),
        ("H", "Wb/A"),
        ("Hz", "s^-1"),
        ("rad/s", "1/s"),
        ("Gy", "J/kg"),
        ("m^(1/2)*m^0.5", "m"),
        ("(kg*m)/(s*(s))", "N"),
    ] {
        assert_eq!(unit(a), unit(b), "{a} is {b}");
        assert!(unit(a).is_some(), "{a}");
    }
    assert_eq!(unit("m^1e30"), None);
    assert_eq!(unit("m^(1/0)"), None);
}

/// What is wrong in the last model of a file, or in the experiments of it.
fn wrong(text: &str) -> String {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let mut models = file.items.iter().filter_map(|item| match item {
        Item::Model(model) => Some(model),
        _ => None,
    });
    let model = models.next_back().expect("a model");
    let exprs = Exprs::new();
    resolve(&exprs, &file, &model.name.name, &[], &mut diags);
    for item in &file.items {
        if let Item::Experiment(experiment) = item {
            check_experiment(&file, &file, model, experiment, &[], &mut diags);
        }
    }
    errors(&diags, &sources)
}

/// What is wrong with the declarations of a falling body and some more.
fn falling(more: &str) -> String {
    wrong(&format!(
        "fn kinetic(m, v) = 0.5*m*v^2; fn twice(a, b) = a + b;
         model fall {{
           param m : kg = 2; param g : m/s^2 = 9.81; param k : N/m = 4; param free = 1; const n = 2;
           state q : m = 1; state v : m/s = 0; state r[2] : m = [3, 4]; state w[2] : m/s = 0;
           q' = v; r' = w; w' = -g*r/norm(r); v' = -g; {more}
         }}"
    ))
}

#[test]
fn accepts_what_fits() {
    let fine = |text: &str| assert_eq!(falling(text), "", "{text}");
    fine("output E : J = kinetic(m, v) + m*g*q;");
    fine("output E : J = 0.5*m*dot(w, w) + m*g*norm(r);");
    fine("output p : W = k*q*v;");
    fine(
        "output y : m = q + 2 mm - 3 km; output z : m/s^2 = g + 1 (m/s^2); output J : J = 2 kJ + 3 N*(2 cm);",
    );
    fine(
        "output y : 1 = sin(5 rad/s*time) + sin(20 kHz*time) + frac(time/3 ms) + sawtooth(time, 1 min);",
    );
    fine("let omega = sqrt(k/m); output s : 1 = sin(omega*time);");
    fine("output y : m = q + 1 - 2*q; output z : m = if q > 2 then q else 0;");
    fine("output y : m = max(q, r[1], 0) + abs(q) + sat(q, -1, 1) + min(r);");
    fine("output y : 1 = sign(v) + exp(-q/r[2]) + atan2(r[1], r[2]) + q^0/1;");
    fine("output y : m^(3/2) = q^1.5 + q^(3/2) + sqrt(q^3) + q^(1 + 1/2);");
    fine("output a : m = free*q; output b : N = n*q; output c : J = q^n; output d : s = free;");
    fine("output y : N = grad(0.5*k*q^2, q); output z : 1/m^2 = inv([q, 0; 0, q])[1, 1]/q;");
    fine("output t : s = time; output c : m^2 = cross([q, 0, 0], [0, q, 0])[1];");
    fine("region up where q > 1 { let a = q; v' += a*k/m; } region down where q < 1 { v' += 0; }");
    fine(
        "switch s = sign(q - 0.5); v' += g*s; output y[0] : m = q;"
            .replace("[0]", "")
            .as_str(),
    );
}

#[test]
fn refuses_what_does_not_fit() {
    assert_snapshot!(falling("output E : J = m*g; output y = q + v + q; let z = q > v;"), @r"
    E0232: `E` is in J, but what it gets is in N | m*g: this is in N | J: declared to be in J | a factor in m is missing, or one of the units is wrong
    E0231: the terms of this sum do not have one unit: the first is in m, another in m/s | q: this is in m | v: this is in m/s | a factor in s is missing, or one of the units is wrong
    E0231: the sides of this comparison do not have one unit: the first is in m, another in m/s | q: this is in m | v: this is in m/s | a factor in s is missing, or one of the units is wrong
    ");
    assert_snapshot!(falling("v' += k*q; w' += -9.81*r/norm(r); v' += 3*sign(v);"), @r"
    E0233: the rate of `v` is in m/s^2, but the right side is in N | k*q: this is in N | v: `v` is in m/s, and its rate that per second: in m/s^2 | a factor in 1/kg is missing, or one of the units is wrong
    E0233: the rate of `w` is in m/s^2, but the right side is a pure number | -9.81*r/norm(r): this is a pure number | w: `w` is in m/s, and its rate that per second: in m/s^2 | a number in a product is a pure number; write its unit behind it, as in `2 (m/s^2)`, or give the factor a name: `param a : m/s^2 = ..;`
    E0233: the rate of `v` is in m/s^2, but the right side is a pure number | 3*sign(v): this is a pure number | v: `v` is in m/s, and its rate that per second: in m/s^2 | a number in a product is a pure number; write its unit behind it, as in `2 (m/s^2)`, or give the factor a name: `param a : m/s^2 = ..;`
    ");
    assert_snapshot!(falling("output a = sin(time); output b = exp(q)*log(v); output c = q^time;"), @r"
    E0234: the argument of `sin` must be a pure number, and is in s | time: this is in s | divide it by a quantity that is in s
    E0234: the argument of `exp` must be a pure number, and is in m | q: this is in m | divide it by a quantity that is in m
    E0234: the argument of `log` must be a pure number, and is in m/s | v: this is in m/s | divide it by a quantity that is in m/s
    E0234: an exponent must be a pure number, and is in s | time: this is in s | divide it by a quantity that is in s
    ");
    assert_snapshot!(falling("param e : 1 = 2; output a = q^e; output b = q^n;"), @"E0235: the unit of this power depends on the value of its exponent | q: this is in m | e: not a fixed number | write the exponent as a number, or divide the base by a quantity that is in m");
    assert_snapshot!(falling("output a = twice(q, 1) + twice(q, v); output b : 1 = kinetic(q, 2);"), @r"
    E0231: the terms of this sum do not have one unit: the first is in m, another in m/s | a: this is in m | b: this is in m/s | twice(q, v): from here | a factor in s is missing, or one of the units is wrong
    E0232: `b` is a pure number, but what it gets is in m | kinetic(q, 2): this is in m | 1: declared to be a pure number | a factor in 1/m is missing, or one of the units is wrong
    ");
    assert_snapshot!(falling("output a = max(q, v); output b = (if q > 0 then q else v);"), @r"
    E0231: the arguments of `max` do not have one unit: the first is in m, another in m/s | q: this is in m | v: this is in m/s | a factor in s is missing, or one of the units is wrong
    E0231: the branches of this `if` do not have one unit: the first is in m, another in m/s | q: this is in m | v: this is in m/s | a factor in s is missing, or one of the units is wrong
    ");
    assert_snapshot!(falling("param a : mm = 1; param b : 1000*m = 1; param c : foo = 1; param d : min; param e : n = 1; param f : m^0.123456789;"), @r"
    E0230: `mm` is not a coherent SI unit | mm: not a unit | write `m`; a number may have its own, as in `2 mm`
    E0230: `1000` is not a coherent SI unit | 1000: not a unit | `1` stands for a pure number; a factor stands in the number
    E0230: `foo` is not a coherent SI unit | foo: not a unit | units are made of kg, m, s, A, K, mol, cd, rad, N, J, W, Pa, V, Ohm, F, H, C, ..
    E0230: `min` is not a coherent SI unit | min: not a unit | write `s`; a number may have its own, as in `2 min`
    E0230: `n` is not a coherent SI unit | n: not a unit | did you mean `N`?
    E0230: the exponent of a unit must be a small whole number or a fraction | m^0.123456789: no such power | write `m^2`, `s^-1` or `m^(1/2)`
    ");
    assert_snapshot!(falling("param a : m in [m, 1] = k; state b : s = g;  b' = 1;"), @r"
    E0232: `a` is in m, but what it gets is in kg | m: this is in kg | m: declared to be in m | a factor in m/kg is missing, or one of the units is wrong
    E0232: `a` is in m, but what it gets is in kg/s^2 | k: this is in kg/s^2 | m: declared to be in m | a factor in m*s^2/kg is missing, or one of the units is wrong
    E0232: `b` is in s, but what it gets is in m/s^2 | g: this is in m/s^2 | s: declared to be in s | a factor in s^3/m is missing, or one of the units is wrong
    ");
    assert_snapshot!(falling("let a = q + v; output b = a; output c = a + q;"), @"E0231: the terms of this sum do not have one unit: the first is in m, another in m/s | q: this is in m | v: this is in m/s | a factor in s is missing, or one of the units is wrong");
    assert_snapshot!(falling("for i in 1..2 { let a = r[i] + w[i]; r[i]' += a; w[i]' += r[i]; }"), @r"
    E0231: the terms of this sum do not have one unit: the first is in m, another in m/s | r[i]: this is in m | w[i]: this is in m/s | a factor in s is missing, or one of the units is wrong
    E0233: the rate of `w` is in m/s^2, but the right side is in m | r[i]: this is in m | w[i]: `w` is in m/s, and its rate that per second: in m/s^2 | a factor in 1/s^2 is missing, or one of the units is wrong
    ");
}

#[test]
fn follows_parts_with_what_they_are_given() {
    let with_parts = |more: &str| {
        wrong(&format!(
            "model law {{ param mu : 1 = 1; param width = 1; input slip; input load; output force = -mu*load*sign(slip); output level = exp(-slip/width); }}
             model spring {{ param k : N/m = 1; input x : m; output force : N = -k*x; }}
             model whole {{ param m : kg = 1; state q : m = 0; state v : m/s = 0; q' = v; {more} }}"
        ))
    };
    assert_eq!(
        with_parts(
            "part f = law { slip = v; load = s[1].force; } part s[i in 1..2] = spring { x = i*q; } v' = (s[1].force + f.force)/m; output p = f.level;"
        ),
        ""
    );
    assert_snapshot!(with_parts("part f = law { slip = v; load = s.force; width = 2; mu = m; } part s = spring { x = v; } v' = f.force;"), @r"
    E0232: `mu` is a pure number, but what it gets is in kg | m: this is in kg | 1: declared to be a pure number | a factor in 1/kg is missing, or one of the units is wrong
    E0232: `x` is in m, but what it gets is in m/s | v: this is in m/s | m: declared to be in m | a factor in s is missing, or one of the units is wrong
    E0233: the rate of `v` is in m/s^2, but the right side is in N | f.force: this is in N | v: `v` is in m/s, and its rate that per second: in m/s^2 | a factor in 1/kg is missing, or one of the units is wrong
    ");
}

#[test]
fn experiments_keep_to_the_units_of_the_model() {
    let experiment = |settings: &str| {
        wrong(&format!(
            "model m {{ param tau : s = 1; param l : m = 1; state q : m = 1; input f : N = 0; q' = -q/tau; }}
             simulate e of m {{ {settings} }}"
        ))
    };
    assert_eq!(
        experiment(
            "with { tau = 2; q = 2*l; } horizon 3*tau; output q every tau/2; expect q at end ~ exp(-3) within 1e-3; expect q at tau <= l; expect switches ~ [1] within 1e-3;"
        ),
        ""
    );
    assert_snapshot!(experiment("with { tau = l; f = q; } horizon 3*l; output q every l; expect q at l ~ tau within 1e-3; expect mode at l is smooth;"), @r"
    E0232: `tau` is in s, but what it gets is in m | l: this is in m | s: declared to be in s | a factor in s/m is missing, or one of the units is wrong
    E0232: `f` is in N, but what it gets is in m | q: this is in m | N: declared to be in N | a factor in kg/s^2 is missing, or one of the units is wrong
    E0232: the horizon is in s, but what it gets is in m | 3*l: this is in m | a factor in s/m is missing, or one of the units is wrong
    E0232: the time of an output is in s, but what it gets is in m | l: this is in m | a factor in s/m is missing, or one of the units is wrong
    E0231: the sides of this expectation do not have one unit: the first is in m, another in s | q: this is in m | tau: this is in s | a factor in m/s is missing, or one of the units is wrong
    E0232: an instant is in s, but what it gets is in m | l: this is in m | a factor in s/m is missing, or one of the units is wrong
    E0232: an instant is in s, but what it gets is in m | l: this is in m | a factor in s/m is missing, or one of the units is wrong
    ");
}

#[test]
fn models_without_units_are_left_alone() {
    assert_eq!(
        wrong("model m { state x = 1; x' = sin(time) + x^x; } simulate e of m { horizon x; }"),
        ""
    );
}

#[test]
fn refuses_quantities_that_do_not_fit() {
    for text in [
        "output y = q + 2 s;",
        "output y : m = 3 kHz;",
        "output y = sin(5 rad/s);",
        "output y = hypot(q, v);",
    ] {
        let found = falling(text);
        assert!(found.starts_with("E023"), "{text}: {found}");
    }
}
