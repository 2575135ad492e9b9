//! How the views see the scene at one height: footprints, overlaps, intersection angles and
//! parallax of all pairs.

use camera::{CameraError, ImagePoint, RpcCamera};
use geo::{BooleanOps, BoundingRect, Centroid, Contains, Point, Polygon};
use geodesy::{EnuFrame, EnuPoint, LonLatHeight};
use raster::Grid;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{RTree, RTreeObject};
use serde::{Deserialize, Serialize};
use sweep::source_from_reference;

use crate::error::ReconstructError;
use crate::planning::footprints::{footprint, local_polygon, overlap_share};
use crate::values::ImagePair;

/// Least angle between two lines of sight that gives heights, degrees. Matching is off by a fifth
/// of a pixel, which at this angle is a height of more than 20 pixels' ground.
pub const ANGLE_MIN_DEG: f64 = 0.5;
/// Beyond this angle walls and roofs look too different to be matched, degrees.
pub const ANGLE_MAX_DEG: f64 = 50.0;
/// Least share of ground that two images have in common to be matched.
pub const OVERLAP_MIN: f64 = 0.05;

/// What the geometry of an image follows from.
#[derive(Debug, Clone, Copy)]
pub struct ImageGeometry<'a> {
    /// Camera in the frame of the whole image.
    pub camera: &'a RpcCamera,
    /// Width and height, pixels.
    pub size: (usize, usize),
}

/// Geometry of a pair of views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairGeometry {
    /// Angle between the two lines of sight at the centre of the scene, degrees.
    pub angle_deg: f64,
    /// Ground that both see, as a share of the smaller footprint.
    pub overlap: f64,
    /// Pixels that the second view moves against the first per metre of height.
    pub parallax_px_per_m: f64,
}

/// Geometry of all views and pairs of views at one height.
pub struct ViewGeometry {
    /// Middle of the ground that the first overlapping pair shares, which surely lies in the scene.
    pub centre: LonLatHeight,
    /// Local frame, with its origin at the first corner of the first image.
    pub frame: EnuFrame,
    /// Footprints of the images in that frame.
    pub outlines: Vec<Polygon<f64>>,
    /// Geometry by pair; `None` for a pair that shares no ground.
    pairs: Grid<Option<PairGeometry>>,
}

impl ViewGeometry {
    /// Computes the geometry at `height_m`, metres above the ellipsoid.
    ///
    /// # Errors
    /// [`ReconstructError::Camera`] for an image without a footprint,
    /// [`ReconstructError::NoOverlap`] when no two images share ground.
    pub fn at(images: &[ImageGeometry<'_>], height_m: f64) -> Result<Self, ReconstructError> {
        let failed = |view: usize| move |source: CameraError| ReconstructError::Camera { view, source };
        let prints: Vec<Vec<LonLatHeight>> = images
            .iter()
            .enumerate()
            .map(|(i, image)| footprint(image.camera, image.size, height_m).map_err(failed(i)))
            .collect::<Result<_, _>>()?;
        let frame = EnuFrame::new(prints[0][0]);
        let outlines: Vec<Polygon<f64>> = prints.iter().map(|p| local_polygon(p, &frame)).collect();
        let n = images.len();
        let mut pairs = Grid::filled(n, n, None);
        let mut centre = None;
        let neighbours = neighbours(&outlines);
        for i in 0..n {
            for &j in &neighbours[i] {
                let share = overlap_share(&outlines[i], &outlines[j]);
                let Some(middle) = middle_of_both(&outlines[i], &outlines[j]) else { continue };
                let ground = LonLatHeight { height_m, ..frame.ground_from_enu(middle) };
                centre.get_or_insert(ground);
                // A camera that fails at this point belongs to a pair that cannot be matched.
                if let Ok(pair) = pair_geometry(images[i].camera, images[j].camera, ground, share) {
                    pairs[(i, j)] = Some(pair);
                    pairs[(j, i)] = Some(pair);
                }
            }
        }
        let Some(centre) = centre else { return Err(ReconstructError::NoOverlap { share_percent: 0.0 }) };
        Ok(Self { centre, frame, outlines, pairs })
    }

    /// Returns the geometry of a pair; `None` when the two share no ground.
    pub fn pair(&self, pair: ImagePair) -> Option<&PairGeometry> {
        self.pairs.get(pair.first, pair.second).and_then(Option::as_ref)
    }

    /// Returns the centre of the scene if an image shows it, and else the middle of the image.
    ///
    /// A camera far outside its image has no meaning, and in a block the centre may be far away.
    pub fn middle_of(&self, image: usize) -> LonLatHeight {
        let centre = self.frame.enu_from_ground(self.centre);
        let outline = &self.outlines[image];
        match outline.centroid() {
            Some(own) if !outline.contains(&Point::new(centre.east, centre.north)) => {
                let ground = self.frame.ground_from_enu(EnuPoint { east: own.x(), north: own.y(), up: 0.0 });
                LonLatHeight { height_m: self.centre.height_m, ..ground }
            }
            _ => self.centre,
        }
    }

    /// Returns the side of a pixel on the ground, metres; `None` where the camera has no ground.
    pub fn ground_sampling_m(&self, camera: &RpcCamera, image: usize) -> Option<f64> {
        camera.gsd(self.middle_of(image)).ok().map(|g| g.mean_m())
    }

    /// Returns the side of the largest pixel on the ground, metres. `cameras` are those of all
    /// images in their order.
    pub fn coarsest_sampling_m<'a>(&self, cameras: impl IntoIterator<Item = &'a RpcCamera>) -> f64 {
        let sides_m = cameras.into_iter().enumerate().filter_map(|(i, camera)| self.ground_sampling_m(camera, i));
        sides_m.fold(0.0, f64::max)
    }

