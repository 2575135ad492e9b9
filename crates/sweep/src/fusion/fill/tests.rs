//! Tests of the filling of voids.

use super::*;

const CONFIG: FillConfig = FillConfig {
    rule: FillRule::Justified,
    reach_cells: 8,
    hidden_reach_cells: 50,
    narrow_cells: 6.0,
    blind_reach_cells: 4,
    island_cells: 36,
    trusted_island_cells: 16,
    same_surface_m: 1.0,
    slope_m: 0.05,
    sigma_slope_m: 0.1,
};

fn fill_with(height_m: &mut Grid<f32>, bound_m: f32, config: &FillConfig) -> FilledVoids {
    let blind = Grid::filled(height_m.width(), height_m.height(), false);
    let (trusted, nowhere) = (blind.map(|_| true), blind.map(|_| f32::NAN));
    let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &nowhere, ground_m: &nowhere };
    fill_voids(height_m, known, |_, voids| vec![bound_m; voids.len()], config)
}

/// Fills with two views that see every void.
fn fill(height_m: &mut Grid<f32>) -> FilledVoids {
    fill_with(height_m, f32::NEG_INFINITY, &CONFIG)
}

/// A plain at 1 m with a void of 10 × 10 cells.
fn void_in_a_plain() -> Grid<f32> {
    let mut out = Grid::filled(40, 40, 1.0f32);
    (10..20).for_each(|x| (10..20).for_each(|y| out[(x, y)] = f32::NAN));
    out
}

#[test]
fn a_void_in_a_slope_gets_the_slope_as_a_plane() {
    let mut g = Grid::from_vec(30, 30, (0..900).map(|i| 0.3 * (i % 30) as f32).collect()).unwrap();
    (8..18).for_each(|x| (8..18).for_each(|y| g[(x, y)] = f32::NAN));
    let found = fill(&mut g);
    assert!((8..18).all(|x| (8..18).all(|y| (g[(x, y)] - 0.3 * x as f32).abs() < 1e-3)), "{:?}", g.row(12));
    assert!((8..18).all(|y| found.source[(12, y)] == CellSource::FilledSurface));
    let sigma = &found.sigma_m;
    assert!(sigma[(13, 13)] > sigma[(9, 9)] && sigma[(9, 9)] >= 0.5 && sigma[(2, 2)].is_nan());
}

#[test]
fn a_narrow_gap_beside_a_wall_gets_the_lower_surface() {
    let mut wall = Grid::from_vec(20, 20, (0..400).map(|i| if i % 20 < 10 { 30.0 } else { 2.0 }).collect()).unwrap();
    (0..20).for_each(|y| (10..13).for_each(|x| wall[(x, y)] = f32::NAN));
    let found = fill(&mut wall);
    assert!((10..13).all(|x| (1..19).all(|y| wall[(x, y)] == 2.0)), "{wall:?}");
    assert_eq!(found.source[(11, 10)], CellSource::FilledNarrow);
    // It could have been the wall.
    assert!(found.sigma_m[(11, 10)] > 10.0, "{}", found.sigma_m[(11, 10)]);
}

#[test]
fn a_narrow_street_gets_the_ground_at_its_end() {
    // Roofs at 20 m on three sides of a street of 4 cells, which opens to a plain.
    let mut g = Grid::filled(40, 60, 20.0f32);
    (40..60).for_each(|y| g.row_mut(y).fill(0.0));
    (30..40).for_each(|y| g.row_mut(y)[18..22].fill(f32::NAN));
    let found = fill(&mut g);
    assert!((18..22).all(|x| (30..40).all(|y| g[(x, y)] == 0.0)), "{:?}", g.row(30));
    assert_eq!(found.source[(19, 30)], CellSource::FilledNarrow);
}

#[test]
fn a_street_between_towers_is_not_filled_with_roof() {
    // Roofs at 40 m on both sides of a street of 10 cells, whose ground is known at its end
    // only.
    let mut g = Grid::filled(40, 60, 40.0f32);
    (15..25).for_each(|x| (0..60).for_each(|y| g[(x, y)] = if y < 45 { f32::NAN } else { 0.0 }));
    let street = g.clone();
    let found = fill_with(&mut g, 25.0, &CONFIG);
    assert!((15..25).all(|x| (36..45).all(|y| g[(x, y)] == 0.0 && found.source[(x, y)] == CellSource::FilledHidden)));
    assert!((15..25).all(|x| (0..36).all(|y| g[(x, y)].is_nan() || g[(x, y)] == 0.0)), "{:?}", g.row(10));
    let mut open = street.clone();
    let reasons = fill_with(&mut open, 25.0, &FillConfig { rule: FillRule::Nothing, ..CONFIG });
    assert_eq!((open[(20, 40)].is_nan(), reasons.source[(20, 40)]), (true, CellSource::Hidden));
}

