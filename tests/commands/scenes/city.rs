//! `skysweep city info` and `convert`, from the command line: exit codes, reports, and what the
//! written files hold.

use std::path::PathBuf;

use assert_cmd::Command;
use serde_json::Value;

/// A house with a ridge roof in EPSG:25832, a part without geometry, a road, and a building whose
/// only surface is a line.
const MODEL: &str = r#"{"type":"CityJSON","version":"2.0",
    "metadata":{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/25832"},
    "transform":{"scale":[0.5,0.5,0.5],"translate":[500000.0,5700000.0,30.0]},
    "CityObjects":{
        "house":{"type":"Building","geometry":[{"type":"Solid","lod":"2.2","boundaries":[[
            [[0,3,2,1]],[[0,1,5,4]],[[2,3,7,6]],[[1,2,6,9,5]],[[3,0,4,8,7]],[[4,5,9,8]],[[6,7,8,9]]]],
            "semantics":{"surfaces":[{"type":"GroundSurface"},{"type":"WallSurface"},{"type":"RoofSurface"}],
                "values":[[0,1,1,1,1,2,2]]}}]},
        "annex":{"type":"BuildingPart","parents":["house"]},
        "street":{"type":"Road","geometry":[{"type":"MultiSurface","lod":"1","boundaries":[[[0,1,2]]]}]},
        BROKEN
        "tower":{"type":"Building","geometry":[{"type":"MultiSurface","lod":"3","boundaries":[[[0,1,2]]]}]}},
    "vertices":[[0,0,0],[16,0,0],[16,12,0],[0,12,0],[0,0,6],[16,0,6],[16,12,6],[0,12,6],[0,6,10],[16,6,10]]}"#;
const BROKEN: &str =
    r#""line":{"type":"Building","geometry":[{"type":"MultiSurface","lod":"2","boundaries":[[[0,1,0]]]}]},"#;

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(broken: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("model.city.json"), MODEL.replace("BROKEN", broken)).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        Command::cargo_bin("skysweep").unwrap().current_dir(self.folder.path()).arg("city").args(arguments).assert()
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(self.path(name)).unwrap()).unwrap()
    }
}

fn stdout(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

#[test]
fn info_says_what_is_there() {
    let bench = Bench::new("");
    let text = stdout(&bench.run(&["info", "model.city.json"]).code(0));
    for words in ["CityJSON 2.0", "EPSG:25832", "500008.000 5700006.000 35.000", "used 1", "RoofSurface 4"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    let summary: Value = serde_json::from_str(&stdout(&bench.run(&["info", "model.city.json", "--json"]))).unwrap();
    assert_eq!(summary["triangles"], 16);
    assert_eq!(summary["lods"]["2.2"], 1);
    let everything = bench.run(&["info", "model.city.json", "--json", "--all-objects"]);
    assert_eq!(serde_json::from_str::<Value>(&stdout(&everything)).unwrap()["triangles"], 17);
    let third = bench.run(&["info", "model.city.json", "--json", "--lod", "3"]);
    assert_eq!(serde_json::from_str::<Value>(&stdout(&third)).unwrap()["triangles"], 1);
}

#[test]
fn the_report_names_every_object() {
    let bench = Bench::new(BROKEN);
    bench.run(&["info", "model.city.json", "--report", "report.json"]).code(1);
    let report = bench.json("report.json");
    let objects: Vec<(&str, &str)> = report["object_reports"]
        .as_array()
        .unwrap()
        .iter()
        .map(|o| (o["id"].as_str().unwrap(), o["status"].as_str().unwrap()))
        .collect();
    let expected = [
        ("house", "used"),
        ("annex", "no geometry"),
        ("street", "no building"),
        ("line", "unusable"),
        ("tower", "other level of detail"),
    ];
    assert_eq!(objects, expected);
    let of_line = &report["object_reports"][3];
    assert_eq!([&of_line["defects"][0]["code"], &of_line["defects"][1]["code"]], [104, 101]);
    assert!(of_line["reason"].as_str().is_some_and(|reason| reason.contains("defects")));
    assert_eq!(report["object_reports"][4]["reason"], "its levels of detail are 3");
    bench.run(&["info", "model.city.json", "--report", "report.json"]).code(2);
    bench.run(&["info", "model.city.json", "--report", "report.json", "--overwrite"]).code(1);
}

/// A part of the house that is inside of it.
const WING: &str = r#""wing":{"type":"BuildingPart","parents":["house"],"geometry":[{"type":"Solid","lod":"2.2",
  "boundaries":[[
    [[0,3,2,1]],[[0,1,5,4]],[[1,2,6,5]],[[2,3,7,6]],[[3,0,4,7]],[[4,5,6,7]]]]}]},"#;

