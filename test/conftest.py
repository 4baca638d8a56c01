# SPDX-License-Identifier: Apache-2.0
"""Every test that touches ROS does so in a domain of its own, on this machine only, with checked messages."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from robot_vision.places import shared_file

# Read once, when the message classes and the middleware are loaded: before any test module.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(shared_file("config/transport.xml"))

# How fast a busy machine is says nothing of the code. In CI every run draws the same examples, so that a change is
# judged by what it changes; elsewhere each run looks at new ones.
settings.register_profile(
    "any machine",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=bool(os.environ.get("CI")),
)
settings.load_profile("any machine")


@pytest.fixture(scope="module")
def ros_domain() -> Iterator[int]:
    """A ROS_DOMAIN_ID nobody else has, set for this module and the processes it starts."""
    from robot_vision.ros.domains import FreeDomain

    before = os.environ.get("ROS_DOMAIN_ID")
    with FreeDomain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain.id)
        yield domain.id
    if before is None:
        del os.environ["ROS_DOMAIN_ID"]
    else:
        os.environ["ROS_DOMAIN_ID"] = before
