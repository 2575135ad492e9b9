//! Materials and textures go from CityGML and CityJSON to CityJSON, each to the surface and the
//! ring that it belongs to.

use std::path::PathBuf;

use city::{CityModel, SurfacePolygon};
use cityfiles::{CityJsonOptions, move_images, read, write_cityjson};
use serde_json::{Value, json};

/// Writes a text, reads it, writes the model as CityJSON, and returns the model and the document.
fn converted(text: &str) -> (CityModel, Value) {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("model"), folder.path().join("out.city.json"));
    std::fs::write(&from, text).unwrap();
    let file = read(&from).unwrap();
    assert!(file.defects.iter().all(|defect| defect.code.number() >= 1000), "{:?}", file.defects);
    write_cityjson(&to, &file.model, &CityJsonOptions::default()).unwrap();
    let document: Value = serde_json::from_slice(&std::fs::read(&to).unwrap()).unwrap();
    let back = read(&to).unwrap().model;
    assert_eq!(back.left_out.values().sum::<usize>(), 0, "{:?}", back.left_out);
    write_cityjson(&to, &back, &CityJsonOptions { overwrite: true, ..CityJsonOptions::default() }).unwrap();
    let again: Value = serde_json::from_slice(&std::fs::read(&to).unwrap()).unwrap();
    assert_eq!(again, document);
    (file.model, document)
}

fn ring(id: &str, positions: &str) -> String {
    format!("<gml:LinearRing gml:id=\"{id}\"><gml:posList>{positions}</gml:posList></gml:LinearRing>")
}

/// A polygon with a hole, a triangle that a solid turns round, and one that only a set names.
fn surfaces() -> String {
    let outer = ring("outer", "0 0 0 9 0 0 9 9 0 0 9 0 0 0 0");
    let hole = ring("hole", "2 2 0 2 4 0 4 4 0 2 2 0");
    let (left, right) = (ring("left", "0 0 0 0 9 0 5 5 9 0 0 0"), ring("right", "9 0 0 5 5 9 9 9 0 9 0 0"));
    format!(
        "<bldg:lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface gml:id=\"all\">\
         <gml:surfaceMember><gml:Polygon gml:id=\"floor\"><gml:exterior>{outer}</gml:exterior>\
         <gml:interior>{hole}</gml:interior></gml:Polygon></gml:surfaceMember>\
         <gml:surfaceMember><gml:OrientableSurface orientation=\"-\"><gml:baseSurface><gml:Polygon gml:id=\"wall\">\
         <gml:exterior>{left}</gml:exterior></gml:Polygon></gml:baseSurface></gml:OrientableSurface></gml:surfaceMember>\
         <gml:surfaceMember><gml:Polygon gml:id=\"roof\"><gml:exterior>{right}</gml:exterior></gml:Polygon>\
         </gml:surfaceMember></gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>"
    )
}

fn city_gml(version: &str, in_object: &str, in_model: &str) -> String {
    format!(
        "<core:CityModel xmlns:core=\"http://www.opengis.net/citygml/{version}\" \
         xmlns:bldg=\"http://www.opengis.net/citygml/building/{version}\" xmlns:gml=\"http://www.opengis.net/gml\" \
         xmlns:app=\"http://www.opengis.net/citygml/appearance/{version}\" xmlns:xlink=\"http://www.w3.org/1999/xlink\">\
         <gml:boundedBy><gml:Envelope srsName=\"EPSG:25832\"/></gml:boundedBy>{in_model}<core:cityObjectMember>\
         <bldg:Building gml:id=\"b\">{in_object}{}</bldg:Building></core:cityObjectMember></core:CityModel>",
        surfaces()
    )
}

const MATERIALS: &str = "<app:surfaceDataMember><app:X3DMaterial gml:id=\"m0\"><gml:name>brick</gml:name>\
    <app:ambientIntensity>0.2</app:ambientIntensity><app:diffuseColor>0.9 0.1 0</app:diffuseColor>\
    <app:emissiveColor>0 0 0</app:emissiveColor><app:specularColor>1 1 1</app:specularColor>\
    <app:shininess>0.5</app:shininess><app:transparency>0</app:transparency><app:isSmooth>true</app:isSmooth>\
    <app:target>#wall</app:target><app:target>#nowhere</app:target></app:X3DMaterial></app:surfaceDataMember>\
    <app:surfaceDataMember><app:X3DMaterial gml:id=\"m1\"><app:diffuseColor>1 0 0</app:diffuseColor>\
    <app:target>#all</app:target></app:X3DMaterial></app:surfaceDataMember>";

