//! Pixels with little texture, with none, or with a different one in every view.

use eval::AlignmentMethod;
use jobs::dsm::{DsmError, Fill};
use raster::Grid;

use crate::stage::{EASY, Shot, Stage, look, noise_3d, rolling, triplet, uniform, village, weathered};

fn blank(shot: &Shot, value: u16) -> Shot {
    Shot { image: Grid::filled(shot.image.width(), shot.image.height(), value), ..shot.clone() }
}

#[test]
fn blank_images_are_refused() {
    for value in [300, u16::MAX] {
        let shots: Vec<Shot> = EASY.shots.iter().map(|s| blank(s, value)).collect();
        let refused = EASY.stage.run(&shots, |_| {}).err();
        assert!(matches!(refused, Some(DsmError::Blank { .. })), "{value}: {refused:?}");
    }
}

#[test]
fn one_blank_view_is_named_and_does_not_harm_the_rest() {
    let mut shots = EASY.shots.clone();
    shots[1] = blank(&shots[1], 300);
    let outcome = EASY.stage.run(&shots, |_| {}).unwrap();
    let score = EASY.stage.score(&outcome);
    score.expect("two views and a blank one", 0.92, 0.04);
    assert!(outcome.warns("view_2.tif"), "{:?}", outcome.report.warnings);
}

/// The 20 m roof and the ground beside it are white in all views. A surface without texture has no
/// observed height.
#[test]
fn a_saturated_roof_is_right_or_void() {
    let white = |x: f64, y: f64| (x - 35.0).hypot(y + 5.0) < 13.0;
    for limit in [2047, u16::MAX] {
        let stage = Stage {
            paint: Box::new(move |p, _| if white(p[0], p[1]) { 100.0 } else { weathered(p) }),
            ..Stage::default()
        };
        let mut shots = stage.shots(&triplet(0.5));
        // 2047 is the white of an 11-bit sensor, 65535 that of the file.
        for s in &mut shots {
            s.image.data_mut().iter_mut().filter(|v| **v >= 2047).for_each(|v| *v = limit);
        }
        let outcome = stage.run(&shots, |_| {}).unwrap();
        let errors = stage.errors(&outcome, 50.0, AlignmentMethod::None);
        let (inside, beside) = (errors.over(white), errors.over(|x, y| !white(x, y)));
        assert!(inside.wrong < 0.15, "{limit}: {inside:?}");
        beside.expect("beside the white", 0.95, 0.03);
        if limit == 2047 {
            let closed = stage.run(&shots, |config| config.fill = Fill::All).unwrap();
            let (before, after) = (&outcome.report.surface, &closed.report.surface);
            assert!(
                inside.covered < 0.5 && stage.errors(&closed, 50.0, AlignmentMethod::None).over(white).covered == 1.0
            );
            // Voids that are closed on request are counted as filled, and nothing else changes.
            assert!(
                before.counts.observed == after.counts.observed && before.counts.filled + 1000 < after.counts.filled,
                "{before:?} {after:?}"
            );
            let open = stage.run(&shots, |config| config.fill = Fill::None).unwrap().report.surface;
            assert!(
                before.counts.observed == open.counts.observed && before.counts.filled > 0 && open.counts.filled == 0,
                "{before:?} {open:?}"
            );
        }
    }
}

/// A third of the middle view is void, once by its declared no-data value and once as undeclared
/// black.
#[test]
fn voids_in_a_view_leave_the_other_views_heights() {
    for no_data in [Some(0.0), None] {
        let mut shots = EASY.shots.clone();
        for s in &mut shots[1..2] {
            let n = s.image.width();
            s.image.data_mut().iter_mut().enumerate().filter(|(i, _)| i % n < n / 3).for_each(|(_, v)| *v = 0);
            s.no_data = no_data;
        }
        let outcome = EASY.stage.run(&shots, |_| {}).unwrap();
        let score = EASY.stage.score(&outcome);
        score.expect("a third of a view void", 0.93, 0.04);
    }
}

