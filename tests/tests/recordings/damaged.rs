//! Recordings that were cut short or damaged.

use std::fs;

use proprio_tests::command::{folder, proprio, stderr};
use proptest::prelude::*;

use super::{recordings, table, unpacked};

/// A recording that was cut short gives its whole messages, and says so.
#[test]
fn a_cut_bag_gives_its_whole_messages() {
    let expected = table(&unpacked(&recordings().join("low_state.csv.gz")));
    let all = expected["t"].len();
    for (bag, name) in [
        ("go_mcap/go_mcap.mcap", "cut.mcap"),
        ("go_lz4.mcap", "cut.mcap"),
        ("go_mcap_zstd/go_mcap_zstd.mcap", "cut.mcap"),
        ("go_db3/go_db3.db3", "cut.db3"),
    ] {
        let whole = fs::read(recordings().join(bag)).unwrap();
        let mut before = 0;
        for percent in [70, 80, 90] {
            let folder = folder();
            let cut = &whole[..whole.len() * percent / 100];
            fs::write(folder.path().join(name), cut).unwrap();
            let output = proprio(folder.path(), &["import", name, "-o", "log.csv"]);
            let words = stderr(&output);
            if output.status.code() == Some(1) {
                // Compressed in one piece, or without the pages that say where the messages are.
                assert!(words.contains("error: cut."), "{bag}: {words}");
                continue;
            }
            assert!(
                words.contains("the file was cut short"),
                "{bag} {percent} %: {words}"
            );
            let found = table(&fs::read_to_string(folder.path().join("log.csv")).unwrap());
            let rows = found["t"].len();
            assert!(
                rows >= before && rows <= all,
                "{bag} {percent} %: {rows} of {all}"
            );
            before = rows;
            for (channel, numbers) in &found {
                assert_eq!(numbers[..], expected[channel][..rows], "{bag}: {channel}");
            }
        }
        assert!(before > all / 3, "{bag}: {before} of {all}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 300, ..ProptestConfig::default() })]

    /// Bytes lost, doubled or changed anywhere: an error or a log, never a panic, never an hour.
    #[test]
    fn no_bytes_make_a_reader_panic(
        which in 0..9usize,
        place in 0.0..1.0f64,
        cut in proptest::bool::ANY,
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        lost in 0..12usize,
    ) {
        use proprio_host::log::{LogReader, Selection};
        let files = [
            "go_mcap/go_mcap.mcap", "go_mcap_zstd/go_mcap_zstd.mcap", "go_lz4.mcap", "go_db3/go_db3.db3",
            "joint_mcap/joint_mcap.mcap", "log.npz", "log_compressed.npz", "log.parquet", "low_state.csv.gz",
        ];
        let mut contents = fs::read(recordings().join(files[which])).unwrap();
        let at = (place * contents.len() as f64) as usize;
        if cut {
            contents.truncate(at);
        } else {
            let end = (at + lost).min(contents.len());
            contents.splice(at..end, bytes);
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), &contents).unwrap();
        if let Ok(mut log) = LogReader::open(file.path(), Selection::Everything) {
            while let Ok(Some(row)) = log.next_row() {
                prop_assert!(row.t().is_finite());
            }
            let _ = log.finish();
        }
    }
}
