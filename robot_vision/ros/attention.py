# SPDX-License-Identifier: Apache-2.0
"""Where to look in the next picture, as it travels: a sensor_msgs/RegionOfInterest to and from a region.

The message has no header, so nothing in it tells which picture it was made from. It is taken to belong to the newest
picture examined when it came, and holds for a short time from there, by the stamps of pictures. All zero
means the whole picture, as in sensor_msgs/CameraInfo.
"""

from __future__ import annotations

from sensor_msgs.msg import RegionOfInterest

from robot_vision.perception.region import Region


def region_to_message(region: Region | None) -> RegionOfInterest:
    """Build the message; None: the whole picture."""
    if region is None:
        return RegionOfInterest()
    return RegionOfInterest(
        x_offset=region.left, y_offset=region.top, width=region.width, height=region.height
    )


def region_from_message(message: RegionOfInterest) -> Region | None:
    """Read the message; None: the whole picture.

    Raises:
        ValueError: it has an offset or a width without a height, or the like.
    """
    if not (message.width or message.height or message.x_offset or message.y_offset):
        return None
    return Region(message.x_offset, message.y_offset, message.width, message.height)


class HeldRegion:
    """The newest region, as long as it holds."""

    def __init__(self) -> None:
        self._region: Region | None = None
        self._since_ns: int | None = None
        self._newest_ns: int | None = None
        self._size: tuple[int, int] | None = None

    def take(self, message: RegionOfInterest) -> None:
        """Take in a message; a bad one means the whole picture.

        Raises:
            ValueError: it is none; the text tells why.
        """
        self._region = None
        try:
            region = region_from_message(message)
        except ValueError as cause:
            raise ValueError(f"{cause}; the whole picture is searched") from cause
        self._region, self._since_ns = region, self._newest_ns

    def forget(self) -> None:
        """Look everywhere until another message comes."""
        self._region = self._newest_ns = self._since_ns = None

    def for_picture(self, stamp_ns: int, width: int, height: int, age_s: float) -> Region | None:
        """The region to search in a picture; None: everywhere.

        Args:
            stamp_ns: of the picture.
            width: of the picture, px.
            height: of the picture, px.
            age_s: how long a region holds, s.

        Raises:
            ValueError: it does not lie in the picture; it is forgotten.
        """
        since, self._newest_ns = self._since_ns, stamp_ns
        other_size = self._size not in (None, (width, height))
        self._size = (width, height)
        region = self._region
        if region is None:
            return None
        if other_size or since is None or not 0 < stamp_ns - since <= age_s * 1e9:
            self._region = None
            return None
        try:
            region.require_inside(width, height)
        except ValueError:
            self._region = None
            raise
        return region
