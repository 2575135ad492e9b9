//! A thousand height maps from one surface model: `cargo bench --bench heightmaps [-- --tiles N
//! --runs N --folder DIR --out DIR]`.
//!
//! The surface is a formula (gentle hills with gabled houses, see `town`), so its height is known
//! at every pixel of every tile; the surface model is the formula at the centres of 4096 × 4096
//! cells of half a metre. The release binary makes tiles of 518 × 518 pixels at 2 pixels per metre
//! around random places with random headings, on two threads, with each interpolation in turn.
//! Errors against the formula are measured at every 13th pixel of every 20th tile, separately on
//! the walls of houses, which no interpolation can place, and away from them. Seconds, tiles per
//! second and errors go to `benches/results/heightmaps.json` and `.md`; runs with other numbers of
//! tiles or runs are written only with `--out`. `make readme` brings the numbers into the pages.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

#[path = "../common/machine.rs"]
mod machine;
#[path = "../common/places.rs"]
mod places;
mod town;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use crs::{Crs, MapProjection};
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
use raster::{GeoTransform, Grid};
use serde_json::{Value, json};

/// Cells along each side of the surface model.
const CELLS: usize = 4096;
const CELL_M: f64 = 0.5;
/// UTM 31N. The corner is the upper left of the surface model, metres.
const EPSG: u32 = 32631;
const CORNER: (f64, f64) = (693_000.0, 4_824_000.0);
/// Distance of the cameras from the border, metres: more than half the diagonal of a tile of 259 m.
const BORDER_M: f64 = 190.0;
const READINGS: [&str; 3] = ["nearest", "bilinear", "cubic"];
/// Errors are measured at every n-th tile and every n-th pixel of it.
const EVERY: (usize, usize) = (20, 13);
/// A pixel is on a wall when the surface jumps within this distance, metres: the reach of the cubic
/// and half the diagonal of a cell.
const WALL_M: f64 = 1.5;

fn main() -> anyhow::Result<()> {
    let arguments = arguments()?;
    let temporary = tempfile::tempdir()?;
    let folder = arguments.folder.as_deref().unwrap_or(temporary.path());
    std::fs::create_dir_all(folder)?;
    let projection = MapProjection::from_epsg(EPSG)?;
    let (dsm, list) = (folder.join("dsm.tif"), folder.join("cameras.csv"));
    write_surface(&dsm)?;
    write_positions(&list, arguments.tiles, &projection)?;
    let mut seconds: Vec<Vec<[f64; 2]>> = vec![Vec::new(); READINGS.len()];
    let mut errors = Vec::new();
    for run in 0..arguments.runs {
        for (reading, seconds) in READINGS.iter().zip(&mut seconds) {
            let out = folder.join("maps");
            seconds.push(make(&dsm, &list, &out, reading, arguments.tiles)?);
            println!("{reading:8} {:.1} s, {:.1} s of processors", seconds[run][0], seconds[run][1]);
            if run == 0 {
                errors.push(measure(&out, arguments.tiles, &projection)?);
            }
            std::fs::remove_dir_all(&out)?;
        }
    }
    let rows: Vec<Value> =
        READINGS.iter().zip(&mut seconds).zip(&errors).map(|((r, s), e)| row(r, s, e, &arguments)).collect();
    let (tiles, runs) = (arguments.tiles, arguments.runs);
    let machine = machine::machine();
    let result = json!({ "machine": machine, "tiles": tiles, "runs": runs, "threads": 2, "readings": rows });
    let text = markdown(&result);
    println!("{text}");
    if let Some(out) = &arguments.out {
        std::fs::write(out.join("heightmaps.json"), serde_json::to_string_pretty(&result)? + "\n")?;
        std::fs::write(out.join("heightmaps.md"), text)?;
    }
    Ok(())
}

struct Arguments {
    tiles: usize,
    runs: usize,
    folder: Option<PathBuf>,
    out: Option<PathBuf>,
}

