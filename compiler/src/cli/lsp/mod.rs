//! `nsdc lsp`: a language server.
//!
//! One thread answers requests in their order. What a client types is checked once there is nothing else to do; what is run
//! goes on beside, and can be canceled. All that is said of names is a view of one index, `model::index`.

mod around;
mod commands;
mod complete;
mod diagnostics;
mod hints;
mod hover;
mod lenses;
mod names;
mod pages;
mod pipes;
mod reference;
mod symbols;
mod text;
mod tokens;
pub(crate) mod world;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Duration;

use crossbeam_channel::SendTimeoutError;
use lsp_server::{Connection, ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::notification::{
    Cancel as CancelRequest, DidChangeTextDocument, DidChangeWatchedFiles, DidCloseTextDocument,
    DidOpenTextDocument, DidSaveTextDocument, Notification as _, PublishDiagnostics,
    WorkDoneProgressCancel,
};
use lsp_types::request::{self as ask, Request as _};
use lsp_types::{InitializeParams, NumberOrString, PublishDiagnosticsParams, Uri};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use self::commands::Tasks;
use self::hover::cache::Cache;
use self::pipes::Pipes;
use self::world::World;
use crate::cli::{Exit, Streams, io};
use crate::expr::Exprs;

/// While nothing is asked, the process of the client is looked for so often: others may hold its ends of the pipes.
const GLANCE: Duration = Duration::from_secs(5);

/// Serves a client at standard input and output until it leaves.
pub fn run(streams: &mut Streams<'_>) -> io::Result<Exit> {
    let (connection, pipes) = Pipes::open()?;
    let Some(exit) = served(&connection) else {
        // Who reads from a client that is gone may wait for ever.
        return Ok(Exit::Wrong);
    };
    drop(connection);
    match pipes.join() {
        Ok(()) => Ok(exit),
        Err(error) => {
            writeln!(streams.err, "error: {error}")?;
            Ok(Exit::Wrong)
        }
    }
}

/// Serves a client until it leaves: well if it has asked for that before.
pub fn serve(connection: Connection) -> Exit {
    served(&connection).unwrap_or(Exit::Wrong)
}

/// The same; nothing where the process of the client is gone.
fn served(connection: &Connection) -> Option<Exit> {
    let mut server = Server::new(connection);
    let exit = server.serve();
    server.tasks.end();
    exit
}

/// Why a request is not answered.
struct Refused {
    code: ErrorCode,
    message: String,
}

impl Refused {
    /// It cannot be done.
    fn new(message: impl Into<String>) -> Self {
        let message = message.into();
        Refused {
            code: ErrorCode::RequestFailed,
            message,
        }
    }
}

/// What a request is answered by.
type Answer<T> = Result<T, Refused>;

/// Where a client is in its life.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    New,
    Working,
    ShutDown,
}

/// What a client can do, and wants.
#[derive(Clone, Debug, Default)]
struct Client {
    links: bool,
    shows: bool,
    watches: bool,
    progress: bool,
    hints: bool,
    /// Its process, where it has said which one it is.
    process: Option<u32>,
}

impl Client {
    fn of(params: &InitializeParams) -> Self {
        let workspace = params.capabilities.workspace.as_ref();
        let texts = params.capabilities.text_document.as_ref();
        let window = params.capabilities.window.as_ref();
        let diagnostics = texts.and_then(|texts| texts.publish_diagnostics.as_ref());
        let watched = workspace.and_then(|known| known.did_change_watched_files.as_ref());
        let shown = window.and_then(|window| window.show_document.as_ref());
        let options = params.initialization_options.as_ref();
        let hints = options.and_then(|options| options.get("inlayHints")?.as_bool());
        Client {
            links: diagnostics.and_then(|known| known.code_description_support) == Some(true),
            shows: shown.is_some_and(|shown| shown.support),
            watches: watched.and_then(|known| known.dynamic_registration) == Some(true),
            progress: window.and_then(|window| window.work_done_progress) == Some(true),
            hints: hints.unwrap_or(true),
            process: params.process_id,
        }
    }

    fn is_gone(&self) -> bool {
        self.process
            .is_some_and(|process| !pipes::is_there(process))
    }
}

struct Server<'c> {
    connection: &'c Connection,
    phase: Phase,
    client: Client,
    world: World,
    tasks: Tasks,
    /// Whether something has changed since diagnostics were told.
    is_stale: bool,
    /// What was told of each file.
    told: BTreeMap<String, PublishDiagnosticsParams>,
    /// Whether a message found that the process of the client is gone: no other waits for it.
    has_lost_client: Cell<bool>,
}

