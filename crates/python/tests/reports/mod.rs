//! The types of the reports in Python, `python/skysweep/reports.py`, made of the structures that
//! serde writes as JSON: names and documentation from the Rust sources, types from the fields.
//!
//! Two reports are put together by hand in Rust; their form is in `shapes.rs`, and a test of Python
//! compares it with what the jobs return.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::rc::Rc;

use syn::{Attribute, Field, Fields, GenericArgument, Item, ItemEnum, ItemStruct, PathArguments, Type};

use super::{cased, docs, docstring, option, serde, tokens};

/// Names that cannot be attributes: words of the language, and methods of dictionaries. These
/// fields are read as keys.
const NO_ATTRIBUTES: [&str; 12] =
    ["class", "from", "in", "is", "clear", "copy", "get", "items", "keys", "pop", "update", "values"];

/// The structures and enumerations that are written, by name.
#[derive(Default)]
struct Written {
    structs: BTreeMap<String, Rc<ItemStruct>>,
    enums: BTreeMap<String, Rc<ItemEnum>>,
}

impl Written {
    fn read(&mut self, folder: &Path) {
        for path in fs::read_dir(folder).expect("a folder of sources").flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                self.read(&path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("a source");
                if text.contains("Serialize") {
                    self.add(syn::parse_file(&text).expect("valid Rust").items);
                }
            }
        }
    }

    fn add(&mut self, items: Vec<Item>) {
        for item in items {
            match item {
                Item::Struct(item) if derives(&item.attrs) => {
                    self.structs.insert(item.ident.to_string(), Rc::new(item));
                }
                Item::Enum(item) if derives(&item.attrs) => {
                    self.enums.insert(item.ident.to_string(), Rc::new(item));
                }
                _ => {}
            }
        }
    }
}

fn derives(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| a.path().is_ident("derive") && tokens(a).contains("Serialize"))
}

/// A type in Python, and the class of the dictionaries in it: `*` stands before the class of the
/// values of a dictionary, `|` between classes of which one fits.
#[derive(Clone)]
struct Typed {
    text: String,
    class: Option<String>,
}

impl Typed {
    fn plain(text: &str) -> Self {
        Self { text: text.to_owned(), class: None }
    }

    fn mapped(self, text: impl Fn(&str) -> String) -> Self {
        Self { text: text(&self.text), class: self.class }
    }

    /// A type of either kind, each named once.
    fn either(all: &[Self]) -> Self {
        let (mut texts, mut classes): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
        for one in all {
            texts.extend(one.text.split(" | ").filter(|text| !texts.contains(text)).collect::<Vec<_>>());
            classes.extend(one.class.as_deref().filter(|class| !classes.contains(class)));
        }
        Self { text: texts.join(" | "), class: (!classes.is_empty()).then(|| classes.join("|")) }
    }
}

/// One attribute of a class.
struct Attributed {
    key: String,
    typed: Typed,
    docs: String,
    /// What the attribute is where the key is missing.
    absent: Option<&'static str>,
}

/// Writes the classes that the reports need.
struct Writer {
    known: Written,
    classes: BTreeMap<String, String>,
    begun: BTreeSet<String>,
    /// The names of the types that structures with an open type were given last.
    given: BTreeMap<String, String>,
}

impl Writer {
    fn of(&mut self, ty: &Type, attributes: &[Attribute]) -> Typed {
        let attribute = serde(attributes);
        if attribute.contains("as_text") {
            return Typed::plain("str | None");
        }
        if attribute.contains("null_is_nan") {
            return Typed::plain("float | None");
        }
        if attribute.contains("serialize_with") {
            return Typed::plain("str");
        }
        match ty {
            Type::Array(array) => self.of(&array.elem, &[]).mapped(|one| format!("list[{one}]")),
            Type::Slice(slice) => self.of(&slice.elem, &[]).mapped(|one| format!("list[{one}]")),
            Type::Reference(to) => self.of(&to.elem, &[]),
            Type::Tuple(tuple) => {
                let parts: Vec<Typed> = tuple.elems.iter().map(|part| self.of(part, &[])).collect();
                Typed::either(&parts).mapped(|one| format!("list[{one}]"))
            }
            Type::Path(path) => {
                let last = path.path.segments.last().expect("a type has a name");
                let inner: Vec<&Type> = match &last.arguments {
                    PathArguments::AngleBracketed(inner) => inner
                        .args
                        .iter()
                        .filter_map(|a| if let GenericArgument::Type(ty) = a { Some(ty) } else { None })
                        .collect(),
                    _ => Vec::new(),
                };
                self.of_name(&last.ident.to_string(), &inner)
            }
            _ => panic!("a report has a type that has no form in Python: {attribute}"),
        }
    }

