//! Changes to an XML text at the places of its elements; all else stays as it is, byte for byte.

use std::ops::Range;

use roxmltree::Node;

/// Changes to one text, made all at once.
#[derive(Debug)]
pub(super) struct Edits<'a> {
    text: &'a str,
    changes: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self {
            text,
            changes: Vec::new(),
        }
    }

    /// The changed text.
    pub(super) fn apply(mut self) -> String {
        // From the end, so that earlier places stay; of two insertions at one place the first stays first.
        self.changes.reverse();
        self.changes
            .sort_by_key(|(range, _)| std::cmp::Reverse((range.start, range.end)));
        let mut text = self.text.to_owned();
        for (range, new) in self.changes {
            text.replace_range(range, &new);
        }
        text
    }

    /// Gives an attribute a value; it comes after the others if it is new.
    pub(super) fn set(&mut self, node: Node, name: &str, value: &str) {
        match node.attribute_node(name) {
            Some(attribute) => self
                .changes
                .push((attribute.range_value(), value.to_owned())),
            None => {
                let end = self.attributes_end(node);
                self.changes
                    .push((end..end, format!(" {name}=\"{value}\"")));
            }
        }
    }

    /// Puts an attribute in the place of another.
    pub(super) fn replace(&mut self, node: Node, old: &str, name: &str, value: &str) {
        if let Some(attribute) = node.attribute_node(old) {
            self.changes
                .push((attribute.range(), format!("{name}=\"{value}\"")));
        }
    }

    /// Removes an attribute and the space before it.
    pub(super) fn remove(&mut self, node: Node, name: &str) {
        if let Some(attribute) = node.attribute_node(name) {
            let range = attribute.range();
            let start = self.text[..range.start].trim_end().len();
            self.changes.push((start..range.end, String::new()));
        }
    }

    /// Adds an element before the first child element of `parent`, on a line of its own if that child has one.
    pub(super) fn prepend(&mut self, parent: Node, element: &str) {
        let first = parent.children().find(Node::is_element);
        match first {
            Some(child) => {
                let (at, gap) = (child.range().start, self.gap_before(child));
                self.changes.push((at..at, format!("{element}{gap}")));
            }
            None => self.fill(parent, element),
        }
    }

    /// Adds an element after the last child element of `parent`, likewise.
    pub(super) fn append(&mut self, parent: Node, element: &str) {
        match parent.last_element_child() {
            Some(child) => {
                let (at, gap) = (child.range().end, self.gap_before(child));
                self.changes.push((at..at, format!("{gap}{element}")));
            }
            None => self.fill(parent, element),
        }
    }

    /// Puts an element into one that has none.
    fn fill(&mut self, parent: Node, element: &str) {
        let end = self.attributes_end(parent);
        let rest = &self.text[end..parent.range().end];
        let close = end + rest.find('>').unwrap_or(rest.len());
        if self.text[..close].ends_with('/') {
            let name = &self.text[self.tag_name(parent)];
            self.changes
                .push((close - 1..close + 1, format!(">{element}</{name}>")));
        } else {
            self.changes
                .push((close + 1..close + 1, element.to_owned()));
        }
    }

    /// Line end and indentation before a child that begins its line; nothing if it does not.
    fn gap_before(&self, child: Node) -> &'a str {
        let before = &self.text[..child.range().start];
        let indent = before.trim_end_matches([' ', '\t']).len();
        let line = before[..indent]
            .strip_suffix('\n')
            .map(|b| b.strip_suffix('\r').unwrap_or(b));
        line.map_or("", |line| &before[line.len()..])
    }

    /// The name in an element's start tag, with its prefix.
    fn tag_name(&self, node: Node) -> Range<usize> {
        let start = node.range().start + 1;
        let ends = |c: char| c.is_whitespace() || c == '/' || c == '>';
        let length = self.text[start..].find(ends).unwrap_or(0);
        start..start + length
    }

    /// Where the last attribute of a start tag ends, or its name.
    fn attributes_end(&self, node: Node) -> usize {
        let last = node
            .attributes()
            .map(|attribute| attribute.range().end)
            .max();
        last.unwrap_or_else(|| self.tag_name(node).end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `text` after `change` to its element `b`.
    fn changed(text: &str, change: impl FnOnce(&mut Edits, Node)) -> String {
        let document = roxmltree::Document::parse(text).unwrap();
        let mut edits = Edits::new(text);
        let b = document
            .descendants()
            .find(|n| n.has_tag_name("b"))
            .unwrap();
        change(&mut edits, b);
        edits.apply()
    }

    #[test]
    fn attributes_change_in_place() {
        let text = "<a>\r\n <!-- <b> --><b  x = '1'\n  y=\"2\" /></a>";
        let set = |name: &'static str| changed(text, move |e, b| e.set(b, name, "3"));
        assert_eq!(set("x"), text.replace("'1'", "'3'"));
        assert_eq!(set("z"), text.replace("\"2\"", "\"2\" z=\"3\""));
        assert_eq!(
            changed(text, |e, b| e.remove(b, "y")),
            text.replace("\n  y=\"2\"", "")
        );
        let both = changed(text, |e, b| {
            e.remove(b, "y");
            e.set(b, "v", "4");
            e.set(b, "w", "5");
            e.replace(b, "x", "u", "6");
        });
        assert_eq!(
            both,
            "<a>\r\n <!-- <b> --><b  u=\"6\" v=\"4\" w=\"5\" /></a>"
        );
    }

    #[test]
    fn children_keep_the_layout() {
        let lines = "<a>\r\n  <b k='>'>\r\n    <c/> <!-- c -->\r\n  </b>\r\n</a>";
        let appended = changed(lines, |e, b| e.append(b, "<d/>"));
        assert_eq!(appended, lines.replace("<c/>", "<c/>\r\n    <d/>"));
        let prepended = changed(lines, |e, b| e.prepend(b, "<d/>"));
        assert_eq!(prepended, lines.replace("<c/>", "<d/>\r\n    <c/>"));
        assert_eq!(
            changed("<a><b><c/></b></a>", |e, b| e.append(b, "<d/>")),
            "<a><b><c/><d/></b></a>"
        );
        assert_eq!(
            changed("<a><b k='/>' /></a>", |e, b| e.prepend(b, "<d/>")),
            "<a><b k='/>' ><d/></b></a>"
        );
        assert_eq!(
            changed("<a><b></b></a>", |e, b| e.append(b, "<d/>")),
            "<a><b><d/></b></a>"
        );
    }
}
