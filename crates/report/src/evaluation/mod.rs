//! Report of one evaluation, as text, as JSON and as a page.

mod figures;
mod html;
mod json;
mod judged;
mod numbers;
mod report;
mod tables;
mod text;

pub use report::EvaluationReport;
