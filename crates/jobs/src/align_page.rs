//! The alignment by hand on a page of the viewer: its server shows the map, [`scenes::align`] has
//! the model and saves what the page asks for.
//!
//! | `job/…` | answer |
//! |---|---|
//! | `opening.json` | frame, start, cameras, numbers of points |
//! | `cloud.bin` | points: three f32 from the pivot in the frame of the model, red, green, blue, 0 |
//! | `photo/NUMBER.png` | a photograph as a pinhole sees it |
//! | POST `fit` | the similarity of the pairs that are sent |
//! | POST `save` | writes the outputs |
//!
//! Positions in the world are counted from the origin of the opening.

use std::path::PathBuf;

use numeric::{Failure, Kind, Progress};
use scenes::align::{AlignMap, ManualAlign, ManualAlignConfig, ManualAlignReport};
use serde::{Deserialize, Serialize};
use serde_json::json;
use viewer::{PageData, PageJob, ViewConfig, ViewServer, ViewerReport};

use camera::Similarity;
use colmap::align::PointPair;
use job::error::JobError;
use job::error_text::with_causes;

/// Most points that the page draws while they are dragged.
const DRAWN_MAX: usize = 100_000;

/// An alignment by hand and the server of its page.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct AlignPageConfig {
    /// What is aligned, and where it is saved.
    pub align: ManualAlignConfig,
    /// The map, first of its inputs, and what is drawn over it; port and time of the server.
    pub view: ViewConfig,
}

impl AlignPageConfig {
    /// A model over a map, on a free port, without an end.
    pub fn new(align: ManualAlignConfig, map: Vec<PathBuf>) -> Self {
        Self { align, view: ViewConfig::new(map) }
    }
}

/// What became of a page.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AlignPageReport {
    /// The alignment that was saved last; `None` when nothing was saved.
    pub saved: Option<ManualAlignReport>,
    /// The requests of the page.
    pub page: ViewerReport,
}

/// A page that listens and is not served yet.
pub struct AlignPage {
    server: ViewServer,
    desk: Desk,
}

impl AlignPage {
    /// Reads the model and the map, and listens on 127.0.0.1.
    ///
    /// # Errors
    /// [`JobError`]: inputs that cannot be read, a map without a place, an output that
    /// exists, a port that is taken.
    pub fn open(config: &AlignPageConfig, progress: &dyn Progress) -> Result<Self, JobError> {
        let server = ViewServer::open(&config.view, progress)?;
        let map = server.map_frame()?.and_then(|frame| {
            Some(AlignMap {
                name: frame.name,
                crs: frame.epsg.map(|code| format!("EPSG:{code}")).or(frame.wkt)?,
                bounds: frame.bounds,
                ground_m: frame.ground_m,
                vertical: frame.vertical,
            })
        });
        let align = ManualAlign::open(&config.align, map, progress)?;
        Ok(Self { server, desk: Desk { stride: align.points().len().div_ceil(DRAWN_MAX).max(1), align } })
    }

    /// Returns the address of the page, with its token.
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// Opens the page in the browser that the system prefers.
    ///
    /// # Errors
    /// As [`ViewServer::open_browser`].
    pub fn open_browser(&self) -> Result<(), JobError> {
        self.server.open_browser()
    }

    /// Answers the page until the job is cancelled or its time is over.
    ///
    /// # Errors
    /// As [`ViewServer::serve`].
    pub fn serve(&self, progress: &dyn Progress) -> Result<AlignPageReport, JobError> {
        let page = self.server.serve_job(&self.desk, progress)?;
        Ok(AlignPageReport { saved: self.desk.align.saved(), page })
    }
}

/// What stands behind the page.
struct Desk {
    align: ManualAlign,
    /// One in so many points is drawn.
    stride: usize,
}

