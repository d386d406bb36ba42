//! Text and numbers from outside, made safe for each language of the page.

use std::borrow::Cow;

/// Text for HTML, between tags and in quoted attributes.
pub fn html(text: &str) -> Cow<'_, str> {
    replaced(text, |c| match c {
        '&' => Some("&amp;"),
        '<' => Some("&lt;"),
        '>' => Some("&gt;"),
        '"' => Some("&quot;"),
        '\'' => Some("&#39;"),
        _ => None,
    })
}

/// Units as texts have them, and what stands after a unit's first word: `N m s/rad`, `N m rms`.
const UNITS: [&str; 18] = [
    "N", "%", "s", "ms", "h", "kg", "g", "mm", "m", "km", "Hz", "rad", "mrad", "rad/s", "rad/s²",
    "A", "W", "°C",
];
const WITHIN_UNITS: [&str; 10] = [
    "m",
    "m²",
    "m^2",
    "m/rad",
    "s/rad",
    "s²/rad²",
    "m/kg",
    "rms",
    "s/m",
    "s²/m²",
];

/// Text of sentences for HTML: lines do not break inside a value, between a number and its unit or after ±.
pub fn prose(text: &str) -> String {
    let mut joined = String::with_capacity(text.len() + 16);
    let (mut before, mut in_unit) = ("", false);
    for (n, word) in text.split(' ').enumerate() {
        let bare = word.trim_end_matches(['.', ',', ';', ':', ')']);
        // `(floor 0.087)` ends a value; `0.087, N` is no unit of it.
        let after_number = before.ends_with(|c: char| c.is_ascii_digit());
        let goes_on = in_unit && WITHIN_UNITS.contains(&bare);
        let is_unit = after_number && UNITS.contains(&bare) || goes_on;
        if n > 0 {
            joined.push(if is_unit || before == "±" {
                '\u{a0}'
            } else {
                ' '
            });
        }
        joined += word;
        (before, in_unit) = (word, is_unit && bare == word);
    }
    html(&joined).into_owned()
}

/// Text for a title, label or name in a plot: Plotly knows tags such as `<b>` and `<a>`, and entities.
pub fn plot(text: &str) -> Cow<'_, str> {
    replaced(text, |c| match c {
        '&' => Some("&amp;"),
        '<' => Some("&lt;"),
        '>' => Some("&gt;"),
        _ => None,
    })
}

/// JSON for a `<script>` element, where neither `</script>` nor `<!--` may occur. Outside strings JSON has no `<`, and
/// inside them the escape means the same.
pub fn json(json: &str) -> Cow<'_, str> {
    replaced(json, |c| (c == '<').then_some("\\u003c"))
}

/// `value` to `digits` significant digits, so that its JSON is short; what is not finite stays, and becomes `null` there.
pub fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(value)
}

fn replaced(text: &str, by: impl Fn(char) -> Option<&'static str>) -> Cow<'_, str> {
    if !text.chars().any(|c| by(c).is_some()) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match by(c) {
            Some(escape) => safe += escape,
            None => safe.push(c),
        }
    }
    Cow::Owned(safe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_value_stays_on_one_line() {
        for (text, expected) in [
            (
                "0.097 ± 0.017 N m s/rad, <b>",
                "0.097 ±_0.017_N_m_s/rad, &lt;b&gt;",
            ),
            (
                "1.27 → 0.065 mm over 20 poses",
                "1.27 → 0.065_mm over 20 poses",
            ),
            ("a 5 s, m of 3 robots", "a 5_s, m of 3 robots"),
            (" 2 %", " 2_%"),
            ("", ""),
        ] {
            assert_eq!(prose(text), expected.replace('_', "\u{a0}"), "{text}");
        }
    }

    #[test]
    fn each_language_has_its_own_escapes() {
        let text = "</script><b onload='x'>\"&amp;\"";
        assert_eq!(
            html(text),
            "&lt;/script&gt;&lt;b onload=&#39;x&#39;&gt;&quot;&amp;amp;&quot;"
        );
        assert_eq!(
            plot(text),
            "&lt;/script&gt;&lt;b onload='x'&gt;\"&amp;amp;\""
        );
        assert_eq!(json("{\"</script>\":1}"), "{\"\\u003c/script>\":1}");
    }

    proptest! {
        #[test]
        fn json_in_a_script_means_the_same(text in ".*") {
            let written = serde_json::to_string(&text).unwrap();
            let embedded = json(&written);
            prop_assert!(!embedded.contains('<'));
            prop_assert_eq!(serde_json::from_str::<String>(&embedded).unwrap(), text);
        }

        #[test]
        fn html_has_no_tag_left(text in ".*") {
            let safe = html(&text);
            prop_assert!(!safe.contains(['<', '>', '"', '\'']));
        }

        #[test]
        fn rounding_keeps_the_digits(value in proptest::num::f64::NORMAL) {
            let error = (rounded(value, 6) - value).abs();
            prop_assert!(error <= 5e-6 * value.abs());
        }
    }

    #[test]
    fn what_is_not_finite_stays_so() {
        assert!(rounded(f64::NAN, 5).is_nan());
        assert_eq!(rounded(f64::NEG_INFINITY, 5), f64::NEG_INFINITY);
    }
}
