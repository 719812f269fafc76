"""Lists of cached facts: Blender's lists count blank rows, and each row shows the fact in its place."""

from fnmatch import fnmatchcase

import bpy

from ..r2sego_blender.bridge.shared.panel_facts import ROWS


def fact_list(layout, kind, group, active, **how):
    """Draw the facts of ``kind``, a ``FactList``; the index of the chosen one is ``group``'s ``active``."""
    layout.template_list(kind.__name__, "", bpy.context.window_manager, ROWS, group, active, **how)


class FactList:
    """A list of the facts that the scene's property group ``group`` has under the name ``facts``."""

    group = facts = ""

    def draw_fact(self, layout, group, item, index):
        """Draw one row."""
        raise NotImplementedError

    def is_listed(self, group, item):
        """Whether a fact stands in the list at all."""
        return True

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        group = getattr(context.scene, self.group)
        self.draw_fact(layout, group, getattr(group, self.facts)[index], index)

    def filter_items(self, context, data, property):
        """The rows that have a fact, and as Blender's own lists do those of a name that is searched for, in
        the order of their names where that is asked for. Blender turns it round where that is asked for."""
        group = getattr(context.scene, self.group)
        facts = getattr(group, self.facts)
        shown, rest = self.bitflag_filter_item, len(getattr(data, property)) - len(facts)
        names = [getattr(one, "name", "").lower() for one in facts]
        pattern = f"*{self.filter_name.lower()}*"
        flags = [
            shown if fnmatchcase(name, pattern) and self.is_listed(group, one) else 0
            for name, one in zip(names, facts, strict=True)
        ]
        order = []
        if self.use_filter_sort_alpha:
            places = sorted(range(len(facts)), key=names.__getitem__)
            order = [0] * len(facts)
            for place, index in enumerate(places):
                order[index] = place
            order += range(len(facts), len(facts) + rest)
        return [*flags, *([shown if self.use_filter_invert else 0] * rest)], order
