//! Header and records of LAS 1.4 for the cloud of a surface model.
//!
//! Specification: ASPRS LAS 1.4 R15; COPC 1.0 for its info record, which is the first.

use super::surface_cloud::{DIMENSIONS, EXTRA, Layout, RECORD};

/// Length of the header of LAS 1.4.
pub(super) const HEADER: usize = 375;
/// Bit of the global encoding: the reference system is WKT.
const WKT: u16 = 0x10;
/// Point format 7, compressed.
const FORMAT: u8 = 7 | 0x80;
/// Length of the header of a variable length record.
const RECORD_HEADER: usize = 54;

/// A variable length record.
pub(super) struct Vlr {
    pub(super) user: &'static str,
    pub(super) id: u16,
    pub(super) description: &'static str,
    pub(super) content: Vec<u8>,
}

impl Vlr {
    /// Returns the record of the reference system.
    pub(super) fn wkt(wkt: &str) -> Self {
        let content = wkt.bytes().chain([0]).collect();
        Self { user: "LASF_Projection", id: 2112, description: "WKT", content }
    }

    /// Returns the record that describes the extra bytes.
    pub(super) fn extra_bytes() -> Self {
        let mut content = Vec::new();
        for (name, kind, description) in DIMENSIONS {
            content.extend([0, 0, kind, 0]);
            content.extend(padded::<32>(name));
            content.extend([0; 124]);
            content.extend(padded::<32>(description));
        }
        Self { user: "LASF_Spec", id: 4, description: "extra bytes", content }
    }

    fn put(&self, out: &mut Vec<u8>) -> Result<(), String> {
        let length = u16::try_from(self.content.len()).map_err(|_| {
            format!("the record {:?} has {} bytes, at most 65535", self.description, self.content.len())
        })?;
        out.extend([0, 0]);
        out.extend(padded::<16>(self.user));
        out.extend(self.id.to_le_bytes());
        out.extend(length.to_le_bytes());
        out.extend(padded::<32>(self.description));
        out.extend(&self.content);
        Ok(())
    }
}

/// Returns an extended variable length record.
pub(super) fn extended(record: &Vlr) -> Vec<u8> {
    let mut out = vec![0, 0];
    out.extend(padded::<16>(record.user));
    out.extend(record.id.to_le_bytes());
    out.extend((record.content.len() as u64).to_le_bytes());
    out.extend(padded::<32>(record.description));
    out.extend(&record.content);
    out
}

/// Returns the header with its records. `extended_at` is the place of the only extended record.
///
/// # Errors
/// A text about a record that is too long.
pub(super) fn header(layout: &Layout<'_>, records: &[Vlr], extended_at: Option<u64>) -> Result<Vec<u8>, String> {
    let (year, day) = layout.date();
    let length: usize = HEADER + records.iter().map(|record| RECORD_HEADER + record.content.len()).sum::<usize>();
    let points = layout.extent.points;
    let mut out = Vec::with_capacity(length);
    out.extend(b"LASF");
    out.extend([0; 2]);
    out.extend(WKT.to_le_bytes());
    out.extend([0; 16]);
    out.extend([1, 4]);
    out.extend(padded::<32>("image matching"));
    out.extend(padded::<32>(concat!("skysweep ", env!("CARGO_PKG_VERSION"))));
    out.extend(day.to_le_bytes());
    out.extend(year.to_le_bytes());
    out.extend((HEADER as u16).to_le_bytes());
    out.extend((length as u32).to_le_bytes());
    out.extend((records.len() as u32).to_le_bytes());
    out.push(FORMAT);
    out.extend((RECORD as u16).to_le_bytes());
    // Numbers of points of older versions.
    out.extend([0; 24]);
    for value in layout.step.iter().chain(&layout.offset) {
        out.extend(value.to_le_bytes());
    }
    for axis in 0..3 {
        out.extend(layout.extent.high[axis].to_le_bytes());
        out.extend(layout.extent.low[axis].to_le_bytes());
    }
    out.extend([0; 8]);
    out.extend(extended_at.unwrap_or(0).to_le_bytes());
    out.extend(u32::from(extended_at.is_some()).to_le_bytes());
    out.extend(points.to_le_bytes());
    // All points are first returns.
    out.extend(points.to_le_bytes());
    out.extend([0; 14 * 8]);
    for record in records {
        record.put(&mut out)?;
    }
    Ok(out)
}

/// Returns a text in a field of fixed length, cut and filled with zeros.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut out = [0; N];
    let kept = text.len().min(N);
    out[..kept].copy_from_slice(&text.as_bytes()[..kept]);
    out
}

/// Number of extra bytes of a record, as the compressor wants it.
pub(super) const fn extra_bytes() -> u16 {
    EXTRA as u16
}