impl<'c> Server<'c> {
    fn new(connection: &'c Connection) -> Self {
        Server {
            connection,
            phase: Phase::New,
            client: Client::default(),
            world: World::default(),
            tasks: Tasks::new({
                let sender = connection.sender.clone();
                move |message| drop(sender.send(message))
            }),
            is_stale: false,
            told: BTreeMap::new(),
            has_lost_client: Cell::new(false),
        }
    }

    fn serve(&mut self) -> Option<Exit> {
        loop {
            let exprs = Exprs::new();
            if let ControlFlow::Break(exit) = self.serve_with(&Cache::new(&exprs)) {
                return exit;
            }
        }
    }

    /// Serves until what was compiled holds no more, or the client leaves.
    fn serve_with(&mut self, cache: &Cache<'_>) -> ControlFlow<Option<Exit>> {
        loop {
            if (self.world.has_changed() && cache.len() > 0) || cache.is_full() {
                return ControlFlow::Continue(());
            }
            let received = match self.is_stale {
                true => match self.connection.receiver.try_recv() {
                    Err(error) if error.is_empty() => {
                        self.tell();
                        continue;
                    }
                    received => received.ok(),
                },
                false => match self.connection.receiver.recv_timeout(GLANCE) {
                    Err(error) if error.is_timeout() && self.client.is_gone() => {
                        return ControlFlow::Break(None);
                    }
                    Err(error) if error.is_timeout() => continue,
                    received => received.ok(),
                },
            };
            match received {
                // A client that is gone has not said so.
                None => return ControlFlow::Break(Some(Exit::Wrong)),
                Some(Message::Notification(note)) if note.method == "exit" => {
                    return ControlFlow::Break(Some(match self.phase {
                        Phase::ShutDown => Exit::Success,
                        Phase::New | Phase::Working => Exit::Wrong,
                    }));
                }
                Some(Message::Notification(note)) if self.phase == Phase::Working => {
                    self.notified(note);
                }
                Some(Message::Request(request)) => {
                    if let Some(response) = self.request(request, cache) {
                        self.send(response);
                    }
                }
                // Of what the client was asked nothing but that it was asked is needed.
                Some(Message::Notification(_) | Message::Response(_)) => {}
            }
        }
    }

    fn send(&self, message: impl Into<Message>) {
        // That nobody listens is seen when nothing comes any more. A client that is gone never does, though others may hold its
        // ends of the pipes.
        let mut message = message.into();
        let wait = || match self.has_lost_client.get() {
            true => Duration::ZERO,
            false => GLANCE,
        };
        let sender = &self.connection.sender;
        while let Err(SendTimeoutError::Timeout(unsent)) = sender.send_timeout(message, wait()) {
            if self.client.is_gone() {
                self.has_lost_client.set(true);
                return;
            }
            message = unsent;
        }
    }

    fn notified(&mut self, note: Notification) {
        match note.method.as_str() {
            DidOpenTextDocument::METHOD => {
                if let Some(params) = read::<DidOpenTextDocument>(note) {
                    let opened = params.text_document;
                    self.world.open(opened.uri, opened.version, opened.text);
                }
            }
            DidChangeTextDocument::METHOD => {
                if let Some(params) = read::<DidChangeTextDocument>(note) {
                    let changed = params.text_document;
                    let changes = params.content_changes;
                    self.world.change(&changed.uri, changed.version, changes);
                }
            }
            DidCloseTextDocument::METHOD => {
                if let Some(params) = read::<DidCloseTextDocument>(note) {
                    self.close(&params.text_document.uri);
                }
            }
            DidSaveTextDocument::METHOD => {
                if let Some(params) = read::<DidSaveTextDocument>(note) {
                    self.world.touch(&World::key(&params.text_document.uri));
                }
            }
            DidChangeWatchedFiles::METHOD => {
                if let Some(params) = read::<DidChangeWatchedFiles>(note) {
                    for change in params.changes {
                        self.world.touch(&World::key(&change.uri));
                    }
                }
            }
            CancelRequest::METHOD => {
                if let Some(params) = read::<CancelRequest>(note) {
                    let id = match params.id {
                        NumberOrString::Number(id) => RequestId::from(id),
                        NumberOrString::String(id) => RequestId::from(id),
                    };
                    self.tasks.cancel(&id);
                }
                return;
            }
            WorkDoneProgressCancel::METHOD => {
                if let Some(params) = read::<WorkDoneProgressCancel>(note) {
                    self.tasks.cancel_shown(&params.token);
                }
                return;
            }
            "initialized" => {
                self.watch();
                return;
            }
            _ => return,
        }
        self.is_stale = true;
    }

