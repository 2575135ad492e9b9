//! A scene of houses and trees with noise: their classes, a vegetation index, and what is refused.

use classes::{
    BUILDING, BuildingCue, ClassifyConfig, ClassifyInput, CrownCue, GROUND, LOW_VEGETATION, UNKNOWN, VEGETATION, WATER,
    classify,
};
use numeric::SplitMix64;
use raster::{Grid, gaussian};

const SIDE: usize = 300;
const CELL_M: f64 = 0.5;

/// Heights above ground and the exact classes: gabled houses, and crowns with branches.
fn scene(seed: u64) -> (Grid<f32>, Grid<u8>) {
    let (mut heights, mut classes) = (Grid::filled(SIDE, SIDE, 0.0f32), Grid::filled(SIDE, SIDE, GROUND));
    let mut stream = SplitMix64::new(seed);
    for k in 0..25 {
        let (left, top) = (15 + k % 5 * 56, 15 + k / 5 * 56);
        let (width, depth) = (18 + stream.below(10), 16 + stream.below(8));
        for y in 0..depth {
            for x in 0..width {
                let across = (y as f32 - depth as f32 / 2.0).abs();
                heights[(left + x, top + y)] = 8.0 - 0.25 * across;
                classes[(left + x, top + y)] = BUILDING;
            }
        }
        let (cx, cy, radius) = (left as f32 + 42.0, top as f32 + 42.0, 6.0 + 4.0 * stream.uniform() as f32);
        for at in 0..SIDE * SIDE {
            let far = ((at % SIDE) as f32 - cx).hypot((at / SIDE) as f32 - cy) / radius;
            if far < 1.0 {
                heights.data_mut()[at] = 3.0 + 4.0 * (1.0 - far * far).sqrt() + 0.5 * stream.normal() as f32;
                classes.data_mut()[at] = VEGETATION;
            }
        }
    }
    let noise: Vec<f32> = (0..SIDE * SIDE).map(|_| stream.normal() as f32).collect();
    let noise = gaussian(&Grid::from_vec(SIDE, SIDE, noise).unwrap(), 1.0);
    heights.data_mut().iter_mut().zip(noise.data()).for_each(|(h, z)| *h += 0.2 * z);
    (heights, classes)
}

/// Heights above flat ground, and nothing else that is known.
fn heights_alone(heights: &Grid<f32>) -> ClassifyInput<'_> {
    ClassifyInput {
        surface: heights,
        above_ground: heights,
        index: None,
        is_index_coarse: false,
        cue: None,
        crowns: None,
        weak: None,
        cell_m: CELL_M,
    }
}

/// Intersection over union of a class.
fn iou(found: &Grid<u8>, truth: &Grid<u8>, class: u8) -> f64 {
    let count = |is: fn(bool, bool) -> bool| {
        let cells = found.data().iter().zip(truth.data());
        cells.filter(|(found, truth)| is(**found == class, **truth == class)).count() as f64
    };
    count(|a, b| a && b) / count(|a, b| a || b)
}

#[test]
fn houses_and_trees_are_told_apart() {
    for seed in 0..4 {
        let (heights, truth) = scene(seed);
        let input = heights_alone(&heights);
        let found = classify(&input, &ClassifyConfig::default()).unwrap().classes;
        let (buildings, plants) = (iou(&found, &truth, BUILDING), iou(&found, &truth, VEGETATION));
        assert!(buildings > 0.95 && plants > 0.9, "seed {seed}: {buildings:.3}, {plants:.3}");
    }
}

#[test]
fn a_roof_that_the_raster_cuts_and_that_clutter_surrounds_is_a_building() {
    // A hall with machines along its rims: the smooth part of the roof ends at them, not at walls.
    let mut heights = Grid::filled(200, 100, 0.0f32);
    let mut stream = SplitMix64::new(1);
    for row in 60..100 {
        for column in 40..160 {
            let is_rim = row < 72 || !(52..148).contains(&column);
            heights[(column, row)] = 12.0 + if is_rim { 1.5 * stream.uniform() as f32 } else { 0.0 };
        }
    }
    let found = classify(&heights_alone(&heights), &ClassifyConfig::default()).unwrap().classes;
    assert!((76..100).all(|row| found.row(row)[56..144].iter().all(|class| *class == BUILDING)));
}

