//! The numbers of a request.

use std::collections::BTreeMap;

use super::http::Refusal;

/// The query of an address: names and values without escapes, as the page writes them.
pub(super) struct Query<'a>(BTreeMap<&'a str, &'a str>);

impl<'a> Query<'a> {
    /// Splits a query. Of a repeated name, the last value counts.
    pub(super) fn new(text: &'a str) -> Self {
        Self(text.split('&').filter_map(|part| part.split_once('=')).collect())
    }

    /// Returns a finite number.
    ///
    /// # Errors
    /// [`Refusal::Malformed`] if it is missing or no finite number.
    pub(super) fn number(&self, name: &str) -> Result<f64, Refusal> {
        let found = self.text(name)?.parse().ok().filter(|number: &f64| number.is_finite());
        found.ok_or_else(|| Refusal::Malformed(format!("{name} is not a finite number")))
    }

    /// Returns a whole number up to 2³¹ − 1.
    ///
    /// # Errors
    /// [`Refusal::Malformed`] if it is missing or something else.
    pub(super) fn whole(&self, name: &str) -> Result<usize, Refusal> {
        whole(self.text(name)?).ok_or_else(|| Refusal::Malformed(format!("{name} is not a number from 0 to 2^31 - 1")))
    }

    /// Returns a value as it stands.
    ///
    /// # Errors
    /// [`Refusal::Malformed`] if it is missing.
    pub(super) fn text(&self, name: &str) -> Result<&'a str, Refusal> {
        self.0.get(name).copied().ok_or_else(|| Refusal::Malformed(format!("{name} is missing")))
    }
}

/// Reads digits as a number up to 2³¹ − 1.
pub(super) fn whole(text: &str) -> Option<usize> {
    let is_plain = !text.is_empty() && text.len() <= 10 && text.bytes().all(|b| b.is_ascii_digit());
    let number: i64 = is_plain.then(|| text.parse().ok()).flatten()?;
    i32::try_from(number).ok().and_then(|number| usize::try_from(number).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_and_others_refused() {
        let query = Query::new("a=1.5&b=-2e3&c=12&c=13&d=&e");
        assert_eq!((query.number("a").unwrap(), query.number("b").unwrap()), (1.5, -2000.0));
        assert_eq!(query.whole("c").unwrap(), 13);
        for name in ["d", "e", "f"] {
            assert!(query.number(name).is_err() && query.whole(name).is_err(), "{name}");
        }
        for text in ["", "-1", "+1", "1.0", "2147483648", "99999999999999999999", "١", "inf", "0x1"] {
            assert_eq!(whole(text), None, "{text}");
        }
        for text in ["inf", "NaN", "1e999", "a"] {
            assert!(Query::new(&format!("a={text}")).number("a").is_err(), "{text}");
        }
    }
}
