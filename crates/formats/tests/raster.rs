//! Rasters are written and read back, damaged files are refused with a reason, and real images
//! open.

use std::path::PathBuf;

use camera::Rpc;
use crs::{Crs, VerticalDatum};
use formats::SaveError;
use formats::raster::{
    Band, BandData, CogRaster, ImageSource, LumaRule, Provenance, RasterError, SampleType, read_dem, read_dem_window,
    write_cog, write_image_with_rpc, write_map_with_rpc, write_png_gray, write_png_rgb,
};
use raster::{FLAG_NO_DATA, FLAG_OUTSIDE, FLAG_SATURATED, GeoTransform, Grid, Window};

fn heights(width: usize, height: usize) -> Grid<f32> {
    let value = |i: usize| if i % 17 == 3 { f32::NAN } else { (i % width) as f32 * 0.25 + (i / width) as f32 };
    Grid::from_vec(width, height, (0..width * height).map(value).collect()).unwrap()
}

fn same(a: &Grid<f32>, b: &Grid<f32>) -> bool {
    a.data().iter().zip(b.data()).all(|(x, y)| x == y || (x.is_nan() && y.is_nan())) && a.width() == b.width()
}

/// An RPC whose numbers need all digits of a double.
fn rpc() -> Rpc {
    let series = |seed: f64| std::array::from_fn(|i| (seed + i as f64).sin() / 3.0 * 10_f64.powi(-(i as i32) / 2));
    Rpc {
        line_off: 19_999.123_456_789_1,
        samp_off: -0.1 + 0.3,
        lat_off: 30.34 / 3.0,
        long_off: -81.66,
        height_off: 10.0,
        line_scale: 512.5,
        samp_scale: 511.5,
        lat_scale: 0.01,
        long_scale: 0.012,
        height_scale: 500.0,
        line_num: series(1.0),
        line_den: series(2.0),
        samp_num: series(3.0),
        samp_den: series(4.0),
        err_bias_m: Some(1.5),
        err_rand_m: None,
    }
}

/// A surface with −9999 in its voids is refused where the file does not declare the value, and read
/// where it does.
#[test]
fn a_no_data_value_that_is_not_declared_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut grid = heights(40, 30);
    grid.data_mut().iter_mut().for_each(|h| *h = if h.is_nan() { 200.0 } else { *h });
    (0..40).for_each(|column| grid[(column, 7)] = -9999.0);
    let bands = [Band { description: "height_m", data: BandData::F32(&grid) }];
    let of = |no_data: Option<f64>| {
        let path = folder.path().join("surface.tif");
        let place = GeoTransform::north_up(436_000.0, 3_358_000.0, 0.5);
        let surface = CogRaster { no_data, ..CogRaster::new(&bands, place, Crs::ellipsoidal(32617)) };
        write_cog(&path, &surface, true).unwrap();
        read_dem(&path)
    };
    let error = of(None).unwrap_err();
    assert!(matches!(error, RasterError::UndeclaredNoData { value: -9999.0, cells: 40, .. }), "{error}");
    assert!(error.to_string().contains("surface.tif"), "{error}");
    let dem = of(Some(-9999.0)).unwrap();
    assert_eq!(dem.heights.data().iter().filter(|h| h.is_nan()).count(), 40);
}

fn shared(name: &str) -> Option<PathBuf> {
    testing::shared_data(&format!("stereo/{name}"))
}

#[test]
fn a_cog_reads_back_with_its_place_and_datum() {
    let folder = tempfile::tempdir().unwrap();
    let grid = heights(700, 300);
    let bands = [Band { description: "height_m", data: BandData::F32(&grid) }];
    let place = GeoTransform::north_up(436_000.5, 3_358_000.0, 0.5);
    for (name, horizontal, vertical) in [
        ("ellipsoid", 32617, VerticalDatum::Ellipsoid),
        ("egm96", 32617, VerticalDatum::Egm96),
        ("egm2008", 5041, VerticalDatum::Egm2008),
        ("degrees", 4326, VerticalDatum::Ellipsoid),
    ] {
        let path = folder.path().join(format!("{name}.tif"));
        write_cog(&path, &CogRaster::new(&bands, place, Crs { horizontal, vertical }), false).unwrap();
        let dem = read_dem(&path).unwrap();
        assert!(same(&dem.heights, &grid), "{name}");
        assert_eq!(dem.geotransform, place);
        assert_eq!((dem.horizontal_epsg, dem.vertical), (Some(horizontal), Some(vertical)), "{name}");
        assert_eq!(dem.no_data, Some(-32768.0));
    }
    let part =
        read_dem_window(folder.path().join("egm96.tif"), Window { x: 690, y: -5, width: 50, height: 15 }).unwrap();
    assert_eq!((part.heights.width(), part.heights.height()), (10, 10));
    assert_eq!(part.geotransform.map_from_cell(0.0, 0.0), place.map_from_cell(690.0, 0.0));
    assert_eq!(part.heights[(0, 0)], grid[(690, 0)]);
    let leftovers = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(leftovers, 4, "expected nothing but the four outputs");
}

