//! `/v1/materials/{id}/color`: what colour a material has, under any light that is named or stored.

use super::extract::{Id, Query};
use super::problem::{Kind, Problem};
use super::query::{compute, direction, indices, open, read};
use super::schemas::{DigestText, DirectionText, IlluminantText, IndexText, ObserverText, Text};
use super::state::App;
use crate::domain::colour::{Illuminant, StandardObserver, TableError};
use crate::evaluate::Material;
use crate::preview::{self, Question, Viewing};
use crate::store::Digest;
use axum::extract::State;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(color))
}

/// Where to look, by whom and in which light.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ColorQuery {
    /// The incoming direction `θ,φ` in degrees; `0,0` if nothing is said.
    #[param(value_type = Option<DirectionText>)]
    wi: Option<String>,
    /// The outgoing direction `θ,φ` in degrees; if nothing is said, all of them together: directional albedo, flux.
    #[param(value_type = Option<DirectionText>)]
    wo: Option<String>,
    /// One entry, from 0, for each leading index axis: `I,J`; every column of a spectral table if nothing is said.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    /// `A`, `B`, `C`, `D50`, `D65` (the default), `F11`, `E`, or the id of a stored material that is a spectrum.
    #[param(value_type = Option<IlluminantText>)]
    illuminant: Option<String>,
    /// The column of a stored table of illuminants, by name or by number from 1.
    #[param(value_type = Option<Text>)]
    illuminant_column: Option<String>,
    /// `1931` (2°, the default), `1964` (10°), or the id of a stored table of x̄, ȳ, z̄.
    #[param(value_type = Option<ObserverText>)]
    observer: Option<String>,
}

/// Colours, and what they are relative to.
#[derive(Debug, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Colors)]
struct ColorAnswer {
    /// `reflectance`, `radiance factor`, `directional albedo`, `intensity`, `flux`, `spectrum` or `phase function` (× 4π).
    of: String,
    /// The illuminant.
    illuminant: String,
    /// The observer.
    observer: String,
    /// XYZ of white, Y = 100.
    #[schema(min_items = 3, max_items = 3)]
    white: [f64; 3],
    /// One for each entry looked at; null where too few wavelengths were measured.
    colours: Vec<Option<Color>>,
}

/// A colour.
#[derive(Debug, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Color {
    /// The entry of the index axes.
    index: Vec<usize>,
    /// Its name, if it has one.
    label: Option<String>,
    /// Tristimulus values; white has Y = 100.
    #[schema(min_items = 3, max_items = 3)]
    xyz: [f64; 3],
    /// Chromaticity; null of black.
    #[schema(min_items = 2, max_items = 2)]
    xy: Option<[f64; 2]>,
    /// CIE 1976 L*a*b*, relative to white.
    #[schema(min_items = 3, max_items = 3)]
    lab: [f64; 3],
    /// Linear sRGB, adapted to its white; may be out of gamut. Of lights, the largest channel of all is 1.
    #[schema(min_items = 3, max_items = 3)]
    linear_srgb: [f64; 3],
    /// Linear sRGB mapped into the gamut: hue and lightness of Oklab stay, chroma is reduced.
    #[schema(min_items = 3, max_items = 3)]
    mapped_srgb: [f64; 3],
    /// The mapped one as `#rrggbb`.
    #[schema(pattern = "^#[0-9a-f]{6}$")]
    srgb: String,
    /// Whether nothing had to be mapped.
    in_gamut: bool,
    /// Correlated colour temperature of a light, K; null more than 0.05 from the Planckian locus in CIE 1960 (u, v).
    cct: Option<f64>,
    /// Distance of a light from the Planckian locus in CIE 1960 (u, v), positive towards green.
    duv: Option<f64>,
    /// Luminous flux (lm) or intensity (cd) of a light in radiometric units.
    luminous: Option<f64>,
}

/// The colour of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}/color", tag = "evaluation",
    params(("id" = DigestText, Path, description = "The material"), ColorQuery),
    responses((status = 200, description = "The colours", body = ColorAnswer))
)]
async fn color(State(app): State<App>, Id(id): Id, Query(query): Query<ColorQuery>) -> Result<Response, Problem> {
    let wi = read(query.wi.as_deref(), |text| direction("wi", text))?;
    let wo = read(query.wo.as_deref(), |text| direction("wo", text))?;
    let index = read(query.index.as_deref(), indices)?;
    let asked = Asked::of(query.illuminant, query.illuminant_column, query.observer)?;
    let material = open(&app, id).await?;
    let sources = asked.open(&app).await?;
    compute(&app, move || {
        let viewing = sources.viewing()?;
        let question = Question { index: index.as_deref(), wi, wo };
        Ok(preview::colours(&material, &question, &viewing)?)
    })
    .await
}

/// An illuminant and an observer as a query names them.
#[derive(Debug)]
pub(super) struct Asked {
    illuminant: Named<Illuminant>,
    column: Option<String>,
    observer: Named<StandardObserver>,
}

