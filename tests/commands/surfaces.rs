//! Commands on surface models.

mod buildings;
mod diff;
mod dtm;
mod eval;
mod eval_report;
mod eval_surfaces;
mod groundview;
mod heightmap;
mod ortho;
mod products;
mod register;
mod tiles;
