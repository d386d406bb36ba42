//! Reports: one HTML file that shows what a command found.
//!
//! A [`Page`] has a [`Header`] and [`Section`]s in reading order. Each kind of figure has its own module, which turns plain
//! data into a section: [`torque`], [`residual`], [`correlation`], [`waterfall`], [`candidates`], [`parameters`]. The plots
//! are Plotly.js' and can be zoomed; the file holds the library and the data, asks no network for anything (its content
//! security policy forbids it) and reads on a phone, in print, in light and in dark.
//!
//! [`pages`] makes the page of each command.
//!
//! Whatever comes from outside (paths, names of joints) is escaped where it enters: [`escape`] has one function for each
//! of the three languages in the file.
//!
//! ```no_run
//! use proprio_host::report::{Header, Page, torque};
//!
//! let page = Page {
//!     header: Header {
//!         title: "Model against measurement".to_owned(),
//!         command: "proprio compare log.csv --html report.html".to_owned(),
//!         ..Header::default()
//!     },
//!     sections: vec![torque::section(&[torque::TorqueSeries {
//!         joint: "FR_hip".to_owned(),
//!         t: vec![0.0, 0.02],
//!         measured: vec![1.0, 1.1],
//!         predicted: vec![("rigid body".to_owned(), vec![0.9, 1.0])],
//!     }])],
//! };
//! page.write("report.html".as_ref())?;
//! # Ok::<(), proprio_host::output::WriteError>(())
//! ```
//!
//! Files beside:
//!
//! - `choices`: tick boxes: every model that leaves effects out, or has more of the simple ones, fitted anew in the page
//! - `data_table`: a table that can be sorted, and filtered where it is long
//! - `minutes`: errors over every window of long logs
//! - `models`: errors of several models, joint by joint
//! - `motion`: a designed motion: what each joint does and how the search went; and the feedback that models leave
//! - `poses`: measured poses: error vectors, errors by pose and by joint
//! - `responses`: frequency responses, their scatter and values
//! - `robot`: the robot as lines, from its URDF: each link in the colour of its joint's error
//! - `rollout`: positions of a model run forward, and their errors
//! - `stance`: which feet carry a force, or may, and why that is believed
//! - `stick`: a moving figure of limbs
//! - `thin`: fewer points without losing what a reader looks for

pub mod candidates;
mod choices;
pub mod correlation;
mod data_table;
pub mod escape;
mod figure;
mod library;
mod minutes;
pub mod models;
pub mod motion;
mod page;
pub mod pages;
pub mod parameters;
pub mod poses;
pub mod residual;
pub mod responses;
mod robot;
pub mod rollout;
mod section;
pub mod stance;
pub mod stick;
mod thin;
pub mod torque;
pub mod waterfall;

pub use page::{Drawing, Finding, Header, LogFile, Moment, Page};
pub use section::Section;
