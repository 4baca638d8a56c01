# SPDX-License-Identifier: Apache-2.0
"""Makes the benchmarks importable: they live beside the package and are not installed."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
