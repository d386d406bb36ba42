//! Every message there and back, the largest, damage, arbitrary bytes.

use proptest::prelude::*;

use super::*;

fn receive<M: Message>(
    receiver: &mut Receiver<M>,
    bytes: &[u8],
) -> std::vec::Vec<Result<M, WireError>> {
    bytes
        .iter()
        .filter_map(|&byte| receiver.push(byte))
        .collect()
}

fn hello() -> Hello {
    Hello {
        schema: SCHEMA,
        says: Vec::from_array(SAYS),
        hears: Vec::from_array(HEARS),
        firmware: String::try_from("12345678901234567890").unwrap(),
        board: String::try_from("12345678901234567890").unwrap(),
        capacities: Capacities {
            legs: 255,
            joints_per_leg: 255,
            inertial_parameters: 255,
            effect_parameters: 255,
            window_us: u32::MAX,
            scalar_bits: 255,
        },
        load_unit: String::try_from("1234567890123456").unwrap(),
        git: String::try_from("1234567890123456").unwrap(),
        reset: Reset::BrownOut,
        brown_out_level: Some(255),
        clock: Clock::Internal,
        crash: String::try_from(
            [b'x'; 64]
                .map(char::from)
                .iter()
                .collect::<std::string::String>()
                .as_str(),
        )
        .unwrap(),
        listens_to: 255,
        carried: true,
        zeros: [[Zero::Exchanged; JOINTS_PER_LEG]; LEGS],
        wiring: [Wiring::Fault(Fault::Velocity {
            joint: 255,
            per_mille: i16::MIN,
        }); LEGS],
        kept: Kept::OfAnother,
        effects: core::array::from_fn::<_, MAX_EFFECTS, _>(|_| {
            String::try_from("12345678901234567890").unwrap()
        })
        .into_iter()
        .collect(),
        setup: Setup {
            imu_at: [i16::MIN; 3],
            imu_turned: [i16::MIN; 3],
            bus_baud: u32::MAX,
        },
        setup_in_use: true,
    }
}

const AT: EffectAt = EffectAt {
    leg: 255,
    joint: 255,
    effect: 255,
};

const READ: ReadFactor = ReadFactor {
    copy: u32::MAX,
    leg: 255,
    fold: 255,
    joint: 255,
    first: u16::MAX,
};

