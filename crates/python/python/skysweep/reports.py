"""The types of the reports. Made by `make stubs` of the structures that the jobs write; do not edit.

A report is a dictionary whose keys are attributes as well. What the report leaves out where there is
nothing to say is `None`, `False` or an empty list as an attribute, and no key.
"""

from __future__ import annotations

from typing import Any, Literal

from ._call import Report

__all__ = [
    "AcquisitionConfig",
    "AlignJobReport",
    "AlignResidual",
    "AppearanceConfig",
    "AreaVolume",
    "Balance",
    "BatchReport",
    "BuildingIndexConfig",
    "BuildingMapReport",
    "BuildingsConfig",
    "ChangeConfig",
    "CheckPointReport",
    "ChipReport",
    "Choice",
    "ChunkEstimate",
    "ChunkFault",
    "ChunkPlan",
    "ChunkRunReport",
    "ChunkSweep",
    "ChunkWork",
    "ChunkWorkFailed",
    "ChunksReport",
    "CityConvertReport",
    "CityCrsSummary",
    "CityDefectCount",
    "CitySummary",
    "ClassLayers",
    "ClassesReport",
    "ClassifyConfig",
    "CloudReport",
    "CloudsConfig",
    "ColourReport",
    "ComposeReport",
    "ContoursReport",
    "ControlPointReport",
    "ControlReport",
    "Cumulative",
    "CurvePoint",
    "DamagedBuilding",
    "Date",
    "DepthSource",
    "DiffBlocks",
    "DiffRegion",
    "DiffReport",
    "DistanceStatistics",
    "Disturbance",
    "DsmConfig",
    "DsmGrid",
    "DsmReport",
    "DtmReport",
    "EdgeRule",
    "ErrorCorrelation",
    "ErrorRow",
    "ErrorStatistics",
    "EvalCoverage",
    "EvalEdges",
    "EvalGrid",
    "EvalMetrics",
    "EvalOrigin",
    "EvalOrigins",
    "EvalOverlap",
    "EvalProtocol",
    "EvalSlope",
    "EvalStanding",
    "FailedChunk",
    "GridEvalReport",
    "GroundConfig",
    "GroundViewFailure",
    "GroundViewReport",
    "GroundViewRow",
    "HeightErrors",
    "HeightMapRecord",
    "HeightMapReport",
    "HeightMapTags",
    "Histogram",
    "ImageCorrection",
    "ImagePoint",
    "ImagePointing",
    "ImageRadiometry",
    "ImageReport",
    "IndexImage",
    "InputFile",
    "LayerArea",
    "LeftOut",
    "LocalOrigin",
    "LonLatHeight",
    "Look",
    "LookAngles",
    "LossPoint",
    "M3c2",
    "MapEvalReport",
    "MeanStd",
    "MeshJobConfig",
    "MeshJobReport",
    "MeshReport",
    "MultispectralConfig",
    "NoiseLevel",
    "NormalAngle",
    "NuthKaabSummary",
    "ObjectsFound",
    "OrthoPart",
    "OrthoReport",
    "PairReport",
    "PartMetrics",
    "Plan",
    "PlanEstimate",
    "PlanFile",
    "PlanReport",
    "PointingReport",
    "PriorReport",
    "PriorsJobReport",
    "PriorsProduct",
    "ProductsReport",
    "QuarterWeights",
    "ReferenceReport",
    "RegisterReport",
    "RegisteredImage",
    "Reliability",
    "ReliabilityRow",
    "Rpc",
    "RpcCamera",
    "RpcCentre",
    "RpcConvertReport",
    "RpcInfoReport",
    "RpcPixels",
    "RpcValidity",
    "SatelliteRow",
    "SceneImage",
    "SceneRecord",
    "SceneReport",
    "SearchSummary",
    "Season",
    "SeasonsConfig",
    "Sensor",
    "SensorConfig",
    "Sharpness",
    "Shift",
    "SigmaCalibration",
    "SigmaReport",
    "SimilarityParts",
    "SimulateReport",
    "SimulationConfig",
    "SplatConvertReport",
    "SplatLabelReport",
    "SplatRenderReport",
    "SplatRenderView",
    "SplatsImageReport",
    "SplatsReport",
    "SplitImage",
    "SplitJobReport",
    "StageTime",
    "Sun",
    "SunPosition",
    "SurfaceComparison",
    "SurfaceComparisonConfig",
    "SurfaceEvalReport",
    "SurfaceLayers",
    "SurfaceProtocol",
    "SurfaceReport",
    "SweepLevels",
    "SweepTuning",
    "TaskReport",
    "TerrainConfig",
    "TerrainSource",
    "ThresholdScore",
    "TileRecord",
    "TilesReport",
    "TrainConfig",
    "TrainReport",
    "TrainSchedule",
    "TrainSteps",
    "TrainWeights",
    "TrainedViewRow",
    "UnprojectReport",
    "VegetationConfig",
    "VehiclesConfig",
    "ViewRecord",
    "ViewRow",
    "Volume",
    "VoxelOverlap",
    "Window",
]


class AcquisitionConfig(Report):
    """Geometry, dates and light of the views."""

    camera: Literal["pushbroom", "frame"]
    """Kind of camera."""

    heading_deg: float
    """Direction of flight, degrees clockwise from north; image lines follow it."""

    along_track_deg: float
    """Largest angle ahead and behind, degrees. The views of a pass run from the one to the
    other."""

    across_track_deg: float
    """Largest angle to the side, degrees. The views of a pass alternate between both sides."""

    looks: list[LookAngles]
    """Lines of sight of the single views in place of a pass. Either empty or as many as `views`."""

    pointing_error_px: list[float]
    """Smallest and largest pointing error of the delivered RPCs, pixels."""

    pointing_drift_px: float
    """Change of the pointing error from the first to the last line, pixels."""

    campaign: int | None
    """Number of the campaign. Another number gives the same scene other light, vehicles,
    pointing errors and noise."""

    dates: int
    """Number of dates. Views are distributed over them in order. Each date has its own light,
    vehicles and radiometry."""

    sun: Sun
    """Direction of the sunlight on the first date."""

    sun_spread_deg: list[float]
    """Largest difference of the sun on other dates: elevation and azimuth, degrees."""

    gain_spread: float
    """Largest relative difference of the gain on other dates."""

    offset_spread: float
    """Largest difference of the offset on other dates, as a share of the sensor's range."""

    gamma_spread: float
    """Largest difference of gamma from 1 on other dates."""

    _parts = {"looks": "LookAngles", "sun": "Sun"}

    _absent = {"campaign": None}


class AlignJobReport(Report):
    """Where a model lies in the world, and how well the positions agree."""

    model: str
    """Folder of the model."""

    positions: str
    """Table of the positions."""

    origin: LocalOrigin
    """Origin that the moved model is relative to."""

    world_from_model: SimilarityParts
    """Similarity from the model to the world, relative to `origin`."""

    pairs: int
    """Number of positions known in both frames."""

    inliers: int
    """Number of pairs within the threshold."""

    positions_without_image: int
    """Number of positions whose image is not in the model."""

    threshold_m: float
    """Largest residual of an inlier, metres."""

    rmse_m: float
    """Root mean square residual of the inliers, metres."""

    spread_across_line: float
    """Spread of the positions across their line relative to that along it."""

    tilt_sigma_deg: float | None
    """Standard deviation of the tilt as far as the positions determine it, degrees; `None` where
    they do not."""

    upright: bool
    """Whether the tilt comes from the up directions of the cameras, because the positions do not
    determine it."""

    residuals: list[AlignResidual]
    """Residual of every pair."""

    noise: list[NoiseLevel]
    """Sensitivity to noise, one entry per level."""

    _parts = {"origin": "LocalOrigin", "world_from_model": "SimilarityParts", "residuals": "AlignResidual", "noise": "NoiseLevel"}


class AlignResidual(Report):
    """Residual of one pair."""

    name: str
    """Name of the image, or number of the point."""

    residual_m: float
    """Distance between the position and the moved model, metres."""

    inlier: bool
    """Whether the pair is within the threshold."""


class AppearanceConfig(Report):
    """Patterns and their contrast."""

    cover: Literal["town", "fields", "rock", "forest"]
    """Cover of the bare ground."""

    contrast: float
    """Contrast of all patterns: 1 for a usual scene, near 0 for a scene without texture."""


class AreaVolume(Report):
    """Volumes within a polygon of the given layer."""

    name: str
    """Name of the polygon, or its number from 1."""

    area_m2: float
    """Area of the cells with a difference, square metres."""

    unknown_m2: float
    """Area of the cells without one, square metres: they are not part of any volume."""

    gain_m3: float
    """Volume gained in regions of change, cubic metres."""

    gain_sigma_m3: float
    """Its standard deviation, cubic metres."""

    loss_m3: float
    """Volume lost in regions of change, cubic metres, as a positive number."""

    loss_sigma_m3: float
    """Its standard deviation, cubic metres."""

    net_m3: float
    """Sum of all differences, in regions of change or not, cubic metres."""

    net_sigma_m3: float
    """Its standard deviation, cubic metres."""


class Balance(Report):
    """Gain and offset that turn the values of an image into values of the mosaic."""

    gain: float
    """Gain."""

    offset: float
    """Offset, added after the gain."""


class BatchReport(Report):
    """What became of a batch."""

    version: str
    """Version of the program."""

    complete: int
    """Number of tasks that are complete, now or before."""

    incomplete: int
    """Number of tasks that are not."""

    scenes: list[SceneReport]
    """The scenes in the order of the file."""

    _parts = {"scenes": "SceneReport"}


class BuildingIndexConfig(Report):
    """Parameters of the building index. Lengths are those of buildings and follow no scene."""

    smoothing_m: float
    """Standard deviation of the smoothing before gradients, metres; at least 0.8 pixels."""

    least_side_m: float
    """Shortest side of a building, metres."""

    most_side_m: float
    """Longest side of a building that is followed, metres."""

    gap_m: float
    """Longest part of a side that may show no edge, metres."""

    least_area_m2: float
    """Smallest area of a building, square metres."""

    most_area_m2: float
    """Largest area of a building, square metres."""

    half_area_m2: float
    """Area at which a shape counts half as much as a small one, square metres. What is between
    streets is larger than most buildings."""

    angle_spread_deg: float
    """Standard deviation of the angles of buildings from a right angle, degrees."""

    log_false_alarms: float
    """Logarithm (base 10) of the number of branches that may be found in an image without any. A
    few do no harm: they close no shape."""

    tolerance_m: float
    """How far a corner or a far side may lie from where a junction says, metres."""

    shadow_m: float
    """Width of the widest shadow, metres."""

    cast_m: float
    """Distance within which a building has a shadow behind it, metres."""

    cast_gain: float
    """How much more salient a lit pixel is with a shadow behind it, as a share."""

    blur_m: float
    """Standard deviation of the smoothing of the index, metres."""

    half_saliency: float
    """Saliency at which the index is a half."""


class BuildingMapReport(Report):
    """A finished building index."""

    image: str
    """The image."""

    index: str
    """File of the index."""

    report: str
    """File of this report; its page lies beside it."""

    surface: str | None
    """File of the surface model on which the index lies, if it does."""

    size: list[int]
    """Columns and rows of the index."""

    gsd_m: float
    """Side of a pixel of the image on the ground, metres."""

    junctions: int
    """Junctions of two branches that were found in the image."""

    pairs: int
    """Pairs of junctions that support each other."""

    cells_known: int
    """Cells with an index."""

    cells_high: int
    """Cells whose index is at least a half."""

    parameters: BuildingIndexConfig
    """Parameters of the index."""

    _parts = {"parameters": "BuildingIndexConfig"}


class BuildingsConfig(Report):
    """A town along a grid of streets. The kind of each quarter between four streets is drawn by
    the weights."""

    turn_deg: float
    """Direction of the first family of streets, degrees counter-clockwise from east."""

    street_spacing_m: float
    """Distance between the centre lines of parallel streets, metres."""

    street_width_m: float
    """Width of the carriageway, metres; 0 for no streets."""

    landmark_height_m: float
    """Height of a stepped tower in the middle of the scene, metres; 0 for none."""

    high_rise_height_m: list[float]
    """Lowest and highest tower of `high_rise` and `dense_towers` quarters, metres."""

    details: bool
    """Whether roofs have parapets, chimneys and plant rooms."""

    identical: bool
    """Whether every quarter is built, painted and planted alike, which makes a repetitive scene."""

    quarters: QuarterWeights
    """Weight of each kind of quarter."""

    _parts = {"quarters": "QuarterWeights"}


class ChangeConfig(Report):
    """Parameters of the search for change."""

    confidence: float
    """Probability that no region is invented, and of the level of detection of a cell."""

    least_change_m: float
    """Smallest mean change of a region, metres."""

    least_area_m2: float
    """Smallest area of a region, square metres. The default is more than a parked lorry covers."""

    position_m: float
    """Distance within which a height of the other surface explains a height, metres. Walls in
    satellite models are ramps of two to three metres, so they may differ by half of it."""

    overreach_m: float
    """Distance by which the walls of both surfaces reach too far outwards, metres. It is taken
    off the volumes of regions."""

    overreach_growth: float
    """Growth of that distance per metre of a wall's height: high walls hide more beside them."""

    overreach_sigma_m: float
    """Standard deviation of that distance for one region, metres."""


class CheckPointReport(Report):
    """A check point after the adjustment."""

    name: str
    """Name of the point."""

    error_m: list[float]
    """Found position minus known position east, north and up, metres."""


class ChipReport(Report):
    """What became of the search for the chip of a ground point in an image."""

    name: str
    """Name of the point."""

    image: str
    """Name of the image's file."""

    place: ImagePoint | None
    """Place at which it was found."""

    score: float | None
    """Correlation there."""

    reason: str | None
    """Why it was not found."""

    _parts = {"place": "ImagePoint"}


class Choice(Report):
    """A value that a job chose, or was given, and the reason for it."""

    name: str
    """Name of what was chosen: `gsd`, `crs`, `height range`, …"""

    value: str
    """Chosen value, with its unit."""

    reason: str
    """Reason for the value."""


class ChunkEstimate(Report):
    """What a chunk will take; zeros for a chunk without work."""

    needed_mb: int
    """Memory, megabytes."""

    cpu_seconds: float
    """Processor time, seconds."""


class ChunkFault(Report):
    """A chunk that could not be computed."""

    chunk: int
    """Number of the chunk, from 0."""

    reason: str
    """Cause."""


class ChunkPlan(Report):
    """One chunk of a plan."""

    core: Window
    """Cells of the grid that the chunk contributes."""

    work: Literal["unseen"] | ChunkWork
    """Work to do for these cells."""

    _parts = {"core": "Window", "work": "ChunkWork"}


