//! Elements of a BSDF file with their texts and positions; the text of values stays in the source.

use super::about::ROOT;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::Source;
use crate::formats::xml::{self, Room, Root, Visitor};
use std::ops::Range;

/// Upper bound on the number of XML elements. Raising it accepts files with more bands and more rings of patches.
const MAX_ELEMENTS: usize = 1 << 16;
/// Upper bound on the bytes of text that an element keeps; longer text is in the source alone. Raising it keeps more.
const MAX_TEXT: usize = 4096;

/// Element of an XML document, by its name without a namespace prefix.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) name: String,
    /// Attribute `unit`; empty if there is none.
    pub(super) unit: String,
    /// Byte offset of the element in the source.
    pub(super) offset: usize,
    /// Own text of the element, without blanks around it; empty if it is long.
    pub(super) text: String,
    /// Bytes of the source between the element's tags.
    pub(super) content: Range<usize>,
    pub(super) children: Vec<Self>,
}

impl Element {
    /// Returns the first child of this name, ignoring ASCII case.
    pub(super) fn child(&self, name: &str) -> Option<&Self> {
        self.children_of(name).next()
    }

    pub(super) fn children_of(&self, name: &str) -> impl Iterator<Item = &Self> {
        self.children.iter().filter(move |child| child.name.eq_ignore_ascii_case(name))
    }

    /// Returns the text of the first child of this name; empty if there is none.
    pub(super) fn text_of(&self, name: &str) -> &str {
        self.child(name).map_or("", |child| &child.text)
    }
}

/// Returns the root element of a source, with all others in it.
pub(super) fn root(source: &Source, report: &mut ParseReport) -> Result<Element, FormatError> {
    let mut tree = Tree { source, open: vec![Element::default()], count: 0 };
    xml::walk(source, &Root { is: |name| name == ROOT, expected: ROOT }, report, &mut tree)?;
    let root = tree.open.pop().and_then(|mut document| document.children.pop());
    root.ok_or_else(|| source.malformed(0, format!("no element, expected {ROOT}")))
}

/// Elements that were read so far.
struct Tree<'a> {
    source: &'a Source,
    /// Elements that are open, outermost first, behind one that stands for the document.
    open: Vec<Element>,
    count: usize,
}

impl Visitor for Tree<'_> {
    fn open(&mut self, element: &xml::Element<'_>) -> Result<Room, FormatError> {
        self.count += 1;
        if self.count > MAX_ELEMENTS {
            let message = format!("more than {MAX_ELEMENTS} XML elements");
            return Err(self.source.error(FormatErrorKind::OverLimit, element.offset, message));
        }
        let short = |text: &str| text.chars().take(80).collect();
        self.open.push(Element {
            name: short(element.name),
            unit: short(&element.attribute("unit").unwrap_or_default()),
            offset: element.offset,
            ..Element::default()
        });
        Ok(Room { bytes: MAX_TEXT, is_strict: false })
    }

    fn content(&mut self, bytes: Range<usize>) {
        if let Some(element) = self.open.last_mut() {
            element.content = bytes;
        }
    }

    fn close(&mut self, _: &str, text: &str, _: usize) -> Result<(), FormatError> {
        if let Some(mut element) = self.open.pop()
            && let Some(parent) = self.open.last_mut()
        {
            text.clone_into(&mut element.text);
            parent.children.push(element);
        }
        Ok(())
    }
}
