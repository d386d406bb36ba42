//! Plotly.js as it travels in the page: compressed, a third of its size.

use std::io::{self, Write};
use std::sync::OnceLock;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;

/// Plotly.js' source, from the crate.
fn source() -> &'static str {
    static SOURCE: OnceLock<String> = OnceLock::new();
    // The crate hands out script elements: Plotly.js, then MathJax, which no label of ours needs.
    let elements = SOURCE.get_or_init(plotly::Plot::offline_js_sources);
    let script = elements.split("</script>").next().unwrap_or_default();
    script.split_once('>').map_or("", |(_tag, source)| source)
}

/// The gzip stream of the source in base64, which the page's script unpacks.
///
/// # Errors
/// None that memory can give.
pub(super) fn packed() -> io::Result<String> {
    pack(source().as_bytes())
}

/// Bytes as they travel in the page: their gzip stream in base64.
///
/// # Errors
/// None that memory can give.
pub(super) fn pack(bytes: &[u8]) -> io::Result<String> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    Ok(STANDARD.encode(encoder.finish()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_plotly_and_nothing_else() {
        assert!(
            source().starts_with("/**\n* plotly.js v"),
            "{}",
            &source()[..40]
        );
        assert!(!source().contains("MathJax.loader"));
        assert!(source().len() > 1_000_000);
    }

    #[test]
    fn it_unpacks_to_the_source() {
        let gzip = STANDARD.decode(packed().unwrap()).unwrap();
        let text = io::read_to_string(flate2::read::GzDecoder::new(&gzip[..])).unwrap();
        assert!(text == source());
    }
}
