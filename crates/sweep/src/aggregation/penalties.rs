//! Penalties of the aggregation: what a path pays for a change of height.

/// Largest penalty of a jump. The sum of two increments then fits a byte.
pub(super) const JUMP_MAX: u8 = 127;

/// Penalties of the aggregation, in units of the cost ([`crate::cost::COST_MAX`] is the worst
/// cost).
///
/// ```
/// use sweep::aggregation::Penalties;
///
/// let smooth = Penalties { step: 40, ..Penalties::default() };
/// assert!(smooth.jump_at_edge < smooth.jump);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalties {
    /// Penalty of a change by one hypothesis, P1.
    pub step: u8,
    /// Penalty of a larger change, P2, where the image is flat. Values above 127 count as 127.
    pub jump: u8,
    /// Penalty of a larger change across the strongest image edges.
    pub jump_at_edge: u8,
}

impl Default for Penalties {
    /// Returns penalties chosen on simulated towns and on the LiDAR truth of JAX_068.
    ///
    /// A step costs about a quarter of the worst cost, so that noise does not ripple a roof. A jump
    /// costs a little more than the worst cost. Across an image edge, where roofs end, it costs no
    /// more than a step. CARS and S2P use similar proportions (8 to 32 of 24 bits).
    fn default() -> Self {
        Self { step: 32, jump: 124, jump_at_edge: 32 }
    }
}

/// Returns the penalty of a jump at a pixel: the stronger its edge (0 to 255), the lower.
#[inline(always)]
pub(super) fn jump_penalty(p: Penalties, edge: u8) -> u8 {
    let range = u16::from(p.jump.saturating_sub(p.jump_at_edge));
    (p.jump - ((range * u16::from(edge)) / 255) as u8).min(JUMP_MAX)
}
