//! Whole simulations: the renderer against an independent projection and an independent ray caster,
//! determinism, dates, and what each preset promises.

use camera::ImagePoint;
use nalgebra::Vector3;
use raster::Grid;
use simulate::{
    CameraModel, CloudsConfig, CrownForm, LookAngles, SeasonsConfig, SensorConfig, SimulatedView, Simulation,
    SimulationConfig, TREE_NUMBER, TruthClass, VegetationConfig, VehiclesConfig,
};

fn small(preset: &str) -> SimulationConfig {
    SimulationConfig { size_m: 120.0, gsd_m: 1.0, seed: 6, ..SimulationConfig::preset(preset).unwrap() }
}

fn in_threads(threads: usize) -> Simulation {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut config = small("town");
    config.clouds.share = 0.1;
    pool.install(|| Simulation::new(config)).unwrap()
}

#[test]
fn a_seed_gives_one_simulation_whatever_the_threads() {
    let (one, three) = (in_threads(1), in_threads(3));
    assert_eq!(one.truth.dsm, three.truth.dsm);
    assert!(one.truth.visibility == three.truth.visibility && one.truth.ortho == three.truth.ortho);
    for (a, b) in one.views.iter().zip(&three.views) {
        assert!(a.image == b.image && a.rpc == b.rpc && a.heights == b.heights && a.clouds == b.clouds);
    }
    let other = Simulation::new(SimulationConfig { seed: 7, ..small("town") }).unwrap();
    assert_ne!(one.truth.dsm, other.truth.dsm);
}

#[test]
fn the_truth_is_the_height_function_on_the_map() {
    let simulation = Simulation::new(small("town")).unwrap();
    let truth = &simulation.truth;
    let [x0, y0] = simulation.frame.origin_m();
    for (column, row) in [(0, 0), (119, 119), (60, 60), (31, 88)] {
        let (x, y) = truth.geotransform.map_from_cell(column as f64, row as f64);
        let (height, class) = simulation.scene.surface(x - x0, y - y0);
        let ground = simulation.scene.terrain().height(x - x0, y - y0);
        assert!((f64::from(truth.dsm[(column, row)]) - height).abs() < 5e-4);
        assert!((f64::from(truth.dtm[(column, row)]) - ground).abs() < 5e-4);
        assert!([class as u8, TruthClass::FootprintEdge as u8].contains(&truth.classes[(column, row)]));
    }
    let count = |class: TruthClass| truth.classes.data().iter().filter(|c| **c == class as u8).count();
    assert!((1000..8000).contains(&count(TruthClass::Building)), "{}", count(TruthClass::Building));
    assert!(count(TruthClass::FootprintEdge) > 300 && count(TruthClass::Vegetation) > 50);
    assert!(truth.dsm.data().iter().zip(truth.dtm.data()).all(|(s, t)| s >= t));
}

/// The first point under the surface on the segment from `from` to `to`, by brute force.
fn is_blocked(simulation: &Simulation, from: Vector3<f64>, to: Vector3<f64>) -> bool {
    let steps = ((to - from).norm() / 0.02) as usize;
    (0..steps).map(|k| from.lerp(&to, k as f64 / steps as f64)).any(|p| p.z < simulation.scene.surface(p.x, p.y).0)
}

#[test]
fn what_a_view_does_not_see_is_what_a_brute_force_ray_caster_calls_hidden() {
    for preset in ["town", "high-rise", "hills"] {
        // Without vehicles the scene of the date is the permanent one.
        let mut config = SimulationConfig { size_m: 100.0, ..small(preset) };
        config.vehicles.parked_share = 0.0;
        let simulation = Simulation::new(config).unwrap();
        let (_, high) = simulation.scene.height_range_m();
        let ([x0, y0], truth) = (simulation.frame.origin_m(), &simulation.truth);
        let (mut counts, mut wrong) = ([0; 2], 0);
        for (view, seen) in simulation.views.iter().zip(&truth.visibility) {
            let to_sensor = view.record.look.towards_sensor();
            for k in 0..2500 {
                let (column, row) = ((k % 50) * 2, (k / 50) * 2);
                let (x, y) = truth.geotransform.map_from_cell(column as f64, row as f64);
                let (x, y) = (x - x0, y - y0);
                let point = Vector3::new(x, y, simulation.scene.surface(x, y).0);
                // Grid north is not north: the convergence of the meridian turns the direction of
                // the look.
                let above = simulation.frame.ground_from_scene(point).unwrap();
                let at = view.true_rpc.project(above).unwrap();
                let up = view.true_rpc.localize(at, high + 1.0).unwrap();
                let up = simulation.frame.scene_from_ground(up).unwrap();
                assert!((up - point).normalize().dot(&to_sensor) > 0.999);
                let lifted = point + (up - point).normalize() * 0.05;
                let visible = !is_blocked(&simulation, lifted, up);
                counts[usize::from(visible)] += 1;
                wrong += usize::from(visible != (seen[(column, row)] == 1));
            }
        }
        assert!(counts[0] > 100 && counts[1] > 2000, "{preset}: {counts:?}");
        // Rays that graze a crown or a corner within the march's step.
        assert!(wrong * 500 < counts[0] + counts[1], "{preset}: {wrong} of {counts:?} differ");
    }
}

