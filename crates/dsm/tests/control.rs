//! Ground control: a few points place the block in the world, check points measure how well, and
//! the pointing of one run is where another one starts.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use dsm::{CorrectionOrder, DsmConfig, DsmError, HeightRange, Pointed, Preset, Session, open, point};
use geodesy::LonLatHeight;
use numeric::Silent;

fn town(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town")).join(name)
}

/// A delivered RPC and its pointing error, which `scene.json` states: delivered = error(true).
struct View {
    name: String,
    delivered: RpcCamera,
    error: ImageCorrection,
}

impl View {
    fn all() -> Vec<View> {
        let text = std::fs::read_to_string(town("scene.json")).unwrap();
        let scene: serde_json::Value = serde_json::from_str(&text).unwrap();
        let view = |i: usize| {
            let name = format!("view_{}.tif", i + 1);
            let delivered = RpcCamera::new(formats::rpc::read_for_image(&town(&name)).unwrap().rpc);
            let error = serde_json::from_value(scene["views"][i]["pointing"].clone()).unwrap();
            View { name, delivered, error }
        };
        (0..3).map(view).collect()
    }

    /// The place at which the image shows a ground point.
    fn shows(&self, ground: LonLatHeight) -> ImagePoint {
        self.error.invert(self.delivered.project(ground).unwrap()).unwrap()
    }
}

/// A number between −1 and 1 that follows from its position.
fn noise(i: usize) -> f64 {
    ((i * 7919 + 13) % 1999) as f64 / 999.5 - 1.0
}

/// Writes ground points spread over the town, of which every other one is a check point. Positions
/// have an error of up to a tenth of a metre along each axis, places of up to `place_px`.
fn write_points(path: &Path, views: &[View], place_px: f64) {
    let mut text = "name,lon,lat,height,accuracy_m,pixel_px,role,image,sample,line\n".to_owned();
    let middle = views[1].delivered.localize(ImagePoint::new(380.0, 380.0), 200.0).unwrap();
    for i in 0..10 {
        let (east_m, north_m) =
            ([-90.0, 80.0, -5.0, -85.0, 88.0][i % 5], [-88.0, -80.0, 10.0, 84.0, 92.0][(i + i / 5) % 5]);
        let height_m = 190.0 + 7.0 * (i % 6) as f64;
        let metre = 1.0 / 111_320.0;
        let place = |east: f64, north: f64, up: f64| {
            let lon = middle.lon_deg + east * metre / middle.lat_deg.to_radians().cos();
            LonLatHeight::new(lon, middle.lat_deg + north * metre, up)
        };
        let at = place(east_m, north_m, height_m);
        let surveyed =
            place(east_m + 0.1 * noise(3 * i), north_m + 0.1 * noise(3 * i + 1), height_m + 0.1 * noise(3 * i + 2));
        let role = if i % 2 == 0 { "control" } else { "check" };
        for (v, view) in views.iter().enumerate() {
            let p = view.shows(at);
            let (sample, line) =
                (p.sample + place_px * noise(100 + 6 * i + v), p.line + place_px * noise(400 + 6 * i + v));
            let LonLatHeight { lon_deg, lat_deg, height_m } = surveyed;
            writeln!(text, "p{i},{lon_deg},{lat_deg},{height_m},0.1,0.3,{role},{},{sample},{line}", view.name).unwrap();
        }
    }
    std::fs::write(path, text).unwrap();
}

fn config(folder: &Path) -> DsmConfig {
    let images = [1, 2, 3].map(|i| town(&format!("view_{i}.tif"))).to_vec();
    let mut config = DsmConfig::new(images, folder.join("out"));
    (config.preset, config.gsd_m) = (Preset::Fast, Some(2.0));
    config.height_range_m = Some(HeightRange::new(170.0, 280.0));
    config
}

fn pointed(config: &DsmConfig) -> Pointed {
    point(config, &open(config).unwrap(), &mut Session::new(&Silent)).unwrap()
}

