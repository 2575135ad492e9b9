//! Splats on the walls of a surface.
//!
//! Each upright face is cut into parallelograms between its edges, which are small along the upper
//! edge and at corners where the wall turns back, and grow from there: so no splat reaches into the
//! sky above a roof or beyond the corner of a house. Parts whose colours differ by more than the
//! bound are cut again. Faces go a little below the ground, whose splats end at its last cells.
//!
//! The colours are those of the image that sees a place of the wall least obliquely. Walls that no
//! image sees take the mean of the walls seen on the same outline, else of all, else middle grey.

use gaussian::Splat;
use occlusion::OcclusionSurface;
use raster::Grid;
use rayon::prelude::*;

use super::facade::{Facade, facades};
use super::gaussian::upright_splat;
use super::graded::graded;
use super::wall_light::{FaceLight, WallView};
use super::{DivisionConfig, GaussianConfig, SplatSurface};

/// Size of the parts along the upper edge, cells: what hangs over is about the error of a wall's
/// place between the cells.
const EDGE_CELLS: f64 = 0.25;
/// Size of the parts at a corner, cells.
const CORNER_CELLS: f64 = 0.5;

/// Size of the smallest part of a wall that is cut for its colours, cells of the image.
const RESOLVED_CELLS: f64 = 1.0;

/// Splats of the walls with their counts.
#[derive(Debug, Clone, Default)]
pub(super) struct WallSplats {
    pub(super) splats: Vec<Splat>,
    /// Number of splats with colours of their own.
    pub(super) seen: usize,
    /// Area of the walls, m².
    pub(super) area_m2: f64,
    /// For each view the positions of walls that it sees.
    pub(super) shown: Vec<Vec<[f64; 3]>>,
}

/// A part of a face: shares of its length and of the way down.
#[derive(Debug, Clone, Copy)]
struct Part {
    along: [f64; 2],
    down: [f64; 2],
}

/// A part with its colour, where it is seen.
struct LitPart {
    part: Part,
    colour: Option<[f32; 3]>,
}

/// The parts of a face, and for each view the positions that it sees.
type LitFace = (Vec<LitPart>, Vec<Vec<[f64; 3]>>);

/// Makes the splats of all walls. `confidence` is per cell.
pub(super) fn wall_splats(
    surface: &SplatSurface<'_>,
    views: &[WallView<'_>],
    confidence: Option<&Grid<f32>>,
    division: &DivisionConfig,
    gaussian: &GaussianConfig,
) -> Result<WallSplats, crs::CrsError> {
    let (along_columns, along_rows) = surface.geotransform().cell_size();
    let cell_m = (along_columns * along_rows).sqrt();
    let obstacle = OcclusionSurface::new(surface.heights(), cell_m);
    let mut faces = facades(surface, &obstacle, division.error_m);
    // The ground's own splats end at the border of their cells, half a cell from the wall at most.
    faces.iter_mut().for_each(|face| face.lower = face.lower.map(|height| height - division.error_m.min(cell_m)));
    let cutting = Cutting { cell_m, division };
    let lit = |face: &Facade| {
        let light = FaceLight::new(surface, &obstacle, views, face, cell_m)?;
        Ok((cutting.parts(face, &light), light.shown))
    };
    let lit: Vec<LitFace> = faces.par_iter().map(lit).collect::<Result<_, crs::CrsError>>()?;
    let unseen = Fallback::new(&faces, &lit);
    let mut walls = WallSplats { shown: vec![Vec::new(); views.len()], ..WallSplats::default() };
    for (face, (parts, shown)) in faces.iter().zip(lit) {
        walls.area_m2 += face.length() * face.mean_height();
        walls.shown.iter_mut().zip(shown).for_each(|(all, some)| all.extend(some));
        for LitPart { part, colour } in parts {
            walls.seen += usize::from(colour.is_some());
            let colour = colour.unwrap_or_else(|| unseen.of(face.line));
            let middle = |range: [f64; 2]| 0.5 * (range[0] + range[1]);
            let (along, down) = (middle(part.along), middle(part.down));
            let [left, right] = part.along.map(|along| face.position(along, down));
            let [top, bottom] = part.down.map(|down| face.position(along, down));
            let tangents = [[left, right], [top, bottom]].map(|[a, b]| [0, 1, 2].map(|i| b[i] - a[i]));
            let trust = confidence.map_or(f64::NAN, |grid| confidence_at(surface, grid, face, along));
            let position = face.position(along, down);
            walls.splats.push(upright_splat(position, tangents, face.outward, colour, trust, gaussian));
        }
    }
    Ok(walls)
}

/// Returns the confidence of the cells on both sides of a place of a wall: their mean, NaN where
/// unknown.
fn confidence_at(surface: &SplatSurface<'_>, confidence: &Grid<f32>, face: &Facade, along: f64) -> f64 {
    let (width, height) = surface.geotransform().cell_size();
    let [x, y, _] = face.position(along, 0.0);
    let origin = surface.origin();
    let beside = [-0.5, 0.5].map(|cells| {
        let off = [0, 1].map(|i| cells * 0.5 * (width + height) * face.outward[i]);
        let (c, r) = surface.geotransform().cell_from_map(x + off[0] + origin[0], y + off[1] + origin[1])?;
        let at = |v: f64| (v.round() >= 0.0).then(|| v.round() as usize);
        confidence.get(at(c)?, at(r)?).copied().filter(|c| c.is_finite()).map(f64::from)
    });
    let known: Vec<f64> = beside.into_iter().flatten().collect();
    known.iter().sum::<f64>() / known.len() as f64
}

/// Bounds of the parts.
struct Cutting<'a> {
    cell_m: f64,
    division: &'a DivisionConfig,
}

