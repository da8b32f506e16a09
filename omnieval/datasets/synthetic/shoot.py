"""One drive through the building as a photographer sees it: names, rooms, and the picture of every capture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.building import Building
from omnieval.datasets.synthetic.day import Day, day_of
from omnieval.datasets.synthetic.drives import Tour, drive
from omnieval.datasets.synthetic.people import Person, bodies, passers_by
from omnieval.datasets.synthetic.picture import photograph
from omnieval.datasets.synthetic.plans import building
from omnieval.datasets.synthetic.render import render_polar
from omnieval.datasets.synthetic.scene import Scene, build_scene
from omnieval.errors import DatasetError
from omnieval.seeding import named_generator

_JPEG_QUALITY = 90


@dataclass(frozen=True)
class Drive:
    """A drive on a day: the tour, the scene it goes through, and who is about."""

    day: Day
    seed: int
    tour: Tour
    scene: Scene
    people: tuple[Person, ...]
    captures_a_tour: int

    @classmethod
    def of(cls, light: str, seed: int, frames: int | None, number: int = 1) -> Drive:
        """Prepare the first `frames` captures of the drive through building `number`, or one whole tour."""
        day = day_of(building(number), light)
        once = drive(day, seed)
        tour = once if frames is None else drive(day, seed, frames)
        return cls(day, seed, tour, build_scene(day, number), passers_by(day, seed, once), len(once.times))

    @property
    def building(self) -> Building:
        """The building that is driven through."""
        return self.day.building

    @property
    def names(self) -> list[str]:
        """File name of every capture, in COLD's form."""
        return [
            f"t{time:.6f}_x{x:.6f}_y{y:.6f}_a{yaw:.6f}.jpeg"
            for time, (x, y, yaw) in zip(self.tour.times, self.tour.poses, strict=True)
        ]

    @property
    def rooms(self) -> list[str]:
        """Code of the room of every capture."""
        return [self.building.room_at(x, y).code for x, y, _ in self.tour.poses]

    def picture(self, index: int) -> NDArray[np.uint8]:
        """Return the picture of a capture, shape (480, 640, 3), uint8 BGR."""
        x, y, yaw = (float(value) for value in self.tour.poses[index])
        people = bodies(self.people, index % self.captures_a_tour, (x, y))
        polar = render_polar(self.scene, (x, y, yaw), people)
        noise = named_generator(self.seed, f"noise-{self.day.name}", index)
        return photograph(polar, self.scene.light, noise, self._turned(index))

    def _turned(self, index: int) -> float:
        """Return by how much the robot turns from the capture before to this one, radians."""
        before, now = self.tour.poses[max(index - 1, 0), 2], self.tour.poses[index, 2]
        return float((now - before + np.pi) % (2.0 * np.pi) - np.pi)

    def jpeg(self, index: int) -> bytes:
        """Return the picture of a capture as the bytes of a JPEG file."""
        done, data = cv2.imencode(".jpeg", self.picture(index), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        if not done:
            raise DatasetError(f"cannot encode frame {index} of the synthetic sequence as JPEG")
        return data.tobytes()
