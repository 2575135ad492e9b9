//! Writes Wavefront OBJ with full coordinates, rounded to 1 µm, and the classes as material names.

use std::io::Write;

use city::SurfaceClass;

use super::source::{Export, line};

pub(super) fn write(out: &mut dyn Write, export: &Export<'_>) -> std::io::Result<()> {
    let (mesh, origin) = (export.mesh, export.mesh.origin);
    line(out, format_args!("# {}", export.remarks()[0]))?;
    let whole = |local: f64, origin: f64| ((local + origin) * 1e6).round() / 1e6;
    for &[x, y, z] in &mesh.positions {
        let (x, y, z) = (whole(x, origin.x), whole(y, origin.y), whole(z, origin.z));
        line(out, format_args!("v {x} {y} {z}"))?;
    }
    for (object, triangles) in export.objects() {
        line(out, format_args!("o {}", export.name(object)))?;
        let mut class: Option<SurfaceClass> = None;
        for triangle in triangles {
            let now = mesh.surface(triangle).class;
            if class.replace(now) != Some(now) {
                line(out, format_args!("usemtl {now}"))?;
            }
            let [a, b, c] = mesh.triangles[triangle].map(|corner| u64::from(corner) + 1);
            line(out, format_args!("f {a} {b} {c}"))?;
        }
    }
    Ok(())
}
