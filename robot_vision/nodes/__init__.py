# SPDX-License-Identifier: Apache-2.0
"""One file a node: what it hears, the one library object it calls, what it says."""
