//! Doubts about the heights of two surfaces: a constant that nobody declared as no-data, and
//! heights in another unit.

use eval::Evaluation;
use formats::raster::Dem;
use numeric::{order_statistic, upper_nmad};
use raster::Grid;

/// Most cells that are looked at, spread evenly.
const CELLS_MAX: usize = 1 << 18;
/// Share of one exact height from which on it is doubtful in a surface whose heights have
/// fractions: computed and measured heights repeat by chance only.
const CONSTANT_SHARE: f64 = 0.25;
/// The same for a height that lies apart from all others.
const APART_SHARE: f64 = 0.05;
/// Distance from all other heights that is apart, metres: three storeys. The shore of a lake or of
/// the sea, which is as constant, rises from it in smaller steps.
const APART_M: f32 = 10.0;

/// Metres in a foot.
const FOOT_M: f64 = 0.3048;
/// Least offset that is looked at for its cause, metres: pointing that was not corrected moves a
/// surface by less.
const OFFSET_M: f64 = 10.0;
/// What a factor leaves of an offset that it explains.
const LEFT_SHARE: f64 = 0.1;
/// No datum differs from another by more, metres: geoids lie 107 m below to 86 m above the
/// ellipsoid.
const DATUM_M: f64 = 110.0;

/// Tells that many cells of a surface have exactly one height.
pub(super) fn undeclared_constant(dem: &Dem) -> Option<String> {
    let (value, share) = constant(&dem.heights)?;
    Some(format!(
        "{:.0} % of the cells have exactly the height {value}, which looks like no-data that the file does not declare: \
         declare it (gdal_edit.py -a_nodata {value}), unless it is flat water: {}",
        100.0 * share,
        dem.path.display()
    ))
}

/// Returns a height that a doubtful share of the cells has, and the share.
fn constant(heights: &Grid<f32>) -> Option<(f32, f64)> {
    let step = heights.data().len().div_ceil(CELLS_MAX).max(1);
    let mut values: Vec<f32> = heights.data().iter().step_by(step).copied().filter(|h| h.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let groups: Vec<&[f32]> = values.chunk_by(|a, b| a == b).collect();
    let (most, same) = groups.iter().enumerate().max_by_key(|(_, same)| same.len())?;
    let (value, share) = (same[0], same.len() as f64 / values.len() as f64);
    let distance = |at: Option<usize>| at.and_then(|at| groups.get(at)).map(|other| (other[0] - value).abs());
    let neighbours = [distance(most.checked_sub(1)), distance(Some(most + 1))];
    let is_apart = groups.len() > 1 && neighbours.into_iter().flatten().all(|distance| distance >= APART_M);
    let fractions = values.iter().filter(|height| height.fract() != 0.0).count();
    let has_fractions = 2 * fractions > values.len() - same.len() && fractions > 0;
    let is_doubtful = (is_apart && share >= APART_SHARE) || (has_fractions && share >= CONSTANT_SHARE);
    is_doubtful.then_some((value, share))
}

/// Tells what explains a large difference of two surfaces in height.
pub(super) fn offset_cause(reference: &Grid<f32>, found: &Evaluation) -> Option<String> {
    let step = reference.data().len().div_ceil(CELLS_MAX).max(1);
    let cells = reference.data().iter().zip(found.aligned.data()).step_by(step);
    let known: Vec<(f64, f64)> = cells
        .map(|(reference, test)| (f64::from(*reference), f64::from(*test) - found.shift.dz_m))
        .filter(|(reference, test)| reference.is_finite() && test.is_finite())
        .collect();
    // Median and spread of what is left when the heights of the test are scaled.
    let left = |factor: f64| -> Option<(f64, f64)> {
        let mut left: Vec<f32> = known.iter().map(|(reference, test)| (reference - factor * test) as f32).collect();
        let middle = left.len() / 2;
        let median = order_statistic(&mut left, middle)?;
        Some((f64::from(median), upper_nmad(&mut left)?))
    };
    let (offset, spread) = left(1.0)?;
    if offset.abs() < OFFSET_M {
        return None;
    }
    let explains =
        |factor: f64| left(factor).is_some_and(|(rest, own)| rest.abs() < LEFT_SHARE * offset.abs() && own <= spread);
    let direction = if offset < 0.0 { "above" } else { "below" };
    let offset = offset.abs();
    if explains(FOOT_M) {
        return Some(format!(
            "the test lies {offset:.0} m {direction} the reference, and its heights times {FOOT_M} fit: they are \
             probably in feet; convert them to metres, or declare the unit"
        ));
    }
    if explains(1.0 / FOOT_M) {
        return Some(format!(
            "the test lies {offset:.0} m {direction} the reference, whose heights times {FOOT_M} fit: those of the \
             reference are probably in feet; convert them to metres, or declare the unit"
        ));
    }
    (offset > DATUM_M).then(|| {
        format!(
            "the test lies {offset:.0} m {direction} the reference, more than any two vertical datums differ: check \
             the unit and the place of both"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_told_from_water_and_from_whole_metres() {
        let surface = |height: &dyn Fn(usize) -> f32| Grid::from_vec(100, 100, (0..10_000).map(height).collect());
        let town = |i: usize| 180.0 + ((i * 7919) % 6007) as f32 * 0.0123;
        for value in [0.0, 255.0, -1.0, 200.0, 65535.0] {
            let half = surface(&|i| if i % 100 < 50 { value } else { town(i) }).unwrap();
            assert_eq!(constant(&half), Some((value, 0.5)), "{value}");
        }
        let strip = surface(&|i| if i % 100 < 8 { 0.0 } else { town(i) }).unwrap();
        assert_eq!(constant(&strip), Some((0.0, 0.08)));
        assert_eq!(constant(&surface(&town).unwrap()), None);
        // A shore, whole metres, and a roof.
        let shore = surface(&|i| if i % 100 < 20 { 0.0 } else { (i % 100 - 20) as f32 * 0.31 + 0.2 }).unwrap();
        assert_eq!(constant(&shore), None);
        assert_eq!(constant(&surface(&|i| (i % 3) as f32).unwrap()), None);
        assert_eq!(constant(&surface(&|i| if i < 300 { 300.0 } else { town(i) }).unwrap()), None);
        assert_eq!(constant(&Grid::filled(3, 3, f32::NAN)), None);
    }
}
