# SPDX-License-Identifier: Apache-2.0
"""How each kind of topic travels, so that a busy robot steers by what is, not by a queue of what was.

Who hears keeps the newest message only, unless every one counts; who says keeps a few, so that one lost on
the way can be sent again.
"""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

#: Pictures: the newest one or none; what comes too fast is skipped and counted.
PICTURE = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
#: What comes with pictures from drivers that may promise no delivery, as calibration and odometry often do: who
#: asks for none hears both kinds. Odometry must come without a gap: half a second of it at 200 Hz.
SENSOR = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
ODOMETRY = QoSProfile(
    depth=100, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE
)
#: Answers heard on the way from picture to steering: only the newest may be acted on.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
#: Answers as they are said.
ANSWER = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
#: What must be heard without a gap.
EVERY = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
