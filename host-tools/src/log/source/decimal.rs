//! Plain decimals, as nearly all numbers of a log are written.

/// Powers of ten that a double holds exactly, as far as [`LONGEST`] digits need them.
const POWERS: [f64; LONGEST + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17,
];
/// Digits and point of the longest that is read here.
const LONGEST: usize = 17;

/// The double nearest to a decimal without an exponent; `None` if it is something else or has too many digits to be told so.
///
/// Digits below 2⁵³ and powers of ten up to 10²² are doubles, so that their quotient is rounded once (Clinger 1990, *How to read
/// floating point numbers accurately*, PLDI, §4).
pub(super) fn decimal(text: &[u8]) -> Option<f64> {
    let (digits, is_negative) = match text {
        [b'-', digits @ ..] => (digits, true),
        digits => (digits, false),
    };
    if digits.len() > LONGEST {
        return None;
    }
    let mut mantissa = 0u64;
    // Digits up to the first byte that is none; how many.
    let mut take = |bytes: &[u8]| {
        let mut taken = 0;
        for byte in bytes {
            let digit = byte.wrapping_sub(b'0');
            if digit > 9 {
                break;
            }
            mantissa = 10 * mantissa + u64::from(digit);
            taken += 1;
        }
        taken
    };
    let whole = take(digits);
    let parts = match &digits[whole..] {
        [] => 0,
        [b'.', parts @ ..] if take(parts) == parts.len() => parts.len(),
        _ => return None,
    };
    let count = whole + parts;
    if count == 0 || mantissa >= 1 << 53 {
        return None;
    }
    let value = mantissa as f64 / POWERS[parts];
    Some(if is_negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// To the last bit what the standard library reads.
        #[test]
        fn a_decimal_is_read_exactly(text in "-?[0-9]{0,10}\\.?[0-9]{0,10}") {
            if let Some(value) = decimal(text.as_bytes()) {
                prop_assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits());
            }
        }

        #[test]
        fn anything_else_is_left_to_others(text in "[-+.0-9eEinfa ]{0,20}") {
            if let Some(value) = decimal(text.as_bytes()) {
                prop_assert_eq!(Ok(value), text.parse::<f64>());
            }
        }
    }

    #[test]
    fn logs_numbers_are_read_here() {
        for text in ["0", "-0.05008644", "12.", ".5", "-1.687046", "3600.001999"] {
            assert_eq!(decimal(text.as_bytes()), text.parse().ok(), "{text}");
        }
        for text in [
            "",
            "-",
            ".",
            "1e3",
            "1,5",
            " 1",
            "nan",
            "123456789012345678",
        ] {
            assert_eq!(decimal(text.as_bytes()), None, "{text}");
        }
    }
}