/// What a patch of ground around a scene point looks like from a view's RPC: the ortho truth,
/// shaded by nothing.
fn expected_patch(simulation: &Simulation, centre: (usize, usize), radius: usize) -> Vec<f64> {
    let ortho = &simulation.truth.ortho;
    let mut patch = Vec::new();
    for row in centre.1 - radius..=centre.1 + radius {
        for column in centre.0 - radius..=centre.0 + radius {
            patch.push(f64::from(ortho[(column, row)]));
        }
    }
    patch
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - ma) * (y - mb);
        aa += (x - ma) * (x - ma);
        bb += (y - mb) * (y - mb);
    }
    ab / (aa * bb).sqrt().max(1e-12)
}

/// Where the ortho patch around a cell is found in a view, relative to where the true RPC projects
/// it, pixels.
fn found_offset(
    simulation: &Simulation,
    view: &SimulatedView,
    image: &Grid<f32>,
    cell: (usize, usize),
) -> Option<[f64; 2]> {
    const RADIUS: usize = 6;
    let truth = &simulation.truth;
    let [x0, y0] = simulation.frame.origin_m();
    let expected = expected_patch(simulation, cell, RADIUS);
    let mut positions = Vec::new();
    for row in cell.1 - RADIUS..=cell.1 + RADIUS {
        for column in cell.0 - RADIUS..=cell.0 + RADIUS {
            let (x, y) = truth.geotransform.map_from_cell(column as f64, row as f64);
            let point = Vector3::new(x - x0, y - y0, f64::from(truth.dsm[(column, row)]));
            let ground = simulation.frame.ground_from_scene(point).ok()?;
            positions.push(view.true_rpc.project(ground).ok()?);
        }
    }
    let score = |ds: f64, dl: f64| {
        let seen: Vec<f64> =
            positions.iter().map(|p| f64::from(raster::bicubic(image, p.sample + ds, p.line + dl))).collect();
        if seen.iter().any(|v| v.is_nan()) { f64::NAN } else { correlation(&expected, &seen) }
    };
    let (mut best, mut at) = (f64::NEG_INFINITY, [0.0; 2]);
    for k in 0..625 {
        let (ds, dl) = (f64::from(k % 25) * 0.05 - 0.6, f64::from(k / 25) * 0.05 - 0.6);
        let value = score(ds, dl);
        if value > best {
            (best, at) = (value, [ds, dl]);
        }
    }
    // Patches in which a shadow's edge or a lack of texture decides the score say nothing about the
    // geometry.
    if best < 0.8 {
        return None;
    }
    let peak = |minus: f64, plus: f64| 0.5 * 0.05 * (minus - plus) / (minus - 2.0 * best + plus);
    let s = at[0] + peak(score(at[0] - 0.05, at[1]), score(at[0] + 0.05, at[1]));
    let l = at[1] + peak(score(at[0], at[1] - 0.05), score(at[0], at[1] + 0.05));
    Some([s, l])
}

