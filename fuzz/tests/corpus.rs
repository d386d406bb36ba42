//! The seeds and the committed corpus once more, without a fuzzer.

use std::fs;
use std::path::Path;

use proprio_fuzz::{TARGETS, seeds};

/// What the fuzzer found worth keeping, by name.
fn committed(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target);
    let files = fs::read_dir(&folder)
        .unwrap()
        .map(|file| file.unwrap().path());
    let mut files: Vec<_> = files
        .map(|path| (path.display().to_string(), fs::read(&path).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn the_corpus_neither_panics_nor_loses_count() {
    for (name, target) in TARGETS {
        let corpus = committed(name);
        assert!(corpus.len() >= 4, "{name}: {} files", corpus.len());
        for (path, bytes) in corpus {
            println!("{path}");
            target(&bytes);
        }
    }
}

#[test]
fn seeds_cut_anywhere_and_spoilt_neither_panic_nor_lose_count() {
    for (name, target) in TARGETS {
        for (n, seed) in seeds::of(name).iter().enumerate() {
            println!("{name} {n}");
            target(seed);
            for cut in [1, seed.len() / 3, seed.len() / 2] {
                target(&seed[..seed.len() - cut]);
            }
            let mut spoilt = seed.clone();
            for byte in spoilt.iter_mut().skip(60).step_by(97) {
                *byte ^= 0x41;
            }
            target(&spoilt);
        }
    }
}
