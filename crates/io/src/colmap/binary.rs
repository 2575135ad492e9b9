//! COLMAP's binary files: little-endian, counts first.

use camera::LensModel;

use super::points::RawPoint;
use super::{Fault, ImagePoints, RawCamera, RawImage};

/// Bytes of a camera without its parameters, of an image without name and points, of a point in an image, of a point in
/// space without its track, and of an element of the track.
const CAMERA_BYTES: usize = 24;
const IMAGE_BYTES: usize = 73;
const IMAGE_POINT_BYTES: usize = 24;
const POINT_BYTES: usize = 51;
const TRACK_BYTES: usize = 8;
/// Longest image name.
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
    let track = (0..count).map(|_| Ok((bytes.u32()?, bytes.u32()?))).collect::<Result<_, _>>()?;
    Ok(RawPoint { position, color: [r, g, b], error_px, track, place })
}

fn camera(bytes: &mut Bytes<'_>) -> Result<RawCamera, Fault> {
    let place = bytes.place();
    let (id, number) = (bytes.u32()?, bytes.u32()?);
    let model = LensModel::from_number(number)
        .ok_or_else(|| Fault { what: format!("{number} is no camera model of COLMAP"), place: place.clone() })?;
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
        ImagePoints::PassOver => {
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

    /// A count of things that take at least `each` bytes: more than the file can hold is refused.
    fn count(&mut self, what: &str, each: usize) -> Result<u64, Fault> {
        let place = self.place();
        let count = self.u64()?;
        let room = (self.all.len() - self.at) / each;
        if count > room as u64 {
            return Err(Fault { what: format!("{count} {what} are announced, and there is room for {room}"), place });
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

    /// Where so many bytes end, if the file holds them.
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
