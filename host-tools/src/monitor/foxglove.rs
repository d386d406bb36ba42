//! The view for viewers: a WebSocket server of Foxglove's protocol, `foxglove.websocket.v1` and `foxglove.sdk.v1`
//! (github.com/foxglove/ws-protocol).
//!
//! One thread takes connections, one more serves each viewer from a queue of its own. Of a viewer that takes too little the queue fills, and messages
//! are left out and counted; the monitor never waits for one. Nothing that a viewer sends reaches the device.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::json;
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket, accept_hdr_with_config};

use super::web::{WebError, listen};
use crate::clock::now_ns;
use crate::log::cdr::{JOINT_STATE, LOG};

/// The protocol's names, the newer one first: to a client of this side they are the same.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const PROTOCOL_HEADER: &str = "Sec-WebSocket-Protocol";
/// Viewers served at once.
const VIEWERS: usize = 16;
/// Messages that may wait for a viewer: some seconds of all channels.
const WAITING: usize = 64;
/// How long a viewer may take to say who it is, or to take a part of what is sent.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long its thread waits for what it says before it looks for what to send.
const LOOK: Duration = Duration::from_millis(20);
/// How long an ending monitor lets viewers take what waits for them.
const FAREWELL: Duration = Duration::from_secs(1);
/// The longest message that a viewer may send, bytes: a list of subscriptions.
const LONGEST: usize = 1 << 16;
/// First byte of a message of a channel.
const MESSAGE_DATA: u8 = 1;
/// Level of a status: something is not as it should be.
const WARNING: u8 = 1;

/// What is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// What `monitor --json` prints, as known by then.
    Estimates,
    /// `sensor_msgs/msg/JointState` whose effort is each joint's residual of the newest windows, N m.
    Residual,
    /// `rcl_interfaces/msg/Log`: what happened.
    Events,
}

impl Channel {
    const ALL: [Self; 3] = [Self::Estimates, Self::Residual, Self::Events];

    /// How it is advertised; its number is its channel's.
    fn description(self) -> serde_json::Value {
        let (topic, encoding, name, kind, schema) = match self {
            Self::Estimates => (
                "/estimates",
                "json",
                "proprio.monitor",
                "jsonschema",
                ESTIMATES,
            ),
            Self::Residual => (
                "/residual",
                "cdr",
                "sensor_msgs/msg/JointState",
                "ros2msg",
                JOINT_STATE,
            ),
            Self::Events => ("/events", "cdr", "rcl_interfaces/msg/Log", "ros2msg", LOG),
        };
        json!({
            "id": self as u32, "topic": topic, "encoding": encoding,
            "schemaName": name, "schema": schema, "schemaEncoding": kind,
        })
    }
}

/// What a viewer must know of `/estimates` to plot it; docs/schema/monitor.json has all of it.
const ESTIMATES: &str = r#"{"type":"object","properties":{
"parameters":{"type":"array","items":{"type":"object","properties":{
"name":{"type":"string"},"unit":{"type":"string"},"value":{"type":"number"},"std":{"type":"number"},
"prior":{"type":"number"},"prior_std":{"type":"number"},"status":{"type":"string"},"at_bound":{"type":"boolean"}}}},
"ranking":{"type":"array","items":{"type":"object","properties":{
"effect":{"type":"string"},"joint":{"type":"string"},"active":{"type":"boolean"},"missing":{"type":"boolean"},
"held_out_gain":{"type":"number"},"held_out_gain_error":{"type":"number"},"value":{"type":"number"},"std":{"type":"number"},
"unit":{"type":"string"}}}}}}"#;

/// A message of a channel, and when it was made, ns since 1970.
struct Sent {
    channel: Channel,
    time_ns: u64,
    payload: Vec<u8>,
}

/// Serves viewers until it is dropped, which lets them take what waits for them.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
}

/// What all threads know.
#[derive(Default)]
struct Shared {
    viewers: Mutex<Vec<Arc<Viewer>>>,
    /// The newest message of each channel: what a viewer gets as it subscribes.
    newest: Mutex<[Option<Arc<Sent>>; Channel::ALL.len()]>,
    connections: AtomicUsize,
    left_out: AtomicU64,
    ends: AtomicBool,
}

/// A viewer as those who have something for it see it.
struct Viewer {
    queue: SyncSender<Arc<Sent>>,
    /// Which channels it has subscribed to.
    wants: [AtomicBool; Channel::ALL.len()],
    /// What was left out since it was last told.
    left_out: AtomicU64,
}

