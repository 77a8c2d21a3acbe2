//! Wrong statements: what is wrong with them, in plain words.
//!
//! The grammar only says where a wrong statement starts and ends. Its text is
//! parsed again with the one rule its first word calls for; where that fails,
//! and what the rule would have taken there, makes the message. After a missing
//! semicolon the next statement is tried, so that one error hides no other.

use std::ops::Range;

use nsd_grammar::{NsdParser, Rule, spelling};
use pest::Parser;
use pest::error::{ErrorVariant, InputLocation};
use pest::iterators::Pair;

use super::reading::Reading;
use super::words::{self, Place};
use crate::diagnostics::{Applicability, Help, explain};
use crate::syntax::lexer::{Lexer, Token, TokenKind, is_word_start};
use crate::syntax::{MAX_ERRORS, SyntaxError};

/// Where the parser got stuck and what it would have taken there.
struct Failure {
    at: usize,
    expected: Vec<Rule>,
}

impl Failure {
    fn expects(&self, rule: Rule) -> bool {
        self.expected.contains(&rule)
    }

    /// An operand has just been read.
    fn after_operand(&self) -> bool {
        self.expects(Rule::infix)
    }

    /// An operand is missing.
    fn wants_operand(&self) -> bool {
        let starts = [
            Rule::expr,
            Rule::arith,
            Rule::number,
            Rule::group,
            Rule::span,
        ];
        starts.iter().any(|start| self.expects(*start))
    }

    /// True for what an expression or a name can always go on or start with.
    fn goes_without_saying(&self, rule: Rule) -> bool {
        use Rule::{
            call, close_bracket, close_paren, comparator, equals, field, index, infix, known_unit,
            kw_for, kw_if, literal_factor, literal_group, literal_unit, matrix, unit_op,
        };
        use Rule::{
            group, name, negative, number, op_and, op_not, op_or, open_bracket, open_paren, string,
        };
        match rule {
            infix | comparator | op_and | op_or | call | index | field => true,
            literal_unit | literal_group | literal_factor | known_unit => true,
            unit_op => self.after_operand(),
            number | string | name | matrix | group | negative | op_not | kw_if => {
                self.wants_operand()
            }
            open_paren | open_bracket => {
                self.after_operand() || self.wants_operand() || self.expects(field)
            }
            // Of an argument that has been read, only its end is of interest.
            equals | kw_for => {
                self.after_operand() && (self.expects(close_paren) || self.expects(close_bracket))
            }
            _ => false,
        }
    }
}

type Build<'f, 'b> = &'f mut dyn FnMut(&mut Reading<'b>, Pair<Rule>);

/// Diagnoses the wrong text in `range`, and builds what can be read of it;
/// false where some of it could not be read.
pub(crate) fn recover<'b>(
    reading: &mut Reading<'b>,
    place: Place,
    range: Range<usize>,
    build: Build<'_, 'b>,
) -> bool {
    let scan = reading.scan;
    let text = &scan.text[..range.end];
    let mut at = range.start;
    let mut lost = false;
    loop {
        let Some(first) = significant(text, at).next() else {
            return !lost;
        };
        if reading.errors.len() > MAX_ERRORS {
            return false;
        }
        at = first.start;
        let rule = match rule_for(reading, place, text, &first) {
            Ok(rule) => rule,
            Err(error) => {
                // What the scan has already refused needs no second message.
                if !reading.wrong_within(first.start..range.end) {
                    reading.report(error);
                }
                return false;
            }
        };
        let failure = match attempt(reading, rule, &text[at..], at, build) {
            Ok(end) => {
                at = end;
                continue;
            }
            Err(failure) => failure,
        };
        let explained = reading.wrong_within(at..failure.at + 1);
        let error = explain(reading, place, &failure, text, at);
        let semicolon = matches!(error, SyntaxError::MissingSemicolon { .. });
        if !explained {
            reading.report(error);
        }
        if !semicolon {
            return false;
        }
        // Read the statement as if it had its semicolon, and go on behind it.
        let end = last_significant(text, at, failure.at).map_or(at, |token| token.end());
        let completed = format!("{};", &text[at..end]);
        lost |= attempt(reading, rule, &completed, at, build).is_err();
        at = failure.at;
    }
}