/// Five control points of a tenth of a metre bring the errors at five others below a pixel of half
/// a metre. Without them the common error of all images stays.
#[test]
fn five_control_points_place_the_town() {
    const GSD_M: f64 = 0.5;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    write_points(&path, &View::all(), 0.3);
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let with = pointed(&config).pointing.control.unwrap();
    assert_eq!((with.control.len(), with.checks.len(), with.unmeasured), (5, 5, 0));
    let (ce90, le90) = (with.ce90_m.unwrap(), with.le90_m.unwrap());
    assert!(ce90 <= GSD_M && le90 <= GSD_M, "CE90 {ce90} m, LE90 {le90} m");
    assert!(with.control.iter().all(|point| point.residual < 3.0), "{:?}", with.control);
    // All points only measure.
    let text = std::fs::read_to_string(&path).unwrap().replace(",control,", ",check,");
    std::fs::write(&path, text).unwrap();
    let without = pointed(&config).pointing.control.unwrap();
    assert_eq!((without.control.len(), without.checks.len()), (0, 10));
    let worst = without.ce90_m.unwrap().max(without.le90_m.unwrap());
    assert!(worst > 2.0 * ce90.max(le90), "{worst} without, {ce90} and {le90} with");
}

#[test]
fn a_wrong_control_point_is_named_and_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let views = View::all();
    write_points(&path, &views, 0.2);
    // The height of the first point is above another datum.
    let text = std::fs::read_to_string(&path).unwrap();
    let moved = |line: &str| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if fields[0] == "p0" {
            fields[3] = (fields[3].parse::<f64>().unwrap() + 49.0).to_string();
        }
        fields.join(",")
    };
    std::fs::write(&path, text.lines().map(moved).collect::<Vec<_>>().join("\n")).unwrap();
    let mut config = config(folder.path());
    config.control = Some(path);
    let pointed = pointed(&config);
    let named =
        pointed.warnings.iter().filter(|warning| warning.contains("control point") && warning.ends_with(": p0"));
    assert_eq!(named.count(), 1, "{:?}", pointed.warnings);
    let report = pointed.pointing.control.unwrap();
    assert!(report.ce90_m.unwrap() < 0.5 && report.le90_m.unwrap() < 0.5, "{report:?}");
}

/// Rewrites the rows of some points of a file: name, longitude, latitude and height.
fn rewrite(path: &Path, change: impl Fn(&str, &mut [f64; 3])) {
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let Ok(height) = fields[3].parse::<f64>() else { return line.to_owned() };
        let mut place = [fields[1].parse().unwrap(), fields[2].parse().unwrap(), height];
        change(fields[0], &mut place);
        let [lon, lat, height] = place;
        format!("{},{lon},{lat},{height},{}", fields[0], fields[4..].join(","))
    };
    std::fs::write(path, text.lines().map(row).collect::<Vec<_>>().join("\n")).unwrap();
}

/// One point of five that is off by 2.5 m is left out: the scene stays where the other four put it.
/// Neither it nor a position beside the scene is blamed on an RPC.
#[test]
fn one_wrong_point_of_five_moves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let views = View::all();
    let run = |change: &dyn Fn(&str, &mut [f64; 3])| {
        write_points(&path, &views, 0.2);
        rewrite(&path, change);
        pointed(&config)
    };
    let good = run(&|_, _| {});
    assert!(good.warnings.is_empty(), "{:?}", good.warnings);
    assert!(good.pointing.control.as_ref().unwrap().control.iter().all(|point| point.used));
    let height_m = |pointed: &Pointed| {
        let cameras: Vec<RpcCamera> = pointed.images.iter().map(|image| image.camera.clone()).collect();
        let at = views[1].delivered.localize(ImagePoint::new(320.0, 320.0), 200.0).unwrap();
        let track = (0..3).map(|view| (view, views[view].shows(at))).collect();
        sweep::pointing::ground_of(&cameras, &track).unwrap().height_m
    };
    let height = run(&|name, place| place[2] += if name == "p4" { 2.5 } else { 0.0 });
    let beside = run(&|name, place| place[0] += if name == "p4" { 0.5 } else { 0.0 });
    for (wrong, why) in [(height, "its height is off by"), (beside, "outside of all images")] {
        let control = wrong.pointing.control.as_ref().unwrap();
        let point = control.control.iter().find(|point| point.name == "p4").unwrap();
        assert!(!point.used && point.reason.as_ref().unwrap().contains(why), "{point:?}");
        assert_eq!(control.control.iter().filter(|point| point.used).count(), 4);
        let [warning] = &wrong.warnings[..] else { panic!("{:?}", wrong.warnings) };
        assert!(warning.contains("p4") && !warning.contains("RPC"), "{warning}");
        let moved_m = height_m(&wrong) - height_m(&good);
        assert!(moved_m.abs() < 0.1, "{moved_m}");
    }
}

