//! A stage for hard cases: a height function with paint on it, photographed through exact RPC
//! cameras, and the score of the DSM that `jobs::dsm` makes of the photographs. It does not use the
//! `simulate` crate on purpose: an error in both would cancel, and a case sets one thing to an
//! extreme. Stage frame: x east, y north in metres from the centre, each proportional to longitude
//! and latitude (so the frame is the same at any latitude and across the antimeridian), z metres
//! above `ground_m`.

use std::path::PathBuf;
use std::sync::LazyLock;

use camera::{ImagePoint, Rpc};
use crs::MapProjection;
use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, MetresFromCells, evaluate};
use formats::raster::{Band, BandData, Dem, read_dem, write_image_with_rpc};
use geodesy::{meridian_radius_m, prime_vertical_radius_m};
use jobs::dsm::{DsmConfig, DsmError, DsmReport};
use nalgebra::Vector3;
use numeric::random::{hash64, unit_interval};
use numeric::{NMAD_FACTOR, Silent, upper_median};
use raster::Grid;
use tempfile::TempDir;

/// Height of the surface over a place of the stage, metres above its ground height.
pub(crate) type Surface = Box<dyn Fn(f64, f64) -> f64 + Send + Sync>;
/// Reflectance (0 to 1) of a point of the surface in a view.
pub(crate) type Paint = Box<dyn Fn([f64; 3], usize) -> f64 + Send + Sync>;

pub(crate) struct Stage {
    pub(crate) lon_deg: f64,
    pub(crate) lat_deg: f64,
    /// Height of z = 0 above the ellipsoid.
    pub(crate) ground_m: f64,
    /// Side of the images, pixels.
    pub(crate) size_px: usize,
    pub(crate) gsd_m: f64,
    /// Least and greatest z of the surface.
    pub(crate) span_m: (f64, f64),
    pub(crate) surface: Surface,
    pub(crate) paint: Paint,
    /// Standard deviation of the noise, digital numbers.
    pub(crate) noise_dn: f64,
}

/// A photograph with its RPC.
#[derive(Clone)]
pub(crate) struct Shot {
    pub(crate) image: Grid<u16>,
    pub(crate) rpc: Rpc,
    pub(crate) no_data: Option<f64>,
}

/// Results of a run.
pub(crate) struct Outcome {
    pub(crate) dem: Dem,
    pub(crate) sigma: Dem,
    pub(crate) report: DsmReport,
}

/// Errors over a region.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Score {
    /// Cells of the region.
    pub(crate) cells: usize,
    /// Share of the cells with a height.
    pub(crate) covered: f64,
    /// Share of the cells whose height is right to a metre.
    pub(crate) right: f64,
    /// Share of the cells whose height is wrong by more than two metres, which is worse than a
    /// void.
    pub(crate) wrong: f64,
    /// Median error, metres.
    pub(crate) bias_m: f64,
    /// 1.4826 × median absolute deviation, metres.
    pub(crate) nmad_m: f64,
}

impl Default for Stage {
    /// A village of six buildings on rolling ground, 140 m of it.
    fn default() -> Self {
        Self {
            lon_deg: 5.4,
            lat_deg: 43.5,
            ground_m: 180.0,
            size_px: 280,
            gsd_m: 0.5,
            span_m: (-4.0, 24.0),
            surface: Box::new(village),
            paint: Box::new(|p, _| weathered(p)),
            noise_dn: 4.0,
        }
    }
}

/// Ground that rolls by ±2 m.
pub(crate) fn rolling(x: f64, y: f64) -> f64 {
    1.2 * (x / 23.0).sin() + 0.8 * (y / 17.0 + 0.4).cos()
}

/// Centre, half sizes, and eaves and ridge heights of a building; the ridge runs along its local x
/// axis.
pub(crate) struct Building {
    pub(crate) centre: [f64; 2],
    pub(crate) half: [f64; 2],
    pub(crate) eaves: f64,
    pub(crate) ridge: f64,
}

