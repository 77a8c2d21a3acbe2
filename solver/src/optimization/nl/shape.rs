//! The shape of a function: what is left of it when its variables and coefficients are taken out.
//!
//! Functions of one shape are one kernel at many places. A shape is a program for a stack machine in words; the
//! variables are numbered as they occur, and every coefficient is the next number. Exponents belong to the shape,
//! since x² is computed in another way than x³.

use super::expression::{Id, Node, Nodes, Operator};
use super::segments::Function;
use crate::tape::{Elementary, TapeBuilder, Term};

/// A function as a shape with its variables and numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    /// What is computed.
    pub code: Vec<Word>,
    /// The variables, as they occur first.
    pub variables: Vec<u32>,
    /// The coefficients, as they occur.
    pub numbers: Vec<f64>,
}

/// A step of the stack machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Word {
    /// Pushes a variable.
    Variable(u32),
    /// Pushes the next coefficient.
    Number,
    /// Pushes the number with these bits.
    Exponent(u64),
    /// Keeps the top as the next definition.
    Keep,
    /// Pushes a definition.
    Kept(u32),
    /// Replaces as many operands by their result.
    Operator(Operator, u32),
}

/// What is still to be written, the next one last.
enum Task {
    Expression(Id),
    Exponent(Id),
    Linear(u32, f64),
    Operator(Operator, u32),
    /// The defined variable is complete.
    Keep(u32),
}

/// Writes shapes.
pub(crate) struct Writer<'c> {
    nodes: &'c Nodes,
    defined: &'c [Function],
    /// The number of a variable or a definition within the present shape, plus one.
    variables: Vec<u32>,
    definitions: Vec<u32>,
    /// Definitions of the present shape.
    kept: Vec<u32>,
    shape: Shape,
}

impl<'c> Writer<'c> {
    pub(crate) fn new(nodes: &'c Nodes, defined: &'c [Function], n_variables: usize) -> Self {
        Writer {
            nodes,
            defined,
            variables: vec![0; n_variables],
            definitions: vec![0; defined.len()],
            kept: Vec::new(),
            shape: Shape::default(),
        }
    }

    /// The shape of `factor` · (nonlinear + linear terms); `None` where it has more than `limit` words.
    pub(crate) fn write(
        &mut self,
        factor: f64,
        nonlinear: Option<Id>,
        linear: &[(u32, f64)],
        limit: usize,
    ) -> Option<Shape> {
        let mut tasks = Vec::new();
        if factor != 1.0 {
            tasks.push(Task::Operator(Operator::Multiply, 2));
        }
        self.push_sum(nonlinear, linear, &mut tasks);
        if factor != 1.0 {
            self.number(factor);
        }
        let complete = self.run(tasks, limit);
        let shape = std::mem::take(&mut self.shape);
        for &variable in &shape.variables {
            self.variables[variable as usize] = 0;
        }
        for definition in self.kept.drain(..) {
            self.definitions[definition as usize] = 0;
        }
        complete.then_some(shape)
    }

    /// Tasks for an expression and linear terms.
    fn push_sum(&self, nonlinear: Option<Id>, linear: &[(u32, f64)], tasks: &mut Vec<Task>) {
        let linear = linear
            .iter()
            .map(|&(variable, factor)| Task::Linear(variable, factor));
        push_chain(
            nonlinear.map(Task::Expression).into_iter().chain(linear),
            tasks,
        );
    }

    fn run(&mut self, mut tasks: Vec<Task>, limit: usize) -> bool {
        while let Some(task) = tasks.pop() {
            if self.shape.code.len() > limit {
                return false;
            }
            match task {
                Task::Expression(id) => self.expression(id, &mut tasks),
                Task::Exponent(id) => match self.nodes.nodes[id as usize] {
                    Node::Number(exponent) => {
                        self.shape.code.push(Word::Exponent(exponent.to_bits()));
                    }
                    _ => self.expression(id, &mut tasks),
                },
                Task::Linear(variable, factor) => {
                    self.number(factor);
                    self.variable(variable);
                    self.operator(Operator::Multiply, 2);
                }
                Task::Operator(operator, n) => self.operator(operator, n),
                Task::Keep(number) => {
                    self.kept.push(number);
                    self.definitions[number as usize] = self.kept.len() as u32;
                    self.shape.code.push(Word::Keep);
                }
            }
        }
        true
    }

