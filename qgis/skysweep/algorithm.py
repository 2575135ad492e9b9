"""An algorithm of the catalogue: its parameters, its run, and the layers that it leaves."""

import os

from processing.core.ProcessingConfig import ProcessingConfig
from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsProcessing,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingOutputFile,
    QgsProcessingOutputHtml,
    QgsProcessingOutputRasterLayer,
    QgsProcessingOutputVectorLayer,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterExtent,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterPoint,
    QgsProcessingParameterRange,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsProcessingParameterVectorLayer,
)

from .command import Cancelled, CommandError, Stages, arguments_of, find_command, run

# Setting of the provider that names the command.
COMMAND_SETTING = "SKYSWEEP_COMMAND"
# Parameter of algorithms that write a folder: whether its layers are added to the project.
LOAD = "LOAD"
WGS84 = "EPSG:4326"


def definition_of(described):
    """Returns the parameter of QGIS for one of the catalogue."""
    name, label = described["name"], described["label"]
    common = {"defaultValue": described.get("default"), "optional": described.get("optional", False)}
    number = QgsProcessingParameterNumber
    made = {
        "rasters": lambda: QgsProcessingParameterMultipleLayers(name, label, QgsProcessing.TypeRaster, **common),
        "raster": lambda: QgsProcessingParameterRasterLayer(name, label, **common),
        "polygons": lambda: QgsProcessingParameterVectorLayer(
            name, label, types=[QgsProcessing.TypeVectorPolygon], **common
        ),
        "file": lambda: QgsProcessingParameterFile(name, label, **common),
        "folder": lambda: QgsProcessingParameterFile(
            name, label, behavior=QgsProcessingParameterFile.Folder, **common
        ),
        "path": lambda: QgsProcessingParameterString(name, label, **common),
        "text": lambda: QgsProcessingParameterString(name, label, **common),
        "count": lambda: number(name, label, type=number.Integer, minValue=1, **common),
        "number": lambda: number(name, label, type=number.Double, **common),
        "length": lambda: number(name, f"{label}, metres", type=number.Double, minValue=0.0, **common),
        "range": lambda: QgsProcessingParameterRange(name, label, type=number.Double, **common),
        "switch": lambda: QgsProcessingParameterBoolean(name, label, described.get("default", False)),
        "choice": lambda: QgsProcessingParameterEnum(
            name, label, options=described["choices"], usesStaticStrings=True, **common
        ),
        "choices": lambda: QgsProcessingParameterEnum(
            name, label, options=described["choices"], allowMultiple=True, usesStaticStrings=True, **common
        ),
        "crs": lambda: QgsProcessingParameterCrs(name, label, **common),
        "extent": lambda: QgsProcessingParameterExtent(name, label, **common),
        "point": lambda: QgsProcessingParameterPoint(name, label, **common),
    }[described["type"]]()
    if described["type"] == "rasters" and "minimum" in described:
        made.setMinimumNumberInputs(described["minimum"])
    if described.get("advanced"):
        made.setFlags(made.flags() | QgsProcessingParameterDefinition.FlagAdvanced)
    return made


