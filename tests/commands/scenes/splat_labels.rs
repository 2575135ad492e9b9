//! Class and object of a city model on splats: from priors, by `skysweep splats label`, in files
//! and as maps.

use std::path::Path;

use assert_cmd::Command;
use formats::npy::NpyData;
use serde_json::Value;

use super::priors::{Bench, OFFSET, SIZE};

/// Returns the numbers of a map of classes or objects.
fn numbers(path: &Path) -> Vec<u32> {
    match formats::npy::read(path).unwrap().data {
        NpyData::U8(values) => values.into_iter().map(u32::from).collect(),
        NpyData::U32(values) => values,
        other => panic!("{path:?} is {other:?}"),
    }
}

/// Splats of the model keep class and object, splats without them get them from the model by their
/// place, and both renderers show the maps that the priors have of the same cameras.
#[test]
fn splats_carry_class_and_object_to_maps() {
    let bench = Bench::new();
    let more = ["-o", "out", "--extras", "--min-views", "1", "--class-weight", "GroundSurface=0"];
    bench.run(&[&OFFSET[..], &more].concat()).code(0);
    let path = bench.path("out/splats/splats_2dgs.ply");
    let made = formats::splat_files::read(&path).unwrap();
    let labels = made.labels.clone().unwrap();
    assert!(labels.of.iter().all(|label| label.object == 1 && [2, 3].contains(&label.class)));
    let house = &labels.table.objects[0];
    assert_eq!((house.number, house.id.as_str(), house.building.as_str()), (1, "house", "house"));
    assert_eq!(labels.table.classes[&2], "RoofSurface");

    // As after a training: opaque, without labels, moved by a few centimetres, with others around.
    let mut splats = made.splats.clone();
    let random = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 997) as f32 / 997.0 - 0.5;
    for (i, splat) in splats.iter_mut().enumerate() {
        splat.opacity = 0.95;
        (0..3).for_each(|k| splat.position[k] += 0.1 * random(i, k));
    }
    let far = gaussian::Splat { position: [-8.0, -8.0, 0.5], ..splats[0] };
    splats.push(far);
    let origin = Some(formats::splat_ply::LocalOrigin::new("EPSG:25832", "ellipsoid", [500_004.0, 5_700_003.0, 30.0]));
    for (name, form) in
        [("2d", formats::splat_ply::SplatForm::Discs), ("3d", formats::splat_ply::SplatForm::Ellipsoids)]
    {
        let layout = formats::splat_ply::SplatLayout { form, sh_degree: 0 };
        // Ellipsoids as thick as a tenth of their width are no discs.
        let thick = |splat: &gaussian::Splat| {
            let [u, v, _] = splat.scale_m;
            gaussian::Splat { scale_m: [u, v, 0.1 * u], ..*splat }
        };
        let splats = splats.iter().map(thick).collect();
        let file =
            formats::splat_ply::SplatFile { splats, harmonics: None, labels: None, layout, origin: origin.clone() };
        let (bare, labelled) = (format!("{name}.ply"), format!("{name}_labelled.ply"));
        formats::splat_files::write(&bench.path(&bare), &file, false).unwrap();
        let skysweep = |arguments: &[&str]| {
            let mut command = Command::cargo_bin("skysweep").unwrap();
            command.current_dir(bench.folder.path()).arg("splats").args(arguments).assert()
        };
        let told = skysweep(&["label", &bare, "--city", "house.city.json", "-o", &labelled, "--json"]).code(0);
        let report: Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
        assert_eq!((&report["objects"], &report["objects_of_model"]), (&1.into(), &1.into()));
        let found = formats::splat_files::read(&bench.path(&labelled)).unwrap().labels.unwrap();
        assert!(found.of.last().is_some_and(|label| label.is_none()));
        let right = found.of.iter().zip(&labels.of).filter(|(a, b)| a == b).count();
        assert!(right as f64 > 0.97 * labels.of.len() as f64, "{name}: {right} of {}", labels.of.len());

        let seen = format!("{name}_seen");
        skysweep(&["render", &labelled, "--cameras", "out", "-o", &seen, "-q"]).code(0);
        assert_eq!(bench.json(&format!("{seen}/labels.json"))["objects"][0]["id"], "house");
        for (kind, missing) in [("class", 255), ("object", 0)] {
            let (mut same, mut all) = (0, 0);
            for view in 1..=4 {
                let expected = numbers(&bench.path(&format!("out/{kind}/view_{view}.npy")));
                let found = numbers(&bench.path(&format!("{seen}/{kind}/view_{view}.npy")));
                assert_eq!(found.len(), expected.len());
                let at = |x: usize, y: usize| expected[y * SIZE[0] + x];
                for (x, y) in (1..SIZE[1] - 1).flat_map(|y| (1..SIZE[0] - 1).map(move |x| (x, y))) {
                    // Away from edges: all pixels around have the same number.
                    if (0..9).all(|k| at(x + k % 3 - 1, y + k / 3 - 1) == at(x, y)) {
                        all += 1;
                        same += usize::from(found[y * SIZE[0] + x] == at(x, y));
                    }
                }
                assert!(found.contains(&missing) && found.iter().any(|number| *number != missing));
            }
            assert!(same as f64 >= 0.98 * f64::from(all), "{name} {kind}: {same} of {all}");
        }

        // Other formats say what they leave out.
        let sog = format!("{name}_packed.sog");
        let told = skysweep(&["convert", &labelled, &sog]).code(0);
        assert!(String::from_utf8_lossy(&told.get_output().stdout).contains("are left out: only PLY holds them"));
        assert_eq!(formats::splat_files::read(&bench.path(&sog)).unwrap().labels, None);
        let copy = format!("{name}_copy.ply");
        skysweep(&["convert", &labelled, &copy, "-q"]).code(0);
        assert_eq!(formats::splat_files::read(&bench.path(&copy)).unwrap().labels.unwrap(), found);
        let refused = skysweep(&["label", &bare, "--city", "house.city.json", "-o", &format!("{name}_2.spz")]).code(2);
        assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains(".ply, which alone holds classes"));
    }
    // Without a map, the similarity says where the model is.
    let file = formats::splat_ply::SplatFile { origin: None, labels: None, ..made.clone() };
    formats::splat_files::write(&bench.path("free.ply"), &file, false).unwrap();
    let mut arguments = vec!["splats", "label", "free.ply", "--city", "house.city.json", "-o", "free_labelled.ply"];
    let run = |arguments: &[&str]| {
        Command::cargo_bin("skysweep").unwrap().current_dir(bench.folder.path()).args(arguments).assert()
    };
    let told = run(&arguments).code(2);
    assert!(String::from_utf8_lossy(&told.get_output().stderr).contains("--transform"));
    std::fs::write(bench.path("similarity.json"), r#"{"translation": [-500004.0, -5700003.0, -30.0]}"#).unwrap();
    arguments.extend(["--transform", "similarity.json", "-q"]);
    run(&arguments).code(0);
    let found = formats::splat_files::read(&bench.path("free_labelled.ply")).unwrap().labels.unwrap();
    let right = found.of.iter().zip(&labels.of).filter(|(a, b)| a == b).count();
    assert!(right as f64 > 0.99 * labels.of.len() as f64, "{right} of {}", labels.of.len());
}
