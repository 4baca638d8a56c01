# SPDX-License-Identifier: Apache-2.0
"""Winding roads (20.7): where one vanishing point becomes a sequence that moves along the horizon."""
