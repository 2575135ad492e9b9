//! Small scenes of the simulator's presets, which have many difficulties at once where a stage has
//! one. Every RPC has a pointing error of one to three pixels, so scores are taken after a shift.

use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, MetresFromCells, evaluate};
use raster::Grid;
use simulate::{Simulation, SimulationConfig, TruthClass};

use crate::stage::{Score, Shot, Stage};

/// Classes of the truth: the numbers of LAS, and those that the simulator adds.
const GROUND: u8 = TruthClass::Ground as u8;
const BUILDING: u8 = TruthClass::Building as u8;
const WATER: u8 = TruthClass::Water as u8;
const FOOTPRINT_EDGE: u8 = TruthClass::FootprintEdge as u8;

/// A preset of 120 m at half a metre.
fn preset(name: &str) -> SimulationConfig {
    SimulationConfig { size_m: 120.0, ..SimulationConfig::preset(name).unwrap() }
}

/// Truth and errors per cell.
struct Compared {
    truth: Grid<f32>,
    classes: Grid<u8>,
    errors: Grid<f32>,
}

impl Compared {
    /// Returns the score over the cells whose class and true height are chosen.
    fn over(&self, choose: impl Fn(u8, f32) -> bool) -> Score {
        let cells = self.errors.data().iter().zip(self.classes.data().iter().zip(self.truth.data()));
        Score::of(cells.filter(|(_, (c, t))| choose(**c, **t)).map(|(e, _)| f64::from(*e)).collect())
    }
}

fn compared(config: SimulationConfig) -> Compared {
    let made = Simulation::new(config).unwrap();
    let shots: Vec<Shot> =
        made.views.iter().map(|v| Shot { image: v.image.clone(), rpc: v.rpc.clone(), no_data: Some(0.0) }).collect();
    let outcome = Stage::default().run(&shots, |_| {}).unwrap();
    let truth = &made.truth;
    assert_eq!(outcome.dem.horizontal_epsg, Some(truth.epsg), "one zone");
    let map = CellMap::affine(&truth.geotransform, &outcome.dem.geotransform).unwrap();
    let metres = MetresFromCells::new(&truth.geotransform, (1.0, 1.0));
    let input = EvalInput::new(&outcome.dem.heights, &truth.dsm, &map, metres);
    let found = evaluate(&input, &EvalConfig { alignment: AlignmentMethod::Xyz, ..EvalConfig::default() }).unwrap();
    Compared { truth: truth.dsm.clone(), classes: truth.classes.clone(), errors: found.errors }
}

/// A tower of 150 m on 22 × 18 m whose roof holds no tie point: the height range must be extended
/// to hold it.
#[test]
fn a_slim_tower_of_the_high_rise_town_survives() {
    let c = compared(SimulationConfig { size_m: 110.0, ..preset("high-rise") });
    let roofs = c.over(|class, h| class == BUILDING && h > 300.0);
    roofs.expect("roofs over 120 m", 0.7, 0.2);
    c.over(|class, _| class == GROUND).expect("ground", 0.9, 0.06);
}

#[test]
fn sheds_that_repeat_keep_their_heights() {
    let c = compared(preset("repetitive-roofs"));
    c.over(|class, _| class == BUILDING).expect("roofs", 0.95, 0.03);
    c.over(|class, _| class != FOOTPRINT_EDGE).expect("all but edges", 0.88, 0.09);
}

#[test]
fn a_harbour_has_quays_and_no_mountains_on_the_water() {
    let c = compared(preset("harbour"));
    let water = c.over(|class, _| class == WATER);
    assert!(water.wrong < 0.1, "{water:?}");
    c.over(|class, _| class == GROUND).expect("quays", 0.88, 0.06);
}

/// An eighth of the contrast at the same noise.
#[test]
fn a_town_under_a_veil_is_found() {
    let c = compared(SimulationConfig { size_m: 150.0, ..preset("low-texture") });
    c.over(|class, _| class == GROUND).expect("ground", 0.85, 0.08);
    c.over(|class, _| class == BUILDING).expect("roofs", 0.75, 0.15);
}
