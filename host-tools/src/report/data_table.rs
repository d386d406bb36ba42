//! A table that can be sorted, and filtered where it is long.

use std::fmt::Write;

use super::escape;

/// Rows from which on a table can be filtered.
const LONG: usize = 12;

/// Rows up to which a table stands whole: two models at the 12 joints of a Go2 and over all.
const WHOLE: usize = 26;

/// A table.
pub(super) struct DataTable {
    pub(super) columns: Vec<Column>,
    /// As many cells in each as there are columns.
    pub(super) rows: Vec<Vec<Cell>>,
}

/// A column of a table.
pub(super) struct Column {
    /// The program's own words.
    pub(super) title: &'static str,
    /// Set right.
    pub(super) numeric: bool,
}

impl Column {
    /// A column of words or of numbers.
    pub(super) fn new(title: &'static str, numeric: bool) -> Self {
        Self { title, numeric }
    }
}

/// A cell of a table.
pub(super) struct Cell {
    pub(super) text: String,
    /// What it is sorted by, where that is not its text; what is not finite comes last.
    pub(super) value: Option<f64>,
}

impl Cell {
    /// A cell of words.
    pub(super) fn text(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            value: None,
        }
    }

    /// A cell that shows `text` for a number, with a true minus sign.
    pub(super) fn number(text: impl Into<String>, value: f64) -> Self {
        Self {
            text: text.into().replace('-', "−"),
            value: Some(value),
        }
    }
}

impl DataTable {
    pub(super) fn render(&self, to: &mut String) {
        to.push_str("<div class=\"table\">\n");
        if self.rows.len() >= LONG {
            to.push_str(
                "<label class=\"filter\">Show rows with <input type=\"search\" placeholder=\"FR_hip\" \
                 autocomplete=\"off\" spellcheck=\"false\"> <output></output></label>\n",
            );
        }
        let long = if self.rows.len() > WHOLE { " long" } else { "" };
        let _ = write!(
            to,
            "<div class=\"scroll{long}\" tabindex=\"0\"><table><thead><tr>"
        );
        for column in &self.columns {
            let _ = write!(
                to,
                "<th scope=\"col\"{}><button type=\"button\">{}</button></th>",
                class(column),
                column.title
            );
        }
        to.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            to.push_str("<tr>");
            for (cell, column) in row.iter().zip(&self.columns) {
                let value = match cell.value {
                    Some(value) if value.is_finite() => format!(" data-value=\"{value:e}\""),
                    Some(_) => " data-value=\"\"".to_owned(),
                    None => String::new(),
                };
                let text = escape::html(&cell.text);
                let _ = write!(to, "<td{}{value}>{text}</td>", class(column));
            }
            to.push_str("</tr>\n");
        }
        to.push_str("</tbody></table></div>\n</div>\n");
    }
}

fn class(column: &Column) -> &'static str {
    if column.numeric {
        " class=\"number\""
    } else {
        ""
    }
}
