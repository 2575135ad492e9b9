//! The Python functions of the jobs, `python/skysweep/_jobs.py`, are made of the configurations:
//! names and documentation from the Rust sources, types from the fields, defaults from serde.
//!
//! So are the types of the reports, `reports.py`: see the module `reports`.
//!
//! The test fails when a file is not what would be made now. With `SKYSWEEP_WRITE_STUBS=1`
//! (`make stubs`) the files are written.

// The crate's own tests cannot be linked, because the symbols of Python are absent; these two files
// know nothing of Python.
#[allow(dead_code, reason = "the test runs no job")]
#[path = "../src/catalogue.rs"]
mod catalogue;
mod examples;
#[allow(dead_code, reason = "the test looks at two errors only")]
#[path = "../src/fault.rs"]
mod fault;
mod options;
mod reports;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use catalogue::{Fields, JOBS, JobEntry};
use examples::EXAMPLES;
use numeric::Kind;
use serde_json::{Map, Value};
use syn::{Attribute, Expr, Field, GenericArgument, Item, ItemEnum, ItemStruct, Lit, Meta, PathArguments, Type};

/// Width of the text of docstrings, columns.
const WIDTH: usize = 100;
/// Names of fields that a class of Python cannot have.
const KEYWORDS: [&str; 4] = ["class", "from", "in", "is"];

fn crates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Structures and enumerations of the workspace by name.
#[derive(Default)]
struct Types {
    structs: BTreeMap<String, ItemStruct>,
    enums: BTreeMap<String, ItemEnum>,
}

impl Types {
    fn read(folder: &Path, types: &mut Self) {
        for path in fs::read_dir(folder).expect("a folder of sources").flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                Self::read(&path, types);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("a source");
                // Most sources have no configuration, and parsing takes the time.
                if text.contains("Deserialize") {
                    types.add(syn::parse_file(&text).expect("valid Rust").items);
                }
            }
        }
    }

    fn add(&mut self, items: Vec<Item>) {
        for item in items {
            match item {
                Item::Struct(item) if derives(&item.attrs) => {
                    self.structs.insert(item.ident.to_string(), item);
                }
                Item::Enum(item) if derives(&item.attrs) => {
                    self.enums.insert(item.ident.to_string(), item);
                }
                _ => {}
            }
        }
    }
}

fn derives(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| a.path().is_ident("derive") && tokens(a).contains("Deserialize"))
}

fn tokens(attribute: &Attribute) -> String {
    match &attribute.meta {
        Meta::List(list) => list.tokens.to_string(),
        _ => String::new(),
    }
}

/// The tokens of all serde attributes, such as `rename = "scene"`.
fn serde(attributes: &[Attribute]) -> String {
    attributes.iter().filter(|a| a.path().is_ident("serde")).map(tokens).collect::<Vec<_>>().join(", ")
}

/// The text in quotes after `key =` of serde attributes.
fn option(attributes: &[Attribute], key: &str) -> Option<String> {
    let text = serde(attributes);
    let entry = text.split(',').find(|entry| entry.trim().starts_with(&format!("{key} =")))?;
    Some(entry.split('"').nth(1)?.to_owned())
}

