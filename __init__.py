"""R2S-EGO in Blender: register() and unregister() of the operators, panels and batch commands."""


def _parts() -> tuple:
    # Imported here, so that test runners can read this file where there is no Blender.
    from . import batch, operators, panels

    return operators, panels, batch


def register() -> None:
    """Add everything to Blender."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Take everything away again, in reverse."""
    for part in reversed(_parts()):
        part.unregister()