#[test]
fn truth_points_are_found_in_the_views_where_they_project() {
    for camera in [CameraModel::Pushbroom, CameraModel::Frame] {
        // Flat points under a high sun without buildings: only the geometry can move them.
        let mut config =
            SimulationConfig { size_m: 200.0, gsd_m: 0.5, seed: 3, ..SimulationConfig::preset("fields").unwrap() };
        config.surface.cover = simulate::GroundCover::Town;
        config.vegetation.trees_per_ha = 0.0;
        config.acquisition.camera = camera;
        config.acquisition.looks = vec![
            LookAngles { incidence_deg: 24.0, azimuth_deg: 20.0 },
            LookAngles { incidence_deg: 3.0, azimuth_deg: 100.0 },
            LookAngles { incidence_deg: 18.0, azimuth_deg: 230.0 },
        ];
        let simulation = Simulation::new(config).unwrap();
        for view in &simulation.views {
            let image = view.image.map(|dn| f32::from(*dn));
            let mut offsets = [Vec::new(), Vec::new()];
            for k in 0..225 {
                let cell = (20 + (k % 15) * 25, 20 + (k / 15) * 25);
                if let Some([s, l]) = found_offset(&simulation, view, &image, cell) {
                    offsets[0].push(s);
                    offsets[1].push(l);
                }
            }
            assert!(offsets[0].len() > 150, "{camera:?}: only {} patches found", offsets[0].len());
            for axis in &mut offsets {
                axis.sort_unstable_by(f64::total_cmp);
                let median = axis[axis.len() / 2];
                let within = axis.iter().filter(|o| o.abs() < 0.1).count();
                assert!(median.abs() < 0.02, "{camera:?}: median bias {median} px");
                assert!(within * 100 > axis.len() * 95, "{camera:?}: {within} of {} within 0.1 px", axis.len());
            }
        }
    }
}

#[test]
fn image_heights_project_back_to_their_pixels() {
    let simulation = Simulation::new(small("high-rise")).unwrap();
    for view in &simulation.views {
        for k in 0..400 {
            let (column, row) = (10 + (k % 20) * 5, 10 + (k / 20) * 5);
            let height = f64::from(view.heights[(column, row)]);
            let at = ImagePoint::new(column as f64, row as f64);
            let point = simulation.frame.scene_from_ground(view.true_rpc.localize(at, height).unwrap()).unwrap();
            let ray = view.sight().ray(at);
            let along = ray.at((height - ray.origin.z) / ray.direction.z);
            assert!((along - point).norm() < 0.005, "{} m beside the ray", (along - point).norm());
        }
    }
}

#[test]
fn views_converge_and_every_rpc_points_a_little_wrong() {
    let mut config = SimulationConfig { views: 5, ..small("town") };
    config.acquisition.pointing_drift_px = 0.8;
    let simulation = Simulation::new(config).unwrap();
    let tangent = |v: &SimulatedView| v.record.look.towards_sensor() / v.record.look.towards_sensor().z;
    let base = (tangent(&simulation.views[0]) - tangent(&simulation.views[4])).norm();
    assert!((base - 2.0 * 16.5_f64.to_radians().tan()).abs() < 0.02, "base over height {base}");
    for view in &simulation.views {
        let [sample, line] = view.record.pointing_error_px;
        assert!((1.0..=3.0).contains(&sample.hypot(line)));
        assert!(view.record.rpc_fit_error_px < 1e-3, "{} px", view.record.rpc_fit_error_px);
        let (width, height) = (view.image.width() as f64, view.image.height() as f64);
        let shift = |at: ImagePoint| {
            let ground = view.true_rpc.localize(at, 180.0).unwrap();
            let given = view.rpc.project(ground).unwrap();
            Vector3::new(given.sample - at.sample, given.line - at.line, 0.0)
        };
        let middle = shift(ImagePoint::new((width - 1.0) / 2.0, (height - 1.0) / 2.0));
        assert!((middle - Vector3::new(sample, line, 0.0)).norm() < 1e-6);
        let drift = shift(ImagePoint::new(width / 2.0, height - 1.0)) - shift(ImagePoint::new(width / 2.0, 0.0));
        assert!((drift.norm() - 0.8).abs() < 1e-3, "a drift of {} px", drift.norm());
    }
}

fn quantile(image: &Grid<u16>, q: f64) -> u16 {
    let mut values = image.data().to_vec();
    values.sort_unstable();
    values[(q * (values.len() - 1) as f64) as usize]
}

#[test]
fn images_use_their_range_without_saturating_and_low_texture_does_not() {
    for bits in [8, 11, 12] {
        let sensor = SensorConfig { bits, ..SensorConfig::default() };
        let simulation = Simulation::new(SimulationConfig { sensor, ..small("town") }).unwrap();
        let top = (1u16 << bits) - 1;
        for view in &simulation.views {
            assert!(quantile(&view.image, 0.99) < top && quantile(&view.image, 1.0) <= top);
            let contrast = quantile(&view.image, 0.95) - quantile(&view.image, 0.05);
            assert!(contrast > top / 8, "{contrast} of {top}");
        }
    }
    let contrast = |preset: &str| {
        let image = &Simulation::new(small(preset)).unwrap().views[1].image.clone();
        f64::from(quantile(image, 0.75) - quantile(image, 0.25))
    };
    assert!(contrast("low-texture") < 0.5 * contrast("town"));
}