impl Building {
    /// Returns the height of the building over a place. All buildings are turned by 17° against the
    /// map.
    pub(crate) fn height(&self, x: f64, y: f64) -> Option<f64> {
        // Sine and cosine are constants because the construction of every scene calls this for
        // every pixel.
        let (sin, cos) = (0.292_371_704_722_736_77, 0.956_304_755_963_035_4);
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let (u, v) = (cos * dx + sin * dy, cos * dy - sin * dx);
        let inside = u.abs() <= self.half[0] && v.abs() <= self.half[1];
        inside.then(|| self.ridge + (self.eaves - self.ridge) * v.abs() / self.half[1])
    }
}

/// The village photographed without any difficulty, and its DSM. Cases with the same pixels are
/// compared with it.
pub(crate) struct Easy {
    pub(crate) stage: Stage,
    pub(crate) shots: Vec<Shot>,
    pub(crate) outcome: Outcome,
}

pub(crate) static EASY: LazyLock<Easy> = LazyLock::new(|| {
    let stage = Stage::default();
    let shots = stage.shots(&triplet(stage.gsd_m));
    let outcome = stage.run(&shots, |_| {}).expect("an easy scene");
    Easy { stage, shots, outcome }
});

const VILLAGE: [Building; 6] = [
    Building { centre: [-30.0, 25.0], half: [12.0, 8.0], eaves: 9.0, ridge: 9.0 },
    Building { centre: [20.0, 32.0], half: [10.0, 6.0], eaves: 6.0, ridge: 9.5 },
    Building { centre: [35.0, -5.0], half: [9.0, 12.0], eaves: 20.0, ridge: 20.0 },
    Building { centre: [-5.0, -4.0], half: [8.0, 6.0], eaves: 5.0, ridge: 8.0 },
    Building { centre: [-36.0, -22.0], half: [9.0, 9.0], eaves: 13.0, ridge: 13.0 },
    Building { centre: [6.0, -38.0], half: [14.0, 6.0], eaves: 7.0, ridge: 10.0 },
];

pub(crate) fn village(x: f64, y: f64) -> f64 {
    VILLAGE.iter().find_map(|b| b.height(x, y)).unwrap_or_else(|| rolling(x, y))
}

/// Detail in three dimensions, at every scale from a metre to a block, so that walls have texture
/// too.
pub(crate) fn weathered([x, y, z]: [f64; 3]) -> f64 {
    const OCTAVES: [(f64, f64); 4] = [(1.1, 0.34), (2.7, 0.28), (7.0, 0.22), (21.0, 0.16)];
    let sum: f64 =
        (0..).zip(OCTAVES).map(|(k, (cell, share))| share * noise_3d(k, [x / cell, y / cell, z / cell])).sum();
    (0.45 + 0.75 * sum).clamp(0.0, 1.0)
}

/// Uniform in [−1, 1] at lattice points, smooth between them.
pub(crate) fn noise_3d(seed: u64, p: [f64; 3]) -> f64 {
    testing::lattice_noise(p, |[x, y, z]| 2.0 * uniform([seed, x as u64, y as u64, z as u64]) - 1.0)
}

/// Returns a number in [0, 1) that depends on the key alone.
pub(crate) fn uniform(key: [u64; 4]) -> f64 {
    unit_interval(key.into_iter().fold(0, |state, part| hash64(state ^ part)))
}

/// A direction from the scene to the sensor, and the sampling distance across it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    incidence_deg: f64,
    azimuth_deg: f64,
    gsd_m: f64,
}

pub(crate) fn look(incidence_deg: f64, azimuth_deg: f64, gsd_m: f64) -> Look {
    Look { incidence_deg, azimuth_deg, gsd_m }
}

