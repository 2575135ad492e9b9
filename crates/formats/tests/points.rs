//! Reads point clouds as grids: LAS and LAZ, reference systems, noise, and hostile files.

use std::path::{Path, PathBuf};

use crs::{Crs, VerticalDatum};
use formats::FormatError;
use formats::points::{CellLattice, GriddedPoints, PointCloud, is_point_cloud};
use geodesy::MapPoint;
use las::point::{Classification, Format};
use las::{Builder, Point, Transform, Vector, Version, Writer};
use proptest::prelude::*;
use tempfile::TempDir;

const WEST: f64 = 436_078.0;
const NORTH: f64 = 3_357_752.0;

fn point(x: f64, y: f64, z: f64, class: u8) -> Point {
    let classification = Classification::new(class).unwrap();
    Point { x: WEST + x, y: NORTH - y, z, classification, gps_time: Some(0.0), ..Point::default() }
}

/// Makes points: two in one cell, a noise point above all others, a withheld one.
fn points() -> Vec<Point> {
    let withheld = Point { is_withheld: true, ..point(0.2, 0.2, 70.0, 1) };
    vec![
        point(0.1, 0.1, 12.0, 2),
        point(0.3, 0.4, 17.5, 6),
        point(0.6, 0.2, 500.0, 18),
        withheld,
        point(2.4, 1.4, 13.25, 2),
    ]
}

fn write(folder: &TempDir, name: &str, crs: Option<Crs>, points: &[Point]) -> PathBuf {
    write_as(Format::new(6).unwrap(), folder, name, crs, points)
}

fn write_as(format: Format, folder: &TempDir, name: &str, crs: Option<Crs>, points: &[Point]) -> PathBuf {
    let path = folder.path().join(name);
    let mut builder = Builder::from(Version::new(1, 4));
    builder.point_format = format;
    builder.point_format.is_compressed = name.ends_with("laz");
    let axis = |offset| Transform { scale: 0.001, offset };
    builder.transforms = Vector { x: axis(WEST), y: axis(NORTH), z: axis(0.0) };
    let mut header = builder.into_header().unwrap();
    if let Some(crs) = crs {
        header.set_wkt_crs(crs.wkt().unwrap().into_bytes()).unwrap();
    }
    let mut writer = Writer::from_path(&path, header).unwrap();
    points.iter().for_each(|p| writer.write_point(p.clone()).unwrap());
    writer.close().unwrap();
    path
}

fn gridded(path: &Path) -> Result<GriddedPoints, FormatError> {
    let anchor = MapPoint { x: WEST, y: NORTH };
    PointCloud::open(path)?.highest(CellLattice { cell_x: 0.5, cell_y: 0.5, anchor })
}

#[test]
fn the_highest_point_of_a_cell_that_is_no_noise_is_its_height() {
    let folder = TempDir::new().unwrap();
    for name in ["cloud.las", "cloud.laz"] {
        let crs = Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 };
        let path = write(&folder, name, Some(crs), &points());
        assert!(is_point_cloud(&path));
        let found = gridded(&path).unwrap();
        let dem = &found.dem;
        assert_eq!((dem.horizontal_epsg, dem.vertical), (Some(32617), Some(VerticalDatum::Egm96)), "{name}");
        assert_eq!((found.points, found.left_out), (5, 2), "{name}");
        assert_eq!((dem.geotransform.0[0], dem.geotransform.0[3]), (WEST, NORTH), "{name}");
        assert_eq!((dem.heights[(0, 0)], found.classes[(0, 0)]), (17.5, Some(6)), "{name}");
        assert_eq!((dem.heights[(4, 2)], found.classes[(4, 2)]), (13.25, Some(2)), "{name}");
        assert_eq!(dem.heights.data().iter().filter(|h| h.is_finite()).count(), 2, "{name}");
    }
}

#[test]
fn a_cloud_without_a_coordinate_system_says_so() {
    let folder = TempDir::new().unwrap();
    let found = gridded(&write(&folder, "bare.las", None, &points())).unwrap();
    assert_eq!((found.dem.horizontal_epsg, found.dem.crs_wkt, found.dem.vertical), (None, None, None));
}

#[test]
fn clouds_that_make_no_surface_are_refused() {
    let folder = TempDir::new().unwrap();
    let noise = write(&folder, "noise.las", None, &[point(0.0, 0.0, 1.0, 7)]);
    let none = gridded(&noise).unwrap_err().to_string();
    assert!(none.starts_with("none of the 1 points can be used"), "{none}");
    let far = write(&folder, "far.las", None, &[point(0.0, 0.0, 1.0, 2), point(9e5, 9e5, 1.0, 2)]);
    let error = gridded(&far).unwrap_err().to_string();
    assert!(error.contains("larger cells") && error.ends_with("far.las"), "{error}");
    let text = folder.path().join("text.las");
    std::fs::write(&text, "no points").unwrap();
    assert!(!is_point_cloud(&text));
    assert!(gridded(&text).unwrap_err().to_string().contains("LASF"));
    let missing = gridded(&folder.path().join("missing.las")).unwrap_err().to_string();
    assert!(missing.starts_with("cannot read the file ("), "{missing}");
}

