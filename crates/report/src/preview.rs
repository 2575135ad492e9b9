//! Depth and normal maps as pictures for people.
//!
//! Depths have colours from near to far, and a bar with the depths written beside it. Normals have
//! the usual colours, (n + 1) / 2 as red, green, blue. Pixels without a value are grey. Large maps
//! are first thinned by a whole number of pixels, without mixing depths across edges.

use raster::Grid;

use crate::palette::OUTSIDE;

/// Longest side of a preview without its bar, pixels.
const LONGEST_SIDE: usize = 640;
/// Colours from near to far. The far end is dark, so that lightness means nearness, also in print.
const NEAR_TO_FAR: [[f64; 3]; 6] = [
    [252.0, 246.0, 190.0],
    [251.0, 178.0, 96.0],
    [226.0, 100.0, 84.0],
    [152.0, 52.0, 112.0],
    [74.0, 30.0, 104.0],
    [18.0, 14.0, 46.0],
];
const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [30; 3];
/// Widths of the bar, of the gap before it, and of the space for its numbers, pixels.
const BAR: [usize; 3] = [14, 10, 52];
/// Number of labels at the bar.
const MARKS: usize = 5;

/// Colours depths from near (light) to far (dark), with a bar from the nearest downwards. Values
/// that are not finite are grey.
pub fn depth_preview(depth_m: &Grid<f32>) -> Grid<[u8; 3]> {
    preview(depth_m, |low, high| (low, high))
}

/// Colours heights from high (light) to low (dark), with a bar from the highest downwards. Values
/// that are not finite are grey.
pub fn height_preview(height_m: &Grid<f32>) -> Grid<[u8; 3]> {
    preview(height_m, |low, high| (high, low))
}

/// Colours values between their first and 99th percentiles. `ends` orders these two: the value of
/// the light end, which is at the top of the bar, and that of the dark end.
fn preview(values_m: &Grid<f32>, ends: fn(f64, f64) -> (f64, f64)) -> Grid<[u8; 3]> {
    let depth = thinned(values_m);
    let range = raster::height_percentiles(&depth, 1.0, 99.0);
    let (near, far) = range.map_or((0.0, 1.0), |(n, f)| ends(f64::from(n), f64::from(f)));
    let span = if far == near { 1.0 } else { far - near };
    let [bar, gap, text] = BAR;
    let (width, height) = (depth.width(), depth.height());
    let mut picture = Grid::filled(width + gap + bar + text, height.max(7 * MARKS), PAPER);
    for row in 0..height {
        for (pixel, &value) in picture.row_mut(row).iter_mut().zip(depth.row(row)) {
            *pixel = if value.is_finite() { near_to_far((f64::from(value) - near) / span) } else { OUTSIDE };
        }
    }
    let last = picture.height() - 1;
    for row in 0..picture.height() {
        let colour = near_to_far(row as f64 / last as f64);
        picture.row_mut(row)[width + gap..width + gap + bar].fill(colour);
    }
    for mark in 0..MARKS {
        let part = mark as f64 / (MARKS - 1) as f64;
        let top = ((part * last as f64) as usize).saturating_sub(3).min(picture.height() - 7);
        write(&mut picture, width + gap + bar + 3, top, &short(near + part * span));
    }
    picture
}

/// Colours normals. Pixels with a normal of zero are grey.
pub fn normal_preview(normals: &Grid<[f32; 3]>) -> Grid<[u8; 3]> {
    let colour = |n: &[f32; 3]| {
        if *n == [0.0; 3] { OUTSIDE } else { n.map(|c| (127.5 * (c + 1.0)).round().clamp(0.0, 255.0) as u8) }
    };
    thinned(normals).map(colour)
}

/// Puts pictures side by side on white, with a strip of 8 pixels between them.
pub fn side_by_side(pictures: &[&Grid<[u8; 3]>]) -> Grid<[u8; 3]> {
    const GAP: usize = 8;
    let width = pictures.iter().map(|p| p.width() + GAP).sum::<usize>().saturating_sub(GAP);
    let height = pictures.iter().map(|p| p.height()).max().unwrap_or(0);
    let mut sheet = Grid::filled(width, height, PAPER);
    let mut left = 0;
    for picture in pictures {
        for row in 0..picture.height() {
            sheet.row_mut(row)[left..left + picture.width()].copy_from_slice(picture.row(row));
        }
        left += picture.width() + GAP;
    }
    sheet
}

