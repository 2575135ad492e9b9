//! Reads CityGML, OBJ and PLY, and refuses invalid and hostile files with a number and a place.

use std::path::{Path, PathBuf};

use city::{
    BuildingRole, DefectCode, GeometryKind, MeshConfig, ModelPoint, ObjectStatus, Scope, SurfaceClass, TriangleMesh,
    check_solids,
};
use cityfiles::{CityError, CityFile, CityFormat, read};

fn read_bytes(bytes: impl AsRef<[u8]>) -> Result<CityFile, CityError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model");
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

fn codes(file: &CityFile) -> Vec<u16> {
    file.defects.iter().map(|defect| defect.code.number()).collect()
}

/// Compares the number, the place and the words of a refusal.
#[track_caller]
fn refused(bytes: impl AsRef<[u8]>, code: u16, place: &str, words: &str) {
    match read_bytes(bytes) {
        Err(CityError::Refused { fault, .. }) => {
            assert!(fault.what.contains(words), "{fault}");
            assert_eq!((fault.code.number(), fault.place.as_str()), (code, place), "{fault}");
        }
        other => panic!("expected a refusal, found {other:?}"),
    }
}

fn polygon(id: &str, ring: &str) -> String {
    format!(
        "<gml:Polygon gml:id=\"{id}\"><gml:exterior><gml:LinearRing><gml:posList srsDimension=\"3\">{ring}</gml:posList>\
         </gml:LinearRing></gml:exterior></gml:Polygon>"
    )
}

/// Makes a CityGML document around the content of a building.
fn gml(version: &str, content: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<core:CityModel xmlns:core=\"http://www.opengis.net/citygml/{version}\" \
         xmlns:bldg=\"http://www.opengis.net/citygml/building/{version}\" xmlns:gml=\"http://www.opengis.net/gml\" \
         xmlns:xlink=\"http://www.w3.org/1999/xlink\">\n<gml:boundedBy><gml:Envelope \
         srsName=\"urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH\"/></gml:boundedBy>\n\
         <core:cityObjectMember><bldg:Building gml:id=\"b\">{content}</bldg:Building></core:cityObjectMember>\n\
         </core:CityModel>"
    )
}

const RINGS: [(&str, &str, &str); 4] = [
    ("g", "GroundSurface", "0 0 0 0 4 0 4 0 0 0 0 0"),
    ("w", "WallSurface", "0 0 0 4 0 0 0 0 3 0 0 0"),
    ("v", "WallSurface", "0 0 0 0 0 3 0 4 0 0 0 0"),
    ("r", "RoofSurface", "4 0 0 0 4 0 0 0 3 4 0 0"),
];

fn boundaries() -> String {
    let one = |(id, class, ring): &(&str, &str, &str)| {
        format!(
            "<bldg:boundedBy><bldg:{class}><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>{}\
             </gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:{class}></bldg:boundedBy>",
            polygon(id, ring)
        )
    };
    RINGS.iter().map(one).collect()
}

fn solid(links: &[&str]) -> String {
    let link = |id: &&str| format!("<gml:surfaceMember xlink:href=\"{id}\"/>");
    let links: String = links.iter().map(link).collect();
    format!(
        "<bldg:lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface>{links}</gml:CompositeSurface></gml:exterior>\
         </gml:Solid></bldg:lod2Solid>"
    )
}

fn classes(file: &CityFile, geometry: usize) -> Vec<SurfaceClass> {
    file.model.objects[0].geometries[geometry].surfaces.iter().map(|surface| surface.class).collect()
}

use SurfaceClass::{Ground, Roof, Unclassified, Wall};

