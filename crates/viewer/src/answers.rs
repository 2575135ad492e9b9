//! What the page asks for: its files, the scene, tiles, grids of values, positions, profiles.
//!
//! | path | answer |
//! |---|---|
//! | `scene.json` | rasters, layers, legends |
//! | `space.json` | splats, meshes, cameras |
//! | `splats/NUMBER.bin`, `harmonics/NUMBER.bin` | splats as [`super::packed`] packs them |
//! | `labels/NUMBER.bin`, `objects/NUMBER.json` | labels of splats as [`super::packed`] packs them, and the table of their objects |
//! | `meshes/NUMBER.glb` | a mesh as it is |
//! | `tile/LAYER/LEVEL/X/Y.png` | tile of a layer; a pixel of a level has 2^level cells |
//! | `picture/LAYER.png?c&r&w&h&side` | window of a layer, at most `side` pixels wide and high |
//! | `grid/RASTER?c&r&w&h&side` | the same of the first band of a raster, as numbers |
//! | `vectors/NUMBER.json` | features of a layer of vectors in the units of the map |
//! | `at?x&y` | values of all rasters at a position |
//! | `profile?rasters&x1&y1&x2&y2` | values of rasters along a line |
//! | `job/NAME` | what a job behind the page has under a name; a POST asks it to do something |
//!
//! A grid begins with its columns and rows (u32), followed by f32 in rows; all little-endian, NaN
//! is no-data. Values are those of the cells of the raster, never interpolated.

use formats::raster::{ImageSource, RasterError};
use raster::{Grid, Window};
use report::{MapStyle, png_with_alpha};
use serde::Serialize;

use super::files::{ALIGN, SPACE, file};
use super::http::{Answer, BINARY, Refusal};
use super::page_job::{PageData, PageJob};
use super::query::{Query, whole};
use super::scene::{SIDE_MAX, Scene, SceneLayer, SceneRaster, TILE, reduced};
use super::space::Space;
use job::error_text::with_causes;

/// Most samples of a profile.
const SAMPLES_MAX: usize = 4000;
/// Most rasters of a profile.
const PROFILE_RASTERS_MAX: usize = 8;
/// Most cells that are read at once for a profile.
const PROFILE_CELLS: usize = 1 << 16;

/// Answers requests with open rasters of its own. Each thread has one.
pub(super) struct Answers<'a> {
    scene: &'a Scene,
    space: &'a Space,
    job: Option<&'a dyn PageJob>,
    /// Rasters that were used so far, by their numbers.
    open: Vec<Option<ImageSource>>,
}

/// Values at a position, by the numbers of the rasters and their bands. Missing values are null.
#[derive(Serialize)]
struct AtPosition {
    values: Vec<Vec<Option<f32>>>,
}

/// Values along a line.
#[derive(Serialize)]
struct Profile {
    /// Distances from the start, metres, or pixels without a georeference.
    distance: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    /// Values of each raster.
    values: Vec<Vec<Option<f32>>>,
}

impl<'a> Answers<'a> {
    pub(super) fn new(scene: &'a Scene, space: &'a Space, job: Option<&'a dyn PageJob>) -> Self {
        Self { scene, space, job, open: scene.rasters.iter().map(|_| None).collect() }
    }

    /// Answers the part of an address after the token.
    ///
    /// # Errors
    /// [`Refusal::NotFound`], [`Refusal::Malformed`], [`Refusal::Failed`].
    pub(super) fn answer(&mut self, path: &str, query: &str) -> Result<Answer, Refusal> {
        // Without rasters, the page of splats is the only one.
        let page = match path {
            "" if self.job.is_some() => ALIGN,
            "" if self.scene.rasters.is_empty() => SPACE,
            ALIGN if self.job.is_none() => return Err(Refusal::NotFound),
            path => path,
        };
        if let Some(answer) = file(page) {
            return Ok(answer);
        }
        if let Some(name) = path.strip_prefix("job/") {
            let found = self.job.and_then(|job| job.get(name)).ok_or(Refusal::NotFound)?;
            return found.map(Answer::from).map_err(Refusal::Failed);
        }
        let query = Query::new(query);
        let parts: Vec<&str> = path.splitn(6, '/').collect();
        match parts.as_slice() {
            ["scene.json"] => json(self.scene),
            ["space.json"] => json(self.space),
            [kind @ ("splats" | "harmonics" | "labels" | "objects" | "meshes"), name] => {
                self.space.bytes(kind, name).ok_or(Refusal::NotFound)
            }
            ["tile", layer, level, x, y] => self.tile(layer, level, x, y),
            ["picture", layer] => self.picture(layer, &query),
            ["grid", raster] => self.grid(raster, &query),
            ["vectors", number] => self.vectors(number),
            ["at"] => self.at(&query),
            ["profile"] => self.profile(&query),
            _ => Err(Refusal::NotFound),
        }
    }

