//! A controller: what it has compiled belongs to a thread of its own, which is asked step by step.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use nsdc::Messages;
use nsdc::expr::Exprs;
use nsdc::limit::{Cancel, Limit};
use nsdc::optimize::PrepareError;
use nsdc::report::Warning;
use nsdc::study::mpc;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::model_error;

/// How long signals wait at most before somebody looks.
const LOOK: Duration = Duration::from_millis(20);

/// What the thread of a controller is asked.
enum Question {
    /// A step: when, from where, with which values of the open parameters, and what cancels it.
    Step(f64, Vec<f64>, Vec<f64>, Cancel),
    /// Ahead of a step: when it will be, with which values, and what cancels it.
    Prepare(f64, Vec<f64>, Cancel),
    /// The step that was prepared: from where, with which values, and what cancels it.
    Feedback(Vec<f64>, Vec<f64>, Cancel),
    Memory,
    Remember(String),
}

/// What it says: the names of states and controls first.
type Answer = Result<String, Refusal>;

/// What it cannot do.
enum Refusal {
    /// The model is wrong.
    Model(Messages),
    /// A value is.
    Value(String),
}

impl From<String> for Refusal {
    fn from(said: String) -> Self {
        Refusal::Value(said)
    }
}

impl From<Refusal> for PyErr {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Model(messages) => model_error(&messages),
            Refusal::Value(said) => PyValueError::new_err(said),
        }
    }
}

/// An `optimize` experiment that is solved from one state after another.
#[pyclass(frozen, module = "nsdc._core")]
pub struct Controller {
    talk: Mutex<(Sender<Question>, Receiver<Answer>)>,
}

impl Controller {
    /// Compiles an experiment; the names of what is open have their values at each step.
    #[expect(
        clippy::disallowed_methods,
        reason = "what a controller has compiled stays on one thread, and Python may call from any"
    )]
    pub fn new(
        project: Arc<nsdc::Project>,
        experiment: String,
        open: Vec<String>,
        values: Vec<(String, f64)>,
        deadline: Option<Duration>,
    ) -> PyResult<Self> {
        let (ask, questions) = channel();
        let (tell, answers) = channel();
        let work = move || {
            let exprs = Exprs::new();
            let open: Vec<&str> = open.iter().map(String::as_str).collect();
            let made = project.controller(&exprs, &experiment, &open, &values, deadline);
            match made {
                Ok(made) => {
                    let names = json!({ "states": made.states(), "controls": made.controls() });
                    if tell.send(Ok(names.to_string())).is_ok() {
                        serve(made, &questions, &tell);
                    }
                }
                // Who would hear it may have gone.
                Err(PrepareError::NotCompiled(messages)) => {
                    let _ = tell.send(Err(Refusal::Model(messages)));
                }
                Err(error) => {
                    let _ = tell.send(Err(error.to_string().into()));
                }
            }
        };
        let named = thread::Builder::new().name("nsdc controller".to_owned());
        // Compilation may be deep.
        let spawned = named.stack_size(64 << 20).spawn(work);
        spawned.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(Controller {
            talk: Mutex::new((ask, answers)),
        })
    }

    /// Waits for an answer without the interpreter; what a handler of signals raises cancels the work.
    fn hear(
        &self,
        py: Python<'_>,
        question: Option<Question>,
        cancel: &Cancel,
    ) -> PyResult<String> {
        let gone = || PyRuntimeError::new_err("the controller has ended");
        let mut question = question;
        let mut raised = None;
        loop {
            let heard = py.detach(|| {
                let talk = self.talk.lock().ok()?;
                if let Some(question) = question.take() {
                    talk.0.send(question).ok()?;
                }
                match talk.1.recv_timeout(LOOK) {
                    Ok(answer) => Some(Some(answer)),
                    Err(RecvTimeoutError::Timeout) => Some(None),
                    Err(RecvTimeoutError::Disconnected) => None,
                }
            });
            match heard {
                None => return Err(raised.unwrap_or_else(gone)),
                Some(Some(answer)) => {
                    return match raised {
                        Some(error) => Err(error),
                        None => answer.map_err(PyErr::from),
                    };
                }
                Some(None) => {
                    if let Err(error) = py.check_signals() {
                        cancel.cancel();
                        raised.get_or_insert(error);
                    }
                }
            }
        }
    }
}

