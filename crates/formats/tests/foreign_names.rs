//! Nothing that a file names is fetched, and no memory or device is read: a VRT that names an
//! address, a raw pointer or a closed file system has no cells, at any depth.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, Dem, ImageSource, RasterError, read_dem, write_cog};
use raster::{GeoTransform, Grid};

/// Writes a VRT of 8 × 8 cells whose only source has a name.
fn vrt(folder: &Path, name: &str, source: &str) -> PathBuf {
    let text = format!(
        r#"<VRTDataset rasterXSize="8" rasterYSize="8">
  <GeoTransform>500000, 1, 0, 4800000, 0, -1</GeoTransform>
  <VRTRasterBand dataType="Float32" band="1">
    <SimpleSource>
      <SourceFilename relativeToVRT="0">{}</SourceFilename>
      <SourceBand>1</SourceBand>
      <SrcRect xOff="0" yOff="0" xSize="8" ySize="8"/>
      <DstRect xOff="0" yOff="0" xSize="8" ySize="8"/>
    </SimpleSource>
  </VRTRasterBand>
</VRTDataset>"#,
        source.replace('&', "&amp;").replace('<', "&lt;")
    );
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Serves a raster to whoever asks, and counts the connections.
fn server(content: Vec<u8>) -> (u16, Arc<AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let count = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&count);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            counter.fetch_add(1, Ordering::SeqCst);
            let Ok(mut stream) = stream else { continue };
            let mut request = [0; 4096];
            let _ = stream.read(&mut request);
            let head = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\nConnection: close\r\n\r\n", content.len());
            let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&content));
        }
    });
    (port, count)
}

fn plain(folder: &Path) -> PathBuf {
    let path = folder.join("plain.tif");
    let heights = Grid::filled(8, 8, 7.0f32);
    let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
    let place = GeoTransform::north_up(500_000.0, 4_800_000.0, 1.0);
    write_cog(&path, &CogRaster::new(&bands, place, Crs::ellipsoidal(32631)), false).unwrap();
    path
}

#[test]
fn local_sources_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let source = plain(folder.path());
    let made = vrt(folder.path(), "local.vrt", source.to_str().unwrap());
    let nested = vrt(folder.path(), "nested.vrt", made.to_str().unwrap());
    assert!(read_dem(&nested).unwrap().heights.data().iter().all(|h| *h == 7.0));
}

#[test]
fn addresses_inside_files_are_not_fetched() {
    let folder = tempfile::tempdir().unwrap();
    let source = plain(folder.path());
    let (port, connections) = server(std::fs::read(&source).unwrap());
    let url = format!("http://127.0.0.1:{port}/plain.tif");
    let wms = format!("<GDAL_WMS><Service name=\"TMS\"><ServerUrl>{url}</ServerUrl></Service></GDAL_WMS>");
    let names = [
        url.clone(),
        wms,
        format!("/vsicurl/{url}"),
        format!("/vsicurl?url={url}"),
        format!("/vsicurl_streaming/{url}"),
        format!("/vsigzip//vsicurl_streaming/{url}"),
        format!("/vsizip//vsicurl_streaming/{url}"),
        format!("/vsizip/{{/vsicurl_streaming/{url}}}"),
        format!("/vsitar//vsicurl/{url}"),
        format!("/vsisubfile/0,/vsicurl_streaming/{url}"),
        format!("/vsisubfile/0,/vsicurl/{url}"),
        format!("/vsicached?file=/vsicurl/{url}"),
        format!("vrt://{url}"),
        format!("vrt:///vsicurl_streaming/{url}"),
        format!("GTIFF_DIR:1:/vsicurl_streaming/{url}"),
        format!("GTIFF_RAW:/vsicurl/{url}"),
        format!("HDF5:/vsicurl/{url}://x"),
        format!("NETCDF:\"{url}\":x"),
        format!("/vsis3_streaming/127.0.0.1:{port}/plain.tif"),
        format!("/vsis3/bucket/127.0.0.1:{port}/plain.tif"),
        "/vsistdin/".to_owned(),
    ];
    for (number, name) in names.iter().enumerate() {
        let made = vrt(folder.path(), &format!("{number}.vrt"), name);
        let nested = vrt(folder.path(), &format!("{number}_nested.vrt"), made.to_str().unwrap());
        let in_text = std::fs::read_to_string(&made).unwrap();
        let inline = vrt(folder.path(), &format!("{number}_inline.vrt"), &in_text);
        for path in [made, nested, inline] {
            let found: Result<Dem, RasterError> = read_dem(&path);
            assert!(found.is_err(), "{name} was read");
            let _ = ImageSource::open(&path).and_then(|image| image.read_samples(1, image.window()));
        }
    }
    // An auxiliary file may name overviews.
    let aux = format!(
        "<PAMDataset><Metadata domain=\"OVERVIEWS\"><MDI key=\"OVERVIEW_FILE\">/vsicurl_streaming/{url}</MDI></Metadata></PAMDataset>"
    );
    std::fs::write(folder.path().join("plain.tif.aux.xml"), aux).unwrap();
    assert!(read_dem(&source).is_ok());
    assert_eq!(connections.load(Ordering::SeqCst), 0, "something was fetched");
}

