//! Towns on two dates with noise as surface models have it: correlated over metres, with outliers,
//! and with walls that move. What was built and removed is found, and nothing is invented.

use change::{Change, ChangeConfig, ChangeInput, detect, volume_of};
use numeric::SplitMix64;
use raster::{Grid, gaussian};

/// Side of the town in cells, and of a cell in metres.
const SIDE: usize = 360;
const CELL_M: f64 = 0.5;

/// A building: its lower left cell, size in cells, and height, metres.
type Block = ([usize; 2], [usize; 2], f32);

/// A town with blocks on a slope.
fn town(blocks: &[Block]) -> Grid<f32> {
    let mut surface = Grid::filled(SIDE, SIDE, 0.0);
    for (at, height) in surface.data_mut().iter_mut().enumerate() {
        *height = 100.0 + 0.02 * (at % SIDE) as f32;
    }
    for ([x, y], [width, height], top) in blocks {
        for row in *y..y + height {
            surface.row_mut(row)[*x..x + width].iter_mut().for_each(|h| *h += top);
        }
    }
    surface
}

/// A grid of houses that stand on both dates.
fn houses() -> Vec<Block> {
    (0..36)
        .map(|k| ([20 + k % 6 * 56, 18 + k / 6 * 56], [22 + k % 3 * 4, 18 + k % 5 * 3], 4.0 + (k % 4) as f32))
        .collect()
}

/// Adds noise of 0.3 m that is alike over about two metres, with patches of outliers, and moves
/// walls by up to a cell. The deviations that are returned are a third too small.
fn observed(exact: &Grid<f32>, seed: u64) -> Grid<f32> {
    let mut stream = SplitMix64::new(seed);
    let white: Vec<f32> = (0..SIDE * SIDE).map(|_| stream.normal() as f32).collect();
    let smooth = gaussian(&Grid::from_vec(SIDE, SIDE, white).unwrap(), 2.0);
    let spread = (smooth.data().iter().map(|z| z * z).sum::<f32>() / (SIDE * SIDE) as f32).sqrt();
    let mut surface = exact.clone();
    let shift = stream.below(3) as i64 - 1;
    for (at, height) in surface.data_mut().iter_mut().enumerate() {
        let from = (at as i64 + shift).clamp(0, (SIDE * SIDE - 1) as i64) as usize;
        *height = exact.data()[from] + 0.3 / spread * smooth.data()[at];
    }
    for _ in 0..60 {
        let (x, y, size) = (stream.below(SIDE - 6), stream.below(SIDE - 6), 1 + stream.below(5));
        let by = 3.0 * stream.normal() as f32;
        (y..y + size).for_each(|row| surface.row_mut(row)[x..x + size].iter_mut().for_each(|h| *h += by));
    }
    surface
}

fn compared(before: &Grid<f32>, after: &Grid<f32>) -> Change {
    let sigma = Grid::filled(SIDE, SIDE, 0.3f32);
    let input = ChangeInput { before, after, sigma: Some(&sigma), observed: None, probability: None, cell_m: CELL_M };
    detect(&input, &ChangeConfig::default()).unwrap()
}

#[test]
fn five_changes_are_found_with_their_volumes_and_none_is_invented() {
    let added = [([50, 46], [20, 16], 5.0), ([160, 46], [30, 8], 3.0), ([270, 160], [16, 24], 12.0)];
    let removed = [([50, 160], [24, 16], 6.0), ([215, 270], [18, 18], 4.0)];
    for seed in 0..8 {
        let with = |more: &[Block]| town(&[&houses(), more].concat());
        let (before, after) = (observed(&with(&removed), 2 * seed), observed(&with(&added), 2 * seed + 1));
        let found = compared(&before, &after);
        assert_eq!(found.regions.len(), 5, "seed {seed}");
        let mut truth = [0.0; 2];
        let changes = added.iter().map(|block| (block, 1.0)).chain(removed.iter().map(|block| (block, -1.0)));
        for (([x, y], [width, height], top), sign) in changes {
            let number = found.numbers[(x + width / 2, y + height / 2)];
            let region = &found.regions[number.checked_sub(1).expect("the middle lies in a region") as usize];
            let volume = f64::from(*top) * sign * (width * height) as f64 * CELL_M * CELL_M;
            truth[usize::from(sign < 0.0)] += volume.abs();
            let (error, sigma) = (region.volume_m3 - volume, region.volume_sigma_m3);
            assert!(
                error.abs() < 4.0 * sigma && sigma < 0.2 * volume.abs(),
                "seed {seed}: {error} ± {sigma} of {volume}"
            );
        }
        let total = volume_of(&found, 0..SIDE * SIDE);
        for (found, truth) in [(total.gain_m3, truth[0]), (total.loss_m3, truth[1])] {
            assert!((found / truth - 1.0).abs() < 0.05, "seed {seed}: {found} for {truth}");
        }
        let gain: f64 = found.regions.iter().map(|r| r.volume_m3.max(0.0)).sum();
        assert!((total.gain_m3 - gain).abs() < 1e-6 * gain && total.unknown_m2 == 0.0);
    }
}

#[test]
fn nothing_is_invented_where_nothing_changed() {
    let exact = town(&houses());
    for seed in 100..120 {
        let found = compared(&observed(&exact, 2 * seed), &observed(&exact, 2 * seed + 1));
        assert_eq!(found.regions.len(), 0, "seed {seed}");
    }
}