impl Look {
    /// Returns a pushbroom camera, north up, whose image of `size` × `size` pixels has a place of
    /// the stage in its middle. With X in metres from there, d the direction and u, v the image's
    /// axes across it, `sample = u·X / (1 − d·X / range)` and `line = −v·X` in pixels, which an RPC
    /// holds exactly.
    pub(crate) fn rpc(&self, stage: &Stage, centre: [f64; 2]) -> Rpc {
        const RANGE_M: f64 = 617_000.0;
        const HEIGHT_SCALE_M: f64 = 500.0;
        let (sin, cos) = self.incidence_deg.to_radians().sin_cos();
        let (east, north) = self.azimuth_deg.to_radians().sin_cos();
        let d = Vector3::new(sin * east, sin * north, cos);
        let u = (Vector3::x() - d * d.x).normalize();
        let v = d.cross(&u);
        let half_px = stage.size_px as f64 / 2.0;
        let half_m = 0.85 * stage.size_px as f64 * self.gsd_m;
        let [kx, ky] = stage.metres_per_degree();
        // A linear form in metres as the terms 1, L, P, H.
        let linear = |constant: f64, form: Vector3<f64>| {
            let mut c = [0.0; 20];
            c[..4].copy_from_slice(&[constant, form.x * half_m, form.y * half_m, form.z * HEIGHT_SCALE_M]);
            c
        };
        Rpc {
            line_off: half_px - 0.5,
            samp_off: half_px - 0.5,
            lat_off: stage.lat_deg + centre[1] / ky,
            long_off: stage.lon_deg + centre[0] / kx,
            height_off: stage.ground_m,
            line_scale: half_px,
            samp_scale: half_px,
            lat_scale: half_m / ky,
            long_scale: half_m / kx,
            height_scale: HEIGHT_SCALE_M,
            line_num: linear(0.0, -v / (self.gsd_m * half_px)),
            line_den: linear(1.0, Vector3::zeros()),
            samp_num: linear(0.0, u / (self.gsd_m * half_px)),
            samp_den: linear(1.0, -d / RANGE_M),
            err_bias_m: None,
            err_rand_m: None,
        }
    }
}

/// Forward, near-nadir and backward: a pass of one sensor.
pub(crate) fn triplet(gsd_m: f64) -> Vec<Look> {
    vec![look(15.0, 12.0, gsd_m), look(4.0, 100.0, gsd_m), look(14.0, 195.0, gsd_m)]
}

impl Stage {
    fn metres_per_degree(&self) -> [f64; 2] {
        let cos = self.lat_deg.to_radians().cos();
        [prime_vertical_radius_m(self.lat_deg) * cos, meridian_radius_m(self.lat_deg)]
            .map(|r| (r + self.ground_m).to_radians())
    }

    pub(crate) fn place(&self, lon_deg: f64, lat_deg: f64) -> [f64; 2] {
        let [kx, ky] = self.metres_per_degree();
        let d_lon = (lon_deg - self.lon_deg + 540.0).rem_euclid(360.0) - 180.0;
        [d_lon * kx, (lat_deg - self.lat_deg) * ky]
    }

    pub(crate) fn rpc(&self, look: &Look) -> Rpc {
        look.rpc(self, [0.0, 0.0])
    }

    pub(crate) fn shots(&self, looks: &[Look]) -> Vec<Shot> {
        looks.iter().enumerate().map(|(view, look)| self.shot(self.rpc(look), view)).collect()
    }

    /// Returns the photograph taken through an RPC.
    pub(crate) fn shot(&self, rpc: Rpc, view: usize) -> Shot {
        let n = self.size_px;
        let (top, bottom) =
            (rpc.plane(self.ground_m + self.span_m.1 + 0.5), rpc.plane(self.ground_m + self.span_m.0 - 0.5));
        let mut image = Grid::filled(n, n, 0u16);
        for line in 0..n {
            for sample in 0..n {
                let at = ImagePoint::new(sample as f64, line as f64);
                let end = |plane: &camera::RpcPlane| {
                    let g = plane.localize(at).expect("the stage lies inside the camera's domain");
                    let [x, y] = self.place(g.lon_deg, g.lat_deg);
                    [x, y, g.height_m - self.ground_m]
                };
                let value = (self.paint)(self.hit(end(&top), end(&bottom)), view);
                let noise: f64 =
                    (0..4).map(|k| uniform([view as u64, sample as u64, line as u64, k]) - 0.5).sum::<f64>()
                        * 3f64.sqrt();
                image[(sample, line)] =
                    (100.0 + 1000.0 * value + self.noise_dn * noise).round().clamp(1.0, 2047.0) as u16;
            }
        }
        Shot { image, rpc, no_data: None }
    }