class ChunkRunReport(Report):
    """What a process did with the chunks that it was to compute."""

    chunks: int
    """Number of chunks in the plan."""

    computed: int
    """Chunks that this process computed."""

    done_before: int
    """Chunks that had a result already."""

    elsewhere: int
    """Chunks that other processes are computing."""

    failed: list[ChunkFault]
    """Chunks that failed, now or before."""

    _parts = {"failed": "ChunkFault"}


class ChunkSweep(Report):
    """Parameters of the sweep of a chunk."""

    extent: Window
    """Cells of the grid that are computed: the core with its rim."""

    windows: list[Window | None]
    """Pixels of each image that are read; `None` for an image that does not show the chunk."""

    sources: list[list[int]]
    """For each image, the positions of the images it is compared with."""

    height_range: list[float]
    """Heights to search, metres above the ellipsoid."""

    levels: SweepLevels
    """Pyramid levels."""

    needed_mb: int
    """Estimate of the memory needed, megabytes."""

    _parts = {"extent": "Window", "windows": "Window", "levels": "SweepLevels"}


class ChunkWork(Report):
    """The work of a chunk."""

    sweep: ChunkSweep | None
    """The chunk is swept."""

    failed: ChunkWorkFailed | None
    """The chunk cannot be planned. Its cells are void."""

    _parts = {"sweep": "ChunkSweep", "failed": "ChunkWorkFailed"}

    _absent = {"sweep": None, "failed": None}


class ChunkWorkFailed(Report):
    """The chunk cannot be planned. Its cells are void."""

    reason: str
    """Cause."""


class ChunksReport(Report):
    """The division of a large scene into chunks."""

    side: int
    """Side of the largest chunk, cells."""

    done: int
    """Number of chunks with a surface."""

    unseen: int
    """Number of chunks that no two images see."""

    failed: list[FailedChunk]
    """Chunks that could not be computed; their cells are void."""

    _parts = {"failed": "FailedChunk"}


class CityConvertReport(Report):
    """What a conversion wrote."""

    summary: CitySummary
    """Numbers about the model."""

    format: Literal["obj", "ply", "glb", "geojson", "cityjson"]
    """Format that was written."""

    without_footprint: int
    """Used objects that have no surface that looks down, and therefore no footprint; 0 for other
    formats."""

    _parts = {"summary": "CitySummary"}


class CityCrsSummary(Report):
    """Reference system of a city model, as its file states it."""

    name: str | None
    """Name in the file."""

    epsg: int | None
    """EPSG code of the horizontal or compound CRS."""

    vertical_epsg: int | None
    """EPSG code of the vertical CRS where the file names it separately."""


class CityDefectCount(Report):
    """How often a defect was found."""

    code: int
    """Number of the defect in the catalogue of val3dity and its extension."""

    meaning: str
    """Meaning of the code."""

    effect: str
    """What was done about it."""

    count: int
    """Number of defects."""


class CitySummary(Report):
    """Numbers about a city model."""

    source: str
    """File that was read."""

    format: str
    """Format of the file, with its version where it has several."""

    crs: CityCrsSummary
    """Reference system."""

    bounds: list[list[float]] | None
    """Least and greatest corner in the model's coordinates; `None` without surfaces."""

    objects: int
    """Number of objects."""

    statuses: dict[str, int]
    """Number of objects per status."""

    lods: dict[str, int]
    """Number of geometries per level of detail."""

    lods_used: dict[str, int]
    """Number of used objects per level of detail."""

    triangles: int
    """Number of triangles."""

    triangles_by_class: dict[str, int]
    """Number of triangles per surface class."""

    origin: list[float]
    """Origin that the triangles are relative to, in the model's coordinates."""

    defects: list[CityDefectCount]
    """Number of defects per code and effect."""

    left_out: dict[str, int]
    """Things of the file that are not carried, such as georeferenced textures, by their kind."""

    incomplete: bool
    """Whether objects have no usable surface, or the reader dropped surfaces."""

    _parts = {"crs": "CityCrsSummary", "defects": "CityDefectCount"}


class ClassLayers(Report):
    """Layers that were found beside a surface, and what they say to the classes."""

    files: list[str]
    """Names of the files that were read."""

    cells_filled: int
    """Cells with a filled height."""

    cells_doubtful: int
    """Observed cells whose height is rather wrong than right."""


class ClassesReport(Report):
    """A finished class raster."""

    surface: str
    """File of the surface model."""

    classes: str
    """File of the classes."""

    size: list[int]
    """Columns and rows."""

    cell_m: float
    """Side of a cell, metres."""

    cells_ground: int
    """Cells of bare ground."""

    cells_building: int
    """Cells of buildings."""

    cells_low_vegetation: int
    """Cells of plants on the ground; none without a vegetation index."""

    cells_vegetation: int
    """Cells of vegetation that stands."""

    cells_water: int
    """Cells of water; none without a vegetation index."""

    cells_unknown: int
    """Cells without a height or without ground."""

    has_vegetation_index: bool
    """Whether a vegetation index took part."""

    vegetation_index: str | None
    """File of the vegetation index, where it was made of images."""

    index_images: list[IndexImage]
    """The multispectral images, the steepest first."""

    has_building_index: bool
    """Whether a building index took part."""

    cells_weak: int
    """Cells whose height was not observed or is uncertain, where the building index decides."""

    ground_share: float
    """Share of the cells with heights that show the ground, 0 to 1."""

    layers: ClassLayers
    """What the layers beside the surface say of its cells."""

    terrain: GroundConfig
    """Parameters of the search for the ground."""

    parameters: ClassifyConfig
    """Parameters of the classes."""

    _parts = {"index_images": "IndexImage", "layers": "ClassLayers", "terrain": "GroundConfig", "parameters": "ClassifyConfig"}


class ClassifyConfig(Report):
    """Parameters of the classes."""

    least_height_m: float
    """Least height above the ground of buildings and vegetation, metres. Cars are below it."""

    window_m: float
    """Side of the windows in which planes are fitted on a noisy surface, metres. It must be
    narrower than half a house and wider than a few branches."""

    least_window_m: float
    """Side below which the windows do not shrink on a surface with little noise, metres."""

    roughness_m: float
    """Residual of a plane up to which a noisy surface is smooth, metres."""

    least_roughness_m: float
    """Residual of a plane up to which an exact surface is smooth, metres: that of small parts of
    roofs that are no planes."""

    ground_residuals: float
    """Residual up to which a surface is smooth, in residuals of the bare ground; between the two
    above."""

    least_radius_m: float
    """Least radius of curvature of roofs, metres, as the area and the residual of planes around
    a cell tell it. Crowns have radii up to that; roofs are flat between their edges."""

    least_building_m2: float
    """Smallest area of a building, square metres."""

    least_vegetation_m2: float
    """Smallest area of vegetation, square metres."""

    ramp_m: float
    """Width of the ramps at walls of a noisy surface, metres."""

    least_index: float
    """Least vegetation index of vegetation, where one is given."""

    least_green_share: float
    """Least share of green cells in vegetation, where an index is given. Coarse pixels hold
    little of a small crown."""

    least_crown_m: float
    """Narrowest crown that is found without a height, metres."""

    water_index: float
    """Largest vegetation index of water, where one is given. Water swallows the near infrared;
    asphalt and soil lie about 0."""

    least_water_m2: float
    """Smallest area of water, square metres: below it lie shadows."""

    least_building_index: float
    """Least building index that counts as a building where the heights are weak."""

    leniency: float
    """Factor by which the height of a building may miss the least height, and its residual the
    roughness, where the building index speaks for it."""


class CloudReport(Report):
    """A point cloud that was made."""

    laz: str
    """LAZ file."""

    copc: str
    """COPC file with the same points."""

    crs: str
    """Reference system of the points."""

    ground_points: int | None
    """Points of the class ground, where there is a terrain model."""

    class_points: dict[str, int]
    """Points of each LAS class."""

    points: int
    """Points."""

    synthetic: int
    """Points that were filled and not observed."""

    low: list[float]
    """Least x, y and z."""

    high: list[float]
    """Greatest x, y and z."""


class CloudsConfig(Report):
    """Clouds, different ones in every view."""

    share: float
    """Share of each image that is hidden."""

    extent_m: float
    """Typical extent of a cloud, metres."""

    masked: bool
    """Whether hidden pixels are no-data (0), as after a cloud mask. Otherwise they are white."""


class ColourReport(Report):
    """Where colours come from."""

    bands: int
    """Bands that were taken: 3 for red, green and blue, 1 for grey."""

    stretch: list[float]
    """Samples that became black and white."""

    cells_filled: int
    """Cells with a height that the ortho does not show, whose colour is that of their
    surroundings."""


class ComposeReport(Report):
    """A composition that was written."""

    output: str
    """The PNG."""

    size: list[int]
    """Columns and rows."""


class ContoursReport(Report):
    """Contour lines that were made."""

    file: str
    """GeoPackage with the layer `contours`."""

    interval: float
    """Step between the lines, in the unit of their heights."""

    unit: str
    """Unit of the heights of the lines, that of the vertical reference system: `m` or `ft`."""

    lines: int
    """Number of lines."""

    specks: int
    """Lines that were left out because they are shorter than ten cells."""


class ControlPointReport(Report):
    """A control point after the adjustment."""

    name: str
    """Name of the point."""

    used: bool
    """Whether it took part in the adjustment."""

    residual: float | None
    """Root mean square residual, in standard deviations of its position and places; NaN when no
    camera sees it."""

    image: str
    """Name of the image in which the point is furthest from its place."""

    off_px: list[float] | None
    """Its place in that image minus where the corrected camera sees its position, along samples
    and lines, pixels; `None` when no camera sees it."""

    off_height_m: float | None
    """Height at which the corrected cameras see its places, minus its height, metres; `None` for
    a point with a place in one image."""

    reason: str | None
    """Why it did not take part."""

    _absent = {"reason": None}


class ControlReport(Report):
    """What ground points with known positions show of the pointing."""

    control: list[ControlPointReport]
    """Points that were given for the adjustment."""

    checks: list[CheckPointReport]
    """Points that only measure."""

    chips: list[ChipReport]
    """Searches for image chips."""

    unmeasured: int
    """Number of check points that fewer than two images show."""

    ce90_m: float | None
    """Horizontal error that nine of ten check points do not exceed, metres; `None` without check
    points."""

    le90_m: float | None
    """Vertical error that nine of ten check points do not exceed, metres; `None` without check
    points."""

    _parts = {"control": "ControlPointReport", "checks": "CheckPointReport", "chips": "ChipReport"}


class Cumulative(Report):
    """Number of cells with at most a given error."""

    error_m: list[float]
    """Absolute error, metres, rising from 0."""

    cells: list[int]
    """Number of cells with at most that error."""


class CurvePoint(Report):
    """Splats of one size."""

    side: int
    """Side of the squares, cells."""

    splats: int
    """Number of splats."""

    rmse_m: float
    """Root mean square error of mean heights, metres."""


class DamagedBuilding(Report):
    """A building of which too little is right."""

    number: int
    """Its number in the raster."""

    height_m: float
    """Its height above the ground around it, metres."""

    area_m2: float
    """Its area, m²."""

    right: float
    """Share of its inner cells that is right, 0 to 1."""


class Date(Report):
    """Properties that all views of a date share."""

    index: int
    """Index of the date, from 0."""

    sun: Sun
    """Direction of the sunlight."""

    gain: float
    """Factor on the gain of the sensor."""

    offset: float
    """Offset added to the sensor's, as a share of its range."""

    gamma: float
    """Exponent applied to the radiance."""

    season: Season | None
    """Season, where the scene has seasons and this is not the first date."""

    _parts = {"sun": "Sun", "season": "Season"}

    _absent = {"season": None}


class DepthSource(Report):
    """Where the depth maps of a mesh come from."""

    splats: str | None
    """Splats (PLY of 2DGS), seen by the cameras of the dataset."""

    maps: str | None
    """A folder of maps as `.npy`, named as the images: depths along the optical axis, metres."""

    _absent = {"splats": None, "maps": None}


class DiffBlocks(Report):
    """Local shifts of the second surface, after the shift of the whole."""

    side_m: float
    """Side of the blocks as asked for, metres."""

    count: int
    """Number of blocks."""

    found: int
    """Blocks that found a shift of their own; the others take those beside them."""

    deviation_m: list[float]
    """Standard deviations of the true local shifts east, north and up, metres; 0 where noise
    explains what was found."""

    largest_sideways_m: float
    """Largest local shift sideways, metres."""

    largest_up_m: float
    """Largest local shift up or down, metres."""


class DiffRegion(Report):
    """A region of change with its number."""

    number: int
    """Its number in `regions.tif`."""

    centre: list[float]
    """Middle of its cells on the map of the first surface."""

    area_m2: float
    """Area of these cells, square metres."""

    decided_m2: float
    """The part of the area whose cells decided: observed on both dates, rather right than wrong,
    and not at the border of a surface, square metres."""

    filled_m2: float
    """The part of the area that was not observed on both dates, and has filled heights, square
    metres."""

    independent_cells: float
    """Cells beyond the level of detection whose errors are independent of each other: what the
    mean and its test rest on."""

    probability: float
    """Mean probability that both heights of these cells are right, 0 to 1; 1 where nothing
    states it."""

    mean_m: float
    """Mean change of the cells that are beyond the level of detection by their probability,
    metres."""

    mean_sigma_m: float
    """Standard deviation of this mean, metres, with the correlation of the errors."""

    extreme_m: float
    """Largest change in the direction of the mean, metres."""

    border_m: float
    """Length of the border, metres, where the change falls through half of its mean."""

    volume_m3: float
    """Volume over all cells without the overreach of walls, cubic metres; negative for a loss."""

    volume_sigma_m3: float
    """Its standard deviation, cubic metres."""

    overreach_m3: float
    """Volume that was taken off for the overreach of walls, cubic metres, with the sign of the
    change."""

    wall_sigma_m3: float
    """The part of the deviation that the walls are the reason of, cubic metres."""

    p_value: float
    """Probability that a scene without change has such a region anywhere, at most 1. It may be 0
    where no number is small enough."""


