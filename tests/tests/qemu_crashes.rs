//! What ended a run is told by the next: an image that panics and faults on purpose, with the firmware's own handlers.

use proprio_host::device::{image, qemu};
use proprio_tests::emulator::unless_missing;

#[test]
fn a_panic_and_a_fault_are_told_at_the_next_start_once() {
    let image = image::crashes(image::Scalar::F64).unwrap();
    let Some(output) = unless_missing(qemu::run(&image)) else {
        return;
    };
    // Between the lines is the log. Each line: what the run before ended with, and the same asked again.
    let told: Vec<&str> = output.lines().filter(|line| line.ends_with('|')).collect();
    let [first, panicked, faulted] = told[..] else {
        panic!("{output:?}")
    };
    assert!(
        first.ends_with("|") && !first.contains("crashes.rs"),
        "{first}"
    );
    // As much as a hello has room for, after the log.
    let start = panicked.rfind("crashes.rs:").expect("the place");
    let words = panicked[start..].trim_end_matches('|');
    assert_eq!(words.len(), 64, "{words}");
    assert!(words.contains(": on purpose, and with more"), "{words}");
    assert!(
        faulted.contains("hard fault at ") && faulted.contains("CFSR 00010000"),
        "{faulted}"
    );
}