#[test]
fn a_vegetation_index_overrules_the_roughness() {
    let (mut heights, mut index) = (Grid::filled(60, 60, 0.0f32), Grid::filled(60, 60, 0.0f32));
    for row in 10..40 {
        heights.row_mut(row)[10..50].fill(3.0);
        index.row_mut(row)[30..50].fill(0.6);
    }
    // A pond, and a dark cell that may be a shadow.
    for row in 45..58 {
        index.row_mut(row)[5..45].fill(-0.4);
    }
    index[(55, 5)] = -0.4;
    heights[(0, 0)] = f32::NAN;
    let input = ClassifyInput { index: Some(&index), ..heights_alone(&heights) };
    let found = classify(&input, &ClassifyConfig::default()).unwrap().classes;
    assert_eq!([found[(20, 20)], found[(40, 20)]], [BUILDING, VEGETATION]);
    assert_eq!([found[(0, 0)], found[(55, 55)]], [UNKNOWN, GROUND]);
    assert_eq!([found[(10, 50)], found[(55, 5)]], [WATER, GROUND]);
}

#[test]
fn a_building_index_decides_where_heights_are_weak_and_only_there() {
    let (mut heights, mut index) = (Grid::filled(120, 60, 0.0f32), Grid::filled(120, 60, 0.0f32));
    let mut weak = Grid::filled(120, 60, false);
    for row in 10..40 {
        // A low shed, a hole where a house was not matched, and ground.
        heights.row_mut(row)[10..30].fill(1.6);
        heights.row_mut(row)[40..60].fill(0.3);
        weak.row_mut(row)[40..60].fill(true);
        index.row_mut(row)[10..90].fill(0.8);
    }
    let input = heights_alone(&heights);
    let classes = |input: &ClassifyInput<'_>| {
        let found = classify(input, &ClassifyConfig::default()).unwrap().classes;
        [(20, 20), (50, 20), (70, 20), (110, 20)].map(|at| found[at])
    };
    assert_eq!(classes(&input), [GROUND; 4]);
    let with = |weak| ClassifyInput { cue: Some(BuildingCue { index: &index, weak }), ..input };
    assert_eq!(classes(&with(None)), [BUILDING, GROUND, GROUND, GROUND]);
    assert_eq!(classes(&with(Some(&weak))), [BUILDING, BUILDING, GROUND, GROUND]);
}

#[test]
fn unusable_input_is_refused() {
    let (heights, other) = (Grid::filled(5, 5, 1.0f32), Grid::filled(4, 5, 1.0f32));
    let input = heights_alone(&heights);
    let told = |input: &ClassifyInput<'_>, config: &ClassifyConfig| classify(input, config).unwrap_err().to_string();
    let usual = ClassifyConfig::default();
    assert!(told(&ClassifyInput { above_ground: &other, ..input }, &usual).contains("heights above ground"));
    assert!(told(&ClassifyInput { index: Some(&other), ..input }, &usual).contains("(4, 5)"));
    assert!(told(&ClassifyInput { cell_m: f64::NAN, ..input }, &usual).contains("side of a cell"));
    let cue = |index, weak| Some(BuildingCue { index, weak });
    assert!(told(&ClassifyInput { cue: cue(&other, None), ..input }, &usual).contains("building index"));
    let small = Grid::filled(4, 5, false);
    assert!(told(&ClassifyInput { cue: cue(&heights, Some(&small)), ..input }, &usual).contains("weak heights"));
    let mut wrong = usual;
    wrong.roughness_m = -1.0;
    assert!(told(&input, &wrong).contains("roughness"));
}

