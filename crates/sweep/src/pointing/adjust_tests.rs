//! Tests of the adjustment: planted errors are found, a dense bundle adjustment that was written
//! apart finds the same, and a large block takes seconds.

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use geodesy::LonLatHeight;
use nalgebra::{DMatrix, DVector};

use super::{AdjustConfig, ControlPoint, ModelOrder, Observations, Track, adjust, adjust_to_control, ground_of};
use crate::testing::camera::leaning_camera;

const SIZE: usize = 400;

/// A number between −1 and 1 that follows from its position.
fn noise(i: usize) -> f64 {
    let mixed = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((mixed ^ (mixed >> 32)) % 2_000_001) as f64 / 1e6 - 1.0
}

/// Ground points of a lattice.
fn lattice() -> Vec<LonLatHeight> {
    let point = |i: usize| {
        let (e, n) = ((i % 12) as f64 / 12.0 - 0.45, (i / 12) as f64 / 12.0 - 0.45);
        LonLatHeight::new(e * 1.6e-3, n * 1.6e-3, ((i * 37) % 50) as f64 - 10.0)
    };
    (0..144).map(point).collect()
}

/// Tracks of ground points, seen by cameras whose images are distorted by `error`.
fn seen(ground: &[LonLatHeight], cameras: &[RpcCamera], error: impl Fn(usize, ImagePoint) -> [f64; 2]) -> Vec<Track> {
    let track = |g: &LonLatHeight| {
        let one = |(view, camera): (usize, &RpcCamera)| {
            let p = camera.project(*g).unwrap();
            let [sample, line] = error(view, p);
            (view, ImagePoint::new(p.sample + sample, p.line + line))
        };
        cameras.iter().enumerate().map(one).collect()
    };
    ground.iter().map(track).collect()
}

fn tracks(cameras: &[RpcCamera], shifts: &[[f64; 2]]) -> Vec<Track> {
    seen(&lattice(), cameras, |view, _| shifts[view])
}

fn three_cameras() -> [RpcCamera; 3] {
    [[0.0, 0.02], [0.5, 0.1], [-0.3, 0.4]].map(|p| leaning_camera(SIZE, p))
}

#[test]
fn planted_shifts_are_taken_out_among_outliers() {
    let cameras = three_cameras();
    let mut tracks = tracks(&cameras, &[[3.0, -4.0], [-1.0, 2.0], [0.5, 5.0]]);
    for (i, track) in tracks.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0) {
        track[1].1.line += 9.0 + (i % 5) as f64;
    }
    let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks, &AdjustConfig::default());
    assert_eq!(found.order, ModelOrder::Translation);
    assert!(found.rms_px < 0.02, "{}", found.rms_px);
    let outliers = found.ground.iter().filter(|g| g.is_none()).count();
    assert_eq!(outliers, tracks.len().div_ceil(7));
}

#[test]
fn a_view_that_is_grossly_off_is_moved_and_the_others_stay() {
    // The views lie along a pass: a common height change moves views 0 and 2 apart, and nothing
    // moves view 1 alone.
    let cameras = [[0.0, 0.5], [0.05, 0.0], [0.0, -0.5]].map(|p| leaning_camera(SIZE, p));
    let tracks = tracks(&cameras, &[[0.0; 2], [31.0, -27.0], [0.0; 2]]);
    let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks, &AdjustConfig::default());
    let [a, b, c] = [0, 1, 2].map(|i| found.corrections[i].translation_px);
    assert!(a[0].hypot(a[1]) < 3.0 && c[0].hypot(c[1]) < 3.0, "{a:?} {b:?} {c:?}");
    assert!(found.rms_px < 0.02, "{}", found.rms_px);
}

#[test]
fn good_pointing_is_left_alone_and_no_ties_change_nothing() {
    let cameras = three_cameras();
    let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks(&cameras, &[[0.0; 2]; 3]), &AdjustConfig::default());
    assert_eq!(found.order, ModelOrder::None);
    let found = adjust(&cameras, &[(SIZE, SIZE); 3], &[], &AdjustConfig::default());
    assert!(found.corrections.iter().all(|c| *c == ImageCorrection::IDENTITY));
}