#[test]
fn solids_are_checked_for_a_report() {
    let bench = Bench::new(WING);
    bench.run(&["info", "model.city.json", "--report", "report.json"]).code(0);
    let report = bench.json("report.json");
    let wing = report["object_reports"].as_array().unwrap().iter().find(|object| object["id"] == "wing").unwrap();
    assert_eq!((&wing["status"], &wing["defects"][0]["code"]), (&Value::from("used"), &Value::from(601)));
    assert_eq!(wing["defects"][0]["detail"], "with house");
    assert!(!stdout(&bench.run(&["info", "model.city.json"])).contains("601"));
}

#[test]
fn triangles_in_three_formats() {
    let bench = Bench::new("");
    for output in ["house.obj", "house.ply", "house.glb"] {
        bench.run(&["convert", "model.city.json", "-o", output]).code(0);
    }
    for (file, classes) in [("house.obj", "RoofSurface 4"), ("house.ply", "RoofSurface 4")] {
        let text = stdout(&bench.run(&["info", file]).code(0));
        assert!(text.contains("triangles         16") && text.contains(classes), "{text}");
        assert!(text.contains("EPSG:25832") && text.contains("500008.000 5700006.000 35.000"), "{text}");
    }
    let obj = std::fs::read_to_string(bench.path("house.obj")).unwrap();
    assert!(obj.contains("v 500008 5700006 33\n") && obj.contains("o house\n"), "{obj}");
    check_glb(&std::fs::read(bench.path("house.glb")).unwrap());
    bench.run(&["convert", "model.city.json", "-o", "house.obj"]).code(2);
    bench.run(&["convert", "model.city.json", "-o", "house.obj", "--overwrite"]).code(0);
    bench.run(&["convert", "model.city.json", "-o", "house.stl"]).code(2);
}

/// The rules of the glTF 2.0 container, and accessors that lie in their buffers.
fn check_glb(bytes: &[u8]) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    let json_length = word(12);
    assert_eq!((&bytes[16..20], json_length % 4), (&b"JSON"[..], 0));
    let document: Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
    let binary = &bytes[28 + json_length..];
    assert_eq!((word(20 + json_length), &bytes[24 + json_length..28 + json_length]), (binary.len(), &b"BIN\0"[..]));
    assert_eq!(document["buffers"][0]["byteLength"], binary.len());
    assert_eq!(document["asset"]["extras"]["origin"][2], 32.0);
    assert_eq!(document["nodes"][0]["name"], "house");
    let number = |value: &Value| value.as_u64().unwrap() as usize;
    let mut triangles = 0;
    for primitive in document["meshes"][0]["primitives"].as_array().unwrap() {
        let positions = &document["accessors"][number(&primitive["attributes"]["POSITION"])];
        let indices = &document["accessors"][number(&primitive["indices"])];
        let view = &document["bufferViews"][number(&indices["bufferView"])];
        let start = number(&view["byteOffset"]);
        let data = &binary[start..start + number(&view["byteLength"])];
        assert_eq!(data.len(), 4 * number(&indices["count"]));
        let (chunks, _) = data.as_chunks::<4>();
        assert!(chunks.iter().all(|c| (u32::from_le_bytes(*c) as usize) < number(&positions["count"])));
        triangles += number(&indices["count"]) / 3;
    }
    assert_eq!(triangles, 16);
}

#[test]
fn footprints_and_cityjson() {
    let bench = Bench::new("");
    bench.run(&["convert", "model.city.json", "-o", "house.geojson"]).code(0);
    let footprints = bench.json("house.geojson");
    let feature = &footprints["features"][0];
    assert_eq!(footprints["features"].as_array().unwrap().len(), 1);
    let properties = &feature["properties"];
    assert_eq!((&properties["id"], &properties["height_m"]), (&Value::from("house"), &Value::from(5.0)));
    let ring = feature["geometry"]["coordinates"][0][0].as_array().unwrap();
    assert_eq!((ring.len(), &ring[0]), (5, &ring[4]));
    // Easting 500 000 m is the zone's central meridian, 9 degrees east; gdaltransform gives the
    // latitude 51.451182.
    let near = |value: &Value, degrees: f64| (value.as_f64().unwrap() - degrees).abs() < 2e-4;
    assert!(ring.iter().all(|point| near(&point[0], 9.0) && near(&point[1], 51.4512)), "{ring:?}");
    bench.run(&["convert", "model.city.json", "-o", "again.json"]).code(0);
    let text = stdout(&bench.run(&["info", "again.json"]).code(0));
    assert!(text.contains("EPSG:25832") && text.contains("triangles         16"), "{text}");
    bench.run(&["convert", "model.city.json", "-o", "house.obj"]).code(0);
    bench.run(&["convert", "house.obj", "-o", "from-obj.geojson"]).code(0);
    let obj = std::fs::read_to_string(bench.path("house.obj")).unwrap();
    std::fs::write(bench.path("house.obj"), obj.replace("# crs EPSG:25832\n", "")).unwrap();
    let refused = bench.run(&["convert", "house.obj", "-o", "none.geojson"]).code(2);
    let error = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(error.contains("error 1010"), "{error}");
}

