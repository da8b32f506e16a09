"""From a pose to a polar image: what is met, painted, and what lies over it."""

from __future__ import annotations

from omnieval.datasets.synthetic.cast import Floats, joined, plan_of
from omnieval.datasets.synthetic.effects import polish_floor, show_outdoors, soften_edges, veil_glass
from omnieval.datasets.synthetic.paint import paint
from omnieval.datasets.synthetic.scene import Scene
from omnieval.datasets.synthetic.sight import Pose, look
from omnieval.datasets.synthetic.solids import Solid


def render_polar(scene: Scene, pose: Pose, people: tuple[Solid, ...] = ()) -> Floats:
    """Return what the mirror shows at a pose, shape (AZIMUTHS, rows, 3), float32 BGR, 255 saturates.

    Column 0 looks straight ahead, later ones further to the left; rows are `camera.radii()`.
    """
    plan = joined(scene.plan, plan_of(people, scene.atlas.index)) if people else scene.plan
    sight = look(scene.building, plan, pose)
    picture, texture = paint(scene, sight, pose)
    show_outdoors(scene, sight, pose, texture, picture)
    polish_floor(scene, sight, texture, picture)
    veil_glass(scene, sight, picture)
    soften_edges(sight, picture)
    return picture