    /// Passes the body of a POST to the job behind the page. What it refuses is told in its words.
    ///
    /// # Errors
    /// [`Refusal::NotFound`], [`Refusal::Malformed`].
    pub(super) fn post(&self, path: &str, body: &[u8]) -> Result<Answer, Refusal> {
        let name = path.strip_prefix("job/").ok_or(Refusal::NotFound)?;
        let found = self.job.and_then(|job| job.post(name, body)).ok_or(Refusal::NotFound)?;
        found.map(|text| PageData::Json(text).into()).map_err(Refusal::Malformed)
    }

    fn vectors(&self, number: &str) -> Result<Answer, Refusal> {
        let number = number.strip_suffix(".json").and_then(whole);
        let vectors = number.and_then(|number| self.scene.vectors.get(number)).ok_or(Refusal::NotFound)?;
        Ok(Answer { kind: "application/json", body: vectors.features.clone().into() })
    }

    fn tile(&mut self, layer: &str, level: &str, x: &str, y: &str) -> Result<Answer, Refusal> {
        let layer = self.layer(layer)?;
        let raster = self.raster(layer.raster)?;
        let level = whole(level).filter(|level| *level <= raster.levels as usize).ok_or(Refusal::NotFound)?;
        let step = 1_usize << level;
        let start = |at: Option<usize>| at.and_then(|at| at.checked_mul(TILE * step)).ok_or(Refusal::NotFound);
        let (x, y) = (start(whole(x))?, start(y.strip_suffix(".png").and_then(whole))?);
        let side = TILE * step;
        let wanted = Window { x: x as i64, y: y as i64, width: side, height: side };
        let window = raster.window().intersection(&wanted).ok_or(Refusal::NotFound)?;
        png(&self.draw(layer, window, (window.width.div_ceil(step), window.height.div_ceil(step)))?)
    }

    fn picture(&mut self, layer: &str, query: &Query<'_>) -> Result<Answer, Refusal> {
        let layer = self.layer(layer.strip_suffix(".png").ok_or(Refusal::NotFound)?)?;
        let (window, size) = window(self.raster(layer.raster)?, query)?;
        png(&self.draw(layer, window, size)?)
    }

    fn grid(&mut self, raster: &str, query: &Query<'_>) -> Result<Answer, Refusal> {
        let index = whole(raster).ok_or(Refusal::NotFound)?;
        let raster = self.raster(index)?;
        let (window, size) = window(raster, query)?;
        let band = raster.bands.first().copied().unwrap_or(1);
        let grid = self.source(index)?.read_reduced(band, window, size).map_err(failed)?;
        let mut body = Vec::with_capacity(8 + 4 * grid.data().len());
        [size.0, size.1].iter().for_each(|side| body.extend_from_slice(&(*side as u32).to_le_bytes()));
        grid.data().iter().for_each(|value| body.extend_from_slice(&value.to_le_bytes()));
        Ok(Answer { kind: BINARY, body: body.into() })
    }

    fn at(&mut self, query: &Query<'_>) -> Result<Answer, Refusal> {
        let (x, y) = (query.number("x")?, query.number("y")?);
        let mut values = Vec::new();
        for (index, raster) in self.scene.rasters.iter().enumerate() {
            let cell = raster.cell(x, y);
            let mut of_bands = Vec::new();
            for &band in &raster.bands {
                of_bands.push(match cell {
                    Some((column, row)) => self.value(index, band, column, row)?,
                    None => None,
                });
            }
            values.push(of_bands);
        }
        json(&AtPosition { values })
    }