fn docs(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter(|a| a.path().is_ident("doc")).filter_map(|a| match &a.meta {
        Meta::NameValue(pair) => match &pair.value {
            Expr::Lit(lit) => match &lit.lit {
                Lit::Str(text) => Some(text.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    });
    let text = lines.take_while(|line| !line.starts_with("```")).collect::<Vec<_>>().join(" ");
    // Links of rustdoc lead nowhere in Python.
    text.replace("[`", "`").replace("`]", "`").trim().to_owned()
}

fn cased(name: &str, rule: Option<&str>) -> String {
    let words = |separator: char| {
        name.char_indices().fold(String::new(), |mut out, (i, c)| {
            if c.is_uppercase() && i > 0 {
                out.push(separator);
            }
            out.extend(c.to_lowercase());
            out
        })
    };
    match rule {
        Some("lowercase") => name.to_lowercase(),
        Some("snake_case") => words('_'),
        Some("kebab-case") => words('-'),
        _ => name.to_owned(),
    }
}

/// Writes Python sources, with the named types that the functions need.
struct Writer<'a> {
    types: &'a Types,
    named: BTreeMap<String, String>,
}

impl Writer<'_> {
    fn python_type(&mut self, ty: &Type, attributes: &[Attribute]) -> String {
        let attribute = serde(attributes);
        if attribute.contains("as_text") {
            return "str | None".to_owned();
        }
        if attribute.contains("deserialize_with") {
            return "str".to_owned();
        }
        match ty {
            Type::Array(array) => format!("Sequence[{}]", self.python_type(&array.elem, &[])),
            Type::Path(path) => {
                let last = path.path.segments.last().expect("a type has a name");
                let inner = match &last.arguments {
                    PathArguments::AngleBracketed(inner) => inner.args.iter().find_map(|a| match a {
                        GenericArgument::Type(ty) => Some(ty),
                        _ => None,
                    }),
                    _ => None,
                };
                match (last.ident.to_string().as_str(), inner) {
                    ("Option", Some(inner)) => format!("{} | None", self.python_type(inner, &[])),
                    ("Vec", Some(inner)) => format!("Sequence[{}]", self.python_type(inner, &[])),
                    ("PathBuf", _) => "PathLike".to_owned(),
                    ("String", _) => "str".to_owned(),
                    ("bool", _) => "bool".to_owned(),
                    ("f32" | "f64", _) => "float".to_owned(),
                    ("u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64", _) => "int".to_owned(),
                    (name, _) => self.named_type(name),
                }
            }
            _ => "Any".to_owned(),
        }
    }

    /// The type of a field. Areas are also polygons in memory, and codes objects with one.
    fn field_type(&mut self, field: &Field) -> String {
        let ty = self.python_type(&field.ty, &field.attrs);
        let like = match key(field).as_str() {
            "bounds" => Some("BoundsLike"),
            "area" => Some("LayerArea | PathLike"),
            name if name.ends_with("_epsg") => Some("CrsCode"),
            _ => None,
        };
        like.map_or(ty.clone(), |like| if ty.ends_with("| None") { format!("{like} | None") } else { like.to_owned() })
    }

    /// The type of a field that may be left out.
    fn optional_type(&mut self, field: &Field, base: &Map<String, Value>) -> String {
        let ty = self.field_type(field);
        if default(base, &key(field)) == "None" && !ty.ends_with("| None") { ty + " | None" } else { ty }
    }

    fn named_type(&mut self, name: &str) -> String {
        let types = self.types;
        if let Some(item) = types.structs.get(name) {
            return match option(&item.attrs, "from").or_else(|| option(&item.attrs, "try_from")).as_deref() {
                Some("[f64; 2]" | "[f64; 4]") => "Sequence[float]".to_owned(),
                Some("[usize; 2]") => "Sequence[int]".to_owned(),
                Some(_) => "str".to_owned(),
                None => self.dictionary(item),
            };
        }
        let Some(item) = types.enums.get(name) else { return "Any".to_owned() };
        if option(&item.attrs, "try_from").is_some() {
            return "str".to_owned();
        }
        if serde(&item.attrs).contains("untagged") {
            let mut of_variant = |v: &syn::Variant| v.fields.iter().next().map(|f| self.python_type(&f.ty, &[]));
            return item.variants.iter().filter_map(&mut of_variant).collect::<Vec<_>>().join(" | ");
        }
        let rule = option(&item.attrs, "rename_all");
        let of_variant = |v: &syn::Variant| {
            option(&v.attrs, "rename").unwrap_or_else(|| cased(&v.ident.to_string(), rule.as_deref()))
        };
        let plain: Vec<String> =
            item.variants.iter().filter(|v| v.fields.is_empty()).map(|v| format!("\"{}\"", of_variant(v))).collect();
        let mut parts = Vec::new();
        if !plain.is_empty() {
            parts.push(format!("Literal[{}]", plain.join(", ")));
        }
        if plain.len() < item.variants.len() {
            parts.push("Mapping[str, Any]".to_owned());
        }
        parts.join(" | ")
    }

    /// A structure as a dictionary whose keys may be left out.
    fn dictionary(&mut self, item: &ItemStruct) -> String {
        let name = item.ident.to_string();
        if !self.named.contains_key(&name) {
            self.named.insert(name.clone(), String::new());
            if fields_of(item).any(|field| KEYWORDS.contains(&key(field).as_str())) {
                let entries = fields_of(item)
                    .map(|field| format!("\"{}\": \"{}\"", key(field), self.python_type(&field.ty, &field.attrs)));
                let entries = entries.collect::<Vec<_>>().join(", ");
                let text = format!("{name} = TypedDict(\"{name}\", {{{entries}}}, total=False)\n");
                self.named.insert(name.clone(), text);
                return name;
            }
            let mut text = format!("class {name}(TypedDict, total=False):\n");
            text += &docstring(&docs(&item.attrs), "    ");
            for field in fields_of(item) {
                let (key, ty) = (key(field), self.python_type(&field.ty, &field.attrs));
                let _ = writeln!(text, "\n    {key}: {ty}");
                text += &docstring(&docs(&field.attrs), "    ");
            }
            self.named.insert(name.clone(), text);
        }
        name
    }

    fn function(&mut self, entry: &JobEntry) -> String {
        let item = &self.types.structs.get(entry.config).unwrap_or_else(|| panic!("no source of {}", entry.config));
        let mut base = (entry.base)();
        let mut fields: Vec<&Field> = fields_of(item).collect();
        if let Some(lifted) = entry.lifted {
            let inner = base.remove(lifted).and_then(|v| v.as_object().cloned()).unwrap_or_default();
            let at = fields.iter().position(|f| key(f) == lifted).expect("the lifted field");
            let Type::Path(path) = &fields[at].ty else { panic!("a lifted field is a structure") };
            let inner_type = path.path.segments.last().expect("a type has a name").ident.to_string();
            fields.splice(at..=at, fields_of(&self.types.structs[&inner_type]));
            base.extend(inner);
        }
        let mut required = Vec::new();
        let (mut optional, mut arguments) = (Vec::new(), Vec::new());
        for name in entry.required {
            let field = fields.iter().find(|f| key(f) == *name).unwrap_or_else(|| panic!("{name} is no field"));
            let ty = if *name == "scene" { "str | Mapping[str, Any]".to_owned() } else { self.field_type(field) };
            required.push(format!("    {name}: {ty},\n"));
            arguments.push((*name, docs(&field.attrs)));
        }
        for field in &fields {
            let name = key(field);
            if entry.required.contains(&name.as_str()) || serde(&field.attrs).contains("skip") {
                continue;
            }
            let default = default(&base, &name);
            let ty = self.optional_type(field, &base);
            optional.push(format!("    {name}: {ty} = {default},\n"));
            arguments.push((Box::leak(name.into_boxed_str()), docs(&field.attrs)));
        }
        let mut text = format!("@job\ndef {}(\n{}    *,\n{}", entry.name, required.concat(), optional.concat());
        text += "    progress: Progress = None,\n) -> ";
        let result = if entry.report == "String" { "str" } else { entry.report };
        text += result;
        text += ":\n    \"\"\"";
        text += &wrapped(entry.summary, "    ", 3);
        text += "\n    Args:\n";
        for (name, doc) in arguments {
            text += &hanging(name, &doc);
        }
        text +=
            &hanging("progress", "`True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.");
        text += "\n    Returns:\n";
        text += if result == "str" {
            "        ``grids``, ``surfaces`` or ``maps``.\n"
        } else {
            "        The report of the job, as the command's ``--json`` has it.\n"
        };
        text += "\n    Raises:\n";
        text += &hanging("TypeError", "A keyword that the job does not have; the text names those that it has.");
        text += &hanging("SkysweepError", "The job has no result; see its subclasses.");
        let example = EXAMPLES.iter().find(|(name, _)| *name == entry.name);
        let (_, lines) = example.unwrap_or_else(|| panic!("{} has no example", entry.name));
        text += "\n    Example:\n        >>> import skysweep\n";
        text.extend(lines.iter().map(|line| format!("        >>> {line}\n")));
        let _ = writeln!(text, "    \"\"\"\n    return run_job(\"{}\", locals(), {result})", entry.name);
        text
    }
}

/// The settings of some jobs together, without those of the positions: for functions that pass them
/// on.
const SETTINGS: [(&str, &str, &[&str]); 2] = [
    ("DsmSettings", "Settings of :func:`dsm`.", &["dsm"]),
    (
        "EvaluateSettings",
        "Settings of :func:`evaluate_grids`, :func:`evaluate_surfaces` and :func:`evaluate_maps`.",
        &["evaluate_grids", "evaluate_surfaces", "evaluate_maps"],
    ),
];

impl Writer<'_> {
    fn settings(&mut self, name: &str, summary: &str, jobs: &[&str]) -> String {
        let mut types: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for entry in JOBS.iter().filter(|entry| jobs.contains(&entry.name)) {
            let item = &self.types.structs[entry.config];
            for field in fields_of(item).filter(|field| !entry.required.contains(&key(field).as_str())) {
                let ty = self.optional_type(field, &(entry.base)());
                let known = types.entry(key(field)).or_default();
                known.extend(
                    ty.split(" | ").map(str::to_owned).filter(|part| !known.contains(part)).collect::<Vec<_>>(),
                );
            }
        }
        let mut text = format!("class {name}(TypedDict, total=False):\n");
        text += &docstring(summary, "    ");
        text.push('\n');
        for (field, parts) in types {
            let _ = writeln!(text, "    {field}: {}", parts.join(" | "));
        }
        text += if jobs.contains(&"dsm") { "" } else { "    progress: Progress\n" };
        text
    }
}