    fn expression(&mut self, id: Id, tasks: &mut Vec<Task>) {
        match self.nodes.nodes[id as usize] {
            Node::Number(number) => self.number(number),
            Node::Variable(variable) => self.variable(variable),
            Node::Defined(number) => match self.definitions[number as usize].checked_sub(1) {
                Some(kept) => self.shape.code.push(Word::Kept(kept)),
                None => {
                    let function = &self.defined[number as usize];
                    tasks.push(Task::Keep(number));
                    self.push_sum(function.nonlinear, &function.linear, tasks);
                }
            },
            Node::Operation {
                operator: Operator::Sum,
                first,
                n,
            } => {
                let operands = self.nodes.operands(first, n).iter();
                push_chain(operands.map(|&id| Task::Expression(id)), tasks);
            }
            Node::Operation { operator, first, n } => {
                tasks.push(Task::Operator(operator, n));
                let operands = self.nodes.operands(first, n);
                let exponent = |i: usize| operator == Operator::Power && i == 1;
                let operands = operands.iter().enumerate().rev();
                tasks.extend(operands.map(|(i, &id)| match exponent(i) {
                    true => Task::Exponent(id),
                    false => Task::Expression(id),
                }));
            }
        }
    }

    fn number(&mut self, number: f64) {
        self.shape.numbers.push(number);
        self.shape.code.push(Word::Number);
    }

    fn variable(&mut self, variable: u32) {
        let number = &mut self.variables[variable as usize];
        if *number == 0 {
            self.shape.variables.push(variable);
            *number = self.shape.variables.len() as u32;
        }
        let number = *number - 1;
        self.shape.code.push(Word::Variable(number));
    }

    fn operator(&mut self, operator: Operator, n: u32) {
        self.shape.code.push(Word::Operator(operator, n));
    }
}

/// Tasks for a sum, each term added before the next one is computed.
fn push_chain(terms: impl Iterator<Item = Task>, tasks: &mut Vec<Task>) {
    let first = tasks.len();
    for (i, term) in terms.enumerate() {
        tasks.push(term);
        if i > 0 {
            tasks.push(Task::Operator(Operator::Add, 2));
        }
    }
    if tasks.len() == first {
        tasks.push(Task::Operator(Operator::Sum, 0));
    }
    tasks[first..].reverse();
}

/// Computes a shape from its variables and numbers.
pub(crate) fn compile(
    code: &[Word],
    variables: &[Term],
    numbers: &[Term],
    b: &mut TapeBuilder,
) -> Term {
    let (mut stack, mut kept) = (Vec::new(), Vec::new());
    let mut numbers = numbers.iter();
    let complete = "a shape is complete";
    for &word in code {
        match word {
            Word::Variable(number) => stack.push(variables[number as usize]),
            Word::Number => stack.push(*numbers.next().expect(complete)),
            Word::Exponent(bits) => stack.push(Term::Number(f64::from_bits(bits))),
            Word::Keep => kept.push(*stack.last().expect(complete)),
            Word::Kept(number) => stack.push(kept[number as usize]),
            Word::Operator(operator, n) => {
                let operands = stack.split_off(stack.len() - n as usize);
                stack.push(apply(operator, &operands, b));
            }
        }
    }
    stack.pop().expect(complete)
}

/// The result of an operator.
pub(crate) fn apply(operator: Operator, operands: &[Term], b: &mut TapeBuilder) -> Term {
    let one = Term::ONE;
    let x = operands.first().copied().unwrap_or(Term::ZERO);
    let y = operands.get(1).copied().unwrap_or(Term::ZERO);
    match operator {
        Operator::Add => x.add(y, b),
        Operator::Subtract => x.sub(y, b),
        Operator::Multiply => x.mul(y, b),
        Operator::Divide => x.div(y, b),
        Operator::Power => x.pow(y, b),
        Operator::Square => x.square(b),
        Operator::Negate => x.neg(),
        Operator::Sum => {
            let mut total = Term::ZERO;
            for &term in operands {
                total = total.add(term, b);
            }
            total
        }
        Operator::Apply(f) => x.function(f, b),
        Operator::Sqrt => x.sqrt(b),
        Operator::Sinh => x.apply(b, f64::sinh, |b, x| b.sinh_cosh(x).0),
        Operator::Cosh => x.apply(b, f64::cosh, |b, x| b.sinh_cosh(x).1),
        Operator::Sin => x.apply(b, f64::sin, |b, x| b.sin_cos(x).0),
        Operator::Cos => x.apply(b, f64::cos, |b, x| b.sin_cos(x).1),
        Operator::Log10 => x.log(b).times(std::f64::consts::LOG10_E),
        Operator::Atan2 => x.atan2(y, b),
        // 1 / (1 + exp(-x))
        Operator::Logistic => {
            let exp = x.neg().function(Elementary::Exp, b);
            exp.add(one, b).recip(b)
        }
        Operator::Absolute | Operator::Minimum | Operator::Maximum => {
            unreachable!("kinks have been rewritten")
        }
    }
}
