//! Which blocks count. A block with a fault is refused with the reason, and the others are as if it had never come.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::block::{Block, Key, short_name};

/// Most time that a block may come after a later one of the same robot and still be usual, s: a day in a robot without a network.
const LATE: f64 = 86_400.0;

/// What is wrong with a file, or with a block.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The file cannot be read.
    #[error("{file}: {cause}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why not.
        cause: String,
    },
    /// The file, or a row group of it, is cut or damaged.
    #[error("{file}: cut or damaged: {cause}")]
    Damaged {
        /// The file.
        file: String,
        /// What its reader met.
        cause: String,
    },
    /// The file is no table of blocks.
    #[error("{file}: no table of blocks ({}): {}", super::table::SCHEMA, not_blocks(.found.as_deref()))]
    NotBlocks {
        /// The file.
        file: String,
        /// The schema that it names.
        found: Option<String>,
    },
    /// A column of the table has another name or type.
    #[error(
        "{file}: column {column} is {found}, which is not {}",
        super::table::SCHEMA
    )]
    Schema {
        /// The file.
        file: String,
        /// The column, by the schema.
        column: String,
        /// What stands there.
        found: String,
    },
    /// The columns that a hash stands for are not in the file, or are others.
    #[error(
        "{file}: the columns {hash} are not in the file's metadata, or are others than the hash is of"
    )]
    Columns {
        /// The file.
        file: String,
        /// The hash.
        hash: String,
    },
    /// The row is not the one that was written.
    #[error("{block}: a bit is wrong: CRC-32C {found:08x}, stored {stored:08x}")]
    Checksum {
        /// Which block.
        block: String,
        /// Of the row.
        found: u32,
        /// In the row.
        stored: u32,
    },
    /// A number is not finite, or a count is none.
    #[error("{block}: {what} is not a finite number, or not a possible one")]
    NotFinite {
        /// Which block.
        block: String,
        /// Which of its numbers.
        what: &'static str,
    },
    /// The factor has another number of entries than its columns ask for.
    #[error("{block}: the factor has {found} numbers, its columns ask for {asked}")]
    Shape {
        /// Which block.
        block: String,
        /// How many it has.
        found: usize,
        /// How many it should have.
        asked: usize,
    },
    /// A column that this program does not know.
    #[error("{block}: column {column} is unknown: renamed, or of a newer proprio")]
    UnknownColumn {
        /// Which block.
        block: String,
        /// The column.
        column: String,
    },
    /// Columns of another CAD, window or order than the robot's blocks before.
    #[error("{block}: other columns than the robot's blocks before ({what})")]
    OtherColumns {
        /// Which block.
        block: String,
        /// What differs.
        what: &'static str,
    },
    /// The block is there already.
    #[error("{block}: there already")]
    Duplicate {
        /// Which block.
        block: String,
    },
    /// The same log came as another robot's.
    #[error("{block}: the same log is {known}'s already")]
    OtherRobot {
        /// Which block.
        block: String,
        /// Whose it is.
        known: String,
    },
}

/// Why a file is no table of blocks, by the schema that it names.
fn not_blocks(found: Option<&str>) -> String {
    match found {
        Some(schema) => format!("its schema is {schema}"),
        None => "it names no such schema".to_owned(),
    }
}

impl Fault {
    /// What to do about it.
    pub fn fix(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "check the path and its permissions",
            Self::Damaged { .. } | Self::Checksum { .. } => {
                "copy the file again, or make it again from the log: proprio factors LOG --robot ID -o FILE"
            }
            Self::NotBlocks { .. } | Self::Schema { .. } | Self::Columns { .. } => {
                "make the table from a log: proprio factors LOG --robot ID -o FILE; a copy must keep the file's metadata and the columns' types"
            }
            Self::NotFinite { .. } | Self::Shape { .. } => {
                "make the block again from its log: proprio factors LOG --robot ID -o FILE"
            }
            Self::UnknownColumn { .. } => "update proprio, or make the block again with this one",
            Self::OtherColumns { .. } => {
                "make the blocks of one robot with one model file: proprio factors LOG… -m MODEL --robot ID"
            }
            Self::Duplicate { .. } => "nothing is lost; leave the second copy out",
            Self::OtherRobot { .. } => {
                "make the block again with the right name: proprio factors LOG --robot ID -o FILE"
            }
        }
    }

    /// A word for it, the same in every version.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "unreadable",
            Self::Damaged { .. } => "damaged",
            Self::NotBlocks { .. } => "not_blocks",
            Self::Schema { .. } => "schema",
            Self::Columns { .. } => "columns",
            Self::Checksum { .. } => "checksum",
            Self::NotFinite { .. } => "not_finite",
            Self::Shape { .. } => "shape",
            Self::UnknownColumn { .. } => "unknown_column",
            Self::OtherColumns { .. } => "other_columns",
            Self::Duplicate { .. } => "duplicate",
            Self::OtherRobot { .. } => "other_robot",
        }
    }
}

/// Lets blocks in, one after the other, and remembers them by their keys. What is let in does not depend on faulty blocks between.
#[derive(Debug, Default)]
pub struct Gate {
    /// Whose each block is, by its key without the robot.
    robots: HashMap<Key, String>,
    /// The columns of each robot's limb.
    columns: BTreeMap<(String, String), Arc<super::BlockColumns>>,
    /// The latest end of each robot's blocks, s.
    latest: BTreeMap<String, f64>,
    /// How many blocks came later than a day after a later one: they count.
    pub late: usize,
}