/// Draws a mask: white where it is set, dark elsewhere.
pub fn mask_preview(mask: &Grid<bool>) -> Grid<[u8; 3]> {
    thinned(mask).map(|set| if *set { PAPER } else { INK })
}

/// Keeps every n-th pixel of every n-th row, so that the longest side fits.
fn thinned<T: Copy>(map: &Grid<T>) -> Grid<T> {
    let step = map.width().max(map.height()).div_ceil(LONGEST_SIDE).max(1);
    let (width, height) = (map.width().div_ceil(step), map.height().div_ceil(step));
    let rows = (0..map.height()).step_by(step);
    let data = rows.flat_map(|row| map.row(row).iter().step_by(step).copied()).collect();
    // The number of values follows from the two divisions above.
    Grid::from_vec(width, height, data).unwrap_or_else(|| map.clone())
}

/// Returns the colour of a part of the range, 0 the light end and 1 the dark end.
pub(crate) fn near_to_far(part: f64) -> [u8; 3] {
    let position = part.clamp(0.0, 1.0) * (NEAR_TO_FAR.len() - 1) as f64;
    let below = (position as usize).min(NEAR_TO_FAR.len() - 2);
    let t = position - below as f64;
    std::array::from_fn(|i| {
        (NEAR_TO_FAR[below][i] + t * (NEAR_TO_FAR[below + 1][i] - NEAR_TO_FAR[below][i])).round() as u8
    })
}

/// Writes a depth or height in at most five digits, and its unit.
fn short(value_m: f64) -> String {
    let size_m = value_m.abs();
    let digits = if size_m < 9.995 { 2 } else { usize::from(size_m < 999.95) };
    if size_m < 99_999.5 { format!("{value_m:.digits$}m") } else { format!("{:.0}km", value_m / 1e3) }
}

/// Letters of 5 × 7 pixels, one number per row. The highest of five bits is the leftmost pixel.
const LETTERS: [(char, [u8; 7]); 14] = [
    ('-', [0x00, 0x00, 0x00, 0x1f, 0x00, 0x00, 0x00]),
    ('0', [0x0e, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0e]),
    ('1', [0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e]),
    ('2', [0x0e, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1f]),
    ('3', [0x0e, 0x11, 0x01, 0x06, 0x01, 0x11, 0x0e]),
    ('4', [0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02]),
    ('5', [0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e]),
    ('6', [0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e]),
    ('7', [0x1f, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08]),
    ('8', [0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e]),
    ('9', [0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c]),
    ('.', [0x00, 0x00, 0x00, 0x00, 0x00, 0x0c, 0x0c]),
    ('m', [0x00, 0x00, 0x1a, 0x15, 0x15, 0x15, 0x15]),
    ('k', [0x10, 0x10, 0x12, 0x14, 0x18, 0x14, 0x12]),
];

/// Writes a number on a white field whose middle lies at (x, y), kept inside the picture. Letters
/// other than digits are left out.
pub fn number_label(picture: &mut Grid<[u8; 3]>, (x, y): (usize, usize), text: &str) {
    let (width, height) = (6 * text.chars().count() + 3, 11);
    let inside = |at: usize, size: usize, all: usize| at.saturating_sub(size / 2).min(all.saturating_sub(size));
    let (left, top) = (inside(x, width, picture.width()), inside(y, height, picture.height()));
    for row in top..(top + height).min(picture.height()) {
        let end = (left + width).min(picture.width());
        picture.row_mut(row)[left..end].fill(PAPER);
    }
    write(picture, left + 2, top + 2, text);
}