#[test]
fn the_deviation_of_a_net_volume_is_honest() {
    let exact = town(&[]);
    let (mut squares, mut count) = (0.0, 0);
    for seed in 200..206 {
        let found = compared(&observed(&exact, 2 * seed), &observed(&exact, 2 * seed + 1));
        for k in 0..16 {
            let (left, top) = (k % 4 * 90 + 10, k / 4 * 90 + 10);
            let cells = (0..60 * 60).map(|i| (top + i / 60) * SIDE + left + i % 60);
            let volume = volume_of(&found, cells);
            squares += (volume.net_m3 / volume.net_sigma_m3).powi(2);
            count += 1;
        }
    }
    let ratio = (squares / f64::from(count)).sqrt();
    assert!((0.5..1.4).contains(&ratio), "{ratio}");
}

#[test]
fn cells_that_were_not_observed_decide_nothing() {
    let (before, after) = (observed(&town(&[]), 1), observed(&town(&[([100, 100], [30, 30], 8.0)]), 2));
    let sigma = Grid::filled(SIDE, SIDE, 0.3f32);
    let mut seen = Grid::filled(SIDE, SIDE, true);
    let of = |seen: &Grid<bool>| {
        let (sigma, observed) = (Some(&sigma), Some(seen));
        let input = ChangeInput { before: &before, after: &after, sigma, observed, probability: None, cell_m: CELL_M };
        detect(&input, &ChangeConfig::default()).unwrap()
    };
    (100..130).for_each(|row| seen.row_mut(row)[100..104].fill(false));
    let found = of(&seen);
    assert_eq!(found.regions.len(), 1);
    assert!((found.regions[0].filled_m2 - 30.0).abs() < 3.0, "{}", found.regions[0].filled_m2);
    (90..140).for_each(|row| seen.row_mut(row)[90..140].fill(false));
    assert_eq!(of(&seen).regions.len(), 0);
}

#[test]
fn heights_that_are_rather_wrong_decide_nothing() {
    let (before, after) = (observed(&town(&[]), 1), observed(&town(&[([100, 100], [30, 60], 8.0)]), 2));
    let sigma = Grid::filled(SIDE, SIDE, 0.3f32);
    let of = |probability: &Grid<f32>| {
        let (sigma, probability) = (Some(&sigma), Some(probability));
        let input = ChangeInput { before: &before, after: &after, sigma, observed: None, probability, cell_m: CELL_M };
        detect(&input, &ChangeConfig::default()).unwrap()
    };
    let mut probability = Grid::filled(SIDE, SIDE, 0.9f32);
    probability[(115, 115)] = f32::NAN;
    let sure = of(&probability);
    assert_eq!(sure.regions.len(), 1);
    let region = &sure.regions[0];
    assert!(region.decided_m2 == region.area_m2 && (region.probability - 0.9).abs() < 0.01, "{region:?}");
    // A strip of 60 m² that decides does not carry three metres of doubtful heights beside it.
    let weak_to = |column: usize| {
        let mut probability = probability.clone();
        (90..170).for_each(|row| probability.row_mut(row)[90..column].fill(0.3));
        of(&probability)
    };
    assert_eq!(weak_to(126).regions.len(), 0);
    let kept = weak_to(106);
    assert_eq!(kept.regions.len(), 1);
    let region = &kept.regions[0];
    assert!(region.decided_m2 < 0.85 * region.area_m2 && region.filled_m2 == 0.0, "{region:?}");
    assert!((region.volume_m3 / 3600.0 - 1.0).abs() < 0.05 && region.mean_sigma_m > sure.regions[0].mean_sigma_m);
}

#[test]
fn the_border_of_a_surface_decides_nothing() {
    let exact = town(&[]);
    let (before, mut after) = (observed(&exact, 1), observed(&exact, 2));
    // A spiky rim two metres wide where the second surface ends.
    for row in 0..SIDE {
        after.row_mut(row)[..40].fill(f32::NAN);
        after.row_mut(row)[40..44].iter_mut().for_each(|height| *height += 15.0);
    }
    let found = compared(&before, &after);
    assert_eq!(found.regions.len(), 0, "{:?}", found.regions.iter().map(|r| r.mean_m).collect::<Vec<_>>());
    assert!(found.deciding_cells < found.observed_cells);
}

#[test]
fn unusable_input_is_refused() {
    let (small, other) = (Grid::filled(5, 5, 1.0f32), Grid::filled(4, 5, 1.0f32));
    let told = |before, after, cell_m, config: ChangeConfig| {
        let input = ChangeInput { before, after, sigma: None, observed: None, probability: None, cell_m };
        detect(&input, &config).unwrap_err().to_string()
    };
    assert!(told(&small, &other, 0.5, ChangeConfig::default()).contains("(4, 5)"));
    assert!(told(&small, &small, 0.5, ChangeConfig::default()).contains("25 cells"));
    assert!(told(&small, &small, 0.0, ChangeConfig::default()).contains("side of a cell"));
    let mut config = ChangeConfig::default();
    config.confidence = 2.0;
    assert!(told(&small, &small, 0.5, config).contains("confidence"));
}
