//! One module per command that does a job: its arguments, and what it prints.

pub(crate) mod align;
pub(crate) mod batch;
pub(crate) mod buildings;
pub(crate) mod city;
pub(crate) mod classes;
pub(crate) mod diff;
pub(crate) mod dsm;
pub(crate) mod dtm;
pub(crate) mod eval;
pub(crate) mod groundview;
pub(crate) mod heightmap;
pub(crate) mod mesh;
pub(crate) mod ortho;
pub(crate) mod priors;
pub(crate) mod production;
pub(crate) mod products;
pub(crate) mod register;
pub(crate) mod rpc;
pub(crate) mod selftest;
pub(crate) mod simulate;
pub(crate) mod splats;
pub(crate) mod split;
pub(crate) mod tiles;
pub(crate) mod train;
pub(crate) mod view;
