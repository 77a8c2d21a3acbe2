//! Dependencies between declarations: an order in which each comes after what it needs.

use miette::LabeledSpan;

use super::{Declared, Definition, Model, Reference, References, import, read};
use crate::diagnostics::Diagnostics;
use crate::model::errors::ModelError;
use crate::source::Span;
use crate::syntax::{
    self, Bind, Binder, Const, Expr, File, Ident, Named, Part, Path, Segment, Stmt,
};

/// An order of the declarations of a model; those in cycles are left out and reported.
pub(crate) fn order(model: &Model<'_>, with: &[Bind], diags: &mut Diagnostics) -> Vec<usize> {
    let declared = &model.declared;
    let names: Vec<&str> = declared
        .iter()
        .map(|declared| declared.name.name.as_str())
        .collect();
    let needs: Vec<Vec<usize>> = declared
        .iter()
        .map(|declared| needs(model, declared, with))
        .collect();
    let (order, cycles) = topological(&needs);
    let mut in_cycle = vec![false; declared.len()];
    for cycle in cycles {
        if cycle.iter().any(|&node| in_cycle[node]) {
            continue;
        }
        cycle.iter().for_each(|&node| in_cycle[node] = true);
        let what = format!("`{}`", names[cycle[0]]);
        let span = declared[cycle[0]].name.span;
        diags.push(ModelError::Cycle {
            what,
            chain: chain(&cycle, &names),
            span,
            others: others(&cycle, &names, |node| declared[node].name.span),
        });
    }
    order.into_iter().filter(|&node| !in_cycle[node]).collect()
}

/// Declarations that must have a value before another one has, in order of appearance.
fn needs(model: &Model<'_>, declared: &Declared<'_>, with: &[Bind]) -> Vec<usize> {
    match declared.item {
        Definition::Const(item) => match given(item, with) {
            Some(value) => model.read_outside(value),
            None => model.read([&item.value]),
        },
        Definition::Decl(decl) => model.read(&decl.shape),
        // The words of a table are no names.
        Definition::Named(named) if syntax::table_of(named).is_some() => vec![],
        Definition::Named(named) => model.read([&named.value]),
        Definition::Switch(switch) => {
            let frames = &declared.frames;
            let mut values = vec![&switch.value];
            let lets = used_lets(&switch.value, &model.references);
            values.extend(lets.iter().map(|named| &named.value));
            values.extend(bounds(frames.iter().flat_map(|frame| frame.binders)));
            model.read(values)
        }
        Definition::Part(part) => part_needs(model, part, with),
        Definition::Program(program) => model.read(&program.shape),
        Definition::Word(..) | Definition::Unsupported => vec![],
    }
}

/// Only structural constants are needed before a part is there.
fn part_needs(model: &Model<'_>, part: &Part, with: &[Bind]) -> Vec<usize> {
    let mut values: Vec<&Expr> = bounds(&part.binder).collect();
    let file = model.file.file;
    if let Some((file, item)) = import::find_silently(file, &part.model) {
        let consts = part.binds.iter();
        let consts = consts.filter(|bind| names_const(file, item, &bind.target));
        values.extend(consts.map(|bind| &bind.value));
    }
    let mut needs = model.read(values);
    for bind in with {
        if bind.target.head.name == part.name.name && !bind.target.rest.is_empty() {
            needs.extend(model.read_outside(&bind.value));
        }
    }
    needs
}

fn bounds<'b>(binders: impl IntoIterator<Item = &'b Binder>) -> impl Iterator<Item = &'b Expr> {
    binders
        .into_iter()
        .flat_map(|binder| [&binder.first, &binder.last])
}