#[test]
fn files_that_are_no_city_model_end_with_2() {
    let bench = Bench::new("");
    std::fs::write(bench.path("broken.json"), "{\"type\":\"CityJSON\",\n\"version\":}").unwrap();
    let error = String::from_utf8(bench.run(&["info", "broken.json"]).code(2).get_output().stderr.clone()).unwrap();
    assert!(error.contains("error 901") && error.contains("line 2, column 11"), "{error}");
    bench.run(&["info", "nothing.json"]).code(2);
    bench.run(&["info", "."]).code(2);
    bench.run(&["info", "model.city.json", "--lod", "two"]).code(2);
}

#[test]
fn the_tile_of_the_yardsticks() {
    let Some(tile) = testing::shared_data("city/3dbag_5910.city.json") else { return };
    let bench = Bench::new("");
    let summary = stdout(&bench.run(&["info", "--json", tile.to_str().unwrap()]).code(0));
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!((&summary["objects"], &summary["statuses"]["used"]), (&Value::from(862), &Value::from(430)));
}

/// A model of another level of detail than the default gives no empty file, but an error that names
/// its levels.
#[test]
fn nothing_selected_is_an_error_that_names_the_levels() {
    let folder = tempfile::tempdir().unwrap();
    let (model, out) = (folder.path().join("lod3.city.json"), folder.path().join("lod3.obj"));
    let text = std::fs::read_to_string(crate::common::sample("truth/buildings.city.json")).unwrap();
    let text = text.replace("\"lod\":\"2.2\"", "\"lod\":\"3\"").replace("\"lod\":\"2\"", "\"lod\":\"3\"");
    std::fs::write(&model, text).unwrap();
    let convert = || {
        let mut command = crate::common::skysweep();
        command.args(["city", "convert"]).arg(&model).arg("-o").arg(&out);
        command
    };
    let expected = predicates::str::contains("levels of detail in the file are 3");
    convert()
        .assert()
        .code(2)
        .stderr(predicates::prelude::PredicateBooleanExt::and(expected, predicates::str::contains("--lod 3")));
    assert!(!out.exists());
    convert().args(["--lod", "3"]).assert().code(0);
    assert!(out.metadata().unwrap().len() > 1000);
}

