//! The configuration of the products of a run.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::product::ProductKind;
use job::error::SettingError;

/// Folder of the products in that of the run.
pub(crate) const FOLDER: &str = "products";

/// The products of the folder of a DSM run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ProductsConfig {
    /// Folder of the run.
    pub run: PathBuf,
    /// Folder for the products; `products` in the run when `None`.
    #[serde(default)]
    pub output: Option<PathBuf>,
    /// What is made.
    pub products: Vec<ProductKind>,
    /// Ortho that colours the products, on the map of the surface model. `None` makes one of the
    /// images of the run, or takes the one that an earlier call made.
    #[serde(default)]
    pub ortho: Option<PathBuf>,
    /// Whether the cloud has the filled cells, too, flagged as synthetic points.
    #[serde(default)]
    pub filled: bool,
    /// Step between contour lines, in the unit of the heights (metres, or feet where the vertical
    /// datum counts in feet); chosen from the relief and the cell size when `None`.
    #[serde(default)]
    pub contour_interval: Option<f64>,
    /// Largest vertical distance of the mesh from the cells, metres; the median standard deviation
    /// of the heights, between a quarter and the whole of a cell, when `None`.
    #[serde(default)]
    pub mesh_tolerance_m: Option<f64>,
    /// Worker threads. `None` uses all cores.
    #[serde(default)]
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

impl ProductsConfig {
    /// All products of a run, in its folder.
    pub fn new(run: PathBuf) -> Self {
        let products = ProductKind::CHOICES.map(|(_, product, _)| product).into();
        Self {
            run,
            output: None,
            products,
            ortho: None,
            filled: false,
            contour_interval: None,
            mesh_tolerance_m: None,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] when nothing is to be made, or a length is not positive.
    pub fn validate(&self) -> Result<(), SettingError> {
        if self.products.is_empty() {
            let names = ProductKind::CHOICES.map(|(name, ..)| name).join(", ");
            return Err(SettingError::new("the list of products", "empty", format!("one or more of {names}")));
        }
        for (name, length) in
            [("the contour interval", self.contour_interval), ("the tolerance of the mesh", self.mesh_tolerance_m)]
        {
            if let Some(found) = length.filter(|length| !(*length > 0.0 && length.is_finite())) {
                return Err(SettingError::new(name, found, "a positive number of metres"));
            }
        }
        Ok(())
    }

    /// Returns the folder for the products.
    pub fn folder(&self) -> PathBuf {
        self.output.clone().unwrap_or_else(|| self.run.join(FOLDER))
    }

    pub(super) fn wants(&self, product: ProductKind) -> bool {
        self.products.contains(&product)
    }
}
