//! Implicit geometries: shapes with their own coordinates, placed by a 4 × 4 matrix in row order
//! and a reference point.
//!
//! The shape is inside the element, or elsewhere in the file behind a link. A library in another
//! file is never opened.

use city::{DefectCode, ModelPoint};

use crate::placement::Placement;

const IDENTITY: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// The elements of an implicit geometry apart from its shape.
#[derive(Debug, Default)]
pub(super) struct Implicit {
    matrix: Option<Vec<f64>>,
    reference: Option<Vec<f64>>,
    library: Option<String>,
    /// A word where a number was expected.
    broken: Option<String>,
}

/// An element with text in an implicit geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Matrix,
    Reference,
    Library,
}

impl Field {
    /// Returns the field that an element is, within its `parents` (innermost last).
    pub(super) fn of<'a>(name: &str, mut parents: impl DoubleEndedIterator<Item = &'a str>) -> Option<Self> {
        match name {
            "transformationMatrix" => Some(Self::Matrix),
            "libraryObject" => Some(Self::Library),
            "pos" | "coordinates" if parents.rfind(|name| *name != "Point") == Some("referencePoint") => {
                Some(Self::Reference)
            }
            _ => None,
        }
    }
}

impl Implicit {
    /// Stores the text of a field.
    pub(super) fn take(&mut self, field: Field, text: &str) {
        if field == Field::Library {
            self.library = Some(text.trim().chars().take(80).collect());
            return;
        }
        let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
        let mut numbers = Vec::new();
        for word in words {
            match word.parse::<f64>() {
                Ok(number) => numbers.push(number),
                Err(_) => self.broken = Some(word.chars().take(20).collect()),
            }
        }
        match field {
            Field::Matrix => self.matrix = Some(numbers),
            _ => self.reference = Some(numbers),
        }
    }

    /// Returns the defect of an implicit geometry without a shape.
    pub(super) fn without_shape(&self) -> (DefectCode, String) {
        match &self.library {
            Some(name) => (
                DefectCode::NotSupported,
                format!("the shape of an implicit geometry is in another file, {name:?}, which is not opened"),
            ),
            None => (DefectCode::EmptyPrimitive, "an implicit geometry without a shape".to_owned()),
        }
    }

    /// Returns the placement of the shape.
    ///
    /// # Errors
    /// The defect that keeps it from being placed.
    pub(super) fn placement(&self) -> Result<Placement, (DefectCode, String)> {
        if let Some(word) = &self.broken {
            return Err((
                DefectCode::CoordinateOutOfRange,
                format!("found {word:?} in an implicit geometry, expected a number"),
            ));
        }
        let missing = |what: &str| (DefectCode::UnresolvedReference, format!("an implicit geometry needs {what}"));
        let matrix = match &self.matrix {
            None => IDENTITY,
            Some(numbers) => numbers[..].try_into().map_err(|_| missing("a transformationMatrix of 16 numbers"))?,
        };
        let reference: Option<[f64; 3]> = self.reference.as_deref().and_then(|numbers| numbers.try_into().ok());
        let origin = ModelPoint::from(reference.ok_or_else(|| missing("a referencePoint of three numbers"))?);
        Ok(Placement { matrix, origin })
    }
}
