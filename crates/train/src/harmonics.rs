//! Colours of surfels that depend on the direction of view and learn: real spherical harmonics up
//! to degree 3, as 3DGS and 2DGS have them.
//!
//! The colour that a camera sees is max(0, c + Σ cₖ Yₖ(d)) with the direction d from the camera to
//! the surfel's centre. The rasteriser draws surfels of that colour, and what it finds by their
//! colours goes on to the coefficients and, as d moves with the surfel, to the position.

use gaussian::{SplatHarmonics, harmonic_slopes, harmonic_values};
use rayon::prelude::*;

use crate::adam::step_all;
use crate::raster::SurfelGradients;
use crate::surfel::Surfel;
use crate::view::SurfelCamera;

/// Harmonics of surfels beyond the constant one, which is their colour.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearnedHarmonics {
    degree: u8,
    /// Surfel by surfel: all of red, all of green, all of blue.
    coefficients: Vec<f32>,
    /// Running means of the gradient and of its square.
    mean: Vec<f32>,
    square: Vec<f32>,
}

impl LearnedHarmonics {
    /// Harmonics of a degree, 0 to 3, that are 0 for a number of surfels.
    ///
    /// # Panics
    /// If the degree is above 3.
    pub fn zeros(degree: u8, surfels: usize) -> Self {
        assert!(degree <= SplatHarmonics::DEGREE_MAX, "a degree of {degree}");
        Self::from_parts(degree, [(); 3].map(|()| vec![0.0; surfels * 3 * SplatHarmonics::count(degree)]))
    }

    /// Harmonics of given coefficients: for each surfel all of red, all of green, all of blue.
    ///
    /// # Panics
    /// If the coefficients are not those of whole surfels.
    pub fn of(harmonics: &SplatHarmonics, surfels: usize) -> Self {
        let of = |surfel: usize| (0..3).flat_map(move |channel| harmonics.of(surfel, channel));
        Self { coefficients: (0..surfels).flat_map(of).copied().collect(), ..Self::zeros(harmonics.degree(), surfels) }
    }

    pub(crate) fn from_parts(degree: u8, [coefficients, mean, square]: [Vec<f32>; 3]) -> Self {
        Self { degree, coefficients, mean, square }
    }

    pub(crate) fn parts(&self) -> [&[f32]; 3] {
        [&self.coefficients, &self.mean, &self.square]
    }

    /// Returns the harmonics of another degree: cut, or with coefficients of 0.
    ///
    /// # Panics
    /// If the degree is above 3.
    pub(crate) fn with_degree(self, degree: u8, surfels: usize) -> Self {
        if degree == self.degree {
            return self;
        }
        assert!(degree <= SplatHarmonics::DEGREE_MAX, "a degree of {degree}");
        let [had, has] = [self.degree, degree].map(SplatHarmonics::count);
        let resized = |from: &[f32]| {
            let value = |i: usize| if i % has < had { from[i / has * had + i % has] } else { 0.0 };
            (0..surfels * 3 * has).map(value).collect()
        };
        let parts = self.parts().map(resized);
        Self::from_parts(degree, parts)
    }

    /// Returns the degree.
    pub fn degree(&self) -> u8 {
        self.degree
    }

    /// Returns the coefficients; `None` for degree 0.
    pub fn to_splats(&self) -> Option<SplatHarmonics> {
        SplatHarmonics::new(self.degree, self.coefficients.clone())
    }

    /// Coefficients of a surfel.
    pub(crate) fn per_surfel(&self) -> usize {
        3 * SplatHarmonics::count(self.degree)
    }

