//! A complete resumable upload that is used as the body of a request.

use super::headers;
use super::refusals::{absent, expired, locked};
use crate::api::caller::client;
use crate::api::extract::{declared_length, linger};
use crate::api::problem::{Kind, Problem};
use crate::api::schemas::UploadIdText;
use crate::api::state::App;
use crate::api::upload::{self, Lines, Lost, Received};
use crate::catalog::Held;
use crate::jobs::{BlobError, Client, Holding};
use crate::store::Staged;
use axum::extract::Request;
use futures::StreamExt;
use utoipa::ToSchema;
use utoipa::openapi::Ref;
use utoipa::openapi::Required;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn};

/// A resumable upload that a request uses; reserved until the request has ended.
#[derive(Debug)]
pub(crate) struct Used(Holding);

/// Describes the query parameter `upload`.
pub(crate) fn upload_parameter() -> Parameter {
    let parameter = ParameterBuilder::new().name("upload").parameter_in(ParameterIn::Query).required(Required::False);
    let help = "Id of a complete resumable upload, which takes the place of the body and is gone afterwards. A request \
                that is refused leaves the upload, so that it can be repeated with other options.";
    parameter.description(Some(help)).schema(Some(Ref::from_schema_name(UploadIdText::name()))).build()
}

/// Receives the body of a request or, if `upload` names one, the bytes of a resumable upload, into a temporary file.
pub(crate) async fn receive(
    app: &App,
    upload: Option<&str>,
    request: Request,
) -> Result<(Received, Option<Used>), Problem> {
    let Some(id) = upload else { return Ok((upload::receive(app, request).await?, None)) };
    if declared_length(request.headers()).is_some_and(|length| length > 0) {
        linger(request).await;
        return Err(Problem::new(Kind::BadBody, "found a body and the parameter `upload`, expected one of the two"));
    }
    let client = client(request.extensions());
    let holding = app.engine.hold_partial(id, None).await?.map_err(|refused| match refused {
        Held::Absent => absent(id),
        Held::Expired => expired(id),
        Held::Busy | Held::Elsewhere(_) | Held::Now(_) => locked(id),
    })?;
    match staged(app, client, &holding, request).await {
        Ok(staged) => {
            let used = Used(holding);
            Ok((Received { staged, file_name: used.stated("filename"), lines: Lines::KEPT }, Some(used)))
        }
        Err(problem) => {
            holding.release().await;
            Err(problem)
        }
    }
}

async fn staged(app: &App, client: Client, holding: &Holding, request: Request) -> Result<Staged, Problem> {
    let partial = &holding.partial;
    if partial.length != Some(partial.received) {
        let length = partial.length.map_or("a size that is not stated yet".to_owned(), |length| format!("{length}"));
        let detail = format!("the upload {} has received {} bytes of {length}", partial.id, partial.received);
        return Err(Problem::new(Kind::IncompleteUpload, detail));
    }
    let parts = holding.bytes().await?;
    let parts = parts.map(|piece| {
        piece.map_err(|error| {
            tracing::error!(%error, "a part of an upload cannot be read from the store");
            let is_damaged = matches!(&error, BlobError::Store(error) if error.damage().is_some());
            std::io::Error::other(Lost(if is_damaged { Kind::Corrupt } else { Kind::Unavailable }))
        })
    });
    upload::receive_stream(app, client, request.headers(), Box::pin(parts)).await
}

impl Used {
    /// Returns the text under `name` in the metadata that the client has sent with the upload.
    fn stated(&self, name: &str) -> Option<String> {
        headers::stated(&self.0.partial.metadata, name)
    }

    /// Deletes the upload if its use has succeeded, and otherwise leaves it for another request.
    pub(crate) async fn end(self, app: &App, succeeded: bool) {
        let id = self.0.partial.id.clone();
        if succeeded {
            // An upload that cannot be deleted now expires later.
            if let Err(error) = app.engine.end_partial(&id).await {
                tracing::warn!(upload = id, %error, "a used upload was not deleted");
            }
        } else {
            self.0.release().await;
        }
    }
}