impl Cutting<'_> {
    /// Cuts a face.
    fn parts(&self, face: &Facade, light: &FaceLight) -> Vec<LitPart> {
        let (length, height) = (face.length(), face.mean_height());
        let edge = EDGE_CELLS * self.cell_m;
        let most = self.division.side_max as f64 * self.cell_m;
        let columns = graded(length, face.turn.map(|turn| CORNER_CELLS * self.cell_m / turn), most);
        let rows = graded(height, [edge, f64::INFINITY], most);
        let mut parts = Vec::with_capacity((columns.len() - 1) * (rows.len() - 1));
        for down in rows.windows(2) {
            for along in columns.windows(2) {
                let share = |range: &[f64], whole: f64| [range[0] / whole, range[1] / whole];
                let part = Part { along: share(along, length), down: share(down, height) };
                self.add(face, light, part, &mut parts);
            }
        }
        parts
    }

    /// Adds a part, or its halves where its colours differ too much.
    fn add(&self, face: &Facade, light: &FaceLight, part: Part, parts: &mut Vec<LitPart>) {
        let over = light.over(part.along, part.down);
        // In sizes of the smallest part that the image tells from the next one: an oblique image
        // shows a wall the lower, the steeper it looks down on it.
        let sides = [
            (part.along[1] - part.along[0]) * face.length() / self.cell_m,
            (part.down[1] - part.down[0]) * face.mean_height() * light.facing / self.cell_m,
        ];
        let longer = usize::from(sides[1] > sides[0]);
        if over.deviation <= self.division.colour_error || sides[longer] < 2.0 * RESOLVED_CELLS {
            parts.push(LitPart { part, colour: over.mean });
            return;
        }
        let halves = |range: [f64; 2]| {
            let middle = 0.5 * (range[0] + range[1]);
            [[range[0], middle], [middle, range[1]]]
        };
        if longer == 0 {
            halves(part.along).into_iter().for_each(|along| self.add(face, light, Part { along, ..part }, parts));
        } else {
            halves(part.down).into_iter().for_each(|down| self.add(face, light, Part { down, ..part }, parts));
        }
    }
}

/// Colours of walls that no image sees.
struct Fallback {
    by_line: Vec<Mean>,
    all: Mean,
}

/// A mean of colours by area.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: [f64; 3],
    area: f64,
}

impl Mean {
    fn add(&mut self, colour: [f32; 3], area: f64) {
        (0..3).for_each(|i| self.sum[i] += area * f64::from(colour[i]));
        self.area += area;
    }

    fn colour(&self) -> Option<[f32; 3]> {
        (self.area > 0.0).then(|| self.sum.map(|sum| (sum / self.area) as f32))
    }
}