/// Coordinates, units and datums that do not fit the images are refused or named, with the cause.
#[test]
fn points_with_other_axes_units_or_datums_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let views = View::all();
    let geoid = crs::HeightConverter::new(crs::VerticalDatum::Egm96).unwrap();
    let run = |change: &dyn Fn(&str, &mut [f64; 3])| {
        write_points(&path, &views, 0.2);
        rewrite(&path, change);
        point(&config, &open(&config).unwrap(), &mut Session::new(&Silent))
    };
    type Change<'a> = &'a dyn Fn(&str, &mut [f64; 3]);
    let refused: [(Change<'_>, &str); 4] = [
        (&|_, place| place.swap(0, 1), "coordinates exchanged"),
        (&|_, place| place[0] += 1.0, "outside of all images"),
        (&|_, place| place[2] /= 0.3048, "in feet they would fit"),
        (&|_, place| place[2] += 300.0, "check their unit and what they are above"),
    ];
    for (change, words) in refused {
        let error = run(change).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("points.csv"), "{words}: {error}");
    }
    let above_geoid = |place: &mut [f64; 3]| {
        place[2] -= geoid.ellipsoid_from_datum(place[0], place[1], 0.0).unwrap();
    };
    let named: [(Change<'_>, &str); 2] = [
        (&|_, place| above_geoid(place), "above the EGM96 geoid (mean sea level) they would fit"),
        (&|_, place| place[2] += 29.0, "where RPCs usually err by"),
    ];
    for (change, words) in named {
        let warnings = run(change).unwrap().warnings;
        let [warning] = &warnings[..] else { panic!("{words}: {warnings:?}") };
        assert!(warning.contains(words), "{warning}");
    }
}

/// The pointing of a run is written into its report. A later run with other images starts from it.
#[test]
fn a_later_run_starts_from_saved_pointing() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(folder.path());
    let first = pointed(&config);
    assert_eq!(first.pointing.order, CorrectionOrder::Translation);
    let image = |image: &dsm::SceneImage| serde_json::json!({ "path": image.path, "applied_correction": image.camera.correction });
    let saved = serde_json::json!({ "images": first.images.iter().map(image).collect::<Vec<_>>() });
    let path = folder.path().join("pointing.json");
    std::fs::write(&path, saved.to_string()).unwrap();
    config.corrections = Some(path.clone());
    let second = pointed(&config);
    assert_eq!(second.pointing.order, CorrectionOrder::None);
    assert!(second.pointing.residual_before_px < 0.3, "{:?}", second.pointing);
    let shift = |pointed: &Pointed, i: usize| pointed.images[i].camera.correction.translation_px;
    for i in 0..3 {
        let (a, b) = (shift(&first, i), shift(&second, i));
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.2, "{a:?} {b:?}");
    }
    // Without an adjustment it is used as it is.
    config.pointing = false;
    let third = pointed(&config);
    for i in 0..3 {
        assert_eq!(shift(&first, i), shift(&third, i));
    }
    std::fs::write(&path, "[]").unwrap();
    let refused = point(&config, &open(&config).unwrap(), &mut Session::new(&Silent));
    assert!(matches!(refused, Err(DsmError::Corrections(_))));
}

/// A ground point on level, open ground of the town, with the relief around it.
struct OpenPlace {
    ground: LonLatHeight,
    relief_m: f64,
}

