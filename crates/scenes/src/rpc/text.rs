//! The report of an RPC as lines of text.

use std::fmt::Write as _;

use camera::ImagePoint;
use geodesy::LonLatHeight;
use serde_json::json;

use super::pixels::RpcPixels;
use super::{RpcDirection, RpcInfoReport, RpcLineAnswer, RpcPoint};

impl RpcInfoReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let rpc = &self.rpc;
        let mut out = String::new();
        let mut row = |name: &str, value: String| {
            let _ = writeln!(out, "{name:<12}{value}");
        };
        row("file", self.file.clone());
        row("format", self.format.to_string());
        if self.source != self.file {
            row("source", self.source.clone());
        }
        self.image.iter().flat_map(RpcPixels::rows).for_each(|(name, value)| row(name, value));
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
        let v = &self.validity;
        row("valid for", format!("longitude {:.6} to {:.6} deg", v.lon_deg[0], v.lon_deg[1]));
        row("", format!("latitude {:.6} to {:.6} deg", v.lat_deg[0], v.lat_deg[1]));
        row("", format!("height {:.1} to {:.1} m above the ellipsoid", v.height_m[0], v.height_m[1]));
        if let Some(c) = &self.centre {
            row("centre", format!("sample {:.2}, line {:.2}", c.image.sample, c.image.line));
            row("GSD", format!("{:.3} m along the sample, {:.3} m along the line", c.gsd_sample_m, c.gsd_line_m));
            row("view", format!("incidence {:.2} deg, sensor at azimuth {:.1} deg", c.incidence_deg, c.azimuth_deg));
        }
        out
    }
}

impl RpcLineAnswer {
    /// Returns the answer as a line: a point, or `nan nan` (in JSON the error) where there is none.
    pub fn text(&self, direction: RpcDirection, as_json: bool) -> String {
        match &self.point {
            Ok(point) => point.line(direction, as_json),
            Err(error) if as_json => json!({ "error": error.to_string() }).to_string(),
            Err(_) => "nan nan".to_owned(),
        }
    }
}

impl RpcPoint {
    /// Returns the answer to a question of a direction as a line of numbers, or as JSON with the
    /// question.
    pub fn line(&self, direction: RpcDirection, as_json: bool) -> String {
        let LonLatHeight { lon_deg: lon, lat_deg: lat, height_m: height } = self.ground;
        let ImagePoint { sample, line } = self.image;
        let value = match direction {
            RpcDirection::Project if !as_json => return format!("{sample:.9} {line:.9}"),
            RpcDirection::Localize if !as_json => return format!("{lon:.12} {lat:.12} {height}"),
            RpcDirection::Project => {
                json!({ "lon_deg": lon, "lat_deg": lat, "height_m": height, "sample": sample, "line": line })
            }
            RpcDirection::Localize => {
                json!({ "sample": sample, "line": line, "lon_deg": lon, "lat_deg": lat, "height_m": height })
            }
        };
        value.to_string()
    }
}
