# SPDX-License-Identifier: Apache-2.0
"""Compares the headings in a bag with the truth, and their errors with the covariances they claim."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field

import numpy as np

from robot_vision.bags.errors import BagError
from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.bags.reader import BagReader
from robot_vision.bags.schema import decode

UNKNOWN = 1e5  # a variance from here on says: this part is not known
_HEADING_TYPE = "geometry_msgs/msg/PoseWithCovarianceStamped"
_Y, _YAW = 7, 35  # places of the variances in the 6 x 6 covariance


@dataclass(frozen=True)
class Part:
    """One component (yaw in rad, offset in m) at one instant; None where it is not known."""

    value: float | None
    truth: float | None
    variance: float

    @property
    def error(self) -> float | None:
        """Answer minus truth."""
        return None if self.value is None or self.truth is None else self.value - self.truth

    @property
    def normalised(self) -> float | None:
        """Error squared over variance; its mean is 1 for an honest variance."""
        return None if self.error is None or self.variance <= 0 else self.error**2 / self.variance


@dataclass(frozen=True)
class FrameScore:
    """The answer for one picture."""

    stamp_ns: int
    yaw: Part
    offset: Part


@dataclass(frozen=True)
class ComponentScore:
    """One component over all pictures.

    Attributes:
        count: answers that were compared.
        unknown: answers that call this part unknown (or whose truth is), left out here.
        rms: root mean square error; nan if none was compared.
        worst: largest absolute error; nan if none.
        normalised: mean normalised error squared (NEES of one degree of freedom, 1 when honest); nan if none.
    """

    count: int
    unknown: int
    rms: float
    worst: float
    normalised: float


@dataclass(frozen=True)
class HeadingScore:
    """All answers against all truths.

    Attributes:
        truths: instants whose truth is known.
        answers: of these, how many got an answer.
        strays: answers whose stamp no truth has.
        yaw: rad.
        offset: m.
        frames: one entry an answer, in order of time.
    """

    truths: int
    answers: int
    strays: int
    yaw: ComponentScore
    offset: ComponentScore
    frames: tuple[FrameScore, ...] = field(repr=False)

    @property
    def missing(self) -> int:
        """Instants without an answer."""
        return self.truths - self.answers

    @property
    def yaw_rms_deg(self) -> float:
        """Root mean square error of the yaw in degrees, for people."""
        return math.degrees(self.yaw.rms)


def score_heading(
    output: str | os.PathLike[str],
    truth: str | os.PathLike[str] | None = None,
    topic: str = "/heading",
    truth_topic: str = "/truth/heading",
) -> HeadingScore:
    """Compare the headings of one bag with the truth of another (or the same) by header stamp.

    Args:
        output: the bag that holds the answers.
        truth: the bag that holds the truth; None: the same.
        topic: name of the answers, PoseWithCovarianceStamped.
        truth_topic: name of the truth, the same type.

    Raises:
        BagError: a bag or a topic is missing, or there is nothing to compare.
    """
    answers = _headings(output, topic)
    truths = _headings(output if truth is None else truth, truth_topic)
    if not truths:
        raise BagError(f"{truth or output} holds no message on {truth_topic} to compare with")
    frames = []
    for stamp in sorted(answers.keys() & truths.keys()):
        (yaw, yaw_variance), (offset, offset_variance) = answers[stamp]
        (true_yaw, _), (true_offset, _) = truths[stamp]
        if yaw is not None and true_yaw is not None:
            yaw = true_yaw + math.remainder(yaw - true_yaw, math.tau)
        frames.append(
            FrameScore(stamp, Part(yaw, true_yaw, yaw_variance), Part(offset, true_offset, offset_variance))
        )
    return HeadingScore(
        truths=len(truths),
        answers=len(frames),
        strays=len(answers.keys() - truths.keys()),
        yaw=_component([frame.yaw for frame in frames]),
        offset=_component([frame.offset for frame in frames]),
        frames=tuple(frames),
    )


_Known = tuple[float | None, float]


def _headings(path: str | os.PathLike[str], topic: str) -> dict[int, tuple[_Known, _Known]]:
    """Return (yaw, variance), (offset, variance) by stamp; the last one counts if a stamp stands twice."""
    bag = BagReader(path)
    found: dict[int, tuple[_Known, _Known]] = {}
    names = {name.lstrip("/") for name in bag.topics}
    if topic.lstrip("/") not in names:
        raise BagError(f"{bag.path} has no topic {topic}; it has {', '.join(bag.topics) or 'none'}")
    for message in bag.messages([topic]):
        if message.type_name != _HEADING_TYPE:
            raise BagError(f"{bag.path}: {topic} holds {message.type_name}, not {_HEADING_TYPE}")
        heading = decode(message.cdr, message.type_name)
        covariance = heading.pose.covariance
        found[stamp_ns(heading)] = (
            _known(yaw_of(heading.pose.pose.orientation), float(covariance[_YAW])),
            _known(heading.pose.pose.position.y, float(covariance[_Y])),
        )
    return found


def _known(value: float, variance: float) -> _Known:
    return (None if not variance < UNKNOWN or not math.isfinite(value) else value), variance


def _component(parts: list[Part]) -> ComponentScore:
    errors = np.array([part.error for part in parts if part.error is not None])
    normalised = [part.normalised for part in parts if part.normalised is not None]
    return ComponentScore(
        count=len(errors),
        unknown=len(parts) - len(errors),
        rms=float(np.sqrt(np.mean(errors**2))) if errors.size else math.nan,
        worst=float(np.abs(errors).max()) if errors.size else math.nan,
        normalised=float(np.mean(normalised)) if normalised else math.nan,
    )