    fn of_name(&mut self, name: &str, inner: &[&Type]) -> Typed {
        match (name, inner) {
            ("Option", [inner]) => self
                .of(inner, &[])
                .mapped(|one| if one.ends_with("| None") { one.into() } else { format!("{one} | None") }),
            ("Vec" | "BTreeSet", [inner]) => self.of(inner, &[]).mapped(|one| format!("list[{one}]")),
            ("Box" | "Arc", [inner]) => self.of(inner, &[]),
            ("BTreeMap" | "HashMap", [_, inner]) => {
                let Typed { text, class } = self.of(inner, &[]);
                Typed { text: format!("dict[str, {text}]"), class: class.map(|class| format!("*{class}")) }
            }
            ("PathBuf" | "String" | "str" | "Path" | "char", _) => Typed::plain("str"),
            ("bool", _) => Typed::plain("bool"),
            ("f32" | "f64", _) => Typed::plain("float"),
            ("Value", _) => Typed::plain("Any"),
            _ if name.trim_start_matches(['u', 'i']).parse::<u8>().is_ok() || name.ends_with("size") => {
                Typed::plain("int")
            }
            _ => match self.given.get(name).cloned() {
                Some(given) => self.of_name(&given, &[]),
                None => self.named(name),
            },
        }
    }

    fn named(&mut self, name: &str) -> Typed {
        if let Some(item) = self.known.structs.get(name).cloned() {
            if let Some(into) = option(&item.attrs, "into") {
                return self.of(&syn::parse_str(&into).expect("a type"), &[]);
            }
            return match &item.fields {
                Fields::Unnamed(fields) if fields.unnamed.len() == 1 => self.of(&fields.unnamed[0].ty, &[]),
                _ => self.class(name, &docs(&item.attrs), |writer| writer.attributes(&item)),
            };
        }
        let item = self.known.enums.get(name).cloned();
        let item = item.unwrap_or_else(|| panic!("{name} is part of a report, and derives no Serialize"));
        self.enumeration(name, &item)
    }

    fn enumeration(&mut self, name: &str, item: &ItemEnum) -> Typed {
        if let Some(into) = option(&item.attrs, "into") {
            return self.of(&syn::parse_str(&into).expect("a type"), &[]);
        }
        if serde(&item.attrs).contains("untagged") {
            let values: Vec<&Type> =
                item.variants.iter().map(|v| &v.fields.iter().next().expect("a value").ty).collect();
            if values.iter().all(|ty| self.is_structure(ty)) {
                return self.class(name, &docs(&item.attrs), |writer| writer.of_one_of(&values));
            }
            let all: Vec<Typed> = values.into_iter().map(|ty| self.of(ty, &[])).collect();
            return Typed::either(&all);
        }
        if option(&item.attrs, "tag").is_some() {
            return self.class(name, &docs(&item.attrs), |writer| writer.of_tagged(item));
        }
        let plain: Vec<String> =
            item.variants.iter().filter(|v| v.fields.is_empty()).map(|v| called(item, v)).collect();
        let mut all = Vec::new();
        if !plain.is_empty() {
            all.push(literal(&plain));
        }
        if plain.len() < item.variants.len() {
            all.push(self.class(name, &docs(&item.attrs), |writer| {
                let holding = item.variants.iter().filter(|v| !v.fields.is_empty());
                let attributes = holding.map(|v| {
                    let typed = match &v.fields {
                        Fields::Unnamed(fields) if fields.unnamed.len() == 1 => writer.of(&fields.unnamed[0].ty, &[]),
                        Fields::Unnamed(fields) => {
                            let parts: Vec<Typed> = fields.unnamed.iter().map(|f| writer.of(&f.ty, &[])).collect();
                            Typed::either(&parts).mapped(|one| format!("list[{one}]"))
                        }
                        fields => {
                            let class = format!("{name}{}", v.ident);
                            writer.class(&class, &docs(&v.attrs), |writer| writer.of_fields(fields))
                        }
                    };
                    may_be_absent(Attributed { key: called(item, v), typed, docs: docs(&v.attrs), absent: None })
                });
                attributes.collect()
            }));
        }
        Typed::either(&all)
    }

