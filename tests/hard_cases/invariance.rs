//! Heights do not depend on the order of the views, on their gain and offset, nor on the first
//! pixel of an image.

use camera::ImagePoint;
use raster::Window;

use crate::stage::{EASY, Shot};

#[test]
fn the_order_of_the_views_does_not_matter() {
    let order = [2, 0, 1].map(|i| EASY.shots[i].clone());
    let outcome = EASY.stage.run(&order, |_| {}).unwrap();
    let share = EASY.outcome.agreement(&outcome, 0.05);
    assert!(share > 0.985, "only {share} of the cells are the same");
}

#[test]
fn gain_and_offset_of_a_view_do_not_matter() {
    let mut shots = EASY.shots.clone();
    for (shot, (gain, offset)) in shots.iter_mut().zip([(1, 0), (3, 500), (9, 2000)]) {
        shot.image = shot.image.map(|v| v * gain + offset);
    }
    let outcome = EASY.stage.run(&shots, |_| {}).unwrap();
    let share = EASY.outcome.agreement(&outcome, 0.05);
    assert!(share > 0.985, "only {share} of the cells are the same");
}

/// Returns the shots without the given (columns, rows) at their upper left.
fn cut(by: [[usize; 2]; 3]) -> Vec<Shot> {
    let one = |(shot, [x, y]): (&Shot, [usize; 2])| {
        let (width, height) = (shot.image.width() - x, shot.image.height() - y);
        let image = shot.image.window(Window { x: x as i64, y: y as i64, width, height }, 0);
        Shot { image, rpc: shot.rpc.cropped(ImagePoint::new(x as f64, y as f64)), ..shot.clone() }
    };
    EASY.shots.iter().zip(by).map(one).collect()
}

/// The cuts are whole pixels of every pyramid level, and odd numbers. The middle of the scene moves
/// with the cut, and with it the lattice of heights, which changes the heights by about their
/// noise. (On one lattice they are the same: `sweep: level`.)
#[test]
fn where_an_image_begins_does_not_matter() {
    for by in [[[8, 16], [8, 8], [16, 8]], [[3, 8], [5, 2], [1, 7]]] {
        let outcome = EASY.stage.run(&cut(by), |c| c.pointing = false).unwrap();
        let share = EASY.outcome.agreement(&outcome, 0.2);
        assert!(share > 0.97, "cut by {by:?}: only {share} of the cells are the same");
        EASY.stage.score(&outcome).expect("images cut by whole pixels", 0.95, 0.03);
    }
}
