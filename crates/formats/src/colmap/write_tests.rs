//! Writes models in both encodings and reads them back; refuses models that no file can hold.

use camera::{ImagePoint, Lens, LensModel, Pose};
use numeric::{Failure, Kind};
use proptest::prelude::*;

use super::*;

fn observation(view: u32, sample: f64, line: f64) -> ColmapObservation {
    ColmapObservation { view, pixel: ImagePoint { sample, line } }
}

fn model() -> (ColmapModel, Vec<ColmapPoint>) {
    let lens = |model, parameters: &[f64]| Lens::new(640, 480, model, parameters).unwrap();
    let lenses = vec![
        lens(LensModel::Pinhole, &[500.1, 510.2, 319.5, 239.25]),
        lens(LensModel::SimpleRadial, &[1.0 / 3.0, 100.0, 20.0, -0.1]),
        lens(LensModel::OpenCv, &[500.0, 510.0, 319.5, 239.5, 0.1, 0.02, 1e-9, -2e-3]),
    ];
    let view = |id, name: &str, lens, q, t| ColmapView {
        id,
        name: name.to_owned(),
        lens,
        pose: Pose::from_quaternion(q, t).unwrap(),
    };
    let views = vec![
        view(7, "a b.png", 0, [1.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0]),
        view(3, "sub/c.png", 2, [0.1, -0.7, 0.2, 0.4], [0.1, 1e-7, -4e5]),
        view(9, "d.png", 1, [0.0, 0.6, 0.0, 0.8], [0.0; 3]),
    ];
    let point = |position, track| ColmapPoint { position, color: [1, 128, 255], error_px: 0.25, track };
    let points = vec![
        point([1.0 / 3.0, -2e-300, 690_123.456], vec![observation(2, 1.5, 2.25), observation(0, 0.125, 0.25)]),
        point([0.0; 3], vec![]),
        point([1.0, 2.0, 3.0], vec![observation(0, 639.4, 0.0), observation(1, 7.0, 8.0)]),
    ];
    (ColmapModel { lenses, views }, points)
}

#[test]
fn both_encodings_lead_back() {
    let (model, points) = model();
    let mut found = Vec::new();
    for encoding in [ColmapEncoding::Binary, ColmapEncoding::Text] {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &model, &points, encoding, false).unwrap();
        assert_eq!(read(folder.path()).unwrap(), read_with_points(folder.path()).unwrap().0);
        found.push(read_with_points(folder.path()).unwrap());
        let again = write(folder.path(), &model, &points, encoding, false).unwrap_err();
        assert_eq!(again.kind(), Kind::OutputExists, "{again}");
        write(folder.path(), &model, &points, encoding, true).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }
    let (again, points_again) = &found[0];
    // Text is as exact as binary.
    assert_eq!(found[0], found[1]);
    assert_eq!(points_again, &points);
    assert_eq!(again.lenses, model.lenses);
    for (a, b) in again.views.iter().zip(&model.views) {
        assert_eq!((a.id, &a.name, a.lens), (b.id, &b.name, b.lens));
        let pairs = a.pose.rotation.as_flattened().iter().zip(b.pose.rotation.as_flattened());
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-15));
        let size = b.pose.centre.iter().fold(1.0, |m: f64, c| m.max(c.abs()));
        assert!((0..3).all(|i| (a.pose.centre[i] - b.pose.centre[i]).abs() < 1e-15 * size));
    }
}

#[test]
fn the_text_is_what_colmap_reads() {
    let (model, points) = model();
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &model, &points, ColmapEncoding::Text, false).unwrap();
    let lines = |name: &str| -> Vec<String> {
        let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    };
    assert_eq!(lines("cameras.txt")[0], "1 PINHOLE 640 480 500.1 510.2 320.0 239.75");
    assert_eq!(lines("images.txt")[0], "7 1.0 0.0 0.0 0.0 1.0 2.0 3.0 1 a b.png");
    // The second line of an image lists its points in the order of the model; tracks give the index
    // in that line.
    assert_eq!(lines("images.txt")[1], "0.625 0.75 1 639.9 0.5 3");
    assert_eq!(lines("points3D.txt")[0], "1 0.3333333333333333 -2e-300 690123.456 1 128 255 0.25 9 0 7 0");
    assert_eq!(lines("points3D.txt")[2], "3 1.0 2.0 3.0 1 128 255 0.25 7 1 3 0");
}

