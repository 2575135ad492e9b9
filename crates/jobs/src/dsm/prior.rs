//! A city model as the prior of the height sweep: what each view would see of it.

use numeric::upper_median;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use city::{MeshConfig, TriangleMesh};
use priors::{LinesOfSight, ModelPlace, NO_OBJECT, PriorModel, SatelliteMaps, buildings_of};
use raster::Grid;
use rayon::prelude::*;
use sweep::{HeightMap, SweepView};

use crate::dsm::report::{LeftOut, PriorReport};
use crate::dsm::setup::Choices;
use crate::error::PipelineError;

/// How far the heights of city models are off: roofs of LoD2 models lie within half a metre of laser heights.
pub(crate) const DEVIATION_M: f64 = 0.5;

/// The model and the images are searched against each other this far: the pointing of good satellites, without ground control.
const SEARCH_M: f64 = 10.0;
/// … and over this many pixels of a level at most.
const REACH_MAX: i64 = 12;
/// Pixels that are compared for each place.
const SAMPLES_MAX: usize = 4000;
/// Heights of a level are off by up to this many of its steps.
const AGREEING_STEPS: f64 = 2.0;
/// A model that fewer of its pixels agree with has nothing to do with the scene.
const AGREEING_MIN: f64 = 0.3;
/// A building that fewer of its pixels agree with is gone. On small ones the coarse heights are wrong more often than right.
const BUILDING_MIN: f64 = 0.1;
/// Buildings that are named on the terminal; the report names all.
const NAMED: usize = 3;
/// A move has to bring this much more agreement: walls that hide what is behind them draw the model a pixel to their side.
const MOVE_GAIN: f64 = 0.05;

type Cause = Box<dyn std::error::Error + Send + Sync>;

/// A city model in its map, heights above the ellipsoid.
#[derive(Debug)]
pub(crate) struct CityPrior {
    path: PathBuf,
    model: PriorModel,
    place: ModelPlace,
    /// The identifiers of all objects.
    ids: Vec<String>,
}

impl CityPrior {
    /// Reads a model; it has to say in which map it is.
    ///
    /// # Errors
    /// [`PipelineError::Prior`].
    pub(crate) fn read(path: &Path, choices: &mut Choices<'_>) -> Result<Self, PipelineError> {
        Self::open(path, choices).map_err(|source| PipelineError::Prior { path: path.to_owned(), source })
    }

    fn open(path: &Path, choices: &mut Choices<'_>) -> Result<Self, Cause> {
        let file = io::citymodel::read(path)?;
        let mut mesh = TriangleMesh::from_model(&file.model, &MeshConfig::default())?.mesh;
        if mesh.triangles.is_empty() {
            return Err("no building of the model has a surface; skysweep city info says why".into());
        }
        let place = ModelPlace::of(&file.model.crs, None, None)?;
        if place.datum.is_none() {
            choices.warn(format!(
                "the model does not say what its heights are above, taken as the ellipsoid: {}",
                path.display()
            ));
        }
        place.to_ellipsoid(&mut mesh)?;
        choices.tell("prior", format!("{} buildings' surfaces", mesh.surfaces.len()), path.display().to_string());
        let ids = file.model.objects.iter().map(|object| object.id.clone()).collect();
        Ok(Self { path: path.to_owned(), model: PriorModel::new(mesh, &buildings_of(&file.model))?, place, ids })
    }

    /// What every view sees of the model; `None` for a view that does not see it.
    ///
    /// # Errors
    /// An image that is too large for maps.
    pub(crate) fn seen_from(&self, views: &[SweepView], gsd_m: f64) -> Result<Vec<Option<ViewPrior>>, PipelineError> {
        let seen = |view: &SweepView| {
            let size = view.levels.first().map_or((0, 0), |image| (image.width(), image.height()));
            if size.0 == 0 || size.1 == 0 {
                return Ok(None);
            }
            let lines = LinesOfSight::new(&view.camera, size, &self.model, &self.place.projection)?;
            let maps = SatelliteMaps::render(&self.model, &lines)?;
            Ok((maps.hits() > 0).then_some(ViewPrior { height_m: maps.height_m, object: maps.object, gsd_m }))
        };
        let all: Result<_, priors::PriorsError> = views.iter().map(seen).collect();
        all.map_err(|source| PipelineError::Prior { path: self.path.clone(), source: source.into() })
    }
}

/// What one view sees of the model, at its full resolution.
#[derive(Debug, Clone)]
pub(crate) struct ViewPrior {
    /// Metres above the ellipsoid; NaN where there is no building.
    height_m: Grid<f32>,
    /// The building's number, not 0.
    object: Grid<u32>,
    /// A pixel on the ground, metres.
    gsd_m: f64,
}

