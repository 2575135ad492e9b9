//! What is doubtful about an image and its RPC by themselves, before any two images are compared:
//! two RPCs that contradict each other, an RPC for another size of the image, and a constant that
//! looks like no-data which nobody declared.

use camera::{ImagePoint, RpcCamera};
use formats::raster::{ImageSource, LumaRule, RasterError};
use formats::rpc::RpcFile;
use geodesy::LonLatHeight;
use raster::{Grid, Window};

/// Difference of two projections of the image below which they are one RPC in two files, pixels. An
/// RPC with coefficients of eight digits in one of them differs by about a hundredth; what matching
/// can tell is about a tenth.
const SAME_RPC_PX: f64 = 0.05;
/// Places along each axis of the image, and shares of half the range of heights, at which two RPCs
/// are compared. RPCs are smooth: the largest differences are at the corners and the ends.
const PLACES: [f64; 3] = [0.0, 0.5, 1.0];
const HEIGHTS: [f64; 3] = [-0.5, 0.0, 0.5];

/// Factors between an image and the one of its RPC: images are halved, cut to thirds or quarters by
/// overviews and panchromatic sharpening.
const FACTORS: [f64; 6] = [0.25, 1.0 / 3.0, 0.5, 2.0, 3.0, 4.0];
/// Largest relative difference between such a factor and that of an axis. Providers centre their
/// RPCs within 1 % (15 images of five sensors); crops have other factors along each axis.
const FACTOR_TOLERANCE: f64 = 0.03;
/// Domain of an RPC over the image that it was made for. It was 1.0 to 1.2 where the RPC was
/// centred on the image; a crop of a large scene has 7 to 57.
const DOMAIN_RATIO: std::ops::Range<f64> = 0.95..1.6;

/// Longest side of the lattice on which constants are looked for, pixels.
const LATTICE: usize = 1024;
/// Least share of the rim of an image, and of its area, that a patch of no-data covers. The patches
/// of saturated roofs and of calm water of 60 images of five sensors have up to 0.06 and 0.012.
const RIM_SHARE: f64 = 0.1;
const AREA_SHARE: f64 = 0.02;

/// Returns what is doubtful about an image, a sentence for each finding.
///
/// # Errors
/// [`RasterError::Damaged`] when the pixels cannot be read.
pub(crate) fn doubts(source: &ImageSource, file: &RpcFile) -> Result<Vec<String>, RasterError> {
    let size = (source.info().width, source.info().height);
    let mut found = contradictions(source, file, size);
    found.extend(other_size(source, file, size));
    found.extend(undeclared_constant(source, size)?);
    Ok(found)
}

/// Compares the RPC that is used with the others of the image.
fn contradictions(source: &ImageSource, file: &RpcFile, size: (usize, usize)) -> Vec<String> {
    let path = source.path();
    let name = |file: &RpcFile| match file.source.as_path() == path {
        true => format!("the one inside the image ({})", file.format),
        false => format!("{} ({})", file.source.display(), file.format),
    };
    let used = RpcCamera::new(file.rpc.clone());
    let all = formats::rpc::all_of_image(path);
    // GDAL does not say whether its RPC is from inside or from beside the image.
    let origin = all.iter().find(|other| is_same(&used, other, size)).unwrap_or(file);
    let others = all.iter().filter(|other| !is_same(&used, other, size));
    others
        .map(|other| {
            let apart = match difference_px(&used, other, size) {
                Some(px) => format!("differ by up to {px:.1} px over the image"),
                None => "do not show the same ground".to_owned(),
            };
            format!(
                "two RPCs of this image {apart}: {} is used, {} is not; remove the wrong one: {}",
                name(origin),
                name(other),
                path.display()
            )
        })
        .collect()
}

fn is_same(used: &RpcCamera, other: &RpcFile, size: (usize, usize)) -> bool {
    difference_px(used, other, size).is_some_and(|px| px < SAME_RPC_PX)
}

/// Returns the largest distance between the projections of two RPCs of ground that the first one
/// sees in the image; `None` where one of them has no projection.
fn difference_px(used: &RpcCamera, other: &RpcFile, (width, height): (usize, usize)) -> Option<f64> {
    let domain = used.rpc.domain();
    let mut largest = 0.0_f64;
    for share in HEIGHTS {
        let height_m = domain.centre.height_m + share * domain.half_height_m;
        for (x, y) in PLACES.iter().flat_map(|x| PLACES.map(|y| (*x, y))) {
            let at = ImagePoint::new(x * (width as f64 - 1.0), y * (height as f64 - 1.0));
            let ground: LonLatHeight = used.localize(at, height_m).ok()?;
            let seen = other.rpc.project(ground).ok()?;
            largest = largest.max((seen.sample - at.sample).hypot(seen.line - at.line));
        }
    }
    Some(largest)
}

