//! The one layout of files.

use insta::assert_snapshot;

use super::{read, skeleton};
use crate::diagnostics::Diagnostics;
use crate::source::SourceMap;
use crate::syntax::format;

/// The formatted text, which has the same tree and is not changed again.
pub fn formatted(text: &str) -> String {
    let once = once(text);
    assert_eq!(self::once(&once), once, "formatting twice changes\n{text}");
    assert_eq!(skeleton(&read(&once)), skeleton(&read(text)), "{once}");
    once
}

fn once(text: &str) -> String {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = sources.add("test.nsd", text);
    format(&file, &mut diags).unwrap_or_else(|| panic!("{text} has errors: {:?}", diags.codes()))
}

#[test]
fn blanks_follow_the_operators() {
    assert_snapshot!(formatted(
        "model m{let a=x [1]*  x[ 2 ]/-y ^ - 2+( b-c ) .* d . e-[ 1,2 ;3 , 4 ]*A[ : , i + 1 ];\n\
         param k:N / m^ 2 in[ 0,10 ]=1;control on in{0,1}=0;x ' +=f( a,fit=cubic )- -1;\n\
         let b=if a<0 and not(b>=c)then sum(x[i] for i in 1 .. n - 1)else[ 1 ; 2 ; ];}\n\
         use std . friction . { coulomb , stribeck as curve } ; use ../lib/plant  as p;"
    ), @r"
    model m {
      let a = x[1]*x[2]/-y^-2 + (b - c).*d.e - [1, 2; 3, 4]*A[:, i + 1];
      param k : N/m^2 in [0, 10] = 1;
      control on in {0, 1} = 0;
      x' += f(a, fit = cubic) - -1;
      let b = if a < 0 and not (b >= c) then sum(x[i] for i in 1..n-1) else [1; 2;];
    }
    use std.friction.{coulomb, stribeck as curve};
    use ../lib/plant as p;
    ");
}

#[test]
fn numbers_have_digits_on_both_sides_of_the_point() {
    assert_snapshot!(formatted(
        "model m { let a = 1. * .5 ./ 2.e3 + [.5, 1.;] .* 3. - x[1. .. 2]; let b=2.*a-2./a^.5; } // 1."
    ), @r"
    model m { let a = 1.0*0.5./2.0e3 + [0.5, 1.0;].*3.0 - x[1.0..2]; let b = 2.*a - 2./a^0.5; }  // 1.
    ");
}

#[test]
fn units_stand_behind_their_numbers() {
    assert_snapshot!(formatted(
        "model m { let a = sin(5   rad / s*time)-9.81 m / s ^ 2+2 (J / ( kg * K ))/3 ms^-1*[1 s , 2]; }"
    ), @r"
    model m { let a = sin(5 rad/s*time) - 9.81 m/s^2 + 2 (J/(kg*K))/3 ms^-1*[1 s, 2]; }
    ");
}

#[test]
fn short_blocks_stay_on_their_line() {
    assert_snapshot!(formatted(
        "model a { state x=0;x'=1; }\n\
         model b { state x = 0;\n x' = 1; }\n\
         model c { region r where x > 0 { x' = 1; } region s else { x' = 2; }; }\n\
         simulate long of a { horizon 1; method fesd { scheme = radau_iia(4); } expect x at end ~ 12345678 within 1e-9; }\n\
         simulate empty of a {\n}\n"
    ), @r"
    model a { state x = 0; x' = 1; }
    model b {
      state x = 0;
      x' = 1;
    }
    model c { region r where x > 0 { x' = 1; } region s else { x' = 2; } }
    simulate long of a {
      horizon 1;
      method fesd { scheme = radau_iia(4); }
      expect x at end ~ 12345678 within 1e-9;
    }
    simulate empty of a {}
    ");
}

#[test]
fn comments_stay_where_they_belong() {
    assert_snapshot!(formatted(
        "\n\n// head\n\n\n/// doc\nmodel m { // opening\n\n  // first\n  state x = 0;// one\n  state long_name = 0;   // two\n\n\n\
         // own\n  let a = [1, // inside\n  // between\n  2]; // behind\n  region r where a > 0 // guard\n  { x' = 1; }\n  \
         x' = // value\n   1 // last\n ;\n  // end\n}\n// foot"
    ), @r"
    // head

    /// doc
    model m {  // opening
      // first
      state x = 0;          // one
      state long_name = 0;  // two

      // own
      let a = [1,  // inside
        // between
        2];                   // behind
      region r where a > 0 {  // guard
        x' = 1;
      }
      x' =  // value
        1;  // last
      // end
    }
    // foot
    ");
}

#[test]
fn line_breaks_inside_statements_stay() {
    assert_snapshot!(formatted(
        "model m {\n let A = [\n1, 2;\n   3, 4\n ];\nx' = a\n+ f(b,\nc)\n  - d;\nregion r where a > 0\nand b > 0 { x' = 1; }\n\
         project x onto { a >= 0;\nb >= 0; }\n metric E;\nlet b\n= 1\n;\n}"
    ), @r"
    model m {
      let A = [
        1, 2;
        3, 4
      ];
      x' = a
        + f(b,
        c)
        - d;
      region r where a > 0
        and b > 0 { x' = 1; }
      project x onto {
        a >= 0;
        b >= 0;
      } metric E;
      let b
        = 1;
    }
    ");
}
