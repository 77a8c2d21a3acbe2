//! Abstract syntax -> canonical source text: what `emit --ir ast` shows.
//!
//! One statement per line, no comments, parentheses only where the tree needs
//! them. Parsing the text gives the same tree back, up to positions.

mod experiment;
pub(super) mod expression;
mod statement;

use std::fmt::{self, Display, Formatter};

use super::ast::*;

impl Display for File {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut printer = Printer::default();
        for item in &self.items {
            printer.item(item);
        }
        f.write_str(&printer.text)
    }
}

impl Display for Expr {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&expression::text(self))
    }
}

impl Display for Path {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.head.name)?;
        for segment in &self.rest {
            match segment {
                Segment::Field(name) => write!(f, ".{name}")?,
                Segment::Index(indices) => write!(f, "[{}]", expression::indices(indices))?,
            }
        }
        Ok(())
    }
}

impl Display for Ident {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

/// Lines of text at a depth of blocks.
#[derive(Default)]
struct Printer {
    text: String,
    depth: usize,
}

impl Printer {
    fn line(&mut self, text: impl Display) {
        let indent = 2 * self.depth;
        self.text.push_str(&format!("{:indent$}{text}\n", ""));
    }

    /// `head {`, the members one level deeper, `}` with what follows it.
    fn block(&mut self, head: impl Display, tail: &str, members: impl FnOnce(&mut Self)) {
        self.line(format!("{head} {{"));
        self.depth += 1;
        members(self);
        self.depth -= 1;
        self.line(format!("}}{tail}"));
    }

    fn bad(&mut self) {
        self.line("// a statement that could not be read");
    }

    fn item(&mut self, item: &Item) {
        match item {
            Item::Use(item) => self.use_item(item),
            Item::Const(item) => self.line(format!("const {} = {};", item.name, item.value)),
            Item::Fn(item) => self.line(format!(
                "fn {}({}) = {};",
                item.name,
                list(&item.params),
                item.body
            )),
            Item::Model(item) => self.block(format!("model {}", item.name), "", |printer| {
                printer.statements(&item.body);
            }),
            Item::Experiment(item) => self.experiment(item),
            Item::ExpectDiagnostic(item) => {
                self.line(format!("expect {} {};", item.severity, item.code))
            }
            Item::Bad(_) => self.bad(),
        }
    }

    fn use_item(&mut self, item: &Use) {
        let source = match &item.source {
            UseSource::Relative(path) => path.name.clone(),
            UseSource::Dotted(path) => join(path.iter(), "."),
        };
        let alias = |alias: &Option<Ident>| {
            alias
                .as_ref()
                .map(|name| format!(" as {name}"))
                .unwrap_or_default()
        };
        let names = item
            .names
            .iter()
            .map(|(name, local)| format!("{name}{}", alias(local)));
        let names = match item.names.is_empty() {
            true => String::new(),
            false => format!(".{{{}}}", join(names, ", ")),
        };
        self.line(format!("use {source}{names}{};", alias(&item.alias)));
    }
}

fn join(parts: impl Iterator<Item = impl Display>, separator: &str) -> String {
    let parts: Vec<String> = parts.map(|part| part.to_string()).collect();
    parts.join(separator)
}

fn list(parts: &[impl Display]) -> String {
    join(parts.iter(), ", ")
}
