//! Form bodies (`multipart/form-data`, RFC 7578), as `curl -F file=@…` and web pages send them: the one file in them.

use super::words::percent_decoded;
use axum::http::{HeaderMap, header};

/// Upper bound in bytes on the headers of a part of a form. Raising it costs memory for each upload.
const LONGEST_HEADERS: usize = 16 << 10;

/// Number of bytes by which a form may exceed the limit on the size of an upload. Raising it takes forms with longer
/// headers around a file of the largest size.
pub(super) const ENVELOPE: u64 = 32 << 10;

/// Upper bound in bytes on the boundary between the parts of a form (RFC 2046).
const LONGEST_BOUNDARY: usize = 70;

/// Reader of a form with one file. It gets the bytes of the body in pieces, and keeps few of them.
#[derive(Debug)]
pub(super) struct Form {
    /// Bytes that end a part: a line break, two dashes and the boundary.
    delimiter: Vec<u8>,
    /// Bytes that were received, but may be the beginning of a delimiter or of a part's headers.
    held: Vec<u8>,
    state: State,
    file_name: Option<String>,
}

/// Place in a form that the reader has reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Before the first delimiter.
    Preamble,
    /// After a delimiter, in the rest of its line.
    Delimiter,
    /// In the headers of a part.
    Headers,
    /// In the bytes of the file.
    File,
    /// After the last delimiter.
    End,
}

impl Form {
    /// Returns the reader of a body with these headers; `None` if it is no form. The error describes a header without a
    /// usable boundary.
    pub(super) fn of(headers: &HeaderMap) -> Result<Option<Self>, String> {
        let Some(text) = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()) else {
            return Ok(None);
        };
        let (essence, parameters) = text.split_once(';').unwrap_or((text, ""));
        if !essence.trim().eq_ignore_ascii_case("multipart/form-data") {
            return Ok(None);
        }
        let boundary = parameter(parameters, "boundary").unwrap_or_default();
        if boundary.is_empty() || boundary.len() > LONGEST_BOUNDARY {
            return Err(format!(
                "found Content-Type {text}, expected a boundary of 1 to {LONGEST_BOUNDARY} characters"
            ));
        }
        let delimiter = [b"\r\n--", boundary.as_bytes()].concat();
        // The first delimiter may be the very beginning of the body, without a line break before it.
        Ok(Some(Self { delimiter, held: b"\r\n".to_vec(), state: State::Preamble, file_name: None }))
    }

    /// Reads the next bytes of the body, and appends those of the file to `file`. The error describes what is wrong
    /// with the form.
    pub(super) fn read(&mut self, bytes: &[u8], file: &mut Vec<u8>) -> Result<(), String> {
        self.held.extend_from_slice(bytes);
        loop {
            let next = match self.state {
                State::Preamble | State::File => {
                    let found = position(&self.held, &self.delimiter);
                    let end = found.unwrap_or_else(|| (self.held.len() + 1).saturating_sub(self.delimiter.len()));
                    if self.state == State::File {
                        file.extend_from_slice(&self.held[..end]);
                    }
                    self.held.drain(..end + found.map_or(0, |_| self.delimiter.len()));
                    found.map(|_| State::Delimiter)
                }
                State::Delimiter if self.held.starts_with(b"--") => Some(State::End),
                State::Delimiter => match position(&self.held, b"\r\n") {
                    Some(end) if self.held[..end].iter().all(u8::is_ascii_whitespace) => {
                        // The line break stays: headers end with two, also if there are none.
                        self.held.drain(..end);
                        Some(State::Headers)
                    }
                    None if self.held.len() <= LONGEST_BOUNDARY => None,
                    _ => return Err("found other text after a boundary of the form, expected a line break".to_owned()),
                },
                State::Headers => match position(&self.held, b"\r\n\r\n") {
                    Some(end) if end <= LONGEST_HEADERS => {
                        let headers = String::from_utf8_lossy(&self.held[..end]).into_owned();
                        self.held.drain(..end + 4);
                        self.begin(&headers)?;
                        Some(State::File)
                    }
                    None if self.held.len() <= LONGEST_HEADERS => None,
                    _ => {
                        return Err(format!(
                            "found more than {LONGEST_HEADERS} bytes of headers in a part of the form"
                        ));
                    }
                },
                State::End => {
                    self.held.clear();
                    None
                }
            };
            match next {
                Some(next) => self.state = next,
                None => return Ok(()),
            }
        }
    }

    /// Begins a part with these headers. It must be the only one, and a file.
    fn begin(&mut self, headers: &str) -> Result<(), String> {
        let value = |wanted: &str| {
            let mut pairs = headers.split("\r\n").filter_map(|line| line.split_once(':'));
            pairs.find(|(name, _)| name.trim().eq_ignore_ascii_case(wanted)).map(|(_, value)| value.trim())
        };
        let disposition = value("content-disposition").unwrap_or_default();
        let (_, parameters) = disposition.split_once(';').unwrap_or_default();
        let Some(name) = file_name(parameters) else {
            let field = parameter(parameters, "name").unwrap_or_default();
            return Err(format!(
                "found the field `{field}` without a file in the form, expected one file alone: options are parameters \
                 of the URL"
            ));
        };
        if let Some(first) = &self.file_name {
            return Err(format!(
                "found the files `{first}` and `{name}` in the form, expected one: send each in a request of its own, or \
                 all in a zip archive"
            ));
        }
        let coding = value("content-transfer-encoding").unwrap_or("binary").to_ascii_lowercase();
        if !matches!(coding.as_str(), "binary" | "8bit" | "7bit") {
            return Err(format!(
                "found Content-Transfer-Encoding {coding} in the form, expected the bytes of the file"
            ));
        }
        self.file_name = Some(name);
        Ok(())
    }

    /// Ends a form after its last byte, and returns the name of the file in it.
    pub(super) fn end(self) -> Result<String, String> {
        match (self.state, self.file_name) {
            (State::End, Some(name)) => Ok(name),
            (State::End, None) => Err("found no file in the form, expected one".to_owned()),
            _ => Err("the form ended early: its last boundary is missing".to_owned()),
        }
    }
}

