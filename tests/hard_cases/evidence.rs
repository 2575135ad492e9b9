//! Wrong inputs that look right: each ends with a refusal, or with a warning that names the image.

use camera::ImagePoint;
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, write_cog};
use jobs::dsm::{DsmConfig, DsmError, Preset};
use raster::{Grid, Window};

use crate::stage::{EASY, Shot, Stage, triplet};

/// Runs shots and expects a refusal, or a warning that names the second image. A small error that
/// is taken out needs none: the heights are then right.
#[track_caller]
fn named_or_refused(case: &str, shots: &[Shot], set: impl FnOnce(&mut DsmConfig)) {
    if let Ok(outcome) = EASY.stage.run(shots, set) {
        let score = EASY.stage.aligned_score(&outcome);
        let is_right = score.right > 0.95 && EASY.stage.score(&outcome).bias_m.abs() < 2.0;
        assert!(outcome.warns("view_2.tif") || is_right, "{case}: {:?} {score:?}", outcome.report);
    }
}

/// Changes the second of the easy shots, and runs all three and the first two alone.
#[track_caller]
fn second_is_wrong(case: &str, change: impl Fn(&mut Shot)) {
    let mut shots = EASY.shots.clone();
    change(&mut shots[1]);
    named_or_refused(&format!("{case}, three views"), &shots, |_| {});
    named_or_refused(&format!("{case}, two views"), &shots[..2], |_| {});
}

#[test]
fn easy_scenes_have_no_warning() {
    assert!(EASY.outcome.report.warnings.is_empty(), "{:?}", EASY.outcome.report.warnings);
    let pair = EASY.stage.run(&EASY.shots[..2], |_| {}).unwrap();
    assert!(pair.report.warnings.is_empty(), "{:?}", pair.report.warnings);
}

#[test]
fn a_negative_image_is_named_or_refused() {
    second_is_wrong("a negative image", |shot| shot.image = shot.image.map(|v| 2048 - v));
}

#[test]
fn a_mirrored_rpc_is_named_or_refused() {
    second_is_wrong("a mirrored RPC", |shot| {
        shot.rpc.samp_num.iter_mut().for_each(|c| *c = -*c);
    });
}

#[test]
fn an_image_of_another_scene_is_named_or_refused() {
    let other = Stage {
        paint: Box::new(|[x, y, z], _| crate::stage::weathered([x + 5000.0, y - 3000.0, z])),
        ..Stage::default()
    };
    let looks = triplet(0.5);
    let shot = other.shot(other.rpc(&looks[1]), 1);
    second_is_wrong("an image of another scene", |own| own.image = shot.image.clone());
}

/// Each shift of the second image, columns and rows, is named or refused.
fn shifts_are_named_or_refused(shifts: [[f64; 2]; 3]) {
    for [sample, line] in shifts {
        let mut shots = EASY.shots.clone();
        shots[1].rpc.samp_off += sample;
        shots[1].rpc.line_off += line;
        named_or_refused(&format!("{sample} {line} px off"), &shots, |_| {});
    }
}

#[test]
fn an_rpc_that_is_thirty_metres_off_is_named_or_refused() {
    shifts_are_named_or_refused([[60.0, 0.0], [0.0, 60.0], [-42.0, 42.0]]);
}

#[test]
fn a_height_offset_of_fifty_metres_is_named_or_refused() {
    let mut shots = EASY.shots.clone();
    shots[1].rpc.height_off += 50.0;
    named_or_refused("HEIGHT_OFF + 50 m", &shots, |_| {});
}

#[test]
fn pointing_errors_of_eighty_to_a_hundred_pixels_are_named_or_refused() {
    shifts_are_named_or_refused([[80.0, 0.0], [0.0, 100.0], [-64.0, 64.0]]);
}

/// Two views tell an error along the line of sight from a height by the heights for which the RPCs
/// are made.
#[test]
fn two_views_that_are_off_along_the_line_of_sight_are_named_or_refused() {
    let mut shots: Vec<Shot> = EASY.shots[..2].to_vec();
    for shot in &mut shots {
        shot.rpc = crate::cameras::with_heights_about(shot.rpc.clone(), 190.0, 60.0);
    }
    shots[1].rpc.line_off += 100.0;
    named_or_refused("100 lines", &shots, |_| {});
}

#[test]
fn an_elevation_model_at_other_heights_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    let heights = EASY.outcome.dem.heights.map(|h| if h.is_nan() { 180.0 } else { *h });
    let write = |by: f32| {
        let heights = heights.map(|h| h + by);
        let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
        let crs = Crs::ellipsoidal(EASY.outcome.dem.horizontal_epsg.unwrap());
        write_cog(&path, &CogRaster::new(&bands, EASY.outcome.dem.geotransform, crs), true).unwrap();
    };
    write(300.0);
    let refused = EASY.stage.run(&EASY.shots, |c| c.dem = Some(path.clone())).err();
    assert!(matches!(refused, Some(DsmError::DemMissesScene { .. })), "{refused:?}");
    write(0.0);
    let outcome = EASY.stage.run(&EASY.shots, |c| c.dem = Some(path.clone())).unwrap();
    assert!(outcome.report.warnings.is_empty(), "{:?}", outcome.report.warnings);
}

