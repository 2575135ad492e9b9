"""The Processing provider: the algorithms of the catalogue, and the setting that names the command."""

import json
from pathlib import Path

from processing.core.ProcessingConfig import ProcessingConfig, Setting
from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .algorithm import COMMAND_SETTING, SkysweepAlgorithm

FOLDER = Path(__file__).parent


def catalogue():
    """Returns the descriptions of all algorithms."""
    with open(FOLDER / "algorithms.json", encoding="utf-8") as file:
        return json.load(file)["algorithms"]


class SkysweepProvider(QgsProcessingProvider):
    """The algorithms that run the command skysweep."""

    def id(self):
        return "skysweep"

    def name(self):
        return "skysweep"

    def longName(self):
        return "skysweep: surface models from satellite images"

    def icon(self):
        return QIcon(str(FOLDER / "icon.svg"))

    def load(self):
        ProcessingConfig.settingIcons[self.name()] = self.icon()
        text = "File of the command skysweep (empty: the one in PATH)"
        ProcessingConfig.addSetting(Setting(self.name(), COMMAND_SETTING, text, "", valuetype=Setting.FILE))
        ProcessingConfig.readSettings()
        self.refreshAlgorithms()
        return True

    def unload(self):
        ProcessingConfig.removeSetting(COMMAND_SETTING)

    def loadAlgorithms(self):
        for description in catalogue():
            self.addAlgorithm(SkysweepAlgorithm(description))