fn expected_materials() -> Value {
    json!([{
        "name": "brick", "ambientIntensity": 0.2, "diffuseColor": [0.9, 0.1, 0.0], "emissiveColor": [0.0, 0.0, 0.0],
        "specularColor": [1.0, 1.0, 1.0], "shininess": 0.5, "transparency": 0.0, "isSmooth": true,
    }, { "name": "m1", "diffuseColor": [1.0, 0.0, 0.0] }])
}

/// The texture of a ring with its image and coordinates in the place of their numbers.
fn shown(document: &Value, ring: &Value) -> Value {
    let appearance = &document["appearance"];
    let numbers: Vec<Option<usize>> = ring.as_array().unwrap().iter().map(|n| Some(n.as_u64()? as usize)).collect();
    match numbers[..] {
        [None] => Value::Null,
        [Some(texture), ref vertices @ ..] => {
            let uv = |n: &Option<usize>| appearance["vertices-texture"][n.unwrap()].clone();
            json!([appearance["textures"][texture]["image"], vertices.iter().map(uv).collect::<Vec<_>>()])
        }
        _ => panic!("{ring}"),
    }
}

#[test]
fn materials_and_textures_of_citygml_reach_their_surfaces_and_rings() {
    let textures = "<app:appearanceMember><app:Appearance><app:theme>summer</app:theme><app:surfaceDataMember>\
        <app:ParameterizedTexture><app:imageURI>looks/a.jpg</app:imageURI><app:mimeType>image/jpeg</app:mimeType>\
        <app:textureType>specific</app:textureType><app:wrapMode>wrap</app:wrapMode><app:borderColor>0 0 0 1</app:borderColor>\
        <app:target uri=\"#floor\"><app:TexCoordList>\
        <app:textureCoordinates ring=\"#outer\">0 0 1 0 1 1 0 1 0 0</app:textureCoordinates></app:TexCoordList></app:target>\
        <app:target uri=\"#wall\"><app:TexCoordList>\
        <app:textureCoordinates ring=\"#left\">0 0.25 0.5 0.75 1 1 0 0.25</app:textureCoordinates></app:TexCoordList></app:target>\
        <app:target uri=\"#roof\"><app:TexCoordList>\
        <app:textureCoordinates ring=\"#right\">0 0 1 1</app:textureCoordinates></app:TexCoordList></app:target>\
        </app:ParameterizedTexture></app:surfaceDataMember><app:surfaceDataMember><app:GeoreferencedTexture>\
        <app:imageURI>ortho.tif</app:imageURI><app:target>#roof</app:target></app:GeoreferencedTexture>\
        </app:surfaceDataMember><app:surfaceDataMember><app:X3DMaterial><app:isFront>false</app:isFront>\
        <app:target>#roof</app:target></app:X3DMaterial></app:surfaceDataMember><app:surfaceDataMember xlink:href=\"#m0\"/>\
        </app:Appearance></app:appearanceMember>";
    let materials = format!(
        "<app:appearance><app:Appearance><app:theme>plain</app:theme>{MATERIALS}</app:Appearance></app:appearance>"
    );
    for version in ["1.0", "2.0"] {
        let (model, document) = converted(&city_gml(version, &materials, textures));
        assert_eq!(document["appearance"]["materials"], expected_materials());
        let texture = json!([{
            "type": "JPG", "image": "looks/a.jpg", "wrapMode": "wrap", "textureType": "specific",
            "borderColor": [0.0, 0.0, 0.0, 1.0],
        }]);
        assert_eq!(document["appearance"]["textures"], texture);
        let geometry = &document["CityObjects"]["b"]["geometry"][0];
        assert_eq!(geometry["type"], "Solid");
        // The wall has its own material before the one of the set.
        assert_eq!(geometry["material"]["plain"]["values"], json!([[1, 0, 1]]));
        assert_eq!(geometry["material"]["summer"]["values"], json!([[null, 0, null]]));
        let rings = &geometry["texture"]["summer"]["values"][0];
        let outer = json!([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(shown(&document, &rings[0][0]), json!(["looks/a.jpg", outer]));
        assert_eq!((&rings[0][1], &rings[2]), (&json!([null]), &json!([[null]])), "the hole, and the roof");
        // The wall is turned round, and its coordinates with it.
        let left = json!([[1.0, 1.0], [0.5, 0.75], [0.0, 0.25]]);
        assert_eq!(shown(&document, &rings[1][0]), json!(["looks/a.jpg", left]));
        let left_out: Vec<(&str, usize)> = model.left_out.iter().map(|(what, &count)| (what.as_str(), count)).collect();
        let expected = [
            ("georeferenced textures", 1),
            ("materials and textures of back sides", 1),
            ("materials of surfaces that are not there", 2),
            ("texture coordinates that fit no ring", 1),
        ];
        assert_eq!(left_out, expected);
    }
}

/// CityGML 3 names rings in elements, and its images may be of kinds that CityJSON does not know.
#[test]
fn the_appearance_of_citygml_3() {
    let association = |ring: &str| {
        format!(
            "<app:textureParameterization><app:TextureAssociation><app:target>#x</app:target><app:textureParameterization>\
             <app:TexCoordList><app:textureCoordinates>0 0 1 0 1 1</app:textureCoordinates><app:ring>#{ring}</app:ring>\
             </app:TexCoordList></app:textureParameterization></app:TextureAssociation></app:textureParameterization>"
        )
    };
    let texture = |image: &str, ring: &str| {
        format!(
            "<app:surfaceData><app:ParameterizedTexture><app:imageURI>{image}</app:imageURI>{}</app:ParameterizedTexture>\
             </app:surfaceData>",
            association(ring)
        )
    };
    let in_object = format!(
        "<core:appearance><app:Appearance><app:theme>t</app:theme>{}{}</app:Appearance></core:appearance>",
        texture("a.PNG", "hole"),
        texture("b.tif", "left")
    );
    let (model, document) = converted(&city_gml("3.0", &in_object, ""));
    assert_eq!(document["appearance"]["textures"], json!([{ "type": "PNG", "image": "a.PNG" }]));
    let rings = &document["CityObjects"]["b"]["geometry"][0]["texture"]["t"]["values"][0];
    assert_eq!(rings[0][0], json!([null]));
    let uv = json!([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    assert_eq!(shown(&document, &rings[0][1]), json!(["a.PNG", uv]));
    assert_eq!(model.left_out["textures whose image is neither PNG nor JPEG"], 1);
}

/// References that lead nowhere cost themselves, and the number of themes is limited.
#[test]
fn broken_references_of_cityjson_are_counted() {
    let mut document = json!({
        "type": "CityJSON", "version": "2.0", "transform": { "scale": [1, 1, 1], "translate": [0, 0, 0] },
        "appearance": {
            "materials": [{ "name": "m" }, 7], "textures": [{ "type": "PNG", "image": "a.png" }],
            "vertices-texture": [[0, 0], [1, 0], [1, 1]],
        },
        "CityObjects": { "b": { "type": "Building", "geometry": [{
            "type": "MultiSurface", "lod": "2", "boundaries": [[[0, 1, 2]], [[0, 1, 3]]],
            "material": { "a": { "values": [0, 1] }, "b": { "value": 5 }, "c": { "values": "none" }, "d": { "values": null } },
            "texture": { "a": { "values": [[[0, 0, 1, 2]], [[0, 0, 1]]] }, "b": { "values": [[[0, 0, 1, 9]]] } },
        }] } },
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    });
    let (model, written) = converted(&document.to_string());
    assert_eq!(model.left_out["invalid references to materials and textures"], 5);
    let geometry = &written["CityObjects"]["b"]["geometry"][0];
    assert_eq!(geometry["material"], json!({ "a": { "values": [0, null] } }));
    assert_eq!(geometry["texture"], json!({ "a": { "values": [[[0, 0, 1, 2]], [[null]]] } }));
    let shape = &mut document["CityObjects"]["b"]["geometry"][0];
    shape["material"] =
        (0..1000).map(|i| (format!("t{i}"), json!({ "value": 0 }))).collect::<serde_json::Map<_, _>>().into();
    let (model, _) = converted(&document.to_string());
    assert_eq!((model.appearance.themes.len(), model.left_out["themes"]), (64, 1000 - 64 + 2));
}

/// Replaces the numbers in the appearance of all geometries by what they stand for.
fn resolved(document: &Value) -> Vec<Value> {
    fn rings(document: &Value, values: &Value) -> Value {
        match values.as_array() {
            Some(list) if list.first().is_some_and(|first| !first.is_array()) => shown(document, values),
            // One null may stand for all rings of a surface.
            Some(list) if list.iter().all(|ring| *ring == json!([null])) => Value::Null,
            Some(list) => list.iter().map(|below| rings(document, below)).collect(),
            None => values.clone(),
        }
    }
    fn leaves(document: &Value, values: &Value, found: &mut Vec<Value>) {
        match values {
            Value::Array(list) => list.iter().for_each(|below| leaves(document, below, found)),
            Value::Number(n) => found.push(document["appearance"]["materials"][n.as_u64().unwrap() as usize].clone()),
            _ => found.push(Value::Null),
        }
    }
    let mut all = Vec::new();
    for object in document["CityObjects"].as_object().unwrap().values() {
        for geometry in object["geometry"].as_array().into_iter().flatten() {
            for (theme, texture) in geometry["texture"].as_object().into_iter().flatten() {
                all.push(json!([theme, rings(document, &texture["values"])]));
            }
            for (theme, material) in geometry["material"].as_object().into_iter().flatten() {
                let mut found = Vec::new();
                leaves(document, material.get("value").unwrap_or(&material["values"]), &mut found);
                if material.get("value").is_none() {
                    all.push(json!([theme, found]));
                }
            }
        }
    }
    all
}

#[test]
fn real_cityjson_keeps_its_appearance() {
    let Some(folder) = testing::shared_data("city") else { return };
    let cases = folder.join("corpus/cases/conformance/v2_0");
    let names = [
        "appearance_complete",
        "geometry_texture_solid",
        "geometry_texture_multisolid",
        "geometry_texture_multisurface",
        "geometry_material_solid",
        "geometry_material_multisolid",
        "geometry_material_multisurface",
    ];
    let mut files: Vec<PathBuf> = names.iter().map(|name| cases.join(name).join(format!("{name}.city.json"))).collect();
    files.push(folder.join("cjio/tests/data/rotterdam/rotterdam_subset.json"));
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        let (model, written) = converted(&text);
        let source: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(model.left_out.values().sum::<usize>(), 0, "{}: {:?}", path.display(), model.left_out);
        let (old, new) = (resolved(&source), resolved(&written));
        assert!(old.iter().all(|looks| new.contains(looks)), "{}", path.display());
        for key in ["default-theme-texture", "default-theme-material"] {
            assert_eq!(source["appearance"].get(key), written["appearance"].get(key), "{}", path.display());
        }
    }
}

/// Each of the 39 polygons of a real file is the target of a material.
#[test]
fn real_citygml_keeps_its_materials() {
    let Some(folder) = testing::shared_data("city/val3dity/gml") else { return };
    let model = read(&folder.join("DenHaag_1BwBP.gml")).unwrap().model;
    let painted = |s: &&SurfacePolygon| s.appearance.as_ref().is_some_and(|a| !a.materials.is_empty());
    assert_eq!((model.surfaces().filter(painted).count(), model.surfaces().count()), (39, 39));
    assert!(model.left_out.is_empty(), "{:?}", model.left_out);
}

/// An image beside the source is found from another folder.
#[test]
fn paths_of_images_lead_from_the_new_file() {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("in"), folder.path().join("out/deep"));
    for path in [&from, &to] {
        std::fs::create_dir_all(path).unwrap();
    }
    let image = |path: &str| json!({ "type": "PNG", "image": path });
    let mut model = CityModel::default();
    for path in ["a/b.png", "/root.png", "https://example.org/c.png"] {
        model.appearance.textures.push(image(path).as_object().unwrap().clone());
    }
    let images = |model: &CityModel| model.appearance.textures.iter().map(|t| t["image"].clone()).collect::<Vec<_>>();
    let before = images(&model);
    move_images(&mut model, &from.join("x.gml"), &from.join("y.json"));
    assert_eq!(images(&model), before, "the same folder");
    move_images(&mut model, &from.join("x.gml"), &to.join("y.json"));
    assert_eq!(images(&model), [json!("../../in/a/b.png"), before[1].clone(), before[2].clone()]);
}
