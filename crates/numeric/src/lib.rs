//! Numbers that every crate needs: seeded random numbers, order statistics, small vectors, progress and cancellation.
