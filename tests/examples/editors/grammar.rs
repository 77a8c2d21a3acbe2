//! The words of the grammar, by its rules.

use std::collections::HashMap;

use pest_meta::ast::Expr;
use pest_meta::parser::{self, Rule};

/// The rules of a grammar, in its order.
pub struct Grammar {
    names: Vec<String>,
    rules: HashMap<String, Expr>,
}

impl Grammar {
    /// Reads the text of a grammar.
    pub fn read(text: &str) -> Self {
        let pairs = parser::parse(Rule::grammar_rules, text).expect("it is a grammar");
        let rules = parser::consume_rules(pairs).expect("its rules are consistent");
        Grammar {
            names: rules.iter().map(|rule| rule.name.clone()).collect(),
            rules: rules
                .into_iter()
                .map(|rule| (rule.name, rule.expr))
                .collect(),
        }
    }

    /// All words of the language: what is spelled in letters and ends where no name goes on.
    pub fn words(&self) -> Vec<String> {
        let mut found = Vec::new();
        for name in &self.names {
            if let Some(Expr::Seq(spelled, end)) = self.rules.get(name)
                && matches!(**end, Expr::NegPred(_))
                && is_spelled(spelled)
            {
                self.first(spelled, &mut found);
            }
        }
        found
    }

    /// The words that a rule begins with.
    pub fn starts(&self, rule: &str) -> Vec<String> {
        let mut found = Vec::new();
        let expr = self.rules.get(rule);
        let expr = expr.unwrap_or_else(|| panic!("the grammar has no rule `{rule}`"));
        self.first(expr, &mut found);
        assert!(!found.is_empty(), "`{rule}` begins with no word");
        found
    }

    /// The text that a rule begins with, whatever it is made of.
    pub fn symbol(&self, rule: &str) -> &str {
        let found = leaves(&self.rules[rule]).find_map(|leaf| match leaf {
            Expr::Str(text) => Some(text.as_str()),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("`{rule}` begins with no text"))
    }

    /// The classes of characters, and the characters, that a rule is made of.
    pub fn classes(&self, rule: &str) -> Vec<String> {
        let name = |leaf: &Expr| match leaf {
            Expr::Ident(name) | Expr::Str(name) => Some(name.clone()),
            _ => None,
        };
        leaves(&self.rules[rule]).filter_map(name).collect()
    }

    /// Adds the words that may stand first; whether there may be nothing at all.
    fn first(&self, expr: &Expr, found: &mut Vec<String>) -> bool {
        match expr {
            Expr::Str(text) => {
                if text.starts_with(char::is_alphabetic) && !found.contains(text) {
                    found.push(text.clone());
                }
                text.is_empty()
            }
            Expr::Ident(name) => self
                .rules
                .get(name)
                .is_some_and(|rule| self.first(rule, found)),
            Expr::Seq(left, right) => self.first(left, found) && self.first(right, found),
            Expr::Choice(left, right) => {
                // Both sides, whatever the first may be.
                let left = self.first(left, found);
                self.first(right, found) || left
            }
            Expr::Opt(inner) | Expr::Rep(inner) => {
                self.first(inner, found);
                true
            }
            Expr::RepOnce(inner) => self.first(inner, found),
            Expr::PosPred(_) | Expr::NegPred(_) => true,
            _ => false,
        }
    }
}

/// What an expression is made of, in order, without what it looks ahead for.
fn leaves(expr: &Expr) -> Box<dyn Iterator<Item = &Expr> + '_> {
    match expr {
        Expr::PosPred(_) | Expr::NegPred(_) => Box::new(std::iter::empty()),
        Expr::Seq(left, right) | Expr::Choice(left, right) => {
            Box::new(leaves(left).chain(leaves(right)))
        }
        Expr::Opt(inner) | Expr::Rep(inner) | Expr::RepOnce(inner) => leaves(inner),
        leaf => Box::new(std::iter::once(leaf)),
    }
}

/// Whether it is a string, or one of several.
fn is_spelled(expr: &Expr) -> bool {
    match expr {
        Expr::Str(text) => text.starts_with(char::is_alphabetic),
        Expr::Choice(left, right) => is_spelled(left) && is_spelled(right),
        _ => false,
    }
}