    fn value(&mut self, raster: usize, band: usize, column: usize, row: usize) -> Result<Option<f32>, Refusal> {
        let window = Window { x: column as i64, y: row as i64, width: 1, height: 1 };
        let cell = self.source(raster)?.read_reduced(band, window, (1, 1)).map_err(failed)?;
        Ok(cell.get(0, 0).copied().filter(|value| value.is_finite()))
    }

    fn profile(&mut self, query: &Query<'_>) -> Result<Answer, Refusal> {
        let rasters: Vec<usize> = query.text("rasters")?.split(',').map_while(whole).collect();
        let first = *rasters.first().ok_or_else(|| Refusal::Malformed("rasters has no number".to_owned()))?;
        if rasters.len() > PROFILE_RASTERS_MAX {
            return Err(Refusal::Malformed(format!("rasters has more than {PROFILE_RASTERS_MAX} numbers")));
        }
        let (x, y) = ((query.number("x1")?, query.number("x2")?), (query.number("y1")?, query.number("y2")?));
        let first = self.raster(first)?;
        let count = samples(first, (x.0, y.0), (x.1, y.1));
        let along = |ends: (f64, f64)| -> Vec<f64> {
            (0..count).map(|i| ends.0 + (ends.1 - ends.0) * (i as f64 / (count - 1) as f64)).collect()
        };
        let (xs, ys) = (along(x), along(y));
        let metres = self.scene.map.metres;
        let length = ((x.1 - x.0) * metres.0).hypot((y.1 - y.0) * metres.1);
        let mut values = Vec::new();
        for index in rasters {
            values.push(self.along(index, &xs, &ys)?);
        }
        json(&Profile { distance: along((0.0, length)), x: xs, y: ys, values })
    }

    /// Returns the values of the cells at some positions. Successive positions are read together.
    fn along(&mut self, index: usize, xs: &[f64], ys: &[f64]) -> Result<Vec<Option<f32>>, Refusal> {
        let raster = self.raster(index)?;
        let band = raster.bands.first().copied().unwrap_or(1);
        let cells: Vec<Option<(usize, usize)>> = xs.iter().zip(ys).map(|(x, y)| raster.cell(*x, *y)).collect();
        let mut values = vec![None; cells.len()];
        let mut next = 0;
        while next < cells.len() {
            let (window, end) = together(&cells, next);
            if let Some(window) = window {
                let size = (window.width, window.height);
                let part = self.source(index)?.read_reduced(band, window, size).map_err(failed)?;
                for (value, cell) in values[next..end].iter_mut().zip(&cells[next..end]) {
                    let inside = |(column, row): (usize, usize)| (column - window.x as usize, row - window.y as usize);
                    *value = cell.map(inside).and_then(|(c, r)| part.get(c, r)).copied().filter(|v| v.is_finite());
                }
            }
            next = end;
        }
        Ok(values)
    }

    /// Draws a window of a layer. Shades need a neighbour on each side, so that tiles fit together.
    fn draw(&mut self, layer: &SceneLayer, window: Window, size: (usize, usize)) -> Result<Grid<[u8; 4]>, Refusal> {
        let raster = self.raster(layer.raster)?;
        let step = (window.width.div_ceil(size.0), window.height.div_ceil(size.1));
        let is_shaded = matches!(layer.style, MapStyle::Hillshade | MapStyle::Relief { .. });
        let before = |start: i64, step: usize| usize::from(is_shaded && start >= step as i64);
        let after = |start: i64, length: usize, step: usize, count: usize| {
            usize::from(is_shaded && start as usize + length + step <= count)
        };
        let (left, top) = (before(window.x, step.0), before(window.y, step.1));
        let right = after(window.x, window.width, step.0, raster.width);
        let bottom = after(window.y, window.height, step.1, raster.height);
        let wide = Window {
            x: window.x - (left * step.0) as i64,
            y: window.y - (top * step.1) as i64,
            width: window.width + (left + right) * step.0,
            height: window.height + (top + bottom) * step.1,
        };
        let full = (size.0 + left + right, size.1 + top + bottom);
        let cell_m = (
            raster.cell_m.0 * window.width as f64 / size.0 as f64,
            raster.cell_m.1 * window.height as f64 / size.1 as f64,
        );
        let source = self.source(layer.raster)?;
        let read = |&band: &usize| source.read_reduced(band, wide, full);
        let bands: Vec<Grid<f32>> = raster.bands.iter().map(read).collect::<Result<_, _>>().map_err(failed)?;
        let drawn = layer.style.draw(&bands, cell_m);
        Ok(drawn.window(Window { x: left as i64, y: top as i64, width: size.0, height: size.1 }, [0; 4]))
    }

