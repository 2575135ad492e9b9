//! Good files of every reader, before their mutation. The command writes most of them from a small
//! simulated town. Each lies in a folder of its own, with the files that belong to it.

use std::fs;
use std::path::{Path, PathBuf};

use las::{Builder, Point, Transform, Vector, Version, Writer};

use crate::common::{sample, skysweep};
use crate::readers::Reader;

/// A good file.
#[derive(Debug, Clone)]
pub(crate) struct Seed {
    pub(crate) reader: Reader,
    pub(crate) path: PathBuf,
}

const CSV: &str = "id,lon,lat,heading,height_m\ndoor,4.36,52.01,90,12\nroof,4.361,52.011,0,30.5\n";
const GEOJSON: &str = r#"{"type":"FeatureCollection","features":[
{"type":"Feature","properties":{"id":"a","heading":12.5},"geometry":{"type":"Point","coordinates":[5.4,43.5]}},
{"type":"Feature","properties":{"name":"b","height_m":20},"geometry":{"type":"Point","coordinates":[5.41,43.5,3]}}]}"#;
const GROUND_POINTS: &str = "name,x,y,height,crs,accuracy_m,pixel_px,role,image,sample,line\n\
                             a,691000,4822000,210.5,EPSG:32631+5773,0.1,0.5,control,view_1.tif,120.25,88.5\n\
                             b,691100,4822100,205,EPSG:32631,0.2,,check,view_2.tif,13,77\n";
const GROUND_POINTS_JSON: &str = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "id": "a",
    "geometry": {"type": "Point", "coordinates": [5.4, 43.5, 200]}, "properties": {"accuracy_m": 0.1,
    "role": "check", "images": {"view_1.tif": [100, 120.5], "view_2.tif": [90, 131]}}}]}"#;
const CONTROL: &str = "name,lon,lat,height\nflight_01.png,5.4,43.5,300\nflight_02.png,5.41,43.51,310.5\n";
const SIMILARITY: &str = r#"{"scale": 1.5, "rotation": [1, 0, 0, 0], "translation": [-690000.0, -5336000.0, 0.0], "vertical_offset_m": 45.2}"#;
const TRANSFORMS: &str = r#"{"w": 64, "h": 48, "fl_x": 50, "fl_y": 51, "cx": 30, "cy": 25, "k1": 0.1, "p1": 1e-3,
"camera_model": "OPENCV", "applied_transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "frames": [
{"file_path": "images/a.png", "transform_matrix": [[1,0,0,10],[0,1,0,20],[0,0,1,30],[0,0,0,1]]},
{"file_path": "images/b.png", "transform_matrix": [[0,1,0,10],[-1,0,0,20],[0,0,1,30],[0,0,0,1]]}]}"#;
const GML: &str = r##"<?xml version="1.0"?>
<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:xlink="http://www.w3.org/1999/xlink" xmlns:gen="http://www.opengis.net/citygml/generics/2.0">
<gml:boundedBy><gml:Envelope srsName="urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783"/></gml:boundedBy>
<core:cityObjectMember><bldg:Building gml:id="b"><gen:stringAttribute name="a"><gen:value>x</gen:value></gen:stringAttribute>
<bldg:lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface><gml:surfaceMember xlink:href="#g"/>
<gml:surfaceMember xlink:href="#s"/></gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>
<bldg:boundedBy><bldg:RoofSurface><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>
<gml:Polygon gml:id="g"><gml:exterior><gml:LinearRing><gml:posList srsDimension="3">690000 5336000 10 690010 5336000 10
 690010 5336010 10 690000 5336010 10 690000 5336000 10</gml:posList></gml:LinearRing></gml:exterior><gml:interior>
<gml:LinearRing><gml:posList>690002 5336002 10 690002 5336004 10 690004 5336004 10 690002 5336002 10</gml:posList>
</gml:LinearRing></gml:interior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface>
</bldg:RoofSurface></bldg:boundedBy><bldg:boundedBy><bldg:GroundSurface><bldg:lod2MultiSurface><gml:MultiSurface>
<gml:surfaceMember><gml:Polygon gml:id="s"><gml:exterior><gml:LinearRing><gml:pos>690000 5336000 0</gml:pos>
<gml:pos>690000 5336010 0</gml:pos><gml:pos>690010 5336010 0</gml:pos><gml:pos>690000 5336000 0</gml:pos></gml:LinearRing>
</gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:GroundSurface>
</bldg:boundedBy></bldg:Building></core:cityObjectMember></core:CityModel>"##;

