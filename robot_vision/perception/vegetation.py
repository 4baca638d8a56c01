# SPDX-License-Identifier: Apache-2.0
"""Where something grows in a picture: a weight for each pixel, or a mask of whole plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[Any]
Index = Literal["auto", "green", "infrared"]
INDICES: tuple[Index, ...] = ("auto", "green", "infrared")

#: Grey levels added to the sum of the channels, so that the noise of dark pixels is no colour.
_DARK = 30.0
#: Grey level below which colour is noise.
_BLACK = 16
#: The index is cut into so many levels for Otsu's threshold.
_LEVELS = 255.0


@dataclass(frozen=True)
class Vegetation:
    """How green, or how bright in the near infrared, each pixel is.

    Attributes:
        index: float32 (H, W), about 0 on soil and above it on plants.
        weight: float32 (H, W), how much each pixel speaks for a plant: the index in standard deviations about
            the local mean, from -1 up to a cap; 0 where the picture is all of one kind.
    """

    index: NDArray[np.float32]
    weight: NDArray[np.float32]


@dataclass(frozen=True)
class VegetationWeight:
    """Turns a picture into soft weights: no threshold, so that no leaf is lost to one.

    Args:
        index: `green` is the excess green of a colour picture, `infrared` its brightness, as of a camera behind a
            near-infrared filter; `auto` takes `infrared` for grey pictures only.
        blur: standard deviation of the blur before, px.
        window: width and height of the surroundings that are compared with, as shares of the picture's width.
        cap: greatest weight.
        floor: least standard deviation of the index that is vegetation and not noise.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    index: Index = "auto"
    blur: float = 0.6
    window: tuple[float, float] = (0.5, 0.016)
    cap: float = 4.0
    floor: float = 0.008

    def __post_init__(self) -> None:
        if self.index not in INDICES:
            raise ValueError(f"index must be one of {', '.join(INDICES)}, not {self.index!r}")
        if not 0.0 <= self.blur <= 20.0:
            raise ValueError(f"blur must lie in [0, 20] px, not {self.blur}")
        if not (np.isfinite(self.cap) and self.cap > 0.0 and np.isfinite(self.floor) and self.floor > 0.0):
            raise ValueError(f"cap and floor must be positive numbers, not {self.cap} and {self.floor}")

    def of(self, picture: Picture) -> Vegetation:
        """Weigh every pixel of a picture, uint8 (H, W, 3) BGR or (H, W).

        Raises:
            ValueError: the array is no such picture.
        """
        index = vegetation_index(picture, self.index, self.blur)
        width = index.shape[1]
        box = tuple(2 * int(0.5 * share * width) + 1 for share in self.window)
        mean = cv2.blur(index, box)
        square = cv2.sqrBoxFilter(index, cv2.CV_32F, box)
        spread = np.sqrt(np.maximum(square - mean * mean, 0.0)) + np.float32(self.floor)
        weight = np.clip((index - mean) / spread, -1.0, self.cap)
        return Vegetation(index, np.asarray(weight, np.float32))


def vegetation_index(picture: Picture, index: Index = "auto", blur: float = 0.0) -> NDArray[np.float32]:
    """Excess green (2 g - b - r) / (b + g + r) of a colour picture (Woebbecke et al. 1995), or the near infrared.

    Args:
        picture: uint8 (H, W, 3) BGR or (H, W).
        index: as for `VegetationWeight`.
        blur: standard deviation of the blur before, px.

    Returns:
        float32 (H, W); the near infrared in shares of full brightness.

    Raises:
        ValueError: the array is no such picture.
    """
    picture = np.asarray(picture)
    colour = picture.ndim == 3 and picture.shape[2] == 3
    if picture.dtype != np.uint8 or not (colour or picture.ndim == 2) or min(picture.shape[:2]) < 1:
        raise ValueError(
            f"expected a picture, uint8 (H, W, 3) or (H, W), not {picture.dtype} {picture.shape}"
        )
    if index == "green" and not colour:
        raise ValueError("index green needs a colour picture; a grey one may be taken as infrared")
    if blur > 0.2:
        picture = cv2.GaussianBlur(picture, (0, 0), blur)
    if not colour or index == "infrared":
        gray = picture if not colour else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        return np.asarray(gray, np.float32) / np.float32(255.0)
    from robot_vision.perception.crop_rows.kernels import excess_green

    return np.asarray(excess_green(np.ascontiguousarray(picture), np.float32(_DARK)))


