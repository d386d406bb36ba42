//! What a user calls a source: `-`, `sim`, `dds`, `dds:eth0/lowstate`, `FR=/dev/ttyUSB0 FL=/dev/ttyUSB1`.

use proprio_core::go2::Leg;

use crate::name::leg_named;

/// A source as the user names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// Standard input.
    Text,
    /// A topic of a DDS domain.
    Dds(Topic),
    /// Adapters on the motor buses of legs.
    Adapters(Vec<Adapter>),
    /// A simulated robot's motor buses.
    Simulated,
}

/// A serial port that listens to a leg's motor bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// The leg.
    pub leg: Leg,
    /// Name of the port.
    pub port: String,
}

impl Adapter {
    /// What `LEG=PORT` names.
    ///
    /// # Errors
    /// In words: what was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (leg, port) = text
            .split_once('=')
            .filter(|(_, port)| !port.is_empty())
            .ok_or("expected LEG=PORT, such as FR=/dev/ttyUSB0")?;
        let leg = leg_named(leg).map_err(|unknown| unknown.to_string())?;
        let port = port.to_owned();
        Ok(Self { leg, port })
    }
}

/// Where a topic is, and which.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Topic {
    /// The network interface, by name or address; none: the only one.
    pub interface: Option<String>,
    /// Its name, with or without what ROS 2 puts before it (`rt/`); none: the first that is read.
    pub name: Option<String>,
}

impl Address {
    /// The source that these words name together: several are adapters, one each leg.
    pub fn parse(words: &[String]) -> Option<Self> {
        if let [word] = words
            && !word.contains('=')
        {
            return Self::of_word(word);
        }
        let adapters = words.iter().map(|word| Adapter::parse(word).ok());
        let adapters: Vec<Adapter> = adapters.collect::<Option<_>>()?;
        let of = |leg| adapters.iter().filter(|adapter| adapter.leg == leg).count();
        (!adapters.is_empty() && Leg::ALL.into_iter().all(|leg| of(leg) <= 1))
            .then_some(Self::Adapters(adapters))
    }

    fn of_word(text: &str) -> Option<Self> {
        match text {
            "-" => return Some(Self::Text),
            "sim" => return Some(Self::Simulated),
            _ => {}
        }
        let rest = text.strip_prefix("dds")?;
        let (interface, name) = match rest.strip_prefix(':') {
            Some(rest) => match rest.split_once('/') {
                Some((interface, name)) => (interface, name),
                None => (rest, ""),
            },
            None if rest.is_empty() => ("", ""),
            None => ("", rest.strip_prefix('/')?),
        };
        let some = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        Some(Self::Dds(Topic {
            interface: some(interface),
            name: some(name),
        }))
    }
}

impl Topic {
    /// Whether a topic of a domain, called `name` there, is meant.
    #[cfg(any(feature = "dds", test))]
    pub(super) fn is(&self, name: &str) -> bool {
        fn bare(name: &str) -> &str {
            let name = name.strip_prefix('/').unwrap_or(name);
            name.strip_prefix("rt/").unwrap_or(name)
        }
        let asked = self.name.as_deref();
        asked.is_none_or(|asked| bare(asked) == bare(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_named_in_few_ways() {
        let dds = |interface: &str, name: &str| {
            let some = |text: &str| (!text.is_empty()).then(|| text.to_owned());
            Some(Address::Dds(Topic {
                interface: some(interface),
                name: some(name),
            }))
        };
        let adapters = |ports: &[(Leg, &str)]| {
            let adapter = |(leg, port): &(Leg, &str)| Adapter {
                leg: *leg,
                port: (*port).to_owned(),
            };
            Some(Address::Adapters(ports.iter().map(adapter).collect()))
        };
        let table = [
            ("-", Some(Address::Text)),
            ("dds", dds("", "")),
            ("dds:eth0", dds("eth0", "")),
            ("dds:eth0/lowstate", dds("eth0", "lowstate")),
            (
                "dds:192.168.123.5/rt/lowstate",
                dds("192.168.123.5", "rt/lowstate"),
            ),
            ("dds/joint_states", dds("", "joint_states")),
            ("dds:", dds("", "")),
            ("ddsx", None),
            ("/dev/ttyACM0", None),
            ("sim", Some(Address::Simulated)),
            ("FR=/dev/ttyUSB0", adapters(&[(Leg::FR, "/dev/ttyUSB0")])),
            (
                "RL=/dev/ttyUSB1 FL=COM3",
                adapters(&[(Leg::RL, "/dev/ttyUSB1"), (Leg::FL, "COM3")]),
            ),
            ("FR=a FR=b", None),
            ("FR=", None),
            ("XX=/dev/ttyUSB0", None),
            ("FR=/dev/ttyUSB0 sim", None),
            ("sim dds", None),
        ];
        for (text, address) in table {
            let words: Vec<String> = text.split(' ').map(str::to_owned).collect();
            assert_eq!(Address::parse(&words), address, "{text}");
        }
    }

    #[test]
    fn a_topic_is_found_with_the_prefix_of_ros_and_without() {
        let topic = |name: &str| Topic {
            interface: None,
            name: Some(name.to_owned()),
        };
        for name in ["lowstate", "/lowstate", "rt/lowstate"] {
            assert!(topic(name).is("rt/lowstate"), "{name}");
            assert!(!topic(name).is("rt/lf/lowstate"), "{name}");
        }
        assert!(Topic::default().is("rt/joint_states"));
    }
}
