"""What an operator reported, in whichever language Blender is used."""

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.shared.reports import reported


@pytest.mark.parametrize("word", ["Error", "Fehler", "エラー", None])
def test_the_word_before_it_is_left_out_once(word):
    said = f"{word or 'Error'}: Error: /rooms/a.r2s: nobody is at home.\n"
    assert reported(RuntimeError(said), word) == "Error: /rooms/a.r2s: nobody is at home."


def test_blender_may_not_translate_reports():
    assert reported(RuntimeError("Error: /rooms: it is gone."), "Fehler") == "/rooms: it is gone."
    assert reported(RuntimeError("/rooms: it is gone."), "Fehler") == "/rooms: it is gone."