@dataclass(frozen=True)
class VegetationMask:
    """Finds whole plants: hysteresis about Otsu's threshold, with a floor, so that bare soil gives nothing.

    What is above the upper threshold grows; what is above the lower one grows where it touches that (20.10).

    Args:
        index: as for `VegetationWeight`.
        blur: standard deviation of the blur before, px.
        lower, upper: thresholds, as shares of Otsu's.
        floor: least threshold: of the excess green of what grows; for the infrared that above the mean.
        least_area: smaller plants are left out, px.
        dilation: by how much plants are dilated, which fills their holes, px.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    index: Index = "auto"
    blur: float = 1.0
    lower: float = 0.7
    upper: float = 1.3
    floor: float = 0.05
    least_area: int = 6
    dilation: int = 0

    def __post_init__(self) -> None:
        if self.index not in INDICES:
            raise ValueError(f"index must be one of {', '.join(INDICES)}, not {self.index!r}")
        if not 0.0 < self.lower <= self.upper < 10.0:
            raise ValueError(
                f"lower and upper must satisfy 0 < lower <= upper, not {self.lower} and {self.upper}"
            )
        for name, most in (("blur", 20.0), ("floor", 1.0), ("least_area", 1e6), ("dilation", 50)):
            if not 0.0 <= getattr(self, name) <= most:
                raise ValueError(f"{name} must lie in [0, {most:g}], not {getattr(self, name)}")

    def of(self, picture: Picture) -> NDArray[np.bool_]:
        """Mask (H, W) of what grows in a picture, uint8 (H, W, 3) BGR or (H, W).

        Raises:
            ValueError: the array is no such picture.
        """
        levels = _index_levels(picture, self.index, self.blur)
        threshold, _ = cv2.threshold(levels, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        floor = self.floor * _LEVELS
        low = cv2.threshold(levels, max(self.lower * threshold, floor), 1, cv2.THRESH_BINARY)[1]
        count, labels, boxes, _ = cv2.connectedComponentsWithStats(low, connectivity=8, ltype=cv2.CV_32S)
        strong = np.zeros(count, bool)
        strong[np.unique(labels[levels > max(self.upper * threshold, floor)])] = True
        strong &= boxes[:, cv2.CC_STAT_AREA] >= self.least_area
        strong[0] = False
        mask = strong[labels]
        if self.dilation:
            side = 2 * self.dilation + 1
            kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
            return np.asarray(cv2.dilate(mask.view(np.uint8), kernel), np.bool_)
        return np.asarray(mask)


@dataclass(frozen=True)
class LeafMask:
    """Finds leaves with their true borders: where the index falls to a share of what it is on the leaf beside.

    A threshold for the whole picture makes small plants among large bright ones too small, or alone too large; the
    border of a blurred edge lies at half its height, whatever the height.

    Args:
        index: as for `VegetationWeight`.
        blur: standard deviation of the blur before, px.
        floor: least index of what grows; for the infrared that above the mean.
        share: of the greatest index nearby at which a leaf ends.
        around: side of the square that counts as nearby, px.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    index: Index = "auto"
    blur: float = 0.6
    floor: float = 0.05
    share: float = 0.5
    around: int = 11

    def __post_init__(self) -> None:
        if self.index not in INDICES:
            raise ValueError(f"index must be one of {', '.join(INDICES)}, not {self.index!r}")
        if not 0.0 < self.floor < 1.0:
            raise ValueError(f"floor must lie in (0, 1), not {self.floor}")
        if not 0.0 <= self.share < 1.0:
            raise ValueError(f"share must lie in [0, 1), not {self.share}")
        if not 1 <= self.around <= 99:
            raise ValueError(f"around must lie in [1, 99] px, not {self.around}")

    def by_colour(self, picture: Picture) -> bool:
        """Whether leaves of a picture are told by their colour."""
        return picture.ndim == 3 and self.index != "infrared"

    def of(self, picture: Picture) -> NDArray[np.bool_]:
        """Mask (H, W) of leaves in a picture, uint8 (H, W, 3) BGR or (H, W).

        Raises:
            ValueError: the array is no such picture.
        """
        levels = _index_levels(picture, self.index, self.blur)
        greatest = cv2.dilate(levels, np.ones((self.around, self.around), np.uint8))
        border = np.maximum(self.share * greatest, self.floor * _LEVELS)
        return np.asarray(levels > border)


def _index_levels(picture: Picture, kind: Index, blur: float) -> NDArray[np.uint8]:
    """Index of what grows (H, W) in grey levels, `_LEVELS` to one; 0 where nothing does."""
    index = vegetation_index(picture, kind, blur)
    infrared = picture.ndim == 2 or kind == "infrared"
    if infrared:
        # soil reflects the near infrared as well; what grows is brighter than the rest
        index = index - np.float32(index.mean(dtype=np.float64))
    levels = np.asarray(cv2.convertScaleAbs(np.maximum(index, 0.0), alpha=_LEVELS), np.uint8)
    if not infrared:
        # where all channels are dark, colour is noise
        levels[cv2.cvtColor(np.asarray(picture), cv2.COLOR_BGR2GRAY) < _BLACK] = 0
    return levels