/// How the model lies in a view: what is added to its pixels and heights.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shift {
    x: i64,
    y: i64,
    height_m: f32,
    /// Share of all samples that agree.
    agreeing: f64,
}

/// Pixels of a building in a view: those with a height to compare with, and those that agree with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Vote {
    agreeing: u64,
    compared: u64,
}

impl Vote {
    /// Whether too few agree.
    fn is_gone(&self) -> bool {
        (self.agreeing as f64) < BUILDING_MIN * self.compared as f64
    }
}

/// What the heights of a level say of the buildings that a view sees.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    votes: BTreeMap<u32, Vote>,
    tolerance_m: f32,
}

/// What all views, and all chunks of a scene, say of the buildings.
#[derive(Debug, Clone, Default)]
pub(crate) struct Findings {
    /// By building: what the views say that keep it, and what those say that leave it out.
    buildings: BTreeMap<u32, [Said; 2]>,
    tolerance_m: f32,
    /// Views that see the model, and whose heights hardly agree with any of it.
    disagreeing_views: usize,
}

/// Views that agree about a building, and their pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Said {
    views: usize,
    vote: Vote,
}

impl Findings {
    /// Takes what a view says that sees the model; `None` where hardly anything agrees.
    pub(crate) fn add(&mut self, evidence: Option<&Evidence>) {
        let Some(evidence) = evidence else {
            self.disagreeing_views += 1;
            return;
        };
        self.tolerance_m = evidence.tolerance_m;
        for (&building, vote) in &evidence.votes {
            let said = &mut self.buildings.entry(building).or_default()[usize::from(vote.is_gone())];
            said.views += 1;
            said.vote.agreeing += vote.agreeing;
            said.vote.compared += vote.compared;
        }
    }

    /// Takes what a chunk says.
    pub(crate) fn extend(&mut self, other: &Self) {
        self.tolerance_m = self.tolerance_m.max(other.tolerance_m);
        self.disagreeing_views += other.disagreeing_views;
        for (&building, said) in &other.buildings {
            let known = self.buildings.entry(building).or_default();
            for (known, said) in known.iter_mut().zip(said) {
                known.views += said.views;
                known.vote.agreeing += said.vote.agreeing;
                known.vote.compared += said.vote.compared;
            }
        }
    }
}

impl CityPrior {
    /// Which buildings were left out, and why; told on the way.
    pub(crate) fn report(&self, findings: &Findings, choices: &mut Choices<'_>) -> PriorReport {
        let name = |number: u32| self.ids.get((number as usize).wrapping_sub(1)).cloned().unwrap_or_default();
        let left_out = findings.buildings.iter().filter(|(_, [_, gone])| gone.views > 0);
        let left_out: Vec<LeftOut> = left_out
            .map(|(&number, [kept, gone])| LeftOut {
                id: name(number),
                views: gone.views,
                of_views: gone.views + kept.views,
                agreeing_pixels: gone.vote.agreeing,
                compared_pixels: gone.vote.compared,
            })
            .collect();
        let names: Vec<&str> = left_out.iter().take(NAMED).map(|building| building.id.as_str()).collect();
        let more = if left_out.len() > NAMED { ", …" } else { "" };
        let value = match left_out.len() {
            0 if findings.disagreeing_views > 0 => format!(
                "none of {}; {} views agree with nothing of the model and do without",
                findings.buildings.len(),
                findings.disagreeing_views
            ),
            0 => format!("none of {}", findings.buildings.len()),
            count => format!("{count} of {}: {}{more}", findings.buildings.len(), names.join(", ")),
        };
        let reason = format!(
            "fewer than {:.0} % of their pixels are at the heights that a coarser level found",
            100.0 * BUILDING_MIN
        );
        choices.tell("buildings left out", value, reason);
        PriorReport {
            model: self.path.clone(),
            buildings_seen: findings.buildings.len(),
            disagreeing_views: findings.disagreeing_views,
            least_agreeing: BUILDING_MIN,
            tolerance_m: f64::from(findings.tolerance_m),
            left_out,
        }
    }
}

impl ViewPrior {
    /// The heights of a level: those of the pixel in the middle of each coarse one, so that edges stay sharp.
    pub(crate) fn at_level(&self, level: usize, (width, height): (usize, usize)) -> Grid<f32> {
        let side = 1usize << level;
        let place = |i: usize, n: usize| (i * side + side / 2).min(n - 1);
        let of = |x, y| self.height_m[(place(x, self.height_m.width()), place(y, self.height_m.height()))];
        let mut out = Grid::filled(width, height, f32::NAN);
        out.data_mut().iter_mut().enumerate().for_each(|(i, h)| *h = of(i % width, i / width));
        out
    }