/// A second adjustment that starts from the first one's corrections has nothing left to do.
#[test]
fn an_adjustment_starts_from_the_corrections_that_cameras_have() {
    let cameras = three_cameras();
    let tracks = seen(&lattice(), &cameras, |view, p| error(ModelOrder::Drift, view, p));
    let sizes = [(SIZE, SIZE); 3];
    let first = adjust(&cameras, &sizes, &tracks, &AdjustConfig::default());
    assert_eq!(first.order, ModelOrder::Drift);
    let corrected = |(camera, correction): (&RpcCamera, &ImageCorrection)| RpcCamera {
        rpc: camera.rpc.clone(),
        correction: *correction,
    };
    let corrected: Vec<RpcCamera> = cameras.iter().zip(&first.corrections).map(corrected).collect();
    let second = adjust(&corrected, &sizes, &tracks, &AdjustConfig::default());
    assert_eq!(second.order, ModelOrder::None);
    assert_eq!(second.corrections, first.corrections);
    let more = adjust(
        &corrected,
        &sizes,
        &seen(&lattice(), &cameras, |view, p| {
            let [sample, line] = error(ModelOrder::Drift, view, p);
            [sample + 2.0 * view as f64, line]
        }),
        &AdjustConfig::default(),
    );
    assert!(more.order > ModelOrder::None && more.residual_px.1 < 0.2, "{:?}", more.residual_px);
}

/// Errors of each kind, with noise of a fifth of a pixel: shifts, drifts along the lines, and
/// changes along the samples.
fn error(kind: ModelOrder, view: usize, p: ImagePoint) -> [f64; 2] {
    let seed = |k: usize| noise(1000 * view + k + 7);
    let at = [p.sample / SIZE as f64 - 0.5, p.line / SIZE as f64 - 0.5];
    let random = |k: usize| 0.2 * noise((p.sample * 8191.0) as usize ^ ((p.line * 131.0) as usize + 64 * view + k));
    let mut out = [4.0 * seed(0) + random(0), 4.0 * seed(1) + random(1)];
    if kind >= ModelOrder::Drift {
        out = [out[0] + 6.0 * seed(2) * at[1], out[1] + 6.0 * seed(3) * at[1]];
    }
    if kind >= ModelOrder::Affine {
        out = [out[0] + 6.0 * seed(4) * at[0], out[1] + 6.0 * seed(5) * at[0]];
    }
    out
}

#[test]
fn the_order_is_that_of_the_planted_errors() {
    let cameras = three_cameras();
    for kind in [ModelOrder::Translation, ModelOrder::Drift, ModelOrder::Affine] {
        let tracks = seen(&lattice(), &cameras, |view, p| error(kind, view, p));
        let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks, &AdjustConfig::default());
        assert_eq!(found.order, kind);
        assert!(found.residual_px.1 < 0.2, "{kind:?}: {:?}", found.residual_px);
    }
}

/// The first two views drift to opposite sides, among errors of half a pixel.
#[test]
fn a_drift_needs_strong_evidence() {
    let cameras = three_cameras();
    let half = 0.5 * SIZE as f64;
    let order = |drift_px: f64| {
        let wrong = |view: usize, p: ImagePoint| {
            let along = [drift_px, -drift_px, 0.0][view] * (p.line / half - 1.0);
            let [sample, line] = error(ModelOrder::Translation, view, p);
            let at = (p.sample * 31.0 + p.line * 57.0) as usize;
            [sample + along + 0.5 * noise(at), line + 0.5 * noise(at + 1)]
        };
        adjust(&cameras, &[(SIZE, SIZE); 3], &seen(&lattice(), &cameras, wrong), &AdjustConfig::default()).order
    };
    assert_eq!(order(0.0), ModelOrder::Translation);
    // The criterion alone would follow this one already.
    assert_eq!(order(0.35), ModelOrder::Translation);
    assert_eq!(order(0.6), ModelOrder::Drift);
}

/// Two views whose lines are stretched alike, and that have a small drift between them: ties of two
/// views hardly tell the stretch, and do not turn it into a drift along the samples, which tilts
/// the ground.
#[test]
fn a_drift_that_all_views_share_stays_small() {
    let cameras = [[0.1, 0.3], [-0.1, -0.3]].map(|p| leaning_camera(SIZE, p));
    let half = 0.5 * SIZE as f64;
    let wrong = |view: usize, p: ImagePoint| {
        let [sample, line] = error(ModelOrder::Translation, view, p);
        let along = p.line / half - 1.0;
        [sample + if view == 0 { 0.0 } else { 1.2 * along }, line + 6.0 * along]
    };
    let found = adjust(&cameras, &[(SIZE, SIZE); 2], &seen(&lattice(), &cameras, wrong), &AdjustConfig::default());
    assert_eq!(found.order, ModelOrder::Drift);
    for axis in 0..2 {
        let shared = found.corrections.iter().map(|c| half * c.linear[axis][1]).sum::<f64>() / 2.0;
        // The true one is 0.6 px along the samples. The ties alone make −1.3 px of it.
        assert!(shared.abs() < 0.6, "{axis}: {shared} px at the border: {:?}", found.corrections);
    }
}

