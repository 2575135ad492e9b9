//! Reads COLMAP's binary files: little-endian numbers, each list after its count.

use camera::LensModel;

use super::raw::{ImagePoints, RawCamera, RawImage, RawObservation, RawPoint};
use crate::camera_file::Fault;

/// Size of a camera record without its parameters, bytes.
const CAMERA_BYTES: usize = 24;
/// Size of an image record without the characters of its name and without its points, bytes.
const IMAGE_BYTES: usize = 73;
/// Size of a point in an image record, bytes: two f64 and the identifier of the 3D point.
const IMAGE_POINT_BYTES: usize = 24;
/// Size of a 3D point record without its track, bytes.
const POINT_BYTES: usize = 51;
/// Size of an element of a track, bytes.
const TRACK_BYTES: usize = 8;
/// Length at which an image name must have ended, bytes.
const NAME_LIMIT: usize = 4096;

pub(super) fn cameras(bytes: &[u8]) -> Result<Vec<RawCamera>, Fault> {
    let mut bytes = Bytes { all: bytes, at: 0 };
    let count = bytes.count("cameras", CAMERA_BYTES)?;
    (0..count).map(|_| camera(&mut bytes)).collect()
}

pub(super) fn images(bytes: &[u8], keep: ImagePoints) -> Result<Vec<RawImage>, Fault> {
    let mut bytes = Bytes { all: bytes, at: 0 };
    let count = bytes.count("images", IMAGE_BYTES)?;
    (0..count).map(|_| image(&mut bytes, keep)).collect()
}

pub(super) fn points(bytes: &[u8]) -> Result<Vec<RawPoint>, Fault> {
    let mut bytes = Bytes { all: bytes, at: 0 };
    let count = bytes.count("points", POINT_BYTES)?;
    (0..count).map(|_| point(&mut bytes)).collect()
}

fn point(bytes: &mut Bytes<'_>) -> Result<RawPoint, Fault> {
    let place = bytes.place();
    bytes.u64()?;
    let position = [bytes.f64()?, bytes.f64()?, bytes.f64()?];
    let [r, g, b] = bytes.take::<3>()?;
    let error_px = bytes.f64()?;
    let count = bytes.count("observations", TRACK_BYTES)?;
    let track = (0..count).map(|_| Ok(RawObservation { image: bytes.u32()?, index: bytes.u32()? }));
    let track = track.collect::<Result<_, _>>()?;
    Ok(RawPoint { position, color: [r, g, b], error_px, track, place })
}

fn camera(bytes: &mut Bytes<'_>) -> Result<RawCamera, Fault> {
    let place = bytes.place();
    let (id, number) = (bytes.u32()?, bytes.u32()?);
    let model = LensModel::from_number(number).ok_or_else(|| Fault {
        what: format!("{number} is not the number of a COLMAP camera model"),
        place: place.clone(),
    })?;
    let (width, height) = (bytes.u64()?, bytes.u64()?);
    let parameters = (0..model.parameter_count()).map(|_| bytes.f64()).collect::<Result<_, _>>()?;
    Ok(RawCamera { id, model, width, height, parameters, place })
}

fn image(bytes: &mut Bytes<'_>, keep: ImagePoints) -> Result<RawImage, Fault> {
    let place = bytes.place();
    let id = bytes.u32()?;
    let mut pose = [0.0; 7];
    for value in &mut pose {
        *value = bytes.f64()?;
    }
    let camera = bytes.u32()?;
    let name = bytes.text()?;
    let count = bytes.u64()?;
    let points = match keep {
        ImagePoints::Skip => {
            bytes.skip(count.checked_mul(IMAGE_POINT_BYTES as u64), "the points of an image")?;
            Vec::new()
        }
        ImagePoints::Keep => {
            let end = bytes.after(count.checked_mul(IMAGE_POINT_BYTES as u64), "the points of an image")?;
            let mut points = Vec::with_capacity((end - bytes.at) / IMAGE_POINT_BYTES);
            while bytes.at < end {
                points.push([bytes.f64()?, bytes.f64()?]);
                bytes.u64()?;
            }
            points
        }
    };
    let [w, x, y, z, tx, ty, tz] = pose;
    Ok(RawImage { id, quaternion: [w, x, y, z], translation: [tx, ty, tz], camera, name, points, place })
}

/// A cursor over the bytes of a file.
struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
}

impl Bytes<'_> {
    fn place(&self) -> String {
        format!("byte {}", self.at)
    }

    fn ends(&self, what: &str) -> Fault {
        Fault { what: format!("the file ends in {what}"), place: self.place() }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let found = self.all.get(self.at..).and_then(|rest| rest.first_chunk::<N>());
        let found = *found.ok_or_else(|| self.ends("the middle of a number"))?;
        self.at += N;
        Ok(found)
    }

    fn u32(&mut self) -> Result<u32, Fault> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, Fault> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, Fault> {
        self.take().map(f64::from_le_bytes)
    }

    /// Reads a count of records of at least `each` bytes, and refuses more than the rest of the
    /// file can hold.
    fn count(&mut self, what: &str, each: usize) -> Result<u64, Fault> {
        let place = self.place();
        let count = self.u64()?;
        let room = (self.all.len() - self.at) / each;
        if count > room as u64 {
            return Err(Fault {
                what: format!("the file announces {count} {what}, the rest of it has room for {room}"),
                place,
            });
        }
        Ok(count)
    }

    fn text(&mut self) -> Result<String, Fault> {
        let rest = self.all.get(self.at..).unwrap_or_default();
        let end = rest.iter().take(NAME_LIMIT).position(|&b| b == 0).ok_or_else(|| self.ends("an image name"))?;
        let text = String::from_utf8_lossy(&rest[..end]).into_owned();
        self.at += end + 1;
        Ok(text)
    }

    /// Returns the offset after the next `count` bytes, if the file holds them.
    fn after(&self, count: Option<u64>, what: &str) -> Result<usize, Fault> {
        let room = (self.all.len() - self.at) as u64;
        let count = count.filter(|&count| count <= room).ok_or_else(|| self.ends(what))?;
        Ok(self.at + count as usize)
    }

    fn skip(&mut self, count: Option<u64>, what: &str) -> Result<(), Fault> {
        self.at = self.after(count, what)?;
        Ok(())
    }
}