#[test]
fn the_same_raster_gives_the_same_bytes_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let grid = heights(1500, 1100);
    let bands = [Band { description: "height_m", data: BandData::F32(&grid) }];
    let mut raster = CogRaster::new(&bands, GeoTransform::north_up(0.0, 0.0, 1.0), Crs::ellipsoidal(32631));
    let bytes: Vec<_> = [1, 2, 5]
        .map(|threads| {
            raster.threads = threads;
            let path = folder.path().join(format!("{threads}.tif"));
            write_cog(&path, &raster, false).unwrap();
            std::fs::read(path).unwrap()
        })
        .into();
    assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2]);
}

#[test]
fn nothing_is_replaced_without_leave_and_failures_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.tif");
    std::fs::write(&path, "mine").unwrap();
    let (small, large) = (Grid::filled(3, 3, 1_u8), Grid::filled(4, 3, 1_u8));
    let place = GeoTransform::north_up(0.0, 0.0, 1.0);
    let crs = Crs::ellipsoidal(32631);
    let one = [Band { description: "a", data: BandData::U8(&small) }];
    let uneven = [one[0], Band { description: "b", data: BandData::U8(&large) }];
    assert!(matches!(
        write_cog(&path, &CogRaster::new(&one, place, crs), false),
        Err(RasterError::NotWritten(SaveError::Exists { .. }))
    ));
    let error = write_cog(&path, &CogRaster::new(&uneven, place, crs), true);
    assert!(matches!(error, Err(RasterError::InconsistentBands { .. })));
    let error = write_cog(&path, &CogRaster::new(&[], place, crs), true);
    assert!(matches!(error, Err(RasterError::InconsistentBands { .. })));
    let error = write_cog(&path, &CogRaster::new(&one, place, Crs::ellipsoidal(1)), true);
    assert!(matches!(error, Err(RasterError::Crs { .. })));
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    write_cog(&path, &CogRaster::new(&one, place, crs), true).unwrap();
    assert_eq!(ImageSource::open(&path).unwrap().info().sample, SampleType::U8);
    let nowhere = folder.path().join("no/such/folder/out.tif");
    let error = write_cog(&nowhere, &CogRaster::new(&one, place, crs), false);
    assert!(matches!(error, Err(RasterError::NotWritten(SaveError::Unwritable { .. }))));
    assert!(matches!(
        write_cog(folder.path(), &CogRaster::new(&one, place, crs), true),
        Err(RasterError::NotWritten(SaveError::Unwritable { .. }))
    ));
}

#[test]
fn an_image_keeps_its_rpc_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("view.tif");
    let pixels = Grid::from_vec(40, 30, (0..1200_u16).map(|i| i * 7).collect()).unwrap();
    let rpc = rpc();
    write_image_with_rpc(&path, &[Band { description: "pan", data: BandData::U16(&pixels) }], &rpc, Some(0.0), false)
        .unwrap();
    let source = ImageSource::open(&path).unwrap();
    let items = source.metadata("RPC");
    let number = |key: &str| -> Vec<f64> {
        let (_, text) = items.iter().find(|(k, _)| k == key).unwrap();
        text.split_whitespace().map(|t| t.parse().unwrap()).collect()
    };
    // GDAL prints 15 significant digits when it turns the tag into text; the tag itself is checked
    // below.
    assert!((number("LINE_OFF")[0] - rpc.line_off).abs() < 1e-9);
    let mut tags = tiff::decoder::Decoder::new(std::fs::File::open(&path).unwrap()).unwrap();
    let tag = tags.get_tag_f64_vec(tiff::tags::Tag::Unknown(50844)).unwrap();
    let expected: Vec<f64> = [1.5, -1.0, rpc.line_off, rpc.samp_off, rpc.lat_off, rpc.long_off, rpc.height_off]
        .into_iter()
        .chain([rpc.line_scale, rpc.samp_scale, rpc.lat_scale, rpc.long_scale, rpc.height_scale])
        .chain([rpc.line_num, rpc.line_den, rpc.samp_num, rpc.samp_den].concat())
        .collect();
    assert_eq!(tag, expected);
    let tile = source.read_luma(source.window()).unwrap();
    assert_eq!(tile.flags[(0, 0)], FLAG_NO_DATA);
    assert_eq!(tile.luma[(5, 2)], f32::from(pixels[(5, 2)]));
    assert_eq!(source.info().geotransform, None);
}