/// A roof beside a lawn, a street, and a tree whose height is missing.
#[test]
fn coarse_images_find_crowns_without_heights_and_leave_roofs_alone() {
    let (mut heights, mut index) = (Grid::filled(80, 60, 0.0f32), Grid::filled(80, 60, 0.0f32));
    let mut unsure = Grid::filled(80, 60, false);
    for row in 10..40 {
        heights.row_mut(row)[10..40].fill(5.0);
        index.row_mut(row)[36..70].fill(0.6);
        unsure.row_mut(row)[39..42].fill(true);
    }
    for row in 20..28 {
        unsure.row_mut(row)[55..63].fill(true);
    }
    let crowns = Some(CrownCue { index: &index, unsure: &unsure });
    let input = ClassifyInput { index: Some(&index), is_index_coarse: true, crowns, ..heights_alone(&heights) };
    let found = classify(&input, &ClassifyConfig::default()).unwrap().classes;
    let at = [(20, 20), (38, 20), (41, 20), (50, 20), (58, 24), (75, 50)];
    assert_eq!(at.map(|at| found[at]), [BUILDING, BUILDING, LOW_VEGETATION, LOW_VEGETATION, VEGETATION, GROUND]);
}

/// A flat-topped slope of 45° between two plains: smooth, high above the lower plain, and no house.
#[test]
fn steep_ground_without_walls_on_several_sides_is_no_building() {
    let rise = |row: usize| (row.clamp(40, 60) - 40) as f32 * 0.5;
    let surface = Grid::from_vec(100, 100, (0..10_000).map(|at| rise(at / 100)).collect()).unwrap();
    // The ground that was found goes on at the level of the lower plain under a part of the slope.
    let mut above = surface.map(|_| 0.0f32);
    let mut house = surface.clone();
    for row in 46..58 {
        for column in 20..70 {
            above[(column, row)] = rise(row);
            house[(column, row)] = 16.0;
        }
    }
    let slope = ClassifyInput { above_ground: &above, ..heights_alone(&surface) };
    let count = |input: &ClassifyInput<'_>| {
        let found = classify(input, &ClassifyConfig::default()).unwrap().classes;
        found.data().iter().filter(|class| **class == BUILDING).count()
    };
    assert_eq!(count(&slope), 0);
    // A house in the same place has walls downhill and on both sides.
    let mut above = house.clone();
    above.data_mut().iter_mut().zip(surface.data()).for_each(|(above, ground)| *above -= ground);
    let found = count(&ClassifyInput { surface: &house, above_ground: &above, ..heights_alone(&house) });
    assert!((550..=650).contains(&found), "{found} of 600 cells");
}

/// Crowns and houses as matching shows them: smooth, with the noise of a surface from images.
#[test]
fn smooth_crowns_are_no_roofs() {
    let mut heights = Grid::filled(SIDE, SIDE, 0.0f32);
    let mut truth = Grid::filled(SIDE, SIDE, GROUND);
    for k in 0..36usize {
        let (left, top) = (10 + k % 6 * 48, 10 + k / 6 * 48);
        for at in 0..24 * 24usize {
            let (x, y) = (at % 24, at / 24);
            let far = ((x as f32 - 12.0).hypot(y as f32 - 12.0)) / 9.0;
            if k % 2 == 0 && far < 1.0 {
                heights[(left + x, top + y)] = 4.0 + 5.0 * (1.0 - far * far).sqrt();
                truth[(left + x, top + y)] = VEGETATION;
            } else if k % 2 == 1 && (4..20).contains(&x) && (4..20).contains(&y) {
                heights[(left + x, top + y)] = 7.0 + 0.3 * (y as f32 - 12.0).abs();
                truth[(left + x, top + y)] = BUILDING;
            }
        }
    }
    let mut stream = SplitMix64::new(5);
    let noise: Vec<f32> = (0..SIDE * SIDE).map(|_| stream.normal() as f32).collect();
    let noise = gaussian(&Grid::from_vec(SIDE, SIDE, noise).unwrap(), 1.0);
    heights.data_mut().iter_mut().zip(noise.data()).for_each(|(h, z)| *h += 0.15 * z);
    let found = classify(&heights_alone(&heights), &ClassifyConfig::default()).unwrap().classes;
    let crowns = truth.data().iter().filter(|class| **class == VEGETATION).count();
    let cells = found.data().iter().zip(truth.data());
    let wrong = cells.filter(|(found, truth)| (**found, **truth) == (BUILDING, VEGETATION)).count();
    assert!(iou(&found, &truth, BUILDING) > 0.9, "{}", iou(&found, &truth, BUILDING));
    assert!(wrong * 10 < crowns, "{wrong} of {crowns} cells of crowns are buildings");
}

