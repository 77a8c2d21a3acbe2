//! What stands at a position, in words.

pub mod cache;
pub mod facts;

use std::rc::Rc;

use lsp_types::{Hover, HoverContents, HoverParams, MarkupContent, MarkupKind, Position, Range};

use self::cache::Cache;
use self::facts::{Facts, model_at, numbers};
use super::around::Around;
use super::world::{Analysis, World};
use super::{Answer, reference};
use crate::diagnostics::explain;
use crate::model::hir::reserved::is_function;
use crate::model::index::{Definition, Kind};
use crate::model::inferred;
use crate::project::describe;
use crate::syntax::Stmt;

/// Lines of a declaration that are shown.
const MOST_LINES: usize = 8;

/// What is known of what stands at a position.
pub fn hover(world: &mut World, cache: &Cache<'_>, params: &HoverParams) -> Answer<Option<Hover>> {
    let at = &params.text_document_position_params;
    let uri = &at.text_document.uri;
    let Some([now, good]) = world.states(uri) else {
        return Ok(None);
    };
    let sound = world.sound(uri).filter(|sound| !Rc::ptr_eq(sound, &now));
    let Some(token) = now.word(at.position) else {
        return Ok(None);
    };
    let range = now.lines().range(token.start..token.end());
    let named = now
        .named(at.position)
        .map(|(_, known)| (&now, at.position, known));
    // While a line is broken, what was there before it was.
    let named = named.or_else(|| {
        let (position, known) = good.named_then(&now, at.position)?;
        Some((&good, position, known))
    });
    let Some((then, position, known)) = named else {
        return Ok(of_word(&now, token.text, at.position).map(|text| shown(text, range)));
    };
    let meant = then.index.meant(known);
    let mut text = of_definition(then, meant);
    if let Some(model) = then.index.model_of(meant) {
        let of = Declared {
            cache,
            then,
            meant,
            model,
            experiment: then.index.experiment_at(then.at(position)),
            part: part_at(then, position),
        };
        let is_taken = Rc::ptr_eq(then, &now) && of.now(&mut text);
        if let Some(sound) = sound.filter(|_| !is_taken && now.checked().has_errors()) {
            of.before(&now, &sound, &mut text);
        }
    }
    Ok(Some(shown(text, range)))
}

fn shown(value: String, range: Range) -> Hover {
    let kind = MarkupKind::Markdown;
    Hover {
        contents: HoverContents::Markup(MarkupContent { kind, value }),
        range: Some(range),
    }
}

/// A declaration with its comment.
fn of_definition(then: &Analysis, meant: &Definition) -> String {
    let mut text = format!("```nsd\n{}\n```", declaration(then, meant));
    if let Some(doc) = describe::doc(meant.whole, &then.project.sources) {
        text.push_str(&format!("\n\n{doc}"));
    }
    text.push_str(&format!("\n\n{}", meant.kind.word()));
    if let Some(model) = then.index.model_of(meant) {
        text.push_str(&format!(" of `{}`", model.name));
    }
    text
}

/// What is declared in a model.
struct Declared<'d, 'e> {
    cache: &'d Cache<'e>,
    then: &'d Rc<Analysis>,
    meant: &'d Definition,
    model: &'d Definition,
    /// The experiment that it is named in.
    experiment: Option<&'d Definition>,
    /// The part that it is named of.
    part: Option<String>,
}

/// The part that a name at a position is of, as it is written there: `legs[2]` of `legs[2].x`, and of what stands in its braces.
fn part_at(then: &Analysis, position: Position) -> Option<String> {
    let text = &then.source().text;
    let before = &text[..then.word(position)?.start];
    if let Some(path) = before.strip_suffix('.') {
        let is_in_path = |c: char| c.is_alphanumeric() || "_.[]".contains(c);
        return Some(path[path.trim_end_matches(is_in_path).len()..].to_owned());
    }
    let at = then.at(position);
    let statements = then.models().flat_map(|model| &model.body);
    let mut parts = statements.filter_map(|stmt| match stmt {
        Stmt::Part(part) if part.model.span.end <= at && at <= part.span.end => Some(part),
        _ => None,
    });
    Some(parts.next()?.name.name.clone())
}

