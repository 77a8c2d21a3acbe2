//! A client of the language server, in memory, and the texts that it has.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::Duration;

use lsp_server::{Connection, Message, Notification, Request, RequestId, Response};
use nsdc::cli::{Exit, lsp};
use serde_json::{Value, json};

/// Whoever takes longer hangs.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// A client, and the server that it talks to.
pub struct Client {
    pub connection: Connection,
    pub server: JoinHandle<Exit>,
    pub last: i32,
    pub versions: BTreeMap<String, i32>,
    pub notes: Vec<Notification>,
    pub requests: Vec<Request>,
    /// The last version of each text of which something was told.
    seen: BTreeMap<String, i64>,
}

impl Client {
    pub fn silent() -> Self {
        let (server, connection) = Connection::memory();
        Client {
            connection,
            server: std::thread::spawn(move || lsp::serve(server)),
            last: 0,
            versions: BTreeMap::new(),
            notes: vec![],
            requests: vec![],
            seen: BTreeMap::new(),
        }
    }

    /// One that has said what it can.
    pub fn new(folders: &[&Path]) -> Self {
        let mut client = Client::silent();
        let folder = |path: &&Path| json!({ "uri": uri(path), "name": "models" });
        let folders: Vec<Value> = folders.iter().map(folder).collect();
        let params = json!({ "capabilities": {}, "workspaceFolders": folders });
        let answer = client.ask("initialize", params);
        assert_eq!(answer["capabilities"]["positionEncoding"], "utf-16");
        client.tell("initialized", json!({}));
        client
    }

    pub fn tell(&self, method: &str, params: Value) {
        let note = Notification::new(method.to_owned(), params);
        self.connection
            .sender
            .send(note.into())
            .expect("the server is there");
    }

    pub fn send(&mut self, method: &str, params: Value) -> RequestId {
        self.last += 1;
        let id = RequestId::from(self.last);
        let request = Request::new(id.clone(), method.to_owned(), params);
        self.connection
            .sender
            .send(request.into())
            .expect("the server is there");
        id
    }

    pub fn receive(&mut self) -> Option<Response> {
        match self
            .connection
            .receiver
            .recv_timeout(PATIENCE)
            .expect("the server answers")
        {
            Message::Response(response) => return Some(response),
            Message::Notification(note) => self.note(note),
            Message::Request(request) => self.requests.push(request),
        }
        None
    }

    fn note(&mut self, note: Notification) {
        if let (Some(uri), Some(version)) =
            (note.params["uri"].as_str(), note.params["version"].as_i64())
        {
            let last = self.seen.insert(uri.to_owned(), version).unwrap_or(0);
            assert!(last <= version, "what is told of {uri} goes back in time");
        }
        self.notes.push(note);
    }

    pub fn response(&mut self, id: &RequestId) -> Response {
        loop {
            if let Some(response) = self.receive() {
                assert_eq!(response.id, *id, "answers come in order");
                return response;
            }
        }
    }

