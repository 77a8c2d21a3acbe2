//! Expressions: prefix notation in the file, a list of nodes here.

use super::scan::Scanner;
use super::{Error, Fault};
use crate::tape::Elementary;

/// The number of a node; operands come before what contains them.
pub(crate) type Id = u32;

/// A number, a variable or an operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Node {
    Number(f64),
    /// A variable, from 0.
    Variable(u32),
    /// A defined variable, from 0.
    Defined(u32),
    /// An operation on nodes `first..first + n` of [`Nodes::operands`].
    Operation {
        operator: Operator,
        first: u32,
        n: u32,
    },
}

/// The operators of the format that are differentiable or can be made so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Square,
    Negate,
    Sum,
    Minimum,
    Maximum,
    Absolute,
    Apply(Elementary),
    Sqrt,
    Sinh,
    Sin,
    Log10,
    Cosh,
    Cos,
    Atan2,
    Logistic,
}

/// How many operands an operator has.
enum Arity {
    Fixed(u32),
    /// As many as the file says next.
    Counted,
}

/// All expressions of a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    pub nodes: Vec<Node>,
    pub operands: Vec<Id>,
}

/// An operator whose operands are still to come.
struct Open {
    operator: Operator,
    n: u32,
    missing: u32,
}

impl Nodes {
    pub(crate) fn push(&mut self, node: Node) -> Id {
        self.nodes.push(node);
        (self.nodes.len() - 1) as Id
    }

    pub(crate) fn operation(&mut self, operator: Operator, operands: &[Id]) -> Id {
        let first = self.operands.len() as u32;
        self.operands.extend_from_slice(operands);
        let n = operands.len() as u32;
        self.push(Node::Operation { operator, first, n })
    }

    /// The operands of an operation.
    pub(crate) fn operands(&self, first: u32, n: u32) -> &[Id] {
        &self.operands[first as usize..(first + n) as usize]
    }

    /// Reads an expression; `defined` tells which defined variables are known already.
    pub(crate) fn read(
        &mut self,
        scanner: &mut Scanner,
        n_variables: usize,
        defined: &[bool],
        user: impl Fn() -> String,
    ) -> Result<Id, Error> {
        let mut open: Vec<Open> = Vec::new();
        let mut values: Vec<Id> = Vec::new();
        loop {
            let expected = "an operator, a variable or a number";
            let Some(letter) = scanner.letter() else {
                return scanner.error(Fault::End(expected));
            };
            let leaf = match letter {
                b'n' => Node::Number(scanner.number("a number")?),
                b's' => Node::Number(scanner.short("a number")? as f64),
                b'l' => Node::Number(scanner.integer("a number")? as f64),
                b'v' => {
                    let all = n_variables + defined.len();
                    let index = scanner.index("variable", all)?;
                    match index.checked_sub(n_variables) {
                        None => Node::Variable(index as u32),
                        Some(number) if defined[number] => Node::Defined(number as u32),
                        Some(_) => return scanner.error(Fault::Undefined(index as u32)),
                    }
                }
                b'o' => {
                    let number = scanner.integer("the number of an operator")?;
                    let (operator, arity) = match Operator::new(number) {
                        Ok(found) => found,
                        Err(Some(operator)) => {
                            let user = user();
                            return scanner.error(Fault::Nonsmooth { operator, user });
                        }
                        Err(None) => return scanner.error(Fault::Operator(number)),
                    };
                    let n = match arity {
                        Arity::Fixed(n) => n,
                        Arity::Counted => {
                            scanner.row("the number of operands")?;
                            let n = scanner.integer("the number of operands")?;
                            // Every operand takes a byte at least.
                            scanner.within("operand", n - 1, scanner.length())? as u32 + 1
                        }
                    };
                    let missing = n;
                    open.push(Open {
                        operator,
                        n,
                        missing,
                    });
                    continue;
                }
                letter => {
                    let found = char::from(letter).escape_default().to_string();
                    return scanner.error(Fault::Unexpected { expected, found });
                }
            };
            values.push(self.push(leaf));
            loop {
                let Some(last) = open.last_mut() else {
                    return Ok(values.pop().expect("a value was pushed"));
                };
                last.missing -= 1;
                if last.missing > 0 {
                    break;
                }
                let (operator, n) = (last.operator, last.n as usize);
                open.pop();
                let operands = values.split_off(values.len() - n);
                values.push(self.operation(operator, &operands));
            }
        }
    }
}

impl Operator {
    /// Whether it is rewritten by complementarity conditions.
    pub(crate) fn is_kink(self) -> bool {
        matches!(self, Self::Absolute | Self::Minimum | Self::Maximum)
    }

    /// The operator with this number, or the name of one that is refused (Gay 2005, table 2, and `opcode.hd` of the
    /// AMPL solver library).
    fn new(number: i64) -> Result<(Self, Arity), Option<&'static str>> {
        let (one, two) = (Arity::Fixed(1), Arity::Fixed(2));
        Ok(match number {
            0 => (Self::Add, two),
            1 => (Self::Subtract, two),
            2 => (Self::Multiply, two),
            3 => (Self::Divide, two),
            5 | 76 | 78 => (Self::Power, two),
            11 => (Self::Minimum, Arity::Counted),
            12 => (Self::Maximum, Arity::Counted),
            15 => (Self::Absolute, one),
            16 => (Self::Negate, one),
            39 => (Self::Sqrt, one),
            40 => (Self::Sinh, one),
            41 => (Self::Sin, one),
            42 => (Self::Log10, one),
            45 => (Self::Cosh, one),
            46 => (Self::Cos, one),
            48 => (Self::Atan2, two),
            54 => (Self::Sum, Arity::Counted),
            77 => (Self::Square, one),
            79 => (Self::Logistic, one),
            _ => {
                let mut functions = Elementary::ALL.iter();
                match functions.find(|function| function.opcode() == Some(number)) {
                    Some(&function) => (Self::Apply(function), one),
                    None => return Err(refused(number)),
                }
            }
        })
    }
}

fn refused(number: i64) -> Option<&'static str> {
    Some(match number {
        4 => "mod",
        6 => "less",
        13 => "floor",
        14 => "ceil",
        20 => "or",
        21 => "and",
        22 => "<",
        23 => "<=",
        24 => "=",
        28 => ">=",
        29 => ">",
        30 => "!=",
        34 => "not",
        35 | 65 => "if",
        55 => "div",
        56 => "precision",
        57 => "round",
        58 => "trunc",
        59 => "count",
        60 | 61 => "numberof",
        62 => "atleast",
        63 => "atmost",
        64 => "a piecewise linear term",
        66 => "exactly",
        67 => "!atleast",
        68 => "!atmost",
        69 => "!exactly",
        70 => "forall",
        71 => "exists",
        72 => "==>",
        73 => "<==>",
        74 => "alldiff",
        75 => "somesame",
        _ => return None,
    })
}
