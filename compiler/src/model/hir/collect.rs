//! What a model declares, in loops too, and whether each name has one meaning.

use rustc_hash::FxHashMap;

use super::reserved::{VALUES, taken};
use super::{Declared, Definition, File, Frame, Global, shared_lets};
use crate::diagnostics::Diagnostics;
use crate::model::errors::ModelError;
use crate::source::Span;
use crate::syntax::{Binder, Contact, Ident, Model, NamedKind, Region, Stmt};

/// The declarations of a model; what takes a name twice is [`Definition::Unsupported`].
pub(super) fn collect<'f>(
    model: &'f Model,
    file: &File<'f>,
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

struct Collector<'c, 'f> {
    file: &'c File<'f>,
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
                Stmt::Const(own) => {
                    let item = Definition::Const(own);
                    self.top(&own.name, item, "a `const`", place, own.span);
                }
                Stmt::Decl(decl) => {
                    let item = Definition::Decl(decl);
                    self.top(&decl.name, item, "a declaration", place, decl.span);
                }
                Stmt::Named(named) if named.kind == NamedKind::Let && place.is_some() => {}
                Stmt::Named(named) => {
                    let item = Definition::Named(named);
                    let what = "an `output` or `signal`";
                    self.top(&named.name, item, what, place, named.span);
                }
                Stmt::Part(part) => {
                    let item = Definition::Part(part);
                    self.top(&part.name, item, "a `part`", place, part.span);
                }
                Stmt::Switch(switch) => {
                    let item = Definition::Switch(switch);
                    self.in_loops(&switch.name, item, "a `switch`", place, switch.span);
                }
                Stmt::Region(region) => self.region(region, place),
                Stmt::Jump(jump) => {
                    let item = Definition::Word("jump", jump.span);
                    let what = "a `jump`";
                    match &jump.name {
                        Some(name) => self.in_loops(name, item, what, place, jump.span),
                        None => {
                            self.misplaced(what, outside_loops, jump.span);
                        }
                    }
                }
                Stmt::Contact(contact) => self.contact(contact, place),
                Stmt::Mechanics(mechanics) => {
                    for contact in &mechanics.contacts {
                        self.contact(contact, place);
                    }
                }
                Stmt::Program(program) => {
                    let item = Definition::Program(program);
                    self.top(&program.name, item, "a program", place, program.span);
                }
                Stmt::For(repeat) => {
                    let lets = shared_lets(&repeat.body);
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
        let item = Definition::Word("contact", contact.span);
        self.in_loops(&contact.name, item, "a `contact`", place, contact.span);
    }

    fn region(&mut self, region: &'f Region, place: Option<&'static str>) {
        let item = Definition::Word("region", region.span);
        self.in_loops(&region.name, item, "a `region`", place, region.span);
        self.block(&region.body, Some("a region"));
    }

    /// What stands only at the top of a model.
    fn top(
        &mut self,
        name: &'f Ident,
        item: Definition<'f>,
        statement: &'static str,
        place: Option<&'static str>,
        span: Span,
    ) {
        let item = if self.misplaced(statement, place, span) {
            Definition::Unsupported
        } else {
            item
        };
        self.declare(name, item, vec![]);
    }

    /// What stands at the top of a model or in its loops.
    fn in_loops(
        &mut self,
        name: &'f Ident,
        item: Definition<'f>,
        statement: &'static str,
        place: Option<&'static str>,
        span: Span,
    ) {
        let wrong = self.misplaced(statement, place.filter(|&place| place != "a loop"), span);
        let item = if wrong { Definition::Unsupported } else { item };
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

    fn declare(&mut self, name: &'f Ident, item: Definition<'f>, frames: Vec<Frame<'f>>) {
        if self.is_free(name) {
            self.seen.insert(&name.name, name.span);
            self.declared.push(Declared { name, item, frames });
        } else if let Some(known) = self
            .declared
            .iter_mut()
            .find(|known| known.name.name == name.name)
        {
            // Which of the two is meant is unknown.
            known.item = Definition::Unsupported;
        } else if VALUES.contains(&name.name.as_str()) {
            let item = Definition::Unsupported;
            self.declared.push(Declared { name, item, frames });
        }
    }

    fn is_free(&mut self, name: &Ident) -> bool {
        let text = &name.name;
        let built_in = taken(text, name.span);
        let is_value = VALUES.contains(&text.as_str());
        let of_file = self.file.get(text);
        // What is no value is told apart by where it stands.
        let of_file = of_file.filter(|known| !matches!(known.global, Global::Model(_)));
        let error = if let Some(&first) = self.seen.get(text.as_str()) {
            ModelError::Redeclared {
                name: text.clone(),
                first,
                second: name.span,
            }
        } else if let Some(known) = of_file.filter(|_| !is_value) {
            ModelError::ShadowsFile {
                name: text.clone(),
                kind: known.global.word(),
                first: known.span,
                second: name.span,
            }
        } else {
            if let Some(error) = built_in {
                self.diags.push(error);
            }
            return !is_value;
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
                    for Binder { name, .. } in &repeat.binders {
                        if let Some(error) = taken(&name.name, name.span) {
                            self.diags.push(error);
                        }
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
