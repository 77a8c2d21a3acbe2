//! What is run for a client, beside what it asks meanwhile: how far it is, and what came of it.

use std::ffi::OsString;
use std::hash::{Hash, Hasher};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::notification::{Notification as _, Progress as ProgressNote};
use lsp_types::request::{Request as _, ShowDocument, WorkDoneProgressCreate};
use lsp_types::{ExecuteCommandParams, NumberOrString, ProgressToken, Uri};
use rustc_hash::FxHasher;
use serde_json::{Value, json};

use super::text::{path_of, uri_of};
use super::{Answer, Client, Refused, lenses};
use crate::cli::args::TestArgs;
use crate::cli::progress::Bar;
use crate::cli::texts::Texts;
use crate::cli::watch::Watching;
use crate::cli::{self, Exit, Meter, STACK, Streams, commands};
use crate::limit::{Cancel, Limit};
use crate::project::Project;
use crate::project::run::Options;
use crate::report::Status;
use crate::source::files::{Disk, Files};

/// Where answers go.
type Send = Box<dyn Fn(Message) + std::marker::Send>;

/// The way to the client, as long as there is one.
#[derive(Clone)]
struct Sender(Arc<Mutex<Option<Send>>>);

impl Sender {
    fn send(&self, message: impl Into<Message>) {
        if let Ok(way) = self.0.lock()
            && let Some(send) = &*way
        {
            send(message.into());
        }
    }

    /// Nothing is sent any more, and who reads need not wait for it.
    fn close(&self) {
        if let Ok(mut way) = self.0.lock() {
            *way = None;
        }
    }
}

/// What goes on.
struct Task {
    id: RequestId,
    token: Option<ProgressToken>,
    cancel: Cancel,
    thread: JoinHandle<()>,
}

/// All that goes on.
pub struct Tasks {
    sender: Sender,
    open: Vec<Task>,
}

/// What is asked for.
struct Asked {
    word: String,
    uri: Uri,
    experiment: Option<String>,
    form: String,
}

impl Asked {
    fn read(params: &ExecuteCommandParams) -> Answer<Self> {
        let word = params.command.strip_prefix("nsdc.").unwrap_or_default();
        let text = |at: usize| {
            params
                .arguments
                .get(at)
                .and_then(Value::as_str)
                .map(str::to_owned)
        };
        let uri = text(0).and_then(|uri| uri.parse().ok());
        match uri.filter(|_| lenses::WORDS.contains(&word)) {
            Some(uri) => Ok(Asked {
                word: word.to_owned(),
                uri,
                experiment: text(1),
                form: text(2).unwrap_or_else(|| "system".to_owned()),
            }),
            None => Err(Refused {
                code: ErrorCode::InvalidParams,
                message: format!("`{}` takes a file and an experiment", params.command),
            }),
        }
    }
}

impl Tasks {
    /// Nothing goes on yet.
    pub fn new(send: impl Fn(Message) + std::marker::Send + 'static) -> Self {
        Tasks {
            sender: Sender(Arc::new(Mutex::new(Some(Box::new(send))))),
            open: Vec::new(),
        }
    }

    /// Begins what is asked for; the answer comes from there.
    pub fn begin(
        &mut self,
        id: RequestId,
        params: ExecuteCommandParams,
        texts: &Texts,
        client: &Client,
    ) -> Answer<()> {
        let asked = Asked::read(&params)?;
        self.open.retain(|task| !task.thread.is_finished());
        let given = params.work_done_progress_params.work_done_token;
        let token = given.or_else(|| {
            let token = NumberOrString::String(format!("nsdc {id}"));
            client.progress.then(|| {
                let create = WorkDoneProgressCreate::METHOD.to_owned();
                let id = RequestId::from(format!("progress {id}"));
                let params = json!({ "token": token });
                self.sender.send(Request::new(id, create, params));
                token
            })
        });
        let work = Work {
            id: id.clone(),
            asked,
            texts: texts.with([]),
            cancel: Cancel::default(),
            progress: token.clone().map(|token| Progress {
                token,
                send: self.sender.clone(),
            }),
            shows: client.shows,
            send: self.sender.clone(),
        };
        let cancel = work.cancel.clone();
        let thread = thread::Builder::new()
            .name("nsdc".to_owned())
            .stack_size(STACK)
            .spawn(move || work.done());
        let thread = thread.map_err(|error| Refused::new(error.to_string()))?;
        self.open.push(Task {
            id,
            token,
            cancel,
            thread,
        });
        Ok(())
    }

    /// Ends what answers a request.
    pub fn cancel(&self, id: &RequestId) {
        let found = self.open.iter().filter(|task| task.id == *id);
        found.for_each(|task| task.cancel.cancel());
    }

    /// Ends what is shown under a token.
    pub fn cancel_shown(&self, token: &ProgressToken) {
        let found = self
            .open
            .iter()
            .filter(|task| task.token.as_ref() == Some(token));
        found.for_each(|task| task.cancel.cancel());
    }

    /// Ends all; what runs to its end by itself is not waited for.
    pub fn end(&mut self) {
        self.open.drain(..).for_each(|task| task.cancel.cancel());
        self.sender.close();
    }
}

/// One thing that is run.
struct Work {
    id: RequestId,
    asked: Asked,
    texts: Texts,
    cancel: Cancel,
    progress: Option<Progress>,
    shows: bool,
    send: Sender,
}

/// Where a client shows how far it is.
#[derive(Clone)]
struct Progress {
    token: ProgressToken,
    send: Sender,
}

impl Progress {
    fn tell(&self, value: Value) {
        let params = json!({ "token": self.token, "value": value });
        let method = ProgressNote::METHOD.to_owned();
        self.send.send(Notification::new(method, params));
    }
}

