//! Broken and hostile RPC files are refused with an error that names the entry. None panics or
//! takes long.

use std::path::PathBuf;

use formats::rpc::{Fault, RpcFormat, RpcReadError, TEXT_LIMIT, read, read_for_image, to_text, write};
use proptest::prelude::*;
use tempfile::TempDir;

fn plain() -> camera::Rpc {
    let unit = |i: usize, value: f64| std::array::from_fn(|k| if k == i { value } else { 0.0 });
    camera::Rpc {
        line_off: 1000.0,
        samp_off: 2000.0,
        lat_off: 45.0,
        long_off: 7.0,
        height_off: 300.0,
        line_scale: 1000.0,
        samp_scale: 2000.0,
        lat_scale: 0.01,
        long_scale: 0.02,
        height_scale: 500.0,
        line_num: unit(2, -1.0),
        line_den: unit(0, 1.0),
        samp_num: unit(1, 1.0),
        samp_den: unit(0, 1.0),
        err_bias_m: Some(1.25),
        err_rand_m: None,
    }
}

fn text(format: RpcFormat) -> String {
    to_text(&plain(), format).expect("a format that is written")
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<camera::Rpc, RpcReadError> {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a file");
    read(&path).map(|f| f.rpc)
}

/// Reads a file of a known format and returns its defect.
fn fault(name: &str, content: &str) -> Fault {
    match read_bytes(name, content.as_bytes()) {
        Err(RpcReadError::Invalid { fault, .. }) => *fault,
        other => panic!("expected a fault, found {other:?}"),
    }
}

fn dimap(profile: &str, first: Option<u32>) -> String {
    let model: String = text(RpcFormat::Text)
        .lines()
        .filter(|l| l.contains("COEFF"))
        .filter_map(|l| l.split_once(": "))
        .map(|(k, v)| format!("<{k}>{v}</{k}>"))
        .collect();
    let scalars: String = text(RpcFormat::Text)
        .lines()
        .filter(|l| !l.contains("COEFF") && !l.contains("ERR"))
        .filter_map(|l| l.split_once(": "))
        .map(|(k, v)| format!("<{k}>{}</{k}>", v.split(' ').next().unwrap_or("")))
        .collect();
    let domain = first.map_or(String::new(), |n| {
        let first = format!("<FIRST_ROW>{n}</FIRST_ROW><FIRST_COL>{n}</FIRST_COL>");
        format!("<Direct_Model_Validity_Domain>{first}</Direct_Model_Validity_Domain>")
    });
    format!(
        "<Dimap_Document>\
         <Metadata_Identification><METADATA_PROFILE>{profile}</METADATA_PROFILE></Metadata_Identification>\
         <Rational_Function_Model><Global_RFM><Inverse_Model>{model}</Inverse_Model>\
         <RFM_Validity>{domain}{scalars}</RFM_Validity></Global_RFM></Rational_Function_Model></Dimap_Document>"
    )
}

#[test]
fn every_missing_entry_is_named() {
    let whole = text(RpcFormat::Text);
    for line in whole.lines().filter(|l| !l.starts_with("ERR")) {
        let key = line.split(':').next().expect("a key");
        let without: String = whole.lines().filter(|l| *l != line).map(|l| format!("{l}\n")).collect();
        assert_eq!(fault("a.txt", &without), Fault::Missing { key: key.to_owned() });
    }
}

#[test]
fn numbers_that_are_none_are_named_with_their_line() {
    let whole = text(RpcFormat::Text);
    let line_of = |key: &str| whole.lines().position(|l| l.starts_with(key)).map(|i| i + 1);
    let with = |key: &str, value: &str| {
        let replaced =
            whole.lines().map(|l| if l.starts_with(key) { format!("{key}: {value}\n") } else { format!("{l}\n") });
        fault("a.txt", &replaced.collect::<String>())
    };
    let scalars = whole.lines().filter_map(|line| line.split_once(':')).map(|(key, _)| key);
    let keys: Vec<&str> = scalars.filter(|key| key.ends_with("_OFF") || key.ends_with("_SCALE")).collect();
    assert_eq!(keys.len(), 10, "{keys:?}");
    for key in keys {
        let (owned, line) = (key.to_owned(), line_of(key));
        for value in ["nan", "inf", "-infinity", "1e999"] {
            assert!(matches!(with(key, value), Fault::NotFinite { key: k, line: l, .. } if k == owned && l == line));
        }
        let comma = Fault::DecimalComma { key: owned.clone(), line, text: "12,5".to_owned() };
        assert_eq!(with(key, "12,5 pixels"), comma);
        for value in ["", "pixels", "1 2", "1 pixels 2", "0x10"] {
            assert!(matches!(with(key, value), Fault::NotANumber { key: k, line: l, .. } if k == owned && l == line));
        }
        if key.ends_with("SCALE") {
            assert_eq!(with(key, "0"), Fault::ZeroScale { key: owned });
        }
    }
    assert!(matches!(with("LAT_OFF", "91"), Fault::NoCamera(_)));
}

#[test]
fn extra_and_repeated_entries_are_named() {
    let whole = text(RpcFormat::Text);
    let line = Some(whole.lines().count() + 1);
    for key in ["LINE_NUM_COEFF_21", "LINE_NUM_COEFF_0", "SAMP_DEN_COEFF_99999999999999999999"] {
        let extra = Fault::Extra { key: key.to_owned(), line };
        assert_eq!(fault("a.txt", &format!("{whole}{key}: 1\n")), extra);
    }
    let again = Fault::Duplicate { key: "LINE_OFF".to_owned(), line };
    assert_eq!(fault("a.txt", &format!("{whole}LINE_OFF: 1\n")), again);
    let json = text(RpcFormat::Json).replacen('{', "{\"row_offset\": 1,", 1);
    assert_eq!(fault("a.json", &json), Fault::Duplicate { key: "row_offset".to_owned(), line: None });
}

#[test]
fn lists_of_the_wrong_length_are_counted() {
    let rpb = text(RpcFormat::Rpb);
    let short = rpb.replacen("\t\t\t0e0,\n", "", 1);
    assert!(
        matches!(fault("a.RPB", &short), Fault::Count { key, found: 19, expected: 20, .. } if key == "lineNumCoef")
    );
    let long = rpb.replacen("\t\t\t0e0,\n", &"\t\t\t0e0,\n".repeat(1_000_000), 1);
    assert!(matches!(fault("a.RPB", &long), Fault::Count { key, found: 21, .. } if key == "lineNumCoef"));
    let zeros = vec!["0"; 1_000_000].join(",");
    let json = text(RpcFormat::Json).replacen("\"row_num\": [", &format!("\"row_num\": [{zeros},"), 1);
    assert!(matches!(fault("a.json", &json), Fault::Count { key, found: 21, .. } if key == "row_num"));
    let open = rpb.split(')').next().expect("the beginning");
    assert!(matches!(fault("a.RPB", open), Fault::Syntax { what, .. } if what.contains("lineNumCoef")));
}

#[test]
fn a_million_coefficients_and_a_million_lines_are_refused() {
    let many: String = (1..=1_000_000).map(|i| format!("LINE_NUM_COEFF_{i}: 0\n")).collect();
    assert!(matches!(fault("a.txt", &many), Fault::Extra { line: Some(21), .. }));
    let deep = "<a>".repeat(1_000_000);
    let document = format!("<isd><RPB>{deep}");
    assert!(matches!(fault("a.xml", &document), Fault::Syntax { what, .. } if what.contains("nested")));
    let attributes: String = (0..100_000).map(|i| format!(" a{i}=\"\"")).collect();
    let document = format!("<isd{attributes}><RPB></RPB></isd>");
    assert!(matches!(fault("a.xml", &document), Fault::Syntax { what, .. } if what.contains("attributes")));
    let nested = format!("{{\"rpc\": {}", "[".repeat(1_000_000));
    assert!(matches!(fault("a.json", &nested), Fault::Syntax { .. }));
}

#[test]
fn xml_with_a_dtd_is_refused() {
    let body = dimap("PHR_SENSOR", Some(1));
    let bomb = format!("<!DOCTYPE d [<!ENTITY x SYSTEM \"file:///etc/passwd\">]>{body}");
    assert!(matches!(fault("a.xml", &bomb), Fault::Syntax { what, .. } if what.contains("DTD")));
    let reference = body.replacen("<LINE_OFF>1000", "<LINE_OFF>&x;1000", 1);
    assert!(matches!(fault("a.xml", &reference), Fault::Syntax { what, .. } if what.contains("&x;")));
}

#[test]
fn dimap_counts_pixels_as_its_domain_or_its_sensor_says() {
    for (profile, first, expected, warned) in [
        ("PHR_SENSOR", Some(1), 999.0, false),
        ("S6_SENSOR", None, 999.0, false),
        ("PNEO_SENSOR", Some(0), 1000.0, false),
        ("PNEO_SENSOR", None, 1000.0, false),
        ("PHR_SENSOR", Some(0), 1000.0, true),
        ("OTHER", Some(1), 999.0, false),
        ("OTHER", None, 999.0, true),
    ] {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join("RPC.XML");
        std::fs::write(&path, dimap(profile, first)).expect("a file");
        let file = read(&path).expect("an RPC");
        assert_eq!((file.rpc.line_off, !file.warnings.is_empty()), (expected, warned), "{profile} {first:?}");
    }
}

#[test]
fn a_virtual_raster_opens_no_source() {
    let items: String = text(RpcFormat::Text)
        .lines()
        .filter_map(|l| l.split_once(": "))
        .map(|(k, v)| format!("<MDI key=\"{k}\">{}</MDI>", v.split(' ').next().unwrap_or("")))
        .collect();
    let vrt = |domain: &str| {
        format!(
            "<VRTDataset rasterXSize=\"1\" rasterYSize=\"1\"><Metadata domain=\"{domain}\">{items}</Metadata>\
             <VRTRasterBand dataType=\"Byte\" band=\"1\">\
             <SimpleSource><SourceFilename>/vsicurl/http://127.0.0.1:9/x.tif</SourceFilename>\
             </SimpleSource></VRTRasterBand></VRTDataset>"
        )
    };
    assert_eq!(read_bytes("a.vrt", vrt("RPC").as_bytes()).expect("an RPC"), plain());
    let none = read_bytes("a.vrt", vrt("IMD").as_bytes());
    assert!(matches!(none, Err(RpcReadError::NotRpc { .. })), "{none:?}");
}

#[test]
fn an_adjusted_or_old_geom_is_refused() {
    let coefficients = |name: &str, one: usize| -> String {
        (0..20).map(|i| format!("{name}_{i:02}:  {}\n", if i == one { 1.0 } else { 0.0 })).collect()
    };
    let geom = |extra: &str| {
        let scalars = "line_off:  10\nsamp_off:  20\nlat_off:  45\nlong_off:  7\nheight_off:  0\n\
                       line_scale:  10\nsamp_scale:  20\n\
                       lat_scale:  1\nlong_scale:  1\nheight_scale:  100\n";
        let num = coefficients("line_num_coeff", 2) + &coefficients("samp_num_coeff", 1);
        let den = coefficients("line_den_coeff", 0) + &coefficients("samp_den_coeff", 0);
        format!("{scalars}{num}{den}{extra}")
    };
    assert_eq!(read_bytes("a.geom", geom("polynomial_format:  B\n").as_bytes()).expect("an RPC").samp_off, 20.0);
    let adjusted = geom("adjustment_0.adj_param_1.parameter:  2.5\n");
    assert!(matches!(fault("a.geom", &adjusted), Fault::Unsupported { what } if what.contains("adj_param_1")));
    let old = geom("polynomial_format:  A\n");
    assert!(matches!(fault("a.geom", &old), Fault::Unsupported { what } if what.contains("RPC00B")));
}

#[test]
fn too_large_folders_and_missing_files_are_told_apart() {
    let folder = TempDir::new().expect("a folder");
    let large: PathBuf = folder.path().join("a_RPC.TXT");
    let file = std::fs::File::create(&large).expect("a file");
    std::io::Write::write_all(&mut &file, &[b' '; 8192]).expect("blanks");
    file.set_len(TEXT_LIMIT + 1).expect("a sparse file");
    assert!(matches!(read(&large), Err(RpcReadError::TooLarge { limit: TEXT_LIMIT, .. })));
    assert!(matches!(read(folder.path()), Err(RpcReadError::NotAFile { .. })));
    assert!(matches!(read(&folder.path().join("none")), Err(RpcReadError::Io { .. })));
}

#[test]
fn files_beside_an_image_are_found_without_regard_to_case() {
    let image = [0_u8; 64];
    for (image_name, rpc_name, content) in [
        ("scene.raw", "scene_RPC.TXT", text(RpcFormat::Text)),
        ("scene.raw", "scene_rpc.txt", text(RpcFormat::Text)),
        ("scene.raw", "SCENE.RPB", text(RpcFormat::Rpb)),
        ("scene.raw", "scene.json", text(RpcFormat::Json)),
        ("IMG_PHR1A_P_X_R1C1.raw", "RPC_PHR1A_P_X.XML", dimap("PNEO_SENSOR", Some(0))),
        ("IMG_PNEO3_X_P_R1C1.raw", "RPC_PNEO3_X.XML", dimap("PNEO_SENSOR", Some(0))),
    ] {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join(image_name);
        std::fs::write(&path, image).expect("an image");
        std::fs::write(folder.path().join("other_RPC.TXT"), "LINE_OFF: broken").expect("another image's RPC");
        assert!(matches!(read_for_image(&path), Err(RpcReadError::NotRpc { .. })));
        std::fs::write(folder.path().join(rpc_name), content).expect("an RPC");
        let file = read_for_image(&path).expect(rpc_name);
        assert_eq!((file.rpc.line_num, file.source), (plain().line_num, folder.path().join(rpc_name)));
    }
    // The RPC does not have the position of other tiles in the scene.
    let folder = TempDir::new().expect("a folder");
    let tile = folder.path().join("IMG_X_R2C1.raw");
    std::fs::write(&tile, image).expect("an image");
    std::fs::write(folder.path().join("RPC_X.XML"), dimap("PHR_SENSOR", Some(1))).expect("an RPC");
    assert!(matches!(read_for_image(&tile), Err(RpcReadError::NotRpc { .. })));
}

#[test]
fn writing_keeps_or_replaces_and_leaves_nothing_else() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("a.json");
    write(&path, &plain(), RpcFormat::Json, false).expect("a new file");
    assert!(write(&path, &plain(), RpcFormat::Text, false).is_err());
    assert_eq!(read(&path).expect("the first").format, RpcFormat::Json);
    write(&path, &plain(), RpcFormat::Text, true).expect("replaced");
    assert_eq!(read(&path).expect("the second").format, RpcFormat::Text);
    assert!(write(&path, &plain(), RpcFormat::Dimap, true).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 1);
}