/// A raster of the MEM driver has an address in memory as its name.
#[test]
fn addresses_in_memory_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let cells = vec![42.0f32; 64];
    let ours = format!("MEM:::DATAPOINTER={:p},PIXELS=8,LINES=8,BANDS=1,DATATYPE=Float32", cells.as_ptr());
    let wild = "MEM:::DATAPOINTER=0x10,PIXELS=8,LINES=8,BANDS=1,DATATYPE=Float32".to_owned();
    for (number, name) in [ours, wild].iter().enumerate() {
        let made = vrt(folder.path(), &format!("memory_{number}.vrt"), name);
        let nested = vrt(folder.path(), &format!("memory_{number}_nested.vrt"), made.to_str().unwrap());
        assert!(read_dem(&made).is_err() && read_dem(&nested).is_err(), "{name} was read");
        assert!(read_dem(Path::new(name)).is_err());
    }
}

#[test]
fn names_of_the_user_are_local_files() {
    for name in ["http://127.0.0.1:1/a.tif", "/vsicurl/http://127.0.0.1:1/a.tif", "/vsis3/b/a.tif", "s3://b/a.tif"] {
        assert!(matches!(read_dem(name), Err(RasterError::NotLocal { .. })), "{name}");
    }
    assert!(matches!(read_dem("MEM:::x"), Err(RasterError::Unreadable { .. })));
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_no_files() {
    assert!(matches!(read_dem("/dev/zero"), Err(RasterError::NotAFile { .. })));
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.tif");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if made.is_ok_and(|status| status.success()) {
        assert!(matches!(read_dem(&pipe), Err(RasterError::NotAFile { .. })));
    } else {
        testing::skip("mkfifo is not installed");
    }
}

/// GDAL would wait for a pipe for ever, and read a device without end.
#[cfg(unix)]
#[test]
fn pipes_and_devices_inside_a_vrt_are_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.tif");
    if !std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success()) {
        testing::skip("mkfifo is not installed");
        return;
    }
    let full = pipe.to_str().unwrap();
    let names = [
        "/dev/zero".to_owned(),
        "pipe.tif".to_owned(),
        full.to_owned(),
        format!("vrt://{full}?bands=1"),
        format!("GTIFF_DIR:1:{full}"),
        format!("/vsigzip/{full}"),
        format!("/vsisubfile/0,{full}"),
    ];
    for (number, name) in names.iter().enumerate() {
        let made = vrt(folder.path(), &format!("{number}.vrt"), name);
        let nested = vrt(folder.path(), &format!("{number}_nested.vrt"), made.to_str().unwrap());
        let in_text = std::fs::read_to_string(&made).unwrap();
        let inline = vrt(folder.path(), &format!("{number}_inline.vrt"), &in_text);
        let coded = folder.path().join(format!("{number}_coded.vrt"));
        std::fs::write(&coded, in_text.replace("pipe", "&#112;ipe").replace("/dev", "&#x2f;dev")).unwrap();
        for path in [made, nested, inline, coded] {
            let found = read_dem(&path);
            assert!(matches!(found, Err(RasterError::NotAFile { .. })), "{name} in {}: {found:?}", path.display());
        }
    }
}
