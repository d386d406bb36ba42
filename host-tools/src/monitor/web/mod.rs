//! The view as a page: a server for browsers on this machine, which streams what is known.
//!
//! One thread takes connections, one more serves each. A browser that does not take what is sent is let go; the monitor never waits
//! for one. The page asks for nothing but this address, and its policy forbids it to.
//!
//! Files beside:
//!
//! - `request`: what a browser asks
//! - `state`: all that a page shows

mod request;
mod state;

use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

pub use request::Wish;
use request::{Request, Target};
pub use state::State;

/// Time between two states that pages and viewers are told.
pub const PERIOD: Duration = Duration::from_millis(250);
/// Browsers, and their connections, served at once.
const CONNECTIONS: usize = 32;
/// How long a browser may take to ask, or to take what is sent.
const PATIENCE: Duration = Duration::from_secs(5);
/// A stream in which nothing is told says so after this long, and learns whether somebody still listens.
const SILENCE: Duration = Duration::from_secs(10);

/// What a page may load: what this server serves, and nothing else. The icon is an empty one in the page.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Why nothing is served.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// Another program serves there.
    #[error("{address}: another program uses this port")]
    Taken {
        /// The option that asks for it.
        option: &'static str,
        /// Where it was to be.
        address: SocketAddr,
    },
    /// The operating system refuses.
    #[error("{address}: {source}")]
    Bind {
        /// The option that asks for it.
        option: &'static str,
        /// Where it was to be.
        address: SocketAddr,
        /// What the operating system says.
        source: io::Error,
    },
}

/// Listens at `address`, as `option` asks; where that is, if it asks for any free port.
pub(super) fn listen(
    address: SocketAddr,
    option: &'static str,
) -> Result<(TcpListener, SocketAddr), WebError> {
    let failed = |source: io::Error| match source.kind() {
        ErrorKind::AddrInUse => WebError::Taken { option, address },
        _ => WebError::Bind {
            option,
            address,
            source,
        },
    };
    let listener = TcpListener::bind(address).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    Ok((listener, address))
}

/// Serves the page.
pub struct Server {
    address: SocketAddr,
    told: Arc<Told>,
    wishes: Receiver<Wish>,
}

/// What is told to all browsers: the newest state, and how many there were.
#[derive(Default)]
struct Told {
    newest: Mutex<(u64, Arc<str>)>,
    changed: Condvar,
    connections: AtomicUsize,
}

impl Server {
    /// Begins to serve at `address`.
    ///
    /// # Errors
    /// [`WebError`].
    pub fn start(address: SocketAddr) -> Result<Self, WebError> {
        let (listener, address) = listen(address, "--web")?;
        let told = Arc::new(Told::default());
        let (wished, wishes) = channel();
        let shared = told.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                take(stream, address, &shared, &wished);
            }
        });
        Ok(Self {
            address,
            told,
            wishes,
        })
    }

    /// Where it serves.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Tells all browsers.
    pub fn tell(&self, state: &State) {
        // Plain data with string keys.
        let text = serde_json::to_string(state).unwrap_or_default();
        let newest = self.told.newest.lock();
        let mut newest = newest.unwrap_or_else(PoisonError::into_inner);
        *newest = (newest.0 + 1, text.into());
        self.told.changed.notify_all();
    }

    /// What was asked in the page since the last time.
    pub fn wishes(&self) -> impl Iterator<Item = Wish> + '_ {
        self.wishes.try_iter()
    }
}

/// Serves a connection in a thread of its own, if there are not too many.
fn take(stream: TcpStream, address: SocketAddr, told: &Arc<Told>, wished: &Sender<Wish>) {
    if told.connections.fetch_add(1, Ordering::Relaxed) >= CONNECTIONS {
        told.connections.fetch_sub(1, Ordering::Relaxed);
        return;
    }
    let (told, wished) = (told.clone(), wished.clone());
    std::thread::spawn(move || {
        // A browser that went away is no error.
        let _ = serve(stream, address, &told, &wished);
        told.connections.fetch_sub(1, Ordering::Relaxed);
    });
}

fn serve(
    mut stream: TcpStream,
    address: SocketAddr,
    told: &Told,
    wished: &Sender<Wish>,
) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(request) = Request::read(&mut stream)? else {
        return answer(
            &mut stream,
            "400 Bad Request",
            "text/plain",
            "no request that a browser makes\n",
        );
    };
    if !request.is_from_page(address) {
        let text = "only the page itself may ask\n";
        return answer(&mut stream, "403 Forbidden", "text/plain", text);
    }
    let page = |stream: &mut TcpStream, kind, text| answer(stream, "200 OK", kind, text);
    match request.target {
        Target::Page => page(&mut stream, "text/html", include_str!("page.html")),
        Target::Script => page(&mut stream, "text/javascript", include_str!("script.js")),
        Target::Style => page(&mut stream, "text/css", include_str!("style.css")),
        Target::Events => tell(&mut stream, told),
        Target::Ask(Some(wish)) => {
            // Nobody hears it only if the monitor ends.
            let _ = wished.send(wish);
            answer(&mut stream, "204 No Content", "text/plain", "")
        }
        Target::Ask(None) => answer(
            &mut stream,
            "400 Bad Request",
            "text/plain",
            "no such wish\n",
        ),
        Target::Nothing => answer(&mut stream, "404 Not Found", "text/plain", "nothing here\n"),
    }
}

fn answer(stream: &mut TcpStream, status: &str, kind: &str, text: &str) -> io::Result<()> {
    let length = text.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nContent-Security-Policy: {POLICY}\r\n\
         Connection: close\r\n\r\n{text}"
    )
}

/// Streams states as they come (server-sent events) until the browser leaves.
fn tell(stream: &mut TcpStream, told: &Told) -> io::Result<()> {
    stream.write_all(
        b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
    )?;
    let mut seen = 0;
    loop {
        let newest = told.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = told
            .changed
            .wait_timeout_while(newest, SILENCE, |newest| newest.0 == seen);
        let newest = waited.unwrap_or_else(PoisonError::into_inner).0;
        let (number, text) = (newest.0, newest.1.clone());
        drop(newest);
        match number == seen {
            true => stream.write_all(b":\n\n")?,
            // One write: the text has no line end.
            false => stream.write_all(format!("data: {text}\n\n").as_bytes())?,
        }
        seen = number;
    }
}