#[pymethods]
impl Controller {
    /// The names of its states and controls, as JSON, once it is compiled.
    fn names(&self, py: Python<'_>) -> PyResult<String> {
        self.hear(py, None, &Cancel::default())
    }

    /// A step, as JSON.
    fn step(&self, py: Python<'_>, t: f64, x: Vec<f64>, parameters: Vec<f64>) -> PyResult<String> {
        let cancel = Cancel::default();
        let question = Question::Step(t, x, parameters, cancel.clone());
        self.hear(py, Some(question), &cancel)
    }

    /// Gets ready for a step.
    fn prepare(&self, py: Python<'_>, t: f64, parameters: Vec<f64>) -> PyResult<()> {
        let cancel = Cancel::default();
        let question = Question::Prepare(t, parameters, cancel.clone());
        self.hear(py, Some(question), &cancel)?;
        Ok(())
    }

    /// The step that was prepared, as JSON.
    fn feedback(&self, py: Python<'_>, x: Vec<f64>, parameters: Vec<f64>) -> PyResult<String> {
        let cancel = Cancel::default();
        let question = Question::Feedback(x, parameters, cancel.clone());
        self.hear(py, Some(question), &cancel)
    }

    /// What it remembers, as JSON.
    fn memory(&self, py: Python<'_>) -> PyResult<String> {
        self.hear(py, Some(Question::Memory), &Cancel::default())
    }

    /// Goes on from what another one of the experiment has remembered.
    fn remember(&self, py: Python<'_>, memory: String) -> PyResult<()> {
        let question = Question::Remember(memory);
        self.hear(py, Some(question), &Cancel::default())?;
        Ok(())
    }
}

/// Answers questions as long as somebody asks.
fn serve(mut made: mpc::Controller<'_>, questions: &Receiver<Question>, tell: &Sender<Answer>) {
    while let Ok(question) = questions.recv() {
        let answer = match question {
            Question::Step(t, x, parameters, cancel) => {
                let limit = Limit::default().canceled_by(&cancel);
                let step = made.step(t, &x, &parameters, &limit);
                Ok(told(&made, &step))
            }
            Question::Prepare(t, parameters, cancel) => {
                made.prepare(t, &parameters, &Limit::default().canceled_by(&cancel));
                Ok(String::new())
            }
            Question::Feedback(x, parameters, cancel) => {
                let limit = Limit::default().canceled_by(&cancel);
                let step = made.feedback(&x, &parameters, &limit);
                step.map(|step| told(&made, &step)).ok_or_else(|| {
                    "nothing is prepared: call `prepare` first"
                        .to_owned()
                        .into()
                })
            }
            Question::Memory => {
                serde_json::to_string(made.memory()).map_err(|error| error.to_string().into())
            }
            Question::Remember(memory) => {
                let memory = serde_json::from_str(&memory);
                match memory.is_ok_and(|memory| made.remember(memory)) {
                    true => Ok(String::new()),
                    false => Err("this is the state of another controller".to_owned().into()),
                }
            }
        };
        if tell.send(answer).is_err() {
            break;
        }
    }
}

fn told(made: &mpc::Controller<'_>, step: &mpc::Step) -> String {
    let column = |names: Vec<String>, rows: &[Vec<f64>]| {
        let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
        let columns = names
            .into_iter()
            .enumerate()
            .map(|(i, name)| (name, json!(column(i))));
        columns.collect::<serde_json::Map<_, _>>()
    };
    let plan = made.followed(step.time).map(|(plan, passed)| {
        let begun = step.time - passed;
        let time: Vec<f64> = plan.ends.iter().map(|end| begun + end).collect();
        json!({
            "time": time,
            "states": column(made.planned_states(), &plan.states),
            "controls": column(made.controls(), &plan.controls),
            "objective": plan.objective,
        })
    });
    let why = step.why.as_ref().map(|why| Warning::of(why));
    json!({
        "u": made.control(step.time),
        "decision": step.decision,
        "why": why,
        "iterations": step.iterations,
        "solve_s": step.seconds,
        "plan": plan,
    })
    .to_string()
}