/// Parses `text`, which starts at offset `at`, as one `rule` and builds it;
/// returns where it ends.
fn attempt<'b>(
    reading: &mut Reading<'b>,
    rule: Rule,
    text: &str,
    at: usize,
    build: Build<'_, 'b>,
) -> Result<usize, Failure> {
    let result = attempt_uncounted(reading, rule, text, at, build);
    #[cfg(test)]
    crate::syntax::lexer::counter::add(match &result {
        Ok(end) => end - at,
        Err(failure) => failure.at - at,
    });
    result
}

fn attempt_uncounted<'b>(
    reading: &mut Reading<'b>,
    rule: Rule,
    text: &str,
    at: usize,
    build: Build<'_, 'b>,
) -> Result<usize, Failure> {
    match NsdParser::parse(rule, text) {
        Ok(mut pairs) => {
            let pair = pairs.next().expect("grammar: a member is one pair");
            let end = at + pair.as_span().end();
            let outer = std::mem::replace(&mut reading.base, at);
            build(reading, pair);
            reading.base = outer;
            Ok(end)
        }
        Err(error) => {
            let offset = match error.location {
                InputLocation::Pos(offset) | InputLocation::Span((offset, _)) => offset,
            };
            let expected = match error.variant {
                ErrorVariant::ParsingError { positives, .. } => positives,
                ErrorVariant::CustomError { .. } => Vec::new(),
            };
            Err(Failure {
                at: at + offset,
                expected,
            })
        }
    }
}

/// The rule that a member of a list should follow, by how it starts.
fn rule_for(
    reading: &Reading,
    place: Place,
    text: &str,
    first: &Token,
) -> Result<Rule, SyntaxError> {
    let mut next = significant(text, first.end());
    let second = next.next();
    let second_text = second.map_or("", |token| token.text);
    let keyword = words::starts(place)
        .iter()
        .find(|(start, _)| *start == first.text);
    // Keywords are names where nothing follows that the keyword would take.
    let only_keywords = matches!(place, Place::File | Place::Experiment);
    let as_name = match second_text {
        _ if only_keywords => false,
        "in" => next
            .next()
            .is_some_and(|third| matches!(third.text, "argmin" | "variational")),
        text => matches!(text, "'" | "=" | "+=" | ":=" | "."),
    };
    if let Some((_, rule)) = keyword.filter(|_| !as_name) {
        return Ok(*rule);
    }
    let is_name = first.kind == TokenKind::Word && !words::RESERVED.contains(&first.text);
    match place {
        Place::Model if first.text == "0" => Ok(match second_text {
            "<=" => Rule::complementarity,
            _ => Rule::equation,
        }),
        Place::Model if is_name => rule_for_name(reading, text, first),
        Place::Rows | Place::Initial => Ok(Rule::relation),
        Place::Binds | Place::Guess if is_name => Ok(Rule::bind),
        Place::Resets if is_name => Ok(Rule::reset),
        Place::Options | Place::Mechanics if is_name => Ok(Rule::option),
        Place::Free if is_name => Ok(Rule::free_path),
        Place::Data if is_name => Ok(Rule::measured),
        Place::Plot => Ok(Rule::plot_panel),
        Place::Animation | Place::Shapes if is_name => Ok(Rule::drawing),
        _ => Err(unknown(reading, place, text, first)),
    }
}

