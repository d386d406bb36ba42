//! The server beside a client of the protocol, and beside those that mean it no good.

use std::io::Write;

use serde_json::Value;
use tungstenite::client::{ClientRequestBuilder, client};

use super::*;

type Client = WebSocket<TcpStream>;

/// A client that offers these protocols.
fn connect(server: &Server, protocols: &[&str]) -> Result<(Client, String), String> {
    let stream = TcpStream::connect(server.address()).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let uri = format!("ws://{}/", server.address()).parse().unwrap();
    let mut request = ClientRequestBuilder::new(uri);
    for protocol in protocols {
        request = request.with_sub_protocol(*protocol);
    }
    let (socket, response) = client(request, stream).map_err(|error| error.to_string())?;
    let chosen = &response.headers()[PROTOCOL_HEADER];
    Ok((socket, chosen.to_str().unwrap().to_owned()))
}

fn text(client: &mut Client) -> Value {
    let message = client.read().unwrap();
    serde_json::from_str(message.to_text().unwrap()).unwrap()
}

/// Id, time (ns) and payload of a message of a channel.
fn data(client: &mut Client) -> (u32, u64, Vec<u8>) {
    let bytes = client.read().unwrap().into_data().to_vec();
    assert_eq!(bytes[0], 1);
    let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
    let time = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
    (id, time, bytes[13..].to_vec())
}

fn ask(client: &mut Client, what: &Value) {
    client.send(Message::text(what.to_string())).unwrap();
}

/// A client that has read what every client is told first.
fn greeted(server: &Server) -> Client {
    let (mut client, _) = connect(server, &["foxglove.websocket.v1"]).unwrap();
    assert_eq!(text(&mut client)["op"], "serverInfo");
    assert_eq!(text(&mut client)["op"], "advertise");
    client
}

fn start() -> Server {
    Server::start("127.0.0.1:0".parse().unwrap()).unwrap()
}

fn subscribe(client: &mut Client, id: u32, channel: Channel) {
    let subscriptions = json!([{"id": id, "channelId": channel as u32}]);
    ask(
        client,
        &json!({"op": "subscribe", "subscriptions": subscriptions}),
    );
}

/// Waits until something holds.
fn wait_until(holds: impl Fn() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < Duration::from_secs(10));
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_viewer_is_told_the_channels_and_gets_what_it_subscribes_to() {
    let server = start();
    for (offered, chosen) in [
        (&["foxglove.websocket.v1"][..], "foxglove.websocket.v1"),
        (
            &["foxglove.websocket.v1", "foxglove.sdk.v1"],
            "foxglove.sdk.v1",
        ),
    ] {
        assert_eq!(connect(&server, offered).unwrap().1, chosen);
    }
    // What was sent before it came is known to it as it subscribes.
    server.send(Channel::Estimates, b"{\"a\":1}".to_vec());
    let (mut client, _) = connect(&server, &["foxglove.websocket.v1"]).unwrap();
    let info = text(&mut client);
    assert_eq!(info["op"], "serverInfo");
    assert_eq!(info["capabilities"], json!([]));
    let advertised = text(&mut client);
    let channels = advertised["channels"].as_array().unwrap();
    let topics: Vec<&str> = channels
        .iter()
        .map(|c| c["topic"].as_str().unwrap())
        .collect();
    assert_eq!(topics, ["/estimates", "/residual", "/events"]);
    for channel in channels {
        let is_json = channel["encoding"] == "json";
        let schema = channel["schema"].as_str().unwrap();
        assert_eq!(serde_json::from_str::<Value>(schema).is_ok(), is_json);
    }
    subscribe(&mut client, 77, Channel::Estimates);
    let (id, time, payload) = data(&mut client);
    assert_eq!((id, &payload[..]), (77, &b"{\"a\":1}"[..]));
    assert!(now_ns() - time < 60_000_000_000);
    // Of a channel that it does not want it gets nothing; after it has left one, neither.
    server.send(Channel::Events, vec![1]);
    server.send(Channel::Estimates, vec![2]);
    assert_eq!(data(&mut client).2, [2]);
    ask(
        &mut client,
        &json!({"op": "unsubscribe", "subscriptionIds": [77]}),
    );
    subscribe(&mut client, 5, Channel::Events);
    assert_eq!(data(&mut client), {
        let newest = lock(&server.shared.newest)[Channel::Events as usize]
            .clone()
            .unwrap();
        (5, newest.time_ns, vec![1])
    });
    server.send(Channel::Estimates, vec![3]);
    server.send(Channel::Events, vec![4]);
    assert_eq!(data(&mut client).2, [4]);
    // What waits as the monitor ends is sent, and the end is said.
    server.send(Channel::Events, vec![5]);
    drop(server);
    assert_eq!(data(&mut client).2, [5]);
    assert!(client.read().unwrap().is_close());
}

