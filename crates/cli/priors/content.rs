//! What a dataset holds beside its maps: cameras, points, splats, labels, schedule, frames, report.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use ::priors::{PriorModel, Sample, SampleConfig, Samples, Schedule, View, Visible, error_curve, initial_splats};
use anyhow::Context;
use city::{CityModel, SurfaceClass, TriangleMesh};
use io::citymodel::CityFile;
use io::colmap::{self, ColmapEncoding, ColmapModel, ColmapObservation, ColmapPoint};
use io::ply::{self, PlyPoint};
use io::splat_ply::{self, LocalOrigin, SplatForm, SplatLayout};
use report::{ErrorRow, PriorsReport};
use serde_json::{Value, json};

use super::cameras::Cameras;
use super::frame::Frame;
use super::maps::{self, Written};
use super::options::{Args, Mode};
use crate::progress::Watcher;

/// Errors of the curve, as parts of the one asked for.
const CURVE: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Everything that is written.
#[derive(Debug)]
pub(super) struct Dataset<'a> {
    pub(super) args: &'a Args,
    pub(super) file: &'a CityFile,
    pub(super) model: &'a PriorModel,
    pub(super) cameras: &'a Cameras,
    pub(super) frame: &'a Frame,
    pub(super) views: &'a [View],
    pub(super) sampling: &'a SampleConfig,
    pub(super) samples: &'a Samples,
    pub(super) visible: &'a Visible,
}

