//! What a model declares, in loops too, and whether each name has one meaning.

pub(crate) mod bind;
pub(crate) mod connect;
pub(crate) mod fields;
pub(crate) mod file;
pub(crate) mod import;
pub(crate) mod lookup;
pub(crate) mod order;
pub(crate) mod parts;
pub(crate) mod places;
pub(crate) mod reserved;
pub(crate) mod scope;
pub(crate) mod target;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::ModelError;
use crate::diagnostics::Diagnostics;
use crate::model::names::file::FileNames;
use crate::model::names::reserved::is_builtin;
use crate::source::Span;
use crate::syntax::{
    Binder, Const, Contact, Decl, Ident, Model, Named, NamedKind, Part, Program, Region, Stmt,
    Switch,
};

/// A loop around a declaration, with the `let`s that stand in it.
#[derive(Clone)]
pub(crate) struct Frame<'f> {
    pub binders: &'f [Binder],
    pub lets: Vec<Rc<Named>>,
    pub span: Span,
}

/// A declaration that has a meaning of its own.
pub(crate) struct Declared<'f> {
    pub name: &'f Ident,
    pub item: Item<'f>,
    /// Loops around it, outermost first.
    pub frames: Vec<Frame<'f>>,
}

/// What is declared.
#[derive(Clone, Copy)]
pub(crate) enum Item<'f> {
    Const(&'f Const),
    Decl(&'f Decl),
    Named(&'f Named),
    Switch(&'f Switch),
    Part(&'f Part),
    Program(&'f Program),
    /// A name that is not a value.
    Word(&'static str),
    /// Something that is wrong.
    Unsupported,
}

/// The declarations of a model; what takes a name twice is [`Item::Unsupported`].
pub(super) fn collect<'f>(
    model: &'f Model,
    file: &FileNames<'f>,
    diags: &mut Diagnostics,
) -> Vec<Declared<'f>> {
    let mut collector = Collector {
        file,
        diags,
        seen: FxHashMap::default(),
        declared: vec![],
        frames: vec![],
    };
    collector.block(&model.body, None);
    // Local names are compared with those of the whole model, so they come last.
    collector.locals(&model.body, false);
    collector.declared
}

/// The `let`s that stand directly in a block.
pub(super) fn local_lets(body: &[Stmt]) -> Vec<Rc<Named>> {
    let lets = body.iter().filter_map(|stmt| match stmt {
        Stmt::Named(named) if named.kind == NamedKind::Let => Some(Rc::new(named.clone())),
        _ => None,
    });
    lets.collect()
}

struct Collector<'c, 'f> {
    file: &'c FileNames<'f>,
    diags: &'c mut Diagnostics,
    seen: FxHashMap<&'f str, Span>,
    declared: Vec<Declared<'f>>,
    frames: Vec<Frame<'f>>,
}

impl<'f> Collector<'_, 'f> {
    /// Declarations of a block; `place` says which block, unless it is the model itself.
    fn block(&mut self, body: &'f [Stmt], place: Option<&'static str>) {
        let outside_loops = place.filter(|&place| place != "a loop");
        for stmt in body {
            match stmt {
                Stmt::Const(item) => {
                    self.top(&item.name, Item::Const(item), "a `const`", place, item.span)
                }
                Stmt::Decl(decl) => {
                    let item = Item::Decl(decl);
                    self.top(&decl.name, item, "a declaration", place, decl.span);
                }
                Stmt::Named(named) if named.kind == NamedKind::Let && place.is_some() => {}
                Stmt::Named(named) => {
                    let item = Item::Named(named);
                    let what = "an `output` or `signal`";
                    self.top(&named.name, item, what, place, named.span);
                }
                Stmt::Part(part) => {
                    self.top(&part.name, Item::Part(part), "a `part`", place, part.span)
                }
                Stmt::Switch(switch) => {
                    let item = Item::Switch(switch);
                    self.in_loops(&switch.name, item, "a `switch`", place, switch.span);
                }
                Stmt::Region(region) => self.region(region, place),
                Stmt::Jump(jump) => {
                    self.in_loops(&jump.name, Item::Word("jump"), "a `jump`", place, jump.span)
                }
                Stmt::Contact(contact) => self.contact(contact, place),
                Stmt::Mechanics(mechanics) => {
                    for contact in &mechanics.contacts {
                        self.contact(contact, place);
                    }
                }
                Stmt::Program(program) => {
                    let item = Item::Program(program);
                    self.top(&program.name, item, "a program", place, program.span);
                }
                Stmt::For(repeat) => {
                    let lets = local_lets(&repeat.body);
                    self.frames.push(Frame {
                        binders: &repeat.binders,
                        lets,
                        span: repeat.span,
                    });
                    self.block(&repeat.body, place.or(Some("a loop")));
                    self.frames.pop();
                }
                Stmt::Hidden(hidden) => {
                    self.misplaced("a `hidden` block", outside_loops, hidden.span);
                    self.block(&hidden.body, Some("a `hidden` block"));
                }
                Stmt::Project(project) => {
                    self.misplaced("a projection", outside_loops, project.span);
                }
                Stmt::Equation { span, .. } | Stmt::Complementarity { span, .. } => {
                    self.misplaced("an equation", outside_loops, *span);
                }
                Stmt::Dynamics(_) | Stmt::Bad(_) => {}
            }
        }
    }

    fn contact(&mut self, contact: &'f Contact, place: Option<&'static str>) {
        let item = Item::Word("contact");
        self.in_loops(&contact.name, item, "a `contact`", place, contact.span);
    }

    fn region(&mut self, region: &'f Region, place: Option<&'static str>) {
        let item = Item::Word("region");
        self.in_loops(&region.name, item, "a `region`", place, region.span);
        self.block(&region.body, Some("a region"));
    }

    /// What stands only at the top of a model.
    fn top(
        &mut self,
        name: &'f Ident,
        item: Item<'f>,
        statement: &'static str,
        place: Option<&'static str>,
        span: Span,
    ) {
        let item = if self.misplaced(statement, place, span) {
            Item::Unsupported
        } else {
            item
        };
        self.declare(name, item, vec![]);
    }

    /// What stands at the top of a model or in its loops.
    fn in_loops(
        &mut self,
        name: &'f Ident,
        item: Item<'f>,
        statement: &'static str,
        place: Option<&'static str>,
        span: Span,
    ) {
        let wrong = self.misplaced(statement, place.filter(|&place| place != "a loop"), span);
        let item = if wrong { Item::Unsupported } else { item };
        self.declare(name, item, self.frames.clone());
    }

    fn misplaced(
        &mut self,
        statement: &'static str,
        place: Option<&'static str>,
        span: Span,
    ) -> bool {
        if let Some(place) = place {
            self.diags.push(ModelError::Misplaced {
                statement,
                place,
                span,
            });
        }
        place.is_some()
    }

    fn declare(&mut self, name: &'f Ident, item: Item<'f>, frames: Vec<Frame<'f>>) {
        if self.is_free(name) {
            self.seen.insert(&name.name, name.span);
            self.declared.push(Declared { name, item, frames });
        } else if let Some(known) = self
            .declared
            .iter_mut()
            .find(|known| known.name.name == name.name)
        {
            // Which of the two is meant is unknown.
            known.item = Item::Unsupported;
        } else if is_builtin(&name.name) {
            let item = Item::Unsupported;
            self.declared.push(Declared { name, item, frames });
        }
    }

    fn is_free(&mut self, name: &Ident) -> bool {
        let text = &name.name;
        let error = if is_builtin(text) {
            ModelError::BuiltIn {
                name: text.clone(),
                span: name.span,
            }
        } else if let Some(&first) = self.seen.get(text.as_str()) {
            ModelError::Redeclared {
                name: text.clone(),
                first,
                second: name.span,
            }
        } else if let Some((kind, first)) = self.file.get(text) {
            ModelError::ShadowsFile {
                name: text.clone(),
                kind,
                first,
                second: name.span,
            }
        } else {
            return true;
        };
        self.diags.push(error);
        false
    }

    /// Names of `let`s and indices in the blocks of a model.
    fn locals(&mut self, body: &'f [Stmt], inside: bool) {
        let mut here: FxHashMap<&str, Span> = FxHashMap::default();
        for stmt in body {
            match stmt {
                Stmt::Named(named) if inside && named.kind == NamedKind::Let => {
                    let (name, second) = (named.name.name.as_str(), named.name.span);
                    if let Some(first) = here.insert(name, second) {
                        self.diags.push(ModelError::Redeclared {
                            name: name.to_owned(),
                            first,
                            second,
                        });
                    } else {
                        self.is_free(&named.name);
                    }
                }
                Stmt::For(repeat) => {
                    for binder in repeat
                        .binders
                        .iter()
                        .filter(|binder| is_builtin(&binder.name.name))
                    {
                        let (name, span) = (binder.name.name.clone(), binder.name.span);
                        self.diags.push(ModelError::BuiltIn { name, span });
                    }
                    self.locals(&repeat.body, true);
                }
                Stmt::Region(region) => self.locals(&region.body, true),
                Stmt::Hidden(hidden) => self.locals(&hidden.body, true),
                _ => {}
            }
        }
    }
}
