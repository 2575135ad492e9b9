//! Tests of the filling of voids.

use super::*;

const CONFIG: FillConfig = FillConfig {
    rule: FillRule::Justified,
    reach_cells: 8,
    hidden_reach_cells: 50,
    narrow_cells: 6.0,
    blind_reach_cells: 4,
    ground_reach_cells: 10,
    quarter_reach_cells: 30,
    island_cells: 36,
    trusted_island_cells: 16,
    same_surface_m: 1.0,
    slope_m: 0.05,
    sigma_slope_m: 0.1,
};

/// What is known about the voids of a surface.
struct About {
    trusted: Grid<bool>,
    blind: Grid<bool>,
    completed_m: Grid<f32>,
    ground_m: Grid<f32>,
    only_roofs: Grid<bool>,
}

impl About {
    /// Trusts all heights, and knows nothing else.
    fn surface(height_m: &Grid<f32>) -> Self {
        let (nowhere, unknown) = (height_m.map(|_| false), height_m.map(|_| f32::NAN));
        Self {
            trusted: height_m.map(|_| true),
            blind: nowhere.clone(),
            completed_m: unknown.clone(),
            ground_m: unknown,
            only_roofs: nowhere,
        }
    }

    /// Fills the voids; two views see past the surface above `bound_m`.
    fn fill(&self, height_m: &mut Grid<f32>, bound_m: f32, config: &FillConfig) -> FilledVoids {
        let Self { trusted, blind, completed_m, ground_m, only_roofs } = self;
        let known = KnownVoids { trusted, blind, completed_m, ground_m, only_roofs };
        fill_voids(height_m, known, |_, voids| vec![bound_m; voids.len()], config)
    }
}

fn fill_with(height_m: &mut Grid<f32>, bound_m: f32, config: &FillConfig) -> FilledVoids {
    About::surface(height_m).fill(height_m, bound_m, config)
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
    let about = About { blind, ..About::surface(&unseen) };
    let found = about.fill(&mut unseen, f32::NEG_INFINITY, &CONFIG);
    assert!((12..20).all(|x| unseen[(x, 15)].is_nan()) && unseen[(10, 15)] == 1.0, "{:?}", unseen.row(15));
    assert_eq!(found.source[(15, 15)], CellSource::Blank);
    let everything = FillConfig { rule: FillRule::Everything, ..CONFIG };
    about.fill(&mut unseen, f32::NEG_INFINITY, &everything);
    assert!((10..20).all(|x| (10..20).all(|y| unseen[(x, y)] == 1.0)), "{:?}", unseen.row(15));
}

