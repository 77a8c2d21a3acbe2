//! Texts to trees and back.

mod cost;
mod layout;
mod random;
mod recovery;

use insta::assert_snapshot;

use super::{File, Item, parse};
use crate::diagnostics::{Diagnostics, render};
use crate::source::SourceMap;

/// Parses a text that has no mistakes.
fn read(text: &str) -> File {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    assert!(
        diags.is_empty(),
        "{text}\n{}",
        render(&diags, &sources, false, 100)
    );
    file
}

/// The tree without positions.
fn skeleton(file: &File) -> String {
    let debug = format!("{file:?}");
    let mut pieces = debug.split("Span { start: ");
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let rest = piece.split_once('}').map_or("", |(_, rest)| rest);
        text.push('_');
        text.push_str(rest);
    }
    text
}

/// The canonical text, which reads back as the same tree.
fn canonical(text: &str) -> String {
    let file = read(text);
    let printed = file.to_string();
    assert_eq!(skeleton(&read(&printed)), skeleton(&file), "{printed}");
    printed
}

/// The canonical text of an expression, with all parentheses it does not need taken away.
fn expr(text: &str) -> String {
    let printed = canonical(&format!("const x = {text};"));
    let value = printed.trim_end().strip_prefix("const x = ");
    value
        .and_then(|value| value.strip_suffix(';'))
        .unwrap_or(&printed)
        .to_owned()
}

/// An index takes a name from where it is bound on: not in its own bounds, nor in those of indices before it.
#[test]
fn names_of_indices_inside_are_not_read_from_outside() {
    let cases = [
        ("i", true),
        ("j + f(i)", true),
        ("f(x, fit = i)", true),
        ("sum(i for i in 1..3)", false),
        ("sum(j for i in 1..3, j in 1..i)", false),
        ("sum(j for j in 1..i, i in 1..3)", true),
        ("sum(i for i in 1..i)", true),
        ("sum(sum(i for j in 1..2) for i in 1..3)", false),
        ("sum(sum(j for i in 1..2) + i for j in 1..3)", true),
        ("[i for i in 1..3][i]", true),
        ("[i for i in 1..3][2]", false),
        ("[i^2 for j in 1..3]", true),
    ];
    for (text, is_read) in cases {
        let file = read(&format!("const x = {text};"));
        let Some(Item::Const(item)) = file.items.first() else {
            panic!("{text} is a constant");
        };
        assert_eq!(item.value.reads("i"), is_read, "{text}");
    }
}

