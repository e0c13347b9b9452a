# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings of the middleware, and workarounds for its limitations.

Each workaround is one file. Its docstring states the upstream issue and the condition for its
removal: `transport.py`, `latched.py`, `past.py`, `raw_types.py`, `clock.py`, `logging.py`, and
`exit_timer.py` in `nodes/process/`.
"""
