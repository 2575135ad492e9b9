//! How far a simulation is.

/// Hears of the progress of a simulation, from any thread.
pub trait Progress: Sync {
    /// A stage of so many steps begins.
    fn begin(&self, stage: &str, steps: usize);
    /// A step of the stage is done.
    fn step(&self);
}

/// Tells nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _steps: usize) {}
    fn step(&self) {}
}
