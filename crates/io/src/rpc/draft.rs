//! An RPC under construction: entries arrive in any order and under any name, and are checked once.
//!
//! Every entry must be there once, be a finite number, and no scale may be zero. Scales may be negative
//! (Planet's LAT_SCALE is). Coefficients are in RPC00B order, image offsets have the upper-left pixel centre at (0, 0);
//! readers convert before they call [`Draft::finish`].

use camera::Rpc;

use super::error::Fault;

/// One of the numbers of an RPC that is no coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    LineOff,
    SampOff,
    LatOff,
    LongOff,
    HeightOff,
    LineScale,
    SampScale,
    LatScale,
    LongScale,
    HeightScale,
    ErrBias,
    ErrRand,
}

/// One of the four polynomials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Poly {
    LineNum,
    LineDen,
    SampNum,
    SampDen,
}

/// The scalars that every RPC has, in the order of RPC00B and of the fixed-width formats.
pub(super) const REQUIRED: &[Scalar] = SCALARS.split_at(10).0;

/// The polynomials in the order of RPC00B.
pub(super) const POLYS: [Poly; 4] = [Poly::LineNum, Poly::LineDen, Poly::SampNum, Poly::SampDen];

/// How a format names the entries: scalars in the order of [`Scalar`], polynomials in that of [`POLYS`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Names {
    pub(super) scalars: [&'static str; 12],
    pub(super) polys: [&'static str; 4],
    /// What stands between a polynomial's name and the number of its first coefficient, and that number.
    pub(super) index: (&'static str, usize),
}

/// The names of RPC00B as GDAL and the text formats write them.
pub(super) const RPC00B: Names = Names {
    scalars: [
        "LINE_OFF",
        "SAMP_OFF",
        "LAT_OFF",
        "LONG_OFF",
        "HEIGHT_OFF",
        "LINE_SCALE",
        "SAMP_SCALE",
        "LAT_SCALE",
        "LONG_SCALE",
        "HEIGHT_SCALE",
        "ERR_BIAS",
        "ERR_RAND",
    ],
    polys: ["LINE_NUM_COEFF", "LINE_DEN_COEFF", "SAMP_NUM_COEFF", "SAMP_DEN_COEFF"],
    index: ("_", 1),
};

/// What an entry's name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Scalar(Scalar),
    /// All twenty coefficients.
    List(Poly),
    /// One coefficient, counted from 0.
    Coefficient(Poly, usize),
    /// A coefficient whose number is not one of the twenty.
    Beyond,
    Unknown,
}

/// All scalars in the order of [`Names::scalars`]; the two optional ones are last.
const SCALARS: [Scalar; 12] = [
    Scalar::LineOff,
    Scalar::SampOff,
    Scalar::LatOff,
    Scalar::LongOff,
    Scalar::HeightOff,
    Scalar::LineScale,
    Scalar::SampScale,
    Scalar::LatScale,
    Scalar::LongScale,
    Scalar::HeightScale,
    Scalar::ErrBias,
    Scalar::ErrRand,
];

impl Names {
    /// What `key` stands for; upper and lower case are the same.
    pub(super) fn field(&self, key: &str) -> Field {
        let by_name = |names: &[&str]| names.iter().position(|n| n.eq_ignore_ascii_case(key));
        if let Some(scalar) = by_name(&self.scalars).and_then(|i| SCALARS.get(i)) {
            return Field::Scalar(*scalar);
        }
        if let Some(poly) = by_name(&self.polys).and_then(|i| POLYS.get(i)) {
            return Field::List(*poly);
        }
        let numbered = self.polys.iter().zip(POLYS).find_map(|(name, poly)| Some((poly, self.number(name, key)?)));
        match numbered {
            Some((poly, Some(i))) => Field::Coefficient(poly, i),
            Some((_, None)) => Field::Beyond,
            None => Field::Unknown,
        }
    }

    /// The number of a coefficient of the polynomial called `name`: `Some(None)` when there is no such coefficient.
    fn number(&self, name: &str, key: &str) -> Option<Option<usize>> {
        let head = key.get(..name.len())?;
        let rest = key.get(name.len()..)?.strip_prefix(self.index.0)?;
        if !head.eq_ignore_ascii_case(name) || rest.is_empty() || !rest.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let n = rest.parse::<usize>().ok().and_then(|n| n.checked_sub(self.index.1));
        Some(n.filter(|n| *n < 20))
    }

    /// This format's name of a scalar.
    pub(super) fn scalar(&self, s: Scalar) -> &'static str {
        self.scalars[s as usize]
    }

    /// This format's name of a polynomial.
    pub(super) fn poly(&self, p: Poly) -> &'static str {
        self.polys[p as usize]
    }

    /// This format's name of a coefficient, counted from 0.
    pub(super) fn coefficient(&self, p: Poly, i: usize) -> String {
        format!("{}{}{}", self.poly(p), self.index.0, i + self.index.1)
    }
}

/// A value in a text, with where it stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry<'a> {
    pub(super) key: &'a str,
    pub(super) text: &'a str,
    pub(super) line: Option<usize>,
}

impl Entry<'_> {
    /// The number that `text` starts with; one word may follow as its unit.
    pub(super) fn number(&self) -> Result<f64, Fault> {
        let mut words = self.text.split_whitespace();
        let (first, unit, more) = (words.next().unwrap_or(""), words.next(), words.next());
        let is_unit = |w: &str| w.chars().all(|c| c.is_alphabetic() || "/²^-°".contains(c));
        if more.is_some() || !unit.is_none_or(is_unit) {
            return Err(self.not_a_number(self.text));
        }
        self.parse(first)
    }

    /// Exactly `N` numbers separated by blanks or, where `comma` says so, by commas.
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
    /// Takes an entry by its name. `Ok(false)` when the name means nothing in `names`.
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

    /// Sets a scalar; `entry` says where it came from.
    pub(super) fn set(&mut self, s: Scalar, value: f64, entry: Entry<'_>) -> Result<(), Fault> {
        set_once(&mut self.scalars[s as usize], value, entry)
    }

    /// Sets all coefficients of a polynomial.
    pub(super) fn set_list(&mut self, p: Poly, values: [f64; 20], entry: Entry<'_>) -> Result<(), Fault> {
        values.iter().enumerate().try_for_each(|(i, v)| self.set_coefficient(p, i, *v, entry))
    }

    /// Sets one coefficient, counted from 0.
    pub(super) fn set_coefficient(&mut self, p: Poly, i: usize, value: f64, entry: Entry<'_>) -> Result<(), Fault> {
        match self.polys[p as usize].get_mut(i) {
            Some(slot) => set_once(slot, value, entry),
            None => Err(Fault::Extra { key: entry.key.to_owned(), line: entry.line }),
        }
    }

    /// A scalar that has been read.
    pub(super) fn get(&self, s: Scalar) -> Option<f64> {
        self.scalars[s as usize]
    }

    /// Moves the image coordinates: what a file counts from `origin` at the upper-left pixel is counted from 0.
    pub(super) fn shift_image(&mut self, origin_sample: f64, origin_line: f64) {
        for (s, origin) in [(Scalar::SampOff, origin_sample), (Scalar::LineOff, origin_line)] {
            if let Some(value) = &mut self.scalars[s as usize] {
                *value -= origin;
            }
        }
    }

    /// The finished RPC; errors name entries as `names` does.
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
            // Writers put −1 where the provider said nothing.
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

/// What can be said about the values without knowing the scene; the scales under the format's own names.
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
