//! What names refer to.

use insta::assert_snapshot;

use super::{Hir, Reference, References};
use crate::diagnostics::Diagnostics;
use crate::source::SourceMap;
use crate::syntax::{Item, parse};

/// Every name of the last model that refers to something, then those of the file, in order of appearance.
fn references(text: &str) -> String {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let models = file.items.iter().rev();
    let mut models = models.filter_map(|item| match item {
        Item::Model(model) => Some(model),
        _ => None,
    });
    let model = Hir::default().model(&file, models.next().expect("a model"), &mut diags);
    assert!(!diags.has_errors());
    let line = |references: &References<'_>| {
        let mut found: Vec<_> = references.iter().collect();
        found.sort_by_key(|(span, _)| span.start);
        let words = found.iter().map(|&(&span, reference)| {
            let what = match *reference {
                Reference::Index => "index".to_owned(),
                Reference::Argument(position) => format!("argument {position}"),
                Reference::Let(named) => format!("let = {}", named.value),
                Reference::Own(index) => format!("own {}", model.declared[index].name),
                Reference::Global(index) => format!("global {}", model.file.globals[index].name),
                Reference::BuiltIn => "built in".to_owned(),
            };
            format!("{}: {what}", sources.text(span))
        });
        words.collect::<Vec<_>>().join("; ")
    };
    let (own, of_file) = (line(&model.references), line(&model.file.references));
    format!("{own}\n{of_file}")
}

/// The innermost declaration counts: an index before an argument, a `let` of its own block before that of another.
#[test]
fn names_refer_to_what_is_declared_next_to_them() {
    let text = "
        const k = 2;
        fn f(i, x) = i + k + sum(i*x for i in 1..i);
        model m {
          state x = 1; state y[2] = 0;
          region a where x > 0 { let r = f(x, k); x' = r; }
          region b where x < 0 { let r = pi; x' = r + missing; }
          for i in 1..2 { let r = x; y[i]' = r + [j for j in 1..i][i]; }
        }";
    assert_snapshot!(references(text), @"
    x: own x; f: global f; x: own x; k: global k; r: let = f(x, k); x: own x; pi: built in; r: let = pi; x: own x; r: let = x; j: index; i: index; i: index
    i: argument 0; k: global k; sum: built in; i: index; x: argument 1; i: argument 0
    ");
}

/// A name that is read twice counts where it stands first: the order of declarations that follow from it stays.
#[test]
fn what_is_read_again_does_not_change_the_order() {
    let order_of = |value: &str| {
        let text = format!(
            "model m {{ state x = 1; for i in 1..1 {{ let a = p; let b = q; switch s = sign(x + {value}); }}
             switch q = sign(x - 1); switch p = sign(x - 2); x' = 0; }}"
        );
        let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
        let file = parse(&sources.add("test.nsd", &text), &mut diags);
        let Some(Item::Model(item)) = file.items.first() else {
            panic!("a model");
        };
        let model = Hir::default().model(&file, item, &mut diags);
        let order = super::order::order(&model, &[], &mut diags);
        let names = order
            .into_iter()
            .map(|at| model.declared[at].name.name.clone());
        names.collect::<Vec<_>>().join(" ")
    };
    assert_eq!(order_of("a + b"), "x q p s");
    assert_eq!(order_of("b + a"), "x p q s");
    for again in ["a + b + a", "a + b + b + a + b", "a + a + b"] {
        assert_eq!(order_of(again), "x q p s", "{again}");
    }
}