/// The middle view of three has a gap beside the roof of 20 m. What the other two do not match
/// there is not taken for ground that the house hides.
#[test]
fn a_gap_in_an_image_is_not_taken_for_hidden_ground() {
    let stage = Stage::default();
    let mut shots = EASY.shots.clone();
    let size = shots[1].image.width();
    for (i, value) in shots[1].image.data_mut().iter_mut().enumerate() {
        let (column, line) = (i % size, i / size);
        if (190..235).contains(&column) && (115..180).contains(&line) {
            *value = 0;
        }
    }
    shots[1].no_data = Some(0.0);
    let outcome = stage.run(&shots, |_| {}).unwrap();
    let roof = |x: f64, y: f64| (x - 35.0).abs() < 11.0 && (y + 5.0).abs() < 14.0;
    let errors = stage.errors(&outcome, 50.0, AlignmentMethod::None);
    let (beside, all) = (errors.over(roof), errors.over(|_, _| true));
    assert!(beside.wrong < 0.12, "{beside:?}");
    all.expect("a gap beside a house", 0.92, 0.04);
}

/// All views are void west of x = −20 m: there is nothing to see, declared or not, and nothing may
/// be invented.
#[test]
fn where_all_views_are_void_there_is_no_height() {
    for no_data in [Some(0.0), None] {
        let stage =
            Stage { paint: Box::new(|p, _| if p[0] < -20.0 { -1.0 } else { weathered(p) }), ..Stage::default() };
        let mut shots = stage.shots(&triplet(0.5));
        for s in &mut shots {
            s.image.data_mut().iter_mut().filter(|v| **v == 1).for_each(|v| *v = 0);
            s.no_data = no_data;
        }
        let outcome = stage.run(&shots, |_| {}).unwrap();
        let errors = stage.errors(&outcome, 50.0, AlignmentMethod::None);
        let (void, seen) = (errors.over(|x, _| x < -26.0), errors.over(|x, _| x > -18.0));
        assert!(void.covered < 0.02, "{no_data:?}: {void:?}");
        seen.expect("the part that is seen", 0.94, 0.03);
    }
}

/// A court of tiles that repeat every 3 m, 40 m wide: at 0.6 m of parallax per metre a tile is 5 m
/// of height.
fn tiled() -> Stage {
    let tiles = |x: f64, y: f64| {
        let wave = |v: f64| (std::f64::consts::TAU * v / 3.0).sin();
        0.45 + 0.2 * wave(x) + 0.2 * wave(y)
    };
    Stage {
        paint: Box::new(move |p, _| {
            let court = p[0].abs() < 20.0 && p[1].abs() < 20.0;
            if court { tiles(p[0], p[1]) } else { weathered(p) }
        }),
        surface: Box::new(|x, y| if x.abs() < 24.0 && y.abs() < 24.0 { 0.0 } else { village(x, y) }),
        ..Stage::default()
    }
}

#[test]
fn repeated_texture_is_not_taken_for_another_height() {
    let stage = tiled();
    let shots = stage.shots(&triplet(0.5));
    let court = |x: f64, y: f64| x.abs() < 20.0 && y.abs() < 20.0;
    for views in [shots.clone(), vec![shots[0].clone(), shots[2].clone()]] {
        let outcome = stage.run(&views, |_| {}).unwrap();
        let score = stage.errors(&outcome, 50.0, AlignmentMethod::None).over(court);
        assert!(score.wrong < 0.05, "{} views: {score:?}", views.len());
        if views.len() == 3 {
            assert!(score.right > 0.9, "{score:?}");
        }
    }
}

/// Two views of a hall of 12 m whose roof has stripes every 2.2 m. At 0.6 m of parallax per metre
/// they match at heights 3.7 m apart. Without the coarse levels a good part of it lies at another
/// of these heights. Roofs with some other periods still do.
#[test]
fn a_striped_roof_is_mostly_found_by_two_views() {
    let hall = |x: f64, y: f64| x.abs() < 16.0 && y.abs() < 12.0;
    let stripes = |x: f64, y: f64| 0.7 + 0.25 * (std::f64::consts::TAU * (0.95 * x + 0.3 * y) / 2.2).sin();
    let stage = Stage {
        surface: Box::new(move |x, y| if hall(x, y) { 12.0 } else { 0.0 }),
        paint: Box::new(move |p, _| {
            let old = 0.05 * (weathered(p) - 0.45);
            if p[2] > 11.9 { stripes(p[0], p[1]) + old } else { weathered(p) }
        }),
        ..Stage::default()
    };
    let shots = stage.shots(&triplet(0.5));
    let outcome = stage.run(&[shots[0].clone(), shots[2].clone()], |_| {}).unwrap();
    let errors = stage.errors(&outcome, 50.0, AlignmentMethod::None);
    let (roof, beside) = (errors.over(|x, y| x.abs() < 15.0 && y.abs() < 11.0), errors.over(|x, y| !hall(x, y)));
    roof.expect("the striped roof", 0.8, 0.2);
    beside.expect("beside it", 0.98, 0.01);
}