/// A similarity as the page sends it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Placed {
    scale: f64,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pair {
    /// Position in the frame of the model.
    model: [f64; 3],
    /// Position in the world.
    world: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wish {
    world_from_model: Placed,
    pairs: Vec<Pair>,
}

impl Wish {
    fn read(body: &[u8]) -> Result<(Similarity, Vec<PointPair>), String> {
        let wish: Self =
            serde_json::from_slice(body).map_err(|error| format!("the request is not readable: {error}"))?;
        let Placed { scale, rotation, translation } = wish.world_from_model;
        let placed = Similarity::new(scale, rotation, translation).map_err(|error| error.to_string())?;
        let pairs = wish.pairs.iter().map(|pair| PointPair { source: pair.model, target: pair.world });
        let pairs: Vec<PointPair> = pairs.collect();
        match pairs.iter().position(|pair| !pair.source.iter().chain(&pair.target).all(|c| c.is_finite())) {
            Some(index) => Err(format!("pair {} has a position that is not finite", index + 1)),
            None => Ok((placed, pairs)),
        }
    }
}

impl PageJob for Desk {
    fn get(&self, name: &str) -> Option<Result<PageData, String>> {
        if let Some(number) = name.strip_prefix("photo/").and_then(|name| name.strip_suffix(".png")) {
            let is_plain = number.len() <= 7 && number.bytes().all(|digit| digit.is_ascii_digit());
            let picture = self.align.photograph(number.parse().ok().filter(|_| is_plain)?)?;
            return Some(picture.map(PageData::Png).map_err(|error| with_causes(&error)));
        }
        match name {
            "opening.json" => Some(Ok(PageData::Json(self.opening().to_string()))),
            "cloud.bin" => Some(Ok(PageData::Binary(self.cloud()))),
            _ => None,
        }
    }

    fn post(&self, name: &str, body: &[u8]) -> Option<Result<String, String>> {
        match name {
            "fit" => Some(Wish::read(body).and_then(|(present, pairs)| {
                let found = self.align.fit(&pairs, &present).map_err(|error| with_causes(&error))?;
                serde_json::to_string(&found).map_err(|error| error.to_string())
            })),
            "save" => Some(Wish::read(body).and_then(|(placed, pairs)| {
                let saved = self.align.save(&placed, &pairs).map_err(|error| refused(&error))?;
                serde_json::to_string(&saved).map_err(|error| error.to_string())
            })),
            _ => None,
        }
    }
}

/// Words for a save that is refused.
fn refused(error: &JobError) -> String {
    let text = with_causes(error);
    if error.kind() == Kind::OutputExists {
        format!("{text}. Nothing was written: start the page so that it may overwrite, or with another folder")
    } else {
        text
    }
}

impl Desk {
    fn opening(&self) -> serde_json::Value {
        let align = &self.align;
        let (map, vertical) = align.map();
        let cameras: Vec<serde_json::Value> = align
            .cameras()
            .views
            .iter()
            .enumerate()
            .filter_map(|(number, view)| {
                let lens = align.cameras().lenses.get(view.lens)?;
                let principal = lens.principal_point();
                Some(json!({
                    "number": number,
                    "name": view.name,
                    "focal": lens.focal_px(),
                    "principal": [principal.sample, principal.line],
                    "size": [lens.width(), lens.height()],
                    "rotation": view.pose.rotation,
                    "centre": view.pose.centre,
                    "has_photograph": align.has_photograph(number),
                }))
            })
            .collect();
        json!({
            "crs": map.crs,
            "vertical": vertical.to_string(),
            "ground_m": map.ground_m,
            "origin": align.origin(),
            "pivot": align.pivot(),
            "start": align.start(),
            "points": align.points().len(),
            "stride": self.stride,
            "cameras": cameras,
            "output": align.output().display().to_string(),
        })
    }

    /// The points that are drawn: one in so many, in the order of the model.
    fn cloud(&self) -> Vec<u8> {
        let pivot = self.align.pivot();
        let mut bytes = Vec::new();
        for point in self.align.points().iter().step_by(self.stride) {
            let offset = [0, 1, 2].map(|i| (point.position[i] - pivot[i]) as f32);
            offset.iter().for_each(|c| bytes.extend_from_slice(&c.to_le_bytes()));
            bytes.extend_from_slice(&point.color);
            bytes.push(0);
        }
        bytes
    }
}
