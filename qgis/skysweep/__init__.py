"""Processing algorithms that run the command skysweep."""


def classFactory(iface):
    """Makes the plugin; QGIS calls it."""
    from .plugin import SkysweepPlugin

    return SkysweepPlugin()
