//! What stops priors from being made.

/// Why no priors can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PriorsError {
    /// A mesh that contradicts itself.
    #[error(transparent)]
    Mesh(#[from] city::ModelError),
    /// A mesh that rays cannot be cast at.
    #[error(transparent)]
    Bvh(#[from] bvh::BvhError),
    /// A place that the map of the model does not have, or a map that cannot be had.
    #[error(transparent)]
    Geodesy(#[from] crs::CrsError),
    /// A model that does not say in which map it is.
    #[error("the model does not say in which map it is ({crs}), expected an EPSG code")]
    MapUnknown {
        /// What it says of its reference system.
        crs: String,
    },
    /// A model in degrees or feet.
    #[error("the model is in {definition}, expected a projected coordinate system in metres")]
    MapNotMetric {
        /// Its reference system.
        definition: String,
    },
    /// A model outside the geoid model that its heights are above.
    #[error("the model reaches beyond where heights above {datum} are known")]
    BeyondDatum {
        /// What the heights are above.
        datum: crs::VerticalDatum,
    },
    /// A model without triangles.
    #[error("the model has no triangle that an image could see")]
    NothingToSee,
    /// Nothing is left to put samples on.
    #[error("no surface is left to sample: {total} triangles, and all of them are excluded or without area")]
    NothingToSample {
        /// How many triangles there are.
        total: usize,
    },
    /// More samples than a run may make.
    #[error("{asked} samples, at most {limit} are made: lower the density, or allow a larger error")]
    TooMany {
        /// How many were asked for, or at least how many.
        asked: u64,
        /// The limit.
        limit: usize,
    },
    /// A number that means nothing.
    #[error("{name} is {value}, expected {expected}")]
    Config {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// An image with more pixels than maps are made for.
    #[error("the image of the camera has {width} × {height} pixels, maps are made of up to {limit}")]
    ImageSize {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// The limit.
        limit: usize,
    },
    /// The list of building objects does not fit the mesh.
    #[error("{flags} objects are said to be buildings or not, and a surface names object {object}")]
    Objects {
        /// Length of the list.
        flags: usize,
        /// The object that it leaves out.
        object: u32,
    },
}
