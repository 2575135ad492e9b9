//! The form of reports that Rust puts together by hand, as structures. This file is read and not
//! compiled; `test_reports.py` compares it with what the jobs return.

/// Errors of a surface model against a reference.
#[derive(Serialize)]
struct GridEvalReport {
    /// Program and version.
    generator: String,
    /// The evaluated surface.
    test: String,
    /// The reference.
    reference: String,
    /// Inputs and conventions of the comparison.
    protocol: EvalProtocol,
    /// Shift of the test that fits best, metres.
    shift: Shift,
    /// Errors over all cells, metres.
    metrics: EvalMetrics,
    /// Errors by class of the reference.
    classes: BTreeMap<String, PartMetrics>,
    /// Errors by slope of the reference.
    slopes: Vec<EvalSlope>,
    /// Errors of the most confident cells, by the share that they cover.
    coverages: Vec<EvalCoverage>,
    /// Errors of observed and of filled cells; `None` where the test does not say which they are.
    origins: Option<EvalOrigins>,
    /// How well the standard deviations of the test describe its errors.
    sigma: Option<SigmaReport>,
    /// How well the confidence of the test describes its errors.
    reliability: Option<Reliability>,
    /// Objects of the reference that were found.
    objects: Option<ObjectsFound>,
    /// How sharp the outlines of given objects are.
    outlines: Option<Sharpness>,
    /// Errors near height jumps, and elsewhere.
    edges: EvalEdges,
    /// How sharp height jumps are.
    sharpness: Sharpness,
    /// What stands above the ground.
    standing: EvalStanding,
    /// Distribution of the errors.
    histogram: Histogram,
    /// Cumulative distribution of the absolute errors.
    cumulative: Cumulative,
    /// Notes for the reader.
    notes: Vec<String>,
    /// Requirements that were not met.
    requirements_missed: Vec<String>,
}

/// Inputs and conventions of an evaluation.
#[derive(Serialize)]
struct EvalProtocol {
    /// Way in which the test was brought to the reference.
    alignment: AlignmentMethod,
    /// To which surface the shift was added.
    shift_sign: String,
    /// Search of the shift.
    search: Option<SearchSummary>,
    /// Course of the method of Nuth and Kääb.
    nuth_kaab: Option<NuthKaabSummary>,
    /// Grid of the comparison.
    grid: EvalGrid,
    /// Interpolation between cells.
    resampling: String,
    /// Vertical datum of both surfaces, in words.
    vertical: String,
    /// Source of the classes.
    class_raster: Option<String>,
    /// Classes that do not count.
    skipped_classes: Vec<i32>,
    /// Source of the mask.
    mask: Option<String>,
    /// Number of cells that do not count.
    skipped_cells: usize,
    /// Distance from the median beyond which an error is an outlier, NMADs.
    outlier_nmads: f64,
    /// What a height jump is.
    edges: EdgeRule,
    /// Source of the ground.
    terrain: TerrainSource,
    /// File of the ground.
    terrain_file: Option<String>,
    /// File of the objects.
    objects_file: Option<String>,
    /// Layers of the test that were used.
    layers: Vec<String>,
}

/// Grid of an evaluation.
#[derive(Serialize)]
struct EvalGrid {
    /// Number of columns.
    columns: usize,
    /// Number of rows.
    rows: usize,
    /// Sides of a cell, metres.
    cell_m: [f64; 2],
    /// EPSG code of the map.
    horizontal_epsg: Option<u32>,
}

/// Errors over cells, metres. Shares of cells within a distance are keys with the distance, such as
/// `["completeness_1"]`.
#[derive(Serialize)]
struct EvalMetrics {
    /// Number of cells of the reference.
    reference_cells: usize,
    /// Number of cells with an error.
    n: usize,
    /// Share of the reference that has an error.
    valid_ratio: f64,
    /// Mean.
    mean: f64,
    /// Median.
    median: f64,
    /// Mean absolute error.
    mae: f64,
    /// Root mean square.
    rmse: f64,
    /// Standard deviation.
    std: f64,
    /// Normalised median absolute deviation.
    nmad: f64,
    /// Absolute error that 68 % do not exceed.
    le68: f64,
    /// Absolute error that 90 % do not exceed.
    le90: f64,
    /// Absolute error that 95 % do not exceed.
    le95: f64,
    /// Smallest error.
    min: f64,
    /// Largest error.
    max: f64,
    /// Number of outliers.
    outliers: usize,
    /// Mean without outliers.
    robust_mean: f64,
    /// Mean absolute error without outliers.
    robust_mae: f64,
    /// Root mean square without outliers.
    robust_rmse: f64,
    /// Standard deviation without outliers.
    robust_std: f64,
}

