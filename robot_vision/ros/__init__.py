# SPDX-License-Identifier: Apache-2.0
"""The door between the library and ROS: messages, parameters, quality of service, diagnostics, processes."""
