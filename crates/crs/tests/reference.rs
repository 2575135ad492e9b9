//! Projections and geoid heights against values computed without PROJ (`reference/generate.py`).

use crs::{HeightConverter, MapProjection, VerticalDatum};
use geodesy::TransverseMercator;

/// Rows of numbers of a reference file.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let data = text.lines().filter(|line| !line.starts_with('#'));
    data.map(|line| line.split_whitespace().map(|n| n.parse().unwrap()).collect()).collect()
}

#[test]
fn utm_and_ups_agree_with_independent_formulas_to_a_hundredth_of_a_millimetre() {
    let rows = rows(include_str!("reference/projections.txt"));
    assert!(rows.len() > 100);
    for row in rows {
        let projection = MapProjection::from_epsg(row[0] as u32).unwrap();
        let map = projection.map_from_lonlat(row[1], row[2]).unwrap();
        let error = (map.x - row[3]).hypot(map.y - row[4]);
        assert!(error < 1e-5, "{row:?}: {map:?}, off by {error} m");
        let (lon, lat) = projection.lonlat_from_map(row[3], row[4]).unwrap();
        let across = (geodesy::lon_near(lon, row[1]) - row[1]) * row[2].to_radians().cos();
        assert!(across.hypot(lat - row[2]) < 1e-10, "{row:?}: {lon} {lat}");
    }
}

#[test]
fn egm96_heights_agree_with_the_grid_read_by_hand() {
    let converter = HeightConverter::new(VerticalDatum::Egm96).unwrap();
    for row in rows(include_str!("reference/egm96.txt")) {
        let geoid = converter.ellipsoid_from_datum(row[0], row[1], 0.0).unwrap();
        assert!((geoid - row[2]).abs() < 2e-4, "{row:?}: {geoid}");
        let height = converter.datum_from_ellipsoid(row[0], row[1], 100.0).unwrap();
        assert!((height - (100.0 - row[2])).abs() < 2e-4, "{row:?}: {height}");
    }
}

#[test]
fn a_grid_of_the_users_is_read_where_it_has_values_and_nowhere_else() {
    let path = std::env::temp_dir().join(format!("skysweep-geoid-{}.gtx", std::process::id()));
    // GTX: south, west, steps in degrees, rows, columns, then values from the south-west, all
    // big-endian.
    let mut bytes: Vec<u8> = [10.0_f64, 20.0, 1.0, 1.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([2_i32, 3].iter().flat_map(|v| v.to_be_bytes()));
    bytes.extend([1.0_f32, 2.0, 3.0, 1.0, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()));
    std::fs::write(&path, bytes).unwrap();
    let converter = HeightConverter::with_grid(VerticalDatum::Egm2008, &path).unwrap();
    let (inside, outside) =
        (converter.datum_from_ellipsoid(20.5, 10.5, 50.0), converter.datum_from_ellipsoid(30.0, 10.5, 50.0));
    std::fs::remove_file(&path).unwrap();
    assert!((inside.unwrap() - 48.5).abs() < 1e-6);
    assert!(outside.is_err());
}

#[test]
fn transverse_mercator_is_what_proj_makes_of_the_same_definition() {
    for (lon, lat, scale) in [(4.36, 52.0, 1.0), (-81.66, 30.34, 1.000_2), (179.999, -33.0, 0.9996), (15.0, 78.2, 1.0)]
    {
        let own = TransverseMercator::new(lon, lat, scale).unwrap();
        let proj = MapProjection::from_definition(&own.wkt()).unwrap();
        for (dx, dy) in [(0.0, 0.0), (1e-3, 2e-3), (-0.3, 0.2), (2.9, -4.0)] {
            let (a, b) =
                (own.map_from_lonlat(lon + dx, lat + dy).unwrap(), proj.map_from_lonlat(lon + dx, lat + dy).unwrap());
            assert!((a.x - b.x).abs() < 1e-6 && (a.y - b.y).abs() < 1e-6, "{lon} {lat} {dx} {dy}: {a:?} {b:?}");
        }
    }
}