#[test]
fn dates_have_another_sun_other_vehicles_and_another_radiometry() {
    let mut config = small("town");
    config.views = 4;
    config.acquisition.dates = 2;
    // All four look alike, so that what differs between them is the date.
    config.acquisition.looks = vec![LookAngles { incidence_deg: 5.0, azimuth_deg: 100.0 }; 4];
    let simulation = Simulation::new(config).unwrap();
    let dates: Vec<usize> = simulation.views.iter().map(|v| v.record.date.index).collect();
    assert_eq!(dates, [0, 0, 1, 1]);
    let (first, second) = (simulation.views[0].record.date, simulation.views[2].record.date);
    assert!(first.sun != second.sun && first.gain != second.gain && first.gamma != second.gamma);
    let image = |k: usize| -> Vec<f64> { simulation.views[k].image.data().iter().map(|dn| f64::from(*dn)).collect() };
    let (same, other) = (correlation(&image(0), &image(1)), correlation(&image(0), &image(2)));
    assert!(same > 0.99 && other < 0.97, "{same} on a date, {other} between dates");
}

/// Two scenes of three dates that look alike from above, without and with seasons.
fn dates_without_and_with(seasons: SeasonsConfig) -> [Simulation; 2] {
    let mut config = SimulationConfig { views: 3, ..small("town") };
    config.acquisition.dates = 3;
    config.acquisition.looks = vec![LookAngles { incidence_deg: 5.0, azimuth_deg: 100.0 }; 3];
    // Light, radiometry and vehicles stay, so that only the seasons differ.
    let a = &mut config.acquisition;
    (a.sun_spread_deg, a.gain_spread, a.offset_spread, a.gamma_spread) = ([0.0; 2], 0.0, 0.0, 0.0);
    config.vehicles.parked_share = 0.0;
    [SeasonsConfig::default(), seasons]
        .map(|seasons| Simulation::new(SimulationConfig { seasons, ..config.clone() }).unwrap())
}

#[test]
fn seasons_change_other_dates_and_nothing_of_the_truth() {
    let [without, with] = dates_without_and_with(SeasonsConfig::YEAR);
    assert!(without.views[0].image == with.views[0].image, "the first date is as without seasons");
    assert!(without.truth.dsm == with.truth.dsm && without.truth.ortho == with.truth.ortho);
    assert!(without.views.iter().all(|view| view.record.date.season.is_none()));
    let values =
        |s: &Simulation, k: usize| -> Vec<f64> { s.views[k].image.data().iter().map(|dn| f64::from(*dn)).collect() };
    let alike = |s: &Simulation, a: usize, b: usize| correlation(&values(s, a), &values(s, b));
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let (same, other) = (alike(&without, a, b), alike(&with, a, b));
        assert!(same > 0.99 && (0.3..0.97).contains(&other), "{a}, {b}: {same} without, {other} with seasons");
    }
    let season = with.views[1].record.date.season.unwrap();
    assert!(season.mtf_at_nyquist != with.config.sensor.mtf_at_nyquist && season.ground != 1.0);
}

#[test]
fn a_softer_date_has_less_detail() {
    let [without, with] = dates_without_and_with(SeasonsConfig { sharpness_spread: 1.2, ..SeasonsConfig::default() });
    let detail = |s: &Simulation, k: usize| -> f64 {
        let image = &s.views[k].image;
        let rows = image.data().chunks_exact(image.width());
        rows.flat_map(|row| row.windows(2).map(|w| (f64::from(w[0]) - f64::from(w[1])).powi(2))).sum()
    };
    let mut is_judged = false;
    for (k, view) in with.views.iter().enumerate().skip(1) {
        let mtf = view.record.date.season.unwrap().mtf_at_nyquist / with.config.sensor.mtf_at_nyquist;
        let ratio = detail(&with, k) / detail(&without, k);
        if !(0.9..1.1).contains(&mtf) {
            is_judged = true;
            assert_eq!(mtf > 1.0, ratio > 1.0, "a transfer of {mtf} gives {ratio}");
        }
    }
    assert!(is_judged);
}

