//! Clouds of surfaces are read back with the crate `las`, with our reader, and node by node.

use std::collections::BTreeMap;
use std::time::{Duration, UNIX_EPOCH};

use crs::{Crs, VerticalDatum};
use las::{Header, Point, PointDataBuilder, Reader};
use raster::{GeoTransform, Grid};

use super::cloud_file::{CloudFormat, write_cloud};
use super::surface_cloud::{CloudExtent, SurfaceCloud};
use crate::points::PointCloud;

const SIZE: (usize, usize) = (700, 300);

/// Rasters whose cells tell their place.
struct Rasters {
    heights: Grid<f32>,
    sigma_m: Grid<f32>,
    confidence: Grid<f32>,
    views: Grid<u8>,
    source: Grid<u8>,
    colours: Grid<[u16; 3]>,
    classes: Grid<u8>,
}

fn grid<T>(of: impl Fn(usize, usize) -> T) -> Grid<T> {
    let cells = (0..SIZE.0 * SIZE.1).map(|i| of(i % SIZE.0, i / SIZE.0)).collect();
    Grid::from_vec(SIZE.0, SIZE.1, cells).unwrap()
}

impl Rasters {
    fn new() -> Self {
        Self {
            heights: grid(|c, r| if c % 50 == 7 { f32::NAN } else { 20.0 + 0.01 * c as f32 + 0.1 * r as f32 }),
            sigma_m: grid(|c, r| (c + r) as f32 * 0.001),
            confidence: grid(|c, _| c as f32 / SIZE.0 as f32),
            views: grid(|c, _| (c % 5) as u8),
            source: grid(|c, r| if c > 600 && r > 200 { 2 } else { 1 }),
            colours: grid(|c, r| [c as u16, r as u16, 65_535]),
            classes: grid(|c, _| if c % 2 == 0 { 2 } else { 1 }),
        }
    }

    fn write(&self, path: &std::path::Path, format: CloudFormat, observed_only: bool) -> CloudExtent {
        let geotransform = GeoTransform::north_up(431_000.1, 3_358_000.0, 0.5);
        self.write_at((geotransform, 32617), path, format, observed_only)
    }

    fn write_at(
        &self,
        (geotransform, horizontal): (GeoTransform, u32),
        path: &std::path::Path,
        format: CloudFormat,
        observed_only: bool,
    ) -> CloudExtent {
        let cloud = SurfaceCloud {
            geotransform,
            crs: Crs { horizontal, vertical: VerticalDatum::Egm96 },
            in_degrees: horizontal == 4326,
            heights: &self.heights,
            sigma_m: &self.sigma_m,
            confidence: &self.confidence,
            views: &self.views,
            source: &self.source,
            colours: &self.colours,
            classes: &self.classes,
            observed_only,
            created: UNIX_EPOCH + Duration::from_secs(1_795_400_000),
        };
        write_cloud(path, &cloud, format, false).unwrap()
    }
}

/// Reads the header and all points of a file.
fn read(path: &std::path::Path) -> (Header, Vec<Point>) {
    let mut reader = Reader::from_path(path).unwrap();
    let header = reader.header().clone();
    let mut batch = PointDataBuilder::new().for_header(&header).build();
    reader.fill_points(header.number_of_points(), &mut batch).unwrap();
    let points = batch.points().map(|point| point.unwrap()).collect();
    (header, points)
}

