//! Messages of the protocol at standard input and output.

use std::io::{self, BufRead, Read, Write};
use std::thread::{self, JoinHandle};

use crossbeam_channel::{Receiver, Sender, bounded};
use lsp_server::{Connection, Message};
#[cfg(unix)]
use nix::{errno::Errno, sys::signal::kill, unistd::Pid};

/// The threads that read and write.
pub struct Pipes {
    reader: JoinHandle<io::Result<()>>,
    writer: JoinHandle<io::Result<()>>,
}

impl Pipes {
    /// A connection to who is at the other ends.
    pub fn open() -> io::Result<(Connection, Self)> {
        let (sender, written) = bounded(0);
        let (read, receiver) = bounded(0);
        let thread = |name: &str| thread::Builder::new().name(name.to_owned());
        let reader = thread("reader").spawn(move || read_all(&mut io::stdin().lock(), &read))?;
        let writer =
            thread("writer").spawn(move || write_all(&mut io::stdout().lock(), &written))?;
        Ok((Connection { sender, receiver }, Pipes { reader, writer }))
    }

    /// Waits until nothing is left to be read and written.
    ///
    /// # Errors
    ///
    /// What was read is none of the protocol, or an end is gone.
    pub fn join(self) -> io::Result<()> {
        let ended = [self.reader, self.writer].map(|thread| {
            let ended = thread.join();
            ended.unwrap_or_else(|_| Err(io::Error::other("a pipe has ended in a mistake of nsdc")))
        });
        ended.into_iter().collect()
    }
}

/// Whether a process is there, that of another user too.
#[cfg(unix)]
pub fn is_there(process: u32) -> bool {
    let known = i32::try_from(process).is_ok_and(|id| id > 0);
    !known || kill(Pid::from_raw(process.cast_signed()), None) != Err(Errno::ESRCH)
}

/// Other systems are not asked: any process is taken to be there.
#[cfg(not(unix))]
pub fn is_there(_: u32) -> bool {
    true
}

fn read_all(input: &mut impl BufRead, read: &Sender<Message>) -> io::Result<()> {
    while let Some(text) = body(input)? {
        let message = serde_json::from_slice(&text).map_err(invalid)?;
        let is_exit = matches!(&message, Message::Notification(note) if note.method == "exit");
        read.send(message).map_err(io::Error::other)?;
        if is_exit {
            break;
        }
    }
    Ok(())
}

fn write_all(output: &mut impl Write, written: &Receiver<Message>) -> io::Result<()> {
    written.iter().try_for_each(|message| message.write(output))
}

fn invalid(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error)
}

/// The next message as text, nothing at the end. No more memory is taken than what comes needs, whatever length is told.
fn body(input: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    const LONGEST: u64 = 4096;
    let mut length: Option<u64> = None;
    loop {
        let mut line = Vec::new();
        if input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        let line = String::from_utf8(line).map_err(invalid)?;
        let Some(line) = line.strip_suffix("\r\n") else {
            return Err(invalid(format!("malformed header: {line:?}")));
        };
        if line.is_empty() {
            break;
        }
        let (name, value) = line
            .split_once(':')
            .ok_or_else(|| invalid(format!("malformed header: {line:?}")))?;
        if name.eq_ignore_ascii_case("Content-Length") {
            length = Some(value.trim().parse().map_err(invalid)?);
        }
    }
    let length = length.ok_or_else(|| invalid("no Content-Length"))?;
    let mut text = Vec::new();
    let found = input.take(length).read_to_end(&mut text)?;
    match u64::try_from(found) == Ok(length) {
        true => Ok(Some(text)),
        false => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}