class DiffReport(Report):
    """A finished change."""

    before: str
    """Surface of the first date."""

    after: str
    """Surface of the second date."""

    before_acquired: list[str]
    """When the images of the first surface were taken, as far as the surface says so."""

    after_acquired: list[str]
    """When those of the second surface were taken."""

    output: str
    """Folder of the results."""

    crs: str
    """CRS of the rasters, and the vertical datum of both surfaces."""

    vertical: str
    """Vertical datum in words."""

    size: list[int]
    """Columns and rows."""

    cell_m: float
    """Side of a cell, metres."""

    shift: Shift
    """Shift that was added to the second surface, metres."""

    blocks: DiffBlocks | None
    """What blocks were moved by besides, if that was asked for."""

    sigma_factor: float
    """Factor, at least 1, that the stated deviations needed to explain the differences of
    unchanged ground; without stated deviations the deviation that was measured, metres."""

    detection_m: float
    """Median level of detection of a cell at the confidence, metres."""

    offset_sigma_m: float
    """Deviation of an offset of all heights, metres. It is part of all regional deviations."""

    correlation: ErrorCorrelation
    """Correlation of the errors of two cells by their distance."""

    observed_cells: int
    """Cells observed on both dates."""

    deciding_cells: int
    """Those of them that decide: rather right than wrong, and clear of the borders."""

    filled_cells: int
    """Cells with a height on both dates of which one was filled."""

    tested: int
    """Candidates that were tested."""

    regions: list[DiffRegion]
    """The regions of significant change."""

    total: Volume
    """Volumes over all cells."""

    areas: list[AreaVolume]
    """Volumes within the given polygons."""

    parameters: ChangeConfig
    """Parameters of the search."""

    notes: list[str]
    """Choices and doubts that a reader must know."""

    _parts = {"shift": "Shift", "blocks": "DiffBlocks", "correlation": "ErrorCorrelation", "regions": "DiffRegion", "total": "Volume", "areas": "AreaVolume", "parameters": "ChangeConfig"}

    _absent = {"blocks": None}


class DistanceStatistics(Report):
    """Distances from samples of one surface to the other, metres."""

    n: int
    """Number of samples."""

    mean_m: float
    """Mean."""

    median_m: float
    """Median."""

    rmse_m: float
    """Root of the mean square."""

    le90_m: float
    """90th percentile."""

    le95_m: float
    """95th percentile."""

    max_m: float
    """Largest distance."""


class Disturbance(Report):
    """One kind of noise."""

    translation_m: float | None
    """Standard deviation of every position, metres along each axis."""

    rotation_deg: float | None
    """Standard deviation of the heading, degrees."""

    _absent = {"translation_m": None, "rotation_deg": None}


class DsmConfig(Report):
    """Configuration of a DSM run. A field that is `None` is chosen from the scene. Positions of
    images count from 0 here, and from 1 where the configuration is written as text."""

    images: list[str]
    """Image files, two or more, each with its RPC inside or beside it."""

    output: str
    """Folder for the results."""

    gsd_m: float | None
    """Cell size of the DSM, metres."""

    crs_epsg: int | None
    """EPSG code of the horizontal CRS."""

    bounds: list[float] | None
    """Area of the DSM, in its CRS."""

    bounds_epsg: int | None
    """EPSG code of the CRS of `bounds` where that is another one, such as 4326 for degrees. The
    grid is the rectangle around them."""

    area: LayerArea | None
    """Polygons in which the DSM lies. Cells outside are void, and without `bounds` the grid is
    the rectangle around them."""

    masks: list[str]
    """Ground without heights, such as water: polygons (GeoJSON, GeoPackage, shapefile), and
    georeferenced rasters where they are neither 0 nor without data."""

    image_masks: list[str]
    """Pixels that are not matched, such as clouds: polygons on the ground, and rasters in the
    frame of an image. The name of each begins with that of its image."""

    band: int | str | None
    """Band to match; the luma of all bands when `None`."""

    height_range_m: list[float] | None
    """Heights to search, metres above the ellipsoid."""

    dem: str | None
    """Coarse elevation model from which the height range is taken."""

    reference_dem: str | None
    """Surface model to which the pointing is co-registered."""

    reference_plane: bool
    """Whether the heights are also tilted onto the reference by a plane."""

    dem_vertical: str | None
    """What the heights of `dem` and `reference_dem` are above; the datum that a file names when
    `None`."""

    prior: str | None
    """City model whose roofs are expected."""

    control: str | None
    """Ground control points and check points with their places in the images (CSV, GeoJSON)."""

    corrections: str | None
    """Pointing corrections of an earlier run to start from: its `pointing.json` or its report."""

    force_crs: bool
    """Whether a CRS may be used far outside its area of use, where its coordinates mean little."""

    vertical: str
    """Datum of the heights of the DSM."""

    preset: Literal["fast", "balanced", "accurate"]
    """Trade-off of speed and accuracy."""

    fill: Literal["none", "justified", "all"]
    """Choice of the voids that are closed."""

    pairs: list[list[int]] | None
    """Pairs of images to match, by positions that are written from 1; all useful ones when
    `None`."""

    references: list[int] | None
    """Images to compute heights for, by positions that are written from 1; all when `None`."""

    pointing: bool
    """Whether the pointing of the RPCs is corrected."""

    products: list[Literal["cloud", "dtm", "classes", "contours", "mesh"]]
    """What is made of the DSM beside it, as `crate::products` does."""

    threads: int | None
    """Number of worker threads; all cores when `None`."""

    memory_mb: int | None
    """Memory limit, megabytes; 4000 when `None`. A scene that takes more is computed by chunks."""

    chunk: int | None
    """Side of the chunks of a large scene, cells; as large as the memory allows when `None`."""

    tile: int
    """Side of the output tiles that are fused at a time, cells. It changes the memory needed,
    never the result."""

    overwrite: bool
    """Whether existing results may be replaced."""

    _parts = {"area": "LayerArea"}


class DsmGrid(Report):
    """The grid of a DSM."""

    epsg: int
    """EPSG code of the horizontal CRS."""

    geotransform: list[float]
    """Placement of the cells on the map."""

    size: list[int]
    """Columns and rows."""

    gsd_m: float
    """Side of a cell on the ground, metres, whatever the unit of the CRS."""


class DsmReport(Report):
    """The report of a DSM run, written as JSON."""

    version: str
    """Version of the program."""

    plan: str | None
    """Identity of the plan whose chunks were merged; absent for a run without a plan."""

    images: list[ImageReport]
    """Images in the order of the configuration."""

    pairs: list[PairReport]
    """Pairs that were matched."""

    pointing: PointingReport
    """Correction of the pointing."""

    height_range_m: list[float]
    """Heights searched, metres above the ellipsoid."""

    hypotheses: int
    """Number of pixel-hypothesis pairs evaluated."""

    surface: SurfaceReport
    """Cells of the DSM."""

    chunks: ChunksReport | None
    """Division of the scene into chunks; absent when it was computed at once."""

    prior: PriorReport | None
    """Use of the city model; absent without one."""

    choices: list[Choice]
    """All choices with their reasons."""

    warnings: list[str]
    """Warnings."""

    stages: list[StageTime]
    """Wall times of the stages."""

    peak_memory_mb: float | None
    """Largest resident memory, megabytes; absent where the system does not report it."""

    _parts = {"images": "ImageReport", "pairs": "PairReport", "pointing": "PointingReport", "surface": "SurfaceReport", "chunks": "ChunksReport", "prior": "PriorReport", "choices": "Choice", "stages": "StageTime"}

    _absent = {"plan": None, "chunks": None, "prior": None}


class DtmReport(Report):
    """A finished terrain model."""

    surface: str
    """File of the surface model."""

    dtm: str
    """File of the ground heights."""

    height_above_ground: str
    """File of the heights above ground."""

    ground: str
    """File of the states of the cells."""

    crs: str
    """CRS of all rasters, with the vertical datum."""

    size: list[int]
    """Columns and rows."""

    cell_m: float
    """Side of a cell, metres."""

    cells_ground: int
    """Cells that show the ground."""

    cells_under_objects: int
    """Cells whose ground was interpolated under objects."""

    cells_void_filled: int
    """Cells whose ground was interpolated in voids of the surface."""

    cells_unknown: int
    """Cells without a height of the ground."""

    cells_below_ground: int
    """Cells where the surface lay below the interpolated ground, and the height above ground is
    0."""

    layers: SurfaceLayers
    """What the layers beside the surface say of its cells."""

    parameters: GroundConfig
    """Parameters of the search."""

    _parts = {"layers": "SurfaceLayers", "parameters": "GroundConfig"}


class EdgeRule(Report):
    """Definition of an edge on a grid."""

    jump_m: list[float]
    """Height difference between neighbours that makes a jump, along columns and along rows,
    metres."""

    zone_m: float
    """Distance from a jump within which a cell belongs to the edge zone, metres."""


class ErrorCorrelation(Report):
    """How alike the errors of two cells are, by their distance."""

    distance_m: list[float]
    """Distances, metres, from 0 upwards."""

    correlation: list[float]
    """Correlation at each distance, 0 to 1."""

    cell_area_m2: float
    """Area of a cell, square metres."""


class ErrorRow(Report):
    """Number of points that keep within a geometric error."""

    error_m: float
    """Geometric error, metres."""

    points: float
    """Number of points with varying spacing."""

    even_points: float
    """Number of points with one spacing."""


class ErrorStatistics(Report):
    """Summary of errors (test − reference), in metres."""

    mean: float
    """Mean error, the bias."""

    median: float
    """Median error."""

    mae: float
    """Mean absolute error."""

    rmse: float
    """Root mean square error."""

    std: float
    """Standard deviation of the population."""

    nmad: float
    """Normalised median absolute deviation: 1.4826 times the median of |e − median|."""

    le68: float
    """68th percentile of |e|."""

    le90: float
    """90th percentile of |e|."""

    le95: float
    """95th percentile of |e|."""

    min: float
    """Lowest error."""

    max: float
    """Highest error."""


class EvalCoverage(Report):
    """Errors of the most confident cells."""

    coverage: float
    """Share of the cells."""

    confidence: float
    """Least confidence of them."""

    metrics: PartMetrics
    """Errors."""

    _parts = {"metrics": "PartMetrics"}


class EvalEdges(Report):
    """Errors near height jumps, and elsewhere."""

    edge: PartMetrics
    """Near height jumps."""

    rest: PartMetrics
    """Elsewhere."""

    _parts = {"edge": "PartMetrics", "rest": "PartMetrics"}


class EvalGrid(Report):
    """Grid of an evaluation."""

    columns: int
    """Number of columns."""

    rows: int
    """Number of rows."""

    cell_m: list[float]
    """Sides of a cell, metres."""

    horizontal_epsg: int | None
    """EPSG code of the map."""


class EvalMetrics(Report):
    """Errors over cells, metres. Shares of cells within a distance are keys with the distance,
    such as `["completeness_1"]`."""

    reference_cells: int
    """Number of cells of the reference."""

    n: int
    """Number of cells with an error."""

    valid_ratio: float
    """Share of the reference that has an error."""

    mean: float
    """Mean."""

    median: float
    """Median."""

    mae: float
    """Mean absolute error."""

    rmse: float
    """Root mean square."""

    std: float
    """Standard deviation."""

    nmad: float
    """Normalised median absolute deviation."""

    le68: float
    """Absolute error that 68 % do not exceed."""

    le90: float
    """Absolute error that 90 % do not exceed."""

    le95: float
    """Absolute error that 95 % do not exceed."""

    min: float
    """Smallest error."""

    max: float
    """Largest error."""

    outliers: int
    """Number of outliers."""

    robust_mean: float
    """Mean without outliers."""

    robust_mae: float
    """Mean absolute error without outliers."""

    robust_rmse: float
    """Root mean square without outliers."""

    robust_std: float
    """Standard deviation without outliers."""


class EvalOrigin(Report):
    """Errors of cells of one origin."""

    metrics: PartMetrics
    """Errors."""

    edges: EvalEdges
    """Errors near height jumps, and elsewhere."""

    classes: dict[str, PartMetrics]
    """Errors by class of the reference."""

    _parts = {"metrics": "PartMetrics", "edges": "EvalEdges", "classes": "*PartMetrics"}


class EvalOrigins(Report):
    """Observed and filled cells apart."""

    observed: EvalOrigin
    """Cells that matching found."""

    filled: EvalOrigin
    """Cells that were filled."""

    unknown_cells: int
    """Number of cells of which it is not known."""

    _parts = {"observed": "EvalOrigin", "filled": "EvalOrigin"}


class EvalOverlap(Report):
    """How much two sets share."""

    reference: float
    """Size in the reference."""

    test: float
    """Size in the test."""

    shared: float
    """Size of the intersection."""

    recall: float | None
    """Share of the reference that was found."""

    precision: float | None
    """Share of the test that is in the reference."""

    iou: float | None
    """Intersection over union."""


class EvalProtocol(Report):
    """Inputs and conventions of an evaluation."""

    alignment: Literal["none", "z", "xyz", "nuth-kaab"]
    """Way in which the test was brought to the reference."""

    shift_sign: str
    """To which surface the shift was added."""

    search: SearchSummary | None
    """Search of the shift."""

    nuth_kaab: NuthKaabSummary | None
    """Course of the method of Nuth and Kääb."""

    grid: EvalGrid
    """Grid of the comparison."""

    resampling: str
    """Interpolation between cells."""

    vertical: str
    """Vertical datum of both surfaces, in words."""

    class_raster: str | None
    """Source of the classes."""

    skipped_classes: list[int]
    """Classes that do not count."""

    mask: str | None
    """Source of the mask."""

    skipped_cells: int
    """Number of cells that do not count."""

    outlier_nmads: float
    """Distance from the median beyond which an error is an outlier, NMADs."""

    edges: EdgeRule
    """What a height jump is."""

    terrain: TerrainSource
    """Source of the ground."""

    terrain_file: str | None
    """File of the ground."""

    objects_file: str | None
    """File of the objects."""

    layers: list[str]
    """Layers of the test that were used."""

    _parts = {"search": "SearchSummary", "nuth_kaab": "NuthKaabSummary", "grid": "EvalGrid", "edges": "EdgeRule", "terrain": "TerrainSource"}


class EvalSlope(Report):
    """Errors of cells with a slope of the reference."""

    from_deg: float
    """Smallest slope, degrees."""

    to_deg: float
    """Largest slope, degrees."""

    metrics: PartMetrics
    """Errors."""

    _parts = {"metrics": "PartMetrics"}


class EvalStanding(Report):
    """What stands above the ground."""

    threshold_m: float
    """Least height of what stands, metres."""

    footprint_m2: EvalOverlap
    """Areas, square metres."""

    volume_m3: EvalOverlap
    """Volumes, cubic metres."""

    _parts = {"footprint_m2": "EvalOverlap", "volume_m3": "EvalOverlap"}


class FailedChunk(Report):
    """A chunk without a result."""

    bounds: list[float]
    """Area of the chunk in the CRS of the DSM."""

    reason: str
    """Cause."""


