//! The pages, the help and the examples say what is true.

mod examples;
mod help_pages;
mod links;
mod numbers;
mod pages;
mod qgis_plugin;