/// Every message with every field as long as it gets.
fn largest() -> [DeviceMessage; 9] {
    let full = Parameters::from_slice(&[f32::MIN; MAX_PARAMETERS]).unwrap();
    let m = u32::MAX;
    let leg = LegCounters {
        commands: m,
        replies: m,
        bad_crc: m,
        short: m,
        skipped_bytes: m,
        lost_bytes: m,
        unheard_bytes: m,
        unused_replies: m,
        incomplete: m,
        motor_faults: m,
        overheated: m,
        stuck: m,
        temperatures: [i8::MIN; 3],
        surplus: m,
        samples: m,
        unplaced: m,
        tried: m,
        used: m,
        late: m,
        rejected: m,
        gaps: m,
        windows: m,
        unfolded: m,
        changes: m,
        forgotten: m,
        carried: m,
        unsolved: m,
    };
    let line = LineLosses {
        overruns: m,
        errors: m,
    };
    let load = Load {
        ticks: m,
        over_budget: m,
        worst: m,
        total: u64::MAX,
        stack_bytes: m,
    };
    [
        DeviceMessage::Hello(hello()),
        DeviceMessage::Estimate(Estimate {
            leg: 255,
            time_us: u64::MAX,
            windows: m,
            effects: [m; 3],
            solution: Solution::Consistent,
            values: full.clone(),
            std: full,
            noise: [f32::MIN; 3],
        }),
        DeviceMessage::Counters(Counters {
            time_us: u64::MAX,
            legs: [leg; LEGS],
            host_frames_bad: m,
            host_frames_missed: m,
            frames_dropped: m,
            buses: [line; LEGS],
            host_line: line,
            imu: line,
            load,
            snapshots: m,
            snapshots_failed: m,
        }),
        DeviceMessage::Diagnosis(Diagnosis {
            at: AT,
            active: true,
            windows: m,
            gain: f32::MIN,
            gain_error: f32::MIN,
            value: f32::MIN,
            std: f32::MIN,
        }),
        DeviceMessage::Answer(Answer {
            id: m,
            outcome: Outcome::NoStorage,
        }),
        DeviceMessage::FactorPart(FactorPart {
            read: READ,
            windows: f64::MIN,
            length: u16::MAX,
            numbers: Vec::from_slice(&[f64::MIN; MAX_PART]).unwrap(),
        }),
        DeviceMessage::Change(Change {
            leg: 255,
            joint: 255,
            kind: ChangeKind::Load,
            size: f32::MIN,
            since_us: u64::MAX,
            time_us: u64::MAX,
        }),
        DeviceMessage::Advanced(Advanced { time_us: u64::MAX }),
        DeviceMessage::Walk(Walk {
            time_us: u64::MAX,
            equations: m,
            noise: f32::MIN,
            mass: [f32::MIN; 2],
            trunk: [f32::MIN; 10],
            acc_bias: [f32::MIN; 3],
            effects: [[f32::MIN; 4]; 12],
            counts: WalkCounts {
                samples: m,
                repeated: m,
                late: m,
                rejected: m,
                gaps: m,
                windows: m,
                equations: m,
                cut: m,
                impact: m,
                singular: m,
                unfolded: m,
                judged: m,
                air: [m; 4],
                without_imu: m,
            },
        }),
    ]
}

#[test]
fn the_largest_messages_fit_and_come_back() {
    let (mut sender, mut receiver) = (Sender::default(), Receiver::default());
    let mut buffer = [0; MAX_FRAME];
    for message in largest() {
        let bytes = sender.encode(&message, &mut buffer);
        assert_eq!(receive(&mut receiver, bytes), [Ok(message)]);
    }
    assert_eq!((receiver.bad(), receiver.missed()), (0, 0));
}

#[test]
fn a_device_of_another_schema_is_refused() {
    let mut theirs = SCHEMA;
    theirs[3] ^= 1;
    let mut message = hello();
    message.schema = theirs;
    message.says[0][0] ^= 1;
    let message = DeviceMessage::Hello(message);
    let mut buffer = [0; MAX_FRAME];
    let bytes = Sender::default().encode(&message, &mut buffer);
    let got = receive(&mut Receiver::<DeviceMessage>::default(), bytes);
    let firmware = hello().firmware;
    assert_eq!(got, [Err(WireError::Incompatible { theirs, firmware })]);
    let said = std::string::ToString::to_string(&got[0].as_ref().unwrap_err());
    assert!(said.contains("12345678901234567890"), "{said}");
    assert!(said.contains(env!("CARGO_PKG_VERSION")), "{said}");
}

/// A message's bytes without its frame.
fn content_of<V: Serialize>(message: &V) -> std::vec::Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    postcard::to_slice(message, &mut buffer).unwrap().to_vec()
}

/// What a receiver makes of messages, whose frames are the test's own.
fn heard(
    contents: &[std::vec::Vec<u8>],
) -> (
    Receiver<DeviceMessage>,
    std::vec::Vec<Result<DeviceMessage, WireError>>,
) {
    let mut receiver = Receiver::default();
    let mut got = std::vec::Vec::new();
    for (n, content) in (0u16..).zip(contents) {
        let mut plain = content_of(&n);
        plain.extend(content);
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&plain);
        plain.extend(crc.to_le_bytes());
        let mut frame = [0; MAX_FRAME + 8];
        let length = cobs::encode(&plain, &mut frame);
        got.extend(receive(&mut receiver, &frame[..=length]));
    }
    (receiver, got)
}

