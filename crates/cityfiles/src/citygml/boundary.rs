//! Boundary surfaces: their classes, and the attributes that their polygons share.
//!
//! CityJSON describes the surfaces of a geometry by an object with a `type` and any attributes. An
//! attribute with the name of a member of that object, and attributes of surfaces that the model
//! has no class or no polygon for, are counted.

use std::collections::HashMap;
use std::sync::Arc;

use city::SurfaceClass;
use serde_json::{Map, Value};

use super::properties::{Ended, add};
use crate::builder::Builder;
use crate::cityjson::is_written;
use crate::placement::attributes_size;

/// Members of CityJSON's description of a surface that are not attributes.
const RESERVED: [&str; 3] = ["type", "parent", "children"];

/// Attributes that the polygons of a boundary surface share.
pub(super) type SharedAttributes = Arc<Map<String, Value>>;

/// A boundary surface: its class, and the number of its attributes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Boundary {
    pub(super) class: SurfaceClass,
    number: usize,
}

/// The attributes of the boundary surfaces of a document.
#[derive(Debug, Default)]
pub(super) struct SurfaceAttributes {
    /// Number of boundary surfaces. Number 0 stands for none.
    count: usize,
    of_number: HashMap<usize, Map<String, Value>>,
    /// Attributes that the description of a surface cannot hold.
    lost: usize,
}

impl SurfaceAttributes {
    /// Begins a boundary surface.
    pub(super) fn boundary(&mut self, class: SurfaceClass) -> Boundary {
        self.count += 1;
        Boundary { class, number: self.count }
    }

    /// Adds an attribute or an address to a boundary surface.
    pub(super) fn add(&mut self, boundary: Boundary, ended: Ended) {
        let (name, value) = match ended {
            Ended::Attribute(name, value) => (name, value),
            Ended::Address(parts) => ("address".to_owned(), Some(parts)),
            Ended::Nothing => return,
        };
        if RESERVED.contains(&&*name) || !is_written(boundary.class) {
            self.lost += usize::from(value.is_some());
        } else {
            add(self.of_number.entry(boundary.number).or_default(), &name, value);
        }
    }

    /// Returns the size of the attributes of a boundary surface, in the unit of [`Expansion`].
    ///
    /// [`Expansion`]: crate::placement::Expansion
    pub(super) fn size(&self, boundary: Boundary) -> usize {
        self.of_number.get(&boundary.number).map_or(0, attributes_size)
    }

    /// Gives the polygons the attributes of their boundary surfaces, and counts those that no
    /// polygon has.
    pub(super) fn give<'a>(
        self,
        builder: &mut Builder,
        polygons: impl Iterator<Item = (Boundary, &'a mut Option<SharedAttributes>)>,
    ) {
        let of_number: HashMap<usize, SharedAttributes> =
            self.of_number.into_iter().map(|(number, attributes)| (number, Arc::new(attributes))).collect();
        for (boundary, attributes) in polygons {
            *attributes = of_number.get(&boundary.number).cloned();
        }
        let without_polygon = of_number.values().filter(|attributes| Arc::strong_count(attributes) == 1);
        let unused: usize = without_polygon.map(|attributes| attributes.len()).sum();
        builder.left_out("attributes of surfaces", self.lost + unused);
    }
}