class GridEvalReport(Report):
    """Errors of a surface model against a reference."""

    generator: str
    """Program and version."""

    test: str
    """The evaluated surface."""

    reference: str
    """The reference."""

    protocol: EvalProtocol
    """Inputs and conventions of the comparison."""

    shift: Shift
    """Shift of the test that fits best, metres."""

    metrics: EvalMetrics
    """Errors over all cells, metres."""

    classes: dict[str, PartMetrics]
    """Errors by class of the reference."""

    slopes: list[EvalSlope]
    """Errors by slope of the reference."""

    coverages: list[EvalCoverage]
    """Errors of the most confident cells, by the share that they cover."""

    origins: EvalOrigins | None
    """Errors of observed and of filled cells; `None` where the test does not say which they are."""

    sigma: SigmaReport | None
    """How well the standard deviations of the test describe its errors."""

    reliability: Reliability | None
    """How well the confidence of the test describes its errors."""

    objects: ObjectsFound | None
    """Objects of the reference that were found."""

    outlines: Sharpness | None
    """How sharp the outlines of given objects are."""

    edges: EvalEdges
    """Errors near height jumps, and elsewhere."""

    sharpness: Sharpness
    """How sharp height jumps are."""

    standing: EvalStanding
    """What stands above the ground."""

    histogram: Histogram
    """Distribution of the errors."""

    cumulative: Cumulative
    """Cumulative distribution of the absolute errors."""

    notes: list[str]
    """Notes for the reader."""

    requirements_missed: list[str]
    """Requirements that were not met."""

    _parts = {"protocol": "EvalProtocol", "shift": "Shift", "metrics": "EvalMetrics", "classes": "*PartMetrics", "slopes": "EvalSlope", "coverages": "EvalCoverage", "origins": "EvalOrigins", "sigma": "SigmaReport", "reliability": "Reliability", "objects": "ObjectsFound", "outlines": "Sharpness", "edges": "EvalEdges", "sharpness": "Sharpness", "standing": "EvalStanding", "histogram": "Histogram", "cumulative": "Cumulative"}


class GroundConfig(Report):
    """Parameters of the search for the ground."""

    widest_object_m: float
    """Width of the widest object, metres: the largest window. Large halls and closed city blocks
    are about 150 m wide."""

    lowest_object_m: float
    """Height of the lowest object, metres, in the smallest window. It must exceed twice the
    noise of the surface, which is up to 0.5 m in satellite models."""

    slope: float
    """Slope of the ground that an opening may cut off without making a candidate: what a window
    may remove grows by this much per metre of its half-width. 0.15 is the value of Pingel et al.
    (2013, <https://doi.org/10.1016/j.isprsjprs.2012.12.002>) for mixed ground."""

    storey_m: float
    """Largest height that counts as ground in any window, metres: the lowest storey. Without
    this limit a wide hall would need to be higher than a narrow house."""


class GroundViewFailure(Report):
    """A view that was asked for and could not be made."""

    id: str
    """Identifier of the row, or name of the view."""

    reason: str
    """Why it could not be made."""


class GroundViewReport(Report):
    """Ground views that were made."""

    views: list[GroundViewRow]
    """The views, in the order of the cameras."""

    failed: list[GroundViewFailure]
    """Views that were asked for and could not be made."""

    points: int
    """Points of the COLMAP model."""

    cells_seen: list[int] | None
    """Cells of a raster that some view sees, and all cells with a height."""

    _parts = {"views": "GroundViewRow", "failed": "GroundViewFailure"}


class GroundViewRow(Report):
    """A ground view."""

    name: str
    """Name of its files, without folder and ending."""

    kind: str
    """`perspective` or `panorama`."""

    size: list[int]
    """Columns and rows."""

    centre: list[float]
    """Position of the camera, metres from the origin."""

    ground_share: float
    """Share of the pixels that show the surface."""

    sky_share: float
    """Share of the pixels that show the sky."""

    depth_range_m: list[float] | None
    """Least and greatest depth, metres."""


class HeightErrors(Report):
    """Errors of rendered heights, metres."""

    cells: int
    """Number of cells compared."""

    rmse_m: float
    """Root mean square error."""

    mae_m: float
    """Mean absolute error."""

    median_m: float
    """Median absolute error."""

    share: float
    """Share of the surface's cells that have a rendered height."""


class HeightMapRecord(Report):
    """A row of a list."""

    id: str
    """Identifier of the row."""

    status: Literal["made", "kept", "failed"]
    """Which of them it is."""

    path: str | None
    """File of the map."""

    camera_lon_deg: float | None
    """Longitude of the camera, degrees."""

    camera_lat_deg: float | None
    """Latitude of the camera, degrees."""

    camera_height_m: float | None
    """Height of the camera above the ellipsoid, metres: the zero of the heights of the map."""

    ground_height_m: float | None
    """Height of the ground under the camera above the ellipsoid, metres, if it was looked for."""

    heading_deg: float | None
    """Heading, degrees clockwise from true north."""

    resolution_px_per_m: float | None
    """Pixels per metre on the ground."""

    scene_scale_m: float | None
    """Scale of the scene, metres: the divisor of the heights of a normalised map."""

    normalized: bool | None
    """Whether the heights are divided by the scale of the scene."""

    source: str | None
    """File name of the source."""

    source_kind: str | None
    """`raster`, `city model` or `point cloud`."""

    interpolation: str | None
    """Interpolation between the cells of a raster."""

    void_share: float | None
    """Share of the pixels without a height."""

    height_range_m: list[float] | None
    """Lowest and highest height relative to the camera, metres."""

    reason: str | None
    """Why not."""

    _absent = {"path": None, "camera_lon_deg": None, "camera_lat_deg": None, "camera_height_m": None, "ground_height_m": None, "heading_deg": None, "resolution_px_per_m": None, "scene_scale_m": None, "normalized": None, "source": None, "source_kind": None, "interpolation": None, "void_share": None, "height_range_m": None, "reason": None}


class HeightMapReport(Report):
    """Result of a height map job. It serializes as the one map, or as the list."""

    path: str | None
    """File of the map."""

    camera_lon_deg: float | None
    """Longitude of the camera, degrees."""

    camera_lat_deg: float | None
    """Latitude of the camera, degrees."""

    camera_height_m: float | None
    """Height of the camera above the ellipsoid, metres: the zero of the heights of the map."""

    ground_height_m: float | None
    """Height of the ground under the camera above the ellipsoid, metres, if it was looked for."""

    heading_deg: float | None
    """Heading, degrees clockwise from true north."""

    resolution_px_per_m: float | None
    """Pixels per metre on the ground."""

    scene_scale_m: float | None
    """Scale of the scene, metres: the divisor of the heights of a normalised map."""

    normalized: bool | None
    """Whether the heights are divided by the scale of the scene."""

    source: str | None
    """File name of the source."""

    source_kind: str | None
    """`raster`, `city model` or `point cloud`."""

    interpolation: str | None
    """Interpolation between the cells of a raster."""

    void_share: float | None
    """Share of the pixels without a height."""

    height_range_m: list[float] | None
    """Lowest and highest height relative to the camera, metres."""

    rows: int | None
    """Rows of the list."""

    made: int | None
    """Maps that were made now."""

    kept: int | None
    """Maps that an earlier run had made."""

    failed: int | None
    """Rows without a map."""

    seconds: float | None
    """Duration of the job, seconds."""

    maps: list[HeightMapRecord] | None
    """The rows, in the order of the list."""

    _parts = {"maps": "HeightMapRecord"}

    _absent = {"path": None, "camera_lon_deg": None, "camera_lat_deg": None, "camera_height_m": None, "ground_height_m": None, "heading_deg": None, "resolution_px_per_m": None, "scene_scale_m": None, "normalized": None, "source": None, "source_kind": None, "interpolation": None, "void_share": None, "height_range_m": None, "rows": None, "made": None, "kept": None, "failed": None, "seconds": None, "maps": None}


class HeightMapTags(Report):
    """Metadata of a height map."""

    camera_lon_deg: float
    """Longitude of the camera, degrees."""

    camera_lat_deg: float
    """Latitude of the camera, degrees."""

    camera_height_m: float
    """Height of the camera above the ellipsoid, metres: the zero of the heights of the map."""

    ground_height_m: float | None
    """Height of the ground under the camera above the ellipsoid, metres, if it was looked for."""

    heading_deg: float
    """Heading, degrees clockwise from true north."""

    resolution_px_per_m: float
    """Pixels per metre on the ground."""

    scene_scale_m: float
    """Scale of the scene, metres: the divisor of the heights of a normalised map."""

    normalized: bool
    """Whether the heights are divided by the scale of the scene."""

    source: str
    """File name of the source."""

    source_kind: str
    """`raster`, `city model` or `point cloud`."""

    interpolation: str
    """Interpolation between the cells of a raster."""


class Histogram(Report):
    """Counts of errors in bins of equal width from −range to +range."""

    range_m: float
    """Half of the range that the bins cover, metres."""

    counts: list[int]
    """Number of errors per bin, from the most negative."""

    below: int
    """Number of errors below −range."""

    above: int
    """Number of errors above +range."""


class ImageCorrection(Report):
    """An affine map in image space, applied after the RPC: `corrected = p + t + D (p − centre)`.
    The translation holds at `centre`. Otherwise a small linear part would become a huge translation
    for crops far from the origin of their coordinates."""

    translation_px: list[float]
    """Shift at `centre`, pixels (sample, line)."""

    linear: list[list[float]]
    """Linear part minus the identity, row-major (sample row, line row), pixels per pixel."""

    centre: ImagePoint
    """The point about which the linear part acts."""

    _parts = {"centre": "ImagePoint"}


class ImagePoint(Report):
    """A position in an image. The centre of the upper-left pixel is (0, 0)."""

    sample: float
    """Column, pixels."""

    line: float
    """Row, pixels."""


class ImagePointing(Report):
    """What the tie points show of the pointing of an image."""

    path: str
    """File of the image."""

    tracks: int
    """Number of ground points that were found in this image and in others."""

    inliers: int
    """Number of them that are no outliers."""

    covered: float | None
    """Share of the ground shared with other images that has inliers nearby, 0 to 1; NaN when no
    ground is known to be shared."""

    residual_px: float | None
    """Robust standard deviation of the residuals in this image after the correction, outliers
    included, pixels; NaN without tracks."""

    tie_residuals_px: list[list[float]]
    """Inliers, evenly chosen where there are many: sample, line, and residual along both after
    the correction, pixels."""


class ImageRadiometry(Report):
    """Noise and contrast of one image, as measured in the windows of it that were read."""

    noise: list[float]
    """Standard deviation of the noise at full resolution, grey values, one per window."""

    contrast: list[list[float]]
    """Typical difference of neighbouring pixels, grey values, by level and window."""

    has_contrast: bool
    """Whether some window has pixels of different values."""


class ImageReport(Report):
    """An image in the report."""

    path: str
    """File of the image."""

    rpc: str
    """Format in which the RPC was found."""

    size: list[int]
    """Columns and rows."""

    acquired: str | None
    """When the image was taken, in the form of ISO 8601; `None` where the file does not say."""

    satellite: str | None
    """Name of the satellite; absent where neither the file nor its STAC item says."""

    sun: SunPosition | None
    """Where the sun stood; absent where neither the file nor its STAC item says."""

    gsd_m: float | None
    """Side of a pixel on the ground at the centre of the scene, metres."""

    incidence_deg: float | None
    """Angle of the line of sight to the vertical, degrees."""

    correction: ImageCorrection | None
    """Correction found, in the frame of the part that was read."""

    applied_correction: ImageCorrection
    """Correction applied, in the frame of the whole image."""

    _parts = {"sun": "SunPosition", "correction": "ImageCorrection", "applied_correction": "ImageCorrection"}

    _absent = {"acquired": None, "satellite": None, "sun": None}


class IndexImage(Report):
    """An image that gave the vegetation index."""

    path: str
    """The image."""

    red_band: int
    """Band of red, counted from 1."""

    nir_band: int
    """Band of near infrared, counted from 1."""

    black: list[float]
    """Values of a black surface in both: path radiance and dark current."""

    nir_gain: float
    """Factor that brings the near infrared to the scale of red, so that roofs are grey."""

    corrected: bool
    """Whether the pointing was corrected."""

    incidence_deg: float
    """Angle from the vertical, degrees."""

    cells_seen: int
    """Cells that the image sees."""


class InputFile(Report):
    """A file that a plan rests on."""

    path: str
    """The file."""

    bytes: int
    """Size, bytes."""

    sha256: str
    """SHA-256 of the content."""

    times_ns: list[int]
    """Times of modification and of change when it was planned, nanoseconds since 1970."""


class LayerArea(Report):
    """Polygons of a layer."""

    file: str
    """GeoPackage or GeoJSON."""

    layer: str | None
    """Layer; the only one when `None`."""

    field: str
    """Field that holds the names of the polygons."""

    name: str | None
    """Name of the polygon; all polygons when `None`, and in a batch that of the scene."""


class LeftOut(Report):
    """A building that is not where the model places it."""

    id: str
    """Identifier in the model."""

    views: int
    """Number of views that leave it out."""

    of_views: int
    """Number of views that see it."""

    agreeing_pixels: int
    """Pixels with agreeing heights, in the views that leave it out."""

    compared_pixels: int
    """Pixels with a height to compare with, in the views that leave it out."""


class LocalOrigin(Report):
    """Point of a map that local positions are relative to."""

    crs: str
    """Projected CRS: `EPSG:n`, WKT or PROJJSON."""

    vertical: str
    """Vertical datum of the heights: `ellipsoid`, `egm96`, …"""

    origin: list[float]
    """Easting, northing and height of the local position (0, 0, 0), metres."""

    axes: list[str]
    """Names of the axes, for people who read the file."""

    unit: str
    """Unit of all lengths, for people who read the file."""


class LonLatHeight(Report):
    """A geographic position: WGS 84 longitude and latitude in degrees, height in metres above
    the ellipsoid."""

    lon_deg: float
    """Longitude, degrees, east positive."""

    lat_deg: float
    """Latitude, degrees, north positive."""

    height_m: float
    """Height above the WGS 84 ellipsoid, metres."""


class Look(Report):
    """The line of sight and the sampling distance of a view."""

    incidence_deg: float
    """Angle between the line of sight and the vertical at the scene, degrees."""

    azimuth_deg: float
    """Direction from the scene to the sensor, degrees clockwise from north."""

    heading_deg: float
    """Direction of flight, degrees clockwise from north; image lines follow it."""

    gsd_m: float
    """Sampling distance perpendicular to the line of sight, metres."""


class LookAngles(Report):
    """The direction from the scene to the sensor."""

    incidence_deg: float
    """Angle between the line of sight and the vertical at the scene, degrees."""

    azimuth_deg: float
    """Direction from the scene to the sensor, degrees clockwise from north."""


