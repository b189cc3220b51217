//! JSON schema of a manifest, for the description of an HTTP interface.

use crate::domain::{Domain, Frame, Outside, Sampling, Unit, one_of};
use crate::formats::StatedQuantity;
use utoipa::openapi::schema::{AdditionalProperties, ArrayBuilder, ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

/// Name of the JSON schema of an axis in a manifest.
const AXIS: &str = "ArrayAxis";
/// Name of the JSON schema of a whole manifest, as opposed to a list of axes alone.
const WHOLE: &str = "ArrayDescription";

/// JSON schema of a manifest: the axes of an array and the meaning of its values, or the axes alone.
#[derive(Debug)]
pub struct ArrayManifest;

fn of_type(kind: Type, description: &str) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(kind).description(Some(description))
}

fn numbers(description: &str) -> ArrayBuilder {
    ArrayBuilder::new().items(ObjectBuilder::new().schema_type(Type::Number)).description(Some(description))
}

fn names<T: Copy>(all: &[T], name: fn(T) -> &'static str) -> Vec<&'static str> {
    all.iter().map(|&known| name(known)).collect()
}

/// Returns the JSON schema of an axis, which is text in a short form or an object.
fn axis() -> Schema {
    let text = "Axis in its short form: `hemi:LEVEL`, `lower:LEVEL`, `sphere:LEVEL`, `lambda:START:STEP:COUNT`, `rgb` or `index`.";
    let long = ObjectBuilder::new()
        .property(
            "kind",
            of_type(Type::String, "Kind of the axis: triangles, directions, wavelength, elevation, index."),
        )
        .property("name", of_type(Type::String, "Name of an angle: theta_i, phi_i, theta_o or phi_o."))
        .property("unit", of_type(Type::String, "Unit of the entries: deg, nm or um."))
        .property("domain", one_of("Directions that triangles cover.", names(Domain::ALL, Domain::name)))
        .property("level", of_type(Type::Integer, "Subdivision level of triangles.").minimum(Some(0.0)))
        .property("frame", one_of("Frame of a grid of directions.", names(Frame::ALL, Frame::name)))
        .property("polar", numbers("Polar angles of a grid of directions."))
        .property("azimuths", numbers("Azimuths of a grid of directions."))
        .property("extent", of_type(Type::String, "Continuation of the azimuths to the full circle."))
        .property("covers", numbers("First and last polar angle that the values hold for."))
        .property("mirrored", of_type(Type::Boolean, "True if polar angles of the other sign mirror the stated ones."))
        .property("outside", one_of("Value outside of a grid.", names(Outside::ALL, Outside::name)))
        .property("start", of_type(Type::Number, "First entry of an even axis."))
        .property("step", of_type(Type::Number, "Distance between entries of an even axis."))
        .property("count", of_type(Type::Integer, "Number of entries.").minimum(Some(0.0)))
        .property("values", numbers("The entries."))
        .property("labels", ArrayBuilder::new().items(ObjectBuilder::new().schema_type(Type::String)))
        .additional_properties(Some(AdditionalProperties::FreeForm(false)));
    let either =
        OneOfBuilder::new().description(Some("Axis of an array.")).item(of_type(Type::String, text)).item(long);
    either.into()
}

/// Returns the JSON schema of a manifest with all its fields.
fn whole() -> Schema {
    let other = OneOfBuilder::new()
        .item(of_type(Type::String, "Text."))
        .item(of_type(Type::Number, "Number."))
        .item(of_type(Type::Boolean, "Flag."));
    let whole = ObjectBuilder::new()
        .description(Some("Axes of an array, and the quantity, unit and meaning of its values. Other fields are kept."))
        .property("axes", axes())
        .required("axes")
        .property("quantity", one_of("Quantity of the values.", names(StatedQuantity::ALL, StatedQuantity::name)))
        .property("value_unit", one_of("Unit of the values.", names(Unit::ALL, Unit::name)))
        .property("unit", one_of("Another name of `value_unit`.", names(Unit::ALL, Unit::name)))
        .property("sampling", one_of("Meaning of a value on triangles.", names(Sampling::ALL, Sampling::name)))
        .property("cosine_included", of_type(Type::Boolean, "True if the values hold |cos theta_o|."))
        .property("detector_aperture", of_type(Type::Number, "Full angle of the detector's aperture in degrees."))
        .property("source_divergence", of_type(Type::Number, "Full angle of the source's divergence in degrees."))
        .additional_properties(Some(AdditionalProperties::RefOr(Schema::from(other.build()).into())));
    whole.into()
}

fn axes() -> ArrayBuilder {
    ArrayBuilder::new().items(Ref::from_schema_name(AXIS)).description(Some("Axes of the array, outermost first."))
}

impl PartialSchema for ArrayManifest {
    fn schema() -> RefOr<Schema> {
        let description = "Axes of an array, as its manifest states them: the manifest, or its list of axes.";
        OneOfBuilder::new().description(Some(description)).item(Ref::from_schema_name(WHOLE)).item(axes()).into()
    }
}

impl ToSchema for ArrayManifest {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((AXIS.to_owned(), axis().into()));
        schemas.push((WHOLE.to_owned(), whole().into()));
    }
}