    /// Returns the pairs that can give heights, the best angles first.
    ///
    /// # Errors
    /// [`ReconstructError::NoOverlap`] and [`ReconstructError::NoParallax`] when there is none.
    pub fn useful_pairs(&self) -> Result<Vec<ImagePair>, ReconstructError> {
        let n = self.outlines.len();
        let all: Vec<(ImagePair, PairGeometry)> = (0..n)
            .flat_map(|i| (i + 1..n).map(move |j| ImagePair::new(i, j)))
            .filter_map(|pair| self.pair(pair).map(|geometry| (pair, *geometry)))
            .collect();
        let largest = |f: fn(&PairGeometry) -> f64| all.iter().map(|(_, g)| f(g)).fold(0.0, f64::max);
        let overlap = largest(|g| g.overlap);
        if overlap < OVERLAP_MIN {
            return Err(ReconstructError::NoOverlap { share_percent: 100.0 * overlap });
        }
        let mut useful: Vec<_> = all
            .iter()
            .filter(|(_, g)| g.overlap >= OVERLAP_MIN && (ANGLE_MIN_DEG..=ANGLE_MAX_DEG).contains(&g.angle_deg))
            .collect();
        if useful.is_empty() {
            let angle_deg = largest(|g| g.angle_deg);
            return Err(ReconstructError::NoParallax { angle_deg, needed_deg: ANGLE_MIN_DEG });
        }
        useful.sort_by(|a, b| angle_merit(b.1.angle_deg).total_cmp(&angle_merit(a.1.angle_deg)));
        Ok(useful.into_iter().map(|(pair, _)| *pair).collect())
    }
}

/// Rates an intersection angle from 0 to 1. Small angles give imprecise heights, and large ones
/// give pictures that differ too much. The best published pairs lie between 5° and 25°.
pub fn angle_merit(angle_deg: f64) -> f64 {
    (-((angle_deg - 15.0) / 15.0).powi(2)).exp()
}

/// Returns for each outline the later ones whose bounding rectangles meet its own, in order.
fn neighbours(outlines: &[Polygon<f64>]) -> Vec<Vec<usize>> {
    let entry = |(i, outline): (usize, &Polygon<f64>)| {
        let rect = outline.bounding_rect()?;
        Some(GeomWithData::new(Rectangle::from_corners([rect.min().x, rect.min().y], [rect.max().x, rect.max().y]), i))
    };
    let entries: Vec<_> = outlines.iter().enumerate().filter_map(entry).collect();
    let tree = RTree::bulk_load(entries.clone());
    let mut out = vec![Vec::new(); outlines.len()];
    for own in entries {
        let meeting = tree.locate_in_envelope_intersecting(&own.geom().envelope()).map(|other| other.data);
        out[own.data] = meeting.filter(|other| *other > own.data).collect();
        out[own.data].sort_unstable();
    }
    out
}

fn middle_of_both(a: &Polygon<f64>, b: &Polygon<f64>) -> Option<EnuPoint> {
    let middle = a.intersection(b).centroid()?;
    Some(EnuPoint { east: middle.x(), north: middle.y(), up: 0.0 })
}

/// Computes the geometry of a pair of cameras at a ground point.
pub fn pair_geometry(
    a: &RpcCamera,
    b: &RpcCamera,
    centre: LonLatHeight,
    overlap: f64,
) -> Result<PairGeometry, CameraError> {
    let (p, q) = (a.project(centre)?, b.project(centre)?);
    let angle_deg = a.view_direction(centre)?.intersection_angle_deg(&b.view_direction(centre)?);
    let (low, high) = (centre.height_m - 5.0, centre.height_m + 5.0);
    let move_px = |r: &RpcCamera, s: &RpcCamera, at: ImagePoint| {
        let place = |h| source_from_reference(r, s, 0, at, h);
        let (from, to) = (place(low)?, place(high)?);
        Ok::<f64, CameraError>((to.sample - from.sample).hypot(to.line - from.line) / (high - low))
    };
    let parallax_px_per_m = move_px(a, b, p)?.max(move_px(b, a, q)?);
    Ok(PairGeometry { angle_deg, overlap, parallax_px_per_m })
}
