//! Writes binary little-endian PLY. Positions are f32 metres from the origin in the comments.

use std::io::Write;

use super::source::{Export, line};

pub(super) fn write(out: &mut dyn Write, export: &Export<'_>) -> std::io::Result<()> {
    let mesh = export.mesh;
    line(out, format_args!("ply\nformat binary_little_endian 1.0"))?;
    for remark in export.remarks() {
        line(out, format_args!("comment {remark}"))?;
    }
    line(out, format_args!("element vertex {}", mesh.positions.len()))?;
    line(out, format_args!("property float x\nproperty float y\nproperty float z"))?;
    line(out, format_args!("element face {}", mesh.triangles.len()))?;
    line(out, format_args!("property list uchar int vertex_indices\nproperty uchar class\nproperty int object"))?;
    line(out, format_args!("end_header"))?;
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
