//! Names of classes in the LAS specification.

/// The class with its name, where that is common.
pub fn class_title(class: i32) -> String {
    let name = match class {
        2 => " ground",
        3..=5 => " vegetation",
        6 => " building",
        9 => " water",
        17 => " bridge",
        _ => "",
    };
    format!("{class}{name}")
}