fn write(picture: &mut Grid<[u8; 3]>, left: usize, top: usize, text: &str) {
    for (place, letter) in text.chars().enumerate() {
        let Some((_, rows)) = LETTERS.iter().find(|(known, _)| *known == letter) else { continue };
        for (row, bits) in rows.iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                let (x, y) = (left + 6 * place + column, top + row);
                if picture.get(x, y).is_some() {
                    picture[(x, y)] = INK;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let (a, b) = (Grid::filled(3, 2, [1; 3]), Grid::filled(4, 5, [2; 3]));
        let sheet = side_by_side(&[&a, &b]);
        assert_eq!((sheet.width(), sheet.height()), (15, 5));
        assert_eq!([sheet[(2, 1)], sheet[(3, 1)], sheet[(2, 2)], sheet[(11, 4)]], [[1; 3], PAPER, PAPER, [2; 3]]);
        assert_eq!(side_by_side(&[]).width(), 0);
        let mask = mask_preview(&Grid::from_vec(2, 1, vec![true, false]).unwrap());
        assert_eq!(mask.data(), [PAPER, INK]);
    }

    #[test]
    fn labels_stay_inside_the_picture() {
        let mut picture = Grid::filled(40, 30, [9; 3]);
        number_label(&mut picture, (39, 0), "12");
        assert_eq!((picture[(39, 0)], picture[(24, 0)], picture[(39, 11)]), (PAPER, [9; 3], [9; 3]));
        assert!(picture.data().contains(&INK));
        let mut tiny = Grid::filled(3, 3, [9; 3]);
        number_label(&mut tiny, (1, 1), "7");
        assert!(tiny.data().iter().all(|pixel| *pixel != [9; 3]));
    }

    #[test]
    fn near_is_light_far_is_dark_and_nothing_is_grey() {
        let depth = (0..100 * 60).map(|i| if i % 100 < 10 { f32::INFINITY } else { (i % 100) as f32 }).collect();
        let picture = depth_preview(&Grid::from_vec(100, 60, depth).unwrap());
        assert_eq!((picture.width(), picture.height()), (100 + 76, 60));
        let light = |x: usize| picture[(x, 30)].iter().map(|&c| u32::from(c)).sum::<u32>();
        assert_eq!(picture[(5, 30)], OUTSIDE);
        assert!(light(12) > light(50) && light(50) > light(95));
        // The bar ends in the colours of the range, and there are labels beside it.
        assert_eq!([picture[(112, 0)], picture[(112, 59)]], [near_to_far(0.0), near_to_far(1.0)]);
        assert!((127..176).any(|x| picture[(x, 2)] == INK));
    }

    /// The bar of heights stands like the ground: the highest is at its top.
    #[test]
    fn heights_are_high_at_the_top() {
        let heights = Grid::from_vec(100, 60, (0..100 * 60).map(|i| -50.0 + (i % 100) as f32).collect()).unwrap();
        let picture = height_preview(&heights);
        let light = |x: usize, y: usize| picture[(x, y)].iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!(light(95, 30) > light(50, 30) && light(50, 30) > light(5, 30));
        assert!(light(112, 0) > light(112, 30) && light(112, 30) > light(112, 59));
        assert_eq!(["-0.50m", "-12.3m"], [-0.5, -12.34].map(short).each_ref().map(String::as_str));
    }

    #[test]
    fn empty_and_large_maps() {
        let nothing = depth_preview(&Grid::filled(8, 2, f32::INFINITY));
        assert_eq!((nothing[(0, 0)], nothing.height()), (OUTSIDE, 35));
        assert_eq!(depth_preview(&Grid::filled(2_000, 1_500, 5.0)).width(), 500 + 76);
        let normals = normal_preview(&Grid::from_vec(3, 1, vec![[0.0; 3], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]).unwrap());
        assert_eq!(normals.data(), [OUTSIDE, [128, 128, 255], [0, 128, 128]]);
    }

    #[test]
    fn depths_are_short() {
        let texts = [0.5, 9.994, 12.34, 999.9, 1_234.4, 250_000.0].map(short);
        assert_eq!(texts, ["0.50m", "9.99m", "12.3m", "999.9m", "1234m", "250km"]);
    }
}