/// The order follows from the number of independent ties: the same ties a hundred times over are no
/// more evidence.
#[test]
fn repeated_ties_are_no_more_evidence() {
    let cameras = three_cameras();
    let few: Vec<LonLatHeight> = lattice().into_iter().step_by(7).collect();
    let once = seen(&few, &cameras, |view, p| error(ModelOrder::Translation, view, p));
    // Copies of a point a hundredth of a pixel apart have the same error.
    let copies = |track: &Track| -> Vec<Track> {
        let moved =
            |k: usize| track.iter().map(move |(v, p)| (*v, ImagePoint::new(p.sample + 1e-4 * k as f64, p.line)));
        (0..100).map(|k| moved(k).collect()).collect()
    };
    let many: Vec<Track> = once.iter().flat_map(copies).collect();
    let order = |tracks: &[Track]| adjust(&cameras, &[(SIZE, SIZE); 3], tracks, &AdjustConfig::default()).order;
    assert_eq!(order(&once), ModelOrder::Translation);
    assert_eq!(order(&many), ModelOrder::Translation);
}

/// A dense bundle adjustment with the ground points as unknowns, written apart from the sparse one.
/// Returns the parameters of each view: shift, and the linear part in units of half the image.
fn dense(cameras: &[RpcCamera], tracks: &[Track], columns: &[usize]) -> Vec<[f64; 6]> {
    let (views, half, centre) = (cameras.len(), SIZE as f64 / 2.0, (SIZE as f64 - 1.0) / 2.0);
    let basis = |p: ImagePoint| {
        let (s, l) = ((p.sample - centre) / half, (p.line - centre) / half);
        [[1.0, 0.0], [0.0, 1.0], [s, 0.0], [l, 0.0], [0.0, s], [0.0, l]]
    };
    let mut x = vec![[0.0; 6]; views];
    let place = |view: usize, x: &[f64; 6], g: [f64; 3]| {
        let at = LonLatHeight::new(g[0] * 1e-5, g[1] * 1e-5, g[2]);
        let p = RpcCamera::new(cameras[view].rpc.clone()).project(at).unwrap();
        let b = basis(p);
        let sum = |axis: usize| (0..6).map(|k| b[k][axis] * x[k]).sum::<f64>();
        [p.sample + sum(0), p.line + sum(1)]
    };
    // Residuals and derivatives with respect to the ground point of one track.
    let rows = |track: &Track, x: &[[f64; 6]], g: [f64; 3]| {
        let mut r = DVector::zeros(2 * track.len());
        let mut j = DMatrix::zeros(2 * track.len(), 3);
        for (i, (view, observed)) in track.iter().enumerate() {
            let p = place(*view, &x[*view], g);
            (r[2 * i], r[2 * i + 1]) = (observed.sample - p[0], observed.line - p[1]);
            for axis in 0..3 {
                let moved =
                    |d: f64| place(*view, &x[*view], std::array::from_fn(|k| g[k] + if k == axis { d } else { 0.0 }));
                let (low, high) = (moved(-0.5), moved(0.5));
                (j[(2 * i, axis)], j[(2 * i + 1, axis)]) = (high[0] - low[0], high[1] - low[1]);
            }
        }
        (r, j)
    };
    let mut ground = vec![[0.0; 3]; tracks.len()];
    let size = columns.len() * views;
    for _ in 0..8 {
        let mut found = Vec::new();
        for (track, g) in tracks.iter().zip(&mut ground) {
            for _ in 0..20 {
                let (r, j) = rows(track, &x, *g);
                let step = (j.transpose() * &j).lu().solve(&(j.transpose() * &r)).unwrap();
                (0..3).for_each(|k| g[k] += step[k]);
            }
            let (r, j) = rows(track, &x, *g);
            let norm = (r.norm_squared() / (r.len() - 3) as f64).sqrt();
            found.push((r, j, norm));
        }
        let mut norms: Vec<f64> = found.iter().map(|(_, _, norm)| *norm).collect();
        norms.sort_by(f64::total_cmp);
        let scale = (norms[norms.len() / 2] / 0.6745).max(0.05);
        let share = (25.0 / tracks.len() as f64).min(1.0);
        let all = size + 3 * tracks.len();
        let (mut normal, mut right) = (DMatrix::zeros(all, all), DVector::zeros(all));
        for view in 0..views {
            let square = |columns: std::ops::Range<usize>| columns.map(|k| x[view][k] * x[view][k]).sum::<f64>();
            // Ten pixels of shift, and two in a thousand at the borders of the image.
            let weights = [1.0 / (10.0 * 10.0 + square(0..2)), 1.0 / (0.4 * 0.4 + square(2..6))];
            for (k, &column) in columns.iter().enumerate() {
                let weight = weights[usize::from(column > 1)];
                normal[(view * columns.len() + k, view * columns.len() + k)] += weight;
                right[view * columns.len() + k] -= weight * x[view][column];
            }
        }
        for (t, (track, (r, j, norm))) in tracks.iter().zip(&found).enumerate() {
            let mut design = DMatrix::zeros(r.len(), all);
            for (i, (view, observed)) in track.iter().enumerate() {
                for (k, &column) in columns.iter().enumerate() {
                    for axis in 0..2 {
                        design[(2 * i + axis, view * columns.len() + k)] = basis(*observed)[column][axis];
                    }
                }
            }
            design.view_mut((0, size + 3 * t), (r.len(), 3)).copy_from(j);
            let weight = share / (1.0 + (norm / scale).powi(2)) / (scale * scale);
            normal += design.transpose() * &design * weight;
            right += design.transpose() * r * weight;
        }
        let step = normal.lu().solve(&right).unwrap();
        for view in 0..views {
            for (k, &column) in columns.iter().enumerate() {
                x[view][column] += step[view * columns.len() + k];
            }
        }
        if step.rows(0, size).amax() < 1e-4 {
            break;
        }
    }
    x
}