class SkysweepAlgorithm(QgsProcessingAlgorithm):
    """Runs one command of skysweep."""

    def __init__(self, described):
        super().__init__()
        self.described = described

    def createInstance(self):
        return SkysweepAlgorithm(self.described)

    def name(self):
        return self.described["id"]

    def displayName(self):
        return self.described["name"]

    def group(self):
        return self.described["group"]

    def groupId(self):
        return self.group().lower().replace(" ", "_")

    def shortHelpString(self):
        return self.described["help"]

    def initAlgorithm(self, configuration=None):
        for described in self.described["parameters"]:
            self.addParameter(definition_of(described))
        output = self.described["output"]
        if output["type"] == "raster":
            self.addParameter(QgsProcessingParameterRasterDestination(output["name"], output["label"]))
            return
        if output["type"] == "filename":
            name, label = output["name"], output["label"]
            self.addParameter(QgsProcessingParameterFileDestination(name, label, fileFilter=output["filter"]))
            return
        self.addParameter(QgsProcessingParameterFolderDestination(output["name"], output["label"]))
        self.addParameter(QgsProcessingParameterBoolean(LOAD, "Load the layers when done", defaultValue=True))
        kinds = {
            "raster": QgsProcessingOutputRasterLayer,
            "vector": QgsProcessingOutputVectorLayer,
            "html": QgsProcessingOutputHtml,
            "file": QgsProcessingOutputFile,
        }
        for layer in self.described["layers"]:
            self.addOutput(kinds[layer["type"]](layer["name"], layer["label"]))

    def processAlgorithm(self, parameters, context, feedback):
        output = self.described["output"]
        try:
            command = find_command(ProcessingConfig.getSetting(COMMAND_SETTING) or "")
            values = self.values(parameters, context, feedback)
            destination = self.parameterAsString(parameters, output["name"], context)
            if output["type"] == "raster":
                destination = self.parameterAsOutputLayer(parameters, output["name"], context)
            if output["type"] == "filename":
                destination = self.parameterAsFileOutput(parameters, output["name"], context)
            if output["type"] in ("raster", "filename"):
                os.makedirs(os.path.dirname(destination) or ".", exist_ok=True)
            with_output = {**self.described, "parameters": [*self.described["parameters"], output]}
            arguments = arguments_of(with_output, {**values, output["name"]: destination})
            feedback.pushCommandInfo(" ".join([command, *arguments]))
            finished = self.run_command(command, arguments, feedback)
        except Cancelled as cancelled:
            feedback.reportError(str(cancelled))
            return {}
        except CommandError as error:
            raise QgsProcessingException(str(error)) from error
        if finished.missed:
            feedback.reportError("some parts failed; the report says which")
        results = {output["name"]: destination}
        for layer in self.described["layers"]:
            path = os.path.join(destination, *layer["file"].split("/"))
            if os.path.exists(path):
                results[layer["name"]] = path
                if layer.get("load") and self.parameterAsBool(parameters, LOAD, context):
                    details = QgsProcessingContext.LayerDetails(layer["label"], context.project(), layer["name"])
                    context.addLayerToLoadOnCompletion(path, details)
        return results

    def run_command(self, command, arguments, feedback):
        """Runs the command with its progress on QGIS's bar and its words in the log."""
        stages = Stages()

        def on_event(event):
            percent = stages.percent(event)
            if percent is not None:
                feedback.setProgress(percent)
            kind = event.get("event")
            if kind == "stage":
                feedback.setProgressText(event.get("stage", ""))
            elif kind == "choice":
                feedback.pushInfo("{name}: {value} ({reason})".format(**event))
            elif kind == "warning":
                feedback.reportError("warning: " + event.get("text", ""))

        return run(command, arguments, on_event, feedback.pushInfo, feedback.isCanceled)

    def values(self, parameters, context, feedback):
        """Returns the texts of all parameters that are set."""
        values = {}
        for described in self.described["parameters"]:
            value = self.value(described, parameters, context, feedback)
            if value is not None:
                values[described["name"]] = value
        # An extent without a CRS of the result fixes that CRS, because its numbers are in it.
        for described in self.described["parameters"]:
            named = described.get("crs")
            if described["type"] == "extent" and described["name"] in values and named == "CRS" and named not in values:
                values[named] = self.parameterAsExtentCrs(parameters, described["name"], context).authid()
        return values

    def value(self, described, parameters, context, feedback):
        """Returns the texts of a parameter, or None if it is not set."""
        name, kind = described["name"], described["type"]
        if kind == "switch":
            return self.parameterAsBool(parameters, name, context)
        given = parameters.get(name)
        if given is None or given == "" or given == []:
            return str(described["default"]) if "default" in described else None
        if kind == "rasters":
            return [_path(layer) for layer in self.parameterAsLayerList(parameters, name, context)]
        if kind == "raster":
            layer = self.parameterAsRasterLayer(parameters, name, context)
            if layer is None:
                raise CommandError(f"{described['label']}: {given} is no raster that can be read")
            return _path(layer)
        if kind == "polygons":
            formats = ["gpkg", "geojson", "json"]
            return self.parameterAsCompatibleSourceLayerPath(parameters, name, context, formats, "gpkg", feedback)
        if kind == "count":
            return str(self.parameterAsInt(parameters, name, context))
        if kind in ("number", "length"):
            return repr(self.parameterAsDouble(parameters, name, context))
        if kind == "range":
            low_high = self.parameterAsRange(parameters, name, context)
            return [repr(value) for value in low_high]
        if kind == "choice":
            return self.parameterAsEnumString(parameters, name, context)
        if kind == "choices":
            return self.parameterAsEnumStrings(parameters, name, context)
        if kind == "crs":
            return self.parameterAsCrs(parameters, name, context).authid()
        if kind == "extent":
            extent = self.parameterAsExtent(parameters, name, context, self.extent_crs(described, parameters, context))
            return [repr(side) for side in (extent.xMinimum(), extent.yMinimum(), extent.xMaximum(), extent.yMaximum())]
        if kind == "point":
            point = self.parameterAsPoint(parameters, name, context, QgsCoordinateReferenceSystem(WGS84))
            return [repr(point.x()), repr(point.y())]
        return self.parameterAsString(parameters, name, context)

    def extent_crs(self, described, parameters, context):
        """Returns the CRS in which the command expects an extent; an invalid one leaves it as it is."""
        other = described.get("crs")
        if other == "CRS":
            return self.parameterAsCrs(parameters, other, context)
        layer = self.parameterAsRasterLayer(parameters, other, context)
        return layer.crs() if layer is not None else QgsCoordinateReferenceSystem()


def _path(layer):
    """Returns the file of a raster layer."""
    return layer.source().split("|")[0]
