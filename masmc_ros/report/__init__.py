# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Results of logged runs: `report.write_report` for people, `export.write_export` for code."""
