//! Opening of the material that a query names.

use super::super::materials::known;
use super::super::problem::Problem;
use super::super::state::App;
use crate::evaluate::Material;
use crate::store::Digest;
use std::sync::Arc;

/// Opens a material that the catalog lists, for queries.
pub(in crate::api) async fn open(app: &App, id: Digest) -> Result<Arc<Material>, Problem> {
    known(app, id).await?;
    app.engine.material(id).await.map_err(|error| Problem::from(&*error))
}