impl Server {
    /// Begins to serve at `address`.
    ///
    /// # Errors
    /// [`WebError`].
    pub fn start(address: SocketAddr) -> Result<Self, WebError> {
        let (listener, address) = listen(address, "--foxglove")?;
        let shared = Arc::new(Shared::default());
        let own = shared.clone();
        thread::spawn(move || take(&listener, &own));
        Ok(Self { address, shared })
    }

    /// Where it serves.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sends a message to all viewers that want it. Returns at once.
    pub fn send(&self, channel: Channel, payload: Vec<u8>) {
        let sent = Arc::new(Sent {
            channel,
            time_ns: now_ns(),
            payload,
        });
        // Under both locks, in this order as everywhere: of a viewer that subscribes meanwhile the message is either the newest or in its queue.
        let mut newest = lock(&self.shared.newest);
        newest[channel as usize] = Some(sent.clone());
        lock(&self.shared.viewers).retain(|viewer| {
            if !viewer.wants[channel as usize].load(Ordering::Relaxed) {
                return true;
            }
            match viewer.queue.try_send(sent.clone()) {
                Ok(()) => true,
                Err(TrySendError::Full(_)) => {
                    viewer.left_out.fetch_add(1, Ordering::Relaxed);
                    self.shared.left_out.fetch_add(1, Ordering::Relaxed);
                    true
                }
                Err(TrySendError::Disconnected(_)) => false,
            }
        });
    }

