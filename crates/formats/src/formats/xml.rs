//! Walk over the elements of an XML file, with their attributes and text; nothing outside the file is read.
//!
//! Names are those without their namespace, which writers choose freely. Document types and custom entities are
//! refused, because they can name other files. Lines that a tool wrote before the XML declaration are left out.

use super::acquisition::ParseReport;
use super::error::{FormatError, FormatErrorKind};
use super::foreign;
use super::text::{Source, snippet};
use crate::notes::TextNote;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use std::borrow::Cow;
use std::ops::Range;

/// Upper bound on the nesting depth of XML elements; TM-27 files have three, TM-33 files seven, BSDFs of WINDOW eight.
/// Raising it accepts deeper files.
const MAX_DEPTH: usize = 16;

/// Start of an XML element.
pub(super) struct Element<'a> {
    /// Name of the element without its namespace prefix.
    pub(super) name: &'a str,
    /// Byte offset of the element in the text of the file.
    pub(super) offset: usize,
    start: &'a BytesStart<'a>,
}

impl Element<'_> {
    /// Returns the value of the attribute `name`; `None` if the element does not have it.
    pub(super) fn attribute(&self, name: &str) -> Option<String> {
        let attribute = self.start.try_get_attribute(name).ok().flatten()?;
        attribute.normalized_value(XmlVersion::Implicit1_0).ok().map(Cow::into_owned)
    }
}

/// Amount of text that is kept of an XML element.
#[derive(Clone, Copy)]
pub(super) struct Room {
    /// Upper bound on the bytes of the element's text.
    pub(super) bytes: usize,
    /// True if longer text is refused; else what is over is left out.
    pub(super) is_strict: bool,
}

/// Receiver of the elements of an XML file, in the order of the file.
pub(super) trait Visitor {
    /// Receives the start of an element and returns how much of its text is to be kept.
    fn open(&mut self, element: &Element<'_>) -> Result<Room, FormatError>;
    /// Receives the bytes of the file between the tags of the element whose end comes next.
    fn content(&mut self, _bytes: Range<usize>) {}
    /// Receives the end of an element that started at byte `offset`, with its text, trimmed.
    fn close(&mut self, name: &str, text: &str, offset: usize) -> Result<(), FormatError>;
}

/// Element that contains all others of an XML file.
pub(super) struct Root {
    /// Returns true for the name of the root element.
    pub(super) is: fn(&str) -> bool,
    /// Name of the root element in messages.
    pub(super) expected: &'static str,
}

/// XML element that is not closed yet.
struct Open {
    name: String,
    text: String,
    room: Room,
    offset: usize,
    /// Byte offset at which the start tag ends.
    content: usize,
}

/// Passes every element of an XML file to `visitor`. Lines of a tool before the XML declaration are left out.
pub(super) fn walk(
    source: &Source,
    root: &Root,
    report: &mut ParseReport,
    visitor: &mut impl Visitor,
) -> Result<(), FormatError> {
    let start = foreign::before_xml(source.text());
    let lines = source.text()[..start].lines().filter(|line| !line.trim().is_empty()).count();
    if lines > 0 {
        report.note(TextNote::LinesBeforeData { lines });
    }
    let place = |within: u64| usize::try_from(within).map_or(usize::MAX, |within| start.saturating_add(within));
    let mut walk = Walk { source, root, stack: Vec::new(), spare: Vec::new(), rooted: false };
    let mut xml = quick_xml::Reader::from_str(&source.text()[start..]);
    loop {
        let offset = place(xml.buffer_position());
        let event = xml.read_event().map_err(|error| {
            let at = place(xml.error_position());
            let message: String = error.to_string().chars().take(120).collect();
            source.malformed(at, format!("XML that is not well formed, expected elements that end: {message}"))
        })?;
        let after = place(xml.buffer_position());
        match event {
            Event::Start(element) => walk.open(&element, offset..after, visitor)?,
            Event::Empty(element) => {
                walk.open(&element, offset..after, visitor)?;
                walk.close(after, visitor)?;
            }
            Event::End(_) => walk.close(offset, visitor)?,
            Event::Text(text) => walk.text(&text, offset)?,
            Event::CData(text) => walk.text(&text, offset)?,
            Event::GeneralRef(reference) => {
                let character = reference.resolve_char_ref().ok().flatten();
                let known = character
                    .map(String::from)
                    .or_else(|| quick_xml::escape::resolve_predefined_entity(&reference).map(str::to_owned));
                let Some(known) = known else {
                    let message =
                        format!("entity {}, expected amp, lt, gt, quot, apos or a number", snippet(&reference));
                    return Err(source.malformed(offset, message));
                };
                walk.text(&known, offset)?;
            }
            Event::DocType(_) => {
                let message = "a document type, expected none: it can name other files";
                return Err(source.error(FormatErrorKind::Unsupported, offset, message));
            }
            Event::Decl(_) | Event::PI(_) | Event::Comment(_) => {}
            Event::Eof => break,
        }
    }
    match walk.stack.last() {
        None if walk.rooted => Ok(()),
        None => Err(source.malformed(0, format!("no element, expected {}", root.expected))),
        Some(open) => {
            let message = format!("the file ends inside the element {}, expected its end", snippet(&open.name));
            Err(source.malformed(source.text().len(), message))
        }
    }
}

/// State of a walk over an XML file: the elements that are open at its position.
struct Walk<'a> {
    source: &'a Source,
    root: &'a Root,
    stack: Vec<Open>,
    /// Closed elements whose buffers are used again.
    spare: Vec<Open>,
    rooted: bool,
}

