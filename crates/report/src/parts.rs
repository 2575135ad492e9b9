//! Parts of the pages about priors: cards, notes, pictures of views, tables.

use raster::Grid;
use serde::Serialize;
use serde_json::{Value, json};

use crate::escape::escape;
use crate::picture::{PictureError, data_uri};
use crate::words::typeset;

/// Pictures of one view.
#[derive(Debug, Clone)]
pub struct ViewPictures {
    /// Name of the image.
    pub name: String,
    /// Maps of the view as pictures, each with its name.
    pub maps: Vec<(&'static str, Grid<[u8; 3]>)>,
}

/// Returns cards with numbers and their labels. The numbers are HTML already.
pub(crate) fn cards_of(cards: &[(String, &str)]) -> String {
    let cards: String = cards
        .iter()
        .map(|(value, text)| format!("<div class=\"card\"><b>{value}</b><span>{text}</span></div>"))
        .collect();
    format!("<div class=\"cards\">{cards}</div>")
}

/// Returns the notes as a list, or an empty text without notes.
pub(crate) fn notes(notes: &[String]) -> String {
    let items: String = notes.iter().map(|note| format!("<li>{}</li>", typeset(&escape(note)))).collect();
    if items.is_empty() { items } else { format!("<div class=\"notes\"><ul>{items}</ul></div>") }
}

/// Returns the pictures of views under a heading, or an empty text without pictures.
pub(crate) fn figures(pictures: &[ViewPictures]) -> Result<String, PictureError> {
    let mut figures = String::new();
    for ViewPictures { name, maps } in pictures {
        for (what, picture) in maps {
            let (uri, name) = (data_uri(picture)?, escape(name));
            figures += &format!(
                "<figure><img src=\"{uri}\" alt=\"{what} of {name}\"><figcaption><b>{name}</b> \
                  {what}</figcaption></figure>"
            );
        }
    }
    Ok(if figures.is_empty() { figures } else { format!("<h2>Views</h2><div class=\"pictures\">{figures}</div>") })
}

/// Returns a table under a heading. Columns of words are set from the left and may wrap; others
/// hold numbers, which stand under each other at the right.
pub(crate) fn table(title: &str, heads: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let rows: Vec<Vec<String>> = rows.collect();
    let class = |column: usize| {
        let words = rows.iter().filter_map(|row| row.get(column)).any(|cell| is_words(cell));
        if words { " class=\"words\"" } else { "" }
    };
    let classes: Vec<&str> = (0..heads.len()).map(class).collect();
    let head = |(head, class): (&&str, &&str)| format!("<th scope=\"col\"{class}>{}</th>", escape(head));
    let heads: String = heads.iter().zip(&classes).map(head).collect();
    let row = |cells: &Vec<String>| {
        let mut cells = cells.iter().map(|cell| escape(cell));
        let first = cells.next().unwrap_or_default();
        let cell = |(cell, class): (String, &&str)| format!("<td{class}>{}</td>", typeset(&cell));
        let rest: String = cells.zip(classes.iter().skip(1)).map(cell).collect();
        format!("<tr><th scope=\"row\">{first}</th>{rest}</tr>")
    };
    let rows: String = rows.iter().map(row).collect();
    format!(
        "<h2>{}</h2><div class=\"wide\"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>",
        escape(title)
    )
}

/// Returns whether a cell holds words rather than a number with its unit.
fn is_words(cell: &str) -> bool {
    cell.split(' ').filter(|word| word.chars().filter(|c| c.is_alphabetic()).count() > 2).count() > 1
}

pub(crate) fn last_part(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Returns every number of a report of priors by name, and the generator.
///
/// # Errors
/// [`serde_json::Error`] if the report cannot be serialised. A report of finite numbers always can.
pub(crate) fn with_generator(report: &impl Serialize) -> Result<Value, serde_json::Error> {
    let mut value = json!({ "generator": concat!("skysweep priors ", env!("CARGO_PKG_VERSION")) });
    if let (Some(all), Value::Object(own)) = (value.as_object_mut(), serde_json::to_value(report)?) {
        all.extend(own);
    }
    Ok(value)
}
