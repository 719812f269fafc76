"""How many faces the 3D views draw of all that is shown of bundles."""

from __future__ import annotations

from ..proxy.show_proxy import draw_fewer_faces_of_proxies
from ..robot.show_robot import draw_fewer_faces_of_robots
from ..views.show_candidates import draw_fewer_candidates


def draw_fewer_faces_of_all(most: int) -> None:
    """At most about ``most`` of each proxy, half as many of each robot and of the candidates; 0 is all."""
    draw_fewer_faces_of_proxies(most)
    draw_fewer_faces_of_robots(most)
    draw_fewer_candidates(most)
