//! Opening of the material that a query names.

use super::super::problem::Problem;
use super::super::seen::seen;
use super::super::state::App;
use crate::evaluate::Material;
use crate::store::Digest;
use std::sync::Arc;

/// Opens a material that the caller may read, for queries.
pub(in crate::api) async fn open(app: &App, id: Digest) -> Result<Arc<Material>, Problem> {
    let seen = seen(app, id).await?;
    seen.app.engine.material(id).await.map_err(|error| Problem::from(&*error))
}
