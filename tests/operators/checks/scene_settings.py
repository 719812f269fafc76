"""What holds of the settings in the room Scene, checked inside Blender."""

import importlib
from types import SimpleNamespace

import bpy
from support import MODULE, calls, conduct, open_bundle, refused, state


def check_settings_are_kept_under_a_name():
    open_bundle()
    state().settings.training__steps_per_round = 123
    assert bpy.ops.r2sego.keep_settings(name="short run") == {"FINISHED"}
    assert "no name" in refused(bpy.ops.r2sego.keep_settings, name="../short")
    open_bundle()
    state().preset = "paper"
    assert bpy.ops.r2sego.load_settings(name="short run") == {"FINISHED"}
    assert state().preset == "preview" and state().settings.training__steps_per_round == 123
    assert state().settings.is_property_set("training__steps_per_round")
    assert not state().settings.is_property_set("training__max_gaussians")
    assert bpy.ops.r2sego.remove_settings(name="short run") == {"FINISHED"}
    try:
        bpy.ops.r2sego.load_settings(name="short run")
    except TypeError as error:
        assert "short run" in str(error)
    else:
        raise AssertionError("removed settings were loaded")


def check_removed_settings_are_told_by_their_name():
    open_bundle()
    for refusing in (bpy.ops.r2sego.load_settings, bpy.ops.r2sego.remove_settings):
        assert "No settings are kept" in refused(refusing)
    for name in ("first", "second"):
        bpy.ops.r2sego.keep_settings(name=name)
    removing = importlib.import_module(f"{MODULE}.operators.scene.kept_settings").R2SEGO_OT_remove_settings
    perform, told = removing.perform, []
    removing.perform = lambda asked, context: told.append(perform(asked, context)) or told[-1]
    try:
        for name in ("first", "second"):
            assert bpy.ops.r2sego.remove_settings(name=name) == {"FINISHED"}
    finally:
        removing.perform = perform
    assert told == ["Removed first", "Removed second"]


def check_a_preset_tells_what_it_sets_below_the_field():
    """A field that the person left alone shows the default, whatever the preset says."""
    drawn = []

    class Layout:
        def __getattr__(self, name):
            return lambda *given, **words: drawn.append(words.get("text", "")) or self

        def panel(self, *given, **words):
            return self, self

    def told():
        drawn.clear()
        bpy.types.R2SEGO_PT_settings.draw(SimpleNamespace(layout=Layout()), bpy.context)
        return [text for text in drawn if text.startswith(f"{state().preset.capitalize()}: ")]

    open_bundle()
    bpy.ops.r2sego.reset_settings()
    assert {"Preview: 900", "Preview: Target", "Preview: 0.6"} <= set(told())
    state().settings.training__steps_per_round = 77
    assert "Preview: 900" not in told()
    state().preset = "paper"
    assert told() == []


def check_every_number_that_a_settings_slider_reaches_is_taken():
    """Blender holds 32 bits of a number: the lowest voxel came back below 0.005."""
    properties = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.scene.settings_properties")
    named = importlib.import_module(f"{MODULE}.r2sego_blender.config.presets")
    open_bundle()
    numbers = [entry for entry in named.entries() if isinstance(entry.default, float)]
    for entry in numbers:
        for value in (entry.low, entry.high, entry.default):
            if value is not None:
                setattr(state().settings, properties.property_name(entry.key), value)
                assert properties.overrides(state().settings, "paper")[entry.key] == value, entry.key
    bpy.ops.r2sego.reset_settings()
    state().settings.proxy__voxel_m = 0.005
    assert bpy.ops.r2sego.keep_settings(name="fine") == {"FINISHED"}
    bpy.ops.r2sego.remove_settings(name="fine")
    conduct("succeed")
    bpy.ops.r2sego.refine()
    assert "proxy.voxel_m=0.005" in calls()[0]
