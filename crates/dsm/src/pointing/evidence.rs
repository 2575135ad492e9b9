//! What tie points prove: whether they are more than chance, and whether their heights fit to the
//! RPCs and to an elevation model.
//!
//! A true tie lies on its height trajectory but for the pointing error, which is nearly the same
//! for all ties of a pair. A chance likeness lies anywhere in the band that was searched. An error
//! along the trajectory cannot be told from a height: it shows only against other pairs, or as
//! heights for which the RPCs were not made.

use camera::RpcCamera;
use reconstruct::HeightRange;
use sweep::pointing::{Tie, off_trajectory};

use crate::error::DsmError;
use crate::images::scene_image::SceneImage;
use crate::notes::Notes;

/// True ties of a pair lie in a band of this width across their trajectories, pixels: the drift of
/// a sensor over an image and the errors of matching. Chance fills the whole band of the search,
/// which is a dozen times wider.
const TRUE_BAND_PX: f64 = 4.0;
/// At least one tie in this many lies in that band when ties are true. Of chance likenesses one in
/// twelve does, and of a few dozen never a third.
const TRUE_ONE_IN: usize = 3;

/// Returns whether ties of a pair are more than chance likenesses. `height_m` is a height at which
/// both cameras see the scene, and `least` the number of ties that is enough.
pub(crate) fn is_beyond_chance(
    (reference, source): (&RpcCamera, &RpcCamera),
    ties: &[Tie],
    height_m: f64,
    least: usize,
) -> bool {
    let off = |tie: &Tie| off_trajectory(reference, source, tie, height_m);
    let mut across: Vec<f64> = ties.iter().filter_map(off).map(|off| off.across_px).collect();
    across.sort_by(f64::total_cmp);
    let within = |from: usize| across[from..].partition_point(|v| *v <= across[from] + TRUE_BAND_PX);
    let densest = (0..across.len()).map(within).max().unwrap_or(0);
    densest >= least && TRUE_ONE_IN * densest >= ties.len()
}

/// Warns of images whose RPCs are not made for the heights at which the ties lie.
pub(crate) fn warn_of_domains(images: &[SceneImage], seen: HeightRange, notes: &mut Notes<'_>) {
    for image in images {
        let rpc = &image.camera.rpc;
        let scale = rpc.height_scale.abs();
        let domain = HeightRange::at(rpc.height_off).grown(scale, scale);
        if seen.low_m > domain.high_m || seen.high_m < domain.low_m {
            notes.warn(format!(
                "the tie points lie between {:.0} and {:.0} m, and the RPC of an image is made for {:.0} to {:.0} m; \
                 if the scene is not there, the pointing of an image is off along its line of sight: {}",
                seen.low_m,
                seen.high_m,
                domain.low_m,
                domain.high_m,
                image.path.display()
            ));
        }
    }
}

/// Returns the heights to search for an elevation model and tie points, which must meet.
///
/// Tie points beyond the model are searched too, with a warning where they are far from it.
///
/// # Errors
/// [`DsmError::DemMissesScene`] when no tie point lies near the heights of the model.
pub(crate) fn dem_with_ties(
    searched: HeightRange,
    dem: HeightRange,
    seen: Option<HeightRange>,
    notes: &mut Notes<'_>,
) -> Result<HeightRange, DsmError> {
    let Some(seen) = seen else { return Ok(searched) };
    if seen.high_m < searched.low_m || seen.low_m > searched.high_m {
        return Err(DsmError::DemMissesScene { dem, seen });
    }
    let all = searched.union(seen);
    if all != searched {
        notes.warn(format!(
            "the elevation model's {:.0} to {:.0} m do not hold the tie points, which lie between {:.0} and {:.0} m \
             above the ellipsoid; both are searched, but check the model and its vertical datum",
            dem.low_m, dem.high_m, seen.low_m, seen.high_m
        ));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use camera::ImagePoint;
    use sweep::source_from_reference;

    use super::*;

    fn cameras() -> [RpcCamera; 2] {
        [1, 3].map(|i| {
            let path = format!("{}/../../data-samples/town/view_{i}.tif", env!("CARGO_MANIFEST_DIR"));
            RpcCamera::new(formats::rpc::read_for_image(std::path::Path::new(&path)).unwrap().rpc)
        })
    }

    /// A tie at a height between 180 and 230 m that is off by some pixels.
    fn tie_off(cameras: &[RpcCamera; 2], i: usize, off: [f64; 2]) -> Tie {
        let at = ImagePoint::new(40.0 + (i * 97 % 500) as f64, 30.0 + (i * 61 % 600) as f64);
        let height_m = 180.0 + (i * 37 % 50) as f64;
        let place = source_from_reference(&cameras[0], &cameras[1], 0, at, height_m).unwrap();
        let source = ImagePoint::new(place.sample + off[0], place.line + off[1]);
        Tie { reference: at, source, correlation: 0.8 }
    }

    #[test]
    fn ties_with_one_pointing_error_are_true_and_scattered_ones_are_chance() {
        let cameras = cameras();
        let check = |ties: &[Tie]| is_beyond_chance((&cameras[0], &cameras[1]), ties, 200.0, 12);
        let one_error: Vec<Tie> = (0..40).map(|i| tie_off(&cameras, i, [17.0, -9.0])).collect();
        assert!(check(&one_error));
        let chance = |i: usize| {
            let [a, b] = [i * 7919 % 97, i * 104_729 % 89].map(|v| v as f64 / 2.0 - 24.0);
            tie_off(&cameras, i, [a, b])
        };
        for count in [12, 20, 40, 100, 300] {
            let ties: Vec<Tie> = (0..count).map(chance).collect();
            assert!(!check(&ties), "{count} chance likenesses");
        }
        // True ties are found among as many wrong ones.
        let mixed: Vec<Tie> = one_error.into_iter().chain((0..40).map(chance)).collect();
        assert!(check(&mixed));
    }

    #[test]
    fn an_elevation_model_must_meet_the_ties() {
        let mut notes = Notes::new(&numeric::Silent);
        let seen = Some(HeightRange::new(190.0, 240.0));
        let searched = |dem: HeightRange| dem.grown(20.0, 60.0);
        let good = HeightRange::new(180.0, 210.0);
        assert_eq!(dem_with_ties(searched(good), good, seen, &mut notes).unwrap(), searched(good));
        assert!(notes.warnings.is_empty());
        let low = HeightRange::new(150.0, 170.0);
        assert_eq!(dem_with_ties(searched(low), low, seen, &mut notes).unwrap(), HeightRange::new(130.0, 240.0));
        assert_eq!(notes.warnings.len(), 1);
        let high = HeightRange::new(480.0, 510.0);
        let refused = dem_with_ties(searched(high), high, seen, &mut notes);
        assert!(matches!(refused, Err(DsmError::DemMissesScene { .. })));
    }
}
