//! The attributes, generic attributes and addresses of CityGML's objects and boundary surfaces, as
//! CityJSON holds them.
//!
//! A property that holds no geometry and no other object is read as a small tree. An
//! element with text becomes text, or a number where CityGML defines one; an element with elements
//! becomes a JSON object; repeated names become an array. Generic attributes get their own names,
//! and an address the names that CityJSON's specification shows.

use serde_json::{Map, Number, Value};

use super::attributes::Attributes;

/// Attributes of CityGML that are numbers.
const NUMBERS: [&str; 4] = ["measuredHeight", "storeysAboveGround", "storeysBelowGround", "storeyHeights"];
/// Largest number of elements of a property. Real ones have a few dozen.
const ELEMENTS_MAX: usize = 10_000;
/// Largest text of an element, bytes.
const TEXT_MAX: usize = 1 << 16;
/// Names of the parts of an address in xAL, and in CityJSON.
const ADDRESS: [(&str, &str); 6] = [
    ("CountryName", "CountryName"),
    ("LocalityName", "LocalityName"),
    ("ThoroughfareName", "ThoroughfareName"),
    ("ThoroughfareNumber", "ThoroughfareNumber"),
    ("PostalCodeNumber", "PostalCode"),
    ("PostBoxNumber", "PostBox"),
];

/// An element of a property.
#[derive(Debug, Default)]
struct Element {
    name: String,
    /// XML attribute `name`, of generic attributes.
    label: Option<String>,
    text: String,
    below: Vec<Element>,
}

/// A property that is being read: its open elements, the property itself first.
#[derive(Debug)]
pub(super) struct Property {
    open: Vec<Element>,
    elements: usize,
}

/// What a property holds.
#[derive(Debug)]
pub(super) enum Ended {
    /// An attribute; its value is `None` when it is empty.
    Attribute(String, Option<Value>),
    /// The parts of an address.
    Address(Value),
    /// Nothing.
    Nothing,
}

impl Element {
    fn new(name: &str, attributes: &Attributes) -> Self {
        Self { name: name.to_owned(), label: attributes.get("name").map(str::to_owned), ..Self::default() }
    }

    fn find(&self, name: &str) -> Option<&Self> {
        self.below.iter().find(|element| element.name == name)
    }

    /// Returns the element as JSON; `None` when it is empty.
    fn value(&self) -> Option<Value> {
        if self.below.is_empty() {
            let text = self.text.trim();
            return (!text.is_empty()).then(|| typed(text, NUMBERS.contains(&&*self.name)));
        }
        let mut map = Map::new();
        self.below.iter().for_each(|element| add(&mut map, &element.name, element.value()));
        (!map.is_empty()).then_some(Value::Object(map))
    }

    /// Returns name and value of a generic attribute, or of a set of them.
    fn generic(&self) -> Option<(String, Option<Value>)> {
        // CityGML 3 wraps the attribute and writes its name as an element.
        if self.name == "genericAttribute" {
            return self.below.first()?.generic();
        }
        let is_set = self.name.ends_with("GenericAttributeSet") || self.name.ends_with("genericAttributeSet");
        if !(is_set || self.name.ends_with("Attribute") && self.name.len() > "Attribute".len()) {
            return None;
        }
        let name = self.label.clone().or_else(|| Some(self.find("name")?.text.trim().to_owned()))?;
        if is_set {
            let mut map = Map::new();
            self.below.iter().filter_map(Self::generic).for_each(|(name, value)| add(&mut map, &name, value));
            return Some((name, Some(Value::Object(map))));
        }
        let text = self.find("value").map_or("", |value| value.text.trim());
        let kind = self.name.to_ascii_lowercase();
        let is_number = ["int", "double", "measure"].iter().any(|number| kind.starts_with(number));
        Some((name, Some(typed(text, is_number))))
    }

    /// Collects the texts of an address.
    fn address(&self, parts: &mut Map<String, Value>) {
        let known = ADDRESS.iter().find(|(known, _)| *known == self.name).map(|&(_, name)| name);
        let text = self.text.trim();
        if !text.is_empty() {
            add(parts, known.unwrap_or(&self.name), Some(Value::String(text.to_owned())));
        }
        self.below.iter().for_each(|element| element.address(parts));
    }
}

impl Property {
    /// Begins a property.
    pub(super) fn new(name: &str, attributes: &Attributes) -> Self {
        Self { open: vec![Element::new(name, attributes)], elements: 1 }
    }

    /// Begins an element. Elements beyond the limit are read into the one above them.
    pub(super) fn start(&mut self, name: &str, attributes: &Attributes) {
        self.elements += 1;
        self.open.push(Element::new(name, attributes));
    }

    /// Adds text to the open element.
    pub(super) fn text(&mut self, text: &str) {
        if let Some(open) = self.open.last_mut().filter(|open| open.text.len() + text.len() <= TEXT_MAX) {
            open.text.push_str(text);
        }
    }

    /// Ends the open element. Returns what the property holds when that was the property itself.
    pub(super) fn end(&mut self) -> Option<Ended> {
        let Some(ended) = self.open.pop() else { return Some(Ended::Nothing) };
        if let Some(above) = self.open.last_mut() {
            if self.elements <= ELEMENTS_MAX {
                above.below.push(ended);
            }
            return None;
        }
        if ended.name == "address" {
            let mut parts = Map::new();
            ended.address(&mut parts);
            return Some(if parts.is_empty() { Ended::Nothing } else { Ended::Address(Value::Object(parts)) });
        }
        let (name, value) = ended.generic().unwrap_or_else(|| (ended.name.clone(), ended.value()));
        Some(Ended::Attribute(name, value))
    }
}

/// Returns a number where one is expected and found, and text otherwise.
fn typed(text: &str, is_number: bool) -> Value {
    let whole = || text.parse::<i64>().ok().map(Number::from);
    let number = || whole().or_else(|| text.parse::<f64>().ok().and_then(Number::from_f64));
    is_number.then(number).flatten().map_or_else(|| Value::String(text.to_owned()), Value::Number)
}

/// Adds a value under a name; a name that exists already gets an array.
pub(super) fn add(map: &mut Map<String, Value>, name: &str, value: Option<Value>) {
    let Some(value) = value else { return };
    match map.get_mut(name) {
        None => drop(map.insert(name.to_owned(), value)),
        Some(Value::Array(known)) => known.push(value),
        Some(known) => *known = Value::Array(vec![known.take(), value]),
    }
}
