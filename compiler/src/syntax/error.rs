//! What can be wrong with the form of a file.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::{Applicability, Fix, Fixable, Help};
use crate::source::Span;

/// A mistake in the text of a file.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum SyntaxError {
    /// The file holds bytes that are not text.
    #[error("file is not UTF-8: byte {offset} is not part of a character")]
    #[diagnostic(code(E0001), help("save the file as UTF-8 text"))]
    NotUtf8 {
        /// Offset of the byte, from 0.
        offset: usize,
        /// Where it stood.
        #[label("here")]
        span: Span,
    },

    /// The file is larger than any model.
    #[error("the file is larger than {limit} bytes")]
    #[diagnostic(code(E0002), help("data belongs into a table that a `signal` reads"))]
    TooLarge {
        /// The limit.
        limit: usize,
        /// Where the limit is reached.
        #[label("the limit is reached here")]
        span: Span,
    },

    /// The file declares more than any collection of models does.
    #[error("the file has more than {limit} declarations")]
    #[diagnostic(
        code(E0002),
        help("put models, functions and constants into files of their own, and import them")
    )]
    TooManyItems {
        /// The limit.
        limit: usize,
        /// The first one beyond it.
        #[label("the limit is reached here")]
        span: Span,
    },

    /// Brackets, blocks or operators are nested too deeply.
    #[error("nesting is deeper than {limit} levels")]
    #[diagnostic(
        code(E0003),
        help("name a part of it with `let`, or define a function with `fn`")
    )]
    TooDeep {
        /// The limit.
        limit: usize,
        /// Where the limit is reached.
        #[label("level {} starts here", limit + 1)]
        span: Span,
    },

    /// A character that is not part of the language.
    #[error("unexpected character {character}")]
    #[diagnostic(code(E0004))]
    StrayCharacter {
        /// The character, in backticks, or its code point.
        character: String,
        /// What to write instead.
        #[help]
        help: Option<Help>,
        /// What its help takes the place of.
        place: Span,
        /// Where it stands.
        #[label("not part of the language")]
        span: Span,
    },

    /// A string without its closing quote.
    #[error("string is not closed")]
    #[diagnostic(code(E0005), help("close it with `\"` on the same line"))]
    UnterminatedString {
        /// From its opening quote to the end of the line.
        #[label("opened here")]
        span: Span,
    },

    /// A number that is not written as numbers are.
    #[error("malformed number `{text}`")]
    #[diagnostic(code(E0006))]
    MalformedNumber {
        /// As written.
        text: String,
        /// What to write instead.
        #[help]
        help: Help,
        /// Where it stands.
        #[label("{problem}")]
        span: Span,
        /// What is wrong with it.
        problem: String,
    },

    /// A bracket that nothing closes.
    #[error("`{bracket}` is never closed")]
    #[diagnostic(code(E0007), help("close it with `{closing}`"))]
    UnclosedBracket {
        /// The bracket.
        bracket: char,
        /// What would close it.
        closing: char,
        /// Where it stands.
        #[label(primary, "opened here")]
        span: Span,
        /// Where it should have been closed.
        #[label("should be closed before this")]
        before: Option<Span>,
    },

    /// A closing bracket that closes nothing.
    #[error("`{bracket}` closes nothing")]
    #[diagnostic(code(E0008))]
    UnmatchedBracket {
        /// The bracket.
        bracket: char,
        /// What to do.
        #[help]
        help: Help,
        /// Where it stands.
        #[label(primary, "no bracket is open for this")]
        span: Span,
        /// The open bracket of another kind.
        #[label("this one is open")]
        open: Option<Span>,
    },

    /// A reserved word where a name is declared or used.
    #[error("`{word}` is reserved")]
    #[diagnostic(code(E0009), help("choose another name, such as `{word}_1`"))]
    ReservedName {
        /// The word.
        word: String,
        /// Where it stands.
        #[label("cannot be a name")]
        span: Span,
    },

    /// Something else stands where the grammar wants a certain word or symbol.
    #[error("expected {expected}, found {found}")]
    #[diagnostic(code(E0010))]
    Expected {
        /// What may stand here.
        expected: String,
        /// What does.
        found: String,
        /// What to write.
        #[help]
        help: Option<Help>,
        /// Where it stands.
        #[label("expected {expected}")]
        span: Span,
    },

    /// A statement without its semicolon.
    #[error("expected `;` after this {what}")]
    #[diagnostic(code(E0011), help("end the statement with `;`"))]
    MissingSemicolon {
        /// What it ends.
        what: String,
        /// The end of the statement.
        #[label("`;` is missing here")]
        span: Span,
    },

    /// A statement starts with a word that starts none.
    #[error("no {place} starts with {word}")]
    #[diagnostic(code(E0012))]
    UnknownStatement {
        /// `statement`, `setting of an experiment`, ...
        place: String,
        /// The word or symbol.
        word: String,
        /// What may have been meant.
        #[help]
        help: Help,
        /// Where it stands.
        #[label("not known here")]
        span: Span,
    },

    /// `==`
    #[error("`{operator}` does not exist")]
    #[diagnostic(code(E0013))]
    NoEquality {
        /// `==` or `!=`.
        operator: String,
        /// What to write.
        #[help]
        help: Help,
        /// Where it stands.
        #[label("real numbers are not compared for equality")]
        span: Span,
    },

    /// `x''`
    #[error("there is no second derivative `{name}''`")]
    #[diagnostic(
        code(E0014),
        help("declare a state for the velocity: `{name}' = v;` and `v' = ...;`")
    )]
    SecondDerivative {
        /// The state.
        name: String,
        /// Where the primes stand.
        #[label("only one prime")]
        span: Span,
    },

    /// `&&`, `**`, `≤`: symbols of other languages and of papers.
    #[error("`{symbol}` is written `{word}`")]
    #[diagnostic(code(E0015), help("write `{word}` instead of `{symbol}`"))]
    ForeignSymbol {
        /// As written.
        symbol: String,
        /// As it should be.
        word: String,
        /// The same, apart from what stands beside it.
        replacement: String,
        /// Where it stands.
        #[label("write `{word}`")]
        span: Span,
    },

    /// `x = 1;` in a model.
    #[error("`{name} {operator}` sets nothing in a model")]
    #[diagnostic(
        code(E0016),
        help("write `{name}' {operator} ...;` for dynamics, or `let {head} = ...;` for a name")
    )]
    AssignmentWithoutPrime {
        /// The left side.
        name: String,
        /// Its first name.
        head: String,
        /// `=` or `+=`.
        operator: String,
        /// The left side and the operator.
        #[label("neither a declaration nor dynamics")]
        span: Span,
    },

    /// A file without any item.
    #[error("file declares nothing")]
    #[diagnostic(
        code(E0017),
        help("start with a model: `model decay {{ state x = 1; x' = -x; }}`")
    )]
    EmptyFile {
        /// The whole file.
        #[label("nothing but blanks and comments")]
        span: Span,
    },

    /// A statement in a place where it has no meaning.
    #[error("`{word}` does not belong {place}")]
    #[diagnostic(code(E0018), help("move it {belongs}"))]
    Misplaced {
        /// The keyword.
        word: String,
        /// Where it stands: `in a model`, ...
        place: String,
        /// Where it belongs: `into a model`, ...
        belongs: String,
        /// The keyword.
        #[label("not possible {place}")]
        span: Span,
    },

    /// `x'` in an expression.
    #[error("`'` stands only on the left of `=`")]
    #[diagnostic(
        code(E0019),
        help("name the right side with `let` and use that name in both places")
    )]
    PrimeInExpression {
        /// Where it stands.
        #[label("a derivative cannot be read here")]
        span: Span,
    },

    /// `/* ... */`
    #[error("comments start with `//` and end with the line")]
    #[diagnostic(code(E0020), help("start each line of the comment with `//`"))]
    BlockComment {
        /// Its lines, each as a comment, where it has an end.
        lines: Option<String>,
        /// The comment.
        #[label("no block comments")]
        span: Span,
    },

    /// More errors than anyone reads at once.
    #[error("too many errors, the rest of the file was not checked")]
    #[diagnostic(code(E0021), help("correct those above and check again"))]
    TooManyErrors {
        /// Where the parser stopped looking.
        #[label("checked up to here")]
        span: Span,
    },
}