/// Returns the first position of `wanted`, which is not empty, in `bytes`.
fn position(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    let (first, rest) = wanted.split_first()?;
    let mut from = 0;
    while let Some(at) = bytes[from..].iter().position(|byte| byte == first) {
        if bytes[from + at + 1..].starts_with(rest) {
            return Some(from + at);
        }
        from += at + 1;
    }
    None
}

/// Returns the name of the file of a part, without directories; `None` if the part has no file.
fn file_name(parameters: &str) -> Option<String> {
    let stated = match parameter(parameters, "filename*") {
        Some(coded) => {
            let (_, text) = coded.split_once("''")?;
            String::from_utf8_lossy(&percent_decoded(text)).into_owned()
        }
        None => parameter(parameters, "filename")?,
    };
    let name = stated.rsplit(['/', '\\']).next().unwrap_or_default();
    if name.is_empty() { None } else { Some(name.replace("%22", "\"")) }
}

/// Returns the value of a parameter of a header, `name=value` or `name="value"`, in which a backslash may stand before
/// quotes and backslashes.
fn parameter(mut text: &str, wanted: &str) -> Option<String> {
    while let Some((name, rest)) = text.split_once('=') {
        let name = name.trim_start_matches([';', ' ', '\t']).trim_end();
        let mut value = String::new();
        text = match rest.trim_start().strip_prefix('"') {
            None => {
                let (plain, after) = rest.split_once(';').unwrap_or((rest, ""));
                value.push_str(plain.trim());
                after
            }
            Some(quoted) => {
                let mut characters = quoted.char_indices().peekable();
                let mut end = quoted.len();
                while let Some((at, character)) = characters.next() {
                    match (character, characters.peek()) {
                        ('"', _) => {
                            end = at + 1;
                            break;
                        }
                        ('\\', Some((_, escaped @ ('"' | '\\')))) => {
                            value.push(*escaped);
                            characters.next();
                        }
                        _ => value.push(character),
                    }
                }
                &quoted[end..]
            }
        };
        if name.eq_ignore_ascii_case(wanted) {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const BOUNDARY: &str = "------------------------d74496d66958873e";

    fn form(content_type: &'static str) -> Result<Option<Form>, String> {
        Form::of(&HeaderMap::from_iter([(header::CONTENT_TYPE, HeaderValue::from_static(content_type))]))
    }

    /// Reads a form in pieces of this size, and returns the name of its file and the file.
    fn read(body: &[u8], piece: usize) -> Result<(String, Vec<u8>), String> {
        let mut form = form("multipart/form-data; boundary=------------------------d74496d66958873e").unwrap().unwrap();
        let mut file = Vec::new();
        for piece in body.chunks(piece) {
            form.read(piece, &mut file)?;
        }
        Ok((form.end()?, file))
    }

    /// A part as curl sends it.
    fn part(disposition: &str, bytes: &[u8]) -> Vec<u8> {
        let head =
            format!("--{BOUNDARY}\r\nContent-Disposition: form-data; {disposition}\r\nContent-Type: text/csv\r\n\r\n");
        [head.as_bytes(), bytes, b"\r\n"].concat()
    }

    fn ended(parts: &[Vec<u8>]) -> Vec<u8> {
        [parts.concat(), format!("--{BOUNDARY}--\r\n").into_bytes()].concat()
    }

    #[test]
    fn the_file_of_a_form_is_found_in_pieces_of_any_size() {
        let nearly = format!("400,1\n\r\n--{}\r\r\n--\r\n\r\n", &BOUNDARY[..BOUNDARY.len() - 1]);
        for bytes in [b"".as_slice(), b"400,1\n", b"\r\n", b"--", nearly.as_bytes(), &[b'\r'; 100]] {
            let body = ended(&[part("name=\"file\"; filename=\"a.csv\"", bytes)]);
            let with_preamble = [b"a preamble\r\n".as_slice(), &body, b"an epilogue"].concat();
            for body in [body, with_preamble] {
                for piece in [1, 2, 3, 7, 64, 1 << 20] {
                    assert_eq!(read(&body, piece), Ok(("a.csv".to_owned(), bytes.to_vec())), "{piece}");
                }
            }
        }
    }

    #[test]
    fn little_is_held_of_a_long_file() {
        let mut form = form("multipart/form-data; boundary=x").unwrap().unwrap();
        let mut file = Vec::new();
        form.read(b"--x\r\ncontent-disposition: form-data; filename=a\r\n\r\n", &mut file).unwrap();
        for _ in 0..100 {
            form.read(&[b'a'; 1000], &mut file).unwrap();
            assert!(form.held.len() < 10);
        }
        form.read(b"\r\n--x--", &mut file).unwrap();
        assert_eq!((file, form.end()), (vec![b'a'; 100_000], Ok("a".to_owned())));
    }

    #[test]
    fn names_are_read_as_clients_write_them() {
        for (disposition, name) in [
            ("name=\"file\"; filename=\"a b;c.csv\"", "a b;c.csv"),
            ("filename=a.csv; name=file", "a.csv"),
            ("name=\"x=y\"; filename=\"a \\\"b\\\".csv\"", "a \"b\".csv"),
            ("name=\"x\"; filename=\"a%22b.csv\"", "a\"b.csv"),
            ("name=\"x\"; filename=\"C:\\data\\a.csv\"", "a.csv"),
            ("name=\"x\"; filename=\"../data/a.csv\"", "a.csv"),
            ("name=\"x\"; filename=\"größe.csv\"", "größe.csv"),
            ("name=\"x\"; filename=\"?.csv\"; filename*=UTF-8''gr%C3%B6%C3%9Fe.csv", "größe.csv"),
        ] {
            let body = ended(&[part(disposition, b"bytes")]);
            assert_eq!(read(&body, 100), Ok((name.to_owned(), b"bytes".to_vec())), "{disposition}");
        }
    }

    #[test]
    fn other_forms_are_refused_with_what_to_send() {
        let file = |name: &str| part(&format!("name=\"file\"; filename=\"{name}\""), b"bytes");
        let field = part("name=\"quantity\"", b"brdf");
        let coded =
            [file("a")[..BOUNDARY.len() + 4].to_vec(), b"Content-Transfer-Encoding: base64\r\n".to_vec()].concat();
        let coded = [coded, file("a")[BOUNDARY.len() + 4..].to_vec()].concat();
        for (body, reason) in [
            (ended(&[file("a.csv"), file("b.csv")]), "`a.csv` and `b.csv` in the form, expected one: send each"),
            (ended(&[field.clone(), file("a.csv")]), "found the field `quantity` without a file"),
            (ended(&[file("a.csv"), field]), "options are parameters of the URL"),
            (ended(&[part("name=\"file\"; filename=\"\"", b"")]), "found the field `file` without a file"),
            (ended(&[]), "found no file in the form"),
            (file("a.csv"), "its last boundary is missing"),
            (b"400,1\n500,1\n".to_vec(), "its last boundary is missing"),
            (ended(&[coded]), "found Content-Transfer-Encoding base64 in the form"),
            (format!("--{BOUNDARY}x\r\n\r\n").into_bytes(), "found other text after a boundary"),
            (format!("--{BOUNDARY}\r\n\r\nbytes\r\n--{BOUNDARY}--").into_bytes(), "found the field `` without a file"),
            (ended(&[part(&"x".repeat(LONGEST_HEADERS), b"")]), "bytes of headers in a part"),
        ] {
            for piece in [1, 1 << 20] {
                let refusal = read(&body, piece).unwrap_err();
                assert!(refusal.contains(reason), "{reason}: {refusal}");
            }
        }
    }

    #[test]
    fn only_forms_with_a_boundary_are_read() {
        for none in ["text/csv", "application/x-www-form-urlencoded", "multipart/mixed; boundary=x"] {
            assert!(form(none).unwrap().is_none(), "{none}");
        }
        assert!(Form::of(&HeaderMap::new()).unwrap().is_none());
        assert!(
            form("Multipart/Form-Data; charset=utf-8; boundary=\"a b\"").unwrap().unwrap().delimiter == b"\r\n--a b"
        );
        for bad in ["multipart/form-data", "multipart/form-data; boundary=", "multipart/form-data; charset=utf-8"] {
            assert!(form(bad).unwrap_err().contains("expected a boundary"), "{bad}");
        }
    }
}
