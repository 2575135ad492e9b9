//! How the formats name the entries of an RPC.

/// An entry of an RPC that is not a coefficient.
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

/// A format's names of the entries: scalars in the order of [`Scalar`], polynomials in the order of
/// [`POLYS`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Names {
    pub(super) scalars: [&'static str; 12],
    pub(super) polys: [&'static str; 4],
    /// The text between a polynomial's name and the number of a coefficient.
    pub(super) separator: &'static str,
    /// The number of the first coefficient.
    pub(super) first: usize,
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
    separator: "_",
    first: 1,
};

/// The entry that a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Scalar(Scalar),
    /// All twenty coefficients.
    List(Poly),
    /// One coefficient, counted from 0.
    Coefficient(Poly, usize),
    /// A coefficient with a number that is not one of the twenty.
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
    /// Returns the entry that `key` stands for. Letter case does not matter.
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

    /// Returns the number, from 0, of a coefficient of the polynomial called `name`: `None` for
    /// another key, `Some(None)` for a number that is not one of the twenty.
    fn number(&self, name: &str, key: &str) -> Option<Option<usize>> {
        let head = key.get(..name.len())?;
        let rest = key.get(name.len()..)?.strip_prefix(self.separator)?;
        if !head.eq_ignore_ascii_case(name) || rest.is_empty() || !rest.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let n = rest.parse::<usize>().ok().and_then(|n| n.checked_sub(self.first));
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

    /// This format's name of coefficient `i`, counted from 0.
    pub(super) fn coefficient(&self, p: Poly, i: usize) -> String {
        format!("{}{}{}", self.poly(p), self.separator, i + self.first)
    }
}