impl Gate {
    /// Lets a block in, or says why not.
    ///
    /// # Errors
    /// [`Fault`], with the block left out.
    pub fn admit(&mut self, block: Block) -> Result<Block, Fault> {
        let limb = (block.robot.clone(), block.limb.clone());
        // Those of one file are one.
        let known = self.columns.get(&limb);
        let is_known = known.is_some_and(|known| Arc::ptr_eq(known, &block.columns));
        check(&block)?;
        if !is_known {
            check_columns(&block)?;
        }
        let key = Key {
            robot: String::new(),
            ..block.key()
        };
        if let Some(known) = self.robots.get(&key) {
            return Err(match *known == block.robot {
                true => Fault::Duplicate {
                    block: name(&block),
                },
                false => Fault::OtherRobot {
                    block: name(&block),
                    known: known.clone(),
                },
            });
        }
        match self.columns.get(&limb) {
            Some(known) if !is_known && **known != *block.columns => {
                return Err(Fault::OtherColumns {
                    what: difference(known, &block.columns),
                    block: name(&block),
                });
            }
            Some(_) => {}
            None => {
                self.columns.insert(limb, block.columns.clone());
            }
        }
        self.robots.insert(key, block.robot.clone());
        let latest = self.latest.entry(block.robot.clone()).or_insert(block.t1);
        self.late += usize::from(block.t1 < *latest - LATE);
        *latest = latest.max(block.t1);
        Ok(block)
    }
}

/// The blocks that a gate of their own lets in, in one order, and why it refuses the others: the same for any order in which they come, which an engine that spreads
/// the work does not keep.
pub fn admit_all(mut blocks: Vec<Block>) -> (Vec<Block>, Vec<Fault>) {
    // Of two with one key that which was made first stands, and its columns are the robot's.
    let order = |block: &Block| (block.key(), block.received.to_bits(), block.crc32c);
    blocks.sort_by_cached_key(order);
    let (mut gate, mut faults) = (Gate::default(), Vec::new());
    let admit = |block| {
        let refused = |fault| faults.push(fault);
        gate.admit(block).map_err(refused).ok()
    };
    let admitted = blocks.into_iter().filter_map(admit).collect();
    (admitted, faults)
}

/// A block's name in words.
pub(super) fn name(block: &Block) -> String {
    let log = short_name(&block.log);
    format!(
        "{} {} at {} s of log {log}",
        block.robot, block.joint, block.t0
    )
}

/// What can be wrong with a block on its own.
fn check(block: &Block) -> Result<(), Fault> {
    let found = block.checksum();
    if found != block.crc32c {
        return Err(Fault::Checksum {
            block: name(block),
            found,
            stored: block.crc32c,
        });
    }
    let numbers = [
        (block.t0, "t0"),
        (block.t1, "t1"),
        (block.received, "received"),
        (block.rms, "rms"),
        (block.windows, "windows"),
        (block.temperature.unwrap_or(0.0), "temperature"),
    ];
    if let Some((_, what)) = numbers.into_iter().find(|(x, _)| !x.is_finite()) {
        return not_finite(block, what);
    }
    if block.t1 < block.t0 {
        return not_finite(block, "t1");
    }
    // As many windows as a factor can count.
    if !(1.0..1e15).contains(&block.windows) {
        return not_finite(block, "windows");
    }
    if !block.factor.iter().all(|x| x.is_finite()) {
        return not_finite(block, "factor");
    }
    let joint = block.columns.place(&block.joint);
    let asked = joint.map_or(0, |joint| block.columns.numbers(joint));
    if block.factor.len() != asked || block.limb != block.columns.limb {
        return Err(Fault::Shape {
            block: name(block),
            found: block.factor.len(),
            asked,
        });
    }
    Ok(())
}

fn not_finite(block: &Block, what: &'static str) -> Result<(), Fault> {
    Err(Fault::NotFinite {
        block: name(block),
        what,
    })
}

/// What can be wrong with the columns that it names.
fn check_columns(block: &Block) -> Result<(), Fault> {
    if let Some(column) = block
        .columns
        .columns
        .iter()
        .find(|column| !column.is_known())
    {
        return Err(Fault::UnknownColumn {
            block: name(block),
            column: column.name.clone(),
        });
    }
    let joints = block.columns.joints.len();
    let is_usable = |column: &super::KeptColumn| {
        let prior = column.mean.is_finite() && column.std.is_finite() && column.std > 0.0;
        prior && column.joints.iter().all(|joint| *joint < joints)
    };
    if !block.columns.columns.iter().all(is_usable) {
        return not_finite(block, "a column's prior");
    }
    Ok(())
}

/// In what two limbs' columns differ first.
fn difference(a: &super::BlockColumns, b: &super::BlockColumns) -> &'static str {
    let names = |of: &super::BlockColumns| -> Vec<String> {
        of.columns
            .iter()
            .map(|column| column.name.clone())
            .collect()
    };
    match () {
        () if a.cad != b.cad => "another CAD",
        () if a.window_us != b.window_us => "another window",
        () if names(a) != names(b) => "other names, or another order",
        () => "other units or priors",
    }
}
