//! NumPy archives: `numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=[...])`, or an array per column.
//!
//! The container is read by `zip`; an array's header is the text of a Python dictionary with three keys (NumPy Enhancement
//! Proposal 1), which needs no parser of Python: `npyz` brings one, and an archive reader with six ciphers and compressions.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use zip::ZipArchive;

use super::arrays::{Array, Holds};
use super::input::Input;
use super::{Source, arrays};
use crate::log::error::{LogError, Problem};

/// Longer than any array's header.
const LONGEST_HEADER: usize = 1 << 16;

/// Most numbers of an array: an hour of 60 joints at 5 kHz.
const MOST: usize = 1 << 30;

/// Opens an archive and reads all its arrays.
pub(super) fn open(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let arrays = read(input.file).map_err(|problem| LogError::new(path, problem))?;
    arrays::open(path, arrays)
}

fn read(file: File) -> Result<Vec<(String, Array)>, Problem> {
    let damaged = |error: zip::result::ZipError| Problem::Damaged(error.to_string());
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(damaged)?;
    let mut arrays = Vec::new();
    for n in 0..archive.len() {
        let entry = archive.by_index(n).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?;
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
            continue;
        };
        match array(entry) {
            Ok(Some(array)) => arrays.push((name, array)),
            // Of a kind that no log holds: objects, complex numbers.
            Ok(None) => {}
            Err(error) => return Err(Problem::Damaged(format!("array `{name}`: {error}"))),
        }
    }
    if arrays.is_empty() {
        return Err(Problem::NotALog {
            what: "a zip archive without NumPy arrays",
            way: "unpack it first; or write numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=[...])",
        });
    }
    Ok(arrays)
}

/// Reads an array; none if it holds neither numbers nor texts.
fn array(mut bytes: impl Read) -> io::Result<Option<Array>> {
    let bad = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
    let mut start = [0; 8];
    bytes.read_exact(&mut start)?;
    if !start.starts_with(b"\x93NUMPY") {
        return Err(bad("it is no array"));
    }
    let length = if start[6] == 1 {
        let mut length = [0; 2];
        bytes.read_exact(&mut length)?;
        usize::from(u16::from_le_bytes(length))
    } else {
        let mut length = [0; 4];
        bytes.read_exact(&mut length)?;
        u32::from_le_bytes(length) as usize
    };
    if length > LONGEST_HEADER {
        return Err(bad("its header is too long"));
    }
    let mut header = vec![0; length];
    bytes.read_exact(&mut header)?;
    let header = String::from_utf8_lossy(&header);
    let (kind, by_column, shape) =
        parse(&header).ok_or_else(|| bad("its header makes no sense"))?;
    let count = shape
        .iter()
        .try_fold(1usize, |count, n| count.checked_mul(*n));
    let count = count
        .filter(|n| *n <= MOST)
        .ok_or_else(|| bad("it is too large"))?;
    let Some(width) = width(&kind) else {
        return Ok(None);
    };
    let mut data = Vec::new();
    bytes.take((count * width) as u64).read_to_end(&mut data)?;
    if data.len() != count * width {
        return Err(bad("it is cut short"));
    }
    let elements = data.chunks_exact(width.max(1));
    let holds = match &kind.as_bytes()[1] {
        b'U' | b'S' => Holds::Texts(elements.map(|e| text(&kind, e)).collect()),
        _ => {
            let Some(numbers) = elements.map(|e| number(&kind, e)).collect() else {
                return Ok(None);
            };
            Holds::Numbers(by_rows(numbers, by_column, &shape))
        }
    };
    Ok(Some(Array { shape, holds }))
}

/// Kind, order and shape of `{'descr': '<f8', 'fortran_order': False, 'shape': (100, 12), }`.
fn parse(header: &str) -> Option<(String, bool, Vec<usize>)> {
    let after = |key: &str| {
        let rest = &header[header.find(key)? + key.len()..];
        Some(rest[rest.find(':')? + 1..].trim_start())
    };
    let kind = after("'descr'")?;
    let kind = kind
        .strip_prefix('\'')
        .map_or("", |kind| kind.split('\'').next().unwrap_or(""));
    let by_column = after("'fortran_order'")?.starts_with("True");
    let shape = after("'shape'")?.strip_prefix('(')?;
    let shape = shape.split(')').next()?.split(',').map(str::trim);
    let shape: Result<Vec<usize>, _> = shape.filter(|n| !n.is_empty()).map(str::parse).collect();
    // A structured array has a list for its kind: none of ours.
    let kind = if kind.len() < 3 || !kind.is_ascii() {
        "|O8"
    } else {
        kind
    };
    Some((kind.to_owned(), by_column, shape.ok()?))
}

/// Bytes of an element.
fn width(kind: &str) -> Option<usize> {
    let size: usize = kind.get(2..)?.parse().ok()?;
    match &kind[1..2] {
        "f" | "i" | "u" | "b" if (1..=8).contains(&size) => Some(size),
        "U" if size <= 1024 => Some(4 * size),
        "S" if size <= 4096 => Some(size),
        _ => None,
    }
}

fn number(kind: &str, bytes: &[u8]) -> Option<f64> {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if kind.starts_with('>') {
        little[..bytes.len()].reverse();
    }
    let unsigned = u64::from_le_bytes(little);
    let bits = 8 * bytes.len() as u32;
    let signed = unsigned.cast_signed() << (64 - bits) >> (64 - bits);
    Some(match (&kind[1..2], bytes.len()) {
        ("f", 8) => f64::from_bits(unsigned),
        ("f", 4) => f32::from_bits(unsigned as u32).into(),
        ("i", _) => signed as f64,
        ("u" | "b", _) => unsigned as f64,
        _ => return None,
    })
}

fn text(kind: &str, bytes: &[u8]) -> String {
    if kind.as_bytes()[1] == b'S' {
        return String::from_utf8_lossy(bytes)
            .trim_end_matches('\0')
            .to_owned();
    }
    let letters = bytes.as_chunks::<4>().0.iter().map(|four| {
        let point = if kind.starts_with('>') {
            u32::from_be_bytes(*four)
        } else {
            u32::from_le_bytes(*four)
        };
        char::from_u32(point).unwrap_or(char::REPLACEMENT_CHARACTER)
    });
    letters
        .collect::<String>()
        .trim_end_matches('\0')
        .to_owned()
}

/// Numbers row by row, whatever their order in the file.
fn by_rows(numbers: Vec<f64>, by_column: bool, shape: &[usize]) -> Vec<f64> {
    match *shape {
        [rows, columns] if by_column => {
            let place = |n: usize| numbers[n % columns * rows + n / columns];
            (0..rows * columns).map(place).collect()
        }
        _ => numbers,
    }
}
