//! `skysweep rpc info`: what an RPC says about its image.
//!
//! The ground sampling distance and the viewing angles are those at the centre of the RPC's domain, at the height offset.
//! The incidence is the angle at the ground between the vertical and the sensor, the azimuth the direction to the sensor,
//! clockwise from north.

use std::fmt::Write as _;
use std::path::PathBuf;

use camera::{CameraError, ImagePoint, Rpc, RpcCamera};
use geodesy::LonLatHeight;
use io::rpc::{RpcFile, RpcFormat};
use serde::Serialize;

use crate::Outcome;

/// Arguments of `skysweep rpc info`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Print JSON for programs.
    #[arg(long)]
    json: bool,
}

/// The whole answer, as it is printed in JSON.
#[derive(Serialize)]
struct Info<'a> {
    file: String,
    source: String,
    format: RpcFormat,
    warnings: &'a [String],
    rpc: &'a Rpc,
    validity: Validity,
    /// Absent where the model cannot be inverted at its centre.
    centre: Option<Centre>,
}

/// The box on which the model was fitted.
#[derive(Serialize)]
struct Validity {
    lon_deg: [f64; 2],
    lat_deg: [f64; 2],
    height_m: [f64; 2],
}

/// The geometry at the centre of the domain.
#[derive(Serialize)]
struct Centre {
    ground: LonLatHeight,
    image: ImagePoint,
    gsd_sample_m: f64,
    gsd_line_m: f64,
    incidence_deg: f64,
    azimuth_deg: f64,
}

/// Runs `skysweep rpc info`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let file = super::read(&args.file)?;
    let centre = centre(&file.rpc);
    if let Err(e) = &centre {
        tracing::warn!("no ground sampling distance and viewing angles: {e}");
    }
    let info = Info {
        file: args.file.display().to_string(),
        source: file.source.display().to_string(),
        format: file.format,
        warnings: &file.warnings,
        rpc: &file.rpc,
        validity: validity(&file.rpc),
        centre: centre.ok(),
    };
    if args.json {
        crate::print::json(&info)?;
    } else {
        crate::print::text(&text(&info, &file))?;
    }
    Ok(Outcome::Complete)
}

fn validity(rpc: &Rpc) -> Validity {
    let domain = rpc.domain();
    let (low, high) = (domain.at([-1.0; 3]), domain.at([1.0; 3]));
    Validity {
        lon_deg: [low.lon_deg, high.lon_deg],
        lat_deg: [low.lat_deg, high.lat_deg],
        height_m: [low.height_m, high.height_m],
    }
}

fn centre(rpc: &Rpc) -> Result<Centre, CameraError> {
    let ground = rpc.domain().centre;
    let camera = RpcCamera::new(rpc.clone());
    let (gsd, view) = (camera.gsd(ground)?, camera.view_direction(ground)?);
    Ok(Centre {
        ground,
        image: camera.project(ground)?,
        gsd_sample_m: gsd.sample_m,
        gsd_line_m: gsd.line_m,
        incidence_deg: view.incidence_deg(),
        azimuth_deg: view.azimuth_deg(),
    })
}

fn text(info: &Info<'_>, file: &RpcFile) -> String {
    let rpc = info.rpc;
    let mut out = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "{name:<12}{value}");
    };
    row("file", info.file.clone());
    row("format", file.format.to_string());
    if info.source != info.file {
        row("source", info.source.clone());
    }
    for (name, off, scale, unit) in [
        ("line", rpc.line_off, rpc.line_scale, "px"),
        ("sample", rpc.samp_off, rpc.samp_scale, "px"),
        ("latitude", rpc.lat_off, rpc.lat_scale, "deg"),
        ("longitude", rpc.long_off, rpc.long_scale, "deg"),
        ("height", rpc.height_off, rpc.height_scale, "m"),
    ] {
        row(name, format!("offset {off}, scale {scale} {unit}"));
    }
    for (name, error) in [("bias error", rpc.err_bias_m), ("rand error", rpc.err_rand_m)] {
        if let Some(error) = error {
            row(name, format!("{error} m"));
        }
    }
    let v = &info.validity;
    row("valid for", format!("longitude {:.6} to {:.6} deg", v.lon_deg[0], v.lon_deg[1]));
    row("", format!("latitude {:.6} to {:.6} deg", v.lat_deg[0], v.lat_deg[1]));
    row("", format!("height {:.1} to {:.1} m above the ellipsoid", v.height_m[0], v.height_m[1]));
    if let Some(c) = &info.centre {
        row("centre", format!("sample {:.2}, line {:.2}", c.image.sample, c.image.line));
        row("GSD", format!("{:.3} m along the sample, {:.3} m along the line", c.gsd_sample_m, c.gsd_line_m));
        row("view", format!("incidence {:.2} deg, sensor at azimuth {:.1} deg", c.incidence_deg, c.azimuth_deg));
    }
    out
}
