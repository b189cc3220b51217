//! The only place where errors become RFC 9457 problems: a stable `type`, a status, a sentence. Internal error text
//! goes to the log.

use super::words::shown;
use crate::catalog::{CatalogError, Limited, OverQuota};
use crate::evaluate::EvaluateError;
use crate::export::ExportError;
use crate::formats::FormatErrorKind;
use crate::jobs::{BlobError, Code, IngestError, JobProblem, MaterialError, MathsError, OpenError};
use crate::preview::PreviewError;
use crate::store::{Digest, StoreError};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

/// Upper bound in characters on the detail text of an error response. The middle of a longer text is left out; such a
/// text quotes a long value from the request.
const LONGEST_DETAIL: usize = 1000;

/// Value of the header `WWW-Authenticate` in answers that ask for an access key.
const CHALLENGE: &str = "Bearer realm=\"wavelume\"";

/// An error of an HTTP request, as the client sees it.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    kind: Kind,
    detail: String,
    /// Extra header of an error response, such as `Content-Range` for status 416 or `Allow` for status 405.
    header: Option<(header::HeaderName, HeaderValue)>,
    /// Limit of the tenant that the request would exceed, and the amount that the tenant used before the request.
    quota: Option<Box<(u64, u64)>>,
}

/// JSON body of an error response (RFC 9457, `application/problem+json`).
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(as = Problem)]
pub(crate) struct ProblemBody {
    /// Type of the error: `urn:wavelume:problem:` and a stable code.
    #[serde(rename = "type")]
    kind: String,
    /// Meaning of the error type in a few words.
    title: &'static str,
    /// HTTP status of the error response.
    pub(crate) status: u16,
    /// Description of this occurrence of the error.
    pub(crate) detail: String,
    /// Limit of the tenant that the request would exceed; absent for other errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    limit: Option<u64>,
    /// Amount of the limited resource that the tenant used before the request; absent for other errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    used: Option<u64>,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $variant:ident = $status:ident, $code:literal, $title:literal;)+) => {
        /// Kinds of errors that an HTTP response can report.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Kind { $($(#[$doc])* $variant),+ }

        impl Kind {
            pub(crate) fn status(self) -> StatusCode {
                let known = match self { $(Self::$variant => StatusCode::$status),+ };
                // Defined by the protocol of resumable uploads, and by no RFC.
                if matches!(self, Self::ChecksumMismatch) { StatusCode::from_u16(460).unwrap_or(known) } else { known }
            }
            pub(crate) fn code(self) -> &'static str {
                match self { $(Self::$variant => $code),+ }
            }
            pub(crate) fn title(self) -> &'static str {
                match self { $(Self::$variant => $title),+ }
            }
        }
    };
}