    /// Whether a type is a structure, in a box or not.
    fn is_structure(&self, ty: &Type) -> bool {
        let Type::Path(path) = ty else { return false };
        let last = path.path.segments.last().expect("a type has a name");
        match &last.arguments {
            PathArguments::AngleBracketed(inner) => {
                matches!(inner.args.first(), Some(GenericArgument::Type(inner)) if self.is_structure(inner))
            }
            _ => self.known.structs.contains_key(&last.ident.to_string()),
        }
    }

    /// The attributes of one of several structures: those that not all of them have may be absent.
    fn of_one_of(&mut self, structures: &[&Type]) -> Vec<Attributed> {
        let all: Vec<Vec<Attributed>> = structures.iter().map(|ty| self.inlined_as_is(ty)).collect();
        let count = |key: &str| all.iter().flatten().filter(|attribute| attribute.key == key).count();
        let shared: BTreeSet<String> =
            all.iter().flatten().map(|a| a.key.clone()).filter(|key| count(key) == all.len()).collect();
        let own = |a: Attributed| if shared.contains(&a.key) { a } else { may_be_absent(a) };
        all.into_iter().flatten().map(own).collect()
    }

    /// The attributes of an enumeration whose variants say which one they are.
    fn of_tagged(&mut self, item: &ItemEnum) -> Vec<Attributed> {
        let names: Vec<String> = item.variants.iter().map(|v| called(item, v)).collect();
        let key = option(&item.attrs, "tag").expect("a tag");
        let mut all =
            vec![Attributed { key, typed: literal(&names), docs: "Which of them it is.".into(), absent: None }];
        for variant in &item.variants {
            all.extend(self.of_fields(&variant.fields).into_iter().map(may_be_absent));
        }
        all
    }

    /// The attributes of the fields of a structure.
    fn attributes(&mut self, item: &ItemStruct) -> Vec<Attributed> {
        self.of_fields(&item.fields)
    }

    fn of_fields(&mut self, fields: &Fields) -> Vec<Attributed> {
        let mut all = Vec::new();
        for field in fields.iter().filter(|field| !is_skipped(field)) {
            let options = serde(&field.attrs);
            if field.ident.is_none() || options.contains("flatten") {
                all.extend(self.inlined(&field.ty));
                continue;
            }
            let absent = match option(&field.attrs, "skip_serializing_if").as_deref() {
                None => None,
                Some("Vec::is_empty") => Some("[]"),
                Some("std::ops::Not::not") => Some("False"),
                Some(_) => Some("None"),
            };
            let typed = self.of(&field.ty, &field.attrs);
            let is_open = absent == Some("None") && !typed.text.ends_with("| None");
            let typed = if is_open { typed.mapped(|one| format!("{one} | None")) } else { typed };
            all.push(Attributed { key: super::key(field), typed, docs: docs(&field.attrs), absent });
        }
        all
    }

    /// The attributes of a structure or a tagged enumeration that lies in the place of a field.
    fn inlined(&mut self, ty: &Type) -> Vec<Attributed> {
        let is_optional =
            matches!(ty, Type::Path(path) if path.path.segments.last().is_some_and(|s| s.ident == "Option"));
        let all = self.inlined_as_is(ty);
        if is_optional { all.into_iter().map(may_be_absent).collect() } else { all }
    }

    fn inlined_as_is(&mut self, ty: &Type) -> Vec<Attributed> {
        let Type::Path(path) = ty else { panic!("what is flattened has a name") };
        let last = path.path.segments.last().expect("a type has a name");
        let name = last.ident.to_string();
        let inner = match &last.arguments {
            PathArguments::AngleBracketed(inner) => inner.args.first(),
            _ => None,
        };
        if let Some(item) = self.known.structs.get(&name).cloned() {
            // The structure may leave the type of a field open.
            let parameter = item.generics.type_params().next().map(|open| open.ident.to_string());
            if let (Some(parameter), Some(GenericArgument::Type(Type::Path(given)))) = (parameter, inner) {
                let given = given.path.segments.last().expect("a type has a name");
                self.given.insert(parameter, given.ident.to_string());
            }
            return self.attributes(&item);
        }
        if let Some(inner) = inner {
            let GenericArgument::Type(inner) = inner else { panic!("a type in {name}") };
            return self.inlined_as_is(inner);
        }
        match self.known.enums.get(&name).cloned() {
            Some(item) if option(&item.attrs, "tag").is_some() => self.of_tagged(&item),
            _ => panic!("{name} is flattened in a report, and has no form in Python"),
        }
    }

