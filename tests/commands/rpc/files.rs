//! Every file of the shared RPC collection is read as `reference/rpc_files.txt` says, or refused
//! for the reason it gives; whatever another reader reads, ours reads; and the same RPC in two
//! containers has the same numbers.
//!
//! The reference is written by `reference/rpc_files.py` with rasterio, rpcm and plain text search.
//! The collection is not part of the repository: without it the tests print a line and end.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use formats::rpc::{RpcReadError, read};

/// The fields of every line of the reference, by path.
fn reference() -> BTreeMap<String, Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/rpc_files.txt");
    let text = fs::read_to_string(path).expect("the reference is in the repository");
    let fields = |line: &str| line.split(" | ").map(str::to_owned).collect::<Vec<_>>();
    text.lines().filter(|l| !l.starts_with('#')).map(fields).map(|f| (f[0].clone(), f)).collect()
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the collection");
    let paths = entries.map(|e| e.expect("an entry of the collection").path());
    paths.flat_map(|p| if p.is_dir() { files_below(&p) } else { vec![p] }).collect()
}

#[test]
fn every_file_is_read_or_refused_as_the_reference_says() {
    let Some(root) = testing::shared_data("rpc") else { return };
    let reference = reference();
    let mut seen = 0;
    for path in files_below(&root) {
        let name = path.strip_prefix(&root).expect("below the root").to_string_lossy().into_owned();
        if ["PROVENANCE.md", "peer_readers.txt"].contains(&name.as_str()) {
            continue;
        }
        let expected = reference.get(&name).unwrap_or_else(|| panic!("{name} is not in the reference: run its script"));
        seen += 1;
        match (read(&path), expected[1].as_str()) {
            (Err(RpcReadError::NotRpc { tried, .. }), "refused") => assert!(!tried.is_empty(), "{name}"),
            (Err(RpcReadError::Invalid { .. }), "refused") => assert!(expected[2].contains("stripped"), "{name}"),
            (Err(e), _) => panic!("{name}: {e}"),
            (Ok(file), format) => {
                assert_eq!(serde_json::to_value(file.format).expect("a name"), format, "{name}");
                let numbers: Vec<f64> = expected[2].split(' ').map(|n| n.parse().expect("a number")).collect();
                let ours = [file.rpc.long_off, file.rpc.lat_off, file.rpc.line_off, file.rpc.samp_off];
                let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-14 * b.abs();
                assert!(ours.iter().zip(&numbers).all(close), "{name}: {ours:?}, expected {numbers:?}");
                assert_eq!(file.warnings, Vec::<String>::new(), "{name}");
            }
        }
    }
    assert!(seen > 0, "the collection is empty");
}

/// `peer_readers.txt` has a line per file: name size | reader:ok lon,lat | reader:Error | …
#[test]
fn what_another_reader_reads_ours_reads() {
    let Some(root) = testing::shared_data("rpc") else { return };
    let peers = fs::read_to_string(root.join("peer_readers.txt")).expect("the list of peer readers");
    let mut compared = 0;
    for line in peers.lines() {
        let mut fields = line.split(" | ");
        let name = fields.next().and_then(|f| f.rsplit_once(' ')).map_or("", |(name, _)| name);
        let path = root.join(name);
        if !path.is_file() {
            continue;
        }
        for lonlat in fields.filter_map(|f| f.split_once(":ok ")).map(|(_, lonlat)| lonlat.trim()) {
            let rpc = read(&path).unwrap_or_else(|e| panic!("a peer reads {name}, ours: {e}")).rpc;
            let (lon, lat) = lonlat.split_once(',').expect("longitude and latitude");
            let offsets = [(rpc.long_off, lon), (rpc.lat_off, lat)];
            for (ours, theirs) in offsets.map(|(o, t)| (o, t.parse::<f64>().expect("degrees"))) {
                assert!((ours - theirs).abs() <= 0.5001e-4, "{name}: {ours}, a peer has {theirs}");
            }
            compared += 1;
        }
    }
    assert!(compared > 0, "no file of the list is there");
}

/// Compares all ninety numbers of two containers; `relative` is what their digits allow.
fn check_same(root: &Path, a: &str, b: &str, relative: f64) {
    let rpc = |name: &str| read(&root.join(name)).unwrap_or_else(|e| panic!("{e}")).rpc;
    for (i, (x, y)) in rpc(a).numbers().zip(rpc(b).numbers()).enumerate() {
        assert!((x - y).abs() <= relative * x.abs().max(y.abs()), "number {i} of {a} is {x}, of {b} {y}");
    }
}

#[test]
fn the_same_rpc_in_two_containers_has_the_same_numbers() {
    let Some(root) = testing::shared_data("rpc/gdal/autotest") else { return };
    check_same(&root, "gcore/data/md_dg.RPB", "gcore/data/md_dg.tif", 0.0);
    check_same(&root, "gcore/data/md_dg.RPB", "gcore/data/md_dg_2.XML", 1e-15);
    check_same(&root, "gcore/data/md_dg_2.XML", "gcore/data/md_dg_2.tif", 0.0);
    check_same(&root, "gcore/data/md_ge_rgb_0010000_rpc.txt", "gcore/data/md_ge_rgb_0010000.tif", 0.0);
    check_same(&root, "gcore/data/md_eros.rpc", "gcore/data/md_eros.tif", 0.0);
    check_same(&root, "gcore/data/md_kompsat.rpc", "gcore/data/md_kompsat.tif", 0.0);
    check_same(&root, "gcore/data/md_ov_rpc.txt", "gcore/data/md_ov.tif", 0.0);
    check_same(&root, "gcore/data/test_rpc.txt", "gcore/data/byte_rpc.tif", 0.0);
    check_same(&root, "gcore/data/alos/RPC-md_alos.txt", "gcore/data/alos/IMG-md_alos.tif", 0.0);
    check_same(&root, "gdrivers/data/envi/envirpc.hdr", "gdrivers/data/envi/envirpc.img", 0.0);
    // DIMAP against GDAL's reading of it: the same pixel counting for Pléiades (from 1) and
    // Pléiades Neo (from 0).
    check_same(&root, "gdrivers/data/jpeg2000/RPC_md_ple.XML", "gdrivers/data/jpeg2000/IMG_md_ple_R1C1.jp2", 0.0);
    check_same(&root, "gdrivers/data/jpeg2000/RPC_md_pneo.XML", "gdrivers/data/jpeg2000/IMG_md_pneo_R1C1.jp2", 0.0);
}

/// OSSIM prints 15 digits.
#[test]
fn geom_counts_pixels_from_zero_where_dimap_counts_from_one() {
    let Some(root) = testing::shared_data("rpc/shareloc") else { return };
    let image = "PHR1B_P_201709281038045_SEN_PRG_FC_178608-001";
    check_same(&root, &format!("{image}.geom"), &format!("RPC_{image}.XML"), 1e-14);
}

/// The originals have a `.geom` of the whole scene and the cut's origin in the geotransform; the
/// other pair has tags.
#[test]
fn a_cut_of_a_geoms_scene_gets_the_rpc_of_the_cut() {
    let Some(root) = testing::shared_data("stereo/phr_gizeh") else { return };
    for image in ["img1", "img2"] {
        check_same(&root, &format!("{image}.tif"), &format!("{image}_rpc.tif"), 1e-14);
    }
}