/// A statement that starts with a name: dynamics, a program, or a mistake.
fn rule_for_name(reading: &Reading, text: &str, first: &Token) -> Result<Rule, SyntaxError> {
    // What stands behind the name and its indices and fields.
    let mut depth = 0;
    let mut after_field = true;
    let mut end = first.end();
    let mut behind = None;
    for token in significant(text, first.end()) {
        match token.text {
            "[" | "(" => depth += 1,
            "]" | ")" if depth > 0 => depth -= 1,
            "." if depth == 0 => {}
            ";" | "{" | "}" if depth == 0 => {
                behind = Some(token);
                break;
            }
            _ if depth > 0 => {}
            _ if after_field
                && token.kind == TokenKind::Word
                && text[end..token.start].trim() == "." => {}
            _ => {
                behind = Some(token);
                break;
            }
        }
        after_field = depth == 0;
        end = token.end();
    }
    let operator = behind.map_or("", |token| token.text);
    let called = text[first.start..end].contains('(');
    match operator {
        "'" => Ok(Rule::dynamics),
        "in" => Ok(Rule::program),
        "=" | "+=" if !called => Err(SyntaxError::AssignmentWithoutPrime {
            name: text[first.start..end].trim().to_owned(),
            head: first.text.to_owned(),
            operator: operator.to_owned(),
            span: reading.position(first.start..behind.map_or(end, |token| token.end())),
        }),
        _ => Err(unknown(reading, Place::Model, text, first)),
    }
}

/// No member of the list starts like this.
fn unknown(reading: &Reading, place: Place, text: &str, first: &Token) -> SyntaxError {
    let mut span = reading.position(first.start..first.end());
    let word = shown(first);
    let second = significant(text, first.end()).next();
    if let Some((here, there)) = words::belongs(first.text, place) {
        return SyntaxError::Misplaced {
            word: first.text.to_owned(),
            place: here.to_owned(),
            belongs: there.to_owned(),
            span,
        };
    }
    let help = if matches!(first.text, "maximize" | "maximise") {
        "what is maximized is a negative that is minimized: write `minimize -(...);`".into()
    } else if let Some(meant) = words::suggestion(first.text, place) {
        let help = format!("did you mean `{meant}`?");
        let is_known = words::is_another_word_for(first.text, meant);
        let applicability = match is_known {
            true => Applicability::Safe,
            false => Applicability::Suggestion,
        };
        Help::edit(help, meant, applicability)
    } else if first.text == "der" && second.is_some_and(|second| second.text == "(") {
        let help = "write a derivative as `x' = ...;`";
        match derivative(text, first) {
            Some((end, state)) => {
                span = reading.position(first.start..end);
                Help::edit(help, format!("{state}'"), Applicability::Safe)
            }
            None => help.into(),
        }
    } else if matches!(first.text, "if" | "else") {
        "cases of the dynamics are written `region NAME where ... { ... }`".into()
    } else if first.text == ";" {
        Help::edit("remove it", "", Applicability::Safe)
    } else {
        let starts = words::starts(place).iter();
        let starts: Vec<String> = starts.map(|(start, _)| format!("`{start}`")).collect();
        let name = match place {
            Place::File | Place::Experiment => "",
            Place::Model => ", or the derivative of a state",
            _ if starts.is_empty() => "a name",
            _ => " or a name",
        };
        format!("start with {}{name}", starts.join(", ")).into()
    };
    SyntaxError::UnknownStatement {
        place: words::member(place).to_owned(),
        word,
        help,
        span,
    }
}

