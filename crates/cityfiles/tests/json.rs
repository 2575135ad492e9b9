//! Reads and writes CityJSON and CityJSONSeq, and refuses invalid and hostile files.

use std::path::{Path, PathBuf};

use city::{
    CityModel, CityObject, CrsReference, Geometry, GeometryKind, Lod, ModelPoint, ObjectKind, SurfaceClass,
    SurfacePolygon,
};
use cityfiles::{CityError, CityFile, CityFormat, CityJsonOptions, read, write_cityjson};
use formats::SaveError;

fn read_text(text: &str) -> Result<CityFile, CityError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.city.json");
    std::fs::write(&path, text).unwrap();
    read(&path)
}

fn codes(file: &CityFile) -> Vec<u16> {
    file.defects.iter().map(|defect| defect.code.number()).collect()
}

/// Returns the number and the place of a refusal.
fn refusal(text: &str) -> (u16, String) {
    match read_text(text) {
        Err(CityError::Refused { fault, .. }) => (fault.code.number(), fault.place),
        other => panic!("expected a refusal, found {other:?}"),
    }
}

/// Makes a document with one object and five vertices; `geometry` is the list of its geometries.
fn document(geometry: &str) -> String {
    format!(
        r#"{{"type":"CityJSON","version":"2.0",
            "metadata":{{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/7415"}},
            "transform":{{"scale":[0.5,0.5,0.5],"translate":[10.0,20.0,30.0]}},
            "CityObjects":{{"b":{{"type":"Building","geometry":[{geometry}]}}}},
            "vertices":[[0,0,0],[2,0,0],[2,2,0],[0,2,0],[1,1,4]]}}"#
    )
}

const PYRAMID: &str = r#"{"type":"Solid","lod":"2.2","boundaries":[[[[0,3,2,1]],[[0,1,4]],[[1,2,4]],[[2,3,4]],[[3,0,4]]]],
    "semantics":{"surfaces":[{"type":"RoofSurface"},{"type":"GroundSurface"}],"values":[[1,0,0,null,7]]}}"#;

#[test]
fn a_solid_with_semantics() {
    let file = read_text(&document(PYRAMID)).unwrap();
    assert_eq!(file.format, CityFormat::CityJson("2.0".to_owned()));
    assert_eq!(file.model.crs.epsg, Some(7415));
    assert_eq!(file.model.vertices[4], ModelPoint::new(10.5, 20.5, 32.0));
    let geometry = &file.model.objects[0].geometries[0];
    assert_eq!((geometry.lod, geometry.kind), (Some(Lod::new(2, Some(2))), GeometryKind::Solid));
    let classes: Vec<_> = geometry.surfaces.iter().map(|surface| surface.class).collect();
    use SurfaceClass::{Ground, Roof, Unclassified};
    assert_eq!(classes, [Ground, Roof, Roof, Unclassified, Unclassified]);
    assert_eq!(codes(&file), [1008], "the fifth surface names a semantic that does not exist");
    assert_eq!(file.model.validate(), Ok(()));
}

#[test]
fn a_sequence_has_its_own_vertices_in_every_line() {
    let head = r#"{"type":"CityJSON","version":"2.0","CityObjects":{},"vertices":[],
        "transform":{"scale":[1,1,1],"translate":[100,0,0]}}"#
        .replace('\n', " ");
    let line = |id: &str, x: i32| {
        format!(
            r#"{{"type":"CityJSONFeature","id":"{id}","CityObjects":{{"{id}":{{"type":"Building","geometry":[
            {{"type":"MultiSurface","lod":2,"boundaries":[[[0,1,2]]]}}]}}}},"vertices":[[{x},0,0],[9,0,0],[9,9,0]]}}"#
        )
        .replace('\n', " ")
    };
    let file = read_text(&format!("{head}\n{}\n{}\n", line("a", 1), line("b", 2))).unwrap();
    assert_eq!(file.format, CityFormat::CityJsonSeq("2.0".to_owned()));
    let first = |object: usize| file.model.objects[object].geometries[0].surfaces[0].rings[0][0];
    let x = |object: usize| file.model.vertices[first(object) as usize].x;
    assert_eq!([x(0), x(1)], [101.0, 102.0]);
    assert_eq!(refusal(&format!("{head}\n{}\n{{\"type\":", line("a", 1))).0, 901);
    let no_transform = head.replace("transform", "nothing");
    assert_eq!(refusal(&format!("{no_transform}\n{}", line("a", 1))), (901, "line 1".to_owned()));
}