/// A device that was built before `Walk` was a message, and when diagnoses and requests were others, is read but for these.
#[test]
fn of_an_older_device_is_read_what_has_not_changed() {
    let mut older = hello();
    older.schema[0] ^= 1;
    older.says.pop();
    older.says[3][1] ^= 1;
    older.hears[1][2] ^= 1;
    let [_, estimate, counters, diagnosis, .., walk] = largest();
    let told = [
        DeviceMessage::Hello(older.clone()),
        estimate.clone(),
        diagnosis,
        counters.clone(),
        walk,
    ];
    let (receiver, got) = heard(&told.each_ref().map(content_of));
    let other = Err(WireError::OtherLayout);
    let expected = [
        Ok(DeviceMessage::Hello(older.clone())),
        Ok(estimate),
        other.clone(),
        Ok(counters),
        other,
    ];
    assert_eq!(got, expected);
    // Nothing was damaged or lost.
    assert_eq!((receiver.bad(), receiver.missed()), (0, 0));
    let peer = receiver.peer();
    assert_eq!(peer, older.peer());
    let unread: std::vec::Vec<usize> = (0..SAYS.len()).filter(|n| !peer.says(*n)).collect();
    let unheard: std::vec::Vec<usize> = (0..HEARS.len()).filter(|n| !peer.hears(*n)).collect();
    assert_eq!((unread, unheard), (std::vec![3, 8], std::vec![1]));
    // A host does not ask what it will not be answered.
    older.says[5][0] ^= 1;
    assert!(!older.peer().hears(2));
    assert_eq!(hello().peer(), Peer::default());
}

/// An older hello ends earlier: what it does not say is not known. Any other hello is refused.
#[test]
fn a_hello_that_ends_earlier_is_read() {
    let whole = DeviceMessage::Hello(hello());
    let length = content_of(&whole).len();
    let Hello {
        setup,
        effects,
        wiring,
        ..
    } = hello();
    // Without what it is set up for, without the effects as well, and without the wiring.
    let setup = content_of(&setup).len() + 1;
    let effects = setup + content_of(&effects).len();
    let wiring = effects + content_of(&wiring).len();
    for (fields, lacks) in [(18, setup), (17, effects), (16, wiring)] {
        let mut older = hello();
        older.schema[0] ^= 1;
        older.says[0] = layout::HELLOS[fields - 4];
        let mut bytes = content_of(&DeviceMessage::Hello(older.clone()));
        bytes.truncate(length - lacks);
        (older.setup, older.setup_in_use) = (Setup::default(), false);
        if fields < 18 {
            older.effects.clear();
        }
        if fields == 16 {
            older.wiring = [Wiring::Untested; LEGS];
        }
        let (_, got) = heard(&[bytes]);
        assert_eq!(got, [Ok(DeviceMessage::Hello(older.clone()))]);
        // Of another layout, with the same bytes.
        older.says[0][2] ^= 1;
        let (receiver, got) = heard(&[content_of(&DeviceMessage::Hello(older))]);
        assert!(
            matches!(got[..], [Err(WireError::Incompatible { .. })]),
            "{got:?}"
        );
        assert_eq!(receiver.bad(), 1);
    }
}

/// The lists of layouts have the messages' order.
#[test]
fn each_kind_has_its_place() {
    for (n, message) in largest().iter().enumerate() {
        assert_eq!(content_of(message)[0], n as u8);
    }
    for message in [
        HostMessage::RequestHello,
        request(0, Action::Reset),
        HostMessage::ReadFactor(READ),
    ] {
        assert_eq!(content_of(&message)[0], message.kind() as u8);
    }
    let all: std::collections::BTreeSet<_> = SAYS.iter().chain(&HEARS).collect();
    assert_eq!(all.len(), SAYS.len() + HEARS.len());
}

#[test]
fn a_change_of_layout_changes_the_schema() {
    #[derive(Schema)]
    #[allow(dead_code)]
    struct Swapped {
        bytes: [u32; LEGS],
        time_us: u64,
    }
    assert_ne!(hash_ty_path::<Advance>(""), hash_ty_path::<Swapped>(""));
}