#[test]
fn a_solid_takes_its_classes_from_the_surfaces_it_links_to() {
    for version in ["1.0", "2.0", "3.0"] {
        let text = gml(version, &format!("{}{}", solid(&["#g", "#w", "#v", "#r"]), boundaries()));
        let file = read_bytes(&text).unwrap();
        assert_eq!(file.format, CityFormat::CityGml(version.to_owned()));
        assert_eq!((file.model.crs.epsg, file.model.crs.vertical_epsg), (Some(25832), Some(7837)));
        assert!(file.defects.is_empty(), "{:?}", file.defects);
        let object = &file.model.objects[0];
        assert_eq!((object.id.as_str(), object.kind.role(), object.geometries.len()), ("b", BuildingRole::Building, 1));
        assert_eq!(object.geometries[0].kind, GeometryKind::Solid);
        assert_eq!(classes(&file, 0), [Ground, Wall, Wall, Roof]);
        assert_eq!(file.model.vertices.len(), 4);
        let meshed = TriangleMesh::from_model(&file.model, &MeshConfig::default()).unwrap();
        assert_eq!(meshed.objects[0].status, ObjectStatus::Used { triangles: 4 });
        assert!(meshed.defects.is_empty(), "{:?}", meshed.defects);
    }
}

#[test]
fn surfaces_that_link_to_a_solid_give_it_their_class() {
    let polygons: String = RINGS.iter().map(|(id, _, ring)| polygon(id, ring)).collect();
    let shell = solid(&[]).replace(
        "</gml:CompositeSurface>",
        &format!("<gml:surfaceMember>{polygons}</gml:surfaceMember></gml:CompositeSurface>"),
    );
    let roof = "<bldg:boundedBy><bldg:RoofSurface><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember \
                xlink:href=\"#r\"/></gml:MultiSurface></bldg:lod2MultiSurface></bldg:RoofSurface></bldg:boundedBy>";
    let file = read_bytes(gml("2.0", &format!("{shell}{roof}"))).unwrap();
    assert_eq!(file.model.objects[0].geometries.len(), 1);
    assert_eq!(classes(&file, 0), [Unclassified, Unclassified, Unclassified, Roof]);
}

#[test]
fn links_stay_in_the_file() {
    let lost = ["#nobody", "other.gml#g", "http://example.org/x#g", "file:///etc/passwd", "g"];
    let file = read_bytes(gml("2.0", &format!("{}{}", solid(&[&["#g"], &lost[..]].concat()), boundaries()))).unwrap();
    assert_eq!(codes(&file), [1006; 5]);
    let kinds: Vec<_> = file.model.objects[0].geometries.iter().map(|g| (g.kind, g.surfaces.len())).collect();
    assert_eq!(kinds, [(GeometryKind::Solid, 1), (GeometryKind::MultiSurface, 3)]);
}

#[test]
fn parts_shells_and_turned_surfaces() {
    let part = format!(
        "<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id=\"p\"><bldg:lod1Solid><gml:Solid><gml:exterior>\
         <gml:CompositeSurface><gml:surfaceMember>{a}</gml:surfaceMember></gml:CompositeSurface></gml:exterior>\
         <gml:interior><gml:CompositeSurface><gml:surfaceMember><gml:OrientableSurface orientation=\"-\"><gml:baseSurface>\
         {b}</gml:baseSurface></gml:OrientableSurface></gml:surfaceMember></gml:CompositeSurface></gml:interior></gml:Solid>\
         </bldg:lod1Solid></bldg:BuildingPart></bldg:consistsOfBuildingPart>",
        a = polygon("a", RINGS[0].2),
        b = polygon("c", RINGS[1].2),
    );
    let file = read_bytes(gml("2.0", &part)).unwrap();
    assert!(file.defects.is_empty(), "{:?}", file.defects);
    assert_eq!(file.model.objects[1].parent, Some(0));
    let surfaces = &file.model.objects[1].geometries[0].surfaces;
    assert_eq!(surfaces.iter().map(|s| s.shell).collect::<Vec<_>>(), [0, 1]);
    let corners: Vec<ModelPoint> = surfaces[1].rings[0].iter().map(|&i| file.model.vertices[i as usize]).collect();
    let point = ModelPoint::new;
    assert_eq!(corners, [point(0.0, 0.0, 3.0), point(4.0, 0.0, 0.0), point(0.0, 0.0, 0.0)]);
}

