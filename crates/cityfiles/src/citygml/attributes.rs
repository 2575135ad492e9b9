//! The attributes of an XML element.

use quick_xml::events::BytesStart;

use crate::error::CityFault;

/// Limit of the attributes of an element. The root has the most, because it declares the
/// namespaces.
const ATTRIBUTES_MAX: usize = 256;

/// The attributes of an element by their local names. Declarations of namespaces have the name
/// `xmlns`.
pub(super) struct Attributes(Vec<(String, String)>);

impl Attributes {
    /// Reads the attributes of an element in line `line`.
    pub(super) fn read(e: &BytesStart<'_>, line: usize) -> Result<Self, CityFault> {
        let mut found = Vec::new();
        // The reader's own check for repeated names takes quadratic time.
        for attribute in e.attributes().with_checks(false) {
            if found.len() == ATTRIBUTES_MAX {
                let what = format!("an XML element has more than {ATTRIBUTES_MAX} attributes");
                return Err(CityFault::in_line(what, line));
            }
            let broken = |e: &dyn std::fmt::Display| CityFault::in_line(format!("invalid XML attribute: {e}"), line);
            let attribute = attribute.map_err(|e| broken(&e))?;
            let value = attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0).map_err(|e| broken(&e))?;
            let key: &str = attribute.key.as_ref();
            let name = if key.starts_with("xmlns") { "xmlns" } else { key.rsplit(':').next().unwrap_or(key) };
            found.push((name.to_owned(), value.into_owned()));
        }
        Ok(Self(found))
    }

    /// Returns the value of the first attribute with a local name.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// Iterates over the declared namespaces.
    pub(super) fn namespaces(&self) -> impl Iterator<Item = &str> {
        self.0.iter().filter(|(name, _)| name == "xmlns").map(|(_, value)| value.as_str())
    }
}
