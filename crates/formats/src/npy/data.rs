//! Arrays in memory and the types of their numbers.

/// An array.
#[derive(Debug, Clone, PartialEq)]
pub struct NpyArray {
    /// Lengths of the axes, the slowest first: rows, columns, channels.
    pub shape: Vec<usize>,
    /// The numbers in C order.
    pub data: NpyData,
}

/// The numbers of an array, in the type of the file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NpyData {
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
    /// Booleans.
    Bool(Vec<bool>),
    /// Unsigned, 8 bits.
    U8(Vec<u8>),
    /// Unsigned, 16 bits.
    U16(Vec<u16>),
    /// Unsigned, 32 bits.
    U32(Vec<u32>),
    /// Signed, 32 bits.
    I32(Vec<i32>),
    /// Signed, 64 bits: NumPy's default integer.
    I64(Vec<i64>),
}

impl NpyData {
    /// Number of values.
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

    /// Whether the array has no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Converts the values to f64; `false` is 0 and `true` is 1.
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

mod sealed {
    pub trait NpyNumberSealed {}
}

/// A type that [`write()`](super::write()) accepts: `f32`, `f64`, `bool`, `u8`, `u16`, `u32`.
pub trait NpyNumber: sealed::NpyNumberSealed + Copy {
    /// NumPy's name of the type.
    #[doc(hidden)]
    const DESCRIPTION: &'static str;
    /// Appends the bytes of the number, little-endian.
    #[doc(hidden)]
    fn append(self, bytes: &mut Vec<u8>);
}

macro_rules! number {
    ($type:ty, $description:literal) => {
        impl sealed::NpyNumberSealed for $type {}
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

impl sealed::NpyNumberSealed for bool {}
impl NpyNumber for bool {
    const DESCRIPTION: &'static str = "|b1";
    fn append(self, bytes: &mut Vec<u8>) {
        bytes.push(u8::from(self));
    }
}