class LossPoint(Report):
    """Mean terms of the loss over some iterations, without their weights."""

    iteration: int
    """Last iteration, counted from 1."""

    splats: int
    """Number of splats."""

    total: float
    """Sum with the weights."""

    colour: float
    """Colour."""

    prior_depth: float
    """Depths against the prior."""

    prior_normal: float
    """Normals against the prior."""

    correlation: float
    """One less the correlation with heights of unknown scale."""


class M3c2(Report):
    """M3C2 distances over the core points, metres. They are positive where the test lies outside
    or above."""

    core_points: int
    """Number of core points."""

    n: int
    """Number of core points with a normal and both surfaces in the cylinder. The fields below
    refer to these."""

    mean_m: float
    """Mean."""

    median_m: float
    """Median."""

    mean_abs_m: float
    """Mean absolute distance."""

    rmse_m: float
    """Root of the mean square."""

    std_m: float
    """Standard deviation."""

    with_lod: int
    """Number of distances with a level of detection."""

    median_lod_m: float | None
    """Median level of detection."""

    significant: float | None
    """Share of the distances with a level of detection that exceed it, which are significant
    changes."""


class MapEvalReport(Report):
    """A finished comparison of two maps."""

    generator: str
    """"""

    kind: Literal["depth", "normals", "mask"]
    """Kind of both maps."""

    test: str
    """The evaluated map, by name."""

    reference: str
    """The reference, by name."""

    size: list[int]
    """Columns and rows."""

    result: Any
    """All numbers by name: a `eval::DepthComparison`, `eval::NormalComparison` or
    `eval::MaskComparison`."""

    missed: list[str]
    """Requirements that are not met."""


class MeanStd(Report):
    """Mean and standard deviation over seeds."""

    mean: float
    """Mean."""

    std: float
    """Standard deviation (n − 1)."""


class MeshJobConfig(Report):
    """A dataset whose depth maps become a mesh."""

    dataset: str
    """Folder with a COLMAP model in `sparse/0`."""

    depths: DepthSource
    """The depth maps."""

    images: str | None
    """Folder of the images that give the colours, where splats do not; grey when `None`."""

    output: str
    """File of the mesh: `.ply` or `.glb`."""

    voxel_m: float
    """Edge of a voxel, metres."""

    truncation_m: float | None
    """Distance from a surface beyond which a map says nothing, metres; four voxels when `None`."""

    least_views: int
    """Number of views that must have seen a place."""

    least_part_m2: float
    """Connected parts of a smaller area are left out, square metres."""

    shrink: int
    """Pixels of an image that become one, in each direction, where splats are drawn."""

    masked: bool
    """Whether only what the masks of the dataset show becomes a mesh."""

    reference: str | None
    """Surface to compare the mesh with: a mesh, a city model or a cloud."""

    memory_gib: float
    """Greatest memory of the volume, gibibytes."""

    threads: int | None
    """Worker threads; one per core when `None`."""

    overwrite: bool
    """Whether existing files may be replaced."""

    _parts = {"depths": "DepthSource"}


class MeshJobReport(Report):
    """A finished mesh."""

    settings: MeshJobConfig
    """The settings."""

    maps: int
    """Number of depth maps."""

    corners: int
    """Number of corners."""

    triangles: int
    """Number of triangles."""

    parts_left_out: int
    """Number of small parts that were left out."""

    seconds: float
    """Seconds of the fusion."""

    comparison: SurfaceEvalReport | None
    """The comparison with the reference."""

    _parts = {"settings": "MeshJobConfig", "comparison": "SurfaceEvalReport"}


class MeshReport(Report):
    """A mesh that was made."""

    glb: str
    """Single file."""

    tileset: str
    """Tileset of the tiles."""

    tolerance_m: float
    """Largest vertical distance of a cell from the finest mesh, metres."""

    glb_cell_m: float
    """Distance of the cells that the single file is made of, metres."""

    glb_triangles: int
    """Triangles of the single file."""

    glb_origin: list[float]
    """Origin of the single file: x, y on the map and height."""

    glb_crs: str
    """Reference system of the single file."""

    levels: int
    """Levels of detail of the tiles."""

    tiles: int
    """Number of tiles."""

    tile_triangles: int
    """Triangles of all tiles, with their skirts."""


class MultispectralConfig(Report):
    """Multispectral images: blue, green, red and near infrared, taken with the panchromatic
    images."""

    ratio: int
    """Side of a multispectral pixel, in panchromatic pixels."""

    autumn_share: float
    """Share of the trees whose leaves are yellow or brown, 0 to 1."""

    planted_roof_share: float
    """Share of the flat roofs that are planted, 0 to 1."""


class NoiseLevel(Report):
    """Differences between alignments under one noise and the alignment without noise."""

    disturbance: Disturbance
    """The noise."""

    position_m: MeanStd
    """Root mean square distance of the cameras, metres."""

    rotation_deg: MeanStd
    """Angle of the rotation between both, degrees."""

    scale_percent: MeanStd
    """Absolute change of scale, percent."""

    failed: int
    """Number of seeds without an alignment."""

    _parts = {"disturbance": "Disturbance", "position_m": "MeanStd", "rotation_deg": "MeanStd", "scale_percent": "MeanStd"}


class NormalAngle(Report):
    """Angles between normals of the test and of the nearest place of the reference, degrees from
    0 to 90."""

    n: int
    """Number of samples where both have a normal."""

    mean_deg: float
    """Mean."""

    median_deg: float
    """Median."""

    p90_deg: float
    """90th percentile."""


class NuthKaabSummary(Report):
    """Summary of the method of Nuth and Kääb."""

    levels: int
    """Number of reductions to the coarsest level."""

    iterations: int
    """Number of corrections."""

    steep_share: float
    """Share of the cells at the coarsest level that are steep enough."""

    last_step_m: float
    """Length of the last correction, metres."""

    converged: bool
    """Whether the corrections converged and lowered the NMAD."""

    nmad_before_m: float
    """NMAD of the differences before the alignment, metres."""

    nmad_after_m: float
    """NMAD of the differences after the alignment, metres."""


class ObjectsFound(Report):
    """Buildings and trees of the reference, as far as the test has them."""

    buildings: int
    """Number of buildings that count."""

    lost: int
    """Number of lost buildings."""

    damaged: int
    """Number of damaged buildings, the lost ones included."""

    tree_cells: int
    """Number of cells of trees."""

    trees_right: float | None
    """Share of the cells of trees that is right, 0 to 1. `None` without trees."""

    worst: list[DamagedBuilding]
    """The damaged buildings, in rising order of the share that is right."""

    _parts = {"worst": "DamagedBuilding"}


class OrthoPart(Report):
    """An image of an ortho."""

    path: str
    """The image."""

    incidence_deg: float
    """Angle from the vertical at the middle of the surface model, degrees."""

    corrected: bool
    """Whether the pointing was corrected."""

    seen: int
    """Cells that the image sees."""

    hidden: int
    """Cells that are hidden in the image."""

    used: int
    """Cells whose values come from the image."""

    balance: list[Balance]
    """Gain and offset by band."""

    _parts = {"balance": "Balance"}


class OrthoReport(Report):
    """A finished ortho."""

    ortho: str
    """File of the ortho."""

    mask: str
    """File of the mask."""

    report: str
    """File of this report; its page lies beside it."""

    size: list[int]
    """Columns and rows."""

    bands: int
    """Bands of the ortho."""

    cells_seen: int
    """Cells that show their own ground point."""

    cells_hidden: int
    """Cells that are hidden in every image that reaches them."""

    cells_outside: int
    """Cells that no image reaches."""

    cells_void: int
    """Cells without a height."""

    images: list[OrthoPart]
    """The images, in the order of the configuration."""

    _parts = {"images": "OrthoPart"}


class PairReport(Report):
    """A pair of images in the report."""

    images: list[int]
    """Positions of the images, counted from 1."""

    angle_deg: float
    """Angle between the two lines of sight at the centre of the scene, degrees."""

    overlap: float
    """Ground that both see, as a share of the smaller footprint."""

    parallax_px_per_m: float
    """Pixels that the second view moves against the first per metre of height."""

    ties: int
    """Number of tie points found."""


class PartMetrics(Report):
    """Errors over a part of the cells, metres; `None` where the part has no error."""

    reference_cells: int
    """Number of cells of the reference."""

    n: int
    """Number of cells with an error."""

    valid_ratio: float | None
    """Share of the reference that has an error."""

    mean: float | None
    """Mean."""

    median: float | None
    """Median."""

    mae: float | None
    """Mean absolute error."""

    rmse: float | None
    """Root mean square."""

    std: float | None
    """Standard deviation."""

    nmad: float | None
    """Normalised median absolute deviation."""

    le68: float | None
    """Absolute error that 68 % do not exceed."""

    le90: float | None
    """Absolute error that 90 % do not exceed."""

    le95: float | None
    """Absolute error that 95 % do not exceed."""

    min: float | None
    """Smallest error."""

    max: float | None
    """Largest error."""

    outliers: int | None
    """Number of outliers."""

    robust_mean: float | None
    """Mean without outliers."""

    robust_mae: float | None
    """Mean absolute error without outliers."""

    robust_rmse: float | None
    """Root mean square without outliers."""

    robust_std: float | None
    """Standard deviation without outliers."""


class Plan(Report):
    """Third stage of a run: everything that is needed to compute the chunks and to merge them. A
    scene that fits the memory is a plan of one chunk. A plan can be written as JSON and read back
    without a change of the result."""

    version: str
    """Version of the program that made the plan."""

    config: DsmConfig
    """Configuration of the run."""

    images: list[SceneImage]
    """Images with corrected cameras."""

    radiometry: list[ImageRadiometry]
    """Noise and contrast of the images."""

    grid: DsmGrid
    """Grid of the DSM."""

    useful: list[list[int]]
    """Pairs that see the same ground from different directions, the best angles first."""

    pixel_m: float
    """Side of a pixel of the coarsest image on the ground, metres."""

    step_m: float
    """Distance of two height hypotheses at full resolution, metres."""

    height_range: list[float]
    """Heights of the scene, metres above the ellipsoid."""

    tuning: SweepTuning
    """Parameters of the sweep."""

    chunk_side: int | None
    """Largest side of a chunk, cells; `None` when the scene is computed at once."""

    chunks: list[ChunkPlan]
    """Chunks, whose cores cover the grid."""

    report: PlanReport
    """Parts of the report that are known before the heights."""

    choices: list[Choice]
    """Choices made so far."""

    warnings: list[str]
    """Warnings given so far."""

    _parts = {"config": "DsmConfig", "images": "SceneImage", "radiometry": "ImageRadiometry", "grid": "DsmGrid", "tuning": "SweepTuning", "chunks": "ChunkPlan", "report": "PlanReport", "choices": "Choice"}


class PlanEstimate(Report):
    """What a plan will take. Times are rough: scenes and processors differ by a factor of two."""

    peak_mb: int
    """Largest memory of a chunk, megabytes."""

    cpu_seconds: float
    """Processor time of all chunks, seconds."""

    merge_mb: int
    """Memory of the merge, megabytes."""

    chunks: list[ChunkEstimate]
    """The chunks in the order of the plan."""

    _parts = {"chunks": "ChunkEstimate"}


class PlanFile(Report):
    """The plan of a run with the files that it rests on."""

    id: str
    """Identity: a hash of everything below but the times of the files."""

    estimate: PlanEstimate
    """Memory and processor time."""

    inputs: list[InputFile]
    """Files that the plan rests on."""

    plan: Plan
    """Grid, chunks with their windows, sources, heights and levels, choices with reasons."""

    _parts = {"estimate": "PlanEstimate", "inputs": "InputFile", "plan": "Plan"}


class PlanReport(Report):
    """Parts of the report that are known before the heights."""

    images: list[ImageReport]
    """Images in the order of the configuration."""

    pairs: list[PairReport]
    """Pairs that were matched."""

    pointing: PointingReport
    """Correction of the pointing."""

    _parts = {"images": "ImageReport", "pairs": "PairReport", "pointing": "PointingReport"}


class PointingReport(Report):
    """The correction of the pointing."""

    applied: bool
    """Whether it was applied."""

    order: Literal["none", "translation", "drift", "affine"]
    """Kind of the correction."""

    tracks: int
    """Number of ground points seen in two or more images."""

    inliers: int
    """Number of tracks that are no outliers."""

    contradictory_ties: int
    """Number of tie points that contradict better ones and were left out."""

    residual_before_px: float | None
    """Robust standard deviation of the residuals before the correction, pixels."""

    residual_after_px: float | None
    """Robust standard deviation of the residuals after the correction, pixels."""

    rms_px: float | None
    """Root mean square of the inliers' residuals after the correction, pixels."""

    images: list[ImagePointing]
    """What the tie points show of each image, in the order of the configuration."""

    control: ControlReport | None
    """Control points and check points; absent without them."""

    reference: ReferenceReport | None
    """Co-registration to a reference; absent without one."""

    _parts = {"images": "ImagePointing", "control": "ControlReport", "reference": "ReferenceReport"}

    _absent = {"control": None, "reference": None}


class PriorReport(Report):
    """A city model compared with the heights that a coarser level found."""

    model: str
    """File of the model."""

    buildings_seen: int
    """Number of buildings that at least one view sees."""

    disagreeing_views: int
    """Number of views that see the model, agree with hardly any of it, and do without it. A view
    counts once per chunk."""

    tolerance_m: float
    """Largest difference of heights that agree, metres."""

    left_out: list[LeftOut]
    """Buildings that some view leaves out."""

    _parts = {"left_out": "LeftOut"}


class PriorsJobReport(Report):
    """What was made, and what of the model could not be used."""

    product: PriorsProduct
    """The report of the dataset or of the maps."""

    unusable_objects: int
    """Number of objects of the model that could not be used."""

    output: str
    """Folder of the files."""

    bytes: int
    """Size of all files, bytes."""

    _parts = {"product": "PriorsProduct"}


