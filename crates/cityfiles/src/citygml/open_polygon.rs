//! A polygon while its rings are read.

use city::DefectCode;

/// A polygon that the walk is in.
#[derive(Debug)]
pub(super) struct OpenPolygon {
    /// Complete rings.
    pub(super) rings: Vec<Vec<u32>>,
    /// Identifiers of the rings, with their numbers.
    pub(super) ids: Vec<(String, usize)>,
    /// Coordinates of the open ring.
    pub(super) ring: Option<Vec<f64>>,
    /// First defect that makes the polygon unusable.
    pub(super) problem: Option<(DefectCode, String)>,
    /// Number of rings that are not closed.
    pub(super) unclosed: usize,
    /// Line in the file.
    pub(super) line: usize,
}

impl OpenPolygon {
    /// Begins a polygon.
    pub(super) fn new(line: usize) -> Self {
        Self { rings: Vec::new(), ids: Vec::new(), ring: None, problem: None, unclosed: 0, line }
    }

    /// Adds the numbers of `pos`, `posList` or `coordinates` to the open ring.
    pub(super) fn take_positions(&mut self, text: &str, element: &str, dimension: usize) {
        let Some(ring) = &mut self.ring else { return };
        if dimension != 3 {
            let detail = format!("coordinates have {dimension} dimensions, expected 3");
            self.problem.get_or_insert((DefectCode::NotSupported, detail));
            return;
        }
        // GML 2 separates the numbers of a tuple with commas.
        let commas = element == "coordinates";
        let words = text.split(|c: char| c.is_whitespace() || (commas && c == ',')).filter(|word| !word.is_empty());
        for word in words {
            match word.parse::<f64>() {
                Ok(number) => ring.push(number),
                Err(_) => {
                    let word: String = word.chars().take(20).collect();
                    self.problem.get_or_insert((DefectCode::CoordinateOutOfRange, format!("{word:?}")));
                    return;
                }
            }
        }
    }
}