/// Finds the most level places of the true surface, one in each field of a lattice.
fn open_places(count: usize) -> Vec<OpenPlace> {
    const AROUND: usize = 30;
    let truth = formats::raster::read_dem(town("truth/dsm.tif")).unwrap();
    let projection = crs::MapProjection::from_epsg(truth.horizontal_epsg.unwrap()).unwrap();
    let (width, height) = (truth.heights.width(), truth.heights.height());
    // Greatest distance of the surroundings from the plane that fits them best.
    let relief = |column: usize, row: usize| {
        let reach = -(AROUND as isize)..=AROUND as isize;
        let cells = reach.clone().flat_map(|y| reach.clone().map(move |x| [x, y]));
        let height =
            |[x, y]: [isize; 2]| f64::from(truth.heights[(column.wrapping_add_signed(x), row.wrapping_add_signed(y))]);
        let sums = cells.clone().map(|at| (height(at), at.map(|v| v as f64), 1.0));
        let [n, sum, along_x, along_y, square] =
            sums.fold([0.0; 5], |s, (h, [x, y], one)| [s[0] + one, s[1] + h, s[2] + x * h, s[3] + y * h, s[4] + x * x]);
        let plane = |[x, y]: [isize; 2]| sum / n + along_x / square * x as f64 + along_y / square * y as f64;
        cells.map(|at| (height(at) - plane(at)).abs()).fold(0.0, f64::max)
    };
    const FIELDS: usize = 5;
    let part = |i: usize, size: usize| {
        let side = (size - 4 * AROUND) / FIELDS;
        (2 * AROUND + i * side..2 * AROUND + (i + 1) * side).step_by(4)
    };
    let mut found: Vec<OpenPlace> = (0..FIELDS * FIELDS)
        .map(|field| {
            let cells = part(field / FIELDS, height)
                .flat_map(|row| part(field % FIELDS, width).map(move |column| (column, row)));
            let level = |&(column, row): &(usize, usize)| relief(column, row);
            let (column, row) = cells.min_by(|a, b| level(a).total_cmp(&level(b))).unwrap();
            let (x, y) = truth.geotransform.map_from_cell(column as f64, row as f64);
            let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
            let ground = LonLatHeight::new(lon, lat, f64::from(truth.heights[(column, row)]));
            OpenPlace { ground, relief_m: relief(column, row) }
        })
        .collect();
    found.sort_by(|a, b| a.relief_m.total_cmp(&b.relief_m));
    found.truncate(count);
    found
}

/// Cuts a chip of 35 × 35 pixels out of the second view, with its RPC or without. Returns the place
/// of the point in it.
fn cut_chip(path: &Path, view: &View, ground: LonLatHeight, with_rpc: bool) -> ImagePoint {
    use formats::raster::{Band, BandData, ImageSource, write_image_with_rpc};
    let at = view.shows(ground);
    let corner = [at.sample, at.line].map(|v| v.round() - 17.0);
    let window = raster::Window { x: corner[0] as i64, y: corner[1] as i64, width: 35, height: 35 };
    let pixels = ImageSource::open(town(&view.name)).unwrap().read_samples(1, window).unwrap().map(|v| *v as u16);
    let bands = [Band { data: BandData::U16(&pixels), description: "grey" }];
    let origin = ImagePoint::new(corner[0], corner[1]);
    if with_rpc {
        write_image_with_rpc(path, &bands, &view.delivered.rpc.cropped(origin), None, true).unwrap();
    } else {
        formats::raster::write_map(path, &bands, None, &[], true).unwrap();
    }
    ImagePoint::new(at.sample - corner[0], at.line - corner[1])
}