impl<'e> Declared<'_, 'e> {
    /// Its unit and shape, and its value and equations in an experiment; whether one takes the model.
    fn now(&self, text: &mut String) -> bool {
        let mut taken = self.taken(self.then, self.model);
        let first = taken.next();
        match &first {
            Some(facts) => self.value(facts, text),
            None => {
                let alone = Facts::alone(self.cache, self.then, self.model.place);
                alone.iter().for_each(|facts| self.value(facts, text));
            }
        }
        let is_taken = first.is_some();
        // What a system calls nowhere is not looked for in other experiments.
        let others = match self.meant.kind {
            Kind::Param | Kind::Constant | Kind::Control | Kind::Input | Kind::Let => 0,
            _ => usize::MAX,
        };
        self.equations(first.into_iter().chain(taken.take(others)), "", text);
        is_taken
    }

    /// Its equations before there was an error, where that is not in the text of its model.
    fn before(&self, now: &Analysis, sound: &Rc<Analysis>, text: &mut String) {
        let home = |then: &Analysis, model: &Definition| {
            let file = then.project.sources.file(model.whole);
            file.map(|file| file.name.clone())
        };
        let file = home(self.then, self.model);
        let mut models = sound.index.definitions().iter();
        let twin = models.find(|twin| {
            let is_it = twin.kind == Kind::Model && twin.name == self.model.name;
            is_it && home(sound, twin) == file
        });
        let Some(twin) = twin else {
            return;
        };
        let was = sound.project.sources.text(twin.whole);
        let mut files = now.project.sources.files().iter();
        if files.any(|known| Some(&known.name) == file.as_ref() && known.text.contains(was)) {
            let taken = self.taken(sound, twin);
            self.equations(taken, "before the error, ", text);
        }
    }

    fn taken<'a>(
        &'a self,
        then: &'a Rc<Analysis>,
        model: &Definition,
    ) -> impl Iterator<Item = Facts<'e>> + 'a {
        let name = self.experiment.map_or("", |known| known.name.as_str());
        Facts::taken(self.cache, then, model.place, (name, self.part.as_deref()))
    }

    fn value(&self, facts: &Facts<'_>, text: &mut String) {
        let name = &self.meant.name;
        let Some(shown) = facts.shown(name) else {
            return;
        };
        let inferred = || {
            let (home, item) = model_at(&self.then.project.file, self.model.place)?;
            inferred(home, item).remove(&self.meant.place)
        };
        if let Some(unit) = shown.unit.clone().or_else(inferred) {
            text.push_str(&format!(", in {unit}"));
        }
        match shown.shape[..] {
            [] => {}
            [n] => text.push_str(&format!(", a vector of {n}")),
            [rows, columns] => text.push_str(&format!(", a matrix of {rows} x {columns}")),
            _ => {}
        }
        if !shown.value.is_empty() {
            let value = numbers(&shown.shape, &shown.value);
            let place = match facts.experiment() {
                Some(name) => format!(" in `{name}`"),
                None => String::new(),
            };
            let when = match self.meant.kind {
                Kind::Param | Kind::Constant => "",
                _ => " at the start",
            };
            let name = facts.called(name);
            text.push_str(&format!("\n\n{name} = {value}{when}{place}"));
        }
    }

    /// Its equations in the first experiment whose system has some.
    fn equations(&self, mut taken: impl Iterator<Item = Facts<'e>>, when: &str, text: &mut String) {
        let found = taken.find_map(|facts| {
            let equations = facts.equations(&self.meant.name)?;
            Some((facts.experiment()?.to_owned(), equations))
        });
        if let Some((name, equations)) = found {
            text.push_str(&format!(
                "\n\n{when}in `{name}`:\n\n```text\n{equations}\n```"
            ));
        }
    }
}

/// The text of a declaration, without what is in its braces.
pub fn declaration(analysis: &Analysis, known: &Definition) -> String {
    let text = analysis.project.sources.text(known.whole.to(known.place));
    if matches!(known.kind, Kind::File | Kind::Module) || text.is_empty() {
        return known.name.clone();
    }
    let has_body = !matches!(known.kind, Kind::Alias | Kind::Part);
    let text = match text.split_once('{') {
        Some((head, _)) if has_body && !head.contains(" in ") => format!("{}{{ .. }}", head),
        _ => text.to_owned(),
    };
    let lines: Vec<&str> = text.lines().take(MOST_LINES).collect();
    lines.join("\n")
}

/// What the language says of a word, in the place where it stands.
fn of_word(analysis: &Analysis, word: &str, position: Position) -> Option<String> {
    if let Some(page) = explain::page(word) {
        return Some(format!("**{word}**: {}", explain::title(page)));
    }
    let around = Around::of(&analysis.source().text, analysis.lines().byte(position))?;
    match around.is_in_experiment() {
        true => of_setting(&around, word),
        false => of_model(&around, word),
    }
}

/// What the language says of a word in a model.
fn of_model(around: &Around<'_>, word: &str) -> Option<String> {
    let statement = match around.word(0) {
        "" => return reference::of_statement(reference::MODEL, word),
        first => first,
    };
    if is_function(word) {
        return reference::of_function(word);
    }
    let part = reference::of_part(reference::MODEL, statement, word);
    part.or_else(|| reference::of_statement(reference::MODEL, word))
}