/// The last lines of the first image and the first lines of the second one show the same ground.
#[test]
fn an_overlap_of_twenty_lines_is_named_or_refused() {
    let cut = |shot: &Shot, from: usize, lines: usize| {
        let window = Window { x: 0, y: from as i64, width: shot.image.width(), height: lines };
        let rpc = shot.rpc.cropped(ImagePoint::new(0.0, from as f64));
        Shot { image: shot.image.window(window, 0), rpc, ..shot.clone() }
    };
    let shots = [cut(&EASY.shots[0], 0, 150), cut(&EASY.shots[1], 130, 150)];
    named_or_refused("20 lines", &shots, |_| {});
    named_or_refused("20 lines and a range", &shots, |c| {
        c.height_range_m = Some(jobs::dsm::HeightRange::new(160.0, 240.0));
    });
}

/// Views of the sample town, whose sun throws shadows.
fn town(count: usize) -> Vec<Shot> {
    let town = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town");
    let shot = |number: usize| {
        let path = town.join(format!("view_{number}.tif"));
        let source = formats::raster::ImageSource::open(&path).unwrap();
        let whole = Window::whole(source.info().width, source.info().height);
        let image = source.read_luma(whole).unwrap().luma.map(|value| value.round() as u16);
        Shot { image, rpc: formats::rpc::read_for_image(&path).unwrap().rpc, no_data: None }
    };
    [1, 3, 2][..count].iter().map(|number| shot(*number)).collect()
}

/// Returns an image with its columns, or also its lines, in the other direction.
fn reversed(image: &Grid<u16>, lines_too: bool) -> Grid<u16> {
    let mut rows: Vec<Vec<u16>> = (0..image.height()).map(|y| image.row(y).iter().rev().copied().collect()).collect();
    if lines_too {
        rows.reverse();
    }
    Grid::from_vec(image.width(), image.height(), rows.concat()).unwrap()
}

/// Runs shots of the town, fast.
fn run_fast(shots: &[Shot]) -> Result<Vec<String>, DsmError> {
    let outcome = EASY.stage.run(shots, |config| config.preset = Preset::Fast)?;
    Ok(outcome.report.warnings)
}

/// The town as it is gives no warning. Two mirrored views tell only where their parallax lies
/// across the sides of the images.
#[test]
fn images_that_are_turned_or_mirrored_against_their_rpcs_are_named() {
    let good = town(2);
    assert_eq!(run_fast(&good).unwrap(), Vec::<String>::new());
    let changed = |lines_too: bool, count: usize| -> Vec<Shot> {
        let shots = town(count).into_iter();
        shots.map(|shot| Shot { image: reversed(&shot.image, lines_too), ..shot }).collect()
    };
    let is_named = |shots: &[Shot], word: &str| {
        let warnings = run_fast(shots).unwrap();
        assert!(warnings.iter().any(|w| w.contains(word) && w.contains("view_2.tif")), "{word}: {warnings:?}");
    };
    is_named(&changed(true, 2), "upside down");
    is_named(&changed(false, 3), "mirrored");
}

#[test]
fn exchanged_rpcs_of_three_images_are_named_or_refused() {
    let mut shots = town(3);
    let first = shots[0].rpc.clone();
    shots[0].rpc = shots[1].rpc.clone();
    shots[1].rpc = shots[2].rpc.clone();
    shots[2].rpc = first;
    if let Ok(warnings) = run_fast(&shots) {
        assert!(warnings.iter().any(|w| w.contains("exchange") && w.contains("view_2.tif")), "{warnings:?}");
    }
}

/// A copy with noise, other grey values or a cut border is refused among two and three views.
#[test]
fn copies_of_one_picture_are_refused() {
    let shots = town(3);
    let source = &shots[0].image;
    let copy = |change: &dyn Fn(usize, u16) -> u16| {
        let data = source.data().iter().enumerate().map(|(i, value)| change(i, *value)).collect();
        Grid::from_vec(source.width(), source.height(), data).unwrap()
    };
    let grainy = copy(&|i, value| value + (i.wrapping_mul(2_654_435_761) >> 9) as u16 % 5);
    let dull = copy(&|_, value| (0.8 * f64::from(value)) as u16 + 20);
    let cut = source.window(Window { x: 31, y: 17, width: source.width() - 31, height: source.height() - 17 }, 0);
    for (case, image) in [("grainy", grainy), ("dull", dull), ("cut", cut)] {
        for count in [2, 3] {
            let mut shots = shots[..count].to_vec();
            shots[1].image = image.clone();
            let refused = run_fast(&shots).err();
            assert!(matches!(refused, Some(DsmError::SamePixels { .. })), "{case} among {count}: {refused:?}");
        }
    }
}