#[test]
fn every_cell_has_the_number_of_its_building() {
    let simulation =
        Simulation::new(SimulationConfig { vehicles: VehiclesConfig { parked_share: 1.0 }, ..small("suburb") })
            .unwrap();
    let truth = &simulation.truth;
    let mut seen = std::collections::BTreeSet::new();
    for (i, number) in truth.objects.data().iter().enumerate() {
        let class = truth.classes.data()[i];
        if class != TruthClass::FootprintEdge as u8 {
            assert_eq!(*number > 0, class == TruthClass::Building as u8, "cell {i}");
        }
        assert!(*number != TREE_NUMBER || [5, 64].contains(&class), "cell {i}: class {class}");
        seen.insert(*number);
    }
    let numbers = seen.iter().filter(|number| **number > 0).count();
    assert!(numbers > 25 && seen.contains(&TREE_NUMBER) && seen.contains(&0), "{seen:?}");
    // The numbers are those of the city model.
    let [x0, y0] = simulation.frame.origin_m();
    let building = &simulation.scene.buildings()[usize::try_from(*seen.last().unwrap()).unwrap() - 1];
    let [x, y] = building.parts[0].centre_m;
    let (column, row) = truth.geotransform.cell_from_map(x + x0, y + y0).unwrap();
    let inside = |c: f64| (0.0..119.5).contains(&c);
    assert!(
        !inside(column)
            || !inside(row)
            || truth.objects[(column.round() as usize, row.round() as usize)] == *seen.last().unwrap()
    );
}

#[test]
fn blank_roofs_have_almost_no_texture() {
    let mut config = SimulationConfig { size_m: 240.0, views: 2, ..small("industrial") };
    config.buildings.quarters.sheds = 0.0;
    let simulation = Simulation::new(config).unwrap();
    let (ortho, dsm, truth) = (&simulation.truth.ortho, &simulation.truth.dsm, &simulation.truth);
    // Differences between neighbouring roof cells of the same height, relative to the reflectance.
    let mut differences: Vec<f64> = Vec::new();
    for row in 0..ortho.height() {
        for column in 1..ortho.width() {
            let (a, b) = ((column - 1, row), (column, row));
            if truth.objects[a] > 0 && truth.objects[a] == truth.objects[b] && (dsm[a] - dsm[b]).abs() < 0.2 {
                differences.push((f64::from(ortho[a]) - f64::from(ortho[b])).abs() / f64::from(ortho[a]));
            }
        }
    }
    differences.sort_by(f64::total_cmp);
    assert!(differences.len() > 5000 && differences[differences.len() * 9 / 10] < 0.02, "{}", differences.len());
}

#[test]
fn views_see_the_ground_under_natural_crowns() {
    let mut config = SimulationConfig { gsd_m: 0.5, size_m: 80.0, ..small("fields") };
    config.vegetation = VegetationConfig { trees_per_ha: 80.0, height_m: [8.0, 12.0], crowns: CrownForm::Natural };
    config.acquisition.looks = vec![LookAngles { incidence_deg: 40.0, azimuth_deg: 120.0 }; 3];
    let simulation = Simulation::new(config).unwrap();
    assert!(simulation.scene.tree_count() > 40);
    let (mut under, mut on) = (0, 0);
    let view = &simulation.views[0];
    for row in 20..view.image.height() - 20 {
        for column in 20..view.image.width() - 20 {
            let height = f64::from(view.heights[(column, row)]);
            let at = ImagePoint::new(column as f64, row as f64);
            let ray = view.sight().ray(at);
            let p = ray.at((height - ray.origin.z) / ray.direction.z);
            let (surface, class) = simulation.scene.surface(p.x, p.y);
            if class == TruthClass::Vegetation {
                if surface - height > 2.0 { under += 1 } else { on += 1 }
            }
        }
    }
    assert!(under > 100 && on > 500, "{under} pixels see under a crown, {on} see its top");
    // Crowns have no upright sides: between the top and the rim lie heights of all kinds.
    let trees =
        simulation.truth.objects.data().iter().zip(simulation.truth.dsm.data().iter().zip(simulation.truth.dtm.data()));
    let heights: Vec<f32> = trees.filter(|(n, _)| **n == TREE_NUMBER).map(|(_, (s, t))| s - t).collect();
    let share =
        |low: f32, high: f32| heights.iter().filter(|h| (low..high).contains(*h)).count() as f64 / heights.len() as f64;
    assert!(share(0.0, 6.0) > 0.1 && share(8.0, 13.0) > 0.1, "{} {}", share(0.0, 6.0), share(8.0, 13.0));
}

