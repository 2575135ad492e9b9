//! Why priors cannot be made.

use numeric::failures;

/// Why priors cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PriorsError {
    /// The mesh is inconsistent.
    #[error(transparent)]
    Mesh(#[from] city::ModelError),
    /// No index for ray casting can be built for the mesh.
    #[error(transparent)]
    Bvh(#[from] bvh::BvhError),
    /// A position cannot be projected, or PROJ cannot provide the projection or the datum.
    #[error(transparent)]
    Geodesy(#[from] crs::CrsError),
    /// The model names no map projection.
    #[error("the reference system of the model is {crs}, expected one with an EPSG code, give the code of its map")]
    MapUnknown {
        /// Reference system of the model.
        crs: String,
    },
    /// The coordinates of the model are in degrees or feet.
    #[error("the reference system of the model is {definition}, expected a projected one in metres")]
    MapNotMetric {
        /// Reference system of the model.
        definition: String,
    },
    /// The model extends beyond the area of its geoid model.
    #[error("the model extends beyond the area in which heights above {datum} can be converted")]
    BeyondDatum {
        /// Vertical datum of the heights.
        datum: crs::VerticalDatum,
    },
    /// The model has no triangles.
    #[error("the model has no triangles, so that an image cannot see it")]
    NothingToSee,
    /// No surface is left to sample.
    #[error("no surface is left to sample, all {total} triangles are excluded or have no area")]
    NothingToSample {
        /// Number of triangles.
        total: usize,
    },
    /// More samples were asked for than the limit allows.
    #[error("{asked} samples are needed, the limit is {limit}, lower the density or allow a larger error")]
    TooMany {
        /// Number of samples needed, or a lower bound of it.
        asked: u64,
        /// Largest number of samples.
        limit: usize,
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}, expected {expected}")]
    Config {
        /// Name of the parameter.
        name: &'static str,
        /// Value of the parameter.
        value: f64,
        /// Range of valid values.
        expected: &'static str,
    },
    /// The image has more pixels than the limit allows.
    #[error("the image of the camera has {width} × {height} pixels, the limit is {limit} pixels")]
    ImageSize {
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Largest number of pixels.
        limit: usize,
    },
    /// The list of building objects does not fit the mesh.
    #[error("the list of building objects has {flags} entries, and a surface names object {object}")]
    Objects {
        /// Length of the list.
        flags: usize,
        /// Object that the list does not have.
        object: u32,
    },
}

failures!(PriorsError: Other { Self::Geodesy(error) => error.kind() });
