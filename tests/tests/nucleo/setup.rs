//! What the board is set up for: kept by its flash wherever the power fails, and used from the next start on.

use super::*;
use proprio_core::wire::Setup;

const OTHER: Setup = Setup {
    imu_at: [-250, 10, 700],
    imu_turned: [31_416, 0, 0],
    bus_baud: 2_000_000,
};
const THIRD: Setup = Setup {
    bus_baud: 1_000_000,
    ..OTHER
};

/// The power fails in the first record at its first word and at a later one; then the record is kept, which asking again does not write; then it fails in
/// the next, and the board listens at the bit rate of the last whole record.
#[test]
fn the_nucleos_image_is_set_up_by_its_last_whole_record() {
    // A step a word and a step until it is written; a start takes 30 ms.
    const CUTS_US: [u64; 3] = [ASKED_US + 6_000, 190_000 + 12_000, 850_000 + 10_000];
    const KEPT_US: u64 = 330_000;
    const OFF_US: u64 = 700_000;
    // Each is a request of its own.
    let asked = |time_us: u64, setup| {
        let id = time_us as u32;
        asked(time_us, &mut Sender::default(), id, &[Action::SetUp(setup)])
    };
    let hello = |time_us| {
        let bytes = Sender::default()
            .encode(&HostMessage::RequestHello, &mut [0; MAX_FRAME])
            .to_vec();
        Event(time_us, HOST, bytes)
    };
    let events = [
        asked(ASKED_US, OTHER),
        asked(190_000, OTHER),
        asked(KEPT_US, OTHER),
        hello(KEPT_US + 60_000),
        asked(KEPT_US + 100_000, OTHER),
        asked(850_000, THIRD),
        hello(1_000_000),
    ];
    let mut faults = Vec::from(CUTS_US.map(|us| Fault(us, HOST, "torn")));
    faults.push(Fault(OFF_US, HOST, "power"));
    let Some(run) = Run::with(1.1, &events, &faults, &[]) else {
        return;
    };
    assert_eq!(run.starts_us().len(), 5, "{}", run.report);
    let told = run.hellos().into_iter();
    let mut told: Vec<_> = told
        .map(|hello| (hello.setup.bus_baud, hello.setup_in_use))
        .collect();
    told.dedup();
    let first = (Setup::GO2.bus_baud, true);
    assert_eq!(
        told,
        [first, (OTHER.bus_baud, false), (OTHER.bus_baud, true)]
    );
    assert_eq!(run.hellos().last().unwrap().setup, OTHER);
    assert_eq!(
        run.report["buses_baud"],
        Value::from(vec![OTHER.bus_baud; 4])
    );
    // Of the four records that were begun: what is kept is not written again.
    assert_eq!(run.report["sectors_erased"], 4);
}