class PriorsProduct(Report):
    """Priors of one kind of cameras."""

    generator: str
    """Program and version."""

    model: str
    """File of the city model."""

    cameras: str | None
    """Source of the cameras."""

    mode: str | None
    """`building-only` or `building-enhanced`."""

    notes: list[str]
    """Notes: choices with their reasons, and what was left out."""

    triangles: int
    """Number of triangles of the model in use."""

    sampled_area_m2: float | None
    """Sampled area, m²."""

    skipped_area_m2: list[list[str | float]] | None
    """Area that was not sampled, by class, m²."""

    samples: int | None
    """Number of points on the model."""

    kept: int | None
    """Number of points that enough views see."""

    min_views: int | None
    """Lowest number of views that must see a point."""

    pairs: int | None
    """Number of pairs of a view and a point that it sees."""

    views_histogram: list[int] | None
    """Number of points by the number of views that see them. The last entry counts that many
    views and more."""

    kept_by_class: list[list[str | int]] | None
    """Number of kept points, by class."""

    scene_points: int | None
    """Number of points taken from the structure from motion."""

    error_curve: list[ErrorRow] | None
    """Number of points against geometric error."""

    depth_png_step: float | None
    """Metres per step of the 16-bit depth maps. `None` if there are none."""

    commands: list[str] | None
    """Command lines that train on the dataset."""

    views: list[ViewRow] | None
    """One row per view."""

    settings: Any | None
    """Settings, by name."""

    model_crs: str | None
    """Reference system that the model states."""

    map: str | None
    """Map projection in which its coordinates were read."""

    model_heights_above: str | None
    """Vertical datum of its heights, in words."""

    images: list[SatelliteRow] | None
    """One row per image."""

    maps: Any | None
    """Description of the maps, by name."""

    _parts = {"error_curve": "ErrorRow", "views": "ViewRow", "images": "SatelliteRow"}

    _absent = {"cameras": None, "mode": None, "sampled_area_m2": None, "skipped_area_m2": None, "samples": None, "kept": None, "min_views": None, "pairs": None, "views_histogram": None, "kept_by_class": None, "scene_points": None, "error_curve": None, "depth_png_step": None, "commands": None, "views": None, "settings": None, "model_crs": None, "map": None, "model_heights_above": None, "images": None, "maps": None}


class ProductsReport(Report):
    """Products that were made."""

    surface: str
    """Surface model that the products were made of."""

    folder: str
    """Folder of the products."""

    ortho: str | None
    """Ortho that gave the colours."""

    colour: ColourReport | None
    """Where the colours come from."""

    dtm: DtmReport | None
    """The terrain model."""

    classes: ClassesReport | None
    """The classes."""

    contours: ContoursReport | None
    """The contour lines."""

    mesh: MeshReport | None
    """The mesh."""

    cloud: CloudReport | None
    """The point cloud."""

    _parts = {"colour": "ColourReport", "dtm": "DtmReport", "classes": "ClassesReport", "contours": "ContoursReport", "mesh": "MeshReport", "cloud": "CloudReport"}


class QuarterWeights(Report):
    """Relative frequency of the kinds of quarters. If all are zero, nothing is built."""

    park: float
    """Nothing."""

    hall: float
    """One flat-roofed hall."""

    rows: float
    """Two rows of terraced houses."""

    houses: float
    """Up to four detached houses."""

    courtyard: float
    """A closed block of five to seven storeys around a courtyard."""

    high_rise: float
    """One or two towers."""

    sheds: float
    """Long low sheds side by side."""

    suburb: float | None
    """Small gabled houses close to one another, with sheds and car ports."""

    dense_towers: float | None
    """Towers that fill their block up to the street."""

    warehouse: float | None
    """One large hall under an almost blank roof."""

    _absent = {"suburb": None, "dense_towers": None, "warehouse": None}


class ReferenceReport(Report):
    """How the scene was moved onto a reference elevation model. The corrections that were
    applied to the images hold it."""

    path: str
    """The reference."""

    shift_m: list[float]
    """Shift east, north and up that the surface was given, metres."""

    deviation_m: list[float]
    """Standard errors of the shift, metres, from the shifts that the parts of the scene find."""

    plane_m_per_km: list[float] | None
    """Tilt that the heights were given, metres per kilometre east and north; `None` unless asked
    for."""

    cells: int
    """Number of cells of the trial surface that were compared."""

    nmad_before_m: float | None
    """NMAD of the differences before the shift, metres."""

    nmad_after_m: float | None
    """NMAD of the differences after the shift, metres."""

    contrast: float
    """NMAD that a typical shift leaves, divided by that of the best one: near 1 there is no
    relief that both surfaces share."""

    last_shift_m: float
    """Length of the last shift, metres, which tells how well the first one was followed."""


class RegisterReport(Report):
    """The correction of an image, and how well it is known."""

    images: list[RegisteredImage]
    """The new image first, then the images of the model."""

    order: Literal["evidence", "shift", "drift", "affine"]
    """Order of the correction: shift, drift or affine."""

    tried: int
    """Points of the model that were searched for."""

    found: int
    """Points that were found."""

    agree: int
    """Points that agree with the correction."""

    rms_px: float
    """Root mean square residual of those, pixels."""

    median_px: float
    """Median length of the residuals of all points found, pixels."""

    shift_px: list[float]
    """Shift of the pixel in the middle of the image, pixels (sample, line)."""

    gsd_m: float
    """Ground sampling distance of the image, metres."""

    rounds: int
    """Rounds of matching."""

    size: list[int]
    """Columns and rows of the image."""

    residuals_px: list[list[float]]
    """Points that were found: sample, line, and residual along both after the correction,
    pixels."""

    _parts = {"images": "RegisteredImage"}


class RegisteredImage(Report):
    """An image with its correction."""

    path: str
    """The image."""

    applied_correction: ImageCorrection | None
    """Its correction, to be applied after the RPC."""

    _parts = {"applied_correction": "ImageCorrection"}


class Reliability(Report):
    """Reliability of the confidence."""

    right_below_m: float
    """Absolute error below which a height is right, metres."""

    tenths: list[ReliabilityRow]
    """One row per tenth of the confidence, from 0 to 1."""

    outside: int
    """Number of compared cells whose confidence is not a number from 0 to 1."""

    _parts = {"tenths": "ReliabilityRow"}


class ReliabilityRow(Report):
    """One row of the reliability table: cells with a confidence between two bounds."""

    # By its key: ["from"] is float.

    to: float
    """Upper bound of the confidence, exclusive except for the last row."""

    n: int
    """Number of cells."""

    promised: float | None
    """Mean confidence of the cells: the promised share. `None` without cells."""

    right: float | None
    """Share of the cells that is right. `None` without cells."""


class Rpc(Report):
    """The RPC00B coefficients of one image, in this toolkit's image coordinates (upper-left
    pixel centre at 0, 0)."""

    line_off: float
    """LINE_OFF, pixels."""

    samp_off: float
    """SAMP_OFF, pixels."""

    lat_off: float
    """LAT_OFF, degrees."""

    long_off: float
    """LONG_OFF, degrees."""

    height_off: float
    """HEIGHT_OFF, metres above the ellipsoid."""

    line_scale: float
    """LINE_SCALE, pixels."""

    samp_scale: float
    """SAMP_SCALE, pixels."""

    lat_scale: float
    """LAT_SCALE, degrees."""

    long_scale: float
    """LONG_SCALE, degrees."""

    height_scale: float
    """HEIGHT_SCALE, metres."""

    line_num: list[float]
    """LINE_NUM_COEFF."""

    line_den: list[float]
    """LINE_DEN_COEFF."""

    samp_num: list[float]
    """SAMP_NUM_COEFF."""

    samp_den: list[float]
    """SAMP_DEN_COEFF."""

    err_bias_m: float | None
    """ERR_BIAS, metres, where the provider gave it."""

    err_rand_m: float | None
    """ERR_RAND, metres, where the provider gave it."""


class RpcCamera(Report):
    """An RPC followed by an image-space correction. All jobs project with this camera."""

    rpc: Rpc
    """The provider's model."""

    correction: ImageCorrection
    """The correction of its pointing."""

    _parts = {"rpc": "Rpc", "correction": "ImageCorrection"}


class RpcCentre(Report):
    """Geometry at the centre of an RPC's domain."""

    ground: LonLatHeight
    """The centre on the ground."""

    image: ImagePoint
    """The centre in the image."""

    gsd_sample_m: float
    """Ground distance of one step along the sample axis, metres."""

    gsd_line_m: float
    """Ground distance of one step along the line axis, metres."""

    incidence_deg: float
    """Angle between the vertical and the direction to the sensor, degrees."""

    azimuth_deg: float
    """Direction to the sensor, degrees clockwise from north."""

    _parts = {"ground": "LonLatHeight", "image": "ImagePoint"}


class RpcConvertReport(Report):
    """What a conversion wrote."""

    source: str
    """File that held the RPC."""

    source_format: Literal["text", "rpb", "digital-globe-xml", "dimap", "alos", "ossim-geom", "json", "vrt", "aux-xml", "envi-header", "tiff-tag", "gdal-metadata"]
    """Format of that file."""

    output: str
    """File that was written."""

    format: Literal["text", "rpb", "digital-globe-xml", "dimap", "alos", "ossim-geom", "json", "vrt", "aux-xml", "envi-header", "tiff-tag", "gdal-metadata"]
    """Format that was written."""

    corrected: bool
    """Whether the RPC includes a pointing correction."""

    residual_px: float
    """Largest difference between the RPC that was written and the corrected one, pixels."""


class RpcInfoReport(Report):
    """An RPC and what follows from it."""

    file: str
    """The file that was asked for."""

    source: str
    """The file that holds the RPC: `file`, or one beside it."""

    format: Literal["text", "rpb", "digital-globe-xml", "dimap", "alos", "ossim-geom", "json", "vrt", "aux-xml", "envi-header", "tiff-tag", "gdal-metadata"]
    """Container of the RPC."""

    warnings: list[str]
    """Warnings of the reader, such as conventions that it had to guess."""

    image: RpcPixels | None
    """The image, where the file holds one."""

    rpc: Rpc
    """The model."""

    validity: RpcValidity
    """Box on which the model was fitted."""

    centre: RpcCentre | None
    """Geometry at the centre of the domain; absent where the model cannot be inverted there."""

    _parts = {"image": "RpcPixels", "rpc": "Rpc", "validity": "RpcValidity", "centre": "RpcCentre"}


class RpcPixels(Report):
    """The image of an RPC."""

    width: int
    """Columns."""

    height: int
    """Rows."""

    bands: list[str]
    """Names of the bands; empty for a band without one."""

    sample: str
    """Type of the stored samples."""

    bits: int | None
    """Significant bits of a sample, where the file says."""

    footprint_deg: list[list[float]] | None
    """Corners of the image on the ground at the height offset of the RPC, longitude and latitude
    in degrees: upper left, upper right, lower right, lower left. Absent where the model has no
    answer for one of them."""

    acquired: str | None
    """When the image was taken, UTC in the form of ISO 8601; absent where the file does not say."""

    satellite: str | None
    """The satellite; absent where the file does not say."""

    sun: SunPosition | None
    """Where the sun stood; absent where the file does not say."""

    _parts = {"sun": "SunPosition"}


class RpcValidity(Report):
    """Box on which an RPC was fitted, each pair least and greatest."""

    lon_deg: list[float]
    """Longitudes, degrees."""

    lat_deg: list[float]
    """Latitudes, degrees."""

    height_m: list[float]
    """Heights above the ellipsoid, metres."""


class SatelliteRow(Report):
    """Report of one image."""

    image: str
    """File of the image."""

    name: str
    """Name of its maps."""

    size: list[int]
    """Numbers of columns and rows."""

    hit_pixels: int
    """Number of pixels that see a building."""

    height_range_m: list[float] | None
    """Lowest and highest place seen, metres above the ellipsoid. `None` if no building is seen."""

    distance_from_height_m: float
    """Height from which distances are measured, metres above the ellipsoid."""

    line_of_sight_error_m: float
    """Largest distance between the approximated lines of sight and those of the RPC, metres."""

    corrected: bool
    """Whether a correction was applied to the RPC."""


class SceneImage(Report):
    """An image file with its camera."""

    path: str
    """File of the image."""

    number: int
    """Position at which the image was given, counted from 0."""

    rpc_format: str
    """Name of the format in which the RPC was found."""

    camera: RpcCamera
    """Camera in the frame of the whole image."""

    size: list[int]
    """Width and height, pixels."""

    acquired_s: int | None
    """When the image was taken, seconds of UTC since 1970; `None` where the file does not say."""

    satellite: str | None
    """Name of the satellite; `None` where neither the file nor its STAC item says."""

    sun: SunPosition | None
    """Where the sun stood; `None` where neither the file nor its STAC item says."""

    stated_incidence_deg: float | None
    """Angle of the line of sight to the vertical that the STAC item states, degrees. It is
    compared with that of the RPC."""

    gain: float
    """Factor of the grey values, a power of two: 1 unless a float image has a scale of its own,
    such as reflectances from 0 to 1. Noise and texture are then measured in numbers like those of
    sensors."""

    band: int | None
    """Band that is matched, counted from 1; the luma of all bands when `None`."""

    masks: list[str]
    """Masks of pixels that are not matched: rasters in the frame of the image, polygons on the
    ground."""

    doubts: list[str]
    """What is doubtful about the image and its RPC by themselves, a sentence for each finding."""

    _parts = {"camera": "RpcCamera", "sun": "SunPosition"}

    _absent = {"satellite": None, "sun": None, "stated_incidence_deg": None, "doubts": []}


class SceneRecord(Report):
    """The parameters and properties of a simulation, written beside its files."""

    config: SimulationConfig
    """The configuration."""

    epsg: int
    """EPSG code of the map."""

    origin_m: list[float]
    """Map coordinates of the scene's origin, metres."""

    height_range_m: list[float]
    """Lowest and highest point of the permanent scene, its surroundings included, metres above
    the ellipsoid."""

    buildings: int
    """Number of buildings, surroundings included."""

    trees: int
    """Number of trees, surroundings included."""

    views: list[ViewRecord]
    """The views in order."""

    _parts = {"config": "SimulationConfig", "views": "ViewRecord"}


class SceneReport(Report):
    """What became of a scene."""

    name: str
    """Name."""

    folder: str
    """Folder."""

    tasks: list[TaskReport]
    """Its tasks in the order in which they are done."""

    left_out: bool
    """Whether it was left out of this run. Its tasks are told as they stand, and do not count."""

    _parts = {"tasks": "TaskReport"}

    _absent = {"left_out": False}


class SearchSummary(Report):
    """Summary of a search."""

    radius_m: float
    """Search radius, metres."""

    candidates: int
    """Number of whole-cell shifts tried."""

    contrast: float
    """Median NMAD of all whole-cell shifts divided by the lowest. Near 1 the ground is too flat
    to find a shift."""

    at_edge: bool
    """Whether the best whole-cell shift lies at the edge of the searched disc. The true shift
    may then lie outside."""


class Season(Report):
    """The season of a date."""

    ground: float
    """Factor on the albedo of ground cover."""

    trees: float
    """Factor on the albedo of trees."""

    roofs: float
    """Factor on the albedo of roofs."""

    mtf_at_nyquist: float
    """Modulation transfer of the optics at the Nyquist frequency."""