#[test]
fn points_have_the_values_of_their_cells() {
    let rasters = Rasters::new();
    let folder = tempfile::tempdir().unwrap();
    for (name, format, observed_only) in
        [("a.laz", CloudFormat::Laz, true), ("b.laz", CloudFormat::Laz, false), ("c.laz", CloudFormat::Copc, false)]
    {
        let path = folder.path().join(name);
        let extent = rasters.write(&path, format, observed_only);
        let (header, points) = read(&path);
        assert_eq!((header.number_of_points(), header.point_format().to_u8().unwrap()), (extent.points, 7));
        assert_eq!(header.date().unwrap().to_string(), "2026-11-23");
        assert!(header.generating_software().starts_with("skysweep "));
        let (mut seen, mut synthetic) = (Grid::filled(SIZE.0, SIZE.1, false), 0);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            let cell = (((point.x - 431_000.1) / 0.5) as usize, ((3_358_000.0 - point.y) / 0.5) as usize);
            assert!(!std::mem::replace(&mut seen[cell], true), "{cell:?} twice");
            assert!((point.z - f64::from(rasters.heights[cell])).abs() <= 0.00051);
            let float = |at: usize| f32::from_le_bytes(point.extra_bytes[at..at + 4].try_into().unwrap());
            assert_eq!((float(0), float(4)), (rasters.sigma_m[cell], rasters.confidence[cell]));
            assert_eq!(point.extra_bytes[8..], [rasters.views[cell], rasters.source[cell]]);
            let colour = point.color.unwrap();
            assert_eq!([colour.red, colour.green, colour.blue], rasters.colours[cell]);
            assert_eq!(u8::from(point.classification), rasters.classes[cell]);
            assert_eq!(point.is_synthetic, rasters.source[cell] != 1);
            synthetic += u64::from(point.is_synthetic);
            for (axis, v) in [point.x, point.y, point.z].into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(v), high[axis].max(v));
            }
        }
        assert_eq!((low, high, synthetic), (extent.low, extent.high, extent.synthetic), "{name}");
        let known = |i: &usize| rasters.heights.data()[*i].is_finite();
        let wanted = |i: &usize| known(i) && !(observed_only && rasters.source.data()[*i] != 1);
        assert!((0..SIZE.0 * SIZE.1).all(|i| seen.data()[i] == wanted(&i)), "{name}");
        let own = PointCloud::open(&path).unwrap();
        assert_eq!((own.horizontal_epsg(), own.vertical()), (Some(32617), Some(VerticalDatum::Egm96)));
        assert_eq!(own.positions(1 << 20).unwrap().len() as u64, extent.points);
    }
}

#[test]
fn nodes_hold_the_points_of_their_cubes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.copc.laz");
    let extent = Rasters::new().write(&path, CloudFormat::Copc, true);
    let counts = points_of_nodes(&path, &extent);
    assert!(counts.len() > 4 && counts.iter().all(|points| *points <= 256 * 256), "{counts:?}");
}

/// Heights reach over 35 units and places over a hundredth of one.
#[test]
fn a_map_in_degrees_has_few_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.copc.laz");
    let degrees = (GeoTransform::north_up(-81.7, 30.35, 1e-5), 4326);
    let extent = Rasters::new().write_at(degrees, &path, CloudFormat::Copc, true);
    let counts = points_of_nodes(&path, &extent);
    assert!((3..=12).contains(&counts.len()), "{counts:?}");
}

/// Returns the number of points of each node of a COPC file. The nodes cover all points, each has
/// its parent, and its points lie in it.
fn points_of_nodes(path: &std::path::Path, extent: &CloudExtent) -> Vec<i32> {
    let bytes = std::fs::read(path).unwrap();
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let float = |at: usize| f64::from_bits(long(at));
    assert_eq!(&bytes[377..381], b"copc");
    // The info record begins behind the header of the first record.
    let info = 375 + 54;
    let (centre, half) = ([float(info), float(info + 8), float(info + 16)], float(info + 24));
    let (at, length) = (long(info + 40) as usize, long(info + 48) as usize);
    assert_eq!(at + length, bytes.len());
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let mut nodes = BTreeMap::new();
    for entry in (at..at + length).step_by(32) {
        let key = [0, 4, 8, 12].map(|offset| int(entry + offset));
        nodes.insert(key, (long(entry + 16), int(entry + 24), int(entry + 28)));
    }
    assert_eq!(nodes.values().map(|node| node.2 as u64).sum::<u64>(), extent.points);
    assert!(nodes.keys().filter(|key| key[0] > 0).all(|k| nodes.contains_key(&[
        k[0] - 1,
        k[1] >> 1,
        k[2] >> 1,
        k[3] >> 1
    ])));
    // Chunks follow each other in the order of the file, as the points do.
    let mut in_file: Vec<_> = nodes.iter().filter(|(_, node)| node.2 > 0).collect();
    in_file.sort_by_key(|(_, node)| node.0);
    assert!(in_file.windows(2).all(|pair| pair[0].1.0 + pair[0].1.1 as u64 == pair[1].1.0));
    let mut points = read(path).1.into_iter();
    for (key, node) in in_file {
        let side = 2.0 * half / f64::from(1 << key[0]);
        for point in points.by_ref().take(node.2 as usize) {
            for (axis, v) in [point.x, point.y, point.z].into_iter().enumerate() {
                let begin = centre[axis] - half + f64::from(key[axis + 1]) * side;
                assert!((begin - 1e-6..=begin + side + 1e-6).contains(&v), "{key:?} {axis} {v}");
            }
        }
    }
    assert!(points.next().is_none());
    nodes.values().map(|node| node.2).collect()
}