kinds! {
    NotFound = NOT_FOUND, "not-found", "The resource does not exist";
    MethodNotAllowed = METHOD_NOT_ALLOWED, "method-not-allowed", "The resource does not support this method";
    BadQuery = BAD_REQUEST, "bad-query", "The query string is invalid";
    BadHeader = BAD_REQUEST, "bad-header", "A request header is invalid";
    BadBody = BAD_REQUEST, "bad-body", "The request body is invalid";
    InvalidRequest = UNPROCESSABLE_ENTITY, "invalid-request", "The request is well-formed but cannot be carried out";
    UnsupportedMediaType = UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "The media type of the body is not supported";
    NotAcceptable = NOT_ACCEPTABLE, "not-acceptable", "No accepted media type can be produced";
    UnsupportedEncoding = UNSUPPORTED_MEDIA_TYPE, "unsupported-encoding", "The content coding of the body is not supported";
    TooLarge = PAYLOAD_TOO_LARGE, "too-large", "The body is larger than the limit";
    DecompressionRatio = PAYLOAD_TOO_LARGE, "decompression-ratio", "The compression ratio of the body is above the limit";
    EmptyBody = UNPROCESSABLE_ENTITY, "empty-body", "The body is empty";
    TooSlow = REQUEST_TIMEOUT, "too-slow", "The body did not arrive in time";
    Unauthorized = UNAUTHORIZED, "unauthorized", "A valid key is needed";
    MissingScope = FORBIDDEN, "missing-scope", "The key does not allow this request";
    TooManyRequests = TOO_MANY_REQUESTS, "too-many-requests", "Too many requests, or too many wrong keys";
    PassedOn = FORBIDDEN, "passed-on", "Requests through a proxy need keys";
    CrossOrigin = FORBIDDEN, "cross-origin-write", "Web pages of other origins may not write";
    CrossOriginRead = FORBIDDEN, "cross-origin-read", "Web pages of other origins may not read with a key";
    Misdirected = MISDIRECTED_REQUEST, "misdirected", "The service does not serve the host of the request";
    LongQuery = URI_TOO_LONG, "query-too-long", "The query string is longer than the limit";
    Unrecognised = UNPROCESSABLE_ENTITY, "unrecognised-format", "The file format is not recognised";
    Malformed = UNPROCESSABLE_ENTITY, "malformed-measurement", "The file breaks the rules of its format";
    Unsupported = UNPROCESSABLE_ENTITY, "unsupported-measurement", "The file uses a feature of its format that is not supported";
    OverLimit = UNPROCESSABLE_ENTITY, "over-limit", "A size exceeds a limit";
    NeedsOption = UNPROCESSABLE_ENTITY, "needs-option", "An option for reading the file is missing or wrong";
    MalformedMaterial = UNPROCESSABLE_ENTITY, "malformed-material", "The file is not a valid material";
    NotOfMeasurement = UNPROCESSABLE_ENTITY, "not-of-measurement", "The material was not made from the measurement";
    Spectrum = UNPROCESSABLE_ENTITY, "unreadable-spectrum", "The spectrum to join cannot be read as a spectrum";
    UnfitAxes = UNPROCESSABLE_ENTITY, "unfit-axes", "The measurement does not fit the axes";
    BadSetting = UNPROCESSABLE_ENTITY, "bad-setting", "A setting is invalid";
    UnreachableTarget = UNPROCESSABLE_ENTITY, "unreachable-target", "No compressed file meets the target";
    UnfitQuery = UNPROCESSABLE_ENTITY, "unfit-query", "The query does not fit the material";
    NotAvailable = UNPROCESSABLE_ENTITY, "not-available", "The material cannot be exported to this format";
    QuotaExceeded = FORBIDDEN, "quota-exceeded", "The request would exceed a limit of the tenant";
    InUse = CONFLICT, "in-use", "Another resource depends on the resource";
    WrongOffset = CONFLICT, "wrong-offset", "The offset differs from the number of bytes received";
    IncompleteUpload = CONFLICT, "incomplete-upload", "The upload is incomplete";
    Gone = GONE, "gone", "The upload has expired";
    Locked = LOCKED, "locked", "Another request is using the upload";
    UnknownVersion = PRECONDITION_FAILED, "unknown-version", "The version of the protocol is not supported";
    ChecksumMismatch = BAD_REQUEST, "checksum-mismatch", "The body does not match its checksum";
    JobFinished = CONFLICT, "job-finished", "The job has already ended";
    KeyReused = UNPROCESSABLE_ENTITY, "idempotency-key-reused", "The idempotency key was used with another body";
    RangeNotSatisfiable = RANGE_NOT_SATISFIABLE, "range-not-satisfiable", "The requested range is outside the content";
    TooManyJobs = TOO_MANY_REQUESTS, "too-many-jobs", "Too many jobs are queued";
    TooManyAtOnce = TOO_MANY_REQUESTS, "too-many-at-once", "The client address or the tenant has too many requests or uploads in progress";
    Overloaded = SERVICE_UNAVAILABLE, "overloaded", "The service is at its limits; try again soon";
    NoSpace = SERVICE_UNAVAILABLE, "no-space", "A disk of the service is full; nothing new is taken until there is space";
    Unavailable = SERVICE_UNAVAILABLE, "unavailable", "The store or the database did not answer; try again soon";
    OutOfMemory = INSUFFICIENT_STORAGE, "out-of-memory", "The job needs more memory than it may use";
    WorkerLost = INTERNAL_SERVER_ERROR, "worker-lost", "The worker stopped while it ran the job";
    Corrupt = INTERNAL_SERVER_ERROR, "corrupt", "Stored bytes are damaged or missing";
    Internal = INTERNAL_SERVER_ERROR, "internal", "Internal error of the service";
}