#[test]
fn clouds_hide_their_share_as_no_data_or_as_white() {
    for masked in [true, false] {
        let clouds = CloudsConfig { share: 0.3, extent_m: 40.0, masked };
        let simulation = Simulation::new(SimulationConfig { clouds, ..small("town") }).unwrap();
        for view in &simulation.views {
            let cover = view.clouds.as_ref().unwrap();
            let hidden = cover.data().iter().filter(|c| **c == 1).count() as f64 / cover.data().len() as f64;
            assert!((hidden - 0.3).abs() < 0.03, "{hidden}");
            let none = view.image.data().iter().zip(cover.data()).filter(|(dn, c)| (**dn == 0) != (masked && **c == 1));
            assert_eq!(none.count(), 0);
        }
        assert_ne!(simulation.views[0].clouds, simulation.views[1].clouds);
    }
}

#[test]
fn every_preset_makes_its_scene() {
    for (preset, lowest_relief, highest_relief) in [
        ("dense-city", 15.0, 120.0),
        ("high-rise", 130.0, 200.0),
        ("hills", 40.0, 220.0),
        ("quarry", 50.0, 110.0),
        ("fields", 0.5, 20.0),
        ("harbour", 5.0, 60.0),
        ("repetitive-roofs", 6.0, 20.0),
        ("suburb", 8.0, 40.0),
        ("dense-towers", 70.0, 140.0),
        ("industrial", 9.0, 25.0),
    ] {
        let mut config = small(preset);
        (config.size_m, config.gsd_m, config.views) = (240.0, 2.0, 2);
        let simulation = Simulation::new(config).unwrap();
        let heights = simulation.truth.dsm.data();
        let (low, high) = heights.iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        let relief = f64::from(high - low);
        assert!((lowest_relief..highest_relief).contains(&relief), "{preset}: {relief} m");
        let share = |class: TruthClass| {
            let count = simulation.truth.classes.data().iter().filter(|c| **c == class as u8).count();
            count as f64 / heights.len() as f64
        };
        match preset {
            "harbour" => assert!((0.2..0.5).contains(&share(TruthClass::Water))),
            "hills" => assert!(share(TruthClass::Vegetation) > 0.3, "{}", share(TruthClass::Vegetation)),
            "industrial" | "dense-towers" => assert!(share(TruthClass::Building) > 0.25),
            "dense-city" | "repetitive-roofs" => assert!(share(TruthClass::Building) > 0.2),
            _ => {}
        }
        for view in &simulation.views {
            assert!(view.record.rpc_fit_error_px < 1e-3, "{preset}: {} px", view.record.rpc_fit_error_px);
            assert!(view.heights.data().iter().all(|h| h.is_finite()), "{preset}: a pixel sees nothing");
        }
    }
}

#[test]
fn numbers_out_of_range_are_named() {
    let town = || small("town");
    for (bad, name) in [
        (SimulationConfig { size_m: f64::NAN, ..town() }, "size"),
        (SimulationConfig { views: 1, ..town() }, "views"),
        (SimulationConfig { gsd_m: 0.0, ..town() }, "sampling"),
        (SimulationConfig { lat_deg: 95.0, ..town() }, "latitude"),
        (SimulationConfig { sensor: SensorConfig { bits: 16, ..SensorConfig::default() }, ..town() }, "bits"),
    ] {
        let error = Simulation::new(bad).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}

#[test]
fn scenes_lie_across_the_antimeridian_and_near_the_poles() {
    for (lon_deg, lat_deg) in [(180.0, 10.0), (-179.999, -40.0), (15.0, 85.0), (0.0, -84.5)] {
        let mut config = SimulationConfig { size_m: 60.0, gsd_m: 2.0, views: 2, lon_deg, lat_deg, ..small("town") };
        config.vehicles.parked_share = 0.0;
        let simulation = Simulation::new(config).unwrap();
        let seen = simulation.truth.visibility[0].data().iter().filter(|v| **v == 1).count();
        assert!(seen * 2 > simulation.truth.dsm.data().len(), "{lon_deg}, {lat_deg}: {seen} cells are seen");
    }
}