/// Attributes, generic attributes and addresses come through, from CityGML and from CityJSON, and
/// what CityJSON has no place for in our model is counted.
#[test]
fn attributes_and_addresses_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let gml = folder.path().join("house.gml");
    let content = r#"<CityModel xmlns="http://www.opengis.net/citygml/2.0" xmlns:gml="http://www.opengis.net/gml"
        xmlns:bldg="http://www.opengis.net/citygml/building/2.0" xmlns:gen="http://www.opengis.net/citygml/generics/2.0"
        xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:xAL="urn:oasis:names:tc:ciq:xsdschema:xAL:2.0">
        <gml:boundedBy><gml:Envelope srsName="urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NH"/></gml:boundedBy>
        <cityObjectMember><bldg:Building gml:id="house"><core:creationDate>2020-01-31</core:creationDate>
        <core:externalReference><core:informationSystem>urn:alkis</core:informationSystem>
        <core:externalObject><core:name>DE42</core:name></core:externalObject></core:externalReference>
        <gen:stringAttribute name="owner"><gen:value>Bell &amp; Sons</gen:value></gen:stringAttribute>
        <gen:intAttribute name="flats"><gen:value>7</gen:value></gen:intAttribute>
        <bldg:function>31001_1000</bldg:function><bldg:roofType>3100</bldg:roofType>
        <bldg:measuredHeight uom="urn:adv:uom:m">9.25</bldg:measuredHeight>
        <bldg:storeysAboveGround>2</bldg:storeysAboveGround>
        <bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>
        <gml:posList srsDimension="3">500000 5700000 30 500000 5700008 30 500008 5700008 30 500008 5700000 30
        500000 5700000 30</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>
        </gml:MultiSurface></bldg:lod2MultiSurface>
        <bldg:address><core:Address><core:xalAddress><xAL:AddressDetails><xAL:Country><xAL:CountryName>Germany</xAL:CountryName>
        <xAL:Locality Type="Town"><xAL:LocalityName>Aachen</xAL:LocalityName><xAL:Thoroughfare Type="Street">
        <xAL:ThoroughfareNumber>3a</xAL:ThoroughfareNumber><xAL:ThoroughfareName>Domhof</xAL:ThoroughfareName>
        </xAL:Thoroughfare></xAL:Locality></xAL:Country></xAL:AddressDetails></core:xalAddress></core:Address></bldg:address>
        </bldg:Building></cityObjectMember></CityModel>"#;
    std::fs::write(&gml, content).unwrap();
    let convert = |from: &std::path::Path, to: &str| -> Value {
        let out = folder.path().join(to);
        let mut command = crate::common::skysweep();
        command.args(["city", "convert"]).arg(from).arg("-o").arg(&out).assert().code(0);
        serde_json::from_slice(&std::fs::read(out).unwrap()).unwrap()
    };
    let first = convert(&gml, "a.city.json");
    let second = convert(&folder.path().join("a.city.json"), "b.city.json");
    assert_eq!(first["CityObjects"], second["CityObjects"]);
    assert_eq!(first["metadata"]["referenceSystem"], "https://www.opengis.net/def/crs/EPSG/0/5555");
    let house = &first["CityObjects"]["house"];
    let expected = serde_json::json!({
        "creationDate": "2020-01-31",
        "externalReference": { "informationSystem": "urn:alkis", "externalObject": { "name": "DE42" } },
        "owner": "Bell & Sons", "flats": 7, "function": "31001_1000", "roofType": "3100",
        "measuredHeight": 9.25, "storeysAboveGround": 2,
    });
    assert_eq!(house["attributes"], expected);
    let address = serde_json::json!([{
        "CountryName": "Germany", "LocalityName": "Aachen", "ThoroughfareNumber": "3a", "ThoroughfareName": "Domhof",
    }]);
    assert_eq!(house["address"], address);
    let footprint = &convert(&gml, "house.geojson")["features"][0]["properties"];
    assert_eq!(
        (&footprint["measuredHeight"], &footprint["address"]),
        (&house["attributes"]["measuredHeight"], &address)
    );
    assert_eq!(footprint["height_m"], 0.0);
}

/// Materials and textures reach CityJSON, with paths of images that lead from the new file; formats
/// without them count them.
#[test]
fn appearances_are_kept_or_counted() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("out")).unwrap();
    let model = serde_json::json!({
        "type": "CityJSON", "version": "2.0", "transform": { "scale": [1, 1, 1], "translate": [0, 0, 0] },
        "metadata": { "referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/25832" },
        "appearance": {
            "materials": [{ "name": "brick" }], "textures": [{ "type": "PNG", "image": "looks/a.png" }],
            "vertices-texture": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], "default-theme-texture": "t",
        },
        "CityObjects": { "b": { "type": "Building", "geometry": [{
            "type": "MultiSurface", "lod": "2", "boundaries": [[[0, 1, 2]]],
            "material": { "t": { "values": [0] } }, "texture": { "t": { "values": [[[0, 0, 1, 2]]] } },
        }] } },
        "vertices": [[0, 0, 0], [9, 0, 0], [0, 9, 0]],
    });
    std::fs::write(folder.path().join("in.city.json"), model.to_string()).unwrap();
    let convert = |to: &str| {
        let mut command = crate::common::skysweep();
        let run = command.current_dir(folder.path()).args(["city", "convert", "in.city.json", "-o", to]).assert();
        String::from_utf8(run.code(0).get_output().stderr.clone()).unwrap()
    };
    assert!(!convert("out/b.city.json").contains("not written"));
    let written = std::fs::read(folder.path().join("out/b.city.json")).unwrap();
    let written: Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(written["appearance"]["textures"][0]["image"], "../looks/a.png");
    let geometry = &written["CityObjects"]["b"]["geometry"][0];
    let source = &model["CityObjects"]["b"]["geometry"][0];
    assert_eq!((&geometry["texture"], &geometry["material"]), (&source["texture"], &source["material"]));
    assert!(convert("b.obj").contains("2 materials and textures"));
}
