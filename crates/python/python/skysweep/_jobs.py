"""The jobs as functions. Made by `make stubs` of the configurations; do not edit.

Every function takes the settings of a job as keywords and returns the job's report. Paths are text,
`os.PathLike` or open rasterio datasets; CRSs are EPSG codes, `pyproj.CRS` or `rasterio.CRS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

from ._call import BoundsLike, CrsCode, PathLike, Progress, job, run as run_job
from .reports import (
    AlignJobReport,
    BatchReport,
    BuildingMapReport,
    ChunkRunReport,
    CityConvertReport,
    CitySummary,
    ClassesReport,
    ComposeReport,
    DiffReport,
    DsmReport,
    DtmReport,
    GridEvalReport,
    GroundViewReport,
    HeightMapReport,
    MapEvalReport,
    MeshJobReport,
    OrthoReport,
    PlanFile,
    PriorsJobReport,
    ProductsReport,
    RegisterReport,
    RpcConvertReport,
    RpcInfoReport,
    SimulateReport,
    SplatConvertReport,
    SplatLabelReport,
    SplatRenderReport,
    SplatsReport,
    SplitJobReport,
    SurfaceEvalReport,
    TilesReport,
    TrainReport,
    UnprojectReport,
)

__all__ = [
    "dsm",
    "plan_run",
    "make_plan",
    "read_plan",
    "run_chunks",
    "merge_run",
    "batch",
    "dtm",
    "classes",
    "buildings",
    "diff",
    "products",
    "ortho",
    "register",
    "evaluate_grids",
    "evaluate_surfaces",
    "evaluate_maps",
    "kind_of_evaluation",
    "heightmap",
    "unproject",
    "tiles",
    "groundview",
    "compose",
    "priors",
    "splats",
    "render_splats",
    "convert_splats",
    "label_splats",
    "train",
    "mesh",
    "align",
    "split",
    "city_info",
    "city_convert",
    "rpc_info",
    "rpc_convert",
    "simulate",
]


class BuildingIndexConfig(TypedDict, total=False):
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


class ChangeConfig(TypedDict, total=False):
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


class ClassifyConfig(TypedDict, total=False):
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


class EvalRequirements(TypedDict, total=False):
    """Requirements on the result of an evaluation."""

    max_mae: float | None
    """Largest mean absolute error, metres; for surfaces the mean distance of the test to the
    reference, for normals the mean angle in degrees."""

    min_completeness: Sequence[MinCompleteness]
    """Least completeness at some thresholds."""


class GroundConfig(TypedDict, total=False):
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


class LayerArea(TypedDict, total=False):
    """Polygons of a layer."""

    file: PathLike
    """GeoPackage or GeoJSON."""

    layer: str | None
    """Layer; the only one when `None`."""

    field: str
    """Field that holds the names of the polygons."""

    name: str | None
    """Name of the polygon; all polygons when `None`, and in a batch that of the scene."""


class MapConfig(TypedDict, total=False):
    """Options for the maps."""

    depth: Literal["ZDepth", "RayLength"]
    """Meaning of the depth."""

    normals: Literal["World", "Camera"]
    """Axes of the normals."""


class MinCompleteness(TypedDict, total=False):
    """A completeness that must be reached."""

    threshold_m: float
    """Threshold of the absolute error, metres."""

    share: float
    """Least share of the cells, 0 to 1."""


class NoiseConfig(TypedDict, total=False):
    """Kinds and amounts of noise."""

    translation_m: Sequence[float]
    """Standard deviations of the positions, metres."""

    rotation_deg: Sequence[float]
    """Standard deviations of the heading, degrees."""

    seeds: int
    """Repetitions of each level."""


PriorsClassWeight = TypedDict("PriorsClassWeight", {"class": "str", "weight": "float"}, total=False)


class StandConfig(TypedDict, total=False):
    """Positions and headings of cameras."""

    source: Mapping[str, Any]
    """Where the positions come from."""

    heading_deg: float | None
    """Heading in degrees clockwise from true north. It overrides the camera file; the rows of a
    list override it."""

    ground_offset_m: float
    """Height of the camera above the ground, metres, where its height is not known otherwise."""

    height_m: float | None
    """Height of the camera above the ellipsoid, metres. It overrides the camera file; the rows
    of a list override it."""


class TrainSchedule(TypedDict, total=False):
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


class TrainSteps(TypedDict, total=False):
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


class TrainWeights(TypedDict, total=False):
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


class VisibilityConfig(TypedDict, total=False):
    """Conditions for a point to be seen and to be kept."""

    margin_px: float
    """Distance from the borders of the image, pixels; a point must be inside by at least this
    much."""

    near_m: float
    """Depth of the near plane, metres."""

    epsilon_m: float
    """Length ε of the last part of the ray, which is not tested for occlusion, metres."""

    max_incidence_deg: float | None
    """Largest angle between the ray and the normal, degrees; `None` allows any angle, also
    surfaces seen from behind."""

    min_views: int
    """Number of views that a point needs to be kept."""

    max_observations: int
    """Largest number of observations that are kept per point."""


class DsmSettings(TypedDict, total=False):
    """Settings of :func:`dsm`."""

    area: LayerArea | PathLike | None
    band: int | str | None
    bounds: BoundsLike | None
    bounds_epsg: CrsCode | None
    chunk: int | None
    control: PathLike | None
    corrections: PathLike | None
    crs_epsg: CrsCode | None
    dem: PathLike | None
    dem_vertical: str | None
    fill: Literal["none", "justified", "all"]
    force_crs: bool
    gsd_m: float | None
    height_range_m: Sequence[float] | None
    image_masks: Sequence[PathLike]
    masks: Sequence[PathLike]
    memory_mb: int | None
    overwrite: bool
    pairs: Sequence[Sequence[int]] | None
    pointing: bool
    preset: Literal["fast", "balanced", "accurate"]
    prior: PathLike | None
    products: Sequence[Literal["cloud", "dtm", "classes", "contours", "mesh"]]
    reference_dem: PathLike | None
    reference_plane: bool
    references: Sequence[int] | None
    threads: int | None
    tile: int
    vertical: str


class EvaluateSettings(TypedDict, total=False):
    """Settings of :func:`evaluate_grids`, :func:`evaluate_surfaces` and :func:`evaluate_maps`."""

    alignment: Literal["none", "z", "xyz", "nuth-kaab"]
    all_objects: bool
    classes: PathLike | None
    confidence: PathLike | None
    cylinder_m: float
    cylinder_reach_m: float
    error_map: PathLike | None
    kind: Literal["depth", "normals", "mask"] | None
    lod: str | None
    mask: PathLike | None
    max_mae: float | None
    normal_scale_m: float
    objects: PathLike | None
    output: PathLike | None
    overwrite: bool
    page: PathLike | None
    reference_cell_m: float | None
    reference_vertical: str | None
    registration_m: float
    requirements: EvalRequirements | None
    sample_seed: int
    samples_per_m2: float
    search_m: float
    skip: Sequence[int]
    standing_m: float
    target: Literal["run_folder", "nowhere"] | Mapping[str, Any]
    terrain: PathLike | None
    test_vertical: str | None
    threads: int | None
    thresholds_m: Sequence[float]
    voxel_m: float
    progress: Progress


@job
def dsm(
    images: Sequence[PathLike],
    output: PathLike,
    *,
    gsd_m: float | None = None,
    crs_epsg: CrsCode | None = None,
    bounds: BoundsLike | None = None,
    bounds_epsg: CrsCode | None = None,
    area: LayerArea | PathLike | None = None,
    masks: Sequence[PathLike] = (),
    image_masks: Sequence[PathLike] = (),
    band: int | str | None = None,
    height_range_m: Sequence[float] | None = None,
    dem: PathLike | None = None,
    reference_dem: PathLike | None = None,
    reference_plane: bool = False,
    dem_vertical: str | None = None,
    prior: PathLike | None = None,
    control: PathLike | None = None,
    corrections: PathLike | None = None,
    force_crs: bool = False,
    vertical: str = "ellipsoid",
    preset: Literal["fast", "balanced", "accurate"] = "balanced",
    fill: Literal["none", "justified", "all"] = "justified",
    pairs: Sequence[Sequence[int]] | None = None,
    references: Sequence[int] | None = None,
    pointing: bool = True,
    products: Sequence[Literal["cloud", "dtm", "classes", "contours", "mesh"]] = (),
    threads: int | None = None,
    memory_mb: int | None = None,
    chunk: int | None = None,
    tile: int = 1024,
    overwrite: bool = False,
    progress: Progress = None,
) -> DsmReport:
    """Make a surface model from satellite images with RPCs.

    Args:
        images: Image files, two or more, each with its RPC inside or beside it.
        output: Folder for the results.
        gsd_m: Cell size of the DSM, metres.
        crs_epsg: EPSG code of the horizontal CRS.
        bounds: Area of the DSM, in its CRS.
        bounds_epsg: EPSG code of the CRS of `bounds` where that is another one, such as 4326 for
            degrees. The grid is the rectangle around them.
        area: Polygons in which the DSM lies. Cells outside are void, and without `bounds` the grid
            is the rectangle around them.
        masks: Ground without heights, such as water: polygons (GeoJSON, GeoPackage, shapefile), and
            georeferenced rasters where they are neither 0 nor without data.
        image_masks: Pixels that are not matched, such as clouds: polygons on the ground, and
            rasters in the frame of an image. The name of each begins with that of its image.
        band: Band to match; the luma of all bands when `None`.
        height_range_m: Heights to search, metres above the ellipsoid.
        dem: Coarse elevation model from which the height range is taken.
        reference_dem: Surface model to which the pointing is co-registered.
        reference_plane: Whether the heights are also tilted onto the reference by a plane.
        dem_vertical: What the heights of `dem` and `reference_dem` are above; the datum that a file
            names when `None`.
        prior: City model whose roofs are expected.
        control: Ground control points and check points with their places in the images (CSV,
            GeoJSON).
        corrections: Pointing corrections of an earlier run to start from: its `pointing.json` or
            its report.
        force_crs: Whether a CRS may be used far outside its area of use, where its coordinates mean
            little.
        vertical: Datum of the heights of the DSM.
        preset: Trade-off of speed and accuracy.
        fill: Choice of the voids that are closed.
        pairs: Pairs of images to match, by positions that are written from 1; all useful ones when
            `None`.
        references: Images to compute heights for, by positions that are written from 1; all when
            `None`.
        pointing: Whether the pointing of the RPCs is corrected.
        products: What is made of the DSM beside it, as `crate::products` does.
        threads: Number of worker threads; all cores when `None`.
        memory_mb: Memory limit, megabytes; 4000 when `None`. A scene that takes more is computed by
            chunks.
        chunk: Side of the chunks of a large scene, cells; as large as the memory allows when
            `None`.
        tile: Side of the output tiles that are fused at a time, cells. It changes the memory
            needed, never the result.
        overwrite: Whether existing results may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.dsm(["left.tif", "right.tif"], "run", gsd_m=0.5, preset="fast")
        >>> print(report.surface.observed)
    """
    return run_job("dsm", locals(), DsmReport)


@job
def plan_run(
    images: Sequence[PathLike],
    output: PathLike,
    *,
    gsd_m: float | None = None,
    crs_epsg: CrsCode | None = None,
    bounds: BoundsLike | None = None,
    bounds_epsg: CrsCode | None = None,
    area: LayerArea | PathLike | None = None,
    masks: Sequence[PathLike] = (),
    image_masks: Sequence[PathLike] = (),
    band: int | str | None = None,
    height_range_m: Sequence[float] | None = None,
    dem: PathLike | None = None,
    reference_dem: PathLike | None = None,
    reference_plane: bool = False,
    dem_vertical: str | None = None,
    prior: PathLike | None = None,
    control: PathLike | None = None,
    corrections: PathLike | None = None,
    force_crs: bool = False,
    vertical: str = "ellipsoid",
    preset: Literal["fast", "balanced", "accurate"] = "balanced",
    fill: Literal["none", "justified", "all"] = "justified",
    pairs: Sequence[Sequence[int]] | None = None,
    references: Sequence[int] | None = None,
    pointing: bool = True,
    products: Sequence[Literal["cloud", "dtm", "classes", "contours", "mesh"]] = (),
    threads: int | None = None,
    memory_mb: int | None = None,
    chunk: int | None = None,
    tile: int = 1024,
    overwrite: bool = False,
    progress: Progress = None,
) -> PlanFile:
    """Plan a surface model in parts into the run folder `output`.

    Args:
        images: Image files, two or more, each with its RPC inside or beside it.
        output: Folder for the results.
        gsd_m: Cell size of the DSM, metres.
        crs_epsg: EPSG code of the horizontal CRS.
        bounds: Area of the DSM, in its CRS.
        bounds_epsg: EPSG code of the CRS of `bounds` where that is another one, such as 4326 for
            degrees. The grid is the rectangle around them.
        area: Polygons in which the DSM lies. Cells outside are void, and without `bounds` the grid
            is the rectangle around them.
        masks: Ground without heights, such as water: polygons (GeoJSON, GeoPackage, shapefile), and
            georeferenced rasters where they are neither 0 nor without data.
        image_masks: Pixels that are not matched, such as clouds: polygons on the ground, and
            rasters in the frame of an image. The name of each begins with that of its image.
        band: Band to match; the luma of all bands when `None`.
        height_range_m: Heights to search, metres above the ellipsoid.
        dem: Coarse elevation model from which the height range is taken.
        reference_dem: Surface model to which the pointing is co-registered.
        reference_plane: Whether the heights are also tilted onto the reference by a plane.
        dem_vertical: What the heights of `dem` and `reference_dem` are above; the datum that a file
            names when `None`.
        prior: City model whose roofs are expected.
        control: Ground control points and check points with their places in the images (CSV,
            GeoJSON).
        corrections: Pointing corrections of an earlier run to start from: its `pointing.json` or
            its report.
        force_crs: Whether a CRS may be used far outside its area of use, where its coordinates mean
            little.
        vertical: Datum of the heights of the DSM.
        preset: Trade-off of speed and accuracy.
        fill: Choice of the voids that are closed.
        pairs: Pairs of images to match, by positions that are written from 1; all useful ones when
            `None`.
        references: Images to compute heights for, by positions that are written from 1; all when
            `None`.
        pointing: Whether the pointing of the RPCs is corrected.
        products: What is made of the DSM beside it, as `crate::products` does.
        threads: Number of worker threads; all cores when `None`.
        memory_mb: Memory limit, megabytes; 4000 when `None`. A scene that takes more is computed by
            chunks.
        chunk: Side of the chunks of a large scene, cells; as large as the memory allows when
            `None`.
        tile: Side of the output tiles that are fused at a time, cells. It changes the memory
            needed, never the result.
        overwrite: Whether existing results may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> plan = skysweep.plan_run(["left.tif", "right.tif"], "run", gsd_m=0.5, chunk=2048)
    """
    return run_job("plan_run", locals(), PlanFile)


@job
def make_plan(
    images: Sequence[PathLike],
    output: PathLike,
    *,
    gsd_m: float | None = None,
    crs_epsg: CrsCode | None = None,
    bounds: BoundsLike | None = None,
    bounds_epsg: CrsCode | None = None,
    area: LayerArea | PathLike | None = None,
    masks: Sequence[PathLike] = (),
    image_masks: Sequence[PathLike] = (),
    band: int | str | None = None,
    height_range_m: Sequence[float] | None = None,
    dem: PathLike | None = None,
    reference_dem: PathLike | None = None,
    reference_plane: bool = False,
    dem_vertical: str | None = None,
    prior: PathLike | None = None,
    control: PathLike | None = None,
    corrections: PathLike | None = None,
    force_crs: bool = False,
    vertical: str = "ellipsoid",
    preset: Literal["fast", "balanced", "accurate"] = "balanced",
    fill: Literal["none", "justified", "all"] = "justified",
    pairs: Sequence[Sequence[int]] | None = None,
    references: Sequence[int] | None = None,
    pointing: bool = True,
    products: Sequence[Literal["cloud", "dtm", "classes", "contours", "mesh"]] = (),
    threads: int | None = None,
    memory_mb: int | None = None,
    chunk: int | None = None,
    tile: int = 1024,
    overwrite: bool = False,
    progress: Progress = None,
) -> PlanFile:
    """Plan a surface model in parts and write nothing.

    Args:
        images: Image files, two or more, each with its RPC inside or beside it.
        output: Folder for the results.
        gsd_m: Cell size of the DSM, metres.
        crs_epsg: EPSG code of the horizontal CRS.
        bounds: Area of the DSM, in its CRS.
        bounds_epsg: EPSG code of the CRS of `bounds` where that is another one, such as 4326 for
            degrees. The grid is the rectangle around them.
        area: Polygons in which the DSM lies. Cells outside are void, and without `bounds` the grid
            is the rectangle around them.
        masks: Ground without heights, such as water: polygons (GeoJSON, GeoPackage, shapefile), and
            georeferenced rasters where they are neither 0 nor without data.
        image_masks: Pixels that are not matched, such as clouds: polygons on the ground, and
            rasters in the frame of an image. The name of each begins with that of its image.
        band: Band to match; the luma of all bands when `None`.
        height_range_m: Heights to search, metres above the ellipsoid.
        dem: Coarse elevation model from which the height range is taken.
        reference_dem: Surface model to which the pointing is co-registered.
        reference_plane: Whether the heights are also tilted onto the reference by a plane.
        dem_vertical: What the heights of `dem` and `reference_dem` are above; the datum that a file
            names when `None`.
        prior: City model whose roofs are expected.
        control: Ground control points and check points with their places in the images (CSV,
            GeoJSON).
        corrections: Pointing corrections of an earlier run to start from: its `pointing.json` or
            its report.
        force_crs: Whether a CRS may be used far outside its area of use, where its coordinates mean
            little.
        vertical: Datum of the heights of the DSM.
        preset: Trade-off of speed and accuracy.
        fill: Choice of the voids that are closed.
        pairs: Pairs of images to match, by positions that are written from 1; all useful ones when
            `None`.
        references: Images to compute heights for, by positions that are written from 1; all when
            `None`.
        pointing: Whether the pointing of the RPCs is corrected.
        products: What is made of the DSM beside it, as `crate::products` does.
        threads: Number of worker threads; all cores when `None`.
        memory_mb: Memory limit, megabytes; 4000 when `None`. A scene that takes more is computed by
            chunks.
        chunk: Side of the chunks of a large scene, cells; as large as the memory allows when
            `None`.
        tile: Side of the output tiles that are fused at a time, cells. It changes the memory
            needed, never the result.
        overwrite: Whether existing results may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> plan = skysweep.make_plan(["left.tif", "right.tif"], "run", memory_mb=2000)
        >>> print(len(plan.plan.chunks))
    """
    return run_job("make_plan", locals(), PlanFile)


@job
def read_plan(
    folder: PathLike,
    *,
    progress: Progress = None,
) -> PlanFile:
    """Read the plan of a run folder.

    Args:
        folder: Folder of a planned run.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> plan = skysweep.read_plan("run")
    """
    return run_job("read_plan", locals(), PlanFile)


@job
def run_chunks(
    folder: PathLike,
    *,
    chunks: str | None = None,
    resume: bool = False,
    threads: int | None = None,
    plan: str | None = None,
    progress: Progress = None,
) -> ChunkRunReport:
    """Compute chunks of a planned run.

    Args:
        folder: Folder of a planned run. Several processes may work in it at once.
        chunks: Chunks to compute: numbers from 0 (`3,7`), or a share (`2/5` is the second of five);
            all that nobody else computes when `None`.
        resume: Whether failed chunks are tried again, and what no longer fits is planned and
            computed again.
        threads: Worker threads; all cores when `None`.
        plan: Identity of the plan; another one is refused.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.run_chunks("run", chunks="2/5", threads=4)
        >>> print(report.computed)
    """
    return run_job("run_chunks", locals(), ChunkRunReport)


@job
def merge_run(
    folder: PathLike,
    *,
    partial: bool = False,
    overwrite: bool = False,
    threads: int | None = None,
    plan: str | None = None,
    progress: Progress = None,
) -> DsmReport:
    """Make the surface model of the computed chunks of a planned run.

    Args:
        folder: Folder of a planned run whose chunks are computed.
        partial: Whether chunks without a result are left void. Otherwise they are an error.
        overwrite: Whether existing products may be replaced.
        threads: Worker threads; all cores when `None`.
        plan: Identity of the plan; another one is refused.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.merge_run("run", partial=True)
    """
    return run_job("merge_run", locals(), DsmReport)


@job
def batch(
    file: PathLike,
    *,
    only: Sequence[str] = (),
    dry_run: bool = False,
    progress: Progress = None,
) -> BatchReport:
    """Do the scenes and tasks that a batch file names.

    Args:
        file: Batch file (TOML).
        only: Scenes to work on, by name; all when empty. The others are reported as they stand.
        dry_run: Whether to say what would be done, and what would be refused, and do nothing.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.batch("night.toml", progress=True)
    """
    return run_job("batch", locals(), BatchReport)


@job
def dtm(
    surface: PathLike,
    output: PathLike,
    *,
    surface_vertical: str | None = None,
    terrain: GroundConfig | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> DtmReport:
    """Find the bare ground under a surface model, and the heights above it.

    Args:
        surface: Surface model on a map with square cells, or the folder of a DSM run.
        output: Folder for the rasters and the report.
        surface_vertical: Vertical datum of the surface model, where the file names none or a wrong
            one. The heights are not converted.
        terrain: Parameters of the search for the ground.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.dtm("run", "terrain", surface_vertical="egm96")
    """
    return run_job("dtm", locals(), DtmReport)


@job
def classes(
    surface: PathLike,
    output: PathLike,
    *,
    vegetation_index: PathLike | None = None,
    multispectral: Sequence[PathLike] = (),
    red_band: int | str | None = None,
    nir_band: int | str | None = None,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    building_index: PathLike | None = None,
    terrain: GroundConfig | None = None,
    classes: ClassifyConfig | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> ClassesReport:
    """Find ground, buildings and vegetation of a surface model.

    Args:
        surface: Surface model on a map with square cells, or the folder of a DSM run.
        output: Folder for the rasters and the report.
        vegetation_index: Vegetation index (NDVI, −1 to 1) on any grid, which overrules the
            roughness.
        multispectral: Multispectral images with RPCs, of which the vegetation index is made.
        red_band: Red band of the multispectral images. `None` takes the one that the file names.
        nir_band: Near-infrared band of the multispectral images. `None` takes the one that the file
            names.
        corrections: Where the pointing corrections of the multispectral images come from.
        building_index: Building index (0 to 1) on any grid, which decides where the heights are
            weak.
        terrain: Parameters of the search for the ground.
        classes: Parameters of the classes.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.classes("run", "classes", multispectral=["multispectral.tif"])
    """
    return run_job("classes", locals(), ClassesReport)


@job
def buildings(
    image: PathLike,
    output: PathLike,
    *,
    surface: PathLike | None = None,
    surface_vertical: str | None = None,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    gsd_m: float | None = None,
    index: BuildingIndexConfig | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> BuildingMapReport:
    """Make an index of buildings from one image, in its pixels or on a surface model.

    Args:
        image: The image.
        output: GeoTIFF to write; the report is written beside it.
        surface: Surface model on a map, or the folder of a DSM run, on which the index is laid.
            `None` leaves it in the pixels of the image.
        surface_vertical: Vertical datum of the surface model, where the file names none or a wrong
            one.
        corrections: Where the pointing correction of the image comes from, on a surface model.
        gsd_m: Ground sampling distance of the image, metres. `None` takes that of its RPC or its
            map.
        index: Parameters of the index.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.buildings("left.tif", "index.tif", surface="run")
    """
    return run_job("buildings", locals(), BuildingMapReport)


@job
def diff(
    before: PathLike,
    after: PathLike,
    output: PathLike,
    *,
    alignment: Literal["none", "z", "xyz", "nuth-kaab"] = "xyz",
    search_m: float = 5.0,
    block_m: float | None = None,
    sigma_m: float | None = None,
    use_filled: bool = False,
    before_vertical: str | None = None,
    after_vertical: str | None = None,
    areas: PathLike | None = None,
    areas_layer: str | None = None,
    areas_field: str | None = None,
    overreach_m: float | None = None,
    change: ChangeConfig | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> DiffReport:
    """Find what changed between two surface models, with volumes.

    Args:
        before: Surface model of the first date, or the folder of a DSM run. The results lie on its
            grid.
        after: Surface model of the second date, or the folder of a DSM run.
        output: Folder for the results.
        alignment: Shift of the second surface that is removed first.
        search_m: Radius of the horizontal search, metres.
        block_m: Side of blocks that are moved on their own after the shift, metres: against jitter
            and drifts, which one shift leaves. `None` moves the surface as a whole.
        sigma_m: Standard deviation of the heights of a surface without a `sigma.tif` beside it,
            metres.
        use_filled: Whether filled cells count as observed.
        before_vertical: Vertical datum of the first surface, where the file names none or a wrong
            one.
        after_vertical: Vertical datum of the second surface, where the file names none or a wrong
            one.
        areas: Polygons (GeoPackage or GeoJSON) whose volumes are wanted.
        areas_layer: Layer of a GeoPackage with several.
        areas_field: Field of the polygons that holds their names.
        overreach_m: Distance by which walls reach too far outwards, metres. `None` takes what
            surfaces of this toolkit have where both surfaces come with their layers, and 0
            otherwise.
        change: Parameters of the search for change, without the overreach.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.diff("run_2023", "run_2024", "change", areas="blocks.geojson", areas_field="name")
        >>> print(report.areas)
    """
    return run_job("diff", locals(), DiffReport)


@job
def products(
    run: PathLike,
    *,
    output: PathLike | None = None,
    products: Sequence[Literal["cloud", "dtm", "classes", "contours", "mesh"]] = ("cloud", "dtm", "classes", "contours", "mesh"),
    ortho: PathLike | None = None,
    filled: bool = False,
    contour_interval: float | None = None,
    mesh_tolerance_m: float | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> ProductsReport:
    """Make point clouds, terrain and other products of a surface model.

    Args:
        run: Folder of the run.
        output: Folder for the products; `products` in the run when `None`.
        products: What is made.
        ortho: Ortho that colours the products, on the map of the surface model. `None` makes one of
            the images of the run, or takes the one that an earlier call made.
        filled: Whether the cloud has the filled cells, too, flagged as synthetic points.
        contour_interval: Step between contour lines, in the unit of the heights (metres, or feet
            where the vertical datum counts in feet); chosen from the relief and the cell size when
            `None`.
        mesh_tolerance_m: Largest vertical distance of the mesh from the cells, metres; the median
            standard deviation of the heights, between a quarter and the whole of a cell, when
            `None`.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.products("run", products=["cloud", "dtm"])
    """
    return run_job("products", locals(), ProductsReport)


@job
def ortho(
    images: Sequence[PathLike],
    surface: PathLike,
    output: PathLike,
    *,
    cell_m: float | None = None,
    bounds: BoundsLike | None = None,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    surface_vertical: str | None = None,
    tolerance_m: float = 0.05,
    balance: bool = True,
    mosaic: Literal["best", "feather", "median"] = "best",
    keep_hidden: bool = False,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> OrthoReport:
    """Lay satellite images on a surface model, hidden cells marked.

    Args:
        images: Images with RPCs, at most 255.
        surface: Surface model on a map, or the folder of a DSM run.
        output: GeoTIFF to write; the mask is written beside it.
        cell_m: Cell size, metres. `None` takes the grid of the surface model.
        bounds: Area on the map of the surface model: x_min, y_min, x_max, y_max. `None` takes all
            of it.
        corrections: Where the pointing corrections of the images come from.
        surface_vertical: Vertical datum of the surface model, where the file names none or a wrong
            one.
        tolerance_m: Height by which the surface must stand above a line of sight to hide what is
            behind it, metres.
        balance: Whether the grey values of several images are brought together.
        mosaic: How the values of several images become one.
        keep_hidden: Whether cells that are hidden in every image take the value of what hides them.
            Otherwise they are no-data.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.ortho(["left.tif"], "run", "orthos", cell_m=0.5)
    """
    return run_job("ortho", locals(), OrthoReport)


@job
def register(
    image: PathLike,
    model: Mapping[str, Any],
    output: PathLike,
    *,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    vertical: str | None = None,
    reach_px: float = 20.0,
    order: Literal["evidence", "shift", "drift", "affine"] = "evidence",
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> RegisterReport:
    """Correct the RPC of an image by a surface model or splats.

    Args:
        image: Image with an RPC.
        model: What it is registered to.
        output: Report to write (JSON), which holds the correction.
        corrections: Source of the pointing corrections of the model's images.
        vertical: Vertical datum of the surface model; the one that the file states when `None`.
        reach_px: Largest error of the pointing that is searched for, pixels of the image.
        order: What is corrected.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether an existing report may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> model = {"surface": {"dsm": "run", "images": ["left.tif"]}}
        >>> report = skysweep.register("new.tif", model, "new.json")
    """
    return run_job("register", locals(), RegisterReport)


@job
def evaluate_grids(
    test: PathLike,
    reference: PathLike,
    *,
    alignment: Literal["none", "z", "xyz", "nuth-kaab"] = "xyz",
    search_m: float = 5.0,
    thresholds_m: Sequence[float] = (0.5, 1.0, 2.5, 7.5),
    classes: PathLike | None = None,
    skip: Sequence[int] = (),
    mask: PathLike | None = None,
    terrain: PathLike | None = None,
    confidence: PathLike | None = None,
    objects: PathLike | None = None,
    standing_m: float = 2.0,
    reference_cell_m: float | None = None,
    test_vertical: str | None = None,
    reference_vertical: str | None = None,
    target: Literal["run_folder", "nowhere"] | Mapping[str, Any] = "run_folder",
    page: PathLike | None = None,
    error_map: PathLike | None = None,
    overwrite: bool = False,
    requirements: EvalRequirements | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> GridEvalReport:
    """Measure the errors of a surface model against a reference.

    Args:
        test: Surface model to evaluate, on any grid, or the folder of a DSM run.
        reference: Surface model that is believed, the folder of a DSM run, or a LAS or LAZ cloud.
            Errors are measured at its cells.
        alignment: What is removed before the comparison.
        search_m: Radius of the horizontal search, metres.
        thresholds_m: Thresholds of completeness and accuracy, metres.
        classes: Class raster on any grid, read at the nearest cell.
        skip: Classes whose cells are left out of everything, the alignment too.
        mask: Raster on any grid, read at the nearest cell. Only cells where it is not zero count.
        terrain: Terrain model. `None` takes the terrain from the cells of class ground, or else
            estimates it from the reference.
        confidence: Confidence of each cell of the test, on its grid; more is better. `None` takes
            `confidence.tif` beside the test, if there is one.
        objects: Raster on any grid, read at the nearest cell: 0 is ground, −1 a tree, and a
            positive number is the building that the cell belongs to.
        standing_m: Least height above the terrain of cells that count as standing, metres.
        reference_cell_m: Side of the cells into which a reference cloud is gridded, metres. `None`
            takes the longer side of the test's cells.
        test_vertical: Vertical datum of the test, where the file names none or a wrong one.
        reference_vertical: Vertical datum of the reference, where the file names none or a wrong
            one.
        target: Folder of the report.
        page: File for the HTML page alone.
        error_map: GeoTIFF for the errors (test − reference, metres) on the grid of the reference.
        overwrite: Whether files may be replaced that no evaluation wrote.
        requirements: Requirements on the result.
        threads: Worker threads. `None` uses all cores.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.evaluate_grids("run", "lidar.laz", alignment="xyz", error_map="errors.tif")
        >>> print(report.metrics.mae)
    """
    return run_job("evaluate_grids", locals(), GridEvalReport)


@job
def evaluate_surfaces(
    test: PathLike,
    reference: PathLike,
    *,
    thresholds_m: Sequence[float] = (0.1, 0.2, 0.5, 1.0),
    samples_per_m2: float = 25.0,
    sample_seed: int = 0,
    normal_scale_m: float = 1.0,
    cylinder_m: float = 1.0,
    cylinder_reach_m: float = 3.0,
    registration_m: float = 0.0,
    voxel_m: float = 0.5,
    lod: str | None = None,
    all_objects: bool = False,
    test_vertical: str | None = None,
    reference_vertical: str | None = None,
    output: PathLike | None = None,
    overwrite: bool = False,
    requirements: EvalRequirements | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> SurfaceEvalReport:
    """Measure how far meshes, city models or clouds are from one another.

    Args:
        test: Surface to evaluate: OBJ, PLY, CityJSON, CityGML, LAS or LAZ.
        reference: Surface that is believed.
        thresholds_m: Thresholds of precision, recall and F-score, metres.
        samples_per_m2: Samples per square metre of a mesh, up to a million in all.
        sample_seed: Seed of the samples.
        normal_scale_m: D of M3C2: diameter in which normals are estimated, metres.
        cylinder_m: d of M3C2: diameter of its cylinders, metres.
        cylinder_reach_m: Length of the cylinders on either side, metres.
        registration_m: Registration error, which is part of the level of detection of M3C2, metres.
        voxel_m: Edge of the voxels of the volumetric overlap, metres.
        lod: Level of detail of city models. `None` takes the highest of each object up to 2.x.
        all_objects: Whether every object of a city model that has surfaces is used, not only
            buildings.
        test_vertical: Vertical datum of the test, where the file names none or a wrong one.
        reference_vertical: Vertical datum of the reference, where the file names none or a wrong
            one.
        output: Folder for `report.json`.
        overwrite: Whether a file may be replaced that no evaluation wrote.
        requirements: Requirements on the result.
        threads: Worker threads. `None` uses all cores.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.evaluate_surfaces("town.ply", "town.city.json", lod="2.2")
    """
    return run_job("evaluate_surfaces", locals(), SurfaceEvalReport)


@job
def evaluate_maps(
    test: PathLike,
    reference: PathLike,
    *,
    kind: Literal["depth", "normals", "mask"] | None = None,
    max_mae: float | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> MapEvalReport:
    """Compare depths, normals or masks in the pixels of one camera.

    Args:
        test: Map to evaluate.
        reference: Map that is believed.
        kind: Kind of both maps. `None` finds it from shape and type of the reference.
        max_mae: Largest mean error: metres for depths, degrees for normals.
        threads: Worker threads. `None` uses all cores.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.evaluate_maps("depth.npy", "truth.npy", kind="depth")
    """
    return run_job("evaluate_maps", locals(), MapEvalReport)


@job
def kind_of_evaluation(
    test: PathLike,
    reference: PathLike,
    *,
    progress: Progress = None,
) -> str:
    """Name the evaluation for two files: grids, surfaces or maps.

    Args:
        test: File to evaluate.
        reference: File that is believed.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        ``grids``, ``surfaces`` or ``maps``.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> kind = skysweep.kind_of_evaluation("run", "lidar.laz")
    """
    return run_job("kind_of_evaluation", locals(), str)


@job
def heightmap(
    source: PathLike,
    output: PathLike,
    stand: StandConfig,
    *,
    size_px: int = 518,
    resolution_px_per_m: float = 2.0,
    terrain: PathLike | None = None,
    normalization: Literal["none", "auto"] | Mapping[str, Any] = "none",
    confidence: Literal["none", "automatic"] | Mapping[str, Any] = "none",
    map: Literal["local", "utm"] | Mapping[str, Any] = "local",
    interpolation: Literal["nearest", "bilinear", "cubic"] = "bilinear",
    source_epsg: CrsCode | None = None,
    source_vertical: str | None = None,
    lod: str | None = None,
    all_objects: bool = False,
    previews: bool = False,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> HeightMapReport:
    """Make height maps seen from above around a camera, turned to its heading.

    Args:
        source: Surface model (raster), city model (CityJSON, CityGML, OBJ, PLY) or point cloud
            (LAS, LAZ, COPC).
        output: GeoTIFF to write; for a list the folder of the maps.
        stand: Positions and headings of the cameras.
        size_px: Pixels along each side.
        resolution_px_per_m: Pixels per metre on the ground.
        terrain: Terrain model: the ground under the camera, and the height where the source has
            none.
        normalization: Unit of the heights.
        confidence: Where the confidences come from.
        map: Map projection to write in.
        interpolation: Interpolation between the cells of a raster.
        source_epsg: EPSG code of the source, where the file names none or a wrong one.
        source_vertical: Vertical datum of the source, where the file names none or a wrong one.
        lod: Level of detail of a city model. `None` takes the highest of each object up to 2.x.
        all_objects: Whether every object of a city model is used, not only buildings.
        previews: Whether a picture is written beside each map.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing maps are replaced. Otherwise a list goes on where an earlier run
            was stopped.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> place = {"lon_deg": 5.4, "lat_deg": 43.53}
        >>> report = skysweep.heightmap("run", "map.tif", {"source": {"position": place}}, size_px=256)
    """
    return run_job("heightmap", locals(), HeightMapReport)


@job
def unproject(
    map: PathLike,
    output: PathLike,
    *,
    axes: Literal["world", "camera"] = "world",
    splats: bool = False,
    picture: PathLike | None = None,
    merge_m: float | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> UnprojectReport:
    """Turn a height map into points or splats.

    Args:
        map: Height map that skysweep made.
        output: File to write: `.ply` (metres from the camera), or `.las` or `.laz` (UTM, heights
            above the ellipsoid).
        axes: Axes of the points of a PLY.
        splats: Whether Gaussian splats are written instead of points (PLY, with its origin beside
            it), one for each pixel.
        picture: Picture of the map's own pixels that gives the splats their colours. Without it
            they are grey.
        merge_m: Splats whose heights are within this distance of one plane, and whose colours are
            alike, are merged, metres.
        overwrite: Whether an existing file may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.unproject("map.tif", "points.ply", axes="world")
    """
    return run_job("unproject", locals(), UnprojectReport)


@job
def tiles(
    source: PathLike,
    output: PathLike,
    stand: StandConfig,
    *,
    size_px: int = 518,
    resolution_px_per_m: float = 2.0,
    terrain: PathLike | None = None,
    normalization: Literal["none", "auto"] | Mapping[str, Any] = "none",
    confidence: Literal["none", "automatic"] | Mapping[str, Any] = "none",
    map: Literal["local", "utm"] | Mapping[str, Any] = "local",
    interpolation: Literal["nearest", "bilinear", "cubic"] = "bilinear",
    source_epsg: CrsCode | None = None,
    source_vertical: str | None = None,
    lod: str | None = None,
    all_objects: bool = False,
    previews: bool = False,
    threads: int | None = None,
    overwrite: bool = False,
    images: Sequence[PathLike] = (),
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    mosaic: Literal["best", "feather", "median"] = "best",
    progress: Progress = None,
) -> TilesReport:
    """Make a folder for each position with its height map, satellite picture and cameras.

    Args:
        source: Surface model (raster), city model (CityJSON, CityGML, OBJ, PLY) or point cloud
            (LAS, LAZ, COPC).
        output: GeoTIFF to write; for a list the folder of the maps.
        stand: Positions and headings of the cameras.
        size_px: Pixels along each side.
        resolution_px_per_m: Pixels per metre on the ground.
        terrain: Terrain model: the ground under the camera, and the height where the source has
            none.
        normalization: Unit of the heights.
        confidence: Where the confidences come from.
        map: Map projection to write in.
        interpolation: Interpolation between the cells of a raster.
        source_epsg: EPSG code of the source, where the file names none or a wrong one.
        source_vertical: Vertical datum of the source, where the file names none or a wrong one.
        lod: Level of detail of a city model. `None` takes the highest of each object up to 2.x.
        all_objects: Whether every object of a city model is used, not only buildings.
        previews: Whether a picture is written beside each map.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing maps are replaced. Otherwise a list goes on where an earlier run
            was stopped.
        images: Images with RPCs. Empty takes those of the run that made the surface model.
        corrections: Where the pointing corrections of the images come from.
        mosaic: How the values of several images become one.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> place = {"lon_deg": 5.4, "lat_deg": 43.53}
        >>> report = skysweep.tiles("run", "tiles", {"source": {"position": place}}, images=["left.tif"], size_px=256)
    """
    return run_job("tiles", locals(), TilesReport)


@job
def groundview(
    surface: PathLike,
    output: PathLike,
    cameras: Mapping[str, Any],
    *,
    panorama_width_px: int = 1024,
    crops: int = 4,
    crop_size_px: int = 512,
    crop_fov_deg: float = 90.0,
    pictures: PathLike | None = None,
    points_per_view: int = 2000,
    surface_vertical: str | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> GroundViewReport:
    """Make depths, normals and sky of cameras and panoramas on the ground.

    Args:
        surface: Height map or surface model (raster), or city model (CityJSON, CityGML, OBJ, PLY),
            on a map in metres.
        output: Folder to write.
        cameras: Cameras that look at the surface.
        panorama_width_px: Columns of a panorama; it has half as many rows.
        crops: Perspective crops of each panorama, evenly around from its heading on.
        crop_size_px: Pixels along each side of a crop.
        crop_fov_deg: Field of view of a crop, degrees.
        pictures: Folder with the pictures of the panoramas (`ID.png`, `ID.jpg` or `ID.tif`; a
            single panorama is called `panorama`). Crops are cut from them.
        points_per_view: Most points of the surface per perspective camera in the COLMAP model.
        surface_vertical: Vertical datum of the surface, where the file names none or a wrong one.
        threads: Worker threads. `None` uses all cores.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.groundview("run", "views", {"model": "sparse/0"})
    """
    return run_job("groundview", locals(), GroundViewReport)


@job
def compose(
    ground: PathLike,
    alpha: PathLike,
    satellite: PathLike,
    output: PathLike,
    *,
    overwrite: bool = False,
    progress: Progress = None,
) -> ComposeReport:
    """Lay a rendered ground layer over a satellite layer.

    Args:
        ground: Colours of the ground layer.
        alpha: Opacity of the ground layer: 0 to the largest value of the file's type, or 0 to 1 in
            floats.
        satellite: Colours of the satellite layer.
        output: PNG to write.
        overwrite: Whether an existing file may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.compose("ground.png", "alpha.png", "satellite.png", "both.png")
    """
    return run_job("compose", locals(), ComposeReport)


@job
def priors(
    model: PathLike,
    cameras: Sequence[PathLike],
    output: PathLike,
    *,
    offset: Sequence[float] | None = None,
    transform: PathLike | None = None,
    image_size: Sequence[int] | None = None,
    map_epsg: CrsCode | None = None,
    vertical: str | None = None,
    corrections: PathLike | None = None,
    mode: Literal["building-only", "building-enhanced"] = "building-only",
    trainer: Literal["2dgs", "gsplat"] = "2dgs",
    recrop: bool = False,
    maps_only: bool = False,
    lod: str | None = None,
    all_objects: bool = False,
    amount: Mapping[str, Any] | None = None,
    spacing: Literal["Random", "Stratified", "PoissonDisk"] = "Stratified",
    class_weights: Sequence[PriorsClassWeight] = (),
    seed: int = 0,
    visibility: VisibilityConfig | None = None,
    maps: MapConfig | None = None,
    extras: bool = False,
    images: Literal["none", "beside"] | Mapping[str, Any] = "none",
    miss: Literal["inf", "nan", "0"] = "inf",
    geotiff: bool = False,
    previews: int = 12,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> PriorsJobReport:
    """Make depth, normal and mask priors of a city model for the cameras of a scene.

    Args:
        model: City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
        cameras: One COLMAP folder (or a folder with `sparse/0` in it), one `transforms.json`, or
            satellite images with RPCs (files, or a folder of them).
        output: Folder for the dataset.
        offset: Origin of the cameras' frame in the model's coordinates. Perspective cameras only.
        transform: File with the similarity from the model's coordinates to the cameras' frame;
            excludes `offset`. Perspective cameras only.
        image_size: Columns and rows of the images, for a `transforms.json` that does not state
            them.
        map_epsg: EPSG code of the model's map, where its file does not state it. Satellite images
            only.
        vertical: Vertical datum of the model, where its file does not state it. Satellite images
            only.
        corrections: Report of a DSM run with the pointing corrections of the images; RPCs as they
            are when `None`. Satellite images only.
        mode: What is to be trained.
        trainer: The trainer that the dataset is for.
        recrop: Whether cameras are cropped whose principal point is off the middle of the image.
        maps_only: Whether only maps are made, for lenses of any kind.
        lod: Level of detail; the highest of each object up to 2.x when `None`.
        all_objects: Whether everything in the model hides what is behind it, and not only
            buildings.
        amount: Number or density of the points.
        spacing: How points keep a distance from each other.
        class_weights: Weights of surface classes that differ from the mode's own.
        seed: Seed of everything random.
        visibility: When a camera sees a point, and which points are kept.
        maps: Meaning of depths and normals in the maps.
        extras: Whether files are written that repeat others in another form: the COLMAP model as
            text, the points as PLY beside `sparse`, and initial splats of the points.
        images: Where the pictures of the dataset come from. Perspective cameras only.
        miss: Depth of pixels that see no building, in the `.npy` maps. Perspective cameras only.
        geotiff: Whether the maps are written as GeoTIFF too.
        previews: Number of views with preview pictures.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether an earlier dataset may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.priors("town.city.json", ["cameras"], "priors", mode="building-only")
    """
    return run_job("priors", locals(), PriorsJobReport)


@job
def splats(
    dsm: PathLike,
    images: Sequence[PathLike],
    output: PathLike,
    *,
    error_m: float = 0.25,
    colour_error: float = 0.037,
    uniform_side: int | None = None,
    walls: bool = True,
    confidence: PathLike | None = None,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    vertical: str | None = None,
    discs: bool = False,
    sh_degree: int = 0,
    compare: bool = False,
    report: PathLike | None = None,
    renderings: PathLike | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SplatsReport:
    """Make Gaussian splats of a surface model and its images.

    Args:
        dsm: The surface model, in a projected CRS in metres.
        images: Images with RPCs that give the colours.
        output: File to write (PLY); its origin is written beside it.
        error_m: Largest distance of a height from the plane of its splat, metres.
        colour_error: Largest standard deviation of the colours under one splat, as a share of the
            display range. Infinity leaves the division to the geometry.
        uniform_side: Side of square splats, cells; splats as large as the bounds allow when `None`.
        walls: Whether the walls between cells get splats. Square splats have none.
        confidence: Confidence of the cells, 0 to 1, on the grid of the surface model; it becomes
            opacity. Full when `None`.
        corrections: Source of the pointing corrections of the images.
        vertical: Vertical datum of the surface model; the one that the file states when `None`.
        discs: Whether splats have two scales (2DGS) instead of three (3DGS).
        sh_degree: Degree of the spherical harmonics in the file, 0 to 3. The original 3DGS and 2DGS
            loaders expect 3.
        compare: Whether uniform splats of several sizes are measured for comparison.
        report: File for the report (JSON), whose page is written beside it.
        renderings: Folder for the splats as each image sees them (PNG, in the display range).
        threads: Worker threads; one per core when `None`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.splats("run", ["left.tif", "right.tif"], "splats.ply", walls=False)
    """
    return run_job("splats", locals(), SplatsReport)


@job
def render_splats(
    splats: PathLike,
    output: PathLike,
    *,
    images: Sequence[PathLike] = (),
    cameras: PathLike | None = None,
    pictures: PathLike | None = None,
    shrink: int = 1,
    corrections: Literal["surface_run", "uncorrected"] | Mapping[str, Any] = "surface_run",
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SplatRenderReport:
    """Look at splats through satellite images and perspective cameras.

    Args:
        splats: Splats (PLY of 3DGS or 2DGS, SPZ, SOG or glTF) with their origin beside them. Files
            of other programs have none: they lie in the frame of the perspective cameras.
        output: Folder to write.
        images: Images with RPCs to look through.
        cameras: Perspective cameras to look through: folder of a COLMAP model on the map of the
            splats with `origin.json`, or of a dataset of the priors job.
        pictures: Folder with the pictures of the perspective cameras; cameras without a picture are
            rendered and not compared. `images` of the dataset when `None`.
        shrink: Pixels of a perspective camera that become one, in each direction.
        corrections: Source of the pointing corrections of the images.
            `CorrectionSource::SurfaceRun` takes those that the splats were made with, which lie
            beside them, or else those of the run in whose folder they lie.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.render_splats("splats.ply", "views", images=["left.tif"])
    """
    return run_job("render_splats", locals(), SplatRenderReport)


@job
def convert_splats(
    splats: PathLike,
    output: PathLike,
    *,
    discs: bool | None = None,
    sh_degree: int | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SplatConvertReport:
    """Bring splats to another format: PLY of 3DGS or 2DGS, SPZ, SOG, binary glTF.

    Args:
        splats: File of splats of any format, with its origin beside it where it has one.
        output: File to write, whose ending names its format: `.ply`, `.spz`, `.sog` or `.glb`. The
            origin goes beside it.
        discs: Whether a PLY has two scales for each splat (2DGS) rather than three (3DGS); as in
            the file when `None`. The other formats always have three.
        sh_degree: Degree of the harmonics, 0 to 3: padded with zeros or cut; that of the file when
            `None`.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.convert_splats("splats.ply", "splats.spz", sh_degree=0)
    """
    return run_job("convert_splats", locals(), SplatConvertReport)


@job
def label_splats(
    splats: PathLike,
    city: PathLike,
    output: PathLike,
    *,
    tolerance_m: float = 0.5,
    transform: PathLike | None = None,
    vertical: str | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SplatLabelReport:
    """Carry class and object of a city model onto splats.

    Args:
        splats: File of splats of any format, with its origin beside it where it lies on a map.
        city: City model: CityJSON, CityGML, OBJ, PLY.
        output: File to write, a PLY: the other formats hold no labels. The origin and the table of
            the objects go beside it.
        tolerance_m: Greatest root mean square distance of a splat's mass from the surface that it
            takes, metres of the city model.
        transform: Similarity from the city model to the frame that the origin of the splats is
            counted in (JSON), where the two do not lie on one map.
        vertical: Vertical datum of the heights of the city model; the one that its file states when
            `None`.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.label_splats("splats.ply", "town.city.json", "labelled.ply")
    """
    return run_job("label_splats", locals(), SplatLabelReport)


@job
def train(
    dataset: PathLike,
    output: PathLike,
    *,
    more_points: PathLike | None = None,
    images: PathLike | None = None,
    masks: PathLike | None = None,
    iterations: int = 3000,
    budget: int = 100000,
    shrink: int = 1,
    hold_out: int = 8,
    hold_out_names: Sequence[str] = (),
    preset: Literal["photographs", "building-only", "building-enhanced", "satellite"] | None = None,
    weights: TrainWeights | None = None,
    steps: TrainSteps | None = None,
    prior_schedule: Literal["preset", "dataset"] = "dataset",
    schedule: TrainSchedule | None = None,
    priors: Literal["both", "depth", "normal", "none"] = "both",
    appearance: bool = False,
    transients: bool = False,
    seed: int = 1,
    checkpoint_every: int = 500,
    resume: bool = False,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> TrainReport:
    """Train flat Gaussian splats on the images of a dataset, with building priors.

    Args:
        dataset: Dataset of the priors job, or another folder with a COLMAP model in it or in a
            folder below, such as `sparse/0`.
        output: Folder for the results.
        more_points: Another COLMAP model of the same cameras, whose points are added to those of
            the dataset, such as the reconstruction that the cameras come from.
        images: Folder of the images; when `None`, `images` of the dataset or the folder in or
            beside it that has the images of the model.
        masks: Folder of a mask for each image, `NAME.jpg.png` or `NAME.png`: pixels that are 0
            there count neither in the training nor in the judgement.
        iterations: Number of iterations; each draws one view.
        budget: Greatest number of splats. The training begins with at most half of them.
        shrink: Pixels of an image that become one, in each direction.
        hold_out: Every view of this number in the order of their names, from the first on, is kept
            for the judgement and not trained on (LLFF); none when 0.
        hold_out_names: Names of the views that are kept instead, where there are any.
        preset: What the training is for; what the dataset says when `None`: buildings where the
            priors job wrote it, or else photographs.
        weights: Weights of the loss that differ from those of the preset.
        steps: Steps of the optimiser that differ from those of the preset.
        prior_schedule: Where the factors of the priors by iteration come from.
        schedule: Times of the training that differ from those of the preset.
        priors: Prior maps in use, as far as the dataset has them.
        appearance: Whether each image has a gain and an offset of its own.
        transients: Whether pixels that stay unexplained while other views agree are left out, such
            as vehicles.
        seed: Seed of everything random.
        checkpoint_every: Iterations between two checkpoints.
        resume: Whether a training that was stopped goes on.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether earlier results may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.train("priors", "trained", iterations=3000, priors="both")
    """
    return run_job("train", locals(), TrainReport)


@job
def mesh(
    dataset: PathLike,
    depths: Mapping[str, Any],
    output: PathLike,
    *,
    images: PathLike | None = None,
    voxel_m: float = 0.1,
    truncation_m: float | None = None,
    least_views: int = 1,
    least_part_m2: float = 1.0,
    shrink: int = 1,
    masked: bool = False,
    reference: PathLike | None = None,
    memory_gib: float = 4.0,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> MeshJobReport:
    """Fuse the depth maps of a dataset, or its splats, to a mesh.

    Args:
        dataset: Folder with a COLMAP model in `sparse/0`.
        depths: The depth maps.
        output: File of the mesh: `.ply` or `.glb`.
        images: Folder of the images that give the colours, where splats do not; grey when `None`.
        voxel_m: Edge of a voxel, metres.
        truncation_m: Distance from a surface beyond which a map says nothing, metres; four voxels
            when `None`.
        least_views: Number of views that must have seen a place.
        least_part_m2: Connected parts of a smaller area are left out, square metres.
        shrink: Pixels of an image that become one, in each direction, where splats are drawn.
        masked: Whether only what the masks of the dataset show becomes a mesh.
        reference: Surface to compare the mesh with: a mesh, a city model or a cloud.
        memory_gib: Greatest memory of the volume, gibibytes.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.mesh("priors", {"maps": "priors/raw_depth"}, "town.ply", voxel_m=0.5)
    """
    return run_job("mesh", locals(), MeshJobReport)


@job
def align(
    model: PathLike,
    positions: PathLike,
    output: PathLike,
    *,
    crs_epsg: CrsCode | None = None,
    vertical: str = "ellipsoid",
    threshold_m: float | None = None,
    use_gravity: bool = True,
    seed: int = 1,
    encoding: Literal["binary", "text"] = "binary",
    noise: NoiseConfig | None = None,
    noise_output: PathLike | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> AlignJobReport:
    """Bring a COLMAP model to the world by GPS or point pairs.

    Args:
        model: Folder of a COLMAP model (text or binary).
        positions: Table of known positions (CSV): of images by name, or of points of the model.
        output: Folder to write: the moved model, `origin.json`, `similarity.json`, `align.json`.
        crs_epsg: EPSG code of a projected CRS in metres; the UTM zone of the positions when `None`.
        vertical: Datum of the heights in `positions`.
        threshold_m: Largest residual of an inlier, metres; estimated from the residuals when
            `None`.
        use_gravity: Whether the up direction of the cameras is up in the world where the positions
            do not determine the tilt.
        seed: Seed of the random triples.
        encoding: Encoding of the model that is written.
        noise: Noise under which the alignment is repeated; not repeated when `None`.
        noise_output: Folder for the models aligned under noise, one per level and seed; needs
            `noise`.
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.align("sparse/0", "positions.csv", "aligned", crs_epsg=32631)
    """
    return run_job("align", locals(), AlignJobReport)


@job
def split(
    model: PathLike,
    *,
    output: PathLike | None = None,
    contexts: int = 2,
    context_iou: float = 0.15,
    target_ious: Sequence[float] = (0.02, 0.05, 0.07, 0.1),
    first: str | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SplitJobReport:
    """Choose context and target views of a COLMAP model by their overlap.

    Args:
        model: Folder of a COLMAP model with its points.
        output: File for the report (JSON), whose page is written beside it; neither is written when
            `None`.
        contexts: Number of context views.
        context_iou: Wanted overlap of each further context with the first one, as intersection over
            union.
        target_ious: Wanted average overlap of each target with the contexts, as intersection over
            union.
        first: Name of the first context; the first by name of the images that see points when
            `None`.
        overwrite: Whether an existing `output` may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.split("sparse/0", contexts=2, output="split.json")
    """
    return run_job("split", locals(), SplitJobReport)


@job
def city_info(
    file: PathLike,
    *,
    lod: str | None = None,
    all_objects: bool = False,
    account: PathLike | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> CitySummary:
    """Describe a city model and its defects.

    Args:
        file: City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
        lod: Level of detail, such as 2.2; the highest of each object up to 2.x when `None`.
        all_objects: Whether every object with surfaces is used, and not only buildings.
        account: File for the account of every object with its defects (JSON). Only when it is
            given, solids are checked for shells that meet themselves, cavities outside of their
            solid, and parts that overlap (codes 306, 4xx, 5xx, 601).
        overwrite: Whether existing files may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.city_info("town.city.json", lod="2.2")
        >>> print(report.triangles)
    """
    return run_job("city_info", locals(), CitySummary)


@job
def city_convert(
    file: PathLike,
    output: PathLike,
    *,
    lod: str | None = None,
    all_objects: bool = False,
    account: PathLike | None = None,
    overwrite: bool = False,
    format: Literal["obj", "ply", "glb", "geojson", "cityjson"] | None = None,
    progress: Progress = None,
) -> CityConvertReport:
    """Write a city model as triangles, footprints or objects.

    Args:
        file: City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
        output: File to write.
        lod: Level of detail, such as 2.2; the highest of each object up to 2.x when `None`.
        all_objects: Whether every object with surfaces is used, and not only buildings.
        account: File for the account of every object with its defects (JSON). Only when it is
            given, solids are checked for shells that meet themselves, cavities outside of their
            solid, and parts that overlap (codes 306, 4xx, 5xx, 601).
        overwrite: Whether existing files may be replaced.
        format: Format to write; taken from the ending of `output` when `None`.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.city_convert("town.city.json", "town.ply")
    """
    return run_job("city_convert", locals(), CityConvertReport)


@job
def rpc_info(
    file: PathLike,
    *,
    progress: Progress = None,
) -> RpcInfoReport:
    """Describe the RPC of a file.

    Args:
        file: RPC file, or image with an RPC.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.rpc_info("left.tif")
    """
    return run_job("rpc_info", locals(), RpcInfoReport)


@job
def rpc_convert(
    file: PathLike,
    output: PathLike,
    *,
    format: Literal["text", "rpb", "digital-globe-xml", "dimap", "alos", "ossim-geom", "json", "vrt", "aux-xml", "envi-header", "tiff-tag", "gdal-metadata"] | None = None,
    corrections: PathLike | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> RpcConvertReport:
    """Write the RPC of a file in another format.

    Args:
        file: RPC file, or image with an RPC.
        output: File to write.
        format: Format to write: text, RPB, JSON, or the image again with the RPC in its tag. `None`
            takes it from the ending of `output`.
        corrections: Report with the pointing correction of the image, or the folder of a DSM run.
            The RPC that is written includes it.
        overwrite: Whether an existing `output` may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.rpc_convert("left.tif", "left.rpb")
    """
    return run_job("rpc_convert", locals(), RpcConvertReport)


@job
def simulate(
    scene: str | Mapping[str, Any],
    output: PathLike,
    *,
    cameras: PathLike | None = None,
    flight: int = 0,
    flight_arc_deg: Sequence[float] | None = None,
    flight_spacing_m: float = 0.2,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> SimulateReport:
    """Make a seeded scene seen through RPC cameras, with its exact surface. `scene` is a preset, a
    parameter file (TOML), or parameters that differ from those of the preset `town`.

    Args:
        scene: The scene, its cameras and its radiometry.
        output: Folder for the images and the truth.
        cameras: Perspective cameras whose exact depths, parts of the scene and pictures are
            written: folder of a COLMAP model on the map of the scene, with `origin.json`.
        flight: Number of perspective cameras around the scene; none when 0.
        flight_arc_deg: Azimuths between which the perspective cameras stand, degrees clockwise from
            north; all around when `None`.
        flight_spacing_m: Edge of the cubes that hold one point of the exact surface each, metres.
            Distances of a mesh from the cloud are too large by about half of it.
        threads: Worker threads; one per core when `None`.
        overwrite: Whether the files of an earlier simulation may be replaced.
        progress: `True` for a bar (tqdm), or a function that takes a `Step`; see `skysweep.Step`.

    Returns:
        The report of the job, as the command's ``--json`` has it.

    Raises:
        TypeError: A keyword that the job does not have; the text names those that it has.
        SkysweepError: The job has no result; see its subclasses.

    Example:
        >>> import skysweep
        >>> report = skysweep.simulate({"size_m": 60.0, "views": 2}, "scene")
        >>> print(report.views)
    """
    return run_job("simulate", locals(), SimulateReport)