/// A result in the pixels of an image has the RPC of the image, and says what it is.
#[test]
fn a_map_with_an_rpc_names_its_unit_and_sources() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("heights.tif");
    let heights = Grid::from_vec(3, 1, vec![2.0_f32, f32::NAN, 4.0]).unwrap();
    let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
    let provenance = Provenance { sources: vec!["left.tif".to_owned()], acquired: Vec::new() };
    write_map_with_rpc(&path, &bands, &rpc(), Some(-32768.0), &provenance, false).unwrap();
    let source = ImageSource::open(&path).unwrap();
    let items = source.metadata("");
    let has = |key: &str, value: &str| items.iter().any(|(k, v)| k == key && v.starts_with(value));
    assert!(has("SOURCES", "left.tif") && has("TIFFTAG_SOFTWARE", "skysweep"), "{items:?}");
    assert!(source.metadata("RPC").iter().any(|(key, _)| key == "LINE_OFF"));
    assert!(source.read_samples(1, source.window()).unwrap()[(1, 0)].is_nan());
}

#[test]
fn windows_reach_outside_and_flags_do_not_depend_on_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("view.tif");
    let mut pixels = Grid::filled(20, 10, 100_u8);
    for (c, r) in [(4, 4), (5, 4), (4, 5), (5, 5)] {
        pixels[(c, r)] = 255;
    }
    pixels[(12, 3)] = 255;
    pixels[(0, 0)] = 7;
    write_image_with_rpc(&path, &[Band { description: "pan", data: BandData::U8(&pixels) }], &rpc(), Some(7.0), false)
        .unwrap();
    let source = ImageSource::open(&path).unwrap();
    let whole = source.read_luma(Window { x: -3, y: -2, width: 30, height: 20 }).unwrap();
    assert_eq!(whole.flags[(0, 0)], FLAG_OUTSIDE);
    assert_eq!(whole.flags[(3, 2)], FLAG_NO_DATA);
    assert!(whole.luma[(3, 2)].is_nan() && whole.luma[(0, 0)].is_nan());
    assert_eq!(whole.flags[(3 + 5, 2 + 5)], FLAG_SATURATED);
    assert_eq!((whole.flags[(3 + 12, 2 + 3)], whole.luma[(3 + 12, 2 + 3)]), (0, 255.0));
    for y in -2..12_i64 {
        for x in -3..22_i64 {
            let one = source.read_luma(Window { x, y, width: 1, height: 1 }).unwrap();
            assert_eq!(one.flags[(0, 0)], whole.flags[((x + 3) as usize, (y + 2) as usize)], "{x} {y}");
        }
    }
    let far = source.read_luma(Window { x: 1000, y: 1000, width: 2, height: 2 }).unwrap();
    assert!(far.flags.data().iter().all(|&f| f == FLAG_OUTSIDE));
    let extreme = source.read_luma(Window { x: i64::MAX - 1, y: i64::MIN, width: 4, height: 1 }).unwrap();
    assert!(extreme.flags.data().iter().all(|&f| f == FLAG_OUTSIDE));
}

#[test]
fn colour_becomes_luma() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rgb.png");
    write_png_rgb(&path, &Grid::filled(4, 3, [200, 100, 50]), false).unwrap();
    let source = ImageSource::open(&path).unwrap();
    assert_eq!(source.info().luma, LumaRule::Rgb([1, 2, 3]));
    let tile = source.read_luma(source.window()).unwrap();
    let expected = 0.299 * 200.0 + 0.587 * 100.0 + 0.114 * 50.0;
    assert!(tile.luma.data().iter().all(|v| (v - expected).abs() < 1e-4));
    write_png_gray(folder.path().join("gray.png"), &Grid::filled(4, 3, 9_u8), false).unwrap();
    assert!(write_png_gray(folder.path().join("gray.png"), &Grid::filled(4, 3, 9_u8), false).is_err());
    assert!(write_png_gray(folder.path().join("none.png"), &Grid::filled(0, 3, 9_u8), false).is_err());
}