#[test]
fn a_blank_roof_is_completed_where_its_rim_was_seen_and_blank_ground_is_not() {
    // A roof at 6 m with a blank middle, and a void in the ground at 1 m.
    let mut roof = Grid::filled(40, 40, 1.0f32);
    (5..25).for_each(|x| (5..25).for_each(|y| roof[(x, y)] = 6.0));
    (10..20).for_each(|x| (10..20).for_each(|y| roof[(x, y)] = f32::NAN));
    (30..36).for_each(|x| (30..36).for_each(|y| roof[(x, y)] = f32::NAN));
    for (at, height_m, is_completed) in [((15, 15), 6.4, true), ((15, 15), 16.0, false), ((33, 33), 1.0, false)] {
        let mut about = About { blind: roof.map(|h| h.is_nan()), ..About::surface(&roof) };
        about.completed_m[at] = height_m;
        let mut filled = roof.clone();
        let config = FillConfig { narrow_cells: 3.0, ..CONFIG };
        let found = about.fill(&mut filled, f32::NEG_INFINITY, &config);
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
    let filled = |blind: Grid<bool>| {
        let source = About { blind, ..About::surface(&g) }.fill(&mut g.clone(), 10.0, &CONFIG).source;
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
        let about = About { trusted: g.map(|h| *h == 1.0 || is_trusted), ..About::surface(&g) };
        let config = FillConfig { trusted_island_cells, ..CONFIG };
        let found = about.fill(&mut g, f32::NEG_INFINITY, &config);
        assert!((18..22).all(|x| (18..22).all(|y| found.source[(x, y)] == CellSource::Observed && g[(x, y)] == 9.0)));
        (14..18).filter(|x| found.source[(*x, 20)].is_filled()).count()
    };
    assert!(filled(false, 16) == 0 && filled(true, 17) == 0 && filled(true, 16) > 0);
}

/// A void between the roofs of two rows of houses, every other one of which is 6 m higher, and
/// the ground under it.
struct Street {
    width: usize,
    roofs_m: [f32; 2],
    ground_m: f32,
    bound_m: f32,
    only_roofs: bool,
    /// Cells of the roofs on each side that are known, and of the known ground behind them.
    known: [usize; 2],
}

impl Street {
    /// Returns the height in the middle of the void, and its source.
    fn filled(&self) -> (f32, CellSource) {
        let mut height_m = Grid::filled(60, 40, 0.0);
        for y in 0..40 {
            let higher_m = if y / 10 % 2 == 0 { 0.0 } else { 6.0 };
            let row = height_m.row_mut(y);
            row[..20].fill(self.roofs_m[0] + higher_m);
            row[20 + self.width..].fill(self.roofs_m[1] - higher_m);
            row[20..20 + self.width].fill(f32::NAN);
            let [roof, ground] = self.known;
            row[..20 - roof].fill(f32::NAN);
            row[20 + self.width + roof..].fill(f32::NAN);
            row[..ground].fill(self.ground_m);
        }
        let ground_m = height_m.map(|_| self.ground_m);
        let only_roofs = height_m.map(|_| self.only_roofs);
        let about = About { ground_m, only_roofs, ..About::surface(&height_m) };
        let found = about.fill(&mut height_m, self.bound_m, &FillConfig { reach_cells: 20, ..CONFIG });
        (height_m[(20 + self.width / 2, 20)], found.source[(20 + self.width / 2, 20)])
    }
}

const WIDE_STREET: Street =
    Street { width: 14, roofs_m: [20.0, 27.0], ground_m: 2.0, bound_m: 10.0, only_roofs: false, known: [20, 0] };
const NARROW_STREET: Street = Street { width: 4, roofs_m: [20.0, 26.0], ..WIDE_STREET };

#[test]
fn ground_fills_a_street_that_two_views_would_have_seen_and_no_narrow_gap_of_a_roof() {
    assert_eq!(WIDE_STREET.filled(), (2.0, CellSource::FilledSurface));
    assert!(Street { ground_m: f32::NAN, ..WIDE_STREET }.filled().0 >= 14.0);
    assert_eq!(Street { bound_m: 30.0, ..WIDE_STREET }.filled(), (2.0, CellSource::FilledHidden));
    assert!(NARROW_STREET.filled().0 >= 20.0);
    assert_eq!(Street { roofs_m: [-9.0, 1.0], bound_m: f32::NEG_INFINITY, ..NARROW_STREET }.filled().0, 2.0);
}

#[test]
fn a_narrow_void_between_roofs_is_ground_where_two_views_see_down_to_it_and_more_of_it_is_known() {
    let beside = |known, bound_m| Street { known, bound_m, ..NARROW_STREET }.filled();
    assert_eq!(beside([6, 14], 1.0), (2.0, CellSource::FilledNarrow));
    assert!(beside([6, 14], 10.0).0 >= 20.0);
    assert!(beside([20, 0], 1.0).0 >= 20.0);
}

#[test]
fn a_narrow_void_is_a_street_where_roofs_are_all_that_is_known_and_its_ground_is_seen_or_most_is_void() {
    let street = |bound_m, known| Street { bound_m, only_roofs: true, known, ..NARROW_STREET }.filled();
    for bound_m in [1.0, f32::NEG_INFINITY] {
        assert_eq!(street(bound_m, [20, 0]), (2.0, CellSource::FilledStreet));
    }
    for bound_m in [10.0, 30.0] {
        assert!(street(bound_m, [20, 0]).0 >= 20.0);
        assert_eq!(street(bound_m, [8, 0]), (2.0, CellSource::FilledStreet));
    }
    // What stands less than a storey above the ground of the quarter may be a yard.
    let yard = Street { roofs_m: [4.0, 10.5], bound_m: f32::NEG_INFINITY, only_roofs: true, ..NARROW_STREET };
    assert_eq!(yard.filled().1, CellSource::FilledNarrow);
}
