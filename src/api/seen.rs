//! Materials that a caller may read: those of its tenant, those shared with it, and public ones.

use super::problem::{Kind, Problem};
use super::state::App;
use crate::catalog::{Sight, Visible};
use crate::store::Digest;
use axum::response::Response;

/// A material that the caller of a request may read.
pub(super) struct Seen {
    /// Service state with access to the data of the material's owner, to be used for this material alone.
    pub(super) app: App,
    /// Name of the material given by its owner.
    pub(super) name: Option<String>,
    /// Reason for which the caller may read the material.
    pub(super) sight: Sight,
    is_public: bool,
}

/// Mark of a response that is the same for all callers, because it is about a public material. Caches may share such a
/// response, for a short time, where requests without a key are admitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForAll;

/// Finds out whether the caller may read the material `id`, and whose it is. Every answer about a material asks this
/// first, even if the material is in memory: it may have been deleted or made private by another process. The problem
/// is the same for a material that nobody has and for one that others keep private.
pub(super) async fn seen(app: &App, id: Digest) -> Result<Seen, Problem> {
    find(app, id).await?.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))
}

/// Finds a material that the caller may read, like [`seen`], but trusts an answer of the catalog for two seconds unless
/// this process changed the right meanwhile. For downloads, which renderers repeat.
pub(super) async fn seen_lately(app: &App, id: Digest) -> Result<Seen, Problem> {
    let catalog = &app.engine.archive.catalog;
    let visible = app.remembered.visible(catalog.tenant(), id, catalog.sees(id)).await?;
    Seen::of(app, id, visible.as_deref()).await.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))
}

/// Finds a material that the caller may read, like [`seen`], but returns `None` instead of an error if there is none.
pub(super) async fn find(app: &App, id: Digest) -> Result<Option<Seen>, Problem> {
    let visible = app.engine.archive.catalog.sees(id).await?;
    Ok(Seen::of(app, id, visible.as_ref()).await)
}

/// Frees the memory that an opened material occupies after it was deleted.
pub(super) async fn forget(app: &App, id: Digest) {
    app.engine.close_material(id).await;
    app.contents.forget(app.engine.archive.catalog.tenant(), id).await;
}

pub(super) fn absent(id: Digest) -> String {
    format!("there is no material {id}")
}

impl Seen {
    /// Builds the access to a material from the answer of the catalog. If the caller may not read it, frees the memory
    /// that it occupies and returns `None`.
    async fn of(app: &App, id: Digest, visible: Option<&Visible>) -> Option<Self> {
        let Some(Visible { owner, name, sight, is_public }) = visible else {
            forget(app, id).await;
            return None;
        };
        Some(Self { app: app.of(owner), name: name.clone(), sight: *sight, is_public: *is_public })
    }

    /// Adds the mark [`ForAll`] to an answer about a public material.
    pub(super) fn mark(&self, mut response: Response) -> Response {
        if self.is_public {
            response.extensions_mut().insert(ForAll);
        }
        response
    }
}
