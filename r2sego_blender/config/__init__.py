"""What a person may set: every setting of the paper's H, presets of them, and the TOML files in which a
person declares something.

Uses ``core``. Begin with ``settings``: one dataclass field there is a setting everywhere. ``fields``
says what a field carries, and ``declared_files`` reads every declared file into such dataclasses.
"""
