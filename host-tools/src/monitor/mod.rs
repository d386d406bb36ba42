//! What a device says, as it says it: a view that messages build up, where they come from, a file that keeps them, a screen, and a page.

mod feed;
mod journal;
mod residual;
mod robot;
mod screen;
mod view;
pub mod web;

pub use feed::{Ask, Feed, FeedError, Source, Told};
pub use journal::{Entry, JournalError, JournalReader, JournalWriter};
pub use residual::{Band, Residual};
pub use robot::Robot;
pub use screen::{Page, Screen, draw};
pub use view::{Event, LegView, Ranked, View};