#[test]
fn broken_polygons_cost_themselves() {
    let with = |ring: &str| {
        let surface = format!(
            "<bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>{}</gml:surfaceMember><gml:surfaceMember>{}\
             </gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface>",
            polygon("x", ring),
            polygon("y", RINGS[0].2)
        );
        let file = read_bytes(gml("2.0", &surface)).unwrap();
        assert_eq!(file.model.validate(), Ok(()));
        (file.model.objects[0].geometries[0].surfaces.len(), codes(&file))
    };
    assert_eq!(with("0 0 0 1 0 0 1 1 0 0 0 0"), (2, vec![]));
    assert_eq!(with("0 0 0 1 0 0 1 1 0"), (2, vec![103]));
    assert_eq!(with("0 0 0 1 0 0 1 1"), (1, vec![1002]));
    assert_eq!(with("0 0 0 1 0 0 NaN 1 0 0 0 0"), (1, vec![1002]));
    assert_eq!(with("0 0 0 1 0 0 1e400 1 0 0 0 0"), (1, vec![1002]));
    assert_eq!(with("0 0 0 1 0 0 one 1 0 0 0 0"), (1, vec![1002]));
    assert_eq!(with("0 0 0 1 0 0 &lol; 1 0 0 0 0"), (1, vec![1002]));
    let flat = gml("2.0", &format!("<bldg:lod0FootPrint>{}</bldg:lod0FootPrint>", polygon("x", "0 0 1 0 1 1 0 0")));
    assert_eq!(codes(&read_bytes(flat.replace("srsDimension=\"3\"", "srsDimension=\"2\"")).unwrap()), [904, 902]);
}

/// Makes an implicit geometry of the elements of its placement and its shape.
fn implicit(placement: &str, shape: &str) -> String {
    format!(
        "<bldg:lod2ImplicitRepresentation><core:ImplicitGeometry>{placement}{shape}</core:ImplicitGeometry>\
         </bldg:lod2ImplicitRepresentation>"
    )
}

