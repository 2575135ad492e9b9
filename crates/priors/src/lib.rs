//! Building priors from LoD2 city models (GS4Buildings, Zhang et al. 2025): area-weighted samples, the points that at least
//! k cameras see, and depth, normal, mask, class and object maps per camera.
//!
//! Positions are f64 metres from a recorded local origin.
