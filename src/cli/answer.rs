//! Requests to a running service, and its answers as JSON.

use super::failure::Failure;
use reqwest::{RequestBuilder, Response};
use serde_json::Value;

/// Returns the innermost cause of a failed HTTP request, the one that a user can act on.
pub(crate) fn reason(error: &reqwest::Error) -> String {
    if error.is_timeout() {
        return "the server did not answer in time".to_owned();
    }
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    let cause = cause.to_string();
    // The name that rustls gives this fault.
    if cause.contains("UnknownIssuer") {
        return format!("{cause}: name the authority of the service's certificate with --ca-cert FILE");
    }
    cause
}

/// Sends an HTTP request to a service.
pub(super) async fn send(request: RequestBuilder) -> Result<Response, Failure> {
    request.send().await.map_err(|error| Failure::failed(reason(&error)))
}

/// Returns the JSON body of an HTTP response; fails with the problem that an unsuccessful response describes.
pub(super) async fn read(answer: Response) -> Result<Value, Failure> {
    let (status, path) = (answer.status(), answer.url().path().to_owned());
    let body: Value = answer.json().await.map_err(|error| Failure::failed(reason(&error)))?;
    if status.is_success() {
        return Ok(body);
    }
    let detail = body["detail"].as_str().or(body["title"].as_str()).unwrap_or("no detail");
    Err(Failure::failed(format!("{path}: {status}: {detail}")))
}

/// Returns the text in the field `name` of a JSON object with which the service answered.
pub(super) fn text<'a>(answer: &'a Value, name: &str) -> Result<&'a str, Failure> {
    answer[name].as_str().ok_or_else(|| Failure::failed(format!("the service's answer has no `{name}`")))
}

/// Percent-encodes `text` as a value in a query string.
pub(super) fn escaped(text: &str) -> String {
    text.bytes()
        .map(|byte| match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' => char::from(byte).to_string(),
            _ => format!("%{byte:02X}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_escaped() {
        assert_eq!(escaped("light skin"), "light%20skin");
        assert_eq!(escaped("b3-a.ies"), "b3-a.ies");
    }
}
