"""Words of the interface that depend on a number."""


def counted(count: int, noun: str) -> str:
    """So many of what ``noun`` names in the singular: "1 mask", "3 masks"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