#[test]
fn templates_are_placed_by_their_matrix() {
    let instance = r#"{"type":"GeometryInstance","template":0,"boundaries":[2],
        "transformationMatrix":[0,-2,0,1, 2,0,0,0, 0,0,2,0, 0,0,0,1]}"#;
    let templates = r#","geometry-templates":{"templates":[{"type":"MultiSurface","lod":"2","boundaries":[[[0,1,2]]]}],
        "vertices-templates":[[0,0,0],[1,0,0],[0,1,0]]}}"#;
    let with = |instance: &str| {
        let text = document(instance);
        read_text(&format!("{}{templates}", text.strip_suffix('}').unwrap())).unwrap()
    };
    let file = with(instance);
    let ring = &file.model.objects[0].geometries[0].surfaces[0].rings[0];
    let placed: Vec<_> = ring.iter().map(|&i| file.model.vertices[i as usize]).collect();
    let expected = [(12.0, 21.0), (12.0, 23.0), (10.0, 21.0)].map(|(x, y)| ModelPoint::new(x, y, 30.0));
    assert_eq!(placed, expected);
    for (from, to) in [("\"template\":0", "\"template\":7"), ("[2]", "[99]"), ("[2]", "[]"), ("0,0,0,1]", "1]")] {
        assert_eq!(codes(&with(&instance.replace(from, to))), [1006], "{to}");
    }
    assert_eq!(codes(&read_text(&document(instance)).unwrap()), [1006], "no templates at all");
}

