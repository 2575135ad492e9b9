"""Runs the algorithms inside QGIS and checks parameters, layers, styles, errors and cancelling.

Called by run_qgis.sh with the folder of a run and one for results.
"""

import sys
from pathlib import Path

sys.path += ["/usr/share/qgis/python", "/usr/share/qgis/python/plugins", str(Path(__file__).parents[1])]

from qgis.core import (  # noqa: E402
    Qgis,
    QgsApplication,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProject,
    QgsRasterLayer,
    QgsRectangle,
    QgsVectorLayer,
)

TOWN = Path(__file__).parents[2] / "data-samples" / "town"
run, output = Path(sys.argv[1]), Path(sys.argv[2])
application = QgsApplication([], False)
application.initQgis()

import processing  # noqa: E402
from processing.core.Processing import Processing  # noqa: E402

Processing.initialize()
from skysweep.plugin import SkysweepPlugin  # noqa: E402

plugin = SkysweepPlugin()
plugin.initProcessing()
checks = 0


def check(holds, what):
    global checks
    checks += 1
    if not holds:
        print(f"FAILED: {what}")
        sys.exit(1)


class Log(QgsProcessingFeedback):
    def __init__(self):
        super().__init__()
        self.lines, self.highest = [], 0.0
        self.progressChanged.connect(self.note)

    def note(self, percent):
        self.highest = max(self.highest, percent)

    def pushInfo(self, text):
        self.lines.append(text)


def style(path):
    """Returns the kind of style that QGIS finds beside a raster."""
    layer = QgsRasterLayer(path, "layer")
    check(layer.isValid(), f"{path} can be read")
    return layer.renderer().type()


def start(name, parameters, feedback=None):
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    results = processing.run(f"skysweep:{name}", parameters, context=context, feedback=feedback or Log())
    return results, context


algorithms = {a.name() for a in plugin.provider.algorithms()}
check(algorithms >= {"dsm", "ortho", "dtm", "evaluate", "heightmap", "priors"}, f"algorithms: {algorithms}")

# A surface model within an extent, which fixes the CRS; its layer comes with its style.
images = [str(TOWN / f"view_{i}.tif") for i in (1, 2, 3)]
log = Log()
extent = "693780,693900,4822440,4822540 [EPSG:32631]"
results, context = start("dsm", {"IMAGES": images, "GSD": 1.0, "PRESET": "fast", "BOUNDS": extent, "OUTPUT": str(output / "dsm")}, log)
check(any("EPSG:32631" in line for line in log.lines), "the log names the CRS")
check(log.highest > 50, "the bar moves")
layer = QgsRasterLayer(results["DSM"], "dsm")
check(layer.isValid() and layer.crs().isValid(), "the layer is valid")
check(layer.renderer().type() == "singlebandpseudocolor", f"the style is used: {layer.renderer().type()}")
check(QgsRectangle(693780, 4822440, 693900, 4822540).contains(layer.extent()), "the extent is kept")
check(list(context.layersToLoadOnCompletion()) == [results["DSM"]], "the surface model is loaded at the end")
check(results["REPORT"].endswith("report.html"), "the report is an output")

surface = str(run / "dsm" / "dsm.tif")
results, context = start("dtm", {"SURFACE": surface, "OUTPUT": str(output / "dtm")})
check(style(results["DTM"]) == "singlebandpseudocolor", "the ground has a style")
check(style(results["STATES"]) == "paletted", "the states have a style")
check(len(context.layersToLoadOnCompletion()) == 2, "ground and heights above it are loaded")
results, context = start("classes", {"SURFACE": surface, "LOAD": False, "OUTPUT": str(output / "classes")})
check(style(results["CLASSES"]) == "paletted", "classes have a style")
check(not context.layersToLoadOnCompletion(), "nothing is loaded unless asked for")
results, _ = start("ortho", {"IMAGES": images[:1], "DSM": surface, "OUTPUT": str(output / "ortho.tif")})
check(QgsRasterLayer(results["OUTPUT"], "ortho").isValid(), "an ortho")
truth = str(TOWN / "truth" / "dsm.tif")
results, _ = start("evaluate", {"TEST": surface, "REFERENCE": truth, "OUTPUT": str(output / "eval")})
check(QgsRasterLayer(results["ERRORS"], "errors").isValid() and "REPORT" in results, "an evaluation")
results, _ = start("diff", {"BEFORE": truth, "AFTER": surface, "OUTPUT": str(output / "diff")})
check(QgsVectorLayer(results["REGIONS"], "regions").isValid(), "regions of change")
check(style(results["CHANGE"]) == "singlebandpseudocolor", "change has a style")
layer = QgsRasterLayer(surface, "surface")
centre = layer.extent().center()
point = f"{centre.x()},{centre.y()} [EPSG:32631]"
results, _ = start("heightmap", {"SOURCE": surface, "CENTER": point, "HEADING": -30.0, "SIZE": 64, "OUTPUT": str(output / "map.tif")})
layer = QgsRasterLayer(results["OUTPUT"], "map")
check(layer.isValid(), "a height map around a point in another CRS")

# The words of the command reach the user; a cancelled job leaves no result.
try:
    start("dtm", {"SURFACE": surface, "OVERWRITE": False, "OUTPUT": str(output / "dtm")})
    check(False, "existing results are refused")
except QgsProcessingException as error:
    check("dtm.tif" in str(error), f"the error names the file: {error}")


class Impatient(Log):
    def note(self, percent):
        super().note(percent)
        if percent > 0:
            self.cancel()


results, _ = start("dsm", {"IMAGES": images, "OUTPUT": str(output / "cancelled")}, Impatient())
check(not (output / "cancelled" / "dsm" / "dsm.tif").exists(), "a cancelled job leaves no surface model")

plugin.unload()
print(f"{checks} checks hold in QGIS {Qgis.QGIS_VERSION}")
