# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logged runs for a viewer in a browser: files over HTTP, and meshes."""