/// Turns a failure in the statement that begins at `start` into a message.
fn explain(
    reading: &Reading,
    place: Place,
    failure: &Failure,
    text: &str,
    start: usize,
) -> SyntaxError {
    let found = significant(text, failure.at).next();
    let span = match found {
        Some(token) => reading.position(token.start..token.end()),
        None => reading.position(failure.at..failure.at),
    };
    let found_text = found.map_or("", |token| token.text);
    let before = last_significant(text, start, failure.at);
    let only_name = failure.expects(Rule::name) && !failure.wants_operand();
    if found_text == "'" && failure.after_operand() {
        return SyntaxError::PrimeInExpression { span };
    }
    if only_name && words::RESERVED.contains(&found_text) {
        let word = found_text.to_owned();
        return SyntaxError::ReservedName { word, span };
    }
    let new_line = before.is_none_or(|before| text[before.end()..failure.at].contains('\n'));
    let ends = found.is_none()
        || found_text == "}"
        || new_line && !failure.wants_operand()
        || found.is_some_and(|found| starts_member(reading, place, text, &found));
    if failure.expects(Rule::semicolon) && ends {
        let what = if failure.after_operand() {
            "expression"
        } else {
            "statement"
        };
        let end = before.map_or(failure.at, |before| before.end());
        return SyntaxError::MissingSemicolon {
            what: what.to_owned(),
            span: reading.position(end..end),
        };
    }
    if let Some((word, meant)) = expectation(text, start, found_text) {
        return SyntaxError::Expected {
            expected: format!("`{meant}`"),
            found: shown(&word),
            help: Some(Help::did_you_mean(meant)),
            span: reading.position(word.start..word.end()),
        };
    }
    let begins = before.is_some_and(|before| before.start == start);
    let is_behind_number = failure.after_operand()
        && before.is_some_and(|before| before.kind == TokenKind::Number)
        && found.is_some_and(|found| found.kind == TokenKind::Word);
    let behind_number = || {
        let text =
            "a product has a `*`, as in `3*x`; a unit behind a number is a known one, as in `3 m`";
        is_behind_number.then(|| Help::from(text))
    };
    let of_order = || order(failure, &text[start..]);
    let help = help(place, failure, found_text, begins);
    let help = help.or_else(of_order).or_else(behind_number);
    let before = before.map_or("", |before| before.text);
    let expected = expected(failure, before);
    SyntaxError::Expected {
        help,
        found: found.map_or("the end of the statement".to_owned(), |found| shown(&found)),
        expected,
        span,
    }
}

/// The second word of an `expect` that is close to one behind which `found` may stand.
fn expectation<'t>(text: &'t str, start: usize, found: &str) -> Option<(Token<'t>, &'static str)> {
    let mut tokens = significant(text, start);
    tokens.next().filter(|first| first.text == "expect")?;
    let second = tokens
        .next()
        .filter(|token| token.kind == TokenKind::Word)?;
    let wanted = words::EXPECTATIONS.iter().filter(|(_, behind)| {
        behind.map_or_else(|| explain::page(found).is_some(), |word| word == found)
    });
    let meant = words::nearest(second.text, wanted.map(|(word, _)| *word))?;
    (meant != second.text).then_some((second, meant))
}

/// True where a whole member of the list starts at a token.
fn starts_member(reading: &Reading, place: Place, text: &str, first: &Token) -> bool {
    let rule = rule_for(reading, place, text, first);
    rule.is_ok_and(|rule| NsdParser::parse(rule, &text[first.start..]).is_ok())
}

/// Tokens from an offset on, without blanks and comments.
fn significant(text: &str, at: usize) -> impl Iterator<Item = Token<'_>> {
    Lexer::at(text, at).filter(|token| !token.is_blank())
}

/// The last token between two offsets that is not blank; both are starts of tokens.
fn last_significant(text: &str, from: usize, to: usize) -> Option<Token<'_>> {
    significant(&text[..to], from).last()
}

fn shown(token: &Token) -> String {
    match token.kind {
        TokenKind::String => "a string".to_owned(),
        _ if token.text.chars().count() > 24 => {
            let start: String = token.text.chars().take(20).collect();
            format!("`{start}…`")
        }
        _ => format!("`{}`", token.text),
    }
}

