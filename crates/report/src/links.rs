//! Links from a page to files beside it.
//!
//! A page is written before what is made of its results. So the links stand between two marks, and
//! [`with_links`] lays new ones in their place.

use crate::escape::escape;

/// Marks around the links of a page.
const MARKS: [&str; 2] = ["<!--files-->", "<!--/files-->"];

/// A link of a page to a file beside it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageLink {
    /// Path of the file, relative to the folder of the page, with `/` between folders.
    pub path: String,
    /// What it holds.
    pub title: String,
}

impl PageLink {
    /// Returns a link.
    pub fn new(path: impl Into<String>, title: impl Into<String>) -> Self {
        Self { path: path.into(), title: title.into() }
    }

    /// Returns the link with the name of its file, without folders above that of the page.
    fn html(&self) -> String {
        let name = self.path.trim_start_matches("../");
        format!("<li>{} <span>{}</span></li>", anchor(&self.path, name), escape(&self.title))
    }
}

/// Returns a link as HTML. The path becomes an address, so that no name can leave its place.
pub(crate) fn anchor(path: &str, text: &str) -> String {
    use std::fmt::Write;
    let mut address = String::with_capacity(path.len());
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_./~".contains(&byte) {
            address.push(char::from(byte));
        } else {
            // Writing to a string cannot fail.
            let _ = write!(address, "%{byte:02X}");
        }
    }
    // A colon before the first slash would begin a protocol, so the address always has a folder.
    let folder = if address.starts_with('.') { "" } else { "./" };
    format!("<a href=\"{folder}{address}\">{}</a>", escape(text))
}

/// Returns the section of links with its marks.
pub(crate) fn section(links: &[PageLink]) -> String {
    let [begin, end] = MARKS;
    let items: String = links.iter().map(PageLink::html).collect();
    let list = if items.is_empty() { items } else { format!("<h2>Files</h2><ul class=\"files\">{items}</ul>") };
    format!("{begin}{list}{end}")
}

/// Returns a page with other links in the place of its own; `None` for a page without the marks.
///
/// ```
/// let page = report::JobPage::default().html()?;
/// let linked = report::with_links(&page, &[report::PageLink::new("../dsm/dsm.tif", "heights")]);
/// assert!(linked.is_some_and(|page| page.contains("href=\"../dsm/dsm.tif\"")));
/// # Ok::<(), report::PictureError>(())
/// ```
pub fn with_links(page: &str, links: &[PageLink]) -> Option<String> {
    let (before, rest) = page.split_once(MARKS[0])?;
    let (_, after) = rest.split_once(MARKS[1])?;
    Some([before, &section(links), after].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_replaced_and_names_cannot_leave_their_place() {
        let page = format!("<p>{}</p>", section(&[PageLink::new("a.tif", "old")]));
        let links = [PageLink::new("../x y/\"><script>.tif", "<new>"), PageLink::new("javascript:alert(1)", "no")];
        let new = with_links(&page, &links).unwrap();
        assert!(new.contains("href=\"../x%20y/%22%3E%3Cscript%3E.tif\"") && new.contains("&lt;new&gt;"), "{new}");
        assert!(new.contains("href=\"./javascript%3Aalert%281%29\"") && !new.contains("old"), "{new}");
        assert_eq!(with_links(&new, &[]).unwrap(), "<p><!--files--><!--/files--></p>");
        assert_eq!(with_links("<p></p>", &links), None);
    }
}