impl Problem {
    pub(crate) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self { kind, detail: shown(&detail.into(), LONGEST_DETAIL), header: None, quota: None }
    }

    pub(crate) fn with(mut self, name: header::HeaderName, value: &str) -> Self {
        self.header = HeaderValue::from_str(value).ok().map(|value| (name, value));
        self
    }

    /// Builds the error response to a request that would exceed `limit`, a limit of the caller's tenant, which already
    /// uses `used`.
    pub(crate) fn over_quota(limit: u64, used: u64, detail: impl Into<String>) -> Self {
        Self { quota: Some(Box::new((limit, used))), ..Self::new(Kind::QuotaExceeded, detail) }
    }

    /// Returns the code that names the type of the error in an error response.
    pub(crate) fn code(&self) -> &'static str {
        self.kind.code()
    }

    /// Prefixes the detail text of an error with the location of the error, for example a line number.
    pub(crate) fn at(mut self, place: &str) -> Self {
        self.detail = format!("{place}: {}", self.detail);
        self
    }

    /// Builds the error response to a request that lacks a valid key.
    pub(crate) fn unauthorised(detail: impl Into<String>) -> Self {
        Self::new(Kind::Unauthorized, detail).with(header::WWW_AUTHENTICATE, CHALLENGE)
    }

    /// Builds the error response to a well-formed request that cannot be fulfilled.
    pub(crate) fn invalid(detail: impl Into<String>) -> Self {
        Self::new(Kind::InvalidRequest, detail)
    }

    /// Builds the error response to an internal failure: `error` goes to the log, the client gets `detail`.
    fn inside(kind: Kind, error: &dyn std::fmt::Display, detail: &str) -> Self {
        tracing::error!(%error, problem = kind.code(), "a request failed");
        Self::new(kind, detail)
    }

    pub(crate) fn internal(error: &dyn std::fmt::Display) -> Self {
        Self::inside(Kind::Internal, error, "the failure was logged")
    }

    /// Builds the error response of a service that has no space on a disk; `error` goes to the log.
    fn no_space(error: &dyn std::fmt::Display) -> Self {
        let detail = "the service has no space left for new data; delete what is not needed, or try again later";
        Self::inside(Kind::NoSpace, error, detail).with(header::RETRY_AFTER, "10")
    }

    /// Builds the error response for a catalog row whose bytes are missing from the store.
    pub(crate) fn missing(digest: Digest) -> Self {
        Self::inside(Kind::Corrupt, &format!("blob {digest} is missing"), "the stored bytes are missing")
    }

    /// Builds the error response for a service whose file store is away, or was taken over by another service; `reason`
    /// goes to the log.
    pub(crate) fn away(reason: &str) -> Self {
        Self::inside(Kind::Unavailable, &reason, "the store of this service is away; try again later")
    }

    /// Builds the error response for a stored file that a row of the database names but that cannot be read. If the
    /// file is missing, the response says that stored data are damaged.
    pub(crate) fn of_named(digest: Digest, error: BlobError) -> Self {
        match error {
            BlobError::Store(StoreError::NotFound(_)) => Self::missing(digest),
            other => other.into(),
        }
    }

    pub(crate) fn body(&self) -> ProblemBody {
        ProblemBody {
            kind: format!("urn:wavelume:problem:{}", self.kind.code()),
            title: self.kind.title(),
            status: self.kind.status().as_u16(),
            detail: self.detail.clone(),
            limit: self.quota.as_ref().map(|quota| quota.0),
            used: self.quota.as_ref().map(|quota| quota.1),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = self.kind.status();
        let body = serde_json::to_vec(&self.body()).unwrap_or_else(|error| {
            tracing::error!(%error, problem = self.kind.code(), "the body of an error response was not written");
            Vec::new()
        });
        let mut response = (status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if matches!(status, StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE) {
            headers.insert(header::RETRY_AFTER, HeaderValue::from_static("2"));
        }
        headers.extend(self.header.map(|(name, value)| (Some(name), value)));
        response
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if error.is_full() {
            return Self::no_space(&error);
        }
        match error {
            StoreError::NotFound(digest) => {
                Self::new(Kind::NotFound, format!("no stored file has the digest {digest}"))
            }
            StoreError::Corrupt { .. } | StoreError::Range { .. } => Self::inside(
                Kind::Corrupt,
                &error,
                "a stored file does not match its digest; upload the same bytes again",
            ),
            StoreError::NoSpace { .. } | StoreError::Io(_) | StoreError::Objects(_) => {
                Self::inside(Kind::Unavailable, &error, "the store did not answer")
            }
        }
    }
}

impl From<CatalogError> for Problem {
    fn from(error: CatalogError) -> Self {
        if error.is_full() {
            return Self::no_space(&error);
        }
        match error {
            CatalogError::Sql(_) | CatalogError::NoSpace | CatalogError::Unreachable { .. } => {
                Self::inside(Kind::Unavailable, &error, "the catalog did not answer")
            }
            CatalogError::Locked => Self::inside(Kind::Unavailable, &error, "another program has locked the catalog"),
            CatalogError::Migrate(_)
            | CatalogError::Schema(_)
            | CatalogError::Unusable { .. }
            | CatalogError::Row { .. } => Self::internal(&error),
        }
    }
}

impl From<BlobError> for Problem {
    fn from(error: BlobError) -> Self {
        match error {
            BlobError::Store(error) => error.into(),
            BlobError::Catalog(error) => error.into(),
            BlobError::Away(reason) => Self::away(&reason),
        }
    }
}

impl From<MathsError> for Problem {
    fn from(error: MathsError) -> Self {
        match error {
            MathsError::Busy => Self::new(Kind::Overloaded, "too many computations are waiting"),
            MathsError::Panicked(_) => Self::internal(&error),
        }
    }
}

impl From<EvaluateError> for Problem {
    fn from(error: EvaluateError) -> Self {
        match error {
            EvaluateError::Query(_) | EvaluateError::Axes(_) | EvaluateError::Tensor(_) => {
                Self::new(Kind::UnfitQuery, error.to_string())
            }
            // The digest matched, so these bytes were stored like this: damaged earlier, or of another version.
            EvaluateError::Decode(_) => Self::inside(Kind::Corrupt, &error, "the stored material cannot be opened"),
        }
    }
}

impl From<PreviewError> for Problem {
    fn from(error: PreviewError) -> Self {
        match error {
            PreviewError::Evaluate(error) => error.into(),
            PreviewError::Question(error) => Self::new(Kind::UnfitQuery, error.to_string()),
            PreviewError::Colour(error) => Self::new(Kind::UnfitQuery, error.to_string()),
            PreviewError::Encode(_) => Self::internal(&error),
        }
    }
}

impl From<ExportError> for Problem {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Unfit(error) => Self::new(Kind::NotAvailable, error.to_string()),
            ExportError::Strict(_) => Self::new(Kind::NotAvailable, error.to_string()),
            ExportError::Setting(error) => Self::new(Kind::BadSetting, error.to_string()),
            ExportError::OverLimit { .. } => Self::new(Kind::OverLimit, error.to_string()),
            ExportError::Format(error) => {
                let kind = match error.kind {
                    FormatErrorKind::OverLimit => Kind::OverLimit,
                    FormatErrorKind::Unrecognised
                    | FormatErrorKind::Malformed
                    | FormatErrorKind::Unsupported
                    | FormatErrorKind::NeedsOption => Kind::UnfitQuery,
                };
                Self::new(kind, error.to_string())
            }
            ExportError::Evaluate(error) => error.into(),
            ExportError::Colour(error) => error.into(),
        }
    }
}