/// Local `let`s that an expression reads, directly or through each other.
fn used_lets<'f>(expr: &Expr, references: &References<'f>) -> Vec<&'f Named> {
    let lets = |expr: &Expr| {
        let read = read(expr, references).into_iter();
        read.filter_map(|reference| match reference {
            Reference::Let(named) => Some(named),
            _ => None,
        })
    };
    let mut used: Vec<&Named> = vec![];
    let mut open: Vec<&Named> = lets(expr).collect();
    while let Some(named) = open.pop() {
        if !used.iter().any(|other| std::ptr::eq(*other, named)) {
            used.push(named);
            open.extend(lets(&named.value));
        }
    }
    used
}

/// The value that an experiment gives to a constant.
pub(crate) fn given<'w>(item: &Const, with: &'w [Bind]) -> Option<&'w Expr> {
    let of_const =
        |bind: &&Bind| bind.target.rest.is_empty() && bind.target.head.name == item.name.name;
    with.iter().rev().find(of_const).map(|bind| &bind.value)
}

/// True for a path from a model to a structural constant, its own or one of its parts'.
pub(crate) fn names_const(file: &File, item: &syntax::Model, path: &Path) -> bool {
    let (mut file, mut item) = (file, item);
    let (mut head, mut rest): (&Ident, &[Segment]) = (&path.head, &path.rest);
    loop {
        let found = item.body.iter().find_map(|stmt| match stmt {
            Stmt::Const(known) if known.name.name == head.name => Some(None),
            Stmt::Part(part) if part.name.name == head.name => Some(Some(part)),
            _ => None,
        });
        let part = match found {
            Some(Some(part)) => part,
            Some(None) => return rest.is_empty(),
            None => return false,
        };
        if part.binder.is_some()
            && let [Segment::Index(_), after @ ..] = rest
        {
            rest = after;
        }
        let [Segment::Field(field), after @ ..] = rest else {
            return false;
        };
        (head, rest) = (field, after);
        match import::find_silently(file, &part.model) {
            Some(found) => (file, item) = found,
            None => return false,
        }
    }
}

/// Nodes in an order where needs come first, or the nodes of a cycle in order.
pub(crate) fn topological(needs: &[Vec<usize>]) -> (Vec<usize>, Vec<Vec<usize>>) {
    #[derive(Clone, Copy, PartialEq)]
    enum Mark {
        New,
        Open,
        Done,
    }
    let mut marks = vec![Mark::New; needs.len()];
    let (mut order, mut cycles) = (Vec::new(), Vec::new());
    for start in 0..needs.len() {
        if marks[start] != Mark::New {
            continue;
        }
        // Depth first with a stack of its own: chains may be as long as the file.
        let mut path = vec![(start, 0)];
        marks[start] = Mark::Open;
        while let Some(&mut (node, ref mut next)) = path.last_mut() {
            let Some(&need) = needs[node].get(*next) else {
                marks[node] = Mark::Done;
                order.push(node);
                path.pop();
                continue;
            };
            *next += 1;
            match marks[need] {
                Mark::Done => {}
                Mark::New => {
                    marks[need] = Mark::Open;
                    path.push((need, 0));
                }
                Mark::Open => {
                    let from = path.iter().position(|&(open, _)| open == need).unwrap_or(0);
                    cycles.push(path[from..].iter().map(|&(node, _)| node).collect());
                }
            }
        }
    }
    (order, cycles)
}

/// `a -> b -> a`
pub(crate) fn chain(cycle: &[usize], names: &[&str]) -> String {
    let closed = cycle.iter().chain(cycle.first());
    closed
        .map(|&node| names[node])
        .collect::<Vec<_>>()
        .join(" -> ")
}

/// What the members of a cycle but the first need, each where it is declared.
pub(crate) fn others(
    cycle: &[usize],
    names: &[&str],
    span: impl Fn(usize) -> Span,
) -> Vec<LabeledSpan> {
    let next = cycle.iter().cycle().skip(2);
    let pairs = cycle.iter().skip(1).zip(next);
    let label = |(&node, &next): (&usize, &usize)| {
        let text = format!("needs `{}`", names[next]);
        LabeledSpan::new_with_span(Some(text), span(node))
    };
    pairs.map(label).collect()
}