fn arguments() -> anyhow::Result<Arguments> {
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/results");
    let mut found = Arguments { tiles: 1000, runs: 3, folder: None, out: Some(results) };
    // Cargo passes `--bench` to every bench.
    let mut given = std::env::args().skip(1).filter(|argument| argument != "--bench");
    let mut out = None;
    while let Some(argument) = given.next() {
        let value = given.next().with_context(|| format!("{argument} wants a value"))?;
        match argument.as_str() {
            "--tiles" => (found.tiles, found.out) = (value.parse()?, None),
            "--runs" => (found.runs, found.out) = (value.parse()?, None),
            "--folder" => found.folder = Some(value.into()),
            "--out" => out = Some(PathBuf::from(value)),
            _ => anyhow::bail!("unknown option {argument}: expected --tiles, --runs, --folder or --out"),
        }
    }
    ensure!(found.tiles > 0 && found.runs > 0, "--tiles and --runs are 1 or more");
    found.out = out.or(found.out);
    Ok(found)
}

fn write_surface(path: &Path) -> anyhow::Result<()> {
    let centre = |k: usize| (k as f64 + 0.5) * CELL_M;
    let cells = (0..CELLS * CELLS).map(|k| town::height(centre(k % CELLS), -centre(k / CELLS)) as f32).collect();
    let heights = Grid::from_vec(CELLS, CELLS, cells).context("as many heights as cells")?;
    let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
    let place = GeoTransform::north_up(CORNER.0, CORNER.1, CELL_M);
    Ok(write_cog(path, &CogRaster { threads: 2, ..CogRaster::new(&bands, place, Crs::ellipsoidal(EPSG)) }, true)?)
}

fn write_positions(path: &Path, tiles: usize, projection: &MapProjection) -> anyhow::Result<()> {
    let inner = CELLS as f64 * CELL_M - 2.0 * BORDER_M;
    let mut text = "lon,lat,heading\n".to_owned();
    for tile in 0..tiles as u64 {
        let [x, y, turn] = [0, 1, 2].map(|k| town::uniform([7, tile, k]));
        let (lon, lat) =
            projection.lonlat_from_map(CORNER.0 + BORDER_M + inner * x, CORNER.1 - BORDER_M - inner * y)?;
        writeln!(text, "{lon},{lat},{}", 360.0 * turn)?;
    }
    Ok(std::fs::write(path, text)?)
}

/// Makes all tiles. Returns wall seconds and processor seconds.
fn make(dsm: &Path, list: &Path, out: &Path, reading: &str, tiles: usize) -> anyhow::Result<[f64; 2]> {
    let (begun, used) = (std::time::Instant::now(), children_seconds()?);
    let mut command = Command::new(places::skysweep());
    command.arg("heightmap").arg(dsm).arg("--positions").arg(list).arg("-o").arg(out);
    command.args(["--interpolation", reading, "--threads", "2", "--progress", "none", "--quiet"]);
    ensure!(command.status()?.success(), "{command:?} failed");
    let seconds = [begun.elapsed().as_secs_f64(), children_seconds()? - used];
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json"))?)?;
    ensure!(report["made"].as_u64() == Some(tiles as u64), "not all tiles were made: {}", report["made"]);
    Ok(seconds)
}

/// Returns the processor seconds of all finished child processes. Linux counts them in hundredths.
fn children_seconds() -> anyhow::Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let (_, fields) = stat.rsplit_once(')').context("no name in /proc/self/stat")?;
    let ticks = fields.split_whitespace().skip(13).take(2).map(str::parse::<f64>).sum::<Result<f64, _>>()?;
    Ok(ticks / 100.0)
}

/// Errors away from walls and on them, metres, sorted.
struct Errors {
    open: Vec<f64>,
    wall: Vec<f64>,
}

