# SPDX-License-Identifier: Apache-2.0
"""What geometry refuses: each error is built from field and reason, so that a person can mend it."""

from __future__ import annotations

from collections.abc import Sequence


class CameraError(ValueError):
    """A camera that cannot be: `field` names what is wrong, `reason` why and, where known, what to try."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"camera {field}: {reason}")
        self.field = field
        self.reason = reason


class GroundPlaneError(ValueError):
    """A question to the ground plane that this camera cannot answer: `reason` says what is missing."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"ground plane: {reason}")
        self.reason = reason


class AboveHorizonError(GroundPlaneError):
    """Pixels at or above the vanishing line, where no ground can be seen: `indices` says which ones."""

    def __init__(self, indices: Sequence[int]) -> None:
        which = ", ".join(map(str, indices[:5])) + (", …" if len(indices) > 5 else "")
        super().__init__(
            f"no ground is seen at or above the horizon, where {len(indices)} of the pixels lie (index {which}); "
            "leave them out, or check the camera's pitch and roll"
        )
        self.indices = tuple(indices)


class CrossRatioError(ValueError):
    """Spacings along a line that name no vanishing point: `reason` says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"cross ratio: {reason}")
        self.reason = reason


class ConicError(ValueError):
    """A conic that is not the picture of a whole circle, or has no centre to tell: `reason` says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"conic: {reason}")
        self.reason = reason