/// Beside a house the surface goes on at its height for a metre, in cells that are rather wrong
/// than right; a strip within the roof is as weak.
#[test]
fn weak_cells_do_not_widen_a_building_and_do_not_tear_it() {
    let (mut heights, mut weak) = (Grid::filled(100, 80, 0.0f32), Grid::filled(100, 80, false));
    for row in 20..60 {
        heights.row_mut(row)[20..74].fill(6.0);
        weak.row_mut(row)[70..74].fill(true);
    }
    (38..41).for_each(|row| weak.row_mut(row)[30..50].fill(true));
    let plain = heights_alone(&heights);
    let classes = |input: &ClassifyInput<'_>| classify(input, &ClassifyConfig::default()).unwrap().classes;
    assert_eq!(classes(&plain)[(73, 40)], BUILDING);
    let found = classes(&ClassifyInput { weak: Some(&weak), ..plain });
    assert_eq!([found[(73, 40)], found[(66, 40)], found[(40, 39)]], [GROUND, BUILDING, BUILDING]);
}

/// A level roof whose uphill side lies a metre above the ground.
#[test]
fn roofs_go_on_to_where_they_come_near_the_ground() {
    let (mut surface, mut above) = (Grid::filled(100, 100, 0.0f32), Grid::filled(100, 100, 0.0f32));
    for at in 0..10_000usize {
        let ground = 0.15 * (at / 100) as f32;
        let is_house = (30..70).contains(&(at % 100)) && (30..60).contains(&(at / 100));
        surface.data_mut()[at] = if is_house { 10.0 } else { ground };
        above.data_mut()[at] = surface.data()[at] - ground;
    }
    let found =
        classify(&ClassifyInput { above_ground: &above, ..heights_alone(&surface) }, &ClassifyConfig::default());
    let found = found.unwrap().classes;
    assert!(above[(50, 58)] < 2.0);
    assert_eq!([found[(50, 35)], found[(50, 58)], found[(50, 70)]], [BUILDING, BUILDING, GROUND]);
}

/// Filled ground, which is smooth, around houses and ground that were observed with noise.
#[test]
fn filled_ground_tells_nothing_about_the_noise_of_roofs() {
    let (mut heights, truth) = scene(7);
    let mut weak = heights.map(|_| false);
    for at in 0..SIDE * SIDE {
        let is_filled = truth.data()[at] == GROUND && at % SIDE > SIDE / 3;
        let noise_m = if (at % SIDE + at / SIDE).is_multiple_of(2) { 0.08 } else { -0.08 };
        heights.data_mut()[at] = if is_filled { 0.0 } else { heights.data()[at] + noise_m };
        weak.data_mut()[at] = is_filled;
    }
    let found = |weak| {
        let input = ClassifyInput { weak, ..heights_alone(&heights) };
        classify(&input, &ClassifyConfig::default()).unwrap().classes
    };
    let (told, untold) = (iou(&found(Some(&weak)), &truth, BUILDING), iou(&found(None), &truth, BUILDING));
    assert!(told > 0.9 && untold < 0.5, "{told}, {untold}");
}
