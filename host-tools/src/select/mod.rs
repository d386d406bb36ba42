//! Which effects a model lacks: candidates, criteria and the search.
mod accept;
mod backward;
pub(crate) mod candidate;
mod compliance_scan;
pub(crate) mod criteria;
pub(crate) mod drift;
pub(crate) mod enumerate;
mod gain_bound;
mod headline;
mod limits;
mod look;
mod payload_placement;
pub(crate) mod ranking;
mod refused;
mod restart;
pub(crate) mod score_test;
pub(crate) mod search;
pub(crate) mod state;