/// Writes the corpus into a folder, which is emptied first.
pub(crate) fn write(home: &Path) -> Vec<Seed> {
    fs::remove_dir_all(home).unwrap();
    fs::create_dir_all(home).unwrap();
    let work = tempfile::tempdir().unwrap();
    make(work.path());
    let made = |name: &str| work.path().join(name);
    let mut corpus = Corpus { home: home.to_owned(), seeds: Vec::new() };
    for name in ["a.rpb", "a.json", "a_RPC.TXT", "a.geom", "a.hdr"] {
        corpus.add(Reader::Rpc, &made(name), &[]);
    }
    corpus.shared_rpcs();
    let vrt = made("v.vrt");
    corpus.add(Reader::Image, &made("town/view_1.tif"), &[]);
    corpus.add(Reader::Image, &vrt, &[&made("town/view_1.tif")]);
    corpus.add(Reader::Dem, &made("town/truth/dsm.tif"), &[]);
    corpus.add(Reader::Dem, &made("out/dsm/dsm.tif"), &[]);
    for name in ["town/truth/buildings.city.json", "m.obj", "m.ply", "m.city.jsonl", "m.gml"] {
        corpus.add(Reader::City, &made(name), &[]);
    }
    for name in ["m.obj", "m.ply", "s.laz"] {
        corpus.add(Reader::Surface, &made(name), &[]);
    }
    corpus.add(Reader::Cloud, &made("s.laz"), &[]);
    corpus.add(Reader::Cloud, &made("s.las"), &[]);
    for folder in ["flight/cameras/sparse/0", "aligned/sparse/0"] {
        let all: Vec<PathBuf> = fs::read_dir(made(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
        let others: Vec<&Path> = all[1..].iter().map(PathBuf::as_path).collect();
        corpus.add(Reader::Colmap, &all[0], &others);
    }
    corpus.text(Reader::Transforms, "transforms.json", TRANSFORMS);
    corpus.text(Reader::Positions, "list.csv", CSV);
    corpus.text(Reader::Positions, "list.geojson", GEOJSON);
    corpus.text(Reader::Control, "control.csv", CONTROL);
    corpus.text(Reader::GroundPoints, "points.csv", GROUND_POINTS);
    corpus.text(Reader::GroundPoints, "points.geojson", GROUND_POINTS_JSON);
    corpus.text(Reader::Similarity, "similarity.json", SIMILARITY);
    corpus.add(Reader::Npy, &made("gv/depth/panorama.npy"), &[]);
    for name in ["gv/depth/panorama.npy", "gv/mask/panorama.png", "map.tif"] {
        corpus.add(Reader::Map, &made(name), &[]);
    }
    for name in ["s.ply", "s.spz", "s.sog", "s.glb"] {
        corpus.add(Reader::Splats, &made(name), &[&made("s.origin.json")]);
    }
    corpus.add(Reader::Corrections, &made("out/report/report.json"), &[]);
    corpus.add(Reader::Report, &made("out/report/report.json"), &[]);
    corpus.add(Reader::Opened, &made("opened.json"), &[]);
    corpus.add(Reader::Scene, &made("town/scene.toml"), &[]);
    corpus.seeds
}

/// Reads the corpus that [`write`] wrote.
pub(crate) fn read(home: &Path) -> Vec<Seed> {
    let text = fs::read_to_string(home.join("index.txt")).unwrap();
    let seed = |line: &str| {
        let (reader, path) = line.split_once(' ').expect("a reader and a path");
        let reader = Reader::ALL.into_iter().find(|r| format!("{r:?}") == reader).expect("a reader");
        Seed { reader, path: home.join(path) }
    };
    text.lines().map(seed).collect()
}

struct Corpus {
    home: PathBuf,
    seeds: Vec<Seed>,
}

impl Corpus {
    /// Adds a file with the files beside it.
    fn add(&mut self, reader: Reader, file: &Path, beside: &[&Path]) {
        let folder = self.home.join(self.seeds.len().to_string());
        fs::create_dir_all(&folder).unwrap();
        for path in [&[file], beside].concat() {
            let copied = fs::copy(path, folder.join(path.file_name().unwrap()));
            copied.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        self.seeds.push(Seed { reader, path: folder.join(file.file_name().unwrap()) });
        let line =
            |seed: &Seed| format!("{:?} {}\n", seed.reader, seed.path.strip_prefix(&self.home).unwrap().display());
        fs::write(self.home.join("index.txt"), self.seeds.iter().map(line).collect::<String>()).unwrap();
    }

    fn text(&mut self, reader: Reader, name: &str, text: &str) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), text).unwrap();
        self.add(reader, &folder.path().join(name), &[]);
    }

    /// Adds files of formats that the command does not write, where the shared data are.
    fn shared_rpcs(&mut self) {
        let Some(root) = testing::shared_data("rpc") else { return };
        for name in [
            "rpcm/rpc_PLEIADES.xml",
            "rpcm/rpc_IKONOS.txt",
            "gdal/autotest/gcore/data/md_dg_2.XML",
            "gdal/autotest/gcore/data/alos/RPC-md_alos.txt",
            "gdal/autotest/gdrivers/data/jpeg2000/RPC_md_pneo.XML",
            "otb/phr_pan.geom",
        ] {
            self.add(Reader::Rpc, &root.join(name), &[]);
        }
    }
}

