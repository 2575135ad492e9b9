//! Arrays are written and read back, as NumPy writes them, and broken ones are refused.

use numeric::{Failure, Kind};
use proptest::prelude::*;

use super::*;

/// Makes a file as NumPy writes it, with any header text.
fn file(version: u8, header: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    match version {
        1 => bytes.extend((header.len() as u16).to_le_bytes()),
        _ => bytes.extend((header.len() as u32).to_le_bytes()),
    }
    bytes.extend(header.as_bytes());
    bytes.extend(body);
    bytes
}

fn dictionary(description: &str, order: &str, shape: &str) -> String {
    format!("{{'descr': {description}, 'fortran_order': {order}, 'shape': {shape}, }}")
}

#[test]
fn the_header_is_numpys() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.npy");
    write(&path, &[2, 3], &[0.5f32, 1.0, f32::INFINITY, -1.0, 2.0, 3.0], false).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // numpy.save of a float32 array of 2 x 3 begins with these 128 bytes.
    let expected = format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }");
    assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
    assert_eq!(&bytes[10..128], expected.as_bytes());
    assert_eq!(bytes.len(), 128 + 24);
    let again = write(&path, &[1], &[1u8], false).unwrap_err();
    assert_eq!((again.kind(), again.path()), (Kind::OutputExists, path.as_path()));
    let wrong = write(&path, &[2, 2], &[1u8], true).unwrap_err();
    assert!(wrong.to_string().starts_with("found 1 numbers for the shape [2, 2], expected its product: "), "{wrong}");
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn every_type_leads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npy");
    let again = || read(&path).unwrap();
    write(&path, &[2, 1, 2], &[true, false, false, true], true).unwrap();
    assert_eq!(again(), NpyArray { shape: vec![2, 1, 2], data: NpyData::Bool(vec![true, false, false, true]) });
    write(&path, &[3], &[1u8, 2, 255], true).unwrap();
    assert_eq!(again().data, NpyData::U8(vec![1, 2, 255]));
    write(&path, &[1, 2], &[1u16, 65535], true).unwrap();
    assert_eq!(again().data, NpyData::U16(vec![1, 65535]));
    write(&path, &[], &[u32::MAX], true).unwrap();
    assert_eq!(again(), NpyArray { shape: vec![], data: NpyData::U32(vec![u32::MAX]) });
    write(&path, &[0, 4], &[0f64; 0], true).unwrap();
    assert_eq!(again(), NpyArray { shape: vec![0, 4], data: NpyData::F64(vec![]) });
}

#[test]
fn what_numpy_may_write_is_read() {
    let big = file(1, &dictionary("'>u2'", "False", "(2,)"), &[1, 2, 3, 4]);
    assert_eq!(parse(&big).unwrap().data, NpyData::U16(vec![0x0102, 0x0304]));
    let wide = file(2, &dictionary("'<i8'", "True", "(1, 2)"), &[[1u8, 0, 0, 0, 0, 0, 0, 0]; 2].concat());
    assert_eq!(parse(&wide).unwrap(), NpyArray { shape: vec![1, 2], data: NpyData::I64(vec![1, 1]) });
    assert_eq!(parse(&wide).unwrap().data.to_f64(), [1.0, 1.0]);
}

#[test]
fn broken_files_are_refused() {
    #[track_caller]
    fn refused(bytes: &[u8], words: &str) {
        let what = parse(bytes).unwrap_err();
        assert!(what.contains(words), "{what}");
    }
    let plain = |shape: &str| file(1, &dictionary("'|u1'", "False", shape), &[1, 2, 3, 4]);
    assert!(parse(&plain("(2, 2)")).is_ok());
    refused(b"", "NUMPY");
    refused(&plain("(2, 2)")[..9], "ends in the header");
    refused(&plain("(5,)"), "does not fit 4 bytes");
    refused(&plain("(3,)"), "does not fit 4 bytes");
    refused(&plain("(18446744073709551615, 2)"), "more numbers");
    refused(&plain("(99999999999999999999,)"), "length of an axis");
    refused(&plain("(-1,)"), "length of an axis");
    refused(&plain("4"), "not a tuple");
    refused(&plain(&format!("({})", "1, ".repeat(40))), "axes");
    refused(&file(1, &dictionary("'|O'", "False", "(1,)"), &[1]), "type");
    refused(&file(1, &dictionary("[('x', '<f4')]", "False", "(1,)"), &[0; 4]), "structured");
    refused(&file(1, &dictionary("'<f4'", "True", "(2, 2)"), &[0; 16]), "Fortran");
    refused(&file(1, &dictionary("'|b1'", "False", "(1,)"), &[2]), "expected 0 or 1");
    refused(&file(9, "{}", &[]), "version 9");
    refused(&file(1, "{}", &[]), "no descr");
}

proptest! {
    #[test]
    fn no_header_makes_it_panic(text in ".{0,80}", body in prop::collection::vec(any::<u8>(), 0..64)) {
        let _ = parse(&file(1, &text, &body));
        let _ = parse(&file(1, &dictionary(&text, "False", &text), &body));
        let _ = parse(&body);
    }

    #[test]
    fn bits_are_kept(bits in prop::collection::vec(any::<u32>(), 0..200)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npy");
        let numbers: Vec<f32> = bits.iter().map(|&b| f32::from_bits(b)).collect();
        write(&path, &[numbers.len()], &numbers, false).unwrap();
        let NpyData::F32(found) = read(&path).unwrap().data else { panic!("another type") };
        let found: Vec<u32> = found.into_iter().map(f32::to_bits).collect();
        prop_assert_eq!(found, bits);
    }
}
