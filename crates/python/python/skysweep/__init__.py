"""Satellite surface models from RPC images, and building priors.

Jobs are functions whose keywords are the settings of the command ``skysweep``::

    import skysweep
    report = skysweep.dsm(["left.tif", "right.tif"], "out", gsd_m=0.5, progress=True)
    print(report.surface.observed)

Objects are :class:`Rpc` (cameras on arrays), :class:`HeightSweep` (heights of arrays),
:class:`CityModel` (ray casting), :class:`Plan` (surface models in parts) and :class:`Raster` (cells
with their map and vertical datum). :func:`evaluate` measures surfaces in files and in memory.
``skysweep.dask`` runs plans on a cluster. Warnings of jobs go to the logger ``skysweep``; a vertical
datum that is assumed is a :class:`DatumWarning`.
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
from ._plan import Plan as Plan
from ._raster import Bounds as Bounds
from ._raster import Raster as Raster
from ._raster import read_raster as read_raster
from ._raster import write_raster as write_raster
from ._rpc import FittedRpc as FittedRpc
from ._rpc import Rpc as Rpc
from ._sweep import HeightSweep as HeightSweep
from ._sweep import ViewHeights as ViewHeights

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
    "__version__",
    "allow_remote",
    "evaluate",
    "read_raster",
    "write_raster",
]
__all__ += _jobs.__all__