impl Walk<'_> {
    /// Opens the element whose start tag has the bytes `tag` of the file.
    fn open(
        &mut self,
        start: &BytesStart<'_>,
        tag: Range<usize>,
        visitor: &mut impl Visitor,
    ) -> Result<(), FormatError> {
        let offset = tag.start;
        let name = start.local_name();
        let name = name.as_ref();
        if self.stack.is_empty() {
            if self.rooted || !(self.root.is)(name) {
                let message = format!("the element {}, expected one {}", snippet(name), self.root.expected);
                return Err(self.source.malformed(offset, message));
            }
            self.rooted = true;
        }
        if self.stack.len() >= MAX_DEPTH {
            let message =
                format!("an XML element inside {MAX_DEPTH} others, expected at most {MAX_DEPTH} nested elements");
            return Err(self.source.error(FormatErrorKind::OverLimit, offset, message));
        }
        let room = visitor.open(&Element { name, offset, start })?;
        let spare = self.spare.pop();
        let (mut kept, text) = spare.map_or_else(Default::default, |open| (open.name, open.text));
        kept.push_str(name);
        self.stack.push(Open { name: kept, text, room, offset, content: tag.end });
        Ok(())
    }

    fn text(&mut self, text: &str, offset: usize) -> Result<(), FormatError> {
        let over = match self.stack.last_mut() {
            Some(open) if open.text.len() + text.len() <= open.room.bytes => {
                open.text.push_str(text);
                false
            }
            Some(open) => open.room.is_strict,
            None => !text.trim().is_empty(),
        };
        if over {
            let message = format!("found {}, expected an element", snippet(text.trim()));
            return Err(self.source.malformed(offset, message));
        }
        Ok(())
    }

    /// Closes the innermost element, whose content ends at byte `end` of the file.
    fn close(&mut self, end: usize, visitor: &mut impl Visitor) -> Result<(), FormatError> {
        let Some(mut open) = self.stack.pop() else { return Ok(()) };
        visitor.content(open.content..end);
        visitor.close(&open.name, open.text.trim(), open.offset)?;
        open.name.clear();
        open.text.clear();
        self.spare.push(open);
        Ok(())
    }
}
