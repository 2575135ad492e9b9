//! `skysweep priors`: a city model and cameras in, a dataset for Gaussian splatting trainers out.
//!
//! The folder holds the points that enough cameras see (COLMAP's `sparse/0` as text and binary, `points3D.ply`), per image
//! the depth, the normals, the mask, the surface class and the object, flat Gaussians to begin with, and a report. It is made
//! beside its place and moved there when it is complete. Everything stays in the frame of the cameras; `origin.json` says how
//! the model lies in it. Of satellite images there are maps only ([`satellite`]). Exit code 1 when objects of the model could not be used.

mod cameras;
mod content;
mod folder;
mod frame;
mod maps;
mod options;
mod satellite;
mod trainer;

use std::path::PathBuf;

use ::priors::{PriorModel, Samples, View, Visibility, Visible, buildings_of, sample};
use anyhow::{Context, bail};
use city::{LodChoice, MeshConfig, MeshedModel, ObjectStatus, Scope, TriangleMesh};
use io::citymodel::CityFile;
use numeric::Progress as _;
use report::PriorsReport;

use crate::progress::Watcher;
use crate::{Global, Outcome, print};
use cameras::Cameras;
use content::Dataset;
use folder::Folder;
use frame::Frame;
pub(crate) use options::Args;

/// Runs `skysweep priors`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(threads.max(1));
    }
    let watcher = Watcher::new(args.progress, global);
    let pool = pool.build().context("the threads could not be started")?;
    let made = pool.install(|| match cameras::satellite_images(&args.cameras)? {
        Some(images) => of_satellite_images(args, &images, &watcher),
        None => of_cameras(args, &watcher),
    });
    watcher.finish();
    let Made { report, summary, unusable } = made?;
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        print::text(&summary)?;
    }
    Ok(if unusable > 0 { Outcome::Partial } else { Outcome::Complete })
}

/// What a run tells.
struct Made {
    report: serde_json::Value,
    summary: String,
    /// Objects of the model that could not be used.
    unusable: usize,
}

fn of_satellite_images(args: &Args, images: &[PathBuf], watcher: &Watcher) -> anyhow::Result<Made> {
    let (report, unusable) = satellite::make(args, images, watcher)?;
    Ok(Made { summary: satellite::summary(args, &report), report, unusable })
}

fn of_cameras(args: &Args, watcher: &Watcher) -> anyhow::Result<Made> {
    let (report, unusable) = make(args, watcher)?;
    Ok(Made { report: report.json()?, summary: summary(args, &report), unusable })
}

fn make(args: &Args, watcher: &Watcher) -> anyhow::Result<(PriorsReport, usize)> {
    if args.crs.is_some() || args.vertical.is_some() || args.corrections.is_some() {
        bail!("--crs, --vertical and --corrections are for satellite images: the cameras are none");
    }
    let folder = Folder::new(&args.output, args.overwrite)?;
    let sampling = args.sampling()?;
    let cameras = Cameras::read(args)?;
    let (file, meshed) = read_model(args)?;
    let unusable = unusable(&meshed);
    let frame = Frame::new(args, meshed.mesh.origin, &cameras)?;
    let model = PriorModel::new(meshed.mesh, &buildings_of(&file.model))?;
    let views = cameras.views(&frame);
    let samples = sample(&model, &sampling)?;
    let visible = look(args, &model, &samples, &views, watcher)?;
    let dataset = Dataset {
        args,
        file: &file,
        model: &model,
        cameras: &cameras,
        frame: &frame,
        views: &views,
        sampling: &sampling,
        samples: &samples,
        visible: &visible,
    };
    let place = folder.begin()?;
    let report = dataset.write(place.path(), unusable, watcher)?;
    place.publish()?;
    Ok((report, unusable))
}

/// How many objects could not be used.
fn unusable(meshed: &MeshedModel) -> usize {
    meshed.objects.iter().filter(|object| object.status == ObjectStatus::Unusable).count()
}

fn read_model(args: &Args) -> anyhow::Result<(CityFile, MeshedModel)> {
    let file = io::citymodel::read(&args.model)?;
    let config = MeshConfig {
        lod: args.lod.map_or_else(LodChoice::default, LodChoice::Only),
        scope: if args.all_objects { Scope::Everything } else { Scope::Buildings },
    };
    let meshed = TriangleMesh::from_model(&file.model, &config)?;
    if meshed.mesh.triangles.is_empty() {
        bail!(
            "no object of the model could be used ({} objects; skysweep city info says why): {}",
            file.model.objects.len(),
            args.model.display()
        );
    }
    Ok((file, meshed))
}

fn look(
    args: &Args,
    model: &PriorModel,
    samples: &Samples,
    views: &[View],
    watcher: &Watcher,
) -> anyhow::Result<Visible> {
    let mut visibility = Visibility::new(model, &samples.points, args.visibility())?;
    watcher.begin("visibility", views.len());
    let mut candidates = 0;
    for view in views {
        candidates += visibility.add(view).candidates;
        watcher.step();
    }
    if candidates == 0 {
        bail!("{}", nothing_in_sight(model, views));
    }
    Ok(visibility.finish())
}

/// What to say where no camera has the model in its image.
fn nothing_in_sight(model: &PriorModel, views: &[View]) -> String {
    let origin = model.mesh().origin;
    let to_model = |p: [f64; 3]| [p[0] + origin.x, p[1] + origin.y, p[2] + origin.z];
    let bounds = |points: &mut dyn Iterator<Item = [f64; 3]>| {
        let limits = points.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
            ([0, 1, 2].map(|i| low[i].min(p[i])), [0, 1, 2].map(|i| high[i].max(p[i])))
        });
        let text = |p: [f64; 3]| format!("({:.0}, {:.0}, {:.0})", p[0], p[1], p[2]);
        format!("{} to {}", text(limits.0), text(limits.1))
    };
    let of_model = bounds(&mut model.mesh().positions.iter().map(|p| to_model(*p)));
    let of_cameras = bounds(&mut views.iter().map(|v| to_model(v.pose.centre)));
    format!(
        "no camera has a building in its image: in the frame of the model the cameras are at {of_cameras}, and the model reaches from \
         {of_model}; say how they lie to one another with --offset or --transform"
    )
}

fn summary(args: &Args, report: &PriorsReport) -> String {
    let at = |name: &str| args.output.join(name).display().to_string();
    format!(
        "points     {} of {} are seen by {} or more of {} views\ndataset    {}\nreport     {}\n",
        report.kept,
        report.samples,
        report.min_views,
        report.views.len(),
        args.output.display(),
        at("report.html"),
    )
}