/// Makes the files with the command.
fn make(folder: &Path) {
    let parameters = fs::read_to_string(sample("scene.toml")).unwrap();
    fs::write(folder.join("scene.toml"), parameters.replace("size_m = 320.0", "size_m = 100.0")).unwrap();
    for line in [
        "simulate scene.toml -o town",
        "simulate scene.toml -o flight --flight 3",
        "dsm town/view_1.tif town/view_3.tif -o out --gsd 1 --preset fast",
        "rpc convert town/view_1.tif -o a.rpb",
        "rpc convert town/view_1.tif -o a.json",
        "rpc convert town/view_1.tif -o a_RPC.TXT",
        "city convert town/truth/buildings.city.json -o m.obj",
        "city convert town/truth/buildings.city.json -o m.ply",
        "heightmap town/truth/dsm.tif --center 5.4 43.53 --size 48 -o map.tif",
        "groundview town/truth/dsm.tif --center 5.4 43.53 --width 64 --crops 1 --crop-size 32 --points 50 -o gv",
        "splats out/dsm/dsm.tif town/view_1.tif -o s.ply",
        "splats convert s.ply s.spz --sh-degree 1 --overwrite",
        "splats convert s.ply s.sog --overwrite",
        "splats convert s.ply s.glb --overwrite",
    ] {
        let arguments: Vec<&str> = line.split(' ').collect();
        skysweep().current_dir(folder).args(arguments).arg("-q").assert().success();
    }
    let rpc = formats::rpc::read(&folder.join("a.json")).unwrap().rpc;
    fs::write(folder.join("a.geom"), geom(&rpc)).unwrap();
    fs::write(folder.join("a.hdr"), envi(&rpc)).unwrap();
    fs::write(folder.join("v.vrt"), vrt(&rpc)).unwrap();
    fs::write(folder.join("m.gml"), GML).unwrap();
    sequence(folder);
    for name in ["s.las", "s.laz"] {
        cloud(&folder.join(name));
    }
    let model = folder.join("flight/cameras/sparse/0");
    let (model, points) = formats::colmap::read_with_points(&model).unwrap();
    let binary = folder.join("aligned/sparse/0");
    fs::create_dir_all(&binary).unwrap();
    formats::colmap::write(&binary, &model, &points, formats::colmap::ColmapEncoding::Binary, true).unwrap();
    let images = [1, 3].map(|i| folder.join(format!("town/view_{i}.tif")));
    let opened = jobs::dsm::open(&jobs::dsm::DsmConfig::new(images.into(), folder.join("none"))).unwrap();
    fs::write(folder.join("opened.json"), serde_json::to_string(&opened).unwrap()).unwrap();
}

/// The numbers of an RPC by OSSIM's names.
fn geom(rpc: &camera::Rpc) -> String {
    let mut out = "type:  ossimRpcModel\npolynomial_format:  B\n".to_owned();
    for (key, value) in [
        ("line_off", rpc.line_off),
        ("samp_off", rpc.samp_off),
        ("lat_off", rpc.lat_off),
        ("long_off", rpc.long_off),
        ("height_off", rpc.height_off),
        ("line_scale", rpc.line_scale),
        ("samp_scale", rpc.samp_scale),
        ("lat_scale", rpc.lat_scale),
        ("long_scale", rpc.long_scale),
        ("height_scale", rpc.height_scale),
    ] {
        out += &format!("{key}:  {value}\n");
    }
    let lists = [
        ("line_num", rpc.line_num),
        ("line_den", rpc.line_den),
        ("samp_num", rpc.samp_num),
        ("samp_den", rpc.samp_den),
    ];
    for (key, list) in lists {
        out.extend(list.iter().enumerate().map(|(i, value)| format!("{key}_coeff_{i:02}:  {value}\n")));
    }
    out
}

