//! A picture against the truth, on a page without scripts: an edge that a hand drags over both, and
//! switches between truth, rendering and error.
//!
//! The edge is that of a box that the browser lets people make wider (`resize` of CSS). Those who
//! use no mouse have the switches.

use raster::Grid;

use crate::escape::escape;
use crate::picture::{PictureError, data_uri};

/// Error that is drawn in the brightest colour, in parts of white: an eighth is a strong error for
/// an image of 18 dB, and larger ones are as bad.
const ERROR_MAX: f64 = 0.125;
/// Colours of no error, of a third and of two thirds of the largest, and of the largest one: they
/// grow lighter, so that also readers who see no hues tell them apart.
const HEAT: [[f64; 3]; 4] = [[10.0, 10.0, 20.0], [112.0, 31.0, 110.0], [238.0, 105.0, 48.0], [252.0, 250.0, 190.0]];

/// Style of the comparisons.
const STYLE: &str = "\
.compare{max-width:1000px;margin:1rem 0}.compare>input{position:absolute;opacity:0}\
.compare>label{display:inline-block;margin:0 .4rem .5rem 0;padding:.15rem .7rem;border:1px solid var(--line);\
border-radius:99px;cursor:pointer}\
.compare>input:checked+label{background:var(--a);color:var(--paper);border-color:var(--a)}\
.compare>input:focus-visible+label{outline:2px solid var(--b)}\
.compare .both{position:relative;line-height:0;overflow:hidden}.compare .both img{display:block}\
.compare .both>img{width:100%}\
.compare .edge{position:absolute;left:0;top:0;width:50%;height:100%;max-width:100%;min-width:14px;overflow:hidden;\
resize:horizontal;border-right:2px solid #fff;box-shadow:1px 0 0 #0008}\
.compare .edge img{height:100%;width:auto;max-width:none}.compare .both .error{display:none}\
.compare .only-truth:checked~.both .edge{display:none}\
.compare .only-shown:checked~.both .edge{width:100%!important;resize:none;border:0}\
.compare .only-error:checked~.both .error{display:block;position:absolute;inset:0}\
.compare .only-error:checked~.both .edge{display:none}\
@media print{.compare>input,.compare>label{display:none}}";

/// A picture against the truth.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// Name of the view.
    pub name: String,
    /// What is right.
    pub truth: Grid<[u8; 3]>,
    /// What was found, of the same size.
    pub shown: Grid<[u8; 3]>,
    /// What the numbers say.
    pub caption: String,
}

impl Comparison {
    /// Returns the errors in colours: the mean difference of the channels, black where there is
    /// none, light yellow from an eighth of white on.
    pub fn errors(&self) -> Grid<[u8; 3]> {
        let mut out = self.truth.clone();
        for (pixel, shown) in out.data_mut().iter_mut().zip(self.shown.data()) {
            let sum: u32 = pixel.iter().zip(shown).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
            *pixel = heat(f64::from(sum) / (3.0 * 255.0) / ERROR_MAX);
        }
        out
    }
}

/// Returns the colour of an error relative to the largest that is told apart.
fn heat(share: f64) -> [u8; 3] {
    let place = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let t = place - below as f64;
    std::array::from_fn(|i| (HEAT[below][i] + t * (HEAT[below + 1][i] - HEAT[below][i])).round() as u8)
}

/// Returns the section of a page with comparisons; nothing without any.
///
/// # Errors
/// [`PictureError`] for a picture without pixels.
pub(crate) fn section(comparisons: &[Comparison]) -> Result<String, PictureError> {
    if comparisons.is_empty() {
        return Ok(String::new());
    }
    let mut out = format!(
        "<h2>Truth and rendering</h2><style>{STYLE}</style><p>Left of the edge is the rendering, right of it the truth: \
         drag the lower right corner of the left part. Errors are the mean difference of the channels, from none \
         (black) to {:.1} % of white and more (light yellow).</p>",
        100.0 * ERROR_MAX
    );
    for (number, one) in comparisons.iter().enumerate() {
        let [truth, shown, errors] = [data_uri(&one.truth)?, data_uri(&one.shown)?, data_uri(&one.errors())?];
        let (name, caption) = (escape(&one.name), escape(&one.caption));
        let switch = |kind: &str, text: &str, checked: &str| {
            format!(
                "<input type=\"radio\" name=\"compare{number}\" class=\"only-{kind}\" id=\"{kind}{number}\"{checked}><label \
                 for=\"{kind}{number}\">{text}</label>"
            )
        };
        let switches = [
            switch("both", "both", " checked"),
            switch("truth", "truth", ""),
            switch("shown", "rendering", ""),
            switch("error", "error", ""),
        ]
        .concat();
        out += &format!(
            "<figure class=\"compare\">{switches}<div class=\"both\"><img src=\"{truth}\" alt=\"{name}, truth\"><div \
             class=\"edge\"><img src=\"{shown}\" alt=\"{name}, rendering\"></div><img class=\"error\" src=\"{errors}\" \
             alt=\"{name}, error\"></div><figcaption><b>{name}.</b> {caption}</figcaption></figure>"
        );
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_black_where_there_are_none_and_lightest_from_an_eighth_on() {
        let truth = Grid::from_vec(3, 1, vec![[100u8; 3], [100; 3], [0, 0, 48]]).unwrap();
        let shown = Grid::from_vec(3, 1, vec![[100u8; 3], [164; 3], [0, 0, 0]]).unwrap();
        let one = Comparison { name: "a <b>".to_owned(), truth, shown, caption: "22 dB".to_owned() };
        let errors = one.errors();
        assert_eq!((errors[(0, 0)], errors[(1, 0)]), ([10, 10, 20], [252, 250, 190]));
        assert!(errors[(2, 0)] > errors[(0, 0)] && errors[(2, 0)] < errors[(1, 0)]);
        let text = section(&[one]).unwrap();
        assert!(text.contains("a &lt;b&gt;") && text.matches("<img").count() == 3 && !text.contains("script"));
        assert_eq!(section(&[]).unwrap(), "");
    }
}
