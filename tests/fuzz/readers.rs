//! The readers under test, and what is done with what they return: as much as a job would.

use std::error::Error;
use std::path::Path;

use camera::{ImagePoint, Rpc, RpcCamera};
use city::{MeshConfig, TriangleMesh, check_solids};
use cityfiles::{CityJsonOptions, MeshFormat};
use formats::points::{CellLattice, PointCloud};
use formats::raster::ImageSource;
use formats::rpc::RpcFormat;
use geodesy::{LonLatHeight, MapPoint};
use raster::Window;

/// Pixels that are read of an image, on a side.
const SIDE: usize = 256;

/// A reader of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reader {
    Rpc,
    Image,
    Dem,
    City,
    Surface,
    Cloud,
    Colmap,
    Transforms,
    Positions,
    Control,
    GroundPoints,
    Similarity,
    Npy,
    Map,
    Splats,
    Corrections,
    Opened,
    Report,
    Scene,
}

impl Reader {
    pub(crate) const ALL: [Self; 19] = [
        Self::Rpc,
        Self::Image,
        Self::Dem,
        Self::City,
        Self::Surface,
        Self::Cloud,
        Self::Colmap,
        Self::Transforms,
        Self::Positions,
        Self::Control,
        Self::GroundPoints,
        Self::Similarity,
        Self::Npy,
        Self::Map,
        Self::Splats,
        Self::Corrections,
        Self::Opened,
        Self::Report,
        Self::Scene,
    ];
}

type Outcome = Result<(), Box<dyn Error>>;

/// Returns whether a file was read.
fn whether<T, E: Into<Box<dyn Error>>>(found: Result<T, E>) -> Outcome {
    found.map(drop).map_err(Into::into)
}

/// Reads a file and uses the result. Files are written beside it.
pub(crate) fn call(reader: Reader, path: &Path) -> Outcome {
    let folder = path.parent().expect("a file in a folder");
    match reader {
        Reader::Rpc => use_rpc(&formats::rpc::read(path)?.rpc),
        Reader::Image => image(path),
        Reader::Dem => whether(formats::raster::read_dem(path)),
        Reader::City => city_model(path, folder),
        Reader::Surface => whether(cityfiles::surfaces::read(path, &MeshConfig::default())),
        Reader::Cloud => {
            let anchor = MapPoint { x: 0.0, y: 0.0 };
            let cloud = PointCloud::open(path)?;
            let grid = cloud.highest(CellLattice { cell_x: 1.0, cell_y: 1.0, anchor });
            PointCloud::open(path)?.positions(1_000_000)?;
            whether(grid)
        }
        Reader::Colmap => {
            let (model, points) = formats::colmap::read_with_points(folder)?;
            let encoding = formats::colmap::ColmapEncoding::Binary;
            std::fs::create_dir_all(folder.join("again"))?;
            Ok(formats::colmap::write(&folder.join("again"), &model, &points, encoding, true)?)
        }
        Reader::Transforms => whether(formats::transforms::read(path, Some([64, 48]))),
        Reader::Positions => whether(formats::positions::read_positions(path)),
        Reader::Control => whether(formats::control::read(path)),
        Reader::GroundPoints => whether(formats::ground_points::read_ground_points(path)),
        Reader::Similarity => whether(formats::similarity::read(path)),
        Reader::Npy => whether(formats::npy::read(path)),
        Reader::Map => whether(formats::maps::read(path)),
        Reader::Splats => {
            formats::splat_ply::LocalOrigin::read_beside(path)?;
            whether(formats::splat_files::read(path))
        }
        Reader::Corrections => whether(jobs::corrections::Corrections::read(path)),
        Reader::Opened => opened(path),
        Reader::Report => {
            let text = formats::read_regular_text(path, 1 << 26)?;
            whether(serde_json::from_str::<jobs::dsm::DsmReport>(&text))
        }
        Reader::Scene => Ok(simulate::SimulationConfig::from_toml(&std::fs::read_to_string(path)?)?.validate()?),
    }
}

fn use_rpc(rpc: &Rpc) -> Outcome {
    for format in [RpcFormat::Text, RpcFormat::Rpb, RpcFormat::Json] {
        formats::rpc::to_text(rpc, format)?;
    }
    let camera = RpcCamera::new(rpc.clone());
    for height_m in [rpc.height_off, -400.0, 0.0, 9000.0, 1e308] {
        for at in [0.0, 0.5, 1e4, -1e9] {
            let _ = camera.localize(ImagePoint::new(at, 2.0 * at), height_m);
            let _ = camera.project(LonLatHeight::new(rpc.long_off + at, rpc.lat_off - at, height_m));
        }
    }
    Ok(())
}

fn image(path: &Path) -> Outcome {
    let source = ImageSource::open(path)?;
    let _ = (source.metadata("RPC"), source.metadata(""));
    let (width, height) = (source.info().width, source.info().height);
    let corners = [(0, 0), (width.saturating_sub(SIDE), height.saturating_sub(SIDE))];
    for (x, y) in corners {
        let window = Window { x: x as i64, y: y as i64, width: SIDE.min(width), height: SIDE.min(height) };
        source.read_luma(window)?;
        source.read_samples(1, window)?;
    }
    use_rpc(&formats::rpc::read_for_image(path)?.rpc)
}

fn city_model(path: &Path, folder: &Path) -> Outcome {
    let file = cityfiles::read(path)?;
    let config = MeshConfig::default();
    let meshed = TriangleMesh::from_model(&file.model, &config)?;
    check_solids(&file.model, &config)?;
    for (format, name) in [(MeshFormat::Obj, "o.obj"), (MeshFormat::Ply, "o.ply"), (MeshFormat::Glb, "o.glb")] {
        let _ = cityfiles::write_mesh(&folder.join(name), &file.model, &meshed.mesh, format, true);
    }
    let _ = cityfiles::write_footprints(&folder.join("o.geojson"), &file.model, &meshed.objects, true);
    let options = CityJsonOptions { overwrite: true, ..CityJsonOptions::default() };
    let _ = cityfiles::write_cityjson(&folder.join("o.city.json"), &file.model, &options);
    Ok(())
}

/// The images of a stage that was written to a file, and a view of their geometry.
fn opened(path: &Path) -> Outcome {
    let opened: jobs::dsm::Opened = serde_json::from_str(&formats::read_regular_text(path, 1 << 26)?)?;
    for image in &opened.images {
        image.camera.rpc.validate()?;
        let _ = image.camera.localize(ImagePoint::new(0.0, 0.0), image.camera.rpc.height_off);
    }
    Ok(())
}
