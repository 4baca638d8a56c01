# SPDX-License-Identifier: Apache-2.0
"""What geometry refuses: each error is built from field and reason, so that a person can mend it."""

from __future__ import annotations


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
