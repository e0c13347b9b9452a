# SPDX-License-Identifier: Apache-2.0
"""What logged runs say: `report.write_report` for people, `export.write_export` for programs."""
