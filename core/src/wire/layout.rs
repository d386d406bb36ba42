//! The layout of each kind of message as a hash, taken when compiled. A device says in its [`Hello`](super::Hello) which layouts its messages have and
//! which it expects of the host's; so a host reads what has stayed as it was from a device that was built before some kind changed or was there,
//! and knows what it does not read.
//!
//! The hello itself is read if it is this program's or one that ended earlier: it grows at its end alone, and what it lacks is zero, which means
//! that nothing is known. A device that was built later than this program, with a longer hello, is refused.

use core::marker::PhantomData;

use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64::hash_ty_path;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType, NamedVariant};

use super::{DeviceMessage, HostMessage, PROTOCOL, SCHEMA, WireError};

/// A hash of a kind's layout and of [`PROTOCOL`]: with 24 bits those of all kinds find room in a hello, and two layouts have the same one by a chance
/// of 6·10⁻⁸.
pub type Layout = [u8; 3];

/// Kinds of messages that a device says.
pub const SAID: usize = 9;
/// Kinds of messages that it hears.
pub const HEARD: usize = 5;

/// The layouts of a device's messages, in the order of [`DeviceMessage`]'s kinds. A new kind is the last.
pub const SAYS: [Layout; SAID] = [
    layout::<Kind<DeviceMessage, 0>>(),
    layout::<Kind<DeviceMessage, 1>>(),
    layout::<Kind<DeviceMessage, 2>>(),
    layout::<Kind<DeviceMessage, 3>>(),
    layout::<Kind<DeviceMessage, 4>>(),
    layout::<Kind<DeviceMessage, 5>>(),
    layout::<Kind<DeviceMessage, 6>>(),
    layout::<Kind<DeviceMessage, 7>>(),
    layout::<Kind<DeviceMessage, 8>>(),
];

/// The layouts of a host's messages, in the order of [`HostMessage`]'s kinds. A new kind is the last.
pub const HEARS: [Layout; HEARD] = [
    layout::<Kind<HostMessage, 0>>(),
    layout::<Kind<HostMessage, 1>>(),
    layout::<Kind<HostMessage, 2>>(),
    layout::<Kind<HostMessage, 3>>(),
    layout::<Kind<HostMessage, 4>>(),
];

const _: () = assert!(variants::<DeviceMessage>().len() == SAYS.len());
const _: () = assert!(variants::<HostMessage>().len() == HEARS.len());

/// Hellos that end after so many of this one's fields: from the two lists of layouts on, which are the fourth, to all.
pub(super) const HELLOS: [Layout; 17] = [
    layout::<HelloOf<4>>(),
    layout::<HelloOf<5>>(),
    layout::<HelloOf<6>>(),
    layout::<HelloOf<7>>(),
    layout::<HelloOf<8>>(),
    layout::<HelloOf<9>>(),
    layout::<HelloOf<10>>(),
    layout::<HelloOf<11>>(),
    layout::<HelloOf<12>>(),
    layout::<HelloOf<13>>(),
    layout::<HelloOf<14>>(),
    layout::<HelloOf<15>>(),
    layout::<HelloOf<16>>(),
    layout::<HelloOf<17>>(),
    layout::<HelloOf<18>>(),
    layout::<HelloOf<19>>(),
    layout::<HelloOf<20>>(),
];

// The last is all of it.
const _: () = {
    let (all, last) = (SAYS[0], HELLOS[HELLOS.len() - 1]);
    assert!(all[0] == last[0] && all[1] == last[1] && all[2] == last[2]);
};

const fn layout<T: Schema>() -> Layout {
    let [a, b, c, ..] = hash_ty_path::<T>("proprio");
    [a ^ PROTOCOL, b, c]
}

const fn variants<M: Schema>() -> &'static [&'static NamedVariant] {
    match M::SCHEMA.ty {
        DataModelType::Enum(variants) => variants,
        _ => panic!("messages are an enum"),
    }
}

/// The `N`th kind of `M` alone.
struct Kind<M, const N: usize>(PhantomData<M>);

impl<M: Schema, const N: usize> Kind<M, N> {
    const TYPE: DataModelType = DataModelType::Enum(&[variants::<M>()[N]]);
}