#[test]
fn implicit_geometries_are_placed() {
    let at = |x: f64| {
        format!("<core:referencePoint><gml:Point><gml:pos>{x} 5700000 30</gml:pos></gml:Point></core:referencePoint>")
    };
    // A quarter turn counter-clockwise, twice the height, one metre up.
    let matrix = "<core:transformationMatrix>0 -1 0 0 1 0 0 0 0 0 2 1 0 0 0 1</core:transformationMatrix>";
    let shape = format!(
        "<core:relativeGMLGeometry><gml:MultiSurface gml:id=\"shape\"><gml:surfaceMember>{}</gml:surfaceMember>\
         </gml:MultiSurface></core:relativeGMLGeometry>",
        polygon("p", "0 0 0 4 0 0 0 3 5 0 0 0")
    );
    let again = "<core:relativeGMLGeometry xlink:href=\"#shape\"/>";
    let both = implicit(&at(500_000.0), again) + &implicit(&format!("{matrix}{}", at(600_000.0)), &shape);
    for version in ["1.0", "2.0", "3.0"] {
        let text = gml(version, &both)
            .replace("relativeGMLGeometry", if version == "3.0" { "relativeGeometry" } else { "relativeGMLGeometry" });
        let file = read_bytes(text).unwrap();
        assert!(file.defects.is_empty(), "{:?}", file.defects);
        let geometries = &file.model.objects[0].geometries;
        let corners = |geometry: usize| -> Vec<ModelPoint> {
            geometries[geometry].surfaces[0].rings[0].iter().map(|&v| file.model.vertices[v as usize]).collect()
        };
        let point = |x: f64, y: f64, z: f64| ModelPoint::new(x, 5_700_000.0 + y, z);
        let plain = [point(500_000.0, 0.0, 30.0), point(500_004.0, 0.0, 30.0), point(500_000.0, 3.0, 35.0)];
        let turned = [point(600_000.0, 0.0, 31.0), point(600_000.0, 4.0, 31.0), point(599_997.0, 0.0, 41.0)];
        assert_eq!((geometries.len(), corners(0), corners(1)), (2, plain.to_vec(), turned.to_vec()));
    }
    let refused = |content: &str, expected: &[u16], words: &str| {
        let file = read_bytes(gml("2.0", content)).unwrap();
        assert_eq!(codes(&file), expected, "{:?}", file.defects);
        assert!(file.defects[0].detail.contains(words), "{:?}", file.defects);
        assert!(file.model.objects[0].geometries.is_empty());
    };
    let library = "<core:libraryObject>file:///etc/passwd</core:libraryObject>";
    refused(&implicit(&at(0.0), library), &[904], "not opened");
    refused(&implicit("", ""), &[902], "without a shape");
    refused(&implicit("", &shape), &[1006], "referencePoint");
    refused(&implicit(&at(0.0).replace("0 5700000", "x 5700000"), &shape), &[1002], "\"x\"");
    refused(&implicit(&format!("{}{}", at(0.0), matrix.replace(" 1<", "<")), &shape), &[1006], "16 numbers");
    refused(
        &implicit(&format!("{}{}", at(0.0), matrix.replace(" 1<", " NaN<").replace(">0 ", ">inf ")), &shape),
        &[1002],
        "",
    );
    refused(&implicit(&at(0.0), "<core:relativeGMLGeometry xlink:href=\"other.gml#shape\"/>"), &[1006], "other.gml");
}

#[test]
fn a_property_may_be_a_link() {
    let link = "<bldg:lod2MultiSurface xlink:href=\"#m\"/>";
    let shared = format!(
        "<bldg:lod1MultiSurface><gml:MultiSurface gml:id=\"m\"><gml:surfaceMember>{}</gml:surfaceMember>\
         </gml:MultiSurface></bldg:lod1MultiSurface>",
        polygon("p", RINGS[0].2)
    );
    let file = read_bytes(gml("2.0", &format!("{link}{shared}"))).unwrap();
    assert!(file.defects.is_empty(), "{:?}", file.defects);
    assert_eq!(file.model.objects[0].geometries.iter().map(|g| g.surfaces.len()).collect::<Vec<_>>(), [1, 1]);
}

#[test]
fn hostile_xml_is_refused() {
    let laughs = format!(
        "<?xml version=\"1.0\"?>\n<!DOCTYPE lolz [<!ENTITY lol \"lol\">{}]>\n{}",
        (1..10).map(|i| format!("<!ENTITY lol{i} \"{}\">", format!("&lol{};", i - 1).repeat(10))).collect::<String>(),
        gml("2.0", "&lol9;").split_once('\n').unwrap().1
    );
    refused(&laughs, 901, "line 2", "DTD");
    refused("<!DOCTYPE x SYSTEM \"file:///etc/passwd\"><x/>", 901, "line 1", "DTD");
    refused(gml("2.0", &format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000))), 901, "line 4", "nested");
    refused(gml("2.0", "<a>"), 901, "line 4", "invalid XML");
    let whole = gml("2.0", &boundaries());
    refused(&whole[..whole.len() - 30], 901, "line 4", "");
    refused("<core:IndoorFeatures/>", 904, "line 1", "IndoorFeatures");
    refused("<CityModel xmlns=\"http://example.org\"/>", 904, "line 1", "no namespace");
    refused("<", 901, "line 1", "");
    refused(b"<?xml version=\"1.0\"?><a>\xff\xfe</a>", 901, "byte 24", "UTF-8");
    let attributes: String = (0..1000).map(|i| format!(" a{i}=\"\"")).collect();
    refused(gml("2.0", &format!("<a{attributes}/>")), 901, "line 4", "attributes");
}