impl From<&OpenError> for Problem {
    fn from(error: &OpenError) -> Self {
        match error {
            OpenError::Blob(BlobError::Store(StoreError::NotFound(digest))) => Self::missing(*digest),
            OpenError::Blob(BlobError::Store(StoreError::Corrupt { .. } | StoreError::Range { .. })) => {
                Self::inside(Kind::Corrupt, error, "a stored file does not match its digest")
            }
            OpenError::Blob(_) => Self::inside(Kind::Unavailable, error, "the store or the catalog did not answer"),
            OpenError::Maths(error) => error.clone().into(),
            OpenError::Evaluate(error) => error.clone().into(),
        }
    }
}

impl From<IngestError> for Problem {
    fn from(error: IngestError) -> Self {
        match error {
            IngestError::Refused(error) => {
                let kind = match error.kind {
                    FormatErrorKind::Unrecognised => Kind::Unrecognised,
                    FormatErrorKind::Malformed => Kind::Malformed,
                    FormatErrorKind::Unsupported => Kind::Unsupported,
                    FormatErrorKind::OverLimit => Kind::OverLimit,
                    FormatErrorKind::NeedsOption => Kind::NeedsOption,
                };
                Self::new(kind, error.to_string())
            }
            IngestError::Unfit(error) => Self::new(Kind::InvalidRequest, error.to_string()),
            IngestError::Spectrum(error) => Self::new(Kind::Spectrum, error.to_string()),
            IngestError::Maths(error) => error.into(),
            IngestError::Store(error) => error.into(),
            IngestError::Catalog(error) => error.into(),
            IngestError::Away(reason) => Self::away(&reason),
            IngestError::Over(over) => over.into(),
        }
    }
}