fn fields_of(item: &ItemStruct) -> impl Iterator<Item = &Field> {
    item.fields.iter().filter(|f| !serde(&f.attrs).contains("skip"))
}

fn key(field: &Field) -> String {
    let own = || field.ident.as_ref().expect("a named field").to_string();
    option(&field.attrs, "rename").unwrap_or_else(own)
}

/// The default of a field as Python; `None` stands for structures, whose defaults are inside.
fn default(base: &Map<String, Value>, name: &str) -> String {
    match base.get(name) {
        Some(Value::Bool(value)) => if *value { "True" } else { "False" }.to_owned(),
        Some(value @ (Value::Number(_) | Value::String(_))) => value.to_string(),
        Some(Value::Array(values)) => match values.as_slice() {
            [] => "()".to_owned(),
            [one] => format!("({one},)"),
            more => format!("({})", more.iter().map(Value::to_string).collect::<Vec<_>>().join(", ")),
        },
        _ => "None".to_owned(),
    }
}

/// Breaks text into lines that begin with `indent`; the first one has `used` columns before it.
fn wrapped(text: &str, indent: &str, used: usize) -> String {
    let mut lines = vec![String::new()];
    let mut room = WIDTH - indent.len() - used;
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("a line");
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > room {
            lines.push(word.to_owned());
            room = WIDTH - indent.len();
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join(&format!("\n{indent}")) + "\n"
}

fn docstring(text: &str, indent: &str) -> String {
    format!("{indent}\"\"\"{}\"\"\"\n", wrapped(text, indent, 6).trim_end())
}

fn hanging(name: &str, text: &str) -> String {
    let indent = " ".repeat(12);
    format!("        {name}: {}", wrapped(text, &indent, (name.len() + 2).saturating_sub(4)))
}

const HEAD: &str = "\"\"\"The jobs as functions. Made by `make stubs` of the configurations; do not edit.

Every function takes the settings of a job as keywords and returns the job's report. Paths are text,
`os.PathLike` or open rasterio datasets; CRSs are EPSG codes, `pyproj.CRS` or `rasterio.CRS`.
\"\"\"

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

from ._call import BoundsLike, CrsCode, PathLike, Progress, job, run as run_job
";

fn all_types() -> Types {
    let mut types = Types::default();
    for folder in fs::read_dir(crates()).expect("the crates").flatten() {
        let folder = folder.path();
        if folder.join("src").is_dir() {
            Types::read(&folder.join("src"), &mut types);
        }
    }
    types
}

fn made() -> String {
    let types = all_types();
    let mut writer = Writer { types: &types, named: BTreeMap::new() };
    let functions: Vec<String> = JOBS.iter().map(|entry| writer.function(entry)).collect();
    let settings: Vec<String> = SETTINGS.iter().map(|(name, text, jobs)| writer.settings(name, text, jobs)).collect();
    let names = JOBS.iter().map(|entry| format!("    \"{}\",\n", entry.name)).collect::<String>();
    let named: Vec<String> = writer.named.into_values().chain(settings).collect();
    let reports = JOBS.iter().map(|entry| entry.report).filter(|name| *name != "String");
    let imports: String = reports.collect::<BTreeSet<_>>().into_iter().map(|name| format!("    {name},\n")).collect();
    format!(
        "{HEAD}from .reports import (\n{imports})\n\n__all__ = [\n{names}]\n\n\n{}\n\n{}",
        named.join("\n\n"),
        functions.join("\n\n")
    )
}

#[test]
fn the_functions_are_those_of_the_configurations_and_reports() {
    let reports: Vec<&str> = JOBS.iter().map(|entry| entry.report).collect();
    for (name, made) in [("_jobs.py", made()), ("reports.py", reports::made(&crates(), &reports))] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/skysweep").join(name);
        if std::env::var_os("SKYSWEEP_WRITE_STUBS").is_some() {
            fs::write(&path, &made).expect("the file can be written");
        }
        let found = fs::read_to_string(&path).unwrap_or_default();
        assert!(found == made, "{} is not what the sources say: run `make stubs`", path.display());
    }
}

