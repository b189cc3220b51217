//! Table of the kinds of jobs.

use super::attempt::{Failure, Made, unread};
use super::computation::{Computation, Computed};
use super::engine::Engine;
use super::frame::{self, FrameError, Queued};
use super::hub::Control;
use super::paper::PaperRequest;
use super::request::{CompressRequest, RequestError};
use super::work::Work;
use crate::catalog::{EDITION, Priority};
use crate::domain::Progress;
use crate::store::Digest;
use bytes::Bytes;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::sync::Arc;
use utoipa::ToSchema;

/// Source of job requests: the body of an HTTP request.
pub(crate) trait Source {
    /// Reason why a job request cannot be read from the body of an HTTP request.
    type Error;

    /// Reads a job request of type `T`, for example a compression request, from the body of an HTTP request.
    fn read<T: DeserializeOwned>(&self) -> Result<T, Self::Error>;
}

/// Declares the kinds of jobs: each with its argument in the queue and its request. The first one is the default.
macro_rules! kinds {
    (
        $(#[doc = $first_doc:literal])+ $first:ident { $first_field:ident: $first_type:ty } = $first_request:ty;
        $($(#[doc = $doc:literal])+ $kind:ident { $field:ident: $type:ty } = $request:ty;)*
    ) => {
        kinds! { @all
            $(#[doc = $first_doc])+ #[default] $first { $first_field: $first_type } = $first_request;
            $($(#[doc = $doc])+ $kind { $field: $type } = $request;)*
        }
    };
    (@all $($(#[doc = $doc:literal])+ $(#[$default:ident])? $kind:ident { $field:ident: $type:ty } = $request:ty;)+) => {
        /// The kinds of jobs.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub(crate) enum Kind {
            $($(#[doc = $doc])+ $(#[$default])? $kind,)+
        }

        /// Job request; `kind` selects its type, `compress` if it is absent.
        #[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
        #[serde(untagged)]
        pub(crate) enum JobRequest {
            $($(#[doc = $doc])+ $kind(Box<$request>),)+
        }

        /// Kind of a job with its arguments, as the job queue stores it. Kinds are only ever appended, so that new
        /// workers can read jobs that an older version queued.
        #[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub(super) enum Frame {
            $($(#[doc = $doc])+ $kind { $field: $type },)+
        }

        impl JobRequest {
            /// Reads a job request of the given kind from the body of an HTTP request.
            pub(crate) fn read<S: Source>(kind: Kind, source: &S) -> Result<Self, S::Error> {
                match kind {
                    $(Kind::$kind => source.read().map(Self::$kind),)+
                }
            }

            /// Checks the content of a job request, such as its texts, options and table numbers, before the job is
            /// queued.
            pub(crate) fn check(&self) -> Result<(), RequestError> {
                match self {
                    $(Self::$kind(request) => Work::check(request.as_ref()),)+
                }
            }
        }

        impl Queued for JobRequest {
            fn measurement(&self) -> Option<Digest> {
                match self {
                    $(Self::$kind(request) => Work::measurement(request.as_ref()),)+
                }
            }

            fn level(&self) -> i64 {
                match self {
                    $(Self::$kind(_) => <$request as Work>::LEVEL,)+
                }
            }

            fn priority(&self) -> Priority {
                match self {
                    $(Self::$kind(request) => Work::priority(request.as_ref()),)+
                }
            }

            fn frame(&self) -> Result<String, String> {
                let frame = match self {
                    $(Self::$kind(request) => Frame::$kind { $field: Work::arguments(request.as_ref())? },)+
                };
                frame.encode().map_err(|error| error.to_string())
            }
        }

        /// Does the computation of the kind called `name`; `computation` holds its arguments as JSON.
        pub(super) fn compute(
            name: &str,
            computation: Value,
            files: Vec<Bytes>,
            progress: &dyn Progress,
        ) -> Result<Computed, Failure> {
            $(if name == <$request as Work>::Computation::NAME {
                let computation: <$request as Work>::Computation =
                    serde_json::from_value(computation).map_err(|error| unread("computation", &error))?;
                return computation.compute(files, progress);
            })+
            Err(Failure::Newer(format!("there is no computation `{name}`")))
        }

        // A job that this program queues is one that it runs.
        const _: () = assert!($(<$request as Work>::LEVEL <= EDITION.level)&&+);

        impl Frame {
            /// Runs one attempt at the job.
            pub(super) async fn run(self, engine: &Arc<Engine>, control: &Arc<Control>) -> Result<Made, Failure> {
                match self {
                    $(Self::$kind { $field } => <$request as Work>::run(engine, $field, control).await,)+
                }
            }
        }
    };
}

// A new kind needs its module and lines at the end: frames in the queue are read by the position of their kind.
kinds! {
    /// Compression of a measurement to a material (a file with a promised error).
    Compress { request: String } = CompressRequest;
    /// Make the report on the tables of the paper by Claustres et al. (2006).
    Paper { tables: Vec<u8> } = PaperRequest;
}

/// Kind of a job request, read first because it decides which other fields the request has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct KindOnly {
    /// Kind of the job. Default: `compress`.
    #[serde(default)]
    pub kind: Kind,
}

impl Frame {
    /// Encodes the arguments of a job as text for the job queue.
    pub(super) fn encode(&self) -> Result<String, FrameError> {
        frame::encode(self)
    }

    /// Decodes the arguments of a job from their text in the job queue.
    pub(super) fn decode(text: &str) -> Result<Self, FrameError> {
        frame::decode(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_keep_their_bytes() {
        for (frame, text) in [
            (Frame::Compress { request: "{}".to_owned() }, "0000000002000000000000007b7d"),
            (Frame::Paper { tables: vec![1, 7] }, "0100000002000000000000000107"),
        ] {
            assert_eq!(frame.encode().unwrap(), text);
            assert_eq!(Frame::decode(text), Ok(frame));
        }
    }
}