    fn layer(&self, number: &str) -> Result<&'a SceneLayer, Refusal> {
        whole(number).and_then(|index| self.scene.layers.get(index)).ok_or(Refusal::NotFound)
    }

    fn raster(&self, index: usize) -> Result<&'a SceneRaster, Refusal> {
        self.scene.rasters.get(index).ok_or(Refusal::NotFound)
    }

    /// Returns an open raster; it is opened when it is used for the first time.
    fn source(&mut self, index: usize) -> Result<&ImageSource, Refusal> {
        let raster = self.raster(index)?;
        let slot = self.open.get_mut(index).ok_or(Refusal::NotFound)?;
        Ok(match slot {
            Some(source) => source,
            None => {
                let wkt = self.scene.map.wkt.as_deref().filter(|_| raster.is_laid);
                let opened = wkt
                    .map_or_else(|| ImageSource::open(&raster.path), |wkt| ImageSource::open_on_map(&raster.path, wkt));
                slot.insert(opened.map_err(failed)?)
            }
        })
    }
}

/// Reads the window and the size of a picture or a grid.
fn window(raster: &SceneRaster, query: &Query<'_>) -> Result<(Window, (usize, usize)), Refusal> {
    let (x, y) = (query.whole("c")? as i64, query.whole("r")? as i64);
    let wanted = Window { x, y, width: query.whole("w")?, height: query.whole("h")? };
    let outside = || Refusal::Malformed("the window lies outside of the raster".to_owned());
    let window = raster.window().intersection(&wanted).ok_or_else(outside)?;
    let side = query.whole("side")?;
    if !(1..=SIDE_MAX).contains(&side) {
        return Err(Refusal::Malformed(format!("side is not a number from 1 to {SIDE_MAX}")));
    }
    Ok((window, reduced((window.width, window.height), side)))
}

/// Returns the number of samples of a line: one for each cell that it passes, at least two.
fn samples(raster: &SceneRaster, from: (f64, f64), to: (f64, f64)) -> usize {
    let (Some(a), Some(b)) =
        (raster.transform.cell_from_map(from.0, from.1), raster.transform.cell_from_map(to.0, to.1))
    else {
        return 2;
    };
    // A length that is not finite becomes the largest number of samples.
    ((b.0 - a.0).hypot(b.1 - a.1).min(SAMPLES_MAX as f64).ceil() as usize + 1).clamp(2, SAMPLES_MAX)
}

/// Returns the end of the cells from `start` on that are read together, and their window; `None`
/// when all lie outside of the raster.
fn together(cells: &[Option<(usize, usize)>], start: usize) -> (Option<Window>, usize) {
    let mut window: Option<Window> = None;
    for (i, cell) in cells.iter().enumerate().skip(start) {
        let Some((column, row)) = *cell else { continue };
        let (x, y) = (column as i64, row as i64);
        let grown = window.map_or(Window { x, y, width: 1, height: 1 }, |w| {
            let (x0, y0) = (w.x.min(x), w.y.min(y));
            let (x1, y1) = ((w.x + w.width as i64).max(x + 1), (w.y + w.height as i64).max(y + 1));
            Window { x: x0, y: y0, width: (x1 - x0) as usize, height: (y1 - y0) as usize }
        });
        if grown.width.saturating_mul(grown.height) > PROFILE_CELLS {
            return (window, i);
        }
        window = Some(grown);
    }
    (window, cells.len())
}

fn png(picture: &Grid<[u8; 4]>) -> Result<Answer, Refusal> {
    let body = png_with_alpha(picture).map_err(|error| Refusal::Failed(error.to_string()))?;
    Ok(Answer { kind: "image/png", body: body.into() })
}

fn json(value: &impl Serialize) -> Result<Answer, Refusal> {
    let body = serde_json::to_vec(value).map_err(|error| Refusal::Failed(error.to_string()))?;
    Ok(Answer { kind: "application/json", body: body.into() })
}

fn failed(error: RasterError) -> Refusal {
    Refusal::Failed(with_causes(&error))
}