    /// The prior held against the heights that a level found. The images' pointing and the model's place are each off by metres:
    /// the prior is moved to where most of its pixels agree. Buildings that still do not agree are left out, as they may be gone;
    /// `None` when hardly anything agrees, because then nothing says where the rest belongs.
    pub(crate) fn checked(&self, map: &HeightMap, level: usize, step_m: f64) -> Option<(Self, Evidence)> {
        let tolerance_m = (AGREEING_STEPS * step_m).max(DEVIATION_M) as f32;
        let side = 1i64 << level;
        let reach = ((SEARCH_M / (self.gsd_m * side as f64)).ceil() as i64).min(REACH_MAX);
        let samples = self.samples(side as usize);
        let shifts: Vec<(i64, i64)> = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y))).collect();
        let scored: Vec<Shift> =
            shifts.par_iter().filter_map(|&by| score(map, &samples, side, by, tolerance_m)).collect();
        // Of equals the nearest: the order of the shifts must not count.
        let far = |s: &Shift| s.x * s.x + s.y * s.y;
        let order = |a: &&Shift, b: &&Shift| a.agreeing.total_cmp(&b.agreeing).then(far(b).cmp(&far(a)));
        let best = scored.iter().max_by(order).filter(|best| best.agreeing >= AGREEING_MIN)?;
        let unmoved = scored.iter().find(|s| far(s) == 0 && s.agreeing + MOVE_GAIN >= best.agreeing);
        let best = *unmoved.unwrap_or(best);
        let moved = self.moved(best);
        let votes = moved.votes(map, side as usize, tolerance_m);
        Some((moved.without(&votes), Evidence { votes, tolerance_m }))
    }

    /// Pixels in the middles of coarse ones, with their heights, a few thousand at most.
    fn samples(&self, side: usize) -> Vec<(i64, i64, f32)> {
        let (w, h) = (self.height_m.width(), self.height_m.height());
        let middles = |n: usize| (side / 2..n).step_by(side);
        let known: Vec<(i64, i64, f32)> = middles(h)
            .flat_map(|y| middles(w).map(move |x| (x, y)))
            .map(|(x, y)| (x as i64, y as i64, self.height_m[(x, y)]))
            .filter(|s| s.2.is_finite())
            .collect();
        let every = known.len().div_ceil(SAMPLES_MAX).max(1);
        known.into_iter().step_by(every).collect()
    }

    fn moved(&self, by: Shift) -> Self {
        let (w, h) = (self.height_m.width(), self.height_m.height());
        let (height_m, object) = (Grid::filled(w, h, f32::NAN), Grid::filled(w, h, NO_OBJECT));
        let mut out = Self { height_m, object, gsd_m: self.gsd_m };
        for y in 0..h {
            for x in 0..w {
                let (u, v) = (x as i64 - by.x, y as i64 - by.y);
                if (0..w as i64).contains(&u) && (0..h as i64).contains(&v) {
                    let from = (u as usize, v as usize);
                    out.height_m[(x, y)] = self.height_m[from] + by.height_m;
                    out.object[(x, y)] = self.object[from];
                }
            }
        }
        out
    }

    /// How many pixels of each building agree with the heights found.
    fn votes(&self, map: &HeightMap, side: usize, tolerance_m: f32) -> BTreeMap<u32, Vote> {
        let mut votes: BTreeMap<u32, Vote> = BTreeMap::new();
        for y in 0..self.height_m.height() {
            for x in 0..self.height_m.width() {
                let object = self.object[(x, y)];
                let found = found_at(map, x as i64 / side as i64, y as i64 / side as i64);
                if let (true, Some(found)) = (object != NO_OBJECT, found) {
                    let vote = votes.entry(object).or_default();
                    vote.agreeing += u64::from((found - self.height_m[(x, y)]).abs() <= tolerance_m);
                    vote.compared += 1;
                }
            }
        }
        votes
    }

    fn without(mut self, votes: &BTreeMap<u32, Vote>) -> Self {
        for (object, height_m) in self.object.data_mut().iter_mut().zip(self.height_m.data_mut()) {
            if votes.get(object).is_some_and(Vote::is_gone) {
                (*object, *height_m) = (NO_OBJECT, f32::NAN);
            }
        }
        self
    }
}