impl Fallback {
    fn new(faces: &[Facade], lit: &[LitFace]) -> Self {
        let lines = faces.iter().map(|face| face.line + 1).max().unwrap_or(0);
        let mut means = Self { by_line: vec![Mean::default(); lines], all: Mean::default() };
        for (face, (parts, _)) in faces.iter().zip(lit) {
            let whole = face.length() * face.mean_height();
            for LitPart { part, colour } in parts {
                let area = whole * (part.along[1] - part.along[0]) * (part.down[1] - part.down[0]);
                if let Some(colour) = *colour {
                    means.by_line[face.line].add(colour, area);
                    means.all.add(colour, area);
                }
            }
        }
        means
    }

    fn of(&self, line: usize) -> [f32; 3] {
        self.by_line[line].colour().or(self.all.colour()).unwrap_or([0.5; 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LensSplatCamera, render, splat_of_block, uniform};
    use camera::{Lens, LensModel, Pose};
    use raster::GeoTransform;

    /// A house of 12 m × 8 m and 6 m, turned by `degrees`, in a flat street.
    fn house(degrees: f64) -> Grid<f32> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let height = |i: usize| {
            let (c, r) = ((i % 96) as f64 - 47.6, (i / 96) as f64 - 47.7);
            let (a, b) = (cos * c + sin * r, cos * r - sin * c);
            if a.abs() < 12.0 && b.abs() < 8.0 { 6.0 } else { 0.0 }
        };
        Grid::from_vec(96, 96, (0..96 * 96).map(height).collect()).unwrap()
    }

    /// From the street, the wall of a house is there without a gap, where it stands, and the sky
    /// above it is clear.
    #[test]
    fn a_wall_closes_the_house_and_leaves_the_sky_clear() {
        for degrees in [0.0, 17.0] {
            let heights = house(degrees);
            let surface = SplatSurface::new(&heights, GeoTransform::north_up(-24.05, 24.1, 0.5), [0.0; 3]);
            let (division, gaussian) = (DivisionConfig::default(), GaussianConfig::default());
            let walls = wall_splats(&surface, &[], None, &division, &gaussian).unwrap();
            assert!(walls.splats.len() < 400, "{} splats", walls.splats.len());
            assert!(walls.splats.iter().all(|splat| splat.validate().is_ok() && splat.colour == [0.5; 3]));
            assert!(walls.splats.iter().all(|splat| splat.normal()[2].abs() < 1e-4));
            // The four walls of 6 m and their feet.
            assert!((walls.area_m2 - 40.0 * 6.25).abs() < 12.0, "{}", walls.area_m2);
            let mut splats = walls.splats;
            let flat = uniform(&surface, 1);
            splats.extend(flat.iter().map(|block| splat_of_block(&surface, block, [0.5; 3], 1.0, &gaussian)));
            // 14 m south of the middle of the house, looking along its axis: its wall is 10 m away.
            let lens = Lens::new(128, 128, LensModel::Pinhole, &[64.0, 64.0, 63.5, 63.5]).unwrap();
            let (sin, cos) = degrees.to_radians().sin_cos();
            let rotation = [[cos, -sin, 0.0], [0.0, 0.0, -1.0], [sin, cos, 0.0]];
            let pose = Pose { rotation, centre: [-14.0 * sin, -14.0 * cos, 1.7] };
            let seen = render(&splats, &LensSplatCamera { lens: &lens, pose: &pose }).unwrap();
            // Rows between the foot and the eaves, away from both.
            for row in 40..72 {
                for column in 32..96 {
                    let (depth, cover) = (seen.median_depth_m[(column, row)], seen.coverage[(column, row)]);
                    assert!(cover > 0.8, "{degrees}: {column} {row}: {cover}");
                    assert!((depth - 10.0).abs() < 0.3, "{degrees}: {column} {row}: {depth}");
                }
            }
            // The eaves are at row 63.5 − 6.4 · 4.3 = 36: above row 31 is nothing but sky.
            let sky = (0..31).flat_map(|row| seen.coverage.row(row));
            assert!(sky.copied().fold(0.0, f32::max) < 0.05, "{degrees}");
        }
    }
}
