"""The plugin: it registers the Processing provider, with and without a window."""

from qgis.core import QgsApplication

from .provider import SkysweepProvider


class SkysweepPlugin:
    """Adds the provider when QGIS loads the plugin, and removes it again."""

    def __init__(self):
        self.provider = None

    def initProcessing(self):
        """Registers the provider; the only step that qgis_process takes."""
        self.provider = SkysweepProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self):
        self.initProcessing()

    def unload(self):
        QgsApplication.processingRegistry().removeProvider(self.provider)
