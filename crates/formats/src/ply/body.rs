//! The numbers after the header of a PLY file.

use super::header::{PlyElement, PlyEncoding, PlyFault, PlyHeader, PlyNumber, PlyProperty};

/// A cursor over the data of a file.
#[derive(Debug, Clone)]
pub struct PlyBody<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: PlyEncoding,
}

impl<'a> PlyBody<'a> {
    /// Creates a cursor at the first record of a file with this header.
    pub fn new(bytes: &'a [u8], header: &PlyHeader) -> Self {
        Self { bytes, at: header.end, encoding: header.encoding }
    }

    /// Checks that the rest of the file can hold all records of an element.
    ///
    /// # Errors
    /// [`PlyFault`] where it cannot, so that nothing is allocated for a count that a file invents.
    pub fn check(&self, element: &PlyElement) -> Result<(), PlyFault> {
        let (smallest, room) = (self.smallest(element), self.room());
        if element.count > 0 && (smallest == 0 || element.count > (room / smallest) as u64) {
            let what = format!("the header announces {} of {}, {room} bytes are left", element.count, element.name);
            return Err(PlyFault::new(what, "header"));
        }
        Ok(())
    }

    /// Reads a number.
    ///
    /// # Errors
    /// [`PlyFault`] where the file ends, or text is no number.
    pub fn number(&mut self, kind: PlyNumber) -> Result<f64, PlyFault> {
        if self.encoding == PlyEncoding::Ascii {
            return self.word();
        }
        let end = self.at + kind.bytes();
        let mut bytes = [0u8; 8];
        let found = self.bytes.get(self.at..end).ok_or_else(|| self.ends())?;
        bytes[..found.len()].copy_from_slice(found);
        if self.encoding == PlyEncoding::BigEndian {
            bytes[..found.len()].reverse();
        }
        self.at = end;
        Ok(kind.value(&bytes))
    }

    /// Reads a list whose count and values have these types.
    ///
    /// # Errors
    /// Those of [`Self::number`], and [`PlyFault`] for a list that the rest of the file cannot
    /// hold.
    pub fn list(&mut self, count: PlyNumber, value: PlyNumber) -> Result<Vec<f64>, PlyFault> {
        let count = self.list_count(count, value)?;
        (0..count).map(|_| self.number(value)).collect()
    }

    /// Passes a property.
    ///
    /// # Errors
    /// Those of [`Self::list`].
    pub fn skip(&mut self, property: &PlyProperty) -> Result<(), PlyFault> {
        let count = match property.count {
            Some(count) => self.list_count(count, property.value)?,
            None => 1,
        };
        (0..count).try_for_each(|_| self.number(property.value).map(drop))
    }

    fn list_count(&mut self, count: PlyNumber, value: PlyNumber) -> Result<usize, PlyFault> {
        let count = self.number(count)?;
        if count >= 0.0 && count <= (self.room() / self.least(value)) as f64 {
            Ok(count as usize)
        } else {
            Err(self.ends())
        }
    }

    /// Returns the number of bytes left.
    fn room(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Returns the least size of a number, bytes: in text it takes at least one.
    fn least(&self, number: PlyNumber) -> usize {
        if self.encoding == PlyEncoding::Ascii { 1 } else { number.bytes() }
    }

    /// Returns the smallest size of a record, bytes.
    fn smallest(&self, element: &PlyElement) -> usize {
        element.properties.iter().map(|property| self.least(property.count.unwrap_or(property.value))).sum()
    }

    fn ends(&self) -> PlyFault {
        PlyFault::new("the file ends in the middle of its data", format!("byte {}", self.at))
    }

    fn word(&mut self) -> Result<f64, PlyFault> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or_else(|| self.ends())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let word = std::str::from_utf8(&rest[start..start + length]).unwrap_or_default();
        let number = word.parse().map_err(|_| {
            let what = format!("found {:?}, expected a number", word.chars().take(20).collect::<String>());
            PlyFault::new(what, format!("byte {}", self.at + start))
        })?;
        self.at += start + length;
        Ok(number)
    }
}