#[test]
fn the_sparse_adjustment_equals_a_dense_one() {
    let cameras = [[0.0, 0.02], [0.5, 0.1], [-0.3, 0.4], [0.2, -0.5]].map(|p| leaning_camera(SIZE, p));
    let ground: Vec<LonLatHeight> = lattice().into_iter().step_by(3).collect();
    for (kind, columns) in [
        (ModelOrder::Translation, &[0, 1][..]),
        (ModelOrder::Drift, &[0, 1, 3, 5][..]),
        (ModelOrder::Affine, &[0, 1, 2, 3, 4, 5][..]),
    ] {
        let mut tracks = seen(&ground, &cameras, |view, p| error(kind, view, p));
        for (i, track) in tracks.iter_mut().enumerate() {
            // Most tracks leave out a view or two, and some are wrong.
            track.retain(|(view, _)| view % 4 != i % 4 && (i % 3 != 0 || (view + 1) % 4 != i % 4));
            track[0].1.line += if i % 11 == 0 { 8.0 } else { 0.0 };
        }
        let found = adjust(&cameras, &[(SIZE, SIZE); 4], &tracks, &AdjustConfig::default());
        assert_eq!(found.order, kind);
        let half = SIZE as f64 / 2.0;
        for (view, (correction, x)) in found.corrections.iter().zip(dense(&cameras, &tracks, columns)).enumerate() {
            let [[a, b], [c, d]] = correction.linear;
            let [sample, line] = correction.translation_px;
            let own = [sample, line, a * half, b * half, c * half, d * half];
            for k in 0..6 {
                assert!((own[k] - x[k]).abs() < 1e-6, "{kind:?}, view {view}, {k}: {} {}", own[k], x[k]);
            }
        }
    }
}

