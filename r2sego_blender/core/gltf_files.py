"""glTF 2.0 files as they lie on a disk: their JSON, bounded, and their buffers, inside or beside it.

Needs the standard library alone.
"""

from __future__ import annotations

import base64
import struct
import urllib.parse
from pathlib import Path
from typing import Any

from .errors import R2SEgoError
from .files_beside import file_beside
from .json_files import parse_json
from .text_files import opened_file

GLB_HEADER, GLB_CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")
GLB_MAGIC, GLB_VERSION, JSON_CHUNK, BINARY_CHUNK = b"glTF", 2, b"JSON", b"BIN\0"

DAMAGE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error)
"""What following indices through JSON of another structure raises."""

_MOST_NODES = 65_536


def gltf_document(data: bytes, path: Path, error: type[R2SEgoError]) -> tuple[dict[str, Any], bytes]:
    """The JSON of a file's bytes, and the binary chunk of a ``.glb``.

    Raises ``error`` for what is no glTF 2.0 or is cut short, and what is in DAMAGE.
    """
    if not data.startswith(GLB_MAGIC):
        if not data.lstrip().startswith(b"{"):
            raise error("the file is not a glTF", where=path, cure="Give a .glb or .gltf file.")
        return parse_json(data.decode("utf-8")), b""
    _, version, length = GLB_HEADER.unpack_from(data)
    if version != GLB_VERSION:
        raise error(f"glTF {version} is unknown", where=path, cure="Export it as glTF 2.0.")
    chunks: dict[bytes, bytes] = {}
    start = GLB_HEADER.size
    while start < min(length, len(data)):
        size, kind = GLB_CHUNK.unpack_from(data, start)
        start += GLB_CHUNK.size + size
        if kind in (JSON_CHUNK, BINARY_CHUNK):
            chunks.setdefault(kind, data[start - size : start])
    if length > len(data) or start > len(data):
        raise cut_short(path, error)
    return parse_json(chunks[JSON_CHUNK].decode("utf-8")), chunks.get(BINARY_CHUNK, b"")


def gltf_buffers(document: dict[str, Any], binary: bytes, path: Path, error: type[R2SEgoError]) -> list[bytes]:
    """The buffers, of which those in files lie beside ``path``; a file that is named twice is read once.

    Raises ``error`` for a file elsewhere or not there, or too short, and what is in DAMAGE.
    """
    read: dict[Path, bytes] = {}
    buffers = []
    for entry in document.get("buffers", []):
        uri = entry.get("uri")
        if uri is None:
            data = binary
        elif uri.startswith("data:"):
            data = base64.b64decode(uri.partition(",")[2], validate=True)
        else:
            file = _beside(uri, path, error)
            if file not in read:
                read[file] = _content(file, error)
            data = read[file]
        if len(data) < entry["byteLength"]:
            raise cut_short(path, error)
        buffers.append(data)
    return buffers


def require_whole(path: Path, error: type[R2SEgoError]) -> None:
    """Raises ``error`` for a glTF that cannot be read, or whose buffers and images are not all inside it."""
    try:
        with opened_file(path) as stream:
            document, _ = gltf_document(stream.read(), path, error)
        uris = [entry.get("uri", "data:") for entry in document.get("buffers", []) + document.get("images", [])]
        elsewhere = [uri for uri in uris if not uri.startswith("data:")]
    except (OSError, *DAMAGE) as cause:
        raise error("the glTF is damaged", where=path, cure="Make or export it again.") from cause
    if elsewhere:
        raise error(f"the glTF names the file '{elsewhere[0]}'", where=path, cure="Make or export it again, as .glb.")


def gltf_tree(document: dict[str, Any], path: Path, error: type[R2SEgoError]) -> list[tuple[int, int | None]]:
    """(node, its parent) of each node of the scene, parents first.

    Raises ``error`` for more nodes than are followed, ValueError where they are no tree, and what is in
    DAMAGE.
    """
    nodes = document.get("nodes", [])
    if len(nodes) > _MOST_NODES:
        raise error(f"the scene has {len(nodes)} nodes, of at most {_MOST_NODES}", where=path, cure="Join its objects.")
    if "scenes" in document:
        roots = document["scenes"][document.get("scene", 0)].get("nodes", [])
    else:
        roots = sorted(set(range(len(nodes))) - {child for node in nodes for child in node.get("children", [])})
    waiting: list[tuple[int, int | None]] = [(root, None) for root in roots]
    seen: set[int] = set()
    found = []
    while waiting:
        index, parent = waiting.pop()
        if index in seen:
            raise ValueError("the nodes are no tree")
        seen.add(index)
        found.append((index, parent))
        waiting += [(child, index) for child in nodes[index].get("children", [])]
    return found


def cut_short(path: Path, error: type[R2SEgoError]) -> R2SEgoError:
    """A file that claims more data than it holds."""
    return error(
        "the file is cut short: it claims more data than it holds", where=path, cure="Copy or export it again."
    )


def _beside(uri: str, path: Path, error: type[R2SEgoError]) -> Path:
    try:
        return file_beside(path, urllib.parse.unquote(uri))
    except ValueError as cause:
        raise error(
            f"the buffer '{uri}' is not beside the file", where=path, cure="Put it there, or export a .glb."
        ) from cause


def _content(file: Path, error: type[R2SEgoError]) -> bytes:
    try:
        with opened_file(file) as stream:
            return stream.read()
    except (OSError, ValueError) as cause:
        raise error("the buffer cannot be read", where=file, cure="Put it there, or export a .glb.") from cause
