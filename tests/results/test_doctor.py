"""What this machine lacks, and what getting it takes."""

from dataclasses import replace

from r2sego_blender.results.doctor import PACKAGES, examine, lines


def test_the_room_for_what_is_missing_is_that_of_what_is_named():
    there, optional = (next(p for p in PACKAGES if p.name == name) for name in ("numpy", "bpy"))
    missing = replace(there, name="no-such-package", module="no_such_module", size_mb=7)
    findings = examine([there, missing, replace(optional, name="nor-this", module="nor_this")])
    assert lines(findings)[-1] == "missing, about 7 MB: run `make install`, or pip install no-such-package"
    assert not findings["ready"]
