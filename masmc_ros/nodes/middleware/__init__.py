# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings of the middleware, and workarounds for its limitations.

Each workaround is one function, class or file. Its docstring states the upstream issue and the
condition for its removal; docs/development/architecture.md lists them.
"""