/// A block of 200 images in four strips with shifts and drifts, and 20,000 tracks over two to six
/// images.
#[test]
fn a_block_of_two_hundred_images_takes_seconds() {
    const STRIPS: usize = 4;
    const IN_STRIP: usize = 50;
    const TRACKS: usize = 20_000;
    /// Degrees from one image to the next, a third of the image, and from strip to strip.
    const STEP: [f64; 2] = [0.33 * 400.0 * 0.5 / 111_320.0, 0.66 * 400.0 * 0.5 / 111_320.0];
    let camera = |i: usize| {
        let (strip, along) = (i / IN_STRIP, i % IN_STRIP);
        let lean = [0.3 * (strip % 2) as f64 - 0.15, 0.4 * ((along % 3) as f64 - 1.0)];
        let mut camera = leaning_camera(SIZE, lean);
        camera.rpc.lat_off = along as f64 * STEP[0];
        camera.rpc.long_off = strip as f64 * STEP[1];
        camera
    };
    let cameras: Vec<RpcCamera> = (0..STRIPS * IN_STRIP).map(camera).collect();
    let mut tracks: Vec<Track> = Vec::with_capacity(TRACKS);
    for i in 0.. {
        if tracks.len() == TRACKS {
            break;
        }
        let [east, north, up] = [3 * i, 3 * i + 1, 3 * i + 2].map(noise);
        let ground = LonLatHeight::new((1.5 + 2.0 * east) * STEP[1], (24.5 + 25.5 * north) * STEP[0], 20.0 * up);
        let place = |(view, camera): (usize, &RpcCamera)| {
            let p = camera.project(ground).ok()?;
            let is_inside = (0.0..SIZE as f64).contains(&p.sample) && (0.0..SIZE as f64).contains(&p.line);
            let [sample, line] = error(ModelOrder::Drift, view, p);
            is_inside.then(|| (view, ImagePoint::new(p.sample + sample, p.line + line)))
        };
        let track: Track = cameras.iter().enumerate().filter_map(place).take(6).collect();
        if track.len() > 1 {
            tracks.push(track);
        }
    }
    let begun = std::time::Instant::now();
    let found = adjust(&cameras, &vec![(SIZE, SIZE); cameras.len()], &tracks, &AdjustConfig::default());
    let seconds = begun.elapsed().as_secs_f64();
    assert_eq!(found.order, ModelOrder::Drift);
    assert!(found.rms_px < 0.3, "{}", found.rms_px);
    assert!(seconds < 60.0, "{seconds} s");
}

/// Control points of a tenth of a metre bring cameras that are off by several pixels to within a
/// pixel at points that were not used.
#[test]
fn control_points_place_the_block() {
    let cameras = three_cameras();
    let sizes = [(SIZE, SIZE); 3];
    let tracks = seen(&lattice(), &cameras, |view, p| error(ModelOrder::Drift, view, p));
    let known = |i: usize| {
        let (east, north) = (0.35 * ((i % 3) as f64 - 1.0), 0.35 * ((i / 3) as f64 - 1.0));
        LonLatHeight::new(1.6e-3 * east, 1.6e-3 * north, 7.0 * (i % 4) as f64)
    };
    let points: Vec<LonLatHeight> = (0..9).map(known).collect();
    let places = seen(&points, &cameras, |view, p| error(ModelOrder::Drift, view, p));
    let is_control = |i: &usize| [0, 2, 4, 6, 8].contains(i);
    let control = |i: usize| ControlPoint {
        ground: points[i],
        horizontal_m: 0.1,
        vertical_m: 0.1,
        pixel_px: 0.3,
        seen: places[i].clone(),
    };
    let mut control: Vec<ControlPoint> = (0..9).filter(is_control).map(control).collect();
    let errors_m = |control: &[ControlPoint]| {
        let observations = Observations { tracks: &tracks, control };
        let found = adjust_to_control(&cameras, &sizes, observations, &AdjustConfig::default());
        let corrected = |(camera, correction): (&RpcCamera, &ImageCorrection)| RpcCamera {
            rpc: camera.rpc.clone(),
            correction: *correction,
        };
        let corrected: Vec<RpcCamera> = cameras.iter().zip(&found.corrections).map(corrected).collect();
        let off = |i: usize| {
            let at = ground_of(&corrected, &places[i]).unwrap();
            let metres = [at.lon_deg - points[i].lon_deg, at.lat_deg - points[i].lat_deg].map(|d| d * 111_320.0);
            metres[0].hypot(metres[1]).max((at.height_m - points[i].height_m).abs())
        };
        let largest = (0..9).filter(|i| !is_control(i)).map(off).fold(0.0, f64::max);
        (largest, found)
    };
    // Pixels of half a metre, whose places have a noise of a fifth.
    let (without, _) = errors_m(&[]);
    let (with, found) = errors_m(&control);
    assert!(without > 1.0 && with < 0.5, "{without} {with}");
    assert!(found.control_residual.iter().all(|residual| *residual < 3.0), "{:?}", found.control_residual);
    // A wrong one yields to the others, and is shown.
    control[2].ground.height_m += 30.0;
    let (with, found) = errors_m(&control);
    assert!(with < 0.5, "{with}");
    assert!(found.control_residual[2] > 10.0, "{:?}", found.control_residual);
}
