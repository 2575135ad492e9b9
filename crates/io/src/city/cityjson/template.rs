//! Geometry templates: a shape with its own vertices, placed at a vertex of the model by a 4 × 4 matrix (row by row).

use std::collections::HashMap;
use std::ops::Range;

use mesh::{DefectCode, ModelPoint};

use super::geometry::{Place, add};
use super::schema::{Nested, Shape, Templates};
use crate::city::CityFault;
use crate::city::builder::Builder;

/// Vertices that the instances of a file may make: a few kilobytes of text can ask for as many as they like.
const MAX_VERTICES: usize = 20_000_000;

/// The instances of a file, counted.
#[derive(Debug, Default)]
pub(super) struct Instances {
    vertices: usize,
}

impl Instances {
    /// Adds an instance as a geometry of its own. `vertices` are those of the document in the model.
    pub(super) fn add(
        &mut self,
        builder: &mut Builder,
        instance: &Shape,
        templates: Option<&Templates>,
        vertices: Range<usize>,
        place: Place,
    ) -> Result<(), CityFault> {
        let at = format!("geometry {}", place.geometry);
        let found = template(instance, templates).and_then(|(shape, all)| {
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
        let used = used_vertices(shape, positions.len());
        self.vertices += used.len();
        if self.vertices > MAX_VERTICES {
            let what = format!("the instances of templates have more than {MAX_VERTICES} vertices");
            return Err(CityFault::unsupported(what, "geometry-templates"));
        }
        let origin = builder.position(anchor);
        let mut index_of = HashMap::with_capacity(used.len());
        for index in used {
            let vertex = builder.vertex(place_vertex(&matrix, positions[index], origin));
            index_of.insert(
                index as u64,
                vertex.ok_or_else(|| CityFault::unsupported("more than 2^32 vertices", at.clone()))?,
            );
        }
        add(builder, shape, |index| index_of.get(&index).copied(), place);
        Ok(())
    }
}

type Found<'a> = (&'a Shape, &'a [[f64; 3]]);

fn template<'a>(instance: &Shape, templates: Option<&'a Templates>) -> Result<Found<'a>, &'static str> {
    let index = instance.template.and_then(|index| usize::try_from(index).ok());
    let shape = index.and_then(|index| templates?.templates.get(index)).ok_or("a template that is in the file")?;
    if shape.kind.as_deref() == Some("GeometryInstance") {
        return Err("a template that is no instance itself");
    }
    Ok((shape, templates.map_or(&[], |t| &t.vertices)))
}

fn matrix(instance: &Shape) -> Result<[f64; 16], &'static str> {
    let matrix = instance.matrix.as_deref().and_then(|m| <[f64; 16]>::try_from(m).ok());
    matrix.ok_or("a transformationMatrix of 16 numbers")
}

/// The vertices that a shape uses, ascending; indices that are not there are left for [`add`] to report.
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

fn place_vertex(matrix: &[f64; 16], [x, y, z]: [f64; 3], origin: ModelPoint) -> ModelPoint {
    let row = |i: usize| matrix[4 * i] * x + matrix[4 * i + 1] * y + matrix[4 * i + 2] * z + matrix[4 * i + 3];
    ModelPoint::new(origin.x + row(0), origin.y + row(1), origin.z + row(2))
}
