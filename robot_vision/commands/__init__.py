# SPDX-License-Identifier: Apache-2.0
"""What the commands of `robot-vision` do: each imports what it needs when it runs, and `cli.py` gives it its name."""
