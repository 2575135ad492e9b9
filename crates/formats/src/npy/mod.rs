//! NumPy's `.npy` files: the maps that Gaussian splatting trainers read.
//!
//! [`write()`] writes version 1.0 in C order, and streams the slice without a copy. [`read`]
//! accepts versions 1 to 3 with real numbers and booleans in either byte order, and keeps their
//! type. Structured types, objects (pickles) and arrays in Fortran order with more than one axis
//! are refused. The shape is checked against the size of the file before it is used.

mod data;
mod header;

use std::path::Path;

use crate::atomic::write_stream;
use crate::format_error::FormatError;
use crate::regular::read_regular;

pub use data::{NpyArray, NpyData, NpyNumber};

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 8 << 30;
/// Numbers converted to bytes at a time.
const CHUNK: usize = 1 << 14;

/// Writes numbers in C order. `shape` has the lengths of the axes, the slowest first.
///
/// ```
/// use formats::npy::{self, NpyData};
///
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("depth.npy");
/// npy::write(&path, &[2, 3], &[1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0], false)?;
///
/// let array = npy::read(&path)?;
/// assert_eq!(array.shape, [2, 3]);
/// assert_eq!(array.data, NpyData::F32(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FormatError`] when the product of `shape` is not the number of values, for a file that exists
/// without `overwrite`, and when the system refuses.
pub fn write<T: NpyNumber>(
    path: impl AsRef<Path>,
    shape: &[usize],
    numbers: &[T],
    overwrite: bool,
) -> Result<(), FormatError> {
    let path = path.as_ref();
    if product(shape) != Some(numbers.len()) {
        let found = numbers.len();
        let what = format!("found {found} numbers for the shape {shape:?}, expected its product");
        return Err(FormatError::new(path, what));
    }
    let header = header::encode(T::DESCRIPTION, shape);
    Ok(write_stream(path, overwrite, |out| {
        out.write_all(&header)?;
        let mut bytes = Vec::with_capacity(CHUNK * size_of::<T>());
        for chunk in numbers.chunks(CHUNK) {
            bytes.clear();
            chunk.iter().for_each(|&number| number.append(&mut bytes));
            out.write_all(&bytes)?;
        }
        Ok(())
    })?)
}

/// Reads an array.
///
/// # Errors
/// [`FormatError`] when the system refuses, for a file that is not an array file, ends early,
/// continues after its numbers, or has another type or order than can be read.
pub fn read(path: impl AsRef<Path>) -> Result<NpyArray, FormatError> {
    let path = path.as_ref();
    let unreadable = |source| FormatError::unreadable(path, "the file", source);
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    let invalid = |what: String| FormatError::new(path, format_args!("not a NumPy array that can be read ({what})"));
    if size > SIZE_LIMIT {
        return Err(invalid(format!("it has {size} bytes, expected at most {SIZE_LIMIT}")));
    }
    parse(&read_regular(path, SIZE_LIMIT).map_err(unreadable)?).map_err(invalid)
}

fn parse(bytes: &[u8]) -> Result<NpyArray, String> {
    let (header, body) = header::decode(bytes)?;
    let count = product(&header.shape).ok_or("the shape has more numbers than can be counted")?;
    let expected = count.checked_mul(header.kind.bytes());
    if expected != Some(body.len()) {
        return Err(format!(
            "the shape {:?} of {} does not fit {} bytes of data",
            header.shape,
            header.description,
            body.len()
        ));
    }
    Ok(NpyArray { data: header.kind.numbers(body, header.big_endian)?, shape: header.shape })
}

fn product(shape: &[usize]) -> Option<usize> {
    shape.iter().try_fold(1usize, |count, &length| count.checked_mul(length))
}

#[cfg(test)]
mod tests;