impl Dataset<'_> {
    /// Writes all of it into a folder.
    pub(super) fn write(&self, folder: &Path, unusable: usize, watcher: &Watcher) -> anyhow::Result<PriorsReport> {
        let written = maps::write(self, folder, watcher)?;
        if !self.args.maps_only {
            self.write_points(folder)?;
            self.write_crops(folder)?;
        }
        write_json(&folder.join("labels.json"), &labels(&self.file.model, self.model.mesh()))?;
        write_json(&folder.join("schedule.json"), &self.schedule())?;
        write_json(&folder.join("origin.json"), &self.frame.describe(&self.file.model.crs))?;
        let report = self.report(&written, unusable)?;
        io::write_bytes(folder.join("report.html"), report.html(&written.pictures)?.as_bytes(), false)?;
        write_json(&folder.join("report.json"), &report.json()?)?;
        Ok(report)
    }

    /// The kept points, in the lengths and the axes of the dataset.
    fn kept(&self) -> Vec<Sample> {
        let moved = |&number: &u32| {
            let sample = &self.samples.points[number as usize];
            Sample {
                position: self.frame.dataset_from_mesh(sample.position),
                normal: self.frame.turn(sample.normal.map(f64::from)).map(|c| c as f32),
                spacing_m: (f64::from(sample.spacing_m) * self.frame.scale()) as f32,
                ..*sample
            }
        };
        self.visible.points.iter().map(moved).collect()
    }

    fn write_points(&self, folder: &Path) -> anyhow::Result<()> {
        let kept = self.kept();
        let sparse = folder.join("sparse/0");
        fs::create_dir_all(&sparse).with_context(|| format!("cannot make the folder: {}", sparse.display()))?;
        let points = self.colmap_points(&kept);
        let model = self.colmap_model();
        for encoding in [ColmapEncoding::Text, ColmapEncoding::Binary] {
            colmap::write(&sparse, &model, &points, encoding, false)?;
        }
        // 2DGS looks for the points beside the cameras, other loaders above.
        let normals = kept.iter().map(|s| s.normal).chain(std::iter::repeat([0.0; 3]));
        let ply_points: Vec<PlyPoint> = points
            .iter()
            .zip(normals)
            .map(|(p, normal)| PlyPoint { position: p.position.map(|c| c as f32), normal, color: p.color })
            .collect();
        let comment =
            format!("skysweep priors: the frame is described in origin.json; model CRS {}", self.file.model.crs);
        for path in [sparse.join("points3D.ply"), folder.join("points3D.ply")] {
            ply::write_points(path, ply_points.iter().copied(), std::slice::from_ref(&comment), false)?;
        }
        self.write_splats(folder, &kept)
    }

    fn write_splats(&self, folder: &Path, kept: &[Sample]) -> anyhow::Result<()> {
        let colours = kept.iter().map(|s| (s, colour(s.class).map(|c| f32::from(c) / 255.0)));
        let splats = initial_splats(colours);
        let path = folder.join("splats");
        fs::create_dir_all(&path).with_context(|| format!("cannot make the folder: {}", path.display()))?;
        let moved = self.frame.moved_by().unwrap_or_default();
        let origin = LocalOrigin::new("frame of the cameras, see origin.json", "frame of the cameras", moved);
        for (name, form) in [("splats_2dgs.ply", SplatForm::Discs), ("splats_3dgs.ply", SplatForm::Ellipsoids)] {
            splat_ply::write(&path.join(name), &splats, &origin, SplatLayout { form, sh_degree: 3 }, false)?;
        }
        Ok(())
    }

    fn colmap_model(&self) -> ColmapModel {
        let mut model = self.cameras.model.clone();
        for view in &mut model.views {
            view.pose.centre = self.frame.dataset_from_camera(view.pose.centre);
        }
        model
    }

    /// The kept points with their tracks, then those of the structure from motion.
    fn colmap_points(&self, kept: &[Sample]) -> Vec<ColmapPoint> {
        let own = kept.iter().zip(&self.visible.observations).map(|(sample, observations)| ColmapPoint {
            position: sample.position,
            color: colour(sample.class),
            error_px: 0.0,
            track: observations.iter().map(|o| ColmapObservation { view: o.view, pixel: o.pixel }).collect(),
        });
        let scene = self.cameras.points.iter().map(|point| {
            let track = point.track.iter().filter_map(|seen| self.cropped(*seen)).collect();
            ColmapPoint { position: self.frame.dataset_from_camera(point.position), track, ..point.clone() }
        });
        own.chain(scene).collect()
    }

    /// An observation of the structure from motion in the part of the image that is kept.
    fn cropped(&self, mut seen: ColmapObservation) -> Option<ColmapObservation> {
        let Some(crop) = self.cameras.crops[self.cameras.model.views[seen.view as usize].lens] else {
            return Some(seen);
        };
        seen.pixel.sample -= crop.x as f64;
        seen.pixel.line -= crop.y as f64;
        let inside = |at: f64, size: usize| (-0.5..size as f64 - 0.5).contains(&at);
        (inside(seen.pixel.sample, crop.width) && inside(seen.pixel.line, crop.height)).then_some(seen)
    }

    /// How the images are to be cropped, where any is.
    fn write_crops(&self, folder: &Path) -> anyhow::Result<()> {
        let views = self.cameras.model.views.iter();
        let crops: BTreeMap<&str, _> =
            views.filter_map(|view| Some((view.name.as_str(), self.cameras.crops[view.lens]?))).collect();
        if crops.is_empty() { Ok(()) } else { write_json(&folder.join("crops.json"), &json!(crops)) }
    }

    fn schedule(&self) -> Value {
        json!({
            "mode": self.args.mode.name(),
            "factors": Schedule::default(),
            "depth_alignment": "alpha = median(prior) / median(rendered) over the pixels of the mask, per view; compare prior with alpha * rendered",
            "mask": match self.args.mode {
                Mode::BuildingOnly => "images, depths and normals are masked to buildings (masks/, raw_mask/)",
                Mode::BuildingEnhanced => "the whole image is trained; priors weigh only inside the mask (masks/, raw_mask/)",
            },
            "source": "values of the released code of GS4Buildings, linear between the two iterations",
        })
    }

    fn report(&self, written: &Written, unusable: usize) -> anyhow::Result<PriorsReport> {
        let curve = error_curve(self.model, self.sampling, &CURVE)?;
        let mut by_class: BTreeMap<SurfaceClass, usize> = BTreeMap::new();
        for &point in &self.visible.points {
            *by_class.entry(self.samples.points[point as usize].class).or_insert(0) += 1;
        }
        Ok(PriorsReport {
            model: self.args.model.display().to_string(),
            cameras: self.cameras.source.display().to_string(),
            mode: self.args.mode.name().to_owned(),
            notes: self.notes(unusable),
            triangles: self.model.mesh().triangles.len(),
            sampled_area_m2: self.samples.area_m2,
            skipped_area_m2: self.samples.skipped_m2.iter().map(|(class, area)| (class.to_string(), *area)).collect(),
            samples: self.samples.points.len(),
            kept: self.visible.points.len(),
            min_views: self.args.min_views,
            pairs: self.visible.pairs,
            views_histogram: self.visible.histogram.clone(),
            kept_by_class: by_class.iter().map(|(class, count)| (class.to_string(), *count)).collect(),
            scene_points: self.cameras.points.len(),
            error_curve: curve
                .iter()
                .map(|c| ErrorRow { error_m: c.error_m, points: c.points, even_points: c.even_points })
                .collect(),
            depth_png_step: Some(written.depth_png_step),
            views: written.rows.clone(),
            settings: self.settings(),
        })
    }

    fn notes(&self, unusable: usize) -> Vec<String> {
        let mut notes = Vec::new();
        let area = |class| self.samples.skipped_m2.iter().find(|(known, _)| *known == class).map(|(_, area)| *area);
        if let Some(area) = area(SurfaceClass::Ground) {
            let share = 100.0 * area / (area + self.samples.area_m2);
            notes.push(format!(
                "Ground surfaces ({share:.0} % of the area) carry no points: they are the bottoms of buildings. --class-weight ground=1 samples them."
            ));
        }
        if unusable > 0 {
            notes.push(unusable_note(unusable));
        }
        if self.visible.points.is_empty() {
            notes.push(format!("No point is seen by {} views: the dataset has no points.", self.args.min_views));
        }
        let blind = self.visible.per_view.iter().filter(|view| view.visible == 0).count();
        if blind > 0 {
            notes.push(format!("{blind} views see no point of a building."));
        }
        if let Some(by) = self.frame.moved_by() {
            notes.push(format!(
                "Cameras were moved by ({}, {}, {}) to lie around zero, where f32 keeps millimetres; origin.json has the way back.",
                -by[0], -by[1], -by[2]
            ));
        }
        if self.file.model.crs.is_missing() {
            notes.push("The model does not say what its reference system is.".to_owned());
        }
        if self.cameras.crops.iter().any(Option::is_some) {
            notes.push("Cameras were cropped: crop the images by crops.json before training.".to_owned());
        }
        if self.args.mode == Mode::BuildingEnhanced && self.cameras.points.is_empty() && !self.args.maps_only {
            notes.push(
                "The cameras came without points of the scene: only buildings have points to begin with.".to_owned(),
            );
        }
        notes
    }

    fn settings(&self) -> Value {
        let args = self.args;
        json!({
            "sampling": format!("{:?}, {:?}, seed {}", self.sampling.amount, self.sampling.spacing, args.seed),
            "disk_m": self.samples.disk_m,
            "margin_px": args.margin,
            "near_m": args.near,
            "epsilon_m": args.epsilon,
            "max_incidence_deg": args.max_incidence,
            "max_observations": args.max_observations,
            "depth": format!("{:?}", args.map_config().depth),
            "normals": format!("{:?}", args.map_config().normals),
            "depth_miss": "+inf in npy, 0 in depth_png, -32768 in GeoTIFF",
            "units_per_metre": self.frame.scale(),
        })
    }
}

