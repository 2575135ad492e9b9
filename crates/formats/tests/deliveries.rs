//! Files of the shape in which vendors deliver: tiles that are one image, and RPCs in the vendor's
//! own file beside them. Each holds the first view of the sample town, so that pixels and cameras
//! can be compared with it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use camera::{ImagePoint, Rpc};
use formats::raster::{Band, BandData, ImageSource, write_map};
use formats::rpc::{RpcFormat, read_for_image};
use raster::{Grid, Window};
use tempfile::TempDir;

/// Columns and rows of the first tile; those of the last column and row are smaller.
const TILE: [usize; 2] = [448, 512];

fn town() -> (ImageSource, Rpc) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town/view_1.tif");
    let rpc = formats::rpc::read(&path).unwrap().rpc;
    (ImageSource::open(&path).unwrap(), rpc)
}

/// Writes a part of the town as a plain TIFF without RPC.
fn write_part(path: &Path, window: Window) {
    let samples = town().0.read_samples(1, window).unwrap();
    let pixels: Grid<u16> = samples.map(|value| *value as u16);
    write_map(path, &[Band { description: "", data: BandData::U16(&pixels) }], None, &[], false).unwrap();
}

/// Writes the town as two by two tiles, and returns their windows, row by row.
fn write_tiles(name: impl Fn(usize, usize) -> PathBuf) -> Vec<(usize, usize, Window)> {
    let info = town().0.info().clone();
    let (columns, rows) = ([0, TILE[0], info.width], [0, TILE[1], info.height]);
    let mut tiles = Vec::new();
    for row in 0..2 {
        for column in 0..2 {
            let (x, y) = (columns[column], rows[row]);
            let (width, height) = (columns[column + 1] - x, rows[row + 1] - y);
            let window = Window { x: x as i64, y: y as i64, width, height };
            write_part(&name(row + 1, column + 1), window);
            tiles.push((row + 1, column + 1, window));
        }
    }
    tiles
}

/// Checks that a file is the town, pixel by pixel, seen by its camera.
fn is_the_town(path: &Path) {
    let (town, rpc) = town();
    let image = ImageSource::open(path).unwrap();
    assert_eq!((image.info().width, image.info().height), (town.info().width, town.info().height));
    let window = town.window();
    let same = image.read_samples(1, window).unwrap() == town.read_samples(1, window).unwrap();
    assert!(same, "{} has other pixels", path.display());
    is_the_camera(&read_for_image(path).unwrap().rpc, &rpc);
}

fn is_the_camera(found: &Rpc, rpc: &Rpc) {
    for (sample, line) in [(10.0, 20.0), (300.0, 100.0), (200.0, 350.0)] {
        let ground = rpc.localize(ImagePoint::new(sample, line), rpc.height_off).unwrap();
        let at = found.project(ground).unwrap();
        let off = (at.sample - sample).hypot(at.line - line);
        assert!(off < 1e-6, "the camera is off by {off} px");
    }
}