class SeasonsConfig(Report):
    """What changes between dates. All zero, which is the default, changes nothing."""

    ground_spread: float
    """Largest change of the albedo of ground cover, as a natural logarithm."""

    tree_spread: float
    """Largest change of the albedo of trees, as a natural logarithm."""

    roof_spread: float
    """Largest change of the albedo of roofs, as a natural logarithm."""

    texture_share: float
    """Share of the variance of the fine texture that each date has of its own, 0 to 1."""

    sharpness_spread: float
    """Largest change of the modulation transfer at the Nyquist frequency, as a natural
    logarithm."""


class Sensor(Report):
    """The radiometry of one view."""

    dn_max: int
    """Largest digital number. 0 is reserved for no-data."""

    gain: float
    """Digital numbers between a black surface and a white one under full light."""

    offset: float
    """Digital number of a black surface: path radiance and dark current."""

    gamma: float
    """Exponent of the radiance."""

    electrons_at_white: float
    """Electrons of a white surface under full light."""

    read_noise_electrons: float
    """Standard deviation of the read noise, electrons."""


class SensorConfig(Report):
    """Optics, detector and quantisation."""

    bits: int
    """Bits of a digital number."""

    mtf_at_nyquist: float
    """Modulation transfer at the Nyquist frequency, pixel box included."""

    subpixels: int
    """Number of samples along each side of a pixel."""

    electrons_at_white: float
    """Electrons of a white surface under full light. The photon noise is the square root of the
    signal."""

    read_noise_electrons: float
    """Standard deviation of the read noise, electrons."""

    white_share: float
    """Share of the sensor's range that a white surface under full light reaches. Values above 1
    saturate."""

    offset_share: float
    """Value of a black surface as a share of the sensor's range: path radiance and dark current."""


class Sharpness(Report):
    """Overreach of a surface at the reference's roof edges."""

    edges: int
    """Number of positions on roof edges of the reference."""

    measured: int
    """Number of these positions where the test has an edge too."""

    overreach_m: ErrorStatistics | None
    """Overreach in metres, positive outwards. `None` if no position was measured."""

    median_cells: float | None
    """Median of the overreach in cells. `None` if no position was measured."""

    _parts = {"overreach_m": "ErrorStatistics"}


class Shift(Report):
    """Translation that was added to the test surface, metres. x and y are along the axes of the
    reference's map, z is up."""

    dx_m: float
    """Along the map's x axis (east for UTM)."""

    dy_m: float
    """Along the map's y axis (north for UTM)."""

    dz_m: float
    """Upwards."""


class SigmaCalibration(Report):
    """Stated standard deviations against errors, over one set of cells."""

    n: int
    """Number of cells with an error and a positive standard deviation."""

    below_1_sigma: float
    """Share of the absolute errors below one standard deviation, 0 to 1."""

    below_2_sigma: float
    """Share of the absolute errors below two standard deviations, 0 to 1."""

    median_ratio: float
    """Median of |error| / σ. It is 0.674 for normal errors with the stated σ."""

    median_sigma_m: float
    """Median of the stated standard deviations, metres."""


class SigmaReport(Report):
    """Calibration of the standard deviation of observed and of filled cells. All cells count as
    observed if the origin of the heights is not known."""

    observed: SigmaCalibration | None
    """The observed cells. `None` if none has a standard deviation."""

    filled: SigmaCalibration | None
    """The filled cells. `None` if none has a standard deviation."""

    _parts = {"observed": "SigmaCalibration", "filled": "SigmaCalibration"}


class SimilarityParts(Report):
    """A similarity as it is written to JSON: target = scale · rotation · source + translation."""

    scale: float
    """Length in the target per length in the source."""

    rotation: list[list[float]]
    """Rotation matrix, by rows."""

    translation: list[float]
    """Translation in the target."""


class SimulateReport(Report):
    """What was simulated."""

    scene: SceneRecord
    """The scene, as it is written to `scene.json`."""

    views: int
    """Number of satellite views."""

    flight: int
    """Number of perspective cameras."""

    output: str
    """Folder of the files."""

    _parts = {"scene": "SceneRecord"}


class SimulationConfig(Report):
    """A scene, its views and its sensor."""

    seed: int
    """Seed of all random numbers."""

    size_m: float
    """Side of the square area whose truth is known, metres."""

    gsd_m: float
    """Sampling distance of the images and cell size of the truth, metres."""

    views: int
    """Number of views."""

    lon_deg: float
    """Longitude of the centre, degrees."""

    lat_deg: float
    """Latitude of the centre, degrees."""

    ground_height_m: float
    """Mean height of the ground above the ellipsoid, metres."""

    absent_buildings: list[int]
    """Numbers of the buildings that do not stand, from 1 as in the truth's `buildings.tif`. All
    else stays as it was with them, which makes a second date of the same scene."""

    terrain: TerrainConfig
    """Bare ground."""

    buildings: BuildingsConfig
    """Streets and buildings."""

    vegetation: VegetationConfig
    """Trees."""

    vehicles: VehiclesConfig
    """Vehicles."""

    surface: AppearanceConfig
    """Ground cover and contrast."""

    acquisition: AcquisitionConfig
    """Directions, dates and light of the views."""

    sensor: SensorConfig
    """Optics and detector."""

    clouds: CloudsConfig
    """Clouds."""

    seasons: SeasonsConfig | None
    """Change of the scene and of the sharpness from date to date."""

    multispectral: MultispectralConfig | None
    """A multispectral image of each view beside the panchromatic one. `None` makes none."""

    _parts = {"terrain": "TerrainConfig", "buildings": "BuildingsConfig", "vegetation": "VegetationConfig", "vehicles": "VehiclesConfig", "surface": "AppearanceConfig", "acquisition": "AcquisitionConfig", "sensor": "SensorConfig", "clouds": "CloudsConfig", "seasons": "SeasonsConfig", "multispectral": "MultispectralConfig"}

    _absent = {"absent_buildings": [], "seasons": None, "multispectral": None}


class SplatConvertReport(Report):
    """What was written."""

    splats: int
    """Number of splats."""

    flat: bool
    """Whether they are discs."""

    sh_degree: int
    """Degree of the harmonics."""

    clipped: int
    """Splats with a colour that the format cannot hold, which was brought to the nearest that it
    can: SPZ has none below -0.44 and above 1.44."""

    labels_lost: int
    """Splats with a class and an object of a city model, which the format cannot hold: only PLY
    does."""

    bytes_before: int
    """Size of the file read, bytes."""

    bytes: int
    """Size of the file written, bytes."""


class SplatLabelReport(Report):
    """What the splats were labelled with."""

    splats: int
    """Number of splats."""

    labelled: int
    """Number of splats that lie on a surface of the city model."""

    classes: dict[str, int]
    """Number of labelled splats of each class."""

    objects: int
    """Number of objects that have splats."""

    objects_of_model: int
    """Number of objects with surfaces in the city model."""


class SplatRenderReport(Report):
    """What the cameras saw."""

    splats: int
    """Number of splats."""

    views: list[SplatRenderView]
    """One entry per camera."""

    _parts = {"views": "SplatRenderView"}


class SplatRenderView(Report):
    """What one camera saw."""

    name: str
    """Name of the view's files."""

    size: list[int]
    """Columns and rows."""

    coverage: float
    """Mean accumulated opacity."""

    psnr_db: float | None
    """Peak signal-to-noise ratio against the picture, decibels, where there is a picture: over
    the pixels that splats cover by more than half."""

    psnr_whole_db: float | None
    """The same over all pixels, as trainings judge their views."""

    ssim: float | None
    """Structural similarity with the picture, where there is a picture, over the covered pixels."""


class SplatsImageReport(Report):
    """How well the splats render back into one image."""

    seen: float
    """Share of the cells with a height that the view sees."""

    pixels: int
    """Number of pixels that show seen cells; the numbers below are over these."""

    psnr_db: float | None
    """Peak signal-to-noise ratio, decibels; the peak is 1 of the display range."""

    ssim: float | None
    """Structural similarity."""

    coverage: float
    """Mean accumulated weight."""

    gain: list[float]
    """Factor from this image's units to the reference's, per channel."""

    offset: list[float]
    """Offset from this image's units to the reference's, per channel."""

    image: str
    """The image."""


class SplatsReport(Report):
    """Number of splats, and how well they stand for the surface and the images."""

    cells: int
    """Number of cells with a height."""

    splats: int
    """Number of splats, walls included."""

    walls: int
    """Number of splats on walls."""

    walls_seen: int
    """Number of splats on walls whose colours an image shows. The others have the mean of the
    walls that are seen on the same outline, or of all."""

    walls_area_m2: float
    """Area of the walls, m²."""

    plane_error_max_m: float
    """Largest distance of a height from the plane of its splat, metres."""

    mean_height: HeightErrors | None
    """Errors of the heights rendered from above, without the walls, as the mean by weight."""

    median_height: HeightErrors | None
    """Errors of the heights rendered from above, without the walls, at half of the weight."""

    display_range: list[list[float]]
    """Values of the reference image at 0 and 1 of the display range, per channel."""

    views: list[SplatsImageReport]
    """How well the splats render back into each image."""

    uniform: list[CurvePoint]
    """Uniform splats of several sizes, when asked for."""

    uniform_at_equal_rmse: float | None
    """Number of uniform splats with the same root mean square error of mean heights, when asked
    for: interpolated in the logarithms, at most one per cell."""

    output: str
    """File that was written."""

    error_bound_m: float
    """Bound on the heights that was asked for, metres."""

    colour_bound: float
    """Bound on the colours that was asked for, as a share of the display range."""

    _parts = {"mean_height": "HeightErrors", "median_height": "HeightErrors", "views": "SplatsImageReport", "uniform": "CurvePoint"}


class SplitImage(Report):
    """A chosen image."""

    image: str
    """Name of the image."""

    wanted_iou: float | None
    """Overlap that was wanted; `None` for the first context."""

    iou: float | None
    """Overlap of a context with the first one, or average overlap of a target with all contexts;
    `None` for the first context."""


class SplitJobReport(Report):
    """The chosen views."""

    model: str
    """Folder of the model."""

    contexts: list[SplitImage]
    """Views to reconstruct from, in the order of choice."""

    targets: list[SplitImage]
    """Views to predict, in the order of the wanted overlaps."""

    deviation: float
    """Sum of the absolute differences between wanted and found overlaps."""

    _parts = {"contexts": "SplitImage", "targets": "SplitImage"}


class StageTime(Report):
    """The wall time of one stage."""

    stage: str
    """Name of the stage."""

    seconds: float
    """Wall time, seconds."""


class Sun(Report):
    """Direction of the sunlight."""

    elevation_deg: float
    """Elevation above the horizon, degrees, at least `Sun::LOWEST_DEG`."""

    azimuth_deg: float
    """Azimuth of the direction towards the sun, degrees clockwise from north."""


class SunPosition(Report):
    """Where the sun stood."""

    azimuth_deg: float
    """Clockwise from north, degrees."""

    elevation_deg: float
    """Above the horizon, degrees."""


class SurfaceComparison(Report):
    """Distances, angles and overlap of a test surface and a reference."""

    accuracy: DistanceStatistics
    """Distances from samples of the test to the reference."""

    completeness: DistanceStatistics
    """Distances from samples of the reference to the test."""

    scores: list[ThresholdScore]
    """Precision, recall and F at each threshold."""

    chamfer_m: float
    """Mean of the two mean distances, metres."""

    hausdorff_m: float
    """Largest of all distances, metres."""

    normal_angle: NormalAngle | None
    """Angle of the normals. `None` if no sample has two."""

    m3c2: M3c2 | None
    """Distances along normals. `None` if no core point has both surfaces in its cylinder."""

    voc: VoxelOverlap
    """Volumetric overlap."""

    test_samples_per_m2: float | None
    """Samples per square metre of the test, if it is a mesh."""

    reference_samples_per_m2: float | None
    """Samples per square metre of the reference, if it is a mesh."""

    _parts = {"accuracy": "DistanceStatistics", "completeness": "DistanceStatistics", "scores": "ThresholdScore", "normal_angle": "NormalAngle", "m3c2": "M3c2", "voc": "VoxelOverlap"}


class SurfaceComparisonConfig(Report):
    """Settings of the comparison of two surfaces."""

    thresholds_m: list[float]
    """Thresholds of precision, recall and F, metres."""

    samples_per_m2: float
    """Samples per square metre of a mesh."""

    max_samples: int
    """Highest number of samples of a mesh. A larger mesh is sampled more thinly."""

    seed: int
    """Seed of the positions of the samples."""

    normal_scale_m: float
    """D of M3C2: diameter of the ball in which normals are estimated, metres."""

    cylinder_m: float
    """d of M3C2: diameter of the cylinder, metres."""

    cylinder_reach_m: float
    """Reach of the cylinder on either side, metres."""

    max_core_points: int
    """Highest number of core points of M3C2. Of more samples, every n-th is a core point."""

    registration_m: float
    """Registration error that is added to the level of detection, metres."""

    voxel_m: float
    """Edge length of the voxels of VOC, metres."""


class SurfaceEvalReport(Report):
    """A finished comparison of two surfaces."""

    generator: str
    """"""

    kind: str
    """"""

    protocol: SurfaceProtocol
    """What was compared, and how."""

    result: SurfaceComparison
    """All distances and scores."""

    _parts = {"protocol": "SurfaceProtocol", "result": "SurfaceComparison"}


class SurfaceLayers(Report):
    """Layers that were found beside a surface, and what they say."""

    files: list[str]
    """Names of the files that were read."""

    cells_filled: int
    """Cells with a filled height."""

    cells_weak: int
    """Observed cells whose probability is too low to be evidence by itself."""


class SurfaceProtocol(Report):
    """What a comparison of surfaces compared, and how."""

    test: str
    """The evaluated surface, by name."""

    reference: str
    """The reference, by name."""

    test_format: str
    """Format and size of the test, in words."""

    reference_format: str
    """Format and size of the reference, in words."""

    crs: str | None
    """Coordinate reference system of both."""

    vertical: str | None
    """Vertical datum of both."""

    local_origin: list[float]
    """Position that local coordinates are counted from, metres."""

    alignment: str
    """Always `none`."""

    config: SurfaceComparisonConfig
    """Settings of the comparison."""

    notes: list[str]
    """Choices and doubts that a reader must know."""

    missed: list[str]
    """Requirements that are not met."""

    _parts = {"config": "SurfaceComparisonConfig"}