/// What to say of objects that could not be used.
pub(super) fn unusable_note(unusable: usize) -> String {
    format!("{unusable} objects of the model could not be used; skysweep city info --report names them.")
}

/// The colour of a class, red, green, blue: something to tell roofs from walls by until a training knows better.
fn colour(class: SurfaceClass) -> [u8; 3] {
    match class {
        SurfaceClass::Roof => [178, 84, 66],
        SurfaceClass::Wall => [208, 196, 172],
        SurfaceClass::Ground => [120, 114, 104],
        SurfaceClass::Window | SurfaceClass::Door => [96, 128, 152],
        _ => [160, 160, 160],
    }
}

/// What the numbers in the class and object maps are.
pub(super) fn labels(model: &CityModel, mesh: &TriangleMesh) -> Value {
    let classes: serde_json::Map<String, Value> =
        SurfaceClass::all().map(|class| ((class as u8).to_string(), json!(class.name()))).collect();
    let mut used: Vec<u32> = mesh.surfaces.iter().map(|surface| surface.object).collect();
    used.sort_unstable();
    used.dedup();
    let object = |&index: &u32| {
        let object = &model.objects[index as usize];
        let building = &model.objects[model.root(index as usize)];
        json!({ "number": index + 1, "id": object.id, "kind": object.kind.name(), "building": building.id })
    };
    json!({
        "classes": classes,
        "missing_class": ::priors::MISSING_CLASS,
        "missing_object": ::priors::NO_OBJECT,
        "objects": used.iter().map(object).collect::<Vec<_>>(),
    })
}

pub(super) fn write_json(path: &Path, value: &Value) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)? + "\n";
    Ok(io::write_bytes(path, text.as_bytes(), false)?)
}
