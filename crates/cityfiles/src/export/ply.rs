//! Writes binary little-endian PLY. Positions are f32 metres from the origin in the comments.

use std::io::Write;

use formats::ply::write_header;

use super::source::Export;

pub(super) fn write(out: &mut dyn Write, export: &Export<'_>) -> std::io::Result<()> {
    let mesh = export.mesh;
    let elements: [(&str, usize, &[&str]); 2] = [
        ("vertex", mesh.positions.len(), &["float x", "float y", "float z"]),
        ("face", mesh.triangles.len(), &["list uchar int vertex_indices", "uchar class", "int object"]),
    ];
    write_header(out, &export.remarks(), &elements)?;
    for position in &mesh.positions {
        for coordinate in position {
            out.write_all(&(*coordinate as f32).to_le_bytes())?;
        }
    }
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let surface = mesh.surface(triangle);
        out.write_all(&[3])?;
        for corner in corners {
            out.write_all(&corner.to_le_bytes())?;
        }
        out.write_all(&[surface.class as u8])?;
        out.write_all(&surface.object.to_le_bytes())?;
    }
    Ok(())
}
