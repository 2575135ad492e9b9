//! The model and mesh that an export writes.

use std::io::Write;

use city::{CityModel, TriangleMesh};

/// A model and its triangles.
pub(super) struct Export<'a> {
    pub(super) model: &'a CityModel,
    pub(super) mesh: &'a TriangleMesh,
}

impl Export<'_> {
    /// Iterates over the objects with triangles, and their ranges of triangles, which are in the
    /// order of the objects.
    pub(super) fn objects(&self) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
        let object = |triangle: usize| self.mesh.surface(triangle).object as usize;
        let mut start = 0;
        std::iter::from_fn(move || {
            let first = (start < self.mesh.triangles.len()).then(|| object(start))?;
            let count = (start..self.mesh.triangles.len()).take_while(|&t| object(t) == first).count();
            let range = start..start + count;
            start = range.end;
            Some((first, range))
        })
    }

    /// Returns the identifier of an object on one line, without spaces.
    pub(super) fn name(&self, object: usize) -> String {
        let id = self.model.objects.get(object).map_or("", |object| object.id.as_str());
        id.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect()
    }

    /// Returns comments with the reference system and the origin.
    pub(super) fn remarks(&self) -> [String; 2] {
        let origin = self.mesh.origin;
        let crs: String = self.model.crs.to_string().chars().filter(|c| !c.is_control()).collect();
        [format!("crs {crs}"), format!("origin {} {} {}", origin.x, origin.y, origin.z)]
    }
}

/// Writes a line.
pub(super) fn line(out: &mut dyn Write, text: std::fmt::Arguments<'_>) -> std::io::Result<()> {
    out.write_fmt(text)?;
    out.write_all(b"\n")
}
