//! The page and what is asked in it.

use std::time::Instant;

use crate::monitor::Ask;
use crate::monitor::web::{PERIOD, Server, State, Wish};
use crate::output::{asked_to_finish, finish_on_interrupt};
use proprio_core::wire::Action;

use super::session::Session;
use crate::command::Error;

/// Serves until the user has seen enough, or the time asked for is over.
pub(super) fn watch(session: &mut Session, server: &Server, source: &str) -> Result<(), Error> {
    finish_on_interrupt();
    eprintln!("The page is at http://{}/ ; Ctrl-C ends.", server.address());
    let (mut paused, mut told) = (false, None::<Instant>);
    let is_over = |session: &Session| session.ended && session.limit_us.is_some();
    while !asked_to_finish() && !is_over(session) {
        match session.ended {
            true => std::thread::sleep(PERIOD),
            false => session.look(&mut |_| ())?,
        }
        for wish in server.wishes() {
            paused ^= wish == Wish::Pause;
            obey(session, wish);
            // A wish shows its effect, also while the page stands still.
            told = None;
        }
        let due = |told: Instant| !paused && told.elapsed() >= PERIOD;
        if told.is_none_or(due) {
            server.tell(&State::of(&session.view, source, paused, session.ended));
            told = Some(Instant::now());
        }
    }
    Ok(())
}

fn obey(session: &mut Session, wish: Wish) {
    match wish {
        Wish::Add(at) => session.ask(Action::AddEffect(at)),
        Wish::Drop(at) => session.ask(Action::DropEffect(at)),
        Wish::Reset => session.ask(Action::Reset),
        Wish::Pause => session.feed.ask(Ask::Pause),
        Wish::Save => session.save(),
        Wish::Factors => session.save_factors(),
        Wish::Keep => session.ask(Action::Keep),
    }
}
