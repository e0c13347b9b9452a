# SPDX-License-Identifier: Apache-2.0
"""What a parameter is: its declaration, its check, its documentation and its file."""