/// Errors over a part of the cells, metres; `None` where the part has no error.
#[derive(Serialize)]
struct PartMetrics {
    /// Number of cells of the reference.
    reference_cells: usize,
    /// Number of cells with an error.
    n: usize,
    /// Share of the reference that has an error.
    valid_ratio: Option<f64>,
    /// Mean.
    mean: Option<f64>,
    /// Median.
    median: Option<f64>,
    /// Mean absolute error.
    mae: Option<f64>,
    /// Root mean square.
    rmse: Option<f64>,
    /// Standard deviation.
    std: Option<f64>,
    /// Normalised median absolute deviation.
    nmad: Option<f64>,
    /// Absolute error that 68 % do not exceed.
    le68: Option<f64>,
    /// Absolute error that 90 % do not exceed.
    le90: Option<f64>,
    /// Absolute error that 95 % do not exceed.
    le95: Option<f64>,
    /// Smallest error.
    min: Option<f64>,
    /// Largest error.
    max: Option<f64>,
    /// Number of outliers.
    outliers: Option<usize>,
    /// Mean without outliers.
    robust_mean: Option<f64>,
    /// Mean absolute error without outliers.
    robust_mae: Option<f64>,
    /// Root mean square without outliers.
    robust_rmse: Option<f64>,
    /// Standard deviation without outliers.
    robust_std: Option<f64>,
}

/// Errors of cells with a slope of the reference.
#[derive(Serialize)]
struct EvalSlope {
    /// Smallest slope, degrees.
    from_deg: f64,
    /// Largest slope, degrees.
    to_deg: f64,
    /// Errors.
    metrics: PartMetrics,
}

/// Errors of the most confident cells.
#[derive(Serialize)]
struct EvalCoverage {
    /// Share of the cells.
    coverage: f64,
    /// Least confidence of them.
    confidence: f64,
    /// Errors.
    metrics: PartMetrics,
}

/// Observed and filled cells apart.
#[derive(Serialize)]
struct EvalOrigins {
    /// Cells that matching found.
    observed: EvalOrigin,
    /// Cells that were filled.
    filled: EvalOrigin,
    /// Number of cells of which it is not known.
    unknown_cells: usize,
}

/// Errors of cells of one origin.
#[derive(Serialize)]
struct EvalOrigin {
    /// Errors.
    metrics: PartMetrics,
    /// Errors near height jumps, and elsewhere.
    edges: EvalEdges,
    /// Errors by class of the reference.
    classes: BTreeMap<String, PartMetrics>,
}

/// Errors near height jumps, and elsewhere.
#[derive(Serialize)]
struct EvalEdges {
    /// Near height jumps.
    edge: PartMetrics,
    /// Elsewhere.
    rest: PartMetrics,
}

/// What stands above the ground.
#[derive(Serialize)]
struct EvalStanding {
    /// Least height of what stands, metres.
    threshold_m: f64,
    /// Areas, square metres.
    footprint_m2: EvalOverlap,
    /// Volumes, cubic metres.
    volume_m3: EvalOverlap,
}

/// How much two sets share.
#[derive(Serialize)]
struct EvalOverlap {
    /// Size in the reference.
    reference: f64,
    /// Size in the test.
    test: f64,
    /// Size of the intersection.
    shared: f64,
    /// Share of the reference that was found.
    recall: Option<f64>,
    /// Share of the test that is in the reference.
    precision: Option<f64>,
    /// Intersection over union.
    iou: Option<f64>,
}

/// Priors of one kind of cameras.
#[derive(Serialize)]
#[serde(untagged)]
enum PriorsProduct {
    Dataset(PriorsDataset),
    SatelliteMaps(PriorsMaps),
}

/// Priors of perspective cameras.
#[derive(Serialize)]
struct PriorsDataset {
    /// Program and version.
    generator: String,
    #[serde(flatten)]
    report: PriorsReport,
}

/// Priors of satellite images.
#[derive(Serialize)]
struct PriorsMaps {
    /// Program and version.
    generator: String,
    #[serde(flatten)]
    report: SatellitePriorsReport,
}
