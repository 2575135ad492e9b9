//! NumPy's `.npy` files, version 1.0, C order: the maps that Gaussian splatting trainers read.
//!
//! [`write()`] streams a slice without a second copy. [`read`] takes what NumPy writes for real numbers and bools in either byte
//! order, and widens nothing; structured types, objects (pickles) and Fortran order beyond one axis are refused.
//! No shape is believed before it is checked against the size of the file.

mod header;

use std::path::{Path, PathBuf};

use crate::atomic::SaveError;
use crate::atomic::write_stream;

/// Files are read up to this size, bytes.
const SIZE_LIMIT: u64 = 8 << 30;
/// Numbers that are turned into bytes at a time.
const CHUNK: usize = 1 << 14;

/// An array from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct NpyArray {
    /// Lengths of the axes, the slowest first: rows, columns, channels.
    pub shape: Vec<usize>,
    /// The numbers in C order.
    pub data: NpyData,
}

/// The numbers of an array.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NpyData {
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
    /// Truth values.
    Bool(Vec<bool>),
    /// 8 bits.
    U8(Vec<u8>),
    /// 16 bits.
    U16(Vec<u16>),
    /// 32 bits.
    U32(Vec<u32>),
    /// 32 bits, signed.
    I32(Vec<i32>),
    /// 64 bits, signed: NumPy's usual integer.
    I64(Vec<i64>),
}

impl NpyData {
    /// How many numbers there are.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::Bool(v) => v.len(),
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::U32(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::I64(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The numbers as f64; truth values are 0 and 1.
    pub fn to_f64(&self) -> Vec<f64> {
        match self {
            Self::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::F64(v) => v.clone(),
            Self::Bool(v) => v.iter().map(|&x| f64::from(u8::from(x))).collect(),
            Self::U8(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::U16(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::U32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::I32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::I64(v) => v.iter().map(|&x| x as f64).collect(),
        }
    }
}

/// A file that is no such array, or that was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The file cannot be read.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The content is not what is read here.
    #[error("not an array that is read here ({what}): {}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was found and expected.
        what: String,
    },
    /// The shape does not hold the numbers.
    #[error("{numbers} numbers do not fill the shape {shape:?}: {}", .path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The shape.
        shape: Vec<usize>,
        /// How many numbers there are.
        numbers: usize,
    },
    /// The file was not written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

mod sealed {
    pub trait Sealed {}
}

/// A type of numbers that [`write()`] takes: `f32`, `f64`, `bool`, `u8`, `u16`, `u32`.
pub trait NpyNumber: sealed::Sealed + Copy {
    /// NumPy's name for it.
    #[doc(hidden)]
    const DESCRIPTION: &'static str;
    /// Appends its bytes, little-endian.
    #[doc(hidden)]
    fn append(self, bytes: &mut Vec<u8>);
}

macro_rules! number {
    ($type:ty, $description:literal) => {
        impl sealed::Sealed for $type {}
        impl NpyNumber for $type {
            const DESCRIPTION: &'static str = $description;
            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    };
}

number!(f32, "<f4");
number!(f64, "<f8");
number!(u8, "|u1");
number!(u16, "<u2");
number!(u32, "<u4");

impl sealed::Sealed for bool {}
impl NpyNumber for bool {
    const DESCRIPTION: &'static str = "|b1";
    fn append(self, bytes: &mut Vec<u8>) {
        bytes.push(u8::from(self));
    }
}

/// Writes numbers in C order with the lengths of their axes.
///
/// # Errors
/// [`NpyError::Shape`] when the shape holds another number of numbers, [`NpyError::NotWritten`] for a file that exists without
/// `overwrite` and for what the system refuses.
pub fn write<T: NpyNumber>(
    path: impl AsRef<Path>,
    shape: &[usize],
    numbers: &[T],
    overwrite: bool,
) -> Result<(), NpyError> {
    let path = path.as_ref();
    if product(shape) != Some(numbers.len()) {
        return Err(NpyError::Shape { path: path.to_owned(), shape: shape.to_vec(), numbers: numbers.len() });
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
/// [`NpyError::Unreadable`]; [`NpyError::Invalid`] for what is no array file, ends early, goes on after its numbers, or is of
/// another type or order than is read.
pub fn read(path: impl AsRef<Path>) -> Result<NpyArray, NpyError> {
    let path = path.as_ref();
    let unreadable = |source| NpyError::Unreadable { path: path.to_owned(), source };
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    let invalid = |what: String| NpyError::Invalid { path: path.to_owned(), what };
    if size > SIZE_LIMIT {
        return Err(invalid(format!("{size} bytes, up to {SIZE_LIMIT} are read")));
    }
    parse(&std::fs::read(path).map_err(unreadable)?).map_err(invalid)
}

fn parse(bytes: &[u8]) -> Result<NpyArray, String> {
    let (header, body) = header::decode(bytes)?;
    let count = product(&header.shape).ok_or("the shape holds more numbers than can be counted")?;
    let expected = count.checked_mul(header.kind.bytes());
    if expected != Some(body.len()) {
        return Err(format!(
            "the shape {:?} of {} does not fit {} bytes",
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
