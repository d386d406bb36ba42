//! Who the device is: what a firmware says of itself and of its board.

use crate::wire::{Clock, Positions, Reset, Setup};

/// Who the device is and what it may do; an argument, so that all logic runs anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Version of the firmware; 24 bytes at most are told.
    pub firmware: &'static str,
    /// Name of the board; 24 bytes at most are told.
    pub board: &'static str,
    /// Why it runs, and what.
    pub start: Start,
    /// What [`App::record_cost`](super::App::record_cost) is told; 16 bytes at most.
    pub load_unit: &'static str,
    /// A step that costs more is counted as over budget.
    pub budget: u32,
    /// Time between two bytes that follow each other on a motor bus, ns: 2500 at 4 Mbit/s; 0 where all bytes that come at once
    /// have one time, as in replay.
    pub byte_ns: u32,
    /// What positions on the bus are, until a host says otherwise ([`Action::SetPositions`](crate::wire::Action::SetPositions)).
    pub positions: Positions,
}

/// What a board knows of its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// The commit that the firmware was built of; 16 bytes at most are told.
    pub git: &'static str,
    /// Why it started.
    pub reset: Reset,
    /// Below which supply it resets itself, as the chip's manual counts levels; nothing where it has no such reset.
    pub brown_out_level: Option<u8>,
    /// Which clock its times are of.
    pub clock: Clock,
    /// What ended the run before, if that was a panic or a fault; 64 bytes at most are told.
    pub crash: &'static str,
    /// What the board is set up for: [`setup_in`](super::setup_in) its flash.
    pub setup: Setup,
}

impl Start {
    /// Nothing is known of it.
    pub const UNKNOWN: Self = Self {
        git: "",
        reset: Reset::Unknown,
        brown_out_level: None,
        clock: Clock::Unknown,
        crash: "",
        setup: Setup::GO2,
    };
}

/// Of an application that has not been told who it is.
pub(super) const NOBODY: Identity = Identity {
    firmware: "",
    board: "",
    start: Start::UNKNOWN,
    load_unit: "",
    budget: u32::MAX,
    byte_ns: 0,
    positions: Positions::FromPowerUp,
};