/// WorldView, GeoEye, QuickBird: `NAME.TIL` lists the tiles `NAME_R1C1.TIF` …, `NAME.RPB` and
/// `NAME.IMD` lie beside it.
#[test]
fn tiles_of_worldview_are_one_image() {
    let folder = TempDir::new().unwrap();
    let name = "16JAN01000000-P1BS-000000000010_01_P001";
    let at = |ending: &str| folder.path().join(format!("{name}{ending}"));
    let tiles = write_tiles(|row, column| at(&format!("_R{row}C{column}.TIF")));
    let (town, rpc) = town();
    let mut til = format!("bandId = \"P\"\nnumTiles = {};\ntileSizeX = {};\n", tiles.len(), TILE[0]);
    let _ = writeln!(til, "tileSizeY = {};\ntileUnits = \"Pixels\";\ntileOverlap = 0;", TILE[1]);
    for (number, (row, column, window)) in (1..).zip(&tiles) {
        let (right, lower) = (window.x + window.width as i64 - 1, window.y + window.height as i64 - 1);
        let _ = writeln!(
            til,
            "BEGIN_GROUP = TILE_{number}\n\tfilename = \"{name}_R{row}C{column}.TIF\";\n\tULColOffset = {};\n\
             \tULRowOffset = {};\n\tURColOffset = {right};\n\tURRowOffset = {};\n\tLRColOffset = {right};\n\
             \tLRRowOffset = {lower};\n\tLLColOffset = {};\n\tLLRowOffset = {lower};\nEND_GROUP = TILE_{number}",
            window.x, window.y, window.y, window.x
        );
    }
    std::fs::write(at(".TIL"), til + "END;\n").unwrap();
    let imd = format!(
        "version = \"28.3\";\nnumRows = {};\nnumColumns = {};\nbandId = \"P\";\nbitsPerPixel = 16;\n\
         BEGIN_GROUP = IMAGE_1\n\tsatId = \"WV03\";\n\tfirstLineTime = 2016-01-01T14:05:10.123456Z;\n\
         \tmeanSunAz = 143.2;\n\tmeanSunEl = 61.5;\nEND_GROUP = IMAGE_1\nEND;\n",
        town.info().height,
        town.info().width
    );
    std::fs::write(at(".IMD"), imd).unwrap();
    formats::rpc::write(&at(".RPB"), &rpc, RpcFormat::Rpb, false).unwrap();
    is_the_town(&at(".TIL"));
    let image = ImageSource::open(at(".TIL")).unwrap();
    assert_eq!(image.satellite().as_deref(), Some("WV03"));
    assert_eq!(image.sun().map(|sun| (sun.azimuth_deg, sun.elevation_deg)), Some((143.2, 61.5)));
    assert!(image.acquired_s().is_some_and(|time| time / 3600 == 1_451_656_800 / 3600), "{:?}", image.acquired_s());
}

/// Pléiades, Pléiades Neo, SPOT: `DIM_NAME.XML` lists the tiles `IMG_NAME_R1C1.TIF` …, the RPC is
/// in `RPC_NAME.XML` and counts pixels from 1, or from 0 for Pléiades Neo.
#[test]
fn tiles_of_pleiades_are_one_image() {
    for (profile, first, domain) in
        [("PHR_SENSOR", 1.0, "Direct_Model_Validity_Domain"), ("PNEO_SENSOR", 0.0, "ImagetoGround_Validity_Domain")]
    {
        let folder = TempDir::new().unwrap();
        let name = "PNEO3_202401010000000_PAN_SEN_PWOI_000000000_1_1_F_1";
        let at = |file: String| folder.path().join(file);
        let tiles = write_tiles(|row, column| at(format!("IMG_{name}_R{row}C{column}.TIF")));
        let (town, rpc) = town();
        let files: String = tiles
            .iter()
            .map(|(row, column, _)| {
                format!(
                    "<Data_File tile_R=\"{row}\" tile_C=\"{column}\"><DATA_FILE_PATH \
                     href=\"IMG_{name}_R{row}C{column}.TIF\"/></Data_File>"
                )
            })
            .collect();
        let head = format!(
            "<Metadata_Identification><METADATA_FORMAT version=\"2.15\">DIMAP</METADATA_FORMAT>\
             <METADATA_PROFILE>{profile}</METADATA_PROFILE></Metadata_Identification>"
        );
        let dim = format!(
            "<?xml version=\"1.0\"?><Dimap_Document>{head}<Raster_Data><Data_Access>\
             <DATA_FILE_FORMAT>image/tiff</DATA_FILE_FORMAT><Data_Files>{files}</Data_Files></Data_Access>\
             <Raster_Dimensions><NROWS>{}</NROWS><NCOLS>{}</NCOLS><NBANDS>1</NBANDS><Tile_Set><NTILES>4</NTILES>\
             <Regular_Tiling><NTILES_SIZE nrows=\"{}\" ncols=\"{}\"/><NTILES_COUNT ntiles_R=\"2\" ntiles_C=\"2\"/>\
             <OVERLAP_ROW>0</OVERLAP_ROW><OVERLAP_COL>0</OVERLAP_COL></Regular_Tiling></Tile_Set></Raster_Dimensions>\
             <Raster_Encoding><DATA_TYPE>INTEGER</DATA_TYPE><NBITS>16</NBITS><SIGN>UNSIGNED</SIGN></Raster_Encoding>\
             </Raster_Data></Dimap_Document>",
            town.info().height,
            town.info().width,
            TILE[1],
            TILE[0]
        );
        std::fs::write(at(format!("DIM_{name}.XML")), dim).unwrap();
        std::fs::write(at(format!("RPC_{name}.XML")), dimap_rpc(&rpc, &head, first, domain)).unwrap();
        is_the_town(&at(format!("DIM_{name}.XML")));
        // The first tile alone begins where the image begins, so the RPC is its own.
        is_the_camera(&read_for_image(&at(format!("IMG_{name}_R1C1.TIF"))).unwrap().rpc, &rpc);
        // Another tile has it moved to its own first pixel.
        let mut moved = rpc.clone();
        moved.samp_off -= TILE[0] as f64;
        is_the_camera(&read_for_image(&at(format!("IMG_{name}_R1C2.TIF"))).unwrap().rpc, &moved);
    }
}