/// The height that a level found at its pixel, metres above the ellipsoid.
fn found_at(map: &HeightMap, x: i64, y: i64) -> Option<f32> {
    let inside = x >= 0 && y >= 0;
    let found = inside.then(|| map.height_m.get(x as usize, y as usize)).flatten()?;
    (!found.is_nan()).then(|| (map.origin_m + f64::from(*found)) as f32)
}

/// How many of the samples, moved by coarse pixels, agree with the heights found, but for one difference of all.
fn score(
    map: &HeightMap,
    samples: &[(i64, i64, f32)],
    side: i64,
    (dx, dy): (i64, i64),
    tolerance_m: f32,
) -> Option<Shift> {
    let difference = |&(x, y, prior): &(i64, i64, f32)| {
        Some(found_at(map, x.div_euclid(side) + dx, y.div_euclid(side) + dy)? - prior)
    };
    let mut off: Vec<f32> = samples.iter().filter_map(difference).collect();
    let height_m = upper_median(&mut off)?;
    if f64::from(height_m.abs()) > SEARCH_M {
        return None;
    }
    let agreeing = off.iter().filter(|d| (**d - height_m).abs() <= tolerance_m).count() as f64 / samples.len() as f64;
    Some(Shift { x: dx * side, y: dy * side, height_m, agreeing })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two boxes of 12 and 20 m over ground at 0, numbered 1 and 2, 64 × 64 pixels.
    fn boxes() -> ViewPrior {
        let (height_m, object) = (Grid::filled(64, 64, f32::NAN), Grid::filled(64, 64, NO_OBJECT));
        let mut out = ViewPrior { height_m, object, gsd_m: 0.5 };
        for (number, (x0, y0, height)) in [(8, 10, 12.0f32), (34, 30, 20.0)].into_iter().enumerate() {
            for (x, y) in (0..18).flat_map(|y| (0..18).map(move |x| (x0 + x, y0 + y))) {
                out.height_m[(x, y)] = height;
                out.object[(x, y)] = number as u32 + 1;
            }
        }
        out
    }

    /// The heights that a level of 2 × 2 pixels finds when the prior lies elsewhere by pixels and metres.
    fn found(by: (i64, i64), up_m: f32, is_there: impl Fn(u32) -> bool) -> HeightMap {
        let moved = boxes().moved(Shift { x: by.0, y: by.1, height_m: 0.0, agreeing: 1.0 });
        let mut map = HeightMap::empty(32, 32, 100.0);
        for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
            let fine = (2 * x + 1, 2 * y + 1);
            let roof = Some(moved.height_m[fine]).filter(|h| h.is_finite() && is_there(moved.object[fine]));
            map.height_m[(x, y)] = roof.unwrap_or(0.0) + up_m - 100.0;
        }
        map
    }

    #[test]
    fn a_model_that_lies_elsewhere_is_moved_there() {
        let (checked, evidence) = boxes().checked(&found((4, -6), 3.5, |_| true), 1, 0.5).unwrap();
        assert!(evidence.votes.values().all(|vote| !vote.is_gone() && vote.compared == 18 * 18));
        let expected = boxes().moved(Shift { x: 4, y: -6, height_m: 3.5, agreeing: 1.0 });
        let same = |(a, b): (&f32, &f32)| a == b || a.is_nan() && b.is_nan();
        assert!(checked.height_m.data().iter().zip(expected.height_m.data()).all(same));
        assert_eq!(checked.object, expected.object);
    }

    #[test]
    fn a_building_that_is_gone_is_left_out_and_the_other_stays() {
        let (checked, evidence) = boxes().checked(&found((0, 0), 0.0, |number| number == 1), 1, 0.5).unwrap();
        let kept = |number| checked.object.data().iter().filter(|o| **o == number).count();
        assert_eq!((kept(1), kept(2)), (18 * 18, 0));
        assert_eq!(evidence.votes[&2], Vote { agreeing: 0, compared: 18 * 18 });
        let mut findings = Findings::default();
        findings.add(Some(&evidence));
        findings.extend(&findings.clone());
        let of = |building| findings.buildings[&building].map(|said| said.views);
        assert_eq!((of(1), of(2)), ([2, 0], [0, 2]));
    }

    #[test]
    fn coarse_heights_are_those_of_the_middle() {
        let height_m = Grid::from_vec(5, 4, (0..20).map(|i| i as f32).collect()).unwrap();
        let prior = ViewPrior { object: height_m.map(|_| 1), height_m, gsd_m: 0.5 };
        assert_eq!(prior.at_level(1, (2, 2)).data(), [6.0, 8.0, 16.0, 18.0]);
        assert_eq!(prior.at_level(0, (5, 4)), prior.height_m);
        assert_eq!(prior.at_level(2, (1, 1)).data(), [12.0]);
    }
}