fn coefficient() -> impl Strategy<Value = f64> {
    prop_oneof![-1e-3..1e-3_f64, -1.0..1.0_f64, Just(0.0)]
}

prop_compose! {
    fn any_rpc()(
        off in prop::array::uniform5(-80.0..80.0_f64),
        scale in prop::array::uniform5(0.001..1e4_f64),
        rest in prop::collection::vec(coefficient(), 76),
        bias in prop::option::of(0.0..10.0_f64),
    ) -> camera::Rpc {
        let poly = |k: usize, first: [f64; 2]| {
            std::array::from_fn(|i| if i < 2 { first[i] } else { rest[19 * k + i - 2] })
        };
        let mut line_num: [f64; 20] = poly(0, [0.0, 0.0]);
        line_num[2] = -3.0;
        camera::Rpc {
            line_off: off[0], samp_off: off[1], lat_off: off[2], long_off: off[3], height_off: off[4],
            line_scale: scale[0], samp_scale: scale[1], lat_scale: scale[2] * 0.009, long_scale: scale[3] * 0.018,
            height_scale: scale[4],
            line_num, line_den: poly(1, [1.0, 1e-4]), samp_num: poly(2, [0.0, 5.0]), samp_den: poly(3, [1.0, 1e-4]),
            err_bias_m: bias, err_rand_m: bias,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_is_written_reads_back_to_the_bit(rpc in any_rpc().prop_filter("a camera", |r| r.validate().is_ok())) {
        for format in [RpcFormat::Text, RpcFormat::Rpb, RpcFormat::Json] {
            let back = read_bytes("a", to_text(&rpc, format).expect("text").as_bytes()).expect("an RPC");
            let (err_bias_m, err_rand_m) = (back.err_bias_m, back.err_rand_m);
            let errors_as_written = camera::Rpc { err_bias_m, err_rand_m, ..rpc.clone() };
            prop_assert_eq!(&back, &errors_as_written);
            prop_assert_eq!(back.err_bias_m.unwrap_or(0.0), rpc.err_bias_m.unwrap_or(0.0));
        }
    }

    #[test]
    fn truncated_and_garbled_files_never_panic(cut in 0.0..1.0_f64, at in 0.0..1.0_f64, byte: u8, kind in 0..4_usize) {
        let whole = match kind {
            0 => text(RpcFormat::Text),
            1 => text(RpcFormat::Rpb),
            2 => text(RpcFormat::Json),
            _ => dimap("PHR_SENSOR", Some(1)),
        };
        let mut bytes = whole.into_bytes();
        let length = bytes.len() as f64;
        // The text ends inside the last polynomial at the latest, so an entry is always missing.
        let short = &bytes[..(0.95 * cut * length) as usize];
        if kind < 3 {
            prop_assert!(read_bytes("a", short).is_err());
        } else {
            let _ = read_bytes("a", short);
        }
        bytes[(at * length) as usize] = byte;
        let _ = read_bytes("a", &bytes);
    }

    #[test]
    fn binary_garbage_is_refused(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        prop_assert!(read_bytes("a.tif", &bytes).is_err());
    }
}
