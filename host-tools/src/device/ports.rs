//! Serial ports, and what is likely behind them.

use serde::Serialize;
use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

use super::serial::BUS_BAUD;

/// What a port is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// The host link of a board: `proprio monitor PORT`.
    Board,
    /// An adapter that is fast enough for the motor bus: `proprio capture PORT`.
    Bus,
    /// An adapter that is too slow for it.
    TooSlow,
    /// Nobody knows.
    Unknown,
}

/// A port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Port {
    /// Its name.
    pub port: String,
    /// What it is likely good for.
    pub likely: Use,
    /// Why.
    pub why: String,
}

/// A maker's number, a product's, what that is, and bits per second at most; 0 for a board's own link.
type Chip = (u16, u16, &'static str, u32);

/// Chips that are met on such cables, with their data sheets' greatest rates.
const CHIPS: [Chip; 16] = [
    (0x0483, 0x374b, "ST-LINK/V2-1 of a NUCLEO", 0),
    (0x0483, 0x3752, "ST-LINK/V2-1 of a NUCLEO", 0),
    (0x0483, 0x374e, "ST-LINK/V3 of a NUCLEO", 0),
    (0x0483, 0x374f, "ST-LINK/V3 of a NUCLEO", 0),
    (0x0483, 0x3753, "ST-LINK/V3 of a NUCLEO", 0),
    (0x0483, 0x3754, "ST-LINK/V3 of a NUCLEO", 0),
    (0x0403, 0x6001, "FTDI FT232R", 3_000_000),
    (0x0403, 0x6010, "FTDI FT2232H", 12_000_000),
    (0x0403, 0x6011, "FTDI FT4232H", 12_000_000),
    (0x0403, 0x6014, "FTDI FT232H", 12_000_000),
    (0x0403, 0x6015, "FTDI FT-X", 3_000_000),
    (0x1a86, 0x7523, "WCH CH340", 2_000_000),
    (0x1a86, 0x55d3, "WCH CH343", 6_000_000),
    (0x1a86, 0x55d5, "WCH CH344", 6_000_000),
    (0x1a86, 0x55d4, "WCH CH9102", 4_000_000),
    (0x10c4, 0xea60, "Silicon Labs CP210x", 3_000_000),
];

/// The ports of this machine, the most likely first.
///
/// # Errors
/// The operating system's.
pub fn available() -> serialport::Result<Vec<Port>> {
    let mut ports: Vec<Port> = serialport::available_ports()?.iter().map(judge).collect();
    ports.sort_by(|a, b| (a.likely as u8, &a.port).cmp(&(b.likely as u8, &b.port)));
    Ok(ports)
}

/// What is likely behind a port.
pub fn judge(info: &SerialPortInfo) -> Port {
    let (likely, why) = match &info.port_type {
        SerialPortType::UsbPort(usb) => of_usb(usb),
        SerialPortType::BluetoothPort => (Use::Unknown, "Bluetooth".to_owned()),
        SerialPortType::PciPort => (Use::Unknown, "a port of the machine itself".to_owned()),
        SerialPortType::Unknown => (Use::Unknown, "not a USB device".to_owned()),
    };
    Port {
        port: info.port_name.clone(),
        likely,
        why,
    }
}

fn of_usb(usb: &UsbPortInfo) -> (Use, String) {
    let chip = CHIPS
        .iter()
        .find(|(vid, pid, ..)| (*vid, *pid) == (usb.vid, usb.pid));
    let id = format!("USB {:04x}:{:04x}", usb.vid, usb.pid);
    match chip {
        Some((.., name, 0)) => (Use::Board, format!("{name}: a board's host link ({id})")),
        Some((.., name, most)) => {
            let megabits = *most as f64 * 1e-6;
            let bus = f64::from(BUS_BAUD) * 1e-6;
            match *most >= BUS_BAUD {
                true => (
                    Use::Bus,
                    format!("{name}: {megabits} Mbit/s, the motor bus has {bus} ({id})"),
                ),
                false => (
                    Use::TooSlow,
                    format!("{name}: {megabits} Mbit/s at most, the motor bus has {bus} ({id})"),
                ),
            }
        }
        None => {
            let product = usb.product.as_deref().unwrap_or("an unknown device");
            (Use::Unknown, format!("{product} ({id})"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_judged_by_its_chip() {
        let port = |vid, pid| {
            let usb = UsbPortInfo {
                vid,
                pid,
                serial_number: None,
                manufacturer: None,
                product: Some("Thing".to_owned()),
            };
            judge(&SerialPortInfo {
                port_name: "/dev/ttyX".to_owned(),
                port_type: SerialPortType::UsbPort(usb),
            })
        };
        assert_eq!(port(0x0483, 0x374e).likely, Use::Board);
        assert_eq!(port(0x0403, 0x6014).likely, Use::Bus);
        assert_eq!(port(0x1a86, 0x55d4).likely, Use::Bus);
        let slow = port(0x1a86, 0x7523);
        assert_eq!(slow.likely, Use::TooSlow);
        assert!(slow.why.contains("2 Mbit/s at most"), "{}", slow.why);
        let other = port(0x1234, 0x5678);
        assert_eq!(
            (other.likely, other.why.as_str()),
            (Use::Unknown, "Thing (USB 1234:5678)")
        );
    }
}