/// What came of it.
struct Outcome {
    exit: Exit,
    text: String,
    figure: Option<String>,
}

impl Work {
    fn done(self) {
        let name = self.asked.experiment.as_deref().unwrap_or("all");
        let title = format!("{} {name}", self.asked.word);
        self.tell(json!({ "kind": "begin", "title": title, "cancellable": true }));
        let ended = panic::catch_unwind(AssertUnwindSafe(|| match self.asked.word.as_str() {
            "run" | "plot" => self.run(),
            _ => self.command(),
        }));
        let ended = ended.unwrap_or_else(|_| {
            Err(Refused {
                code: ErrorCode::InternalError,
                message: format!("`{title}` has ended in a mistake of nsdc"),
            })
        });
        self.tell(json!({ "kind": "end" }));
        let response = match ended {
            _ if self.cancel.is_canceled() => Refused {
                code: ErrorCode::RequestCanceled,
                message: format!("`{title}` is canceled"),
            }
            .response(self.id.clone()),
            Err(refused) => refused.response(self.id.clone()),
            Ok(outcome) => Response::new_ok(self.id.clone(), self.show(&outcome, name)),
        };
        self.send.send(response);
    }

    fn tell(&self, value: Value) {
        if let Some(progress) = &self.progress {
            progress.tell(value);
        }
    }

    /// Tells how far it is, now and then.
    fn meter(&self) -> Meter {
        let Some(progress) = self.progress.clone() else {
            return Meter::None;
        };
        // What is shown under one token does not fall.
        let most = AtomicU32::new(0);
        Meter::Told(Arc::new(move |done, message| {
            let mut value = json!({ "kind": "report", "message": message });
            if let Some(done) = done {
                let percent = (100.0 * done) as u32;
                let known = most.fetch_max(percent, Ordering::Relaxed);
                value["percentage"] = percent.max(known).into();
            }
            progress.tell(value);
        }))
    }

    fn path(&self) -> PathBuf {
        path_of(&self.asked.uri)
    }

    /// A run by the library.
    fn run(&self) -> Answer<Outcome> {
        let project = Project::from_files(self.path(), self.texts.clone());
        let project = project.map_err(|error| Refused::new(error.to_string()))?;
        let options = Options {
            limit: Limit::default().canceled_by(&self.cancel),
            figure: self.asked.word == "plot",
            ..Options::default()
        };
        let only = || {
            let mut all = project.experiments();
            all.next()
                .map(|known| known.name.name.clone())
                .filter(|_| all.next().is_none())
        };
        let name = self.asked.experiment.clone().or_else(only);
        let name = name.ok_or_else(|| Refused::new("name an experiment"))?;
        let mut watching = Watching::new(Bar::new(&name, self.meter()));
        let run = project.run(&name, &options, &mut watching);
        let run = run.map_err(|messages| Refused::new(messages.to_string()))?;
        Ok(Outcome {
            exit: match run.trajectory.status {
                Status::Solved => Exit::Success,
                _ => Exit::Failed,
            },
            text: format!("{}{}", run.messages(), run.text()),
            figure: run.figure,
        })
    }

    /// What a command prints.
    fn command(&self) -> Answer<Outcome> {
        let experiment = &self.asked.experiment;
        let word = &self.asked.word;
        let mut args: Vec<OsString> = vec!["nsdc".into(), word.into(), self.path().into()];
        args.extend(experiment.as_ref().map(OsString::from));
        if word == "emit" {
            args.extend(["--ir".into(), OsString::from(&self.asked.form)]);
        }
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let mut streams = Streams {
            out: &mut out,
            err: &mut err,
            colour: false,
            meter: self.meter(),
            cancel: self.cancel.clone(),
            width: 100,
            files: Arc::new(self.texts.clone()),
        };
        let exit = match word.as_str() {
            "test" => {
                let args = TestArgs::of(self.path(), experiment.clone());
                let tested = commands::test::run(&args, &mut streams);
                tested.map_err(|error| Refused::new(error.to_string()))?
            }
            _ => cli::run(args, &mut streams),
        };
        let text = [&err[..], &out[..]].concat();
        Ok(Outcome {
            exit,
            text: String::from_utf8_lossy(&text).into_owned(),
            figure: None,
        })
    }

    /// The folder of results of this file: its name, and what tells it from others of that name.
    fn folder(&self) -> String {
        let path = self.path();
        let mut hasher = FxHasher::default();
        Disk.key(&path).hash(&mut hasher);
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        format!("results/{name}-{:016x}", hasher.finish())
    }

    /// What came of it as data, after it has been shown as a document, or a figure where there is one.
    fn show(&self, outcome: &Outcome, name: &str) -> Value {
        let (extension, shown) = match &outcome.figure {
            Some(figure) => ("svg", figure),
            None => ("txt", &outcome.text),
        };
        let file = format!("{name}.{}.{extension}", self.asked.word);
        let is_plain = Path::new(&file)
            .file_name()
            .is_some_and(|known| known == file.as_str());
        let path =
            (self.shows && is_plain).then(|| super::pages::write(&self.folder(), &file, shown));
        let uri = path.flatten().and_then(|path| uri_of(&path));
        if let Some(uri) = &uri {
            let method = ShowDocument::METHOD.to_owned();
            let id = RequestId::from(format!("show {}", self.id));
            let params = json!({ "uri": uri, "takeFocus": false });
            self.send.send(Request::new(id, method, params));
        }
        json!({ "status": outcome.exit as u8, "text": outcome.text, "figure": outcome.figure, "uri": uri })
    }
}
