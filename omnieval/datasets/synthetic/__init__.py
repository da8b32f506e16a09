"""Buildings rendered for omnidirectional vision: rooms, furniture, lights and people, with exact ground truth.

`synthesize` writes a drive through one in COLD's layout; `cached` keeps the default one of each light. What the camera
sees is cast ray by ray through a hyperbolic mirror. The heavy libraries are imported when the first frame is made.
"""

from omnieval.datasets.synthetic.facts import LIGHTS, MIRROR, RENDERER_VERSION, Rendered, rendered
from omnieval.datasets.synthetic.write import cached, synthesize

__all__ = ["LIGHTS", "MIRROR", "RENDERER_VERSION", "Rendered", "cached", "rendered", "synthesize"]