#[test]
fn blank_images_leave_a_wide_void_open_and_say_so() {
    let mut blind = Grid::filled(40, 40, false);
    (12..20).for_each(|x| (0..40).for_each(|y| blind[(x, y)] = true));
    let (mut seen, mut unseen) = (void_in_a_plain(), void_in_a_plain());
    fill(&mut seen);
    assert!((10..20).all(|x| (10..20).all(|y| seen[(x, y)] == 1.0)), "{:?}", seen.row(15));
    let visible = |_: &Grid<f32>, voids: &[usize]| vec![f32::NEG_INFINITY; voids.len()];
    let (trusted, nowhere) = (blind.map(|_| true), blind.map(|_| f32::NAN));
    let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &nowhere, ground_m: &nowhere };
    let found = fill_voids(&mut unseen, known, visible, &CONFIG);
    assert!((12..20).all(|x| unseen[(x, 15)].is_nan()) && unseen[(10, 15)] == 1.0, "{:?}", unseen.row(15));
    assert_eq!(found.source[(15, 15)], CellSource::Blank);
    let everything = FillConfig { rule: FillRule::Everything, ..CONFIG };
    fill_voids(&mut unseen, known, visible, &everything);
    assert!((10..20).all(|x| (10..20).all(|y| unseen[(x, y)] == 1.0)), "{:?}", unseen.row(15));
}

#[test]
fn a_blank_roof_is_completed_where_its_rim_was_seen_and_blank_ground_is_not() {
    // A roof at 6 m with a blank middle, and a void in the ground at 1 m.
    let mut roof = Grid::filled(40, 40, 1.0f32);
    (5..25).for_each(|x| (5..25).for_each(|y| roof[(x, y)] = 6.0));
    (10..20).for_each(|x| (10..20).for_each(|y| roof[(x, y)] = f32::NAN));
    (30..36).for_each(|x| (30..36).for_each(|y| roof[(x, y)] = f32::NAN));
    let (blind, trusted) = (roof.map(|h| h.is_nan()), roof.map(|_| true));
    let nowhere = roof.map(|_| f32::NAN);
    for (at, height_m, is_completed) in [((15, 15), 6.4, true), ((15, 15), 16.0, false), ((33, 33), 1.0, false)] {
        let mut completed_m = roof.map(|_| f32::NAN);
        completed_m[at] = height_m;
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &nowhere };
        let mut filled = roof.clone();
        let config = FillConfig { narrow_cells: 3.0, ..CONFIG };
        let found = fill_voids(&mut filled, known, |_, voids| vec![f32::NEG_INFINITY; voids.len()], &config);
        assert_eq!(filled[at] == height_m, is_completed, "{height_m}");
        assert_eq!(found.source[at] == CellSource::FilledSurface, is_completed, "{height_m}");
    }
}

#[test]
fn a_void_with_heights_on_one_side_stays_open_and_says_why() {
    let mut g = Grid::filled(60, 60, f32::NAN);
    (10..50).for_each(|x| (10..50).for_each(|y| g[(x, y)] = if x > 40 { 30.0 } else { 1.0 }));
    let void = g.clone();
    let reason = |bound_m: f32| {
        let mut g = void.clone();
        let found = fill_with(&mut g, bound_m, &CONFIG);
        assert!(bound_m.is_finite() || (0..60).all(|k| g[(k, 9)].is_nan() && g[(50, k)].is_nan()));
        found.source[(30, 9)]
    };
    assert_eq!(reason(f32::NEG_INFINITY), CellSource::Unmatched);
    assert_eq!(reason(f32::INFINITY), CellSource::Outside);
    assert_eq!(reason(20.0), CellSource::FilledHidden);
    // Hidden, and no known height within reach.
    let mut g = void.clone();
    (0..60).for_each(|y| (10..50).for_each(|x| g[(x, y)] = if y < 20 { g[(x, y)] } else { f32::NAN }));
    let found = fill_with(&mut g, 20.0, &FillConfig { hidden_reach_cells: 12, ..CONFIG });
    assert_eq!((found.source[(30, 50)], g[(30, 50)].is_nan()), (CellSource::Hidden, true));
}

