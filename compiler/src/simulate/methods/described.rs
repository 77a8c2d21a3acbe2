//! What a method says of itself, option by option.

use crate::report::{Method, MethodOption};
use crate::system::experiment::MethodKind;

impl Method {
    /// A method of which nothing is said yet.
    pub(crate) fn of(kind: MethodKind) -> Self {
        Method {
            name: kind.word().to_owned(),
            options: Vec::new(),
        }
    }

    /// With a number.
    pub(crate) fn number(mut self, name: &str, value: f64) -> Self {
        let option = (name.to_owned(), MethodOption::Number(value));
        self.options.push(option);
        self
    }

    /// With how many there are of something.
    pub(crate) fn count(self, name: &str, value: usize) -> Self {
        self.number(name, value as f64)
    }

    /// With a word.
    pub(crate) fn word(mut self, name: &str, value: impl Into<String>) -> Self {
        let option = (name.to_owned(), MethodOption::Text(value.into()));
        self.options.push(option);
        self
    }
}
