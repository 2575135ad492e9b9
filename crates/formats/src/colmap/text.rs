//! Reads COLMAP's text files: one line per camera and per point, two per image.
//!
//! The second line of an image holds its points and may be empty.

use camera::LensModel;

use super::convention::shorten;
use super::raw::{ImagePoints, RawCamera, RawImage, RawObservation, RawPoint};
use crate::camera_file::Fault;

pub(super) fn cameras(text: &str) -> Result<Vec<RawCamera>, Fault> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    lines.map(|(number, line)| camera(&mut Words::new(line, number))).collect()
}

pub(super) fn images(text: &str, keep: ImagePoints) -> Result<Vec<RawImage>, Fault> {
    let mut images = Vec::new();
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
    while let Some((number, line)) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        let mut image = image(&mut Words::new(line, number))?;
        if let (Some((number, line)), ImagePoints::Keep) = (lines.next(), keep) {
            image.points = image_points(&mut Words::new(line, number))?;
        }
        images.push(image);
    }
    Ok(images)
}

pub(super) fn points(text: &str) -> Result<Vec<RawPoint>, Fault> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    lines.map(|(number, line)| point(&mut Words::new(line, number))).collect()
}

fn point(words: &mut Words<'_>) -> Result<RawPoint, Fault> {
    words.number::<u64>("the identifier of the point")?;
    let (mut position, mut color) = ([0.0; 3], [0; 3]);
    for value in &mut position {
        *value = words.number("the position")?;
    }
    for value in &mut color {
        *value = words.number("the colour")?;
    }
    let error_px = words.number("the error")?;
    let mut track = Vec::new();
    while !words.rest().is_empty() {
        let image = words.number("an image of the track")?;
        track.push(RawObservation { image, index: words.number("a point of the track")? });
    }
    Ok(RawPoint { position, color, error_px, track, place: words.place() })
}

fn image_points(words: &mut Words<'_>) -> Result<Vec<[f64; 2]>, Fault> {
    let mut points = Vec::new();
    while !words.rest().is_empty() {
        points.push([words.number("a point of the image")?, words.number("a point of the image")?]);
        words.number::<i64>("the identifier of a point")?;
    }
    Ok(points)
}

fn camera(words: &mut Words<'_>) -> Result<RawCamera, Fault> {
    let id = words.number("the identifier of the camera")?;
    let name = words.next("the model")?;
    let model = LensModel::from_name(name)
        .ok_or_else(|| words.fault(format!("{:?} is not the name of a COLMAP camera model", shorten(name))))?;
    let (width, height) = (words.number("the width")?, words.number("the height")?);
    let mut parameters = Vec::new();
    while parameters.len() <= model.parameter_count() && !words.rest().is_empty() {
        parameters.push(words.number("a parameter")?);
    }
    Ok(RawCamera { id, model, width, height, parameters, place: words.place() })
}

fn image(words: &mut Words<'_>) -> Result<RawImage, Fault> {
    let id = words.number("the identifier of the image")?;
    let mut pose = [0.0; 7];
    for value in &mut pose {
        *value = words.number("the pose")?;
    }
    let camera = words.number("the identifier of the camera")?;
    let [w, x, y, z, tx, ty, tz] = pose;
    // A name may contain spaces, so it is the rest of the line.
    let name = words.rest().to_owned();
    Ok(RawImage {
        id,
        quaternion: [w, x, y, z],
        translation: [tx, ty, tz],
        camera,
        name,
        points: Vec::new(),
        place: words.place(),
    })
}

/// A cursor over the words of a line.
struct Words<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(line: &'a str, number: usize) -> Self {
        Self { rest: line.trim(), line: number + 1 }
    }

    /// Returns the part of the line that is not read yet.
    fn rest(&self) -> &'a str {
        self.rest
    }

    fn place(&self) -> String {
        format!("line {}", self.line)
    }

    fn fault(&self, what: String) -> Fault {
        Fault { what, place: self.place() }
    }

    fn next(&mut self, what: &str) -> Result<&'a str, Fault> {
        if self.rest.is_empty() {
            return Err(self.fault(format!("the line ends before {what}")));
        }
        let (word, rest) = self.rest.split_once(char::is_whitespace).unwrap_or((self.rest, ""));
        self.rest = rest.trim_start();
        Ok(word)
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Fault> {
        let word = self.next(what)?;
        word.parse().map_err(|_| self.fault(format!("{what} is {:?}, expected a number", shorten(word))))
    }
}
