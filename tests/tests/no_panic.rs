//! Nothing that a step of the application reaches can panic: read off the image's branches.
//!
//! A function's calls and tail calls are branches whose distance is in the instruction (Arm DDI 0403E, A7.7.12 and A7.7.18), so
//! what can be reached from it is known from the image alone. A call through a pointer would hide what it calls: there is to be
//! none either.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use proprio_host::device::image::{self, Scalar};

/// The functions of an image: by address, where each ends and what it is called.
struct Image {
    functions: BTreeMap<u64, (u64, String)>,
    /// Where data lie between the instructions: from, to.
    data: Vec<(u64, u64)>,
    text: Vec<u8>,
    start: u64,
}

/// A call through a register.
const POINTER: u64 = u64::MAX;

impl Image {
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let file = object::File::parse(&*bytes).unwrap();
        let section = file.section_by_name(".text").unwrap();
        let start = section.address();
        let text = section.data().unwrap().to_vec();
        let end = start + text.len() as u64;
        let mut functions = BTreeMap::new();
        let mut marks = BTreeMap::new();
        for symbol in file.symbols() {
            let (name, address) = (symbol.name().unwrap_or(""), symbol.address() & !1);
            if !(start..end).contains(&address) {
                continue;
            }
            if name.starts_with("$d") || name.starts_with("$t") {
                marks.insert(symbol.address(), name.starts_with("$d"));
            } else if symbol.kind() == SymbolKind::Text && symbol.size() > 0 {
                functions.insert(address, (address + symbol.size(), name.to_owned()));
            }
        }
        let ends = marks.keys().copied().skip(1).chain([end]);
        let spans = marks.iter().zip(ends);
        let data = spans
            .filter(|((_, is_data), _)| **is_data)
            .map(|((from, _), to)| (*from, to))
            .collect();
        Self {
            functions,
            data,
            text,
            start,
        }
    }

    fn half(&self, address: u64) -> Option<u32> {
        let at = usize::try_from(address.checked_sub(self.start)?).ok()?;
        let bytes = self.text.get(at..at + 2)?;
        Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]])))
    }

    /// Where the branches of a function go outside of it.
    fn targets(&self, function: u64) -> BTreeSet<u64> {
        let end = self.functions[&function].0;
        let mut targets = BTreeSet::new();
        let mut address = function;
        while address < end {
            if let Some((_, to)) = self
                .data
                .iter()
                .find(|(from, to)| (*from..*to).contains(&address))
            {
                address = *to;
                continue;
            }
            let Some(first) = self.half(address) else {
                break;
            };
            let wide = first >> 11 >= 0b11101;
            let second = if wide { self.half(address + 2) } else { None };
            if first & 0xFF80 == 0x4780 {
                targets.insert(POINTER);
            }
            if let Some(offset) = branch(first, second) {
                let target = address.wrapping_add(4).wrapping_add_signed(offset);
                if !(function..end).contains(&target) {
                    targets.insert(target);
                }
            }
            address += if wide { 4 } else { 2 };
        }
        targets
    }

    fn name(&self, address: u64) -> &str {
        match (address, self.functions.get(&address)) {
            (POINTER, _) => "a call through a pointer",
            (_, Some((_, name))) => name,
            (_, None) => "an address that is no function's",
        }
    }

    /// The ways, by name, from functions whose names hold all of `root` to what panics or cannot be told.
    fn panics(&self, root: &[&str]) -> Vec<String> {
        let is_root = |name: &str| root.iter().all(|part| name.contains(part));
        let roots = self
            .functions
            .iter()
            .filter(|(_, (_, name))| is_root(name))
            .map(|(address, _)| *address);
        let mut from: BTreeMap<u64, Option<u64>> = roots.map(|root| (root, None)).collect();
        assert!(!from.is_empty(), "no function is called {root:?}");
        let mut queue: VecDeque<u64> = from.keys().copied().collect();
        let mut ways = Vec::new();
        while let Some(at) = queue.pop_front() {
            let name = self.name(at);
            if name.contains("panicking") || !self.functions.contains_key(&at) {
                let mut way = name.to_owned();
                let mut before = from[&at];
                while let Some(caller) = before {
                    way = format!("{} → {way}", self.name(caller));
                    before = from[&caller];
                }
                ways.push(way);
                continue;
            }
            for target in self.targets(at) {
                from.entry(target).or_insert_with(|| {
                    queue.push_back(target);
                    Some(at)
                });
            }
        }
        ways
    }
}

/// How far a branch goes from the end of its four bytes' place: BL, B.W, B<c>.W, and the two narrow ones.
fn branch(first: u32, second: Option<u32>) -> Option<i64> {
    let signed = |value: u32, bits: u32| i64::from((value << (32 - bits)) as i32 >> (32 - bits));
    match second {
        None if first >> 12 == 0b1101 && first >> 8 & 0xF < 0xE => {
            Some(signed(first & 0xFF, 8) * 2)
        }
        None if first >> 11 == 0b11100 => Some(signed(first & 0x7FF, 11) * 2),
        Some(second) if first >> 11 == 0b11110 && second >> 15 == 1 => {
            let (s, j1, j2) = (first >> 10 & 1, second >> 13 & 1, second >> 11 & 1);
            if second >> 12 & 1 == 1 {
                let (i1, i2) = (1 ^ j1 ^ s, 1 ^ j2 ^ s);
                let high = s << 23 | i1 << 22 | i2 << 21 | (first & 0x3FF) << 11;
                Some(signed(high | second & 0x7FF, 24) * 2)
            } else if second >> 14 & 1 == 0 && first >> 6 & 0xF < 0xE {
                let high = s << 19 | j2 << 18 | j1 << 17 | (first & 0x3F) << 11;
                Some(signed(high | second & 0x7FF, 20) * 2)
            } else {
                None
            }
        }
        _ => None,
    }
}

/// The images that `proprio flash` writes have the same application between other functions, so that others are inlined. What `App::keep` asks of
/// their flash wakes a task, through a pointer.
#[test]
fn nothing_that_a_step_of_the_nucleos_images_reaches_can_panic() {
    for (walks, app) in [(false, "App"), (true, "WalkingApp")] {
        let image = Image::read(&image::build_nucleo(walks).unwrap());
        let ways = image.panics(&["proprio_core", "3app", app, "4step"]);
        assert!(ways.is_empty(), "{app}:\n{}", ways.join("\n"));
    }
}

#[test]
fn nothing_that_a_step_reaches_can_panic() {
    for scalar in [Scalar::F64, Scalar::F32] {
        let walking = Image::read(&image::walking(scalar).unwrap());
        let ways = walking.panics(&["proprio_core", "3app", "WalkingApp", "4step"]);
        assert!(ways.is_empty(), "{}:\n{}", scalar.name(), ways.join("\n"));
        let image = Image::read(&image::build(scalar).unwrap());
        let ways = image.panics(&["proprio_core", "3app", "App", "4step"]);
        assert!(ways.is_empty(), "{}:\n{}", scalar.name(), ways.join("\n"));
        let ways = image.panics(&["proprio_core", "3app", "App", "4keep"]);
        assert!(ways.is_empty(), "{}:\n{}", scalar.name(), ways.join("\n"));
        // What the board does before its first step may: it is how this test would notice.
        let main = image.panics(&["__cortex_m_rt_main"]);
        assert!(main.iter().any(|way| way.contains("panicking")), "{main:?}");
    }
}