/// What could stand where the parser failed, as "a, b or c".
fn expected(failure: &Failure, before: &str) -> String {
    let mut list: Vec<String> = Vec::new();
    if failure.wants_operand() {
        list.push("an expression".to_owned());
    }
    for rule in &failure.expected {
        if failure.goes_without_saying(*rule) {
            continue;
        }
        let closes = matches!(
            rule,
            Rule::close_paren | Rule::close_bracket | Rule::close_brace
        );
        if closes && (failure.after_operand() || before.starts_with(is_word_start)) {
            list.push("`,`".to_owned());
        }
        match spelling(*rule) {
            Some(word) => list.push(format!("`{word}`")),
            None => list.extend(words::describe(*rule).split('|').map(str::to_owned)),
        }
    }
    if failure.after_operand() {
        list.push("an operator".to_owned());
    }
    let mut seen = Vec::new();
    list.retain(|text| {
        let is_new = !seen.contains(text);
        seen.push(text.clone());
        is_new
    });
    match list.split_last() {
        None => "something else".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// One action that may repair the statement; `begins` where only its first word stands before `found`.
fn help(place: Place, failure: &Failure, found: &str, begins: bool) -> Option<Help> {
    use Applicability::{Safe, Suggestion};
    let wanted = failure.expected.iter().filter_map(|rule| spelling(*rule));
    if let Some(meant) = words::nearest(found, wanted.filter(|word| word.len() > 2)) {
        return Some(Help::did_you_mean(meant));
    }
    Some(match found {
        "if" => "put the `if` in parentheses".into(),
        ";" if failure.expects(Rule::close_bracket) => {
            Help::edit("remove the empty row", "", Suggestion)
        }
        "=" if place == Place::Experiment && failure.wants_operand() => {
            let applicability = if begins { Safe } else { Suggestion };
            // Both sides of it may be words.
            Help::edit("remove the `=`", " ", applicability)
        }
        "=" if failure.expects(Rule::comparator) => "compare with `<`, `<=`, `>` or `>=`".into(),
        ":=" if failure.expects(Rule::equals) => {
            Help::edit("write `=`; `:=` stands only in a `jump`", "=", Safe)
        }
        "=" if failure.expects(Rule::becomes) => {
            Help::edit("write `:=`; a jump sets the value after it", ":=", Safe)
        }
        _ if failure.expects(Rule::kw_else) && failure.after_operand() => {
            "every `if` has a `then` and an `else`".into()
        }
        _ => return None,
    })
}

/// The form of a statement whose words stand in another order.
fn order(failure: &Failure, statement: &str) -> Option<Help> {
    let words: Vec<&str> = (significant(statement, 0).map(|token| token.text))
        .take(2)
        .collect();
    Some(match words[..] {
        ["output", _] if failure.expects(Rule::kw_every) => {
            "`output` of an experiment takes names: the model names an expression, `output y = 2*x;`, or `plot` draws it".into()
        }
        ["expect", "mode"] => {
            "the instant stands before the mode: `expect mode at 2 is sliding(s);`".into()
        }
        _ => return None,
    })
}

/// Where `der(x)` ends, and the state in it: a name, its fields and indices.
fn derivative<'t>(text: &'t str, first: &Token) -> Option<(usize, &'t str)> {
    let mut tokens = significant(text, first.end());
    let open = tokens.next().filter(|token| token.text == "(")?;
    let is_path = |token: &Token| {
        let is_name = matches!(token.kind, TokenKind::Word | TokenKind::Number);
        is_name || matches!(token.text, "." | "[" | "]" | "," | ":")
    };
    let close = tokens.find(|token| !is_path(token))?;
    let state = text[open.end()..close.start].trim();
    let is_plain = !state.contains("//") && !state.contains('\n');
    let is_one = |(depth, is_one): (i32, bool), c| match c {
        '[' => (depth + 1, is_one),
        ']' => (depth - 1, is_one),
        _ => (depth, is_one && (c != ',' || depth > 0)),
    };
    let (_, is_one) = state.chars().fold((0, true), is_one);
    let is_state = close.text == ")" && state.starts_with(is_word_start) && is_plain && is_one;
    is_state.then_some((close.end(), state))
}