impl From<MaterialError> for Problem {
    fn from(error: MaterialError) -> Self {
        match error {
            MaterialError::Malformed(_) => Self::new(Kind::MalformedMaterial, error.to_string()),
            MaterialError::NotOf(detail) => Self::new(Kind::NotOfMeasurement, detail),
            MaterialError::NoRoom => Self::new(Kind::Overloaded, error.to_string()),
            MaterialError::Described(_) | MaterialError::NoMeasurement(_) => {
                Self::new(Kind::InvalidRequest, error.to_string())
            }
            MaterialError::Ingest(error) => error.into(),
        }
    }
}

impl From<OverQuota> for Problem {
    fn from(over: OverQuota) -> Self {
        let kind = match over.what {
            Limited::Bytes | Limited::Materials => Kind::QuotaExceeded,
            Limited::Queued => Kind::TooManyJobs,
        };
        Self { kind, ..Self::over_quota(over.limit, over.used, over.to_string()) }
    }
}

impl From<JobProblem> for Problem {
    fn from(problem: JobProblem) -> Self {
        let kind = match problem.code {
            Code::UnreadableMeasurement => Kind::Malformed,
            Code::UnfitAxes => Kind::UnfitAxes,
            Code::BadSetting => Kind::BadSetting,
            Code::UnreachableTarget => Kind::UnreachableTarget,
            Code::Corrupt => Kind::Corrupt,
            Code::Internal => Kind::Internal,
            Code::Unavailable => Kind::Unavailable,
            Code::OutOfMemory => Kind::OutOfMemory,
            Code::WorkerLost => Kind::WorkerLost,
            Code::QuotaExceeded => Kind::QuotaExceeded,
        };
        // Transient and internal failures were logged where they happened.
        match problem.code {
            Code::Internal | Code::Unavailable => Self::new(kind, kind.title()),
            _ => Self::new(kind, problem.detail),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn details_are_bounded_lines() {
        let long = Problem::new(Kind::InvalidRequest, format!("unknown field `{}\n\u{1b}[2J`", "x".repeat(30 << 20)));
        let detail = long.at("line 7").body().detail;
        assert!(detail.len() < 4 * LONGEST_DETAIL && detail.starts_with("line 7: unknown"), "{}", detail.len());
        assert!(detail.ends_with("\\n\\u{1b}[2J`"), "{detail}");
    }

    #[test]
    fn internal_text_stays_inside() {
        assert_eq!(Problem::from(CatalogError::Locked).into_response().status(), StatusCode::SERVICE_UNAVAILABLE);
        let error = StoreError::Io(std::io::Error::other("/secret/path: I/O error"));
        let response = Problem::from(error).into_response();
        assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(response.headers()[header::RETRY_AFTER], "2");
        let problem = Problem::from(JobProblem { code: Code::Unavailable, detail: "disk".to_owned() });
        assert!(!problem.body().detail.contains("disk"));
    }
}
