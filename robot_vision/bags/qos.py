# SPDX-License-Identifier: Apache-2.0
"""The quality of service a publisher offered, as rosbag2 keeps it beside each topic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

# up to ROS 2 Iron the policies stand as numbers
_BEST_EFFORT = ("best_effort", 2)
_TRANSIENT_LOCAL = ("transient_local", 1)
# rosbag2 writes "infinite" as the largest time its YAML carries
_FOREVER = "{sec: 9223372036, nsec: 854775807}"


@dataclass(frozen=True)
class OfferedQoS:
    """Reliability, durability and history depth of the publisher of a recorded topic."""

    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"
    depth: int = 10

    def to_yaml(self) -> str:
        """Return the text of `offered_qos_profiles` in the form ROS 2 Jazzy writes."""
        return (
            f"- history: keep_last\n  depth: {self.depth}\n  reliability: {self.reliability}\n"
            f"  durability: {self.durability}\n  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n"
            f"  liveliness: automatic\n  liveliness_lease_duration: {_FOREVER}\n"
            "  avoid_ros_namespace_conventions: false\n"
        )

    @classmethod
    def from_yaml(cls, text: str) -> OfferedQoS | None:
        """Read the first profile of `offered_qos_profiles` (names or numbers); None if there is none."""
        from ruamel.yaml import YAML
        from ruamel.yaml.error import YAMLError

        try:
            profiles: Any = YAML(typ="safe").load(text)
        except YAMLError:
            return None
        if not isinstance(profiles, list) or not profiles or not isinstance(profiles[0], dict):
            return None
        profile: dict[str, Any] = profiles[0]
        best_effort = profile.get("reliability") in _BEST_EFFORT
        transient = profile.get("durability") in _TRANSIENT_LOCAL
        depth = profile.get("depth")
        return cls(
            "best_effort" if best_effort else "reliable",
            "transient_local" if transient else "volatile",
            depth if isinstance(depth, int) and depth > 0 else cls.depth,
        )