class SurfaceReport(Report):
    """The cells of a DSM."""

    cells: int
    """Number of cells."""

    observed: int
    """Number of cells with an observed height."""

    filled: int
    """Number of cells filled from their surroundings."""

    void: int
    """Number of cells without a height."""

    masked: int
    """Number of those of them that lie under a mask or outside the area."""

    streets: int
    """Number of filled cells between roofs, in quarters of which hardly any ground is known:
    they have the ground there as far as it is known, or that under the lowest heights around."""

    speckle_removed: int
    """Number of cells removed as speckle."""

    expected_right: float
    """Number of heights, observed and filled, that are expected to be right within 1 m, or
    within two cells where those are larger: the sum of their probabilities."""

    right_within_m: float
    """Error below which a height counts as right, metres: in `expected_right` and in
    `confidence.tif`."""

    kept_by_view: list[float]
    """Share of each view's pixels with which another view agrees."""

    kept_by_image: list[float | None]
    """The same for each image in the order of the configuration; `None` for one that is no view."""


class SweepLevels(Report):
    """Pyramid levels of a sweep; 0 is the full resolution."""

    finest: int
    """Finest level, whose heights are the result."""

    coarsest: int
    """Coarsest level, which searches the whole height range."""


class SweepTuning(Report):
    """Parameters of the sweep. The remaining ones are the same for all presets: the defaults of
    `sweep::LevelConfig`."""

    step_px: float
    """Parallax between neighbouring hypotheses in the pair with the most parallax per metre,
    pixels."""

    finest_level: int
    """Finest pyramid level whose heights are computed; 0 is the full resolution."""

    top_hypotheses: float
    """Largest number of hypotheses on the coarsest level: the height range is at most this many
    of its steps."""

    sources: int
    """Largest number of sources per view."""

    reach: int
    """Distance around a coarse pixel from which the next finer level takes over heights to
    search, coarse pixels."""

    reach_below: int
    """The same for lower heights, which begin farther away where streets are narrow, coarse
    pixels."""

    lattices: int
    """Number of lattices of pixels on which the finest level is swept, at most four."""

    jump_at_edge: int
    """Penalty of a height jump across the strongest image edges on the finest level, of 112 for
    the worst cost."""


class TaskReport(Report):
    """What became of a task."""

    task: Literal["dsm", "ortho", "eval", "heightmap", "priors", "dtm", "classes", "products", "diff"]
    """The task."""

    state: Literal["done", "done_before", "partial", "failed", "not_begun", "to_do"]
    """How it ended."""

    reason: str | None
    """Why it is not done."""

    attempts: int
    """Times that it was tried in the run that did it."""

    seconds: float
    """Wall time of the run that did it, seconds."""

    warnings: list[str]
    """Warnings of the run that did it."""

    _absent = {"reason": None, "warnings": []}


class TerrainConfig(Report):
    """The shape of the bare ground."""

    relief_m: float
    """Amplitude of the widest undulation, metres."""

    wavelength_m: float
    """Wavelength of the widest undulation, metres. Each further octave has half of it."""

    roughness: float
    """Amplitude of each octave relative to the one before."""

    pit_depth_m: float
    """Depth of a pit in the middle of the scene, metres; 0 for none."""

    bench_height_m: float
    """Height of the benches into which the ground is cut, metres; 0 for smooth ground."""

    water_share: float
    """Share of the area that is water, on one side of the scene; 0 for none."""

    quay_height_m: float
    """Height of the quay above the water, metres."""


class TerrainSource(Report):
    """Source of the terrain."""

    source: Literal["given", "ground-class", "estimated"]
    """Which of them it is."""

    cells: int | None
    """Number of ground cells."""

    window_m: float | None
    """Width of the largest window, metres."""

    slope: float | None
    """Slope of the ground that the filter allows, metres per metre."""

    _absent = {"cells": None, "window_m": None, "slope": None}


class ThresholdScore(Report):
    """Shares of distances below a threshold."""

    threshold_m: float
    """Threshold, metres."""

    precision: float
    """Share of the test that is nearer than this to the reference."""

    recall: float
    """Share of the reference that is nearer than this to the test."""

    f_score: float
    """Harmonic mean of precision and recall; 0 if both are 0."""


class TileRecord(Report):
    """A position and its tile."""

    id: str
    """Identifier of the position; the name of the folder."""

    status: Literal["made", "kept", "failed"]
    """Which of them it is."""

    reason: str | None
    """Why not."""

    _absent = {"reason": None}


class TilesReport(Report):
    """Tiles for the rows of a list, or for one camera."""

    made: int
    """Tiles that were made now."""

    kept: int
    """Tiles that an earlier run had made."""

    failed: int
    """Positions without a tile."""

    seconds: float
    """Duration of the job, seconds."""

    images: list[str]
    """The images."""

    tiles: list[TileRecord]
    """The positions, in the order of the list."""

    _parts = {"tiles": "TileRecord"}


class TrainConfig(Report):
    """A training of splats on a dataset."""

    dataset: str
    """Dataset of the priors job, or another folder with a COLMAP model in it or in a folder
    below, such as `sparse/0`."""

    more_points: str | None
    """Another COLMAP model of the same cameras, whose points are added to those of the dataset,
    such as the reconstruction that the cameras come from."""

    images: str | None
    """Folder of the images; when `None`, `images` of the dataset or the folder in or beside it
    that has the images of the model."""

    masks: str | None
    """Folder of a mask for each image, `NAME.jpg.png` or `NAME.png`: pixels that are 0 there
    count neither in the training nor in the judgement."""

    output: str
    """Folder for the results."""

    iterations: int
    """Number of iterations; each draws one view."""

    budget: int
    """Greatest number of splats. The training begins with at most half of them."""

    shrink: int
    """Pixels of an image that become one, in each direction."""

    hold_out: int
    """Every view of this number in the order of their names, from the first on, is kept for the
    judgement and not trained on (LLFF); none when 0."""

    hold_out_names: list[str]
    """Names of the views that are kept instead, where there are any."""

    preset: Literal["photographs", "building-only", "building-enhanced", "satellite"] | None
    """What the training is for; what the dataset says when `None`: buildings where the priors
    job wrote it, or else photographs."""

    weights: TrainWeights
    """Weights of the loss that differ from those of the preset."""

    steps: TrainSteps
    """Steps of the optimiser that differ from those of the preset."""

    prior_schedule: Literal["preset", "dataset"]
    """Where the factors of the priors by iteration come from."""

    schedule: TrainSchedule
    """Times of the training that differ from those of the preset."""

    priors: Literal["both", "depth", "normal", "none"]
    """Prior maps in use, as far as the dataset has them."""

    appearance: bool
    """Whether each image has a gain and an offset of its own."""

    transients: bool
    """Whether pixels that stay unexplained while other views agree are left out, such as
    vehicles."""

    seed: int
    """Seed of everything random."""

    checkpoint_every: int
    """Iterations between two checkpoints."""

    resume: bool
    """Whether a training that was stopped goes on."""

    threads: int | None
    """Worker threads; one per core when `None`."""

    overwrite: bool
    """Whether earlier results may be replaced."""

    _parts = {"weights": "TrainWeights", "steps": "TrainSteps", "schedule": "TrainSchedule"}


class TrainReport(Report):
    """A finished training."""

    settings: TrainConfig
    """The settings."""

    preset: Literal["photographs", "building-only", "building-enhanced", "satellite"]
    """What the training was for."""

    weights: TrainWeights
    """The weights of the loss that it had."""

    splats: str
    """The splats."""

    harmonics_degree: int
    """Highest degree of the harmonics of their colours."""

    splats_before: int
    """Number of splats at the beginning."""

    splats_after: int
    """Number of splats at the end."""

    masked: bool
    """Whether only what the masks show is modelled."""

    depth_scale: float
    """Factor of the prior depths, as learned."""

    seconds: float
    """Seconds of the iterations of this run."""

    transient_share: list[float]
    """Share of the pixels of each trained image that were left out as transient."""

    views: list[TrainedViewRow]
    """Quality of the views before and after."""

    losses: list[LossPoint]
    """Mean loss of the iterations before each point."""

    _parts = {"settings": "TrainConfig", "weights": "TrainWeights", "views": "TrainedViewRow", "losses": "LossPoint"}


class TrainSchedule(Report):
    """When things happen in a training; as in the preset where it is `None`."""

    distortion_from: float | None
    """Share of the training after which the distortion counts in full."""

    consistency_from: float | None
    """Share of the training after which the consistency of normals counts in full."""

    split_from: float | None
    """Share of the training from which on splats are split."""

    split_until: float | None
    """Share of the training after which splats are split no more."""

    split_every: float | None
    """Iterations between two rounds of splitting and removing."""

    split_gradient: float | None
    """Gradient by the position in the image, in halves of the image, above which a splat is
    split."""

    least_opacity: float | None
    """Opacity below which a splat is removed."""

    reset_every: float | None
    """Iterations between two times at which opacities are brought down; never when 0."""

    degree: float | None
    """Highest degree of the harmonics of colours, 0 to 3; the same colour from all sides when 0."""

    degree_every: float | None
    """Share of the training after which the degree grows by one, until it is the highest."""


class TrainSteps(Report):
    """Steps of the optimiser; those of the preset where they are `None`."""

    position_first: float | None
    """Of positions at the first iteration, sizes of the scene."""

    position_last: float | None
    """Of positions at the last iteration, sizes of the scene."""

    rotation: float | None
    """Of quaternions."""

    scale: float | None
    """Of the natural logarithms of scales."""

    opacity: float | None
    """Of the logits of opacities."""

    colour_first: float | None
    """Of colours from 0 to 1 at the first iteration."""

    colour_last: float | None
    """Of colours from 0 to 1 at the last iteration."""

    harmonics_first: float | None
    """Of the harmonics of colours at the first iteration."""

    harmonics_last: float | None
    """Of the harmonics of colours at the last iteration."""


class TrainWeights(Report):
    """Weights of the terms of the loss; those of the preset where they are `None`."""

    absolute: float | None
    """Absolute difference of colours from 0 to 1."""

    squared: float | None
    """Squared difference of colours from 0 to 1."""

    similarity: float | None
    """One less the structural similarity (D-SSIM)."""

    mask: float | None
    """Squared difference between coverage and mask, where there are masks."""

    distortion: float | None
    """Spread of the inverse depths of a ray, times the squared size of the scene; for satellite
    images that of the depths, over the squared size of the scene."""

    consistency: float | None
    """One less the cosine between the normals of splats and of drawn depths."""

    prior_depth: float | None
    """Difference from prior depths, over the size of the scene."""

    prior_normal: float | None
    """One less the cosine between the normals of splats and of the prior."""

    correlation: float | None
    """One less the correlation with heights of unknown scale."""

    exposure: float | None
    """Squared difference of the gains of images from 1 and of their offsets from 0."""


class TrainedViewRow(Report):
    """Quality of a view."""

    name: str
    """File name of the image."""

    held_out: bool
    """Whether the view was kept from the training."""

    psnr_before_db: float | None
    """Signal-to-noise ratio before the training, dB."""

    psnr_db: float | None
    """Signal-to-noise ratio, dB."""

    ssim_before: float | None
    """Structural similarity before the training."""

    ssim: float | None
    """Structural similarity."""

    ms_ssim: float | None
    """Structural similarity over five scales; none of images with a side below 176 pixels."""

    psnr_right_db: float | None
    """Signal-to-noise ratio over the right half of a photograph that was held out, dB."""

    psnr_right_exposed_db: float | None
    """The same after the gains and the offsets that bring its left half to the truth, dB: a
    photograph has an exposure of its own, which no training on others can know."""


class UnprojectReport(Report):
    """Points or splats that were written."""

    path: str
    """File that was written."""

    points: int | None
    """Number of points, if points were written."""

    splats: int | None
    """Number of splats, if splats were written."""

    camera: HeightMapTags
    """Metadata of the map."""

    _parts = {"camera": "HeightMapTags"}

    _absent = {"points": None, "splats": None}


class VegetationConfig(Report):
    """Trees: opaque crowns on free ground."""

    trees_per_ha: float
    """Trees per hectare of free ground."""

    height_m: list[float]
    """Lowest and highest tree, metres."""

    crowns: Literal["dome", "natural"] | None
    """Shape of the crowns."""

    _absent = {"crowns": None}


class VehiclesConfig(Report):
    """Vehicles along the streets, different ones on every date."""

    parked_share: float
    """Share of the parking places that are taken."""


class ViewRecord(Report):
    """How a view was taken."""

    look: Look
    """Line of sight."""

    date: Date
    """Date."""

    sensor: Sensor
    """Radiometry."""

    pointing_error_px: list[float]
    """Pointing error of the delivered RPC in the middle of the image, pixels (sample, line)."""

    pointing: ImageCorrection
    """Pointing error at every position: `delivered = pointing(true)`."""

    rpc_fit_error_px: float
    """Largest distance between the true RPC and the physical camera, pixels."""

    _parts = {"look": "Look", "date": "Date", "sensor": "Sensor", "pointing": "ImageCorrection"}


class ViewRow(Report):
    """Report of one view."""

    name: str
    """Name of the image."""

    size: list[int]
    """Numbers of columns and rows of its maps."""

    hit_pixels: int
    """Number of pixels that see a building."""

    depth_range: list[float] | None
    """Smallest and largest depth. `None` if no building is seen."""

    candidates: int
    """Number of points in the image."""

    visible: int
    """Number of these points that nothing hides."""


class Volume(Report):
    """Volumes of change over a set of cells, with standard deviations."""

    area_m2: float
    """Area of the cells with a difference, square metres."""

    unknown_m2: float
    """Area of the cells without one, square metres: they are not part of any volume."""

    gain_m3: float
    """Volume gained in regions of change, cubic metres."""

    gain_sigma_m3: float
    """Its standard deviation, cubic metres."""

    loss_m3: float
    """Volume lost in regions of change, cubic metres, as a positive number."""

    loss_sigma_m3: float
    """Its standard deviation, cubic metres."""

    net_m3: float
    """Sum of all differences, in regions of change or not, cubic metres."""

    net_sigma_m3: float
    """Its standard deviation, cubic metres."""


class VoxelOverlap(Report):
    """Overlap of occupied voxels. Corners of voxels are at whole multiples of the edge length
    from the local origin."""

    voxel_m: float
    """Edge length of a voxel, metres."""

    test: int
    """Number of voxels with samples of the test."""

    reference: int
    """Number of voxels with samples of the reference."""

    shared: int
    """Number of voxels with samples of both."""

    voc: float
    """Number of shared voxels divided by the number occupied by either: the volumetric overlap."""

    completeness: float
    """Number of shared voxels divided by the number of the reference."""

    correctness: float
    """Number of shared voxels divided by the number of the test."""


class Window(Report):
    """Rectangle of whole pixels: `[x, x + width) × [y, y + height)`. It may reach outside an
    image."""

    x: int
    """First column."""

    y: int
    """First row."""

    width: int
    """Number of columns."""

    height: int
    """Number of rows."""
