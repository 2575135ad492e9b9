//! An example of each job for its docstring in Python. A test holds their types (mypy).

/// Names of the jobs, and lines of Python.
pub(crate) const EXAMPLES: [(&str, &[&str]); 37] = [
    (
        "dsm",
        &[
            "report = skysweep.dsm([\"left.tif\", \"right.tif\"], \"run\", gsd_m=0.5, preset=\"fast\")",
            "print(report.surface.observed)",
        ],
    ),
    ("plan_run", &["plan = skysweep.plan_run([\"left.tif\", \"right.tif\"], \"run\", gsd_m=0.5, chunk=2048)"]),
    (
        "make_plan",
        &[
            "plan = skysweep.make_plan([\"left.tif\", \"right.tif\"], \"run\", memory_mb=2000)",
            "print(len(plan.plan.chunks))",
        ],
    ),
    ("read_plan", &["plan = skysweep.read_plan(\"run\")"]),
    ("run_chunks", &["report = skysweep.run_chunks(\"run\", chunks=\"2/5\", threads=4)", "print(report.computed)"]),
    ("merge_run", &["report = skysweep.merge_run(\"run\", partial=True)"]),
    ("batch", &["report = skysweep.batch(\"night.toml\", progress=True)"]),
    ("dtm", &["report = skysweep.dtm(\"run\", \"terrain\", surface_vertical=\"egm96\")"]),
    ("classes", &["report = skysweep.classes(\"run\", \"classes\", multispectral=[\"multispectral.tif\"])"]),
    ("buildings", &["report = skysweep.buildings(\"left.tif\", \"index.tif\", surface=\"run\")"]),
    (
        "diff",
        &[
            "report = skysweep.diff(\"run_2023\", \"run_2024\", \"change\", areas=\"blocks.geojson\", areas_field=\"name\")",
            "print(report.areas)",
        ],
    ),
    ("products", &["report = skysweep.products(\"run\", products=[\"cloud\", \"dtm\"])"]),
    ("ortho", &["report = skysweep.ortho([\"left.tif\"], \"run\", \"orthos\", cell_m=0.5)"]),
    (
        "register",
        &[
            "model = {\"surface\": {\"dsm\": \"run\", \"images\": [\"left.tif\"]}}",
            "report = skysweep.register(\"new.tif\", model, \"new.json\")",
        ],
    ),
    (
        "evaluate_grids",
        &[
            "report = skysweep.evaluate_grids(\"run\", \"lidar.laz\", alignment=\"xyz\", error_map=\"errors.tif\")",
            "print(report.metrics.mae)",
        ],
    ),
    ("evaluate_surfaces", &["report = skysweep.evaluate_surfaces(\"town.ply\", \"town.city.json\", lod=\"2.2\")"]),
    ("evaluate_maps", &["report = skysweep.evaluate_maps(\"depth.npy\", \"truth.npy\", kind=\"depth\")"]),
    ("kind_of_evaluation", &["kind = skysweep.kind_of_evaluation(\"run\", \"lidar.laz\")"]),
    (
        "heightmap",
        &[
            "place = {\"lon_deg\": 5.4, \"lat_deg\": 43.53}",
            "report = skysweep.heightmap(\"run\", \"map.tif\", {\"source\": {\"position\": place}}, size_px=256)",
        ],
    ),
    ("unproject", &["report = skysweep.unproject(\"map.tif\", \"points.ply\", axes=\"world\")"]),
    (
        "tiles",
        &[
            "place = {\"lon_deg\": 5.4, \"lat_deg\": 43.53}",
            "report = skysweep.tiles(\"run\", \"tiles\", {\"source\": {\"position\": place}}, images=[\"left.tif\"], size_px=256)",
        ],
    ),
    ("groundview", &["report = skysweep.groundview(\"run\", \"views\", {\"model\": \"sparse/0\"})"]),
    ("compose", &["report = skysweep.compose(\"ground.png\", \"alpha.png\", \"satellite.png\", \"both.png\")"]),
    ("priors", &["report = skysweep.priors(\"town.city.json\", [\"cameras\"], \"priors\", mode=\"building-only\")"]),
    ("splats", &["report = skysweep.splats(\"run\", [\"left.tif\", \"right.tif\"], \"splats.ply\", walls=False)"]),
    ("render_splats", &["report = skysweep.render_splats(\"splats.ply\", \"views\", images=[\"left.tif\"])"]),
    ("convert_splats", &["report = skysweep.convert_splats(\"splats.ply\", \"splats.spz\", sh_degree=0)"]),
    ("label_splats", &["report = skysweep.label_splats(\"splats.ply\", \"town.city.json\", \"labelled.ply\")"]),
    ("train", &["report = skysweep.train(\"priors\", \"trained\", iterations=3000, priors=\"both\")"]),
    ("mesh", &["report = skysweep.mesh(\"priors\", {\"maps\": \"priors/raw_depth\"}, \"town.ply\", voxel_m=0.5)"]),
    ("align", &["report = skysweep.align(\"sparse/0\", \"positions.csv\", \"aligned\", crs_epsg=32631)"]),
    ("split", &["report = skysweep.split(\"sparse/0\", contexts=2, output=\"split.json\")"]),
    ("city_info", &["report = skysweep.city_info(\"town.city.json\", lod=\"2.2\")", "print(report.triangles)"]),
    ("city_convert", &["report = skysweep.city_convert(\"town.city.json\", \"town.ply\")"]),
    ("rpc_info", &["report = skysweep.rpc_info(\"left.tif\")"]),
    ("rpc_convert", &["report = skysweep.rpc_convert(\"left.tif\", \"left.rpb\")"]),
    ("simulate", &["report = skysweep.simulate({\"size_m\": 60.0, \"views\": 2}, \"scene\")", "print(report.views)"]),
];