/// The numbers of an RPC in the order of ENVI's headers.
fn envi(rpc: &camera::Rpc) -> String {
    let numbers: Vec<String> = rpc.numbers().map(|value| value.to_string()).collect();
    let rest = "0.0, 0.0, 1.0";
    format!(
        "ENVI\nsamples = 8\nlines = 8\nbands = 1\nheader offset = 0\nfile type = ENVI Standard\ndata type = 1\n\
         interleave = bsq\nbyte order = 0\nrpc info = {{\n {}, {rest}}}\n",
        numbers.join(",\n ")
    )
}

/// A virtual raster over the first view with the RPC in its metadata.
fn vrt(rpc: &camera::Rpc) -> String {
    let text = formats::rpc::to_text(rpc, formats::rpc::RpcFormat::Text).unwrap();
    let mut items: std::collections::BTreeMap<String, String> = std::collections::BTreeMap::new();
    for (key, value) in text.lines().filter_map(|line| line.split_once(':')) {
        let value = value.split_whitespace().next().unwrap_or_default();
        let (name, number) = key.rsplit_once('_').unwrap_or((key, ""));
        if number.parse::<u32>().is_ok() {
            let list = items.entry(name.to_owned()).or_default();
            *list += &format!("{value} ");
        } else {
            items.insert(key.to_owned(), value.to_owned());
        }
    }
    let items: String = items.iter().map(|(key, value)| format!("<MDI key=\"{key}\">{value}</MDI>")).collect();
    format!(
        "<VRTDataset rasterXSize=\"100\" rasterYSize=\"90\"><Metadata domain=\"RPC\">{items}</Metadata>\
         <VRTRasterBand dataType=\"UInt16\" band=\"1\"><NoDataValue>0</NoDataValue><SimpleSource>\
         <SourceFilename relativeToVRT=\"1\">view_1.tif</SourceFilename><SourceBand>1</SourceBand>\
         <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"100\" ySize=\"90\"/><DstRect xOff=\"0\" yOff=\"0\" xSize=\"100\" ySize=\"90\"/>\
         </SimpleSource></VRTRasterBand></VRTDataset>"
    )
}

/// Writes a CityJSON sequence of two features.
fn sequence(folder: &Path) {
    let head = r#"{"type":"CityJSON","version":"2.0","CityObjects":{},"vertices":[],
"transform":{"scale":[0.001,0.001,0.001],"translate":[85000,446000,0]},"metadata":{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/7415"}}"#
        .replace('\n', "");
    let feature = |id: usize| {
        format!(
            "{{\"type\":\"CityJSONFeature\",\"id\":\"f{id}\",\"CityObjects\":{{\"f{id}\":{{\"type\":\"Building\",\
             \"attributes\":{{\"a\":{id}}},\"geometry\":[{{\"type\":\"MultiSurface\",\"lod\":\"2.2\",\
             \"boundaries\":[[[0,1,2,3]],[[0,1,4]]],\"semantics\":{{\"surfaces\":[{{\"type\":\"RoofSurface\"}}],\
             \"values\":[0,null]}}}}]}}}},\
             \"vertices\":[[0,0,0],[10000,0,0],[10000,8000,0],[0,8000,0],[5000,4000,3000]]}}"
        )
    };
    fs::write(folder.join("m.city.jsonl"), format!("{head}\n{}\n{}\n", feature(1), feature(2))).unwrap();
}

fn cloud(path: &Path) {
    let mut builder = Builder::from(Version::new(1, 4));
    builder.point_format = las::point::Format::new(6).unwrap();
    builder.point_format.is_compressed = path.extension().is_some_and(|e| e == "laz");
    let axis = |offset| Transform { scale: 0.001, offset };
    builder.transforms = Vector { x: axis(436_078.0), y: axis(3_357_752.0), z: axis(0.0) };
    let mut writer = Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    for i in 0..200 {
        let (x, y, z) = (436_078.0 + f64::from(i % 20), 3_357_752.0 + f64::from(i / 20), f64::from(i % 7));
        writer.write_point(Point { x, y, z, gps_time: Some(0.0), ..Point::default() }).unwrap();
    }
    writer.close().unwrap();
}