#[test]
fn defects_cost_the_surface_they_are_in() {
    let surfaces = |boundaries: &str| {
        let shape = format!(r#"{{"type":"MultiSurface","lod":"2","boundaries":{boundaries}}}"#);
        let file = read_text(&document(&shape)).unwrap();
        let kept = file.model.objects[0].geometries.iter().map(|g| g.surfaces.len()).sum::<usize>();
        assert_eq!(file.model.validate(), Ok(()));
        (kept, codes(&file))
    };
    assert_eq!(surfaces("[[[0,1,2]],[[0,1,99]]]"), (1, vec![1001]));
    assert_eq!(surfaces("[[[0,1,18446744073709551615]],[[0,1,2]]]"), (1, vec![1001]));
    assert_eq!(
        surfaces("[[[0,1,18446744073709551616]],[[0,-1,2]],[[0,1.5,2]],[[0,\"x\",{}]]]"),
        (0, vec![1001, 1001, 1001, 1001, 902])
    );
    assert_eq!(surfaces("[]"), (0, vec![902]));
    assert_eq!(surfaces("[[]]"), (0, vec![902, 902]));
    let points = r#"{"type":"MultiPoint","lod":"0","boundaries":[0,1]}"#;
    assert_eq!(codes(&read_text(&document(points)).unwrap()), [1005]);
    let level = PYRAMID.replace("\"2.2\"", "\"high\"").replace(",7]", ",0]");
    assert_eq!(codes(&read_text(&document(&level)).unwrap()), [1009]);
}

#[test]
fn unusable_coordinates_cost_what_uses_them() {
    let shape = r#"{"type":"MultiSurface","lod":"2","boundaries":[[[0,1,2]],[[1,2,3]]]}"#;
    let huge = document(shape).replace("[[0,0,0],", "[[1e300,0,0],");
    let file = read_text(&huge).unwrap();
    assert_eq!(codes(&file), [1002]);
    assert_eq!(file.model.objects[0].geometries[0].surfaces.len(), 1);
    let scaled = document(shape).replace("\"scale\":[0.5,0.5,0.5]", "\"scale\":[1e308,1e308,1e308]");
    assert_eq!(codes(&read_text(&scaled).unwrap()), [1002, 1002, 902]);
    let endless = document(shape).replace("[[0,0,0],", "[[1e999,0,0],");
    assert_eq!(refusal(&endless).0, 901);
    assert_eq!(refusal(&document(shape).replace("[[0,0,0],", "[[NaN,0,0],")).0, 901);
    assert_eq!(refusal(&document(shape).replace("[[0,0,0],", "[[0,0],")).0, 901);
}

#[test]
fn other_documents_are_refused_with_a_place() {
    assert_eq!(refusal(""), (901, "line 1".to_owned()));
    assert_eq!(refusal("\n\n{\"type\": \"CityJSON\",,}"), (901, "line 1, column 21".to_owned()));
    assert_eq!(refusal("{}"), (901, "type".to_owned()));
    assert_eq!(refusal(r#"{"type":"FeatureCollection"}"#), (904, "type".to_owned()));
    assert_eq!(refusal(r#"{"type":"CityJSONFeature"}"#), (904, "type".to_owned()));
    assert_eq!(refusal(r#"{"type":"CityJSON","version":"0.9"}"#), (904, "version".to_owned()));
    assert_eq!(refusal(&document("").replace("\"vertices\":[", "\"vertices\":7,\"x\":[")).0, 901);
    let deep = document(&format!(r#"{{"type":"Solid","boundaries":{}{}}}"#, "[".repeat(100_000), "]".repeat(100_000)));
    assert_eq!(refusal(&deep).0, 901);
    assert!(read(Path::new("/nowhere/model.json")).unwrap_err().to_string().starts_with("cannot read"));
}

/// Makes a model with every kind of geometry.
fn model_of_all_kinds() -> CityModel {
    let mut model = CityModel::new(CrsReference::from_epsg(25832, Some(7837)));
    for (x, y, z) in [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0), (2, 2, 3)] {
        model.vertices.push(ModelPoint::new(500_000.25 + f64::from(x), 5_700_000.125 + f64::from(y), f64::from(z)));
    }
    let faces: [&[u32]; 5] = [&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
    use GeometryKind::{CompositeSolid, CompositeSurface, MultiSolid, MultiSurface, Solid};
    for (number, kind) in [MultiSurface, CompositeSurface, Solid, MultiSolid, CompositeSolid].into_iter().enumerate() {
        let mut object = CityObject::new(format!("b{number}"), ObjectKind::BUILDING);
        if number == 2 {
            object.kind = ObjectKind::BUILDING_PART;
            object.parent = Some(0);
        }
        let mut geometry = Geometry::new(Some(Lod::new(2, Some(2))), kind);
        let solids = if matches!(kind, MultiSolid | CompositeSolid) { 2 } else { 1 };
        for solid in 0..solids {
            for shell in 0..if kind.is_solid() { 2 } else { 1 } {
                geometry.surfaces.extend(faces.iter().enumerate().map(|(i, ring)| SurfacePolygon {
                    rings: vec![ring.to_vec()],
                    class: [SurfaceClass::Ground, SurfaceClass::Roof, SurfaceClass::Unclassified][i % 3],
                    solid,
                    shell,
                    attributes: None,
                    appearance: None,
                }));
            }
        }
        object.geometries.push(geometry);
        model.objects.push(object);
    }
    model
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.city.json");
    let model = model_of_all_kinds();
    write_cityjson(&path, &model, &CityJsonOptions::default()).unwrap();
    let back = read(&path).unwrap();
    assert!(back.defects.is_empty(), "{:?}", back.defects);
    assert_eq!((back.model.crs.epsg, back.model.crs.vertical_epsg), (Some(25832), Some(7837)));
    for (written, read) in model.objects.iter().zip(&back.model.objects) {
        assert_eq!((&written.id, &written.kind, written.parent), (&read.id, &read.kind, read.parent));
        let (w, r) = (&written.geometries[0], &read.geometries[0]);
        assert_eq!((w.lod, w.kind, w.surfaces.len()), (r.lod, r.kind, r.surfaces.len()));
        for (a, b) in w.surfaces.iter().zip(&r.surfaces) {
            assert_eq!((a.class, a.solid, a.shell), (b.class, b.solid, b.shell));
            let corner = |m: &CityModel, i: u32| m.vertices[i as usize];
            for (&i, &j) in a.rings[0].iter().zip(&b.rings[0]) {
                let off = corner(&model, i).from_origin(corner(&back.model, j));
                assert!(off.iter().all(|c| c.abs() <= 0.0005 + 1e-9), "{off:?}");
            }
        }
    }
    let again = write_cityjson(&path, &model, &CityJsonOptions::default());
    assert!(matches!(again, Err(CityError::NotWritten(SaveError::Exists { .. }))));
    write_cityjson(&path, &model, &CityJsonOptions { overwrite: true, ..CityJsonOptions::default() }).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left in the folder");
}

#[test]
fn models_that_cannot_be_written_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.city.json");
    let mut twice = model_of_all_kinds();
    twice.objects[1].id = "b0".to_owned();
    let mut broken = model_of_all_kinds();
    broken.vertices.truncate(3);
    for (model, scale) in [(&twice, 0.001), (&broken, 0.001), (&model_of_all_kinds(), 0.0)] {
        let refused = write_cityjson(&path, model, &CityJsonOptions { scale, overwrite: false });
        assert!(matches!(refused, Err(CityError::Refused { .. })), "{refused:?}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Returns the folder of real city models, if it exists.
fn real_data() -> Option<PathBuf> {
    testing::shared_data("city")
}

#[test]
fn the_3dbag_tile_is_read_whole() {
    let Some(folder) = real_data() else { return };
    let file = read(&folder.join("3dbag_5910.city.json")).unwrap();
    assert_eq!(file.model.crs.epsg, Some(7415));
    assert_eq!(file.model.objects.len(), 862);
    assert_eq!(file.model.objects.iter().filter(|o| o.parent.is_some()).count(), 430);
    assert!(file.defects.is_empty(), "{:?}", &file.defects[..1]);
    let lod22 = |g: &&Geometry| g.lod == Some(Lod::new(2, Some(2)));
    assert_eq!(file.model.objects.iter().flat_map(|o| &o.geometries).filter(lod22).count(), 430);
}

/// What the file says about single surfaces is kept, once for the surfaces that share it.
#[test]
fn attributes_of_surfaces_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (source, target) = (folder.path().join("a.city.json"), folder.path().join("b.city.json"));
    let document = serde_json::json!({
        "type": "CityJSON", "version": "2.0",
        "transform": { "scale": [0.001, 0.001, 0.001], "translate": [0.0, 0.0, 0.0] },
        "CityObjects": { "house": { "type": "Building", "geometry": [{
            "type": "MultiSurface", "lod": "2",
            "boundaries": [[[0, 1, 2]], [[0, 1, 3]], [[0, 2, 3]], [[1, 2, 3]]],
            "semantics": {
                "surfaces": [
                    { "type": "RoofSurface", "slope": 31.5, "children": [3] },
                    { "type": "WallSurface" },
                    { "type": "RoofSurface", "slope": 12.0, "panel": { "kind": "solar" } },
                    { "type": "+Gutter", "metal": "zinc" }
                ],
                "values": [0, 2, 0, 1]
            }
        }] } },
        "vertices": [[0, 0, 0], [4000, 0, 0], [0, 4000, 0], [0, 0, 4000]]
    });
    std::fs::write(&source, document.to_string()).unwrap();
    let model = read(&source).unwrap().model;
    assert_eq!(model.left_out["relations of surfaces"], 1);
    assert_eq!(model.left_out["attributes of surfaces"], 1, "CityJSON has no name for the gutter in our model");
    write_cityjson(&target, &model, &CityJsonOptions::default()).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&std::fs::read(&target).unwrap()).unwrap();
    let semantics = &written["CityObjects"]["house"]["geometry"][0]["semantics"];
    let of = |surface: usize| &semantics["surfaces"][semantics["values"][surface].as_u64().unwrap() as usize];
    assert_eq!(semantics["surfaces"].as_array().unwrap().len(), 3);
    assert_eq!(*of(0), serde_json::json!({ "type": "RoofSurface", "slope": 31.5 }));
    assert_eq!(*of(1), serde_json::json!({ "type": "RoofSurface", "slope": 12.0, "panel": { "kind": "solar" } }));
    assert_eq!((of(2), of(3)), (of(0), &serde_json::json!({ "type": "WallSurface" })));
}

/// A CityGML document of one building.
fn city_gml(building: &str) -> String {
    format!(
        "<core:CityModel xmlns:core=\"http://www.opengis.net/citygml/2.0\" xmlns:gml=\"http://www.opengis.net/gml\" \
         xmlns:bldg=\"http://www.opengis.net/citygml/building/2.0\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" \
         xmlns:gen=\"http://www.opengis.net/citygml/generics/2.0\"><gml:boundedBy><gml:Envelope \
         srsName=\"EPSG:25832\"/></gml:boundedBy><core:cityObjectMember><bldg:Building gml:id=\"b\">{building}\
         </bldg:Building></core:cityObjectMember></core:CityModel>"
    )
}

fn gml_polygon(id: &str, corners: &str) -> String {
    format!(
        "<gml:surfaceMember><gml:Polygon gml:id=\"{id}\"><gml:exterior><gml:LinearRing><gml:posList>{corners}\
         </gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
    )
}

/// The surfaces of a solid have the attributes of the boundary surfaces that it links to, or that
/// link to it. What the description of a surface cannot hold is counted.
#[test]
fn attributes_of_surfaces_go_from_citygml_to_cityjson() {
    let set = |polygons: &str| {
        format!("<bldg:lod2MultiSurface><gml:MultiSurface>{polygons}</gml:MultiSurface></bldg:lod2MultiSurface>")
    };
    let roof =
        set(&[gml_polygon("r", "0 0 3 4 0 3 0 4 3 0 0 3"), gml_polygon("s", "4 0 3 4 4 3 0 4 3 4 0 3")].concat());
    let door = set(&gml_polygon("d", "1 0 0 2 0 0 2 0 2 1 0 0"));
    let building = format!(
        "<bldg:lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface><gml:surfaceMember xlink:href=\"#r\"/>{own}\
         </gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>\
         <bldg:boundedBy><bldg:RoofSurface><gml:name>gable</gml:name>{roof}<gen:doubleAttribute name=\"slope\">\
         <gen:value>31.5</gen:value></gen:doubleAttribute><gen:stringAttribute name=\"type\"><gen:value>x</gen:value>\
         </gen:stringAttribute></bldg:RoofSurface></bldg:boundedBy>\
         <bldg:boundedBy><bldg:WallSurface><gml:description>north</gml:description>{linked}<bldg:opening><bldg:Door>\
         <gml:name>entry</gml:name>{door}<bldg:address><core:Address><core:xalAddress><LocalityName>Ulm</LocalityName>\
         </core:xalAddress></core:Address></bldg:address></bldg:Door></bldg:opening></bldg:WallSurface></bldg:boundedBy>\
         <bldg:boundedBy><bldg:GroundSurface><gml:name>nowhere</gml:name></bldg:GroundSurface></bldg:boundedBy>\
         <bldg:boundedBy><bldg:Gutter><gml:name>zinc</gml:name></bldg:Gutter></bldg:boundedBy>",
        own = gml_polygon("w", "0 0 0 4 0 0 0 0 3 0 0 0"),
        linked = set("<gml:surfaceMember xlink:href=\"#w\"/>"),
    );
    let folder = tempfile::tempdir().unwrap();
    let (source, target) = (folder.path().join("a.gml"), folder.path().join("b.city.json"));
    std::fs::write(&source, city_gml(&building)).unwrap();
    let model = read(&source).unwrap().model;
    // The type is a member of its own; the ground has no polygon, and the gutter no class.
    assert_eq!(model.left_out.clone().into_iter().collect::<Vec<_>>(), [("attributes of surfaces".to_owned(), 3)]);
    assert!(model.objects[0].attributes.is_empty() && model.objects[0].addresses.is_empty());
    write_cityjson(&target, &model, &CityJsonOptions::default()).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&std::fs::read(&target).unwrap()).unwrap();
    let shapes = &written["CityObjects"]["b"]["geometry"];
    let roof = serde_json::json!({ "type": "RoofSurface", "name": "gable", "slope": 31.5 });
    let wall = serde_json::json!({ "type": "WallSurface", "description": "north" });
    let door = serde_json::json!({ "type": "Door", "name": "entry", "address": { "LocalityName": "Ulm" } });
    assert_eq!(shapes[0]["semantics"], serde_json::json!({ "surfaces": [roof, wall], "values": [[0, 1]] }));
    assert_eq!(shapes[1]["semantics"], serde_json::json!({ "surfaces": [roof, door], "values": [0, 1] }));
}

/// The surfaces of real files keep all of their attributes. The numbers were counted with lxml.
#[test]
fn real_citygml_keeps_the_attributes_of_surfaces() {
    let Some(folder) = real_data() else { return };
    for (name, attributes) in
        [("val3dity/gml/DenHaag_1BwBP.gml", 14), ("berlin/data/examples/gml_data/20240216_PartialMierendorff.gml", 167)]
    {
        let model = read(&folder.join(name)).unwrap().model;
        assert!(!model.left_out.contains_key("attributes of surfaces"), "{name}: {:?}", model.left_out);
        let shared: std::collections::HashMap<_, _> = model
            .surfaces()
            .filter_map(|s| s.attributes.as_ref())
            .map(|a| (std::sync::Arc::as_ptr(a), a.len()))
            .collect();
        assert_eq!(shared.values().sum::<usize>(), attributes, "{name}");
    }
}

/// An appearance or attributes of the wrong type cost only themselves.
#[test]
fn malformed_appearances_and_attributes_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.city.json");
    let house = |appearance: &str, attributes: &str, material: &str, texture: &str| {
        format!(
            "{{\"type\":\"CityJSON\",\"version\":\"2.0\",\"appearance\":{appearance},\"CityObjects\":{{\"house\":{{\
             \"type\":\"Building\",\"attributes\":{attributes},\"geometry\":[{{\"type\":\"MultiSurface\",\"lod\":\"2\",\
             \"boundaries\":[[[0,1,2]]],\"material\":{material},\"texture\":{texture}}}]}}}},\
             \"vertices\":[[0,0,0],[4,0,0],[0,4,0]]}}"
        )
    };
    let good = "{\"materials\":[{\"name\":\"m\"}],\"textures\":[{\"type\":\"PNG\",\"image\":\"a.png\"}],\
                \"vertices-texture\":[[0,0],[1,0],[0,1]]}";
    let one_bad = "{\"materials\":[7,{\"name\":\"m\"}],\"textures\":[\"a.png\"],\"vertices-texture\":[[0],[1,0],{}],\
                   \"default-theme-material\":[]}";
    let (paint, cover) = ("{\"t\":{\"value\":0}}", "{\"t\":{\"values\":[[[0,0,1,2]]]}}");
    let (appearances, attributes) = ("malformed materials and textures", "malformed attributes of objects");
    let references = "invalid references to materials and textures";
    for (text, expected) in [
        (house(good, "{}", paint, cover), vec![]),
        (house("null", "null", "null", "null"), vec![]),
        (house("\"red\"", "7", "null", "null"), vec![(attributes, 1), (appearances, 1)]),
        (house(good, "{}", "[]", "{\"t\":\"x\"}"), vec![(appearances, 2)]),
        (house(one_bad, "{}", paint, cover), vec![(references, 2), (appearances, 5)]),
        (house("{\"materials\":{},\"vertices-texture\":1}", "{}", "null", "null"), vec![(appearances, 2)]),
    ] {
        std::fs::write(&path, &text).unwrap();
        let model = read(&path).unwrap_or_else(|error| panic!("{error}: {text}")).model;
        assert_eq!(model.surfaces().count(), 1, "{text}");
        let found: Vec<(&str, usize)> = model.left_out.iter().map(|(what, count)| (what.as_str(), *count)).collect();
        assert_eq!(found, expected, "{text}");
    }
}
