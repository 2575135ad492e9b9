//! The header of an array file: magic bytes, version, and a Python dictionary with type, order and
//! shape.

use super::data::NpyData;

const MAGIC: &[u8] = b"\x93NUMPY";
/// The data begin at a multiple of this, bytes.
const ALIGNMENT: usize = 64;
/// Longest header that is read, bytes.
const HEADER_LIMIT: usize = 1 << 16;
/// Most axes that are read, as in NumPy.
const AXES_LIMIT: usize = 32;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F64,
    Bool,
    U8,
    U16,
    U32,
    I32,
    I64,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) kind: Kind,
    pub(super) big_endian: bool,
    pub(super) shape: Vec<usize>,
    pub(super) description: String,
}

/// Returns the header of a file: the bytes before the numbers, padded to [`ALIGNMENT`].
/// `description` is NumPy's name of the number type, such as `<f4`.
pub(super) fn encode(description: &str, shape: &[usize]) -> Vec<u8> {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    // A Python tuple of one item needs a comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let text =
        format!("{{'descr': '{description}', 'fortran_order': False, 'shape': ({}{comma}), }}", lengths.join(", "));
    let total = (MAGIC.len() + 4 + text.len() + 1).next_multiple_of(ALIGNMENT);
    let length = (total - MAGIC.len() - 4) as u16;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend(length.to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.resize(total - 1, b' ');
    bytes.push(b'\n');
    bytes
}

/// Splits the bytes of a file into the header and the numbers.
pub(super) fn decode(bytes: &[u8]) -> Result<(Header, &[u8]), String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("it does not begin with \\x93NUMPY")?;
    let (version, rest) = rest.split_first_chunk::<2>().ok_or("it ends in the header")?;
    let (length, rest) = match version[0] {
        1 => rest.split_first_chunk::<2>().map(|(l, rest)| (usize::from(u16::from_le_bytes(*l)), rest)),
        2 | 3 => rest.split_first_chunk::<4>().map(|(l, rest)| (u32::from_le_bytes(*l) as usize, rest)),
        other => return Err(format!("it has version {other}, expected 1 to 3")),
    }
    .ok_or("it ends in the header")?;
    if length > HEADER_LIMIT {
        return Err(format!("its header has {length} bytes, expected at most {HEADER_LIMIT}"));
    }
    let (text, body) = rest.split_at_checked(length).ok_or("it ends in the header")?;
    let text = std::str::from_utf8(text).map_err(|_| "the header is not UTF-8 text")?;
    Ok((dictionary(text)?, body))
}

fn dictionary(text: &str) -> Result<Header, String> {
    let after = |key: &str| {
        let at = text.find(&format!("'{key}'")).ok_or_else(|| format!("the header has no {key}"))?;
        let rest = text[at + key.len() + 2..].trim_start();
        rest.strip_prefix(':').map(str::trim_start).ok_or_else(|| format!("the header has no {key}"))
    };
    let description = after("descr")?.strip_prefix('\'').and_then(|rest| rest.split_once('\'')).map(|(d, _)| d);
    let description = description.ok_or("it has a structured type, expected plain numbers")?;
    let shape = after("shape")?.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(s, _)| s);
    let lengths =
        shape.ok_or("the shape is not a tuple")?.split(',').map(str::trim).filter(|length| !length.is_empty());
    let shape: Vec<usize> = lengths
        .take(AXES_LIMIT + 1)
        .map(|length| {
            length
                .trim_end_matches('L')
                .parse()
                .map_err(|_| format!("the length of an axis is {length:?}, expected a whole number"))
        })
        .collect::<Result<_, _>>()?;
    if shape.len() > AXES_LIMIT {
        return Err(format!("it has more than {AXES_LIMIT} axes"));
    }
    let fortran = after("fortran_order")?.starts_with("True");
    if fortran && shape.iter().filter(|&&length| length > 1).count() > 1 {
        return Err("it is in Fortran order, expected C order: save numpy.ascontiguousarray(a)".to_owned());
    }
    let (order, name) = description.split_at_checked(1).ok_or("the type has no name")?;
    let kind = Kind::from_name(name).filter(|_| matches!(order, "<" | ">" | "|" | "="));
    let kind = kind.ok_or_else(|| {
        let shown: String = description.chars().take(20).collect();
        format!("it has numbers of type {shown:?}, expected f4, f8, b1, u1, u2, u4, i4 or i8")
    })?;
    Ok(Header { kind, big_endian: order == ">", shape, description: description.to_owned() })
}

impl Kind {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "f4" => Self::F32,
            "f8" => Self::F64,
            "b1" => Self::Bool,
            "u1" => Self::U8,
            "u2" => Self::U16,
            "u4" => Self::U32,
            "i4" => Self::I32,
            "i8" => Self::I64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Bool | Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 | Self::U32 | Self::I32 => 4,
            Self::F64 | Self::I64 => 8,
        }
    }

    pub(super) fn numbers(self, body: &[u8], big: bool) -> Result<NpyData, String> {
        Ok(match self {
            Self::F32 => NpyData::F32(each(body, big, f32::from_le_bytes)),
            Self::F64 => NpyData::F64(each(body, big, f64::from_le_bytes)),
            Self::U8 => NpyData::U8(body.to_vec()),
            Self::U16 => NpyData::U16(each(body, big, u16::from_le_bytes)),
            Self::U32 => NpyData::U32(each(body, big, u32::from_le_bytes)),
            Self::I32 => NpyData::I32(each(body, big, i32::from_le_bytes)),
            Self::I64 => NpyData::I64(each(body, big, i64::from_le_bytes)),
            Self::Bool => match body.iter().position(|&byte| byte > 1) {
                Some(at) => return Err(format!("boolean {at} is {}, expected 0 or 1", body[at])),
                None => NpyData::Bool(body.iter().map(|&byte| byte == 1).collect()),
            },
        })
    }
}

/// Converts numbers of `N` bytes each.
fn each<T, const N: usize>(body: &[u8], big: bool, from_le: impl Fn([u8; N]) -> T) -> Vec<T> {
    let (numbers, _) = body.as_chunks::<N>();
    numbers
        .iter()
        .map(|&(mut bytes)| {
            if big {
                bytes.reverse();
            }
            from_le(bytes)
        })
        .collect()
}
