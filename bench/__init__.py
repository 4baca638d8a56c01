# SPDX-License-Identifier: Apache-2.0
"""Measures how well and how fast the package answers, beside the marks to reach: `python -m bench`."""
