//! The screen and its keys.

use crate::monitor::{Ask, Page, Screen, draw};
use crate::output::{asked_to_finish, finish_on_interrupt};
use proprio_core::wire::Action;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::session::Session;
use crate::command::Error;

/// Lines that a page key scrolls.
const PAGE: usize = 10;

/// Shows the screen until the user has seen enough.
pub(super) fn watch(session: &mut Session, source: String) -> Result<(), Error> {
    let mut screen = Screen {
        source,
        ..Screen::default()
    };
    finish_on_interrupt();
    let mut terminal = ratatui::try_init().map_err(Error::Terminal)?;
    let done = run(session, &mut screen, &mut terminal);
    ratatui::restore();
    done
}

fn run(
    session: &mut Session,
    screen: &mut Screen,
    terminal: &mut ratatui::DefaultTerminal,
) -> Result<(), Error> {
    while !asked_to_finish() {
        // What is watched stands still; what comes is heard all the same.
        if !screen.paused {
            screen.ended = session.ended;
            terminal
                .draw(|frame| draw(frame, &session.view, screen))
                .map_err(Error::Terminal)?;
        }
        match session.ended {
            true => std::thread::sleep(std::time::Duration::from_millis(50)),
            false => session.look(&mut |_| ())?,
        }
        while event::poll(std::time::Duration::ZERO).map_err(Error::Terminal)? {
            let Event::Key(key) = event::read().map_err(Error::Terminal)? else {
                continue;
            };
            if key.kind == KeyEventKind::Press && !obey(key, session, screen) {
                return Ok(());
            }
            // A key shows its effect, also while the screen stands still.
            terminal
                .draw(|frame| draw(frame, &session.view, screen))
                .map_err(Error::Terminal)?;
        }
    }
    Ok(())
}

/// Does what a key asks; false for the end.
fn obey(key: KeyEvent, session: &mut Session, screen: &mut Screen) -> bool {
    let sure = std::mem::take(&mut screen.sure);
    let count = session.view.ranking().len();
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return false,
        KeyCode::Char('q') | KeyCode::Esc => return false,
        KeyCode::Tab => {
            screen.page = screen.page.next();
            screen.scroll = 0;
        }
        KeyCode::Char(digit @ '1'..='5') => {
            screen.page = Page::ALL[digit as usize - '1' as usize];
            screen.scroll = 0;
        }
        KeyCode::Up | KeyCode::Char('k') => move_by(screen, count, -1),
        KeyCode::Down | KeyCode::Char('j') => move_by(screen, count, 1),
        KeyCode::PageUp => move_by(screen, count, -(PAGE as isize)),
        KeyCode::PageDown => move_by(screen, count, PAGE as isize),
        KeyCode::Char('a') => change(session, screen, true),
        KeyCode::Char('d') => change(session, screen, false),
        KeyCode::Char('r') if sure => session.ask(Action::Reset),
        KeyCode::Char('r') => screen.sure = true,
        KeyCode::Char('p' | ' ') => {
            screen.paused = !screen.paused;
            session.feed.ask(Ask::Pause);
        }
        KeyCode::Char('s') => session.save(),
        KeyCode::Char('f') => session.save_factors(),
        KeyCode::Char('w') => session.ask(Action::Keep),
        _ => {}
    }
    true
}

/// Moves the choice, or a leg's page.
fn move_by(screen: &mut Screen, count: usize, lines: isize) {
    match screen.page {
        Page::Robot => {
            let last = count.saturating_sub(1);
            screen.selected = screen
                .selected
                .min(last)
                .saturating_add_signed(lines)
                .min(last);
        }
        Page::Leg(leg) => {
            let _ = leg;
            screen.scroll = screen.scroll.saturating_add_signed(lines).min(100);
        }
    }
}

/// Adds the chosen effect to the device's model, or drops it.
fn change(session: &mut Session, screen: &Screen, add: bool) {
    let ranking = session.view.ranking();
    if let Some(ranked) = ranking.get(screen.selected.min(ranking.len().saturating_sub(1))) {
        session.ask(match add {
            true => Action::AddEffect(ranked.at),
            false => Action::DropEffect(ranked.at),
        });
    }
}
