//! Content negotiation: the encoding of a batch and that of its answer.

use super::super::problem::{Kind, Problem};
use axum::http::{HeaderMap, HeaderValue, header};

/// Encoding of a batch of queries or of its answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// One JSON object that holds all queries of a batch, or all answers.
    Json,
    /// One JSON object per line (NDJSON), one line for each query or answer.
    Lines,
    /// Little-endian f32 numbers without separators.
    Floats,
}

/// Media types of the encodings of batches. The first media type of an encoding labels answers.
const NAMES: [(&str, Encoding); 6] = [
    ("application/json", Encoding::Json),
    ("application/x-ndjson", Encoding::Lines),
    ("application/ndjson", Encoding::Lines),
    ("application/jsonl", Encoding::Lines),
    ("application/x-jsonlines", Encoding::Lines),
    ("application/octet-stream", Encoding::Floats),
];

impl Encoding {
    /// Returns the encoding of a request body according to the header `Content-Type`.
    pub(super) fn of_body(headers: &HeaderMap) -> Result<Self, Problem> {
        let found = headers.get(header::CONTENT_TYPE).map(|value| value.to_str().unwrap_or("?"));
        let essence = found.map(essence).unwrap_or_default();
        let known = NAMES.iter().find(|(name, _)| *name == essence).map(|(_, encoding)| *encoding);
        let encoding = match known {
            None if essence.starts_with("application/") && essence.ends_with("+json") => Some(Self::Json),
            known => known,
        };
        encoding.ok_or_else(|| {
            let shown: String = found.unwrap_or("none").chars().take(80).collect();
            let detail = format!(
                "found Content-Type {shown}, expected application/json, application/x-ndjson or application/octet-stream"
            );
            Problem::new(Kind::UnsupportedMediaType, detail)
        })
    }

    /// Negotiates the encoding of the answer from the header `Accept`, preferring the encoding of the request body. A
    /// streamed request (NDJSON or f32) gets a streamed answer.
    pub(super) fn of_answer(self, headers: &HeaderMap) -> Result<Self, Problem> {
        let offers: &[Self] = match self {
            Self::Json => &[Self::Json, Self::Lines, Self::Floats],
            Self::Lines => &[Self::Lines, Self::Floats],
            Self::Floats => &[Self::Floats, Self::Lines],
        };
        let accepted: Vec<&str> =
            headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok()).collect();
        if accepted.is_empty() {
            return Ok(self);
        }
        // The highest quality wins; ties go to the first offer.
        let mut best = (0, None);
        for &offer in offers {
            let quality = offer.quality(&accepted);
            if quality > best.0 {
                best = (quality, Some(offer));
            }
        }
        best.1.ok_or_else(|| {
            let shown: String = accepted.join(", ").chars().take(80).collect();
            let expected: Vec<&str> = offers.iter().map(|offer| offer.name()).collect();
            let detail = format!("found Accept {shown}, expected one of {}", expected.join(", "));
            Problem::new(Kind::NotAcceptable, detail)
        })
    }

    /// Returns the media type that labels answers in this encoding.
    pub(super) fn name(self) -> &'static str {
        NAMES.iter().find(|(_, encoding)| *encoding == self).map_or("", |(name, _)| name)
    }

    pub(super) fn header(self) -> HeaderValue {
        HeaderValue::from_static(self.name())
    }

    /// Returns the quality value in thousandths that the most specific matching range of the header `Accept` gives to a
    /// media type (RFC 9110 section 12.5.1).
    fn quality(self, accepted: &[&str]) -> u32 {
        let mut best = (0, 0);
        for range in accepted.iter().flat_map(|text| text.split(',')) {
            let media = essence(range);
            let precision = if NAMES.iter().any(|(name, encoding)| *name == media && *encoding == self) {
                3
            } else if media == "application/*" {
                2
            } else if media == "*/*" {
                1
            } else {
                continue;
            };
            if precision > best.0 {
                best = (precision, weight(range));
            }
        }
        best.1
    }
}

/// Returns a media type in lower case, without its parameters.
fn essence(text: &str) -> String {
    text.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// Returns the quality parameter `q` of a media range in thousandths: 1000 if it is absent, 0 if it is not a number.
fn weight(range: &str) -> u32 {
    let q = range.split(';').skip(1).find_map(|part| {
        let (name, value) = part.split_once('=')?;
        name.trim().eq_ignore_ascii_case("q").then(|| value.trim().parse::<f32>().unwrap_or(0.0))
    });
    q.map_or(1000, |q| (q.clamp(0.0, 1.0) * 1000.0) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(text: &'static str) -> Result<Encoding, Problem> {
        Encoding::of_body(&HeaderMap::from_iter([(header::CONTENT_TYPE, HeaderValue::from_static(text))]))
    }

    fn answer(body: Encoding, text: &'static str) -> Result<Encoding, Problem> {
        body.of_answer(&HeaderMap::from_iter([(header::ACCEPT, HeaderValue::from_static(text))]))
    }

    #[test]
    fn bodies_say_what_they_are() {
        assert_eq!(body("application/json; charset=utf-8").unwrap(), Encoding::Json);
        assert_eq!(body("application/vnd.x+json").unwrap(), Encoding::Json);
        assert_eq!(body("Application/X-NDJSON").unwrap(), Encoding::Lines);
        assert_eq!(body("application/octet-stream").unwrap(), Encoding::Floats);
        for other in ["text/plain", "application/x-www-form-urlencoded", ""] {
            assert!(body(other).is_err(), "{other}");
        }
        assert!(Encoding::of_body(&HeaderMap::new()).is_err());
    }

    #[test]
    fn answers_are_what_is_accepted() {
        assert_eq!(Encoding::Floats.of_answer(&HeaderMap::new()).unwrap(), Encoding::Floats);
        for (given, accepted, expected) in [
            (Encoding::Json, "*/*", Encoding::Json),
            (Encoding::Lines, "*/*", Encoding::Lines),
            (Encoding::Json, "application/octet-stream", Encoding::Floats),
            (Encoding::Json, "application/json;q=0.5, application/x-ndjson", Encoding::Lines),
            (Encoding::Json, "application/json;q=0, */*;q=0.1", Encoding::Lines),
            (Encoding::Floats, "text/html, application/*;q=0.2", Encoding::Floats),
            (Encoding::Lines, "application/octet-stream, application/json", Encoding::Floats),
        ] {
            assert_eq!(answer(given, accepted).unwrap(), expected, "{accepted}");
        }
        for (given, accepted) in
            [(Encoding::Json, "text/html"), (Encoding::Lines, "application/json"), (Encoding::Json, "*/*;q=0")]
        {
            assert!(answer(given, accepted).is_err(), "{accepted}");
        }
    }
}