/// A name, or a stored table.
#[derive(Clone, Debug)]
enum Named<T> {
    Standard(T),
    Stored(Digest),
}

/// The tables that a query names, opened.
pub(super) struct Sources {
    illuminant: Illuminant,
    observer: StandardObserver,
    column: Option<String>,
    light: Option<(Digest, Arc<Material>)>,
    eye: Option<(Digest, Arc<Material>)>,
}

impl Asked {
    pub(super) fn of(
        illuminant: Option<String>,
        column: Option<String>,
        observer: Option<String>,
    ) -> Result<Self, Problem> {
        let illuminant = named("illuminant", illuminant)?;
        if let (Named::Standard(light), Some(_)) = (&illuminant, &column) {
            let detail = format!("illuminant_column: {light} is no table, expected the id of one as illuminant");
            return Err(Problem::new(Kind::BadQuery, detail));
        }
        Ok(Self { illuminant, column, observer: named("observer", observer)? })
    }

    /// What was asked for in one text, the same for the same viewing.
    pub(super) fn key(&self) -> String {
        fn key<T: std::fmt::Display>(named: &Named<T>) -> String {
            match named {
                Named::Standard(name) => name.to_string(),
                Named::Stored(digest) => digest.to_string(),
            }
        }
        format!("{} {:?} {}", key(&self.illuminant), self.column, key(&self.observer))
    }

    pub(super) async fn open(self, app: &App) -> Result<Sources, Problem> {
        let mut sources = Sources {
            illuminant: Illuminant::default(),
            observer: StandardObserver::default(),
            column: self.column,
            light: None,
            eye: None,
        };
        match self.illuminant {
            Named::Standard(light) => sources.illuminant = light,
            Named::Stored(id) => sources.light = Some((id, open(app, id).await?)),
        }
        match self.observer {
            Named::Standard(observer) => sources.observer = observer,
            Named::Stored(id) => sources.eye = Some((id, open(app, id).await?)),
        }
        Ok(sources)
    }
}

impl Sources {
    pub(super) fn viewing(&self) -> Result<Viewing, Problem> {
        let unfit = |what: &str, error: TableError| Problem::new(Kind::UnfitQuery, format!("{what}: {error}"));
        let mut viewing = Viewing::standard(self.illuminant, self.observer);
        if let Some((id, table)) = &self.eye {
            let tensor = &table.measurement()?.tensor;
            viewing = viewing.seen_by(&id.to_string(), tensor).map_err(|error| unfit("observer", error))?;
        }
        if let Some((id, table)) = &self.light {
            let tensor = &table.measurement()?.tensor;
            let under = viewing.under(&id.to_string(), tensor, self.column.as_deref());
            viewing = under.map_err(|error| unfit("illuminant", error))?;
        }
        Ok(viewing)
    }
}

fn named<T: std::str::FromStr<Err = crate::domain::UnknownName> + Default>(
    what: &str,
    text: Option<String>,
) -> Result<Named<T>, Problem> {
    let Some(text) = text else { return Ok(Named::Standard(T::default())) };
    if let Ok(digest) = text.parse() {
        return Ok(Named::Stored(digest));
    }
    let shown: String = text.chars().take(80).collect();
    let known = shown.parse().map(Named::Standard);
    known.map_err(|error| Problem::new(Kind::BadQuery, format!("{what}: {error}, or the id of a stored one")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Axis, Measurement, Quantity, Sampling, Tensor, Unit, WavelengthGrid};

    #[test]
    fn the_answer_is_the_one_described() {
        let grid = Axis::Wavelength(WavelengthGrid::even(380.0, 10.0, 41).unwrap());
        let tensor = Tensor::new(vec![grid], vec![1.0; 41]).unwrap();
        let light = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Point, tensor).unwrap();
        let light = Material::of(light).unwrap();
        let found = preview::colours(&light, &Question::default(), &Viewing::default()).unwrap();
        let found = serde_json::to_value(&found).unwrap();
        let described: ColorAnswer = serde_json::from_value(found.clone()).unwrap();
        assert_eq!(serde_json::to_value(&described).unwrap(), found);
    }

    #[test]
    fn names_are_checked_before_anything_is_opened() {
        assert!(Asked::of(None, None, None).is_ok());
        assert!(Asked::of(Some("A".into()), None, Some("1964".into())).is_ok());
        let stored = Digest::of(b"x").to_string();
        assert!(Asked::of(Some(stored), Some("2".into()), None).is_ok());
        for (light, column, observer) in
            [("D93", None, None), ("", None, None), ("A", Some("1"), None), ("A", None, Some("1932"))]
        {
            let owned = |text: Option<&str>| text.map(str::to_owned);
            let problem = Asked::of(owned(Some(light)), owned(column), owned(observer)).unwrap_err();
            assert!(format!("{problem:?}").contains("expected"), "{light}: {problem:?}");
        }
    }
}
