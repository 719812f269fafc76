"""The extension's bill of materials (CycloneDX 1.6, JSON): what *Set Up Engine* installs, from the lock.

``batch/build_extension.py`` writes it beside the zip. The same tree gives the same bytes: it tells no time, and
its serial number comes of what it says. Of each package it names every file that may be installed by its hash;
which Python and system takes which of two versions stands in the property ``marker``.
"""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
import uuid
from pathlib import Path
from typing import Any

_LOCKS = ("torch", "engine")
_SCHEMA = "http://cyclonedx.org/schema/bom-1.6.schema.json"


def write_bill(root: Path, package: Path) -> Path:
    """Write the bill of a built zip beside it; returns its file."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    purl = f"pkg:pypi/{project['name']}@{project['version']}"
    subject = {
        "type": "application",
        "bom-ref": purl,
        "name": project["name"],
        "version": project["version"],
        "licenses": [{"license": {"id": project["license"]}}],
        "purl": purl,
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(package.read_bytes()).hexdigest()}],
    }
    components = _components([(root / "requirements" / f"{name}.txt").read_text(encoding="utf-8") for name in _LOCKS])
    bill: dict[str, Any] = {
        "$schema": _SCHEMA,
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": subject},
        "components": components,
        "dependencies": [{"ref": purl, "dependsOn": [component["bom-ref"] for component in components]}],
    }
    bill["serialNumber"] = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(bill, sort_keys=True)).urn
    file = package.with_suffix(".cdx.json")
    file.write_text(json.dumps(bill, indent=1, sort_keys=True) + "\n", encoding="utf-8", newline="\n")
    return file


def _components(locks: list[str]) -> list[dict[str, Any]]:
    """Every package of the locks by its name and version, in that order."""
    hashes: dict[tuple[str, str], set[str]] = {}
    markers: dict[tuple[str, str], set[str]] = {}
    for line in "".join(locks).replace("\\\n", "").splitlines():
        if found := re.match(r"([\w.-]+)==([\w.]+)(?: ; (.*?))?(?= +--hash)", line):
            name, version, marker = found.groups()
            hashes.setdefault((name, version), set()).update(re.findall(r"--hash=sha256:(\w+)", line))
            markers.setdefault((name, version), set()).update({marker} - {None})
    return [
        _component(name, version, sorted(markers[name, version]), sorted(hashes[name, version]))
        for name, version in sorted(hashes)
    ]


def _component(name: str, version: str, markers: list[str], hashes: list[str]) -> dict[str, Any]:
    purl = f"pkg:pypi/{name}@{version}"
    files = {
        "type": "distribution",
        "url": f"https://pypi.org/project/{name}/{version}/",
        "hashes": [{"alg": "SHA-256", "content": one} for one in hashes],
    }
    component = {
        "type": "library",
        "bom-ref": purl,
        "name": name,
        "version": version,
        "purl": purl,
        "externalReferences": [files],
    }
    return component | ({"properties": [{"name": "marker", "value": one} for one in markers]} if markers else {})
