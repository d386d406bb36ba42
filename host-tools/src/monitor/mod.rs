//! What a device says, as it says it: a view that messages build up, where they come from, a file that keeps them, a screen, and a page.
//!
//! Files beside:
//!
//! - `error`: why messages end
//! - `foxglove`: the view for viewers: a WebSocket server of Foxglove's protocol
//! - `feed`: where messages come from: a thread that listens to a device, feeds it if it has no robot, and passes on what it is asked
//! - `journal`: all that came from a device, in a file
//! - `live`: rows of a live source or of a log as steps of motor buses, for the device in this process
//! - `residual`: a joint's residual of the last second against what it was before
//! - `web`: the view as a page: a server for browsers on this machine, which streams what is known

mod error;
mod feed;
pub mod foxglove;
mod journal;
mod live;
mod residual;
mod screen;
mod view;
pub mod web;

pub use error::FeedError;
pub use feed::{Ask, Feed, Source, Told};
pub use journal::{Entry, JournalError, JournalReader, JournalWriter};
pub use live::Live;
pub use residual::{Band, Residual};
pub use screen::{Page, Screen, draw};
pub use view::{Event, LegView, Ranked, View};
