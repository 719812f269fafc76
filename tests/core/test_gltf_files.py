from __future__ import annotations

import json
import struct

import pytest

from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.gltf_files import require_whole

INSIDE = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": "data:;base64,AAAA"}], "images": [{}]}


def glb(document: dict) -> bytes:
    text = json.dumps(document).encode()
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_whole_file_names_no_other(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"

    def write(document: dict) -> None:
        path.write_bytes(glb(document) if suffix == ".glb" else json.dumps(document).encode())

    write(INSIDE)
    require_whole(path, SceneError)
    for part in ({"buffers": [{"byteLength": 1, "uri": "../a.bin"}]}, {"images": [{"uri": "there.png"}]}):
        write(INSIDE | part)
        with pytest.raises(SceneError, match=rf"a\{suffix}"):
            require_whole(path, SceneError)


@pytest.mark.parametrize(
    "content", [b"", b"glTF", b"{", b"[]", b'{"buffers": 3}', b'{"buffers": [{"uri": 3}]}', b"{\xff}"]
)
def test_damage_is_an_error_of_the_file(tmp_path, content):
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(SceneError, match=r"a\.glb"):
        require_whole(tmp_path / "a.glb", SceneError)