    /// Returns the first point of the surface on a line from above it to below it: marched, then
    /// bisected.
    fn hit(&self, from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
        let at = |t: f64| -> [f64; 3] { std::array::from_fn(|i| from[i] + t * (to[i] - from[i])) };
        let below = |t: f64| {
            let [x, y, z] = at(t);
            z < (self.surface)(x, y)
        };
        // A third of a metre of height is a tenth of a metre across: no stage has thinner things.
        let step = 0.33 / (from[2] - to[2]);
        let mut t = step;
        while !below(t) && t < 1.0 {
            t += step;
        }
        let (mut above, mut under) = (t - step, t);
        for _ in 0..12 {
            let middle = 0.5 * (above + under);
            if below(middle) { under = middle } else { above = middle }
        }
        at(above)
    }

    /// Makes a DSM of shots.
    pub(crate) fn run(&self, shots: &[Shot], set: impl FnOnce(&mut DsmConfig)) -> Result<Outcome, DsmError> {
        let folder = TempDir::new().expect("a folder");
        let paths: Vec<PathBuf> = (1..=shots.len()).map(|i| folder.path().join(format!("view_{i}.tif"))).collect();
        for (shot, path) in shots.iter().zip(&paths) {
            let bands = [Band { description: "pan", data: BandData::U16(&shot.image) }];
            write_image_with_rpc(path, &bands, &shot.rpc, shot.no_data, false).expect("an image");
        }
        let out = folder.path().join("out");
        let mut config = DsmConfig::new(paths, out.clone());
        config.threads = Some(1);
        set(&mut config);
        let report = jobs::dsm::run(&config, &Silent)?;
        let read = |name: &str| read_dem(out.join("dsm").join(name)).expect("a result");
        Ok(Outcome { dem: read("dsm.tif"), sigma: read("sigma.tif"), report })
    }

    /// Returns the error of every cell within `half_m` of the centre, after an alignment; NaN in
    /// voids and outside.
    pub(crate) fn errors(&self, outcome: &Outcome, half_m: f64, alignment: AlignmentMethod) -> Errors {
        let (dem, truth) = (&outcome.dem, self.truth(&outcome.dem, half_m));
        let map = CellMap::affine(&dem.geotransform, &dem.geotransform).expect("a grid on itself");
        let input = EvalInput::new(&dem.heights, &truth, &map, MetresFromCells::new(&dem.geotransform, (1.0, 1.0)));
        let found =
            evaluate(&input, &EvalConfig { alignment, search_m: 15.0, ..EvalConfig::default() }).expect("common cells");
        Errors { errors: found.errors, truth, places: self.places(dem) }
    }

    /// Returns the score without alignment, over 50 m around the centre.
    pub(crate) fn score(&self, outcome: &Outcome) -> Score {
        self.errors(outcome, 50.0, AlignmentMethod::None).over(|_, _| true)
    }

    /// Returns the score after the shift that pointing errors common to all views leave.
    pub(crate) fn aligned_score(&self, outcome: &Outcome) -> Score {
        self.errors(outcome, 50.0, AlignmentMethod::Xyz).over(|_, _| true)
    }

    fn places(&self, dem: &Dem) -> Grid<[f64; 2]> {
        let projection = MapProjection::from_epsg(dem.horizontal_epsg.expect("a CRS")).expect("a projection");
        let (w, h) = (dem.heights.width(), dem.heights.height());
        let cell = |i: usize| {
            let (x, y) = dem.geotransform.map_from_cell((i % w) as f64, (i / w) as f64);
            let (lon, lat) = projection.lonlat_from_map(x, y).expect("a place");
            self.place(lon, lat)
        };
        Grid::from_vec(w, h, (0..w * h).map(cell).collect()).expect("a grid")
    }