#[test]
fn who_speaks_another_protocol_is_refused_and_others_are_served_on() {
    let server = start();
    for protocols in [&[][..], &["graphql-ws"]] {
        let refused = connect(&server, protocols).unwrap_err();
        assert!(refused.contains("400"), "{refused}");
    }
    // No WebSocket at all, half of one, and a message longer than any question.
    let mut stray = TcpStream::connect(server.address()).unwrap();
    stray.write_all(b"\0\x01\x02 hello\r\n\r\n").unwrap();
    let mut half = TcpStream::connect(server.address()).unwrap();
    half.write_all(b"GET / HTTP/1.1\r\nHost: a\r\n").unwrap();
    let mut long = greeted(&server);
    let _ = long.send(Message::text("x".repeat(LONGEST + 1)));
    assert!(long.read().is_err());
    let mut client = greeted(&server);
    for (question, answer) in [
        ("{", "no message of Foxglove's protocol"),
        (
            r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":9}]}"#,
            "no channel 9",
        ),
        (
            r#"{"op":"advertise","channels":[]}"#,
            "this server sends estimates, and takes nothing",
        ),
    ] {
        client.send(Message::text(question)).unwrap();
        let said = text(&mut client);
        assert_eq!((&said["op"], &said["level"]), (&"status".into(), &1.into()));
        assert!(said["message"].as_str().unwrap().contains(answer), "{said}");
    }
    subscribe(&mut client, 1, Channel::Residual);
    subscribe(&mut client, 2, Channel::Residual);
    let said = text(&mut client);
    assert!(said["message"].as_str().unwrap().contains("already, as 1"));
    server.send(Channel::Residual, vec![9]);
    assert_eq!(data(&mut client), {
        let newest = lock(&server.shared.newest)[Channel::Residual as usize]
            .clone()
            .unwrap();
        (1, newest.time_ns, vec![9])
    });
}

/// A viewer that reads nothing costs its own messages, and nobody else anything.
#[test]
fn a_viewer_that_takes_nothing_holds_up_nobody() {
    let server = start();
    let (mut slow, mut quick) = (greeted(&server), greeted(&server));
    for client in [&mut slow, &mut quick] {
        subscribe(client, 1, Channel::Estimates);
    }
    wait_until(|| {
        let viewers = lock(&server.shared.viewers);
        let wants = |viewer: &&Arc<Viewer>| viewer.wants[0].load(Ordering::Relaxed);
        viewers.iter().filter(wants).count() == 2
    });
    // More than the operating system and the queue take.
    const COUNT: u32 = 120;
    let mut longest = Duration::ZERO;
    for n in 0..COUNT {
        let mut payload = vec![0; 1 << 20];
        payload[..4].copy_from_slice(&n.to_le_bytes());
        let begin = Instant::now();
        server.send(Channel::Estimates, payload);
        longest = longest.max(begin.elapsed());
        assert_eq!(data(&mut quick).2[..4], n.to_le_bytes());
    }
    assert!(longest < Duration::from_millis(500), "{longest:?}");
    let left_out = server.left_out();
    assert!(left_out > 20, "{left_out}");
    // Once it reads it gets the rest in order, and is told how many are missing.
    let (mut last, mut count) = (None, 0);
    let said = loop {
        match slow.read().unwrap() {
            Message::Text(said) => break said,
            message => {
                let n = u32::from_le_bytes(message.into_data()[13..17].try_into().unwrap());
                assert!(last.is_none_or(|last| n > last));
                (last, count) = (Some(n), count + 1);
            }
        }
    };
    assert!(
        said.contains(&format!("{left_out} messages are left out")),
        "{said}"
    );
    assert_eq!(count + left_out, u64::from(COUNT));
}