/// Chips from one view are found in the others in spite of the pointing errors, and place the town
/// as measured places do.
#[test]
fn chips_are_found_in_the_other_views() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let views = View::all();
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let places = open_places(6);
    let mut text =
        "name,lon,lat,height,accuracy_m,pixel_px,role,image,sample,line,chip,chip_sample,chip_line\n".to_owned();
    for (i, OpenPlace { ground, .. }) in places.iter().enumerate() {
        let chip = cut_chip(&folder.path().join(format!("{i}.tif")), &views[1], *ground, true);
        let role = if i % 2 == 0 { "control" } else { "check" };
        let (LonLatHeight { lon_deg, lat_deg, height_m }, ImagePoint { sample, line }) = (*ground, chip);
        let row = format!("p{i},{lon_deg},{lat_deg},{height_m},0.1,0.2,{role},,,,{i}.tif,{sample},{line}");
        writeln!(text, "{row}").unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let found = pointed(&config);
    let report = found.pointing.control.unwrap();
    assert_eq!((report.control.len(), report.checks.len(), report.chips.len()), (3, 3, 3 * places.len()));
    let mut worst = 0.0f64;
    for chip in &report.chips {
        let number: usize = chip.name[1..].parse().unwrap();
        let view = views.iter().find(|view| view.name == chip.image).unwrap();
        let (at, true_at) = (chip.place.unwrap_or_else(|| panic!("{chip:?}")), view.shows(places[number].ground));
        worst = worst.max((at.sample - true_at.sample).hypot(at.line - true_at.line));
    }
    assert!(worst < 0.1, "{worst} px: {:?}", report.chips);
    let (ce90, le90) = (report.ce90_m.unwrap(), report.le90_m.unwrap());
    assert!(ce90 < 0.5 && le90 < 0.5, "CE90 {ce90} m, LE90 {le90} m");
}

/// A chip is found in the image it comes from also without an RPC; what is not found is named.
#[test]
fn chips_that_are_not_found_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let views = View::all();
    let places = open_places(2);
    let (here, there) = (places[0].ground, places[1].ground);
    let chip = cut_chip(&folder.path().join("a.tif"), &views[1], here, false);
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let write = |ground: LonLatHeight, at: ImagePoint| {
        let LonLatHeight { lon_deg, lat_deg, height_m } = ground;
        let (place, ImagePoint { sample, line }) = (views[0].shows(ground), at);
        let text = format!(
            "name,lon,lat,height,accuracy_m,image,sample,line,chip,chip_sample,chip_line\n\
             a,{lon_deg},{lat_deg},{height_m},0.1,view_1.tif,{},{},a.tif,{sample},{line}\n",
            place.sample, place.line
        );
        std::fs::write(&path, text).unwrap();
    };
    write(here, chip);
    let report = pointed(&config).pointing.control.unwrap();
    let own = report.chips.iter().find(|chip| chip.image == "view_2.tif").unwrap();
    assert!(own.score.unwrap() > 0.95 && report.chips.iter().all(|chip| chip.image != "view_1.tif"), "{report:?}");
    // The chip of another place.
    write(there, chip);
    let found = pointed(&config);
    let report = found.pointing.control.unwrap();
    assert!(report.chips.iter().all(|chip| chip.place.is_none() && chip.reason.is_some()), "{:?}", report.chips);
    let named =
        found.warnings.iter().filter(|text| text.contains("the chip of the ground point a is not found in 2 of 2"));
    assert_eq!(named.count(), 1, "{:?}", found.warnings);
    // A place outside of the chip.
    write(here, ImagePoint::new(35.5, 3.0));
    let refused = point(&config, &open(&config).unwrap(), &mut Session::new(&Silent)).unwrap_err();
    assert!(refused.to_string().contains("inside of the 35 x 35 pixels of the chip"), "{refused}");
}

#[test]
fn points_outside_of_the_images_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    std::fs::write(&path, "name,lon,lat,height,accuracy_m,image,sample,line\na,5,43,2,1,other.tif,3,4\n").unwrap();
    let mut config = config(folder.path());
    config.control = Some(path.clone());
    let refused = point(&config, &open(&config).unwrap(), &mut Session::new(&Silent)).unwrap_err();
    assert!(refused.to_string().contains("without a place in an image of the run"), "{refused}");
    std::fs::write(&path, "name,lon,lat,height,accuracy_m,image,sample,line\na,5,43,2,1,view_2.tif,3,-4e9\n").unwrap();
    let refused = point(&config, &open(&config).unwrap(), &mut Session::new(&Silent)).unwrap_err();
    assert!(refused.to_string().contains("a at sample 3, line -4000000000 of view_2.tif"), "{refused}");
    std::fs::write(&path, "name,lon\n").unwrap();
    let refused = point(&config, &open(&config).unwrap(), &mut Session::new(&Silent)).unwrap_err();
    assert!(matches!(refused, DsmError::Control(_)), "{refused}");
}
