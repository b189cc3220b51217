//! `/v1/materials/{id}/color`: the colour of a material under any named or stored illuminant.

use super::caller::Caller;
use super::extract::{Id, Query};
use super::problem::{Kind, Problem};
use super::query::{compute, direction, indices, open, outgoing, read};
use super::schemas::{DirectionText, IlluminantText, IndexText, ObserverText};
use super::state::{App, Service};
use crate::domain::colour::{Illuminant, StandardObserver, TableError};
use crate::evaluate::Material;
use crate::jobs::Text;
use crate::preview::{self, Question, Viewing};
use crate::store::Digest;
use crate::trust::Reach;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of the colours of materials.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(color))
}

/// Query parameters of a colour: directions, index, illuminant and observer.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ColorQuery {
    /// Incoming direction `θ,φ` in degrees. Default: `0,0`.
    #[param(value_type = Option<DirectionText>)]
    wi: Option<String>,
    /// Outgoing direction `θ,φ` in degrees. Default: all outgoing directions together (directional albedo, flux).
    #[param(value_type = Option<DirectionText>)]
    wo: Option<String>,
    /// Azimuth C of the outgoing direction of a luminaire in degrees, with `gamma` instead of `wo` (phi = C).
    c: Option<f64>,
    /// Angle of the outgoing direction of a luminaire from straight down in degrees, with `c` instead of `wo` (theta =
    /// 180° − gamma).
    #[param(minimum = 0, maximum = 180)]
    gamma: Option<f64>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. Default: every column of a
    /// spectral table.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    /// Illuminant: `A`, `B`, `C`, `D50`, `D65` (the default), `F11`, `E`, or the id of a stored material that is a
    /// spectrum.
    #[param(value_type = Option<IlluminantText>)]
    illuminant: Option<String>,
    /// Column of a stored table of illuminants, by its name or by its number, counted from 1.
    #[param(value_type = Option<Text>)]
    illuminant_column: Option<String>,
    /// Observer: `1931` (2°, the default), `1964` (10°), or the id of a stored table of x̄, ȳ, z̄.
    #[param(value_type = Option<ObserverText>)]
    observer: Option<String>,
}

/// Colours of a material, and the reference white to which they are relative.
#[derive(Debug, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Colors)]
struct ColorAnswer {
    /// Quantity that the colours describe: `reflectance`, `radiance factor`, `directional albedo`, `intensity`, `flux`,
    /// `spectrum` or `phase function` (× 4π).
    of: String,
    /// Name of the illuminant, or id of the stored spectrum that serves as one.
    illuminant: String,
    /// Name of the observer, or id of the stored table of colour-matching functions that serves as one.
    observer: String,
    /// Tristimulus values XYZ of the reference white, scaled to Y = 100.
    #[schema(min_items = 3, max_items = 3)]
    white: [f64; 3],
    /// One colour for each selected spectrum of the material; null if too few wavelengths were measured.
    colours: Vec<Option<Color>>,
}

/// Colour of one spectrum of a material, in several colour spaces.
#[derive(Debug, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Color {
    /// Zero-based position of the spectrum on each index axis (tensor axis before the directions).
    index: Vec<usize>,
    /// Label of the spectrum in its table, if it has one.
    label: Option<String>,
    /// Tristimulus values XYZ; the reference white has Y = 100.
    #[schema(min_items = 3, max_items = 3)]
    xyz: [f64; 3],
    /// CIE chromaticity (x, y); null for black.
    #[schema(min_items = 2, max_items = 2)]
    xy: Option<[f64; 2]>,
    /// CIE 1976 L*a*b*, relative to the reference white.
    #[schema(min_items = 3, max_items = 3)]
    lab: [f64; 3],
    /// Linear sRGB, chromatically adapted to the white of sRGB; may be out of gamut. Colours of light sources are
    /// scaled so that the largest channel over all colours of the answer is 1.
    #[schema(min_items = 3, max_items = 3)]
    linear_srgb: [f64; 3],
    /// Linear sRGB mapped into the gamut: hue and lightness in Oklab are kept, chroma is reduced.
    #[schema(min_items = 3, max_items = 3)]
    mapped_srgb: [f64; 3],
    /// Gamut-mapped colour in sRGB as `#rrggbb`.
    #[schema(pattern = "^#[0-9a-f]{6}$")]
    srgb: String,
    /// True if the colour needed no gamut mapping.
    in_gamut: bool,
    /// Correlated colour temperature of a light source in K; null if its distance from the Planckian locus in CIE 1960
    /// (u, v) exceeds 0.05.
    cct: Option<f64>,
    /// Distance of a light source from the Planckian locus in CIE 1960 (u, v), positive towards green.
    duv: Option<f64>,
    /// Luminous flux in lm or luminous intensity in cd, for a light source whose values have radiometric units.
    luminous: Option<f64>,
}

/// Compute the colour of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}/color", tag = "evaluation",
    params(("id" = Digest, Path, description = "Id of the material"), ColorQuery),
    responses((status = 200, description = "The colours", body = ColorAnswer))
)]
async fn color(app: App, caller: Caller, Id(id): Id, Query(query): Query<ColorQuery>) -> Result<Response, Problem> {
    let wi = read(query.wi.as_deref(), |text| direction("wi", text))?;
    let wo = read(query.wo.as_deref(), |text| direction("wo", text))?;
    let index = read(query.index.as_deref(), indices)?;
    let asked = Asked::of(query.illuminant, query.illuminant_column, query.observer)?.within(&caller)?;
    let material = open(&app, id).await?;
    let sources = asked.open(&app).await?;
    compute(&app, move || {
        let viewing = sources.viewing()?;
        let wo = outgoing(wo, (query.c, query.gamma), &material)?;
        let question = Question { index: index.as_deref(), wi, wo };
        Ok(preview::colours(&material, &question, &viewing)?)
    })
    .await
}

/// Illuminant and observer as the query parameters name them, before the stored tables are opened.
#[derive(Debug)]
pub(super) struct Asked {
    illuminant: Named<Illuminant>,
    column: Option<String>,
    observer: Named<StandardObserver>,
}

/// A standard illuminant or observer by name, or the digest of a stored table in its place.
#[derive(Clone, Debug)]
enum Named<T> {
    Standard(T),
    Stored(Digest),
}

/// Illuminant and observer of a colour query. Those that the client names by digest are opened from the store: tables
/// of a light's spectrum or of colour-matching functions.
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
            let detail =
                format!("illuminant_column: {light} has no columns, expected the id of a stored table as illuminant");
            return Err(Problem::new(Kind::BadQuery, detail));
        }
        Ok(Self { illuminant, column, observer: named("observer", observer)? })
    }

    /// Returns true if the illuminant or the observer is a stored table, which may be private.
    pub(super) fn has_stored(&self) -> bool {
        matches!(self.illuminant, Named::Stored(_)) || matches!(self.observer, Named::Stored(_))
    }

    /// Refuses stored tables of illuminants and observers to a caller whose token or link is limited to one material.
    pub(super) fn within(self, caller: &Caller) -> Result<Self, Problem> {
        if self.has_stored() && caller.reach != Reach::All {
            let detail = "the token is for one material, expected the name of an illuminant and observer, not an id";
            return Err(Problem::new(Kind::MissingScope, detail));
        }
        Ok(self)
    }

    /// Returns a cache key, which is equal for queries with equal illuminant, illuminant column and observer.
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