fn measure(maps: &Path, tiles: usize, projection: &MapProjection) -> anyhow::Result<Errors> {
    let mut errors = Errors { open: Vec::new(), wall: Vec::new() };
    for tile in (0..tiles).step_by(EVERY.0) {
        let dem = read_dem(maps.join(format!("row_{}.tif", tile + 1)))?;
        let own = MapProjection::from_definition(dem.crs_wkt.as_deref().context("a tile without its map")?)?;
        for k in (0..dem.heights.data().len()).step_by(EVERY.1) {
            let (column, row) = (k % dem.heights.width(), k / dem.heights.width());
            let (x, y) = dem.geotransform.map_from_cell(column as f64, row as f64);
            let (lon, lat) = own.lonlat_from_map(x, y)?;
            let at = projection.map_from_lonlat(lon, lat)?;
            let (x, y) = (at.x - CORNER.0, at.y - CORNER.1);
            let error = (f64::from(dem.heights.data()[k]) - town::height(x, y)).abs();
            ensure!(error.is_finite(), "tile {tile} has no height at {column}, {row}");
            if town::jumps(x, y, WALL_M) { errors.wall.push(error) } else { errors.open.push(error) }
        }
    }
    errors.open.sort_by(f64::total_cmp);
    errors.wall.sort_by(f64::total_cmp);
    Ok(errors)
}

fn row(reading: &str, seconds: &mut [[f64; 2]], errors: &Errors, arguments: &Arguments) -> Value {
    seconds.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let rmse = |e: &[f64]| (e.iter().map(|e| e * e).sum::<f64>() / e.len().max(1) as f64).sqrt();
    let share = |e: &[f64], share: f64| e.get((share * (e.len().max(1) - 1) as f64) as usize).copied();
    let of = |errors: &[f64]| {
        let (median_m, p99_m) = (share(errors, 0.5), share(errors, 0.99));
        json!({ "pixels": errors.len(), "rmse_m": rmse(errors), "median_m": median_m, "p99_m": p99_m })
    };
    let [middle, processors] = seconds[seconds.len() / 2];
    json!({
        "interpolation": reading,
        "seconds": middle,
        "seconds_least_and_most": [seconds[0][0], seconds[seconds.len() - 1][0]],
        "processor_seconds": processors,
        "tiles_per_second": arguments.tiles as f64 / middle,
        "open": of(&errors.open),
        "walls": of(&errors.wall),
    })
}

fn markdown(result: &Value) -> String {
    let mut text = format!(
        "# Height maps: speed against interpolation error\n\n{} tiles of 518 × 518 pixels at 2 px/m, random \
         headings, from one surface \
         model of {CELLS} × {CELLS} cells of {CELL_M} m; whole command, files included, 2 threads; {}; median of {} \
         runs.\n\
         Errors are against the formula that the surface model was sampled from, away from walls and within {WALL_M} \
         m of them.\n\n\
         | interpolation | seconds | CPU s | tiles/s | RMSE m | median m | 99 % m | at walls: RMSE m | median m \
         |\n|---|---|---|---|---|---|---|---|---|\n",
        result["tiles"],
        result["machine"].as_str().unwrap_or_default(),
        result["runs"]
    );
    for row in result["readings"].as_array().into_iter().flatten() {
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        let (open, walls) = (&row["open"], &row["walls"]);
        text += &format!(
            "| {} | {:.1} ({:.1} to {:.1}) | {:.1} | {:.0} | {:.4} | {:.4} | {:.4} | {:.2} | {:.3} |\n",
            row["interpolation"].as_str().unwrap_or_default(),
            number(&row["seconds"]),
            number(&row["seconds_least_and_most"][0]),
            number(&row["seconds_least_and_most"][1]),
            number(&row["processor_seconds"]),
            number(&row["tiles_per_second"]),
            number(&open["rmse_m"]),
            number(&open["median_m"]),
            number(&open["p99_m"]),
            number(&walls["rmse_m"]),
            number(&walls["median_m"]),
        );
    }
    text + "\n    cargo bench --bench heightmaps\n"
}