    /// Asks to be told of files that change.
    fn watch(&self) {
        if self.client.watches {
            let patterns = ["**/*.nsd", "**/*.csv"].map(|glob| json!({ "globPattern": glob }));
            let method = DidChangeWatchedFiles::METHOD;
            let options = json!({ "watchers": patterns });
            let registered = json!({ "id": "files", "method": method, "registerOptions": options });
            self.send(Request::new(
                RequestId::from("files".to_owned()),
                ask::RegisterCapability::METHOD.to_owned(),
                json!({ "registrations": [registered] }),
            ));
        }
    }

    fn close(&mut self, uri: &Uri) {
        self.world.close(uri);
        if self.told.remove(&World::key(uri)).is_some() {
            let (uri, diagnostics, version) = (uri.clone(), vec![], None);
            self.publish(&PublishDiagnosticsParams {
                uri,
                diagnostics,
                version,
            });
        }
    }

    /// Tells what is wrong in the texts that are open, where that has changed.
    fn tell(&mut self) {
        self.is_stale = false;
        let open: Vec<_> = self.world.documents().cloned().collect();
        for document in open {
            let Some(analysis) = self.world.analysis(&document.uri) else {
                continue;
            };
            let found = diagnostics::of(&analysis, self.client.links);
            if !analysis.checked().has_errors() {
                self.world.keep_sound(&document.uri, &analysis);
            }
            let told = PublishDiagnosticsParams {
                uri: document.uri.clone(),
                diagnostics: found.into_iter().map(|found| found.shown).collect(),
                version: Some(document.version),
            };
            let key = World::key(&document.uri);
            if self.told.get(&key) != Some(&told) {
                self.publish(&told);
                self.told.insert(key, told);
            }
        }
    }

    fn publish(&self, told: &PublishDiagnosticsParams) {
        self.send(Notification::new(
            PublishDiagnostics::METHOD.to_owned(),
            told,
        ));
    }

    /// The answer, where it is there at once.
    fn request(&mut self, request: Request, cache: &Cache<'_>) -> Option<Response> {
        let refuse = |code: ErrorCode, message: &str| {
            Some(Response::new_err(
                request.id.clone(),
                code as i32,
                message.to_owned(),
            ))
        };
        match (self.phase, request.method.as_str()) {
            (Phase::New, ask::Initialize::METHOD) => Some(self.initialize(request)),
            (Phase::New, _) => refuse(ErrorCode::ServerNotInitialized, "expected `initialize`"),
            (Phase::ShutDown, _) => refuse(ErrorCode::InvalidRequest, "the server is shut down"),
            (Phase::Working, ask::Initialize::METHOD) => {
                refuse(ErrorCode::InvalidRequest, "the server is initialized")
            }
            (Phase::Working, ask::Shutdown::METHOD) => {
                self.phase = Phase::ShutDown;
                Some(Response::new_ok(request.id, Value::Null))
            }
            (Phase::Working, ask::ExecuteCommand::METHOD) => self.execute(request),
            (Phase::Working, _) => Some(self.look(request, cache)),
        }
    }

    fn initialize(&mut self, request: Request) -> Response {
        let id = request.id;
        let params: InitializeParams = match serde_json::from_value(request.params) {
            Ok(params) => params,
            Err(error) => return invalid(id, &error),
        };
        self.phase = Phase::Working;
        self.client = Client::of(&params);
        let folders = params.workspace_folders.into_iter().flatten();
        let folders: Vec<Uri> = folders.map(|folder| folder.uri).collect();
        #[expect(deprecated, reason = "older clients have one folder alone")]
        let folders = match folders.is_empty() {
            true => params.root_uri.into_iter().collect(),
            false => folders,
        };
        self.world.roots = folders.iter().map(text::path_of).collect();
        let server = json!({ "name": "nsdc", "version": env!("CARGO_PKG_VERSION") });
        let can = capabilities();
        Response::new_ok(id, json!({ "capabilities": can, "serverInfo": server }))
    }