#[test]
fn a_void_of_a_blank_roof_is_not_taken_for_hidden_ground() {
    // A roof at 16 m whose blank inside is open to one side, beside ground at −20 m.
    let mut g = Grid::filled(60, 60, -20.0f32);
    (10..50).for_each(|x| (10..50).for_each(|y| g[(x, y)] = 16.0));
    (14..46).for_each(|x| (14..60).for_each(|y| g[(x, y)] = if y < 50 { f32::NAN } else { -20.0 }));
    let trusted = g.map(|_| true);
    let nowhere = g.map(|_| f32::NAN);
    let filled = |blind: Grid<bool>| {
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &nowhere, ground_m: &nowhere };
        let mut filled = g.clone();
        let source = fill_voids(&mut filled, known, |_, voids| vec![10.0; voids.len()], &CONFIG).source;
        let is_hidden = |i: usize| source.data()[i] == CellSource::FilledHidden;
        let inside = (14..46).flat_map(|x| (14..46).map(move |y| y * 60 + x));
        (inside.filter(|i| is_hidden(*i)).count(), source[(30, 30)])
    };
    // With texture it is hidden ground; the images could not show it where they are blank.
    assert!(filled(g.map(|_| false)).0 > 900);
    assert_eq!(filled(g.map(|h| h.is_nan())), (0, CellSource::Blank));
    // Blind cells in the middle are the reason for the void beside them.
    let mut middle = g.map(|_| false);
    (17..43).for_each(|x| (17..46).for_each(|y| middle[(x, y)] = true));
    assert_eq!(filled(middle).0, 0);
}

#[test]
fn a_small_island_in_a_void_is_kept_and_spread_only_where_it_is_trusted_and_not_very_small() {
    let mut surface = Grid::filled(40, 40, 1.0f32);
    (10..30).for_each(|x| (10..30).for_each(|y| surface[(x, y)] = f32::NAN));
    (18..22).for_each(|x| (18..22).for_each(|y| surface[(x, y)] = 9.0));
    let filled = |is_trusted: bool, trusted_island_cells: usize| {
        let mut g = surface.clone();
        let trusted = g.map(|h| *h == 1.0 || is_trusted);
        let (blind, nowhere) = (g.map(|_| false), g.map(|_| f32::NAN));
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &nowhere, ground_m: &nowhere };
        let config = FillConfig { trusted_island_cells, ..CONFIG };
        let found = fill_voids(&mut g, known, |_, voids| vec![f32::NEG_INFINITY; voids.len()], &config);
        assert!((18..22).all(|x| (18..22).all(|y| found.source[(x, y)] == CellSource::Observed && g[(x, y)] == 9.0)));
        (14..18).filter(|x| found.source[(*x, 20)].is_filled()).count()
    };
    assert!(filled(false, 16) == 0 && filled(true, 17) == 0 && filled(true, 16) > 0);
}

/// A void between the roofs of two rows of houses, every other one of which is 6 m higher, and
/// the ground under it.
#[test]
fn ground_fills_a_street_that_two_views_would_have_seen_and_no_narrow_gap_of_a_roof() {
    let filled = |width: usize, roofs_m: [f32; 2], ground_m: f32, bound_m: f32| {
        let mut height_m = Grid::filled(60, 40, 0.0);
        for y in 0..40 {
            let higher_m = if y / 10 % 2 == 0 { 0.0 } else { 6.0 };
            let row = height_m.row_mut(y);
            row[..20].fill(roofs_m[0] + higher_m);
            row[20 + width..].fill(roofs_m[1] - higher_m);
            row[20..20 + width].fill(f32::NAN);
        }
        let blind = height_m.map(|_| false);
        let (trusted, completed_m) = (blind.map(|_| true), blind.map(|_| f32::NAN));
        let ground_m = blind.map(|_| ground_m);
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &ground_m };
        let config = FillConfig { reach_cells: 20, ..CONFIG };
        let found = fill_voids(&mut height_m, known, |_, voids| vec![bound_m; voids.len()], &config);
        (height_m[(20 + width / 2, 20)], found.source[(20 + width / 2, 20)])
    };
    let unknown = f32::NAN;
    assert_eq!(filled(14, [20.0, 27.0], 2.0, 10.0), (2.0, CellSource::FilledSurface));
    assert!(filled(14, [20.0, 27.0], unknown, 10.0).0 >= 14.0);
    assert_eq!(filled(14, [20.0, 27.0], 2.0, 30.0), (2.0, CellSource::FilledHidden));
    assert!(filled(4, [20.0, 26.0], 2.0, 10.0).0 >= 20.0);
    assert_eq!(filled(4, [-9.0, 1.0], 2.0, f32::NEG_INFINITY).0, 2.0);
}