/// What the language says of a word in an experiment.
fn of_setting(around: &Around<'_>, word: &str) -> Option<String> {
    let kind = around.heads[0][0].text;
    let sections = match kind {
        "optimize" => [reference::OPTIMIZE, reference::SIMULATE],
        "fit" => [reference::FIT, reference::SIMULATE],
        "mpc" => [reference::MPC, reference::SIMULATE],
        _ => [reference::SIMULATE, reference::OPTIMIZE],
    };
    let all = || sections.iter().chain(&reference::EXPERIMENTS);
    let of_statement = || all().find_map(|section| reference::of_statement(section, word));
    let of_function = || match is_function(word) {
        true => reference::of_function(word),
        false => None,
    };
    let of_part = |statement: &str| {
        let sections = all().chain([&reference::EXPECTATIONS]);
        let mut found = sections.map(|section| reference::of_part(section, statement, word));
        found.find_map(|found| found)
    };
    let first = around.word(0);
    match (around.heads.len(), around.block()) {
        (1, _) => match first {
            "" => of_statement(),
            "method" => reference::of_method(word),
            "lower" => reference::of_lowering(word),
            // A setting of `optimize` has the words of the option that is called the same.
            _ => reference::of_option(first, word)
                .or_else(of_function)
                .or_else(|| of_part(first)),
        },
        (2, "method") => match first {
            "" => reference::of_option(around.heads[1].get(1)?.text, word),
            _ => reference::of_option(first, word).or_else(of_function),
        },
        (_, block) => of_function()
            .or_else(|| of_part(block))
            .or_else(|| {
                reference::of_part(reference::MODEL, "switch", word).filter(|_| block == "with")
            })
            .or_else(|| of_statement().filter(|_| first.is_empty())),
    }
}

#[cfg(test)]
mod tests {
    use lsp_types::InlayHintParams;
    use serde_json::json;

    use super::*;
    use crate::cli::lsp::hints::hints;
    use crate::expr::Exprs;

    const TEXT: &str = "model m {
  param p = 2;
  state x = 1;
  state y = 3*p;
  x' = -y;
  y' = x;
}
simulate one of m { horizon 1; }
simulate two of m { horizon 1; with { p = 5; } }
";

    /// Each experiment is compiled once for all names of a text, and anew once it has changed.
    #[test]
    fn hovers_compile_once() {
        let uri: lsp_types::Uri = "file:///nowhere/cache.nsd".parse().expect("a name");
        let mut world = World::default();
        world.open(uri.clone(), 1, TEXT.to_owned());
        assert!(world.has_changed() && !world.has_changed());
        let exprs = Exprs::new();
        let cache = Cache::new(&exprs);
        let told = |world: &mut World, line: u32, character: u32| {
            let at = json!({ "line": line, "character": character });
            let params = json!({ "textDocument": { "uri": uri }, "position": at });
            let params: HoverParams = serde_json::from_value(params).expect("a place");
            let Ok(Some(found)) = hover(world, &cache, &params) else {
                panic!("something is told");
            };
            let HoverContents::Markup(found) = found.contents else {
                panic!("it is Markdown");
            };
            (found.value, cache.len())
        };
        let (first, n_compiled) = told(&mut world, 3, 8);
        assert!(first.contains("y = 6 at the start in `one`"), "{first}");
        assert!(first.contains("der(y) = x"), "{first}");
        assert_eq!(n_compiled, 1);
        // The same name, another one, and hints.
        assert_eq!(told(&mut world, 3, 8), (first, 1));
        let (other, n_compiled) = told(&mut world, 2, 8);
        assert!(other.contains("der(x) = -y"), "{other}");
        assert_eq!(n_compiled, 1);
        let range =
            json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 9, "character": 0 } });
        let params = json!({ "textDocument": { "uri": uri }, "range": range });
        let params: InlayHintParams = serde_json::from_value(params).expect("a range");
        hints(&mut world, &cache, &params);
        assert_eq!(cache.len(), 1);
        // In the other experiment it is the other value.
        let (other, n_compiled) = told(&mut world, 8, 38);
        assert!(other.contains("p = 5 in `two`"), "{other}");
        assert_eq!(n_compiled, 2);
        assert_eq!(told(&mut world, 8, 38), (other, 2));
        assert!(!world.has_changed());
        let change = json!([{ "text": TEXT.replace("3*p", "4*p") }]);
        world.change(&uri, 2, serde_json::from_value(change).expect("a change"));
        assert!(world.has_changed());
        let (changed, n_compiled) = told(&mut world, 3, 8);
        assert!(changed.contains("y = 8 at the start in `one`"), "{changed}");
        assert_eq!(n_compiled, 3);
    }
}
