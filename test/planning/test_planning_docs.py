# SPDX-License-Identifier: Apache-2.0
"""The example of the documentation runs as it stands, and makes the pictures it promises."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "planning" / "README.md"


def test_the_example_runs_and_makes_its_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = PAGE.read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, str(PAGE), "exec"), {"__name__": "example"})
    assert "+---+" in capsys.readouterr().out
    # What lies beside the page is made by its example; docs/maze_camera.png is made by a drive of minutes.
    for picture in re.findall(r"!\[[^\]]*\]\(([^/)]+)\)", text):
        made = cv2.imread(str(tmp_path / picture))
        assert np.array_equal(made, cv2.imread(str(PAGE.parent / picture)))
