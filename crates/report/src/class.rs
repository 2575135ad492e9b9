//! Names of classes in the LAS specification.

/// Returns the class number, with its name if it is a common class.
///
/// ```
/// assert_eq!(report::class_title(6), "6 building");
/// ```
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
