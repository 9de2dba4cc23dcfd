"""Cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Sequence

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera without distortion, and what the values of its images mean.

    The centre of the pixel at the top left is (0, 0). ``depth_scale`` is the number of raw depth units in a metre.
    ``response`` says how light becomes bytes: ``"srgb"``, ``"linear"``, or the linear light of every byte, 256 numbers.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    depth_scale: float = 5000.0
    response: str | Sequence[float] | NDArray[np.float32] = "srgb"

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The intrinsics as a 3 x 3 matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def resized(self, width: int, height: int) -> Camera:
        """The same view with other pixels."""
        x, y = width / self.width, height / self.height
        # The edges of the image are half a pixel outside of the centres of the outer pixels.
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * x,
            fy=self.fy * y,
            cx=(self.cx + 0.5) * x - 0.5,
            cy=(self.cy + 0.5) * y - 0.5,
        )
