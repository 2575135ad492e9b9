//! Classifies pixels and cells by what they show, and counts errors per class.

use camera::ImagePoint;
use nalgebra::Vector3;
use raster::Grid;
use rayon::prelude::*;
use simulate::{SceneRay, SimulatedView, Simulation, Sun, TruthClass};
use sweep::HeightMap;

/// Names, in the order of the columns.
pub(crate) const KINDS: [&str; 6] = ["occluded", "edge", "vegetation", "shadow", "roof", "ground"];
/// Least jump within [`EDGE_REACH_M`] that makes an edge, metres.
const EDGE_M: f32 = 2.0;
const EDGE_REACH_M: f64 = 1.0;
/// Distance up to which something that casts a shadow is searched, and the start of the search
/// above the surface, metres.
const CASTER_M: f64 = 300.0;
const ABOVE_M: f64 = 0.2;
/// Errors above this count as wrong, metres.
const OFF_M: f32 = 1.0;

/// Per kind: the number of pixels or cells, the number of wrong ones, the number with a height, and
/// the sum of their absolute errors.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Tally([(usize, usize, usize, f64); KINDS.len()]);

impl Tally {
    fn add(mut self, (kind, error): (usize, f32)) -> Self {
        let (count, off, known, sum) = &mut self.0[kind];
        *count += 1;
        *off += usize::from(error.is_nan() || error.abs() > OFF_M);
        if !error.is_nan() {
            *known += 1;
            *sum += f64::from(error.abs());
        }
        self
    }

    fn join(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| {
            let (a, b) = (self.0[k], other.0[k]);
            (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3 + b.3)
        }))
    }

    /// Returns the texts of the columns: for each kind the share of wrong ones among all pixels,
    /// then the sum over all kinds.
    pub(crate) fn cells(&self) -> Vec<String> {
        let all = self.0.iter().fold((0, 0, 0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3 + b.3));
        let text = |(count, off, known, sum): (usize, usize, usize, f64)| match count {
            0 => "–".to_owned(),
            _ => format!("{:.1} ({:.2})", 100.0 * off as f64 / all.0 as f64, sum / known as f64),
        };
        self.0.iter().copied().chain([all]).map(text).collect()
    }
}

/// The cells of the truth with their kinds.
pub(crate) struct Kinds {
    edge: Grid<bool>,
    /// Number of views that see each cell.
    seen: Grid<u8>,
    cell_m: f64,
    half_m: f64,
}

impl Kinds {
    pub(crate) fn new(simulation: &Simulation) -> Self {
        let (dsm, cell_m) = (&simulation.truth.dsm, simulation.config.gsd_m);
        let reach = (EDGE_REACH_M / cell_m).round() as usize;
        let (w, h) = (dsm.width(), dsm.height());
        let is_edge = |i: usize| {
            let (x, y) = (i % w, i / w);
            let rows = y.saturating_sub(reach)..(y + reach + 1).min(h);
            let around = rows.flat_map(|v| &dsm.row(v)[x.saturating_sub(reach)..(x + reach + 1).min(w)]);
            let (low, high) = around.fold((f32::MAX, f32::MIN), |(l, g), v| (l.min(*v), g.max(*v)));
            high - low > EDGE_M
        };
        let edge = (0..w * h).into_par_iter().map(is_edge).collect();
        let seen = (0..w * h).map(|i| simulation.truth.visibility.iter().map(|v| v.data()[i]).sum()).collect();
        Self {
            edge: Grid::from_vec(w, h, edge).expect("as many cells"),
            seen: Grid::from_vec(w, h, seen).expect("as many cells"),
            cell_m,
            half_m: (w / 2) as f64 * cell_m,
        }
    }

    /// Returns the kind of a surface point. A point that fewer than `views` views see is occluded.
    /// Returns `None` for water and outside.
    fn kind(&self, simulation: &Simulation, point: Vector3<f64>, views: u8, sun: &Sun) -> Option<usize> {
        let (column, row) = ((point.x + self.half_m) / self.cell_m, (self.half_m - point.y) / self.cell_m);
        if column < 0.0 || row < 0.0 {
            return None;
        }
        let at = (column as usize, row as usize);
        let class = *simulation.truth.classes.get(at.0, at.1)?;
        if class == TruthClass::Water as u8 {
            return None;
        }
        let is_shaded = || {
            let to_sun = sun.direction();
            let ray = SceneRay { origin: point + to_sun * ABOVE_M, direction: to_sun * CASTER_M };
            simulation.scene.first_point(&ray, 1.0).is_some()
        };
        Some(if self.seen[at] < views {
            0
        } else if self.edge[at] {
            1
        } else if class == TruthClass::Vegetation as u8 {
            2
        } else if is_shaded() {
            3
        } else if class == TruthClass::Building as u8 {
            4
        } else {
            5
        })
    }

    /// Compares the heights of the views with the true heights of their pixels.
    pub(crate) fn of_pixels(&self, simulation: &Simulation, heights: &[HeightMap]) -> Tally {
        let of_view = |(view, map): (&SimulatedView, &HeightMap)| {
            let (w, h) = (map.height_m.width(), map.height_m.height());
            let error = |i: usize| {
                let (x, y) = (i % w, i / w);
                let truth = view.heights[(x, y)];
                let ray = view.sight().ray(ImagePoint::new(x as f64, y as f64));
                let t = (f64::from(truth) - ray.origin.z) / ray.direction.z;
                let kind = self.kind(simulation, ray.at(t), 2, &view.record.date.sun)?;
                Some((kind, (f64::from(map.height_m[(x, y)]) + map.origin_m - f64::from(truth)) as f32))
            };
            (0..w * h)
                .into_par_iter()
                .filter_map(error)
                .fold(Tally::default, Tally::add)
                .reduce(Tally::default, Tally::join)
        };
        simulation.views.iter().zip(heights).map(of_view).fold(Tally::default(), Tally::join)
    }

    /// Compares a surface on the cells of the truth, metres above the ellipsoid.
    pub(crate) fn of_cells(&self, simulation: &Simulation, height_m: &Grid<f32>) -> Tally {
        let truth = &simulation.truth.dsm;
        let error = |i: usize| {
            let at = |k: usize| (k as f64 + 0.5) * self.cell_m - self.half_m;
            let h = truth.data()[i];
            let point = Vector3::new(at(i % truth.width()), -at(i / truth.width()), f64::from(h));
            let kind = self.kind(simulation, point, 2, &simulation.views[0].record.date.sun)?;
            Some((kind, height_m.data()[i] - h))
        };
        let errors = (0..truth.data().len()).into_par_iter().filter_map(error);
        errors.fold(Tally::default, Tally::add).reduce(Tally::default, Tally::join)
    }
}
