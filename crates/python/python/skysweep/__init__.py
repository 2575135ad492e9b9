"""Satellite surface models from RPC images, and building priors.

Jobs are functions whose keywords are the settings of the command ``skysweep``. They write files and
return a report with attributes; ``help(skysweep.dsm)`` lists keywords, units and defaults::

    import skysweep
    report = skysweep.dsm(["left.tif", "right.tif"], "out", gsd_m=0.5, progress=True)
    print(report.surface.observed)

Surface models
    :func:`dsm` makes one, :func:`batch` many, :func:`products` what is made of one (clouds, meshes,
    contours). In parts: :class:`Plan`, with :func:`make_plan`, :func:`plan_run`, :func:`read_plan`,
    :func:`run_chunks` and :func:`merge_run` beneath it. ``skysweep.dask`` runs plans on a cluster.
From surface models
    :func:`dtm` finds the ground, :func:`classes` buildings and vegetation, :func:`diff` changes,
    :func:`buildings` an index of one image. :func:`ortho` lays images on a surface,
    :func:`register` corrects the RPC of a new image. :func:`heightmap`, :func:`unproject` and
    :func:`tiles` see a place from above, :func:`groundview` and :func:`compose` from the ground.
Accuracy
    :func:`evaluate` measures surfaces in files and in memory; :func:`kind_of_evaluation` chooses
    among :func:`evaluate_grids`, :func:`evaluate_surfaces` and :func:`evaluate_maps`.
    :func:`simulate` makes scenes whose exact surface is known.
City models, splats, cameras
    :func:`priors` of a city model, :func:`city_info`, :func:`city_convert`; :func:`splats`,
    :func:`render_splats`, :func:`convert_splats`, :func:`label_splats`, :func:`train`,
    :func:`mesh`; :func:`align` and :func:`split` of COLMAP models; :func:`rpc_info`, :func:`rpc_convert`.
Objects on arrays
    :class:`Rpc` projects points and finds them (:class:`FittedRpc` is a fit), :class:`HeightSweep`
    finds the heights of arrays (:class:`ViewHeights`) and their surface (:class:`ViewSurface`),
    :class:`CityModel` casts rays (:class:`Hits`), and :class:`Raster` has cells with their map and vertical datum (:class:`Bounds`,
    :func:`read_raster`, :func:`write_raster`).
Progress, reports, errors
    `progress` takes ``True`` or a function of a :class:`Step` (:data:`Progress`). A :class:`Report`
    is a dictionary whose keys are attributes; :mod:`skysweep.reports` has the class of each. Errors
    are a :class:`SkysweepError`: :class:`InputError`, :class:`FileError`,
    :class:`FileMissingError`, :class:`OutputExistsError`, :class:`InUseError`, :class:`CrsError`,
    :class:`CancelledError`. Warnings of jobs go to the logger ``skysweep``; a vertical datum that is
    assumed is a :class:`DatumWarning`. :func:`allow_remote` lets jobs read addresses, and
    :func:`fetch_grids` lets them fetch geoid grids.
"""

from . import _jobs
from ._call import Progress as Progress
from ._call import Report as Report
from ._call import Step as Step
from ._city import CityModel as CityModel
from ._city import Hits as Hits
from ._errors import CancelledError as CancelledError
from ._errors import CrsError as CrsError
from ._errors import DatumWarning as DatumWarning
from ._errors import FileError as FileError
from ._errors import FileMissingError as FileMissingError
from ._errors import InputError as InputError
from ._errors import InUseError as InUseError
from ._errors import OutputExistsError as OutputExistsError
from ._errors import SkysweepError as SkysweepError
from ._evaluate import evaluate as evaluate
from ._jobs import *  # noqa: F403
from ._native import __version__ as __version__
from ._native import allow_remote as allow_remote
from ._native import fetch_grids as fetch_grids
from ._plan import Plan as Plan
from ._raster import Bounds as Bounds
from ._raster import Raster as Raster
from ._raster import read_raster as read_raster
from ._raster import write_raster as write_raster
from ._rpc import FittedRpc as FittedRpc
from ._rpc import Rpc as Rpc
from ._sweep import HeightSweep as HeightSweep
from ._sweep import ViewHeights as ViewHeights
from ._sweep import ViewSurface as ViewSurface

__all__ = [
    "Bounds",
    "CancelledError",
    "CityModel",
    "CrsError",
    "DatumWarning",
    "FileError",
    "FileMissingError",
    "FittedRpc",
    "HeightSweep",
    "Hits",
    "InUseError",
    "InputError",
    "OutputExistsError",
    "Plan",
    "Progress",
    "Raster",
    "Report",
    "Rpc",
    "SkysweepError",
    "Step",
    "ViewHeights",
    "ViewSurface",
    "__version__",
    "allow_remote",
    "evaluate",
    "fetch_grids",
    "read_raster",
    "write_raster",
]
__all__ += _jobs.__all__