    /// A class, written once.
    fn class(&mut self, name: &str, text: &str, attributes: impl FnOnce(&mut Self) -> Vec<Attributed>) -> Typed {
        let typed = Typed { text: name.to_owned(), class: Some(name.to_owned()) };
        if !self.begun.insert(name.to_owned()) {
            return typed;
        }
        let mut known: Vec<Attributed> = Vec::new();
        for attribute in attributes(self) {
            match known.iter_mut().find(|other| other.key == attribute.key) {
                Some(other) => other.typed = Typed::either(&[other.typed.clone(), attribute.typed]),
                None => known.push(attribute),
            }
        }
        let mut out = format!("class {name}(Report):\n{}", docstring(text, "    "));
        for Attributed { key, typed, docs, .. } in &known {
            if NO_ATTRIBUTES.contains(&key.as_str()) || !is_name(key) {
                let _ = writeln!(out, "\n    # By its key: [\"{key}\"] is {}.", typed.text);
                continue;
            }
            let _ = writeln!(out, "\n    {key}: {}", typed.text);
            out += &docstring(docs, "    ");
        }
        let entries = |all: Vec<String>| all.join(", ");
        let parts: Vec<String> =
            known.iter().filter_map(|a| Some(format!("\"{}\": \"{}\"", a.key, a.typed.class.as_ref()?))).collect();
        let absent: Vec<String> = known.iter().filter_map(|a| Some(format!("\"{}\": {}", a.key, a.absent?))).collect();
        for (field, all) in [("_parts", parts), ("_absent", absent)] {
            if !all.is_empty() {
                let _ = writeln!(out, "\n    {field} = {{{}}}", entries(all));
            }
        }
        self.classes.insert(name.to_owned(), out);
        typed
    }
}

fn called(item: &ItemEnum, variant: &syn::Variant) -> String {
    let rule = option(&item.attrs, "rename_all");
    option(&variant.attrs, "rename").unwrap_or_else(|| cased(&variant.ident.to_string(), rule.as_deref()))
}

fn literal(names: &[String]) -> Typed {
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
    Typed::plain(&format!("Literal[{}]", quoted.join(", ")))
}

fn is_skipped(field: &Field) -> bool {
    let options = serde(&field.attrs);
    options.split(',').any(|one| matches!(one.trim(), "skip" | "skip_serializing"))
}

fn is_name(key: &str) -> bool {
    key.chars().all(|c| c.is_alphanumeric() || c == '_') && !key.starts_with(|c: char| c.is_ascii_digit())
}

fn may_be_absent(attribute: Attributed) -> Attributed {
    let typed = Typed::either(&[attribute.typed, Typed::plain("None")]);
    Attributed { typed, absent: attribute.absent.or(Some("None")), ..attribute }
}

const HEAD: &str =
    "\"\"\"The types of the reports. Made by `make stubs` of the structures that the jobs write; do not edit.

A report is a dictionary whose keys are attributes as well. What the report leaves out where there is
nothing to say is `None`, `False` or an empty list as an attribute, and no key.
\"\"\"

from __future__ import annotations

from typing import Any, Literal

from ._call import Report

";

/// Makes the module of the reports with these names.
pub(crate) fn made(crates: &Path, reports: &[&str]) -> String {
    let mut known = Written::default();
    for folder in fs::read_dir(crates).expect("the crates").flatten() {
        let folder = folder.path();
        if folder.join("src").is_dir() {
            known.read(&folder.join("src"));
        }
    }
    known.add(syn::parse_file(include_str!("shapes.rs")).expect("valid Rust").items);
    let mut writer = Writer { known, classes: BTreeMap::new(), begun: BTreeSet::new(), given: BTreeMap::new() };
    for report in reports.iter().filter(|name| **name != "String") {
        writer.named(report);
    }
    let names: String = writer.classes.keys().map(|name| format!("    \"{name}\",\n")).collect();
    let classes: Vec<String> = writer.classes.into_values().collect();
    format!("{HEAD}__all__ = [\n{names}]\n\n\n{}", classes.join("\n\n"))
}
