//! What a browser asks.

use std::io::{self, Read};
use std::net::SocketAddr;

use proprio_core::wire::EffectAt;

/// Longest request; a browser's is some hundred bytes.
const LONGEST: usize = 8192;

/// What can be asked in the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Add this effect to the device's model.
    Add(EffectAt),
    /// Drop it.
    Drop(EffectAt),
    /// Hold the simulated robot or the recording, or let it go on.
    Pause,
    /// Forget all data.
    Reset,
    /// Write a model file.
    Save,
    /// Write the device's factors.
    Factors,
    /// Have the device write a snapshot to its flash.
    Keep,
}

impl Wish {
    fn read(text: &str) -> Option<Self> {
        let mut words = text.split(' ');
        let verb = words.next()?;
        let mut number = || words.next()?.parse().ok();
        let mut at = || {
            Some(EffectAt {
                leg: number()?,
                joint: number()?,
                effect: number()?,
            })
        };
        Some(match verb {
            "add" => Self::Add(at()?),
            "drop" => Self::Drop(at()?),
            "pause" => Self::Pause,
            "reset" => Self::Reset,
            "save" => Self::Save,
            "factors" => Self::Factors,
            "keep" => Self::Keep,
            _ => return None,
        })
    }
}

/// What a request is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Page,
    Script,
    Style,
    Events,
    /// A wish, if it makes sense.
    Ask(Option<Wish>),
    Nothing,
}

/// A request as far as it matters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) target: Target,
    host: String,
    origin: Option<String>,
}

impl Request {
    /// Reads a request; none if it is too long, cut, or none.
    pub(super) fn read(stream: &mut impl Read) -> io::Result<Option<Self>> {
        let mut bytes = Vec::new();
        loop {
            let mut buffer = [0; 1024];
            let length = stream.read(&mut buffer)?;
            bytes.extend_from_slice(&buffer[..length]);
            match Self::parse(&bytes) {
                Parsed::Whole(request) => return Ok(Some(request)),
                Parsed::Cut if length > 0 && bytes.len() <= LONGEST => {}
                _ => return Ok(None),
            }
        }
    }

    fn parse(bytes: &[u8]) -> Parsed {
        let Some(end) = bytes.windows(4).position(|four| four == b"\r\n\r\n") else {
            return Parsed::Cut;
        };
        let (Ok(head), body) = (std::str::from_utf8(&bytes[..end]), &bytes[end + 4..]) else {
            return Parsed::Nonsense;
        };
        let mut lines = head.split("\r\n");
        let first = lines.next().unwrap_or_default();
        let headers: Vec<_> = lines.filter_map(|line| line.split_once(':')).collect();
        let header = |name: &str| {
            let found = headers.iter().find(|(n, _)| n.eq_ignore_ascii_case(name));
            found.map(|(_, value)| value.trim().to_owned())
        };
        let length = match header("content-length").map(|text| text.parse::<usize>()) {
            None => 0,
            Some(Ok(length)) if length <= LONGEST => length,
            Some(_) => return Parsed::Nonsense,
        };
        if body.len() < length {
            return Parsed::Cut;
        }
        let wish = || {
            std::str::from_utf8(&body[..length])
                .ok()
                .and_then(Wish::read)
        };
        let target = match first.rsplit_once(' ').map_or(first, |(rest, _)| rest) {
            "GET /" => Target::Page,
            "GET /script.js" => Target::Script,
            "GET /style.css" => Target::Style,
            "GET /events" => Target::Events,
            "POST /ask" => Target::Ask(wish()),
            _ => Target::Nothing,
        };
        Parsed::Whole(Self {
            target,
            host: header("host").unwrap_or_default(),
            origin: header("origin"),
        })
    }

    /// Whether the page at `address` asks, or a user for it. Another page's request names that page as its origin; one whose name was
    /// made to lead here names itself as the host.
    pub(super) fn is_from_page(&self, address: SocketAddr) -> bool {
        let port = address.port();
        let here = match address.ip().is_loopback() {
            true => [
                format!("localhost:{port}"),
                format!("127.0.0.1:{port}"),
                format!("[::1]:{port}"),
                address.to_string(),
            ]
            .contains(&self.host),
            // Which of its names this machine is called by elsewhere is not known here.
            false => !self.host.is_empty(),
        };
        let own = |origin: &String| origin.strip_prefix("http://") == Some(&self.host);
        here && match (&self.target, &self.origin) {
            (Target::Ask(_), origin) => origin.as_ref().is_some_and(own),
            (_, origin) => origin.as_ref().is_none_or(own),
        }
    }
}

enum Parsed {
    Whole(Request),
    Cut,
    Nonsense,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Request> {
        Request::read(&mut text.as_bytes()).unwrap()
    }

    #[test]
    fn a_request_is_read_whole_or_not_at_all() {
        let text = "POST /ask HTTP/1.1\r\nHost: localhost:7700\r\nOrigin: http://localhost:7700\r\n\
                    content-length: 9\r\n\r\nadd 0 2 7";
        let at = EffectAt {
            leg: 0,
            joint: 2,
            effect: 7,
        };
        let request = read(text).unwrap();
        assert_eq!(request.target, Target::Ask(Some(Wish::Add(at))));
        for end in 0..text.len() {
            assert_eq!(read(&text[..end]), None, "{end}");
        }
        assert_eq!(read(&"x".repeat(20_000)), None);
        let text = "POST /ask HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n";
        assert_eq!(read(text), None);
        let target = |text: &str| read(&format!("{text}\r\n\r\n")).unwrap().target;
        assert_eq!(target("GET / HTTP/1.1"), Target::Page);
        assert_eq!(target("GET /../etc/passwd HTTP/1.1"), Target::Nothing);
        for wish in ["", "add", "add 0 2", "add 0 2 256", "go"] {
            assert_eq!(Wish::read(wish), None, "{wish}");
        }
    }

    #[test]
    fn only_the_page_itself_may_ask() {
        let address = "127.0.0.1:7700".parse().unwrap();
        let from = |verb: &str, host: &str, origin: &str| {
            let origin = match origin {
                "" => String::new(),
                origin => format!("Origin: {origin}\r\n"),
            };
            let text = format!("{verb} HTTP/1.1\r\nHost: {host}\r\n{origin}\r\n");
            read(&text).unwrap().is_from_page(address)
        };
        assert!(from("GET /", "127.0.0.1:7700", ""));
        assert!(from("POST /ask", "localhost:7700", "http://localhost:7700"));
        assert!(!from("POST /ask", "localhost:7700", ""));
        assert!(!from("POST /ask", "localhost:7700", "http://elsewhere.org"));
        assert!(!from(
            "GET /events",
            "localhost:7700",
            "http://elsewhere.org"
        ));
        // A name of another site that was made to lead here.
        assert!(!from("GET /", "elsewhere.org:7700", ""));
    }
}