#[test]
fn a_frame_that_never_came_is_counted() {
    let (mut sender, mut receiver) = (Sender::default(), Receiver::default());
    let mut buffer = [0; MAX_FRAME];
    for n in 0..20 {
        let bytes = sender.encode(&HostMessage::RequestHello, &mut buffer);
        if n % 5 != 2 {
            assert_eq!(
                receive(&mut receiver, bytes),
                [Ok(HostMessage::RequestHello)]
            );
        }
    }
    assert_eq!((receiver.bad(), receiver.missed()), (0, 4));
}

fn host_message() -> impl Strategy<Value = HostMessage> {
    let at = any::<(u8, u8, u8)>().prop_map(|(leg, joint, effect)| EffectAt { leg, joint, effect });
    prop_oneof![
        advance(),
        (any::<u32>(), at.clone()).prop_map(|(id, at)| request(id, Action::AddEffect(at))),
        (any::<u32>(), at).prop_map(|(id, at)| request(id, Action::DropEffect(at))),
        any::<u32>().prop_map(|id| request(id, Action::Reset)),
        any::<(u32, u32)>().prop_map(|(id, s)| request(id, Action::SetMemory(s))),
        prop::array::uniform6(-50.0..50.0f32).prop_map(|[a, b, c, d, e, f]| {
            HostMessage::Imu(Imu {
                gyro: [a, b, c],
                acc: [d, e, f],
            })
        }),
        any::<(u32, u16)>().prop_map(|(copy, first)| HostMessage::ReadFactor(ReadFactor {
            copy,
            first,
            ..READ
        })),
    ]
}

fn request(id: u32, action: Action) -> HostMessage {
    HostMessage::Request(Request { id, action })
}

fn advance() -> impl Strategy<Value = HostMessage> {
    any::<(u64, [u32; 4])>()
        .prop_map(|(time_us, bytes)| HostMessage::Advance(Advance { time_us, bytes }))
}

proptest! {
    #[test]
    fn damage_costs_one_frame_and_is_counted(
        messages in proptest::collection::vec(host_message(), 3..10), at: prop::sample::Index, flip in 1u8..
    ) {
        let (mut sender, mut receiver) = (Sender::default(), Receiver::default());
        let mut buffer = [0; MAX_FRAME];
        for (n, message) in messages.iter().enumerate() {
            let mut bytes = sender.encode(message, &mut buffer).to_vec();
            if n == 1 {
                // The closing zero stays, or the next frame's opening zero ends this one all the same.
                let at = at.index(bytes.len());
                bytes[at] ^= flip;
                let got = receive(&mut receiver, &bytes);
                prop_assert!(got.iter().all(Result::is_err));
            } else if n == 2 {
                let got = receive(&mut receiver, &bytes);
                prop_assert_eq!(got.last(), Some(&Ok(*message)));
            } else {
                prop_assert_eq!(receive(&mut receiver, &bytes), [Ok(*message)]);
            }
        }
        prop_assert_eq!(receiver.missed() > 0, receiver.bad() > 0);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_bytes_panic(bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0)], 0..3000)) {
        receive(&mut Receiver::<DeviceMessage>::default(), &bytes);
        receive(&mut Receiver::<HostMessage>::default(), &bytes);
    }

    #[test]
    fn no_content_with_a_good_checksum_panics(content in proptest::collection::vec(any::<u8>(), 0..300)) {
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&content).to_le_bytes();
        let mut frame = [0; MAX_FRAME];
        let plain: std::vec::Vec<u8> = content.iter().copied().chain(crc).collect();
        let length = cobs::encode(&plain, &mut frame);
        receive(&mut Receiver::<DeviceMessage>::default(), &frame[..=length]);
        receive(&mut Receiver::<HostMessage>::default(), &frame[..=length]);
    }
}