#[test]
fn reads_every_item_and_declaration() {
    assert_snapshot!(canonical(
        r#"
        use std.friction.{coulomb, stribeck as curve}; use ./actuators; use ../../lib/plant-2 as plant;
        const g = 9.81; fn f(a, b) = a*b; fn zero() = 0; expect error E0203;
        model everything {
          const n = 3;
          param m : kg = 1; param k : N/m^2 in [0, 10] = 1; param c : m^(-1/2) * ( kg / s )^2 / 1 = 1; param free_one;
          state x[3] : m in [-1, 1] = [0, 0, 1]; state R[3,3] = eye(3); state θ;
          control u in [-1, 1] = 0; control on in {0, 1} = 0;
          input w[2]; algebraic z = 0;
          signal r = table("data.csv", "r", fit = cubic);
          let c = dot(x, x) - 1; output E : J = m*g*x[1];
          switch s = sign(c); switch h = sign(c) sliding nonlinear; switch l = step(c) sliding linear;
          part b = disc { m = 2; q = [0, 1]; }; part d[i in 1..n] = lib.disc; part e = disc { }
        }
        "#
    ), @r#"
    use std.friction.{coulomb, stribeck as curve};
    use ./actuators;
    use ../../lib/plant-2 as plant;
    const g = 9.81;
    fn f(a, b) = a*b;
    fn zero() = 0;
    expect error E0203;
    model everything {
      const n = 3;
      param m : kg = 1;
      param k : N/m^2 in [0, 10] = 1;
      param c : m^(-1/2)*(kg/s)^2/1 = 1;
      param free_one;
      state x[3] : m in [-1, 1] = [0, 0, 1];
      state R[3, 3] = eye(3);
      state θ;
      control u in [-1, 1] = 0;
      control on in {0, 1} = 0;
      input w[2];
      algebraic z = 0;
      signal r = table("data.csv", "r", fit = cubic);
      let c = dot(x, x) - 1;
      output E : J = m*g*x[1];
      switch s = sign(c);
      switch h = sign(c) sliding nonlinear;
      switch l = step(c) sliding linear;
      part b = disc {
        m = 2;
        q = [0, 1];
      }
      part d[i in 1..n] = lib.disc;
      part e = disc;
    }
    "#);
}

#[test]
fn reads_every_relation_of_a_model() {
    assert_snapshot!(canonical(
        r#"
        model everything {
          region free where c < 0 and not (x[1] > 0 or x[2] > 0) { x' = -x; }
          region other indicator c { x' = x; } region rest else { let y = 1; x[2]' += y; };
          hidden on s { x' += 1 - s^2; }
          project x onto { 1 - dot(x, x) >= 0; for i in 1..n { x[i] >= 0; } }
          project x onto { -1 <= x[1] <= 1; } metric E;
          jump floor when x[1] <= 0 and x[2] < 0 { x[2] := -e*x[2]; }
          mechanics q, v { mass = eye(2); force = [0, -g]; contact c { gap = q[2]; } along = [1; 0]; }
          contact pair { gap = norm(a.q - b.q); restitution = 0; }
          for i in 1..n, j in i+1..n { b[i].x' = b[j].x; }
          y in argmin (y - x)^2; y[2] in argmin y*y subject to { y >= 0; }
          y in variational [0, inf] solves y - 1; y in variational { norm(y) <= r; } solves y;
          0 = z^2 - 1; 0 <= a perp b >= 0;
          b[1].x' = 1; state' = 1; region' += 1;
        }
        "#
    ), @r#"
    model everything {
      region free where c < 0 and not (x[1] > 0 or x[2] > 0) {
        x' = -x;
      }
      region other indicator c {
        x' = x;
      }
      region rest else {
        let y = 1;
        x[2]' += y;
      }
      hidden on s {
        x' += 1 - s^2;
      }
      project x onto {
        1 - dot(x, x) >= 0;
        for i in 1..n {
          x[i] >= 0;
        }
      }
      project x onto {
        -1 <= x[1] <= 1;
      } metric E;
      jump floor when x[1] <= 0 and x[2] < 0 {
        x[2] := -e*x[2];
      }
      mechanics q, v {
        mass = eye(2);
        force = [0, -g];
        along = [1; 0];
        contact c {
          gap = q[2];
        }
      }
      contact pair {
        gap = norm(a.q - b.q);
        restitution = 0;
      }
      for i in 1..n, j in i + 1..n {
        b[i].x' = b[j].x;
      }
      y in argmin (y - x)^2;
      y[2] in argmin y*y subject to {
        y >= 0;
      }
      y in variational [0, inf] solves y - 1;
      y in variational {
        norm(y) <= r;
      } solves y;
      0 = z^2 - 1;
      0 <= a perp b >= 0;
      b[1].x' = 1;
      state' = 1;
      region' += 1;
    }
    "#);
}

#[test]
fn reads_every_setting_of_a_simulation() {
    assert_snapshot!(canonical(
        r#"
        simulate run of lib.model {
          with { omega = 6; x = [0, 1]; b[1].s.sliding = linear; }
          horizon pi/2; tolerance 1e-9; runs 200;
          method fesd { scheme = radau_iia(4); steps = 10; } method auto;
          lower step, timefreezing;
          output q, E every 0.01; output at [0, 1]; output b[2].q; output every 1;
          perturb every 0.16 by sphere(1e-4) seed 1; perturb every 1; on chattering slide; sensitivity to mu, x[1] at 0 one_sided;
          expect x at end ~ [1, 0] within 1e-9; expect x at 0.5 <= 0;
          expect energy at end <= energy at 0; expect clearance always >= -1e-8;
          expect switches ~ [1.0] within 1e-9; expect len(switches) = 3;
          expect events(contact_close, floor)[1] ~ sqrt(2) within 1e-3;
          expect mode at 2.0 is inside and sliding(s); expect status is locally_infeasible;
          expect warning W0102; expect lowering golden; expect mode at 2 < 1; expect order > 6.5;
        }
        "#
    ), @r#"
    simulate run of lib.model {
      with {
        omega = 6;
        x = [0, 1];
        b[1].s.sliding = linear;
      }
      horizon pi/2;
      tolerance 1e-9;
      runs 200;
      method fesd {
        scheme = radau_iia(4);
        steps = 10;
      }
      method auto;
      lower step, timefreezing;
      output q, E every 0.01;
      output at [0, 1];
      output b[2].q;
      output every 1;
      perturb every 0.16 by sphere(0.0001) seed 1;
      perturb every 1;
      on chattering slide;
      sensitivity to mu, x[1] at 0 one_sided;
      expect x at end ~ [1, 0] within 1e-9;
      expect x at 0.5 <= 0;
      expect energy at end <= energy at 0;
      expect clearance always >= -1e-8;
      expect switches ~ [1] within 1e-9;
      expect len(switches) = 3;
      expect events(contact_close, floor)[1] ~ sqrt(2) within 0.001;
      expect mode at 2 is inside and sliding(s);
      expect status is locally_infeasible;
      expect warning W0102;
      expect lowering golden;
      expect mode at 2 < 1;
      expect order > 6.5;
    }
    "#);
}

#[test]
fn reads_what_figures_show() {
    assert_snapshot!(canonical(
        r#"
        simulate run of m {
          plot { x[1], 2*x[2]; phase q[1], phase; phase, v; phase - v, v; phase (-v), v; title, w; title "A fall"; width 8 cm; }
          plot { width -3 px; phase; }
          animate { disc -q, r; disc (x), disc; polygon [0, 0; 1, 0; x]; title "Fall"; width 8 cm; speed 0.5; }
        }
        "#
    ), @r#"
    simulate run of m {
      plot {
        x[1], 2*x[2];
        phase q[1], phase;
        phase, v;
        phase - v, v;
        phase (-v), v;
        title, w;
        title "A fall";
        width 8 cm;
      }
      plot {
        width -3 px;
        phase;
      }
      animate {
        disc -q, r;
        disc x, disc;
        polygon [0, 0; 1, 0; x];
        title "Fall";
        width 8 cm;
        speed 0.5;
      }
    }
    "#);
}

#[test]
fn reads_every_setting_of_a_fit() {
    assert_snapshot!(canonical(
        r#"
        fit it of m {
          data "measured.csv" { q -> position; v[2] -> "speed [m/s]" weight 1/0.05; a.b->data; }
          data "other.csv" {} loss squared; loss huber(2*d);
        }
        "#
    ), @r#"
    fit it of m {
      data "measured.csv" {
        q -> position;
        v[2] -> "speed [m/s]" weight 1/0.05;
        a.b -> data;
      }
      data "other.csv" {
      }
      loss squared;
      loss huber(2*d);
    }
    "#);
}

#[test]
fn reads_every_setting_of_a_closed_loop() {
    assert_snapshot!(canonical(
        "mpc it of m { controller   plan ; sample 1/10; deadline 0.02; horizon 3; }"
    ), @r"
    mpc it of m {
      controller plan;
      sample 1/10;
      deadline 0.02;
      horizon 3;
    }
    ");
}

#[test]
fn reads_every_setting_of_an_optimization() {
    assert_snapshot!(canonical(
        r#"
        optimize it of m {
          horizon free in [0.1, 10] = 4; horizon free; horizon free = 2;
          intervals 6; elements 3; scheme radau_iia(3); controls constant;
          minimize integral(dot(u, u)) + final(norm(x)^2);
          subject to { -2 <= v <= 2; u = 0; } at elements; subject to { x > 0; }
          initial { x[1] free in [0, 1]; y free; z = 1; }
          free { k; m in [1, 2]; }
          final { q = [-pi/6, -pi/4]; }
          guess { from crossing; from "file.json"; u = 0; from = 1; }
          starts 40 by gauss(0.5) seed 1; starts 3;
        }
        "#
    ), @r#"
    optimize it of m {
      horizon free in [0.1, 10] = 4;
      horizon free;
      horizon free = 2;
      intervals 6;
      elements 3;
      scheme radau_iia(3);
      controls constant;
      minimize integral(dot(u, u)) + final(norm(x)^2);
      subject to {
        -2 <= v <= 2;
        u = 0;
      } at elements;
      subject to {
        x > 0;
      }
      initial {
        x[1] free in [0, 1];
        y free;
        z = 1;
      }
      free {
        k;
        m in [1, 2];
      }
      final {
        q = [-pi/6, -pi/4];
      }
      guess {
        from crossing;
        from "file.json";
        u = 0;
        from = 1;
      }
      starts 40 by gauss(0.5) seed 1;
      starts 3;
    }
    "#);
}

#[test]
fn operators_bind_as_in_the_reference() {
    assert_snapshot!(expr("((a + b) + c) - (d - e)"), @"((a + b) + c) - (d - e)");
    assert_snapshot!(expr("-a^b + (-a)^b * -c/(d*e)"), @"-a^b + (-a)^b*-c/(d*e)");
    assert_snapshot!(expr("(a^b)^c - a^(b^c) - 2^-x^2 .^ y"), @"(a^b)^c - a^b^c - 2^-x^2.^y");
    assert_snapshot!(expr("not (not a) or b and (c or d) and not (e < f)"), @"not not a or b and (c or d) and not e < f");
    assert_snapshot!(expr("-1 < x <= (y < 2)"), @"-1 < x <= (y < 2)");
    assert_snapshot!(expr("if a then b else if c then d else e + 1"), @"if a then b else if c then d else e + 1");
    assert_snapshot!(expr("(if a then b else c) + (a or b)*2"), @"(if a then b else c) + (a or b)*2");
    assert_snapshot!(expr("f(x, fit = cubic)(2).y[1, :, 2..n-1][i] .* (2).k ./ -3"), @"f(x, fit = cubic)(2).y[1, :, 2..n - 1][i].*(2).k./-3");
    assert_snapshot!(expr("[[a, b], c; d, e] + [1, 2;] + [1; 2] + [x[i]^2 for i in 1..n-1]"), @"[[a, b], c; d, e] + [1, 2;] + [1; 2] + [x[i]^2 for i in 1..n - 1]");
    assert_snapshot!(expr("sum(x[i]*y[j] for i in 1..n, j in i+1..n) + min(x, y for i in 1..2)"), @"sum(x[i]*y[j] for i in 1..n, j in i + 1..n) + min(x, y for i in 1..2)");
    assert_snapshot!(expr("1e-3 + 0.5e+2 + 1E300 + 123456789 + 0.1"), @"0.001 + 50 + 1e300 + 123456789 + 0.1");
}

#[test]
fn words_are_keywords_only_where_they_stand() {
    let text = "model model {\n  state region = 1;\n  region' = 1;\n  state' = state.of[in_1];\n  \
                let at = always*within;\n  region free where if_ < thenceforth { for_x' = orange + nota; }\n}\n\
                simulate simulate of model {\n  expect at at at ~ at at at within within;\n  output every every every;\n}\n";
    assert_snapshot!(canonical(text), @r"
    model model {
      state region = 1;
      region' = 1;
      state' = state.of[in_1];
      let at = always*within;
      region free where if_ < thenceforth {
        for_x' = orange + nota;
      }
    }
    simulate simulate of model {
      expect at at at ~ at at at within within;
      output every every every;
    }
    ");
}

#[test]
fn names_are_normalized() {
    assert_snapshot!(canonical("const ﬁ = θ_1 + ｘ;"), @"const fi = θ_1 + x;");
}

#[test]
fn comments_and_blanks_of_all_kinds_are_no_syntax() {
    let text = "\u{feff}// a\r\n/// b; { ( \"\r\nconst\u{a0}a\u{2003}= 1; // end";
    assert_snapshot!(canonical(text), @"const a = 1;");
}

#[test]
fn spans_cover_what_was_written() {
    let text = "model m {\n  x[1] ' = -(a + b) ;  // end\n  region r else { x' = 1; }  \n}\n";
    let file = read(text);
    let Item::Model(model) = &file.items[0] else {
        panic!("no model");
    };
    let spans = model.body.iter().map(|statement| match statement {
        super::Stmt::Dynamics(stmt) => vec![stmt.span, stmt.target.span, stmt.value.span],
        super::Stmt::Region(stmt) => vec![stmt.span, stmt.name.span],
        _ => vec![],
    });
    let spans: Vec<&str> = spans
        .flatten()
        .map(|span| &text[span.start as usize..span.end as usize])
        .collect();
    assert_eq!(
        spans,
        [
            "x[1] ' = -(a + b) ;",
            "x[1]",
            "-(a + b)",
            "region r else { x' = 1; }",
            "r"
        ]
    );
}
