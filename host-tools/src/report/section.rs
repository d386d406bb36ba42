//! A section: words, plots, a table.

use std::fmt::Write;

use super::data_table::DataTable;
use super::escape;
use super::figure::Figure;

/// A part of the page, made by the functions of the modules beside this one.
#[derive(Default)]
pub struct Section {
    /// Name in the page's address, unique in a page.
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    /// What it shows and how to read it: the program's own words, in HTML.
    pub(super) text: String,
    pub(super) legend: Vec<Key>,
    pub(super) figures: Vec<Figure>,
    pub(super) table: Option<DataTable>,
    /// How many plots stand side by side where there is room.
    pub(super) columns: usize,
    /// What stands between words and plots: the program's own HTML.
    pub(super) html: String,
    /// Whether only its heading shows until a reader opens it.
    pub(super) folded: bool,
}

/// An entry of a legend.
pub(super) struct Key {
    pub(super) label: String,
    /// As a trace's, such as `@measured`.
    pub(super) colour: &'static str,
    pub(super) mark: Mark,
    /// The trace which it shows and hides in every plot of the section, if any.
    pub(super) trace: Option<usize>,
}

impl Key {
    /// An entry of the program's own words.
    pub(super) fn new(label: &str, colour: &'static str, mark: Mark, trace: Option<usize>) -> Self {
        Self {
            label: label.to_owned(),
            colour,
            mark,
            trace,
        }
    }
}

/// How an entry of a legend looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    Solid,
    Dashed,
    Dotted,
    Point,
    Area,
}

impl Mark {
    fn name(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Dashed => "dashed",
            Self::Dotted => "dotted",
            Self::Point => "point",
            Self::Area => "area",
        }
    }
}

impl Section {
    /// Its name in the page's address.
    pub fn id(&self) -> &'static str {
        self.id
    }

    /// Its heading.
    pub fn title(&self) -> &'static str {
        self.title
    }

    pub(super) fn render(&self, to: &mut String) {
        let Self {
            id,
            title,
            text,
            columns,
            ..
        } = self;
        let (open, close) = if self.folded {
            ("<details><summary><h2>", "</h2></summary>")
        } else {
            ("<h2>", "</h2>")
        };
        let _ = write!(
            to,
            "<section id=\"{id}\">\n{open}{title}{close}\n<p class=\"how\">{text}</p>\n{}",
            self.html
        );
        if self.figures.is_empty() && self.table.is_none() && self.html.is_empty() {
            to.push_str("<p class=\"empty\">There is nothing to show here.</p>\n");
        }
        let beside = *columns == 1 && !self.figures.is_empty() && self.table.is_some();
        if beside {
            to.push_str("<div class=\"beside\">\n<div>\n");
        }
        if !self.figures.is_empty() {
            self.render_legend(to);
            let paper = if *columns == 4 { 2 } else { *columns };
            let single = if *columns == 1 { " single" } else { "" };
            let _ = writeln!(
                to,
                "<div class=\"figures{single}\" style=\"--columns:{columns};--paper:{paper}\">"
            );
            for figure in &self.figures {
                figure.render(to);
            }
            to.push_str("</div>\n");
        }
        if beside {
            to.push_str("</div>\n");
        }
        if let Some(table) = &self.table {
            table.render(to);
        }
        if beside {
            to.push_str("</div>\n");
        }
        if self.folded {
            to.push_str("</details>\n");
        }
        to.push_str("</section>\n");
    }

    fn render_legend(&self, to: &mut String) {
        to.push_str("<div class=\"legend\">");
        for key in &self.legend {
            let swatch = format!(
                "<i class=\"{}\" style=\"color:var(--{})\"></i>{}",
                key.mark.name(),
                key.colour.trim_start_matches('@'),
                escape::html(&key.label),
            );
            let _ = match key.trace {
                Some(trace) => write!(
                    to,
                    "<button type=\"button\" data-trace=\"{trace}\" aria-pressed=\"true\" \
                     title=\"show or hide in every plot below\">{swatch}</button>"
                ),
                None => write!(to, "<span>{swatch}</span>"),
            };
        }
        if self.figures.iter().any(|figure| figure.group.is_some()) {
            to.push_str("<button type=\"button\" class=\"whole\">Show all of it</button>");
        }
        to.push_str("</div>\n");
    }
}
