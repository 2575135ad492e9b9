//! An RPC under construction: entries arrive in any order and under any name, and are checked at
//! the end.
//!
//! Every required entry must occur exactly once and be a finite number. No scale may be zero;
//! scales may be negative (Planet's LAT_SCALE is). Coefficients are in RPC00B order and image
//! offsets have the centre of the upper-left pixel at (0, 0): readers convert before they call
//! [`Draft::finish`].

use camera::{ImagePoint, Rpc};

use super::error::Fault;
use super::names::{Field, Names, POLYS, Poly, REQUIRED, RPC00B, Scalar};

/// The text of a value, with its key and its line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry<'a> {
    pub(super) key: &'a str,
    pub(super) text: &'a str,
    pub(super) line: Option<usize>,
}

impl Entry<'_> {
    /// Parses the number that `text` starts with. One word may follow as its unit.
    pub(super) fn number(&self) -> Result<f64, Fault> {
        let mut words = self.text.split_whitespace();
        let (first, unit, more) = (words.next().unwrap_or(""), words.next(), words.next());
        let is_unit = |w: &str| w.chars().all(|c| c.is_alphabetic() || "/²^-°".contains(c));
        if more.is_some() || !unit.is_none_or(is_unit) {
            return Err(self.not_a_number(self.text));
        }
        self.parse(first)
    }

    /// Parses exactly `N` numbers separated by blanks, and with `comma` also by commas.
    pub(super) fn numbers<const N: usize>(&self, comma: bool) -> Result<[f64; N], Fault> {
        let mut values = [0.0; N];
        let mut found = 0;
        let separator = |c: char| c.is_whitespace() || (comma && c == ',');
        for word in self.text.split(separator).filter(|w| !w.is_empty()) {
            let Some(slot) = values.get_mut(found) else {
                return Err(self.count(N + 1, N));
            };
            *slot = self.parse(word)?;
            found += 1;
        }
        if found == N { Ok(values) } else { Err(self.count(found, N)) }
    }

    fn parse(&self, word: &str) -> Result<f64, Fault> {
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(value) => Err(Fault::NotFinite { key: self.key.to_owned(), line: self.line, value }),
            Err(_) if word.replacen(',', ".", 1).parse::<f64>().is_ok() => {
                Err(Fault::DecimalComma { key: self.key.to_owned(), line: self.line, text: word.to_owned() })
            }
            Err(_) => Err(self.not_a_number(word)),
        }
    }

    fn not_a_number(&self, text: &str) -> Fault {
        Fault::NotANumber { key: self.key.to_owned(), line: self.line, text: text.chars().take(40).collect() }
    }

    fn count(&self, found: usize, expected: usize) -> Fault {
        Fault::Count { key: self.key.to_owned(), line: self.line, found, expected }
    }
}

/// The entries read so far.
#[derive(Debug, Default)]
pub(super) struct Draft {
    scalars: [Option<f64>; 12],
    polys: [[Option<f64>; 20]; 4],
}

impl Draft {
    /// Sets the ten scalars and eighty coefficients of `values`, which are in the order of RPC00B.
    pub(super) fn from_values(values: &[f64], entry: Entry<'_>) -> Result<Self, Fault> {
        let mut draft = Self::default();
        let mut values = values.iter();
        let mut next = || values.next().copied().ok_or_else(|| Fault::Missing { key: entry.key.to_owned() });
        for &scalar in REQUIRED {
            draft.set(scalar, next()?, Entry { key: RPC00B.scalar(scalar), ..entry })?;
        }
        for poly in POLYS {
            for i in 0..20 {
                let key = RPC00B.coefficient(poly, i);
                draft.set_coefficient(poly, i, next()?, Entry { key: &key, ..entry })?;
            }
        }
        Ok(draft)
    }

    /// Sets an entry by its name. Returns whether `names` has the name.
    pub(super) fn take(&mut self, names: &Names, entry: Entry<'_>) -> Result<bool, Fault> {
        match names.field(entry.key) {
            Field::Scalar(s) => self.set(s, entry.number()?, entry),
            Field::List(p) => self.set_list(p, entry.numbers(false)?, entry),
            Field::Coefficient(p, i) => self.set_coefficient(p, i, entry.number()?, entry),
            Field::Beyond => Err(Fault::Extra { key: entry.key.to_owned(), line: entry.line }),
            Field::Unknown => return Ok(false),
        }?;
        Ok(true)
    }

    /// Sets a scalar. `entry` gives the key and the line for errors.
    pub(super) fn set(&mut self, s: Scalar, value: f64, entry: Entry<'_>) -> Result<(), Fault> {
        set_once(&mut self.scalars[s as usize], value, entry)
    }

