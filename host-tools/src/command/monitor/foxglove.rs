//! What viewers are sent of a session.

use std::net::SocketAddr;
use std::time::Instant;

use crate::clock::now_ns;
use crate::log::cdr;
use crate::monitor::View;
use crate::monitor::foxglove::{Channel, Server};
use crate::monitor::web::{PERIOD, WebError};
use proprio_core::go2::{JointId, Leg};

use super::lines::Report;
use crate::command::result::result;

/// Viewers, and what they were sent last.
pub(super) struct Viewers {
    server: Server,
    sent: Option<Instant>,
    /// Messages of the device that this state is of.
    messages: u64,
    /// Events that were sent.
    events: u64,
}

impl Viewers {
    /// Serves them at `address`, and says so.
    pub(super) fn start(address: SocketAddr) -> Result<Self, WebError> {
        let server = Server::start(address)?;
        eprintln!("Viewers connect to ws://{}", server.address());
        Ok(Self {
            server,
            sent: None,
            messages: 0,
            events: 0,
        })
    }

    /// Sends what is new, and at the end the last state.
    pub(super) fn look(&mut self, view: &View, ended: bool) {
        self.happened(view);
        let is_due = self.sent.is_none_or(|sent| sent.elapsed() >= PERIOD) || ended;
        if !is_due || self.messages == view.messages {
            return;
        }
        (self.sent, self.messages) = (Some(Instant::now()), view.messages);
        let estimates = result("monitor", &Report::new(view));
        self.server.send(Channel::Estimates, estimates.into_bytes());
        let legs = Leg::ALL.into_iter().zip(&view.legs);
        let legs = legs.filter(|(_, known)| known.windows > 0);
        let joints =
            legs.flat_map(|(leg, known)| JointId::of(leg).into_iter().zip(&known.residuals));
        let newest = |residual: &crate::monitor::Residual| residual.newest().unwrap_or(f64::NAN);
        let (names, residuals): (Vec<&str>, Vec<f64>) = joints
            .map(|(joint, residual)| (joint.name(), newest(residual)))
            .unzip();
        let row = [Vec::new(), Vec::new(), residuals];
        let message = cdr::joint_state(now_ns(), names.into_iter(), &row);
        self.server.send(Channel::Residual, message);
    }

    /// Sends the events since the last time that the view still keeps.
    fn happened(&mut self, view: &View) {
        let new = view.happened_so_far() - self.events;
        self.events += new;
        let kept = view.events.len();
        for event in view.events.iter().skip(kept - kept.min(new as usize)) {
            let message = cdr::log(now_ns(), cdr::INFO, "device", &event.text);
            self.server.send(Channel::Events, message);
        }
    }

    /// Lets viewers take what waits for them; what they did not is a warning.
    pub(super) fn end(self) {
        let left_out = self.server.left_out();
        if left_out > 0 {
            eprintln!(
                "warning: messages that viewers took too few of, and are left out: {left_out}"
            );
        }
    }
}
