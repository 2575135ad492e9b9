//! Geometry templates: shapes with their own vertices, placed at a vertex of the model by a 4 × 4
//! matrix in row order.

use std::ops::Range;

use city::DefectCode;

use super::appearance::Numbers;
use super::geometry::{Place, add};
use super::schema::{Lenient, Nested, Pairs, Shape, Templates};
use crate::builder::Builder;
use crate::error::CityFault;
use crate::placement::{Instances, Placement, attributes_size, surface_size};

/// The templates of a file, and the appearance that they refer to.
#[derive(Clone, Copy)]
pub(super) struct Library<'a> {
    pub(super) templates: Option<&'a Templates>,
    pub(super) numbers: &'a Numbers,
}

/// Adds an instance as a geometry. `vertices` is the range of the document's vertices in the model.
pub(super) fn add_instance(
    builder: &mut Builder,
    instances: &mut Instances,
    instance: &Shape,
    library: Library<'_>,
    vertices: Range<usize>,
    place: Place,
) -> Result<(), CityFault> {
    let at = format!("geometry {}", place.geometry);
    let found = template(instance, library.templates).and_then(|(shape, all)| {
        let [Nested::Index(anchor)] = instance.boundaries.list() else { return Err("one vertex as boundaries") };
        let anchor = usize::try_from(*anchor).ok().filter(|&i| i < vertices.len());
        let anchor = anchor.ok_or("a vertex of the model as boundaries")?;
        Ok((shape, all, (vertices.start + anchor) as u32, matrix(instance)?))
    });
    let (shape, positions, anchor, matrix) = match found {
        Ok(found) => found,
        Err(missing) => {
            let detail = format!("an instance needs {missing}");
            builder.dropped(DefectCode::UnresolvedReference, place.object, at, detail);
            return Ok(());
        }
    };
    if !builder.is_usable(anchor) {
        builder.dropped(DefectCode::CoordinateOutOfRange, place.object, at, "");
        return Ok(());
    }
    let placement = Placement { matrix, origin: builder.position(anchor) };
    let used = used_vertices(shape, positions.len());
    let sizes = [size(&shape.boundaries), appearance_size(shape), semantics_size(shape)];
    instances.expansion.add(sizes.into_iter().fold(0, usize::saturating_add), 0, &at)?;
    let index_of =
        instances.place(builder, &placement, used.into_iter().map(|index| (index as u64, positions[index])), &at)?;
    add(builder, shape, library.numbers, |index| index_of.get(&index).copied(), place);
    Ok(())
}

/// A template, and the vertices of all templates.
type Found<'a> = (&'a Shape, &'a [[f64; 3]]);

fn template<'a>(instance: &Shape, templates: Option<&'a Templates>) -> Result<Found<'a>, &'static str> {
    let index = instance.template.and_then(|index| usize::try_from(index).ok());
    let shape = index.and_then(|index| templates?.templates.get(index)).ok_or("a template of the file")?;
    if shape.kind.as_deref() == Some("GeometryInstance") {
        return Err("a template that is not an instance itself");
    }
    Ok((shape, templates.map_or(&[], |t| &t.vertices)))
}

fn matrix(instance: &Shape) -> Result<[f64; 16], &'static str> {
    let matrix = instance.matrix.as_deref().and_then(|m| <[f64; 16]>::try_from(m).ok());
    matrix.ok_or("a transformationMatrix of 16 numbers")
}

/// Returns the size of the surfaces of nested boundaries: each list counts as a surface or a ring.
fn size(boundaries: &Nested) -> usize {
    let mut total = 0usize;
    let mut open = vec![boundaries];
    while let Some(nested) = open.pop() {
        if let Nested::List(list) = nested {
            total = total.saturating_add(surface_size(1, list.len()));
            open.extend(list);
        }
    }
    total
}

/// Returns the size of the materials and textures of a shape. A material of all surfaces costs
/// each of them an entry.
fn appearance_size(shape: &Shape) -> usize {
    let mut total = 0usize;
    for themes in [&shape.material, &shape.texture] {
        let Lenient::Good(Pairs(themes)) = themes else { continue };
        for (_, theme) in themes {
            let Lenient::Good(theme) = theme else { continue };
            total = total.saturating_add(size(&theme.values)).saturating_add(size(&shape.boundaries));
        }
    }
    total
}

/// Returns the size of the attributes of the surfaces of a shape.
fn semantics_size(shape: &Shape) -> usize {
    let surfaces = shape.semantics.iter().flat_map(|semantics| &semantics.surfaces);
    surfaces.map(|surface| attributes_size(&surface.attributes)).fold(0, usize::saturating_add)
}

/// Returns the vertices that a shape uses, ascending. [`add`] reports indices that do not exist.
fn used_vertices(shape: &Shape, count: usize) -> Vec<usize> {
    let mut used = Vec::new();
    let mut open = vec![&shape.boundaries];
    while let Some(nested) = open.pop() {
        match nested {
            Nested::List(list) => open.extend(list),
            Nested::Index(index) => used.extend(usize::try_from(*index).ok().filter(|&i| i < count)),
            Nested::Null | Nested::Other => {}
        }
    }
    used.sort_unstable();
    used.dedup();
    used
}