#[test]
fn an_extended_record_that_does_not_fit_is_refused_before_it_is_read() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, "cloud.las", None, &points());
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[235..243].copy_from_slice(&100u64.to_le_bytes());
    bytes[243..247].copy_from_slice(&1u32.to_le_bytes());
    bytes[120..128].copy_from_slice(&(u64::MAX / 2).to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    assert!(gridded(&path).unwrap_err().to_string().contains("extended record"));
}

#[test]
fn chunks_that_do_not_fit_are_refused_before_they_are_read() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, "cloud.laz", None, &points());
    let whole = std::fs::read(&path).unwrap();
    let data = u32::from_le_bytes(whole[96..100].try_into().unwrap()) as usize;
    let table = u64::from_le_bytes(whole[data..data + 8].try_into().unwrap()) as usize;
    let layers = data + 8 + 30 + 4;
    for (at, size, said) in [(table + 4, u32::MAX, "chunks in a file of"), (layers, u32::MAX, "bytes of points from")] {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&size.to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
        let error = gridded(&path).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    std::fs::write(&path, &whole[..layers]).unwrap();
    let cut = gridded(&path).unwrap_err().to_string();
    assert!(cut.starts_with("the file is not a readable LAS or LAZ file ("), "{cut}");
    // The record of LASzip has the type, size and version of each item of a point from byte 34 on.
    let record = whole.windows(14).position(|bytes| bytes == b"laszip encoded").unwrap();
    let mut bytes = whole;
    bytes[record + 52 + 34 + 2] = 40;
    std::fs::write(&path, bytes).unwrap();
    let error = gridded(&path).unwrap_err().to_string();
    assert!(error.contains("item Point14 of 40 bytes"), "{error}");
}

#[test]
fn a_cloud_without_points_has_none_and_a_record_of_compression_alone_compresses_nothing() {
    let folder = TempDir::new().unwrap();
    let empty = write(&folder, "empty.laz", None, &[]);
    assert!(gridded(&empty).is_err());
    let mut bytes = std::fs::read(write(&folder, "cloud.las", None, &points())).unwrap();
    let compressed = std::fs::read(write(&folder, "cloud.laz", None, &points())).unwrap();
    let data = |bytes: &[u8]| u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let (own, records) = (data(&bytes), compressed[375..data(&compressed)].to_vec());
    bytes.splice(own..own, records.iter().copied());
    bytes[96..100].copy_from_slice(&((own + records.len()) as u32).to_le_bytes());
    bytes[100..104].copy_from_slice(&1u32.to_le_bytes());
    let path = folder.path().join("stale.las");
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(gridded(&path).unwrap().points, 5);
}

#[test]
fn compressed_points_of_every_form_and_of_several_chunks_are_read() {
    let folder = TempDir::new().unwrap();
    let many = 120_000;
    for (number, extra_bytes) in [(1, 0), (3, 2), (6, 0), (7, 3), (8, 0)] {
        let format = Format { extra_bytes, ..Format::new(number).unwrap() };
        let points: Vec<Point> = (0..many)
            .map(|i| Point {
                gps_time: format.has_gps_time.then_some(f64::from(i)),
                color: format.has_color.then(Default::default),
                nir: format.has_nir.then_some(7),
                extra_bytes: vec![1; usize::from(extra_bytes)],
                ..point(f64::from(i % 400) * 0.5, f64::from(i / 400) * 0.5, f64::from(i % 97), 2)
            })
            .collect();
        let found = gridded(&write_as(format, &folder, "many.laz", None, &points)).unwrap();
        assert_eq!((found.points, found.left_out), (many as u64, 0), "format {number}");
        assert_eq!(found.dem.heights[(3, 0)], 3.0, "format {number}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn damaged_files_end_in_an_error_or_a_grid(
        changes in prop::collection::vec((0usize..900, any::<u8>()), 1..12), cut in 0usize..900, compressed in any::<bool>(),
    ) {
        let folder = TempDir::new().unwrap();
        let path = write(&folder, if compressed { "cloud.laz" } else { "cloud.las" }, None, &points());
        let mut bytes = std::fs::read(&path).unwrap();
        for (at, value) in changes {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        if cut % 3 == 0 {
            bytes.truncate(cut);
        }
        std::fs::write(&path, bytes).unwrap();
        if let Ok(found) = gridded(&path) {
            prop_assert!(found.left_out < found.points);
        }
    }
}
