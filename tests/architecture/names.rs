//! Collects the names of public types, and finds texts of errors that name a command-line flag.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Ident, Visibility};

/// Public types of a source with the file that defines them.
#[derive(Default)]
pub(crate) struct PublicTypes {
    found: BTreeMap<String, Vec<PathBuf>>,
    file: PathBuf,
}

impl PublicTypes {
    /// Adds the types of a source.
    pub(crate) fn add(&mut self, file: &Path) {
        self.file = file.to_owned();
        let text = fs::read_to_string(file).expect("a source is readable");
        let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        self.visit_file(&parsed);
    }

    /// Names that more than one file defines.
    pub(crate) fn repeated(&self) -> impl Iterator<Item = (&String, &Vec<PathBuf>)> {
        self.found.iter().filter(|(_, files)| files.len() > 1)
    }

    fn take(&mut self, visibility: &Visibility, name: &Ident) {
        if matches!(visibility, Visibility::Public(_)) {
            self.found.entry(name.to_string()).or_default().push(self.file.clone());
        }
    }
}

impl<'a> Visit<'a> for PublicTypes {
    fn visit_item_struct(&mut self, item: &'a syn::ItemStruct) {
        self.take(&item.vis, &item.ident);
    }

    fn visit_item_enum(&mut self, item: &'a syn::ItemEnum) {
        self.take(&item.vis, &item.ident);
    }

    fn visit_item_trait(&mut self, item: &'a syn::ItemTrait) {
        self.take(&item.vis, &item.ident);
    }

    fn visit_item_type(&mut self, item: &'a syn::ItemType) {
        self.take(&item.vis, &item.ident);
    }
}

/// Texts of a source's `#[error("…")]` attributes.
pub(crate) fn error_texts(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).expect("a source is readable");
    let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut texts = ErrorTexts(Vec::new());
    texts.visit_file(&parsed);
    texts.0
}

/// Texts of a source's `#[error("…")]` attributes that name a command-line flag.
pub(crate) fn errors_with_flags(file: &Path) -> Vec<String> {
    error_texts(file).into_iter().filter(|text| names_flag(text)).collect()
}

/// Names of the public enumerations of a source that are errors.
pub(crate) fn public_error_enums(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).expect("a source is readable");
    let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let is_error = |attribute: &syn::Attribute| match &attribute.meta {
        syn::Meta::List(list) if attribute.path().is_ident("derive") => {
            list.tokens.to_string().split([',', ':', ' ']).any(|name| name == "Error")
        }
        _ => false,
    };
    let enums = parsed.items.iter().filter_map(|item| match item {
        syn::Item::Enum(item) if matches!(item.vis, Visibility::Public(_)) => Some(item),
        _ => None,
    });
    enums.filter(|item| item.attrs.iter().any(is_error)).map(|item| item.ident.to_string()).collect()
}

/// Texts that a source searches for in other texts, outside of its tests.
pub(crate) fn searched_texts(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).expect("a source is readable");
    let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut searches = Searches(Vec::new());
    searches.visit_file(&parsed);
    searches.0
}

struct Searches(Vec<String>);

impl<'a> Visit<'a> for Searches {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        let is_test = |attribute: &syn::Attribute| matches!(&attribute.meta, syn::Meta::List(list) if list.path.is_ident("cfg") && list.tokens.to_string() == "test");
        if !item.attrs.iter().any(is_test) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        if ["contains", "starts_with", "ends_with", "find"].iter().any(|name| call.method == name)
            && let Some(syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(wanted), .. })) = call.args.first()
        {
            self.0.push(wanted.value());
        }
        visit::visit_expr_method_call(self, call);
    }
}

/// Whether a text holds a word such as `--gsd`.
pub(crate) fn names_flag(text: &str) -> bool {
    text.match_indices("--").any(|(at, dashes)| text[at + dashes.len()..].starts_with(|c: char| c.is_ascii_lowercase()))
}

struct ErrorTexts(Vec<String>);

impl<'a> Visit<'a> for ErrorTexts {
    fn visit_attribute(&mut self, attribute: &'a syn::Attribute) {
        if let (true, syn::Meta::List(list)) = (attribute.path().is_ident("error"), &attribute.meta) {
            self.0.push(list.tokens.to_string());
        }
        visit::visit_attribute(self, attribute);
    }
}