#[test]
fn every_setting_has_an_option_or_a_reason() {
    let missing = options::missing(&crates(), &all_types());
    assert!(missing.is_empty(), "in crates/python/tests/options: {missing:#?}");
}

fn settings(entries: &[(&str, Value)]) -> Fields {
    entries.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
}

fn refused(job: &str, entries: &[(&str, Value)]) -> (Kind, String) {
    let entry = catalogue::job(job).expect("a job");
    let fault = (entry.run)(settings(entries), &numeric::Silent).expect_err("no result");
    (fault.kind, fault.text)
}

#[test]
fn wrong_settings_are_named() {
    let two = ("images", Value::from(vec!["a.tif", "b.tif"]));
    let (kind, text) = refused("dsm", &[two.clone(), ("output", "out".into()), ("preset", "slow".into())]);
    assert_eq!(kind, Kind::Input);
    assert!(text.starts_with("preset: unknown variant `slow`, expected one of `fast`"), "{text}");
    let (_, text) = refused("dsm", &[two.clone(), ("colour", 1.into())]);
    assert!(text.contains("unknown field `colour`"), "{text}");
    let (kind, text) = refused("dsm", &[two, ("output", "out".into()), ("gsd_m", Value::from(-1.0))]);
    assert_eq!((kind, text.as_str()), (Kind::Input, "the cell size is -1, expected a positive cell size in metres"));
    let (_, text) = refused("classes", &[("surface", "a.tif".into()), ("terrain", serde_json::json!({"sloppy": 1}))]);
    assert!(text.contains("unknown field `sloppy`"), "{text}");
}

#[test]
fn errors_have_their_class() {
    let (kind, text) = refused("rpc_info", &[("file", "/no/such/file".into())]);
    assert_eq!(kind, Kind::File, "{text}");
    let (kind, text) = refused("read_plan", &[("folder", "/no/such/folder".into())]);
    assert_eq!(kind, Kind::File, "{text}");
    let (kind, text) = refused("simulate", &[("scene", "atlantis".into()), ("output", "out".into())]);
    assert_eq!(kind, Kind::Input, "{text}");
    let (kind, text) = refused("city_info", &[("file", "/no/such/file".into()), ("lod", "2.2".into())]);
    assert_eq!(kind, Kind::File, "{text}");
}
