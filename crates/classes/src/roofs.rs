//! Roofs among the smooth cells: flat ones, as far as their planes go, with outlines that were seen
//! well, and with walls on several sides.

use raster::Grid;

use crate::planes::{Planes, START_REACH, box_sums, flatness, planes};
use crate::regions::{labelled, shrunk};
use crate::roughness::residuals;
use crate::walls::has_walls;

/// Area of a plane over its residual on a sphere of radius 1 m: 2 π √12, from the sag of a cap.
const PLANE_OF_SPHERE: f64 = 21.8;
/// Width of the surroundings over which the flatness is a mean, metres: those of a small house.
const AROUND_M: f64 = 5.0;
/// Share of the least height down to which roofs go on: the uphill side of a house in a slope.
const LOWEST_ROOF_SHARE: f32 = 0.25;
/// Share of the standing cells of a plane, and of all its cells, that are a building's where the
/// plane is one's.
const OWN_STANDING: f64 = 0.6;
const OWN_SHARE: f64 = 0.3;
/// Width of the outlines in which weak cells do not count, metres: matching puts walls that far
/// from their places.
const OUTLINE_M: f64 = 1.5;
/// Height of a wall, as a share of the least height of a building.
const WALL_SHARE: f32 = 0.75;

/// The surface and its scale.
pub(crate) struct RoofScene<'a> {
    pub(crate) surface: &'a Grid<f32>,
    pub(crate) above_ground: &'a Grid<f32>,
    pub(crate) weak: Option<&'a Grid<bool>>,
    pub(crate) cell_m: f64,
    /// Least height of a building, metres.
    pub(crate) least_m: f32,
    /// Distance from a plane up to which cells lie on it, metres.
    pub(crate) tolerance_m: f64,
}

impl RoofScene<'_> {
    fn steps(&self, length_m: f64) -> usize {
        (length_m / self.cell_m).round().max(1.0) as usize
    }

    /// Returns the cells that rise above the ground by more than the least height.
    pub(crate) fn stands(&self) -> Grid<bool> {
        self.above_ground.map(|h| *h > self.least_m)
    }

    /// Returns the planes of what rises above the ground.
    pub(crate) fn planes(&self) -> Planes {
        let lowest_m = LOWEST_ROOF_SHARE * self.least_m;
        let risen = self.above_ground.map(|h| *h > lowest_m);
        let starts = residuals(self.surface, &risen, START_REACH);
        planes(self.surface, &risen, &starts, self.tolerance_m)
    }

    /// Takes cells out of a mask around which the standing surface is curved with less than
    /// `least_radius_m`. Residuals below `least_residual_m` are those of planes.
    pub(crate) fn without_crowns(
        &self,
        mask: &mut Grid<bool>,
        (planes, roughness): (&Planes, &Grid<f32>),
        least_radius_m: f64,
        least_residual_m: f64,
    ) {
        let around = (self.steps(0.5 * AROUND_M), self.cell_m);
        let flat = flatness(planes, roughness, &self.stands(), around, least_residual_m);
        let least = (PLANE_OF_SPHERE * least_radius_m) as f32;
        mask.data_mut().iter_mut().zip(flat.data()).for_each(|(is, flat)| *is &= *flat >= least);
    }

    /// Lets buildings go on over the planes that are mostly theirs, where they come near the
    /// ground.
    pub(crate) fn continue_over_planes(&self, buildings: &mut Grid<bool>, planes: &Planes) {
        let mut standing = vec![0usize; planes.cells.len()];
        let mut own = standing.clone();
        for (at, number) in planes.numbers.data().iter().enumerate() {
            standing[*number as usize] += usize::from(self.above_ground.data()[at] > self.least_m);
            own[*number as usize] += usize::from(buildings.data()[at]);
        }
        let is_own = |number: usize| {
            let own = own[number] as f64;
            number > 0
                && own >= OWN_STANDING * standing[number] as f64
                && own >= OWN_SHARE * planes.cells[number] as f64
        };
        for (at, cell) in buildings.data_mut().iter_mut().enumerate() {
            let is_low = self.above_ground.data()[at] <= self.least_m;
            let is_weak = self.weak.is_some_and(|weak| weak.data()[at]);
            *cell |= is_low && !is_weak && is_own(planes.numbers.data()[at] as usize);
        }
    }

    /// Takes weak cells out of the outlines of buildings, unless the building lies around them.
    /// Returns the cells that were taken.
    pub(crate) fn without_weak_outlines(&self, buildings: &mut Grid<bool>) -> Grid<bool> {
        let Some(weak) = self.weak else { return buildings.map(|_| false) };
        let reach = self.steps(OUTLINE_M);
        let inner = shrunk(buildings, reach);
        let mut sure = buildings.clone();
        for (at, cell) in sure.data_mut().iter_mut().enumerate() {
            *cell &= !weak.data()[at] || inner.data()[at];
        }
        let sums = box_sums(&sure.map(|is| f64::from(u8::from(*is))), reach);
        let half = 0.5 * ((2 * reach + 1) * (2 * reach + 1)) as f64;
        let mut taken = buildings.map(|_| false);
        for at in 0..sums.data().len() {
            if buildings.data()[at] && !sure.data()[at] && sums.data()[at] < half {
                buildings.data_mut()[at] = false;
                taken.data_mut()[at] = true;
            }
        }
        taken
    }

    /// Takes regions out of a mask that have no walls on several sides. Regions of which more than
    /// half is `known` by other evidence than heights stay.
    pub(crate) fn without_slopes(&self, mask: &mut Grid<bool>, known: &[bool]) {
        let (numbers, regions) = labelled(mask);
        let stands = self.stands();
        for cells in regions {
            if 2 * cells.iter().filter(|at| known[**at]).count() > cells.len() {
                continue;
            }
            if !has_walls(self.surface, &stands, &numbers, &cells, self.cell_m, WALL_SHARE * self.least_m) {
                cells.into_iter().for_each(|at| mask.data_mut()[at] = false);
            }
        }
    }
}