/// South of the shore the water glitters, differently in every view.
#[test]
fn glittering_water_is_void_or_level_and_the_land_is_right() {
    let stage = Stage {
        surface: Box::new(|x, y| if y < -12.0 { -3.0 } else { village(x, y) }),
        paint: Box::new(|p, view| {
            let glitter = 0.25 + 0.15 * noise_3d(90 + view as u64, [p[0] / 0.8, p[1] / 0.8, 0.0]);
            if p[2] < -2.9 { glitter } else { weathered(p) }
        }),
        ..Stage::default()
    };
    let outcome = stage.run(&stage.shots(&triplet(0.5)), |_| {}).unwrap();
    let errors = stage.errors(&outcome, 50.0, AlignmentMethod::None);
    let (water, land) = (errors.over(|_, y| y < -16.0), errors.over(|_, y| y > -9.0));
    land.expect("land", 0.94, 0.04);
    assert!(water.wrong < 0.06, "{water:?}");
}

/// Other sun, other contrast, other cars and other crops on each of four dates.
fn dates() -> Stage {
    let suns = [[0.6, -0.5], [-0.3, -0.9], [0.9, 0.1], [-0.8, -0.5]];
    let lit = move |p: [f64; 3], view: usize| {
        let [sx, sy]: [f64; 2] = suns[view % 4];
        // The sun stands at 50°.
        !(1..40).map(|k| 0.6 * f64::from(k)).any(|d| village(p[0] + sx * d, p[1] + sy * d) > p[2] + 0.2 + 1.2 * d)
    };
    let crop = |p: [f64; 3], view: usize| {
        let field = noise_3d(70, [p[0] / 14.0, p[1] / 14.0, 0.0]) > 0.25 && p[2] < 2.5;
        field.then(|| 0.35 + 0.2 * noise_3d(80 + view as u64, [p[0] / 2.0, p[1] / 2.0, 0.0]))
    };
    let car = |p: [f64; 3], view: usize| {
        let (i, j) = ((p[0] / 6.0).floor(), (p[1] / 6.0).floor());
        let (u, v) = (p[0] - 6.0 * i, p[1] - 6.0 * j);
        let kind = uniform([view as u64, 5, i as i64 as u64, j as i64 as u64]);
        (kind < 0.12 && p[2] < 2.5 && (u - 3.0).abs() < 2.2 && (v - 3.0).abs() < 0.9).then_some(kind * 8.0)
    };
    Stage {
        paint: Box::new(move |p, view| {
            let base = car(p, view).or_else(|| crop(p, view)).unwrap_or_else(|| weathered(p));
            let light = if lit(p, view) { 1.0 } else { 0.35 };
            let (gain, offset, gamma) = [(1.0, 0.0, 1.0), (0.6, 0.1, 1.0), (1.3, 0.05, 1.3), (0.8, 0.2, 0.8)][view % 4];
            offset + gain * (base * light).max(0.0).powf(gamma)
        }),
        ..Stage::default()
    }
}

#[test]
fn four_dates_with_other_suns_cars_and_crops_give_one_surface() {
    let stage = dates();
    let looks = [look(15.0, 12.0, 0.5), look(5.0, 100.0, 0.5), look(14.0, 195.0, 0.5), look(12.0, 290.0, 0.5)];
    let outcome = stage.run(&stage.shots(&looks), |_| {}).unwrap();
    let score = stage.score(&outcome);
    score.expect("four dates", 0.85, 0.07);
    // Roofs have neither crops nor cars on them.
    let roofs = stage.errors(&outcome, 50.0, AlignmentMethod::None).over(|x, y| village(x, y) > rolling(x, y) + 2.0);
    assert!(roofs.right > 0.85, "{roofs:?}");
}