    /// Sets all coefficients of a polynomial.
    pub(super) fn set_list(&mut self, p: Poly, values: [f64; 20], entry: Entry<'_>) -> Result<(), Fault> {
        values.iter().enumerate().try_for_each(|(i, v)| self.set_coefficient(p, i, *v, entry))
    }

    /// Sets coefficient `i`, counted from 0.
    pub(super) fn set_coefficient(&mut self, p: Poly, i: usize, value: f64, entry: Entry<'_>) -> Result<(), Fault> {
        match self.polys[p as usize].get_mut(i) {
            Some(slot) => set_once(slot, value, entry),
            None => Err(Fault::Extra { key: entry.key.to_owned(), line: entry.line }),
        }
    }

    /// A scalar, if it has been set.
    pub(super) fn get(&self, s: Scalar) -> Option<f64> {
        self.scalars[s as usize]
    }

    /// Subtracts `first_pixel`, the file's image coordinates of the centre of the upper-left pixel,
    /// from the offsets.
    pub(super) fn shift_image(&mut self, first_pixel: ImagePoint) {
        for (s, origin) in [(Scalar::SampOff, first_pixel.sample), (Scalar::LineOff, first_pixel.line)] {
            if let Some(value) = &mut self.scalars[s as usize] {
                *value -= origin;
            }
        }
    }

    /// Returns the checked RPC. Errors name entries as `names` does.
    pub(super) fn finish(&self, names: &Names) -> Result<Rpc, Fault> {
        let scalar = |s| self.get(s).ok_or_else(|| Fault::Missing { key: names.scalar(s).to_owned() });
        let rpc = Rpc {
            line_off: scalar(Scalar::LineOff)?,
            samp_off: scalar(Scalar::SampOff)?,
            lat_off: scalar(Scalar::LatOff)?,
            long_off: scalar(Scalar::LongOff)?,
            height_off: scalar(Scalar::HeightOff)?,
            line_scale: scalar(Scalar::LineScale)?,
            samp_scale: scalar(Scalar::SampScale)?,
            lat_scale: scalar(Scalar::LatScale)?,
            long_scale: scalar(Scalar::LongScale)?,
            height_scale: scalar(Scalar::HeightScale)?,
            line_num: self.poly(Poly::LineNum, names)?,
            line_den: self.poly(Poly::LineDen, names)?,
            samp_num: self.poly(Poly::SampNum, names)?,
            samp_den: self.poly(Poly::SampDen, names)?,
            // Writers put −1 where the error is unknown.
            err_bias_m: self.get(Scalar::ErrBias).filter(|e| *e >= 0.0),
            err_rand_m: self.get(Scalar::ErrRand).filter(|e| *e >= 0.0),
        };
        check(&rpc, names)?;
        Ok(rpc)
    }

    fn poly(&self, p: Poly, names: &Names) -> Result<[f64; 20], Fault> {
        let slots = &self.polys[p as usize];
        if slots.iter().all(Option::is_none) {
            return Err(Fault::Missing { key: names.poly(p).to_owned() });
        }
        let mut values = [0.0; 20];
        for (i, (value, slot)) in values.iter_mut().zip(slots).enumerate() {
            *value = slot.ok_or_else(|| Fault::Missing { key: names.coefficient(p, i) })?;
        }
        Ok(values)
    }
}

fn set_once(slot: &mut Option<f64>, value: f64, entry: Entry<'_>) -> Result<(), Fault> {
    if !value.is_finite() {
        return Err(Fault::NotFinite { key: entry.key.to_owned(), line: entry.line, value });
    }
    match slot.replace(value) {
        None => Ok(()),
        Some(_) => Err(Fault::Duplicate { key: entry.key.to_owned(), line: entry.line }),
    }
}

/// Checks the values as far as that is possible without the scene. Errors name scales as `names`
/// does.
fn check(rpc: &Rpc, names: &Names) -> Result<(), Fault> {
    let scales = [
        (Scalar::LineScale, rpc.line_scale),
        (Scalar::SampScale, rpc.samp_scale),
        (Scalar::LatScale, rpc.lat_scale),
        (Scalar::LongScale, rpc.long_scale),
        (Scalar::HeightScale, rpc.height_scale),
    ];
    if let Some((s, _)) = scales.iter().find(|(_, value)| *value == 0.0) {
        return Err(Fault::ZeroScale { key: names.scalar(*s).to_owned() });
    }
    rpc.validate().map_err(Fault::NoCamera)
}