#[test]
fn links_that_multiply_are_refused() {
    // Each set links ten times to the set before it, which makes 10^9 surfaces when all links are
    // followed.
    let set = |i: usize, target: String| {
        let links = format!("<gml:surfaceMember xlink:href=\"#{target}\"/>").repeat(300);
        format!(
            "<bldg:lod2MultiSurface><gml:MultiSurface gml:id=\"s{i}\">{links}</gml:MultiSurface></bldg:lod2MultiSurface>"
        )
    };
    let first = format!(
        "<bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>{}</gml:surfaceMember></gml:MultiSurface>\
         </bldg:lod2MultiSurface>",
        polygon("s0", RINGS[0].2)
    );
    let sets: String = (1..6).map(|i| set(i, format!("s{}", i - 1))).collect();
    refused(gml("2.0", &format!("{first}{sets}")), 904, "line 4", "links");
    let circle = format!("{}{}", set(1, "s2".to_owned()), set(2, "s1".to_owned()));
    assert!(read_bytes(gml("2.0", &circle)).is_ok_and(|file| codes(&file).iter().all(|&code| code == 1006)));
}

#[test]
fn latin_1_is_read_where_it_is_declared() {
    let text = gml("2.0", "").replace("version=\"1.0\"?>", "version=\"1.0\" encoding=\"ISO-8859-1\"?>");
    let mut bytes = text.replace("gml:id=\"b\"", "gml:id=\"M?nchen\"").into_bytes();
    let at = bytes.iter().position(|&b| b == b'M').and_then(|_| bytes.windows(2).position(|w| w == b"M?")).unwrap() + 1;
    bytes[at] = 0xfc;
    assert_eq!(read_bytes(bytes).unwrap().model.objects[0].id, "München");
}

#[test]
fn wavefront_obj() {
    let text = "# a tent\nmtllib none.mtl\no tent one\nv 0 0 0\nv 4 0 0 1 0 0\nv 4 4 0\nv 0 4 0\nv 2 2 3\n\
        usemtl GroundSurface\nf 1 4 3 2\nusemtl RoofSurface\nf 1/1/1 2/2/1 5//1\nf -4 -3 \\\n -1\nusemtl tiles\nf 3 4 5\n\
        o tent two\nf 4 1 5\n";
    let file = read_bytes(text).unwrap();
    assert_eq!((file.format.clone(), codes(&file)), (CityFormat::Obj, vec![1010]));
    let names: Vec<_> = file.model.objects.iter().map(|o| (o.id.as_str(), o.geometries[0].surfaces.len())).collect();
    assert_eq!(names, [("tent one", 4), ("tent two", 1)]);
    assert_eq!(classes(&file, 0), [Ground, Roof, Roof, Unclassified]);
    assert_eq!(file.model.objects[0].geometries[0].surfaces[2].rings[0], [1, 2, 4]);
    for (face, code) in
        [("0 1 2", 1001), ("1 2 9", 1001), ("1 2 -9", 1001), ("1 2 x", 1001), ("1 2 99999999999999999999", 1001)]
    {
        let file = read_bytes(format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {face}\n")).unwrap();
        assert_eq!(codes(&file), [1010, code], "{face}");
    }
    assert_eq!(codes(&read_bytes("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n").unwrap()), [1010, 1002]);
    refused("v 0 0\n", 901, "line 1", "three coordinates");
    refused("# x\nv 0 0 zero\n", 901, "line 2", "zero");
    refused("nothing of this kind", 904, "line 1", "neither CityJSON nor CityGML");
}

/// A PLY file of a triangle and a quadrilateral, with properties that are skipped.
fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment x\nelement vertex 4\nproperty double x\nproperty uchar red\nproperty float y\n\
         property float z\nelement face 2\nproperty list uchar int vertex_indices\nproperty list ushort float extra\n\
         element edge 1\nproperty int vertex1\nend_header\n"
    )
    .into_bytes();
    let points = [(0.0f64, 0.0f32, 0.0f32), (500_000.25, 0.0, 0.5), (4.0, 4.0, 0.0), (0.0, 4.0, -1.5)];
    if format == "ascii" {
        points.iter().for_each(|(x, y, z)| bytes.extend(format!("{x} 7 {y} {z}\n").bytes()));
        bytes.extend(b"3 0 1 2 0\n4 0 1 2 3 1 9.5\n7\n");
        return bytes;
    }
    let big = format == "binary_big_endian";
    let mut put = |le: &[u8]| if big { bytes.extend(le.iter().rev()) } else { bytes.extend(le) };
    for (x, y, z) in points {
        put(&x.to_le_bytes());
        put(&[7]);
        put(&y.to_le_bytes());
        put(&z.to_le_bytes());
    }
    for (corners, extra) in [(&[0i32, 1, 2][..], &[][..]), (&[0, 1, 2, 3], &[9.5f32])] {
        put(&[corners.len() as u8]);
        corners.iter().for_each(|c| put(&c.to_le_bytes()));
        put(&(extra.len() as u16).to_le_bytes());
        extra.iter().for_each(|e| put(&e.to_le_bytes()));
    }
    put(&7i32.to_le_bytes());
    bytes
}

