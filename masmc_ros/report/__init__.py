# SPDX-License-Identifier: Apache-2.0
"""Metrics, tables and figures from logged runs; `report.write_report` makes all of them."""