    fn truth(&self, dem: &Dem, half_m: f64) -> Grid<f32> {
        self.places(dem).map(|&[x, y]| {
            let inside = x.abs() <= half_m && y.abs() <= half_m;
            if inside { (self.ground_m + (self.surface)(x, y)) as f32 } else { f32::NAN }
        })
    }
}

/// Errors per cell.
pub(crate) struct Errors {
    pub(crate) errors: Grid<f32>,
    truth: Grid<f32>,
    places: Grid<[f64; 2]>,
}

impl Errors {
    /// Returns the score over the cells whose place (x, y) belongs to a region.
    pub(crate) fn over(&self, region: impl Fn(f64, f64) -> bool) -> Score {
        let inside = self.truth.data().iter().zip(self.places.data()).map(|(t, p)| !t.is_nan() && region(p[0], p[1]));
        let chosen: Vec<f64> =
            self.errors.data().iter().zip(inside).filter(|(_, i)| *i).map(|(e, _)| f64::from(*e)).collect();
        Score::of(chosen)
    }
}

pub(crate) fn median(values: &mut [f64]) -> f64 {
    upper_median(values).unwrap_or(f64::NAN)
}

impl Score {
    /// Returns the score of cells with these errors, NaN in voids.
    pub(crate) fn of(chosen: Vec<f64>) -> Self {
        let share = |f: &dyn Fn(&&f64) -> bool| chosen.iter().filter(f).count() as f64 / chosen.len().max(1) as f64;
        let mut known: Vec<f64> = chosen.iter().copied().filter(|e| e.is_finite()).collect();
        let bias_m = median(&mut known);
        let nmad_m = NMAD_FACTOR * median(&mut known.iter().map(|e| (e - bias_m).abs()).collect::<Vec<_>>());
        Self {
            cells: chosen.len(),
            covered: share(&|e| e.is_finite()),
            right: share(&|e| e.abs() < 1.0),
            wrong: share(&|e| e.abs() > 2.0),
            bias_m,
            nmad_m,
        }
    }

    /// Fails, with all numbers, unless at least `right` of the cells are right and at most `wrong`
    /// wrong.
    pub(crate) fn expect(&self, case: &str, right: f64, wrong: f64) {
        assert!(self.cells > 100, "{case}: the region is empty: {self:?}");
        assert!(
            self.right >= right && self.wrong <= wrong,
            "{case}: expected ≥ {right} right, ≤ {wrong} wrong: {self:?}"
        );
    }
}

impl Outcome {
    /// Returns the share of the inner cells with a height in either DSM whose heights agree to a
    /// tolerance.
    pub(crate) fn agreement(&self, other: &Self, tolerance_m: f32) -> f64 {
        let (a, b) = (&self.dem, &other.dem);
        let margin = |n: usize| n / 6..n - n / 6;
        let (mut same, mut known) = (0, 0);
        for row in margin(a.heights.height()) {
            for column in margin(a.heights.width()) {
                let (x, y) = a.geotransform.map_from_cell(column as f64, row as f64);
                let at = b.geotransform.cell_from_map(x, y).expect("a north-up grid");
                let (c, r) = (at.0.round(), at.1.round());
                if c < 0.0 || r < 0.0 {
                    continue;
                }
                let Some(theirs) = b.heights.get(c as usize, r as usize) else { continue };
                let ours = a.heights[(column, row)];
                known += usize::from(!(ours.is_nan() && theirs.is_nan()));
                same += usize::from((ours - theirs).abs() <= tolerance_m);
            }
        }
        f64::from(same as u32) / f64::from(known.max(1) as u32)
    }

    /// Returns whether a warning of the report contains a text.
    pub(crate) fn warns(&self, text: &str) -> bool {
        self.report.warnings.iter().any(|w| w.contains(text))
    }
}