impl<M: Schema, const N: usize> Schema for Kind<M, N> {
    const SCHEMA: &'static NamedType = &NamedType {
        name: "",
        ty: &Self::TYPE,
    };
}

/// The hello's first `N` fields.
struct HelloOf<const N: usize>;

impl<const N: usize> HelloOf<N> {
    const FIELDS: DataModelType = match variants::<DeviceMessage>()[0].ty {
        DataModelVariant::NewtypeVariant(NamedType {
            ty: DataModelType::Struct(fields),
            ..
        }) => DataModelType::Struct(fields.split_at(N).0),
        _ => panic!("the hello is a struct"),
    };
    const VARIANT: NamedVariant = NamedVariant {
        name: variants::<DeviceMessage>()[0].name,
        ty: &DataModelVariant::NewtypeVariant(&NamedType {
            name: "",
            ty: &Self::FIELDS,
        }),
    };
    const TYPE: DataModelType = DataModelType::Enum(&[&Self::VARIANT]);
}

impl<const N: usize> Schema for HelloOf<N> {
    const SCHEMA: &'static NamedType = &NamedType {
        name: "",
        ty: &Self::TYPE,
    };
}

/// How a device's messages differ from this program's. Before its hello they are taken to be the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Peer {
    /// Kinds of its messages that it lacks or has another layout of, bit n for the n-th.
    unread: u16,
    /// Kinds of the host's messages that it lacks or has another layout of.
    unheard: u16,
    /// Its hello ends earlier.
    pub(super) is_short: bool,
}

impl Peer {
    /// What a hello says of it, from behind the kind on.
    pub(super) fn of(hello: &[u8]) -> Result<Self, WireError> {
        let Some((schema, rest)) = hello.split_first_chunk() else {
            return Err(WireError::Malformed);
        };
        if *schema == SCHEMA {
            return Ok(Self::default());
        }
        let incompatible = |firmware| WireError::Incompatible {
            theirs: *schema,
            firmware,
        };
        let (firmware, rest) =
            postcard::take_from_bytes(rest).map_err(|_| incompatible(String::new()))?;
        type Lists = (Vec<Layout, SAID>, Vec<Layout, HEARD>);
        match postcard::take_from_bytes::<Lists>(rest) {
            Ok(((says, hears), _)) if says.first().is_some_and(|its| HELLOS.contains(its)) => {
                Ok(Self::new(&says, &hears))
            }
            _ => Err(incompatible(firmware)),
        }
    }

    fn new(says: &[Layout], hears: &[Layout]) -> Self {
        Self {
            // The hello is read, whichever it is.
            unread: others(says, &SAYS) & !1,
            unheard: others(hears, &HEARS),
            is_short: says.first() != SAYS.first(),
        }
    }

    /// Whether this program reads the `kind`th of the device's messages.
    pub fn says(self, kind: usize) -> bool {
        kind < SAYS.len() && self.unread >> kind & 1 == 0
    }

    /// Whether the device reads the `kind`th of the host's messages, and its answer is read.
    pub fn hears(self, kind: usize) -> bool {
        // Of a request, of the reading of a factor, of a step.
        let answer = match kind {
            1 => Some(4),
            2 => Some(5),
            3 => Some(7),
            _ => None,
        };
        kind < HEARS.len()
            && self.unheard >> kind & 1 == 0
            && answer.is_none_or(|answer| self.says(answer))
    }
}

/// Which of `ours` are not the same in `theirs`, bit n for the n-th.
fn others(theirs: &[Layout], ours: &[Layout]) -> u16 {
    let others = ours.iter().enumerate();
    let others = others.filter(|(n, layout)| theirs.get(*n) != Some(layout));
    others.fold(0, |mask, (n, _)| mask | 1 << n)
}

impl super::Hello {
    /// How its device's messages differ from this program's.
    pub fn peer(&self) -> Peer {
        Peer::new(&self.says, &self.hears)
    }
}

impl HostMessage {
    /// Its kind's place in [`HEARS`].
    pub const fn kind(&self) -> usize {
        match self {
            Self::RequestHello => 0,
            Self::Request(_) => 1,
            Self::ReadFactor(_) => 2,
            Self::Advance(_) => 3,
            Self::Imu(_) => 4,
        }
    }
}
