//! What a user calls a source: `-`, `dds`, `dds:eth0/lowstate`.

/// A source as the user names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// Standard input.
    Text,
    /// A topic of a DDS domain.
    Dds(Topic),
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
    /// The source that `text` names, if it is `-` or begins as one of DDS does.
    pub fn parse(text: &str) -> Option<Self> {
        if text == "-" {
            return Some(Self::Text);
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
            ("sim", None),
        ];
        for (text, address) in table {
            assert_eq!(Address::parse(text), address, "{text}");
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