impl Fixable for SyntaxError {
    fn fix(&self) -> Option<Fix> {
        use Applicability::{Safe, Suggestion};
        match self {
            SyntaxError::StrayCharacter { help, place, .. } => help.as_ref()?.fix(*place),
            SyntaxError::Expected { help, span, .. } => help.as_ref()?.fix(*span),
            SyntaxError::MalformedNumber { help, span, .. }
            | SyntaxError::UnmatchedBracket { help, span, .. }
            | SyntaxError::UnknownStatement { help, span, .. }
            | SyntaxError::NoEquality { help, span, .. } => help.fix(*span),
            SyntaxError::MissingSemicolon { span, .. } => Some(Fix::one(*span, ";", Safe)),
            SyntaxError::ForeignSymbol {
                symbol,
                replacement,
                span,
                ..
            } => {
                // Bars may be an absolute value, arrows anything, and `!` may belong to what is before it.
                let applicability = match symbol.as_str() {
                    "|" | "&" | "!" | "->" | "=>" | "=<" => Suggestion,
                    _ => Safe,
                };
                Some(Fix::one(*span, replacement, applicability))
            }
            SyntaxError::BlockComment {
                lines: Some(lines),
                span,
            } => Some(Fix {
                title: "start each line of the comment with `//`".to_owned(),
                ..Fix::one(*span, lines, Safe)
            }),
            _ => None,
        }
    }
}