/// Writes an RPC as DIMAP does; `first` is the number of the first pixel, in the element `domain`.
fn dimap_rpc(rpc: &Rpc, head: &str, first: f64, domain: &str) -> String {
    let mut values = String::new();
    for (name, poly) in [
        ("SAMP_NUM", &rpc.samp_num),
        ("SAMP_DEN", &rpc.samp_den),
        ("LINE_NUM", &rpc.line_num),
        ("LINE_DEN", &rpc.line_den),
    ] {
        for (number, value) in (1..).zip(poly) {
            let _ = write!(values, "<{name}_COEFF_{number}>{value:e}</{name}_COEFF_{number}>");
        }
    }
    let scalars = [
        ("LONG_SCALE", rpc.long_scale),
        ("LONG_OFF", rpc.long_off),
        ("LAT_SCALE", rpc.lat_scale),
        ("LAT_OFF", rpc.lat_off),
        ("HEIGHT_SCALE", rpc.height_scale),
        ("HEIGHT_OFF", rpc.height_off),
        ("SAMP_SCALE", rpc.samp_scale),
        ("SAMP_OFF", rpc.samp_off + first),
        ("LINE_SCALE", rpc.line_scale),
        ("LINE_OFF", rpc.line_off + first),
    ];
    let validity: String = scalars.iter().map(|(name, value)| format!("<{name}>{value}</{name}>")).collect();
    format!(
        "<?xml version=\"1.0\"?><Dimap_Document>{head}<Rational_Function_Model><Global_RFM><Inverse_Model>{values}\
         </Inverse_Model><RFM_Validity><{domain}><FIRST_ROW>{first}</FIRST_ROW>\
         <FIRST_COL>{first}</FIRST_COL></{domain}>{validity}</RFM_Validity></Global_RFM>\
         </Rational_Function_Model></Dimap_Document>"
    )
}

/// SkySat: an RPC text named after the image. ZY-3 and GaoFen: `.rpb` or `_rpc.txt`, in small
/// letters.
#[test]
fn files_of_skysat_and_zy3_have_their_rpc_beside_them() {
    let (town, rpc) = town();
    for (image, side, format) in [
        (
            "20200101_101010_ssc6d1_0001_basic_panchromatic_dn.tif",
            "20200101_101010_ssc6d1_0001_basic_panchromatic_dn_RPC.TXT",
            RpcFormat::Text,
        ),
        ("zy302a_nad_016497_003126_20190520.tiff", "zy302a_nad_016497_003126_20190520.rpb", RpcFormat::Rpb),
        ("ZY3_TLC_E110.0_N34.5-NAD.tif", "ZY3_TLC_E110.0_N34.5-NAD_rpc.txt", RpcFormat::Text),
    ] {
        let folder = TempDir::new().unwrap();
        write_part(&folder.path().join(image), town.window());
        formats::rpc::write(&folder.path().join(side), &rpc, format, false).unwrap();
        is_the_town(&folder.path().join(image));
    }
}