#[test]
fn models_that_no_file_can_hold_are_refused() {
    #[track_caller]
    fn refused(change: impl FnOnce(&mut ColmapModel, &mut Vec<ColmapPoint>), words: &str) {
        let (mut model, mut points) = model();
        change(&mut model, &mut points);
        let folder = tempfile::tempdir().unwrap();
        let error = write(folder.path(), &model, &points, ColmapEncoding::Binary, false).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("the model cannot be written (") && text.contains(words), "{text}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
    refused(|model, _| model.views[1].lens = 3, "names lens 3, the model has 3 lenses");
    refused(|model, _| model.views[1].id = 7, "belongs to two images");
    for name in ["../../x", "", "/a", "a\nb", " a", "a\\b"] {
        refused(|model, _| model.views[0].name = name.to_owned(), "image name");
    }
    refused(|model, _| model.views[0].pose.centre[1] = f64::NAN, "pose");
    refused(|_, points| points[0].position[0] = f64::INFINITY, "point 0");
    refused(|_, points| points[0].track[1].view = 3, "names view 3 of 3");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("frames.bin"), b"").unwrap();
    let (model, points) = model();
    let error = write(folder.path(), &model, &points, ColmapEncoding::Text, true).unwrap_err();
    assert!(error.to_string().contains("the folder holds frames.bin of another model"), "{error}");
}

#[test]
fn hostile_points_are_refused() {
    let (model, points) = model();
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &model, &points, ColmapEncoding::Binary, false).unwrap();
    let path = folder.path().join("points3D.bin");
    let whole = std::fs::read(&path).unwrap();
    let images = std::fs::read(folder.path().join("images.bin")).unwrap();
    for end in 0..whole.len() {
        std::fs::write(&path, &whole[..end]).unwrap();
        assert!(read_with_points(folder.path()).is_err(), "{end}");
    }
    // Offsets of the number of points, the length of a track, its image, its point, and a
    // coordinate.
    let changes: [(usize, &[u8], &str); 5] = [
        (0, &[0xff; 8], "room for"),
        (51, &[0xff; 8], "room for"),
        (59, &[0xee; 4], "there is no point with this number"),
        (63, &[0xff; 4], "there is no point with this number"),
        (16, &[0xff; 8], "not finite"),
    ];
    for (at, bytes, words) in changes {
        let mut changed = whole.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        std::fs::write(&path, changed).unwrap();
        let error = read_with_points(folder.path()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    std::fs::write(&path, &whole).unwrap();
    std::fs::write(folder.path().join("images.bin"), &images[..images.len() - 1]).unwrap();
    assert!(read_with_points(folder.path()).is_err());
}

proptest! {
    #[test]
    fn any_numbers_lead_back(
        position in prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO),
        pixels in prop::collection::vec((0u32..3, 0.0..600.0f64, 0.0..400.0f64), 0..20),
    ) {
        let (model, mut points) = model();
        points[1].position = position;
        points[1].track = pixels.into_iter().map(|(view, s, l)| observation(view, s, l)).collect();
        for encoding in [ColmapEncoding::Binary, ColmapEncoding::Text] {
            let folder = tempfile::tempdir().unwrap();
            write(folder.path(), &model, &points, encoding, false).unwrap();
            let (_, found) = read_with_points(folder.path()).unwrap();
            prop_assert_eq!(found.len(), points.len());
            for (found, point) in found.iter().zip(&points) {
                prop_assert_eq!(found.position, point.position);
                prop_assert_eq!(found.track.len(), point.track.len());
                for (found, seen) in found.track.iter().zip(&point.track) {
                    prop_assert_eq!(found.view, seen.view);
                    // Writing adds half a pixel and reading subtracts it.
                    prop_assert!((found.pixel.sample - seen.pixel.sample).abs() < 1e-13 * 600.0);
                    prop_assert!((found.pixel.line - seen.pixel.line).abs() < 1e-13 * 600.0);
                }
            }
        }
    }
}
