# SPDX-License-Identifier: Apache-2.0
"""One error type for bags, so that callers can tell a bad file from a bug."""

from __future__ import annotations


class BagError(ValueError):
    """A bag (or what is to become one) cannot be used; the text names the file and the cause."""
