//! The file: header, sections, style, script.

use std::fmt::{self, Write};
use std::path::Path;

use super::{Section, escape, library};
use crate::output::{self, WriteError};
use crate::summary::POINTS;

/// A report.
#[derive(Default)]
pub struct Page {
    /// What stands first.
    pub header: Header,
    /// The rest, in reading order.
    pub sections: Vec<Section>,
}

/// What a reader must know before the plots.
#[derive(Debug, Clone, Default)]
pub struct Header {
    /// Heading, such as "Model against measurement".
    pub title: String,
    /// What matters most, in one line.
    pub headline: String,
    /// What was found, a point each. The first three are seen at once.
    pub findings: Vec<Finding>,
    /// What to run next, a command a line.
    pub next: Vec<String>,
    /// The robot, as the page draws it.
    pub drawing: Drawing,
    /// The command line that made the page.
    pub command: String,
    /// The logs.
    pub logs: Vec<LogFile>,
}

/// A point of what was found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Finding {
    /// A plain sentence.
    pub text: String,
    /// Where the page shows it.
    pub moment: Option<Moment>,
}

/// A moment in a joint's plot over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Name of the joint.
    pub joint: String,
    /// On the plot's axis, s.
    pub time: f64,
}

impl From<String> for Finding {
    fn from(text: String) -> Self {
        Self { text, moment: None }
    }
}

/// A drawing of a robot, made by [`pages`](super::pages): the program's own HTML, in which every name is escaped.
#[derive(Debug, Clone, Default)]
pub struct Drawing(pub(super) String);

/// A log that a report is about.
#[derive(Debug, Clone)]
pub struct LogFile {
    /// Its path as given.
    pub path: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

impl Page {
    /// The same with only the header and the sections' headings to be seen until a reader opens one.
    pub(super) fn folded(mut self) -> Self {
        for section in &mut self.sections {
            section.folded = true;
        }
        self
    }

    /// Writes the page to `path`, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        let page = self.html().map_err(|source| WriteError {
            path: path.to_owned(),
            source,
        })?;
        output::write(path, &page)
    }

    /// The page as one HTML document.
    ///
    /// # Errors
    /// If the plotting library that comes with the program cannot be unpacked.
    pub fn html(&self) -> std::io::Result<String> {
        let plots = self
            .sections
            .iter()
            .any(|section| !section.figures.is_empty());
        let library = if plots {
            library::packed()?
        } else {
            String::new()
        };
        let mut page = String::with_capacity(library.len() + (1 << 20));
        // Without a policy a name that slipped through could still call home.
        let _ = write!(
            page,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
             style-src 'unsafe-inline'; img-src data: blob:\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"generator\" content=\"proprio {}\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
            env!("CARGO_PKG_VERSION"),
            escape::html(&self.header.title),
            include_str!("style.css"),
        );
        let _ = write!(page, "{}", self.header);
        self.render_contents(&mut page);
        page.push_str("<main>\n");
        for section in &self.sections {
            section.render(&mut page);
        }
        page.push_str("</main>\n<footer>Made by proprio; plots by Plotly.js (MIT licence). The page asks no network for anything.</footer>\n");
        if plots {
            let _ = writeln!(
                page,
                "<script type=\"text/plain\" id=\"library\">{library}</script>"
            );
        }
        let _ = write!(
            page,
            "<script>\n{}</script>\n<script>\n{}</script>\n</body>\n</html>\n",
            include_str!("choices.js"),
            include_str!("script.js")
        );
        Ok(page)
    }

    fn render_contents(&self, to: &mut String) {
        to.push_str("<nav aria-label=\"contents\">");
        for section in &self.sections {
            let _ = write!(to, "<a href=\"#{}\">{}</a>", section.id, section.title);
        }
        to.push_str("</nav>\n<noscript><p class=\"failed\">The plots need JavaScript; the tables do not.</p></noscript>\n");
    }
}

/// In HTML.
impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "<header>\n<button type=\"button\" id=\"theme\" hidden>Dark</button>\n<h1>{}</h1>\n",
            escape::html(&self.title)
        )?;
        f.write_str("<div class=\"first\">\n<div>\n")?;
        if !self.headline.is_empty() {
            writeln!(
                f,
                "<p class=\"headline\">{}</p>",
                escape::prose(&self.headline)
            )?;
        }
        let (first, rest) = self.findings.split_at(self.findings.len().min(POINTS));
        write_points(f, first)?;
        for (n, command) in self.next.iter().enumerate() {
            write!(
                f,
                "<div class=\"next\"><code id=\"next-{n}\">{}</code> <button type=\"button\" data-copy=\"next-{n}\">Copy</button></div>",
                escape::html(command)
            )?;
        }
        writeln!(f, "</div>\n{}</div>", self.drawing.0)?;
        f.write_str("<details><summary>More findings, command, logs</summary>\n")?;
        write_points(f, rest)?;
        write!(
            f,
            "<dl>\n<dt>Command</dt><dd><code>{}</code></dd>\n<dt>Version</dt><dd>proprio {}</dd>\n",
            escape::html(&self.command),
            env!("CARGO_PKG_VERSION"),
        )?;
        for log in &self.logs {
            writeln!(
                f,
                "<dt>Log</dt><dd>{}<br><code class=\"hash\">SHA-256 {}</code></dd>",
                escape::html(&log.path),
                escape::html(&log.sha256)
            )?;
        }
        writeln!(f, "</dl>\n</details>\n</header>")
    }
}

fn write_points(f: &mut fmt::Formatter<'_>, points: &[Finding]) -> fmt::Result {
    if points.is_empty() {
        return Ok(());
    }
    f.write_str("<ul class=\"findings\">\n")?;
    for point in points {
        write!(f, "<li>{}", escape::prose(&point.text))?;
        if let Some(Moment { joint, time }) = &point.moment {
            let joint = escape::html(joint);
            write!(
                f,
                " <a class=\"moment\" href=\"#torque\" data-joint=\"{joint}\" data-time=\"{time}\">Plot of {joint} at {time:.1} s</a>"
            )?;
        }
        f.write_str("</li>\n")?;
    }
    f.write_str("</ul>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_outside_is_text_in_the_page() {
        let evil = "</script><img src=x onerror=alert(1)>";
        let page = Page {
            header: Header {
                title: evil.to_owned(),
                findings: vec![Finding {
                    text: evil.to_owned(),
                    moment: Some(Moment {
                        joint: evil.to_owned(),
                        time: 1.0,
                    }),
                }],
                command: evil.to_owned(),
                headline: evil.to_owned(),
                next: vec![evil.to_owned()],
                logs: vec![LogFile {
                    path: evil.to_owned(),
                    sha256: evil.to_owned(),
                }],
                ..Header::default()
            },
            sections: Vec::new(),
        };
        let html = page.html().unwrap();
        assert!(!html.contains("<img"));
        assert_eq!(html.matches(&*escape::html(evil)).count(), 10);
    }
}
