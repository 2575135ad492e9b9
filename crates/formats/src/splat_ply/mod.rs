//! Gaussian splats as PLY files for viewers and trainers of 3D Gaussian Splatting (Kerbl et al.
//! 2023) and 2DGS (Huang et al. 2024).
//!
//! The file is binary little-endian. It has one `vertex` per splat, and all its properties but the
//! last two are `float`:
//!
//! - `x y z`: position, metres from a local origin
//! - `nx ny nz`: surface normal
//! - `f_dc_0..2`: colour as the constant spherical harmonic, colour = ½ + C₀ f with C₀ = ½ √(1/π)
//! - `f_rest_*`: higher harmonics, all of red, of green and of blue; some loaders demand them, and
//!   get zeros
//! - `opacity`: logit of the opacity
//! - `scale_0..2`: natural logarithm of the standard deviations in metres; 2DGS has only two
//! - `rot_0..3`: quaternion, w first
//! - `class` (`uchar`) and `object` (`uint`): number of the class, and of the object of the city
//!   model that the splat stands for; only where splats have labels
//!
//! The local origin is in a file of its own, `NAME.origin.json`, because not every loader skips PLY
//! comments. The table of classes and objects is `NAME.objects.json`. Loaders look properties up by
//! name, so that those of labels do not disturb them.
//!
//! The number of splats is checked against the length of the file before anything is allocated.

mod labels;
mod layout;
mod origin;
mod read;
mod write;

pub use labels::{LabelTable, LabelledObject, SplatLabels, objects_path};
pub use layout::{SH_DEGREE_MAX, SplatForm, SplatLayout};
pub use origin::{LocalOrigin, origin_path};
pub use read::{SplatFile, read};
pub use write::{write, write_file};

pub(crate) use layout::SH_C0;
pub(crate) use write::checked;

#[cfg(test)]
mod tests;