    /// Messages that were left out since viewers took too little.
    pub fn left_out(&self) -> u64 {
        self.shared.left_out.load(Ordering::Relaxed)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        let begin = Instant::now();
        while self.shared.connections.load(Ordering::Relaxed) > 0 && begin.elapsed() < FAREWELL {
            thread::sleep(LOOK);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves each connection in a thread of its own, if there are not too many.
fn take(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming().flatten() {
        if shared.connections.fetch_add(1, Ordering::Relaxed) >= VIEWERS {
            shared.connections.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let shared = shared.clone();
        thread::spawn(move || {
            // A viewer that went away, or that speaks another protocol, is no error.
            let _ = serve(stream, &shared);
            shared.connections.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// What a viewer asks.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Asked {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// What this side does not offer.
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: u32,
}

fn serve(stream: TcpStream, shared: &Shared) -> Result<(), Box<Error>> {
    stream.set_read_timeout(Some(PATIENCE)).map_err(boxed)?;
    stream.set_write_timeout(Some(PATIENCE)).map_err(boxed)?;
    let config = WebSocketConfig::default()
        .read_buffer_size(1 << 12)
        .write_buffer_size(0)
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST));
    let Ok(mut socket) = accept_hdr_with_config(stream, choose, Some(config)) else {
        return Ok(());
    };
    let timeout = socket.get_ref().set_read_timeout(Some(LOOK));
    timeout.map_err(boxed)?;
    let info = json!({
        "op": "serverInfo", "name": concat!("proprio ", env!("CARGO_PKG_VERSION")), "capabilities": [],
        "supportedEncodings": [], "metadata": {}, "sessionId": format!("{}", now_ns()),
    });
    say(&mut socket, &info)?;
    let channels = Channel::ALL.map(Channel::description);
    say(
        &mut socket,
        &json!({"op": "advertise", "channels": channels}),
    )?;
    let (queue, waiting) = sync_channel(WAITING);
    let viewer = Arc::new(Viewer {
        queue,
        wants: Default::default(),
        left_out: AtomicU64::new(0),
    });
    lock(&shared.viewers).push(viewer.clone());
    let mut served = Served {
        socket,
        viewer: viewer.clone(),
        ids: [None; Channel::ALL.len()],
    };
    let ended = served.follow(&waiting, shared);
    lock(&shared.viewers).retain(|known| !Arc::ptr_eq(known, &viewer));
    ended
}

fn boxed(error: io::Error) -> Box<Error> {
    Box::new(error.into())
}

/// Chooses the protocol; who speaks none of them is refused.
#[allow(clippy::result_large_err)] // as the library has it
fn choose(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let headers = request.headers().get_all(PROTOCOL_HEADER);
    let offered = headers.iter().filter_map(|header| header.to_str().ok());
    let offered: Vec<&str> = offered.flat_map(|header| header.split(',')).collect();
    let known = |name: &&str| offered.iter().any(|offered| offered.trim() == *name);
    match PROTOCOLS.into_iter().find(known) {
        Some(name) => {
            let name = HeaderValue::from_static(name);
            response.headers_mut().insert(PROTOCOL_HEADER, name);
            Ok(response)
        }
        None => {
            let mut refused = ErrorResponse::new(Some("the protocol is Foxglove's".to_owned()));
            *refused.status_mut() = StatusCode::BAD_REQUEST;
            Err(refused)
        }
    }
}

fn say(socket: &mut WebSocket<TcpStream>, what: &serde_json::Value) -> Result<(), Box<Error>> {
    Ok(socket.send(Message::text(what.to_string()))?)
}

/// A viewer as its thread sees it.
struct Served {
    socket: WebSocket<TcpStream>,
    viewer: Arc<Viewer>,
    /// What it calls its subscription to each channel.
    ids: [Option<u32>; Channel::ALL.len()],
}

impl Served {
    /// Takes what it asks and sends what waits, until it leaves or the monitor ends.
    fn follow(&mut self, waiting: &Receiver<Arc<Sent>>, shared: &Shared) -> Result<(), Box<Error>> {
        loop {
            let ends = shared.ends.load(Ordering::Relaxed);
            match self.socket.read() {
                Ok(Message::Text(text)) => self.obey(&text, shared)?,
                Ok(Message::Close(_)) => return Ok(()),
                Ok(_) => {}
                Err(Error::Io(error))
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(error.into()),
            }
            while let Ok(sent) = waiting.try_recv() {
                self.pass(&sent)?;
            }
            let left_out = self.viewer.left_out.swap(0, Ordering::Relaxed);
            if left_out > 0 {
                self.warn(&format!(
                    "{left_out} messages are left out: this viewer takes too few"
                ))?;
            }
            if ends {
                return Ok(self.socket.close(None)?);
            }
        }
    }

    /// Sends a message if its channel is still subscribed to.
    fn pass(&mut self, sent: &Sent) -> Result<(), Box<Error>> {
        let Some(id) = self.ids[sent.channel as usize] else {
            return Ok(());
        };
        let mut bytes = Vec::with_capacity(13 + sent.payload.len());
        bytes.push(MESSAGE_DATA);
        bytes.extend(id.to_le_bytes());
        bytes.extend(sent.time_ns.to_le_bytes());
        bytes.extend(&sent.payload);
        Ok(self.socket.send(Message::binary(bytes))?)
    }

    fn obey(&mut self, text: &str, shared: &Shared) -> Result<(), Box<Error>> {
        match serde_json::from_str(text) {
            Ok(Asked::Subscribe { subscriptions }) => {
                for Subscription { id, channel_id } in subscriptions {
                    self.subscribe(id, channel_id, shared)?;
                }
                Ok(())
            }
            Ok(Asked::Unsubscribe { subscription_ids }) => {
                for (wants, own) in self.viewer.wants.iter().zip(&mut self.ids) {
                    if own.is_some_and(|id| subscription_ids.contains(&id)) {
                        wants.store(false, Ordering::Relaxed);
                        *own = None;
                    }
                }
                Ok(())
            }
            Ok(Asked::Other) => self.warn("this server sends estimates, and takes nothing"),
            Err(_) => self.warn("no message of Foxglove's protocol"),
        }
    }

    fn subscribe(&mut self, id: u32, channel: u32, shared: &Shared) -> Result<(), Box<Error>> {
        let place = usize::try_from(channel).unwrap_or(usize::MAX);
        match self.ids.get(place) {
            None => return self.warn(&format!("there is no channel {channel}")),
            Some(Some(known)) => {
                return self.warn(&format!(
                    "channel {channel} is subscribed to already, as {known}"
                ));
            }
            Some(None) => {}
        }
        self.ids[place] = Some(id);
        let newest = {
            let newest = lock(&shared.newest);
            self.viewer.wants[place].store(true, Ordering::Relaxed);
            newest[place].clone()
        };
        newest.map_or(Ok(()), |newest| self.pass(&newest))
    }

    fn warn(&mut self, text: &str) -> Result<(), Box<Error>> {
        let status = json!({"op": "status", "level": WARNING, "message": text});
        say(&mut self.socket, &status)
    }
}

#[cfg(test)]
mod tests;