    /// Returns the surfels with the colours that a camera sees, up to a degree; those that it
    /// cannot see, and all at degree 0, as they are. `memory` may be reused.
    pub fn seen<'a, C: SurfelCamera>(
        &self,
        surfels: &'a [Surfel],
        camera: &C,
        degree: u8,
        memory: &'a mut Vec<Surfel>,
    ) -> &'a [Surfel] {
        let active = SplatHarmonics::count(degree.min(self.degree));
        if active == 0 {
            return surfels;
        }
        let one = |((number, surfel), own): ((usize, &Surfel), &[f32])| {
            let Some((direction, _)) = sight(camera, number, surfel) else { return *surfel };
            let values = harmonic_values(direction);
            let colour = |channel: usize| {
                let terms = own[channel * own.len() / 3..].iter().zip(&values).take(active);
                let sum: f64 = terms.map(|(coefficient, value)| f64::from(*coefficient) * value).sum();
                (f64::from(surfel.colour[channel]) + sum).max(0.0) as f32
            };
            Surfel { colour: [0, 1, 2].map(colour), ..*surfel }
        };
        let own = self.coefficients.par_chunks_exact(self.per_surfel());
        surfels.par_iter().enumerate().zip(own).map(one).collect_into_vec(memory);
        memory
    }

    /// Brings the gradient by the surfels that [`Self::seen`] returned back to what they were made
    /// of: `out` gets that by the coefficients, and `gradients` those by position and colour.
    ///
    /// # Panics
    /// If the surfels are not those of the harmonics.
    pub fn spread<C: SurfelCamera>(
        &self,
        (surfels, seen): (&[Surfel], &[Surfel]),
        camera: &C,
        degree: u8,
        gradients: &mut SurfelGradients,
        out: &mut Vec<f32>,
    ) {
        let active = SplatHarmonics::count(degree.min(self.degree));
        out.resize(self.coefficients.len(), 0.0);
        if active == 0 {
            out.fill(0.0);
            return;
        }
        let size = self.per_surfel();
        let rows = out.par_chunks_exact_mut(size).zip(self.coefficients.par_chunks_exact(size));
        let rows = rows.zip(&mut gradients.surfels).zip(&gradients.by_pixel);
        rows.zip(surfels.par_iter().zip(seen)).enumerate().for_each(|(number, row)| {
            let ((((out, own), gradient), by_pixel), (surfel, seen)) = row;
            out.fill(0.0);
            let sight = sight(camera, number, surfel).filter(|_| by_pixel.is_finite());
            let Some((direction, moves)) = sight else { return };
            let values = harmonic_values(direction);
            let mut by_value = [0.0; 15];
            for channel in 0..3 {
                // A colour that is held at 0 does not learn.
                if seen.colour[channel] <= 0.0 {
                    gradient.colour[channel] = 0.0;
                }
                let slope = f64::from(gradient.colour[channel]);
                for k in 0..active {
                    let place = channel * size / 3 + k;
                    out[place] = (slope * values[k]) as f32;
                    by_value[k] += slope * f64::from(own[place]);
                }
            }
            if moves {
                let slopes = harmonic_slopes(direction);
                for (axis, coordinate) in gradient.position.iter_mut().enumerate() {
                    *coordinate += (0..active).map(|k| by_value[k] * slopes[k][axis]).sum::<f64>() as f32;
                }
            }
        });
    }

    /// Steps down the gradient of the surfels that were drawn. `steps` has the number of steps of
    /// each surfel so far.
    pub(crate) fn descend(
        &mut self,
        gradient: &[f32],
        by_pixel: &[f32],
        steps: impl Fn(usize) -> u32 + Sync,
        rate: f32,
    ) {
        let size = self.per_surfel();
        if size == 0 || gradient.is_empty() {
            return;
        }
        let moments = self.mean.par_chunks_exact_mut(size).zip(self.square.par_chunks_exact_mut(size));
        let rows = self.coefficients.par_chunks_exact_mut(size).zip(moments).zip(gradient.par_chunks_exact(size));
        rows.zip(by_pixel).enumerate().for_each(|(number, (((own, (mean, square)), gradient), by_pixel))| {
            if by_pixel.is_finite() {
                step_all([own, mean, square], gradient, steps(number), rate);
            }
        });
    }

    /// Takes the harmonics of other surfels: each has those of a surfel so far, with or without the
    /// running means of its gradient.
    pub(crate) fn rearrange(&mut self, sources: &[(usize, bool)]) {
        let size = self.per_surfel();
        if size == 0 {
            return;
        }
        let taken = |from: &[f32], always: bool| {
            let mut out = Vec::with_capacity(sources.len() * size);
            for (source, keeps) in sources {
                if always || *keeps {
                    out.extend_from_slice(&from[source * size..(source + 1) * size]);
                } else {
                    out.resize(out.len() + size, 0.0);
                }
            }
            out
        };
        *self = Self::from_parts(
            self.degree,
            [taken(&self.coefficients, true), taken(&self.mean, false), taken(&self.square, false)],
        );
    }
}

/// Returns the direction from the camera to a surfel, and whether it changes as the surfel moves.
fn sight<C: SurfelCamera>(camera: &C, number: usize, surfel: &Surfel) -> Option<([f64; 3], bool)> {
    let position = surfel.position.map(f64::from);
    let view = camera.local(number, position)?;
    Some(match camera.centre() {
        Some(centre) => ([0, 1, 2].map(|i| position[i] - centre[i]), true),
        None => (view.depth_axis, false),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_degree_cuts_or_pads_each_channel() {
        let numbered = SplatHarmonics::new(1, (1..19).map(|k| k as f32).collect()).unwrap();
        let two = LearnedHarmonics::of(&numbered, 2);
        let wide = two.clone().with_degree(2, 2).to_splats().unwrap();
        assert_eq!((wide.degree(), wide.of(1, 2)), (2, &[16.0, 17.0, 18.0, 0.0, 0.0, 0.0, 0.0, 0.0][..]));
        assert_eq!(two.clone().with_degree(3, 2).with_degree(1, 2), two);
        assert_eq!(two.with_degree(0, 2), LearnedHarmonics::zeros(0, 2));
    }
}