    /// Answers what is asked about texts.
    fn look(&mut self, request: Request, cache: &Cache<'_>) -> Response {
        let (world, client) = (&mut self.world, &self.client);
        match request.method.as_str() {
            ask::CodeActionRequest::METHOD => {
                answer::<ask::CodeActionRequest>(request, |p| diagnostics::actions(world, &p))
            }
            ask::HoverRequest::METHOD => {
                answer::<ask::HoverRequest>(request, |p| hover::hover(world, cache, &p))
            }
            ask::GotoDefinition::METHOD => {
                answer::<ask::GotoDefinition>(request, |p| names::definition(world, &p))
            }
            ask::References::METHOD => {
                answer::<ask::References>(request, |p| names::references(world, &p))
            }
            ask::DocumentHighlightRequest::METHOD => {
                answer::<ask::DocumentHighlightRequest>(request, |p| names::highlights(world, &p))
            }
            ask::PrepareRenameRequest::METHOD => {
                answer::<ask::PrepareRenameRequest>(request, |p| names::may_rename(world, &p))
            }
            ask::Rename::METHOD => answer::<ask::Rename>(request, |p| names::rename(world, &p)),
            ask::DocumentSymbolRequest::METHOD => {
                answer::<ask::DocumentSymbolRequest>(request, |p| symbols::of_file(world, &p))
            }
            ask::WorkspaceSymbolRequest::METHOD => {
                answer::<ask::WorkspaceSymbolRequest>(request, |p| symbols::of_world(world, &p))
            }
            ask::FoldingRangeRequest::METHOD => {
                answer::<ask::FoldingRangeRequest>(request, |p| symbols::folds(world, &p))
            }
            ask::SelectionRangeRequest::METHOD => {
                answer::<ask::SelectionRangeRequest>(request, |p| symbols::selections(world, &p))
            }
            ask::Formatting::METHOD => {
                answer::<ask::Formatting>(request, |p| symbols::format(world, &p))
            }
            ask::RangeFormatting::METHOD => {
                answer::<ask::RangeFormatting>(request, |p| symbols::format_range(world, &p))
            }
            ask::Completion::METHOD => {
                answer::<ask::Completion>(request, |p| complete::complete(world, &p))
            }
            ask::SignatureHelpRequest::METHOD => {
                answer::<ask::SignatureHelpRequest>(request, |p| complete::signature(world, &p))
            }
            ask::SemanticTokensFullRequest::METHOD => {
                answer::<ask::SemanticTokensFullRequest>(request, |p| tokens::all(world, &p))
            }
            ask::InlayHintRequest::METHOD => answer::<ask::InlayHintRequest>(request, |p| {
                Ok(Some(match client.hints {
                    true => hints::hints(world, cache, &p),
                    false => vec![],
                }))
            }),
            ask::CodeLensRequest::METHOD => {
                answer::<ask::CodeLensRequest>(request, |p| lenses::all(world, &p))
            }
            _ => {
                let message = format!("there is no `{}` here", request.method);
                Response::new_err(request.id, ErrorCode::MethodNotFound as i32, message)
            }
        }
    }

    /// Begins what a command asks for; the answer comes when it is done.
    fn execute(&mut self, request: Request) -> Option<Response> {
        let (id, params) = match params::<ask::ExecuteCommand>(request) {
            Ok(read) => read,
            Err(response) => return Some(response),
        };
        let begun = self
            .tasks
            .begin(id.clone(), params, self.world.texts(), &self.client);
        begun.err().map(|refused| refused.response(id))
    }
}

impl Refused {
    fn response(self, id: RequestId) -> Response {
        Response::new_err(id, self.code as i32, self.message)
    }
}

/// What comes with a notification; one that is wrong has no answer.
fn read<N: lsp_types::notification::Notification>(note: Notification) -> Option<N::Params>
where
    N::Params: DeserializeOwned,
{
    serde_json::from_value(note.params).ok()
}

fn params<R: ask::Request>(request: Request) -> Result<(RequestId, R::Params), Response> {
    let id = request.id;
    match serde_json::from_value(request.params) {
        Ok(params) => Ok((id, params)),
        Err(error) => Err(invalid(id, &error)),
    }
}

fn invalid(id: RequestId, error: &serde_json::Error) -> Response {
    Response::new_err(id, ErrorCode::InvalidParams as i32, error.to_string())
}

fn answer<R: ask::Request>(
    request: Request,
    look: impl FnOnce(R::Params) -> Answer<R::Result>,
) -> Response {
    let (id, params) = match params::<R>(request) {
        Ok(read) => read,
        Err(response) => return response,
    };
    match look(params) {
        Ok(found) => Response::new_ok(id, found),
        Err(refused) => refused.response(id),
    }
}

/// What clients may ask for.
fn capabilities() -> Value {
    json!({
        "positionEncoding": "utf-16",
        "textDocumentSync": { "openClose": true, "change": 2, "save": true },
        "codeActionProvider": { "codeActionKinds": ["quickfix"] },
        "hoverProvider": true,
        "definitionProvider": true,
        "referencesProvider": true,
        "documentHighlightProvider": true,
        "renameProvider": { "prepareProvider": true },
        "documentSymbolProvider": true,
        "workspaceSymbolProvider": true,
        "foldingRangeProvider": true,
        "selectionRangeProvider": true,
        "documentFormattingProvider": true,
        "documentRangeFormattingProvider": true,
        "completionProvider": { "triggerCharacters": [".", " "] },
        "signatureHelpProvider": { "triggerCharacters": ["(", ","] },
        "semanticTokensProvider": { "legend": tokens::legend(), "full": true },
        "inlayHintProvider": true,
        "codeLensProvider": {},
        "executeCommandProvider": { "commands": lenses::commands(), "workDoneProgress": true },
    })
}
