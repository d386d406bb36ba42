//! Each fault gets its own reason, and the others' answers stay the same to the bit.

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::study::few_blocks;
use super::table::{encode, read_from};
use super::*;

/// A file of these bytes, without a name.
fn file(bytes: &[u8]) -> File {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(bytes).unwrap();
    file
}

/// Answers as text: numbers are written so that they read back to the bit.
fn answers(blocks: impl IntoIterator<Item = Block>) -> String {
    serde_json::to_string(&final_answers(partial(blocks))).unwrap()
}

/// What the gate lets in, and the kinds of what it refuses.
fn admitted(blocks: impl IntoIterator<Item = Block>) -> (Vec<Block>, Vec<&'static str>) {
    let (mut gate, mut faults) = (Gate::default(), Vec::new());
    let admit = |block| {
        gate.admit(block)
            .map_err(|fault| faults.push(fault.kind()))
            .ok()
    };
    (blocks.into_iter().filter_map(admit).collect(), faults)
}

fn with_columns(block: &Block, change: impl Fn(&mut BlockColumns)) -> Block {
    let mut columns = (*block.columns).clone();
    change(&mut columns);
    Block {
        hash: Arc::from(columns.hash()),
        columns: Arc::new(columns),
        ..block.clone()
    }
    .sealed()
}

#[test]
fn each_fault_is_named_and_the_others_answers_stay() {
    let blocks = few_blocks(4, 9);
    let truth = answers(blocks.clone());
    let last = blocks.last().unwrap().clone();
    let new = |change: &dyn Fn(&mut Block)| {
        let mut block = last.clone();
        block.log = "another log".to_owned();
        change(&mut block);
        block.sealed()
    };
    let flipped = |bit: u32| {
        let mut block = new(&|_| ());
        block.factor[3] = f32::from_bits(block.factor[3].to_bits() ^ (1 << bit));
        block
    };
    let faulty = [
        (last.clone(), "duplicate"),
        (new(&|b| b.factor[2] = f32::NAN), "not_finite"),
        (new(&|b| b.t1 = f64::NAN), "not_finite"),
        (new(&|b| b.windows = 0.0), "not_finite"),
        (flipped(0), "checksum"),
        (flipped(30), "checksum"),
        (new(&|b| b.factor.push(0.0)), "shape"),
        (new(&|b| b.joint = "tail".to_owned()), "shape"),
        (
            with_columns(&new(&|_| ()), |c| c.window_us = 10_000),
            "other_columns",
        ),
        (
            with_columns(&new(&|_| ()), |c| c.cad = "0".to_owned()),
            "other_columns",
        ),
        (
            with_columns(&new(&|_| ()), |c| {
                c.columns[30].name = "friction:RL_hip".to_owned()
            }),
            "unknown_column",
        ),
        (
            with_columns(&new(&|_| ()), |c| c.columns.swap(0, 1)),
            "other_columns",
        ),
        (
            with_columns(&new(&|_| ()), |c| c.columns[3].std = 0.0),
            "not_finite",
        ),
        (
            Block {
                robot: "r000".to_owned(),
                ..last.clone()
            }
            .sealed(),
            "other_robot",
        ),
    ];
    for (block, kind) in faulty {
        let after = blocks.iter().cloned().chain([block.clone()]);
        let (let_in, faults) = admitted(after);
        assert_eq!(faults, [kind]);
        assert_eq!(answers(let_in), truth, "{kind}");
        let fault = Gate::default().admit(block).err();
        assert!(fault.is_none_or(|fault| !fault.fix().is_empty()));
    }
}

