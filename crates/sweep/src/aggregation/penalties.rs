//! Penalties of the aggregation.

/// The greatest penalty of a jump.
pub(crate) const JUMP_MAX: u8 = 127;

/// Penalties in units of the cost ([`crate::cost::COST_MAX`] = worst).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalties {
    /// For a change of one step.
    pub step: u8,
    /// For a jump, where the image is flat; at most 127, more counts as that.
    pub jump: u8,
    /// For a jump, across the strongest edges.
    pub jump_at_edge: u8,
}

impl Default for Penalties {
    /// Measured on simulated towns and the LiDAR truth of JAX_068: a step costs about a quarter of the worst cost, so that noise
    /// does not ripple a roof; a jump a little more than the worst cost, and no more than a step across an image edge,
    /// where roofs end. The proportions are those of CARS and S2P (8 to 32 of 24 bits).
    fn default() -> Self {
        Self { step: 32, jump: 124, jump_at_edge: 32 }
    }
}

/// The jump penalty at a pixel: the stronger its edge is, the lower. Between two pixels it is the lower one of theirs.
#[inline(always)]
pub(super) fn jump_penalty(p: Penalties, edge: u8) -> u8 {
    let range = u16::from(p.jump.saturating_sub(p.jump_at_edge));
    (p.jump - ((range * u16::from(edge)) / 255) as u8).min(JUMP_MAX)
}