#[test]
fn ply_in_three_encodings() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let whole = ply(format);
        let file = read_bytes(&whole).unwrap();
        assert_eq!((file.format.clone(), codes(&file)), (CityFormat::Ply, vec![1010]));
        let rings: Vec<_> = file.model.objects[0].geometries[0].surfaces.iter().map(|s| s.rings[0].clone()).collect();
        assert_eq!(rings, [vec![0, 1, 2], vec![0, 1, 2, 3]], "{format}");
        assert_eq!(file.model.vertices[1], ModelPoint::new(500_000.25, 0.0, 0.5));
        assert_eq!(file.model.vertices[3].z, -1.5);
        for end in 4..whole.len() - 2 {
            assert!(read_bytes(&whole[..end]).is_err(), "{format} cut at {end}");
        }
    }
}

#[test]
fn comments_say_where_a_mesh_is() {
    let with = |comments: &str| {
        let text = String::from_utf8(ply("ascii")).unwrap();
        read_bytes(text.replacen("comment x\n", comments, 1)).unwrap()
    };
    let file = with("comment crs EPSG:25832+7837\ncomment origin 1000 2000 -3\n");
    assert!(codes(&file).is_empty(), "{:?}", file.defects);
    assert_eq!((file.model.crs.epsg, file.model.crs.vertical_epsg), (Some(25832), Some(7837)));
    assert_eq!(file.model.vertices[1], ModelPoint::new(501_000.25, 2000.0, -2.5));
    assert_eq!(codes(&with("comment crs unknown\n")), [1010]);
    assert_eq!(with("comment origin 1 2 inf\n").model.vertices[1], ModelPoint::new(500_000.25, 0.0, 0.5));
    let obj = |head: &str| read_bytes(format!("{head}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap();
    assert_eq!(obj("# made by hand\n# crs EPSG:7415\n").model.crs.epsg, Some(7415));
    assert_eq!(codes(&obj("# crs unknown\n")), [1010]);
}

#[test]
fn hostile_ply_is_refused() {
    let text = |from: &str, to: &str| String::from_utf8(ply("ascii")).unwrap().replacen(from, to, 1);
    refused(text("vertex 4", "vertex 18446744073709551615"), 901, "header", "announces");
    refused(text("vertex 4", "vertex 18446744073709551616"), 901, "line 4", "number of elements");
    refused(text("face 2", "face 4000000000"), 901, "header", "announces");
    refused(text("property double x\n", ""), 901, "header", "do not have the properties x, y and z");
    refused(text("ascii", "morse"), 904, "line 2", "not one of ascii");
    refused(text("list uchar int", "list float int"), 901, "line 10", "property");
    refused(text("element vertex 4\n", ""), 901, "line 4", "property");
    assert_eq!(codes(&read_bytes(text("3 0 1 2", "3 0 1 9")).unwrap()), [1010, 1001]);
    assert_eq!(codes(&read_bytes(text("3 0 1 2", "3 0 1 -1")).unwrap()), [1010, 1001]);
    assert!(read_bytes(text("3 0 1 2", "1e18 0 1 2")).is_err());
    let mut binary = ply("binary_little_endian");
    let at = binary.windows(10).position(|w| w == b"end_header").unwrap() + 11 + 4 * 17;
    binary[at] = 255;
    assert!(read_bytes(&binary).is_err());
}

fn city_data() -> Option<PathBuf> {
    testing::shared_data("city")
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() { files_below(&path, found) } else { found.push(path) }
    }
}

#[test]
fn everything_there_is_loads_or_is_refused() {
    let Some(folder) = city_data() else { return };
    let mut files = Vec::new();
    files_below(&folder, &mut files);
    files.sort();
    let (mut loaded, mut refusals) = (0, 0);
    for path in files {
        match read(&path) {
            Ok(file) => {
                loaded += 1;
                for scope in [Scope::Buildings, Scope::Everything] {
                    let config = MeshConfig { scope, ..MeshConfig::default() };
                    let meshed = TriangleMesh::from_model(&file.model, &config).unwrap();
                    assert_eq!(meshed.objects.len(), file.model.objects.len(), "{}", path.display());
                    assert_eq!(meshed.mesh.validate(), Ok(()));
                    let solids = check_solids(&file.model, &config).unwrap();
                    assert!(solids.iter().all(|defect| defect.code != DefectCode::NotChecked), "{}", path.display());
                }
            }
            Err(CityError::Refused { fault, .. }) => {
                assert!(!fault.place.is_empty(), "{}: {fault}", path.display());
                refusals += 1;
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(loaded > 100 && refusals > 100, "{loaded} files loaded, {refusals} refused");
}

#[test]
fn real_citygml() {
    let Some(folder) = city_data() else { return };
    // The numbers of solids or buildings, and of polygons, were counted with grep.
    for (name, format, used, polygons) in [
        ("nrw/data/GML/LoD2_32_280_5657_1_NW.gml", "CityGML 1.0", 113, 1144),
        ("berlin/data/examples/gml_data/Block020023.gml", "CityGML 2.0", 4, 97),
        ("berlin/data/examples/gml_data/20240216_PartialMierendorff.gml", "CityGML 2.0", 2, 167),
        ("njam/test/data/zurich-lod2-citygml1.xml", "CityGML 1.0", 6, 61),
        ("val3dity/gml/DenHaag_1BwBP.gml", "CityGML 1.0", 6, 39),
    ] {
        let file = read(&folder.join(name)).unwrap();
        assert_eq!(file.format.to_string(), format, "{name}");
        let meshed = TriangleMesh::from_model(&file.model, &MeshConfig::default()).unwrap();
        let found = meshed.objects.iter().filter(|o| matches!(o.status, ObjectStatus::Used { .. })).count();
        assert_eq!((found, meshed.mesh.surfaces.len()), (used, polygons), "{name}");
        let classed = meshed.mesh.surfaces.iter().filter(|s| s.class != Unclassified).count();
        assert_eq!(classed, polygons, "{name}: surfaces with a class");
    }
    let file = read(&folder.join("nrw/data/GML/LoD2_32_280_5657_1_NW.gml")).unwrap();
    assert_eq!((file.model.crs.epsg, file.model.crs.vertical_epsg), (Some(25832), Some(7837)));
}