#[test]
fn late_blocks_count_and_the_order_does_not() {
    let mut blocks = few_blocks(4, 9);
    let truth = answers(blocks.clone());
    let mut random = ChaCha8Rng::seed_from_u64(3);
    blocks.shuffle(&mut random);
    let mut gate = Gate::default();
    let let_in: Vec<Block> = blocks
        .iter()
        .cloned()
        .map(|block| gate.admit(block).unwrap())
        .collect();
    assert!(gate.late > 0);
    assert_eq!(answers(let_in), truth);
    // In parts that are put together in any order, limbs' joints torn apart.
    let mut parts: Vec<Vec<Kept>> = blocks
        .chunks(37)
        .map(|part| partial(part.iter().cloned()))
        .collect();
    parts.shuffle(&mut random);
    let merged = merge(parts);
    assert_eq!(
        serde_json::to_string(&final_answers(merged)).unwrap(),
        truth
    );
}

#[test]
fn a_table_holds_what_was_written() {
    let mut blocks = few_blocks(1, 3);
    blocks[5].site = Some("hall".to_owned());
    blocks[5].temperature = Some(41.5);
    blocks[5] = blocks[5].clone().sealed();
    let bytes = encode(&blocks).unwrap();
    let table = read_from("table", file(&bytes));
    assert_eq!(table.faults, []);
    assert_eq!(table.blocks, blocks);
    let (let_in, faults) = admitted(table.blocks);
    assert_eq!((let_in.len(), faults.len()), (36, 0));
    // What a block of a Go2 adds to a table.
    let size = |logs: usize| encode(&few_blocks(1, logs)).unwrap().len();
    let own = size(3) - size(2);
    println!("{own} bytes a block, {} in a table of one", size(1));
    assert!(own < 30_000, "{own}");
}

#[test]
fn a_damaged_file_costs_what_is_damaged_and_nothing_is_silently_another() {
    let blocks = few_blocks(1, 3);
    let bytes = encode(&blocks).unwrap();
    for share in [0.0, 0.01, 0.3, 0.9, 0.999] {
        let cut = (share * bytes.len() as f64) as usize;
        let table = read_from("cut", file(&bytes[..cut]));
        assert!(
            table.blocks.is_empty() && table.faults[0].kind() == "damaged",
            "{share}"
        );
    }
    for other in [&b"t,q/FR_hip\n0.0,0.1\n"[..], b"t"] {
        let table = read_from("log.csv", file(other));
        assert_eq!(table.faults[0].kind(), "not_blocks");
        let said = table.faults[0].to_string();
        assert!(said.contains("log.csv: no table of blocks"), "{said}");
    }
    let mut survived = 0;
    for at in (0..bytes.len()).step_by(97) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        let table = read_from("flipped", file(&flipped));
        let (let_in, _) = admitted(table.blocks);
        // What is let in is what was written.
        assert!(
            let_in.iter().all(|block| blocks.contains(block)),
            "byte {at}"
        );
        survived += let_in.len();
    }
    let all = bytes.len().div_ceil(97) * blocks.len();
    println!("{:.1} % survive", 100.0 * survived as f64 / all as f64);
    // A flipped bit of one block of three leaves the other two.
    assert!(2 * survived > all, "{survived} of {all}");
}

#[test]
fn other_types_and_other_names_of_the_tables_columns_are_named() {
    use parquet::file::metadata::KeyValue;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    let of = |message: String, name: &str| {
        let schema = Arc::new(parse_message_type(&message).unwrap());
        let named = KeyValue::new("schema".to_owned(), name.to_owned());
        let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![named]));
        let writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties.build()));
        let table = read_from("other", file(&writer.unwrap().into_inner().unwrap()));
        assert!(table.blocks.is_empty());
        (table.faults[0].kind(), table.faults[0].to_string())
    };
    let with = |from: &str, to: &str| of(table::MESSAGE.replace(from, to), table::SCHEMA);
    let (kind, words) = with("float element", "double element");
    assert_eq!(kind, "schema");
    assert!(words.contains("factor.list.element is double"), "{words}");
    let (kind, words) = with("binary robot", "binary machine");
    assert_eq!(kind, "schema");
    assert!(words.contains("column robot is machine"), "{words}");
    assert_eq!(
        of(table::MESSAGE.to_owned(), "proprio.blocks/2").0,
        "not_blocks"
    );
}