    /// The answer, or the code of an error.
    pub fn try_ask(&mut self, method: &str, params: Value) -> Result<Value, (i32, String)> {
        let id = self.send(method, params);
        let result = self.response(&id).response_result;
        result.map_err(|error| (error.code, error.message))
    }

    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        let answer = self.try_ask(method, params);
        answer.unwrap_or_else(|error| panic!("{method} is refused: {error:?}"))
    }

    /// What is wrong in a text once it is opened, or has become another one.
    pub fn open(&mut self, path: &Path, text: &str) -> Vec<Value> {
        let uri = uri(path);
        let version = self.versions.entry(uri.clone()).or_insert(0);
        *version += 1;
        let (number, is_new) = (*version, *version == 1);
        match is_new {
            true => self.tell(
                "textDocument/didOpen",
                json!({ "textDocument": { "uri": uri, "languageId": "nsd", "version": number, "text": text } }),
            ),
            false => self.change(path, json!({ "text": text })),
        }
        self.told(path)
    }

    /// A range of a text that is open is replaced.
    pub fn replace(&mut self, path: &Path, range: Value, new: &str) {
        *self.versions.get_mut(&uri(path)).expect("it is open") += 1;
        self.change(path, json!({ "range": range, "text": new }));
    }

    pub fn close(&mut self, path: &Path) {
        let uri = uri(path);
        self.tell(
            "textDocument/didClose",
            json!({ "textDocument": { "uri": uri } }),
        );
        // Its versions are counted anew when it is opened again.
        self.notes.retain(|note| note.params["uri"] != uri.as_str());
        self.versions.remove(&uri);
        self.seen.remove(&uri);
    }

    pub fn change(&self, path: &Path, change: Value) {
        let uri = uri(path);
        let document = json!({ "uri": uri, "version": self.versions[&uri] });
        let params = json!({ "textDocument": document, "contentChanges": [change] });
        self.tell("textDocument/didChange", params);
    }

    /// What the server says of the version of a text that it has now.
    pub fn told(&mut self, path: &Path) -> Vec<Value> {
        let (uri, version) = (uri(path), self.versions[&uri(path)]);
        loop {
            let is_it = |note: &Notification| {
                note.method == "textDocument/publishDiagnostics"
                    && note.params["uri"] == uri.as_str()
                    && note.params["version"] == version
            };
            if let Some(at) = self.notes.iter().rposition(is_it) {
                let found = self.notes.remove(at).params["diagnostics"].clone();
                return found.as_array().expect("a list").clone();
            }
            assert!(self.receive().is_none(), "nothing was asked");
        }
    }

    pub fn at(&mut self, method: &str, path: &Path, position: Value) -> Value {
        self.ask(
            method,
            json!({ "textDocument": { "uri": uri(path) }, "position": position }),
        )
    }

    /// Labels of what may stand at the first `|` of a text.
    pub fn completes(&mut self, path: &Path, marked: &str) -> Vec<String> {
        let at = marked.find('|').expect("a mark");
        let text = marked.replacen('|', "", 1);
        self.open(path, &text);
        let found = self.at("textDocument/completion", path, position(&text, at));
        let items = found.as_array().map_or(&[][..], Vec::as_slice);
        items
            .iter()
            .map(|item| item["label"].as_str().expect("a label").to_owned())
            .collect()
    }

    pub fn end(mut self) -> Exit {
        assert_eq!(self.ask("shutdown", Value::Null), Value::Null);
        self.tell("exit", Value::Null);
        self.server.join().expect("the server does not panic")
    }
}

pub fn uri(path: &Path) -> String {
    format!("file://{}", path.display())
}

/// Lines end with `\n` in all texts here.
pub fn position(text: &str, byte: usize) -> Value {
    let before = &text[..byte];
    let line = before.matches('\n').count();
    let column = before
        .rsplit('\n')
        .next()
        .unwrap_or_default()
        .encode_utf16()
        .count();
    json!({ "line": line, "character": column })
}

pub fn byte(text: &str, position: &Value) -> usize {
    let number = |name: &str| position[name].as_u64().expect("a number") as usize;
    let start: usize = text
        .split_inclusive('\n')
        .take(number("line"))
        .map(str::len)
        .sum();
    let mut units = 0;
    let inside = text[start..].char_indices().find(|(_, c)| {
        let found = units >= number("character");
        units += c.len_utf16();
        found
    });
    inside.map_or(text.len(), |(at, _)| start + at)
}

/// A text with edits made in it.
pub fn edited(text: &str, edits: &[Value]) -> String {
    let mut edits: Vec<(usize, usize, &str)> = edits
        .iter()
        .map(|edit| {
            let range = &edit["range"];
            let new = edit["newText"].as_str().expect("a text");
            (byte(text, &range["start"]), byte(text, &range["end"]), new)
        })
        .collect();
    edits.sort_by_key(|(start, ..)| std::cmp::Reverse(*start));
    let mut text = text.to_owned();
    for (start, end, new) in edits {
        text.replace_range(start..end, new);
    }
    text
}

pub fn memory(name: &str) -> PathBuf {
    PathBuf::from("/nowhere/models").join(name)
}

pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("lsp")
        .join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}