/// Tells an RPC that was made for the image at another size: its centre and its domain are those of
/// an image that is larger or smaller by one factor.
fn other_size(source: &ImageSource, file: &RpcFile, (width, height): (usize, usize)) -> Option<String> {
    let rpc = &file.rpc;
    let axes = [(rpc.samp_off, rpc.samp_scale, width as f64), (rpc.line_off, rpc.line_scale, height as f64)];
    let factor = FACTORS.into_iter().find(|factor| {
        axes.iter().all(|(offset, scale, side)| {
            let centred = (2.0 * offset + 1.0) / side / factor;
            let domain = 2.0 * scale.abs() / side / factor;
            (centred - 1.0).abs() <= FACTOR_TOLERANCE && DOMAIN_RATIO.contains(&domain)
        })
    })?;
    let of_rpc = [axes[0], axes[1]].map(|(offset, _, _)| 2.0 * offset + 1.0);
    Some(format!(
        "the image has {width} × {height} pixels, and its RPC is centred on an image of about {:.0} × {:.0}, {} in both \
         directions: if the image was resampled, give it the RPC of its own size; \
         if it is a part of a larger one, this is no fault: {}",
        of_rpc[0],
        of_rpc[1],
        if factor > 1.0 { format!("{factor:.0} times as large") } else { format!("{:.0} times smaller", 1.0 / factor) },
        source.path().display()
    ))
}

/// Tells a patch of one value at the rim. Zeros are no-data to every stage and need no word.
fn undeclared_constant(source: &ImageSource, (width, height): (usize, usize)) -> Result<Option<String>, RasterError> {
    let band = match &source.info().luma {
        LumaRule::Single(band) | LumaRule::Rgb([band, ..]) => *band,
        LumaRule::Mean(bands) => bands.first().copied().unwrap_or(1),
        _ => 1,
    };
    let long = |side: usize| side.min(LATTICE);
    let read = |x: usize, y: usize, w: usize, h: usize| {
        let window = Window { x: x as i64, y: y as i64, width: w, height: h };
        source.read_reduced(band, window, (long(w), long(h)))
    };
    // The rim alone tells most images, without reading them whole.
    let rim =
        [read(0, 0, width, 1)?, read(0, height - 1, width, 1)?, read(0, 0, 1, height)?, read(width - 1, 0, 1, height)?];
    let perimeter: usize = rim.iter().map(|side| side.data().len()).sum();
    let mut values: Vec<f32> = rim.iter().flat_map(|side| side.data().iter().copied()).collect();
    values.retain(|value| value.is_finite() && *value != 0.0);
    values.sort_unstable_by(f32::total_cmp);
    let most = values.chunk_by(|a, b| a == b).max_by_key(|same| same.len());
    let Some(value) = most.filter(|same| same.len() as f64 >= RIM_SHARE * perimeter as f64).map(|same| same[0]) else {
        return Ok(None);
    };
    let lattice = read(0, 0, width, height)?;
    let Some(share) = patch_at_rim(&lattice, value) else { return Ok(None) };
    Ok(Some(format!(
        "{:.0} % of the image is one patch of exactly {value} that reaches its rim, which looks like no-data that the \
         file does not declare: declare it (gdal_edit.py -a_nodata {value}), or mask it if it is a saturated cloud: {}",
        100.0 * share,
        source.path().display()
    )))
}

/// Returns the share of the largest patch of a value that takes enough of the rim and of the area.
fn patch_at_rim(lattice: &Grid<f32>, value: f32) -> Option<f64> {
    let (width, height) = (lattice.width(), lattice.height());
    let mut is_seen = vec![false; width * height];
    let is_rim = |at: usize| {
        let (x, y) = (at % width, at / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    let rim = (0..width * height).filter(|&at| is_rim(at)).count();
    let mut best: Option<f64> = None;
    for start in (0..width * height).filter(|&at| is_rim(at)) {
        if is_seen[start] || lattice.data()[start] != value {
            continue;
        }
        is_seen[start] = true;
        let (mut open, mut cells, mut on_rim) = (vec![start], 0_usize, 0_usize);
        while let Some(at) = open.pop() {
            cells += 1;
            on_rim += usize::from(is_rim(at));
            let (x, y) = (at % width, at / width);
            let around = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for next in around.into_iter().flatten() {
                if !is_seen[next] && lattice.data()[next] == value {
                    is_seen[next] = true;
                    open.push(next);
                }
            }
        }
        let share = cells as f64 / (width * height) as f64;
        if on_rim as f64 >= RIM_SHARE * rim as f64 && share >= AREA_SHARE && best.is_none_or(|best| share > best) {
            best = Some(share);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_at_the_rim_are_told_from_roofs() {
        let image = |is_void: &dyn Fn(usize, usize) -> bool| {
            let value = |i: usize| if is_void(i % 200, i / 200) { 255.0 } else { (i * 7 % 90) as f32 };
            Grid::from_vec(200, 100, (0..20_000).map(value).collect()).unwrap()
        };
        assert_eq!(patch_at_rim(&image(&|x, _| x < 20), 255.0), Some(0.1));
        assert!(patch_at_rim(&image(&|x, y| x + y < 60), 255.0).is_some(), "a corner of a turned image");
        // A roof inside, a small one at the rim, a thin line along it.
        assert_eq!(patch_at_rim(&image(&|x, y| (50..150).contains(&x) && (20..80).contains(&y)), 255.0), None);
        assert_eq!(patch_at_rim(&image(&|x, y| x < 25 && y < 25), 255.0), None);
        assert_eq!(patch_at_rim(&image(&|_, y| y == 0), 255.0), None);
    }
}