#[test]
fn what_cannot_be_read_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("notes.tif");
    std::fs::write(&text, "no image at all").unwrap();
    let missing = ImageSource::open(folder.path().join("absent.tif")).err().unwrap();
    assert!(matches!(missing, RasterError::Unreadable { .. }), "{missing}");
    let error = ImageSource::open(&text).err().unwrap();
    assert!(matches!(error, RasterError::NotARaster { .. }) && error.to_string().ends_with("notes.tif"), "{error}");
    for name in [
        "/vsicurl/https://example.org/a.tif",
        "https://example.org/a.tif",
        "/vsizip//vsicurl/http://x/a.zip",
        "/vsis3/b/a.tif",
    ] {
        assert!(matches!(ImageSource::open(name), Err(RasterError::NotLocal { .. })), "{name}");
    }
    let good = folder.path().join("good.tif");
    let noise =
        Grid::from_vec(512, 512, (0..512 * 512_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u16).collect())
            .unwrap();
    write_image_with_rpc(&good, &[Band { description: "pan", data: BandData::U16(&noise) }], &rpc(), None, false)
        .unwrap();
    let bytes = std::fs::read(&good).unwrap();
    for keep in [10, 200, bytes.len() / 2, bytes.len() - 100] {
        let cut = folder.path().join(format!("cut{keep}.tif"));
        std::fs::write(&cut, &bytes[..keep]).unwrap();
        let read = ImageSource::open(&cut).and_then(|s| s.read_luma(s.window()));
        let error = read.err().unwrap_or_else(|| panic!("{keep} of {} bytes were enough", bytes.len()));
        assert!(matches!(error, RasterError::NotARaster { .. } | RasterError::Damaged { .. }), "{keep}: {error}");
        assert!(error.to_string().contains("cut"), "{error}");
    }
}

#[test]
fn a_description_that_names_the_network_fetches_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let address = listener.local_addr().unwrap();
    let vrt = folder.path().join("trap.vrt");
    for source in [
        format!("/vsicurl/http://{address}/a.tif"),
        format!("NETCDF:&quot;http://{address}/a.nc&quot;:z"),
        format!("http://{address}/a.tif"),
        format!("/vsis3/bucket/a.tif?endpoint={address}"),
    ] {
        let band = format!(
            r#"<VRTRasterBand dataType="Byte" band="1"><SimpleSource><SourceFilename>{source}</SourceFilename>
            <SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>"#
        );
        std::fs::write(&vrt, format!(r#"<VRTDataset rasterXSize="4" rasterYSize="4">{band}</VRTDataset>"#)).unwrap();
        assert!(ImageSource::open(&vrt).and_then(|s| s.read_luma(s.window())).is_err(), "{source}");
    }
    let wms = folder.path().join("trap.xml");
    let service =
        format!("<GDAL_WMS><Service name=\"TMS\"><ServerUrl>http://{address}/${{z}}</ServerUrl></Service></GDAL_WMS>");
    std::fs::write(&wms, service).unwrap();
    assert!(ImageSource::open(&wms).is_err());
    assert!(listener.accept().is_err(), "expected no connection");
}

#[test]
fn real_images_and_models_open() {
    if let Some(path) = shared("s2p_pair/img_01.tif") {
        let source = ImageSource::open(path).unwrap();
        assert_eq!((source.info().width, source.info().height, source.info().sample), (1024, 1024, SampleType::U16));
        let tile = source.read_luma(Window { x: 1000, y: 1000, width: 48, height: 48 }).unwrap();
        assert!(tile.luma[(0, 0)] > 0.0 && tile.flags[(30, 30)] == FLAG_OUTSIDE);
        assert!(source.metadata("RPC").iter().any(|(key, _)| key == "LINE_OFF"));
        assert!(source.reopen().is_ok());
    }
    if let Some(path) = shared("jax_068/truth/JAX_068_DSM_georef.tif") {
        let dem = read_dem(path).unwrap();
        assert_eq!((dem.heights.width(), dem.horizontal_epsg, dem.vertical), (512, Some(32617), None));
    }
    if let Some(path) = shared("peers/cars_pair_dem_0.5m.tif") {
        let dem = read_dem(path).unwrap();
        assert_eq!(dem.horizontal_epsg, Some(32740));
        assert!(dem.heights.data().iter().any(|h| h.is_nan()) && dem.heights.data().iter().all(|h| *h != -32768.0));
    }
}
